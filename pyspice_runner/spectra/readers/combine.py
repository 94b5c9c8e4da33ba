# SPDX-License-Identifier: GPL-3.0-or-later
"""The complex admittance of any two quantities that an analyser displays.

Series elements make Z = R + jX with X = ωL_s = −1/(ωC_s), parallel ones Y = G + jB with B = ωC_p = −1/(ωL_p). A quality
factor or loss D = 1/Q gives the magnitude of the real part, which is positive for a passive part under every sign
convention for Q and D.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.spectra.readers.table import Floats

Complexes = NDArray[np.complex128]
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
_POLAR = tuple(product(("abs_z", "abs_y"), ("phase_z", "phase_y")))

# by preference, for a file with several: real and imaginary part have no ambiguity of sign or wrap
_PAIRS = (
    ("r", "x"),
    ("g", "b"),
    *sorted(_POLAR, key=lambda pair: pair[0][-1] != pair[1][-1]),
    *((real, imag) for imag in _REACTANCE for real in ("r", "d", "q", "abs_z")),
    *((real, imag) for imag in _SUSCEPTANCE for real in ("g", "rp", "d", "q", "abs_z")),
)


def pair_of(columns: Mapping[str, Floats]) -> tuple[str, str] | None:
    """Return the two quantities that make the admittance; ``None`` without such a pair."""
    return next((pair for pair in _PAIRS if pair[0] in columns and pair[1] in columns), None)


def is_polar(pair: tuple[str, str]) -> bool:
    """Whether a pair is modulus and phase."""
    return pair in _POLAR


def admittance(pair: tuple[str, str], frequency_hz: Floats, columns: Mapping[str, Floats]) -> Complexes:
    """Return the admittance in S; not finite at points whose values make none."""
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
    """Return the real part beside an imaginary one; a modulus may be the smaller of the two by rounding."""
    if kind == "d":
        return np.abs(imag * value)
    if kind == "q":
        return np.abs(imag / value)
    if kind == "abs_z":
        return np.sqrt(np.maximum(modulus**2 - imag**2, 0.0))
    return 1.0 / value if kind == "rp" else value


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


def negative_modulus(pair: tuple[str, str], columns: Mapping[str, Floats]) -> int | None:
    """Return the place of the first negative modulus, if there is one."""
    below = [np.flatnonzero(columns[kind] < 0.0) for kind in pair if kind in ("abs_z", "abs_y")]
    return next((int(places[0]) for places in below if places.size), None)
