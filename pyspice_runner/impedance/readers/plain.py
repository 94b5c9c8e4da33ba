# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain CSV whose header or user names quantity and unit, and the two-port CSV of ``piezomotor admittance``.

Examples: ``frequency_hz,conductance_s,susceptance_s``, ``Frequency (kHz); |Z| (kOhm); Phase (deg)`` or
``f/Hz  Re(Z)/Ω  -Im(Z)/Ω``: commas, semicolons, tabs or spaces; comments above, after ``#``, ``!`` or ``%``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pyspice_runner.errors import ParameterError, SpectrumError
from pyspice_runner.impedance.readers.quantities import Heading, heading, pair_of, with_named_phase
from pyspice_runner.impedance.readers.reading import A_PAIR, ALONE, Reading, from_header, from_headings
from pyspice_runner.impedance.readers.text import (
    SEPARATORS,
    Table,
    Text,
    described,
    number,
    quote,
    read_table,
    separator,
    split,
)
from pyspice_runner.impedance.spectrum import TWO_PORT
from pyspice_runner.motor.refusal import check_keys

FORMAT = "plain CSV"
TWO_PORT_FORMAT = "two-port CSV"
_COMMENT = "#!% \t"
_LONGEST = 4000  # characters of a line that may be a header or a row
_EXAMPLE = "frequency_hz,magnitude_ohm,phase_deg"
_STATED = (  # suggested names; every known heading is valid too
    "frequency_hz", "frequency_khz", "frequency_mhz", "magnitude_ohm", "magnitude_s", "phase_deg", "phase_rad",
    "resistance_ohm", "reactance_ohm", "conductance_s", "susceptance_s", "real_ohm", "imaginary_ohm", "real_s",
    "imaginary_s", "rs_ohm", "xs_ohm", "cs_f", "ls_h", "rp_ohm", "xp_ohm", "cp_f", "lp_h", "d", "q", "phase_z_deg",
    "phase_y_deg", "magnitude_dbohm", "magnitude_dbs",
)  # fmt: skip


def read(text: Text) -> Reading | None:
    """Read the file; ``None`` without a header that names a frequency."""
    header = text.find(_names_frequency, 0, 200)
    if header is None:
        return None
    lines = list(text.lines)
    lines[header] = lines[header].lstrip(_COMMENT)
    text = Text(text.name, tuple(lines), text.ended)
    mark = separator(lines[header])
    if set(TWO_PORT) <= {name.lower() for name in split(lines[header], mark)}:
        return _two_port(read_table(text, header, header + 1, None, mark), described(lines[:header]))
    return from_header(text, header, FORMAT)


def read_stated(text: Text, columns: Sequence[str], headings: Sequence[Heading]) -> Reading:
    """Read a table with given columns, from the first row of numbers on; lines above are ignored.

    Raise SpectrumError if no row has a number for each name.
    """
    first, mark = _first_row(text, columns)
    table = read_table(text, None, first, None, mark, columns)
    above = [line for line in text.lines[:first] if line.strip()]
    metadata = {**described(above), "columns": ",".join(columns)}
    reading = from_headings(table, list(headings), FORMAT, metadata, first)
    reading.cautions += _contradicted(split(above[-1].lstrip(_COMMENT), mark) if above else [], headings)
    return reading


def stated(columns: Sequence[str]) -> list[Heading]:
    """Return the meanings of given columns.

    Raise ParameterError for a name that is unknown, has no unit or occurs twice, or if they make no admittance.
    """
    headings = [Heading(name) if name == "-" else heading(name) for name in columns]
    kinds: dict[str, str] = {}
    for item in headings:
        if item.cell == "-":
            continue
        if item.kind is None:
            check_keys({item.cell: None}, _STATED, "columns", "")
            continue
        if item.fault:
            example = next(name for name in _STATED if heading(name).kind == item.kind)
            raise ParameterError(f"columns: {item.fault}. Write it as {example}.")
        if item.kind in kinds:
            raise ParameterError(
                f"columns: {quote(kinds[item.kind])} and {quote(item.cell)} are the same quantity. "
                "Write - for a column that does not count."
            )
        kinds[item.kind] = item.cell
    if "frequency" not in kinds:
        raise ParameterError(f"columns = {','.join(columns)} has no frequency. Add frequency_hz at its place.")
    if pair_of(with_named_phase(dict.fromkeys(kinds, np.zeros(0)))) is None and not set(kinds) <= {"frequency", *ALONE}:
        raise ParameterError(f"columns = {','.join(columns)} makes no admittance. Give {A_PAIR}, as in {_EXAMPLE}.")
    return headings


def _first_row(text: Text, columns: Sequence[str]) -> tuple[int, str | None]:
    """Return the line of the first row of numbers, and what separates its cells."""
    other: tuple[int, int] | None = None  # line and number of cells of a row of numbers of another width
    for index, line in enumerate(text.lines):
        if not line.strip() or len(line) > _LONGEST or line[0] in "#!%":
            continue
        for mark in (*SEPARATORS, None):
            cells = split(line, mark)
            while len(cells) > len(columns) and not cells[-1]:
                cells.pop()
            if len(cells) == len(columns):
                counted = [cell for cell, name in zip(cells, columns, strict=True) if name != "-"]
                if _numbers(counted, mark):
                    return index, mark
            elif other is None and len(cells) > 1 and _numbers(cells, mark):
                other = index, len(cells)
    if other is None:
        raise SpectrumError(f"{text.name} has no row of {len(columns)} numbers, one for each of {','.join(columns)}.")
    found = f"{other[1]} columns, but columns states {len(columns)}"
    raise text.refusal(other[0], found, "a name for each, - for one that does not count")


def _numbers(cells: Sequence[str], mark: str | None) -> bool:
    """Whether all cells are numbers, with a decimal comma unless commas separate them."""
    return all(number(cell if mark == "," else cell.replace(",", ".")) is not None for cell in cells) and any(cells)


def _contradicted(header: Sequence[str], headings: Sequence[Heading]) -> list[str]:
    """Tell the columns whose header names another quantity than the user."""
    if len(header) != len(headings):
        return []
    pairs = [(heading(cell), item) for cell, item in zip(header, headings, strict=True)]
    return [
        f"The column headed {quote(found.cell)} was read as {item.cell}, as specified."
        for found, item in pairs
        if found.kind and item.kind and found.kind.partition("_")[0] != item.kind.partition("_")[0]
    ]


def _names_frequency(line: str) -> bool:
    if len(line) > _LONGEST:
        return False
    cells = split(line.lstrip(_COMMENT), separator(line.lstrip(_COMMENT)))
    kinds = [heading(cell).kind for cell in cells]
    return "frequency" in kinds and (len(cells) > 2 or not {*ALONE}.isdisjoint(kinds))


def _two_port(table: Table, metadata: dict[str, str]) -> Reading:
    names = [name.lower() for name in table.names]
    if "frequency_hz" not in names:
        raise table.text.refusal(table.indices[0] - 1, "no column frequency_hz", "one beside those of the two-port")
    frequency, *parts = table.numbers([names.index(name) for name in ("frequency_hz", *TWO_PORT)])
    entries = [real + 1j * imag for real, imag in zip(parts[::2], parts[1::2], strict=True)]
    return Reading(
        table.text, TWO_PORT_FORMAT, frequency, np.array(table.indices), dict(zip(TWO_PORT, parts, strict=True)),
        matrix_s=np.stack(entries, axis=-1).reshape(-1, 2, 2), metadata=metadata, cautions=table.cut,
    )  # fmt: skip
