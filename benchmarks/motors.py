# SPDX-License-Identifier: GPL-3.0-or-later
"""Curves, maps, transients and small times of the motors that people use.

.venv/bin/python -m benchmarks.motors                  # all but the last two, on an idle machine: some twenty minutes
.venv/bin/python -m benchmarks.motors curves settled   # some of its parts
.venv/bin/python -m benchmarks.motors cluster          # 10,000 points on four local workers, one of which is ended
.venv/bin/python -m benchmarks.motors settling         # of docs/steady_state.md; of CPU time, some six minutes
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import xarray

import pyspice_runner as pr
from benchmarks.cluster import after_a_death
from benchmarks.steady_state import at_equal_accuracy
from pyspice_runner.run.point import Point
from validation.lift_off import CAMPAIGN as LIFT_OFF

ROOT = Path(__file__).resolve().parent.parent
REPEATS = 5
BRUSH = pr.Law("brush", 8)
SETTLED = 1e-4  # a tenth of the tolerance of settling
PATIENCE = 400  # blocks: the carrier of the paper's second motor needs about a hundred
EVERY = 5  # one of this number of speeds is left to settle


@dataclass(frozen=True)
class Subject:
    """A motor with its drive and 21 speeds in four quadrants."""

    name: str
    motor: pr.Motor
    drive: pr.TwoPhaseDrive
    speeds: np.ndarray  # rad/s

    @property
    def friction_torque(self) -> float:
        """μ F₀ R, N·m."""
        contact = self.motor.contact
        return contact.friction * contact.preload_n * self.motor.rotor.radius_m


def subjects() -> Iterator[Subject]:
    """Return the motors: the paper's two sets, the flagship, and a plate that is open for 65 % of the time."""
    for name, drive, first, last in (
        ("andersen2002", pr.TwoPhaseDrive(voltage=200.0, frequency=51.7e3, phase_deg=90.0), -5.0, 12.0),
        ("andersen2002-unintended-mode", pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0), -10.0, 30.0),
    ):
        motor, speeds = pr.load_motor(name), np.linspace(first, last, 21)
        yield Subject(f"{name}, fixed distance", motor.updated({"mount": None}), drive, speeds)
        yield Subject(f"{name}, mount", motor, drive, speeds)
    motor = pr.load_motor("bimodal40")
    yield Subject(motor.name, motor, pr.default_drive(motor), np.linspace(-20.0, 50.0, 21))  # type: ignore[arg-type]
    plate = pr.load_motor(str(ROOT / "examples" / "plate40.toml"))
    speeds = np.linspace(-0.2, 0.5, 21) / plate.rotor.radius_m
    for voltage in (100.0, 150.0):
        drive = pr.TwoPhaseDrive(voltage=voltage, frequency=40.2e3, phase_deg=70.0)
        yield Subject(f"plate40, {voltage:g} V", plate, drive, speeds)


def used() -> float:
    """Return the CPU time in s of this process and of its ended children."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def timed(task: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float]:
    """Return the medians of wall time and CPU time in s."""
    walls, spent = [], []
    for _ in range(repeats):
        began, before = time.perf_counter(), used()
        task()
        walls.append(time.perf_counter() - began)
        spent.append(used() - before)
    return statistics.median(walls), statistics.median(spent)


def curve(one: Subject, law: pr.Law | str) -> xarray.Dataset:
    """Return the curve of a motor."""
    return pr.speed_torque(one.motor, one.drive, speeds=one.speeds, contact=law)


def curves() -> None:
    """Print the times of curves of 21 speeds with both laws, and what they are against the unintended mode's."""
    pr.steady_state(pr.load_motor("andersen2002"), pr.default_drive(pr.load_motor("andersen2002")), speed=0.0)  # loads
    print("| motor | open | spring-slider, s | CPU, s | brush of 8, s | CPU, s | brush over slider, CPU | found by |")
    print("|---|---|---|---|---|---|---|---|")
    taken: dict[str, tuple[float, float]] = {}
    for one in subjects():
        found = [curve(one, law) for law in ("spring-slider", BRUSH)]
        methods = Counter(method for each in found for method in json.loads(each.attrs["method"]))
        (wall, spent), (brush_wall, brush_spent) = (timed(partial(curve, one, law)) for law in ("spring-slider", BRUSH))
        taken[one.name] = wall, spent
        print(
            f"| {one.name} | {100.0 * float(found[0].separated.max()):.0f} % | {wall:.2f} | {spent:.2f} | "
            f"{brush_wall:.2f} | {brush_spent:.2f} | {brush_spent / spent:.2f} | "
            f"{', '.join(f'{count} {method}' for method, count in methods.items())} |",
            flush=True,
        )
    ours, other = taken["bimodal40"], taken["andersen2002-unintended-mode, mount"]
    print(f"bimodal40 over the unintended mode on its mount: {ours[0] / other[0]:.2f}, CPU {ours[1] / other[1]:.2f}")


def settled() -> None:
    """Print the largest difference of the torque from settling to a tenth of its tolerance, at a quarter of the step.

    Steady states are extrapolated to a vanishing step, runs that settle are not.
    """
    print("| motor | largest difference from settling, % of μF₀R | not settled | CPU of a point, s |")
    print("|---|---|---|---|")
    for one in subjects():
        speeds = one.speeds[::EVERY]
        steady = pr.speed_torque(one.motor, one.drive, speeds=speeds)
        before = used()
        step = 0.25 * Point.of(one.motor, one.drive, contact="spring-slider").step
        left = pr.speed_torque(
            one.motor, one.drive, speeds=speeds, mode="settle", tolerance=SETTLED, patience=PATIENCE, step=step
        )
        kept = left.settled.values
        away = np.abs(steady.torque_n_m - left.torque_n_m).values[kept].max(initial=0.0) / one.friction_torque
        print(
            f"| {one.name} | {100.0 * away:.3f} | {np.count_nonzero(~kept)} of {len(kept)} | "
            f"{(used() - before) / len(speeds):.1f} |",
            flush=True,
        )


def settling() -> None:
    """Print CPU times of curves of the paper's motors by steady states and by settling, in one run, and their ratio."""
    print("| motor | steady states, CPU | settling, CPU | ratio | largest difference, % of μF₀R |")
    print("|---|---|---|---|---|")
    for one in islice(subjects(), 4):
        found, spent = [], []
        for mode in ("steady", "settle"):
            before = used()
            found.append(pr.speed_torque(one.motor, one.drive, speeds=one.speeds, mode=mode, patience=PATIENCE))
            spent.append(used() - before)
        away = float(abs(found[0].torque_n_m - found[1].torque_n_m).max()) / one.friction_torque
        assert found[1].settled.all()
        print(
            f"| {one.name} | {spent[0]:.2f} s | {spent[1]:.0f} s | {spent[1] / spent[0]:.0f} | {100.0 * away:.3f} |",
            flush=True,
        )


def flagship_map(points: int, over: str) -> object:
    """Return a map of the flagship over its frequency and its phase or its preload."""
    motor = pr.load_motor("bimodal40")
    second = {"drive.phase_deg": (50.0, 100.0), "contact.preload_n": (5.0, 25.0)}[over]
    axes = {"drive.frequency": np.linspace(40.4e3, 41.4e3, points), over: np.linspace(*second, points)}
    return pr.working_points(motor, pr.default_drive(motor), over=axes, speed=20.0)  # type: ignore[arg-type]


def maps() -> None:
    """Print the times of maps of 400 points, and the gain of a second core."""
    for over in ("drive.phase_deg", "contact.preload_n"):
        wall, spent = timed(partial(flagship_map, 20, over), 1)
        print(f"map of bimodal40 over frequency and {over}, 400 points: {wall:.1f} s, {spent:.1f} s of CPU", flush=True)
    pairs = [(one_core(task), timed(task, 1)[0]) for task in [partial(flagship_map, 20, "drive.phase_deg")] * 3]
    ratios = sorted(one / two for one, two in pairs)
    print(f"map of 400 points: {ratios[1]:.2f} times as fast on 2 cores ({ratios[0]:.2f} to {ratios[-1]:.2f})")


def one_core(task: Callable[[], object]) -> float:
    """Return the wall time of a task in s on one core."""
    every = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, set(sorted(every)[:1]))
        return timed(task, 1)[0]
    finally:
        os.sched_setaffinity(0, every)


def transients() -> None:
    """Print ngspice's time for 1 ms of the flagship under each law."""
    motor = pr.load_motor("bimodal40")
    laws = ("spring-slider", BRUSH, pr.Law("brush", 32), "coulomb")
    spent: dict[object, list[float]] = {law: [] for law in laws}
    for _ in range(REPEATS):
        for law in laws:
            run = pr.simulate(motor, pr.default_drive(motor), duration=1e-3, contact=law, step=1.8e-7)
            spent[law].append(run.solver_seconds)
    first = statistics.median(spent["spring-slider"])
    for law in laws:
        middle = statistics.median(spent[law])
        print(
            f"1 ms of bimodal40 in steps of 0.18 µs, {law}: {middle:.3f} s, {middle / first:.2f} of the spring-slider's"
        )


def laws() -> None:
    """Print work over precision of a curve of 5 speeds of the flagship under each law.

    The error is the greatest difference from the torque at a quarter of the usual step, in % of μF₀R.
    """
    motor = pr.load_motor("bimodal40")
    drive, speeds = pr.default_drive(motor), np.linspace(-20.0, 50.0, 5)
    scale = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    usual = Point.of(motor, drive, contact="spring-slider").step

    def found(law: pr.Law, step: float) -> xarray.Dataset:
        return pr.speed_torque(motor, drive, speeds=speeds, contact=law, step=step)

    print("| law | step, µs | CPU, s | error, % of μF₀R | its estimate, % |")
    print("|---|---|---|---|---|")
    for law in (pr.Law("spring-slider"), BRUSH, pr.Law("brush", 32), pr.Law("coulomb")):
        exact = found(law, usual / 4.0).torque_n_m
        for step in (usual, usual / 2.0):
            before = used()
            curve_at = found(law, step)
            spent = used() - before
            away, told = abs(curve_at.torque_n_m - exact).max(), curve_at.torque_error_n_m.max()
            print(
                f"| {law} | {1e6 * step:.3f} | {spent:.2f} | {100.0 * float(away) / scale:.3f} | "
                f"{100.0 * float(told) / scale:.3f} |",
                flush=True,
            )


def scipy() -> None:
    """Print curves by this package and by shooting with scipy and compiled equations, at equal accuracy."""
    at_equal_accuracy([1, 3, 9, 21])


def lift_off() -> None:
    """Print the counts of the record of random motors that lift off (``python -m validation.lift_off``)."""
    print(LIFT_OFF.summary(LIFT_OFF.cases()))


def cluster() -> None:
    """Print what a map of 10,000 points on a Dask cluster of four workers loses when one of them is killed."""
    after_a_death(10_000)


def small() -> None:
    """Print the wall times of commands, each in a process of its own; the package has its bytecode, as installed."""
    python, page = [sys.executable, "-m", "pyspice_runner"], str(Path(tempfile.gettempdir()) / "report.html")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"PYTHONPYCACHEPREFIX": str(Path(tempfile.gettempdir()) / "piezomotor-bytecode")}
    for what, command in (
        ("import pyspice_runner", [sys.executable, "-c", "import pyspice_runner"]),
        ("piezomotor --version", [*python, "--version"]),
        ("piezomotor show bimodal40", [*python, "show", "bimodal40"]),
        ("piezomotor simulate bimodal40, 2 ms", [*python, "simulate", "bimodal40", "--duration", "2e-3"]),
        ("piezomotor steady bimodal40", [*python, "steady", "bimodal40", "--speed", "20"]),
        ("piezomotor report bimodal40", [*python, "report", "bimodal40", "--output", page]),
    ):
        go = partial(subprocess.run, command, capture_output=True, check=True, env=environment)
        go()  # writes the bytecode
        wall, spent = timed(go, 3)
        print(f"{what}: {wall:.2f} s, {spent:.2f} s of CPU", flush=True)
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    wall, spent = timed(lambda: pr.steady_state(motor, drive, speed=20.0))
    print(f"steady_state in a process that has loaded it: {wall:.2f} s, {spent:.2f} s of CPU")
    wall, spent = timed(lambda: pr.simulate(motor, drive, duration=2e-3))
    print(f"simulate of 2 ms in such a process: {wall:.2f} s, {spent:.2f} s of CPU")


USUAL = (curves, settled, maps, transients, small, scipy, laws, lift_off)
PARTS = {part.__name__: part for part in (*USUAL, settling, cluster)}


def main(names: Sequence[str] = tuple(part.__name__ for part in USUAL)) -> None:
    """Measure, and print tables and lines."""
    for name in names:
        print(f"- {name}: {(PARTS[name].__doc__ or '').partition('.')[0]}", flush=True)
        PARTS[name]()


if __name__ == "__main__":
    main(*([sys.argv[1:]] if sys.argv[1:] else []))
