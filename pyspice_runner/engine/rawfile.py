# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading of ngspice's binary raw files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_HEADER_LIMIT = 1 << 20  # bytes; a header lists the vectors' names, a few dozen bytes each


@dataclass(frozen=True)
class RawFile:
    """One analysis as ngspice wrote it.

    Attributes:
        plot: ngspice's name of the analysis, such as "Transient Analysis".
        vectors: lower-case vector name → values (real, or complex for AC), in the file's order.
    """

    plot: str
    vectors: dict[str, NDArray[np.generic]]

    @property
    def points(self) -> int:
        """Number of points of every vector."""
        return len(next(iter(self.vectors.values())))


class RawFileError(ValueError):
    """The file is not a complete binary raw file."""


def read_rawfile(path: Path) -> RawFile:
    """Read the first plot of a binary raw file.

    Raises:
        RawFileError: if the file is missing, truncated or of another format.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(_HEADER_LIMIT)
    except OSError as error:
        raise RawFileError(f"no raw file was written ({error.strerror})") from error
    marker = head.find(b"Binary:\n")
    if marker < 0:
        raise RawFileError("the raw file has no binary part")
    header = head[:marker].decode("utf-8", errors="replace")
    try:
        count = int(_field(header, "No. Variables"))
        points = int(_field(header, "No. Points"))
        names = [line.split()[1].lower() for line in header.split("Variables:\n", 1)[1].splitlines() if line.strip()]
    except (ValueError, IndexError) as error:
        raise RawFileError("the raw file's header is broken") from error
    kind = np.dtype(complex) if "complex" in _field(header, "Flags") else np.dtype(float)
    start = marker + len(b"Binary:\n")
    if len(names) != count or count < 1 or points < 1:
        raise RawFileError(f"the raw file announces {count} vectors of {points} points and names {len(names)}")
    if size - start < count * points * kind.itemsize:
        raise RawFileError(f"the raw file is cut short: it announces {points} points of {count} vectors")
    table = np.fromfile(path, dtype=kind, count=count * points, offset=start).reshape(points, count)
    return RawFile(_field(header, "Plotname"), {name: table[:, index] for index, name in enumerate(names)})


def _field(header: str, key: str) -> str:
    match = re.search(rf"^{re.escape(key)}: *(.*)$", header, re.M)
    if not match:
        raise RawFileError(f"the raw file's header has no {key!r}")
    return match.group(1).strip()
