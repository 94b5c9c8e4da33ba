# SPDX-License-Identifier: GPL-3.0-or-later
"""A library in the dialect of Xyce, translated from the one that ngspice and LTspice read.

What differs: parameters follow the word ``PARAMS:``; the expression of a B-source stands in braces as a whole, and
contains no others; the step function is ``STP``; ``LOG`` is to base 10, the natural logarithm is ``LN``; an option
belongs to a package. A dot in the name of a node becomes ``_``. Initial conditions are parameters ``IC`` of capacitors
and inductors in both.

Source: Xyce Reference Guide, sections on B, C, L and X devices, .OPTIONS, .PARAM, .SUBCKT, .TRAN and on expressions.
"""

from __future__ import annotations

import re
from typing import Literal

from pyspice_runner.errors import ParameterError

Dialect = Literal["spice", "xyce"]
# functions of the Reference Guide's table that a library may use, with those that read a node or a source
FUNCTIONS = frozenset(
    "v i abs acos asin atan cos cosh exp ln max min sgn sin sinh sqrt stp tan tanh uramp".split()  # noqa: SIM905
)
_OTHER_NAMES = {"u": "STP", "log": "LN"}  # function here → in Xyce
_OTHER_OPERATORS = re.compile(r"[\^?&|~]")  # not in a library: ^ is the exclusive or in Xyce
_TESTED = (
    "* TESTED WITH no Xyce: translated by Xyce's reference guide from a library that is tested with ngspice\n"
    "* NOTE   Xyce applies IC= in every analysis. Run .tran with uic; .op and .ac start from rest under the preload."
)


def xyce_library(text: str) -> str:
    """Return a library in the dialect of Xyce.

    Raise ParameterError for a function or an operator that Xyce does not have, as a user's own law may contain.
    """
    return "\n".join(_line(line) for line in text.splitlines()) + "\n"


def _line(line: str) -> str:
    if line.startswith("*"):
        return _comment(line)
    kind = line[:1].upper()
    if kind == "B":
        start, equals, expression = line.partition("=")
        inside = _expression(expression.replace("{", "(").replace("}", ")"), line)
        return f"{start}{equals}{{{inside}}}"
    line = re.sub(r"\{([^{}]*)\}", lambda found: f"{{{_expression(found[1], line)}}}", line)
    line = re.sub(r"\b([a-z]\w*)\.(?=[a-z])", r"\1_", line, flags=re.I)
    if kind == "X" or line.lower().startswith(".subckt"):
        line = re.sub(r" (?=\w+=)", " PARAMS: ", line, count=1)
    return line


def _comment(line: str) -> str:
    if line.startswith("* TESTED WITH"):
        return _TESTED
    method = re.fullmatch(r"(\*\s+)\.options .*\bmethod=(\w+).*", line)
    return f"{method[1]}.options timeint method={method[2]}" if method else line


def _expression(text: str, line: str) -> str:
    """Return an expression with the names of Xyce's functions."""
    if found := _OTHER_OPERATORS.search(text):
        raise ParameterError(
            f"The operator {found[0]} in the line {line.split()[0]} has no translation to Xyce. Use + - * / **."
        )

    def renamed(call: re.Match[str]) -> str:
        name = _OTHER_NAMES.get(call[1].lower(), call[1])
        if name.lower() not in FUNCTIONS:
            raise ParameterError(
                f"{call[1]}() in the line {line.split()[0]} has no translation to Xyce. "
                f"Use {', '.join(sorted(FUNCTIONS - {'i', 'v'}))}."
            )
        return f"{name}("

    return re.sub(r"\b([a-z]\w*)\(", renamed, text, flags=re.I)
