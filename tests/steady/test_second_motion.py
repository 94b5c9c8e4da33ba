# SPDX-License-Identifier: GPL-3.0-or-later
"""Operating points with two stable motions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.motor.drive import Load
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.period_map import PeriodMap

DECAYS = 10.0  # decay times of the slowest mode in a run: e^-10 of the beginning is left, 5e-5
COARSE = 0.01  # of a force, the error of the step at which the second motion is solved


def worn() -> tuple[pr.Motor, pr.TwoPhaseDrive, float]:
    """Return a worn tip on a beam, whose contact stays closed or opens."""
    motor = pr.load_motor("beam40")
    drive = pr.default_drive(motor).updated({"voltage": 110.0})
    return motor.updated({"contact.worn_flat_radius_m": 6e-5}), drive, 10.0


def hammering() -> tuple[pr.Motor, pr.TwoPhaseDrive, float]:
    """Return a stator at a fixed distance that stays in contact, or hammers with twice the mean normal force."""
    motor = pr.load_motor("andersen2002").updated({"mount": None})
    return motor, pr.TwoPhaseDrive(voltage=30.0, frequency=16.89e3, phase_deg=90.0), 3.0


@pytest.mark.parametrize("point", [worn, pytest.param(hammering, marks=pytest.mark.soak)])
def test_a_point_with_two_stable_motions_says_so(point: Callable[[], tuple[pr.Motor, pr.TwoPhaseDrive, float]]) -> None:
    """The run from rest ends in the one that Newton's method does not find."""
    motor, drive, speed = point()
    state = pr.steady_state(motor, drive, speed=speed)
    plant = Plant(motor, drive, Load(speed), PAPER_LAW)
    start = np.zeros(plant.order)
    for place, mode in enumerate(motor.modes):
        start[place] = -mode.tip_y * motor.contact.preload_n / mode.stiffness_n_per_m
    slowest = max(2.0 * mode.mass_kg / mode.damping_n_s_per_m for mode in motor.modes)
    (trace,) = PeriodMap(drive.period, round(drive.period / state.step_s)).traces(
        [Copy(plant, start)], round(DECAYS * slowest / drive.period)
    )
    assert trace is not None
    assert state.stable
    assert state.second is not None
    assert state.second.trace is not None
    scale = np.array([1.0, motor.contact.friction]) * motor.contact.preload_n
    found = state.second.trace.forces
    assert np.abs(found - trace.forces).max() < COARSE * max(found[0], scale[0])
    assert np.abs(found - [state.normal_force_n, state.torque_n_m / motor.rotor.radius_m]).max() > 0.1 * scale[1]
    assert any(
        "A second motion is stable" in told and f"{1e3 * motor.rotor.radius_m * found[1]:.4g}" in told
        for told in state.cautions
    )


def test_a_point_with_one_motion_has_no_second() -> None:
    """The flagship's run from above and from rest end in the same motion."""
    motor = pr.load_motor("bimodal40")
    state = pr.steady_state(motor, pr.default_drive(motor), speed=20.0)
    assert state.separated > 0.3
    assert state.second is None
    assert not any("second motion" in told for told in state.cautions)
