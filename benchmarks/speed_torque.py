# SPDX-License-Identifier: GPL-3.0-or-later
"""A speed–torque curve of 21 points in four quadrants, compared with spin-ups of the same model by scipy's best solver.

Without this package a user writes the motor as ordinary differential equations and lets the rotor spin up against each
load until its speed is constant. The equations are those of ``docs/physics.md``; the slider is held inside its limits
with the time constant of the circuit. The right-hand side exists twice: with numpy, and with plain numbers, which is
faster for few variables. Solver and tolerance are the fastest with an error of the operating point below 1 % of the
stall torque, and below 0.1 %, the error of this package. The spin-up ends when the speed changes by less than half of
that in a block of one decay time. The time is measured at some loads over the curve, and scaled.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import pi, sin, sqrt
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import pyspice_runner as pr

MOTOR = pr.load_motor("andersen2002-unintended-mode").updated({"mount": None})
DRIVE = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
SPEEDS = np.linspace(-10.0, 30.0, 21)  # braking, stall, motoring, overrunning
BLOCK = 62 / DRIVE.frequency  # s: the decay time of the slowest mode, as in the package
LONGEST = 40  # blocks
SOLVERS = ("LSODA", "RK23", "RK45", "DOP853", "BDF", "Radau")
TARGETS = (0.01, 0.001)  # of the stall torque
EVERY = 4  # one of this number of loads is timed
PULL = 7e-8  # s

Rates = Callable[[float, Any, float], Any]


def numpy_rates() -> Rates:
    """Return the rates of change, in numpy: of displacements, velocities, slider, speed and angle."""
    modes, contact, rotor = MOTOR.modes, MOTOR.contact, MOTOR.rotor
    count = len(modes)
    mass, damping, stiffness, theta_a, theta_b, tip_x, tip_y = (
        np.array([getattr(mode, name) for mode in modes])
        for name in (
            "mass_kg", "damping_n_s_per_m", "stiffness_n_per_m",
            "coupling_a_n_per_v", "coupling_b_n_per_v", "tip_x", "tip_y",
        )
    )  # fmt: skip
    hertz, friction, radius = contact.normal_stiffness_n_per_m15, contact.friction, rotor.radius_m
    ratio, seat, omega = _constants()

    def rates(t: float, z: Any, load: float) -> Any:
        r, v, u, speed = z[:count], z[count : 2 * count], z[2 * count], z[2 * count + 1]
        voltage_a = DRIVE.voltage * np.sin(omega * t)
        voltage_b = DRIVE.voltage * np.sin(omega * t + pi)
        x, y, vx, vy = tip_x @ r, tip_y @ r, tip_x @ v, tip_y @ v
        height = radius - seat - y
        distance = np.hypot(x, height)
        delta = max((2 * radius * (seat + y) - (seat + y) ** 2 - x**2) / (radius + distance), 0.0)
        normal, limit = hertz * delta**1.5, ratio * delta
        held = np.clip(u, -limit, limit)
        force = np.sign(held) * friction * normal * (1 - (1 - np.abs(held) / limit) ** 1.5) if limit > 0.0 else 0.0
        sine, cosine = x / distance, height / distance
        slide = vx * cosine + vy * sine - radius * speed - (u - held) / PULL
        force_x, force_y = normal * sine - force * cosine, -normal * cosine - force * sine
        drive = theta_a * voltage_a + theta_b * voltage_b
        acceleration = (drive + tip_x * force_x + tip_y * force_y - damping * v - stiffness * r) / mass
        turn = (radius * force - rotor.bearing_damping_n_m_s * speed - load) / rotor.inertia_kg_m2
        return np.concatenate([v, acceleration, [slide, turn, speed]])

    return rates


def plain_rates() -> Rates:
    """Return the same in plain numbers."""
    contact, rotor = MOTOR.contact, MOTOR.rotor
    modes = [tuple(mode.model_dump(exclude={"name"}).values()) for mode in MOTOR.modes]
    count = len(modes)
    hertz, friction, radius = contact.normal_stiffness_n_per_m15, contact.friction, rotor.radius_m
    ratio, seat, omega = _constants()

    def rates(t: float, state: Any, load: float) -> Any:
        z = state.tolist()
        voltage_a, voltage_b = DRIVE.voltage * sin(omega * t), DRIVE.voltage * sin(omega * t + pi)
        x = y = vx = vy = 0.0
        for (_, _, _, _, _, tip_x, tip_y), r, v in zip(modes, z[:count], z[count : 2 * count], strict=True):
            x += tip_x * r
            y += tip_y * r
            vx += tip_x * v
            vy += tip_y * v
        u, speed = z[2 * count], z[2 * count + 1]
        height = radius - seat - y
        distance = sqrt(x * x + height * height)
        delta = max((2.0 * radius * (seat + y) - (seat + y) ** 2 - x * x) / (radius + distance), 0.0)
        normal, limit = hertz * delta * sqrt(delta), ratio * delta
        held = min(max(u, -limit), limit)
        force = friction * normal * (1.0 - (1.0 - abs(held) / limit) ** 1.5) if limit > 0.0 else 0.0
        if held < 0.0:
            force = -force
        sine, cosine = x / distance, height / distance
        slide = vx * cosine + vy * sine - radius * speed - (u - held) / PULL
        force_x, force_y = normal * sine - force * cosine, -normal * cosine - force * sine
        acceleration = [
            (a * voltage_a + b * voltage_b + tip_x * force_x + tip_y * force_y - c * v - k * r) / m
            for (m, c, k, a, b, tip_x, tip_y), r, v in zip(modes, z[:count], z[count : 2 * count], strict=True)
        ]
        turn = (radius * force - rotor.bearing_damping_n_m_s * speed - load) / rotor.inertia_kg_m2
        return [*z[count : 2 * count], *acceleration, slide, turn, speed]

    return rates


def _constants() -> tuple[float, float, float]:
    contact = MOTOR.contact
    compliance = contact.tangential_compliance_tip_m_per_n23 + contact.tangential_compliance_rotor_m_per_n23
    hertz, preload = contact.normal_stiffness_n_per_m15, contact.preload_n
    bending = preload * sum(mode.tip_y**2 / mode.stiffness_n_per_m for mode in MOTOR.modes)
    ratio = contact.friction * compliance * hertz ** (2.0 / 3.0)
    return ratio, (preload / hertz) ** (2.0 / 3.0) + bending, 2.0 * pi * DRIVE.frequency


def spin_up(rates: Rates, solver: str, load: float, rtol: float, settled: float, longest: int = LONGEST) -> list[float]:
    """Return the mean speeds of the blocks, from preloaded rest until they change by less than ``settled``."""
    count, preload = len(MOTOR.modes), MOTOR.contact.preload_n
    rest = [-mode.tip_y * preload / mode.stiffness_n_per_m for mode in MOTOR.modes]
    state = np.array([*rest, *(0.0 for _ in rest), 0.0, 0.0, 0.0])
    scale = np.array([1e-6] * count + [0.1] * count + [1e-7, 1.0, 1e-2])
    speeds: list[float] = []
    while len(speeds) < longest and (len(speeds) < 2 or abs(speeds[-1] - speeds[-2]) > settled):
        begun = len(speeds) * BLOCK
        done = solve_ivp(
            rates, (begun, begun + BLOCK), state,
            method=solver, rtol=rtol, atol=rtol * scale, max_step=0.05 / DRIVE.frequency, args=(load,),
        )  # fmt: skip
        if not done.success:
            raise RuntimeError(f"{solver}: {done.message}")
        speeds.append(float(done.y[-1, -1] - state[-1]) / BLOCK)
        state = done.y[:, -1]
    return speeds


def fastest_solver(load: float) -> str:
    """Return the fastest solver over the first block of a spin-up, at a sufficient tolerance; print all."""
    rates, words, took = numpy_rates(), [], {}
    with np.errstate(over="ignore"):  # in the implicit solvers' difference quotients
        for solver in SOLVERS:
            began = time.perf_counter()
            (found,) = spin_up(rates, solver, load, 1e-4, 0.0, longest=1)
            took[solver] = time.perf_counter() - began
            words.append(f"{solver} {took[solver]:.2f} s, {found:.3f} rad/s")
    best = min(took, key=lambda solver: took[solver])
    print(f"scipy's solvers over the first block at rtol = 1e-4, numpy: {'; '.join(words)}. Fastest: {best}")
    return best


def main() -> None:
    """Measure, and print a line for each."""
    began = time.perf_counter()
    curve = pr.speed_torque(MOTOR, DRIVE, speeds=SPEEDS)
    ours = time.perf_counter() - began
    loads = curve["load_torque_n_m"].values
    stall, no_load = float(np.interp(0.0, SPEEDS, loads)), float(np.interp(0.0, -loads, SPEEDS))
    slope = np.abs(np.gradient(loads, SPEEDS))
    print(f"{len(SPEEDS)} points of a speed–torque curve, {SPEEDS[0]:g} to {SPEEDS[-1]:g} rad/s: {ours:.1f} s")
    middle = len(loads) // 2
    solver = fastest_solver(loads[middle])
    exact = spin_up(plain_rates(), "LSODA", loads[middle], 1e-8, 1e-5 * no_load)[-1]
    print(f"ours is {_away(slope[middle], SPEEDS[middle], exact, stall)} at {SPEEDS[middle]:g} rad/s")
    for target in TARGETS:
        settled = 0.5 * target * no_load
        for rtol in (1e-3, 1e-4, 1e-5, 1e-6):
            found = spin_up(plain_rates(), solver, loads[middle], rtol, settled)[-1]
            if slope[middle] * abs(found - exact) <= target * stall:
                break
        away = _away(slope[middle], found, exact, stall)
        for name, rates in (("numpy", numpy_rates()), ("plain numbers", plain_rates())):
            began = time.perf_counter()
            blocks = [len(spin_up(rates, solver, load, rtol, settled)) for load in loads[::EVERY]]
            theirs = (time.perf_counter() - began) * len(loads) / len(blocks)
            print(
                f"spin-ups by {solver}, rtol = {rtol:g}, {name}, {away}: {theirs:.0f} s "
                f"({len(blocks)} timed, {min(blocks)} to {max(blocks)} blocks), {theirs / ours:.1f} times as long"
            )


def _away(slope: float, speed: float, exact: float, stall: float) -> str:
    return f"{100.0 * slope * abs(speed - exact) / stall:.2f} % of the stall torque away"


if __name__ == "__main__":
    main()
