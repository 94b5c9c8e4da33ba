# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor as a Verilog-A module: ``behavioral/piezomotor.va`` with the values and the number of modes of a motor.

The file in ``behavioral/`` is written by hand, with one mode and no contact. The text of the mode is repeated for every
mode of the motor, and the default of each parameter is replaced. The contact is written from the library of its law.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from pyspice_runner.circuit.law import (
    LAWS,
    PAPER_LAW,
    ContactLaw,
    Law,
    contact_library,
    contact_values,
    on_contact,
    touching_law,
)
from pyspice_runner.circuit.motor import (
    SLIDER_TIME,
    SMALLEST_LOSS,
    SUBCIRCUIT,
    coarsest_step,
    mode_values,
    require_no_feedback,
    rounded,
    spring_values,
)
from pyspice_runner.circuit.state import Discretisation, held_piezo, pushes, stems, written_stator
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.motor import Motor, require_one_contact
from pyspice_runner.motor.parameters import Contact
from pyspice_runner.motor.stator import carriers
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.expressions import HELPERS, equations, translated
from pyspice_runner.spice.library import LibraryParameter, check_name, data_path, read_library, slider_words

WRITTEN = tuple(name for name in LAWS if "verilog-a" in Law(name).forms)  # the laws that have a Verilog-A form
_BLOCKS = ("parameters of mode", "states of mode", "motion of mode", "mode")
_OF_CONTACT = {"mu": "friction", "damping": "normal_damping"}  # parameters of the contact with other names outside
_OF_RUN = ("deflection", "start")  # parameters of the contact that rest and the start of a run replace
# nodes of the contact with other names outside; those that are not listed get the prefix contact_
_NODES = {name: f"contact_{name}" for name in ("x", "y", "vx", "vy")}
_NODES |= {"shaft": "V(shaft)", "slider": "V(slider)", "friction": "tangential"}
_NODES |= {name: name for name in ("fx", "fy", "normal", "delta", "state")}
_ROTATIONAL = "electrical a, b, com, temperature;\n    rotational_omega shaft;"
_ACCESS = {"V": "Omega", "I": "Tau"}  # functions of the discipline electrical → of rotational_omega
_ITERATIONS = 5  # of an equation that contains its own node; each reduces the error by penetration over radius


def motor_module(
    motor: Motor,
    *,
    contact: ContactLaw | None = PAPER_LAW,
    name: str = "",
    thermal: Thermal | None = None,
    rotational: bool = False,
) -> str:
    """Return a motor as the Verilog-A ``module piezomotor(a, b, com, shaft, temperature)``.

    ``thermal`` is the drift per kelvin at the pin ``temperature``; without it nothing drifts. A ``rotational`` shaft
    has the discipline ``rotational_omega``, with the speed in rad/s as potential and the torque in N·m as flow; else it
    is electrical, 1 V = 1 rad/s and 1 A = 1 N·m, of a slider 1 m/s and 1 N.

    Raises:
        ParameterError: for a law that the module does not have, or an invalid name.
    """
    require_one_contact(motor, "A Verilog-A module is", "Export a .lib or a .fmu")
    law = touching_law(contact, "The module contains the rotor.", motor.law)
    if law.name not in WRITTEN:
        raise ParameterError(
            f"contact = {law.name!r} is not valid for a .va file: it must be one of {', '.join(WRITTEN)}. "
            "Export a .lib for a law of your own."
        )
    require_no_feedback(motor, "A .va file")
    text = module_source(len(motor.modes), law, motor.contact)
    for parameter, value in module_values(motor, law, thermal=thermal).items():
        text, count = re.subn(
            rf"(?m)^(.*parameter (?:real|integer) {parameter} = )\S+( from .*)$", rf"\g<1>{value!r}\g<2>", text
        )
        assert count == 1, parameter
    module = check_name(name) if name else SUBCIRCUIT
    text = text.replace(f"module {SUBCIRCUIT}(", f"module {module}(", 1)
    if rotational and motor.slider:
        raise ParameterError(f"{motor.name} has a slider, and a rotational shaft is for a rotor: leave it out.")
    if rotational:
        text = text.replace("electrical a, b, com, shaft, temperature;", _ROTATIONAL, 1)
        text = re.sub(r"\b([VI])\(shaft\)", lambda found: f"{_ACCESS[found[1]]}(shaft)", text)
        text = text.replace("1 V = 1 rad/s", "Omega, rad/s").replace("1 A = 1 N.m", "Tau, N.m")
    if motor.slider:  # of comments at the beginning of a line, and of the attributes of parameters
        text = re.sub(r"(?m)^//.*|\(\* .*? \*\)", lambda found: slider_words(found[0]), text)
    title = f"// {module}: standing-wave piezomotor {motor.name}"
    text = text.replace(f"// {SUBCIRCUIT}: standing-wave piezomotor bimodal40", title, 1)
    return re.sub(
        r"(?m)^// STEP .*$", f"// STEP   at most {coarsest_step(motor):.2g} s; slider_time is half of it", text
    )


def module_source(modes: int, law: Law, contact: Contact | None = None) -> str:
    """Return the module with some number of modes and a law of the contact, Hertz's, of a worn tip or of a lining.

    The defaults are those of ``behavioral/piezomotor.va`` and of the library of the law.
    """
    text = (data_path("behavioral") / "piezomotor.va").read_text(encoding="utf-8")
    for block in _BLOCKS:
        text = _repeated(text, block, modes)
    for name, lines in _contact(law, contact).items():
        text = text.replace(f"// {name}\n", "\n".join((f"// {name}", *lines, "")), 1)
    return text


def _contact(law: Law, contact: Contact | None) -> dict[str, list[str]]:
    """Return the lines of the contact, by the comments of ``behavioral/piezomotor.va`` after which they stand."""
    library = on_contact(contact_library(law) if law.row else read_library(LAWS[law.name]), contact)
    found = equations(library)
    parameters = {item.name: _OF_CONTACT.get(item.name, item.name) for item in library.parameters}
    parameters |= dict.fromkeys(_OF_RUN, "0.0")
    states = {node: node if node in library.pin_names else f"cell_{node[1:]}" for node in found.capacitances}
    names = parameters | _NODES | {node: f"V({port})" for node, port in states.items()}
    own: dict[str, None] = {}  # variables of the contact alone, in order

    def name(node: str) -> str:
        if node in names:
            return names[node]
        own[f"contact_{node}"] = None
        return f"contact_{node}"

    def written(text: str) -> str:
        return translated(text, "verilog-a", name)

    lines = []
    for node, text in found.ordered():
        if node == "slider":  # a port, also where the law has no such state
            lines.append(f"I(slider) <+ V(slider) - ({written(text)});")
            continue
        implicit = f"V({node})" in text
        lines += [f"{name(node)} = 0.0;"] if implicit else []
        lines += [f"{name(node)} = {written(text)};"] * (_ITERATIONS if implicit else 1)
    for node, port in states.items():
        lines.append(f"I({port}) <+ ddt({written(found.capacitances[node])} * V({port}));")
        lines.append(f"I({port}) <+ V({port}) / {written(found.resistances[node])};")
    for node, port in {**states, "shaft": "shaft"}.items():
        lines.append(f"I({port}) <+ -({written('+'.join(found.currents[node]))});")
    declared = [_declared(item, parameters[item.name]) for item in library.parameters if item.name not in _OF_RUN]
    if SLIDER_TIME not in parameters:  # which the compliance in series needs, too
        declared += [_declared(item) for item in read_library("piezomotor_stem").parameters if item.name == SLIDER_TIME]
    return {
        "parameters of the contact": [
            *declared,
            *HELPERS["verilog-a"].splitlines(),
        ],
        "states of the contact": [
            *(f"    electrical {port};" for port in states.values() if port != "slider"),
            f"    real {', '.join(own)};",
        ],
        "contact": [f"        {line}" for line in lines],
    }


def _declared(item: LibraryParameter, name: str = "") -> str:
    """Return the line of a parameter of a library, by default with its own name."""
    unit = "" if item.unit == "1" else f', units="{item.unit}"'
    value = f"{name or item.name} = {item.default!r} from [{item.least:g}:{item.greatest:g}]"
    return f'    (* desc="{item.meaning}"{unit} *) parameter real {value};'


def _repeated(text: str, block: str, count: int) -> str:
    """Return the text with as many copies of the block of mode 1 as there are modes."""
    found = re.search(rf"(?ms)^ *// {block} 1\b.*?(?=^ *// end of the )", text)
    assert found is not None, block
    copies = [
        re.sub(r"_1\b", f"_{number}", found[0]).replace(f"// {block} 1", f"// {block} {number}", 1)
        for number in range(1, count + 1)
    ]
    return text[: found.start()] + "".join(copies) + text[found.end() :]


def module_values(
    motor: Motor,
    law: Law,
    *,
    thermal: Thermal | None = None,
    discretisation: Discretisation | None = None,
) -> Mapping[str, float | int]:
    """Return the value of every parameter of the module but those that stay at their neutral defaults."""
    piezo = held_piezo(motor, law)
    constants = contact_values(
        law, motor.contact, radius=motor.rotor.radius_m, preload=motor.contact.preload_n, deflection=0.0,
        slider_time=discretisation.slider_time if discretisation else None,
    )  # fmt: skip
    touching = {_OF_CONTACT.get(name, name): value for name, value in constants.items() if name != "deflection"}
    values: dict[str, float | int] = {
        **{name: rounded(value) for name, value in touching.items()},
        "normal_damping": rounded(touching.get("normal_damping", 0.0)),
        "series_compliance": motor.contact.series_compliance_m_per_n,
        "series_compliance_x": stems(motor, law).get("stem_x", 0.0),
        **({SLIDER_TIME: discretisation.slider_time} if discretisation else {}),
        "inertia": motor.rotor.inertia_kg_m2,
        "bearing": motor.rotor.bearing_damping_n_m_s,
        "bearing_torque": motor.rotor.bearing_friction_n_m,
        "bearing_angle": motor.rotor.bearing_presliding_rad,
        "mounted": int(motor.mount is not None),
        "mounted_x": int(len(carriers(motor.mount)) > 1),
        "capacitance_a": rounded(piezo.capacitance_a_f),
        "capacitance_b": rounded(piezo.capacitances[1]),
        "capacitance_ab": rounded(piezo.capacitance_ab_f),
        "loss": max(motor.piezo.loss_tangent, SMALLEST_LOSS),
    }
    for name, forces in pushes(motor, law).items():
        values |= {
            groups.named(name.replace("stem", "push"), group): force
            for group, force in zip(GROUPS, forces, strict=True)
        }
    for along, prefix in zip(carriers(motor.mount), ("mount", "mount_x"), strict=False):
        values |= {f"{prefix}_{name}": value for name, value in spring_values(along, discretisation).items()}
    if thermal is not None:
        values |= {
            "drift_f": thermal.frequency_drift_per_k,
            "drift_k": thermal.coupling_drift_per_k,
            "drift_c": thermal.capacitance_drift_per_k,
        }
    shaking = written_stator(motor, discretisation, motor.mount).carrier_recoil.T
    for number, (mode, recoil) in enumerate(zip(motor.modes, shaking.tolist(), strict=True), start=1):
        of_mode = {
            **mode_values(mode, discretisation), "softening": mode.softening_per_m2,
            "growth": mode.damping_growth_per_m2,
        }  # fmt: skip
        of_mode |= dict(zip(("recoil", "recoil_x"), recoil, strict=True))
        values |= {f"{parameter}_{number}": rounded(value) for parameter, value in of_mode.items()}
    return values
