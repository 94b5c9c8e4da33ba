# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states: cost of a curve over the number of points, and random motors compared with settling.

.venv/bin/python -m benchmarks.steady_state cost 1 3 10 30 100
.venv/bin/python -m benchmarks.steady_state random 200
"""

from __future__ import annotations

import os
import resource
import sys
import time
from collections import Counter
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.analysis.speed_torque import operating_point
from pyspice_runner.analysis.steady import SteadyState
from tests.soak import case

LONGEST = 20.0  # s, of a run of ngspice in the random study
SEED = 16


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


def random(count: int) -> None:
    """Print by method how many random points were solved, and their deviation from settling."""
    methods: Counter[str] = Counter()
    verdicts: Counter[str] = Counter()
    index = -1
    while methods.total() < count:
        index += 1
        subject = case(SEED, index)
        if not isinstance(subject.drive, pr.TwoPhaseDrive | pr.TwoToneDrive) or subject.settings.get("contact") is None:
            continue
        point: dict[str, Any] = {"speed": subject.settings.get("speed") or 0.0, "contact": subject.settings["contact"]}
        point |= {"timeout": LONGEST, "audit": False}
        try:
            state = pr.steady_state(subject.motor, subject.drive, **point)
        except (pr.ParameterError, pr.SimulationError) as error:
            methods["refused" if isinstance(error, pr.ParameterError) else "failed"] += 1
            continue
        methods[state.method or "not found"] += 1
        if state.converged:
            found = verdict(subject.motor, subject.drive, state, point)
            verdicts[found] += 1
            if found == "differs":
                print(f"case {index} differs: {state}", flush=True)
    print(f"{count} cases:", dict(methods), "; of those found:", dict(verdicts))


def verdict(motor: pr.Motor, drive: Any, state: SteadyState, point: dict[str, Any]) -> str:
    """Return the deviation of a steady state from the result of settling."""
    if not state.stable:
        return "unstable"
    if state.audit.findings:
        return "fails the audit"
    try:
        settled = operating_point(motor, drive, mode="settle", **point)
    except (pr.ParameterError, pr.SimulationError):
        return "not settled: failed or refused"
    if not settled["settled"]:
        return "not settled in time"
    force = max(motor.contact.preload_n, settled["normal_force_n"])
    allowed = 5e-3 * motor.contact.friction * force * motor.rotor.radius_m + state.torque_error_n_m
    return "agrees" if abs(state.torque_n_m - settled["torque_n_m"]) <= allowed else "differs"


if __name__ == "__main__":
    if sys.argv[1] == "cost":
        cost([int(text) for text in sys.argv[2:]])
    else:
        random(int(sys.argv[2]))
