# SPDX-License-Identifier: GPL-3.0-or-later
"""HP, Agilent and Keysight 4294A, ASCII: settings in quotes, then for each trace ``"TRACE: A"``, a header, the points.

The columns of a trace are *Frequency*, *Data Trace Real*, *Data Trace Imag*, and with a saved memory trace *Memory
Trace Real* and *Memory Trace Imag*: the measurement parameter as displayed; the imaginary part of a scalar is 0. *Data
Real* and *Data Imag*, if saved, are R and X, independent of the display.
"""

from __future__ import annotations

import re

import numpy as np

from pyspice_runner.impedance.readers.quantities import heading, pair_of, with_named_phase
from pyspice_runner.impedance.readers.reading import MEMORY_NOTE, Reading, wants_memory
from pyspice_runner.impedance.readers.text import Floats, Table, Text, describe, quote, read_table

FORMAT = "4294A ASCII"
_MODEL = re.compile(r'\s*"?\s*(?:HP |AGILENT )?4294A\b', re.IGNORECASE)
_SETTING = re.compile(r'\s*"([^":]+):\s*(.*?)\s*"\s*')
_HEADER = 60  # lines that may hold settings
_MNEMONICS = {  # of the manuals (GPIB): the quantities of traces A and B
    "IMPH": "abs_z phase", "IRIM": "r x", "LSR": "ls r", "LSQ": "ls q", "CSR": "cs r", "CSQ": "cs q", "CSD": "cs d",
    "AMPH": "abs_y phase", "ARIM": "g b", "LPG": "lp g", "LPQ": "lp q", "CPG": "cp g", "CPQ": "cp q", "CPD": "cp d",
    "COMP": "complex complex", "IMLS": "abs_z ls", "IMCS": "abs_z cs", "IMLP": "abs_z lp", "IMCP": "abs_z cp",
    "IMRS": "abs_z r", "IMQ": "abs_z q", "IMD": "abs_z d", "LPR": "lp rp", "CPR": "cp rp",
}  # fmt: skip
_EXPECTED = "a pair such as IMPEDANCE MAG PHASE (DEG), R-X, Cs-D, ADMITTANCE MAG PHASE (DEG), G-B, Cp-D or COMPLEX Z-Y"


def read(text: Text, trace: str | None) -> Reading | None:
    """Read the file; ``None`` if it is in another format."""
    if not _MODEL.match(text.lines[0]):
        return None
    settings, starts = _settings(text)
    index, parameter = settings.get("MEASURE PARAMETER", (None, ""))
    if index is None:
        raise text.refusal(0, "no line “MEASURE PARAMETER: …” follows", "one, since it names the two traces")
    tables = _traces(text, settings, starts)
    saved = [(table, places) for table in tables.values() if len(places := _places(table, "data")) == 2]
    has_memory = any(_places(item, "memory trace") for item in tables.values())
    memory = wants_memory(text, trace, has_memory)
    described = [("instrument", text.lines[0]), *((key.capitalize(), value) for key, (_, value) in settings.items())]
    cautions = []
    if saved and not memory:  # R and X beside the displayed trace
        table, places = saved[0]
        frequency, r, x = table.numbers([0, *places])
        columns = {"r": r, "x": x}
    else:
        if (pair := parameters(parameter)) is None:
            raise text.refusal(index, f"the parameters {quote(parameter)} are not known", _EXPECTED)
        columns, frequency, table = _displayed(text, tables, pair, "memory" if memory else "data", index)
        cautions = [MEMORY_NOTE] if has_memory and not memory else []
    unit = "rad" if "RAD" in parameter.upper() else "deg"
    if unit == "deg":
        columns = {kind: np.deg2rad(values) if kind == "phase" else values for kind, values in columns.items()}
    columns = with_named_phase(columns)
    if pair_of(columns) is None:
        found = f"{quote(parameter)} does not show whether the reactance is capacitive or inductive"
        raise text.refusal(index, found, _EXPECTED)
    indices = np.array(table.indices)
    return Reading(text, FORMAT, frequency, indices, columns, unit, metadata=describe(described), cautions=cautions)


def parameters(named: str) -> tuple[str, str] | None:
    """Return the quantities of traces A and B by the MEASURE PARAMETER line; ``None`` if unknown."""
    words = re.split(r"[\s_/,-]+", named.upper().strip())
    mnemonic = " ".join(words)
    if mnemonic in _MNEMONICS or "COMPLEX" in mnemonic:
        first, second = _MNEMONICS.get(mnemonic, "complex complex").split()
        return first, second
    found = []
    while words:  # the longest name first, as SERIES CAPACITANCE or PHASE (DEG)
        sizes = (3, 2) if len(words[0]) > 1 else ()  # a letter is a name of its own
        size = next((size for size in sizes if heading(" ".join(words[:size])).kind), 1)
        name, words = " ".join(words[:size]), words[size:]
        kind = "imaginary" if name.startswith("IMAG") else heading(name).kind or ""
        found += ["phase" if kind.startswith("phase") else kind] if kind else []
    if len(found) != 2 or found[0] == found[1] or found[0] in ("imaginary", "phase"):
        return None
    first, second = found
    if second == "imaginary":
        second = {"r": "x", "g": "b"}.get(first, "")
    return (first, second) if second else None


def _settings(text: Text) -> tuple[dict[str, tuple[int, str]], list[tuple[str, int]]]:
    """Return key → (line, value) of the settings above the first trace, and name and line of each trace."""
    settings: dict[str, tuple[int, str]] = {}
    starts: list[tuple[str, int]] = []
    for index, line in enumerate(text.lines):
        if len(line) < 300 and (match := _SETTING.fullmatch(line)):
            key = match[1].strip().upper()
            if key == "TRACE":
                starts.append((match[2].strip().upper(), index))
            elif not starts and index < _HEADER:
                settings.setdefault(key, (index, match[2]))
    return settings, starts


def _traces(text: Text, settings: dict[str, tuple[int, str]], starts: list[tuple[str, int]]) -> dict[str, Table]:
    """Return the tables of traces A and B, of equal length and as long as NUMBER of POINTS says."""
    line, stated = settings.get("NUMBER OF POINTS", (0, ""))
    points = int(stated) if stated.isdecimal() and len(stated) < 7 else None
    tables: dict[str, Table] = {}
    for place, (name, start) in enumerate(starts):
        stop = starts[place + 1][1] if place + 1 < len(starts) else None
        header = text.find(lambda line: line.lstrip().lower().startswith(('"frequency"', "frequency")), start, stop)
        if header is None:
            raise text.refusal(start, f"trace {quote(name)} has no column “Frequency”", "a sweep of the frequency")
        # the last trace extends to the end of the file, so the number of points shows a missing end
        table = read_table(text, header, header + 1, len(text.lines) if stop is None else stop, "\t")
        if points is not None and len(table.rows) != points:
            found = f"trace {quote(name)} ends after {len(table.rows)} points"
            raise text.refusal(table.indices[-1], found, f"{points}, as line {line + 1} says")
        if stop is None and not text.ended and len({len(row[-1].lstrip("+-")) for row in table.rows[-2:]}) > 1:
            raise text.refusal(table.indices[-1], "the file ends within a number", "a file that was not cut short")
        tables.setdefault(name, table)
    if not tables:
        raise text.refusal(len(text.lines) - 1, "the file ends without a line “TRACE: A”", "traces A and B")
    return tables


def _places(table: Table, array: str) -> list[int]:
    """Return the places of the real and the imaginary part of an array such as *Data Trace*, if they are there."""
    cells = [cell.strip('" ').lower() for cell in table.names]
    return [cells.index(name) for name in (f"{array} real", f"{array} imag") if name in cells]


def _displayed(
    text: Text, tables: dict[str, Table], pair: tuple[str, str], wanted: str, index: int
) -> tuple[dict[str, Floats], Floats, Table]:
    """Return the displayed traces by quantity, their frequencies, and a table with their lines."""
    columns: dict[str, Floats] = {}
    frequencies = []
    for name, kind in zip("AB", pair, strict=True):
        table = tables.get(name)
        if table is None:
            raise text.refusal(index, f"trace {name} is missing", "both traces, which make the admittance together")
        places = _places(table, f"{wanted} trace")
        if len(places) < 2:
            found = f"trace {name} has no {wanted} trace"
            raise text.refusal(table.indices[0] - 1, found, f"columns “{wanted.capitalize()} Trace Real”")
        frequency, value, rest = table.numbers([0, *places])
        frequencies.append(frequency)
        if kind == "complex":  # Z in trace A; Y in trace B repeats it
            return {"r": value, "x": rest}, frequency, table
        if rest.any():
            place = table.indices[int(np.argmax(rest != 0.0))]
            found = f"{quote(table.names[places[1]])} of a scalar is not 0"
            raise text.refusal(place, found, "0, or the parameters COMPLEX Z-Y")
        columns[kind] = value
    if not np.array_equal(frequencies[0], frequencies[1]):
        raise text.refusal(tables["B"].indices[0], "trace B has other frequencies than trace A", "the same in both")
    return columns, frequencies[0], tables["A"]
