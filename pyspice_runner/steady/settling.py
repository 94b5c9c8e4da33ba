# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of a curve that run on the dynamometer until they have settled, or while the speed slowly changes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Any, Literal

import numpy as np

from pyspice_runner.circuit.fixtures import SpeedRamp
from pyspice_runner.circuit.state import Motion
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.run.audit import audit_point
from pyspice_runner.run.dynamometer import UNITS, Block, Dynamometer, quantities
from pyspice_runner.run.waveforms import Array
from pyspice_runner.steady.period_map import cores

Progress = Callable[[int, int], None]

TOLERANCE = 1e-3
PATIENCE = 40
RAMP_BLOCKS = 16  # of a ramp from the lowest speed to the highest, at least
_FEWEST_BLOCKS = 4  # of patience
_APPROACH = 100.0  # times a motion may be nearer after a block: e at least, 20 to 100 while the driven modes settle
_SMALL = 0.02  # of the friction torque that the mean normal force allows; drifts below tolerance times this are noise


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


def settle(
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
    return {
        **_audited(now), "settled": settled, "torque_drift_n_m": now[-1].torque - before[-1].torque,
        "simulated_s": blocks * now[0].bench.duration, "deck_sha256": now[-1].deck_sha256,
        "torque_error_n_m": float("nan"), "largest_multiplier": float("nan"), "method": "settle",
    }  # fmt: skip


def _audited(blocks: list[Block]) -> dict[str, Any]:
    """Return the quantities over blocks, and the findings of the audit."""
    bench, means = blocks[0].bench, quantities(blocks)
    findings = audit_point(bench.motor, means, bench.setup.step)
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
    first, last = settle(bench, float(edges[0]), None, settling, stop)
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


@dataclass(frozen=True)
class Task:
    """Points that one worker runs, one after the other: a chain, a ramp, or a single point."""

    places: tuple[int, ...]
    points: tuple[Dynamometer, ...]
    settling: Settling
    ramp: Literal["up", "down"] | None = None

    def __call__(self, stop: Callable[[], bool] = bool) -> list[dict[str, Any]]:
        """Run the points and return their outcomes; ``stop`` tells whether to end early."""
        if self.ramp:
            speeds = [bench.speed for bench in self.points]
            return _ramp(self.points[0], speeds, self.settling, self.ramp == "down", stop)
        outcomes: list[dict[str, Any]] = []
        motion = None
        for bench in self.points:
            outcome, last = settle(bench, bench.speed, motion, self.settling, stop)
            motion = last.end
            outcomes.append(outcome)
        return outcomes


def tasks_of(
    points: Sequence[Dynamometer],
    axes: Mapping[str, Array],
    mode: str,
    follow: str | None,
    settling: Settling,
) -> list[Task]:
    """Return the tasks of the points: ramps in both directions, chains along an axis, or single points."""
    ways: tuple[Literal["up", "down"] | None, ...] = (None,)
    if mode == "ramp":
        *_, follow = axes
        ways = ("up", "down")
    places = np.arange(len(points)).reshape([len(axis) for axis in axes.values()])
    chains = np.moveaxis(places, list(axes).index(follow), -1) if follow else places[..., np.newaxis]
    rows = chains.reshape(-1, chains.shape[-1]).tolist()
    return [Task(tuple(row), tuple(points[place] for place in row), settling, way) for row in rows for way in ways]


def run_tasks(
    tasks: Sequence[Task], executor: Executor | None, progress: Progress, answers: dict[int, list[dict[str, Any]]]
) -> None:
    """Run the tasks and add their outcomes to ``answers``, by the number of the task.

    If a task fails, or the user interrupts, the running ones stop at the end of their block and the others are
    cancelled. ``answers`` then has the outcomes of those that were finished.
    """
    done, total = 0, sum(len(task.places) for task in tasks)
    progress(0, total)
    if executor is None and len(tasks) == 1:  # in this thread, which an interrupt reaches at once
        answers[0] = tasks[0]()
        progress(total, total)
        return
    stop = threading.Event()
    futures: list[Future[list[dict[str, Any]]]] = []
    try:
        with nullcontext(executor) if executor else ThreadPoolExecutor(min(cores(), len(tasks))) as pool:
            assert pool is not None
            arguments = () if executor else (stop.is_set,)  # an event does not reach another process
            try:
                futures += (pool.submit(task, *arguments) for task in tasks)
                for future in futures:
                    done += len(future.result())
                    progress(done, total)
            except BaseException:
                stop.set()
                for future in futures:
                    future.cancel()
                raise
    finally:
        for number, future in enumerate(futures):
            if future.done() and not future.cancelled() and future.exception() is None:
                answers[number] = future.result()


def outcomes_of(tasks: list[Task], answers: Mapping[int, list[dict[str, Any]]]) -> dict[int, dict[str, Any]]:
    """Return by place what is finished there; of a ramp both ways."""
    ways: dict[int, list[dict[str, Any]]] = {}
    for number, answer in sorted(answers.items()):
        for place, outcome in zip(tasks[number].places, answer, strict=True):
            ways.setdefault(place, []).append(outcome)
    if not any(task.ramp for task in tasks):
        return {place: outcome for place, (outcome,) in ways.items()}
    return {place: _between(*both) for place, both in ways.items() if len(both) == 2}
