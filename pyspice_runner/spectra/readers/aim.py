# SPDX-License-Identifier: GPL-3.0-or-later
"""AIM antenna analysers (Array Solutions), CSV: points by position, the frequency in MHz.

The columns are frequency in MHz, SWR, series R, series X, |Z|, θ in degrees, reflection coefficient, return loss in dB,
reflected power in percent. Whether there is a header does not matter; the format shows in |Z| and θ being
those of R + jX.
"""

from __future__ import annotations

import numpy as np

from pyspice_runner.spectra.readers.reading import Reading, cut_warning, swept
from pyspice_runner.spectra.readers.table import number, read_table, split
from pyspice_runner.spectra.readers.text import Text

FORMAT = "AIM CSV"
_FEWEST, _MOST = 6, 12


def read(text: Text, _trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it is of another format."""
    start = text.find(_is_point, 0, 20)
    if start is None:
        return None
    above = [line.lower() for line in text.lines[:start] if line.strip()]
    titled = bool(above) and "swr" in above[-1] and above[-1].lstrip('" ').startswith("freq")
    if above and not titled:
        return None
    if not above and not _makes_sense(split(text.lines[start], ",")):
        return None
    if titled and "hz" in above[-1].replace("mhz", ""):
        return None
    table = read_table(text, None, start, None, ",")
    frequency, r, x, size, angle = table.numbers([0, 2, 3, 4, 5])
    columns = {"r": r, "x": x, "abs_z": size, "phase_z": np.deg2rad(angle)}
    indices = np.array(table.indices)
    return swept(Reading(text, FORMAT, frequency * 1e6, indices, columns, warnings=cut_warning(table)))


def _is_point(line: str) -> bool:
    cells = split(line, ",")
    return _FEWEST <= len(cells) <= _MOST and all(number(cell) is not None for cell in cells)


def _makes_sense(cells: list[str]) -> bool:
    """Whether |Z| and θ are those of R + jX, but for rounding."""
    r, x, size, angle = (number(cell) or 0.0 for cell in cells[2:6])
    return bool(abs(np.hypot(r, x) - size) <= 0.02 * size + 0.1 and abs(np.angle(r + 1j * x, deg=True) - angle) < 2.0)
