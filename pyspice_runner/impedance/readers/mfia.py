# SPDX-License-Identifier: GPL-3.0-or-later
"""Zurich Instruments MFIA and MFLI, CSV of LabOne's sweeper.

One line per field and sweep: ``chunk;timestamp;size;fieldname;value;value;…``, padded with ``nan``. The fields in use
are ``frequency`` (or ``grid``), ``realz`` and ``imagz`` or ``absz`` and ``phasez`` (radians).
"""

from __future__ import annotations

import numpy as np

from pyspice_runner.errors import SpectrumError
from pyspice_runner.impedance.readers.reading import Reading
from pyspice_runner.impedance.readers.text import Floats, Text, clean, number, quote, separator, split

FORMAT = "Zurich Instruments MFIA CSV"
_FIELDS = {"realz": "r", "imagz": "x", "absz": "abs_z", "phasez": "phase_z"}
_WANTED = {*_FIELDS, "frequency", "grid"}


def read(text: Text, trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it is in another format."""
    header = text.find(lambda line: line.lower().lstrip('" ').startswith("chunk"), 0, 50)
    if header is None or "fieldname" not in text.lines[header].lower():
        return None
    mark = separator(text.lines[header])
    names = [cell.lower() for cell in split(text.lines[header], mark)]
    if names[:4] != ["chunk", "timestamp", "size", "fieldname"]:
        raise text.refusal(header, f"the header {quote(text.lines[header])}", "“chunk;timestamp;size;fieldname”")
    sweeps = _sweeps(text, header, mark)
    order = sorted(sweeps, key=lambda name: (len(name), name))
    wanted = order[0] if trace is None else trace
    if wanted not in sweeps:
        there = ", ".join(clean(name, 10) for name in order[:20])
        raise SpectrumError(f"{text.name} has no sweep {quote(wanted)}; it has {there}.")
    fields = sweeps[wanted]
    frequency = fields.get("frequency", fields.get("grid"))
    columns = {kind: fields[name][1] for name, kind in _FIELDS.items() if name in fields}
    if frequency is None or not ({"r", "x"} <= set(columns) or {"abs_z", "phase_z"} <= set(columns)):
        raise text.refusal(
            header, f"sweep {quote(wanted)} has the fields {quote(', '.join(fields))}", "frequency, realz and imagz"
        )
    filled = np.flatnonzero(np.isfinite(frequency[1]))
    size = int(filled[-1]) + 1 if filled.size else 0  # the rest is padding
    cautions = []
    if trace is None and len(sweeps) > 1:
        cautions = [f"The file holds {len(sweeps)} sweeps; the first was read. trace=“{order[1]}” reads the second."]
    return Reading(
        text, FORMAT, frequency[1][:size], np.full(size, frequency[0]),
        {kind: values[:size] for kind, values in columns.items()}, "rad", metadata={"sweep": wanted}, cautions=cautions,
    )  # fmt: skip


def _sweeps(text: Text, header: int, mark: str | None) -> dict[str, dict[str, tuple[int, Floats]]]:
    """Return chunk → field → (line, values)."""
    sweeps: dict[str, dict[str, tuple[int, Floats]]] = {}
    for index in range(header + 1, len(text.lines)):
        cells = split(text.lines[index], mark)
        if not any(cells):
            continue
        if len(cells) < 5 or not cells[2].isdecimal() or len(cells[2]) > 7:
            raise text.refusal(index, quote(text.lines[index]), "“chunk;timestamp;size;fieldname;values…”")
        fields, name = sweeps.setdefault(clean(cells[0], 20), {}), cells[3].lower()
        if name not in _WANTED:
            continue
        if name in fields:
            raise text.refusal(index, f"a second line of {name} in sweep {quote(cells[0])}", "one")
        fields[name] = index, _values(text, index, cells)
        if len({values.size for _, values in fields.values()}) > 1:
            raise text.refusal(index, "the fields of this sweep differ in size", "one size")
    if not sweeps:
        raise text.refusal(header, "no values follow", "lines of frequency, realz and imagz")
    return sweeps


def _values(text: Text, index: int, cells: list[str]) -> Floats:
    size = int(cells[2])
    cut = index == len(text.lines) - 1 and not text.ended and len(cells) - 4 <= size
    if len(cells) - 4 < size or cut:
        raise text.refusal(index, f"the line ends within its {size} values", "a file that was not cut short")
    values = np.empty(size)
    for place, cell in enumerate(cells[4 : 4 + size]):
        if (value := number(cell)) is None:
            raise text.refusal(index, f"{quote(cell)} among the values of {cells[3].lower()}", "numbers")
        values[place] = value
    return values
