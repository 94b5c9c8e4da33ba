# SPDX-License-Identifier: GPL-3.0-or-later
"""A file as lines of text, and a table of numbers in it: encodings, line ends, separators, both decimal signs."""

from __future__ import annotations

import csv
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import SpectrumError

Floats = NDArray[np.float64]

MOST_BYTES = 16 * 2**20  # about 200 000 points; an analyser writes 801 or 1601
_LARGEST = 10 * MOST_BYTES  # of a workbook, whose XML takes about ten times the text of its cells

_ZIP = b"PK\x03\x04"  # an .xlsx file is a ZIP archive
_LINE_END = re.compile(r"\r\n|\r|\n")
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_DECODERS = ((BOM_UTF8, "utf-8"), (BOM_UTF16_LE, "utf-16-le"), (BOM_UTF16_BE, "utf-16-be"))
_UNMARKED = ("utf-8", "cp1252", "latin-1")  # tried without a byte-order mark
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_LONGEST_NUMBER = 60
_COMMENTS = ("#", "!", "%")  # start of a line
SEPARATORS = (";", "\t", ",")  # in this order, since a comma may be a decimal sign
_MISSING = frozenset(
    ("", "nan", "+nan", "-nan", "inf", "+inf", "-inf", "1.#qnan", "1.#inf", "-1.#inf", "-", "--", "---", "ol", "ovl",
     "overflow", "overload", "n/a", "#n/a", "#num!", "#div/0!")
)  # fmt: skip
_OVERFLOW = (9.9e37, 9.91e37)  # infinity and not a number after SCPI 1999.0, volume 1, 7.2.1


@dataclass(frozen=True)
class Text:
    """The lines of a file."""

    name: str  # printable name of the file
    lines: tuple[str, ...]  # its lines, without line ends; line 1 of the file is ``lines[0]``
    ended: bool = True  # whether the last line has a line end; if not, the file may have been cut within it

    @property
    def cut(self) -> list[str]:
        """The caution for a last line without an end, which readers leave out, if there is one."""
        last = f"Line {len(self.lines)}, the last, has no line end and may be cut short, so it was left out."
        return [] if self.ended else [last]

    def refusal(self, index: int, found: str, expected: str) -> SpectrumError:
        """Return the error for a line, with the text found and the text expected."""
        return SpectrumError(f"{self.name}, line {index + 1}: {found}; expected {expected}.")

    def find(self, accept: Callable[[str], object], start: int = 0, stop: int | None = None) -> int | None:
        """Return the index of the first line that is accepted, or ``None``."""
        return next((index for index, line in enumerate(self.lines[start:stop], start) if accept(line)), None)


def load(path: str | Path) -> Text:
    """Return a file's lines; of an Excel workbook (.xlsx) the rows of its first sheet, with tabs between the cells.

    Raise SpectrumError if it is no regular file, too large, empty or not text.
    """
    path = Path(path)
    name = clean(path.name or str(path), 80)
    try:
        path.stat()  # raises an error where there is nothing
        if not path.is_file():
            raise ValueError("it is not a regular file")
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or clean(str(error), 80)
        raise SpectrumError(f"Cannot read {name}: {reason}. Give the file of a measured spectrum.") from None
    if len(data) > MOST_BYTES:
        raise SpectrumError(f"{name} has more than {MOST_BYTES // 2**20} MiB. Export fewer points.")
    # DOS ended its text files with Ctrl-Z
    content = _sheet(data, name) if data.startswith(_ZIP) else decode(data.rstrip(b"\x1a"), name)
    if not content.strip():
        raise SpectrumError(f"{name} is empty; expected a measured spectrum.")
    lines = _LINE_END.split(content)
    ended = not lines[-1].strip()
    return Text(name, tuple(lines[:-1] if ended else lines), ended)


def _sheet(data: bytes, name: str) -> str:
    """Return the first sheet of a workbook as text, a line for each row, so that messages name the row."""
    try:
        from openpyxl import load_workbook
    except ImportError:
        raise SpectrumError(
            f"{name} is an Excel workbook or another ZIP archive; a workbook needs openpyxl. Install it: `pip install "
            "'piezomotor[excel]'`; or save the sheet as CSV."
        ) from None
    try:
        unpacked = sum(part.file_size for part in ZipFile(BytesIO(data)).infolist())
        book = load_workbook(BytesIO(data), read_only=True, data_only=True) if unpacked < _LARGEST else None
        rows = list(book.worksheets[0].values) if book else None
    except Exception as error:  # noqa: BLE001 # a damaged file makes openpyxl raise errors of any type
        fault = clean(str(error), 80)
        raise SpectrumError(f"{name} is no Excel workbook that can be read: {fault}; save the sheet as CSV.") from None
    if rows is None:
        raise SpectrumError(f"{name} has more than {_LARGEST // 2**20} MiB unpacked. Export fewer points.")
    cells = (["" if cell is None else " ".join(str(cell).split()) for cell in row] for row in rows)
    return "".join("\t".join(row).rstrip("\t") + "\n" for row in cells)


def decode(data: bytes, name: str) -> str:
    """Decode UTF-8, UTF-16 with a byte-order mark or Windows' Western European, or raise SpectrumError."""
    mark, attempts = next(((m, (e,)) for m, e in _DECODERS if data.startswith(m)), (b"", _UNMARKED))
    data = data.removeprefix(mark)
    for encoding in attempts:
        try:
            content = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        control = _CONTROL.search(content)
        if not control:
            return content
        line = len(_LINE_END.findall(content, 0, control.start())) + 1
        raise SpectrumError(f"{name}, line {line}: a control character, so this is not text; expected a text export.")
    raise SpectrumError(f"{name} is not text in UTF-8, UTF-16 or Latin-1; export the spectrum as a text file.")


def clean(text: str, most: int) -> str:
    """Return text from a file for display: printable, on one line, and short."""
    flat = " ".join("".join(c if c.isprintable() else " " for c in text[: 4 * most]).split())
    return flat if len(flat) <= most else flat[: most - 1] + "…"


def quote(text: str) -> str:
    """Return text from a file in quotes, for a message."""
    return f"“{clean(text, 40)}”"


def describe(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return the metadata of a measurement: the first forty entries, printable and short."""
    metadata: dict[str, str] = {}
    for key, value in pairs:
        if len(metadata) == 40:
            break
        if (name := clean(key, 40)) and (shown := clean(value, 120)):
            metadata.setdefault(name, shown)
    return metadata


def described(lines: Iterable[str], bare: str = "comment") -> dict[str, str]:
    """Return the metadata in lines such as ``# Date: today``; the key of a line without a colon is ``bare``."""
    entries = (line[:400].strip(' \t#!%",;').partition(":") for line in lines)
    return describe((key, value) if colon else (bare, key) for key, colon, value in entries)


# --- tables ---


@dataclass(frozen=True)
class Table:
    """A header and its rows, as strings; :meth:`numbers` converts columns."""

    text: Text  # the file
    names: tuple[str, ...]  # cells of the header
    rows: tuple[list[str], ...]  # cells of each row
    indices: tuple[int, ...]  # line of each row, counted from 0
    cut: list[str]  # caution for an omitted last row, within which the file may end

    def numbers(self, columns: list[int]) -> list[Floats]:
        """Return columns as numbers; NaN for an empty cell or a mark of a missing value.

        Raise SpectrumError for a cell that is not a number, or if both decimal signs occur.
        """
        commas = [any("," in row[column] for row in self.rows) for column in columns]
        if any(commas):
            for index, row in zip(self.indices, self.rows, strict=True):
                if point := next((row[column] for column in columns if "." in row[column]), None):
                    raise self.text.refusal(
                        index, f"{quote(point)} has a decimal point where others have a comma", "one decimal sign"
                    )
        values = np.empty((len(columns), len(self.rows)))
        for at, (column, comma) in enumerate(zip(columns, commas, strict=True)):
            name = f" in column {quote(self.names[column])}" if self.names[column] else ""
            for place, row in enumerate(self.rows):
                value = number(row[column].replace(",", ".") if comma else row[column])
                if value is None:
                    raise self.text.refusal(self.indices[place], f"{quote(row[column])}{name} is no number", "a number")
                values[at, place] = value
        return list(values)


def number(cell: str) -> float | None:
    """Return a cell's number, NaN for a missing one, ``None`` for anything else."""
    if len(cell) <= _LONGEST_NUMBER and _NUMBER.fullmatch(cell):
        value = float(cell)
        return np.nan if abs(value) in _OVERFLOW else value if abs(value) < 1e300 else None
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
    omitted, as ``cut`` of the table says. Raise SpectrumError for a row with another number of cells than the header,
    or with fewer than two rows.
    """
    names = split(text.lines[header], mark) if header is not None else list(names) if names else None
    while names and not names[-1]:  # a separator at the end of the header
        names.pop()
    last = len(text.lines) if stop is None else stop
    cut = text.cut if stop is None else []
    rows, indices = [], []
    for index in range(start, last - len(cut)):
        line = text.lines[index]
        if not line.strip() or line.lstrip().startswith(_COMMENTS):
            continue
        cells = split(line, mark)
        if header is not None and cells == names:  # repeated above each sweep
            continue
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
