# SPDX-License-Identifier: GPL-3.0-or-later
r"""Closed-form laws of the contact between tip and rotor.

Normal contact is Hertz's, with :math:`F_N = K_N \delta^{3/2}`; the tangential contact is the paper's lumped
spring–slider, whose spring follows Cattaneo and Mindlin's virgin curve:

.. math::
    K_N = \tfrac43 E^* \sqrt{R^*}, \quad \frac1{E^*} = \frac{1-\nu_1^2}{E_1} + \frac{1-\nu_2^2}{E_2}, \quad
    K_{t,i} = \left(\frac{4E^*}{3R^*}\right)^{1/3} \frac{3(2-\nu_i)}{16\,G_i}, \quad
    u_{\lim} = \mu\,(K_{t1}+K_{t2})\,F_N^{2/3}

A cap of effective radius R* that is worn to a flat of radius b has, with β = b²/R* and q = (√(β² + 4δ²) − β)/2,

.. math::
    F_N = K_N \sqrt q\,(q + \tfrac32\beta), \qquad a^2 = R^*(q + \beta), \qquad
    F_T = \mu\,\bigl(F_N(\delta) - F_N(\delta - |u|/\kappa)\bigr),\quad u_{\lim} = \kappa\,\delta

by the method of dimensionality reduction. β = 0 is Hertz's contact; a small penetration gives F_N = 2 E* b δ. The
second law holds for any axisymmetric profile (Ciavarella; Jäger) and is the paper's spring for β = 0.

Another exponent p than 3/2 gives F_N = K_N δ^p and the same F_T, with κ = μ K_t K_N^(1/p). p = 1 is a lining, which is
also linear along the tangent; p = 2 to 3.5 are rough surfaces (Back, Burdekin, Cowley, 1973).

Sources: Andersen, Helbo and Blanke (2002), eqs. (4), (13)–(18), corrected as ``docs/physics.md`` shows;
K. L. Johnson, *Contact Mechanics*, Cambridge 1985, §4.2 and §7.2; V. L. Popov, M. Heß, E. Willert, *Handbook of Contact
Mechanics*, Springer 2019, §2.5 and §4.3.
"""

from __future__ import annotations

from functools import lru_cache
from math import asinh, cbrt, log1p, nan, pi, sinh, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.motor.numerics import root
from pyspice_runner.motor.parameters import HERTZ, Contact, Mode

Array = NDArray[np.float64]


def effective_modulus(
    youngs_modulus_1_pa: float, poisson_1: float, youngs_modulus_2_pa: float, poisson_2: float
) -> float:
    """Plane-strain modulus E* of two bodies in contact, in Pa (Johnson eq. 4.20)."""
    return 1.0 / ((1.0 - poisson_1**2) / youngs_modulus_1_pa + (1.0 - poisson_2**2) / youngs_modulus_2_pa)


def effective_radius(radius_1_m: float, radius_2_m: float) -> float:
    """Relative radius R* of two spheres in contact, 1/R* = 1/R₁ + 1/R₂, in m; of a plane the radius is infinite."""
    return 1.0 / (1.0 / radius_1_m + 1.0 / radius_2_m)


def normal_stiffness(effective_modulus_pa: float, effective_radius_m: float) -> float:
    """Hertz constant K_N of F_N = K_N δ^(3/2), in N/m^1.5 (paper eq. 4, corrected)."""
    return 4.0 / 3.0 * effective_modulus_pa * sqrt(effective_radius_m)


def tangential_compliance(
    youngs_modulus_pa: float, poisson: float, effective_modulus_pa: float, effective_radius_m: float
) -> float:
    """Constant K_t,i of one body, in m/N^(2/3): u_i = μ K_t,i F_N^(2/3) at the limit of stick (paper eqs. 13–15)."""
    shear_modulus_pa = youngs_modulus_pa / (2.0 * (1.0 + poisson))
    return cbrt(4.0 * effective_modulus_pa / (3.0 * effective_radius_m)) * (
        3.0 * (2.0 - poisson) / (16.0 * shear_modulus_pa)
    )


def total_compliance(contact: Contact) -> float:
    """Tangential compliance K_t of tip and rotor together, in m/N^(2/3), or m/N^(1/p)."""
    return contact.tangential_compliance_tip_m_per_n23 + contact.tangential_compliance_rotor_m_per_n23


def limit_ratio(contact: Contact) -> float:
    """Limit of stick over penetration, κ = u_lim/δ = μ K_t K_N^(2/3), which is μ E*/G*; in general μ K_t K_N^(1/p)."""
    stiffness = contact.normal_stiffness_n_per_m15
    power = cbrt(stiffness**2) if contact.exponent == HERTZ else stiffness ** (1.0 / contact.exponent)
    return contact.friction * total_compliance(contact) * power


def stick_limit(contact: Contact, penetration_m: ArrayLike, normal_n: ArrayLike) -> NDArray[np.float64]:
    """Limit of stick u_lim = κ δ in m, times the factor of the normal force by damping; 0 where δ ≤ 0."""
    depth = np.maximum(penetration_m, 0.0)
    elastic = elastic_force(contact, depth)
    factor = np.divide(normal_n, elastic, out=np.zeros(np.shape(depth)), where=elastic > 0.0)
    return np.asarray(limit_ratio(contact) * depth * factor)


def normal_damping(contact: Contact) -> float:
    """Hunt and Crossley's constant a of F_N = K_N δ^p (1 + a δ̇), in s/m; 0 without loss."""
    return hunt_crossley_damping(contact.restitution, contact.restitution_velocity_m_s)


@lru_cache(maxsize=1024)
def hunt_crossley_damping(restitution: float, velocity_m_s: float) -> float:
    r"""Constant a, in s/m, that gives a coefficient of restitution e at an approach velocity v.

    The equation of motion m v̇ = −K_N δ^p (1 + a v) is separable, and for any mass, stiffness and exponent

    .. math::
        a v\,(1 + e) = \ln\frac{1 + a v}{1 - a e v}.

    a is larger than the 3(1 − e²)/(4v) of Lankarani and Nikravesh, which holds for e near 1 only.
    """
    if restitution >= 1.0:
        return 0.0

    def mismatch(z: float) -> float:
        return z * (1.0 + restitution) - log1p(z) + log1p(-restitution * z)

    # the root between that at z = 0 and the pole at z = 1/e
    lowest = 0.5 * (1.0 - restitution)
    return root(mismatch, lowest, (1.0 - 1e-15) / restitution) / velocity_m_s


def restitution(loss: float) -> float:
    """Return the coefficient of restitution e for which :func:`hunt_crossley_damping` has a v = ``loss``, above 0."""

    def mismatch(e: float) -> float:
        return loss * (1.0 + e) - log1p(loss) + log1p(-e * loss)

    return root(mismatch, 0.0, min(1.0, (1.0 - 1e-15) / loss))


def flat_length(contact: Contact) -> float:
    """Length β = b²/R* in m of a tip that is worn to a flat of radius b; 0 for a new one."""
    if contact.effective_radius_m is None:
        return 0.0
    return contact.worn_flat_radius_m**2 / contact.effective_radius_m


def elastic_force(contact: Contact, penetration_m: Array) -> Array:
    """Normal force in N without damping."""
    if contact.exponent != HERTZ:
        return np.asarray(contact.normal_stiffness_n_per_m15 * np.maximum(penetration_m, 0.0) ** contact.exponent)
    flat, depth = flat_length(contact), np.maximum(penetration_m, 0.0)
    q = _square(depth, flat)
    return np.asarray(contact.normal_stiffness_n_per_m15 * np.sqrt(q) * (q + 1.5 * flat))


def elastic_energy(contact: Contact, penetration_m: Array) -> Array:
    """Elastic energy in J of the normal contact, ∫ F_N dδ; F_N δ/(1 + p) for a new tip."""
    if contact.exponent != HERTZ:
        return np.asarray(elastic_force(contact, penetration_m) * penetration_m / (1.0 + contact.exponent))
    flat = flat_length(contact)
    m = _square(np.maximum(penetration_m, 0.0), flat) + flat
    energy = 0.8 * m**2.5 - flat**2 * np.sqrt(m) + 0.2 * flat**2.5
    return np.asarray(0.5 * contact.normal_stiffness_n_per_m15 * energy)


def _square(depth_m: Array, flat_m: float) -> Array:
    """Return q in m, without cancellation."""
    spread = np.sqrt(flat_m**2 + 4.0 * depth_m**2) + flat_m
    return 2.0 * depth_m**2 / np.where(spread > 0.0, spread, 1.0)


def _root(contact: Contact, force_n: float) -> float:
    """Return √q in m^½ for a normal force: the root t of t³ + 3/2 β t = F_N/K_N."""
    ratio, flat = max(force_n, 0.0) / contact.normal_stiffness_n_per_m15, flat_length(contact)
    if flat == 0.0:
        return cbrt(ratio)
    size = sqrt(0.5 * flat)
    return 2.0 * size * sinh(asinh(0.5 * ratio / size**3) / 3.0)


def penetration(contact: Contact, force_n: float) -> float:
    """Penetration δ in m under a normal force; (F_N/K_N)^(1/p) for a new tip."""
    if contact.exponent != HERTZ:
        return float((max(force_n, 0.0) / contact.normal_stiffness_n_per_m15) ** (1.0 / contact.exponent))
    root = _root(contact, force_n)
    return root * sqrt(root**2 + flat_length(contact))


def contact_radius(contact: Contact, force_n: float) -> float:
    """Radius a of the contact under a normal force in N, in m; NaN without the effective radius."""
    if contact.effective_radius_m is None:
        return nan
    return sqrt(contact.effective_radius_m * (_root(contact, force_n) ** 2 + flat_length(contact)))


def static_penetration(contact: Contact) -> float:
    """Penetration δ₀ under the preload, in m."""
    return penetration(contact, contact.preload_n)


def stiffnesses_at_preload(contact: Contact) -> tuple[float, float]:
    """Tangential stiffness in stick and normal stiffness at the operating point without compliances in series, N/m.

    dF_T/du = 2 G* a and dF_N/dδ = 2 E* a = 3/2 K_N √(q + β); for a new tip p F₀/δ₀, and the first by u_lim/(μ δ) less.
    """
    if contact.exponent == HERTZ:
        power = sqrt(_root(contact, contact.preload_n) ** 2 + flat_length(contact))
    else:
        power = static_penetration(contact) ** (contact.exponent - 1.0)
    normal = contact.exponent * contact.normal_stiffness_n_per_m15 * power
    return normal * contact.friction / limit_ratio(contact), normal


def normal_stiffness_at_preload(contact: Contact) -> float:
    """Normal stiffness k_c at the operating point, in N/m: dF_N/dδ = 2 E* a and the compliance in series."""
    alone = stiffnesses_at_preload(contact)[1]
    return alone / (1.0 + alone * contact.series_compliance_m_per_n)


def tangential_stiffness_at_preload(contact: Contact) -> float:
    """Tangential stiffness in stick at the operating point, in N/m: dF_T/du = 2 G* a and the compliance in series."""
    alone = stiffnesses_at_preload(contact)[0]
    return alone / (1.0 + alone * contact.tangential_series_compliance_m_per_n)


def resonance_under_preload(contact: Contact, mode: Mode) -> float:
    """Resonance f_n √(1 + k_c Y_n²/k_n) of a mode whose tip is pressed on a rigid rotor, in Hz.

    Exact for a mode that alone moves the tip towards the rotor and does not tilt it; the paper's *contact resonance*.
    """
    stiffness = mode.stiffness_n_per_m + normal_stiffness_at_preload(contact) * mode.tip_y**2
    return sqrt(stiffness / mode.mass_kg) / (2.0 * pi)
