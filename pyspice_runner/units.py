# SPDX-License-Identifier: GPL-3.0-or-later
"""Units: the unit in which a name ends, and values written with the prefix of their unit."""

from __future__ import annotations

from math import floor, isfinite, log10

_PREFIXES = {-5: "f", -4: "p", -3: "n", -2: "µ", -1: "m", 0: "", 1: "k", 2: "M", 3: "G"}

_WITHOUT_PREFIX = ("", "rad/s", "°", "%")

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


def engineering(value: float | None, unit: str) -> str:
    """Write a value with four digits and the prefix of its unit; a dash for a value that is not known."""
    if value is None or not isfinite(value):
        return "–"
    if unit in _WITHOUT_PREFIX:
        return f"{value:.4g}\N{NO-BREAK SPACE}{unit}"
    exponent = 0 if value == 0.0 else min(max(floor(log10(abs(value)) / 3), -5), 3)
    return f"{value / 1000.0**exponent:.4g}\N{NO-BREAK SPACE}{_PREFIXES[exponent]}{unit}"
