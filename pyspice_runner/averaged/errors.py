# SPDX-License-Identifier: GPL-3.0-or-later
r"""Errors of an averaged run against the full motor at the same commands, estimated from a few of its steady states.

At some operating points of the run both motors are held at the speed, drive, preload and temperature there, and differ
by :math:`\Delta T` in torque. The free shaft of the full motor, which swings within a period, has another speed under
the same load, by :math:`\Delta\omega`. Over time the error :math:`\delta` of the speed follows

.. math::
    J\,\dot\delta = D\,(\Delta\omega - \delta), \qquad \delta(0) = 0, \qquad
    D = b - \frac{\partial T}{\partial\omega},

with :math:`\Delta T` in place of :math:`D\,\Delta\omega` where there is no such speed. It changes currents and power by
their slopes versus the speed. Two parts are added, in quadrature: the difference from the same run with more phases of
the contact, which are too few where it opens or slips briefly; and the change in half a period, which no average
resolves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp, expm1, inf, nan, sqrt
from typing import NamedTuple

import numpy as np

from pyspice_runner.averaged.library import MOST_PHASES
from pyspice_runner.averaged.point import AveragedPoint
from pyspice_runner.averaged.run import Array, ErrorEstimate
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.drive import Load, ideal_drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import SteadyState, check_runs, steady_states
from pyspice_runner.units import linear_name

POINTS = 7  # operating points along a run
DECAYS = 8.0  # decay times of the slowest mode, after which a held motor is settled
# Factor on the estimate. It was chosen by 37 transients of two motors, in which the estimate without it is at least
# 0.56 of the true error; validation/trust.py has these and others.
MARGIN = 2.0
# Share of the period in slip or open. Below it the contact sticks nearly throughout: the shaft of the full motor then
# swings on the stiffness of the contact for seconds, and a held shaft has any torque up to the friction torque.
HARDLY = 0.1
ASIDE = 0.02  # of the maximum speed: between the two speeds of a slope
FINER = 4  # times as many phases, in the run for comparison
MEANS = 20.0  # periods over which a mean is taken that is compared
NEAR = 5.0  # times :data:`ASIDE`, beyond which the speed of the full motor is that of another motion
COLUMN = {  # of a record → name of its error
    "torque": "torque_n_m", "speed": "rotor_speed_rad_s", "current_amplitude_a": "current_amplitude_a_a",
    "current_amplitude_b": "current_amplitude_b_a", "electrical_power": "electrical_power_w",
}  # fmt: skip
COMPARED = ("torque", "current_amplitude_a", "current_amplitude_b", "electrical_power")
CHANGES = ("speed", "frequency", "amplitude_a", "amplitude_b", "phase")


class Comparison(NamedTuple):
    """Both motors at operating points of a run, one column a point, :data:`COMPARED` in the rows."""

    time: list[float]  # s
    difference: Array  # averaged less full motor
    slope: Array  # of the averaged motor versus the speed, 0 of a held shaft
    torque_error: list[float]  # of the steady states of the full motor, N·m
    forcing: Array  # torque that makes the error of the speed, N·m

    def over(self, time: Array) -> list[Array]:
        """Return difference, slope, torque_error and forcing at times in s."""
        return [
            np.apply_along_axis(lambda row: np.interp(time, self.time, row), -1, np.asarray(one)) for one in self[1:]
        ]


def estimate(run: AveragedPoint, duration: float, *, steady: bool = False) -> ErrorEstimate:
    """Estimate the errors of a run of a duration in s, from rest or from the steady state at its start.

    It takes about 1.5 s of CPU time plus five times the CPU time of the run.
    """
    motor, contact = run.point.motor, run.point.motor.contact
    try:
        rows = run.recorded(duration, steady=steady)
        at = compare(run, rows)
        more = min(FINER * run.phases, MOST_PHASES)
        finer = replace(run, phases=more).recorded(duration, steady=steady)
    except (ParameterError, SimulationError) as error:
        return ErrorEstimate({}, {}, str(error))
    parts = _parts(rows, finer, at, motor, free=run.point.load.speed is None)
    errors = {name: MARGIN * sqrt(sum(_mean_square(rows["time"], part) for part in parts[name])) for name in parts}
    most = {name: float(np.abs(_means(rows, name)).max()) or inf for name in parts}
    most["torque"] = contact.friction * contact.preload_n * motor.rotor.radius_m
    names = {name: (motor.slider and linear_name(COLUMN[name])) or COLUMN[name] for name in parts}
    shares = {names[name]: error / most[name] for name, error in errors.items()}
    return ErrorEstimate({names[name]: error for name, error in errors.items()}, shares)


def _parts(
    rows: Mapping[str, Array], finer: Mapping[str, Array], at: Comparison, motor: Motor, *, free: bool
) -> dict[str, list[Array]]:
    """Return the parts of each error over time, which are independent of each other."""
    time, wait = rows["time"], 0.5 * MEANS / rows["frequency"]
    static, slope, found, forcing = at.over(time)
    parts = {}
    for name in COLUMN:
        shift = (np.interp(time + wait, time, rows[name]) - np.interp(time - wait, time, rows[name])) / (2.0 * MEANS)
        parts[name] = [shift, np.interp(time, finer["time"], _means(finer, name)) - _means(rows, name)]
    damping = motor.rotor.bearing_damping_n_m_s - slope[0]
    late, uncertain, shifted = (
        free * _speed_error(time, torque, damping, motor) for torque in (forcing, found, parts["torque"][0])
    )
    for row, name in enumerate(COMPARED):
        parts[name].append(static[row] + slope[row] * late)
    parts["torque"] = [np.abs(static[0]) + found]
    parts["speed"] = [np.abs(late) + uncertain, shifted, parts["speed"][1]]
    return parts if free else {name: parts[name] for name in COMPARED}


def compare(run: AveragedPoint, rows: Mapping[str, Array]) -> Comparison:
    """Compare both motors at operating points of a run with these records.

    Raise SimulationError where they cannot be compared.
    """
    step = 0.0 if run.point.load.speed is not None else max(ASIDE * float(np.abs(rows["speed"]).max()), 1e-9)
    chosen = _rows(rows)
    if not chosen:
        raise SimulationError("There is no drive, so that there is nothing to compare.")
    sticks = SimulationError("Friction holds the shaft, which swings on the contact in the full motor.")
    if step and (rows["slip"] + rows["separated"]).max() < HARDLY:
        raise sticks
    points, places, averaged, slopes = [], [], [], []
    for row in chosen:
        point = operating_point(run, {name: float(values[row]) for name, values in rows.items()})
        here = settled_at(run, point)
        if step and here["slip"] + here["separated"] < HARDLY:
            raise sticks
        aside = settled_at(run, point, step) if step else here
        points.append(point)
        places.append(float(rows["time"][row]))
        averaged.append([here[name] for name in COMPARED])
        slopes.append([(aside[name] - here[name]) / (step or 1.0) for name in COMPARED])
    states = steady_states(points, averages=False)
    check_runs(states)
    for state in states:
        if not state.stable:
            largest = np.abs(state.floquet_multipliers).max(initial=0.0)
            how = f"is unstable ({state.instability}, multiplier {largest:.5g})" if state.converged else "was not found"
            raise SimulationError(
                f"The periodic motion that the averaged model describes {how} in the full motor at {state.drive.label} "
                f"and {state.speed_rad_s:.4g} rad/s. Use speed_torque or simulate for the time averages."
            )
    if not all(state.determined for state in states):
        raise sticks
    difference, slope = (np.array(averaged) - [values_of(state) for state in states]).T, np.transpose(slopes)
    forcing = difference[0].copy()
    if step:
        damping = run.point.motor.rotor.bearing_damping_n_m_s - slope[0]
        settles = damping > run.point.motor.rotor.inertia_kg_m2 / rows["time"][-1]
        away = _free_speeds(points, [torque for torque, *_ in averaged], settles)
        near = np.abs(away) < NEAR * step
        forcing[near] = (damping * away)[near]
    return Comparison(places, difference, slope, [state.torque_error_n_m for state in states], forcing)


def _free_speeds(points: Sequence[Point], torques: Sequence[float], settles: Array) -> Array:
    """Return held speeds minus the speeds of the full motor with a free shaft that torques in N·m load.

    NaN where there is no such state, or the shaft does not settle in the run.
    """
    away, rotor = np.full(len(points), nan), points[0].motor.rotor
    places = np.flatnonzero(settles).tolist()
    if rotor.bearing_friction_n_m or not places:  # with dry friction there is no state of a free shaft
        return away
    speeds = np.array([points[place].load.speed for place in places])
    loads = [torques[place] - rotor.bearing_damping_n_m_s * speed for place, speed in zip(places, speeds, strict=True)]
    turning = [replace(points[place], load=Load(None, load)) for place, load in zip(places, loads, strict=True)]
    away[places] = speeds - [
        state.speed_rad_s if state.stable else nan for state in steady_states(turning, averages=False)
    ]
    return away


def _rows(rows: Mapping[str, Array]) -> list[int]:
    """Return the rows with a drive at equal shares of time and of all changes in a run, the last one at its end.

    Of rows at the same operating point there is the last one only.
    """
    passed = rows["time"] / rows["time"][-1]
    for name in CHANGES:
        moved = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(rows[name])))])
        passed = passed + moved / (moved[-1] or 1.0)
    places = np.searchsorted(passed, passed[-1] * (np.arange(POINTS) + 1.0) / POINTS).clip(max=len(passed) - 1).tolist()
    same = (*CHANGES, "preload", "temperature")
    return [
        *{
            tuple(float(rows[name][row]) for name in same): row
            for row in places
            if rows["amplitude_a"][row] + rows["amplitude_b"][row] > 0.0
        }.values()
    ]


def operating_point(run: AveragedPoint, there: Mapping[str, float]) -> Point:
    """Return the operating point of the full motor, held at the speed of the run, for values of the records."""
    motor, thermal = run.point.motor, run.point.thermal
    if thermal is not None:
        motor = thermal.warmed(motor, there["temperature"])
    motor = motor.updated({"contact.preload_n": there["preload"]})
    drive = ideal_drive(there["amplitude_a"], there["amplitude_b"], there["phase"], there["frequency"])
    timeout = run.point.solver.timeout
    return Point.of(motor, drive, speed=there["speed"], contact=run.point.law, audit=False, timeout=timeout)


def settled_at(run: AveragedPoint, point: Point, aside: float = 0.0) -> dict[str, float]:
    """Return the settled values of the averaged motor at a point, held at a speed that differs by so many rad/s."""
    assert point.load.speed is not None
    duration = DECAYS * point.motor.decay_s
    held = replace(point, load=Load(point.load.speed + aside))
    at = AveragedPoint.of(held, duration, phases=run.phases, harmonics=run.harmonics)
    return {name: float(values[-1]) for name, values in at.recorded(duration).items()}


def values_of(state: SteadyState) -> list[float]:
    """Return :data:`COMPARED` of the full motor."""
    currents = sqrt(2.0) * state.current_a_rms_a, sqrt(2.0) * state.current_b_rms_a
    return [state.torque_n_m, *currents, state.power_a_w + state.power_b_w]


def _speed_error(time: Array, torque: Array, damping: Array, motor: Motor) -> Array:
    """Return the speed in rad/s that an error of the torque in N·m makes, against a damping in N·m·s, over time."""
    found = np.zeros(len(time))
    for row, step in enumerate(np.diff(time)):
        rate = damping[row] / motor.rotor.inertia_kg_m2
        grown = -expm1(-rate * step) / rate if rate else step
        found[row + 1] = found[row] * exp(-rate * step) + torque[row] / motor.rotor.inertia_kg_m2 * grown
    return found


def _means(rows: Mapping[str, Array], name: str) -> Array:
    """Return the means over :data:`MEANS` periods, which have no peaks of current at steps of the voltage."""
    time, values, wait = rows["time"], rows[name], 0.5 * MEANS / rows["frequency"]
    total = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
    begin, end = (time - wait).clip(min=0.0), (time + wait).clip(max=time[-1])
    return np.asarray((np.interp(end, time, total) - np.interp(begin, time, total)) / (end - begin))


def _mean_square(time: Array, values: Array) -> float:
    return float(np.trapezoid(values**2, time) / (time[-1] - time[0]))
