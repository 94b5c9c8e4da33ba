# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed-step integration of a piezomotor with any number of contact points, written from the physics alone.

It imports nothing of the package and nothing of the other integrators in ``tests/reference``.

Mode n, contact point j with the radius R_j, carrier z that the preload F_0 presses towards the rotor, shaft Ω:
    m_n r_n'' + c_n r_n' + k_n r_n = θ_An U_A + θ_Bn U_B + Σ_j (X_jn F_xj + Y_jn F_yj) − Γ_n z''
    m_c z'' + d_c z' + k_c z = F_0 + Σ_j F_yj − Σ_n Γ_n r_n''            z = 0 if m_c is infinite
    x_j = Σ X_jn (r_n − r_n0),  y_j = Σ Y_jn (r_n − r_n0) + z            r_n0: rest under the shares s_j F_0
    h_j = R_j − δ_j0 − e_j − y_j,  D_j = √(x_j² + h_j²),  δ_j = R_j − D_j    δ_j0: depth of the share, e_j: height
    F_xj = F_Nj x_j/D_j − F_Tj h_j/D_j,  F_yj = −F_Nj h_j/D_j − F_Tj x_j/D_j
    J Ω' + C_R Ω = Σ R_j F_Tj − τ
The law of a point, N(δ) = K max(δ, 0)^p or that of a tip worn to a flat of radius b (p = 3/2), v_rel = v_tip − R_j Ω:
    F_N = N(δ),  F_T = sign(u) μ [N(δ) − N(δ − |u|/(μ κ))],  u' = v_rel in |u| ≤ μ κ δ
    flat: a from δ R* = a √(a² − b²), N = K/(2 R*^{3/2}) (2 a² + b²) √(a² − b²)
    Coulomb's law with the creep v_c instead: F_T = μ N tanh(v_rel/v_c)
with κ the tangential over the normal flexibility. p = 1 is a lining of linear springs, p = 3/2 Hertz and Mindlin.

The classical Runge–Kutta method runs with a fixed step; sliders are put back to their limits after each step, so that
a change of state is late by a step at most. Two steps show the error.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

STIFFNESS, EXPONENT, KAPPA, FRICTION, RADIUS, DEPTH, FLAT, ROUND, CREEP = range(9)
"""columns of the table of the points; DEPTH is δ_j0 + e_j"""
MASS, DAMPING, SPRING, PRELOAD, INERTIA, BEARING, TORQUE, FREE = range(8)
"""places among the scalars"""


@dataclass(frozen=True)
class Points:
    """A motor with contact points; modes in columns, points in rows, SI units."""

    mass: Array
    damping: Array
    stiffness: Array
    coupling: Array
    """(2, modes), N/V"""
    x: Array
    """(points, modes): motion of each point along the rotor, positive where it drives forward"""
    y: Array
    """motion towards the rotor"""
    normal: Array
    """K_j in N/m^p of each point"""
    kappa: Array
    friction: Array
    radius: Array
    exponent: float = 1.5
    preload: float = 0.0
    shares: Array | None = None
    """default: the same for each point"""
    height: Array | None = None
    """in m, by which a point stands out"""
    flat: Array | None = None
    """radius in m of a worn flat"""
    round: Array | None = None
    """R* in m, of points with a flat"""
    creep: Array | None = None
    """m/s, of points with Coulomb's law; 0 for a spring-slider"""
    carrier_mass: float = np.inf
    carrier_damping: float = 0.0
    carrier_stiffness: float = 0.0
    recoil: Array | None = None
    inertia: float = 1.0
    bearing: float = 0.0

    def only(self, **changes) -> Points:
        """Return the same motor with changes."""
        return replace(self, **changes)

    @property
    def scale(self) -> float:
        """μ F_0 R, the torque in N·m at which all of it slips."""
        shares = self._shares
        return float(self.preload * np.sum(shares * self.friction * self.radius))

    @property
    def _shares(self) -> Array:
        count = len(self.normal)
        return np.full(count, 1.0 / count) if self.shares is None else self.shares

    def tables(self, load: float, speed: float | None) -> tuple[Array, Array, Array]:
        """Return the rows of the modes, of the points, and the scalars."""
        count = len(self.normal)
        nothing = np.zeros(count)
        names = ("height", "flat", "round", "creep")
        given = {name: nothing if getattr(self, name) is None else getattr(self, name) for name in names}
        points = np.zeros((count, 9))
        points[:, STIFFNESS], points[:, EXPONENT] = self.normal, self.exponent
        points[:, KAPPA], points[:, FRICTION], points[:, RADIUS] = self.kappa, self.friction, self.radius
        points[:, FLAT], points[:, ROUND], points[:, CREEP] = given["flat"], given["round"], given["creep"]
        for j, force in enumerate(self._shares * self.preload):
            points[j, DEPTH] = _depth(force, points[j]) + given["height"][j]
        modes = np.stack([self.mass, self.damping, self.stiffness, *self.coupling,
                          np.zeros(len(self.mass)) if self.recoil is None else self.recoil])  # fmt: skip
        scalars = np.array([self.carrier_mass, self.carrier_damping, self.carrier_stiffness, self.preload,
                            self.inertia, self.bearing, load, float(speed is None)])  # fmt: skip
        return modes, points, scalars

    def rest(self, speed: float | None = None) -> Array:
        """Return the state of preloaded rest."""
        modes, points = len(self.mass), len(self.normal)
        start = np.zeros(2 * modes + 3 + points)
        start[:modes] = -(self._shares * self.preload) @ self.y / self.stiffness
        start[2 * modes + 2] = speed or 0.0
        return start


def read(document: Mapping[str, Any]) -> Points:
    """Return the motor of the mapping that ``piezomotor show MOTOR --json`` prints; equal points are one, stiffer."""
    law, rotor, modes = document["contact"], document["rotor"], document["modes"]
    tips = {axis: {mode["name"]: mode[axis] for mode in modes} for axis in ("tip_x", "tip_y")}
    places = document.get("contacts") or [tips]
    known = ("restitution", 1.0), ("sliding_ratio", 1.0), ("series_compliance_m_per_n", 0.0)
    if any(own.get(name, normal) != normal for own in (law, *(one.get("contact", {}) for one in places))
           for name, normal in (*known, ("tangential_series_compliance_m_per_n", 0.0))):  # fmt: skip
        raise ValueError("this integrator has no loss along the normal, no compliance in series, no Stribeck friction")
    laws = [{"name": "spring-slider", "creep": 0.01} | one.get("law", {}) for one in places]
    if any(one["name"] not in ("spring-slider", "coulomb") for one in laws):
        raise ValueError("this integrator has the laws spring-slider and coulomb")
    exponent = law.get("exponent", 1.5)
    many = np.array([one.get("multiplicity", 1) for one in places], dtype=float)
    parts = many * np.array([one.get("part", 1.0) for one in places])

    def of(name: str) -> Array:
        return np.array([one.get("contact", {}).get(name, law.get(name, 0.0)) for one in places], dtype=float)

    def along(axis: str, mode: Mapping[str, Any]) -> Array:
        return np.array([one[axis].get(mode["name"], 0.0) for one in places], dtype=float)

    direction = np.array([one.get("direction", 1) for one in places], dtype=float)
    normal = of("normal_stiffness_n_per_m15")
    compliance = of("tangential_compliance_tip_m_per_n23") + of("tangential_compliance_rotor_m_per_n23")
    mount = document.get("mount") or {}
    return Points(
        mass=np.array([mode["mass_kg"] for mode in modes]),
        damping=np.array([mode["damping_n_s_per_m"] for mode in modes]),
        stiffness=np.array([mode["stiffness_n_per_m"] for mode in modes]),
        coupling=np.array([[mode[f"coupling_{group}_n_per_v"] for mode in modes] for group in "ab"]),
        x=direction[:, None] * np.stack([along("tip_x", mode) for mode in modes], axis=1),
        y=np.stack([along("tip_y", mode) for mode in modes], axis=1),
        normal=parts * normal,
        kappa=compliance * normal ** (1.0 / exponent),
        friction=of("friction"),
        radius=np.array([one.get("radius_m") or rotor["radius_m"] for one in places]),
        exponent=exponent,
        preload=law["preload_n"],
        shares=np.array([one.get("share") or part for one, part in zip(places, many / many.sum(), strict=True)]),
        height=np.array([one.get("height_m", 0.0) for one in places]),
        flat=of("worn_flat_radius_m"),
        round=of("effective_radius_m"),
        creep=np.array([one["creep"] if one["name"] == "coulomb" else 0.0 for one in laws]),
        carrier_mass=mount.get("mass_kg", np.inf),
        carrier_damping=mount.get("damping_n_s_per_m", 0.0),
        carrier_stiffness=mount.get("stiffness_n_per_m", 0.0),
        recoil=np.array([mode.get("recoil_kg") or 0.0 for mode in modes]),
        inertia=rotor["inertia_kg_m2"],
        bearing=rotor["bearing_damping_n_m_s"],
    )


@njit(nogil=True, cache=True)
def _pressed(depth, point):
    """Normal force of a point."""
    if depth <= 0.0:
        return 0.0
    if point[FLAT] > 0.0:
        flat, curved = point[FLAT] ** 2, point[ROUND]
        wide = 0.5 * (flat + np.sqrt(flat * flat + 4.0 * (curved * depth) ** 2))
        return point[STIFFNESS] / (2.0 * curved**1.5) * (2.0 * wide + flat) * np.sqrt(max(wide - flat, 0.0))
    if point[EXPONENT] == 1.0:
        return point[STIFFNESS] * depth
    if point[EXPONENT] == 1.5:
        return point[STIFFNESS] * depth * np.sqrt(depth)
    return point[STIFFNESS] * depth ** point[EXPONENT]


def _depth(force, point):
    """Depth of a normal force, by bisection."""
    low, high = 0.0, 1e-9
    while _pressed(high, point) < force:
        high *= 2.0
    while low < 0.5 * (low + high) < high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _pressed(middle, point) < force else (low, middle)
    return high if force > 0.0 else 0.0


@njit(nogil=True, cache=True)
def _rates(s, t, drive, modes, xs, ys, rest, points, p, ds, forces):
    """Fill the rates of the state, and for each point its normal and friction force, v_rel and limit."""
    n, count = modes.shape[1], points.shape[0]
    z, rise, speed = s[2 * n], s[2 * n + 1], s[2 * n + 2]
    ua = drive[0] * np.sin(2.0 * np.pi * drive[1] * t)
    ub = drive[2] * np.sin(2.0 * np.pi * drive[1] * t + drive[3])
    for i in range(n):
        v = s[n + i]
        ds[i] = v
        ds[n + i] = modes[3, i] * ua + modes[4, i] * ub - modes[1, i] * v - modes[2, i] * s[i]
    push, torque = p[PRELOAD] - p[DAMPING] * rise - p[SPRING] * z, 0.0
    for j in range(count):
        x, y, vx, vy = 0.0, z, 0.0, rise
        for i in range(n):
            x += xs[j, i] * (s[i] - rest[i])
            y += ys[j, i] * (s[i] - rest[i])
            vx += xs[j, i] * s[n + i]
            vy += ys[j, i] * s[n + i]
        radius = points[j, RADIUS]
        sunk = points[j, DEPTH] + y
        h = radius - sunk
        distance = np.sqrt(x * x + h * h)
        depth = (2.0 * radius * sunk - sunk * sunk - x * x) / (radius + distance)  # R − D without cancellation
        ex, ey = x / distance, h / distance
        relative = vx * ey + vy * ex - radius * speed
        normal = _pressed(depth, points[j])
        limit = points[j, FRICTION] * points[j, KAPPA] * max(depth, 0.0)
        u = s[2 * n + 3 + j]
        friction = 0.0
        if normal > 0.0:
            held = min(abs(u), limit) / (points[j, FRICTION] * points[j, KAPPA])
            friction = points[j, FRICTION] * (normal - _pressed(depth - held, points[j]))
            if u < 0.0:
                friction = -friction
            if points[j, CREEP] > 0.0:
                friction = points[j, FRICTION] * normal * np.tanh(relative / points[j, CREEP])
        ds[2 * n + 3 + j] = relative if depth > 0.0 else 0.0
        fx, fy = normal * ex - friction * ey, -normal * ey - friction * ex
        push += fy
        torque += radius * friction
        for i in range(n):
            ds[n + i] += xs[j, i] * fx + ys[j, i] * fy
        forces[j, 0], forces[j, 1], forces[j, 2], forces[j, 3] = normal, friction, relative, limit
    borne = p[MASS]
    for i in range(n):
        ds[n + i] /= modes[0, i]
        push -= modes[5, i] * ds[n + i]
        borne -= modes[5, i] ** 2 / modes[0, i]
    shaken = push / borne  # 0 where the mass is infinite
    for i in range(n):
        ds[n + i] -= modes[5, i] * shaken / modes[0, i]
    ds[2 * n], ds[2 * n + 1] = rise, shaken
    ds[2 * n + 2] = p[FREE] * (torque - p[BEARING] * speed - p[TORQUE]) / p[INERTIA]
    return ua, ub


@njit(nogil=True, cache=True)
def _run(s, t, drive, chirp, modes, xs, ys, rest, points, p, step, substeps, samples, means):
    """Run and fill samples of the state, and means of each block: power, speed, forces and contact of each point."""
    size, n, count = s.shape[0], modes.shape[1], points.shape[0]
    k1, k2, k3, k4, trial = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    forces = np.zeros((count, 4))
    now = drive.copy()
    samples[0] = s
    phase = 2.0 * np.pi * drive[1] * t
    for k in range(1, samples.shape[0]):
        for _ in range(substeps):
            half = 0.5 * step
            now[1] = drive[1]  # a sweep changes it between two steps, with the phase continuous
            offset = phase / (2.0 * np.pi * now[1])
            ua, ub = _rates(s, offset, now, modes, xs, ys, rest, points, p, k1, forces)
            power = 0.0
            for i in range(n):
                power += (modes[3, i] * ua + modes[4, i] * ub) * s[n + i]
            means[k - 1, 0] += power
            means[k - 1, 1] += s[2 * n + 2]
            for j in range(count):
                means[k - 1, 2 + 3 * j] += forces[j, 0]
                means[k - 1, 3 + 3 * j] += forces[j, 1]
                means[k - 1, 4 + 3 * j] += 1.0 if forces[j, 0] > 0.0 else 0.0
            for i in range(size):
                trial[i] = s[i] + half * k1[i]
            _rates(trial, offset + half, now, modes, xs, ys, rest, points, p, k2, forces)
            for i in range(size):
                trial[i] = s[i] + half * k2[i]
            _rates(trial, offset + half, now, modes, xs, ys, rest, points, p, k3, forces)
            for i in range(size):
                trial[i] = s[i] + step * k3[i]
            _rates(trial, offset + step, now, modes, xs, ys, rest, points, p, k4, forces)
            for i in range(size):
                s[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            phase += 2.0 * np.pi * now[1] * step
            drive[1] += chirp * step
            _rates(s, phase / (2.0 * np.pi * now[1]), now, modes, xs, ys, rest, points, p, trial, forces)
            for j in range(count):
                u, limit = s[2 * n + 3 + j], forces[j, 3]
                s[2 * n + 3 + j] = min(max(u, -limit), limit)
        samples[k] = s
    means /= substeps


@dataclass(frozen=True)
class Drive:
    """U_A = amplitude sin ωt, U_B = amplitude_b sin(ωt + phase), on from t = 0."""

    amplitude: float
    frequency: float
    phase_deg: float = 90.0
    amplitude_b: float | None = None

    def row(self) -> Array:
        """Return it as the integrator reads it."""
        second = self.amplitude if self.amplitude_b is None else self.amplitude_b
        return np.array([self.amplitude, self.frequency, second, self.phase_deg * pi / 180.0])


@dataclass(frozen=True)
class History:
    """Samples at the ends of equal blocks, and the means of each block."""

    motor: Points
    time: Array
    state: Array
    """(times, states): r, r', z, z', Ω, u"""
    power: Array
    """W that the drive gives the modes; a block less than the samples, as what follows"""
    mean_speed: Array
    """rad/s"""
    normal: Array
    """(blocks, points), N"""
    friction: Array
    touching: Array
    """share of the time"""

    @property
    def torque(self) -> Array:
        """Torque of the friction in N·m."""
        return self.friction @ self.motor.radius

    @property
    def speed(self) -> Array:
        """Speed in rad/s at the ends of the blocks."""
        return self.state[:, 2 * len(self.motor.mass) + 2]


def integrate(
    motor: Points,
    drive: Drive,
    *,
    blocks: int,
    block: float | None = None,
    steps: int = 800,
    speed: float | None = None,
    load: float = 0.0,
    start: Array | None = None,
    start_time: float = 0.0,
    chirp: float = 0.0,
) -> History:
    """Integrate over blocks, by default periods of the drive, with ``steps`` in a period.

    ``speed`` holds the shaft. ``chirp`` in Hz/s changes the frequency. The start is preloaded rest, or a state.
    """
    block = 1.0 / drive.frequency if block is None else block
    substeps = max(1, round(steps * block * drive.frequency))
    modes, points, scalars = motor.tables(load, speed)
    state = motor.rest(speed) if start is None else start.copy()
    if speed is not None:
        state[2 * len(motor.mass) + 2] = speed
    count = len(motor.normal)
    samples, means = np.zeros((blocks + 1, state.size)), np.zeros((blocks, 2 + 3 * count))
    rest = motor.rest()[: len(motor.mass)]
    _run(state, start_time, drive.row(), chirp, modes, np.ascontiguousarray(motor.x), np.ascontiguousarray(motor.y),
         rest, points, scalars, block / substeps, substeps, samples, means)  # fmt: skip
    if not np.isfinite(samples).all():
        raise RuntimeError("the motion is no longer finite: take more steps")
    time = start_time + np.arange(blocks + 1) * block
    return History(motor, time, samples, means[:, 0], means[:, 1], means[:, 2::3], means[:, 3::3], means[:, 4::3])


@dataclass(frozen=True)
class Steady:
    """Means of a steady motion with the shaft held."""

    torque: float
    power: float
    normal: Array
    friction: Array
    touching: Array
    periods: int
    settled: bool
    state: Array


def settle(
    motor: Points, drive: Drive, speed: float, *, steps: int = 800, start: Array | None = None,
    tolerance: float = 1e-5, block: int = 40, longest: int = 4000,
) -> Steady:  # fmt: skip
    """Run with the shaft held until the mean torque of two blocks of periods agrees, in μ F_0 R."""
    before, quiet, number = np.inf, 0, 0
    while number * block < longest:
        number += 1
        found = integrate(motor, drive, blocks=block, steps=steps, speed=speed, start=start)
        start, torque = found.state[-1], float(found.torque.mean())
        quiet = quiet + 1 if abs(torque - before) <= tolerance * motor.scale else 0
        before = torque
        if quiet == 2:
            break
    return Steady(
        torque, float(found.power.mean()), found.normal.mean(axis=0), found.friction.mean(axis=0),
        found.touching.mean(axis=0), number * block, quiet == 2, found.state[-1],
    )  # fmt: skip


def no_load(motor: Points, drive: Drive, high: float, *, steps: int = 800, load: float = 0.0) -> tuple[float, Steady]:
    """Return the speed in rad/s from 0 to ``high`` at which the mean torque is that of bearing and load."""
    low, start, found = 0.0, None, None

    def excess(at):
        nonlocal start, found
        found = settle(motor, drive, at, steps=steps, start=start)
        start = found.state
        return found.torque - motor.bearing * at - load

    e_low, e_high = excess(low), excess(high)
    if e_low * e_high > 0.0:
        raise ValueError(f"no change of sign: {e_low:g} at 0, {e_high:g} at {high:g} rad/s")
    for _ in range(40):  # regula falsi, Illinois
        middle = (low * e_high - high * e_low) / (e_high - e_low)
        e_middle = excess(middle)
        if e_middle * e_high < 0.0:
            low, e_low = high, e_high
        else:
            e_low *= 0.5
        high, e_high = middle, e_middle
        if abs(e_middle) < 2e-5 * motor.scale or abs(high - low) < 1e-5 * abs(high):
            break
    return high, found
