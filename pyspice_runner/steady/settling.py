# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of a curve that run on the dynamometer until they have settled."""

from __future__ import annotations

import statistics
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

from pyspice_runner.circuit.state import Motion
from pyspice_runner.errors import SimulationError, require
from pyspice_runner.run.audit import audit_point
from pyspice_runner.run.dynamometer import Block, Dynamometer, quantities
from pyspice_runner.steady.period_map import cores

Progress = Callable[[int, int], None]

TOLERANCE = 1e-3
PATIENCE = 40
_FEWEST_BLOCKS = 4  # of patience
_APPROACH = 100.0  # times a motion may be nearer after a block: e at least, 20 to 100 while the driven modes settle
_SMALL = 0.02  # of the friction torque that the mean normal force allows; drifts below tolerance times this are noise


@dataclass(frozen=True)
class Settling:
    """When a motion counts as settled, and when it is given up; see :func:`speed_torque`."""

    tolerance: float = TOLERANCE
    patience: int = PATIENCE

    def __post_init__(self) -> None:
        require(1e-8 <= self.tolerance <= 0.1, "tolerance", self.tolerance, "a number from 1e-8 to 0.1")
        words = f"a whole number from {_FEWEST_BLOCKS} to 10000"
        require(_FEWEST_BLOCKS <= self.patience <= 10_000, "patience", self.patience, words)

    def holds(self, before: Sequence[Block], now: Sequence[Block], slack: float = 1.0) -> bool:
        """Whether the means of two successive groups of blocks are the same, to so many times the tolerance."""
        bench = now[0].bench
        torques, forces = ([_mean(group, name) for group in (before, now)] for name in ("torque", "normal_force"))
        energies = [bench.stored(group[-1].end) for group in (before, now)]
        scales = (_torque_scale(now), forces[1], 4.0 * energies[1])
        return all(
            abs(pair[1] - pair[0]) <= slack * self.tolerance * scale
            for pair, scale in zip((torques, forces, energies), scales, strict=True)
        )


def _mean(blocks: Sequence[Block], name: str) -> float:
    return statistics.fmean(getattr(block, name) for block in blocks)


def _torque_scale(blocks: Sequence[Block]) -> float:
    """Return the mean torque, without sign, plus a small part of what friction can transmit."""
    motor = blocks[0].bench.setup.motor
    friction_torque = motor.contact.friction * motor.rotor.radius_m * _mean(blocks, "normal_force")
    return abs(_mean(blocks, "torque")) + _SMALL * friction_torque


def settle(
    bench: Dynamometer, start: Motion | None, settling: Settling, stop: Callable[[], bool] = bool
) -> tuple[dict[str, Any], Block]:
    """Run blocks until their means stay the same, or patience ends; return the outcome and the last block.

    The meters cost time; they come in when the next block is expected to be settled, and for the last half of patience.
    """
    source = bench.setup.source
    if (drive := source.ideal) is None:
        return _settle_from_rest(bench, settling, stop)
    # what goes on from another motion is driven at full amplitude
    begun = ceil(drive.soft_start / source.period) * source.period if start else 0.0
    motion = replace(start, speed_rad_s=bench.speed) if start else bench.rest()
    blocks: list[Block] = []
    meters = False
    while True:
        if stop():
            raise SimulationError("The run was stopped because another one failed.")
        blocks.append(bench.run(motion, begun, meters=meters))
        motion, begun = blocks[-1].end, blocks[-1].ended
        before, now = _groups(blocks)
        if before and begun - 2 * len(now) * bench.duration >= drive.soft_start * (1.0 - 1e-9):
            if all(block.metered for block in now) and settling.holds(before, now):
                return _outcome(now, before, len(blocks), settling.tolerance, True), blocks[-1]
            meters = meters or settling.holds(before, now, slack=_APPROACH)
        if len(blocks) >= settling.patience:
            now = [block for block in blocks[-(settling.patience // 2) :] if block.metered]
            return _outcome(now, before, len(blocks), settling.tolerance, False), blocks[-1]
        meters = meters or len(blocks) >= settling.patience - settling.patience // 2


def _settle_from_rest(bench: Dynamometer, settling: Settling, stop: Callable[[], bool]) -> tuple[dict[str, Any], Block]:
    """Do the same in runs from rest, each of twice as many blocks as the one before."""
    number = min(2 * _FEWEST_BLOCKS, settling.patience)
    while True:
        if stop():
            raise SimulationError("The run was stopped because another one failed.")
        blocks = bench.run_from_rest(number)
        for end in range(2, len(blocks) + 1):
            before, now = _groups(blocks[:end])
            if settling.holds(before, now):
                return _outcome(now, before, end, settling.tolerance, True), blocks[end - 1]
        if number >= settling.patience:
            return _outcome(blocks[-(number // 2) :], before, number, settling.tolerance, False), blocks[-1]
        number = min(2 * number, settling.patience)


def _groups(blocks: list[Block]) -> tuple[list[Block], list[Block]]:
    """Return the last two groups of blocks to compare: where the motion is irregular, more blocks may still settle."""
    size = max(1, len(blocks) // 10)
    return blocks[-2 * size : -size], blocks[-size:]


def _scatter(values: Sequence[float]) -> float:
    """Return twice the standard error of a mean over time, the largest over means of 1, 2, 4, … values; 0 for few.

    Longer means have the scatter of slow motions, too. H. Flyvbjerg, H. G. Petersen, J. Chem. Phys. 91, 461 (1989).
    """
    largest, size = 0.0, 1
    while (count := len(values) // size) >= _FEWEST_BLOCKS:
        means = [statistics.fmean(values[place * size : (place + 1) * size]) for place in range(count)]
        largest = max(largest, 2.0 * statistics.stdev(means) / count**0.5)
        size *= 2
    return largest


def _outcome(now: list[Block], before: list[Block], blocks: int, tolerance: float, settled: bool) -> dict[str, Any]:
    bench, means = now[0].bench, quantities(now)
    findings = audit_point(bench.setup.motor, means, bench.setup.step)
    error = max(tolerance * _torque_scale(now), _scatter([block.torque for block in now]))
    return {
        **means, "audit_passed": not findings, "findings": findings, "settled": settled,
        "torque_drift_n_m": now[-1].torque - before[-1].torque, "simulated_s": blocks * bench.duration,
        "deck_sha256": now[-1].deck_sha256, "torque_error_n_m": error, "largest_multiplier": float("nan"),
        "method": "settle",
    }  # fmt: skip


def settle_points(
    points: Mapping[int, Dynamometer], settling: Settling, progress: Progress, outcomes: dict[int, dict[str, Any]]
) -> None:
    """Let points settle, each from rest, and add their outcomes by place to ``outcomes``.

    If one fails, or the user interrupts, the running ones stop at the end of their block and the others are cancelled.
    ``outcomes`` then has those that are finished.
    """
    progress(0, len(points))
    if len(points) == 1:  # in this thread, which an interrupt reaches at once
        ((place, bench),) = points.items()
        outcomes[place] = settle(bench, None, settling)[0]
        progress(1, 1)
        return
    stop = threading.Event()
    futures: dict[int, Future[tuple[dict[str, Any], Block]]] = {}
    try:
        with ThreadPoolExecutor(min(cores(), len(points))) as pool:
            try:
                for place, bench in points.items():
                    futures[place] = pool.submit(settle, bench, None, settling, stop.is_set)
                for done, future in enumerate(futures.values(), start=1):
                    future.result()
                    progress(done, len(points))
            except BaseException:
                stop.set()
                for future in futures.values():
                    future.cancel()
                raise
    finally:
        for place, future in futures.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                outcomes[place] = future.result()[0]
