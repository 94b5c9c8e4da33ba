# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed-step integration of the standing-wave piezomotor with every loss and recoil, written from the physics alone.

It shares no code with the package that it checks, nor with :mod:`.integrator`, which finds each event exactly but has
no loss along the normal.

The law, with the crown of the rotor above the tip as it rests and d the approach of tip and rotor
    m_n r_n'' + c_n r_n' + k_n r_n = θ_An U_A + θ_Bn U_B + X_n F_x + Y_n F_y − Γ_n z''
    m_c z'' + d_c z' + k_c z = F_0 + F_y − Σ Γ_n r_n''
    x = Σ X_n r_n + F_0 Σ X_n Y_n/k_n,  y = Σ Y_n r_n + z,  h = R − δ_0 − C F_0 − F_0 Σ Y_n²/k_n − y
    D = √(x² + h²),  d = R − D,  e_x = x/D,  e_y = h/D,  v_rel = x' e_y + y' e_x − Ω R
    d = δ + C F_N,  F_N = K_N δ^{3/2} f,  f = max(0, 1 + a δ')      series compliance C, Hunt and Crossley's a
    F_x = F_N e_x − F_T e_y,  F_y = −F_N e_y − F_T e_x
    F_T = sign(u) μ s F_N [1 − (1 − |u|/u_lim)^{3/2}],  u_lim = μ K_t K_N^{2/3} δ f
    (u + C_t F_T)' = v_rel in |u| ≤ u_lim, with the compliance C_t along the rotor
    s = ρ + (1 − ρ) exp(−(w/v_s)²), with the slip velocity w = |v_rel − u'|, where C_t = 0
    J Ω' + C_R Ω + T = R F_T − τ_load,  T' = (T_c Ω − T |Ω|)/φ_0

With C and a the penetration is a state of its own, which follows d with the time constant a C K_N δ^{3/2}. The implicit
Euler rule finds it from that at the start of a step, so that it needs no finer step.

With a compliance C_t along the rotor the state is u + C_t F_T, a function of u that rises, so that its limit is that at
u_lim. (The package forms the rate of C_t F_T by a difference formula instead.)

The classical Runge–Kutta method runs with a fixed step. The slider is put back to its limit after each step, so that a
change of state is late by a step at most: the error of the means is of first order, and two steps show it.
"""

# mypy: allow-untyped-defs
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MODES = (
    "mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "coupling_a_n_per_v", "coupling_b_n_per_v", "tip_x", "tip_y",
    "recoil_kg",
)  # fmt: skip
_M, _C, _K, _TA, _TB, _X, _Y, _RECOIL = range(8)
INTEGRALS = (
    "input", "damping", "mount_damping", "normal", "friction", "bearing", "normal_force", "friction_force", "speed",
)  # fmt: skip
_SOLVED = 1e-12  # relative error of the penetration


@dataclass(frozen=True)
class DampedRun:
    """Samples at k · output_step, SI units."""

    time_s: Array
    tip_x_m: Array
    """relative to the carrier, as tip_y_m"""
    tip_y_m: Array
    rotor_speed_rad_s: Array
    integrals: dict[str, Array]
    """by :data:`INTEGRALS`, from t = 0: the energies in J that the drive gives the modes and that modes, mount, normal
    damping, friction with its spring, and bearing take; and ∫F_N dt, ∫F_T dt, ∫Ω dt"""

    def mean(self, name: str, start: float) -> float:
        """Return the mean of what is integrated from a time in s to the end."""
        values = self.integrals[name]
        before = np.interp(start, self.time_s, values)
        return float((values[-1] - before) / (self.time_s[-1] - start))


@njit(nogil=True, cache=True)
def _penetration(d, before, h, p):
    """δ and f for an approach; h is the time since δ was ``before``."""
    hertz, compliance, damping = p[0], p[1], p[2]
    low, high, delta = 0.0, d, min(before, d)
    for _ in range(60):
        rate = (delta - before) / h
        f = max(0.0, 1.0 + damping * rate)
        root = np.sqrt(max(delta, 0.0))
        excess = delta + compliance * hertz * root * delta * f - d
        if excess > 0.0:
            high = delta
        else:
            low = delta
        if high - low <= _SOLVED * d:
            break
        slope = 1.0 + compliance * hertz * root * (1.5 * f + (delta * damping / h if f > 0.0 else 0.0))
        following = delta - excess / slope
        if abs(following - delta) <= _SOLVED * d:
            delta = following
            break
        delta = following if low < following < high else 0.5 * (low + high)
    return delta, max(0.0, 1.0 + damping * (delta - before) / h)


@njit(nogil=True, cache=True)
def _depth(d, approach, before, f0, h, p):
    """δ and f for an approach and its rate; h = 0 stands for the start of a step, where both are known."""
    compliance, damping = p[1], p[2]
    if d <= 0.0:
        return 0.0, 1.0
    if compliance == 0.0:
        return d, max(0.0, 1.0 + damping * approach)
    if damping == 0.0:
        return _penetration(d, d, 1.0, p)
    return _penetration(d, before, h, p) if h > 0.0 else (before, f0)


@njit(nogil=True, cache=True)
def _friction(u, limit, most, w, p):
    """F_T for a slider, its limit, μ F_N and the slip velocity."""
    if limit <= 0.0:
        return 0.0
    share = min(abs(u) / limit, 1.0)
    force = most * (1.0 - (1.0 - share) ** 1.5)
    if share == 1.0:
        force *= p[5] + (1.0 - p[5]) * np.exp(-((w / p[6]) ** 2))
    return force if u > 0.0 else -force


@njit(nogil=True, cache=True)
def _slider(total, limit, most, soft):
    """u of u + C_t F_T, by z = √(1 − |u|/u_lim) of limit (1 − z²) + C_t μ F_N (1 − z³) = |total|."""
    if soft == 0.0 or limit <= 0.0:
        return total
    size, z = min(abs(total), limit + soft * most), 1.0
    for _ in range(60):
        excess = limit * (1.0 - z * z) + soft * most * (1.0 - z * z * z) - size
        if excess >= -_SOLVED * limit:
            break
        z = max(z + excess / (2.0 * limit * z + 3.0 * soft * most * z * z), 0.0)  # concave: from one side
    u = limit * (1.0 - z * z)
    return u if total > 0.0 else -u


@njit(nogil=True, cache=True)
def _rates(s, ua, ub, before, f0, h, w, modes, p, ds):
    """Fill the rates of the state; return δ, f, and the limit of u + C_t F_T."""
    n = modes.shape[1]
    hertz, damping, kappa, mu = p[0], p[2], p[3], p[4]
    radius, seat, sway, preload = p[7], p[8], p[9], p[10]
    z, rise, omega, dry, total = s[2 * n], s[2 * n + 1], s[2 * n + 2], s[2 * n + 3], s[2 * n + 4]
    x, vx, y, vy = sway, 0.0, z, rise
    for i in range(n):
        x += modes[_X, i] * s[i]
        y += modes[_Y, i] * s[i]
        vx += modes[_X, i] * s[n + i]
        vy += modes[_Y, i] * s[n + i]
    sigma = seat + y
    distance = np.sqrt(x * x + (radius - sigma) ** 2)
    d = (2.0 * radius * sigma - sigma * sigma - x * x) / (radius + distance)
    ex, ey = x / distance, (radius - sigma) / distance
    relative = vx * ey + vy * ex - omega * radius
    approach = ey * vy - ex * vx
    delta, f = _depth(d, approach, before, f0, h, p)
    fn = hertz * delta * np.sqrt(delta) * f
    limit = kappa * delta * f
    rate = (f - 1.0) / damping if damping > 0.0 and f > 0.0 else approach
    ft = _friction(_slider(total, limit, mu * fn, p[20]), limit, mu * fn, w, p)
    fx, fy = fn * ex - ft * ey, -fn * ey - ft * ex
    push, borne = preload + fy - p[12] * rise - p[13] * z, p[11]
    given = lost = 0.0
    for i in range(n):
        v = s[n + i]
        drive = modes[_TA, i] * ua + modes[_TB, i] * ub
        ds[i] = v
        ds[n + i] = (drive - modes[_C, i] * v - modes[_K, i] * s[i] + modes[_X, i] * fx + modes[_Y, i] * fy) / modes[
            _M, i
        ]
        push -= modes[_RECOIL, i] * ds[n + i]
        borne -= modes[_RECOIL, i] ** 2 / modes[_M, i]
        given += drive * v
        lost += modes[_C, i] * v * v
    shaken = push / borne  # 0 without a mount, whose mass is infinite
    for i in range(n):
        ds[n + i] -= modes[_RECOIL, i] * shaken / modes[_M, i]
    ds[2 * n], ds[2 * n + 1] = rise, shaken
    ds[2 * n + 2] = p[18] * (radius * ft - p[15] * omega - dry - p[19]) / p[14]
    ds[2 * n + 3] = (p[16] * omega - dry * abs(omega)) / p[17]
    ds[2 * n + 4] = relative if d > 0.0 else 0.0
    q = 2 * n + 5
    ds[q], ds[q + 1], ds[q + 2] = given, lost, p[12] * rise * rise
    ds[q + 3] = (fn - hertz * delta * np.sqrt(delta)) * rate if d > 0.0 else 0.0
    ds[q + 4], ds[q + 5] = ft * relative, (p[15] * omega + dry) * omega
    ds[q + 6], ds[q + 7], ds[q + 8] = fn, ft, omega
    return delta, f, limit + p[20] * mu * fn


@njit(nogil=True, cache=True)
def _voltage(tones, t):
    value = 0.0
    for i in range(tones.shape[0]):
        value += tones[i, 0] * np.sin(2.0 * np.pi * tones[i, 1] * t + tones[i, 2])
    return value


@njit(nogil=True, cache=True)
def _run(s, delta, tones_a, tones_b, modes, p, step, substeps, samples):
    size, u = s.shape[0], 2 * modes.shape[1] + 4
    k1, k2, k3, k4, trial = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    f, w = 1.0, 0.0
    samples[0] = s
    for k in range(1, samples.shape[0]):
        for j in range(substeps):
            t = ((k - 1) * substeps + j) * step
            half = t + 0.5 * step
            ua, ub = _voltage(tones_a, half), _voltage(tones_b, half)
            va, vb = _voltage(tones_a, t + step), _voltage(tones_b, t + step)
            _rates(s, _voltage(tones_a, t), _voltage(tones_b, t), delta, f, 0.0, w, modes, p, k1)
            for i in range(size):
                trial[i] = s[i] + 0.5 * step * k1[i]
            _rates(trial, ua, ub, delta, f, 0.5 * step, w, modes, p, k2)
            for i in range(size):
                trial[i] = s[i] + 0.5 * step * k2[i]
            _rates(trial, ua, ub, delta, f, 0.5 * step, w, modes, p, k3)
            for i in range(size):
                trial[i] = s[i] + step * k3[i]
            _rates(trial, va, vb, delta, f, step, w, modes, p, k4)
            for i in range(size):
                s[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            delta, f, limit = _rates(s, va, vb, delta, f, step, w, modes, p, trial)
            w = max(abs(s[u]) - limit, 0.0) / step  # the slider is put back by this
            s[u] = min(max(s[u], -limit), limit)
        samples[k] = s


def integrate_damped(
    motor: Mapping[str, Any],
    tones_a: Sequence[tuple[float, float, float]],
    tones_b: Sequence[tuple[float, float, float]],
    *,
    duration: float,
    output_step: float,
    step: float,
    speed: float | None = None,
    start_speed: float = 0.0,
    load_torque: float = 0.0,
    perturbation_m: float = 0.0,
) -> DampedRun:
    """Integrate a motor (the mapping that ``piezomotor show MOTOR --json`` prints) from preloaded rest.

    A tone is amplitude in V, frequency in Hz, phase in rad of a sine. The step is the largest that divides output_step
    and is not above ``step``. ``speed`` holds the shaft; without it the rotor starts with ``start_speed`` against
    ``load_torque``. ``perturbation_m`` shifts the start of r_1.
    """
    law, rotor, mount = motor["contact"], motor["rotor"], motor.get("mount") or {}
    if law.get("worn_flat_radius_m"):
        raise ValueError("this integrator has no worn tip")
    if law.get("sliding_ratio", 1.0) < 1.0 and law.get("tangential_series_compliance_m_per_n"):
        raise ValueError("friction that falls makes a spring without mass jump")
    modes = np.array([[float(mode.get(name) or 0.0) for mode in motor["modes"]] for name in _MODES])
    hertz, preload, mu = law["normal_stiffness_n_per_m15"], law["preload_n"], law["friction"]
    radius, compliance = rotor["radius_m"], law.get("series_compliance_m_per_n", 0.0)
    bending = preload * float(np.sum(modes[_Y] ** 2 / modes[_K]))
    seated = (preload / hertz) ** (2.0 / 3.0)
    tangential = law["tangential_compliance_tip_m_per_n23"] + law["tangential_compliance_rotor_m_per_n23"]
    p = np.array([
        hertz, compliance, _damping(law.get("restitution", 1.0), law.get("restitution_velocity_m_s", 1.0)),
        mu * tangential * hertz ** (2.0 / 3.0), mu,
        law.get("sliding_ratio", 1.0), law.get("stribeck_velocity_m_s", 1.0),
        radius, seated + compliance * preload + bending, preload * float(np.sum(modes[_X] * modes[_Y] / modes[_K])),
        preload,
        mount.get("mass_kg", np.inf), mount.get("damping_n_s_per_m", 0.0), mount.get("stiffness_n_per_m", 0.0),
        rotor["inertia_kg_m2"], rotor["bearing_damping_n_m_s"], rotor.get("bearing_friction_n_m", 0.0),
        rotor.get("bearing_presliding_rad", 1.0), float(speed is None), load_torque,
        law.get("tangential_series_compliance_m_per_n", 0.0),
    ])  # fmt: skip
    n = modes.shape[1]
    s = np.zeros(2 * n + 5 + len(INTEGRALS))
    s[:n] = -modes[_Y] * preload / modes[_K]
    s[0] += perturbation_m
    s[2 * n + 2] = start_speed if speed is None else speed
    samples = np.zeros((floor(duration / output_step * (1.0 + 1e-9)) + 1, s.size))
    substeps = max(1, ceil(output_step / step * (1.0 - 1e-9)))
    a, b = (np.array(tones, dtype=float).reshape(-1, 3) for tones in (tones_a, tones_b))
    _run(s, seated, a, b, modes, p, output_step / substeps, substeps, samples)
    if not np.isfinite(samples).all():
        raise RuntimeError("the motion is no longer finite: take a smaller step")
    return DampedRun(
        time_s=np.arange(len(samples)) * output_step,
        tip_x_m=samples[:, :n] @ modes[_X],
        tip_y_m=samples[:, :n] @ modes[_Y],
        rotor_speed_rad_s=samples[:, 2 * n + 2].copy(),
        integrals={name: samples[:, 2 * n + 5 + place].copy() for place, name in enumerate(INTEGRALS)},
    )


def _damping(restitution: float, velocity: float) -> float:
    """Hunt and Crossley's a in s/m by bisection: an impact at this velocity rebounds with e times of it.

    m v dv = −K δ^{3/2} (1 + a v) dδ: up to the turn and back, ∫ v dv/(1 + a v) is the same.
    """

    def potential(z: float) -> float:  # a² ∫ v dv/(1 + a v) from 0 to v = z/a
        return z - float(np.log1p(z))

    low, high = 0.0, 1.0 / restitution
    if restitution == 1.0:
        return 0.0
    while low < 0.5 * (low + high) < high:
        z = 0.5 * (low + high)
        low, high = (z, high) if potential(z) > potential(-restitution * z) else (low, z)
    return low / velocity
