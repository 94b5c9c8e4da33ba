# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of held shafts at random drives against runs that settle from rest: a determined torque is the settled one."""

from __future__ import annotations

from random import Random

import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import LAWS


def differing(seed: int, points: int) -> list[str]:
    """Return a line for each determined torque from which a settled run is away, of points at random drives."""
    random, found = Random(seed), []
    for number in range(points):
        motor = pr.load_motor(random.choice(["andersen2002", "bimodal40"]))
        nominal, law = pr.default_drive(motor), random.choice(list(LAWS))
        drive = pr.TwoPhaseDrive(
            voltage=2.0 * (nominal.voltage / 2.0) ** random.random(),
            frequency=nominal.frequency * random.uniform(0.99, 1.01),
            phase_deg=random.choice([60.0, 90.0, 120.0, -90.0]),
        )
        state = pr.steady_state(motor, drive, speed=0.0, contact=law)
        if not state.determined:
            continue
        settled = float(pr.speed_torque(motor, drive, speeds=[0.0], mode="settle", contact=law)["torque_n_m"].item())
        limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        # a settled block repeats the one before to 1e-3 of the friction torque
        if abs(state.torque_n_m - settled) > max(3.0 * state.torque_error_n_m, 5e-3 * limit):
            found.append(f"{number}: {motor.name} {law} {drive.label} {state.torque_n_m:g} {settled:g} N·m")
    return found


@pytest.mark.parametrize(("seed", "points"), [(3, 2), (4, 2), pytest.param(1, 200, marks=pytest.mark.soak)])
def test_a_determined_torque_of_a_held_shaft_is_that_of_a_run_that_settles_from_rest(seed: int, points: int) -> None:
    assert not differing(seed, points)
