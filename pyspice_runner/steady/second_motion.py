# SPDX-License-Identifier: GPL-3.0-or-later
"""A second stable motion of an operating point, where harmonic balance leads to one."""

from __future__ import annotations

import numpy as np

from pyspice_runner.steady.harmonic_balance import start_from_above
from pyspice_runner.steady.monodromy import differentiable
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.shooting import NEAR, Array, Point, Shooting, start_point
from pyspice_runner.units import engineering


def second_motion(point: Point, period_map: PeriodMap) -> Point | None:
    """Return a stable motion other than that of a solved point on the map, whose period begins at t = 0.

    The search is not complete: harmonic balance from above leads to one motion.
    """
    plant = point.plant
    moving = slice(2 * plant.modes)  # displacements and velocities

    def same(state: Array) -> bool:
        return bool((np.abs(state - point.state)[moving] <= NEAR * point.scale[moving]).all())

    start = start_from_above(plant)
    if start is None or same(start):
        return None
    other = start_point(plant)
    other.restart(start)
    other.informed = differentiable(plant)
    shooting = Shooting([other], period_map)
    shooting.solve()
    shooting.measure_anew()
    if not other.done or same(other.state) or np.abs(other.multipliers).max(initial=0.0) >= 1.0:
        return None
    return other


def caution(second: Point) -> str:
    """Return the sentence of a result beside which there is a second motion."""
    assert second.trace is not None
    plant, (normal, friction) = second.plant, second.trace.forces.tolist()
    torque = engineering(plant.motor.rotor.radius_m * friction, "N·m")
    what = f"a speed of {engineering(float(second.state[-1]), 'rad/s')}" if plant.turns else f"a torque of {torque}"
    return (
        f"A second motion is stable, with {what} and a normal force of {engineering(normal, 'N')}. "
        "The start of the motor decides between the two: simulate shows where it leads."
    )
