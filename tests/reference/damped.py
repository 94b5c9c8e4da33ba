# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed-step integration of the standing-wave piezomotor with every loss and recoil, written from the physics alone.

It shares no code with the package that it checks, nor with :mod:`.integrator`, which finds each event exactly but has
no loss along the normal.

The law, with what is in :mod:`.physics` and d the approach of tip and rotor, whose seat is deeper by C F_0
    d = δ + C F_N,  F_N = K_N δ^{3/2} f,  f = max(0, 1 + a δ')      series compliance C, Hunt and Crossley's a
    F_T = sign(u) μ s F_N [1 − (1 − |u|/u_lim)^{3/2}],  u_lim = μ K_t K_N^{2/3} δ f
    (u + C_t F_T)' = v_rel in |u| ≤ u_lim, with the compliance C_t along the rotor
    the voltages move the tip by S U in addition, if it gives way: d' and v_rel by the rate of it
    s: Stribeck's factor, with the slip velocity w = |v_rel − u'|, where C_t = 0

With C and a the penetration is a state of its own, which follows d with the time constant a C K_N δ^{3/2}. The implicit
Euler rule finds it from that at the start of a step, so that it needs no finer step.

With a compliance C_t along the rotor the state is u + C_t F_T, a function of u that rises, so that its limit is that at
u_lim. (The package forms the rate of C_t F_T by a difference formula instead.)

The classical Runge–Kutta method runs with a fixed step. The slider is put back to its limit after each step, so that a
change of state is late by a step at most: the error of the means is of first order, and two steps show it.
"""

# mypy: allow-untyped-defs
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any

import numpy as np
from numba import njit

from tests.reference import physics
from tests.reference.physics import HERTZ, KAPPA, MU, OMEGA, Array, Q, U, X, Y, accelerate, sliding, touching, voltage

_SERIES, _LOSS, _SOFT = range(physics.SCALARS, physics.SCALARS + 3)  # C, a and C_t
_MOVED = physics.SCALARS + 3  # motion of the tip per volt of A and B along the rotor, then towards it
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
    hertz, compliance, damping = p[HERTZ], p[_SERIES], p[_LOSS]
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
    compliance, damping = p[_SERIES], p[_LOSS]
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
        force *= sliding(w, p)
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
def _rise(tones, t):
    """Rate of the sum of sines in V/s."""
    value = 0.0
    for i in range(tones.shape[0]):
        omega = 2.0 * np.pi * tones[i, 1]
        value += tones[i, 0] * omega * np.cos(omega * t + tones[i, 2])
    return value


@njit(nogil=True, cache=True)
def _rates(s, t, tones_a, tones_b, before, f0, h, w, modes, p, ds):
    """Fill the rates of the state; return δ, f, and the limit of u + C_t F_T."""
    n = modes.shape[1]
    hertz, damping = p[HERTZ], p[_LOSS]
    d, approach, relative, ex, ey = touching(s, modes, p)
    ua, ub, ra, rb = voltage(tones_a, t), voltage(tones_b, t), _rise(tones_a, t), _rise(tones_b, t)
    slid, pressed = p[_MOVED] * ra + p[_MOVED + 1] * rb, p[_MOVED + 2] * ra + p[_MOVED + 3] * rb
    d += p[_MOVED + 2] * ua + p[_MOVED + 3] * ub
    approach, relative = approach + pressed, relative + slid
    delta, f = _depth(d, approach, before, f0, h, p)
    fn = hertz * delta * np.sqrt(delta) * f
    limit = p[KAPPA] * delta * f
    rate = (f - 1.0) / damping if damping > 0.0 and f > 0.0 else approach
    ft = _friction(_slider(s[2 * n + U], limit, p[MU] * fn, p[_SOFT]), limit, p[MU] * fn, w, p)
    given, lost, mount, bearing = accelerate(s, ua, ub, fn * ex - ft * ey, -fn * ey - ft * ex, ft, modes, p, ds)
    ds[2 * n + U] = relative if d > 0.0 else 0.0
    q = 2 * n + Q
    ds[q], ds[q + 1], ds[q + 2] = given + fn * pressed + ft * slid, lost, mount
    ds[q + 3] = (fn - hertz * delta * np.sqrt(delta)) * rate if d > 0.0 else 0.0
    ds[q + 4], ds[q + 5] = ft * relative, bearing
    ds[q + 6], ds[q + 7], ds[q + 8] = fn, ft, s[2 * n + OMEGA]
    return delta, f, limit + p[_SOFT] * p[MU] * fn


@njit(nogil=True, cache=True)
def _run(s, delta, tones_a, tones_b, modes, p, step, substeps, samples):
    size, u = s.shape[0], 2 * modes.shape[1] + U
    k1, k2, k3, k4, trial = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    f, w = 1.0, 0.0
    samples[0] = s
    for k in range(1, samples.shape[0]):
        for j in range(substeps):
            t = ((k - 1) * substeps + j) * step
            half = t + 0.5 * step
            _rates(s, t, tones_a, tones_b, delta, f, 0.0, w, modes, p, k1)
            for i in range(size):
                trial[i] = s[i] + 0.5 * step * k1[i]
            _rates(trial, half, tones_a, tones_b, delta, f, 0.5 * step, w, modes, p, k2)
            for i in range(size):
                trial[i] = s[i] + 0.5 * step * k2[i]
            _rates(trial, half, tones_a, tones_b, delta, f, 0.5 * step, w, modes, p, k3)
            for i in range(size):
                trial[i] = s[i] + step * k3[i]
            _rates(trial, t + step, tones_a, tones_b, delta, f, step, w, modes, p, k4)
            for i in range(size):
                s[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            delta, f, limit = _rates(s, t + step, tones_a, tones_b, delta, f, step, w, modes, p, trial)
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
    law = motor["contact"]
    if law.get("worn_flat_radius_m"):
        raise ValueError("this integrator has no worn tip")
    if law.get("sliding_ratio", 1.0) < 1.0 and law.get("tangential_series_compliance_m_per_n"):
        raise ValueError("friction that falls makes a spring without mass jump")
    modes, p = physics.read(motor, speed=speed, load_torque=load_torque, own=7)
    preload, n = float(p[physics.PRELOAD]), modes.shape[1]
    compliance = law.get("series_compliance_m_per_n", 0.0)
    seated = (preload / p[HERTZ]) ** (2.0 / 3.0)
    p[physics.SEAT] += compliance * preload
    p[[_SERIES, _SOFT]] = compliance, law.get("tangential_series_compliance_m_per_n", 0.0)
    moved = [motor.get("piezo", {}).get(f"motion_{axis}_{group}_m_per_v", 0.0) for axis in "xy" for group in "ab"]
    p[_MOVED : _MOVED + 4] = np.array(moved) * np.repeat(p[[_SOFT, _SERIES]] > 0.0, 2)
    p[_LOSS] = _damping(law.get("restitution", 1.0), law.get("restitution_velocity_m_s", 1.0))
    s = physics.rest(modes, preload, len(INTEGRALS))
    s[0] += perturbation_m
    s[2 * n + OMEGA] = start_speed if speed is None else speed
    samples = np.zeros((floor(duration / output_step * (1.0 + 1e-9)) + 1, s.size))
    substeps = max(1, ceil(output_step / step * (1.0 - 1e-9)))
    a, b = (np.array(tones, dtype=float).reshape(-1, 3) for tones in (tones_a, tones_b))
    _run(s, seated, a, b, modes, p, output_step / substeps, substeps, samples)
    if not np.isfinite(samples).all():
        raise RuntimeError("the motion is no longer finite: take a smaller step")
    return DampedRun(
        time_s=np.arange(len(samples)) * output_step,
        tip_x_m=samples[:, :n] @ modes[X],
        tip_y_m=samples[:, :n] @ modes[Y],
        rotor_speed_rad_s=samples[:, 2 * n + OMEGA].copy(),
        integrals={name: samples[:, 2 * n + Q + place].copy() for place, name in enumerate(INTEGRALS)},
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
