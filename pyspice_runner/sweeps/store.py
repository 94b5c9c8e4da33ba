# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder of finished results, each addressed by the hash of everything that it follows from, its content.

An entry is one JSON file, named by the SHA-256 of its content and written in one step. A process that is killed leaves
no incomplete entry, and several processes may use one folder at once: both write the same entry.
"""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pyspice_runner.errors import ParameterError
from pyspice_runner.files import cache_folder


class Store:
    """A store of results in a folder, by default in the user's cache folder; it is created if it does not exist.

    Raise ParameterError if the folder cannot be written.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        hint = "Set HOME or XDG_CACHE_HOME, or name a folder for the store."
        no_home = ParameterError(f"This user has no home folder for the store. {hint}")
        self.folder = Path(folder) if folder is not None else cache_folder("points", no_home)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:  # a name with a null character raises ValueError
            raise self._refusal(getattr(error, "strerror", None) or str(error)) from error
        if not os.access(self.folder, os.W_OK | os.X_OK):
            raise self._refusal("permission denied")

    def get(self, content: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return the result for a content; ``None`` if it is missing, damaged, or belongs to another content.

        Raise ParameterError if something else than a file is in its place, which a result could not replace.
        """
        try:
            entry = json.loads(self._path(content).read_bytes())
            result: dict[str, Any] = entry["result"]
            whole = entry["seal"] == fingerprint([content, result])
        except (IsADirectoryError, NotADirectoryError) as error:
            raise ParameterError(
                f"Cannot read the entry {error.filename} of the store: {error.strerror}. Remove what is in its place."
            ) from error
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return None
        return result if whole else None

    def put(self, content: Mapping[str, Any], result: Mapping[str, Any]) -> None:
        """Store a result; it is on the disk when this returns. Raise ParameterError if it cannot be written."""
        path = self._path(content)
        text = _canonical({"content": content, "result": result, "seal": fingerprint([content, result])})
        part = path.with_name(f".{uuid.uuid4().hex}.part")
        try:
            path.parent.mkdir(exist_ok=True)
            try:
                with part.open("x", encoding="utf-8") as file:
                    file.write(text)
                    file.flush()
                    os.fsync(file.fileno())
                part.replace(path)
            finally:
                part.unlink(missing_ok=True)
        except OSError as error:
            raise self._refusal(error.strerror) from error

    def _path(self, content: Mapping[str, Any]) -> Path:
        address = fingerprint(content)
        return self.folder / address[:2] / f"{address[2:]}.json"

    def _refusal(self, reason: str | None) -> ParameterError:
        return ParameterError(f"Cannot write the store {self.folder}: {reason}. Free it, or choose another folder.")


def fingerprint(document: Any) -> str:
    """Return the SHA-256 of a document of numbers, texts, lists and tables; the order of keys does not matter."""
    return hashlib.sha256(_canonical(document).encode()).hexdigest()


def _canonical(document: Any) -> str:
    """Return a document as JSON in canonical form: keys sorted, no spaces, all digits, arrays as lists."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"), default=lambda array: array.tolist())
