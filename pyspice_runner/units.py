# SPDX-License-Identifier: GPL-3.0-or-later
"""Units: the unit in which a name ends, and values written with the prefix of their unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import floor, isfinite, log10
from typing import Any

_PREFIXES = {-5: "f", -4: "p", -3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}

_WITHOUT_PREFIX = ("", "rad/s", "°", "°C", "%")

# The group of a motor stands before the unit: current_a_a is the current of group A in ampere.
_UNITS = {
    "_n_m_s": "N·m·s", "_rad_s": "rad/s", "_n_m": "N·m", "_m_s": "m/s", "_v_per_s": "V/s", "_deg": "°", "_hz": "Hz",
    "_ohm": "Ω", "_var": "var", "_va": "VA", "_kg": "kg", "_pa": "Pa", "_k": "K", "_f": "F", "_h": "H", "_s": "s",
    "_v": "V", "_a": "A", "_w": "W", "_n": "N", "_m": "m", "_j": "J",
}  # fmt: skip


def unit_in(name: str) -> str:
    """Return the unit in which a name ends, ``"1"`` for a name without one."""
    if "_per_" in name and not name.endswith("_v_per_s"):
        return "1"
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), "1")


# A slider is computed as a rotor of radius 1 m: the values of its rotary and linear quantities are equal.
_LINEAR_UNITS = {
    "rad/s": "m/s", "rad": "m", "N·m·s": "N·s/m", "N·m": "N", "N.m.s": "N.s/m", "N.m": "N", "kg.m2": "kg",
    "N.m/rad": "N/m",
}  # fmt: skip
_LINEAR_WORDS = {
    "torque": "force", "Torque": "Force", "rotor": "slider", "Rotor": "Slider", "moment of inertia": "mass",
    "viscous bearing": "viscous guide", "of the bearing": "of the guide",
}  # fmt: skip
_WORDS = re.compile(  # whole units, and words that are not in a dotted path
    r"N[·.]m[·.]s|N[·.]m(?!\w)|rad/s|\brad\b|kg\.m2"
    r"|(?<![\w.])(?:torque|Torque|rotor|Rotor|moment of inertia|viscous bearing|of the bearing)(?!\.\w)"
)
_LINEAR_ENDS = {"_rad_s": "_m_s", "_n_m": "_n", "_rad": "_m"}


def linear_unit(unit: str) -> str:
    """Return the unit of a quantity of a slider, for that of a rotor."""
    return _LINEAR_UNITS.get(unit, unit)


def linear_words(text: str) -> str:
    """Return a text about a rotor, its values with units among it, as it reads for a slider."""
    return _WORDS.sub(lambda found: (_LINEAR_UNITS | _LINEAR_WORDS)[found[0]], text)


def linear_name(name: str) -> str:
    """Return the name of a quantity of a slider, for that of a rotor: ``force_n`` for ``torque_n_m``.

    An empty text for a quantity that is not of the rotor. Of a mean the name has no ``mean_``.
    """
    end = next((end for end in _LINEAR_ENDS if name.endswith(end)), None)
    if end is None:
        return ""
    start = name.removesuffix(end).removeprefix("mean_").replace("rotor_", "").replace("torque", "force")
    return start + _LINEAR_ENDS[end]


def with_linear(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document, and the tables in it, with the quantities of a slider beside those of its rotor."""
    found: dict[str, Any] = {}
    for name, value in document.items():
        found[name] = value = with_linear(value) if isinstance(value, Mapping) else value
        beside = linear_name(name)
        if beside and beside not in document:
            found[beside] = value
    return found


def engineering(value: float | None, unit: str) -> str:
    """Write a value with four digits and the prefix of its unit; a dash for a value that is not known."""
    if value is None or not isfinite(value):
        return "–"
    if unit in _WITHOUT_PREFIX:
        return f"{value:.4g}\N{NO-BREAK SPACE}{unit}".rstrip()
    exponent = 0 if abs(value) < 1e-16 else min(max(floor(log10(abs(value)) / 3), -5), 3)
    return f"{value / 1000.0**exponent:.4g}\N{NO-BREAK SPACE}{_PREFIXES[exponent]}{unit}"
