# SPDX-License-Identifier: GPL-3.0-or-later
"""A contact law of the user's own: a file with one subcircuit that has the pins of the built-in laws.

The file comes from outside and its text goes into netlists, so that only circuit elements are taken from it: no control
language, no files, no code models. ``docs/tutorial_contact_law.md`` shows how to write one.
"""

from __future__ import annotations

import re
from pathlib import Path

from pyspice_runner.errors import ParameterError
from pyspice_runner.netlist.library import (
    LAW,
    PREFIX,
    Library,
    LibraryParameter,
    Pin,
    header_parameters,
    library_names,
    number,
)

ENDING = ".lib"
PINS = ("x", "y", "vx", "vy", "fx", "fy", "shaft", "normal", "friction", "slider", "state")
#: parameters that the motor sets in every law: they place the contact at its preload
REQUIRED = ("normal_stiffness", "mu", "radius", "preload", "deflection")
NAME = f"{PREFIX}{LAW}"  # of the subcircuit in a netlist; the file may use another name
_MOST_BYTES = 1 << 18
_ELEMENTS = "RLCVIEFGHBDKSX"  # first letters; A and N, which may run code, and the rest are left out
_FORBIDDEN = {
    r"file|[`\"\\]": "a law reads no files and needs no quotes",
    r"\bic\s*=": "remove ic=; a run starts with no voltage there",
}
_FUNCTIONS = frozenset(["abs", "atan", "cos", "cosh", "exp", "log", "max", "min", "sin", "sinh", "sqrt", "tan", "tanh"])


def read_own_law(path: str) -> Library:
    """Read a contact law from a file.

    Args:
        path: the file, which ends in ``.lib`` and holds one ``.subckt`` with the pins :data:`PINS`.

    Raises:
        ParameterError: for a file that cannot be read or used; the message names the line.
    """
    file = Path(path)
    try:
        if not file.is_file():
            raise ParameterError(f"The contact law {path!r} is not a file. Give the path of a {ENDING} file.")
        with file.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ParameterError(f"The contact law {path!r} cannot be read: {error}.") from None
    if len(data) > _MOST_BYTES:
        raise ParameterError(f"The contact law {path!r} is larger than {_MOST_BYTES >> 10} KiB. Shorten it.")
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ParameterError(f"{path}, line {line}: only ASCII characters are allowed; write um for µm.") from None
    return _Reader(path, text).library()


class _Reader:
    """Reads the text of one law."""

    def __init__(self, path: str, text: str) -> None:
        self._path = path
        self._text = text.replace("\r\n", "\n")
        self._lines = self._joined()

    def library(self) -> Library:
        """Return the law as a library whose subcircuit is called :data:`NAME`."""
        (begin, first), *body, (end, last) = self._subcircuit()
        words = re.sub(r"\s*=\s*", "=", first).split()
        name, pins = words[1].lower(), [word.lower() for word in words[2:] if "=" not in word]
        if tuple(pins) != PINS:
            raise self._error(begin, f"the pins are {' '.join(pins) or 'missing'}; they must be {' '.join(PINS)}")
        if last.split()[1:] and last.split()[1].lower() != name:
            raise self._error(end, f"{_short(last)} does not end .subckt {words[1]}")
        needs = self._needs()
        parameters = self._parameters(begin, [word for word in words[2:] if "=" in word])
        known = {parameter.name for parameter in parameters}
        for number_of, line in body:
            known |= self._check(number_of, line, known, needs)
        values = " ".join(f"{parameter.name}={parameter.default!r}" for parameter in parameters)
        lines = [f".subckt {NAME} {' '.join(PINS)} {values}", *(line for _, line in body), f".ends {NAME}"]
        title = re.search(rf"^\* {re.escape(words[1])}: (.+)$", self._text, re.M | re.I)
        return Library(
            name=NAME,
            title=title.group(1) if title else f"contact law {words[1]}",
            pins=tuple(Pin(pin, "", "", "") for pin in PINS),
            parameters=parameters,
            source=self._fact("SOURCE", "not stated"),
            omits=self._fact("OMITS", "what the user's own contact law leaves out"),
            revision=self._fact("REVISION", "not stated"),
            step=self._fact("STEP", "not stated"),
            tested_with=self._fact("TESTED WITH", "not stated"),
            usage="",
            subcircuit="\n".join(lines),
            text=self._text,
            needs=needs,
        )

    def _joined(self) -> list[tuple[int, str]]:
        """Return what a simulator reads, each continued line joined to the line before, with line numbers."""
        lines: list[tuple[int, str]] = []
        for count, raw in enumerate(self._text.split("\n"), start=1):
            if re.search(r"[^\x20-\x7e\t]", raw):
                raise self._error(count, "there is a control character")
            line = re.sub(r"\s*;.*$|\s+\$ .*$", "", raw).replace("\t", " ").strip()
            line = re.sub(r"\s+ic=\{start\}$", "", line)  # of a copied built-in law: its start comes by .ic here
            if not line or line.startswith(("*", "$", "#")):
                continue
            if line.startswith("+"):
                if not lines:
                    raise self._error(count, "a continued line needs a line before it")
                lines[-1] = (lines[-1][0], f"{lines[-1][1]} {line[1:].strip()}")
            else:
                lines.append((count, line))
        return lines

    def _subcircuit(self) -> list[tuple[int, str]]:
        """Return the lines from ``.subckt`` to ``.ends``; there is nothing else in the file."""
        begins = [index for index, (_, line) in enumerate(self._lines) if re.match(r"\.subckt\s+\S", line, re.I)]
        ends = [index for index, (_, line) in enumerate(self._lines) if re.match(r"\.ends\b", line, re.I)]
        if len(begins) != 1 or len(ends) != 1 or ends[0] < begins[0]:
            raise ParameterError(
                f"{self._path} must hold one subcircuit, from .subckt NAME {' '.join(PINS)} to .ends; "
                f"it has {len(begins)} .subckt and {len(ends)} .ends."
            )
        for count, line in (*self._lines[: begins[0]], *self._lines[ends[0] + 1 :]):
            raise self._error(count, f"{_short(line)} is outside of the subcircuit; remove it")
        return self._lines

    def _needs(self) -> tuple[str, ...]:
        names = tuple(name for line in re.findall(r"^\* NEEDS +(.+)$", self._text, re.M) for name in line.split())
        for name in names:
            if name not in library_names():
                raise ParameterError(
                    f"{self._path}: NEEDS names {name!r}, which is not in behavioral/. Usually it is {PREFIX}_normal."
                )
        return names

    def _parameters(self, line: int, words: list[str]) -> tuple[LibraryParameter, ...]:
        """Return the parameters of the ``.subckt`` line, with what PAR lines say of them."""
        stated = header_parameters(self._path, self._text)
        found = []
        for word in words:
            name, _, value = word.partition("=")
            name = name.lower()
            if not re.fullmatch(r"[a-z]\w*", name):
                raise self._error(line, f"{name!r} cannot be the name of a parameter")
            try:
                default = number(value)
            except ParameterError as error:
                raise self._error(line, f"parameter {name}: {error}") from None
            if name in stated and stated[name].default != default:
                raise self._error(line, f"{name} is {value} here and {stated[name].default:g} in its PAR line")
            plain = LibraryParameter(name, "1", default, -1e30, 1e30, "parameter of the user's own contact law")
            found.append(stated.pop(name, plain))
        if stated:
            raise ParameterError(f"{self._path}: {', '.join(stated)} has a PAR line, but .subckt does not have it.")
        names = [parameter.name for parameter in found]
        missing = [name for name in REQUIRED if name not in names]
        if missing:
            raise self._error(line, f"the parameters {', '.join(missing)} are missing; the motor sets them")
        taken = [name for name in names if name in ("friction", "inertia", "bearing") or names.count(name) > 1]
        if taken:
            raise self._error(line, f"a parameter cannot be called {taken[0]}, since another one is; rename it")
        return tuple(found)

    def _check_text(self, line: int, text: str, known: set[str]) -> None:
        """Check what holds for every line: no files, and expressions of known parameters."""
        for pattern, why in _FORBIDDEN.items():
            if re.search(pattern, text, re.I):
                raise self._error(line, f"{_short(text)} is not allowed: {why}")
        for expression in re.findall(r"\{([^}]*)\}", text):
            for name in re.findall(r"(?<![\w.])[a-z_]\w*", expression.lower()):
                if name not in known and name not in _FUNCTIONS:
                    raise self._error(line, f"the expression reads {name}, which is not a parameter of the law")

    def _check(self, line: int, text: str, known: set[str], needs: tuple[str, ...]) -> set[str]:
        """Check one line of the subcircuit and return the parameter that it defines, if any."""
        self._check_text(line, text, known)
        if text.startswith("."):
            match = re.match(r"\.param\s+([a-z]\w*)\s*=", text, re.I)
            if not match and not re.match(r"\.model\s+\w+\s+(d|sw|csw)\b", text, re.I):
                raise self._error(line, f"{_short(text)} is not allowed: only .param, and .model of type D, SW or CSW")
            return {match.group(1).lower()} if match else set()
        if text[0].upper() not in _ELEMENTS:
            raise self._error(line, f"{_short(text)} is not allowed: elements begin with one of {_ELEMENTS}")
        if text[0].upper() == "X":
            words = re.sub(r"\s*=\s*", "=", text).split()
            part = next(word for word in reversed(words) if "=" not in word)
            if part not in needs:
                raise self._error(line, f"{part} is not in the file; name it in a line '* NEEDS {PREFIX}_normal'")
        return set()

    def _fact(self, key: str, otherwise: str) -> str:
        match = re.search(rf"^\* {key} +(.+)$", self._text, re.M)
        return match.group(1).strip() if match else otherwise

    def _error(self, line: int, what: str) -> ParameterError:
        return ParameterError(f"{self._path}, line {line}: {what}.")


def _short(text: str) -> str:
    """Return the start of a line, as a message shows it."""
    return repr(text if len(text) <= 40 else text[:37] + "...")
