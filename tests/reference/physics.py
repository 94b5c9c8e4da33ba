# SPDX-License-Identifier: GPL-3.0-or-later
"""What the reference integrators share, written from the physics alone; no code of the package.

The crown of the rotor is above the tip as it rests; on a mount the stator's carrier moves by z and z_x, which F_0
presses towards the rotor:
    m_n r_n'' + c_n r_n' + k_n r_n = θ_An U_A + θ_Bn U_B + X_n F_x + Y_n F_y − Γ_n z'' − Γ_xn z_x''
    m_c z'' + d_c z' + k_c z = F_0 + F_y − Σ Γ_n r_n''
    m_c z_x'' + d_x z_x' + k_x z_x = F_x − Σ Γ_xn r_n''      where the carrier moves along the rotor as well
    x = Σ X_n r_n + z_x + F_0 Σ X_n Y_n/k_n,  y = Σ Y_n r_n + z,  h = R − seat − y
    D = √(x² + h²),  d = R − D,  e_x = x/D,  e_y = h/D,  v_rel = x' e_y + y' e_x − Ω R
    F_x = F_N e_x − F_T e_y,  F_y = −F_N e_y − F_T e_x
    J Ω' + C_R Ω + T = R F_T − τ_load,  T' = (T_c Ω − T |Ω|)/φ_0
with the seat δ_0 + F_0 Σ Y_n²/k_n and the torque T of a dry bearing (Dahl), which rises to T_c over an angle of about
φ_0 after each reversal. Stribeck friction, with the slip velocity w and μ_∞ = ρ μ the friction of fast sliding:
    |F_T| = μ F_N [ρ + (1 − ρ) exp(−(w/v_s)²)]
"""

# mypy: allow-untyped-defs
from collections.abc import Mapping
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

_COLUMNS = (
    "mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "coupling_a_n_per_v", "coupling_b_n_per_v", "tip_x", "tip_y",
    "recoil_kg", "recoil_x_kg",
)  # fmt: skip
M, C, K, TA, TB, X, Y, RECOIL, RECOIL_X = range(9)
"""rows of the matrix of modes"""
R, SEAT, SWAY, PRELOAD, HERTZ, KAPPA, MU, DROP, VS, J, CR, TAU, FREE_SHAFT, DRY, ANGLE = range(15)
MASS, RESIST, SPRING, SPRUNG_X, RESIST_X, SPRING_X, SCALARS = range(15, 22)
"""places in the vector of scalars; an integrator's own come after them"""
U, OMEGA, Z, ZDOT, T, ZX, ZXDOT, Q = range(8)
"""places in the state after r_1 … r_n, r_1' … r_n'; the quadratures begin at Q"""


def read(
    motor: Mapping[str, Any], *, speed: float | None = None, load_torque: float = 0.0, own: int = 0
) -> tuple[Array, Array]:
    """Return the matrix of modes and the scalars of a motor, with places for ``own`` scalars of an integrator."""
    modes = np.array([[float(mode.get(name) or 0.0) for mode in motor["modes"]] for name in _COLUMNS])
    law, rotor, mount = motor["contact"], motor["rotor"], motor.get("mount") or {}
    friction, preload = float(law["friction"]), float(law["preload_n"])
    hertz, radius = float(law["normal_stiffness_n_per_m15"]), float(rotor["radius_m"])
    power = 1.0 / law.get("exponent", 1.5)  # of the force in the penetration
    compliance = float(law["tangential_compliance_tip_m_per_n23"]) + float(law["tangential_compliance_rotor_m_per_n23"])
    if not (friction > 0.0 and preload >= 0.0 and hertz > 0.0 and compliance > 0.0 and radius > 0.0):
        raise ValueError("friction, stiffness, compliance and radius must be > 0, the preload >= 0")
    p = np.zeros(SCALARS + own)
    bending = preload * float(np.sum(modes[Y] ** 2 / modes[K]))
    p[[R, SEAT, PRELOAD]] = radius, (preload / hertz) ** power + bending, preload
    p[SWAY] = preload * float(np.sum(modes[X] * modes[Y] / modes[K]))
    p[[HERTZ, KAPPA, MU]] = hertz, friction * compliance * hertz**power, friction
    p[[DROP, VS]] = 1.0 - law.get("sliding_ratio", 1.0), law.get("stribeck_velocity_m_s", 1.0)
    p[[J, CR, TAU]] = rotor["inertia_kg_m2"], rotor["bearing_damping_n_m_s"], load_torque
    p[FREE_SHAFT] = speed is None
    p[[DRY, ANGLE]] = rotor.get("bearing_friction_n_m", 0.0), rotor.get("bearing_presliding_rad", 1.0)
    along = mount.get("tangential_stiffness_n_per_m")
    p[[MASS, RESIST, SPRING]] = (
        mount.get("mass_kg", np.inf),
        mount.get("damping_n_s_per_m", 0.0),
        mount.get("stiffness_n_per_m", 0.0),
    )
    p[[SPRUNG_X, RESIST_X, SPRING_X]] = (
        along is not None,
        mount.get("tangential_damping_n_s_per_m") or 0.0,
        along or 0.0,
    )
    return modes, p


def rest(modes: Array, preload: float, quadratures: int) -> Array:
    """Return the state of preloaded rest."""
    n = modes.shape[1]
    start = np.zeros(2 * n + Q + quadratures)
    start[:n] = -modes[Y] * preload / modes[K]
    return start


@njit(nogil=True, cache=True)
def voltage(tones, t):
    """Sum of sines; a row is amplitude in V, frequency in Hz, phase in rad."""
    value = 0.0
    for i in range(tones.shape[0]):
        value += tones[i, 0] * np.sin(2.0 * np.pi * tones[i, 1] * t + tones[i, 2])
    return value


@njit(nogil=True, cache=True)
def approached(x, y, vx, vy, speed, p):
    """d, d', v_rel, e_x, e_y of a tip that has moved by x and y."""
    sigma = p[SEAT] + y  # R − h, so that d = R − D loses no digits
    h = p[R] - sigma
    distance = np.sqrt(x * x + h * h)
    d = (2.0 * p[R] * sigma - sigma * sigma - x * x) / (p[R] + distance)
    ex = x / distance
    ey = h / distance
    return d, ey * vy - ex * vx, vx * ey + vy * ex - p[R] * speed, ex, ey


@njit(nogil=True, cache=True)
def touching(z, modes, p):
    """d, d', v_rel, e_x, e_y of a state."""
    n = modes.shape[1]
    x, y, vx, vy = p[SWAY] + z[2 * n + ZX], z[2 * n + Z], z[2 * n + ZXDOT], z[2 * n + ZDOT]
    for i in range(n):
        x += modes[X, i] * z[i]
        y += modes[Y, i] * z[i]
        vx += modes[X, i] * z[n + i]
        vy += modes[Y, i] * z[n + i]
    return approached(x, y, vx, vy, z[2 * n + OMEGA], p)


@njit(nogil=True, cache=True)
def sliding(w, p):
    """Friction at the slip velocity w over that at the limit of stick (Stribeck)."""
    return 1.0 - p[DROP] * (1.0 - np.exp(-((w / p[VS]) ** 2)))


@njit(nogil=True, cache=True)
def accelerate(z, ua, ub, fx, fy, ft, modes, p, dz):
    """Fill the rates of modes, carrier, rotor and bearing.

    Returns the powers that the drive gives the modes, and that modes, mount and bearing take.
    """
    n = modes.shape[1]
    given = lost = 0.0
    rise, rise_x, speed, dry = z[2 * n + ZDOT], z[2 * n + ZXDOT], z[2 * n + OMEGA], z[2 * n + T]
    push = p[PRELOAD] + fy - p[RESIST] * rise - p[SPRING] * z[2 * n + Z]  # on the carrier
    push_x = fx - p[RESIST_X] * rise_x - p[SPRING_X] * z[2 * n + ZX]
    # what z'' and z_x'' accelerate once the modal accelerations are eliminated
    borne = borne_x = p[MASS]
    shared = 0.0
    for i in range(n):
        v = z[n + i]
        drive = modes[TA, i] * ua + modes[TB, i] * ub
        resist = modes[C, i] * v
        dz[i] = v
        dz[n + i] = (drive - resist - modes[K, i] * z[i] + modes[X, i] * fx + modes[Y, i] * fy) / modes[M, i]
        push -= modes[RECOIL, i] * dz[n + i]
        borne -= modes[RECOIL, i] ** 2 / modes[M, i]
        push_x -= modes[RECOIL_X, i] * dz[n + i]
        borne_x -= modes[RECOIL_X, i] ** 2 / modes[M, i]
        shared -= modes[RECOIL, i] * modes[RECOIL_X, i] / modes[M, i]
        given += drive * v
        lost += resist * v
    shaken, shaken_x = push / borne, 0.0  # 0 without a mount, whose mass is infinite
    if p[SPRUNG_X]:
        whole = borne * borne_x - shared * shared
        shaken = (push * borne_x - push_x * shared) / whole
        shaken_x = (push_x * borne - push * shared) / whole
    for i in range(n):
        dz[n + i] -= (modes[RECOIL, i] * shaken + modes[RECOIL_X, i] * shaken_x) / modes[M, i]
    dz[2 * n + Z], dz[2 * n + ZDOT] = rise, shaken
    dz[2 * n + ZX], dz[2 * n + ZXDOT] = rise_x, shaken_x
    dz[2 * n + OMEGA] = p[FREE_SHAFT] * (p[R] * ft - p[CR] * speed - dry - p[TAU]) / p[J]
    dz[2 * n + T] = (p[DRY] * speed - dry * abs(speed)) / p[ANGLE]
    return given, lost, p[RESIST] * rise * rise + p[RESIST_X] * rise_x * rise_x, (p[CR] * speed + dry) * speed
