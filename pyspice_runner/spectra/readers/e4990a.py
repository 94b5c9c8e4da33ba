# SPDX-License-Identifier: GPL-3.0-or-later
"""Keysight and Agilent E4990A, CSV: lines of ``!``, ``BEGIN CH1_DATA``, a header, the points, ``END``.

Each trace is headed as ``theta-z(deg)-data``; what another suffix than ``data`` marks is a memory trace.
"""

from __future__ import annotations

import re

from pyspice_runner.spectra.readers.quantities import Heading, heading
from pyspice_runner.spectra.readers.reading import Reading, from_headings, wants_memory
from pyspice_runner.spectra.readers.table import read_table, separator
from pyspice_runner.spectra.readers.text import Text, described

FORMAT = "Keysight E4990A CSV"
_BEGIN = re.compile(r"BEGIN CH[0-9]+_DATA")
_MEMORY = re.compile(r"[)\]]\s*-\s*mem", re.IGNORECASE)


def read(text: Text, trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it is of another format."""
    begin = text.find(lambda line: _BEGIN.match(line.strip()), 0, 100)
    if begin is None:
        return None
    end = text.find(lambda line: line.strip() == "END", begin)
    if end is None:
        raise text.refusal(
            len(text.lines) - 1, "the file ends here, so it was cut short", "a line END after the points"
        )
    header = begin + 1
    mark = separator(text.lines[header])
    table = read_table(text, header, header + 1, end, mark)
    memory = [bool(_MEMORY.search(name)) for name in table.names]
    wanted = wants_memory(text, trace, any(memory))
    headings = [
        heading(name) if place == 0 or is_memory == wanted else Heading(name)
        for place, (name, is_memory) in enumerate(zip(table.names, memory, strict=True))
    ]
    reading = from_headings(table, headings, FORMAT, described(text.lines[:begin], "instrument"), header)
    if any(memory) and not wanted:
        reading.warnings.append("The file also holds a memory trace; trace=“memory” reads that one.")
    if text.find(lambda line: _BEGIN.match(line.strip()), end) is not None:
        reading.warnings.append(f"The file holds several channels; {text.lines[begin].strip()[6:]} was read.")
    return reading
