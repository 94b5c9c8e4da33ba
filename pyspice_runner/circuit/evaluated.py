# SPDX-License-Identifier: GPL-3.0-or-later
"""Equations of the libraries, evaluated by numpy: of contact and stem, and of powers that a circuit leaves out."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from threading import Lock
from types import CodeType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.law import Law, contact_library, contact_values, laws_of, libraries_of
from pyspice_runner.circuit.motor import touching_values
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.motor.motor import Motor
from pyspice_runner.spice.expressions import TOKEN, equations, translated
from pyspice_runner.spice.library import Library, number

Array = NDArray[np.float64]
DIFFERENCE = 1e-7  # step of a difference quotient over the scale: the curvature and rounding change less than that
_REPETITIONS = 3  # of a node that depends on itself by a small term, as the penetration over the radius of the rotor
_FUNCTIONS: dict[str, Any] = {
    **{name: getattr(np, name) for name in ("absolute", "maximum", "minimum", "exp", "sqrt", "tanh")},
    "ramp_up": lambda x: np.maximum(x, 0.0),
    "ramp_down": lambda x: np.maximum(-x, 0.0),
    "unit_step": lambda x: np.greater(x, 0.0).astype(float),
    "power32": lambda x: np.maximum(x, 0.0) * np.sqrt(np.maximum(x, 0.0)),
    "pow": lambda base, exponent: np.absolute(base) ** exponent,  # as ngspice
}


@dataclass(frozen=True, eq=False)
class LibraryFunction:
    """The equations of a library."""

    states: tuple[str, ...]  # nodes whose capacitors hold the state
    rates: tuple[str, ...]  # names of their rates, ``rate_NODE``
    nodes: tuple[str, ...]  # all nodes and rates
    _program: tuple[tuple[str, CodeType, int], ...]  # node or parameter, its value, how often it is evaluated

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Return all nodes, and the rate of each state in V/s, from the values of :meth:`of`."""
        return self.of(self.nodes, values)

    def of(self, nodes: Sequence[str], values: Mapping[str, Any], start: Mapping[str, Any] = {}) -> dict[str, Any]:
        """Return some nodes.

        ``values`` has the parameters and those nodes that are given, such as the pins that are inputs and the states,
        in the units of the library; they are numbers or arrays whose shapes agree. A node that depends on itself begins
        at its value in ``start``, or 0. What is no longer needed on the way is forgotten, so that its memory serves
        again while it is in the cache.
        """
        found = {**start, **values}
        for name, code, times, dead in _needed(self, tuple(nodes), frozenset(values)):
            found.setdefault(name, 0.0)
            for _ in range(times):
                found[name] = eval(code, _FUNCTIONS, found)
            for one in dead:
                del found[one]
        return {node: found[node] for node in nodes}


@cache
def _needed(
    function: LibraryFunction, nodes: tuple[str, ...], given: frozenset[str]
) -> list[tuple[str, CodeType, int, list[str]]]:
    """Return the part of a program that some nodes need, each step with what no later one needs."""
    program: list[tuple[str, CodeType, int, list[str]]] = []
    needed, kept = set(nodes), set(nodes) | given
    for name, code, times in reversed(function._program):
        if name in needed - given:
            needed.update(code.co_names)
            dead = list({name, *code.co_names} - kept - _FUNCTIONS.keys())
            kept.update(dead)
            program.append((name, code, times, dead))
    return program[::-1]


@dataclass(frozen=True, eq=False)
class Derived:
    """The voltage of a node that a circuit leaves out, because nothing depends on it."""

    terms: Mapping[str, str]  # name in the equations by vector
    value: Callable[[Mapping[str, Array]], Any]  # the equations
    line: str = ""  # of the library, which the circuit leaves out

    def of(self, vectors: Mapping[str, Array]) -> Array:
        """Return the vector of the node."""
        return np.asarray(self.value({name: vectors[vector] for vector, name in self.terms.items()}), dtype=float)


def plotted_nodes(motor: Motor, law: Law | None, *instances: str) -> dict[str, Derived]:
    """Return the nodes of a brush that the circuits of a motor leave out (:func:`.unplotted`), by their vectors."""
    if law is None or not law.row:
        return {}
    library = contact_library(law, motor.contact)
    constants = library.defaults | contact_values(
        law, motor.contact, radius=motor.rotor.radius_m, preload=motor.contact.preload_n
    )
    function = library_function(library)

    def value(node: str, known: Mapping[str, Array]) -> Any:
        return function.of([node], {**constants, **known})[node]

    found: dict[str, Derived] = {}
    for instance in instances:
        terms = {f"v({instance}.xcontact.{node})": node for node in ("delta", "factor", *function.states)}
        for node in ("slider", "state"):
            found[f"v({instance}.{node})"] = Derived(terms, partial(value, node))
    return found


# Python 3.11 counts the depth of a syntax tree for all threads together: parallel parsing raises SystemError
_PARSING = Lock()


@cache
def library_function(library: Library) -> LibraryFunction:
    """Return the equations of a library as a function."""
    known = equations(library)
    texts = [(name, text, _REPETITIONS if f"V({name})" in text else 1) for name, text in known.ordered()]
    for node, capacitance in known.capacitances.items():
        flow = "+".join(known.currents.get(node, ["0"]))
        leak = f"-V({node})/{known.resistances[node]}" if node in known.resistances else ""
        texts.append((f"rate_{node}", f"({flow}{leak})/{capacitance}", 1))
    with _PARSING:
        program = tuple(
            (name, compile(translated(text, "python", str), f"<{library.name}>", "eval"), times)
            for name, text, times in texts
        )
    if both := {*library.defaults} & {*library.pin_names, *known.capacitances, *(name for name, *_ in program)}:
        raise ValueError(f"{library.name}: {', '.join(sorted(both))} is a parameter and a node, or set twice.")
    given = {*library.defaults, *library.pin_names, *known.capacitances, *(name for name, *_ in program), *_FUNCTIONS}
    if missing := {name for _, code, _ in program for name in code.co_names} - given:
        raise ValueError(f"{library.name} reads {', '.join(sorted(missing))}, which cannot be translated.")
    states, nodes = tuple(known.capacitances), tuple(name for name, *_ in program)
    return LibraryFunction(states, nodes[len(nodes) - len(states) :], nodes, program)


@cache
def evaluable(library: Library) -> bool:
    """Return whether numpy can evaluate the equations of a library, for example of a user's own law."""
    with suppress(ValueError):
        return bool(library_function(library))
    return False


def parameter_columns(
    law: Law, motors: Sequence[Motor], discretisation: Discretisation | None = None
) -> dict[str, Array]:
    """Return the parameters of a law's library in its units and order, each for all contacts of all motors.

    The contacts of all motors have the same library (:func:`.libraries_of`).
    """
    library = libraries_of(motors[0], law)[0]
    rows = [
        [*(library.defaults | touching_values(motor, own, one, discretisation, library)).values()]
        for motor in motors
        for one, own in zip(motor.touching, laws_of(motor, law), strict=True)
    ]
    return dict(zip(library.defaults, np.array(rows, dtype=float).T, strict=True))


LINE = re.compile(r"^B((?:loss|feed|store|limit)_\w+) \w+ 0 V=(.*)\n", re.M)  # of a power: its node and expression
_PARAMETER = re.compile(r"^\.param (\w+)=\{(.*)\}$", re.M)  # of a library, which follows from others
_SENSED = re.compile(r"([VI])\((\w+)(?:,(\w+))?\)")  # a voltage or current in an expression


def powers_of(
    library: Library, instance: str, nodes: Mapping[str, str], values: Mapping[str, float]
) -> Iterator[tuple[str, Derived]]:
    """Yield the powers and energies of an instance of a library by their vectors.

    ``instance`` is its name with the x, in lower case, ``nodes`` has the node of the circuit for each pin.
    """
    constants = dict(values)
    for name, expression in _PARAMETER.findall(library.subcircuit):
        constants[name] = eval(_python(expression), {}, constants)

    def value(code: CodeType, recorded: Mapping[str, Array]) -> Any:
        return eval(code, {}, {**constants, **recorded})

    for line in LINE.finditer(library.subcircuit):
        node, expression = line.groups()
        terms: dict[str, str] = {}

        def voltage(name: str | None, terms: dict[str, str] = terms) -> str:
            node = nodes.get(name, f"{instance}.{name}") if name else "0"
            return terms.setdefault(f"v({node})", f"node_{name}") if node != "0" else "0"

        def sensed(found: re.Match[str], terms: dict[str, str] = terms) -> str:
            kind, first, second = found.groups()
            if kind == "I":
                return terms.setdefault(f"i(v.{instance}.{first.lower()})", f"current_{first.lower()}")
            return f"({voltage(first)}-{voltage(second)})"

        code = compile(_python(_SENSED.sub(sensed, expression)), f"<{library.name}>", "eval")
        yield f"v({instance}.{node})", Derived(terms, partial(value, code), line.group())


def _python(expression: str) -> str:
    """Return an expression of ngspice, without functions, for Python."""
    words = TOKEN.findall(expression.replace("{", "(").replace("}", ")"))
    return "".join(repr(number(word)) if word[0] in ".0123456789" else word for word in words)
