# SPDX-License-Identifier: GPL-3.0-or-later
"""A file as lines of text: size, encoding and line ends."""

from __future__ import annotations

import re
import stat
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from pyspice_runner.errors import SpectrumError

MOST_BYTES = 16 * 2**20  # some 200 000 points; an analyser writes 801 or 1601

_LINE_END = re.compile(r"\r\n|\r|\n")
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_DECODERS = ((BOM_UTF8, "utf-8"), (BOM_UTF16_LE, "utf-16-le"), (BOM_UTF16_BE, "utf-16-be"))


@dataclass(frozen=True)
class Text:
    """The lines of a file.

    Attributes:
        name: printable name of the file.
        lines: its lines, without line ends; line 1 of the file is ``lines[0]``.
        ended: whether the last line has a line end; if not, the file may have been cut within it.
    """

    name: str
    lines: tuple[str, ...]
    ended: bool = True

    def refusal(self, index: int, found: str, expected: str) -> SpectrumError:
        """Return the error for a line: what was found and what was expected."""
        return SpectrumError(f"{self.name}, line {index + 1}: {found}; expected {expected}.")

    def find(self, accept: Callable[[str], object], start: int = 0, stop: int | None = None) -> int | None:
        """Return the index of the first line that is accepted, or ``None``."""
        last = len(self.lines) if stop is None else min(stop, len(self.lines))
        return next((index for index in range(start, last) if accept(self.lines[index])), None)


def load(path: str | Path) -> Text:
    """Return a file's lines.

    Raises:
        SpectrumError: if it is no regular file, too large, empty or not text.
    """
    path = Path(path)
    name = clean(path.name or str(path), 80)
    data = b""
    try:
        status = path.stat()
        if (regular := stat.S_ISREG(status.st_mode)) and status.st_size <= MOST_BYTES:
            with path.open("rb") as file:
                data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or clean(str(error), 80)
        raise SpectrumError(f"Cannot read {name}: {reason}. Give the file of a measured spectrum.") from None
    if not regular:
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not a regular file"
        raise SpectrumError(f"Cannot read {name}: it is {kind}. Give the file of a measured spectrum.")
    if max(status.st_size, len(data)) > MOST_BYTES:
        raise SpectrumError(
            f"{name} has {status.st_size / 2**20:.0f} MiB; a spectrum may have {MOST_BYTES // 2**20} MiB. "
            "Export fewer points."
        )
    content = decode(data.rstrip(b"\x1a"), name)  # DOS ended its text files with Ctrl-Z
    if not content.strip():
        raise SpectrumError(f"{name} is empty; expected a measured spectrum.")
    lines = _LINE_END.split(content)
    ended = not lines[-1].strip()
    return Text(name, tuple(lines[:-1] if ended else lines), ended)


def decode(data: bytes, name: str) -> str:
    """Decode UTF-8, UTF-16 (with or without byte-order mark) or Windows' Western European.

    Raises:
        SpectrumError: for bytes that are none of these.
    """
    mark, attempts = next(((m, (e,)) for m, e in _DECODERS if data.startswith(m)), (b"", _guesses(data)))
    data = data.removeprefix(mark)
    for encoding in attempts:
        try:
            content = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        control = _CONTROL.search(content)
        if not control:
            return content
        line = len(_LINE_END.findall(content, 0, control.start())) + 1
        raise SpectrumError(f"{name}, line {line}: a control character, so this is not text; expected a text export.")
    raise SpectrumError(f"{name} is not text in UTF-8, UTF-16 or Latin-1; export the spectrum as a text file.")


def clean(text: str, most: int) -> str:
    """Return text from a file for display: printable, on one line, and short."""
    flat = " ".join("".join(c if c.isprintable() else " " for c in text[: 4 * most]).split())
    return flat if len(flat) <= most else flat[: most - 1] + "…"


def quote(text: str) -> str:
    """Return text from a file in quotes, for a message."""
    return f"“{clean(text, 40)}”"


def describe(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return the metadata of a measurement: the first forty entries, printable and short."""
    metadata: dict[str, str] = {}
    for key, value in pairs:
        if len(metadata) == 40:
            break
        if (name := clean(key, 40)) and (shown := clean(value, 120)):
            metadata.setdefault(name, shown)
    return metadata


def described(lines: Iterable[str], bare: str = "comment") -> dict[str, str]:
    """Return the metadata in lines such as ``# Date: today``; the key of a line without a colon is ``bare``."""
    entries = (line[:400].strip(' \t#!%",;').partition(":") for line in lines)
    return describe((key, value) if colon else (bare, key) for key, colon, value in entries)


def _guesses(data: bytes) -> tuple[str, ...]:
    """Return the encodings to try; every other byte of ASCII text in UTF-16 is zero."""
    head = data[:2000]
    even, odd = head[::2].count(0), head[1::2].count(0)
    if max(even, odd) > 0.8 * max(len(head) // 2, 1) and min(even, odd) == 0:
        return ("utf-16-le" if odd else "utf-16-be",)
    return ("utf-8", "cp1252", "latin-1")
