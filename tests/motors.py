# SPDX-License-Identifier: GPL-3.0-or-later
"""Motors off the default values, for tests of anything that takes a motor."""

from math import pi, sqrt
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from pyspice_runner.motor.drive import default_drive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Contact, Mode, Parameters, Piezo, Rotor, Slider

BEAM40 = str(Path(__file__).parent / "data" / "beam40.toml")  # two bending modes of a beam meet at 40 kHz

# of bimodal40 with a cap of alumina on a ring of alumina: the tip hammers
HARD_TIP = {
    "contact.preload_n": 16.5, "contact.restitution": 0.9, "contact.restitution_velocity_m_s": 0.1,
    "contact.materials.tip_radius_m": 6.5e-3, "contact.materials.on_face": False,
    "contact.materials.rotor_youngs_modulus_pa": 370e9,
    "contact.materials.rotor_poisson": 0.22,
}  # fmt: skip


def mode(name: str, frequency: float, mass: float, quality: float, **rest: float) -> Mode:
    """A mode by its frequency in Hz and quality factor; couplings and tip motions as named."""
    stiffness = mass * (2.0 * pi * frequency) ** 2
    values = {"coupling_a_n_per_v": 0.0, "coupling_b_n_per_v": 0.0, "tip_x": 0.0, "tip_y": 0.0, **rest}
    return Mode(
        name=name,
        mass_kg=mass,
        damping_n_s_per_m=sqrt(stiffness * mass) / quality,
        stiffness_n_per_m=stiffness,
        **values,
    )


def motor(**parts: Any) -> Motor:
    """A motor of three modes whose groups differ in everything; any part may be replaced."""
    values: dict[str, Any] = {
        "name": "off the defaults",
        "modes": (
            mode("push", 22e3, 0.004, 80.0, coupling_a_n_per_v=0.21, coupling_b_n_per_v=0.17, tip_x=0.1, tip_y=0.9),
            mode("pull", 41e3, 0.003, 130.0, coupling_a_n_per_v=-0.3, coupling_b_n_per_v=0.34, tip_x=1.4, tip_y=-0.2),
            mode("turn", 66e3, 0.002, 60.0, coupling_a_n_per_v=0.08, coupling_b_n_per_v=0.02, tip_x=-0.6, tip_y=0.5),
        ),
        "piezo": Piezo(capacitance_a_f=3.1e-9, capacitance_b_f=2.2e-9, loss_tangent=0.03),
        "contact": Contact(
            normal_stiffness_n_per_m15=4e9,
            tangential_compliance_tip_m_per_n23=1.1e-7,
            tangential_compliance_rotor_m_per_n23=2.3e-7,
            friction=0.22,
            preload_n=8.0,
        ),
        "rotor": Rotor(radius_m=0.013, inertia_kg_m2=3e-6, bearing_damping_n_m_s=2e-5),
    }
    return Motor(**(values | parts))


def within(kind: type[Parameters], **fixed: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    """Values for every field of a class of parameters, each anywhere in its range."""
    fields = {}
    for name, schema in kind.model_json_schema()["properties"].items():
        if name in fixed:
            fields[name] = fixed[name]
        elif schema.get("type") == "number":
            low = schema.get("minimum", schema.get("exclusiveMinimum"))
            high = schema.get("maximum", schema.get("exclusiveMaximum"))
            fields[name] = st.floats(low, high, exclude_min="exclusiveMinimum" in schema)
    return st.fixed_dictionaries(fields)


def sliding(motor: Motor, **slider: float) -> Motor:
    """The same motor with a slider that moves as the rim of its rotor."""
    rotor, radius = motor.rotor, motor.rotor.radius_m
    values = {
        "mass_kg": rotor.inertia_kg_m2 / radius**2,
        "guide_damping_n_s_per_m": rotor.bearing_damping_n_m_s / radius**2,
        "guide_friction_n": rotor.bearing_friction_n_m / radius,
        "guide_presliding_m": rotor.bearing_presliding_rad * radius,
    }
    parts = {name: value for name, value in motor if name != "rotor"}
    return Motor(**(parts | {"slider": Slider(**(values | slider))}))


def turning(motor: Motor, radius_m: float) -> Motor:
    """A motor with a slider with a rotor in its place whose rim moves as the slider."""
    rotor = motor.rotor
    values = {
        "radius_m": radius_m,
        "inertia_kg_m2": rotor.inertia_kg_m2 * radius_m**2,
        "bearing_damping_n_m_s": rotor.bearing_damping_n_m_s * radius_m**2,
        "bearing_friction_n_m": rotor.bearing_friction_n_m * radius_m,
    }
    if rotor.bearing_friction_n_m:
        values["bearing_presliding_rad"] = rotor.bearing_presliding_rad / radius_m
    parts = {name: value for name, value in motor if name not in ("rotor", "slider")}
    return Motor(**(parts | {"rotor": Rotor(**values)}))


def recommended(name: str) -> tuple[Motor, Any]:
    """A motor with its recommended drive."""
    motor = load_motor(name)
    return motor, default_drive(motor)


def friction_torque(motor: Motor) -> float:
    """μ F₀ R, N·m."""
    return motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
