# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor as a Verilog-A module: ``behavioral/piezomotor.va`` with the values and the number of modes of a motor.

The file in ``behavioral/`` is written by hand and is the module of the set ``bimodal40``. The text of its first mode is
repeated for every mode of the motor, and the default of each parameter is replaced. The friction of a brush is in
``behavioral/piezomotor_brush.va``, whose first cell is repeated for every slider.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from pyspice_runner.errors import ParameterError
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import Mode, Mount
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.contact import ContactLaw, Law, contact_values, touching_law
from pyspice_runner.netlist.library import check_name, data_path
from pyspice_runner.netlist.motor import SMALLEST_LOSS, SUBCIRCUIT, Discretisation, coarsest_step

LAWS = {"spring-slider": 0, "coulomb": 1}  # values of the parameter law
WRITTEN = (*LAWS, "brush")  # the laws that have a Verilog-A form
_BLOCKS = ("parameters of mode", "states of mode", "motion of mode", "mode")
_CELLS = ("states of cell", "cell")
_OF_CONTACT = {"mu": "friction", "damping": "normal_damping"}  # parameters of the contact with other names outside


def motor_module(
    motor: Motor,
    *,
    contact: ContactLaw | None = "spring-slider",
    name: str = "",
    thermal: Thermal | None = None,
) -> str:
    """Return a motor as the Verilog-A ``module piezomotor(a, b, com, shaft, temperature)``.

    Args:
        motor: the motor.
        contact: ``"spring-slider"``, ``"coulomb"`` or ``"brush"``.
        name: name of the module; by default ``piezomotor``.
        thermal: drift per kelvin at the pin ``temperature``; without it nothing drifts.

    Raises:
        ParameterError: for a law that the module does not have, or an invalid name.
    """
    law = touching_law(contact, "The module contains the rotor.")
    if law.name not in WRITTEN:
        raise ParameterError(
            f"contact = {law.name!r} is not valid for a .va file: it must be one of {', '.join(WRITTEN)}. "
            "Export a .lib for a law of your own."
        )
    text = module_source(len(motor.modes), law.sliders or 0)
    text = named(text, SUBCIRCUIT, motor, name, module_values(motor, law, thermal=thermal))
    return re.sub(
        r"(?m)^// STEP .*$", f"// STEP   at most {coarsest_step(motor):.2g} s; slider_time is half of it", text
    )


def named(text: str, original: str, motor: Motor, name: str, values: Mapping[str, float | int]) -> str:
    """Return a module with the name and the values of a motor.

    Args:
        text: the module.
        original: the name that it has.
        motor: the motor.
        name: the name that it gets; by default the one that it has.
        values: the parameters.

    Raises:
        ParameterError: for an invalid name.
    """
    module = check_name(name) if name else original
    for parameter, value in values.items():
        text, count = re.subn(
            rf"(?m)^(.*parameter (?:real|integer) {parameter} = )\S+( from .*)$", rf"\g<1>{value!r}\g<2>", text
        )
        assert count == 1, parameter
    text = text.replace(f"module {original}(", f"module {module}(", 1)
    title = f"// {module}: standing-wave piezomotor {motor.name}"
    return re.sub(rf"(?m)^// {original}: standing-wave piezomotor bimodal40", title, text, count=1)


def module_source(modes: int, sliders: int = 0) -> str:
    """Return the module with some number of modes and with the defaults of ``behavioral/piezomotor.va``.

    Args:
        modes: number of modes.
        sliders: number of sliders of a brush; 0 for the other laws.
    """
    text = with_modes((data_path("behavioral") / "piezomotor.va").read_text(encoding="utf-8"), modes)
    if not sliders:
        return text
    brush = (data_path("behavioral") / "piezomotor_brush.va").read_text(encoding="utf-8")
    for block in _CELLS:
        brush = _repeated(brush, block, sliders)
    brush = re.sub(r"(localparam integer sliders = )\d+", rf"\g<1>{sliders}", brush)
    states = _part("states of the cells")
    found = states.search(brush)
    assert found is not None
    text = text.replace(
        "    // end of the states of the modes\n", f"    // end of the states of the modes\n{found[0]}", 1
    )
    for name in ("parameters of the friction", "friction"):
        part = _part(name)
        found = part.search(brush)
        assert found is not None, name
        text, count = part.subn(lambda _, written=found[0]: written, text)  # type: ignore[misc]
        assert count == 1, name
    return text


def with_modes(text: str, modes: int) -> str:
    """Return a module with some number of modes instead of two."""
    for block in _BLOCKS:
        text = _repeated(text, block, modes)
    return text


def _part(name: str) -> re.Pattern[str]:
    """Return what finds the lines between two comments, these included."""
    return re.compile(rf"(?ms)^ *// {name}\n.*?^ *// end of the {name.removeprefix('the ')}\n")


def _repeated(text: str, block: str, count: int) -> str:
    """Return the text with as many copies of the block of mode 1 as there are modes."""
    found = re.search(rf"(?ms)^ *// {block} 1\b.*?(?=^ *// {block} 2\b)", text)
    whole = re.search(rf"(?ms)^ *// {block} 1\b.*?(?=^ *// end of the )", text)
    assert found is not None, block
    assert whole is not None, block
    copies = [
        re.sub(r"_1\b", f"_{number}", found[0]).replace(f"// {block} 1", f"// {block} {number}", 1)
        for number in range(1, count + 1)
    ]
    return text[: whole.start()] + "".join(copies) + text[whole.end() :]


def module_values(
    motor: Motor,
    law: Law,
    *,
    thermal: Thermal | None = None,
    discretisation: Discretisation | None = None,
) -> Mapping[str, float | int]:
    """Return the value of every parameter of the module but those that stay at their neutral defaults.

    Args:
        motor: the motor.
        law: law of the contact.
        thermal: drift per kelvin.
        discretisation: adaptation to a run's time step, if any.
    """
    constants = contact_values(
        law, motor.contact, radius=motor.rotor.radius_m, preload=motor.contact.preload_n, deflection=0.0,
        slider_time=discretisation.slider_time if discretisation else None,
    )  # fmt: skip
    touching = {_OF_CONTACT.get(name, name): value for name, value in constants.items() if name != "deflection"}
    values: dict[str, float | int] = {
        **{name: _digits(value) for name, value in touching.items()},
        **({"law": LAWS[law.name]} if law.name in LAWS else {}),
        "normal_damping": _digits(touching.get("normal_damping", 0.0)),
        "series_compliance": motor.contact.series_compliance_m_per_n,
        "inertia": motor.rotor.inertia_kg_m2,
        "bearing": motor.rotor.bearing_damping_n_m_s,
        "bearing_torque": motor.rotor.bearing_friction_n_m,
        "bearing_angle": motor.rotor.bearing_presliding_rad,
        "mounted": int(motor.mount is not None),
        "capacitance_a": _digits(motor.piezo.capacitance_a_f),
        "capacitance_b": _digits(motor.piezo.capacitance_b_f),
        "loss": max(motor.piezo.loss_tangent, SMALLEST_LOSS),
    }
    if motor.mount is not None:
        mass, stiffness = _written(motor.mount, discretisation)
        values |= {
            "mount_stiffness": stiffness,
            "mount_mass": mass,
            "mount_damping": motor.mount.damping_n_s_per_m,
        }
    if thermal is not None:
        values |= {
            "drift_f": thermal.frequency_drift_per_k,
            "drift_k": thermal.coupling_drift_per_k,
            "drift_c": thermal.capacitance_drift_per_k,
        }
    for number, mode in enumerate(motor.modes, start=1):
        mass, stiffness = _written(mode, discretisation)
        of_mode = {
            "mass": mass,
            "damping": mode.damping_n_s_per_m,
            "stiffness": stiffness,
            "coupling_a": mode.coupling_a_n_per_v,
            "coupling_b": mode.coupling_b_n_per_v,
            "tip_x": mode.tip_x,
            "tip_y": mode.tip_y,
            "softening": mode.softening_per_m2,
            "growth": mode.damping_growth_per_m2,
        }
        values |= {f"{parameter}_{number}": _digits(value) for parameter, value in of_mode.items()}
    return values


def _written(mode: Mode | Mount, discretisation: Discretisation | None) -> tuple[float, float]:
    """Return mass (kg) and stiffness (N/m) to write for a mode or a carrier."""
    return discretisation.mode(mode) if discretisation else (mode.mass_kg, mode.stiffness_n_per_m)


def _digits(value: float) -> float:
    """Round to ten digits, because the last digits of an eigenvalue depend on the computer."""
    return float(f"{value:.10g}")
