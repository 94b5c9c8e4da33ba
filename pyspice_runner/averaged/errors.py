# SPDX-License-Identifier: GPL-3.0-or-later
r"""Errors of an averaged run against the full motor at the same commands, estimated from a few of its steady states.

An error has three parts. They may have the same sign, so their magnitudes are added:

1. Discretisation: the difference from the same run with N times as many phases and with more harmonics. The errors of
   the contact fall in proportion to the number of phases or faster, so the remaining error has the upper bound
   :math:`1/(N - 1)` of this difference, which is added.
2. Averaging: the remaining difference from the full motor at operating points of the run, where both are held at the
   same speed, drive, preload and temperature. The free shaft of the full motor swings within a period, so its speed
   under the same load differs by :math:`\Delta\omega`, which is equivalent to the torque
   :math:`(b - \partial T/\partial\omega)\,\Delta\omega`. A further run adds this torque to the load, and counts
   it as torque of the motor; its curves show the errors.
3. Resolution: the change in half a period, which an average does not resolve. The change of the torque is added to the
   load of a further run. The change of a current is the RMS projection of the change of its phasor on one direction;
   the change of the power is the product of these with the voltages.

If the motor makes its shaft swing, these errors accumulate and are not known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf, nan, sqrt

import numpy as np

from pyspice_runner.averaged.driver import AveragedDrive
from pyspice_runner.averaged.library import MOST_HARMONICS, MOST_PHASES
from pyspice_runner.averaged.point import SETTINGS, SPECIAL, AveragedPoint
from pyspice_runner.averaged.run import Array, ErrorEstimate
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.drive import UNCOUPLED, Load, ideal_drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import check_runs, steady_states
from pyspice_runner.units import linear_name

POINTS = 11  # operating points along a run
DECAYS = 8.0  # decay times of the slowest mode, after which a held motor is settled
# Factor on the first two parts, which are interpolated between the points. Without it the ratio of estimate to true
# error has a minimum of 0.82 in 57 transients of two motors; validation/trust.py has these and others.
MARGIN = 1.5
# Share of the period in slip or open. Below it the contact sticks nearly throughout: the shaft of the full motor then
# swings on the stiffness of the contact for seconds, and a held shaft has any torque up to the friction torque.
HARDLY = 0.1
ASIDE = 0.02  # of the maximum speed: between the two speeds of a slope
NEAR = 5.0  # times :data:`ASIDE`, beyond which the full motor has another motion
FINER, FURTHER = 4, 2  # times as many phases, and so many more harmonics, in the motor for comparison
STIFF = 1e3  # torque per deviation of a shaft that follows a speed, over friction torque per maximum speed
MEANS = 20.0  # periods over which a mean is taken that is compared
COLUMN = {  # of a record → name of its error
    "torque": "torque_n_m", "speed": "rotor_speed_rad_s", "current_amplitude_a": "current_amplitude_a_a",
    "current_amplitude_b": "current_amplitude_b_a", "electrical_power": "electrical_power_w",
}  # fmt: skip
COMPARED = ("torque", "current_amplitude_a", "current_amplitude_b", "electrical_power")
CHANGES = ("speed", "frequency", "amplitude_a", "amplitude_b", "phase")


def estimate(run: AveragedPoint, duration: float, *, steady: bool = False, controlled: bool = False) -> ErrorEstimate:
    """Estimate the errors of a run of a duration in s, from rest or from the steady state at its start.

    A ``controlled`` shaft has the speed of the run in both motors. It takes about 1 s of CPU time plus eight times the
    CPU time of the run.
    """
    motor = run.point.motor
    phases, harmonics = min(FINER * run.phases, MOST_PHASES), min(run.harmonics + FURTHER, MOST_HARMONICS)
    finer, free = replace(run, phases=phases, harmonics=harmonics), run.point.load.speed is None and not controlled

    def loaded(torque: Array) -> dict[str, Array]:
        load = np.interp(rows["time"], *np.transpose(run.settings["load_torque"])) + torque
        course = {"load_torque": [*zip(rows["time"], load, strict=True)]}
        other = replace(run, settings={**run.settings, **course}).recorded(duration, steady=steady)
        return other | {"torque": other["torque"] - np.interp(other["time"], rows["time"], torque)}

    try:
        rows = run.recorded(duration, steady=steady)
        rest, found, forcing = compare(finer, rows, free=free)
        if free:
            if _swings(rows):
                raise SimulationError(
                    "The motor makes its shaft swing to and fro; over the swings small errors add up."
                )
            loads = [forcing + np.copysign(found, forcing), _shift(rows, rows["torque"])]
            others = [finer.recorded(duration, steady=steady), *map(loaded, loads)]
        else:
            others = [followed(finer, rows["time"], rows["speed"], duration, steady=steady), rows, rows]
            rest[0] = np.abs(rest[0]) + found
    except (ParameterError, SimulationError) as error:
        return ErrorEstimate({}, {}, str(error))
    left = run.phases / (phases - run.phases) if phases > run.phases else 0.0
    errors, shares = {}, {}
    limit = _friction_torque(motor)
    for name in COLUMN if free else COMPARED:
        means = _means(rows, name)
        by_phases, by_rest, by_shift = (
            np.abs(means - np.interp(rows["time"], one["time"], _means(one, name))) for one in others
        )
        if name in COMPARED[free:]:  # torque and speed of a free shaft have theirs by the loads
            by_rest = by_rest + np.abs(rest[COMPARED.index(name)])
            by_shift = by_shift + _unresolved(rows, name)
        part = MARGIN * ((1.0 + left) * by_phases + by_rest) + by_shift
        most = limit if name == "torque" else float(np.abs(means).max()) or inf
        curve = (motor.slider and linear_name(COLUMN[name])) or COLUMN[name]
        errors[curve] = sqrt(np.trapezoid(part**2, rows["time"]) / rows["time"][-1])
        shares[curve] = errors[curve] / most
    return ErrorEstimate(errors, shares)


def _friction_torque(motor: Motor) -> float:
    """Return the torque μ F₀ R of friction in N·m, the sum over the contacts."""
    return sum(one.contact.friction * one.preload_n * one.radius_m for one in motor.touching)


def _swings(rows: Mapping[str, Array]) -> bool:
    """Whether the shaft reverses three times in a row with the same commands."""
    turns = np.flatnonzero(np.abs(rows["speed"]) > HARDLY * np.abs(rows["speed"]).max())
    turns = turns[1:][np.diff(np.sign(rows["speed"][turns])) != 0.0]
    commands = np.transpose([rows[name] for name in (*CHANGES[1:], "load_torque", "preload")])
    swings = [bool((commands[begin] == commands[begin + 1 : end + 1]).all()) for begin, end in pairwise(turns)]
    return sum(swings) > 1


def _unresolved(rows: Mapping[str, Array], name: str) -> Array:
    """Return the change of a value in half a period, over time."""
    if name == "torque":
        return np.abs(_shift(rows, rows[name]))
    if name == "electrical_power":
        currents = [rows[f"amplitude_{group}"] * _unresolved(rows, f"current_amplitude_{group}") for group in "ab"]
        return np.asarray(0.5 * np.sum(currents, axis=0))
    phase = np.radians(rows[name.replace("amplitude", "phase")])
    return sqrt(0.5) * np.abs(_shift(rows, rows[name] * np.exp(1j * phase)))


def compare(run: AveragedPoint, rows: Mapping[str, Array], *, free: bool) -> list[Array]:
    """Compare an averaged motor with the full motor at operating points of the records of a run.

    Return over time the differences of :data:`COMPARED`, in as many rows; the errors of the torque of the full motor;
    and the torque that makes the error of the speed, both in N·m. A shaft that is not ``free`` has the same speed in
    both. Raise SimulationError where they cannot be compared.
    """
    chosen = _rows(rows)
    if not chosen:
        raise SimulationError("There is no drive, so that there is nothing to compare.")
    sticks = SimulationError("Friction holds the shaft, which swings on the contact in the full motor.")
    if (turns := run.point.load.speed is None) and (rows["slip"] + rows["separated"]).max() < HARDLY:
        raise sticks
    at = {name: values[chosen] for name, values in rows.items()}
    there = settled(run, at)
    if turns and (there["slip"] + there["separated"]).min() < HARDLY:
        raise sticks
    points = [operating_point(run, {name: float(values[row]) for name, values in rows.items()}) for row in chosen]
    states = steady_states(points, averages=False)
    check_runs(states)
    for row, state in zip(chosen, states, strict=True):
        if not state.stable:
            largest = np.abs(state.floquet_multipliers).max(initial=0.0)
            how = f"is unstable ({state.instability}, multiplier {largest:.5g})" if state.converged else "was not found"
            raise SimulationError(
                f"The periodic motion that the averaged model describes {how} in the full motor at "
                f"{1e3 * rows['time'][row]:.4g} ms of the run, with {state.drive.label} and {state.speed_rad_s:.4g} "
                "rad/s. Take the time averages of the full motor, by simulate or speed-torque."
            )
    if not all(state.determined for state in states):
        raise sticks
    averaged = np.array([there[name] for name in COMPARED])
    full = [
        (state.torque_n_m, sqrt(2.0) * state.current_a_rms_a, sqrt(2.0) * state.current_b_rms_a,
         state.power_a_w + state.power_b_w) for state in states
    ]  # fmt: skip
    difference = averaged - np.transpose(full)
    forcing = difference[0].copy()
    if free:
        rotor, step = run.point.motor.rotor, max(ASIDE * float(np.abs(rows["speed"]).max()), 1e-9)
        aside = settled(run, {**at, "speed": at["speed"] + step})
        damping = rotor.bearing_damping_n_m_s - (aside["torque"] - there["torque"]) / step
        settles = damping > rotor.inertia_kg_m2 / rows["time"][-1]
        if settles.any() and not rotor.bearing_friction_n_m:  # with dry friction there is no state of a free shaft
            away = _away([points[place] for place in np.flatnonzero(settles)], averaged[0, settles].tolist())
            near = np.abs(away) < NEAR * step
            forcing[np.flatnonzero(settles)[near]] = (damping[settles] * away)[near]
    found, time = (difference, np.array([state.torque_error_n_m for state in states]), forcing), rows["time"]
    return [np.apply_along_axis(lambda row: np.interp(time, time[chosen], row), -1, one) for one in found]


def _away(points: Sequence[Point], torques: Sequence[float]) -> Array:
    """Return held speeds minus speeds of the full motor's free shaft under the torques in N·m; NaN if none."""
    damping, speeds = points[0].motor.rotor.bearing_damping_n_m_s, np.array([point.load.speed for point in points])
    loads = [Load(None, load) for load in (torques - damping * speeds).tolist()]
    turning = [replace(point, load=load) for point, load in zip(points, loads, strict=True)]
    states = steady_states(turning, averages=False)
    return np.asarray(speeds - [state.speed_rad_s if state.stable else nan for state in states])


def _rows(rows: Mapping[str, Array]) -> list[int]:
    """Return the rows with a drive at equal shares of time and of all changes in a run, the last one at its end.

    Of rows at the same operating point there is the last one only. All are a period later, behind a step of a command,
    which takes as long.
    """
    time = rows["time"]
    passed = np.diff(time) / time[-1]
    for name in CHANGES:
        moved = np.abs(np.diff(rows[name]))
        passed += moved / (moved.sum() or 1.0)
    passed = np.cumsum(passed.clip(max=passed.sum() / POINTS))  # of a jump the row behind it is enough
    places = 1 + np.searchsorted(passed, passed[-1] * (np.arange(POINTS) + 1.0) / POINTS).clip(max=len(passed) - 1)
    places = np.searchsorted(time, time[places] + 1.0 / rows["frequency"][places]).clip(max=len(time) - 1).tolist()
    points = np.transpose([rows[name][places] for name in (*CHANGES, "preload", "temperature")]).tolist()
    last = {tuple(point): place for point, place in zip(points, places, strict=True)}
    return [place for place in last.values() if rows["amplitude_a"][place] + rows["amplitude_b"][place] > 0.0]


def operating_point(run: AveragedPoint, there: Mapping[str, float]) -> Point:
    """Return the operating point of the full motor, held at the speed of the run, for values of the records."""
    motor, thermal = run.point.motor, run.point.thermal
    if thermal is not None:
        motor = thermal.warmed(motor, there["temperature"])
    motor = motor.updated({"contact.preload_n": there["preload"]})
    drive = ideal_drive(there["amplitude_a"], there["amplitude_b"], there["phase"], there["frequency"])
    timeout = run.point.solver.timeout
    return Point.of(motor, drive, speed=there["speed"], contact=run.point.law, audit=False, timeout=timeout)


def settled(run: AveragedPoint, there: Mapping[str, Array]) -> dict[str, Array]:
    """Return the settled values of the averaged motor, held at the speeds of rows, for these rows of the records."""
    stay = DECAYS * run.point.motor.decay_s
    ends = stay * np.arange(1, len(there["time"]) + 1)
    begins = ends - stay + run.point.motor.decay_s  # it goes from one row to the next in a decay time
    times = np.column_stack([begins, ends]).ravel()
    of = {"voltage_a": "amplitude_a", "voltage_b": "amplitude_b", "phase_deg": "phase"}
    names = {name: of.get(name, name) for name in (*SETTINGS, *SPECIAL) if name != "load_torque"}
    settings = {name: [*zip(times, np.repeat(there[row], 2), strict=True)] for name, row in names.items()}
    drive = ideal_drive(*(float(there[name][0]) for name in ("amplitude_a", "amplitude_b", "phase", "frequency")))
    at = replace(run, front=AveragedDrive.of(drive), settings=settings)
    rows = followed(at, times, np.repeat(there["speed"], 2), float(ends[-1]), heat_capacity=0.0)
    places = np.searchsorted(rows["time"], ends).clip(max=len(rows["time"]) - 1)
    return {name: values[places] for name, values in rows.items()}


def followed(
    run: AveragedPoint, time: Array, speed: Array, duration: float, *, steady: bool = False, **values: float
) -> dict[str, Array]:
    """Return the records of a run whose shaft has speeds in rad/s at times in s, with values of the compiled motor."""
    if run.point.load.speed is None:
        values["bearing"] = STIFF * _friction_torque(run.point.motor) / max(np.abs(speed).max(), 1e-9)
        course = [*zip(time, -values["bearing"] * speed, strict=True)]
        run = replace(run, settings={**run.settings, "load_torque": course}, shaft=UNCOUPLED)
    return run.recorded(duration, steady=steady, **values)


def _means(rows: Mapping[str, Array], name: str) -> Array:
    """Return the means over :data:`MEANS` periods, which have no peaks of current at steps of the voltage."""
    time, values, wait = rows["time"], rows[name], 0.5 * MEANS / rows["frequency"]
    total = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
    begin, end = (time - wait).clip(min=0.0), (time + wait).clip(max=time[-1])
    return np.asarray((np.interp(end, time, total) - np.interp(begin, time, total)) / (end - begin))


def _shift(rows: Mapping[str, Array], values: Array) -> Array:
    """Return the change of values in half a period, by that in :data:`MEANS` periods."""
    time, wait = rows["time"], 0.5 * MEANS / rows["frequency"]
    return np.asarray((np.interp(time + wait, time, values) - np.interp(time - wait, time, values)) / (2.0 * MEANS))
