# SPDX-License-Identifier: GPL-3.0-or-later
"""How results are written to files: by their ending, and with one sentence where that cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError


def save_by_ending(path: str | Path, writers: Mapping[str, Callable[[Path], object]]) -> Path:
    """Write a file by the writer that belongs to its ending, and return its path.

    Args:
        path: the file to write.
        writers: ending with its dot → function that writes a path.

    Raises:
        ParameterError: for another ending, or a place that cannot be written.
    """
    path = Path(path)
    if path.suffix not in writers:
        raise ParameterError(f"Cannot tell a format from {path.name!r}; let it end in {_either(list(writers))}.")
    try:
        writers[path.suffix](path)
    except OSError as error:
        raise ParameterError(f"Cannot write {path}: {error.strerror or error}. Choose another place.") from error
    return path


def write_csv(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write columns of equal length under their names, twelve digits, a point for the decimal sign."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        table = np.column_stack(list(columns.values()))
        np.savetxt(file, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a JSON object, readable by eye; a value that is not finite is refused by the format."""
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _either(endings: list[str]) -> str:
    return " or ".join([", ".join(endings[:-1]), endings[-1]]) if len(endings) > 1 else endings[0]
