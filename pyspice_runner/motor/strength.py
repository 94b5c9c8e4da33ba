# SPDX-License-Identifier: GPL-3.0-or-later
r"""Strain, stress and temperature of the ceramic of a running motor, and what exceeds the limits of the motor.

A beam strains its outer fibre by the curvature ψ′ times the distance from the neutral axis. The stress is Young's
modulus times that strain, without the contribution of the field, E d₃₁ E₃ (0.7 MPa at 50 V on the plates of
andersen2002). Of a solid they are the normal strains and stresses, means over elements.

Pressure, tension and wear of the contact between tip and rotor.

With :math:`a^2=R^*\delta` and :math:`E^*=\tfrac34 K_N/\sqrt{R^*}`, a force :math:`F_N` on spheres that slide gives

.. math::
    p_0=\frac{3F_N}{2\pi a^2},\qquad
    \sigma_x=p_0\left(\frac{1-2\nu}{3}+\frac{\pi(4+\nu)}{8}\,\mu\right),\qquad
    \dot V=k\,\langle F_N\,|v_\mathrm{slip}|\rangle

:math:`\sigma_x` is the tension at the trailing edge, the largest in a body with Poisson's ratio ν. It leaves out that
bodies of different materials press each other sideways. It is an upper bound where the contact does not slip at its
largest force. The tip alone wears, to a flat that fits the rotor; a flat of radius a takes the volume
:math:`\pi a^4/(4R^*)` of its cap.

Sources: G. M. Hamilton, L. E. Goodman, J. Appl. Mech. 33, 371, 1966; G. M. Hamilton, Proc. IMechE 197C, 53, 1983;
K. L. Johnson, *Contact Mechanics*, Cambridge 1985, eqs. 3.39, 3.49 and 3.91; J. F. Archard, J. Appl. Phys. 24, 981,
1953.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from math import nan, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor.beam import solve_resonator
from pyspice_runner.motor.contact import contact_radius, stick_limit
from pyspice_runner.motor.motor import Motor, Structure
from pyspice_runner.motor.parameters import Contact
from pyspice_runner.motor.ring import ring_stress
from pyspice_runner.motor.solid.parameters import Electrode
from pyspice_runner.motor.solid.stator import stator_of
from pyspice_runner.units import engineering

Array = NDArray[np.float64]
STRESSED = (
    "The ceramic is stressed to {stress:.3g} MPa; its rated dynamic strength is {strength:.3g} MPa. Lower the voltage."
)
HEATED = (
    "In the steady state the losses heat the stator by {rise:.3g} K to {temperature:.3g} °C; the limit is {most:.3g} "
    "°C, half the Curie temperature. Lower the voltage, or drive it for a short time."
)
_OF_CONTACT = {  # quantity → its limit, and what to say above it
    "peak_pressure_pa": (
        "contact_pressure_pa", "The peak pressure of the contact is {value}; the limit is {most}.",
    ),
    "tensile_stress_pa": (
        "contact_tension_pa",
        "Friction puts the trailing edge of the contact under a tension of {value}; its strength is {most}.",
    ),
}  # fmt: skip
WORN = (
    "The results are those of a new tip: after {time} it is worn to a flat as wide as the contact under the preload, "
    "{radius} in radius."
)
WIDER = "The results are those of a tip with a flat of {worn} in radius: after {time} its radius is {radius}."
FIELD = (
    "Group {group} reaches {volts:.4g} V, a field of {field:.3g} V/mm; the limit is {most:.3g} V/mm, above which "
    "losses rise steeply and the ceramic may lose its polarisation. Lower the voltage, or let the supply rise slowly."
)
COMPARED = (
    "ceramic_stress_pa", "temperature_rise_k", "peak_pressure_pa", "tensile_stress_pa", "wear_volume_m3_per_s",
)  # fmt: skip
SHORT_LIFE_S = 3600.0  # time in which a new tip must not wear to a flat
_POINTS = 41  # along each patch


@cache
def _of_beam(structure: Structure) -> tuple[Array, Array]:
    """Return strain in 1/m and stress in Pa/m of the outer fibres per modal displacement, (points, modes)."""
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip)
    strains, moduli = [], []
    for patch in structure.patches:
        x = np.linspace(patch.start_m, patch.end_m, _POINTS)
        strains.append((0.5 * structure.beam.thickness_m + patch.thickness_m) * -resonator.curvature(x))
        moduli.append(np.full(_POINTS, patch.youngs_modulus_pa))
    strain = np.concatenate(strains)
    return strain, np.concatenate(moduli)[:, None] * strain


def of_modes(motor: Motor) -> tuple[Array, Array]:
    """Return strain in 1/m and stress in Pa/m of the ceramic per modal displacement; no points if not known."""
    if motor.solid is not None:
        stator = stator_of(motor.solid)
        return stator.strain_per_m, stator.stress_pa_per_m
    if motor.structure is not None:
        strain, stress = _of_beam(motor.structure)
        return strain[:, : len(motor.modes)], stress[:, : len(motor.modes)]
    if motor.ring is not None:
        return ring_stress(motor.ring)
    return np.empty((0, 0)), np.empty((0, 0))


def peak_of_motion(motor: Motor, displacement_m: Array) -> dict[str, float]:
    """Return the largest strain and stress over modal displacements in m, shape (modes, points).

    They are NaN without a known beam, solid or ring.
    """
    return _peak(of_modes(motor), displacement_m)


def peak_of_amplitudes(motor: Motor, amplitudes_m: Sequence[float]) -> dict[str, float]:
    """Return an upper bound of strain and stress: all modes at their amplitudes at once."""
    return _peak(map(np.abs, of_modes(motor)), np.asarray(amplitudes_m))


def _peak(shapes: Iterable[Array], displacement_m: Array) -> dict[str, float]:
    """Return the largest strain and stress from their values per modal displacement."""
    found = dict.fromkeys(("ceramic_strain", "ceramic_stress_pa"), nan)
    for name, shape in zip(found, shapes, strict=True):
        if len(shape):
            found[name] = float(np.abs(shape @ displacement_m).max())
    return found


def electrode_distance(motor: Motor, group: str) -> float | None:
    """Return the smallest distance in m between the electrodes of group ``a`` or ``b``; ``None`` if it is not known.

    Of patches it is the thickness of a layer, of a solid the distance of the nearest parallel electrode of ground.
    """
    found: list[float] = []
    if motor.structure is not None:
        patches = (patch for patch in motor.structure.patches if patch.group.lower() == group)
        found = [patch.thickness_m / patch.layers for patch in patches]
    elif motor.ring is not None:
        found = [motor.ring.ceramic_thickness_m]
    elif motor.solid is not None:
        faces = [face for face in motor.solid.electrodes if face.region is None]
        for one in (face for face in faces if face.group.lower() == group):
            found += [gap for other in faces if other.group == "ground" if (gap := _gap(one, other)) is not None]
    return min(found, default=None)


def _gap(one: Electrode, other: Electrode) -> float | None:
    """Return the distance in m of two parallel electrodes that face each other; ``None`` if they do not."""
    (low, high), (base, top) = one.corners, other.corners
    for axis in range(3):
        sides = [side for side in range(3) if side != axis]
        level = low[axis] == high[axis] and base[axis] == top[axis] and low[axis] != base[axis]
        if level and all(low[side] < top[side] and base[side] < high[side] for side in sides):
            return abs(low[axis] - base[axis])
    return None


def depolarised(motor: Motor, volts: Mapping[str, float]) -> tuple[str, ...]:
    """Return one sentence for each group whose largest voltage in V, by its name, puts its ceramic above its field."""
    limits = motor.limits
    if limits is None or limits.field_v_per_m is None:
        return ()
    told = []
    for group, voltage in volts.items():
        distance = electrode_distance(motor, group)
        if distance is not None and voltage / distance > limits.field_v_per_m:
            told.append(
                FIELD.format(group=group.upper(), volts=voltage, field=1e-3 * voltage / distance,
                             most=1e-3 * limits.field_v_per_m)
            )  # fmt: skip
    return tuple(told)


def amplitude(mean_square_velocity: float, omega: float) -> float:
    """Return the amplitude in m of a sinusoidal displacement."""
    return sqrt(2.0 * max(mean_square_velocity, 0.0)) / omega


def temperature_rise(motor: Motor, heat_w: float) -> float:
    """Return the steady temperature in K above the surroundings; NaN without a thermal resistance."""
    return nan if motor.limits is None else motor.limits.thermal_resistance_k_per_w * heat_w


def limits_of(motor: Motor) -> dict[str, float]:
    """Return the motor's own limits by the name of the quantity, those that are known."""
    limits = motor.limits
    if limits is None:
        return {}
    of_contact = {name: getattr(limits, limit) for name, (limit, _) in _OF_CONTACT.items()}
    return {
        "ceramic_stress_pa": limits.dynamic_strength_pa,
        "temperature_c": 0.5 * limits.curie_temperature_c,
        **{name: limit for name, limit in of_contact.items() if limit is not None},
    }


def exceeded(motor: Motor, quantities: Mapping[str, float]) -> tuple[str, ...]:
    """Return one sentence for each limit that a quantity of :data:`COMPARED` exceeds, after the motor's own."""
    stress, rise, wear = (
        quantities.get(name, nan) for name in ("ceramic_stress_pa", "temperature_rise_k", COMPARED[-1])
    )
    limits, found = motor.limits, [*motor.cautions]
    if limits is not None:
        if stress > limits.dynamic_strength_pa:
            found.append(STRESSED.format(stress=1e-6 * stress, strength=1e-6 * limits.dynamic_strength_pa))
        temperature, hottest = limits.ambient_c + rise, limits_of(motor)["temperature_c"]
        if temperature > hottest:
            found.append(HEATED.format(rise=rise, temperature=temperature, most=hottest))
        for name, (limit, sentence) in _OF_CONTACT.items():
            value, most = quantities.get(name, nan), getattr(limits, limit)
            if most is not None and value > most:
                words = sentence.format(value=engineering(value, "Pa"), most=engineering(most, "Pa"))
                found.append(f"{words} Lower the voltage or the preload, or give the tip a larger radius.")
    if motor.is_transducer:
        return tuple(found)
    contact = motor.touching[0].point
    life = time_to_flat(contact, wear)
    if life <= SHORT_LIFE_S:
        worn, radius = (engineering(value, "m") for value in (contact.worn_flat_radius_m, next_flat(contact)))
        said = WIDER if contact.worn_flat_radius_m else WORN
        found.append(said.format(time=engineering(life, "s"), worn=worn, radius=radius))
    return tuple(found)


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

    ``greatest_n`` is the largest normal force in N, ``rubbing_w`` the mean of normal force times slip velocity in W.
    """
    rate = contact.specific_wear_rate_m3_per_n_m
    return {
        "peak_pressure_pa": peak_pressure(contact, greatest_n),
        "tensile_stress_pa": tensile_stress(contact, greatest_n),
        "wear_volume_m3_per_s": nan if rate is None else rate * rubbing_w,
    }


def worst_contact(motor: Motor, loads: Iterable[tuple[float, float]]) -> dict[str, float]:
    """Return the largest of each quantity of :func:`of_contact` at a point of any contact, from their loads."""
    found = [of_contact(one.point, *load) for one, load in zip(motor.touching, loads, strict=True)]
    return dict(zip(found[0], np.max([[*one.values()] for one in found], axis=0).tolist(), strict=True))


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
