# SPDX-License-Identifier: GPL-3.0-or-later
"""The subcircuits of ``behavioral/`` and their headers.

This module reads the header of a library: ``PIN`` lines (name, direction, unit, meaning) in the order of the
``.subckt`` line, ``PAR`` lines (name, unit, default, smallest, largest, meaning), ``SOURCE``, ``OMITS``,
``REVISION`` (of pins, parameters and results), ``STEP`` (the coarsest time step at which the results are right),
``TESTED WITH``, and a usage example between ``USE`` and ``END USE``. ``NEEDS`` names other libraries whose subcircuits
it instantiates. A contact law has ``STATE`` (node, unit, meaning), ``SLIDERS``, ``SPRING`` and ``FORMS`` lines.
Where a part dissipates, feeds or stores energy, ``LOSS``, ``FEED`` and ``STORE`` lines (name, meaning)
name its inner nodes ``loss_NAME`` and ``feed_NAME``, 1 V = 1 W, and ``store_NAME``, 1 V = 1 uJ; ``LIMIT`` lines name
``limit_NAME``, 1 while a limit of the part is reached, else 0.
``behavioral/CONVENTIONS.md`` explains them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cache, cached_property
from math import inf, isfinite
from pathlib import Path
from textwrap import dedent
from typing import Any

from pyspice_runner.errors import ParameterError, did_you_mean, located, require
from pyspice_runner.units import linear_words

PREFIX = "piezomotor"  # first part of the names of a motor's parts, and name of the motor
LAW = "_law"  # end of the name of a user's own contact law in a netlist
_EXPONENTS = {"t": 12, "g": 9, "meg": 6, "k": 3, "": 0, "m": -3, "u": -6, "n": -9, "p": -12, "f": -15}


@dataclass(frozen=True)
class Pin:
    """One pin of a subcircuit."""

    name: str
    direction: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class LibraryParameter:
    """One parameter of a subcircuit, with its default and its closed range."""

    name: str
    unit: str
    default: float
    least: float
    greatest: float
    meaning: str


@dataclass(frozen=True)
class Library:
    """One file of ``behavioral/``: a subcircuit, its header and its text."""

    name: str
    title: str
    pins: tuple[Pin, ...]
    parameters: tuple[LibraryParameter, ...]
    source: str
    omits: str
    revision: str
    step: str
    tested_with: str
    usage: str
    subcircuit: str
    text: str
    losses: tuple[tuple[str, str], ...] = ()
    feeds: tuple[tuple[str, str], ...] = ()
    stores: tuple[tuple[str, str], ...] = ()
    limits: tuple[tuple[str, str], ...] = ()
    needs: tuple[str, ...] = ()
    states: tuple[str, ...] = ()  # of a contact law: the nodes whose capacitors hold its state
    sliders: tuple[str, ...] = ()  # those of the states that are sliders
    spring: bool = False  # whether the law has a tangential spring of its own
    forms: frozenset[str] = frozenset()  # in which the law exists, such as "spice" and "verilog-a"

    @property
    def pin_names(self) -> tuple[str, ...]:
        """Names of the pins, in their order."""
        return tuple(pin.name for pin in self.pins)

    @cached_property
    def defaults(self) -> dict[str, float]:
        """Defaults of the parameters, in their order."""
        return {parameter.name: parameter.default for parameter in self.parameters}


def check_parameters(name: str, parameters: Sequence[LibraryParameter], values: Mapping[str, float | str]) -> None:
    """Check names and values of the parameters of an instance. A text is an expression; its value is not checked.

    ngspice ignores an unknown parameter of a subcircuit without a message; here it is an error. Raise ParameterError
    for an unknown parameter or a number out of range.
    """
    known = {parameter.name: parameter for parameter in parameters}
    for key, value in values.items():
        if key not in known:
            raise ParameterError(f"Subcircuit {name} has no parameter {key!r}; it has {', '.join(known)}.")
        parameter = known[key]
        if not isinstance(value, str) and not parameter.least <= value <= parameter.greatest:
            unit = parameter.unit.removesuffix("1")
            allowed = f"{parameter.least:g} to {parameter.greatest:g} {unit}".rstrip()
            require(False, f"Subcircuit {name}: {key}", value, allowed, unit=unit)


def check_name(name: str) -> str:
    """Return a name that every SPICE accepts and no part of another export may have; else raise ParameterError."""
    accepted = re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,39}", name)
    require(accepted, "name", name, "at most 40 letters, digits and _, the first a letter")
    suffixes = {part.removeprefix(PREFIX) for part in library_names() if part.startswith(f"{PREFIX}_")} | {LAW}
    taken = next((suffix for suffix in sorted(suffixes) if name.lower().endswith(suffix)), "")
    if taken and name != f"{PREFIX}_thermal":
        raise ParameterError(
            f"name = {name!r} ends in {taken!r}, like a part of the motor {name[: -len(taken)]!r} would. "
            "Choose another ending."
        )
    return name


def data_path(folder: str) -> Path:
    """Return the folder ``behavioral``, ``netlists`` or ``figures``: in the installed package or the source tree."""
    package = Path(__file__).resolve().parents[1]
    for candidate in (package / "_data" / folder, package.parent / folder):
        if candidate.is_dir():
            return candidate
    raise ParameterError(f"The folder {folder} is missing beside the package; install piezomotor again.")


@cache
def read_library(name: str) -> Library:
    """Read ``behavioral/NAME.lib``. Raise ParameterError if it is missing, or header and ``.subckt`` disagree."""
    if name not in library_names():
        hint = did_you_mean(name, library_names(), "There are")
        raise ParameterError(f"There is no library {name!r} in behavioral/. {hint}")
    return parse_library(name, (data_path("behavioral") / f"{name}.lib").read_text(encoding="utf-8"))


@cache
def library_names() -> tuple[str, ...]:
    """Return the names of all parts in ``behavioral/``."""
    return tuple(sorted(path.stem for path in data_path("behavioral").glob("*.lib")))


def parse_library(name: str, text: str) -> Library:
    """Read a library. Raise ParameterError for a missing entry, or one that differs from the ``.subckt`` line."""
    header = Header(f"behavioral/{name}.lib", text)
    escaped = re.escape(name)
    begin = re.search(rf"^\.subckt {escaped} (.+)$", text, re.M)
    end = re.compile(rf"^\.ends {escaped}$", re.M).search(text, begin.end() if begin else 0)
    usage = re.search(r"^\* USE\b[^\n]*\n(.*?)^\* END USE$", text, re.M | re.S)
    title, facts = header.title(name), header.facts()
    entries = {"title": title, ".subckt": begin and end, "USE": usage}
    entries |= {key: facts.get(field) for field, key in FACTS.items()}
    missing = [key for key, entry in entries.items() if not entry]
    if missing or begin is None or end is None or usage is None:
        raise ParameterError(f"{header.where} lacks {', '.join(missing)}; see behavioral/CONVENTIONS.md.")
    pins, parameters = tuple(Pin(*words) for words in header.entries("PIN", 4)), header.parameters()
    words = begin.group(1).split()
    if [word for word in words if "=" not in word] != [pin.name for pin in pins]:
        raise ParameterError(f"{header.where}: the PIN lines and the pins of .subckt differ; make them the same.")
    assigned = [word.partition("=") for word in words if "=" in word]
    defaults = [(key, header.number(key, value)) for key, _, value in assigned]
    if defaults != [(parameter.name, parameter.default) for parameter in parameters]:
        raise ParameterError(f"{header.where}: the PAR lines and the parameters of .subckt differ; make them the same.")
    return Library(
        name=name,
        title=title,
        pins=pins,
        parameters=parameters,
        usage=dedent("".join(line[1:] for line in usage.group(1).splitlines(keepends=True))),
        subcircuit=text[begin.start() : end.end()],
        text=text,
        needs=header.needs(),
        **facts,
        **header.insides(text[begin.end() : end.start()]),
    )


FACTS = {
    "source": "SOURCE", "omits": "OMITS", "revision": "REVISION", "step": "STEP", "tested_with": "TESTED WITH"
}  # fmt: skip
_POWERS = {"losses": "LOSS", "feeds": "FEED", "stores": "STORE", "limits": "LIMIT"}


@dataclass(frozen=True)
class Header:
    """The comment lines of a library that begin with a keyword."""

    where: str  # name of the file, for messages
    text: str  # text with the comments

    def entries(self, keyword: str, words: int = 1) -> list[tuple[str, ...]]:
        """Return the entries of a keyword: each has this number of words, the last with the rest of the line."""
        columns = " +".join([r"(\S+)"] * (words - 1) + ["(.+)"])
        return [match.groups() for match in re.finditer(rf"^\* {keyword} +{columns}$", self.text, re.M)]

    def title(self, name: str) -> str:
        """Return the text behind ``* NAME:``, or an empty text."""
        match = re.search(rf"^\* {re.escape(name)}: (.+)$", self.text, re.M | re.I)
        return match.group(1) if match else ""

    def facts(self) -> dict[str, Any]:
        """Return the entries of one line, by the fields of :class:`Library`."""
        found = {field: self.entries(key) for field, key in FACTS.items()}
        return {field: lines[0][0].strip() for field, lines in found.items() if lines}

    def needs(self) -> tuple[str, ...]:
        """Return the names on the ``NEEDS`` lines."""
        return tuple(name for (names,) in self.entries("NEEDS") for name in names.split())

    def parameters(self) -> tuple[LibraryParameter, ...]:
        """Return the ``PAR`` lines. Raise ParameterError for an invalid number or a default out of its range."""
        found = []
        for key, unit, *numbers, meaning in self.entries("PAR", 6):
            default, least, greatest = (self.number(key, text) for text in numbers)
            if not least <= default <= greatest:
                raise ParameterError(f"{self.where}: the default of {key} is outside its range; correct its PAR.")
            found.append(LibraryParameter(key, unit, default, least, greatest, meaning))
        return tuple(found)

    def insides(self, body: str) -> dict[str, Any]:
        """Return powers and stores, and what a contact law states about itself, by the fields of :class:`Library`.

        Without ``STATE`` lines the states are the nodes of the capacitors to ground in the ``body`` of the subcircuit;
        without a line ``SPRING`` a law with states has a spring.
        """
        capacitors = re.findall(r"^C\w+ (\w+) 0 ", body, re.M | re.I)
        states = [node for node, _, _ in self.entries("STATE", 3)] or capacitors
        words = {key: " ".join(text for (text,) in self.entries(key)).split() for key in ("SLIDERS", "SPRING", "FORMS")}
        return {
            **{field: tuple(self.entries(keyword, 2)) for field, keyword in _POWERS.items()},
            "states": tuple(map(str.lower, states)),
            "sliders": tuple(words["SLIDERS"]),
            "spring": words["SPRING"][0] == "yes" if words["SPRING"] else bool(states),
            "forms": frozenset(words["FORMS"]),
        }

    def number(self, key: str, text: str) -> float:
        """Return the value of a parameter. Raise ParameterError if it is not a SPICE number."""
        with located(f"{self.where}, parameter {key}"):
            return number(text)


def definitions(*libraries: Library) -> str:
    """Return the subcircuits of libraries and of those that they need, each once, for a netlist."""
    return "\n".join(definition_texts(*libraries).values())


def definition_texts(*libraries: Library, prefix: str = PREFIX) -> dict[str, str]:
    """Return the texts of :func:`definitions` by the names of the subcircuits in the netlist."""
    wanted: dict[str, Library] = {}

    def add(library: Library) -> None:
        for name in library.needs:
            add(read_library(name))
        wanted.setdefault(library.name, library)

    for library in libraries:
        add(library)
    names = re.compile(rf"\b({'|'.join(re.escape(name) for name in wanted)})\b")
    return {
        part_name(name, prefix): names.sub(lambda match: part_name(match.group(), prefix), library.subcircuit)
        for name, library in wanted.items()
    }


def part_name(name: str, prefix: str = PREFIX) -> str:
    """Return the name of a library's subcircuit in a netlist whose motor's parts begin with ``prefix``."""
    return name.replace(PREFIX, prefix, 1) if name.startswith(f"{PREFIX}_") else name


_OF_SLIDER = {
    "radius of the slider": "1 m: a slider is computed as a rotor of this radius",
    "angle of the slider": "position of the slider",
    "angle over which": "travel over which",
    "speed_rad_s": "speed_m_s",
}


def slider_words(text: str) -> str:
    """Return the header of an exported motor as it reads for a slider: 1 V = 1 m/s and 1 A = 1 N at the shaft."""
    text = linear_words(text)
    for rotary, linear in _OF_SLIDER.items():
        text = text.replace(rotary, linear)
    return text


def number(text: str) -> float:
    """Read a SPICE number with its suffix (``50n``, ``1meg``). Raise ParameterError for any other text."""
    match = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(t|g|meg|k|m|u|n|p|f)?", text.lower(), re.A)
    try:  # by decimal arithmetic, so that 40n is exactly 4e-8
        value = float(Decimal(match.group(1)).scaleb(_EXPONENTS[match.group(2) or ""])) if match else inf
    except ArithmeticError:
        value = inf
    if not isfinite(value):
        raise ParameterError(f"{text!r} is not a SPICE number.")
    return value
