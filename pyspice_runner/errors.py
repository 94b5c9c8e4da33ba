# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors of this package, and the exception that carries the result of an interrupted run.

Each message is one or two sentences that name the parameter or file, the value with its unit, the allowed range, and
what to do.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import date
from functools import partial
from pathlib import Path
from textwrap import shorten
from typing import Any

_LONGEST, _TAIL = 1000, 300  # characters of a message; its end says what to do
_LONGEST_LIST = 300  # characters of a list of names


class ParameterError(ValueError):
    """Invalid input, found before anything runs: a value, a name or a file."""

    def __init__(self, message: str) -> None:
        super().__init__(_readable(message))


class SpectrumError(ValueError):
    """A measured spectrum that cannot be read, or that has no resonance to identify."""

    def __init__(self, message: str) -> None:
        super().__init__(_readable(message))


class SimulationError(RuntimeError):
    """The simulator failed, or its result is not valid.

    Attributes:
        deck: the netlist that failed, kept for inspection; ``None`` if nothing was run.
        log: the complete log of ngspice.
        partial: the finished part of an analysis of many runs; ``None`` if there is none.
    """

    def __init__(self, message: str, *, deck: Path | None = None, log: str = "", partial: Any = None) -> None:
        super().__init__(_readable(message))
        self.deck = deck
        self.log = log
        self.partial = partial

    def __reduce__(self) -> tuple[object, ...]:
        """Keep deck and log when the error crosses a process boundary."""
        return partial(type(self), deck=self.deck, log=self.log), (str(self),)


def _readable(message: str) -> str:
    """Return a message on one line, of limited length, with characters that are not printable escaped."""
    if len(message) > _LONGEST:
        message = f"{message[: _LONGEST - _TAIL - 1]}…{message[-_TAIL:]}"
    if message.isprintable():
        return message
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in message)


class Interrupted(KeyboardInterrupt):
    """A run was interrupted by a signal.

    Attributes:
        partial: the result until then, marked as incomplete.
    """

    def __init__(self, message: str, partial: Any) -> None:
        super().__init__(message)
        self.partial = partial


def quoted(value: Any) -> str:
    """Return a value as it was written, made short and printable."""
    try:
        text = f"{value:g}" if isinstance(value, float) else str(value) if isinstance(value, date) else repr(value)
    except (ValueError, RecursionError):  # such as an integer of five thousand digits, which Python does not write
        return f"{type(value).__name__} too large to be shown"
    return text if len(text) <= 60 else text[:57] + "…"


@contextmanager
def located(where: str) -> Iterator[None]:
    """Put a place in front of the message of a ParameterError that is raised in the block."""
    try:
        yield
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}") from error


def require(valid: object, name: str, value: object, allowed: str, *, unit: str = "") -> None:
    """Raise ParameterError for a value, with its unit, that is not one of those allowed in words."""
    if not valid:
        raise ParameterError(f"{name} = {quoted(value)}{unit and f' {unit}'} is not valid: it must be {allowed}.")


def did_you_mean(name: str, known: Iterable[str], otherwise: str = "Known are") -> str:
    """Return a sentence with the known name nearest to an unknown one; without a near one, with those that are known.

    A name that contains the unknown one as a word is near: ``rotor_speed_rad_s`` to ``speed``.
    """
    known = list(known)
    words = sorted((other for other in known if name in other.split("_")), key=len)
    very, fairly = (difflib.get_close_matches(name, known, n=1, cutoff=cutoff) for cutoff in (0.8, 0.6))
    close = very or words or fairly
    listed = shorten(", ".join(known), _LONGEST_LIST, placeholder=" and others")
    return f"Did you mean {close[0]!r}?" if close else f"{otherwise} {listed}."
