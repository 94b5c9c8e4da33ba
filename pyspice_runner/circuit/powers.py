# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers and energies of the parts of a driver, from recorded voltages and currents.

The libraries have a B-source for each ``LOSS``, ``FEED`` and ``STORE`` of their headers. Nothing depends on these
sources, but they take a quarter of the time of a run behind a bridge. A run therefore leaves them out;
:class:`Power` evaluates their expressions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import CodeType

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.spice.expressions import TOKEN
from pyspice_runner.spice.library import Library, number

Array = NDArray[np.float64]
LINE = re.compile(r"^B((?:loss|feed|store)_\w+) \w+ 0 V=(.*)\n", re.M)  # of a power or energy: its node and expression
_PARAMETER = re.compile(r"^\.param (\w+)=\{(.*)\}$", re.M)  # of a library, which follows from others
_SENSED = re.compile(r"([VI])\((\w+)(?:,(\w+))?\)")  # a voltage or current in an expression


@dataclass(frozen=True, eq=False)
class Power:
    """The voltage of a node that a circuit leaves out, because nothing depends on it."""

    line: str  # of the library, which the circuit leaves out
    terms: Mapping[str, str]  # name in the expression by vector
    constants: Mapping[str, float]  # parameters of the part
    _code: CodeType

    def of(self, vectors: Mapping[str, Array]) -> Array:
        """Return the vector of the node."""
        recorded = {name: vectors[vector] for vector, name in self.terms.items()}
        return np.asarray(eval(self._code, {}, {**self.constants, **recorded}), dtype=float)


def powers_of(
    library: Library, instance: str, nodes: Mapping[str, str], values: Mapping[str, float]
) -> Iterator[tuple[str, Power]]:
    """Yield the powers and energies of an instance of a library by their vectors.

    Args:
        library: the library.
        instance: name of the instance, with the x, in lower case.
        nodes: node of the circuit for each pin.
        values: value of each parameter.
    """
    constants = dict(values)
    for name, expression in _PARAMETER.findall(library.subcircuit):
        constants[name] = eval(_python(expression), {}, constants)
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

        text = _python(_SENSED.sub(sensed, expression))
        yield f"v({instance}.{node})", Power(line.group(), terms, constants, compile(text, f"<{library.name}>", "eval"))


def _python(expression: str) -> str:
    """Return an expression of ngspice, without functions, for Python."""
    words = TOKEN.findall(expression.replace("{", "(").replace("}", ")"))
    return "".join(repr(number(word)) if word[0] in ".0123456789" else word for word in words)
