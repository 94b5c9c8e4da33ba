# SPDX-License-Identifier: GPL-3.0-or-later
"""Work and precision: error of a motor run over its wall time, with scipy's solvers and a compiled integrator.

Every solver has the same law. scipy's solvers use scalar arithmetic and no dense output; the comparison is at their
steps. All times are medians of interleaved runs within one process. The results are in
``work_precision.json``.
"""

from __future__ import annotations

import json
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from math import pi, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import pyspice_runner as pr
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.run.point import Point
from pyspice_runner.spice.ngspice import run_deck

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
from tests.reference.integrator import integrate  # noqa: E402

TARGET = Path(__file__).resolve().parent / "work_precision.json"
FIRST_VERSION = "3f030b5"  # the last commit before the contact laws were simplified
DURATION = 5e-3  # s
ROUNDS = 3
SLOW = 2.5  # s; longer tasks run once
PULL = 5e-8  # s
OURS = (20, 24, 32, 48, 64, 128)  # points a period of the fastest motion
RUNGE_KUTTA = (2e-6, 1e-6, 5e-7, 2.5e-7, 1.25e-7)  # s
SCIPY = {
    "RK45": (1e-3, 3e-4, 1e-4, 1e-5),
    "DOP853": (1e-3, 1e-4),
    "LSODA": (1e-3, 1e-4, 1e-5),
    "Radau": (1e-3,),
    "BDF": (1e-3, 1e-4),
}
MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
CASES = {
    "sliding": (MOTOR, pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)),
    "intermittent contact": (
        MOTOR.updated({"contact.preload_n": 3.0}),
        pr.TwoPhaseDrive(voltage=60.0, frequency=17.9e3, phase_deg=90.0),
    ),
}


def right_hand_side(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> tuple[Callable[..., list[float]], list[float]]:
    """The equations of motion for scipy, in scalars without arrays, and the initial state.

    Stick and slip are one right-hand side: beyond its limit the slider returns with a time constant of 50 ns. (With a
    discontinuous right-hand side LSODA does not end.)
    """
    (m1, m2), law, rotor = motor.modes, motor.contact, motor.rotor
    k1, k2, c1, c2 = m1.stiffness_n_per_m, m2.stiffness_n_per_m, m1.damping_n_s_per_m, m2.damping_n_s_per_m
    x1, x2, y1, y2 = m1.tip_x, m2.tip_x, m1.tip_y, m2.tip_y
    (a_1, b_1, mass_1), (a_2, b_2, mass_2) = (
        (mode.coupling_a_n_per_v, mode.coupling_b_n_per_v, mode.mass_kg) for mode in motor.modes
    )
    inertia, bearing = rotor.inertia_kg_m2, rotor.bearing_damping_n_m_s
    hertz, mu, radius = law.normal_stiffness_n_per_m15, law.friction, rotor.radius_m
    compliance = law.tangential_compliance_tip_m_per_n23 + law.tangential_compliance_rotor_m_per_n23
    kappa = mu * compliance * hertz ** (2.0 / 3.0)
    seat = (law.preload_n / hertz) ** (2.0 / 3.0) + law.preload_n * (y1**2 / k1 + y2**2 / k2)
    omega, voltage, phase = 2.0 * pi * drive.frequency, drive.voltage, drive.phase_deg * pi / 180.0

    def rates(t: float, z: np.ndarray[Any, Any]) -> list[float]:
        r1, r2, v1, v2, u, speed = z.tolist()
        ua, ub = voltage * sin(omega * t), voltage * sin(omega * t + phase)
        x, vx, vy = x1 * r1 + x2 * r2, x1 * v1 + x2 * v2, y1 * v1 + y2 * v2
        sigma = seat + y1 * r1 + y2 * r2
        h = radius - sigma
        distance = sqrt(x * x + h * h)
        delta = (2.0 * radius * sigma - sigma * sigma - x * x) / (radius + distance)
        if delta > 0.0:
            ex, ey = x / distance, h / distance
            normal, limit = hertz * delta * sqrt(delta), kappa * delta
            held = min(max(u, -limit), limit)
            du = vx * ey + vy * ex - radius * speed - (u - held) / PULL
            rest = 1.0 - abs(held) / limit
            friction = mu * normal * (1.0 - rest * sqrt(rest))
            friction = friction if held > 0.0 else -friction
            fx, fy = normal * ex - friction * ey, -normal * ey - friction * ex
        else:
            fx = fy = friction = 0.0
            du = -u / PULL
        a1 = (a_1 * ua + b_1 * ub - c1 * v1 - k1 * r1 + x1 * fx + y1 * fy) / mass_1
        a2 = (a_2 * ua + b_2 * ub - c2 * v2 - k2 * r2 + x2 * fx + y2 * fy) / mass_2
        turn = (radius * friction - bearing * speed) / inertia
        return [v1, v2, a1, a2, du, turn]

    return rates, [-law.preload_n * y1 / k1, -law.preload_n * y2 / k2, 0.0, 0.0, 0.0, 0.0]


class Case:
    """One motor run, its converged reference, and the error of the tip's path."""

    def __init__(self, motor: pr.Motor, drive: pr.TwoPhaseDrive) -> None:
        self.motor, self.drive = motor, drive
        self.tones = drive.tones_a, drive.tones_b
        exact = integrate(motor.to_dict(), *self.tones, duration=DURATION, output_step=1e-7)
        self.x, self.y = CubicSpline(exact.time_s, exact.tip_x_m), CubicSpline(exact.time_s, exact.tip_y_m)
        self.motion = float(np.var(exact.tip_x_m) + np.var(exact.tip_y_m))

    def error(self, t: Any, x: Any, y: Any) -> float:
        """RMS distance of the tip, relative to the RMS of its motion, weighted by time."""
        away = (x - self.x(t)) ** 2 + (y - self.y(t)) ** 2
        return sqrt(float(np.trapezoid(away, t) / (t[-1] - t[0])) / self.motion)

    def ours(self, points: int, exact_resonance: bool) -> float:
        """A run of the package, and its error."""
        step = Point(self.motor, DriveSource(self.drive)).shortest_period / points
        run = pr.simulate(
            self.motor, self.drive, duration=DURATION, step=step, exact_resonance=exact_resonance,
            signals=("tip_x_m", "tip_y_m"),
        )  # fmt: skip
        return self.error(run.time_s, run.tip_x_m, run.tip_y_m)

    def scipy(self, method: str, tolerance: float) -> float:
        """A run of one of scipy's solvers, and its error."""
        rates, start = right_hand_side(self.motor, self.drive)
        scale = np.array([1e-6, 1e-6, 0.1, 0.1, 1e-7, 1.0])
        run = solve_ivp(rates, (0.0, DURATION), start, method=method, rtol=tolerance, atol=tolerance * scale)
        first, second = self.motor.modes
        x = first.tip_x * run.y[0] + second.tip_x * run.y[1]
        y = first.tip_y * run.y[0] + second.tip_y * run.y[1]
        return self.error(run.t, x, y)

    def compiled(self, step: float) -> float:
        """A run of the compiled event-driven Runge-Kutta integrator of the tests, and its error."""
        run = integrate(self.motor.to_dict(), *self.tones, duration=DURATION, output_step=max(step, 5e-7), step=step)
        return self.error(run.time_s, run.tip_x_m, run.tip_y_m)


def measured(tasks: dict[tuple[str, str], Callable[[], float]]) -> list[dict[str, Any]]:
    """Error and median wall time of every task; the tasks are interleaved, so that all have the same load."""
    seconds: dict[tuple[str, str], list[float]] = {key: [] for key in tasks}
    errors: dict[tuple[str, str], float] = {}
    for _ in range(ROUNDS):
        for key, task in tasks.items():
            if seconds[key] and seconds[key][0] > SLOW:
                continue
            began = time.perf_counter()
            errors[key] = task()
            seconds[key].append(time.perf_counter() - began)
    return [
        {"solver": solver, "setting": setting, "error": errors[solver, setting],
         "seconds": statistics.median(seconds[solver, setting]), "runs": len(seconds[solver, setting])}
        for solver, setting in tasks
    ]  # fmt: skip


def work_precision(case: Case) -> list[dict[str, Any]]:
    """All solvers on one case."""
    tasks: dict[tuple[str, str], Callable[[], float]] = {}
    for points in OURS:
        tasks["ngspice, exact at resonance", f"{points} a period"] = lambda n=points: case.ours(n, True)
        tasks["ngspice, plain", f"{points} a period"] = lambda n=points: case.ours(n, False)
    for step in RUNGE_KUTTA:
        tasks["Runge-Kutta, numba", f"{step:g} s"] = lambda h=step: case.compiled(h)
    for method, tolerances in SCIPY.items():
        for tolerance in tolerances:
            tasks[method, f"rtol {tolerance:g}"] = lambda m=method, r=tolerance: case.scipy(m, r)
    return measured(tasks)


def point_cost() -> dict[str, Any]:
    """Cost of a point with the present and with the first contact law, interleaved."""
    shown = ["git", "-C", str(ROOT), "show", f"{FIRST_VERSION}:behavioral/piezomotor_contact.lib"]
    answer = subprocess.run(shown, capture_output=True, text=True, check=False)
    pattern = re.compile(r"^\.subckt piezomotor_contact .*?^\.ends piezomotor_contact$", re.M | re.S)
    first = pattern.search(answer.stdout)
    costs: dict[str, Any] = {"first_version": FIRST_VERSION}
    for name, (motor, drive) in CASES.items():
        deck = pr.simulate(motor, drive, duration=DURATION).deck
        decks = {"now": deck}
        if first is not None:
            decks["first"] = deck.replace(_whole(pattern, deck), first.group(0))
        seconds: dict[str, list[float]] = {key: [] for key in decks}
        points = 0
        for _ in range(5):
            for key, text in decks.items():
                result = run_deck(text, vectors=["v(shaft)"], stop_time=DURATION)
                points = result.raw.points
                seconds[key].append(result.seconds)
        costs[name] = {key: 1e6 * statistics.median(values) / points for key, values in seconds.items()}
    return costs


def _whole(pattern: re.Pattern[str], text: str) -> str:
    match = pattern.search(text)
    assert match is not None
    return match.group(0)


def python_share() -> dict[str, float]:
    """Time of Python and files in a run of 10^5 points, without ngspice."""
    motor, drive = CASES["sliding"]
    step = Point(motor, DriveSource(drive)).shortest_period / 128
    shares = []
    for _ in range(3):
        began = time.perf_counter()
        run = pr.simulate(motor, drive, duration=1e5 * step)
        wall = time.perf_counter() - began
        shares.append((wall - run.solver_seconds) / wall)
    return {"points": run.points, "wall_seconds": wall, "share": statistics.median(shares)}


def import_times() -> dict[str, float]:
    """Time of an interpreter for imports in s, without its own start."""
    scripts = {
        "bare": "pass",
        "pyspice_runner": "import pyspice_runner",
        "numpy_and_pyspice": "import numpy, PySpice.Spice.Netlist",
        "simulate": "import pyspice_runner; pyspice_runner.simulate",
    }
    seconds: dict[str, list[float]] = {name: [] for name in scripts}
    for _ in range(5):
        for name, script in scripts.items():
            began = time.perf_counter()
            subprocess.run([sys.executable, "-c", script], check=True, cwd=ROOT)
            seconds[name].append(time.perf_counter() - began)
    medians = {name: statistics.median(values) for name, values in seconds.items()}
    return {name: value - medians["bare"] for name, value in medians.items() if name != "bare"}


def main() -> None:
    """Measure, print a line for each and write all as JSON."""
    document: dict[str, Any] = {"point_us": point_cost(), "python": python_share(), "import_seconds": import_times()}
    print(json.dumps(document), flush=True)
    document["cases"] = {}
    for name, (motor, drive) in CASES.items():
        rows = work_precision(Case(motor, drive))
        document["cases"][name] = rows
        for row in rows:
            print(
                f"{name}: {row['solver']}, {row['setting']}: {row['error']:.2e} in {row['seconds']:.3f} s", flush=True
            )
        TARGET.write_text(json.dumps(document, separators=(",", ":")) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
