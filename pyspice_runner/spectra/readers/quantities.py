# SPDX-License-Identifier: GPL-3.0-or-later
"""What a column's heading says: which quantity, in which unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from math import pi

from pyspice_runner.spectra.readers.text import quote

# quantity → the dimension of its unit; an angle's unit may be missing, the values then tell
DIMENSION = {
    "frequency": "Hz",
    "abs_z": "Ohm",
    "phase_z": "angle",
    "r": "Ohm",  # series resistance, the real part of Z
    "x": "Ohm",
    "rp": "Ohm",  # parallel resistance, 1/G
    "xp": "Ohm",
    "abs_y": "S",
    "phase_y": "angle",
    "phase": "angle",  # of whichever magnitude stands beside it
    "g": "S",
    "b": "S",
    "ls": "H",
    "lp": "H",
    "cs": "F",
    "cp": "F",
    "q": "",
    "d": "",
}

_NAMES = {
    "frequency": "frequency freq f",
    "abs_z": "|z| z abs(z) absz zabs mag(z) magz zmag zmod modz |impedance| impedance impedancemagnitude "
    "magnitudez impedancemag zmagnitude",
    "phase_z": "thetaz phasez zphase argz arg(z) phase(z) impedancephase zphz angle(z) zangle",
    "r": "r rs rseries resistance seriesresistance re(z) rez zre zreal realz z' impedancereal zr",
    "x": "x xs xseries reactance seriesreactance im(z) imz zim zimag imagz z'' impedanceimaginary impedanceimag zi",
    "rp": "rp rparallel parallelresistance",
    "xp": "xp xparallel parallelreactance",
    "abs_y": "|y| y abs(y) absy yabs mag(y) magy ymag mody |admittance| admittance admittancemagnitude "
    "magnitudey admittancemag ymagnitude",
    "phase_y": "thetay phasey yphase argy arg(y) phase(y) admittancephase angle(y) yangle",
    "phase": "phase theta th angle arg phi phaseangle",
    "g": "g gp conductance re(y) rey yre yreal realy y' admittancereal",
    "b": "b bp susceptance im(y) imy yim yimag imagy y'' admittanceimaginary admittanceimag",
    "ls": "ls lseries seriesinductance",
    "lp": "lp lparallel parallelinductance",
    "cs": "cs cseries seriescapacitance",
    "cp": "cp cparallel parallelcapacitance",
    "q": "q qualityfactor",
    "d": "d dissipation dissipationfactor losstangent tandelta",
}
_KIND = {name: kind for kind, names in _NAMES.items() for name in names.split()}
_BY_UNIT = {  # names that say nothing without their unit
    name: dict(zip(("Ohm", "S"), kinds, strict=True))
    for names, kinds in (
        ("magnitude mag abs modulus", ("abs_z", "abs_y")),
        ("real re realpart", ("r", "g")),
        ("imaginary imag im imagpart imaginarypart", ("x", "b")),
    )
    for name in names.split()
}
_SIGNED = frozenset({"x", "b"})  # chemists plot −Im Z

_PREFIX = {"": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9}
_SPELLING = {"\N{OHM SIGN}": "Ohm", "Ω": "Ohm", "ohms": "Ohm", "Ohms": "Ohm", "OHMS": "Ohm", "µ": "u", "μ": "u"} | {
    "siemens": "S",
    "Siemens": "S",
    "mho": "S",
    "℧": "S",
}
_ANGLE = dict.fromkeys(("deg", "degree", "degrees", "°", "â°"), pi / 180) | dict.fromkeys(
    ("rad", "radian", "radians"), 1.0
)
_BASE = re.compile(r"(.{0,1})(hz|ohm|s|f|h)", re.IGNORECASE)

_BRACKETED = re.compile(r"(.*)[(\[]([^()\[\]]*)[)\]]([^()\[\]]*)")
_DIVIDED = re.compile(r"([^/]+)/([^/]+)")
_TAILED = re.compile(r"(.+)[_ ]([^_ ]+)")


@dataclass(frozen=True)
class Heading:
    """A column's meaning.

    Attributes:
        cell: the heading as it stands in the file.
        kind: the quantity, a key of ``DIMENSION``; ``None`` if it is none that is known.
        scale: factor that makes SI units of the values, radians of angles; ``None`` if no unit is named.
        wrong: what is wrong with it, when the quantity is known and the unit does not fit; else empty.
    """

    cell: str
    kind: str | None = None
    scale: float | None = None
    wrong: str = ""


@cache
def unit_of(text: str) -> tuple[str, float] | None:
    """Return dimension and factor to SI of a unit; ``None`` if it is none that is known here."""
    unit = text.strip()
    if len(unit) > 12:
        return None
    if unit.lower() in _ANGLE:
        return "angle", _ANGLE[unit.lower()]
    if not unit or unit in ("1", "-"):
        return "", 1.0
    for spelling, plain in _SPELLING.items():
        unit = unit.replace(spelling, plain)
    match = _BASE.fullmatch(unit)
    if not match or match[1] not in _PREFIX:
        return None
    dimension = {"hz": "Hz", "ohm": "Ohm", "s": "S", "f": "F", "h": "H"}[match[2].lower()]
    prefix = "M" if unit == "mhz" else match[1]  # all in small letters: nobody means millihertz
    return dimension, _PREFIX[prefix]


def heading(cell: str) -> Heading:
    """Return the meaning of a heading such as ``frequency_hz``, ``|Z| (kOhm)``, ``theta-z(deg)`` or ``Re(Z)/Ω``."""
    if len(cell) > 100:
        return Heading(cell)
    name, unit = _parts(cell)
    sign = 1.0
    normal = _normal(name)
    if normal.startswith("-") and _KIND.get(normal[1:]) in _SIGNED:
        sign, normal = -1.0, normal[1:]
    normal = normal.replace("-", "")
    known = unit_of(unit) if unit is not None else None
    kind = _KIND.get(normal)
    if kind is None and known:
        kind = _BY_UNIT.get(normal, {}).get(known[0])
    if kind is None:
        return Heading(cell)
    dimension = DIMENSION[kind]
    if unit is None:
        return Heading(cell, kind, 1.0 if dimension == "" else None)
    if known is None:
        return Heading(cell, kind, wrong=f"the unit {quote(unit)} is not known")
    if known[0] != dimension:
        return Heading(cell, kind, wrong=f"the unit {quote(unit)} does not fit")
    return Heading(cell, kind, sign * known[1])


def _parts(cell: str) -> tuple[str, str | None]:
    """Split a heading into name and unit; the unit is ``None`` if there is none."""
    text = cell.strip()
    bracketed = _BRACKETED.fullmatch(text)
    for match in (bracketed, _DIVIDED.fullmatch(text), _TAILED.fullmatch(text)):
        if match and unit_of(match[2]):
            return match[1], match[2]
    if bracketed and _normal(text) not in _KIND and _normal(bracketed[1]) in _KIND:
        return bracketed[1], bracketed[2]  # a known quantity in a unit that is not
    return text, None


def _normal(name: str) -> str:
    text = name.strip().lower().replace("θ", "theta").replace("φ", "phi").replace("\N{MINUS SIGN}", "-")
    text = text.replace("′", "'").replace("″", "''").replace('"', "''")
    return re.sub(r"[\s_.:]", "", text)
