# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor as a compiled Verilog-A module in a bench, with the pins and the vectors of the B-source subcircuit.

The module is that of :mod:`.veriloga` with its states as further ports, because a simulator sets initial voltages of
ports only. What a motor does not need is left out: drift, carrier, dry bearing. The values are on the ``.model`` line,
so that similar motors share one compilation. The coordinates of the module are relative to rest under the preload;
:func:`module_signals` has the vectors of the subcircuit in terms of those of the module.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.law import PAPER_LAW, Law
from pyspice_runner.circuit.state import PLATES, Discretisation, motor_states, plate_nodes, stems, written
from pyspice_runner.circuit.veriloga import WRITTEN, module_source, module_values
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import carriers

# states and pins that a motor may not need: their nodes, and the comment before their equations
_CARRIER = ("carrier on plate springs", ("carrier", "carrier_velocity"))
_CARRIER_X = ("carrier along the rotor", ("carrier_x", "carrier_x_velocity"))
_BEARING = ("dry bearing", ("share",))
_STEM = ("lags of the compression in series with the contact", ("stem", "stem_rate"))
_STEM_X = ("lags along the rotor", ("pulling", "stem_x", "stem_x_rate"))
_HEAT = ("heat of dielectric and modes", ("temperature",))
_HEAD = re.compile(r"module piezomotor\([^)]*\);\n +inout [^;]*;\n")
_ELECTRICAL = re.compile(r"(?m)^    electrical ([^;]+);$")  # first the pins, then the states
PINS = ("a", "b", "com", "shaft")  # the first ports of a module
# ports of the module that are nodes of the subcircuit under another name
_NODES = {"pressing": "normal"} | {
    groups.named(plate, group): node for group in "ab" for plate, node in zip(PLATES, plate_nodes(group), strict=True)
}


@dataclass(frozen=True)
class Signal:
    """A vector as a sum of others: ``offset + Σ factor · vector``."""

    terms: Mapping[str, float]  # factor by vector
    offset: float = 0.0  # in the unit of the vector

    def of(self, vectors: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the sum."""
        total = np.full(len(next(iter(vectors.values()))), self.offset)
        for name, factor in self.terms.items():
            total += factor * vectors[f"v({name})" if name.startswith("@") else name]
        return total


@dataclass(frozen=True)
class Module:
    """A Verilog-A module to compile."""

    name: str  # its name, and that of the compiled file without the ending
    source: str  # its text
    ports: tuple[str, ...]  # its ports: :data:`PINS`, then the states

    @property
    def file(self) -> str:
        """Name of the compiled file, as the deck has it."""
        return f"{self.name}.osdi"


def missing_form(law: Law | None) -> str:
    """Return the reason why a motor with this law has no compiled form; empty if it has one."""
    if law is None:
        return "contact = None (a free tip) has no compiled form: its circuit is linear."
    if law.name not in WRITTEN:
        return f"contact = {law.name!r} has no compiled form; there is one of {', '.join(WRITTEN)}."
    return ""


def module_of(motor: Motor, law: Law) -> Module:
    """Return the module for a motor with a law: the exported one without what it does not need, its states as ports.

    Motors with the same number of modes, with or without mount, dry friction of the bearing and a compliance in series
    with the contact, have the same module.
    """
    soft = stems(motor, law)
    parts = {
        "dry": motor.rotor.bearing_friction_n_m > 0.0, "stem": "stem" in soft, "stem_x": "stem_x" in soft,
        "worn": motor.contact.worn_flat_radius_m > 0.0,
    }  # fmt: skip
    there = tuple(name for name, one in parts.items() if one)
    return _module(len(motor.modes), law, len(carriers(motor.mount)), there)


@cache
def _module(modes: int, law: Law, moving: int, there: tuple[str, ...]) -> Module:
    text = module_source(modes, law, flat="worn" in there)
    parts = {"dry": _BEARING, "stem": _STEM, "stem_x": _STEM_X}
    absent = (part for name, part in parts.items() if name not in there)
    unused = [_HEAT, *(_CARRIER, _CARRIER_X)[moving:], *absent]
    for comment, nodes in unused:  # their voltages are 0, and their equations are left out
        text, count = re.subn(rf"(?ms)^ *// {comment}.*?^ *// end of the [^\n]*\n", "", text)
        assert count == 1, comment
        for node in nodes:
            text = text.replace(f"= V({node});", "= 0.0;")
            assert f"V({node})" not in text, node
    left_out = {node for _, nodes in unused for node in nodes}

    def kept(line: re.Match[str]) -> str:
        names = [name for name in line[1].split(", ") if name not in left_out]
        return f"    electrical {', '.join(names)};" if names else ""

    text = _ELECTRICAL.sub(kept, text)
    ports = tuple(port for line in _ELECTRICAL.findall(text) for port in line.split(", "))
    listed = ", ".join(ports)
    kind = {"spring-slider": (), "coulomb": ("coulomb",), "brush": (f"{law.sliders}_sliders",)}[law.name]
    name = "_".join(("piezomotor", f"{modes}_modes", *kind, *("mount", "x")[:moving], *there))
    return Module(name, _HEAD.sub(f"module {name}({listed});\n    inout {listed};\n", text, count=1), ports)


def module_subcircuit(motor: Motor, law: Law, discretisation: Discretisation | None, name: str) -> str:
    """Return ``.subckt NAME a b com shaft`` with the module as its only device, ``n1``, and the module's model.

    Raise ParameterError for a law that the module does not have.
    """
    reason = missing_form(law)
    if reason:
        raise ParameterError(reason)
    module = module_of(motor, law)
    values = " ".join(
        f"{parameter}={value!r}"
        for parameter, value in module_values(motor, law, discretisation=discretisation).items()
    )
    names = _NODES | {f"cell_{number}": f"xcontact.q{number}" for number in range(1, (law.sliders or 0) + 1)}
    nodes = " ".join(names.get(port, port) for port in module.ports[len(PINS) :])
    return "\n".join(
        (
            f".model {name}_device {module.name} {values}",
            f".subckt {name} a b com shaft",
            f"N1 a b com shaft {nodes} {name}_device",
            f".ends {name}",
        )
    )


def loading(module: Module) -> str:
    """Return the control section that loads the compiled file.

    The start file of ngspice 46 asks for eight threads, which slow down even a single device: a run on two cores takes
    up to 50 times as long as with one thread.
    """
    return f".control\npre_osdi {module.file}\nset num_threads=1\n.endc"


def module_signals(motor: Motor, discretisation: Discretisation | None, instance: str) -> dict[str, Signal]:
    """Return the vectors of the B-source motor that differ in the module, as sums of those of an instance."""
    found: dict[str, Signal] = {}
    for state in motor_states(motor, PAPER_LAW, ("mode", "stem", "mount", "bearing")):
        factor = state.unit / state.scale(discretisation)
        found[state.within(instance)] = Signal({f"v({instance}.{state.name})": factor}, state.rest)
    for axis in "xy":
        shapes = [getattr(mode, f"tip_{axis}") for mode in motor.modes]
        terms = {f"v({instance}.displacement_{at})": shape for at, shape in enumerate(shapes, start=1) if shape}
        bending = sum(
            shape * mode.tip_y / written(mode, discretisation)[1]
            for shape, mode in zip(shapes, motor.modes, strict=True)
        )
        if axis == "x":  # which is 0 where it differs from 0 only by rounding
            bending = bending if motor.sway_m else 0.0
        found[f"v({instance}.{axis})"] = Signal(terms, -1e6 * bending * motor.contact.preload_n)
    for node, variable in (("friction", "tangential"), ("state", "state"), ("xcontact.delta", "delta")):
        found[f"v({instance}.{node})"] = Signal({f"@n.{instance}.n1[{variable}]": 1.0})
    return found
