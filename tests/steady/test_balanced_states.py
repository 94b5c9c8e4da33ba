# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantities and their derivatives by harmonic balance, against steady states by ngspice."""

import numpy as np

import pyspice_runner as pr
from pyspice_runner.run.point import Point
from pyspice_runner.steady.harmonic_balance import QUANTITIES, balanced_states, balances
from pyspice_runner.steady.steady import steady_states
from validation import calibration as study

SET = "andersen2002-unintended-mode"


def points(changes: dict[str, float]) -> list[Point]:
    motor = pr.load_motor(SET).updated({"contact.restitution": 0.8, **changes})
    return [Point.of(motor, pr.default_drive(motor), speed=speed, audit=False) for speed in (2.0, 12.0)]


def values(changes: dict[str, float], *, fast: bool) -> np.ndarray:
    """Values of the points: a row for each."""
    some = points(changes)
    if fast:
        rows = [state.values for state in balanced_states(some, [None] * len(some)) if state]
    else:
        rows = [{name: getattr(state, name) for name in QUANTITIES} for state in steady_states(some)]
    return np.array([[row[name] for name in QUANTITIES] for row in rows])


def test_harmonic_balance_gives_forces_currents_and_their_changes_with_a_parameter() -> None:
    assert all(balances(point) for point in points({}))
    slow, fast = values({}, fast=False), values({}, fast=True)
    # of a phase a radian: a change of the current by a share of it turns it by as many radians
    turns = np.array([name.endswith("_deg") for name in QUANTITIES])
    size = np.where(turns, np.degrees(1.0), np.abs(slow).max(axis=0))
    # Seven harmonics of a force that is open for a part of the period leave less than 1 % of the motion, see
    # test_harmonic_balance. The mean friction follows from the motion with a slope of order one.
    assert np.all(np.abs(fast - slow) < 0.01 * size)
    step = 0.05
    for path, value in (("contact.friction", 0.3), ("contact.preload_n", 5.0)):
        changes = {path: value * (1.0 + step)}
        rise = values(changes, fast=True) - fast, values(changes, fast=False) - slow
        # a steady state is accurate to 2e-3 of the friction torque, and a difference of two to twice that
        assert np.all(np.abs(rise[0] - rise[1]) < 4e-3 * size), path


def test_values_of_a_tip_that_opens_in_each_period_are_smooth_in_a_parameter() -> None:
    # Without the moment of touching between two phases the torque rises in steps, as it goes from phase to phase.
    motor = study.base()
    drive = pr.default_drive(motor).updated({"voltage": 100.0})
    frictions = 0.3 * (1.0 + np.linspace(-0.05, 0.05, 9))
    some = [
        Point.of(motor.updated({"contact.friction": friction}), drive, speed=12.0, audit=False)
        for friction in frictions
    ]
    torques = np.array([state.values["torque_n_m"] for state in balanced_states(some, [None] * 9) if state])
    (slow,) = steady_states(some[4:5], accuracy=2e-4)
    assert slow.separated > 0.3
    grip = motor.rotor.radius_m * 0.3 * motor.contact.preload_n
    # phases of 1/64 period: an error of second order, 1e-2, of what the contact does while it opens or closes
    assert abs(torques[4] - slow.torque_n_m) < 5e-3 * grip
    bend = np.diff(torques, 2)
    slope = np.diff(torques).mean()
    # a parabola through the curve of a smooth function: its third difference is a small part of the first one
    assert np.all(np.abs(np.diff(bend)) < 0.05 * abs(slope))
