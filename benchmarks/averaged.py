# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor: time of a second of spin-up and settled run, and of ten minutes of warm-up with a tracker.

The full motor runs for 20 ms; its time is scaled to one second.

.venv/bin/python -m benchmarks.averaged
"""

from __future__ import annotations

import time

import pyspice_runner as pr
from benchmarks.steady_state import cpu_seconds
from pyspice_runner.spice import Engine

SHORT, WHOLE, WARM_UP = 20e-3, 1.0, 600.0  # s


def main() -> None:
    """Print wall and CPU time of each run, and the ratio of full to averaged."""
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    pr.simulate_averaged(motor, drive, 1e-3)  # imports all modules
    print(f"{motor.name}, {drive.label}, {WHOLE:g} s of motor time; full: {SHORT * 1e3:g} ms, scaled")
    seconds = {}
    for name, duration in (("averaged", WHOLE), ("full", SHORT)):
        began, used = time.perf_counter(), cpu_seconds()
        if name == "full":
            run = pr.simulate(motor, drive, duration=duration)
        else:
            run = pr.simulate_averaged(motor, drive, duration)
        scale = WHOLE / duration
        seconds[name] = scale * (cpu_seconds() - used)
        wall = scale * (time.perf_counter() - began)
        solver = scale * run.solver_seconds
        print(f"{name:8s} {wall:7.2f} s wall, {seconds[name]:7.2f} s CPU, ngspice alone {solver:7.2f} s wall")
    print(f"averaged is {seconds['full'] / seconds['averaged']:.0f} times faster")
    tracker = pr.Tracker(
        kind="pll", voltage=60.0, phase_deg=drive.phase_deg, frequency=drive.frequency, target_deg=-30.0
    )
    engines: tuple[Engine, ...] = ("compiled", "spice")
    for engine in engines:
        pr.track(motor, tracker, duration=2e-3, averaged=True, engine=engine)  # compiles
        began, used = time.perf_counter(), cpu_seconds()
        found = pr.track(motor, tracker, disturb="warm-up", duration=WARM_UP, averaged=True, engine=engine)
        assert found.locked
        print(
            f"{WARM_UP:g} s of warm-up with a tracker, {engine}: {time.perf_counter() - began:.2f} s wall, "
            f"{cpu_seconds() - used:.2f} s CPU, {len(found.time_s)} points"
        )


if __name__ == "__main__":
    main()
