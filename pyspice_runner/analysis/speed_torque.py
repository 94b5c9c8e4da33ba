# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed–torque curves: the steady state at each speed, found directly, after settling, or at a slowly changing speed.

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
from pydantic import SkipValidation

from pyspice_runner.analysis.branch import steady_branch
from pyspice_runner.analysis.dynamometer import UNITS, Block, Dynamometer, off_beat, quantities
from pyspice_runner.analysis.steady import steady_states
from pyspice_runner.engine.ngspice import ngspice_version
from pyspice_runner.errors import Interrupted, ParameterError, SimulationError
from pyspice_runner.model.drive import Drive, Load
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked, quoted
from pyspice_runner.model.strength import exceeded
from pyspice_runner.netlist.benches import SpeedRamp
from pyspice_runner.netlist.contact import ContactLaw, Law, touching_law
from pyspice_runner.netlist.drivers import Driver
from pyspice_runner.netlist.motor import Motion
from pyspice_runner.netlist.sources import source_of, unit_in, updated
from pyspice_runner.result import Audit
from pyspice_runner.run.audit import audit_point
from pyspice_runner.run.engines import BEHIND_DRIVER, Engine, is_compiled
from pyspice_runner.run.settings import Solver
from pyspice_runner.run.setup import Setup
from pyspice_runner.run.steps import MOST_POINTS
from pyspice_runner.run.waveforms import Array

if TYPE_CHECKING:
    import xarray

Method = Literal["steady", "settle", "ramp", "hold"]  # the last is the former name of settle
Progress = Callable[[int, int], None]

SPEED = "speed_rad_s"
TOLERANCE = 1e-3
PATIENCE = 40
RAMP_BLOCKS = 16  # of a ramp from the lowest speed to the highest, at least
_FEWEST_BLOCKS = 4  # of patience
_APPROACH = 100.0  # times a motion may be nearer after a block: e at least, 20 to 100 while the driven modes settle
_SMALL = 0.02  # of the friction torque that the mean normal force allows; drifts below tolerance times this are noise
_MOST_POINTS = 100_000
_NO_TORQUE = "A free tip exerts no torque."

OUTCOME = {
    **UNITS,
    "settled": ("1", "whether the means stayed the same from block to block"),
    "audit_passed": ("1", "whether the means passed the physical audit"),
    "torque_error_n_m": ("N·m", "estimated error of the mean torque by the time step; NaN where it was not estimated"),
    "largest_multiplier": ("1", "largest Floquet multiplier; a disturbance decays where it is below 1"),
    "torque_drift_n_m": ("N·m", "change of the mean torque from block to block; of a ramp, half of fall less rise"),
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
    speeds: SkipValidation[ArrayLike],
    over: Mapping[str, SkipValidation[Sequence[float] | Array]] | None = None,
    mode: Method = "steady",
    follow: str | None = None,
    contact: ContactLaw | None = "spring-slider",
    step: float | None = None,
    tolerance: float = TOLERANCE,
    patience: int = PATIENCE,
    executor: Executor | None = None,
    progress: Progress | None = None,
    timeout: float | None = None,
    audit: bool = True,
    engine: Engine = "spice",
) -> xarray.Dataset:
    """Measure torque, power and losses over speed, in all four quadrants.

    The steady states of all points are found together by shooting (:func:`.steady_state`); where there is none, or an
    unstable one, the point is left to settle.

    A point that settles starts from preloaded rest, on a rotor that turns at its speed, and runs in blocks of whole
    drive periods, each as long as the slowest mode takes to decay. It is settled when the means do not change from
    block to block; the means over the last one are returned. A point that never settles, because the motion is chaotic
    or the tones of the drive beat, says so by ``settled`` and gives the means over the last half of its blocks.

    Args:
        motor: the motor.
        drive: the voltages of both groups, or a driver circuit; its inductances and capacitances are states of the
            periodic solution. A full bridge and a driver of the user's own are powered up from rest and settle.
        speeds: at which the shaft is held, rad/s.
        over: further axes: dotted path → values; the motor's as in :meth:`Motor.updated`, the drive's as
            ``drive.voltage``, those of a driver's parts as ``drive.bridge.dead_time``.
        mode: ``"steady"``, which takes drivers and voltages with a common period; ``"settle"``, which takes any; or
            ``"ramp"``: the speed rises slowly through the whole range, and in a second run it falls. The mean of both
            is returned; half their difference is ``torque_drift_n_m``.
        follow: axis along which points go on from the one before: ``"speed_rad_s"`` or one of ``over``. With
            ``"settle"`` each begins where the one before it ended, which shows hysteresis if the axis goes up and down
            again. With ``"steady"`` the branch of steady states from the first to the last value of the axis is
            followed through its folds, stable or not; the result is that of :func:`.steady_branch`, and every other
            axis has one value.
        contact: law of the contact, as in ``simulate``.
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
        engine: of the steady states, as in ``simulate``. A point that settles, and one behind a driver, runs with the
            B-sources; the attribute ``method`` has which points settled.

    Returns:
        The quantities over the axes, the speed last, with units and provenance.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted; ``partial`` has the finished points.
        Interrupted: when interrupted; ``partial`` has those points, and NaN for the others.
    """
    law = touching_law(contact, _NO_TORQUE)
    settling = Settling(tolerance, patience)
    axes = {path: axis(path, values) for path, values in (over or {}).items()}
    axes[SPEED] = axis("speeds", speeds)
    mode = _way(mode, drive)
    _check(axes, mode, follow)
    _check_driver(drive, mode, follow)
    if mode == "steady" and follow is not None:
        is_compiled(engine, motor, law, "A branch is followed with the B-sources.")
        return _branch(motor, drive, axes, follow, contact=law, step=step, timeout=timeout)
    solver = _solver(motor, drive, law, mode, engine, step=step, timeout=timeout, audit=audit)
    settings = {**law.to_dict(), "step_s": step, "tolerance": tolerance, "patience": patience}
    settings["engine"] = "compiled" if solver.compiled else "spice"
    combinations = [dict(zip(axes, values, strict=True)) for values in product(*(a.tolist() for a in axes.values()))]
    benches: dict[tuple[float, ...], Dynamometer] = {}
    points = []
    for combination in combinations:
        speed = combination.pop(SPEED)
        key = tuple(combination.values())
        if key not in benches:
            benches[key] = _dynamometer(motor, drive, combination, law, solver)
        Load(speed).check(benches[key].motor)
        points.append((benches[key], speed))
    tasks = _tasks(points, axes, mode, follow, settling)
    answers: dict[int, list[dict[str, Any]]] = {}
    found: dict[int, dict[str, Any]] = {}
    fault: KeyboardInterrupt | SimulationError | None = None
    progress = progress or (lambda *_: None)
    try:
        if mode == "steady":
            progress(0, len(points))
            found = _steady(points, executor)
            tasks = [task for task in tasks if task.places[0] not in found]
        if tasks:
            _answer(tasks, executor, _after(progress, len(found)), answers)
        else:
            progress(len(points), len(points))
        _withhold_failed(points, found)
    except (KeyboardInterrupt, SimulationError) as error:
        fault = error
    found |= _found(tasks, answers)
    if fault is not None and not found:
        raise fault
    dataset = _dataset(
        motor,
        drive,
        source_of(drive, motor, law).to_dict(),
        axes,
        [found.get(place, _MISSING) for place in range(len(points))],
    )
    dataset.attrs["run"] = json.dumps({"mode": mode, "follow": follow, **settings})
    if fault is None:
        return dataset
    dataset.attrs["incomplete"] = f"{len(found)} of {len(points)} points are finished."
    if isinstance(fault, KeyboardInterrupt):
        raise Interrupted("The curve was interrupted.", dataset) from None
    fault.partial = dataset
    raise fault


def _solver(motor: Motor, drive: Drive | Driver, law: Law, mode: str, engine: Engine, **settings: Any) -> Solver:
    """Return how points are solved; compiled modules serve steady states at ideal voltages only."""
    reason = "" if mode == "steady" else f"The meters of mode = {mode!r} need the B-sources."
    reason = BEHIND_DRIVER if isinstance(drive, Driver) else reason
    return Solver(**settings, compiled=is_compiled(engine, motor, law, reason))


def _branch(
    motor: Motor, drive: Drive | Driver, axes: Mapping[str, Array], follow: str, **settings: Any
) -> xarray.Dataset:
    """Follow the branch of steady states along one axis."""
    assert isinstance(drive, Drive)
    along, others = axes[follow], {path: values for path, values in axes.items() if path != follow}
    for path, values in others.items():
        if len(values) > 1:
            raise ParameterError(
                f"{path} has {len(values)} values: a branch along {follow} is followed at one value. Give one, or take "
                "mode = 'settle'."
            )
    one = {path: float(values[0]) for path, values in others.items()}
    speed = one.pop(SPEED, None)
    on_drive = {path[6:]: value for path, value in one.items() if path.startswith("drive.")}
    on_motor = {path: value for path, value in one.items() if not path.startswith("drive.")}
    excitation = updated(drive, on_drive) if on_drive else drive
    assert isinstance(excitation, Drive)
    return steady_branch(
        motor.updated(on_motor) if on_motor else motor, excitation, follow="speed" if follow == SPEED else follow,
        start=float(along[0]), stop=float(along[-1]), speed=speed, **settings,
    )  # fmt: skip


def _way(mode: Method, drive: Drive | Driver) -> Method:
    """Return how the points are measured: a driver whose states are not known settles."""
    unknown = isinstance(drive, Driver) and (drive.own or drive.kind == "full-bridge")
    return "settle" if mode == "hold" or (mode == "steady" and unknown) else mode


def _check_driver(drive: Drive | Driver, mode: str, follow: str | None) -> None:
    if isinstance(drive, Driver) and (mode == "ramp" or follow):
        raise ParameterError(
            "A driver circuit does not go on from another point: mode must be 'steady' or 'settle', and follow must be "
            "left out."
        )


@checked
def operating_point(
    motor: Motor,
    drive: Drive | Driver,
    *,
    speed: float = 0.0,
    mode: Literal["steady", "settle", "hold"] = "steady",
    contact: ContactLaw | None = "spring-slider",
    step: float | None = None,
    tolerance: float = TOLERANCE,
    patience: int = PATIENCE,
    timeout: float | None = None,
    audit: bool = True,
    engine: Engine = "spice",
) -> dict[str, Any]:
    """Return the quantities of :func:`speed_torque` at one speed, plain and JSON-ready; ``sweep`` takes it as analysis.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        speed: at which the shaft is held, rad/s.
        mode: as in :func:`speed_torque`, but for ``"ramp"``.
        contact: as in :func:`speed_torque`.
        step: as in :func:`speed_torque`.
        tolerance: as in :func:`speed_torque`.
        patience: as in :func:`speed_torque`.
        timeout: as in :func:`speed_torque`.
        audit: as in :func:`speed_torque`; ``audit`` of the result has what was found.
        engine: as in :func:`speed_torque`.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    mode = _way(mode, drive)  # type: ignore[assignment]
    if mode not in ("steady", "settle"):
        raise ParameterError(f"mode = {quoted(mode)} is not valid: it must be 'steady' or 'settle'.")
    (speed,) = axis("speed", [speed])
    law = touching_law(contact, _NO_TORQUE)
    solver = _solver(motor, drive, law, mode, engine, step=step, timeout=timeout, audit=audit)
    bench = _dynamometer(motor, drive, {}, law, solver)
    Load(float(speed)).check(motor)
    settling = Settling(tolerance, patience)
    found = _steady([(bench, float(speed))], None) if mode == "steady" else {}
    _withhold_failed([(bench, float(speed))], found)
    outcome = found[0] if found else _settle(bench, float(speed), None, settling)[0]
    return _reported(bench, outcome)


def operating_points(points: Sequence[tuple[Motor, Drive, Mapping[str, Any]]]) -> list[dict[str, Any] | None]:
    """Return what :func:`operating_point` gives for many motors, drives and settings, which share runs of ngspice.

    ``None`` stands for a point that is better asked for by itself: without a stable steady state, refused, or failed.
    """
    benches: dict[int, tuple[Dynamometer, float]] = {}
    for place, (motor, drive, settings) in enumerate(points):
        given = {
            "speed": 0.0,
            "contact": "spring-slider",
            "step": None,
            "timeout": None,
            "engine": "spice",
            **settings,
        }
        try:
            law = touching_law(given["contact"], _NO_TORQUE)
            solver = _solver(motor, drive, law, "steady", given["engine"], step=given["step"], timeout=given["timeout"])
            bench = _dynamometer(motor, drive, {}, law, solver)
            Load(float(given["speed"])).check(motor)
        except (ParameterError, SimulationError, TypeError, ValueError):
            continue
        benches[place] = bench, float(given["speed"])
    try:
        found = _steady(list(benches.values()), None)
    except (ParameterError, SimulationError):
        return [None] * len(points)
    answers: list[dict[str, Any] | None] = [None] * len(points)
    for number, place in enumerate(benches):
        if number in found and not found[number]["findings"]:
            answers[place] = _reported(benches[place][0], found[number])
    return answers


def _reported(bench: Dynamometer, outcome: dict[str, Any]) -> dict[str, Any]:
    """Return the outcome of a point as :func:`operating_point` reports it."""
    motor = bench.motor
    compiled = bench.setup.solver.compiled and outcome["method"] != "settle"
    kept = {name: value for name, value in outcome.items() if name not in ("audit_passed", "findings")}
    warnings = list(exceeded(motor, outcome["ceramic_stress_pa"], outcome["temperature_rise_k"]))
    engine = "compiled" if compiled else "spice"
    return {**kept, "engine": engine, "warnings": warnings, "audit": Audit(outcome["findings"]).to_dict()}


# --- steady states ---


def _steady(points: Sequence[tuple[Dynamometer, float]], executor: Executor | None) -> dict[int, dict[str, Any]]:
    """Return by place the outcomes of the points that have a stable steady state."""
    setups = [
        replace(bench.setup, load=Load(speed), solver=replace(bench.setup.solver, audit=False))
        for bench, speed in points
    ]
    states = steady_states(setups) if executor is None else executor.submit(steady_states, setups).result()
    found = {}
    for place, state in enumerate(states):
        if state.stable:
            largest = float(np.abs(state.floquet_multipliers).max(initial=0.0))
            found[place] = {
                **state.quantities, "settled": True, "audit_passed": bool(state.audit.passed),
                "findings": state.audit.findings, "torque_error_n_m": state.torque_error_n_m,
                "largest_multiplier": largest, "torque_drift_n_m": 0.0, "simulated_s": state.provenance["simulated_s"],
                "deck_sha256": state.provenance["deck_sha256"], "method": state.method,
            }  # fmt: skip
    return found


def _withhold_failed(points: Sequence[tuple[Dynamometer, float]], found: dict[int, dict[str, Any]]) -> None:
    """Take out the outcomes that failed the audit, where that is an error.

    Raises:
        SimulationError: for the first of them.
    """
    failed = [place for place, (bench, _) in enumerate(points) if bench.setup.solver.audit and place in found]
    failed = [place for place in failed if found[place]["findings"]]
    findings = [(points[place][1], found.pop(place)["findings"]) for place in failed]
    for speed, finding in findings:
        Audit(finding).withhold(f"point at {speed:.4g} rad/s")


def _after(progress: Progress, finished: int) -> Progress:
    """Return what reports the progress of the remaining points."""
    return lambda done, total: progress(finished + done, finished + total)


# --- how a motion settles ---


@dataclass(frozen=True)
class Settling:
    """When a motion counts as settled, and when it is given up; see :func:`speed_torque`."""

    tolerance: float = TOLERANCE
    patience: int = PATIENCE

    def __post_init__(self) -> None:
        if not 1e-8 <= self.tolerance <= 0.1:
            raise ParameterError(f"tolerance = {self.tolerance:g} is not valid: it must be a number from 1e-8 to 0.1.")
        if not _FEWEST_BLOCKS <= self.patience <= 10_000:
            raise ParameterError(
                f"patience = {self.patience} is not valid: it must be a whole number from {_FEWEST_BLOCKS} to 10000."
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
    bench: Dynamometer, speed: float, start: Motion | None, settling: Settling, stop: Callable[[], bool] = bool
) -> tuple[dict[str, Any], Block]:
    """Run blocks until their means stay the same, or patience ends; return the outcome and the last block.

    The meters cost time; they come in when the next block is expected to be settled, and for the last half of patience.
    """
    if not bench.source.continues:
        return _settle_from_rest(bench, speed, settling, stop)
    soft_start = bench.source.rise_time
    # what goes on from another motion is driven at full amplitude
    begun = ceil(soft_start / bench.source.period) * bench.source.period if start else 0.0
    motion = replace(start, speed_rad_s=speed) if start else bench.rest(speed)
    blocks: list[Block] = []
    meters = False
    while True:
        if stop():
            raise SimulationError("The run was stopped because another one failed.")
        blocks.append(bench.run(motion, speed, begun, meters=meters))
        motion, begun = blocks[-1].end, blocks[-1].ended
        before, now = _groups(blocks)
        if before and begun - 2 * len(now) * bench.duration >= soft_start * (1.0 - 1e-9):
            if all(block.metered for block in now) and settling.holds(before, now):
                return _outcome(now, True, before, len(blocks)), blocks[-1]
            meters = meters or settling.holds(before, now, slack=_APPROACH)
        if len(blocks) >= settling.patience:
            now = [block for block in blocks[-(settling.patience // 2) :] if block.metered]
            return _outcome(now, False, before, len(blocks)), blocks[-1]
        meters = meters or len(blocks) >= settling.patience - settling.patience // 2


def _settle_from_rest(
    bench: Dynamometer, speed: float, settling: Settling, stop: Callable[[], bool]
) -> tuple[dict[str, Any], Block]:
    """Do the same in runs from rest, each of twice as many blocks as the one before."""
    number = min(2 * _FEWEST_BLOCKS, settling.patience)
    while True:
        if stop():
            raise SimulationError("The run was stopped because another one failed.")
        blocks = bench.run_from_rest(speed, number)
        for end in range(2, len(blocks) + 1):
            before, now = _groups(blocks[:end])
            if settling.holds(before, now):
                return _outcome(now, True, before, end), blocks[end - 1]
        if number >= settling.patience:
            return _outcome(blocks[-(number // 2) :], False, before, number), blocks[-1]
        number = min(2 * number, settling.patience)


def _groups(blocks: list[Block]) -> tuple[list[Block], list[Block]]:
    """Return the last two groups of blocks to compare: where the motion is irregular, more blocks may still settle."""
    size = max(1, len(blocks) // 10)
    return blocks[-2 * size : -size], blocks[-size:]


def _outcome(now: list[Block], settled: bool, before: list[Block], blocks: int) -> dict[str, Any]:
    drift = now[-1].torque - before[-1].torque
    return {
        **_audited(now), "settled": settled, "torque_drift_n_m": drift,
        "simulated_s": blocks * now[0].bench.duration, "deck_sha256": now[-1].deck_sha256,
        "torque_error_n_m": float("nan"), "largest_multiplier": float("nan"), "method": "settle",
    }  # fmt: skip


def _audited(blocks: list[Block]) -> dict[str, Any]:
    """Return the quantities over blocks, and what the audit found."""
    bench, means = blocks[0].bench, quantities(blocks)
    findings = audit_point(bench.motor, means, bench.setup.step)
    if bench.setup.solver.audit:
        Audit(findings).withhold(f"point at {blocks[-1].end.speed_rad_s:.4g} rad/s")
    return {**means, "audit_passed": not findings, "findings": findings}


def _ramp(
    bench: Dynamometer, speeds: Sequence[float], settling: Settling, falling: bool, stop: Callable[[], bool]
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
    points: tuple[tuple[Dynamometer, float], ...]
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


def _tasks(
    points: Sequence[tuple[Dynamometer, float]],
    axes: Mapping[str, Array],
    mode: Method,
    follow: str | None,
    settling: Settling,
) -> list[_Task]:
    """Return the tasks of the points: ramps in both directions, chains along an axis, or single points."""
    shape = tuple(len(axis) for axis in axes.values())
    places = np.arange(len(points)).reshape(shape)
    if mode == "ramp":
        rows = places.reshape(-1, shape[-1]).tolist()
        return [
            _Task(tuple(row), tuple(points[place] for place in row), settling, ramp)
            for row in rows
            for ramp in ("up", "down")
        ]
    chains = np.moveaxis(places, list(axes).index(follow), -1) if follow else places[..., np.newaxis]
    rows = chains.reshape(-1, chains.shape[-1]).tolist()
    return [_Task(tuple(row), tuple(points[place] for place in row), settling) for row in rows]


def _call(task: _Task) -> list[dict[str, Any]]:
    return task()


def _found(tasks: list[_Task], answers: Mapping[int, list[dict[str, Any]]]) -> dict[int, dict[str, Any]]:
    """Return by place what is finished there; of a ramp both ways."""
    ways: dict[int, list[dict[str, Any]]] = {}
    for number, answer in sorted(answers.items()):
        for place, outcome in zip(tasks[number].places, answer, strict=True):
            ways.setdefault(place, []).append(outcome)
    if not any(task.ramp for task in tasks):
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
        raise ParameterError(f"{name} = {quoted(values)} is not valid: it must be one or more numbers.")
    if name in ("speed", "speeds") and np.abs(given).max() > 1e6:
        worst = given[np.abs(given).argmax()]
        raise ParameterError(f"{name} has {worst:g} rad/s, which is not valid: it must be from -1e6 to 1e6 rad/s.")
    return given


def _check(axes: Mapping[str, Array], mode: str, follow: str | None) -> None:
    if mode not in get_args(Method):
        raise ParameterError(f"mode = {quoted(mode)} is not valid: it must be 'steady', 'settle' or 'ramp'.")
    if follow is not None and follow not in axes:
        raise ParameterError(f"follow = {quoted(follow)} is not valid: it must be one of {', '.join(axes)}.")
    if mode == "ramp" and follow is not None:
        raise ParameterError("A ramp goes on from speed to speed by itself; leave out follow, or take mode = 'settle'.")
    if mode == "ramp" and np.ptp(axes[SPEED]) == 0.0:
        raise ParameterError("A ramp needs two different speeds at least; give them, or take another mode.")
    count = int(np.prod([len(axis) for axis in axes.values()]))
    if count > _MOST_POINTS:
        raise ParameterError(f"The curve has {count} points; at most {_MOST_POINTS} are allowed.")


def _dynamometer(
    motor: Motor, drive: Drive | Driver, changes: Mapping[str, float], law: Law, solver: Solver
) -> Dynamometer:
    """Return the dynamometer at one place of the further axes."""
    on_drive = {path[6:]: value for path, value in changes.items() if path.startswith("drive.")}
    on_motor = {path: value for path, value in changes.items() if not path.startswith("drive.")}
    excitation = updated(drive, on_drive) if on_drive else drive
    if on_motor:
        motor = motor.updated(on_motor)
    setup = Setup(motor, source_of(excitation, motor, law), law=law, solver=solver)
    finest = Dynamometer(setup).duration / MOST_POINTS
    if setup.step < finest:
        raise ParameterError(
            f"step = {setup.step:g} s is not valid for a motion of {1.0 / setup.shortest_period:.4g} Hz: it must be "
            f">= {finest:.3g} s."
        )
    return Dynamometer(off_beat(setup))


def _dataset(
    motor: Motor,
    drive: Drive | Driver,
    excitation: dict[str, Any],
    axes: Mapping[str, Array],
    outcomes: list[dict[str, Any]],
) -> xarray.Dataset:
    from pyspice_runner.datasets import labelled

    shape = tuple(len(axis) for axis in axes.values())
    variables = {}
    for name, (unit, meaning) in OUTCOME.items():
        values = np.array([outcome[name] for outcome in outcomes]).reshape(shape)
        variables[name] = (tuple(axes), values, {"units": unit, "long_name": meaning})
    coordinates = {path: (path, axis, {"units": _unit(path, motor, drive)}) for path, axis in axes.items()}
    swept = any(path.startswith("drive.") for path in axes)
    decks = "".join(outcome["deck_sha256"] for outcome in outcomes)
    findings = dict.fromkeys(finding for outcome in outcomes for finding in outcome["findings"])
    stress, rise = (
        max((outcome[name] for outcome in outcomes if outcome[name] == outcome[name]), default=float("nan"))
        for name in ("ceramic_stress_pa", "temperature_rise_k")
    )
    warnings = list(exceeded(motor, stress, rise))
    attributes = {
        "audit": json.dumps(Audit(tuple(findings)).to_dict()),
        "warnings": json.dumps(warnings),
        "title": f"{motor.name}: {', '.join(['speed and torque', *([] if swept else [drive.label])])}",
        "parameter_set": motor.name,
        "motor": json.dumps(motor.to_dict()),
        "drive": json.dumps(excitation),
        "ngspice_version": ngspice_version(),
        "method": json.dumps([outcome["method"] for outcome in outcomes]),
        "deck_sha256": hashlib.sha256(decks.encode()).hexdigest(),
    }
    return labelled(variables, coordinates, attributes)


def _unit(path: str, motor: Motor, drive: Drive | Driver) -> str:
    return "rad/s" if path == SPEED else unit_in(path, motor, drive)
