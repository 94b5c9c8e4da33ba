# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of steady states over parameters of drive and motor, and the best working point within limits.

A map is solved from coarse to fine: the points of a coarse grid first, from the response of the free stator; then the
points between them, from the mean of their solved neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from graphlib import TopologicalSorter
from itertools import product
from math import inf, prod
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np
from pydantic import SkipValidation

from pyspice_runner.circuit.bench import FREE
from pyspice_runner.circuit.law import law_settings
from pyspice_runner.errors import Interrupted, ParameterError, SimulationError, require
from pyspice_runner.motor.drive import Drive, too_fast
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked, quoted
from pyspice_runner.motor.strength import exceeded, limits_of
from pyspice_runner.result import grouped
from pyspice_runner.run.audit import delivering
from pyspice_runner.run.dynamometer import STUCK, UNITS
from pyspice_runner.run.paths import LOADS, canonical
from pyspice_runner.run.point import Point, Settings
from pyspice_runner.run.waveforms import Array
from pyspice_runner.spice.process import KeptProcesses
from pyspice_runner.steady.period_map import Found, cores
from pyspice_runner.steady.settling import Progress
from pyspice_runner.steady.shooting import Orbit, between
from pyspice_runner.steady.speed_torque import TORQUE_ERROR, axis, check_distinct, coordinates, dataset_of
from pyspice_runner.steady.steady import (
    Part,
    SteadyState,
    check_accuracy,
    check_runs,
    divided,
    solve_part,
    steady_states,
)
from pyspice_runner.units import linear_name, with_linear

if TYPE_CHECKING:
    import xarray

Objective = Literal["torque", "speed", "efficiency", "power"]
Limit = float | tuple[float, float]  # the maximum of an absolute value, or its minimum and maximum

OBJECTIVES: dict[Objective, str] = {
    "torque": "torque_n_m", "speed": "speed_rad_s", "efficiency": "efficiency", "power": "shaft_power_w",
}  # fmt: skip
ACCURACY = 1e-2  # of the friction torque under the preload; finer than the differences between points of a map
MOST_POINTS = 10_000
_COARSEST = 4  # steps between the points that are solved first

OUTCOME = {
    "speed_rad_s": ("rad/s", "mean speed of the rotor"),
    **UNITS,
    "current_a": ("A", "RMS current of the group that draws more"),
    "voltage_v": ("V", "maximum voltage at a group"),
    "temperature_c": ("°C", "steady temperature of the stator; not known without its thermal resistance"),
    "torque_error_n_m": TORQUE_ERROR,
    "largest_multiplier": ("1", "largest Floquet multiplier; a disturbance decays where it is below 1"),
    "converged": ("1", "whether a steady state was found"),
    "stable": ("1", "whether the steady state is stable"),
    "allowed": ("1", "whether the point is stable, passed the audit, and is within all limits"),
}
_FLAGS = ("converged", "stable", "allowed")
_MISSING = dict.fromkeys(OUTCOME, np.nan) | dict.fromkeys(_FLAGS, False)  # a point that was not reached


@checked
def working_points(
    motor: Motor,
    drive: Drive,
    *,
    over: Mapping[str, SkipValidation[Sequence[float] | Array]],
    objective: Objective = "torque",
    limits: Mapping[str, Limit] | None = None,
    accuracy: float = ACCURACY,
    progress: Progress | None = None,
    **settings: Unpack[Settings],
) -> xarray.Dataset:
    """Map the steady states of a motor over parameters of drive and motor, and choose the best one within limits.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        over: dotted path → values, as in :func:`speed_torque`: ``drive.frequency``, ``drive.phase_deg``,
            ``drive.ratio_b``, ``drive.voltage``, ``contact.preload_n``, ``load.speed``, ``load.torque``.
        objective: quantity that the best point maximises: ``"torque"``, ``"speed"``, ``"efficiency"``, or
            ``"power"`` at the shaft; not the speed or the torque if ``speed`` or ``load_torque`` fixes it.
        limits: name of a quantity → maximum absolute value allowed, such as ``{"current_a": 0.1}``, or (minimum,
            maximum): ``voltage_v``, ``current_a``, ``temperature_c`` or a quantity of :func:`speed_torque`, as
            ``ceramic_stress_pa``. The motor's own ``limits`` of stress, temperature, pressure and tension hold unless
            another value is given here.
        accuracy: error of the torque, relative to the friction torque under the preload, above which the step is
            halved, twice at most.
        progress: called with the number of finished points and of all points.
        settings: load, contact and solver, as in :class:`.Settings`. Without speed and load torque the shaft is held
            still for the torque, free for the speed, and held at half of the free rotor's speed under the given drive
            for efficiency and power.

    Returns:
        The quantities over the axes; attribute ``best`` has the best point as JSON, also as
        ``dataset.piezomotor.best``. Quantities of a point without a steady state are NaN.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails, or no rotor speed is found for the default of ``speed``.
        Interrupted: when interrupted; ``partial`` has the finished points, and NaN for the others.
    """
    base = Point.of(motor, drive, audit=False, **settings)
    return mapped(base, over, objective=objective, limits=limits, accuracy=accuracy, progress=progress)


def mapped(
    base: Point,
    over: Mapping[str, Sequence[float] | Array],
    *,
    objective: Objective = "torque",
    limits: Mapping[str, Limit] | None = None,
    accuracy: float = ACCURACY,
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Map the steady states about an operating point; the arguments are those of :func:`working_points`."""
    bounds = _limits(limits or {}, base.motor)
    axes = {path: axis(path, values) for path, values in over.items()}
    count = prod(len(values) for values in axes.values())
    if not axes or count > MOST_POINTS:
        raise ParameterError(f"over has {count if axes else 0} points: it must have 1 to {MOST_POINTS}.")
    check_distinct(axes)
    law = base.touching("A free tip has no torque and moves no rotor.")
    stated = {"load.speed": base.load.speed is not None, "load.torque": base.load.torque != 0.0}
    paths = [*map(canonical, axes), *(path for path, given in stated.items() if given)]
    twice = next((path for path in paths if paths.count(path) > 1), None)
    if twice:
        raise ParameterError(f"{twice} is given twice. Give it once.")
    if stated.get(f"load.{objective}"):
        raise ParameterError(
            f"objective = {objective!r} is not valid: the load fixes the {objective} of every point. Leave it out, or "
            "choose another objective."
        )
    if base.load == FREE and not LOADS.keys() & set(map(canonical, axes)):
        base = base.updated({"load.speed": _usual_speed(base, objective, accuracy)})
    shape = tuple(len(values) for values in axes.values())
    setups = {
        index: base.updated({path: float(axes[path][at]) for path, at in zip(axes, index, strict=True)})
        for index in product(*map(range, shape))
    }
    states, complete = _solved(setups, accuracy, progress or (lambda *_: None))
    rows = {index: _row(states[index], bounds) if index in states else _MISSING for index in setups}
    goal = OBJECTIVES[objective]
    allowed = [index for index, row in rows.items() if row["allowed"] and np.isfinite(row[goal])]
    best: dict[str, Any] | None = None
    if allowed:
        index = max(allowed, key=lambda one: rows[one][goal])
        at = {path: float(values[place]) for (path, values), place in zip(axes.items(), index, strict=True)}
        best = at | {name: _plain(value) for name, value in rows[index].items() if name not in at}
    held = "" if base.load.speed is None else f", shaft at {base.load.speed:.4g} rad/s"
    dataset = dataset_of(
        base, f"{objective} over {' and '.join(axes)}{held}", OUTCOME, list(rows.values()), coordinates(base, axes),
        (states[index].provenance["deck_sha256"] for index in setups if index in states),
        objective=objective, best=best,
        limits={name: high if low == -inf else [low, _plain(high)] for name, (low, high) in bounds.items()},
        cautions=[
            *([STUCK] if any(state.held_by_friction for state in states.values()) else []),
            *delivering(state.quantities for state in states.values()),
            *grouped([
                (*exceeded(state.motor, state.quantities), *too_fast(state.motor.to_dict(), state.speed_rad_s))
                for state in states.values()
            ]),
        ],
        method=[states[index].method if index in states else "" for index in setups],
        run=law_settings(base.motor, law)
        | {"speed": base.load.speed, "load_torque": base.load.torque, "accuracy": accuracy},
    )  # fmt: skip
    if complete:
        return dataset
    dataset.attrs["incomplete"] = f"{len(states)} of {len(setups)} points are finished."
    raise Interrupted("The map was interrupted.", dataset)


def _limits(limits: Mapping[str, Limit], motor: Motor) -> dict[str, tuple[float, float]]:
    bounds: dict[str, tuple[float, float]] = {}
    known = [name for name in OUTCOME if name not in _FLAGS]
    known += filter(None, map(linear_name, known)) if motor.slider else ()
    missing: dict[str, str] = {}
    if motor.structure is None:
        missing |= dict.fromkeys(("ceramic_stress_pa", "ceramic_strain"), "motor is described without its beam")
    if motor.limits is None:
        missing |= dict.fromkeys(("temperature_c", "temperature_rise_k"), "motor has no table of limits")
    for name, parameter in (
        ("peak_pressure_pa", "effective_radius_m"),
        ("tensile_stress_pa", "poisson"),
        ("wear_volume_m3_per_s", "specific_wear_rate_m3_per_n_m"),
    ):
        if getattr(motor.contact, parameter) is None:
            missing[name] = f"motor has no contact.{parameter}"
    for name, value in limits.items():
        if name not in known:
            raise ParameterError(f"limits: {quoted(name)} is not known: it must be one of {', '.join(known)}.")
        if name in missing:
            raise ParameterError(
                f"limits: {name} is not known of {motor.name}: the {missing[name]}. Leave the limit out."
            )
        low, high = value if isinstance(value, tuple) else (-inf, value)
        require(high > 0.0 and low <= high, f"limits: {name}", value, "a number > 0, or (low, high) with high > 0")
        bounds[name] = (float(low), float(high))
    return bounds


def _usual_speed(base: Point, objective: Objective, accuracy: float) -> float | None:
    """Return the speed at which the shaft is held if neither speed nor load is given; ``None`` leaves it free."""
    if objective in ("torque", "speed"):
        return 0.0 if objective == "torque" else None
    (free,) = steady_states([base], accuracy=accuracy)
    if not free.converged:
        raise SimulationError("The free rotor has no steady state under the given drive. Give speed or load_torque.")
    return 0.5 * free.speed_rad_s


Index = tuple[int, ...]


def _solved(
    setups: Mapping[Index, Point], accuracy: float, progress: Progress
) -> tuple[dict[Index, SteadyState], bool]:
    """Solve the points of a coarse grid, then those halfway between solved ones as soon as these are solved.

    Return the states, and whether they are complete: after an interrupt those that were found by then.
    """
    check_accuracy(accuracy)
    beside: dict[Index, list[Index]] = {}  # the neighbours of each point from which it starts
    owner: dict[Index, int] = {}  # the part of each point
    parts: list[Part[Index]] = []
    stride = _COARSEST
    while stride:
        new = [index for index in setups if index not in beside and not any(at % stride for at in index)]
        beside |= {index: [other for other in _neighbours(index, stride) if other in owner] for index in new}
        level = divided({index: setups[index] for index in new})
        owner |= {index: number for number, part in enumerate(level, start=len(parts)) for index in part.setups}
        parts += level
        stride //= 2
    found: dict[Index, SteadyState] = {}
    needs = [{owner[other] for index in part.setups for other in beside[index]} for part in parts]
    progress(0, len(setups))
    complete = True
    with KeptProcesses() as processes:

        def solved(number: int) -> list[SteadyState]:
            part = parts[number]
            starts: dict[Index, Orbit | None] = {}
            for index in part.setups:
                near = [found[other] for other in beside[index]]
                points = [other.solution for other in near if other.stable and other.solution]
                starts[index] = between(points) if points else None
            return solve_part(part, accuracy, starts, processes)

        try:
            for number, states in _as_ready(solved, needs, cores() + 2, processes.stop):
                found |= zip(parts[number].setups, states, strict=True)
                progress(len(found), len(setups))
        except KeyboardInterrupt:
            if not found:
                raise
            complete = len(found) == len(setups)
    check_runs(found.values())
    return {index: found[index] for index in setups if index in found}, complete


def _as_ready(
    task: Callable[[int], Found], needs: Sequence[Collection[int]], workers: int, stop: Callable[[], object]
) -> Iterator[tuple[int, Found]]:
    """Yield the numbers and results of tasks as they end, each begun after those that it needs have been yielded.

    After an error or an interrupt, ``stop`` ends the running ones.
    """
    waiting = TopologicalSorter(dict(enumerate(needs)))
    waiting.prepare()
    running: dict[Future[Found], int] = {}
    with ThreadPoolExecutor(workers) as pool:
        try:
            while waiting.is_active():
                running |= {pool.submit(task, number): number for number in waiting.get_ready()}
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    ended = running.pop(future)
                    yield ended, future.result()
                    waiting.done(ended)
        finally:
            if running:
                stop()
            for future in running:
                future.cancel()


def _neighbours(index: Index, stride: int) -> Iterator[Index]:
    """Yield the points of the grid of twice the stride that are nearest to a point; itself if it is one of them."""
    steps = [(-stride, stride) if at % (2 * stride) else (0,) for at in index]
    return (tuple(at + step for at, step in zip(index, each, strict=True)) for each in product(*steps))


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: ``None`` for what is not defined."""
    return bool(value) if isinstance(value, bool | np.bool_) else float(value) if np.isfinite(value) else None


def _row(state: SteadyState, limits: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """Return the quantities of a point."""
    assert isinstance(state.drive, Drive)
    row: dict[str, Any] = {
        "speed_rad_s": state.speed_rad_s,
        **state.quantities,
        "current_a": max(state.current_a_rms_a, state.current_b_rms_a),
        "voltage_v": max(sum(abs(tone.amplitude) for tone in group) for group in state.drive.tones),
        "temperature_c": state.motor.limits.ambient_c + state.temperature_rise_k if state.motor.limits else np.nan,
        "torque_error_n_m": state.torque_error_n_m,
        "largest_multiplier": state.largest_multiplier,
        "converged": state.converged,
        "stable": state.stable,
    }
    row = with_linear(row) if state.motor.slider else row
    within = all(low <= abs(row[name]) <= high for name, (low, high) in limits.items())
    given = {name for name, (_, high) in limits.items() if high < inf}
    given |= {"temperature_c"} if "temperature_rise_k" in given else set()
    own = {name: most for name, most in limits_of(state.motor).items() if name not in given}
    within = within and not any(abs(row[name]) > most for name, most in own.items())
    within = within and not too_fast(state.motor.to_dict(), state.speed_rad_s)
    return {**row, "allowed": bool(state.stable and not state.audit.findings and within)}
