# SPDX-License-Identifier: GPL-3.0-or-later
r"""Errors of an averaged run, estimated from steady states of the full motor at operating points along it.

At each point both motors are held at the speed, drive, preload and temperature of the run there. Their torques differ
by :math:`\Delta T`. Averages over a period :math:`\tau` shift changes by half of it. On a free shaft both make the
error :math:`\delta` of the speed,

.. math::
    J\,\dot\delta = |\Delta T| + \frac{\tau}{2} \dot T - \left(b - \frac{\partial T}{\partial\omega}\right)\delta,
    \qquad \delta(0) = 0 ,

which changes currents and power by their slopes versus the speed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import exp, expm1, sqrt

import numpy as np

from pyspice_runner.averaged.point import AveragedPoint
from pyspice_runner.averaged.run import Array, ErrorEstimate
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.drive import ideal_drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import SteadyState, check_runs, steady_states

POINTS = 7  # operating points along a run
MARGIN, MARGIN_OF_SPEED = 2.2, 3.2  # by which errors are enlarged; validation/trust.py has none below the true one
HARDLY = 0.1  # share of the period in slip or open, below which the shaft swings on the contact for long
ASIDE = 0.02  # of the maximum speed: between the two speeds of a slope
SPEED, TORQUE = "rotor_speed_rad_s", "torque_n_m"
QUANTITIES = (TORQUE, "current_amplitude_a_a", "current_amplitude_b_a", "electrical_power_w")
CHANGES = (SPEED, "frequency_hz", "amplitude_a_v", "amplitude_b_v", "phase_deg")


def estimate(
    run: AveragedPoint,
    curves: Mapping[str, Array],
    settled_at: Callable[[AveragedPoint, Point, float], Mapping[str, float]],
    timeout: float | None = None,
) -> ErrorEstimate:
    """Estimate the errors of a run with the curves of :data:`.COLUMNS`.

    ``settled_at`` returns the settled values of the averaged motor at a point, held at a speed aside by some rad/s.
    """
    time, free, motor = curves["time_s"], run.point.load.speed is None, run.point.motor
    step = max(ASIDE * float(np.abs(curves[SPEED]).max()), 1e-9) if free else 0.0
    points, places, averaged, slopes = [], [], [], []
    try:
        rows = _rows(curves)
        for row in rows:
            point = operating_point(run, {name: float(values[row]) for name, values in curves.items()}, timeout)
            here = settled_at(run, point, 0.0)
            aside = settled_at(run, point, step) if free else here
            if here["slip"] + here["separated"] >= HARDLY:
                points.append(point)
                places.append(time[row])
                averaged.append([here[name] for name in QUANTITIES])
                slopes.append([(aside[name] - here[name]) / (step or 1.0) for name in QUANTITIES])
        states = steady_states(points)
        check_runs(states)
    except (ParameterError, SimulationError) as error:
        return ErrorEstimate({}, {}, str(error))
    for point, state in zip(points, states, strict=True):
        if not state.stable:
            reason = f"is unstable ({state.instability})" if state.converged else "was not found"
            at = f"{point.drive.label} and {point.load.speed:.4g} rad/s"
            return ErrorEstimate({}, {}, f"The steady state of the full motor at {at} {reason}.")
    if rows and not points:
        return ErrorEstimate({}, {}, "Friction holds the shaft, which swings on the contact in the full motor.")
    static = slope = np.zeros((len(QUANTITIES), len(time)))
    if points:
        found = np.abs(np.array(averaged) - [values_of(state) for state in states])
        found[:, 0] += [state.torque_error_n_m for state in states]
        static, slope = (
            np.array([np.interp(time, places, values) for values in np.transpose(table)]) for table in (found, slopes)
        )
    later = time + 1.0 / curves["frequency_hz"]
    shift = np.array([0.5 * (np.interp(later, time, curves[name]) - curves[name]) for name in QUANTITIES])
    damping = motor.rotor.bearing_damping_n_m_s - slope[0]
    late = free * sum(np.abs(_speed_error(time, torque, damping, motor)) for torque in (static[0], shift[0]))
    over_time = dict(zip(QUANTITIES, static + np.abs(shift) + np.abs(slope) * late, strict=True))
    over_time |= {TORQUE: static[0], SPEED: late}
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    margins = dict.fromkeys(over_time, MARGIN) | {SPEED: MARGIN_OF_SPEED}
    errors = {name: margins[name] * _rms(time, values) for name, values in over_time.items()}
    most = {name: limit if name == TORQUE else float(np.abs(curves[name]).max()) for name in errors}
    return ErrorEstimate(errors, {name: error / most[name] if most[name] else 0.0 for name, error in errors.items()})


def _rows(curves: Mapping[str, Array]) -> list[int]:
    """Return the rows with a drive at equal shares of time and of all changes in a run, the last one at its end."""
    passed = curves["time_s"] / curves["time_s"][-1]
    for name in CHANGES:
        moved = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(curves[name])))])
        passed = passed + moved / (moved[-1] or 1.0)
    rows = np.unique(np.searchsorted(passed, passed[-1] * (np.arange(POINTS) + 1.0) / POINTS).clip(max=len(passed) - 1))
    return [int(row) for row in rows if curves["amplitude_a_v"][row] + curves["amplitude_b_v"][row] > 0.0]


def operating_point(run: AveragedPoint, there: Mapping[str, float], timeout: float | None = None) -> Point:
    """Return the operating point of the full motor, held at the speed of the run, for values of the curves."""
    motor, thermal = run.point.motor, run.point.thermal
    if thermal is not None:
        motor = thermal.warmed(motor, there["temperature_k"])
    if "preload" in run.settings:
        preload = float(np.interp(there["time_s"], *np.transpose(run.settings["preload"])))
        motor = motor.updated({"contact.preload_n": preload})
    drive = ideal_drive(there["amplitude_a_v"], there["amplitude_b_v"], there["phase_deg"], there["frequency_hz"])
    return Point.of(motor, drive, speed=there[SPEED], contact=run.point.law, audit=False, timeout=timeout)


def values_of(state: SteadyState) -> list[float]:
    """Return :data:`QUANTITIES` of the full motor."""
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


def _rms(time: Array, values: Array) -> float:
    return sqrt(float(np.trapezoid(values**2, time) / (time[-1] - time[0])))
