# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states: cost of a curve over the number of points, errors by the step, and the same curve by scipy.

.venv/bin/python -m benchmarks.steady_state cost 1 10 100 1000
.venv/bin/python -m benchmarks.steady_state errors
.venv/bin/python -m benchmarks.steady_state scipy 5
.venv/bin/python -m benchmarks.steady_state equal 1 3 9 21
"""

from __future__ import annotations

import os
import resource
import sys
import time
from math import pi, radians, sin, sqrt
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from scipy.optimize import root

import pyspice_runner as pr
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import steady_states

STEPS = 4000  # of the Runge-Kutta method in a period, 5 ns
PULL = 10.0  # steps in the time constant by which the slider returns to its limit
SCALE = np.array([1e-6, 1e-6, 0.3, 0.3, 1e-7])  # of displacements, velocities and slider
SETTLED = 1e-3  # change of the mean torque from block to block, relative to the friction torque


def cpu_seconds() -> float:
    """Return the CPU time in s of this process and of its ended children."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def cost(counts: list[int]) -> None:
    """Print wall time, CPU time and memory over the number of points; settling is timed on three of them."""
    motor = pr.load_motor("andersen2002-unintended-mode")
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
    pr.steady_state(motor, drive, speed=0.0)  # imports all modules
    print("points  wall/s  CPU/s  CPU a point/s  memory of the largest ngspice/MB")
    for count in counts:
        began, used = time.perf_counter(), cpu_seconds()
        curve = pr.speed_torque(motor, drive, speeds=np.linspace(-10.0, 30.0, count))
        wall, cpu = time.perf_counter() - began, cpu_seconds() - used
        memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0
        assert curve["settled"].all()
        print(f"{count:6d}  {wall:6.2f}  {cpu:5.2f}  {cpu / count:13.3f}  {memory:.0f}", flush=True)
    began, used = time.perf_counter(), cpu_seconds()
    pr.speed_torque(motor, drive, speeds=[-5.0, 10.0, 25.0], mode="settle")
    print(
        f"settle: {(time.perf_counter() - began) / 3:.2f} s wall and {(cpu_seconds() - used) / 3:.2f} s CPU a point",
        flush=True,
    )


def errors() -> None:
    """Print the greatest errors of the torque by the step, in % of μF₀R, against steady states at an eighth of it."""
    paper, unintended = (
        pr.load_motor(name).updated({"mount": None}) for name in ("andersen2002", "andersen2002-unintended-mode")
    )
    flagship = pr.load_motor("bimodal40")
    drives = [
        pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
        for voltage, frequency, phase in ((200.0, 51.7e3, 90.0), (100.0, 46e3, 180.0), (100.0, 17e3, 90.0))
    ]
    print("| motor | drive, speeds in rad/s | coarse step, one copy | finer step, one copy | result | its estimate |")
    print("|---|---|---|---|---|---|")
    slider, brush = "spring-slider", pr.Law("brush", 8)
    hammers, lifts = (paper, drives[2], np.linspace(-5.0, 12.0, 7)), (flagship, None, np.linspace(-20.0, 60.0, 9))
    for law, (motor, of_motor, speeds) in (
        (slider, (paper, drives[0], np.linspace(-5.0, 12.0, 7))),
        (slider, (unintended, drives[1], np.linspace(-12.0, 30.0, 7))),
        *((law, subject) for law in (slider, brush) for subject in (hammers, lifts)),
    ):
        drive = of_motor or pr.default_drive(motor)
        scale = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        setups = [Point.of(motor, drive, contact=law, speed=speed) for speed in speeds.tolist()]
        finer = [setup.with_step(setup.step / 2.0) for setup in setups]
        exact = steady_states([setup.with_step(setup.step / 8.0) for setup in setups])
        found = steady_states(setups)
        assert all(state.converged for state in (*exact, *found))
        rows = [steady_states(setups, accuracy=None), steady_states(finer, accuracy=None), found]
        away = [[abs(a.torque_n_m - b.torque_n_m) for a, b in zip(row, exact, strict=True)] for row in rows]
        stated = [state.torque_error_n_m for state in found]
        small = sum(one > told for one, told in zip(away[2], stated, strict=True))
        cells = " | ".join(f"{100.0 * max(row) / scale:.3f}" for row in (*away, stated))
        least = 100.0 * max(state.torque_error_n_m for state in exact) / scale
        print(
            f"| {motor.name}, {law} | {drive.label}, {speeds[0]:g} to {speeds[-1]:g} | {cells} |\n"
            f"{small} of {len(speeds)} errors above their estimates; those at an eighth are at most {least:.4f}",
            flush=True,
        )


@njit
def rates(t: float, z: Any, p: Any, dz: Any) -> float:  # type: ignore[misc]
    """The equations of motion of two modes and the contact on a held shaft; return the friction force."""
    x, vx = p[8] * z[0] + p[9] * z[1], p[8] * z[2] + p[9] * z[3]
    y, vy = p[10] * z[0] + p[11] * z[1], p[10] * z[2] + p[11] * z[3]
    sigma = p[17] + y
    h = p[16] - sigma
    distance = sqrt(x * x + h * h)
    delta = (2.0 * p[16] * sigma - sigma * sigma - x * x) / (p[16] + distance)
    fx = fy = friction = 0.0
    dz[4] = -z[4] / p[25]
    if delta > 0.0:
        ex, ey = x / distance, h / distance
        normal, limit = p[18] * delta * sqrt(delta), p[19] * delta
        held = min(max(z[4], -limit), limit)
        dz[4] = vx * ey + vy * ex - p[16] * p[20] - (z[4] - held) / p[25]
        rest = 1.0 - abs(held) / limit
        friction = p[21] * normal * (1.0 - rest * sqrt(rest)) * (1.0 if held > 0.0 else -1.0)
        fx, fy = normal * ex - friction * ey, -normal * ey - friction * ex
    ua, ub = p[22] * sin(p[23] * t), p[22] * sin(p[23] * t + p[24])
    for n in range(2):
        dz[n] = z[2 + n]
        force = p[12 + n] * ua + p[14 + n] * ub - p[4 + n] * z[2 + n] - p[2 + n] * z[n]
        dz[2 + n] = (force + p[8 + n] * fx + p[10 + n] * fy) / p[n]
    return friction


@njit
def period(z: Any, p: Any) -> float:  # type: ignore[misc]
    """Advance a state over one period by the classical Runge-Kutta method; return the mean friction force."""
    h = p[25] / PULL
    steps = round(2.0 * pi / p[23] / h)
    k1, k2, k3, k4 = np.empty(5), np.empty(5), np.empty(5), np.empty(5)
    total = 0.0
    for n in range(steps):
        t = n * h
        total += rates(t, z, p, k1)
        rates(t + 0.5 * h, z + 0.5 * h * k1, p, k2)
        rates(t + 0.5 * h, z + 0.5 * h * k2, p, k3)
        rates(t + h, z + h * k3, p, k4)
        z += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return total / steps


def parameters(motor: pr.Motor, drive: pr.TwoPhaseDrive, speed: float, steps: int = STEPS) -> np.ndarray:
    """Return motor, drive and speed as the equations take them."""
    names = ("mass_kg", "stiffness_n_per_m", "damping_n_s_per_m", None, "tip_x", "tip_y", "coupling_a_n_per_v")
    pairs = [getattr(mode, name) if name else 0.0 for name in (*names, "coupling_b_n_per_v") for mode in motor.modes]
    law, radius = motor.contact, motor.rotor.radius_m
    seat = (law.preload_n / law.normal_stiffness_n_per_m15) ** (2.0 / 3.0)
    seat += law.preload_n * sum(mode.tip_y**2 / mode.stiffness_n_per_m for mode in motor.modes)
    compliance = law.tangential_compliance_tip_m_per_n23 + law.tangential_compliance_rotor_m_per_n23
    limit = law.friction * compliance * law.normal_stiffness_n_per_m15 ** (2.0 / 3.0)
    waves = [drive.voltage, 2.0 * pi * drive.frequency, radians(drive.phase_deg)]
    pull = PULL / (steps * drive.frequency)
    return np.array([*pairs, radius, seat, law.normal_stiffness_n_per_m15, limit, speed, law.friction, *waves, pull])


def settled(p: np.ndarray, start: np.ndarray, periods: int, friction: float) -> float:
    """Return the mean friction force of LSODA's blocks of so many periods, once it stays the same."""
    length, before, begun, z = periods * 2.0 * pi / p[23], np.inf, 0.0, start
    derivative = np.empty(5)

    def right(t: float, state: np.ndarray) -> np.ndarray:
        rates(t, state, p, derivative)
        return derivative.copy()

    while True:
        run = solve_ivp(right, (begun, begun + length), z, method="LSODA", rtol=1e-6, atol=1e-6 * SCALE)
        forces = [rates(t, state, p, derivative) for t, state in zip(run.t, run.y.T, strict=True)]
        mean = float(np.trapezoid(forces, run.t)) / length
        if abs(mean - before) < SETTLED * friction:
            return mean
        before, begun, z = mean, begun + length, run.y[:, -1]


def shot(p: np.ndarray, start: np.ndarray) -> tuple[float, bool]:
    """Return the mean friction force of the fixed point of the period that scipy finds."""

    def gap(scaled: np.ndarray) -> np.ndarray:
        z = scaled * SCALE
        period(z, p)
        return z / SCALE - scaled

    found = root(gap, start / SCALE, method="hybr", options={"eps": 1e-6, "xtol": 1e-6})
    return float(period(found.x * SCALE, p)), bool(np.abs(gap(found.x)).max() < 1e-3)


def at_equal_accuracy(counts: list[int]) -> None:
    """Print CPU times of curves by this package and by shooting with scipy, at the coarsest step that is as accurate.

    Errors are those of the torque against shooting at 8 times the finest of scipy's steps, in % of μF₀R.
    """
    motor = pr.load_motor("andersen2002").updated({"mount": None})
    drive = pr.TwoPhaseDrive(voltage=200.0, frequency=51.7e3, phase_deg=90.0)
    law, radius = motor.contact, motor.rotor.radius_m
    scale = law.friction * law.preload_n
    rest = [-law.preload_n * mode.tip_y / mode.stiffness_n_per_m for mode in motor.modes]
    start = np.array([*rest, 0.0, 0.0, 0.0])
    decay = max(2.0 * mode.mass_kg / mode.damping_n_s_per_m for mode in motor.modes)
    periods = round(decay * drive.frequency)
    pr.speed_torque(motor, drive, speeds=[0.0])  # loads
    shot(parameters(motor, drive, 0.0), start)  # compiles

    def forces(speeds: np.ndarray, steps: int) -> tuple[np.ndarray, float]:
        used, found = cpu_seconds(), []
        for speed in speeds:
            p = parameters(motor, drive, speed, steps)
            force, good = shot(p, _warm(p, start, periods))
            found.append(force if good else np.nan)
        return np.array(found), cpu_seconds() - used

    print("| points | ours, CPU | wall | error | scipy, CPU | steps a period | error | ours over scipy, CPU |")
    print("|---|---|---|---|---|---|---|---|")
    for count in counts:
        speeds = np.linspace(-5.0, 12.0, count)
        exact, _ = forces(speeds, 8 * STEPS)
        used, began = cpu_seconds(), time.perf_counter()
        curve = pr.speed_torque(motor, drive, speeds=speeds)
        wall, ours = time.perf_counter() - began, cpu_seconds() - used
        error = float(np.abs(curve["torque_n_m"].values / radius - exact).max()) / scale
        for steps in (250, 500, 1000, 2000, STEPS):
            found, theirs = forces(speeds, steps)
            away = float(np.abs(found - exact).max()) / scale
            if away <= error:
                break
        print(
            f"| {count} | {ours:.2f} s | {wall:.2f} s | {100.0 * error:.3f} % | {theirs:.2f} s | {steps} | "
            f"{100.0 * away:.3f} % | {ours / theirs:.2f} |",
            flush=True,
        )


def scipy_too(count: int) -> None:
    """Print times and torques of a curve by this package, by LSODA until it settles, and by shooting with scipy."""
    motor = pr.load_motor("andersen2002").updated({"mount": None})
    drive = pr.TwoPhaseDrive(voltage=200.0, frequency=51.7e3, phase_deg=90.0)
    speeds = np.linspace(-5.0, 12.0, count)
    law, radius = motor.contact, motor.rotor.radius_m
    friction = law.friction * law.preload_n
    rest = [-law.preload_n * mode.tip_y / mode.stiffness_n_per_m for mode in motor.modes]
    start = np.array([*rest, 0.0, 0.0, 0.0])
    decay = max(2.0 * mode.mass_kg / mode.damping_n_s_per_m for mode in motor.modes)
    periods = round(decay * drive.frequency)
    shot(parameters(motor, drive, 0.0), start)  # compiles
    pr.steady_state(motor, drive, speed=0.0)
    began = time.perf_counter()
    curve = pr.speed_torque(motor, drive, speeds=speeds)
    ours = curve["torque_n_m"].values
    print(f"ours: {(time.perf_counter() - began) / count:.3f} s a point, {curve.attrs['method']}", flush=True)

    def report(name: str, torques: list[float], seconds: float, found: list[bool]) -> None:
        worst = max((abs(a - b) for a, b, good in zip(torques, ours, found, strict=True) if good), default=np.nan)
        away = 100.0 * worst / (friction * radius)
        print(
            f"{name}: {seconds / count:.3f} s a point, {sum(found)} of {count} found, up to {away:.2f} % away",
            flush=True,
        )

    began = time.perf_counter()
    several = [
        shot(parameters(motor, drive, speed), _warm(parameters(motor, drive, speed), start, periods))
        for speed in speeds
    ]
    report(
        "shooting by scipy",
        [radius * f for f, _ in several],
        time.perf_counter() - began,
        [good for _, good in several],
    )
    began = time.perf_counter()
    blocks = [settled(parameters(motor, drive, speed), start, periods, friction) for speed in speeds]
    report("LSODA, settled", [radius * f for f in blocks], time.perf_counter() - began, [True] * count)


def _warm(p: np.ndarray, start: np.ndarray, periods: int) -> np.ndarray:
    """Let the motion run for a decay time: from rest scipy's method often fails."""
    z = start.copy()
    for _ in range(periods):
        period(z, p)
    return z


if __name__ == "__main__":
    if sys.argv[1] == "cost":
        cost([int(text) for text in sys.argv[2:]])
    elif sys.argv[1] == "errors":
        errors()
    elif sys.argv[1] == "equal":
        at_equal_accuracy([int(text) for text in sys.argv[2:]])
    else:
        scipy_too(int(sys.argv[2]))
