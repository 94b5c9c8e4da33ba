# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states: cost of a curve over the number of points.

.venv/bin/python -m benchmarks.steady_state cost 1 3 10 30 100
"""

from __future__ import annotations

import os
import resource
import sys
import time

import numpy as np

import pyspice_runner as pr


def cpu_seconds() -> float:
    """Return the CPU time in s of this process and of its ended children."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def cost(counts: list[int]) -> None:
    """Print wall time, CPU time and memory over the number of points; settling is timed on three of them."""
    motor = pr.load_motor("andersen2002-unintended-mode")
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
    pr.steady_state(motor, drive, speed=0.0)  # imports all modules
    began, used = time.perf_counter(), cpu_seconds()
    pr.speed_torque(motor, drive, speeds=[-5.0, 10.0, 25.0], mode="settle")
    print(
        f"settle: {(time.perf_counter() - began) / 3:.2f} s wall and {(cpu_seconds() - used) / 3:.2f} s CPU a point",
        flush=True,
    )
    print("points  wall/s  CPU/s  CPU a point/s  memory of the largest ngspice/MB")
    for count in counts:
        began, used = time.perf_counter(), cpu_seconds()
        curve = pr.speed_torque(motor, drive, speeds=np.linspace(-10.0, 30.0, count))
        wall, cpu = time.perf_counter() - began, cpu_seconds() - used
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
        assert curve["settled"].all()
        print(f"{count:6d}  {wall:6.2f}  {cpu:5.2f}  {cpu / count:13.3f}  {memory:.0f}", flush=True)


if __name__ == "__main__":
    cost([int(text) for text in sys.argv[2:]])
