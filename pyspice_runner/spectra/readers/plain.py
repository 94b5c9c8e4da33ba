# SPDX-License-Identifier: GPL-3.0-or-later
"""Plain CSV whose header names quantity and unit, and the two-port that ``piezomotor admittance --output`` writes.

Such as ``frequency_hz,conductance_s,susceptance_s``, ``Frequency (kHz); |Z| (kOhm); Phase (deg)`` or
``f/Hz  Re(Z)/Ω  -Im(Z)/Ω``: commas, semicolons, tabs or spaces; comments above, after ``#``, ``!`` or ``%``.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from pyspice_runner.spectra.readers.quantities import heading
from pyspice_runner.spectra.readers.reading import Reading, cut_warning, from_headings
from pyspice_runner.spectra.readers.table import Table, read_table, separator, split
from pyspice_runner.spectra.readers.text import Text, described

FORMAT = "plain CSV"
TWO_PORT_FORMAT = "two-port CSV"
_COMMENT = "#!% \t"
_TWO_PORT = tuple(f"y_{into}{by}_{part}_s" for into, by, part in product("ab", "ab", ("real", "imag")))


def read(text: Text, _trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it has no header that names a frequency."""
    header = text.find(_names_frequency, 0, 200)
    if header is None:
        return None
    line = text.lines[header].lstrip(_COMMENT)
    mark = separator(line)
    table = _table(text, header, mark)
    metadata = described(text.lines[:header])
    if set(_TWO_PORT) <= {name.lower() for name in table.names}:
        return _two_port(table, metadata)
    return from_headings(table, [heading(cell) for cell in table.names], FORMAT, metadata, header)


def _names_frequency(line: str) -> bool:
    if len(line) > 4000:
        return False
    cells = split(line.lstrip(_COMMENT), separator(line.lstrip(_COMMENT)))
    return len(cells) >= 3 and any(heading(cell).kind == "frequency" for cell in cells)


def _table(text: Text, header: int, mark: str | None) -> Table:
    """Read the table; the header may stand behind a comment's sign."""
    lines = list(text.lines)
    lines[header] = lines[header].lstrip(_COMMENT)
    return read_table(Text(text.name, tuple(lines), text.ended), header, header + 1, None, mark)


def _two_port(table: Table, metadata: dict[str, str]) -> Reading:
    names = [name.lower() for name in table.names]
    if "frequency_hz" not in names:
        raise table.text.refusal(table.indices[0] - 1, "no column frequency_hz", "one beside those of the two-port")
    frequency, *parts = table.numbers([names.index(name) for name in ("frequency_hz", *_TWO_PORT)])
    entries = [real + 1j * imag for real, imag in zip(parts[::2], parts[1::2], strict=True)]
    matrix = np.stack(entries, axis=-1).reshape(-1, 2, 2)
    reading = Reading(table.text, TWO_PORT_FORMAT, frequency, np.array(table.indices), metadata=metadata)
    reading.matrix_s = matrix
    reading.columns = dict(zip(_TWO_PORT, parts, strict=True))
    reading.warnings += cut_warning(table)
    return reading
