# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantity and unit of a column by its heading, and the admittance of any two quantities that an analyser displays.

Series elements make Z = R + jX with X = ωL_s = −1/(ωC_s), parallel ones Y = G + jB with B = ωC_p = −1/(ωL_p). A quality
factor or loss D = 1/Q gives the magnitude of the real part, which is positive for a passive part under every sign
convention for Q and D.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import pi

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.impedance.readers.text import Floats, quote

Complexes = NDArray[np.complex128]

# quantity → dimension of its unit, and names
_QUANTITIES = {
    "frequency": ("Hz", "frequency freq f"),
    "abs_z": ("Ohm", "|z| z |impedance| impedance"),
    "phase_z": ("angle", "zphz"),
    "r": ("Ohm", "r rs rseries resistance seriesresistance z' zr"),  # of the series elements, the real part of Z
    "x": ("Ohm", "x xs xseries reactance seriesreactance z'' zi"),
    "rp": ("Ohm", "rp rparallel parallelresistance"),  # 1/G
    "xp": ("Ohm", "xp xparallel parallelreactance"),
    "abs_y": ("S", "|y| y |admittance| admittance"),
    "phase_y": ("angle", ""),
    "phase": ("angle", "phase theta th angle arg phi phaseangle argument"),
    "g": ("S", "g gp conductance y'"),
    "b": ("S", "b bp susceptance y''"),
    "ls": ("H", "ls lseries seriesinductance"),
    "lp": ("H", "lp lparallel parallelinductance"),
    "cs": ("F", "cs cseries seriescapacitance"),
    "cp": ("F", "cp cparallel parallelcapacitance"),
    "q": ("", "q qualityfactor"),
    "d": ("", "d dissipation dissipationfactor losstangent tandelta"),
}
DIMENSION = {kind: dimension for kind, (dimension, _) in _QUANTITIES.items()}
_PARTS = {  # of an impedance or an admittance; the unit or a name beside it decides which
    ("abs_z", "abs_y"): "magnitude mag abs modulus mod",
    ("r", "g"): "real re realpart",
    ("x", "b"): "imaginary imag im imagpart imaginarypart",
    ("phase_z", "phase_y"): "phase theta arg angle argument",
}
_SIDES = ("z impedance", "y admittance")
_BESIDE = ("{part}{side}", "{part}({side})", "{part}|{side}|", "{side}{part}", "{part}of{side}")

_KIND = {
    form.format(part=part, side=side): kind
    for kinds, parts in _PARTS.items()
    for kind, sides in zip(kinds, _SIDES, strict=True)
    for form, part, side in product(_BESIDE, parts.split(), sides.split())
} | {name: kind for kind, (_, names) in _QUANTITIES.items() for name in names.split()}
_BY_UNIT = {  # names with no meaning without a unit
    name: dict(zip(("Ohm", "S"), kinds, strict=True))
    for kinds, parts in _PARTS.items()
    for name in parts.split()
    if name not in _KIND
}
_SIGNED = frozenset({"x", "b"})  # electrochemistry plots −Im Z

_PREFIX = {"": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9}
_SPELLING = {
    spelling: unit
    for unit, spellings in {
        "Ohm": "Î© â„¦ \N{OHM SIGN} Ω ohms Ohms OHMS",  # also UTF-8 read as Windows' Western European
        "u": "Âµ Î¼ µ μ",
        "S": "siemens Siemens mho ℧",
    }.items()
    for spelling in spellings.split()
}
_ANGLE = dict.fromkeys(("deg", "degree", "degrees", "°", "â°"), pi / 180) | dict.fromkeys(
    ("rad", "radian", "radians"), 1.0
)
_BASE = re.compile(r"(.{0,1})(hz|ohm|s|f|h)", re.IGNORECASE)

_BRACKETED = re.compile(r"(.*)[(\[]([^()\[\]]*)[)\]]([^()\[\]]*)")
_DIVIDED = re.compile(r"([^/]+)/([^/]+)")
_TAILED = re.compile(r"(.+?)(?: in)?[_ ]([^_ ]+)")


@dataclass(frozen=True)
class Heading:
    """The meaning of a column."""

    cell: str  # the heading in the file
    kind: str | None = None  # the quantity, a key of ``DIMENSION``; ``None`` if unknown
    scale: float | None = None  # factor to SI units, for angles to radians; ``None`` if no unit is named
    wrong: str = ""  # fault of the unit of a known quantity; empty without one
    decibel: bool = False  # whether the values are 20 times the decimal logarithm of the quantity in units of ``scale``

    @property
    def fault(self) -> str:
        """The heading and why its values have no known unit; empty if they have one."""
        why = self.wrong or ("it names no unit" if self.scale is None else "")
        return f"{quote(self.cell)}: {why}" if why else ""

    def values(self, printed: Floats) -> Floats:
        """Return the column in SI units; not finite beyond the range of numbers."""
        with np.errstate(over="ignore"):
            return np.asarray((10.0 ** (printed / 20.0) if self.decibel else printed) * (self.scale or 1.0))


@cache
def unit_of(text: str) -> tuple[str, float] | None:
    """Return dimension and factor to SI of a unit, of decibels as ``dBOhm`` or ``dB``; ``None`` if unknown."""
    unit = text.strip()
    if len(unit) > 12:
        return None
    if angle := _ANGLE.get(unit.lower()):
        return "angle", angle
    if unit[:2].lower() == "db":
        of = unit_of(unit[2:])
        return (f"dB{of[0]}", of[1]) if of else None
    if not unit or unit in ("1", "-"):
        return "", 1.0
    for spelling, plain in _SPELLING.items():
        unit = unit.replace(spelling, plain)
    match = _BASE.fullmatch(unit)
    if not match or match[1] not in _PREFIX:
        return None
    dimension = {"hz": "Hz", "ohm": "Ohm", "s": "S", "f": "F", "h": "H"}[match[2].lower()]
    prefix = "M" if unit == "mhz" else match[1]  # a lower-case header means megahertz
    return dimension, _PREFIX[prefix]


def heading(cell: str) -> Heading:
    """Return the meaning of a heading such as ``frequency_hz``, ``|Z| (kOhm)``, ``theta-z(deg)`` or ``Re(Z)/Ω``."""
    if len(cell) > 100:
        return Heading(cell)
    name, unit = _parts(cell)
    sign = 1.0
    normal = _normal(name)
    known = unit_of(unit) if unit is not None else None
    if normal.startswith("-") and _kind(normal[1:], known) in _SIGNED:
        sign, normal = -1.0, normal[1:]
    kind = _kind(normal.replace("-", ""), known)
    if kind is None:
        if normal in _BY_UNIT and known and known[0] == "dB":
            return Heading(cell, _BY_UNIT[normal]["Ohm"], wrong="it names dB without the quantity, |Z| or |Y|")
        return Heading(cell)
    dimension = DIMENSION[kind]
    if unit is None:
        return Heading(cell, kind, 1.0 if dimension == "" else None)
    if known is None:
        return Heading(cell, kind, wrong=f"the unit {quote(unit)} is not known")
    decibel = kind.startswith("abs") and known[0] in ("dB", f"dB{dimension}")
    if known[0] != dimension and not decibel:
        return Heading(cell, kind, wrong=f"the unit {quote(unit)} does not fit")
    return Heading(cell, kind, sign * known[1], decibel=decibel)


def _kind(name: str, unit: tuple[str, float] | None) -> str | None:
    """Return the quantity of a name, ``None`` if unknown."""
    return _KIND.get(name) or (_BY_UNIT.get(name, {}).get(unit[0].removeprefix("dB")) if unit else None)


def _parts(cell: str) -> tuple[str, str | None]:
    """Split a heading into name and unit; the unit is ``None`` if there is none."""
    text = cell.strip()
    bracketed = _BRACKETED.fullmatch(text)
    for match in (bracketed, _DIVIDED.fullmatch(text), _TAILED.fullmatch(text)):
        if match and unit_of(match[2]):
            return match[1], match[2]
    if bracketed and not _kind(_normal(text), None) and _kind(_normal(bracketed[1]), None):
        return bracketed[1], bracketed[2]  # a known quantity in a unit that is not
    return text, None


def _normal(name: str) -> str:
    text = name.strip().lower().replace("θ", "theta").replace("φ", "phi").replace("\N{MINUS SIGN}", "-")
    text = text.replace("′", "'").replace("’", "'").replace("″", "''").replace('"', "''")
    return "".join(text.split()).translate(dict.fromkeys(map(ord, "_.:")))


# --- admittance ---

_Part = Callable[[Floats, Floats], Floats]  # of angular frequency and value
# imaginary part of Z, or of Y, by the quantity that gives it
_REACTANCE: dict[str, _Part] = {
    "x": lambda _, x: x,
    "cs": lambda w, capacitance: -1.0 / (w * capacitance),
    "ls": lambda w, inductance: w * inductance,
}
_SUSCEPTANCE: dict[str, _Part] = {
    "b": lambda _, b: b,
    "cp": lambda w, capacitance: w * capacitance,
    "lp": lambda w, inductance: -1.0 / (w * inductance),
    "xp": lambda _, x: -1.0 / x,
}
POLAR = tuple(product(("abs_z", "abs_y"), ("phase_z", "phase_y")))  # modulus and phase

# by preference, for a file with several: real and imaginary part have no ambiguity of sign or wrap
_PAIRS = (
    ("r", "x"),
    ("g", "b"),
    *sorted(POLAR, key=lambda pair: pair[0][-1] != pair[1][-1]),
    *((real, imag) for imag in _REACTANCE for real in ("r", "d", "q", "abs_z")),
    *((real, imag) for imag in _SUSCEPTANCE for real in ("g", "rp", "d", "q", "abs_z")),
)


def pair_of(columns: Mapping[str, Floats]) -> tuple[str, str] | None:
    """Return the two quantities that make the admittance; ``None`` without such a pair."""
    return next((pair for pair in _PAIRS if pair[0] in columns and pair[1] in columns), None)


def admittance(pair: tuple[str, str], frequency_hz: Floats, columns: Mapping[str, Floats]) -> Complexes:
    """Return the admittance in S; not finite at points whose values make none."""
    first, second = columns[pair[0]], columns[pair[1]]
    w = 2.0 * np.pi * frequency_hz
    with np.errstate(all="ignore"):
        if pair in POLAR:
            y = first if pair[0] == "abs_y" else 1.0 / first
            return np.asarray(y * np.exp(1j * second if pair[1] == "phase_y" else -1j * second), dtype=np.complex128)
        series = pair[1] in _REACTANCE
        imag = (_REACTANCE if series else _SUSCEPTANCE)[pair[1]](w, second)
        real = {
            "d": np.abs(imag * first),
            "q": np.abs(imag / first),
            # a modulus may be the smaller of the two by rounding
            "abs_z": np.sqrt(np.maximum((first if series else 1.0 / first) ** 2 - imag**2, 0.0)),
            "rp": 1.0 / first,
        }.get(pair[0], first)
        found = real + 1j * imag
        return np.asarray(1.0 / found if series else found, dtype=np.complex128)


def with_named_phase(columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the columns with a bare “phase” assigned to the magnitude beside it, |Z| before |Y|."""
    named = dict(columns)
    if (angle := named.pop("phase", None)) is not None:
        named.setdefault("phase_y" if "abs_y" in named and "abs_z" not in named else "phase_z", angle)
    return named


def contradiction(pair: tuple[str, str], y: Complexes, columns: Mapping[str, Floats]) -> str | None:
    """Return a quantity that disagrees with the admittance of two others, if there is one.

    A file with several columns is redundant; a disagreement means swapped or mislabelled columns. Printed digits differ
    by rounding, so the limit is 5 % at more than half of the points.
    """
    with np.errstate(all="ignore"):
        z = 1.0 / y
        truths = {"abs_z": np.abs(z), "abs_y": np.abs(y), "r": z.real, "x": z.imag, "g": y.real, "b": y.imag}
        angles = {"phase_z": np.angle(z), "phase_y": np.angle(y)}
        for kind in [kind for kind in columns if kind not in pair and kind in truths | angles]:
            values = columns[kind]
            if kind in truths:
                off = np.abs(values - truths[kind]) > 0.05 * np.abs(z if kind in ("abs_z", "r", "x") else y)
            else:
                off = np.abs(np.angle(np.exp(1j * (values - angles[kind])))) > 0.05
            known = np.isfinite(values)
            if 2 * np.count_nonzero(off & known) > np.count_nonzero(known):
                return kind
    return None
