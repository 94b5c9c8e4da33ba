# SPDX-License-Identifier: GPL-3.0-or-later
"""A run of a driver that begins while the steady states of its design are solved."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Generic, Self, TypeVar

Given = TypeVar("Given")
Found = TypeVar("Found")


class _EndedError(Exception):
    """The run was ended since its outcome is not needed."""


class EarlyRun(Generic[Given, Found]):
    """The run of the last given subject, in a thread.

    As a context it ends a run whose outcome has not been taken.
    """

    def __init__(self, run: Callable[[Given, Callable[[float], None]], Found]) -> None:
        """Take the function that runs a subject. Its second argument is a progress callback, which may end the run."""
        self._run = run
        self._pool = ThreadPoolExecutor(1)
        self._subject: Given | None = None
        self._future: Future[Found] | None = None
        self._ended = False

    def begin(self, subject: Given) -> None:
        """Begin the run of a subject; a run of another one ends."""
        self.end()
        self._subject, self._ended = subject, False
        self._future = self._pool.submit(self._run, subject, self._go_on)

    def outcome(self, subject: Given) -> Found | None:
        """Return the outcome of the run of a subject when it has ended, or raise its error; ``None`` without a run."""
        return self._future.result() if self._future is not None and subject == self._subject else None

    def end(self) -> None:
        """End the run."""
        if self._future is not None:
            self._ended = True
            self._future.exception()
            self._future = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
        self._pool.shutdown()

    def _go_on(self, _: float) -> None:
        if self._ended:
            raise _EndedError
