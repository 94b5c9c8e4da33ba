# SPDX-License-Identifier: GPL-3.0-or-later
"""What a reader returns: columns in SI units with their places in the file."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import SpectrumError
from pyspice_runner.spectra.readers.combine import pair_of, with_named_phase
from pyspice_runner.spectra.readers.quantities import DIMENSION, Heading
from pyspice_runner.spectra.readers.table import Floats, Table
from pyspice_runner.spectra.readers.text import Text, quote

STATED = "the columns stated by --columns frequency_hz,magnitude_ohm,phase_deg (columns= in Python)"  # ends a message
A_PAIR = "two that make an admittance, such as R (Ohm) and X (Ohm), G (S) and B (S), |Z| (Ohm) and Phase (deg)"


@dataclass
class Reading:
    """The content of a file in one format, not yet checked for sense.

    Attributes:
        text: the file.
        format: name of the format.
        frequency_hz: frequencies in Hz as they stand in the file.
        indices: the line of each point, counted from 0.
        columns: quantity → values in SI units; angles in radians, or as they are if ``angle_unit`` is ``None``.
        angle_unit: ``"deg"`` or ``"rad"`` as the file names it; ``None`` if it names none.
        matrix_s: a two-port's admittance, shape (points, 2, 2), in place of the columns.
        metadata: what the file says of the measurement.
        warnings: what the reader left out or chose.
    """

    text: Text
    format: str
    frequency_hz: Floats
    indices: NDArray[np.int64]
    columns: dict[str, Floats] = field(default_factory=dict)
    angle_unit: str | None = "deg"
    matrix_s: NDArray[np.complex128] | None = None
    metadata: dict[str, str] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def cut_warning(table: Table) -> list[str]:
    """Return the warning that a last row was left out, if it was."""
    if table.cut is None:
        return []
    return [f"Line {table.cut + 1}, the last, has no line end and may be cut short, so it was left out."]


def steady(values: Floats) -> bool:
    """Whether values rise, or fall, from each to the next."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and ((steps > 0.0).all() or (steps < 0.0).all()))


def swept(reading: Reading) -> Reading:
    """Return the reading of an instrument that never jumps about in frequency, checked that it did not.

    Raises:
        SpectrumError: if it did; then another column stands in the frequency's place.
    """
    if not steady(reading.frequency_hz):
        raise reading.text.refusal(
            int(reading.indices[0]), "from here on the frequencies jump about", "a sweep (columns may be swapped)"
        )
    return reading


def wants_memory(text: Text, trace: str | None, there: bool) -> bool:
    """Whether a memory trace is asked for, in a format that may have one beside the data trace.

    Raises:
        SpectrumError: if there is none, or for another name.
    """
    if trace in (None, "data"):
        return False
    if trace != "memory" or not there:
        found = "the traces data and memory" if there else "no trace but data"
        raise SpectrumError(f"{text.name} has {found}; trace={quote(str(trace))} is not valid.")
    return True


def from_headings(
    table: Table, headings: list[Heading], format_name: str, metadata: dict[str, str], header: int
) -> Reading:
    """Make a reading of the columns whose headings name a quantity and a unit.

    Raises:
        SpectrumError: if there is no frequency, no two quantities that make an admittance, if two columns of one
            quantity differ, or a cell is no number.
    """
    frequency = _the_frequency(table, headings, header)
    usable = [i for i, h in enumerate(headings) if h.kind and h.scale is not None and not h.wrong and i != frequency]
    unitless = [i for i, h in enumerate(headings) if h.kind and h.scale is None and DIMENSION[h.kind] == "angle"]
    values = table.numbers([frequency, *usable, *unitless])
    scale = headings[frequency].scale or 1.0
    reading = Reading(table.text, format_name, values[0] * scale, np.array(table.indices), metadata=metadata)
    reading.warnings += cut_warning(table)
    reading.angle_unit = None if unitless else "deg"
    places: dict[str, int] = {}
    for column, raw in zip([*usable, *unitless], values[1:], strict=True):
        item = headings[column]
        kind = str(item.kind)
        converted = raw * (item.scale or 1.0)
        if kind in places and not np.allclose(converted, reading.columns[kind], 1e-3, 0.0, equal_nan=True):
            raise table.text.refusal(
                header,
                f"{quote(item.cell)} and {quote(headings[places[kind]].cell)} are the same quantity with other values",
                "one of them",
            )
        places[kind] = column
        reading.columns[kind] = converted
        if DIMENSION[kind] == "angle" and item.scale is not None:
            reading.angle_unit = "rad" if item.scale == 1.0 else "deg"
    if pair_of(with_named_phase(reading.columns)) is None:
        raise _no_quantities(table.text, header, headings)
    return reading


def _the_frequency(table: Table, headings: list[Heading], header: int) -> int:
    found = [place for place, item in enumerate(headings) if item.kind == "frequency"]
    if len(found) != 1:
        raise table.text.refusal(
            header,
            f"{len(found) or 'no'} columns of frequency",
            f"one, headed as “Frequency (Hz)” or “frequency_hz”, or {STATED}",
        )
    item = headings[found[0]]
    if item.wrong or item.scale is None:
        why = item.wrong or "it names no unit"
        expected = f"Hz, kHz, MHz or GHz, as in “Frequency (kHz)”, or {STATED}"
        raise table.text.refusal(header, f"{quote(item.cell)}: {why}", expected)
    return found[0]


def _no_quantities(text: Text, header: int, headings: list[Heading]) -> SpectrumError:
    """Return the error for a header that does not hold two quantities which make an admittance."""
    expected = f"{A_PAIR}, or {STATED}"
    for item in headings:
        if item.kind and item.kind != "frequency" and (item.wrong or item.scale is None):
            why = item.wrong or "it names no unit"
            return text.refusal(header, f"{quote(item.cell)}: {why}", expected)
    known = [quote(item.cell) for item in headings if item.kind and item.kind != "frequency"]
    found = f"of the columns only {' and '.join(known[:4])}" if known else "no column of a quantity that is known"
    return text.refusal(header, found, expected)
