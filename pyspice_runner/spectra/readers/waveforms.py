# SPDX-License-Identifier: GPL-3.0-or-later
"""Digilent WaveForms, CSV of the impedance analyser: lines of ``#``, then ``Frequency (Hz),Trace th (deg),…``.

Each quantity shown is a column headed by its channel, as ``Trace |Z| (Ohm)``, ``Trace Rs (Ohm)``, ``Trace Xs (Ohm)``.
"""

from __future__ import annotations

import re

from pyspice_runner.spectra.readers.quantities import Heading, heading
from pyspice_runner.spectra.readers.reading import Reading, from_headings
from pyspice_runner.spectra.readers.table import read_table, separator
from pyspice_runner.spectra.readers.text import Text, described

FORMAT = "Digilent WaveForms CSV"
_CHANNEL = re.compile(r"Trace\s+(.+)", re.IGNORECASE)


def read(text: Text, _trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it is of another format."""
    header = text.find(lambda line: line.strip() and not line.lstrip().startswith("#"), 0, 200)
    if header is None or not text.lines[header].lstrip('" ').startswith("Frequency"):
        return None
    title = text.lines[0].lower()
    if "trace " not in text.lines[header].lower() or "trace 1:" in text.lines[header].lower():
        if not title.startswith("#digilent waveforms"):
            return None
        raise text.refusal(header, "no column of an impedance", "the export of WaveForms' impedance analyser")
    mark = separator(text.lines[header])
    table = read_table(text, header, header + 1, None, mark)
    headings = [_heading(cell) for cell in table.names]
    return from_headings(table, headings, FORMAT, described(text.lines[:header]), header)


def _heading(cell: str) -> Heading:
    """Return the meaning of a column; those of other channels (voltages, references) are left aside."""
    if match := _CHANNEL.fullmatch(cell):
        return heading(match[1])
    return heading(cell) if cell.lower().startswith("frequency") else Heading(cell)
