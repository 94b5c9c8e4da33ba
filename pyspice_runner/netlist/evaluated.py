# SPDX-License-Identifier: GPL-3.0-or-later
"""The equations of contact and stem, as the libraries have them, evaluated by numpy for many states at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import CodeType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.model.motor import Motor
from pyspice_runner.netlist.contact import Law, contact_library, contact_values
from pyspice_runner.netlist.expressions import equations, translated
from pyspice_runner.netlist.library import Library

Array = NDArray[np.float64]
DIFFERENCE = 1e-7  # step of a difference quotient over the scale: the curvature and rounding change less than that
_REPETITIONS = 3  # of a node that depends on itself by a small term, as the penetration over the radius of the rotor


def _ramp_up(x: Array) -> Array:
    return np.maximum(x, 0.0)


_FUNCTIONS: dict[str, Any] = {
    **{name: getattr(np, name) for name in ("absolute", "maximum", "minimum", "exp", "sqrt", "tanh")},
    "ramp_up": _ramp_up,
    "ramp_down": lambda x: np.maximum(-x, 0.0),
    "unit_step": lambda x: np.greater(x, 0.0).astype(float),
    "power32": lambda x: np.maximum(x, 0.0) * np.sqrt(np.maximum(x, 0.0)),
    "pow": pow,
}


@dataclass(frozen=True)
class LibraryFunction:
    """The equations of a library.

    Attributes:
        states: nodes whose capacitors hold the state.
    """

    states: tuple[str, ...]
    _program: tuple[tuple[str, CodeType, int], ...]  # node or parameter, its value, how often it is evaluated

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return all nodes, and the rate of each state as ``rate_NODE`` in V/s.

        ``values`` has the parameters, the pins that are inputs, and the states, in the units of the library; they are
        numbers or arrays whose shapes agree. A node that depends on itself starts from the value that is given, or 0.
        """
        found = dict(values)
        for name, code, times in self._program:
            found.setdefault(name, 0.0)
            for _ in range(times):
                found[name] = eval(code, _FUNCTIONS, found)
        return found

    def of(self, nodes: Sequence[str], values: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values with some nodes, from parameters and those nodes that are given."""
        found, needed = dict(values), set(nodes)
        program: list[tuple[str, CodeType]] = []
        for name, code, _ in reversed(self._program):
            if name in needed and name not in found:
                needed.update(code.co_names)
                program.append((name, code))
        for name, code in reversed(program):
            found[name] = eval(code, _FUNCTIONS, found)
        return found


@dataclass(frozen=True)
class Plotted:
    """A node of a brush that the circuit leaves out, because nothing depends on it (:func:`.contact.unplotted`)."""

    node: str  # of the library
    library: Library
    constants: Mapping[str, float]  # its parameters
    terms: Mapping[str, str]  # node of the library by vector: what the sliders are held by

    def of(self, vectors: Mapping[str, Array]) -> Array:
        """Return the vector of the node."""
        known = {node: vectors[vector] for vector, node in self.terms.items()}
        return np.asarray(library_function(self.library).of([self.node], {**self.constants, **known})[self.node])


def plotted_nodes(motor: Motor, law: Law | None, instance: str) -> dict[str, Plotted]:
    """Return the nodes of a brush that the circuit of a motor leaves out, by the names of their vectors."""
    if law is None or law.sliders is None:
        return {}
    library = contact_library(law, motor.contact)
    constants = {item.name: item.default for item in library.parameters}
    constants |= contact_values(law, motor.contact, radius=motor.rotor.radius_m, preload=motor.contact.preload_n)
    inside = ("delta", "factor", *library_function(library).states)
    terms = {f"v({instance}.xcontact.{node})": node for node in inside}
    return {f"v({instance}.{node})": Plotted(node, library, constants, terms) for node in ("slider", "state")}


@cache
def library_function(library: Library) -> LibraryFunction:
    """Return the equations of a library as a function."""
    known = equations(library)

    def compiled(text: str) -> CodeType:
        return compile(translated(text, "python", str), f"<{library.name}>", "eval")

    program = [
        (name, compiled(text), _REPETITIONS if f"V({name})" in text else 1) for name, text in known.ordered()
    ]  # fmt: skip
    for node, capacitance in known.capacitances.items():
        flow = "+".join(known.currents.get(node, ["0"]))
        leak = f"-V({node})/{known.resistances[node]}" if node in known.resistances else ""
        program.append((f"rate_{node}", compiled(f"({flow}{leak})/{capacitance}"), 1))
    return LibraryFunction(tuple(known.capacitances), tuple(program))


def parameter_columns(
    law: Law, motors: Sequence[Motor], deflections_m: Sequence[float], slider_time: float | None = None
) -> dict[str, Array]:
    """Return the parameters of a law's library in its units and order, each for all motors.

    The motors have the same library. The deflections are those of stator and series compliance under the preload.
    """
    defaults = {parameter.name: parameter.default for parameter in contact_library(law, motors[0].contact).parameters}
    each = [
        defaults
        | contact_values(
            law, motor.contact, radius=motor.rotor.radius_m, preload=motor.contact.preload_n, deflection=deflection,
            slider_time=slider_time,
        )
        for motor, deflection in zip(motors, deflections_m, strict=True)
    ]  # fmt: skip
    return {name: np.array([values[name] for values in each], dtype=float) for name in defaults}
