# SPDX-License-Identifier: GPL-3.0-or-later
"""What measured files get wrong, put right with a warning that says so, or refused.

Order and repetition of the frequencies, missing values, degrees called radians, a phase that wraps or is off by 180°.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import SpectrumError
from pyspice_runner.spectra.readers.combine import (
    Complexes,
    admittance,
    contradiction,
    is_polar,
    negative_modulus,
    pair_of,
    with_named_phase,
)
from pyspice_runner.spectra.readers.quantities import DIMENSION
from pyspice_runner.spectra.readers.reading import Reading, steady
from pyspice_runner.spectra.readers.sense import foster, passive, reciprocal, turns_backwards
from pyspice_runner.spectra.readers.table import Floats
from pyspice_runner.spectra.spectrum import COUPLING, Spectrum, connect

_HIGHEST = 1e12  # Hz
_SAME = 1e-6  # relative difference within which a repeated point is the same point


def spectrum_of(reading: Reading) -> Spectrum:
    """Return the spectrum of a reading.

    Raises:
        SpectrumError: if the columns do not make one.
    """
    warnings = list(reading.warnings)
    _refuse_swapped(reading)
    if reading.matrix_s is None:
        y, polar = _one_port(reading, warnings)
        matrix = y[:, None, None]
    else:
        matrix, polar = reading.matrix_s, False
    frequency, matrix, indices = _finite(reading, matrix, warnings)
    frequency, matrix = _ordered(reading, frequency, matrix, indices, warnings)
    if matrix.shape[-1] == 1:
        matrix = _right_way_round(reading, matrix[:, 0, 0], polar, warnings)[:, None, None]
    _refuse_nonsense(reading, matrix)
    return Spectrum(frequency, matrix, reading.text.name, reading.format, tuple(warnings), reading.metadata)


def _one_port(reading: Reading, warnings: list[str]) -> tuple[Complexes, bool]:
    columns = with_named_phase(reading.columns)
    angles = [kind for kind in columns if DIMENSION[kind] == "angle"]
    pair = pair_of(columns)
    if pair is None:
        raise SpectrumError(f"{reading.text.name} has no two quantities that make an admittance.")
    if not is_polar(pair) and reading.angle_unit is None:
        columns = {kind: values for kind, values in columns.items() if kind not in angles}
    elif angles:
        factor = _angle_factor(reading, columns[angles[0]], columns, warnings)
        for kind in angles:
            columns[kind] = columns[kind] * factor
    if (place := negative_modulus(pair, columns)) is not None:
        raise reading.text.refusal(
            int(reading.indices[place]), "a magnitude below zero", "positive ones (columns may be swapped)"
        )
    y = admittance(pair, reading.frequency_hz, columns)
    if (odd := contradiction(pair, y, columns)) is not None:
        raise SpectrumError(
            f"{reading.text.name}: the column of {_word(odd)} contradicts those of {_word(pair[0])} and "
            f"{_word(pair[1])}; columns may be swapped, or a unit wrong."
        )
    if pair[0] == "abs_z" and not is_polar(pair):
        warnings.append(
            "The real part is what a modulus leaves beside its imaginary part, so that losses are only as good as "
            "the printed digits."
        )
    if is_polar(pair):
        _tell_wraps(reading.frequency_hz, columns[pair[1]], warnings)
    return y, is_polar(pair)


def _word(kind: str) -> str:
    """Return a quantity as one writes it."""
    side = kind[-1].upper()
    return {"abs": f"|{side}|", "phase": "phase"}.get(kind.partition("_")[0], kind.capitalize())


# --- phase ---


def _angle_factor(reading: Reading, angle: Floats, columns: dict[str, Floats], warnings: list[str]) -> float:
    """Return what to multiply the angles by, told by their values where the heading does not or cannot be right.

    A reader has made radians of what is headed as degrees. Beyond ±2π nothing is radians. Within ±π, degrees would
    mean a phase of at most 3.1°, which is a resistor; it is not one if its magnitude varies over the band.
    """
    unit = reading.angle_unit
    raw = np.rad2deg(angle) if unit == "deg" else angle  # as printed
    known = raw[np.isfinite(raw)]
    largest = float(np.abs(known).max()) if known.size else 0.0
    if unit != "deg" and largest > 2.01 * np.pi:
        told = "in radians" if unit == "rad" else "without a unit"
        warnings.append(f"The phase is given {told} but reaches {largest:.4g}, so it was taken as degrees.")
        return float(np.pi / 180.0)
    if unit != "rad" and largest < 1.01 * np.pi and _magnitude_varies(reading.frequency_hz, columns):
        told = "in degrees" if unit == "deg" else "without a unit"
        warnings.append(
            f"The phase is given {told} but stays within ±{largest:.4g} while the magnitude varies, "
            "so it was taken as radians."
        )
        return float(180.0 / np.pi) if unit == "deg" else 1.0
    if unit is None:
        if largest > 1.01 * np.pi:
            warnings.append(f"The phase names no unit; it reaches {largest:.4g} and was taken as degrees.")
            return float(np.pi / 180.0)
        raise SpectrumError(
            f"{reading.text.name}: the phase names no unit and its values do not tell; head it as "
            "“Phase (deg)” or “Phase (rad)”."
        )
    return 1.0


def _magnitude_varies(frequency: Floats, columns: dict[str, Floats]) -> bool:
    """Whether |Z| or |Y| varies by more than a part whose phase is below 3.1° could."""
    size = next((columns[kind] for kind in ("abs_z", "abs_y") if kind in columns), None)
    if size is None:
        return False
    good = np.isfinite(size) & (size > 0.0) & (frequency > 0.0)
    if np.count_nonzero(good) < 5:
        return False
    logarithm, octaves = np.log(size[good]), np.ptp(np.log(frequency[good]))
    low, high = np.percentile(logarithm, [5.0, 95.0])
    return bool(high - low > 0.1 + 0.1 * octaves)


def _tell_wraps(frequency: Floats, angle: Floats, warnings: list[str]) -> None:
    order = np.argsort(frequency, kind="stable")
    steps = np.abs(np.diff(angle[order]))
    if (jumps := np.flatnonzero(steps > 1.5 * np.pi)).size:
        times = "once" if jumps.size == 1 else f"{jumps.size} times"
        first = frequency[order][jumps[0]]
        warnings.append(f"The phase wraps by 360° {times}, first at {first:g} Hz; it was unwrapped.")


def _right_way_round(reading: Reading, y: Complexes, polar: bool, warnings: list[str]) -> Complexes:
    """Turn an admittance by 180° if its real part is negative throughout and its reactance runs the wrong way.

    A capacitor whose small real part came out negative has the right reactance and is left as it is.
    """
    share = float(np.mean(y.real < 0.0))
    if share < 0.9:
        if share > 0.01:
            warnings.append(
                f"The real part is negative at {np.count_nonzero(y.real < 0.0)} of {y.size} points: "
                "noise, or a compensation that is not complete; nothing was changed."
            )
        return y
    reactive = np.mean(np.abs(y.imag) > np.abs(y.real)) > 0.5
    if reactive and foster(y) > 0.0:
        warnings.append(
            "The real part is negative throughout, but small, and the reactance is as it should be: "
            "the compensation is not complete; nothing was changed."
        )
        return y
    if not reactive and not polar:
        raise SpectrumError(
            f"{reading.text.name}: the real part is negative throughout and larger than the imaginary part; "
            "the two columns may be swapped."
        )
    warnings.append("The real part was negative throughout: the phase was off by 180°, which was added.")
    return -y


# --- points ---


def _finite(reading: Reading, matrix: Complexes, warnings: list[str]) -> tuple[Floats, Complexes, NDArray[np.int64]]:
    """Leave out points without values, and the one at 0 Hz."""
    frequency, text = reading.frequency_hz, reading.text
    if (below := np.flatnonzero(frequency < 0.0)).size:
        raise text.refusal(int(reading.indices[below[0]]), "a frequency below 0 Hz", "positive ones")
    if (above := np.flatnonzero(frequency > _HIGHEST)).size:
        found = f"a frequency of {frequency[above[0]]:.3g} Hz"
        raise text.refusal(int(reading.indices[above[0]]), found, f"at most {_HIGHEST:g} Hz (the unit may be wrong)")
    good = np.isfinite(frequency) & np.isfinite(matrix).all(axis=(1, 2))
    zero = good & (frequency == 0.0)
    if zero.any():
        warnings.append("The point at 0 Hz was left out.")
    if bad := np.count_nonzero(~good):
        first = int(reading.indices[np.argmin(good)]) + 1
        if 2 * bad > good.size:
            raise SpectrumError(
                f"{text.name}, line {first}: here and at {bad - 1} of {good.size} points values are missing or zero; "
                "expected numbers at most of them."
            )
        points = "1 point was" if bad == 1 else f"{bad} points were"
        warnings.append(f"{points} left out where values are missing or zero, first in line {first}.")
    keep = good & ~zero
    if np.count_nonzero(keep) < 2:
        raise SpectrumError(f"{text.name} has fewer than 2 complete points; expected a spectrum.")
    return frequency[keep], matrix[keep], reading.indices[keep]


def _ordered(
    reading: Reading, frequency: Floats, matrix: Complexes, indices: NDArray[np.int64], warnings: list[str]
) -> tuple[Floats, Complexes]:
    """Let the frequencies rise, each of them once."""
    steps = np.diff(frequency)
    if (steps > 0.0).all():
        return frequency, matrix
    order = np.argsort(frequency, kind="stable")
    if (steps < 0.0).all():
        warnings.append("The frequencies fall from point to point; the points were put in rising order.")
    elif (steps < 0.0).any():
        warnings.append("The frequencies do not rise from point to point; the points were sorted.")
    frequency, matrix, indices = frequency[order], matrix[order], indices[order]
    repeated = np.flatnonzero(np.diff(frequency) == 0.0)
    if repeated.size:
        size = np.abs(matrix).max(axis=(1, 2))
        differ = np.abs(matrix[repeated + 1] - matrix[repeated]).max(axis=(1, 2)) > _SAME * size[repeated]
        if differ.any():
            place = int(repeated[np.argmax(differ)])
            raise reading.text.refusal(
                int(indices[place + 1]),
                f"{frequency[place]:.12g} Hz as in line {indices[place] + 1}, with other values",
                "each frequency once; if these are several sweeps, export one",
            )
        times = "1 point" if repeated.size == 1 else f"{repeated.size} points"
        warnings.append(f"{times} came twice, with the same values; one of each was kept.")
        keep = np.ones(frequency.size, dtype=bool)
        keep[repeated + 1] = False
        frequency, matrix = frequency[keep], matrix[keep]
    return frequency, matrix


def _refuse_nonsense(reading: Reading, matrix: Complexes) -> None:
    """Refuse what no passive part can do."""
    name = reading.text.name
    if matrix.shape[-1] == 1:
        if turns_backwards(matrix[:, 0, 0]):
            raise SpectrumError(
                f"{name}: the circles of Y run against the clock, which none of a passive part do; real and imaginary "
                "part may be swapped, or the sign of the phase or the imaginary part reversed."
            )
        return
    hint = " (if one device lies between the ports, state through = series or shunt)"
    hint = hint if reading.format == "Touchstone" else ""
    if not reciprocal(matrix):
        raise SpectrumError(
            f"{name}: from A to B and from B to A the admittances differ, which those of no passive part do; "
            f"columns may be swapped{hint}."
        )
    if not passive(matrix) or any(turns_backwards(connect(matrix, connection)) for connection in COUPLING):
        raise SpectrumError(
            f"{name}: the admittances are not those of a passive part; columns may be swapped, or a sign "
            f"reversed{hint}."
        )


def _refuse_swapped(reading: Reading) -> None:
    """Refuse frequencies that jump about while another column runs steadily: the two are swapped."""
    if steady(reading.frequency_hz):
        return
    for kind, values in reading.columns.items():
        if steady(values):
            raise SpectrumError(
                f"{reading.text.name}: the frequencies jump about while {_word(kind)} runs steadily; "
                "the columns may be swapped."
            )
