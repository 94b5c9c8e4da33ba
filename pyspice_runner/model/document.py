# SPDX-License-Identifier: GPL-3.0-or-later
"""How a file that states parameters is read, whatever it turns out to be."""

from __future__ import annotations

import stat
from pathlib import Path

from pyspice_runner.errors import ParameterError

MOST_BYTES = 4 * 2**20  # a motor has some kB, a fit some ten


def read_document(path: Path, wanted: str) -> str:
    """Return the text of a file.

    Args:
        path: the file.
        wanted: what to give instead, for messages.

    Raises:
        ParameterError: if it is no regular file, too large, no text, or cannot be read.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # a pipe would be waited for
            reason = "it is not a regular file"
        elif status.st_size > MOST_BYTES:
            reason = f"it has {status.st_size / 2**20:.3g} MiB, and at most {MOST_BYTES >> 20} are allowed"
        else:
            return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        reason = "it is not UTF-8 text"
    except (OSError, ValueError) as error:  # a name with a zero in it is a ValueError
        reason = getattr(error, "strerror", None) or str(error)
    raise ParameterError(f"Cannot read {path}: {reason}. Give {wanted}.")
