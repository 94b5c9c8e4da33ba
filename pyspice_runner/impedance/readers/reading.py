# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a reader: columns in SI units with their lines in the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import SpectrumError
from pyspice_runner.impedance.readers.quantities import DIMENSION, Heading, heading, pair_of, with_named_phase
from pyspice_runner.impedance.readers.text import Floats, Table, Text, described, quote, read_table, separator

STATED = "the columns stated by --columns frequency_hz,magnitude_ohm,phase_deg (columns= in Python)"  # ends a message
A_PAIR = "two that make an admittance, such as R (Ohm) and X (Ohm), G (S) and B (S), |Z| (Ohm) and Phase (deg)"
MEMORY_NOTE = "The file also holds a memory trace; trace=“memory” reads that one."


@dataclass
class Reading:
    """The content of a file in one format, before the plausibility checks."""

    text: Text  # the file
    format: str  # name of the format
    frequency_hz: Floats  # frequencies in Hz in the order of the file
    indices: NDArray[np.int64]  # line of each point, counted from 0
    # quantity → values in SI units; angles in radians, or as printed if ``angle_unit`` is ``None``.
    columns: dict[str, Floats] = field(default_factory=dict)
    angle_unit: str | None = "deg"  # ``"deg"`` or ``"rad"`` as named in the file; ``None`` if it names none
    # admittance of a two-port, shape (points, 2, 2), instead of the columns.
    matrix_s: NDArray[np.complex128] | None = None
    metadata: dict[str, str] = field(default_factory=dict)  # description of the measurement from the file
    cautions: list[str] = field(default_factory=list)  # omissions and choices of the reader


def cut_caution(index: int | None) -> list[str]:
    """Return the caution for an omitted last line, counted from 0, if there is one."""
    if index is None:
        return []
    return [f"Line {index + 1}, the last, has no line end and may be cut short, so it was left out."]


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
    usable = [i for i, h in enumerate(headings) if h.kind and h.scale is not None and not h.wrong and i != frequency]
    unitless = [i for i, h in enumerate(headings) if h.kind and h.scale is None and DIMENSION[h.kind] == "angle"]
    values = table.numbers([frequency, *usable, *unitless])
    scale = headings[frequency].scale or 1.0
    reading = Reading(table.text, format_name, values[0] * scale, np.array(table.indices), metadata=metadata)
    reading.cautions += cut_caution(table.cut)
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
        expected = f"one, headed as “Frequency (Hz)” or “frequency_hz”, or {STATED}"
        raise table.text.refusal(header, f"{len(found) or 'no'} columns of frequency", expected)
    if why := headings[found[0]].fault:
        expected = f"Hz, kHz, MHz or GHz, as in “Frequency (kHz)”, or {STATED}"
        raise table.text.refusal(header, why, expected)
    return found[0]


def _no_quantities(text: Text, header: int, headings: list[Heading]) -> SpectrumError:
    """Return the error for a header without two quantities that make an admittance."""
    expected = f"{A_PAIR}, or {STATED}"
    quantities = [item for item in headings if item.kind and item.kind != "frequency"]
    if why := next((item.fault for item in quantities if item.fault), ""):
        return text.refusal(header, why, expected)
    known = [quote(item.cell) for item in quantities]
    found = f"of the columns only {' and '.join(known[:4])}" if known else "no column of a quantity that is known"
    return text.refusal(header, found, expected)
