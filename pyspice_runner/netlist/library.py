# SPDX-License-Identifier: GPL-3.0-or-later
"""The subcircuits of ``behavioral/`` and their headers.

This module reads the header of a library: ``PIN`` lines (name, direction, unit, meaning) in the order of the
``.subckt`` line, ``PAR`` lines (name, unit, default, least, greatest, meaning), ``SOURCE``, ``OMITS``,
``REVISION`` (of pins, parameters and results), ``STEP`` (the coarsest time step at which the results are right),
``TESTED WITH``, and a usage example between ``USE`` and ``END USE``. ``NEEDS`` names other libraries whose subcircuits
it instantiates. Where a part dissipates, feeds or stores energy, ``LOSS``, ``FEED`` and ``STORE`` lines (name, meaning)
name its inner nodes ``loss_NAME`` and ``feed_NAME``, 1 V = 1 W, and ``store_NAME``, 1 V = 1 uJ.
``behavioral/CONVENTIONS.md`` explains them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from math import inf, isfinite
from pathlib import Path

from pyspice_runner.errors import ParameterError

ASSEMBLED = "piezomotor_averaged"  # a library of behavioral/ that the package writes from the parts
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
    needs: tuple[str, ...] = ()

    @property
    def pin_names(self) -> tuple[str, ...]:
        """Names of the pins, in their order."""
        return tuple(pin.name for pin in self.pins)

    def check(self, **values: float) -> dict[str, float]:
        """Return the values if each is a known parameter within its range.

        ngspice ignores an unknown parameter of a subcircuit without a message, so it is an error here.

        Raises:
            ParameterError: otherwise.
        """
        check_parameters(self.name, self.parameters, values)
        return values


def check_parameters(name: str, parameters: Sequence[LibraryParameter], values: Mapping[str, float | str]) -> None:
    """Check the parameters of an instance; of a text, which is an expression, only the name of the parameter.

    Raises:
        ParameterError: for an unknown parameter or a number out of range.
    """
    known = {parameter.name: parameter for parameter in parameters}
    for key, value in values.items():
        if key not in known:
            raise ParameterError(f"Subcircuit {name} has no parameter {key!r}; it has {', '.join(known)}.")
        parameter = known[key]
        if not isinstance(value, str) and not parameter.least <= value <= parameter.greatest:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            raise ParameterError(
                f"Subcircuit {name}: {key} = {value:g}{unit} is not valid: "
                f"it must be {parameter.least:g} to {parameter.greatest:g}{unit}."
            )


def check_name(name: str) -> str:
    """Return the name of a subcircuit if every SPICE accepts it and no part of another export can have it.

    Raises:
        ParameterError: otherwise.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,39}", name):
        raise ParameterError(
            f"name = {name!r} is not valid: it must be at most 40 letters, digits and _, the first a letter."
        )
    suffixes = {part.removeprefix(PREFIX) for part in library_names() if part.startswith(f"{PREFIX}_")} | {LAW}
    taken = next((suffix for suffix in sorted(suffixes) if name.lower().endswith(suffix)), "")
    if taken and name != f"{PREFIX}_thermal":
        raise ParameterError(
            f"name = {name!r} ends in {taken!r}, like a part of the motor {name[: -len(taken)]!r} would. "
            "Choose another ending."
        )
    return name


def data_path(folder: str) -> Path:
    """Return the folder ``behavioral`` or ``netlists``: inside an installed package, or in the source tree."""
    package = Path(__file__).resolve().parents[1]
    for candidate in (package / "_data" / folder, package.parent / folder):
        if candidate.is_dir():
            return candidate
    raise ParameterError(f"The folder {folder} is missing beside the package; install pyspice-runner again.")


@cache
def read_library(name: str) -> Library:
    """Read ``behavioral/NAME.lib``.

    Raises:
        ParameterError: if there is no such library, or its header and its ``.subckt`` line disagree.
    """
    if name not in library_names():
        names = ", ".join(library_names())
        raise ParameterError(f"There is no library {name!r} in behavioral/; there are {names}.")
    return parse_library(name, (data_path("behavioral") / f"{name}.lib").read_text(encoding="utf-8"))


@cache
def library_names() -> tuple[str, ...]:
    """Return the names of all parts in ``behavioral/``; :data:`ASSEMBLED` is none."""
    return tuple(sorted(path.stem for path in data_path("behavioral").glob("*.lib") if path.stem != ASSEMBLED))


def parse_library(name: str, text: str) -> Library:
    """Read the header of a library and compare it with its ``.subckt`` line.

    Raises:
        ParameterError: with what is missing or different.
    """
    pins = tuple(Pin(*match) for match in re.findall(r"^\* PIN +(\S+) +(\S+) +(\S+) +(.+)$", text, re.M))
    where = f"behavioral/{name}.lib"
    parameters = tuple(
        _parameter(where, *match)
        for match in re.findall(r"^\* PAR +(\S+) +(\S+) +(\S+) +(\S+) +(\S+) +(.+)$", text, re.M)
    )
    title = re.search(rf"^\* {re.escape(name)}: (.+)$", text, re.M)
    subcircuit = re.search(rf"^\.subckt {re.escape(name)} (.+)$", text, re.M)
    end = re.compile(rf"^\.ends {re.escape(name)}$", re.M).search(text, subcircuit.end() if subcircuit else 0)
    usage = re.search(r"^\* USE\b[^\n]*\n(.*?)^\* END USE$", text, re.M | re.S)
    facts = {
        key: re.search(rf"^\* {key} +(.+)$", text, re.M)
        for key in ("SOURCE", "OMITS", "REVISION", "STEP", "TESTED WITH")
    }
    missing = [
        key
        for key, match in {"title": title, ".subckt": subcircuit and end, "USE": usage, **facts}.items()
        if not match
    ]
    if missing:
        raise ParameterError(f"behavioral/{name}.lib lacks {', '.join(missing)}; see behavioral/CONVENTIONS.md.")
    assert title is not None
    assert subcircuit is not None
    assert end is not None
    assert usage is not None
    words = subcircuit.group(1).split()
    declared = [word for word in words if "=" not in word]
    defaults = [
        (key, _number_in(where, key, value)) for key, _, value in (word.partition("=") for word in words if "=" in word)
    ]
    if declared != [pin.name for pin in pins]:
        raise ParameterError(
            f"behavioral/{name}.lib: the PIN lines and the pins of .subckt differ; make them the same."
        )
    if defaults != [(parameter.name, parameter.default) for parameter in parameters]:
        raise ParameterError(
            f"behavioral/{name}.lib: the PAR lines and the parameters of .subckt differ; make them the same."
        )
    return Library(
        name=name,
        title=title.group(1),
        pins=pins,
        parameters=parameters,
        source=facts["SOURCE"].group(1),  # type: ignore[union-attr]
        omits=facts["OMITS"].group(1),  # type: ignore[union-attr]
        revision=facts["REVISION"].group(1),  # type: ignore[union-attr]
        step=facts["STEP"].group(1),  # type: ignore[union-attr]
        tested_with=facts["TESTED WITH"].group(1),  # type: ignore[union-attr]
        usage=re.sub(r"^\*(   ?)?", "", usage.group(1), flags=re.M),
        subcircuit=text[subcircuit.start() : end.end()],
        text=text,
        losses=_powers("LOSS", text),
        feeds=_powers("FEED", text),
        stores=_powers("STORE", text),
        needs=tuple(name for line in re.findall(r"^\* NEEDS +(.+)$", text, re.M) for name in line.split()),
    )


def definitions(*libraries: Library, prefix: str = PREFIX) -> str:
    """Return the subcircuits of libraries and of those that they need, each once, for a netlist.

    Args:
        libraries: the libraries.
        prefix: first part of the names of a motor's parts instead of ``piezomotor``: two motors in one netlist
            then have no common name.
    """
    wanted: dict[str, Library] = {}

    def add(library: Library) -> None:
        for name in library.needs:
            add(read_library(name))
        wanted.setdefault(library.name, library)

    for library in libraries:
        add(library)
    text = "\n".join(library.subcircuit for library in wanted.values())
    names = "|".join(re.escape(name) for name in wanted)
    return re.sub(rf"\b({names})\b", lambda match: part_name(match.group(), prefix), text)


def part_name(name: str, prefix: str = PREFIX) -> str:
    """Return the name of a library's subcircuit in a netlist whose motor's parts begin with ``prefix``."""
    return re.sub(rf"^{PREFIX}_", f"{prefix}_", name)


def header_parameters(where: str, text: str) -> dict[str, LibraryParameter]:
    """Return the parameters of the ``PAR`` lines of a header, by name.

    Raises:
        ParameterError: naming ``where``, for an invalid number or a default out of its range.
    """
    found = re.findall(r"^\* PAR +(\S+) +(\S+) +(\S+) +(\S+) +(\S+) +(.+)$", text, re.M)
    return {match[0]: _parameter(where, *match) for match in found}


def _powers(keyword: str, text: str) -> tuple[tuple[str, str], ...]:
    """Return name and meaning of every ``LOSS``, ``FEED`` or ``STORE`` line."""
    return tuple((name, meaning) for name, meaning in re.findall(rf"^\* {keyword} +(\S+) +(.+)$", text, re.M))


def _parameter(
    where: str, key: str, unit: str, default: str, least: str, greatest: str, meaning: str
) -> LibraryParameter:
    value, low, high = (_number_in(where, key, text) for text in (default, least, greatest))
    if not low <= value <= high:
        raise ParameterError(f"{where}: the default of {key} is outside its range; correct its PAR.")
    return LibraryParameter(key, unit, value, low, high, meaning)


def _number_in(where: str, key: str, text: str) -> float:
    try:
        return number(text)
    except ParameterError as error:
        raise ParameterError(f"{where}, parameter {key}: {error}") from None


def number(text: str) -> float:
    """Read a SPICE number with its suffix (``50n``, ``1meg``).

    Raises:
        ParameterError: for any other text.
    """
    match = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(t|g|meg|k|m|u|n|p|f)?", text.lower(), re.A)
    try:  # by decimal arithmetic, so that 40n is exactly 4e-8
        value = float(Decimal(match.group(1)).scaleb(_EXPONENTS[match.group(2) or ""])) if match else inf
    except ArithmeticError:
        value = inf
    if not isfinite(value):
        raise ParameterError(f"{text!r} is not a SPICE number.")
    return value
