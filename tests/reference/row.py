# SPDX-License-Identifier: GPL-3.0-or-later
"""A Hertz contact as a row of very many independent elements: the yardstick of the contact laws.

Written from the theory alone (V. L. Popov, M. Heß, *Method of Dimensionality Reduction in Contact Mechanics and
Friction*, Springer 2015, for a sphere); it shares no code with the package.

The element at x is pressed in by δ − x²/R*, where that is positive. Per length it carries E* (δ − x²/R*) as normal
force and G* u as tangential force, u being its own tangential displacement, and slips at |u| = μ (E*/G*) (δ − x²/R*).
It has u = 0 when it comes into touch. All sums here are over midpoints x of equal lengths, so that neither friction
force nor stiffness is exact but in the limit of many elements and small steps.

Units: penetration in d, displacement in μ (E*/G*) d, force in μ K_N d^(3/2), with d any penetration.
"""

# mypy: allow-untyped-defs
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from tests.reference import physics
from tests.reference.physics import Array, approached, voltage

ELEMENTS = 1000


@njit(nogil=True, cache=True)
def _drag(depth, displacement, reach, elements):
    """Friction force and the share of slipping elements for given histories of penetration and displacement."""
    count = depth.shape[0]
    force, slipping = np.zeros(count), np.zeros(count)
    gap = np.empty(elements)
    for i in range(elements):
        gap[i] = reach * ((i + 0.5) / elements) ** 2
    width = np.sqrt(reach) / elements
    u = np.zeros(elements)
    for k in range(count):
        step = displacement[k] - displacement[k - 1] if k > 0 else displacement[0]
        slip = touching = 0
        total = 0.0
        for i in range(elements):
            limit = depth[k] - gap[i]
            if limit <= 0.0:
                u[i] = 0.0
                continue
            touching += 1
            moved = u[i] + step
            u[i] = min(max(moved, -limit), limit)
            slip += moved != u[i]
            total += u[i]
        force[k] = 1.5 * width * total
        slipping[k] = slip / touching if touching > 0 else 0.0
    return force, slipping


def drag(depth: Array, displacement: Array, elements: int = ELEMENTS) -> tuple[Array, Array]:
    """Return friction force and share of slipping elements along a history that starts unloaded along the tangent."""
    force, slipping = _drag(depth, displacement, float(np.max(depth)), elements)
    return np.asarray(force), np.asarray(slipping)


@njit(nogil=True, cache=True)
def _throw(psi, ratio, steps, elements):
    """The rebound ψ₂ and the duration, for a sphere in units of m = v_n = δ_max = 1, so that K_N = 5/4.

    The tangential motion of the patch feels 2/7 of the mass. In units of ψ, and with u in units of μ E*/G*,
    ψ' = −(7/2) (G*/E*) (5/4) f with f the force in units of μ K_N. Leapfrog: the velocities live between the steps.
    """
    h = 2.943276 / steps
    width = 1.0 / elements
    u = np.zeros(elements)
    depth, approach, patch = 0.0, 1.0, psi
    for k in range(2 * steps):
        before = depth
        depth += approach * h
        if depth <= 0.0:
            return patch, h * (k + before / (before - depth))
        total = 0.0
        for i in range(elements):
            gap = ((i + 0.5) * width) ** 2
            limit = depth - gap
            if limit <= 0.0:
                u[i] = 0.0
                continue
            u[i] = min(max(u[i] + patch * h, -limit), limit)
            total += u[i]
        approach -= 1.25 * depth * np.sqrt(depth) * h
        patch -= 3.5 / ratio * 1.25 * 1.5 * width * total * h
    return np.nan, np.nan


def throw(psi: float, ratio: float, steps: int = 4000, elements: int = ELEMENTS) -> tuple[float, float]:
    """Return the rebound ψ₂ of a solid sphere and the duration in units of δ_max/v_n.

    Args:
        psi: incidence ψ₁ of the patch.
        ratio: E*/G*; (2 − ν)/(2 (1 − ν)) for two bodies of one material.
        steps: number of time steps of the impact.
        elements: number of elements of half of the greatest contact.
    """
    rebound, duration = _throw(psi, ratio, steps, elements)
    return float(rebound), float(duration)


# --- a motor ---


@njit(nogil=True, cache=True)
def _slide(u, gap, depth, scale, moved):
    """Move all elements; their limits are scale · (depth − gap). Returns the sum of their displacements."""
    total = 0.0
    for i in range(u.shape[0]):
        limit = scale * (depth - gap[i])
        u[i] = min(max(u[i] + moved, -limit), limit) if limit > 0.0 else 0.0
        total += u[i]
    return total


@njit(nogil=True, cache=True)
def _motor(modes, p, bent, tones_a, tones_b, step, stride, elements, reach, samples):
    """Leapfrog: displacements, sliders and forces at whole steps, velocities between them."""
    mass, damping, stiffness, theta_a, theta_b, tip_x, tip_y = modes[:7]
    radius, hertz, mu = p[physics.R], p[physics.HERTZ], p[physics.MU]
    inertia, bearing, ratio = p[physics.J], p[physics.CR], p[physics.KAPPA] / p[physics.MU]
    r, v = bent.copy(), np.zeros_like(bent)
    u = np.zeros(elements)
    gap = reach * ((np.arange(elements) + 0.5) / elements) ** 2
    spring = 1.5 * hertz / ratio * np.sqrt(reach) / elements
    speed = 0.0
    for k in range((samples.shape[1] - 1) * stride + 1):
        x, y, vx, vy = p[physics.SWAY] + (tip_x * r).sum(), (tip_y * r).sum(), (tip_x * v).sum(), (tip_y * v).sum()
        depth, _, relative, ex, ey = approached(x, y, vx, vy, speed, p)
        moved = relative * step if k > 0 else 0.0
        friction = spring * _slide(u, gap, depth, mu * ratio, moved)
        normal = hertz * depth**1.5 if depth > 0.0 else 0.0
        if k % stride == 0:
            place = k // stride  # one by one: numba takes 2 s to compile the assignment of a slice
            samples[0, place], samples[1, place], samples[2, place] = x, y, normal
            samples[3, place], samples[4, place] = friction, speed
        kick = step if k > 0 else 0.5 * step
        force = theta_a * voltage(tones_a, k * step) + theta_b * voltage(tones_b, k * step) - stiffness * r
        force += tip_x * (normal * ex - friction * ey) - tip_y * (normal * ey + friction * ex)
        drag = 0.5 * kick * damping / mass
        v = ((1.0 - drag) * v + kick * force / mass) / (1.0 + drag)
        r = r + step * v
        slow = 0.5 * kick * bearing / inertia
        speed = ((1.0 - slow) * speed + kick * radius * friction / inertia) / (1.0 + slow)


def run_motor(
    motor: Mapping[str, Any],
    tones_a: Sequence[tuple[float, float, float]],
    tones_b: Sequence[tuple[float, float, float]],
    *,
    duration: float,
    step: float = 1e-8,
    output_step: float = 1e-7,
    elements: int = 200,
    reach: float = 8.0,
) -> dict[str, Array]:
    """Run a motor (the mapping that ``piezomotor show MOTOR --json`` prints) from preloaded rest, its shaft free.

    Args:
        motor: the motor.
        tones_a: amplitude (V), frequency (Hz) and phase (rad) of the sines of group A.
        tones_b: the same of group B.
        duration: simulated time in s.
        step: time step in s; output_step must be a multiple of it.
        output_step: time between samples in s.
        elements: number of elements of half of the contact.
        reach: penetration, in units of the static one, that the elements cover.

    Returns:
        time_s, tip_x_m, tip_y_m, normal_force_n, friction_force_n, rotor_speed_rad_s.
    """
    modes, p = physics.read(motor)
    preload = float(p[physics.PRELOAD])
    bent = physics.rest(modes, preload, 0)[: modes.shape[1]]
    static = (preload / p[physics.HERTZ]) ** (2.0 / 3.0)
    stride = round(output_step / step)
    count = round(duration / output_step)
    samples = np.zeros((5, count + 1))
    _motor(
        modes, p, bent, np.array(tones_a, dtype=float), np.array(tones_b, dtype=float), step, stride, elements,
        reach * static, samples,
    )  # fmt: skip
    names = ("tip_x_m", "tip_y_m", "normal_force_n", "friction_force_n", "rotor_speed_rad_s")
    return {"time_s": np.arange(count + 1) * output_step, **dict(zip(names, samples, strict=True))}


# --- what figures compare with ---

TABLE = Path(__file__).parents[1] / "data" / "oblique_impact.csv"
POISSONS = (0.0, 0.1, 0.2, 0.3, 0.4)
PSIS = (*(k / 10 for k in range(1, 10)), *(1.0 + k / 5 for k in range(31)))


def table() -> str:
    """Return the rebound ψ₂ over the incidence ψ₁ for spheres of several Poisson's ratios, as CSV."""
    rows = ["psi_1," + ",".join(f"psi_2_poisson_{poisson:g}" for poisson in POISSONS)]
    for psi in PSIS:
        found = [throw(psi, (2.0 - poisson) / (2.0 * (1.0 - poisson)))[0] for poisson in POISSONS]
        rows.append(f"{psi:g}," + ",".join(f"{value:.4f}" for value in found))
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8", newline="\n")
