# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled engine at an error of 0.5 %, beside the B-sources, scipy's fastest solver and compiled Runge-Kutta.

The two cases and their errors are those of ``work_precision.py``. All times are medians of runs in turn within one
process; compilation and comparison come before, and the start of ngspice is measured apart. It takes the tools of
``make verilog-a``; without them it says so. Each solver has the coarsest of its settings that is below 0.5 %.
"""

from __future__ import annotations

import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from work_precision import CASES, DURATION, Case

import pyspice_runner as pr
from pyspice_runner.circuit.bench import DriveSource
from pyspice_runner.run.point import Point

TARGET = Path(__file__).with_suffix(".json")
ROUNDS = 7
# the coarsest settings of each solver below 0.5 %: points a period of the fastest motion, relative tolerance, step in s
POINTS = {"sliding": 24, "intermittent contact": 21}
LSODA = {"sliding": 1e-4, "intermittent contact": 1.25e-4}
RUNGE_KUTTA = {"sliding": 5e-7, "intermittent contact": 2e-6}


def ours(case: Case, engine: str, points: int, duration: float = DURATION) -> tuple[float, int]:
    """A run of the package: its error and its number of points."""
    step = Point(case.motor, DriveSource(case.drive)).shortest_period / points
    run = pr.simulate(
        case.motor, case.drive, duration=duration, step=step, signals=("tip_x_m", "tip_y_m"), engine=engine,
    )  # fmt: skip
    return (case.error(run.time_s, run.tip_x_m, run.tip_y_m) if duration == DURATION else 0.0), run.points


def medians(tasks: dict[str, Callable[[], Any]]) -> dict[str, float]:
    """Median wall time in s of tasks that run in turn, after one run of each that does not count."""
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for number in range(ROUNDS + 1):
        for name, task in tasks.items():
            began = time.perf_counter()
            task()
            if number:
                seconds[name].append(time.perf_counter() - began)
    return {name: statistics.median(values) for name, values in seconds.items()}


def measured(name: str) -> dict[str, Any]:
    """Errors, wall times and ratios of one case."""
    case = Case(*CASES[name])
    tasks: dict[str, Callable[[], Any]] = {
        "compiled engine": lambda: ours(case, "compiled", POINTS[name]),
        "B-sources": lambda: ours(case, "spice", POINTS[name]),
        "LSODA": lambda: case.scipy("LSODA", LSODA[name]),
        "Runge-Kutta, numba": lambda: case.compiled(RUNGE_KUTTA[name]),
        "start": lambda: ours(case, "compiled", POINTS[name], duration=DURATION / 200),
        "four times as long": lambda: ours(case, "compiled", POINTS[name], duration=4 * DURATION),
    }
    errors = {key: tasks[key]() for key in ("compiled engine", "B-sources", "LSODA", "Runge-Kutta, numba")}
    seconds = medians(tasks)
    ratio = {key: seconds[key] / seconds["compiled engine"] for key in errors}
    stepping = seconds["compiled engine"] - seconds["start"]
    points = errors["compiled engine"][1]
    cost = (seconds["four times as long"] - seconds["compiled engine"]) / (3 * points)
    return {
        "error": {key: value[0] if isinstance(value, tuple) else value for key, value in errors.items()},
        "seconds": seconds, "times_the_compiled_engine": ratio,
        "times_the_compiled_engine_without_its_start": {key: seconds[key] / stepping for key in errors},
        "point_us": 1e6 * cost, "points": points,
    }  # fmt: skip


def main() -> None:
    """Measure both cases, print a line for each and write all as JSON."""
    document = {}
    for name in CASES:
        try:
            document[name] = measured(name)
        except pr.SimulationError as error:
            print(f"The compiled engine cannot be measured: {error}")
            return
        print(name, json.dumps(document[name]), flush=True)
    TARGET.write_text(json.dumps(document, separators=(",", ":")) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
