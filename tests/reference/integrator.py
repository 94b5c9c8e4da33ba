# SPDX-License-Identifier: GPL-3.0-or-later
"""Event-driven integration of the standing-wave piezomotor, written from the physics alone.

It shares no code with the package that it checks; both have only the law in common.

The law, with what is in :mod:`.physics`, d = δ and
    F_N = K_N δ^{3/2},  u_lim = μ K_t F_N^{2/3} = κ δ  with  κ = μ K_t K_N^{2/3}
    F_T = sign(u) μ F_N [1 − (1 − |u|/u_lim)^{3/2}],  with Stribeck friction in slip, where w = |v_rel − u'|
A free tip has a carrier only if there is recoil, and then no F_0.
A tip worn to a flat of radius b, with R* of the new tip and E* = 3 K_N/(4 √R*): the contact's radius a from
δ R* = a √(a² − b²), then F_N = 2 E*/(3 R*) (2 a² + b²) √(a² − b²), and F_T = sign(u) μ [F_N(δ) − F_N(δ − |u|/κ)]

Four states, each with smooth equations of its own:
    separated   δ ≤ 0:  F_N = F_T = u = 0
    stick       u' = v_rel, |u| ≤ u_lim
    slip+/−     u = s u_lim, for as long as s v_rel > u_lim' = κ δ'

Between two events the classical Runge–Kutta method runs with a fixed step. A step that ends beyond an event
is discarded; the event's time is found by bisection on the length of the step, every trial being a
Runge–Kutta step from the same start, so that no step reaches across an event. What is left of the step is
then done in the new state. The passage of u through 0, where F_T has a jump in its curvature, splits a step
too, uncounted.

At the touch u and u_lim are both zero: the slider follows (stick) if |v_rel| ≤ κ δ', otherwise it slips.
"""

# mypy: allow-untyped-defs
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from tests.reference import physics
from tests.reference.physics import HERTZ, KAPPA, MU, OMEGA, Array, Q, R, U, accelerate, sliding, touching, voltage


class Tone(NamedTuple):
    """amplitude_v · sin(2π frequency_hz t + phase_rad), on from t = 0."""

    amplitude_v: float
    frequency_hz: float
    phase_rad: float = 0.0


@dataclass(frozen=True)
class ReferenceRun:
    """Samples at k · output_step (SI units) and integrals of the run."""

    time_s: Array
    voltage_a_v: Array
    voltage_b_v: Array
    tip_x_m: Array
    tip_y_m: Array
    normal_force_n: Array
    friction_force_n: Array
    contact_displacement_m: Array
    contact_state: NDArray[np.int64]
    """0 separated, 1 stick, 2 slip"""
    rotor_speed_rad_s: Array
    modal_displacement_m: Array
    """(modes, times)"""
    modal_velocity_m_s: Array
    state_fractions: dict[str, float]
    """separated, stick, slip: shares of the time from statistics_from to the end, from the event times"""
    slip_energy_j: float
    """∫ F_T (v_rel − u') dt over the whole run: what the slipping contact turned into heat, never negative"""
    input_mechanical_energy_j: float
    """∫ Σ (θ_A U_A + θ_B U_B) r' dt over the whole run"""
    energies_j: dict[str, float]
    """The balance of the run: input = kinetic + elastic + damping + contact_elastic + tangential + shaft.
    The stored energies are end minus start, tangential = ∫ F_T v_rel dt (slip and what the tangential spring
    takes), shaft = ∫ R F_T Ω dt, which a free rotor divides into rotor_kinetic + bearing + load.
    On a mount there are two more terms: mount (kinetic and elastic energy less the work of F_0) and
    mount_damping. bearing includes the dry friction."""
    events: int
    """changes of state"""
    carrier_displacement_m: Array
    """z of the mount, towards the rotor; 0 for a stator that is held"""


SEPARATED, STICK, SLIP_UP, SLIP_DOWN = 0, 1, 2, 3
_TOUCH, _UPPER, _LOWER, _REVERSAL, _FOLD = 0, 1, 2, 3, 4  # what ends a step
_QUADRATURES = ("input", "damping", "tangential", "slip", "bearing", "load", "shaft", "mount_damping")
_BISECTION_S = 1e-16
_EVENTS_A_STEP = 40
_DONE, _CHATTER, _NOT_FINITE = 0, 1, 2

_CONTACT, _FLAT, _ROUND, _POWER = range(physics.SCALARS, physics.SCALARS + 4)  # scalars beside those of the physics


@njit(nogil=True, cache=True)
def _pressed(delta, p):
    """Normal force at a penetration."""
    if delta <= 0.0:
        return 0.0
    if p[_POWER] != 1.5:
        return p[HERTZ] * delta ** p[_POWER]
    if p[_FLAT] == 0.0:
        return p[HERTZ] * delta * np.sqrt(delta)
    flat, curved = p[_FLAT] ** 2, p[_ROUND]
    wide = 0.5 * (flat + np.sqrt(flat * flat + 4.0 * (curved * delta) ** 2))
    return p[HERTZ] / (2.0 * curved**1.5) * (2.0 * wide + flat) * np.sqrt(wide - flat)


def _seat(depth, preload, p):
    """Penetration of a preload by bisection, from that of a new tip, which is at least as deep."""
    shallow = 0.0
    while p[_FLAT] and shallow < 0.5 * (shallow + depth) < depth:
        middle = 0.5 * (shallow + depth)
        shallow, depth = (middle, depth) if _pressed(middle, p) < preload else (shallow, middle)
    return depth


@njit(nogil=True, cache=True)
def _rates(z, ua, ub, state, modes, p, dz):
    n = modes.shape[1]
    delta, ddelta, vrel, ex, ey = touching(z, modes, p)
    fn = ft = slip = 0.0
    dz[2 * n + U] = 0.0
    if state != SEPARATED:
        fn = _pressed(delta, p)
        if state == STICK:
            u = z[2 * n + U]
            dz[2 * n + U] = vrel
            limit = p[KAPPA] * delta
            if limit > 0.0:
                ft = p[MU] * (fn - _pressed(delta - abs(u) / p[KAPPA], p))
                if u < 0.0:
                    ft = -ft
        else:
            s = 1.0 if state == SLIP_UP else -1.0
            w = vrel - s * p[KAPPA] * ddelta
            ft = s * p[MU] * fn * sliding(w, p)
            slip = ft * w
    given, lost, mount, bearing = accelerate(z, ua, ub, fn * ex - ft * ey, -fn * ey - ft * ex, ft, modes, p, dz)
    speed, q = z[2 * n + OMEGA], 2 * n + Q
    dz[q], dz[q + 1], dz[q + 2], dz[q + 3] = given, lost, ft * vrel, slip
    dz[q + 4], dz[q + 5], dz[q + 6], dz[q + 7] = bearing, p[physics.TAU] * speed, p[R] * ft * speed, mount


@njit(nogil=True, cache=True)
def _advance(z, t, h, state, tones_a, tones_b, modes, p, work, end):
    """One step of the classical Runge–Kutta method, from z to end."""
    size = z.shape[0]
    k1, k2, k3, k4, trial = work[0], work[1], work[2], work[3], work[4]
    ua = voltage(tones_a, t + 0.5 * h)
    ub = voltage(tones_b, t + 0.5 * h)
    _rates(z, voltage(tones_a, t), voltage(tones_b, t), state, modes, p, k1)
    for i in range(size):
        trial[i] = z[i] + 0.5 * h * k1[i]
    _rates(trial, ua, ub, state, modes, p, k2)
    for i in range(size):
        trial[i] = z[i] + 0.5 * h * k2[i]
    _rates(trial, ua, ub, state, modes, p, k3)
    for i in range(size):
        trial[i] = z[i] + h * k3[i]
    _rates(trial, voltage(tones_a, t + h), voltage(tones_b, t + h), state, modes, p, k4)
    for i in range(size):
        end[i] = z[i] + h * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0


@njit(nogil=True, cache=True)
def _copy(source, target):
    """Copy in a loop: numba takes 3 s to compile the assignment of a slice, whose error states both shapes."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@njit(nogil=True, cache=True)
def _gauge(z, kind, state, modes, p):
    """What is positive until the event of this kind happens, and its rate (0 where it is not asked for)."""
    delta, ddelta, vrel, _, _ = touching(z, modes, p)
    u = z[2 * modes.shape[1]]
    if kind == _TOUCH:
        return (-delta, -ddelta) if state == SEPARATED else (delta, ddelta)
    if kind == _UPPER:
        return p[KAPPA] * delta - u, p[KAPPA] * ddelta - vrel
    if kind == _LOWER:
        return p[KAPPA] * delta + u, p[KAPPA] * ddelta + vrel
    if kind == _REVERSAL:
        return (vrel if state == SLIP_UP else -vrel) - p[KAPPA] * ddelta, 0.0
    return u, vrel  # _FOLD; its sign is the caller's


@njit(nogil=True, cache=True)
def _bisect(low, high, sign, by_rate, kind, z, t, state, tones_a, tones_b, modes, p, work, end):
    """The length of step at which sign · gauge (or its rate) turns from ≥ 0 to < 0: the side beyond."""
    while high - low > _BISECTION_S:
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        _advance(z, t, middle, state, tones_a, tones_b, modes, p, work, end)
        value, rate = _gauge(end, kind, state, modes, p)
        if sign * (rate if by_rate else value) < 0.0:
            high = middle
        else:
            low = middle
    return high


@njit(nogil=True, cache=True)
def _first(kind, z, end, t, h, state, tones_a, tones_b, modes, p, work, scratch):
    """When, in the step from z to end, an event of this kind happens first; 2h if it does not."""
    never = 2.0 * h
    g0, rate0 = _gauge(z, kind, state, modes, p)
    g1, rate1 = _gauge(end, kind, state, modes, p)
    u = z[2 * modes.shape[1]]
    if kind == _FOLD:
        delta, _, _, _, _ = touching(end, modes, p)
        if g0 * g1 < 0.0 and abs(g1) > 1e-6 * p[KAPPA] * delta:
            sign = 1.0 if g0 > 0.0 else -1.0
            return _bisect(0.0, h, sign, False, kind, z, t, state, tones_a, tones_b, modes, p, work, scratch)
        return never
    pinned = (kind in (_UPPER, _LOWER)) and g0 <= 8.0 * 2.3e-16 * abs(u)
    if pinned:  # the step starts on the limit: it has just begun to stick, and leaves the limit as t²
        if g1 >= 0.0 or rate1 >= 0.0:
            return never
        top = _bisect(0.0, h, 1.0, True, kind, z, t, state, tones_a, tones_b, modes, p, work, scratch)
        _advance(z, t, top, state, tones_a, tones_b, modes, p, work, scratch)
        if _gauge(scratch, kind, state, modes, p)[0] <= 0.0:
            return top
        return _bisect(top, h, 1.0, False, kind, z, t, state, tones_a, tones_b, modes, p, work, scratch)
    if g1 < 0.0:
        return _bisect(0.0, h, 1.0, False, kind, z, t, state, tones_a, tones_b, modes, p, work, scratch)
    if rate0 < 0.0 and rate1 > 0.0:  # a dip inside the step; where the two tangents meet bounds its depth
        meet = (g1 - rate1 * h - g0) / (rate0 - rate1)
        if g0 + rate0 * meet < 0.0:
            low = _bisect(0.0, h, -1.0, True, kind, z, t, state, tones_a, tones_b, modes, p, work, scratch)
            _advance(z, t, low, state, tones_a, tones_b, modes, p, work, scratch)
            if _gauge(scratch, kind, state, modes, p)[0] >= 0.0:
                return never
            return _bisect(0.0, low, 1.0, False, kind, z, t, state, tones_a, tones_b, modes, p, work, scratch)
    return never


@njit(nogil=True, cache=True)
def _next_state(z, kind, state, modes, p):
    """The state after an event, with u put where that state has it."""
    n = modes.shape[1]
    delta, ddelta, vrel, _, _ = touching(z, modes, p)
    limit = p[KAPPA] * delta
    growth = p[KAPPA] * ddelta
    if delta <= 0.0:
        z[2 * n] = 0.0
        return SEPARATED
    if state == SEPARATED:
        z[2 * n] = 0.0
        if vrel > growth:
            return SLIP_UP
        if vrel < -growth:
            return SLIP_DOWN
        return STICK
    if kind == _FOLD:
        return STICK
    up = kind == _UPPER or (kind == _REVERSAL and state == SLIP_UP)
    s = 1.0 if up else -1.0
    z[2 * n] = s * limit
    if kind != _REVERSAL and s * vrel > growth:
        return SLIP_UP if up else SLIP_DOWN
    return STICK


@njit(nogil=True, cache=True)
def _next_event(z, end, t, h, state, tones_a, tones_b, modes, p, work, scratch):
    """The first event in the step from z to end, and when; −1 if there is none."""
    kind, when = -1, 2.0 * h
    for candidate in (_TOUCH, _UPPER, _LOWER, _REVERSAL, _FOLD):
        if state == STICK:
            asked = candidate in (_UPPER, _LOWER, _FOLD)
        else:
            asked = candidate == _TOUCH or (candidate == _REVERSAL and state != SEPARATED)
        if asked:
            first = _first(candidate, z, end, t, h, state, tones_a, tones_b, modes, p, work, scratch)
            if first < when:
                kind, when = candidate, first
    return kind, when


@njit(nogil=True, cache=True)
def _one_step(z, begin, stop, state, tones_a, tones_b, modes, p, start, spent, work, end, scratch):
    """From begin to stop, through all events: the state there, the number of changes, how it ended."""
    length, done, changes = stop - begin, 0.0, 0
    for _ in range(_EVENTS_A_STEP):
        if done >= length:
            return state, changes, _DONE
        t, h, kind = begin + done, length - done, -1
        _advance(z, t, h, state, tones_a, tones_b, modes, p, work, end)
        if p[_CONTACT] > 0.0:
            kind, when = _next_event(z, end, t, h, state, tones_a, tones_b, modes, p, work, scratch)
            if kind >= 0:
                h = when
                _advance(z, t, h, state, tones_a, tones_b, modes, p, work, end)
        _copy(end, z)
        spent[min(state, 2)] += max(0.0, t + h - max(t, start))
        if kind >= 0:
            done += h
            following = _next_state(z, kind, state, modes, p)
            if following != state:
                changes += 1
            state = following
        else:
            done = length
            if state == STICK:  # rounding, where it has just begun to stick
                u = 2 * modes.shape[1]
                limit = p[KAPPA] * max(touching(z, modes, p)[0], 0.0)
                z[u] = min(max(z[u], -limit), limit)
    return state, changes, _DONE if done >= length else _CHATTER


@njit(nogil=True, cache=True)
def _run(z, state, tones_a, tones_b, modes, p, output_step, substeps, duration, start, samples, states, spent):
    """Integrates to the end; fills the samples, the states there and the time spent in each from start on.

    Returns how it ended, when, and the number of changes of state.
    """
    work = np.zeros((5, z.shape[0]))
    end, scratch = np.zeros(z.shape[0]), np.zeros(z.shape[0])
    events = 0
    count = samples.shape[0]
    _copy(z, samples[0])
    states[0] = state
    for k in range(count):  # the last pass is what is left of the duration after the last sample
        for j in range(substeps):
            begin = (k + j / substeps) * output_step
            stop = (k + (j + 1) / substeps) * output_step
            if k + 1 == count:
                stop = min(stop, duration)
            state, changes, ending = _one_step(
                z, begin, stop, state, tones_a, tones_b, modes, p, start, spent, work, end, scratch
            )
            events += changes
            if not np.isfinite(z[0]):
                ending = _NOT_FINITE
            if ending != _DONE:
                return ending, stop, events
        if k + 1 < count:
            _copy(z, samples[k + 1])
            states[k + 1] = state
    return _DONE, duration, events


def _waveform(tones: Array, time: Array) -> Array:
    amplitude, frequency, phase = tones.T[:, :, np.newaxis]
    return np.asarray((amplitude * np.sin(2.0 * np.pi * frequency * time + phase)).sum(axis=0))


def integrate(
    motor: Mapping[str, Any],
    tones_a: Sequence[tuple[float, float, float]],
    tones_b: Sequence[tuple[float, float, float]],
    *,
    duration: float,
    output_step: float,
    step: float = 2e-8,
    contact: bool = True,
    speed: float | None = None,
    load_torque: float = 0.0,
    perturbation_m: float = 0.0,
    statistics_from: float = 0.0,
) -> ReferenceRun:
    """Integrate a motor (the mapping that ``piezomotor show MOTOR --json`` prints) from preloaded rest.

    The step is the largest that divides output_step and is not above ``step``. With ``contact=False`` the tip
    is free and starts from r = 0. A ``mount`` that is not null springs the carrier; a free tip has it for its recoil.
    ``speed`` holds the shaft; without it the rotor starts from rest against ``load_torque``. ``perturbation_m``
    shifts the start of r_1: two runs that differ in it alone show chaos. A tone is a :class:`Tone` or as one.
    """
    if not (duration > 0.0 and output_step > 0.0 and step > 0.0 and 0.0 <= statistics_from < duration):
        raise ValueError("duration, output_step and step must be > 0, and 0 <= statistics_from < duration")
    a, b = (np.array(tones, dtype=np.float64).reshape(-1, 3) for tones in (tones_a, tones_b))
    modes, scalars = physics.read(motor, speed=speed, load_torque=load_torque, own=4)
    law, n = motor["contact"], modes.shape[1]
    preload = float(scalars[physics.PRELOAD])
    scalars[[_CONTACT, _FLAT, _ROUND]] = contact, law.get("worn_flat_radius_m", 0.0), law.get("effective_radius_m", 1.0)
    scalars[_POWER] = power = law.get("exponent", 1.5)
    new = (preload / scalars[HERTZ]) ** (1.0 / power)
    scalars[physics.SEAT] += _seat(new, preload, scalars) - new
    mounted = bool(motor.get("mount")) and (contact or bool(np.any(modes[physics.RECOIL :])))
    if not mounted:
        scalars[[physics.MASS, physics.SPRUNG_X]] = np.inf, 0.0
    if not contact:
        scalars[physics.PRELOAD] = 0.0
    start = physics.rest(modes, float(scalars[physics.PRELOAD]), len(_QUADRATURES))
    start[0] += perturbation_m
    start[2 * n + OMEGA] = 0.0 if speed is None else speed

    def indentation(z: Array) -> float:
        return float(touching(z, modes, scalars)[0])

    first = STICK if contact and indentation(start) > 0.0 else SEPARATED
    count = floor(duration / output_step * (1.0 + 1e-12)) + 1
    substeps = max(1, ceil(output_step / step * (1.0 - 1e-9)))
    samples = np.zeros((count, start.size))
    states = np.zeros(count, dtype=np.int64)
    spent = np.zeros(3)
    final = start.copy()
    ending, when, events = _run(
        final,
        first,
        a,
        b,
        modes,
        scalars,
        float(output_step),
        substeps,
        float(duration),
        float(statistics_from),
        samples,
        states,
        spent,
    )
    if ending == _CHATTER:
        raise RuntimeError(
            f"the contact changes its state more than {_EVENTS_A_STEP} times within a step of "
            f"{output_step / substeps:.3g} s at t = {when:.9g} s: chatter, not physics"
        )
    if ending == _NOT_FINITE:
        raise RuntimeError(f"the motion is no longer finite at t = {when:.9g} s: take a smaller step")

    time: Array = np.arange(count, dtype=np.float64) * np.float64(output_step)
    r, v = samples[:, :n].T.copy(), samples[:, n : 2 * n].T.copy()
    kappa = float(scalars[KAPPA])
    limit = kappa * np.maximum([indentation(sample) for sample in samples], 0.0)
    pressed = np.vectorize(lambda depth: _pressed(depth, scalars), otypes=[float])
    normal = np.where(states == SEPARATED, 0.0, pressed(limit / kappa))
    u = np.where(states == STICK, samples[:, 2 * n], np.where(states == SLIP_UP, limit, -limit))
    u[states == SEPARATED] = 0.0
    slipping = np.isin(states, (SLIP_UP, SLIP_DOWN))
    share = np.ones(count)
    for k in np.flatnonzero(slipping):
        _, growth, relative, _, _ = touching(samples[k], modes, scalars)
        share[k] = sliding(abs(relative) - kappa * growth, scalars)

    nodes, weights = np.polynomial.legendre.leggauss(400)

    def stored(z: Array) -> tuple[float, float, float, float, float]:
        depth = max(indentation(z), 0.0) if contact else 0.0
        lift, rise = float(z[2 * n + physics.Z]), float(z[2 * n + physics.ZDOT])
        lift_x, rise_x = float(z[2 * n + physics.ZX]), float(z[2 * n + physics.ZXDOT])
        return (
            0.5 * float(modes[physics.M] @ z[n : 2 * n] ** 2),
            0.5 * float(modes[physics.K] @ z[:n] ** 2),
            0.5 * depth * float(weights @ pressed(0.5 * depth * (1.0 + nodes))),  # of √δ exact to 1e-9
            0.5 * float(scalars[physics.J]) * float(z[2 * n + OMEGA]) ** 2,
            0.5 * float(scalars[physics.SPRING]) * lift**2
            - float(scalars[physics.PRELOAD]) * lift
            + (0.5 * float(scalars[physics.MASS]) * rise + float(modes[physics.RECOIL] @ z[n : 2 * n])) * rise
            + 0.5 * float(scalars[physics.SPRING_X]) * lift_x**2
            + (0.5 * float(scalars[physics.MASS]) * rise_x + float(modes[physics.RECOIL_X] @ z[n : 2 * n])) * rise_x
            if mounted
            else 0.0,
        )

    energies = {name: float(final[2 * n + Q + i]) for i, name in enumerate(_QUADRATURES)}
    for name, before, after in zip(
        ("kinetic", "elastic", "contact_elastic", "rotor_kinetic", "mount"), stored(start), stored(final), strict=True
    ):
        energies[name] = after - before
    window = duration - statistics_from
    return ReferenceRun(
        time_s=time,
        voltage_a_v=_waveform(a, time),
        voltage_b_v=_waveform(b, time),
        tip_x_m=modes[physics.X] @ r,
        tip_y_m=modes[physics.Y] @ r,
        normal_force_n=normal,
        friction_force_n=np.sign(u) * scalars[MU] * share * (normal - pressed((limit - np.abs(u)) / kappa)),
        contact_displacement_m=u,
        contact_state=np.minimum(states, 2),
        rotor_speed_rad_s=samples[:, 2 * n + OMEGA].copy(),
        modal_displacement_m=r,
        modal_velocity_m_s=v,
        state_fractions=dict(zip(("separated", "stick", "slip"), (spent / window).tolist(), strict=True)),
        slip_energy_j=energies["slip"],
        input_mechanical_energy_j=energies["input"],
        energies_j=energies,
        events=int(events),
        carrier_displacement_m=samples[:, 2 * n + physics.Z].copy(),
    )
