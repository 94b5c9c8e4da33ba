# SPDX-License-Identifier: GPL-3.0-or-later
"""A contact law of the user's own: a file with one subcircuit with the pins of the built-in laws.

``docs/tutorial_contact_law.md`` shows how to write one; :mod:`.own_file` reads it.
"""

from __future__ import annotations

import re

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.document import read_bytes
from pyspice_runner.spice.library import LAW, PREFIX, Library
from pyspice_runner.spice.own_file import OwnFile, Rules, Statement, short, words_of

ENDING = ".lib"
PINS = ("x", "y", "vx", "vy", "fx", "fy", "shaft", "normal", "friction", "slider", "state")
#: parameters that the motor sets in every law, to start the contact at its preload
REQUIRED = ("normal_stiffness", "mu", "radius", "preload", "deflection")
NAME = f"{PREFIX}{LAW}"  # of the subcircuit in a netlist; the file may use another name
_MOST_BYTES = 1 << 18
_RULES = Rules("law", forbidden={r"\bic\s*=": "remove ic=; a run starts with no voltage there"})


def read_own_law(path: str) -> Library:
    """Read a contact law from a ``.lib`` file that holds one ``.subckt`` with the pins :data:`PINS`.

    Raise ParameterError for a file that cannot be read or used; the message names the line.
    """
    data = read_bytes(path, "contact law", _MOST_BYTES)
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ParameterError(f"{path}, line {line}: only ASCII characters are allowed; write um for µm.") from None
    return _Law(path, text, _RULES).library()


class _Law(OwnFile):
    """Reader of one law."""

    def library(self) -> Library:
        """Return the law as a library with the subcircuit :data:`NAME`."""
        (begin, first), *body, (end, last) = self._subcircuit()
        words = words_of(first)
        name, pins = words[1].lower(), [word.lower() for word in words[2:] if "=" not in word]
        if tuple(pins) != PINS:
            self._fail(begin, f"the pins are {' '.join(pins) or 'missing'}; they must be {' '.join(PINS)}")
        if last.split()[1:] and last.split()[1].lower() != name:
            self._fail(end, f"{short(last)} does not end .subckt {words[1]}")
        needs = self._needs()
        parameters = self._parameters(begin, [word for word in words[2:] if "=" in word])
        known = {parameter.name for parameter in parameters}
        missing = [name for name in REQUIRED if name not in known]
        if missing:
            self._fail(begin, f"the parameters {', '.join(missing)} are missing; the motor sets them")
        for taken in ("friction", "inertia", "bearing"):
            if taken in known:
                self._fail(begin, f"a parameter cannot be called {taken}, since another one is; rename it")
        for line, text in body:
            known |= self._check(line, text, known, needs)
        values = " ".join(f"{parameter.name}={parameter.default!r}" for parameter in parameters)
        lines = [f".subckt {NAME} {' '.join(PINS)} {values}", *(text for _, text in body), f".ends {NAME}"]
        return self._library(NAME, words[1], PINS, parameters, "\n".join(lines), needs)

    def _subcircuit(self) -> list[Statement]:
        """Return the lines from ``.subckt`` to ``.ends``, the only ones in the file."""
        lines = self._statements
        begins = [index for index, (_, line) in enumerate(lines) if re.match(r"\.subckt\s+\S", line, re.I)]
        ends = [index for index, (_, line) in enumerate(lines) if re.match(r"\.ends\b", line, re.I)]
        if len(begins) != 1 or len(ends) != 1 or ends[0] < begins[0]:
            raise ParameterError(
                f"{self._path} must hold one subcircuit, from .subckt NAME {' '.join(PINS)} to .ends; "
                f"it has {len(begins)} .subckt and {len(ends)} .ends."
            )
        for count, line in (*lines[: begins[0]], *lines[ends[0] + 1 :]):
            self._fail(count, f"{short(line)} is outside of the subcircuit; remove it")
        return lines
