# SPDX-License-Identifier: GPL-3.0-or-later
"""SPICE files of the user's own: contact laws (:mod:`.law`), drivers and MOSFETs (:mod:`.own_device`).

The text of such a file enters netlists. Therefore only circuit elements are accepted: no control language, no files, no
code models.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

from pyspice_runner.errors import ParameterError
from pyspice_runner.spice.library import FACTS, PREFIX, Header, Library, LibraryParameter, Pin, library_names, number

Parameters = tuple[LibraryParameter, ...]
Statement = tuple[int, str]  # number of its first line in the file, and its text with the continued lines
_FUNCTIONS = frozenset(
    "abs acos asin atan ceil cos cosh exp floor int ln log log10 max min pow pwr sgn sin sinh sqrt tan tanh".split()  # noqa: SIM905
)
_FREE = frozenset(["pi", "temper", "time"])  # names that every expression may read
_UNIT = re.compile(r"[\w/*^().%-]{1,20}")  # of a PAR line; a label of axes
_LONGEST = 4096  # characters of a line
_NO_FILES = {r"file|[`\"\\]": "a {what} reads no files and needs no quotes"}


@dataclass(frozen=True)
class Rules:
    """Statements that a file may have."""

    what: str  # the file's purpose in one word, for messages
    elements: str = "RLCVIEFGHBDKSX"  # first letters of the elements; never A and N, which may run code
    models: tuple[str, ...] = ("D", "SW", "CSW")  # types of ``.model``
    usual: str = f"{PREFIX}_normal"  # the part of ``behavioral/`` that such a file usually needs, for messages
    forbidden: Mapping[str, str] = field(default_factory=dict)  # further forbidden patterns, with the reason


class OwnFile:
    """The text of one file, checked by statements. Raise ParameterError for an invalid character; it names the line."""

    def __init__(self, path: str, text: str, rules: Rules) -> None:
        self._path = path
        self._text = text.replace("\r\n", "\n")
        self._header = Header(path, self._text)
        self._rules = rules
        self._statements = self._joined()

    def _joined(self) -> list[Statement]:
        """Return the statements: continuation lines joined, without comments and blanks in braces."""
        joined: list[tuple[int, list[str]]] = []
        for count, raw in enumerate(self._text.split("\n"), start=1):
            if raw.lstrip(" \t").startswith(("*", "$", "#", ";")):
                continue
            if len(raw) > _LONGEST:
                self._fail(count, f"it has {len(raw)} characters; at most {_LONGEST} are allowed")
            line = raw.partition(";")[0].replace("\t", " ").partition(" $ ")[0].strip(" ")
            if not line:
                continue
            if re.search(r"[^\x20-\x7e]", line):
                self._fail(count, "it has a control character or one that is not ASCII; write u for µ")
            if not line.startswith("+"):
                joined.append((count, [line]))
            elif joined:
                joined[-1][1].append(line[1:].strip())
            else:
                self._fail(count, "a continued line needs a line before it")
        return [(count, self._squeezed(count, " ".join(pieces))) for count, pieces in joined]

    def _squeezed(self, count: int, line: str) -> str:
        """Return a line without the blanks in its braces."""
        pieces = re.split(r"(\{[^{}]*\})", line)
        if any("{" in piece or "}" in piece for piece in pieces[::2]):
            self._fail(count, f"the braces of {short(line)} do not match, or are nested")
        pieces[1::2] = [piece.replace(" ", "") for piece in pieces[1::2]]
        return "".join(pieces)

    def _library(
        self, name: str, own_name: str, pins: Sequence[str], parameters: Parameters, text: str, needs: tuple[str, ...]
    ) -> Library:
        """Return the file as a library: ``name`` and ``text`` in a netlist, ``own_name`` in the file."""
        what, stated = self._rules.what, dict.fromkeys(FACTS, "not stated")
        return Library(
            name=name,
            title=self._header.title(own_name) or f"{what} {own_name}",
            pins=tuple(Pin(pin, "", "", "") for pin in pins),
            parameters=parameters,
            usage="",
            subcircuit=text,
            text=self._text,
            needs=needs,
            **(stated | {"omits": f"what the user's own {what} leaves out"} | self._header.facts()),
            **self._header.insides(text),
        )

    def _needs(self) -> tuple[str, ...]:
        """Return the libraries of ``behavioral/`` on the ``NEEDS`` lines."""
        names = self._header.needs()
        for name in names:
            if name not in library_names():
                raise ParameterError(
                    f"{self._path}: NEEDS names {name!r}, which is not in behavioral/. "
                    f"Usually it is {self._rules.usual}."
                )
        return names

    def _parameters(self, line: int, words: Sequence[str]) -> Parameters:
        """Return the parameters ``name=value`` of a ``.subckt`` line, with their PAR lines."""
        stated = {parameter.name: parameter for parameter in self._header.parameters()}
        found: list[LibraryParameter] = []
        for word in words:
            name, _, value = word.partition("=")
            name = name.lower()
            if not re.fullmatch(r"[a-z]\w*", name):
                self._fail(line, f"{name!r} cannot be the name of a parameter")
            if any(name == other.name for other in found):
                self._fail(line, f"a parameter cannot be called {name}, since another one is; rename it")
            try:
                default = number(value)
            except ParameterError as error:
                self._fail(line, f"parameter {name}: {str(error).rstrip('.')}")
            plain = LibraryParameter(name, "1", default, -1e30, 1e30, f"parameter of the user's own {self._rules.what}")
            parameter = stated.pop(name, plain)
            if parameter.default != default:
                self._fail(line, f"{name} is {value} here and {parameter.default:g} in its PAR line")
            if not _UNIT.fullmatch(parameter.unit):
                raise ParameterError(f"{self._path}: {parameter.unit!r} in the PAR line of {name} is not a unit.")
            found.append(parameter)
        if stated:
            raise ParameterError(f"{self._path}: {', '.join(stated)} has a PAR line, but .subckt does not have it.")
        return tuple(found)

    def _check(self, line: int, text: str, known: Collection[str], parts: Collection[str]) -> set[str]:
        """Check one line of a subcircuit, with the parameters ``known`` to expressions and the ``parts`` for X lines.

        Return the parameters that the line defines.
        """
        rules = self._rules
        self._check_text(line, text, known)
        if text.startswith("."):
            if re.match(r"\.param\s+[a-z]\w*\s*=", text, re.I):
                return {name.lower() for name in re.findall(r"([a-z]\w*)\s*=", text, re.I)}
            if not re.match(rf"\.model\s+\S+\s+({'|'.join(rules.models)})\b", text, re.I):
                types = f"{', '.join(rules.models[:-1])} or {rules.models[-1]}"
                self._fail(line, f"{short(text)} is not allowed: only .param, and .model of type {types}")
        elif text[0].upper() not in rules.elements:
            self._fail(line, f"{short(text)} is not allowed: elements begin with one of {rules.elements}")
        elif text[0].upper() == "X":
            part = self._part(text)
            if part not in parts:
                self._fail(line, f"{part} is not in the file; name it in a line '* NEEDS {rules.usual}'")
        return set()

    def _check_text(self, line: int, text: str, known: Collection[str]) -> None:
        """Check the rules for every line: no files, and in braces only known parameters, nodes and currents."""
        for pattern, why in (_NO_FILES | dict(self._rules.forbidden)).items():
            if re.search(pattern, text, re.I):
                self._fail(line, f"{short(text)} is not allowed: {why.format(what=self._rules.what)}")
        for expression in re.findall(r"\{([^}]*)\}", text.lower()):
            for name in re.findall(r"\b[vi]\([^()]*\)|(?<![\w.])([a-z_]\w*)", expression):
                if name and name not in known and name not in _FUNCTIONS | _FREE:
                    self._fail(line, f"the expression reads {name}, which is not a parameter of the {self._rules.what}")

    def _part(self, text: str) -> str:
        """Return the subcircuit that an X line instantiates, in lower case."""
        return next(word for word in reversed(words_of(text)) if "=" not in word).lower()

    def _fail(self, line: int, what: str) -> NoReturn:
        raise ParameterError(f"{self._path}, line {line}: {what}.")


def words_of(text: str) -> list[str]:
    """Return the words of a ``.subckt`` or X line, ``name=value`` as one; the word ``params:`` is left out."""
    joined = "=".join(piece.strip() for piece in text.split("="))
    return [word for word in joined.split() if word.lower() != "params:"]


def short(text: str) -> str:
    """Return the start of a line, as a message shows it."""
    return repr(text if len(text) <= 40 else text[:37] + "...")
