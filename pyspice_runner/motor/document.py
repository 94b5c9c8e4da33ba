# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameter files: regular files of limited size, and TOML of limited nesting."""

from __future__ import annotations

import re
import stat
import tomllib
from codecs import BOM_UTF8
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pyspice_runner.errors import ParameterError

Content = TypeVar("Content", str, bytes)
MOST_BYTES = 2**18  # a motor has a few kB, a fit about ten; a MiB of tables would take the parser seconds
MOST_PARTS = 32  # of a dotted key; a motor's longest key has four

_NO_KEY = re.compile(  # strings and comments of TOML; a string that is not closed ends with its line or the file
    r"""
    \"{3} (?: \\. | [^\\] )*? (?: \"{3,5} | \Z )
    | '{3} .*? (?: '{3,5} | \Z )
    | " (?: \\[^\n] | [^"\\\n] )*+ "?
    | ' [^'\n]*+ '?
    | \# [^\n]*
    """,
    re.DOTALL | re.VERBOSE,
)
_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{MOST_PARTS}}}")


def read_document(path: Path, wanted: str, most: int = MOST_BYTES) -> str:
    """Return the text of a file of at most ``most`` bytes; a message proposes the kind of file that is ``wanted``.

    Raise ParameterError if the file is not a regular file, is too large, is not text, or cannot be read.
    """
    return _read(path, str(path), wanted, most, lambda file: file.read_text(encoding="utf-8-sig"))


def read_bytes(path: str, what: str, most: int, wanted: str = "the path of a .lib file") -> bytes:
    """Return at most ``most`` bytes of a file, without the byte order mark that some editors write at its beginning.

    ``what`` is its kind for messages, such as ``"contact law"``.

    Raise ParameterError if the file is not a regular file, is too large, or cannot be read.
    """
    shown = repr(path if len(path) <= 200 else f"{path[:197]}...")
    return _read(Path(path), f"the {what} {shown}", wanted, most, Path.read_bytes).removeprefix(BOM_UTF8)


def _read(path: Path, shown: str, wanted: str, most: int, read: Callable[[Path], Content]) -> Content:
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # reading a pipe would wait for its writer
            reason = "it is not a regular file"
        elif status.st_size > most:
            reason = f"it has {status.st_size / 2**20:.3g} MiB; the limit is {most / 2**20:g} MiB"
        else:
            return read(path)
    except UnicodeDecodeError:
        reason = "it is not UTF-8 text"
    except (OSError, ValueError) as error:  # a path with a null character raises ValueError
        reason = getattr(error, "strerror", None) or str(error)
    raise ParameterError(f"Cannot read {shown}: {reason}. Give {wanted}.")


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Return the table of a TOML text. Raise ParameterError if it is not valid, or nests its values too deeply.

    Memory and time of the parser grow with the square of the number of parts of a dotted key, and its recursion with
    the nesting of arrays; both are limited here.
    """
    if _LONG_KEY.search(_NO_KEY.sub("_", text)):
        raise ParameterError(
            f"{name} has a key of more than {MOST_PARTS} dotted parts. Use the keys of a motor's TOML."
        )
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ParameterError(f"{name} is not valid TOML: {error}. Correct that line.") from error
    except RecursionError:
        raise ParameterError(f"{name} nests its values too deeply. Use the structure of a motor's TOML.") from None
    except ValueError as error:  # Python limits the number of digits that it converts
        raise ParameterError(f"{name} holds a number of thousands of digits. Write numbers as in 1e-3.") from error
