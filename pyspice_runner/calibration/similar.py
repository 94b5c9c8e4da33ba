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
normal stiffness K_N, of Hertz p = 3/2                 F/x^p
tangential compliance K_t                             x/F^(1/p)
====================================================  ==============================

So the curve of speed over load keeps its shape, currents grow by F v/U, and friction, quality factors and efficiency
stay. A rotor keeps its radius; the curvature of its rim within the motion of the tip, the only term that does not
scale, is below 10⁻³ of the penetration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.motor import Motor, assemble
from pyspice_runner.motor.parameters import HERTZ

_MASS, _STIFFNESS, _DAMPING = (1.0, -1.0, -2.0, 0.0), (1.0, -1.0, 0.0, 0.0), (1.0, -1.0, -1.0, 0.0)
_FORCE, _LENGTH, _SPEED = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 1.0, 1.0, 0.0)
_NUMBER = (0.0, 0.0, 0.0, 0.0)
_EXPONENTS = {  # field of a motor → exponents of force, displacement, frequency and voltage
    **dict.fromkeys(("mass_kg", "inertia_kg_m2", "recoil_kg", "recoil_x_kg"), _MASS),
    **dict.fromkeys(("stiffness_n_per_m", "tangential_stiffness_n_per_m"), _STIFFNESS),
    **dict.fromkeys(("damping_n_s_per_m", "tangential_damping_n_s_per_m"), _DAMPING),
    **dict.fromkeys(("bearing_damping_n_m_s", "guide_damping_n_s_per_m"), _DAMPING),
    **dict.fromkeys(("preload_n", "bearing_friction_n_m", "guide_friction_n"), _FORCE),
    **dict.fromkeys(("bearing_presliding_rad", "guide_presliding_m"), _LENGTH),
    **dict.fromkeys(("restitution_velocity_m_s", "stribeck_velocity_m_s"), _SPEED),
    **dict.fromkeys(("coupling_a_n_per_v", "coupling_b_n_per_v"), (1.0, 0.0, 0.0, -1.0)),
    **dict.fromkeys(("capacitance_a_f", "capacitance_b_f", "capacitance_ab_f"), (1.0, 1.0, 0.0, -2.0)),
    **dict.fromkeys(("series_compliance_m_per_n", "tangential_series_compliance_m_per_n"), (-1.0, 1.0, 0.0, 0.0)),
    **dict.fromkeys(tuple(f"motion_{axis}_{group}_m_per_v" for axis in "xy" for group in "ab"), (0.0, 1.0, 0.0, -1.0)),
    **dict.fromkeys(("softening_per_m2", "damping_growth_per_m2"), (0.0, -2.0, 0.0, 0.0)),
    **dict.fromkeys(("loss_tangent", "friction", "restitution", "sliding_ratio", "tip_x", "tip_y"), _NUMBER),
    "exponent": _NUMBER,
    "radius_m": _NUMBER,  # of the rotor
}
_TRAVELS = ("bearing_presliding_rad", "guide_presliding_m")
LEAST_TRAVEL = 1e-5  # in their ranges; a steady state does not depend on them
# of a tip whose size is not known: no pressure, no tension, no wear
_UNKNOWN = {"effective_radius_m": None, "poisson": None, "specific_wear_rate_m3_per_n_m": None}


@dataclass(frozen=True)
class Factors:
    """Factors of force, velocity, frequency and voltage."""

    force: float
    speed: float
    frequency: float
    voltage: float

    def of(self, key: str, power: float = HERTZ) -> float:
        """Return the factor of a field of a motor; 1 for one without a dimension, and for the radius of a rotor.

        ``power`` is the exponent of the contact. Raise ParameterError for a field whose dimension is not known.
        """
        compliance = (-1.0 / power, 1.0, 0.0, 0.0)
        known = _EXPONENTS | {
            "normal_stiffness_n_per_m15": (1.0, -power, 0.0, 0.0),
            "tangential_compliance_tip_m_per_n23": compliance, "tangential_compliance_rotor_m_per_n23": compliance,
        }  # fmt: skip
        if key not in known:
            raise ParameterError(f"A similar motor cannot be made: it is not known how {key} scales.")
        force, length, frequency, voltage = known[key]
        displacement = self.speed / self.frequency
        return float(self.force**force * displacement**length * self.frequency**frequency * self.voltage**voltage)


def scaled(motor: Motor, factors: Factors, name: str) -> Motor:
    """Return a similar motor. What is not scaled is not known of it: strength, worn flat, recommended drive.

    Raise ParameterError if a value leaves its range.
    """
    document = motor.model_dump() | {"name": name, "limits": None}
    for parameter in motor.law:  # refused: the dimension of a law's own parameter is not known here
        factors.of(f"law.{parameter}")
    document["contact"] |= _UNKNOWN | {"worn_flat_radius_m": 0.0}
    document["modes"] = [_grown(mode, factors) for mode in document["modes"]]
    for section in ("piezo", "contact", motor.moved, "mount"):
        if document[section] is not None:
            document[section] = _grown(document[section], factors)
    return assemble(document, None, {}, where=f"a motor similar to {motor.name}")


def _grown(table: Mapping[str, Any], factors: Factors) -> dict[str, Any]:
    power = table.get("exponent", HERTZ)
    found = {key: factors.of(key, power) * value if value and not isinstance(value, str) else value
             for key, value in table.items()}  # fmt: skip
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
