# SPDX-License-Identifier: GPL-3.0-or-later
r"""Pressure, tension and wear of the contact between tip and rotor.

With :math:`a^2=R^*\delta` and :math:`E^*=\tfrac34 K_N/\sqrt{R^*}`, a force :math:`F_N` on spheres that slide gives

.. math::
    p_0=\frac{3F_N}{2\pi a^2},\qquad
    \sigma_x=p_0\left(\frac{1-2\nu}{3}+\frac{\pi(4+\nu)}{8}\,\mu\right),\qquad
    \dot V=k\,\langle F_N\,|v_\mathrm{slip}|\rangle

:math:`\sigma_x` is the tension at the trailing edge, the greatest in a body with Poisson's ratio ν. It leaves out that
bodies of different materials press each other sideways. It is an upper bound where the contact does not slip at its
greatest force. The tip alone wears, to a flat that fits the rotor; a flat of radius a takes the volume
:math:`\pi a^4/(4R^*)` of its cap.

Sources: G. M. Hamilton, L. E. Goodman, J. Appl. Mech. 33, 371, 1966; G. M. Hamilton, Proc. IMechE 197C, 53, 1983;
K. L. Johnson, *Contact Mechanics*, Cambridge 1985, eqs. 3.39, 3.49 and 3.91; J. F. Archard, J. Appl. Phys. 24, 981,
1953.
"""

from __future__ import annotations

from math import nan, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor.contact import contact_radius, stick_limit
from pyspice_runner.motor.parameters import Contact

Array = NDArray[np.float64]


def peak_pressure(contact: Contact, force_n: float) -> float:
    """Return the pressure p₀ in Pa in the middle of the contact; NaN without the effective radius, or for a worn tip.

    The pressure at the edge of a worn flat depends on how wear has rounded it.
    """
    if contact.worn_flat_radius_m:
        return nan
    radius = contact_radius(contact, force_n)
    return 1.5 * force_n / (pi * radius**2) if radius else 0.0


def tensile_stress(contact: Contact, force_n: float) -> float:
    """Return the tension in Pa at the trailing edge of the sliding contact; NaN if R* or ν is not known."""
    if contact.poisson is None:
        return nan
    of_friction = 0.125 * pi * (4.0 + contact.poisson) * contact.friction
    return peak_pressure(contact, force_n) * ((1.0 - 2.0 * contact.poisson) / 3.0 + of_friction)


def slip_velocity(contact: Contact, slider_m: Array, penetration_m: Array, normal_n: Array, held_s: float) -> Array:
    """Return the slip velocity in m/s of the spring-slider: the excess over its limit divided by its time constant."""
    limit = stick_limit(contact, penetration_m, normal_n)
    return np.asarray(np.maximum(np.abs(slider_m) - limit, 0.0) / held_s)


def of_contact(contact: Contact, greatest_n: float, rubbing_w: float) -> dict[str, float]:
    """Return pressure, tension and wear in SI units; NaN where they are not known.

    Args:
        contact: the contact.
        greatest_n: greatest normal force, N.
        rubbing_w: mean of normal force times slip velocity, W.
    """
    rate = contact.specific_wear_rate_m3_per_n_m
    return {
        "peak_pressure_pa": peak_pressure(contact, greatest_n),
        "tensile_stress_pa": tensile_stress(contact, greatest_n),
        "wear_volume_m3_per_s": nan if rate is None else rate * rubbing_w,
    }


def next_flat(contact: Contact) -> float:
    """Return the radius in m of a flat with which the results change.

    It is that of the contact under the preload, and has at least twice the area of the present flat.
    """
    return max(sqrt(2.0) * contact.worn_flat_radius_m, contact_radius(contact, contact.preload_n))


def time_to_flat(contact: Contact, wear_m3_per_s: float) -> float:
    """Return the time in s in which the tip wears to :func:`next_flat`; NaN if not known."""
    if contact.effective_radius_m is None or not wear_m3_per_s > 0.0:
        return nan
    volume = pi * (next_flat(contact) ** 4 - contact.worn_flat_radius_m**4) / (4.0 * contact.effective_radius_m)
    return volume / wear_m3_per_s
