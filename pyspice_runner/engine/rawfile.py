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

    def find(self, name: str) -> NDArray[np.generic] | None:
        """Return the vector that ``.save NAME`` asked for (``out`` is ``v(out)``, ``v1#branch`` is ``i(v1)``)."""
        name = name.lower().replace(" ", "")
        for candidate in (name, f"v({name})", f"i({name})", f"i({name.removesuffix('#branch')})"):
            if candidate in self.vectors:
                return self.vectors[candidate]
        return None


class RawFileError(ValueError):
    """The file is not a complete binary raw file."""


def read_rawfile(path: Path) -> RawFile:
    """Read a binary raw file that holds one analysis.

    Raises:
        RawFileError: if the file is missing, truncated, of another format, or holds more than one analysis.
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
    plot, flags, variables, length = (
        _field(header, key) for key in ("Plotname", "Flags", "No. Variables", "No. Points")
    )
    try:
        count, points = int(variables), int(length)
        rows = header.split("\nVariables:\n", 1)[1].split("\n")
        names = [row.split()[1].lower() for row in rows if row.strip()]
    except (ValueError, IndexError) as error:
        raise RawFileError("the raw file's header is broken") from error
    if points < 1:
        raise RawFileError("the raw file holds no points")
    if len(names) != count or len(set(names)) != count:
        raise RawFileError(f"the raw file announces {count} vectors and names {len(set(names))}")
    kind = np.dtype(complex) if "complex" in flags else np.dtype(float)
    start = marker + len(b"\nBinary:\n")
    excess = size - start - count * points * kind.itemsize
    if excess < 0:
        raise RawFileError(f"the raw file is cut short: it announces {points} points of {count} vectors")
    if excess > 0:
        raise RawFileError("the raw file holds more than one analysis")
    table = np.fromfile(path, dtype=kind, count=count * points, offset=start).reshape(points, count)
    return RawFile(plot, {name: table[:, index] for index, name in enumerate(names)})


def _field(header: str, key: str) -> str:
    match = re.search(rf"^{re.escape(key)}: *(.*)$", header, re.M)
    if not match:
        raise RawFileError(f"the raw file's header has no {key!r}")
    return match.group(1).strip()
