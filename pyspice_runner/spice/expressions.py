# SPDX-License-Identifier: GPL-3.0-or-later
"""Subcircuits of the libraries as equations, in C, Verilog-A and Python with numpy.

The libraries are the only source of the contact's equations. :func:`equations` reads them from a subcircuit;
:func:`translated` writes an expression of a B-source in another language.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from keyword import iskeyword
from typing import Literal

from pyspice_runner.spice.library import Library, number, read_library

Language = Literal["c", "verilog-a", "python"]
_LANGUAGES = ("c", "verilog-a", "python")
TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?[a-z]*|[a-z_]\w*|\*\*|\S", re.I)
# function of a library → in each language; some are defined by HELPERS
_FUNCTIONS = {
    "abs": ("fabs", "abs", "absolute"), "max": ("larger", "max", "maximum"), "min": ("smaller", "min", "minimum"),
    **{name: (other,) * 3 for name, other in (("uramp", "ramp_up"), ("u", "unit_step"))},
    **{name: (name,) * 3 for name in ("cos", "exp", "sin", "sqrt", "tanh")}, "atan": ("atan", "atan", "arctan"),
}  # fmt: skip
# ramp_down(x) is uramp(-x). At 0 only ramp_up has a slope, so that small signals at rest see a stiffness once.
_BODIES = {
    "ramp_up": "x >= 0.0 ? x : 0.0", "ramp_down": "x < 0.0 ? -x : 0.0", "unit_step": "x > 0.0 ? 1.0 : 0.0",
    "power32": "x > 0.0 ? x * sqrt(x) : 0.0",
}  # fmt: skip
HELPERS: dict[Literal["c", "verilog-a"], str] = {
    "c": "\n".join(
        (
            "#ifndef EXPRESSION_HELPERS",
            "#define EXPRESSION_HELPERS",
            *(f"static inline double {name}(double x) {{ return {body}; }}" for name, body in _BODIES.items()),
            # fmax and fmin of the library are calls
            "static inline double larger(double a, double b) { return a > b ? a : b; }",
            "static inline double smaller(double a, double b) { return a < b ? a : b; }",
            "#endif",
        )
    ),
    "verilog-a": "\n".join(
        f"    analog function real {name};\n        input x;\n        real x;\n        {name} = {body};\n"
        "    endfunction"
        for name, body in _BODIES.items()
    ),
}


def translated(text: str, language: Language, name: Callable[[str], str]) -> str:
    """Return an expression in another language, with the functions of :data:`HELPERS`, or of :mod:`.evaluated`.

    Braces are parentheses.

    ``name`` returns the name of a node or parameter in that language. Raise ValueError for what is not known here.
    """
    parser = _Parser(text, language, name)
    with suppress(KeyError, IndexError):  # of a function that is not known, and of an incomplete expression
        found = parser.total()
        if not parser._tokens:
            return found
    raise ValueError(f"The expression {text} cannot be translated.")


class _Parser:
    """A recursive-descent parser that writes what it reads."""

    def __init__(self, text: str, language: Language, name: Callable[[str], str]) -> None:
        self._tokens = TOKEN.findall(text.replace("{", "(").replace("}", ")"))[::-1]
        self._language = language
        self._name = name

    def _next_is(self, word: str) -> bool:
        """Take the next token if it is a word."""
        found = bool(self._tokens) and self._tokens[-1].lower() == word
        if found:
            self._tokens.pop()
        return found

    def total(self) -> str:
        return self._chain("+-", self._product)

    def _product(self) -> str:
        return self._chain("*/", self._power)

    def _chain(self, operators: str, operand: Callable[[], str]) -> str:
        found = operand()
        while self._tokens and self._tokens[-1] in operators:
            found = f"{found} {self._tokens.pop()} {operand()}"
        return found

    def _power(self) -> str:
        if self._next_is("-"):
            return f"-{self._power()}"
        base = self._atom()
        if not self._next_is("**"):
            return base
        base, exponent = (text[1:-1] if text.startswith("(") else text for text in (base, self._atom()))
        return f"power32({base})" if exponent == "1.5" else f"pow({base}, {exponent})"

    def _atom(self) -> str:
        word = self._tokens.pop()
        if word == "(":
            inner = self.total()
            self._tokens.pop()
            return f"({inner})" if " " in inner else inner
        if not (word[0].isalpha() or word[0] == "_"):
            return repr(number(word))
        return self._call(word.lower()) if self._next_is("(") else self._name(word)

    def _call(self, function: str) -> str:
        falling = function == "uramp" and self._next_is("-")
        arguments = [self._product() if falling else self.total()]
        while self._tokens.pop() == ",":
            arguments.append(self.total())
        if function in ("v", "i"):  # of a node, or of a source that senses a current
            return arguments[0 if len(arguments) == 1 else 2]  # a difference of two nodes is an IndexError
        called = "ramp_down" if falling else _FUNCTIONS[function][_LANGUAGES.index(self._language)]
        return f"{called}({', '.join(arguments)})"


# elements that are translated: what follows the first node. X passes parameters of the same names.
_ELEMENTS = {
    "B": r"(0 V|\S+ I)=.*", "C": r"0 \S+( ic=\S+)?", "R": r"\S+ \S+", "V": r"\S+ (DC )?\S+",
    **dict.fromkeys("EG", r"\S+ \S+ \S+ \S+"), "X": r"[^=]*( (\w+)=\{\2\})*",
}  # fmt: skip


@dataclass
class Equations:
    """The equations of a subcircuit and of those that it contains."""

    parameters: dict[str, str] = field(default_factory=dict)  # name → expression of each ``.param``
    values: dict[str, str] = field(default_factory=dict)  # node → expression of its voltage
    currents: dict[str, list[str]] = field(default_factory=dict)  # node → expressions of the currents that flow into it
    resistances: dict[str, str] = field(default_factory=dict)  # node → resistance to ground
    capacitances: dict[str, str] = field(default_factory=dict)  # node → capacitance to ground
    # node → conductance to ground beside the resistance: a B-source whose current is its voltage times an expression
    conductances: dict[str, str] = field(default_factory=dict)

    def ordered(self) -> Iterator[tuple[str, str]]:
        """Return parameters and node voltages, each one behind those that it depends on."""
        known = self.parameters | self.values
        done: set[str] = set()

        def visit(name: str) -> Iterator[tuple[str, str]]:
            if name in known and name not in done:
                done.add(name)
                for word in TOKEN.findall(known[name]):
                    yield from visit(word)
                yield name, known[name]

        for name in known:
            yield from visit(name)

    def add(self, library: Library, pins: Mapping[str, str]) -> None:
        """Add the lines of a subcircuit whose pins are connected to other nodes."""
        for line in library.subcircuit.splitlines()[1:-1]:
            if line.startswith(".param"):
                name, _, value = line.removeprefix(".param ").partition("=")
                self._put(self.parameters, name, value[1:-1] if value.startswith("{") else value)
            elif not line.startswith("*"):
                line = TOKEN.sub(lambda word: pins.get(word[0], word[0]), line)
                self._add_element(line[0].upper(), line.split(maxsplit=3), library)

    def _add_element(self, kind: str, words: list[str], library: Library) -> None:
        _, plus, minus, rest = words
        if not re.fullmatch(_ELEMENTS.get(kind, "(?!)"), f"{minus} {rest}", re.I):
            raise ValueError(f"The element {' '.join(words)} cannot be translated.")
        last = rest.rpartition(" ")[2]
        if kind == "X":
            self._add_inner([plus, minus, *rest.split()], library)
        elif kind == "B" and rest.startswith("V="):
            self._put(self.values, plus, rest.removeprefix("V="))
        elif kind == "B" and minus == "0" and rest.endswith(f"*V({plus})"):
            factor = rest.removeprefix("I=").removesuffix(f"*V({plus})")
            if _has_sum(factor):
                raise ValueError(f"{rest}: put the sum before *V({plus}) in parentheses.")
            self._put(self.conductances, plus, factor)
        elif kind == "V":
            self._put(self.values, plus, f"V({minus})+{last}")
        elif kind == "E":
            base = "" if minus == "0" else f"V({minus})+"
            self._put(self.values, plus, f"{base}{last}*{_across(*rest.split()[:2])}")
        elif kind == "C":
            self._put(self.capacitances, plus, rest.split()[0])
        elif kind == "R" and minus == "0":
            self._put(self.resistances, plus, last)
        else:
            flow = {
                "B": lambda: rest.removeprefix("I="), "G": lambda: f"{last}*{_across(*rest.split()[:2])}",
                "R": lambda: f"{_across(plus, minus)}/{last}",
            }[kind]()  # fmt: skip
            self.currents.setdefault(plus, []).append(f"-({flow})")
            self.currents.setdefault(minus, []).append(f"({flow})")

    def _add_inner(self, words: list[str], library: Library) -> None:
        """Add a subcircuit within another one, whose parameters it is given all."""
        inner = next(read_library(word) for word in words if word in library.needs)
        if missing := inner.defaults.keys() - {word.partition("=")[0] for word in words if "=" in word}:
            raise ValueError(f"The X line of {inner.name} does not pass {', '.join(sorted(missing))}.")
        self.add(inner, dict(zip(inner.pin_names, words, strict=False)))

    @staticmethod
    def _put(kind: dict[str, str], name: str, text: str) -> None:
        """Note what is at a node, or a parameter. Raise ValueError for a second one, or a name that cannot be used."""
        if name in kind or not name.isidentifier() or name != name.lower() or iskeyword(name) or name in _FUNCTIONS:
            raise ValueError(f"{name} = {text} cannot be translated: its name is taken, or no lower-case word.")
        kind[name] = text

    def resolve(self) -> None:
        """Give each node with a resistor to ground and no capacitor the voltage that its currents cause there.

        Raise ValueError for a conductance elsewhere, and for a node with the name of a parameter.
        """
        if (self.conductances.keys() - self.resistances.keys()) | (self.conductances.keys() & self.capacitances.keys()):
            raise ValueError("A current V(node) times an expression flows where there is no resistor to node 0 alone.")
        nodes = self.values.keys() | self.capacitances.keys() | self.resistances.keys()
        if both := nodes & self.parameters.keys():
            raise ValueError(f"{', '.join(sorted(both))} is a parameter and a node.")
        for node, resistance in self.resistances.items():
            if node not in self.capacitances:
                flow, beside = "+".join(self.currents.pop(node, ["0"])), self.conductances.get(node)
                self.values[node] = f"({flow})/(1/{resistance}+{beside})" if beside else f"{resistance}*({flow})"


def _across(plus: str, minus: str) -> str:
    """Return the expression of the voltage between two nodes."""
    return f"V({plus})" if minus == "0" else f"(V({plus})-V({minus}))"


def _has_sum(expression: str) -> bool:
    """Return whether an expression is a sum or a difference, outside of its parentheses."""
    depth, before = 0, ""
    for token in TOKEN.findall(expression):
        depth += (token in "({") - (token in ")}")
        if depth == 0 and token in "+-" and before not in ("*", "/", "**"):
            return True
        before = token
    return False


def equations(library: Library) -> Equations:
    """Return the equations of a library's subcircuit."""
    found = Equations()
    found.add(library, {})
    found.resolve()
    return found
