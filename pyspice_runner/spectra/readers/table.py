# SPDX-License-Identifier: GPL-3.0-or-later
"""A table of numbers in a text: separators, quotes and both decimal signs."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import SpectrumError
from pyspice_runner.spectra.readers.text import Text, quote

Floats = NDArray[np.float64]

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_LONGEST_NUMBER = 60
SEPARATORS = (";", "\t", ",")  # in this order, since a comma may be a decimal sign
_MISSING = frozenset(
    {"", "nan", "+nan", "-nan", "inf", "+inf", "-inf", "1.#qnan", "1.#inf", "-1.#inf", "-", "--", "---"}
)


@dataclass(frozen=True)
class Table:
    """A header and its rows, as strings; numbers are made of the columns that a reader asks for.

    Attributes:
        text: where the table stands.
        names: the header's cells.
        rows: the cells of each row.
        indices: the line of each row, counted from 0.
        cut: line of a last row that was left out because the file may end within it.
    """

    text: Text
    names: tuple[str, ...]
    rows: tuple[list[str], ...]
    indices: tuple[int, ...]
    cut: int | None = None

    def numbers(self, columns: list[int]) -> list[Floats]:
        """Return columns as numbers; NaN where a cell is empty or says that there is none.

        Raises:
            SpectrumError: for a cell that is no number, or if both decimal signs occur.
        """
        commas = [any("," in row[column] for row in self.rows) for column in columns]
        if any(commas):
            for index, row in zip(self.indices, self.rows, strict=True):
                if point := next((row[column] for column in columns if "." in row[column]), None):
                    raise self.text.refusal(
                        index, f"{quote(point)} has a decimal point where others have a comma", "one decimal sign"
                    )
        return [self._column(column, comma) for column, comma in zip(columns, commas, strict=True)]

    def _column(self, column: int, comma: bool) -> Floats:
        values = np.empty(len(self.rows))
        for place, row in enumerate(self.rows):
            cell = row[column].replace(",", ".") if comma else row[column]
            value = number(cell)
            if value is None:
                name = f" in column {quote(self.names[column])}" if self.names[column] else ""
                raise self.text.refusal(self.indices[place], f"{quote(row[column])}{name} is no number", "a number")
            values[place] = value
        return values


def number(cell: str) -> float | None:
    """Return a cell's number, NaN for a missing one, ``None`` for anything else."""
    if len(cell) <= _LONGEST_NUMBER and _NUMBER.fullmatch(cell):
        value = float(cell)
        return value if abs(value) < 1e300 else None
    return np.nan if cell.lower() in _MISSING else None


def separator(header: str) -> str | None:
    """Return what separates the cells of a header; ``None`` for white space."""
    return next((mark for mark in SEPARATORS if mark in header), None)


def split(line: str, mark: str | None) -> list[str]:
    """Return the cells of a line, without quotes."""
    if mark is None:
        return [cell.strip('"') for cell in line.split()]
    if '"' not in line:
        return [cell.strip() for cell in line.split(mark)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]
    except (csv.Error, StopIteration):
        return [cell.strip().strip('"') for cell in line.split(mark)]


def read_table(
    text: Text,
    header: int | None,
    start: int,
    stop: int | None = None,
    mark: str | None = ",",
    names: Sequence[str] | None = None,
) -> Table:
    """Read the rows of a table from line ``start`` up to ``stop`` (exclusive; ``None``: the file's end).

    The header stands in line ``header``, or is ``names``. A last line without an end may have been cut within a number;
    it is left out, and the table says so.

    Raises:
        SpectrumError: for a row whose cells are not those of the header, or if fewer than two are there.
    """
    names = split(text.lines[header], mark) if header is not None else list(names) if names else None
    while names and not names[-1]:  # a separator at the end of the header
        names.pop()
    last = len(text.lines) if stop is None else stop
    cut = last - 1 if stop is None and not text.ended else None
    rows, indices = [], []
    for index in range(start, last if cut is None else cut):
        line = text.lines[index]
        if not line.strip():
            continue
        cells = split(line, mark)
        if names is None:
            names = [""] * len(cells)
        while len(cells) > len(names) and not cells[-1]:
            cells.pop()
        if len(cells) != len(names):
            raise text.refusal(index, f"{_columns(len(cells))}", f"{len(names)}, as in the line before or the header")
        rows.append(cells)
        indices.append(index)
    if len(rows) < 2:
        where = (header if header is not None else start) + 1
        raise SpectrumError(f"{text.name}, line {where}: {_points(len(rows))} follow; expected at least 2.")
    return Table(text, tuple(names or ()), tuple(rows), tuple(indices), cut)


def _columns(count: int) -> str:
    return "1 column" if count == 1 else f"{count} columns"


def _points(count: int) -> str:
    return {0: "no complete points", 1: "1 complete point and no more"}.get(count, f"{count} points")
