# SPDX-License-Identifier: GPL-3.0-or-later
"""The hand-written subcircuits of ``behavioral/``, and what their headers promise.

A library's header is read by machines: ``PIN`` lines (name, direction, unit, meaning) in the order of the
``.subckt`` line, ``PAR`` lines (name, unit, default, least, greatest, meaning), ``SOURCE``, ``OMITS``,
``TESTED WITH``, and a usage example between ``USE`` and ``END USE``. Where a part dissipates, feeds or stores energy,
``LOSS``, ``FEED`` and ``STORE`` lines (name, meaning) tell of its inner nodes ``loss_NAME`` and ``feed_NAME``, 1 V =
1 W, and ``store_NAME``, 1 V = 1 uJ. ``behavioral/CONVENTIONS.md`` explains them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from math import inf, isfinite
from pathlib import Path

from pyspice_runner.errors import ParameterError

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
    """One parameter of a subcircuit, with its default and the closed range it may take."""

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
    tested_with: str
    usage: str
    subcircuit: str
    text: str
    losses: tuple[tuple[str, str], ...] = ()
    feeds: tuple[tuple[str, str], ...] = ()
    stores: tuple[tuple[str, str], ...] = ()

    def check(self, **values: float) -> dict[str, float]:
        """Return the values if every one is a known parameter inside its range.

        ngspice takes an unknown subcircuit parameter without a word, so it is refused here.

        Raises:
            ParameterError: otherwise.
        """
        known = {parameter.name: parameter for parameter in self.parameters}
        for name, value in values.items():
            if name not in known:
                raise ParameterError(f"Subcircuit {self.name} has no parameter {name!r}; it has {', '.join(known)}.")
            parameter = known[name]
            if not parameter.least <= value <= parameter.greatest:
                unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                raise ParameterError(
                    f"Subcircuit {self.name}: {name} = {value:g}{unit} is refused; "
                    f"allowed is {parameter.least:g} to {parameter.greatest:g}{unit}."
                )
        return values


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
    """Return the names of all libraries in ``behavioral/``."""
    return tuple(sorted(path.stem for path in data_path("behavioral").glob("*.lib")))


def parse_library(name: str, text: str) -> Library:
    """Read a library's header and hold it against its ``.subckt`` line.

    Raises:
        ParameterError: naming what is missing or disagrees.
    """
    pins = tuple(Pin(*match) for match in re.findall(r"^\* PIN +(\S+) +(\S+) +(\S+) +(.+)$", text, re.M))
    parameters = tuple(
        _parameter(name, *match)
        for match in re.findall(r"^\* PAR +(\S+) +(\S+) +(\S+) +(\S+) +(\S+) +(.+)$", text, re.M)
    )
    title = re.search(rf"^\* {re.escape(name)}: (.+)$", text, re.M)
    subcircuit = re.search(rf"^\.subckt {re.escape(name)} (.+)$", text, re.M)
    end = re.compile(rf"^\.ends {re.escape(name)}$", re.M).search(text, subcircuit.end() if subcircuit else 0)
    usage = re.search(r"^\* USE$\n(.*?)^\* END USE$", text, re.M | re.S)
    facts = {key: re.search(rf"^\* {key} +(.+)$", text, re.M) for key in ("SOURCE", "OMITS", "TESTED WITH")}
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
        (key, _number_in(name, key, value)) for key, _, value in (word.partition("=") for word in words if "=" in word)
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
        tested_with=facts["TESTED WITH"].group(1),  # type: ignore[union-attr]
        usage=re.sub(r"^\*(   ?)?", "", usage.group(1), flags=re.M),
        subcircuit=text[subcircuit.start() : end.end()],
        text=text,
        losses=_powers("LOSS", text),
        feeds=_powers("FEED", text),
        stores=_powers("STORE", text),
    )


def _powers(keyword: str, text: str) -> tuple[tuple[str, str], ...]:
    """Return name and meaning of every ``LOSS``, ``FEED`` or ``STORE`` line."""
    return tuple((name, meaning) for name, meaning in re.findall(rf"^\* {keyword} +(\S+) +(.+)$", text, re.M))


def _parameter(
    library: str, key: str, unit: str, default: str, least: str, greatest: str, meaning: str
) -> LibraryParameter:
    value, low, high = (_number_in(library, key, text) for text in (default, least, greatest))
    if not low <= value <= high:
        raise ParameterError(f"behavioral/{library}.lib: the default of {key} lies outside its range; mend its PAR.")
    return LibraryParameter(key, unit, value, low, high, meaning)


def _number_in(library: str, key: str, text: str) -> float:
    try:
        return number(text)
    except ParameterError as error:
        raise ParameterError(f"behavioral/{library}.lib, parameter {key}: {error}") from None


def number(text: str) -> float:
    """Read a SPICE number with its suffix (``50n``, ``1meg``).

    Raises:
        ParameterError: for any other text.
    """
    match = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(t|g|meg|k|m|u|n|p|f)?", text.lower(), re.A)
    try:  # in decimals, so that 40n is 4e-8 to the last digit
        value = float(Decimal(match.group(1)).scaleb(_EXPONENTS[match.group(2) or ""])) if match else inf
    except ArithmeticError:
        value = inf
    if not isfinite(value):
        raise ParameterError(f"{text!r} is not a SPICE number.")
    return value
