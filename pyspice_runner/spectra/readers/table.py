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
    ("", "nan", "+nan", "-nan", "inf", "+inf", "-inf", "1.#qnan", "1.#inf", "-1.#inf", "-", "--", "---")
)


@dataclass(frozen=True)
class Table:
    """A header and its rows, as strings; :meth:`numbers` converts columns.

    Attributes:
        text: the file.
        names: cells of the header.
        rows: cells of each row.
        indices: line of each row, counted from 0.
        cut: line of an omitted last row, within which the file may end.
    """

    text: Text
    names: tuple[str, ...]
    rows: tuple[list[str], ...]
    indices: tuple[int, ...]
    cut: int | None = None

    def numbers(self, columns: list[int]) -> list[Floats]:
        """Return columns as numbers; NaN for an empty cell or a mark of a missing value.

        Raises:
            SpectrumError: for a cell that is not a number, or if both decimal signs occur.
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
    """Return the separator of the cells of a header; ``None`` for white space."""
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
    """Read the rows of a table from line ``start`` up to ``stop`` (exclusive; ``None``: end of the file).

    The header is line ``header``, or ``names``. A last line without an end may have been cut within a number; it is
    omitted, as ``cut`` of the table says.

    Raises:
        SpectrumError: for a row with another number of cells than the header, or with fewer than two rows.
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
            found = "1 column" if len(cells) == 1 else f"{len(cells)} columns"
            raise text.refusal(index, found, f"{len(names)}, as in the line before or the header")
        rows.append(cells)
        indices.append(index)
    if len(rows) < 2:
        where = (header if header is not None else start) + 1
        found = "1 complete point and no more" if rows else "no complete points"
        raise SpectrumError(f"{text.name}, line {where}: {found} follow; expected at least 2.")
    return Table(text, tuple(names or ()), tuple(rows), tuple(indices), cut)
