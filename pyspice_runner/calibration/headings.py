# SPDX-License-Identifier: GPL-3.0-or-later
"""Headings of published speed–force tables: ``Speed (mm/s)``, ``Force [mN]``, ``Torque / mN·m``, ``n (rpm)``."""

from __future__ import annotations

import re
from math import pi, sqrt

_HEADING = re.compile(r"\s*([A-Za-z][A-Za-z .]*?)\s*(?:\[([^\]]+)\]|\(([^)]+)\)|/\s*(\S.*?))\s*")
_G = 9.80665  # m/s², standard gravity: weights are stated in grams
_LINEAR = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6}
_ROTARY = {
    "rad/s": 1.0,
    "rpm": pi / 30.0,
    "1/min": pi / 30.0,
    "r/min": pi / 30.0,
    "deg/s": pi / 180.0,
    "°/s": pi / 180.0,
}
_FORCE = {"n": 1.0, "mn": 1e-3, "kgf": _G, "kg": _G, "gf": 1e-3 * _G, "g": 1e-3 * _G}
_TORQUE = {"nm": 1.0, "mnm": 1e-3, "unm": 1e-6, "ncm": 1e-2, "nmm": 1e-3, "kgfcm": 1e-2 * _G, "gfcm": 1e-5 * _G}
_FREQUENCY = {"hz": 1.0, "khz": 1e3}
_ANGLE = {"deg": 1.0, "°": 1.0, "rad": 180.0 / pi}
_KINDS: dict[str, tuple[tuple[str, dict[str, float]], ...]] = {  # words → columns, each with its units
    "speed": (("speed_m_s", _LINEAR), ("speed_rad_s", _ROTARY)),
    "force": (("force_n", _FORCE),),
    "torque": (("torque_n_m", _TORQUE),),
    "load": (("force_n", _FORCE), ("torque_n_m", _TORQUE)),
    "frequency": (("frequency", _FREQUENCY),),
    "voltage": (("voltage", {"v": 1.0, "vp": 1.0, "vpp": 0.5, "vrms": sqrt(2.0)}),),
    "power": (("power_w", {"w": 1.0, "mw": 1e-3}),),
    "resonance": (("resonance_hz", _FREQUENCY),),
    "temperature": (("temperature", {"°c": 1.0, "c": 1.0, "degc": 1.0}),),
    "current phase": (("current_a_phase_deg", _ANGLE),),
    "current phase a": (("current_a_phase_deg", _ANGLE),),
    "current phase b": (("current_b_phase_deg", _ANGLE),),
}
_WORDS = {
    "velocity": "speed",
    "n": "speed",
    "v": "speed",
    "f": "force",
    "thrust": "force",
    "m": "torque",
    "t": "torque",
}


def column_of(heading: str) -> tuple[str, float] | None:
    """Return the column that a heading with a unit means, and the factor to its unit; ``None`` for another heading.

    A voltage is an amplitude; one in ``Vrms`` is that of a sine.
    """
    found = _HEADING.fullmatch(heading)
    if found is None:
        return None
    words = found[1].lower().split()
    unit = (found[2] or found[3] or found[4]).strip().lower()
    unit = re.sub(r"[·*⋅ .-]", "", unit.replace("µ", "u").replace("μ", "u"))
    named = (" ".join(words), words[-1], words[0])
    for word in ("resonance",) if any(word.startswith("resonan") for word in words) else named:
        for column, units in _KINDS.get(_WORDS.get(word, word), ()):
            if unit in units:
                return column, units[unit]
    return None
