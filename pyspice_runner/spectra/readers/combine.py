# SPDX-License-Identifier: GPL-3.0-or-later
"""From any two quantities that an analyser shows to the complex admittance.

Series elements make Z = R + jX with X = ωL_s = −1/(ωC_s), parallel ones Y = G + jB with B = ωC_p = −1/(ωL_p). A quality
factor or loss D = 1/Q gives the size of the real part; of a passive part it is positive under each sign convention
the instrument has for Q and D.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.spectra.readers.table import Floats

Complexes = NDArray[np.complex128]
_Part = Callable[[Floats, Floats], Floats]  # of angular frequency and value


def _same(_: Floats, value: Floats) -> Floats:
    return value


def _rising(w: Floats, value: Floats) -> Floats:
    return w * value


def _falling(w: Floats, value: Floats) -> Floats:
    return -1.0 / (w * value)


_REACTANCE: dict[str, _Part] = {"x": _same, "cs": _falling, "ls": _rising}
_SUSCEPTANCE: dict[str, _Part] = {"b": _same, "cp": _rising, "lp": _falling, "xp": lambda _, value: -1.0 / value}
_POLAR = tuple(product(("abs_z", "abs_y"), ("phase_z", "phase_y")))

# in the order of preference where a file has several: real and imaginary part have no trouble with signs and wraps
_PAIRS = (
    ("r", "x"),
    ("g", "b"),
    *sorted(_POLAR, key=lambda pair: pair[0][-1] != pair[1][-1]),
    *((real, imag) for imag in _REACTANCE for real in ("r", "d", "q", "abs_z")),
    *((real, imag) for imag in _SUSCEPTANCE for real in ("g", "rp", "d", "q", "abs_z")),
)
_MODULI = ("abs_z", "abs_y")


def pair_of(columns: Mapping[str, Floats]) -> tuple[str, str] | None:
    """Return the two quantities that the admittance is made of; ``None`` if no two do."""
    return next((pair for pair in _PAIRS if pair[0] in columns and pair[1] in columns), None)


def is_polar(pair: tuple[str, str]) -> bool:
    """Whether a pair is modulus and phase."""
    return pair in _POLAR


def admittance(pair: tuple[str, str], frequency_hz: Floats, columns: Mapping[str, Floats]) -> Complexes:
    """Return the admittance in S, not finite where the values make none."""
    first, second = columns[pair[0]], columns[pair[1]]
    w = 2.0 * np.pi * frequency_hz
    with np.errstate(all="ignore"):
        if is_polar(pair):
            y = first if pair[0] == "abs_y" else 1.0 / first
            return np.asarray(y * np.exp(1j * second if pair[1] == "phase_y" else -1j * second), dtype=np.complex128)
        if pair[1] in _REACTANCE:
            x = _REACTANCE[pair[1]](w, second)
            return np.asarray(1.0 / (_real_part(pair[0], first, first, x) + 1j * x), dtype=np.complex128)
        b = _SUSCEPTANCE[pair[1]](w, second)
        return np.asarray(_real_part(pair[0], first, 1.0 / first, b) + 1j * b, dtype=np.complex128)


def _real_part(kind: str, value: Floats, modulus: Floats, imag: Floats) -> Floats:
    """Return the real part beside an imaginary one; rounding may have made the modulus the smaller of the two."""
    if kind == "d":
        return np.abs(imag * value)
    if kind == "q":
        return np.abs(imag / value)
    if kind == "abs_z":
        return np.sqrt(np.maximum(modulus**2 - imag**2, 0.0))
    return 1.0 / value if kind == "rp" else value


def with_named_phase(columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return the columns with a bare “phase” given to the magnitude that it stands beside, by custom |Z| first."""
    named = dict(columns)
    if (angle := named.pop("phase", None)) is not None:
        named.setdefault("phase_y" if "abs_y" in named and "abs_z" not in named else "phase_z", angle)
    return named


def contradiction(pair: tuple[str, str], y: Complexes, columns: Mapping[str, Floats]) -> str | None:
    """Return the quantity that does not agree with the admittance made of two others, if there is one.

    The columns of one file say the same thing several times over; where they do not, some are swapped or mislabelled.
    Printed digits differ by rounding, so it takes more than half of the points to be off by more than 5 %.
    """
    with np.errstate(all="ignore"):
        z = 1.0 / y
        truths = {"abs_z": np.abs(z), "abs_y": np.abs(y), "r": z.real, "x": z.imag, "g": y.real, "b": y.imag}
        angles = {"phase_z": np.angle(z), "phase_y": np.angle(y)}
        for kind, values in columns.items():
            if kind in pair:
                continue
            if kind in truths:
                scale = np.abs(z) if kind in ("abs_z", "r", "x") else np.abs(y)
                off = np.abs(values - truths[kind]) > 0.05 * scale
            elif kind in angles:
                off = np.abs(np.angle(np.exp(1j * (values - angles[kind])))) > 0.05
            else:
                continue
            known = np.isfinite(values)
            if 2 * np.count_nonzero(off & known) > np.count_nonzero(known):
                return kind
    return None


def negative_modulus(pair: tuple[str, str], columns: Mapping[str, Floats]) -> int | None:
    """Return the place of the first modulus or parallel resistance that is below zero, if there is one."""
    for kind in pair:
        if kind in _MODULI and (below := np.flatnonzero(columns[kind] < 0.0)).size:
            return int(below[0])
    return None
