# SPDX-License-Identifier: GPL-3.0-or-later
"""NanoVNA, CSV with the reflection and the impedance: ``Frequency(Hz),Return Loss(dB),Phase(deg),Rs,SWR,Xs,|Z|,Theta``.

No unit is named for the last columns: they are in ohms, *Theta* in degrees. *Phase(deg)* is that of the reflection.
"""

from __future__ import annotations

from math import pi

from pyspice_runner.spectra.readers.quantities import Heading
from pyspice_runner.spectra.readers.reading import Reading, from_headings, swept
from pyspice_runner.spectra.readers.table import read_table, separator, split
from pyspice_runner.spectra.readers.text import Text

FORMAT = "NanoVNA CSV"
_COLUMNS = {"frequency(hz)": ("frequency", 1.0), "rs": ("r", 1.0), "xs": ("x", 1.0)} | {
    "|z|": ("abs_z", 1.0),
    "theta": ("phase_z", pi / 180),
}


def read(text: Text, _trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it is of another format."""
    header = text.find(lambda line: line.strip() and line[0] not in "#!", 0, 50)
    if header is None:
        return None
    mark = separator(text.lines[header])
    names = [cell.lower().replace(" ", "") for cell in split(text.lines[header], mark)]
    if not {"frequency(hz)", "returnloss(db)"} <= set(names):
        return None
    if not {"rs", "xs"} <= set(names):
        raise text.refusal(header, "no columns Rs and Xs", "a NanoVNA file with the impedance, or its .s1p")
    table = read_table(text, header, header + 1, None, mark)
    cells = zip(table.names, (name.lower().replace(" ", "") for name in table.names), strict=True)
    headings = [Heading(cell, *_COLUMNS[name]) if name in _COLUMNS else Heading(cell) for cell, name in cells]
    return swept(from_headings(table, headings, FORMAT, {}, header))
