# SPDX-License-Identifier: GPL-3.0-or-later
"""Omicron Bode 100, CSV of the Bode Analyzer Suite.

UTF-8 with a byte-order mark, semicolons or commas, the decimal sign of the computer's language. A column is headed
``Trace 1: Impedance: Real (Ω)``; each trace has its real and imaginary part and then what was displayed. With the
measurement's settings, these stand above, after ``---Measurement settings---``.
"""

from __future__ import annotations

import re

from pyspice_runner.spectra.readers.quantities import Heading, heading
from pyspice_runner.spectra.readers.reading import Reading, from_headings
from pyspice_runner.spectra.readers.table import read_table, separator
from pyspice_runner.spectra.readers.text import Text, described

FORMAT = "Omicron Bode 100 CSV"
_HEADER = re.compile(r'"?Frequency \([kMG]?Hz\)"?[;,\t]"?Trace \d+: ')
_PARTS = {"Magnitude": "mag", "Phase": "phase", "Real": "re", "Imaginary": "im"}
_COLUMN = re.compile(r"Trace \d+: (Impedance|Admittance): (.+)")


def read(text: Text, _trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it is of another format."""
    header = text.find(_HEADER.match, 0, 200)
    if header is None:
        return None
    mark = separator(text.lines[header])
    table = read_table(text, header, header + 1, None, mark)
    headings = [_heading(cell) if place else heading(cell) for place, cell in enumerate(table.names)]
    return from_headings(table, headings, FORMAT, described(text.lines[:header]), header)


def _heading(cell: str) -> Heading:
    """Return the meaning of a column; gain and reflection are left aside."""
    match = _COLUMN.match(cell)
    if not match:
        return Heading(cell)
    side = "z" if match[1] == "Impedance" else "y"
    part = match[2].strip()
    word = part.partition(" ")[0]
    return heading(part.replace(word, _PARTS[word] + side, 1) if word in _PARTS else part)
