# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed–torque curves: the motor on the dynamometer, settled at each speed, or at a slowly changing one.

The torque is that of the contact on the rotor, R·F_T; the bearing takes its share of it, and what remains is the load
torque. Both are positive where they drive the rotor, or the load, in the positive direction.
"""

from __future__ import annotations

import hashlib
import json
import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import ceil
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from pyspice_runner.analysis.audit import FEWEST_POINTS_PER_PERIOD, audit_point, mark, withhold
from pyspice_runner.analysis.dynamometer import UNITS, Bench, Block, quantities, uniform_step
from pyspice_runner.analysis.simulate import MOST_POINTS, shortest_period
from pyspice_runner.analysis.waveforms import Array
from pyspice_runner.engine.ngspice import ngspice_version
from pyspice_runner.errors import Interrupted, ParameterError, SimulationError
from pyspice_runner.model.drive import Drive, check_shaft
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked, quoted, unit_of
from pyspice_runner.netlist.benches import SpeedRamp
from pyspice_runner.netlist.contact import SLIDERS, ContactLaw, check_law, contact_library
from pyspice_runner.netlist.motor import Motion

if TYPE_CHECKING:
    import xarray

Method = Literal["hold", "ramp"]
Progress = Callable[[int, int], None]

SPEED = "speed_rad_s"
TOLERANCE = 1e-3
PATIENCE = 40
RAMP_BLOCKS = 16  # of a ramp from the lowest speed to the highest, at least
_FEWEST_BLOCKS = 4  # of patience
_APPROACH = 100.0  # times a motion may be nearer after a block: e at least, 20 to 100 while the driven modes settle
_SMALL = 0.02  # of the friction torque that the mean normal force allows; drifts below tolerance times this are noise
_MOST_POINTS = 100_000

OUTCOME = {
    **UNITS,
    "settled": ("1", "whether the means stayed the same from block to block"),
    "audit_passed": ("1", "whether the means passed the physical audit"),
    "torque_drift_n_m": ("N·m", "change of the mean torque from block to block; of a ramp, half of fall less rise"),
    "simulated_s": ("s", "time that was simulated"),
}
_MISSING = dict.fromkeys(OUTCOME, float("nan")) | {
    "settled": False, "audit_passed": False, "findings": (), "deck_sha256": "",
}  # fmt: skip


@checked
def speed_torque(
    motor: Motor,
    drive: Drive,
    *,
    speeds: ArrayLike,
    over: Mapping[str, Sequence[float] | Array] | None = None,
    mode: Method = "hold",
    follow: str | None = None,
    contact: ContactLaw = "spring-slider",
    sliders: int = SLIDERS,
    step: float | None = None,
    tolerance: float = TOLERANCE,
    patience: int = PATIENCE,
    executor: Executor | None = None,
    progress: Progress | None = None,
    timeout: float | None = None,
    audit: bool = True,
) -> xarray.Dataset:
    """Measure torque, power and losses over speed, in all four quadrants.

    Each point starts from preloaded rest, on a rotor that turns at its speed, and runs in blocks of whole drive
    periods, each as long as the slowest mode takes to decay. It is settled when the means do not change from block to
    block; the means over the last one are returned. A point that never settles, because the motion is chaotic or the
    tones of the drive beat, says so by ``settled`` and gives the means over the last half of its blocks.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        speeds: at which the shaft is held, rad/s.
        over: further axes: dotted path → values; the motor's as in :meth:`Motor.updated`, the drive's as
            ``drive.voltage``.
        mode: ``"hold"``, or ``"ramp"`` for a quick curve: the speed rises slowly through the whole range, and in a
            second run it falls. The mean of both is returned; half their difference is ``torque_drift_n_m``.
        follow: axis along which each point goes on from where the one before it ended, not from rest:
            ``"speed_rad_s"`` or one of ``over``. It shows hysteresis if the axis goes up and down again.
        contact: law of the contact, as in ``simulate``.
        sliders: number of sliders of the brush.
        step: longest time step in s; by default that of ``simulate``.
        tolerance: change from block to block that still counts as settled: of the normal force relative to itself, of
            the torque relative to itself plus a fiftieth of the friction torque that the normal force allows; the
            energy stored in the modes may change by four times as much. What is left of the start is at most 0.6 of it.
        patience: number of blocks after which a point is given up as one that does not settle.
        executor: what runs the points; by default one thread a core, each with an ngspice process of its own.
        progress: called with the number of points that are finished and of all.
        timeout: wall time in s after which ngspice is ended, a block.
        audit: whether a point that fails the physical audit (:mod:`.audit`) is an error. If not, ``audit_passed`` is
            false there, and the attribute ``audit`` has what was found.

    Returns:
        The quantities over the axes, the speed last, with units and provenance.

    Raises:
        ParameterError: for a value that is refused.
        SimulationError: if ngspice fails or its result cannot be trusted; ``partial`` has the finished points.
        Interrupted: when interrupted; ``partial`` has those points, and NaN for the others.
    """
    settling = Settling(tolerance, patience)
    axes = {path: axis(path, values) for path, values in (over or {}).items()}
    axes[SPEED] = axis("speeds", speeds)
    _check(axes, mode, follow)
    _check_contact(contact, sliders)
    settings = {"contact": contact, "step_s": step, "tolerance": tolerance, "patience": patience}
    if contact == "brush":
        settings["sliders"] = sliders
    combinations = [dict(zip(axes, values, strict=True)) for values in product(*(a.tolist() for a in axes.values()))]
    benches: dict[tuple[float, ...], Bench] = {}
    points = []
    for combination in combinations:
        speed = combination.pop(SPEED)
        key = tuple(combination.values())
        if key not in benches:
            bench = _bench(motor, drive, combination, step, timeout)
            benches[key] = replace(bench, contact=contact, sliders=sliders, audit=audit)
        check_shaft(benches[key].motor, speed)
        points.append((benches[key], speed))
    shape = tuple(len(axis) for axis in axes.values())
    places = np.arange(len(points)).reshape(shape)
    if mode == "ramp":
        rows = places.reshape(-1, shape[-1]).tolist()
        tasks = [
            _Task(tuple(row), tuple(points[place] for place in row), settling, ramp)
            for row in rows
            for ramp in ("up", "down")
        ]
    else:
        chains = np.moveaxis(places, list(axes).index(follow), -1) if follow else places[..., np.newaxis]
        rows = chains.reshape(-1, chains.shape[-1]).tolist()
        tasks = [_Task(tuple(row), tuple(points[place] for place in row), settling) for row in rows]
    answers: dict[int, list[dict[str, Any]]] = {}
    fault: KeyboardInterrupt | SimulationError | None = None
    try:
        _answer(tasks, executor, progress or (lambda *_: None), answers)
    except (KeyboardInterrupt, SimulationError) as error:
        fault = error
    found = _found(tasks, answers)
    if fault is not None and not found:
        raise fault
    dataset = _dataset(motor, drive, axes, [found.get(place, _MISSING) for place in range(len(points))])
    dataset.attrs["run"] = json.dumps({"mode": mode, "follow": follow, **settings})
    if fault is None:
        return dataset
    dataset.attrs["incomplete"] = f"{len(found)} of {len(points)} points are finished."
    if isinstance(fault, KeyboardInterrupt):
        raise Interrupted("The curve was interrupted.", dataset) from None
    fault.partial = dataset
    raise fault


@checked
def operating_point(
    motor: Motor,
    drive: Drive,
    *,
    speed: float = 0.0,
    contact: ContactLaw = "spring-slider",
    sliders: int = SLIDERS,
    step: float | None = None,
    tolerance: float = TOLERANCE,
    patience: int = PATIENCE,
    timeout: float | None = None,
    audit: bool = True,
) -> dict[str, Any]:
    """Return the quantities of :func:`speed_torque` at one speed, plain and JSON-ready; ``sweep`` takes it as analysis.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        speed: at which the shaft is held, rad/s.
        contact: as in :func:`speed_torque`.
        sliders: as in :func:`speed_torque`.
        step: as in :func:`speed_torque`.
        tolerance: as in :func:`speed_torque`.
        patience: as in :func:`speed_torque`.
        timeout: as in :func:`speed_torque`.
        audit: as in :func:`speed_torque`; ``audit`` of the result has what was found.

    Raises:
        ParameterError: for a value that is refused.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    (speed,) = axis("speed", [speed])
    _check_contact(contact, sliders)
    bench = replace(_bench(motor, drive, {}, step, timeout), contact=contact, sliders=sliders, audit=audit)
    check_shaft(motor, float(speed))
    outcome, _ = _settle(bench, float(speed), None, Settling(tolerance, patience))
    del outcome["audit_passed"]
    return {**outcome, "audit": mark(outcome.pop("findings"))}


# --- how a motion settles ---


@dataclass(frozen=True)
class Settling:
    """When a motion counts as settled, and when it is given up; see :func:`speed_torque`."""

    tolerance: float = TOLERANCE
    patience: int = PATIENCE

    def __post_init__(self) -> None:
        if not 1e-8 <= self.tolerance <= 0.1:
            raise ParameterError(f"tolerance = {self.tolerance:g} is refused; allowed is a number from 1e-8 to 0.1.")
        if not _FEWEST_BLOCKS <= self.patience <= 10_000:
            raise ParameterError(
                f"patience = {self.patience} is refused; allowed is a whole number from {_FEWEST_BLOCKS} to 10000."
            )

    def holds(self, before: Sequence[Block], now: Sequence[Block], slack: float = 1.0) -> bool:
        """Whether the means of two successive groups of blocks are the same, to so many times the tolerance."""
        bench = now[0].bench
        torques, forces = (
            [sum(getattr(block, name) for block in group) / len(group) for group in (before, now)]
            for name in ("torque", "normal_force")
        )
        energies = [bench.stored(group[-1].end) for group in (before, now)]
        friction_torque = bench.motor.contact.friction * bench.motor.rotor.radius_m * forces[1]
        scales = (abs(torques[1]) + _SMALL * friction_torque, forces[1], 4.0 * energies[1])
        return all(
            abs(pair[1] - pair[0]) <= slack * self.tolerance * scale
            for pair, scale in zip((torques, forces, energies), scales, strict=True)
        )


def _settle(
    bench: Bench, speed: float, start: Motion | None, settling: Settling, stop: Callable[[], bool] = bool
) -> tuple[dict[str, Any], Block]:
    """Run blocks until their means stay the same, or patience ends; return the outcome and the last block.

    The meters cost time; they come in when the next block is expected to be settled, and for the last half of patience.
    """
    drive = bench.drive
    # what goes on from another motion is driven at full amplitude
    begun = ceil(drive.soft_start / drive.period) * drive.period if start else 0.0
    motion = replace(start, speed_rad_s=speed) if start else bench.rest(speed)
    blocks: list[Block] = []
    meters = False
    while True:
        if stop():
            raise SimulationError("The run was stopped because another one failed.")
        blocks.append(bench.run(motion, speed, begun, meters=meters))
        motion, begun = blocks[-1].end, blocks[-1].ended
        group = max(1, len(blocks) // 10)  # where the motion is irregular, means over more blocks may still settle
        before, now = blocks[-2 * group : -group], blocks[-group:]
        if before and begun - 2 * group * bench.duration >= drive.soft_start * (1.0 - 1e-9):
            if all(block.metered for block in now) and settling.holds(before, now):
                return _outcome(now, True, before, len(blocks)), blocks[-1]
            meters = meters or settling.holds(before, now, slack=_APPROACH)
        if len(blocks) >= settling.patience:
            now = [block for block in blocks[-(settling.patience // 2) :] if block.metered]
            return _outcome(now, False, before, len(blocks)), blocks[-1]
        meters = meters or len(blocks) >= settling.patience - settling.patience // 2


def _outcome(now: list[Block], settled: bool, before: list[Block], blocks: int) -> dict[str, Any]:
    drift = now[-1].torque - before[-1].torque
    return {
        **_audited(now), "settled": settled, "torque_drift_n_m": drift,
        "simulated_s": blocks * now[0].bench.duration, "deck_sha256": now[-1].deck_sha256,
    }  # fmt: skip


def _audited(blocks: list[Block]) -> dict[str, Any]:
    """Return the quantities over blocks, and what the audit found."""
    bench, means = blocks[0].bench, quantities(blocks)
    findings = audit_point(bench.motor, means, bench.step)
    if bench.audit:
        withhold(findings, f"point at {blocks[-1].end.speed_rad_s:.4g} rad/s")
    return {**means, "audit_passed": not findings, "findings": findings}


def _ramp(
    bench: Bench, speeds: Sequence[float], settling: Settling, falling: bool, stop: Callable[[], bool]
) -> list[dict[str, Any]]:
    """Let the speed rise or fall slowly through its whole range; return the outcomes at the speeds.

    Each block spans one interval of speed; its means stand for the middle of that.
    """
    low, high = min(speeds), max(speeds)
    middles = np.linspace(low, high, max(RAMP_BLOCKS, len(speeds) - 1) + 1)
    half = 0.5 * (middles[1] - middles[0])
    edges = np.append(middles - half, high + half)
    if falling:
        edges = edges[::-1]
    first, last = _settle(bench, float(edges[0]), None, settling, stop)
    found = []
    for before, after in pairwise(edges.tolist()):
        if stop():
            raise SimulationError("The run was stopped because another one failed.")
        last = bench.run(last.end, SpeedRamp(before, after, bench.duration), last.ended)
        found.append(_audited([last]))
    if falling:
        found.reverse()
    curves = {name: np.interp(speeds, middles, [means[name] for means in found]) for name in UNITS}
    findings = tuple(dict.fromkeys(finding for means in found for finding in means["findings"]))
    first |= {"audit_passed": not findings, "findings": findings}
    of_run = first | {"torque_drift_n_m": 0.0, "simulated_s": last.ended, "deck_sha256": last.deck_sha256}
    return [of_run | {name: float(curve[index]) for name, curve in curves.items()} for index in range(len(speeds))]


def _between(up: dict[str, Any], down: dict[str, Any]) -> dict[str, Any]:
    """Return the mean of a rising and a falling ramp; the lag of the motion behind the speed drops out of it."""
    outcome = up | {name: 0.5 * (up[name] + down[name]) for name in UNITS}
    for name in ("settled", "audit_passed"):
        outcome[name] = up[name] and down[name]
    outcome["findings"] = tuple(dict.fromkeys((*up["findings"], *down["findings"])))
    outcome["torque_drift_n_m"] = 0.5 * (down["torque_n_m"] - up["torque_n_m"])
    outcome["simulated_s"] = up["simulated_s"] + down["simulated_s"]
    return outcome


# --- tasks ---


@dataclass(frozen=True)
class _Task:
    """Points that one worker runs, one after the other: a chain, a ramp, or a single point."""

    places: tuple[int, ...]
    points: tuple[tuple[Bench, float], ...]
    settling: Settling
    ramp: Literal["up", "down"] | None = None

    def __call__(self, stop: Callable[[], bool] = bool) -> list[dict[str, Any]]:
        if self.ramp:
            speeds = [speed for _, speed in self.points]
            return _ramp(self.points[0][0], speeds, self.settling, self.ramp == "down", stop)
        outcomes: list[dict[str, Any]] = []
        motion = None
        for bench, speed in self.points:
            outcome, last = _settle(bench, speed, motion, self.settling, stop)
            motion = last.end
            outcomes.append(outcome)
        return outcomes


def _call(task: _Task) -> list[dict[str, Any]]:
    return task()


def _found(tasks: list[_Task], answers: Mapping[int, list[dict[str, Any]]]) -> dict[int, dict[str, Any]]:
    """Return by place what is finished there; of a ramp both ways."""
    ways: dict[int, list[dict[str, Any]]] = {}
    for number, answer in sorted(answers.items()):
        for place, outcome in zip(tasks[number].places, answer, strict=True):
            ways.setdefault(place, []).append(outcome)
    if not tasks[0].ramp:
        return {place: outcome for place, (outcome,) in ways.items()}
    return {place: _between(*both) for place, both in ways.items() if len(both) == 2}


def _answer(
    tasks: list[_Task], executor: Executor | None, progress: Progress, answers: dict[int, list[dict[str, Any]]]
) -> None:
    """Run the tasks and put down what they give; when one fails, or the user interrupts, the others end their block."""
    done, total = 0, sum(len(task.places) for task in tasks)
    progress(0, total)

    def collect(results: Iterable[list[dict[str, Any]]]) -> None:
        nonlocal done
        for number, answer in enumerate(results):
            answers[number] = answer
            done += len(answer)
            progress(done, total)

    if executor is not None:
        collect(executor.map(_call, tasks))
        return
    stop = threading.Event()
    workers = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    futures: list[Future[list[dict[str, Any]]]] = []
    try:
        with ThreadPoolExecutor(min(workers, len(tasks))) as pool:
            try:
                futures += (pool.submit(task, stop.is_set) for task in tasks)
                collect(future.result() for future in futures)
            except BaseException:
                stop.set()
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    finally:
        for number, future in enumerate(futures):
            if future.done() and not future.cancelled() and future.exception() is None:
                answers[number] = future.result()


# --- axes and dataset ---


def axis(name: str, values: Any) -> Array:
    """Return the values of an axis as an array.

    Raises:
        ParameterError: for what is not numbers, or no speeds.
    """
    try:
        given = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError, OverflowError):
        given = np.array([])
    if given.ndim != 1 or not given.size or not np.all(np.isfinite(given)):
        raise ParameterError(f"{name} = {quoted(values)} is refused; allowed are one or more numbers.")
    if name in ("speed", "speeds") and np.abs(given).max() > 1e6:
        worst = given[np.abs(given).argmax()]
        raise ParameterError(f"{name} has {worst:g} rad/s, which is refused; allowed is from -1e6 to 1e6 rad/s.")
    return given


def _check(axes: Mapping[str, Array], mode: str, follow: str | None) -> None:
    if mode not in get_args(Method):
        raise ParameterError(f"mode = {quoted(mode)} is refused; allowed are 'hold' and 'ramp'.")
    if follow is not None and follow not in axes:
        raise ParameterError(f"follow = {quoted(follow)} is refused; allowed are {', '.join(axes)}.")
    if mode == "ramp" and follow is not None:
        raise ParameterError("A ramp goes on from speed to speed by itself; leave out follow, or take mode = 'hold'.")
    if mode == "ramp" and np.ptp(axes[SPEED]) == 0.0:
        raise ParameterError("A ramp needs two different speeds at least; give them, or take mode = 'hold'.")
    count = int(np.prod([len(axis) for axis in axes.values()]))
    if count > _MOST_POINTS:
        raise ParameterError(f"The curve has {count} points; at most {_MOST_POINTS} are allowed.")


def _check_contact(contact: ContactLaw, sliders: int) -> None:
    if contact is None:
        raise ParameterError("The dynamometer needs a law of the contact; state one of those of simulate.")
    check_law(contact)
    contact_library(contact, sliders)


def _bench(
    motor: Motor, drive: Drive, changes: Mapping[str, float], step: float | None, timeout: float | None
) -> Bench:
    """Return the bench at one place of the further axes."""
    on_drive = {path[6:]: value for path, value in changes.items() if path.startswith("drive.")}
    on_motor = {path: value for path, value in changes.items() if not path.startswith("drive.")}
    if on_drive:
        drive = type(drive)(**(drive.model_dump() | on_drive))
    if on_motor:
        motor = motor.updated(on_motor)
    shortest = shortest_period(motor, drive, contact=True)
    coarsest = shortest / FEWEST_POINTS_PER_PERIOD
    finest = min(coarsest, Bench(motor, drive, coarsest).duration / MOST_POINTS)
    if step is not None and not finest <= step <= coarsest:
        raise ParameterError(
            f"step = {step:g} s is refused for a motion of {1.0 / shortest:.4g} Hz; "
            f"allowed is a number ≥ {finest:.3g} and ≤ {coarsest:.3g} s."
        )
    return Bench(motor, drive, uniform_step(motor, drive, step), timeout)


def _dataset(motor: Motor, drive: Drive, axes: Mapping[str, Array], outcomes: list[dict[str, Any]]) -> xarray.Dataset:
    import xarray

    shape = tuple(len(axis) for axis in axes.values())
    variables = {}
    for name, (unit, meaning) in OUTCOME.items():
        values = np.array([outcome[name] for outcome in outcomes]).reshape(shape)
        variables[name] = (tuple(axes), values, {"units": unit, "long_name": meaning})
    coordinates = {path: (path, axis, {"units": _unit(path, motor, drive)}) for path, axis in axes.items()}
    swept = any(path.startswith("drive.") for path in axes)
    decks = "".join(outcome["deck_sha256"] for outcome in outcomes)
    findings = dict.fromkeys(finding for outcome in outcomes for finding in outcome["findings"])
    attributes = {
        "audit": json.dumps(mark(tuple(findings))),
        "title": f"{motor.name}: {', '.join(['speed and torque', *([] if swept else [drive.label])])}",
        "parameter_set": motor.name,
        "motor": json.dumps(motor.to_dict()),
        "drive": json.dumps({"kind": type(drive).__name__, "label": drive.label, **drive.model_dump()}),
        "ngspice_version": ngspice_version(),
        "deck_sha256": hashlib.sha256(decks.encode()).hexdigest(),
    }
    return xarray.Dataset(variables, coordinates, attributes)


def _unit(path: str, motor: Motor, drive: Drive) -> str:
    section, _, rest = path.partition(".")
    if path == SPEED:
        return "rad/s"
    key = rest.rpartition(".")[2]
    if key == "frequency_hz":
        return "Hz"
    kind = type(drive) if section == "drive" else type(motor.modes[0]) if section == "modes" else None
    return unit_of(kind or type(getattr(motor, section)), key)
