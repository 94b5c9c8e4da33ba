# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantities and their derivatives by harmonic balance, against steady states by ngspice."""

from __future__ import annotations

import numpy as np

import pyspice_runner as pr
from pyspice_runner.analysis.balanced import QUANTITIES, balanced_states, balances
from pyspice_runner.analysis.steady import steady_states
from pyspice_runner.run.operating_point import OperatingPoint

SET = "andersen2002-unintended-mode"


def points(changes: dict[str, float]) -> list[OperatingPoint]:
    motor = pr.load_motor(SET).updated({"contact.restitution": 0.8, **changes})
    return [OperatingPoint.of(motor, pr.default_drive(motor), speed=speed, audit=False) for speed in (2.0, 12.0)]


def values(changes: dict[str, float], *, fast: bool) -> np.ndarray:
    """Values of the points: a row for each."""
    some = points(changes)
    if fast:
        rows = [state.values for state in balanced_states(some, [None] * len(some)) if state]
    else:
        rows = [{**state.quantities, "speed_rad_s": state.speed_rad_s} for state in steady_states(some)]
    return np.array([[row[name] for name in QUANTITIES] for row in rows])


def test_harmonic_balance_gives_forces_currents_and_their_changes_with_a_parameter() -> None:
    assert all(balances(point) for point in points({}))
    slow, fast = values({}, fast=False), values({}, fast=True)
    size = np.abs(slow).max(axis=0)
    # Seven harmonics of a force that is open for a part of the period leave less than 1 % of the motion, see
    # test_harmonic_balance. The mean friction follows from the motion with a slope of order one.
    assert np.all(np.abs(fast - slow) < 0.01 * size)
    step = 0.05
    for path, value in (("contact.friction", 0.3), ("contact.preload_n", 5.0)):
        changes = {path: value * (1.0 + step)}
        rise = values(changes, fast=True) - fast, values(changes, fast=False) - slow
        # a steady state is accurate to 2e-3 of the friction torque, and a difference of two to twice that
        assert np.all(np.abs(rise[0] - rise[1]) < 4e-3 * size), path
