# SPDX-License-Identifier: GPL-3.0-or-later
"""Instrument exports that are one table: most are a header and how to read a column.

=======================  ==============================================================================================
Keysight E4990A          lines of ``!``, ``BEGIN CH1_DATA``, the header, the points, ``END``. A trace is headed
                         ``theta-z(deg)-data``; a suffix ``mem…`` in place of ``data`` marks a memory trace.
Omicron Bode 100         ``Trace 1: Impedance: Real (Ω)``: for each trace its real and imaginary part, then the
                         displayed quantities. Semicolons or commas, decimal sign of the computer's language.
Digilent WaveForms       lines of ``#``, then ``Frequency (Hz),Trace th (deg),Trace |Z| (Ohm),…``. Columns without
                         ``Trace`` are other channels.
NanoVNA                  ``Frequency(Hz),Return Loss(dB),Phase(deg),Rs,SWR,Xs,|Z|,Theta``. The last columns are in Ω,
                         *Theta* in degrees; *Phase(deg)* is the phase of the reflection.
AIM (Array Solutions)    by position: frequency in MHz, SWR, series R, series X, |Z|, θ in degrees, …
MFIA, MFLI (Zurich       LabOne's sweeper: a line for each field and sweep, ``chunk;timestamp;size;fieldname;value;…``,
Instruments)             padded with ``nan``: ``frequency`` (or ``grid``), ``realz`` and ``imagz``, or ``absz`` and
                         ``phasez`` in radians.
=======================  ==============================================================================================
"""

from __future__ import annotations

import re
from collections.abc import Callable
from math import pi

import numpy as np

from pyspice_runner.errors import SpectrumError
from pyspice_runner.impedance.readers.quantities import Heading, heading
from pyspice_runner.impedance.readers.reading import MEMORY_NOTE, Reading, from_header, swept, wants_memory
from pyspice_runner.impedance.readers.text import Floats, Text, clean, number, quote, read_table, separator, split

_E4990A_BEGIN = re.compile(r"BEGIN CH[0-9]+_DATA")
_E4990A_MEMORY = re.compile(r"[)\]]\s*-\s*mem", re.IGNORECASE)


def read_e4990a(text: Text, trace: str | None) -> Reading | None:
    """Read an E4990A file; ``None`` if it is in another format."""
    begin = text.find(lambda line: _E4990A_BEGIN.match(line.strip()), 0, 100)
    if begin is None:
        return None
    end = text.find(lambda line: line.strip() == "END", begin)
    if end is None:
        last = len(text.lines) - 1
        raise text.refusal(last, "the file ends here, so it was cut short", "a line END after the points")
    header = text.lines[begin + 1]
    there = any(_E4990A_MEMORY.search(name) for name in split(header, separator(header)))
    wanted = wants_memory(text, trace, there)

    def meaning(name: str) -> Heading:
        item = heading(name)
        return item if item.kind == "frequency" or bool(_E4990A_MEMORY.search(name)) == wanted else Heading(name)

    reading = from_header(text, begin + 1, "Keysight E4990A CSV", meaning, end, text.lines[:begin], "instrument")
    if there and not wanted:
        reading.cautions.append(MEMORY_NOTE)
    if text.find(lambda line: _E4990A_BEGIN.match(line.strip()), end) is not None:
        reading.cautions.append(f"The file holds several channels; {text.lines[begin].strip()[6:]} was read.")
    return reading


_BODE_HEADER = re.compile(r'"?Frequency \([kMG]?Hz\)"?[;,\t]"?Trace \d+: ')
_BODE_PARTS = {"Magnitude": "mag", "Phase": "phase", "Real": "re", "Imaginary": "im"}
_BODE_COLUMN = re.compile(r"Trace \d+: (Impedance|Admittance): (.+)")


def _bode_column(cell: str) -> Heading:
    """Return the meaning of a column; gain and reflection are ignored."""
    match = _BODE_COLUMN.match(cell)
    if not match:
        return heading(cell) if cell.startswith("Frequency") else Heading(cell)
    side, part = "z" if match[1] == "Impedance" else "y", match[2].strip()
    word = part.partition(" ")[0]
    return heading(part.replace(word, _BODE_PARTS[word] + side, 1) if word in _BODE_PARTS else part)


_CHANNEL = re.compile(r"Trace\s+(.+)", re.IGNORECASE)


def _waveforms_header(text: Text) -> int | None:
    header = text.find(lambda line: line.strip() and not line.lstrip().startswith("#"), 0, 200)
    if header is None or not text.lines[header].lstrip('" ').startswith("Frequency"):
        return None
    names = text.lines[header].lower()
    if "trace " in names and "trace 1:" not in names:
        return header
    if not text.lines[0].lower().startswith("#digilent waveforms"):
        return None
    raise text.refusal(header, "no column of an impedance", "the export of WaveForms' impedance analyser")


def _waveforms_column(cell: str) -> Heading:
    """Return the meaning of a column; other channels (voltages, references) are ignored."""
    if match := _CHANNEL.fullmatch(cell):
        return heading(match[1])
    return heading(cell) if cell.lower().startswith("frequency") else Heading(cell)


_NANOVNA_FORMAT = "NanoVNA CSV"
_NANOVNA = {
    "frequency(hz)": ("frequency", 1.0), "rs": ("r", 1.0), "xs": ("x", 1.0), "|z|": ("abs_z", 1.0),
    "theta": ("phase_z", pi / 180),
}  # fmt: skip


def _nanovna_header(text: Text) -> int | None:
    header = text.find(lambda line: line.strip() and line[0] not in "#!", 0, 50)
    if header is None:
        return None
    names = {cell.lower().replace(" ", "") for cell in split(text.lines[header], separator(text.lines[header]))}
    if not {"frequency(hz)", "returnloss(db)"} <= names:
        return None
    if not {"rs", "xs"} <= names:
        raise text.refusal(header, "no columns Rs and Xs", "a NanoVNA file with the impedance, or its .s1p")
    return header


def _nanovna_column(cell: str) -> Heading:
    return Heading(cell, *_NANOVNA.get(cell.lower().replace(" ", ""), ()))


def read_aim(text: Text) -> Reading | None:
    """Read an AIM file; ``None`` if it is in another format."""
    header = text.find(lambda line: line.strip(), 0, 20)
    names = text.lines[header].lower().lstrip('" ') if header is not None else ""
    if header is None or not names.startswith("freq") or "swr" not in names or "hz" in names.replace("mhz", ""):
        return None
    start = text.find(_is_aim_point, header + 1, header + 20)
    if start is None:
        return None
    table = read_table(text, None, start, None, ",")
    frequency, r, x, size, angle = table.numbers([0, 2, 3, 4, 5])
    columns = {"r": r, "x": x, "abs_z": size, "phase_z": np.deg2rad(angle)}
    indices = np.array(table.indices)
    return swept(Reading(text, "AIM CSV", frequency * 1e6, indices, columns, cautions=table.cut))


def _is_aim_point(line: str) -> bool:
    cells = split(line, ",")
    return 6 <= len(cells) <= 12 and all(number(cell) is not None for cell in cells)


_MFIA_FIELDS = {"realz": "r", "imagz": "x", "absz": "abs_z", "phasez": "phase_z"}
_MFIA_WANTED = {*_MFIA_FIELDS, "frequency", "grid"}


def read_mfia(text: Text, trace: str | None) -> Reading | None:
    """Read an MFIA or MFLI file; ``None`` if it is in another format."""
    header = text.find(lambda line: line.lower().lstrip('" ').startswith("chunk"), 0, 50)
    if header is None or "fieldname" not in text.lines[header].lower():
        return None
    mark = separator(text.lines[header])
    names = [cell.lower() for cell in split(text.lines[header], mark)]
    if names[:4] != ["chunk", "timestamp", "size", "fieldname"]:
        raise text.refusal(header, f"the header {quote(text.lines[header])}", "“chunk;timestamp;size;fieldname”")
    sweeps = _mfia_sweeps(text, header, mark)
    order = sorted(sweeps, key=lambda name: (len(name), name))
    wanted = order[0] if trace is None else trace
    if wanted not in sweeps:
        there = ", ".join(clean(name, 10) for name in order[:20])
        raise SpectrumError(f"{text.name} has no sweep {quote(wanted)}; it has {there}.")
    fields = sweeps[wanted]
    frequency = fields.get("frequency", fields.get("grid"))
    columns = {kind: fields[name][1] for name, kind in _MFIA_FIELDS.items() if name in fields}
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
        text, "Zurich Instruments MFIA CSV", frequency[1][:size], np.full(size, frequency[0]),
        {kind: values[:size] for kind, values in columns.items()}, "rad", metadata={"sweep": wanted}, cautions=cautions,
    )  # fmt: skip


def _mfia_sweeps(text: Text, header: int, mark: str | None) -> dict[str, dict[str, tuple[int, Floats]]]:
    """Return chunk → field → (line, values)."""
    sweeps: dict[str, dict[str, tuple[int, Floats]]] = {}
    for index in range(header + 1, len(text.lines)):
        cells = split(text.lines[index], mark)
        if not any(cells):
            continue
        if len(cells) < 5 or not cells[2].isdecimal() or len(cells[2]) > 7:
            raise text.refusal(index, quote(text.lines[index]), "“chunk;timestamp;size;fieldname;values…”")
        fields, name = sweeps.setdefault(clean(cells[0], 20), {}), cells[3].lower()
        if name not in _MFIA_WANTED:
            continue
        if name in fields:
            raise text.refusal(index, f"a second line of {name} in sweep {quote(cells[0])}", "one")
        fields[name] = index, _mfia_values(text, index, cells)
        if len({values.size for _, values in fields.values()}) > 1:
            raise text.refusal(index, "the fields of this sweep differ in size", "one size")
    if not sweeps:
        raise text.refusal(header, "no values follow", "lines of frequency, realz and imagz")
    return sweeps


def _mfia_values(text: Text, index: int, cells: list[str]) -> Floats:
    size = int(cells[2])
    cut = index == len(text.lines) - 1 and not text.ended and len(cells) - 4 <= size
    if len(cells) - 4 < size or cut:
        raise text.refusal(index, f"the line ends within its {size} values", "a file that was not cut short")
    values = [number(cell) for cell in cells[4 : 4 + size]]
    if None in values:
        cell = cells[4 + values.index(None)]
        raise text.refusal(index, f"{quote(cell)} among the values of {cells[3].lower()}", "numbers")
    return np.array(values, dtype=float)


# of the formats that are one table: the line of the header, ``None`` in another format; the meaning of a heading
_TABLES: dict[str, tuple[Callable[[Text], int | None], Callable[[str], Heading]]] = {
    "Omicron Bode 100 CSV": (lambda text: text.find(_BODE_HEADER.match, 0, 200), _bode_column),
    "Digilent WaveForms CSV": (_waveforms_header, _waveforms_column),
    _NANOVNA_FORMAT: (_nanovna_header, _nanovna_column),
}


def read(text: Text) -> Reading | None:
    """Read a Bode 100, WaveForms or NanoVNA file; ``None`` if it is in another format."""
    for name, (header, meaning) in _TABLES.items():
        if (line := header(text)) is not None:
            reading = from_header(text, line, name, meaning)
            return swept(reading) if name == _NANOVNA_FORMAT else reading  # which always sweeps steadily
    return None
