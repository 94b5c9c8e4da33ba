# SPDX-License-Identifier: GPL-3.0-or-later
"""The fault of a netlist that ngspice ignores: the status is 0, the log has no complaint, and the result is wrong.

Measured with ngspice 39: an unknown parameter on the line of a subcircuit's instance. The netlist is checked for
it before ngspice runs.
"""

from __future__ import annotations

import re

# what is taken out of a netlist in lower case, in this order
_READING = (
    re.compile(r"^[^\S\n]*[*$].*\n?", re.M),  # comments
    re.compile(r"(?:;|\s\$\s|//).*"),
    re.compile(r"^[^\S\n]*\.control.*?(?:^[^\S\n]*\.endc.*?$|\Z)", re.M | re.S),
)
_QUOTED = re.compile(r"'[^'\n]*'|\"[^\"\n]*\"")
_BRACE = re.compile(r"([{}])")
_EQUALS = re.compile(r"[^\S\n]*=[^\S\n]*")


def _statements(deck: str) -> list[str]:
    """Return the lines ``.subckt`` and the instances that ngspice reads, with continuations joined.

    They are in lower case; expressions in braces or quotes are replaced by 0.
    """
    text = deck.lower().partition("\n")[2]
    for pattern in _READING:
        text = pattern.sub("", text)
    text = "\n".join(filter(None, map(str.strip, text.split("\n")))).replace("\n+", " ")
    lines = _QUOTED.sub("0", text).split("\n")
    return [_EQUALS.sub("=", _without_braces(line)) for line in lines if line.startswith((".subckt", "x"))]


def _without_braces(line: str) -> str:
    """Return a line with 0 for each outermost pair of braces; one that is not closed ends with the line."""
    kept, depth = [], 0
    for part in _BRACE.split(line):
        if part == "{":
            kept.append("" if depth else "0")
            depth += 1
        elif part == "}" and depth:
            depth -= 1
        elif not depth:
            kept.append(part)
    return "".join(kept)


def _names(words: list[str]) -> list[str]:
    """Return the names of ``name=value`` among words."""
    return [word.partition("=")[0] for word in words if "=" in word]


def silent_fault(deck: str) -> str | None:
    """Return the first fault in a netlist that ngspice would ignore, as one sentence, or ``None``."""
    lines = _statements(deck)
    known: dict[str, set[str]] = {}
    for line in lines:
        if line.startswith(".subckt"):
            words = line.split()
            known.setdefault(words[1] if len(words) > 1 else "", {"m"}).update(_names(words))  # m multiplies any one
    for line in lines:
        if not line.startswith("x"):
            continue
        words = line.split()
        subcircuit = next((word for word in reversed(words) if "=" not in word and word != "params:"), "")
        for name in _names(words) if subcircuit in known else ():
            if name not in known[subcircuit]:
                has = ", ".join(sorted(known[subcircuit] - {"m"})) or "none"
                return (
                    f"Subcircuit {subcircuit} has no parameter {name}, and ngspice would ignore it without a message "
                    f"on the line of {words[0]}; it has {has}."
                )
    return None
