# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled files in a cache that only this user can write, because the code in them is run."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from pyspice_runner.errors import SimulationError


def kept_file(place: Path, make: Callable[[Path], object]) -> Path:
    """Return the path of a compiled file; compile it if it is not there yet.

    ``make`` is called with an empty folder, into which it writes the file under its name. A file or folder that another
    user owns or can write is not used: it is replaced, or the folder cannot be written.

    Raise SimulationError if the folder cannot be written.
    """
    if is_private(place):
        return place
    try:
        make_private(place.parent)
        with tempfile.TemporaryDirectory(prefix=".part-", dir=place.parent) as work:
            make(Path(work))
            (Path(work) / place.name).chmod(0o700)
            (Path(work) / place.name).replace(place)  # complete or not there, also for another process
    except OSError as error:
        raise SimulationError(
            f"Cannot write the compiled module to {place.parent}: {error.strerror}. Set XDG_CACHE_HOME."
        ) from error
    return place


def is_private(path: Path) -> bool:
    """Tell whether a file exists, it and its folder belong to this user, and no one else can write them."""
    try:
        found = [place.stat() for place in (path, path.parent)]
    except OSError:
        return False
    return all(status.st_uid == os.getuid() and not status.st_mode & 0o022 for status in found)


def make_private(folder: Path) -> None:
    """Create a folder that only this user can write. Raise OSError if it exists and belongs to another user."""
    folder.mkdir(parents=True, exist_ok=True)
    folder.chmod(0o700)
