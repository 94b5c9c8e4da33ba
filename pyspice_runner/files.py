# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing of result files: the format follows from the ending, and a file is complete or not written at all."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.interrupts import held

if TYPE_CHECKING:
    import xarray


def save_by_ending(path: str | Path, writers: Mapping[str, Callable[[Path], object]]) -> Path:
    """Write a file by the writer for its ending, and return its path.

    The complete file replaces an older one in one step. If it cannot be written, or the writer is interrupted, the
    older file stays unchanged.

    ``writers`` has for each ending, with its dot, the function that writes a path.

    Raises:
        ParameterError: for another ending, or a place that cannot be written.
    """
    path = Path(path)
    if path.suffix not in writers:
        *others, last = writers
        endings = f"{', '.join(others)} or {last}" if others else last
        raise ParameterError(f"No format follows from the name {path.name!r}: let it end in {endings}.")
    try:
        _write_whole(path, writers[path.suffix])
    except OSError as error:
        raise ParameterError(f"Cannot write {path}: {error.strerror or error}. Choose another place.") from error
    return path


def _write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Write to a temporary folder beside the file, and move the complete file to its place."""
    try:
        target = path.resolve()  # a symbolic link stays a link
    except ValueError as error:  # a name with a null character
        raise OSError(errno.EINVAL, str(error)) from error
    if (target.exists() and not target.is_file()) or not os.access(target.parent, os.W_OK):
        write(path)  # a device, a pipe, or a writable file in a read-only folder
        return
    with held() as listening:
        folder = Path(tempfile.mkdtemp(prefix=".piezomotor-", dir=target.parent))
        try:
            partial = folder / path.name
            with listening():
                write(partial)
            if target.exists():
                shutil.copymode(target, partial)
            partial.replace(target)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def write_csv(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write columns of equal length under their names, twelve digits, a point for the decimal sign."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        table = np.column_stack(list(columns.values()))
        np.savetxt(file, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")


def write_rows(path: Path, rows: Sequence[Sequence[str]]) -> None:
    """Write rows of texts as CSV, the header first."""
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def write_netcdf(path: Path, dataset: xarray.Dataset) -> None:
    """Write a dataset as NetCDF by way of memory, since HDF5 itself crashes when the disk is full."""
    content = io.BytesIO()
    dataset.to_netcdf(content, engine="h5netcdf")
    path.write_bytes(content.getvalue())  # not getbuffer(): a failed write keeps that view, and Python 3.13 complains


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """Write a JSON object with indentation. JSON has no values that are not finite: they raise a ValueError."""
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def cache_folder(part: str, no_home: Exception) -> Path:
    """Return a folder in the user's cache, which may not exist yet; a user without a home folder gets the error."""
    stated = os.environ.get("XDG_CACHE_HOME") or (os.environ.get("LOCALAPPDATA") if os.name == "nt" else None)
    try:
        cache = Path(stated) if stated else Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    except RuntimeError:  # neither HOME nor an entry of this user in the passwd file
        raise no_home from None
    return cache / "piezomotor" / part
