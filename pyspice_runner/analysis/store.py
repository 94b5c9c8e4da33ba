# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder of finished results, each addressed by its content: by all that it follows from.

An entry is one JSON file, named by the SHA-256 of its content and written in one stroke, so that a process that is
killed leaves no half of one, and several may use one folder at once: whoever comes second puts the same in its place.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import uuid
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pyspice_runner.errors import ParameterError

_ABANDONED = 3600.0  # s; a file that was begun so long ago belongs to a process that was killed


class Store:
    """A store of results.

    Args:
        folder: where it lies; by default in the user's cache folder. It is made if it does not exist.

    Raises:
        ParameterError: if the folder cannot be written.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        self.folder = Path(folder) if folder is not None else cache / "piezomotor" / "points"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for begun in self.folder.glob("*/.*.part"):
                with suppress(FileNotFoundError):  # it was just finished
                    if begun.stat().st_mtime < time.time() - _ABANDONED:
                        begun.unlink()
        except (OSError, ValueError) as error:  # a name with a zero in it is a ValueError
            raise self._refusal(getattr(error, "strerror", None) or str(error)) from error
        if not os.access(self.folder, os.W_OK | os.X_OK):
            raise self._refusal("permission denied")

    def get(self, content: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return the result that follows from a content; ``None`` for what is missing, damaged or of another content.

        Args:
            content: what the result follows from, JSON-ready.
        """
        try:
            entry = json.loads(self._path(content).read_bytes())
            result: dict[str, Any] = entry["result"]
            whole = entry["seal"] == fingerprint([content, result])
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return None
        return result if whole else None

    def put(self, content: Mapping[str, Any], result: Mapping[str, Any]) -> None:
        """Keep a result, on the disk when this returns.

        Raises:
            ParameterError: if it cannot be written.
        """
        path = self._path(content)
        text = _canonical({"content": content, "result": result, "seal": fingerprint([content, result])})
        begun = path.with_name(f".{uuid.uuid4().hex}.part")
        try:
            path.parent.mkdir(exist_ok=True)
            try:
                with begun.open("x", encoding="utf-8") as file:
                    file.write(text)
                    file.flush()
                    os.fsync(file.fileno())
                begun.replace(path)
            finally:
                begun.unlink(missing_ok=True)
        except OSError as error:
            raise self._refusal(error.strerror) from error

    def _path(self, content: Mapping[str, Any]) -> Path:
        address = fingerprint(content)
        return self.folder / address[:2] / f"{address[2:]}.json"

    def _refusal(self, reason: str | None) -> ParameterError:
        return ParameterError(f"Cannot write the store {self.folder}: {reason}. Free it, or choose another folder.")


def fingerprint(document: Any) -> str:
    """Return the SHA-256 of a document of numbers, texts, lists and tables, whatever the order of the tables' keys."""
    return hashlib.sha256(_canonical(document).encode()).hexdigest()


def _canonical(document: Any) -> str:
    """Return a document as JSON in the one form: keys sorted, no spaces, digits in full, arrays as lists."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"), default=lambda array: array.tolist())
