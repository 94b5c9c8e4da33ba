# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that run until they have settled: on the dynamometer, and in time averages of unstable periodic motions.

A time average is that of a motor from preloaded rest, or of a free rotor from the speed of its periodic motion, in
blocks as long as the slowest mode takes to decay. Means over blocks have the weights sin², so that a modulation that
does not fit into them has no share in it. S. Das, Y. Saiki, E. Sander, J. A. Yorke, "Quantitative quasiperiodicity",
Nonlinearity 30, 4111 (2017).
"""

from __future__ import annotations

import statistics
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np

from pyspice_runner.circuit.state import Motion
from pyspice_runner.errors import SimulationError, require
from pyspice_runner.run.audit import audit_point
from pyspice_runner.run.dynamometer import FEWEST_PERIODS, GOLDEN, Block, Dynamometer, quantities
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.period_map import PeriodMap, cores, extrapolated, in_threads, mean_of, means
from pyspice_runner.steady.shooting import Orbit, rest

Progress = Callable[[int, int], None]
Means = dict[str, float]
Run = Callable[[Mapping[int, Copy], PeriodMap], Mapping[int, tuple[Means, Copy]]]  # as :func:`run_block`

TOLERANCE = 1e-3
PATIENCE = 40
_FEWEST_BLOCKS = 4  # of patience
_APPROACH = 100.0  # times a motion may be nearer after a block: e at least, 20 to 100 while the driven modes settle
AVERAGE = "time average"  # the method of such a point
_FEWEST, _MOST, _CHECKED = 8, 20, 4  # blocks of a time average that count, and blocks between its checks
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
    motion = {**start, "speed": bench.speed} if start else bench.rest()
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
    stop, turn = threading.Event(), threading.Lock()

    def settled(place: int) -> None:
        outcome = settle(points[place], None, settling, stop.is_set)[0]
        with turn:
            outcomes[place] = outcome
            progress(len(points.keys() & outcomes.keys()), len(points))

    in_threads(settled, list(points), cores(), stop.set)


def run_block(copies: Mapping[int, Copy], blocks: PeriodMap) -> dict[int, tuple[Means, Copy]]:
    """Return by place the means over a block of the copies that ngspice can run, and the copies at its end."""
    found = {}
    for (place, copy), trace in zip(copies.items(), blocks.traces(list(copies.values())), strict=True):
        if trace is not None:
            after = replace(copy, state=trace.states[:, -1], begun=float(trace.time[-1]))
            found[place] = means(copy.plant, trace, blocks.discretisation), after
    return found


def time_averages(
    points: Mapping[int, Orbit], period_map: PeriodMap, accuracy: float, run: Run = run_block
) -> tuple[dict[int, tuple[Means, float]], list[PeriodMap], dict[int, Copy]]:
    """Return by place the means of running motors with the error of the mean friction force (N), the maps, the ends.

    The motors run until the means of each vary by less than ``accuracy`` times the friction under the preload, or for
    :data:`_MOST` blocks that count: the second half, since they start from rest. They go on at half the step, for the
    means at a vanishing step. The error is what the means vary, and the difference to the finer step. A motor that
    ngspice cannot run is left out. What ``run`` measures behind a driver, whose steps are not uniform, is not
    extrapolated, and network and plates start as in the periodic motion.
    """
    longest = max(point.plant.motor.decay_s for point in points.values())
    periods = max(FEWEST_PERIODS, ceil(longest / period_map.period))
    copies = {}
    for place, point in points.items():
        state, turning = rest(point.plant), point.plant.places["rotor"]
        state[turning] = point.state[turning]
        if point.plant.driver:
            state[point.plant.inner :] = point.state[point.plant.inner :]
        copies[place] = Copy(point.plant, state)
    steps = round(periods * (period_map.steps + GOLDEN))  # which move through the period, so that rounding averages out
    coarse, fine = (period_map.of(periods * period_map.period, finer * steps) for finer in (1, 2))
    before = _averages(copies, coarse, accuracy, run, settled=False)
    found = {}
    for place, (mean, error) in _averages(copies, fine, accuracy, run, settled=True).items():
        rough, driven = before[place][0], copies[place].plant.driver
        limit = mean if driven else extrapolated(mean, rough, fine.steps / coarse.steps)
        change = mean["friction"] - (rough if driven else limit)["friction"]
        found[place] = limit, max(error, before[place][1]) + abs(change)
    return found, [coarse, fine], copies


def _averages(
    copies: dict[int, Copy], blocks: PeriodMap, accuracy: float, run: Run, *, settled: bool
) -> dict[int, tuple[Means, float]]:
    """Run copies, leave them at their ends, and return their means with what these vary, in N."""
    passed: dict[int, list[Means]] = {place: [] for place in copies}
    found: dict[int, tuple[Means, float]] = {}
    for number in range(1, (1 if settled else 2) * _MOST + 1):
        after = run(copies, blocks)
        for place in list(copies):
            if place not in after:
                del copies[place]
                continue
            mean, copies[place] = after[place]
            passed[place].append(mean)
        first = 0 if settled else number // 2
        if number - first < _FEWEST or number % _CHECKED:
            continue
        found = {place: _average(passed[place][first:], copy.plant) for place, copy in copies.items()}
        if all(error <= accuracy * copies[place].plant.friction_n for place, (_, error) in found.items()):
            break
    return found


def _average(blocks: Sequence[Means], plant: Plant) -> tuple[Means, float]:
    """Return weighted means, and how much those over the first, the middle and the last half differ.

    The difference is one of friction forces in N; of speeds it is relative to the maximum, and normal forces count by
    the friction that they allow.
    """
    half = len(blocks) // 2
    every, *parts = [
        mean_of(some, np.sin(np.pi * (np.arange(len(some)) + 0.5) / len(some)) ** 2)
        for some in (blocks, *(blocks[first : first + half] for first in (0, half // 2, half)))
    ]
    fastest = max(abs(block["speed"]) for block in blocks) or 1.0
    scales = {"friction": 1.0, "normal": plant.motor.contact.friction, "speed": plant.friction_n / fastest}
    every |= {name: max(block[name] for block in blocks) for name in ("ceramic_strain", "ceramic_stress_pa")}
    return every, max(scale * float(np.ptp([part[name] for part in parts])) for name, scale in scales.items())
