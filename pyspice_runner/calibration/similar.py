# SPDX-License-Identifier: GPL-3.0-or-later
r"""Motors that are similar to another one: the same motion in other units of force, velocity, time and voltage.

With the factors F, v, 1/f and U, a displacement grows by :math:`x = v/f` and every term of the equations of motion by
the same factor if

====================================================  ==============================
value                                                 grows by
====================================================  ==============================
mass, inertia, recoil                                 F/(x f²)
stiffness                                             F/x
damping                                               F/v
force per volt θ                                      F/U
capacitance                                           F x/U²
normal stiffness K_N                                  F/x^(3/2)
tangential compliance K_t                             x/F^(2/3)
====================================================  ==============================

So the curve of speed over load keeps its shape, currents grow by F v/U, and friction, quality factors and efficiency
stay. A rotor keeps its radius; the curvature of its rim within the motion of the tip, the only term that does not
scale, is below 10⁻³ of the penetration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pyspice_runner.motor.motor import Motor, Provenance, assemble


@dataclass(frozen=True)
class Factors:
    """Factors of force, velocity, frequency and voltage."""

    force: float
    speed: float
    frequency: float
    voltage: float

    @property
    def length(self) -> float:
        """Factor of a displacement."""
        return self.speed / self.frequency

    def of(self, key: str) -> float:
        """Return the factor of a value of a motor; 1 for one without a dimension, and for the radius of a rotor."""
        force, length = self.force, self.length
        found = {
            "mass_kg": force / (length * self.frequency**2),
            "stiffness_n_per_m": force / length,
            "damping_n_s_per_m": force / self.speed,
            "force_n": force,
            "coupling": force / self.voltage,
            "capacitance": force * length / self.voltage**2,
            "length_m": length,
            "length_per_force": length / force,
            "per_m2": length**-2,
            "speed_m_s": self.speed,
            "normal_stiffness_n_per_m15": force / length**1.5,
            "tangential_compliance": length / force ** (2.0 / 3.0),
        }
        return found[_KINDS[key]] if key in _KINDS else 1.0


_KINDS = {
    **dict.fromkeys(("mass_kg", "inertia_kg_m2", "recoil_kg", "recoil_x_kg"), "mass_kg"),
    **dict.fromkeys(("stiffness_n_per_m", "tangential_stiffness_n_per_m"), "stiffness_n_per_m"),
    **dict.fromkeys(
        ("damping_n_s_per_m", "tangential_damping_n_s_per_m", "bearing_damping_n_m_s", "guide_damping_n_s_per_m"),
        "damping_n_s_per_m",
    ),
    **dict.fromkeys(("preload_n", "bearing_friction_n_m", "guide_friction_n"), "force_n"),
    **dict.fromkeys(("coupling_a_n_per_v", "coupling_b_n_per_v"), "coupling"),
    **dict.fromkeys(("capacitance_a_f", "capacitance_b_f", "capacitance_ab_f"), "capacitance"),
    **dict.fromkeys(("bearing_presliding_rad", "guide_presliding_m"), "length_m"),
    **dict.fromkeys(("series_compliance_m_per_n", "tangential_series_compliance_m_per_n"), "length_per_force"),
    **dict.fromkeys(("softening_per_m2", "damping_growth_per_m2"), "per_m2"),
    **dict.fromkeys(("restitution_velocity_m_s", "stribeck_velocity_m_s"), "speed_m_s"),
    "normal_stiffness_n_per_m15": "normal_stiffness_n_per_m15",
    "tangential_compliance_tip_m_per_n23": "tangential_compliance",
    "tangential_compliance_rotor_m_per_n23": "tangential_compliance",
}
_TRAVELS = ("bearing_presliding_rad", "guide_presliding_m")
LEAST_TRAVEL = 1e-5  # in their ranges; a steady state does not depend on them
# of a tip whose size is not known: no pressure, no tension, no wear
_UNKNOWN = {"effective_radius_m": None, "poisson": None, "specific_wear_rate_m3_per_n_m": None}


def scaled(motor: Motor, factors: Factors, name: str, provenance: Mapping[str, Provenance]) -> Motor:
    """Return a similar motor. What is not scaled is not known of it: strength, worn flat, recommended drive.

    Raises:
        ParameterError: if a value leaves its range.
    """
    document = motor.model_dump() | {"name": name, "limits": None}
    document["modes"] = [_grown(mode, factors) for mode in document["modes"]]
    for section in ("piezo", "contact", motor.moved, "mount"):
        if document[section] is not None:
            document[section] = _grown(document[section], factors)
    document["contact"] |= _UNKNOWN | {"worn_flat_radius_m": 0.0}
    return assemble(document, None, dict(provenance), where=f"a motor similar to {motor.name}")


def _grown(table: Mapping[str, Any], factors: Factors) -> dict[str, Any]:
    found = {key: factors.of(key) * value if isinstance(value, float) else value for key, value in table.items()}
    return found | {key: max(found[key], LEAST_TRAVEL) for key in _TRAVELS if key in found}


def as_stage(motor: Motor) -> Motor:
    """Return the motor with a slider that moves as the rim of its rotor; a linear stage as it is."""
    if motor.slider is not None:
        return motor
    document, rotor = motor.model_dump(), motor.rotor
    del document["rotor"]
    radius = rotor.radius_m
    document["slider"] = {
        "mass_kg": rotor.inertia_kg_m2 / radius**2, "guide_damping_n_s_per_m": rotor.bearing_damping_n_m_s / radius**2,
        "guide_friction_n": rotor.bearing_friction_n_m / radius,
        "guide_presliding_m": max(rotor.bearing_presliding_rad * radius, LEAST_TRAVEL),
    }  # fmt: skip
    document["drive"] = motor.drive
    return assemble(document, None, motor.provenance, where=motor.name)
