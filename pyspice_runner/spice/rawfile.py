# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading of ngspice's binary raw files."""

from __future__ import annotations

import mmap
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_CHUNK = 1 << 14  # points; some MB of a file, so that a pass over it stays in the cache
_FIELD = re.compile(r"^(Plotname|Flags|No\. Variables|No\. Points): *(.*)$", re.M)
_HEADER_LIMIT = 1 << 20  # bytes; a header lists the vectors' names, a few dozen bytes each


@dataclass(frozen=True)
class RawFile:
    """One analysis as ngspice wrote it."""

    plot: str  # ngspice's name of the analysis, such as "Transient Analysis"
    # lower-case vector name → values (real, or complex for AC), in the file's order; views of the file.
    vectors: dict[str, NDArray[np.generic]]
    _table: NDArray[np.generic] | None = field(default=None, repr=False, compare=False)  # of the vectors, (points, n)
    _pages: mmap.mmap | bytes | None = field(default=None, repr=False, compare=False)

    @property
    def points(self) -> int:
        """Number of points of every vector."""
        return len(next(iter(self.vectors.values())))

    def find(self, name: str) -> NDArray[np.generic] | None:
        """Return the vector of ``.save NAME`` (``out`` is ``v(out)``, ``v1#branch`` is ``i(v1)``)."""
        if name in self.vectors:
            return self.vectors[name]
        name = name.lower().replace(" ", "")
        for candidate in (name, f"v({name})", f"i({name})", f"i({name.removesuffix('#branch')})"):
            if candidate in self.vectors:
                return self.vectors[candidate]
        return None

    def missing(self, names: Sequence[str]) -> str | None:
        """Return the first of these vectors that the file does not have."""
        return next((name for name in names if self.find(name) is None), None)

    def beyond(self, largest: float, names: Sequence[str]) -> str | None:
        """Return the first of these vectors with a value that is not finite or larger in magnitude than a limit."""
        with np.errstate(over="ignore", invalid="ignore"):  # in the magnitude of a complex value
            for chunk in self._chunks():
                if self._table is not None and (np.abs(self._table[chunk]) <= largest).all():
                    continue
                for name in names:
                    values = self.find(name)
                    if values is not None and not (np.abs(values[chunk]) <= largest).all():
                        return name
        return None

    def thinned(self, every: int) -> dict[str, NDArray[np.generic]]:
        """Return a copy of every n-th point of the vectors, independent of the file."""
        thin = {name: np.empty_like(values[::every]) for name, values in self.vectors.items()}
        for chunk in self._chunks(every):
            for name, values in self.vectors.items():
                copied = values[chunk][::every]
                first = chunk.start // every
                thin[name][first : first + len(copied)] = copied
        return thin

    def _chunks(self, multiple: int = 1) -> Iterator[slice]:
        """Yield slices of the points, each a multiple of a number, and release the file's pages behind them."""
        size = max(_CHUNK // multiple, 1) * multiple
        for start in range(0, self.points, size):
            yield slice(start, min(start + size, self.points))
            if isinstance(self._pages, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
                self._pages.madvise(mmap.MADV_DONTNEED)


class RawFileError(ValueError):
    """The file is not a complete binary raw file."""


def read_rawfile(path: Path, *, partial: bool = False) -> RawFile:
    """Map a binary raw file that holds one analysis: the vectors are views into the file, which may then be deleted.

    A ``partial`` analysis may have been stopped before it wrote the number of points; then all complete points count.
    Raise RawFileError if the file is missing, truncated, of another format, or holds more than one analysis.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(_HEADER_LIMIT)
    except OSError as error:
        raise RawFileError(f"no raw file was written ({error.strerror})") from error
    marker = head.find(b"\nBinary:\n")
    if marker < 0:
        raise RawFileError("the raw file has no binary part")
    header = head[:marker].decode("utf-8", errors="replace")
    about = dict(_FIELD.findall(header))
    if lacking := {"Plotname", "Flags", "No. Variables", "No. Points"} - about.keys():
        raise RawFileError(f"the raw file's header has no {min(lacking)!r}")
    try:
        count, points = int(about["No. Variables"]), int(about["No. Points"])
        rows = header.split("\nVariables:\n", 1)[1].split("\n")
        names = [row.split()[1].lower() for row in rows if row.strip()]
    except (ValueError, IndexError) as error:
        raise RawFileError("the raw file's header is broken") from error
    kind = np.dtype(complex) if "complex" in about["Flags"] else np.dtype(float)
    start = marker + len(b"\nBinary:\n")
    if partial and count > 0:
        points = (size - start) // (count * kind.itemsize)
    if points < 1:
        raise RawFileError("the raw file holds no points")
    if len(names) != count or len(set(names)) != count:
        raise RawFileError(f"the raw file announces {count} vectors and names {len(set(names))}")
    excess = 0 if partial else size - start - count * points * kind.itemsize
    if excess < 0:
        raise RawFileError(f"the raw file is cut short: it announces {points} points of {count} vectors")
    if excess > 0:
        raise RawFileError("the raw file holds more than one analysis")
    pages: mmap.mmap | bytes
    with path.open("rb") as file:  # Windows deletes no file that is mapped
        pages = file.read() if os.name == "nt" else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    table = np.frombuffer(pages, dtype=kind, count=count * points, offset=start).reshape(points, count)
    return RawFile(about["Plotname"].strip(), dict(zip(names, table.T, strict=True)), table, pages)
