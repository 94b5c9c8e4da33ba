# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns in SI units with their lines in the file, and the spectrum that they make.

Common faults of measured files are repaired, each with a caution: order and repetition of the frequencies, missing
values, a phase that wraps or is off by 180°. What no passive part can do is rejected.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import SpectrumError
from pyspice_runner.impedance.readers import quantities
from pyspice_runner.impedance.readers.quantities import DIMENSION, POLAR, Complexes, Heading, heading
from pyspice_runner.impedance.readers.text import Floats, Table, Text, described, quote, read_table, separator
from pyspice_runner.impedance.spectrum import COUPLING, Spectrum, connect, half_power
from pyspice_runner.units import engineering

STATED = "the columns given by --columns frequency_hz,magnitude_ohm,phase_deg (columns= in Python)"  # ends a message
A_PAIR = "two that make an admittance, such as R (Ohm) and X (Ohm), G (S) and B (S), |Z| (Ohm or dB) and Phase (deg)"
MEMORY_NOTE = "The file also holds a memory trace; trace=“memory” reads that one."
ALONE = {  # a real part, the imaginary part that is missing, and what is not determined without it
    "g": ("conductance", "the susceptance in S", "C0, coupling factor and leads"),
    "r": ("resistance", "the reactance in Ohm", "R1, L1, C1, C0, coupling factor and leads"),
}
_HIGHEST = 1e12  # Hz
_LOOP = 0.55  # enclosed share of the bounding box: a circle has 0.79, a locus that does not turn back at most 0.5
_SAME = 1e-6  # relative difference within which a repeated point is the same point
_DRIFT = 0.5  # correlation of the differences between sweeps from point to point: 0 for noise, 1 for a drift


@dataclass
class Reading:
    """The content of a file in one format, before the plausibility checks."""

    text: Text  # the file
    format: str  # name of the format
    frequency_hz: Floats  # frequencies in Hz in the order of the file
    indices: NDArray[np.int64]  # line of each point, counted from 0
    columns: dict[str, Floats] = field(default_factory=dict)  # quantity → values in SI units; angles in radians
    angle_unit: str = "deg"  # ``"deg"`` or ``"rad"`` as named in the file
    # admittance of a two-port, shape (points, 2, 2), instead of the columns.
    matrix_s: NDArray[np.complex128] | None = None
    metadata: dict[str, str] = field(default_factory=dict)  # description of the measurement from the file
    cautions: list[str] = field(default_factory=list)  # omissions and choices of the reader


def steady(values: Floats) -> bool:
    """Whether values rise, or fall, from each to the next."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and ((steps > 0.0).all() or (steps < 0.0).all()))


def swept(reading: Reading) -> Reading:
    """Return the reading of an instrument that sweeps steadily. Raise SpectrumError if the frequency jumps."""
    if not steady(reading.frequency_hz):
        raise reading.text.refusal(
            int(reading.indices[0]), "from here on the frequencies jump about", "a sweep (columns may be swapped)"
        )
    return reading


def wants_memory(text: Text, trace: str | None, there: bool) -> bool:
    """Whether ``trace`` selects the memory trace, in a format that may have one beside the data trace.

    Raise SpectrumError if there is none, or for another name.
    """
    if trace in (None, "data"):
        return False
    if trace != "memory" or not there:
        found = "the traces data and memory" if there else "no trace but data"
        raise SpectrumError(f"{text.name} has {found}; trace={quote(str(trace))} is not valid.")
    return True


def from_header(
    text: Text,
    header: int,
    format_name: str,
    meaning: Callable[[str], Heading] = heading,
    stop: int | None = None,
    above: Sequence[str] | None = None,
    bare: str = "comment",
) -> Reading:
    """Read the table below a header line; ``above`` are the lines that describe the measurement.

    Raise SpectrumError as :func:`read_table` and :func:`from_headings`.
    """
    table = read_table(text, header, header + 1, stop, separator(text.lines[header]))
    metadata = described(text.lines[:header] if above is None else above, bare)
    return from_headings(table, [meaning(cell) for cell in table.names], format_name, metadata, header)


def from_headings(
    table: Table, headings: list[Heading], format_name: str, metadata: dict[str, str], header: int
) -> Reading:
    """Make a reading of the columns whose headings name a quantity and a unit.

    Raise SpectrumError if there is no frequency, no two quantities that make an admittance, if two columns of one
    quantity differ, or a cell is not a number.
    """
    frequency = _the_frequency(table, headings, header)
    usable = [i for i, h in enumerate(headings) if h.kind and not h.fault and i != frequency]
    values = table.numbers([frequency, *usable])
    scale = headings[frequency].scale or 1.0
    reading = Reading(table.text, format_name, values[0] * scale, np.array(table.indices), metadata=metadata)
    reading.cautions += table.cut
    places: dict[str, int] = {}
    for column, raw in zip(usable, values[1:], strict=True):
        item = headings[column]
        kind = str(item.kind)
        converted = item.values(raw)
        if item.decibel:
            unit = {"Ohm": "Ω"}.get(DIMENSION[kind], DIMENSION[kind])
            reading.cautions.append(f"{quote(item.cell)} was read in dB relative to {item.scale:g} {unit}.")
        if kind in places and not np.allclose(converted, reading.columns[kind], 1e-3, 0.0, equal_nan=True):
            raise table.text.refusal(
                header,
                f"{quote(item.cell)} and {quote(headings[places[kind]].cell)} are the same quantity with other values",
                "one of them",
            )
        places[kind] = column
        reading.columns[kind] = converted
        if DIMENSION[kind] == "angle":
            reading.angle_unit = "rad" if item.scale == 1.0 else "deg"
    reading.columns = quantities.with_named_phase(reading.columns)
    if quantities.pair_of(reading.columns) is None:
        alone = next(iter(reading.columns), "") if set(reading.columns) <= set(ALONE) else ""
        raise _part_alone(reading, alone, header) if alone else _no_quantities(table.text, header, headings)
    return reading


def _the_frequency(table: Table, headings: list[Heading], header: int) -> int:
    found = [place for place, item in enumerate(headings) if item.kind == "frequency"]
    if len(found) != 1:
        expected = f"one, headed as “Frequency (Hz)” or “frequency_hz”, or {STATED}"
        raise table.text.refusal(header, f"{len(found) or 'no'} columns of frequency", expected)
    if why := headings[found[0]].fault:
        expected = f"Hz, kHz, MHz or GHz, as in “Frequency (kHz)”, or {STATED}"
        raise table.text.refusal(header, why, expected)
    return found[0]


def _no_quantities(text: Text, header: int, headings: list[Heading]) -> SpectrumError:
    """Return the error for a header without two quantities that make an admittance."""
    expected = f"{A_PAIR}, or {STATED}"
    named = [item for item in headings if item.kind and item.kind != "frequency"]
    if why := next((item.fault for item in named if item.fault), ""):
        return text.refusal(header, why, expected)
    known = [quote(item.cell) for item in named]
    found = f"of the columns only {' and '.join(known[:4])}" if known else "no column of a quantity that is known"
    return text.refusal(header, found, expected)


def _part_alone(reading: Reading, kind: str, header: int) -> SpectrumError:
    """Return the error for conductance or resistance alone, with what its largest peak shows."""
    part, other, hidden = ALONE[kind]
    frequency, places = np.unique(reading.frequency_hz, return_index=True)
    real = np.nan_to_num(reading.columns[kind][places])
    top = frequency[np.argmax(real)]
    with np.errstate(all="ignore"):
        peak = half_power(frequency, real.astype(complex), top, 2.0 * top / np.ptp(frequency))
    found = "no peak with points at half of its height"
    if peak:
        f, q, ohm, w = peak.resonance_hz, peak.quality_factor, peak.resistance_ohm, 2.0 * np.pi * peak.resonance_hz
        values = [("R1", ohm, "Ω"), ("L1", ohm * q / w, "H"), ("C1", 1.0 / (ohm * q * w), "F"), ("fs", f, "Hz")]
        values = values if kind == "g" else [("maximum", 1.0 / ohm, "Ω"), ("fp", f, "Hz")]
        found = ", ".join([*(f"{name} {engineering(value, unit)}" for name, value, unit in values), f"Q {q:.4g}"])
        found = f"{found} (of its largest peak, by half power)".replace("\N{NO-BREAK SPACE}", " ")
    return reading.text.refusal(header, f"{part} alone, which shows {found}, but not {hidden}", f"{other}, too")


# --- spectrum ---


def spectrum_of(reading: Reading) -> Spectrum:
    """Return the spectrum of a reading. Raise SpectrumError if the columns do not make one."""
    for kind, values in reading.columns.items():
        if steady(values) and not steady(reading.frequency_hz):
            raise SpectrumError(
                f"{reading.text.name}: the frequencies jump about while {_word(kind)} runs steadily; "
                "the columns may be swapped."
            )
    matrix, polar = _one_port(reading) if reading.matrix_s is None else (reading.matrix_s, False)
    frequency, matrix = _ordered(reading, *_finite(reading, matrix))
    if matrix.shape[-1] == 1:
        matrix = _right_way_round(reading, matrix[:, 0, 0], polar)[:, None, None]
    _reject_nonsense(reading, matrix)
    return Spectrum(frequency, matrix, reading.text.name, reading.format, tuple(reading.cautions), reading.metadata)


def _one_port(reading: Reading) -> tuple[Complexes, bool]:
    """Return the admittance matrix of the columns, and whether they are modulus and phase."""
    columns, pair = reading.columns, quantities.pair_of(reading.columns)
    assert pair is not None  # as every format makes sure
    angles = [kind for kind in columns if DIMENSION[kind] == "angle"]
    if angles:
        _check_unit(reading, columns[angles[0]], columns)
    below = columns[pair[0]] < 0.0  # a modulus is the first of a pair
    if pair[0].startswith("abs") and below.any():
        index = int(reading.indices[below.argmax()])
        raise reading.text.refusal(index, "a magnitude below zero", "positive ones (columns may be swapped)")
    y = quantities.admittance(pair, reading.frequency_hz, columns)
    if (odd := quantities.contradiction(pair, y, columns)) is not None:
        raise SpectrumError(
            f"{reading.text.name}: the column of {_word(odd)} contradicts those of {_word(pair[0])} and "
            f"{_word(pair[1])}; columns may be swapped, or a unit wrong."
        )
    if pair[0] == "abs_z" and pair not in POLAR:
        reading.cautions.append(
            "The real part is what a modulus leaves beside its imaginary part, so that losses are only as good as "
            "the printed digits."
        )
    if pair in POLAR:
        order = np.argsort(reading.frequency_hz, kind="stable")
        jumps = np.flatnonzero(np.abs(np.diff(columns[pair[1]][order])) > 1.5 * np.pi)
        if jumps.size:
            first = reading.frequency_hz[order][jumps[0]]
            reading.cautions.append(f"The phase wraps by 360°, first at {first:g} Hz; it was unwrapped.")
    return y[:, None, None], pair in POLAR


def _word(kind: str) -> str:
    """Return a quantity as written in messages."""
    side = kind[-1].upper()
    return {"abs": f"|{side}|", "phase": "phase"}.get(kind.partition("_")[0], kind.capitalize())


# --- phase ---


def _check_unit(reading: Reading, angle: Floats, columns: dict[str, Floats]) -> None:
    """Raise an error for angles whose named unit cannot be right.

    Beyond ±2π they are not radians. Within ±π, degrees would mean a phase of at most 3.1°, a resistor, whose magnitude
    does not vary over the band.
    """
    degrees = reading.angle_unit == "deg"
    printed = np.abs(np.rad2deg(angle) if degrees else angle)
    largest = float(printed[np.isfinite(printed)].max(initial=0.0))
    if degrees and largest < 1.01 * np.pi and _magnitude_varies(reading.frequency_hz, columns):
        fault, right = f"in degrees but stays within ±{largest:.4g} while the magnitude varies", "phase_rad"
    elif not degrees and largest > 2.01 * np.pi:
        fault, right = f"in radians but reaches {largest:.4g}", "phase_deg"
    else:
        return
    raise SpectrumError(f"{reading.text.name}: the phase is given {fault}; correct its unit, as to {right}.")


def _magnitude_varies(frequency: Floats, columns: dict[str, Floats]) -> bool:
    """Whether |Z| or |Y| varies more than that of a part with a phase below 3.1° can."""
    size = next((columns[kind] for kind in ("abs_z", "abs_y") if kind in columns), None)
    if size is None:
        return False
    good = np.isfinite(size) & (size > 0.0) & (frequency > 0.0)
    if np.count_nonzero(good) < 5:
        return False
    logarithm, octaves = np.log(size[good]), np.ptp(np.log(frequency[good]))
    low, high = np.percentile(logarithm, [5.0, 95.0])
    return bool(high - low > 0.1 + 0.1 * octaves)


def _right_way_round(reading: Reading, y: Complexes, polar: bool) -> Complexes:
    """Negate an admittance whose real part is negative throughout and whose reactance has the wrong sign.

    A capacitor whose small real part is negative has the right reactance and stays as it is.
    """
    negative = np.count_nonzero(y.real < 0.0)
    if negative < 0.9 * y.size:
        if negative > 0.01 * y.size:
            reading.cautions.append(
                f"The real part is negative at {negative} of {y.size} points: "
                "noise, or a compensation that is not complete; nothing was changed."
            )
        return y
    reactive = np.mean(np.abs(y.imag) > np.abs(y.real)) > 0.5
    if reactive and _foster(y) > 0.0:
        reading.cautions.append(
            "The real part is negative throughout, but small, and the reactance is as it should be: "
            "the compensation is not complete; nothing was changed."
        )
        return y
    if not reactive and not polar:
        raise SpectrumError(
            f"{reading.text.name}: the real part is negative throughout and larger than the imaginary part; "
            "the two columns may be swapped."
        )
    reading.cautions.append("The real part was negative throughout: the phase was off by 180°, which was added.")
    return -y


# --- points ---


def _finite(reading: Reading, matrix: Complexes) -> tuple[Floats, Complexes, NDArray[np.int64]]:
    """Return the points with values above 0 Hz, and their lines."""
    frequency, text = reading.frequency_hz, reading.text
    for outside, found, expected in (
        (frequency < 0.0, "a frequency below 0 Hz", "positive ones"),
        (frequency > _HIGHEST, "a frequency of {:.3g} Hz", f"at most {_HIGHEST:g} Hz (the unit may be wrong)"),
    ):
        if outside.any():
            place = int(outside.argmax())
            raise text.refusal(int(reading.indices[place]), found.format(frequency[place]), expected)
    good = np.isfinite(frequency) & np.isfinite(matrix).all(axis=(1, 2))
    zero = good & (frequency == 0.0)
    if zero.any():
        reading.cautions.append("The point at 0 Hz was left out.")
    if bad := np.count_nonzero(~good):
        first = int(reading.indices[np.argmin(good)]) + 1
        if 2 * bad > good.size:
            raise SpectrumError(
                f"{text.name}, line {first}: here and at {bad - 1} of {good.size} points values are missing or zero; "
                "expected numbers at most of them."
            )
        found = f"Points left out, with values missing, zero or an overflow: {bad}, first in line {first}."
        reading.cautions.append(found)
    keep = good & ~zero
    if np.count_nonzero(keep) < 2:
        raise SpectrumError(f"{text.name} has fewer than 2 complete points; expected a spectrum.")
    return frequency[keep], matrix[keep], reading.indices[keep]


def _ordered(
    reading: Reading, frequency: Floats, matrix: Complexes, indices: NDArray[np.int64]
) -> tuple[Floats, Complexes]:
    """Return the points by rising frequency, each frequency once."""
    steps = np.diff(frequency)
    if (steps > 0.0).all():
        return frequency, matrix
    order = np.argsort(frequency, kind="stable")
    each, starts, counts = np.unique(frequency[order], return_index=True, return_counts=True)
    if np.median(counts) > 1.0:
        return each, _of_sweeps(reading, matrix[order], starts, counts)
    if (steps < 0.0).all():
        reading.cautions.append("The frequencies fall from point to point; the points were put in rising order.")
    elif (steps < 0.0).any():
        reading.cautions.append("The frequencies do not rise from point to point; the points were sorted.")
    frequency, matrix, indices = frequency[order], matrix[order], indices[order]
    repeated = np.flatnonzero(np.diff(frequency) == 0.0)
    if not repeated.size:
        return frequency, matrix
    size = np.abs(matrix).max(axis=(1, 2))
    differ = np.abs(matrix[repeated + 1] - matrix[repeated]).max(axis=(1, 2)) > _SAME * size[repeated]
    if differ.any():
        place = int(repeated[np.argmax(differ)])
        found = f"{frequency[place]:.12g} Hz as in line {indices[place] + 1}, with other values"
        expected = "each frequency once; if these are several sweeps, export one"
        raise reading.text.refusal(int(indices[place + 1]), found, expected)
    reading.cautions.append(f"Points that came twice, with the same values: {repeated.size}; one of each was kept.")
    return np.delete(frequency, repeated + 1), np.delete(matrix, repeated + 1, axis=0)


def _of_sweeps(reading: Reading, matrix: Complexes, starts: NDArray[np.int64], counts: NDArray[np.int64]) -> Complexes:
    """Return the mean of repeated sweeps, or the first if a resonance moves: the mean would be too broad.

    ``starts`` and ``counts`` are place and number of the points of each frequency.
    """
    mean: Complexes = np.asarray(np.add.reduceat(matrix, starts) / counts[:, None, None], dtype=np.complex128)
    first = matrix[starts]
    size = np.maximum(np.abs(mean).max(axis=(1, 2), keepdims=True), np.finfo(float).tiny)
    off = (first - mean) / size
    power = float(np.sum(np.abs(off) ** 2))
    along = float(np.sum((off[1:] * off[:-1].conj()).real))
    drifts = power > off.size * _SAME**2 and along > _DRIFT * power
    kept = "They differ by more than noise, and the first was read" if drifts else "Their mean was read"
    scatter = f"the first differs from the mean by {100.0 * np.sqrt(power / off.size):.2g} % RMS"
    reading.cautions.append(f"The file holds {counts.max()} sweeps. {kept}; {scatter}.")
    return first if drifts else mean


# --- rejection ---


def _reject_nonsense(reading: Reading, matrix: Complexes) -> None:
    """Raise an error for an admittance that no passive part has."""
    fault = ""
    if matrix.shape[-1] == 1:
        if _turns_backwards(matrix[:, 0, 0]):
            fault = "the circles of Y run against the clock, which none of a passive part do; real and imaginary "
            fault += "part may be swapped, or the sign of the phase or the imaginary part reversed"
    elif not _reciprocal(matrix):
        fault = "from A to B and from B to A the admittances differ, which those of no passive part do; "
        fault += "columns may be swapped"
    elif not _passive(matrix) or any(_turns_backwards(connect(matrix, connection)) for connection in COUPLING):
        fault = "the admittances are not those of a passive part; columns may be swapped, or a sign reversed"
    if fault:
        of_device = matrix.shape[-1] == 2 and reading.format == "Touchstone"
        hint = " (if one device lies between the ports, specify through = series or shunt)" if of_device else ""
        raise SpectrumError(f"{reading.text.name}: {fault}{hint}.")


# --- properties of every passive part, which reveal swapped columns and reversed signs ---

# Foster: reactance rises with frequency; |Z| falls where Z is capacitive and rises where it is inductive. Causality:
# with rising frequency the circles of resonances in the planes of Y and of Z run clockwise; swapping real and imaginary
# part, or reversing the sign of one, mirrors them. Reciprocity: the matrix of a two-port is symmetric.


def _foster(y: Complexes) -> float:
    """Return a positive number if the reactance rises on the whole, a negative one if that of −Y does."""
    inductive = np.sign(-y.imag[:-1] - y.imag[1:])
    size = np.maximum(np.abs(y), np.finfo(float).tiny)
    return float(np.sum(inductive * -np.diff(np.log(size))))


def _turns_backwards(y: Complexes) -> bool:
    """Whether the locus clearly has circles that run counterclockwise."""
    with np.errstate(all="ignore"):
        z = 1.0 / y
    if not np.isfinite(z).all():
        return False
    (area_y, swept_y), (area_z, swept_z) = _enclosed(y), _enclosed(z)
    return max(area_y, area_z) > _LOOP and min(swept_y, swept_z) > 0.5


def _reciprocal(matrix: Complexes) -> bool:
    """Whether a two-port's transfer admittances agree at most points, within 20 % or 1 % of its largest admittance."""
    there, back = matrix[:, 0, 1], matrix[:, 1, 0]
    bound = np.maximum(0.1 * (np.abs(there) + np.abs(back)), 0.01 * np.abs(matrix).max(axis=(1, 2)))
    return bool(np.mean(np.abs(there - back) > bound) < 0.5)


def _passive(matrix: Complexes) -> bool:
    """Whether the part delivers no power at most points, within 2 % of its largest admittance."""
    loss = np.linalg.eigvalsh(0.5 * (matrix + matrix.conj().transpose(0, 2, 1)))[:, 0]
    return bool(np.mean(loss < -0.02 * np.abs(matrix).max(axis=(1, 2))) < 0.5)


def _enclosed(locus: Complexes) -> tuple[float, float]:
    """Return the enclosed area, positive counterclockwise, over that of the bounding box and over the swept area.

    The second ratio is small for noise, which sweeps area in both directions.
    """
    largest = float(np.abs(locus).max())
    if not largest > 0.0:
        return 0.0, 0.0
    locus = locus / largest  # products of very large or very small values leave the range of numbers
    arms = locus - locus.mean()
    sectors = 0.5 * (arms.conj() * np.roll(arms, -1)).imag
    box = np.ptp(locus.real) * np.ptp(locus.imag)
    swept = np.abs(sectors).sum()
    area = float(sectors.sum())
    return (area / float(box), area / float(swept)) if box > 0.0 and swept > 0.0 else (0.0, 0.0)
