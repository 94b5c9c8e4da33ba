# SPDX-License-Identifier: GPL-3.0-or-later
"""Sweeps: gain of a second worker on 100 points, and memory of a worker over 1,000 points."""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import pyspice_runner as pr

POINTS = 100
DURATION = 1e-3  # s
STEP = 1.8e-7  # s
REPEATS = 5
MANY, FEW = 1000, 10
SHORT = 1e-4  # s, of the 1,000 points

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)


def seconds(workers: int) -> float:
    """Return the wall time of a sweep of the flagship, including the start of the workers.

    The step is stated: without one, each point has two coarser runs beside it for the estimated error, and one worker
    uses two cores.
    """
    motor, frequencies = pr.load_motor("bimodal40"), np.linspace(40.4e3, 41.4e3, POINTS)
    with tempfile.TemporaryDirectory() as store:
        began = time.perf_counter()
        pr.sweep(
            motor, pr.default_drive(motor), over={"drive.frequency": frequencies}, workers=workers, store=store,
            duration=DURATION, step=STEP,
        )  # fmt: skip
        return time.perf_counter() - began


def worker_memory(counts: Sequence[int]) -> list[int]:
    """Return the resident memory of one worker in bytes after a number of points."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool, tempfile.TemporaryDirectory() as store:
        memory, done = [], 0
        for count in counts:
            voltages = np.linspace(20.0, 60.0, counts[-1])[done:count]
            pr.sweep(MOTOR, DRIVE, over={"drive.voltage": voltages}, executor=pool, store=store, duration=SHORT)
            memory.append(pool.submit(_resident_bytes).result())
            done = count
    return memory


def _resident_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main() -> None:
    """Measure, and print a line for each."""
    times = [(seconds(1), seconds(2)) for _ in range(REPEATS)]
    one, two = (statistics.median(each) for each in zip(*times, strict=True))
    ratios = sorted(first / second for first, second in times)
    print(
        f"{POINTS} points of {1e3 * DURATION:g} ms of bimodal40: one worker {one:.1f} s, two {two:.1f} s, "
        f"{ratios[REPEATS // 2]:.2f} times as fast ({ratios[0]:.2f} to {ratios[-1]:.2f})",
        flush=True,
    )
    few, many = worker_memory([FEW, MANY])
    print(
        f"a worker's memory: {few / 1e6:.1f} MB after {FEW} points, {many / 1e6:.1f} MB after {MANY}: "
        f"{(many - few) / 1e6:+.1f} MB"
    )


if __name__ == "__main__":
    main()
