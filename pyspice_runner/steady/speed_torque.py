# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed–torque curves: steady states found by shooting (:mod:`.steady`), or after settling (:mod:`.settling`).

The torque is that of the contact on the rotor, R·F_T; the bearing takes its share of it, and what remains is the load
torque. Both are positive where they drive the rotor, or the load, in the positive direction.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from math import prod
from typing import TYPE_CHECKING, Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike
from pydantic import SkipValidation

from pyspice_runner.circuit.law import law_settings, laws_of
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import Interrupted, ParameterError, SimulationError, require
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.strength import COMPARED, exceeded
from pyspice_runner.result import Audit
from pyspice_runner.run.audit import delivering
from pyspice_runner.run.dynamometer import GRAZING, STUCK, UNITS, Dynamometer, off_beat, stuck
from pyspice_runner.run.paths import canonical
from pyspice_runner.run.point import MOST_POINTS, Point, RunSettings
from pyspice_runner.run.waveforms import Array
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.steady.settling import PATIENCE, TOLERANCE, Progress, Settling, settle_points
from pyspice_runner.steady.steady import SteadyState, steady_state, steady_states
from pyspice_runner.units import linear_name, linear_words, with_linear

if TYPE_CHECKING:
    import xarray

Method = Literal["steady", "settle"]

SPEED = "speed_rad_s"
_MOST_POINTS = 100_000
_NO_TORQUE = "A free tip exerts no torque."

TORQUE_ERROR = "N·m", "estimated error of the mean torque by the time step, of a time average also by its scatter"
OUTCOME = {
    **UNITS,
    "settled": ("1", "whether the means stayed the same from block to block"),
    "audit_passed": ("1", "whether the means passed the physical audit"),
    "torque_error_n_m": TORQUE_ERROR,
    "largest_multiplier": ("1", "largest Floquet multiplier; beyond 1 the periodic motion is unstable"),
    "torque_drift_n_m": ("N·m", "change of the mean torque from block to block"),
    "simulated_s": ("s", "time that was simulated"),
}
_MISSING = dict.fromkeys(OUTCOME, float("nan")) | {
    "settled": False, "audit_passed": False, "findings": (), "deck_sha256": "", "method": "",
}  # fmt: skip


@checked
def speed_torque(
    motor: Motor,
    drive: Drive | Driver,
    *,
    speeds: SkipValidation[ArrayLike | None] = None,
    over: Mapping[str, SkipValidation[Sequence[float] | Array]] | None = None,
    mode: Method = "steady",
    tolerance: float = TOLERANCE,
    patience: int = PATIENCE,
    progress: Progress | None = None,
    audit: bool = True,
    **settings: Unpack[RunSettings],
) -> xarray.Dataset:
    """Measure torque, power and losses over speed, in all four quadrants.

    The steady states of all points are found together by shooting (:func:`.steady_state`), with time averages where
    the motion is unstable. A point without one is left to settle.

    A point that settles starts from preloaded rest, on a rotor that turns at its speed, and runs in blocks of whole
    drive periods, each as long as the slowest mode takes to decay. It is settled when the means do not change from
    block to block; the means over the last one are returned. A point that never settles, because the motion is chaotic
    or the tones of the drive beat, says so by ``settled`` and gives the means over the last half of its blocks.

    Args:
        motor: the motor.
        drive: the voltages of both groups, or a driver circuit; its inductances and capacitances are states of the
            periodic solution. A full bridge and a driver of the user's own are powered up from rest and settle.
        speeds: at which the shaft is held, rad/s; by default the values of ``load.speed`` in ``over``.
        over: further axes: dotted path → values; the motor's as in :meth:`Motor.updated`, the drive's as
            ``drive.voltage``, those of a driver's parts as ``drive.bridge.dead_time``.
        mode: ``"steady"``, which takes drivers and voltages with a common period, or ``"settle"``, which takes any.
        tolerance: change from block to block that still counts as settled: of the normal force relative to itself, of
            the torque relative to itself plus a fiftieth of the friction torque that the normal force allows; the
            energy stored in the modes may change by four times as much. What is left of the start is at most 0.6 of
            the tolerance, or about twice the tolerance where the carrier vibrates on the contact longer than a block.
        patience: number of blocks after which a point counts as not settled.
        progress: called with the number of finished points and of all points.
        audit: whether findings of the physical audit (:mod:`.audit`) are an error; if not, ``audit_passed`` is false
            at such a point, and the attribute ``audit`` has them.
        settings: contact and solver, as in :class:`.RunSettings`; the timeout is that of a block.

    Returns:
        The quantities over the axes, the speed last, with units and provenance.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted; ``partial`` has the finished points.
        Interrupted: when interrupted; ``partial`` has those points, and NaN for the others.
    """
    base = Point.of(motor, drive, audit=audit, **settings)
    return curve(base, speeds=speeds, over=over, mode=mode, settling=Settling(tolerance, patience), progress=progress)


def curve(
    base: Point,
    *,
    speeds: ArrayLike | None = None,
    over: Mapping[str, Sequence[float] | Array] | None = None,
    mode: Method = "steady",
    settling: Settling = Settling(),  # noqa: B008, a frozen value
    progress: Progress | None = None,
) -> xarray.Dataset:
    """Return the curve of an operating point, whose load is replaced; the arguments are as in :func:`speed_torque`."""
    law = base.touching(_NO_TORQUE)
    axes = _axes(speeds, over or {})
    mode = "settle" if base.source.own else mode  # the states of such a driver are not known
    count = prod(len(values) for values in axes.values())
    if count > _MOST_POINTS:
        raise ParameterError(f"The curve has {count} points; at most {_MOST_POINTS} are allowed.")
    check_distinct(axes)
    *further, _ = axes
    points: list[Dynamometer] = []
    for values in product(*(axes[path].tolist() for path in further)):
        there = base.updated(dict(zip(further, values, strict=True)))
        points += [_dynamometer(there.updated({"load.speed": speed})) for speed in axes[SPEED].tolist()]
    found, fault = _measured(points, mode, settling, progress)
    if fault is not None and not found:
        raise fault
    outcomes = [found.get(place, _MISSING) for place in range(len(points))]
    findings = dict.fromkeys(finding for outcome in outcomes for finding in outcome["findings"])
    greatest = {
        name: max((outcome[name] for outcome in outcomes if outcome[name] == outcome[name]), default=float("nan"))
        for name in COMPARED
    }
    label = [] if any(path.startswith("drive.") for path in axes) else [base.source.label]
    dataset = dataset_of(
        base, ", ".join(["speed and torque", *label]), OUTCOME, outcomes, coordinates(base, axes),
        (outcome["deck_sha256"] for outcome in outcomes),
        audit=Audit(tuple(findings)).to_dict(),
        cautions=[*exceeded(base.motor, greatest), *_cautions(points, outcomes)],
        method=[outcome["method"] for outcome in outcomes],
        run={
            "mode": mode, **law_settings(base.motor, law), "step_s": base.solver.step, "tolerance": settling.tolerance,
            "patience": settling.patience, "engine": "spice",
        },
    )  # fmt: skip
    if fault is None:
        return dataset
    dataset.attrs["incomplete"] = f"{len(found)} of {len(points)} points are finished."
    if isinstance(fault, KeyboardInterrupt):
        raise Interrupted("The curve was interrupted.", dataset) from None
    fault.partial = dataset
    raise fault


@checked
def held_point(
    motor: Motor,
    drive: Drive | Driver,
    *,
    speed: float = 0.0,
    mode: Method = "steady",
    tolerance: float = TOLERANCE,
    patience: int = PATIENCE,
    audit: bool = True,
    **settings: Unpack[RunSettings],
) -> dict[str, Any]:
    """Return the quantities of :func:`speed_torque` at one speed, plain and JSON-ready; ``sweep`` takes it as analysis.

    The arguments are those of :func:`speed_torque`. ``audit`` of the result has its findings.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    bench = _held(motor, drive, speed=speed, audit=audit, **settings)
    mode = "settle" if bench.setup.source.own else mode
    found, fault = _measured([bench], mode, Settling(tolerance, patience), None)
    if fault is not None:
        raise fault
    return _reported(bench, found[0])


def held_points(points: Sequence[tuple[Motor, Drive, Mapping[str, Any]]]) -> list[dict[str, Any] | None]:
    """Return the results of :func:`held_point` for many motors, drives and settings that share runs of ngspice.

    ``None`` stands for a point that is to be run alone: invalid, failed, or left to settle.
    """
    benches: dict[int, Dynamometer] = {}
    for place, (motor, drive, settings) in enumerate(points):
        with suppress(ParameterError, SimulationError, TypeError, ValueError):
            benches[place] = _held(motor, drive, **settings)
    try:
        found = _steady(list(benches.values()))
    except (ParameterError, SimulationError):
        return [None] * len(points)
    answers: list[dict[str, Any] | None] = [None] * len(points)
    for number, (place, bench) in enumerate(benches.items()):
        if number in found and not found[number]["findings"]:
            answers[place] = _reported(bench, found[number])
    return answers


def _held(motor: Motor, drive: Drive | Driver, *, speed: float = 0.0, **settings: Any) -> Dynamometer:
    """Return the dynamometer at one speed; the arguments are those of :func:`held_point`."""
    axis("speed", [speed])
    known = {name: value for name, value in settings.items() if name in ("contact", "step", "timeout", "audit")}
    base = Point.of(motor, drive, speed=speed, **known)
    base.touching(_NO_TORQUE)
    return _dynamometer(base)


def _reported(bench: Dynamometer, outcome: dict[str, Any]) -> dict[str, Any]:
    """Return the outcome of a point as :func:`held_point` reports it."""
    motor = bench.setup.motor
    kept = {name: value for name, value in outcome.items() if name not in ("audit_passed", "findings")}
    cautions = [*exceeded(motor, outcome), *_cautions([bench], [outcome])]
    found = {**kept, "engine": "spice", "cautions": cautions, "audit": Audit(outcome["findings"]).to_dict()}
    return with_linear(found) if motor.slider else found


def _cautions(benches: Sequence[Dynamometer], outcomes: Sequence[Mapping[str, Any]]) -> list[str]:
    found = False
    for bench, outcome in zip(benches, outcomes, strict=True):
        grazing = GRAZING if outcome["method"] == "settle" and not bench.speed else 0.0
        laws = laws_of(bench.setup.motor, bench.setup.law)
        found |= bool(laws) and all(law.sliding for law in laws) and stuck(outcome, grazing)
    unstable = sum(outcome["largest_multiplier"] >= 1.0 for outcome in outcomes)
    averages = f"{unstable} of {len(outcomes)} points have an unstable periodic motion: their values are time averages."
    return [*([averages] if unstable else []), *([STUCK] if found else []), *delivering(outcomes)]


# --- points ---


def _measured(
    points: Sequence[Dynamometer], mode: str, settling: Settling, progress: Progress | None
) -> tuple[dict[int, dict[str, Any]], KeyboardInterrupt | SimulationError | None]:
    """Return the outcomes by place, and the error or interrupt if some are missing."""
    tell = progress or (lambda *_: None)
    found: dict[int, dict[str, Any]] = {}
    fault: KeyboardInterrupt | SimulationError | None = None
    try:
        if mode == "steady":
            tell(0, len(points))
            found = _steady(points)
        others = {place: bench for place, bench in enumerate(points) if place not in found}
        finished = len(found)
        if others:
            settle_points(others, settling, lambda done, _: tell(finished + done, len(points)), found)
        else:
            tell(len(points), len(points))
    except (KeyboardInterrupt, SimulationError) as error:
        fault = error
    for place in sorted(found):
        bench = points[place]
        if bench.setup.solver.audit and found[place]["findings"]:
            try:
                Audit(found.pop(place)["findings"]).withhold(f"point at {bench.speed:.4g} rad/s")
            except SimulationError as error:
                fault = fault or error
    return found, fault


def _steady(points: Sequence[Dynamometer]) -> dict[int, dict[str, Any]]:
    """Return by place the outcomes of points whose values need no settling."""
    setups = [replace(bench.setup, solver=replace(bench.setup.solver, audit=False)) for bench in points]
    return {
        place: {
            **state.quantities, "settled": True, "audit_passed": bool(state.audit.passed),
            "findings": state.audit.findings, "torque_error_n_m": state.torque_error_n_m,
            "largest_multiplier": state.largest_multiplier, "torque_drift_n_m": 0.0,
            "simulated_s": state.provenance["simulated_s"], "deck_sha256": state.provenance["deck_sha256"],
            "method": state.method,
        }
        for place, state in enumerate(steady_states(setups))
        if state.reached
    }  # fmt: skip


# --- axes ---


def axis(name: str, values: Any) -> Array:
    """Return the values of an axis as an array. Raise ParameterError for what is not numbers, or no speeds."""
    try:
        given = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError, OverflowError):
        given = np.array([])
    require(given.ndim == 1 and given.size and np.all(np.isfinite(given)), name, values, "one or more numbers")
    if (name == "speeds" or canonical(name) == "load.speed") and np.abs(given).max() > 1e6:
        worst = given[np.abs(given).argmax()]
        raise ParameterError(f"{name} has {worst:g} rad/s, which is not valid: it must be from -1e6 to 1e6 rad/s.")
    return given


def check_distinct(axes: Mapping[str, Array]) -> None:
    """Raise ParameterError for a value that an axis has twice: its points would be solved twice."""
    for path, values in axes.items():
        kept, counts = np.unique(values, return_counts=True)
        if counts.max() > 1:
            name = "speeds" if path == SPEED else path
            raise ParameterError(f"{name} has the value {kept[counts.argmax()]:g} more than once. Give it once.")


def no_load_state(motor: Motor, drive: Drive, **settings: Any) -> SteadyState | None:
    """Return the steady state without load; ``None`` if dry friction, a constant torque, stops the rotor.

    The settings are those of :func:`.steady_state`.
    """
    path, dry, _ = motor.dry_friction
    motor = motor.updated({path: 0.0})
    free = steady_state(motor, drive, **settings)
    if not dry or not free.reached:
        return free
    braked = steady_state(motor, drive, load_torque=float(np.copysign(dry, free.speed_rad_s)), **settings)
    return braked if braked.speed_rad_s * free.speed_rad_s > 0.0 else None


def _axes(speeds: Any, over: Mapping[str, Any]) -> dict[str, Array]:
    """Return the axes of a curve, that of the speed last."""
    given = {path: values for path, values in over.items() if canonical(path) == "load.speed"}
    if speeds is not None:
        given["speeds"] = speeds
    if len(given) != 1:
        raise ParameterError("The speeds of the curve must be given once: as speeds, or as over['load.speed'].")
    axes = {path: axis(path, values) for path, values in over.items() if path not in given}
    ((name, values),) = given.items()
    return {**axes, SPEED: axis(name, values)}


def _dynamometer(point: Point) -> Dynamometer:
    """Return the dynamometer of a point. Raise ParameterError for a step with which a block has too many points."""
    block = Dynamometer(point).duration
    finest = block / MOST_POINTS
    if point.step < finest:
        if point.solver.step is None:
            raise ParameterError(
                f"The motor is too stiff for a curve: a block of {block:.3g} s, in which the slowest mode decays, "
                f"takes {block / point.step:.3g} steps for the motion of {1.0 / point.shortest_period:.4g} Hz; at most "
                f"{MOST_POINTS:g} are allowed. Use steady_state at each speed."
            )
        raise ParameterError(
            f"step = {point.step:g} s is not valid for a motion of {1.0 / point.shortest_period:.4g} Hz: it must be "
            f">= {finest:.3g} s."
        )
    return Dynamometer(off_beat(point))


def coordinates(base: Point, axes: Mapping[str, Array]) -> dict[str, tuple[str, Array, dict[str, str]]]:
    """Return the coordinates of axes, with units."""
    return {path: (path, values, {"units": base.parameter(path).unit}) for path, values in axes.items()}


def dataset_of(
    base: Point,
    title: str,
    outcome: Mapping[str, tuple[str, str]],
    rows: Sequence[Mapping[str, Any]],
    coordinates: Mapping[str, tuple[str, Array, Mapping[str, str]]],
    hashes: Iterable[str],
    **attributes: Any,
) -> xarray.Dataset:
    """Return the quantities of all points over their axes, with units and provenance.

    ``outcome`` has unit and meaning of each quantity, ``rows`` the values by point, the last axis fastest, ``hashes``
    those of the decks. Attributes other than texts become JSON.
    """
    from pyspice_runner.datasets import Dataset

    shape = {name: len(values) for name, (along, values, _) in coordinates.items() if along == name}
    variables = {}
    for name, (unit, meaning) in outcome.items():
        if name not in shape:
            values = np.array([row[name] for row in rows]).reshape(tuple(shape.values()))
            variables[name] = (tuple(shape), values, {"units": unit, "long_name": meaning})
    motor = base.motor.to_dict()
    if "slider" in motor:
        title = linear_words(title)
        variables |= {beside: _of_slider(*variables[name]) for name in variables if (beside := linear_name(name))}
        coordinates = {**coordinates} | {
            beside: _of_slider(*item) for name, item in coordinates.items() if (beside := linear_name(name))
        }
    attributes |= {"motor": motor, "drive": base.source.to_dict()}
    texts = {name: value if isinstance(value, str) else json.dumps(value) for name, value in attributes.items()}
    texts |= {"ngspice_version": ngspice_version(), "deck_sha256": hashlib.sha256("".join(hashes).encode()).hexdigest()}
    heading = {"title": f"{base.motor.name}: {title}", "parameter_set": base.motor.name}
    return Dataset(variables, coordinates, heading | texts)


def _of_slider(dims: Any, values: Array, attributes: Mapping[str, str]) -> tuple[Any, Array, dict[str, str]]:
    """Return a quantity of a rotor as that of a slider, which has the same values."""
    return dims, values, {name: linear_words(text) for name, text in attributes.items()}
