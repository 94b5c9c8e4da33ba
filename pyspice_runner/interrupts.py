# SPDX-License-Identifier: GPL-3.0-or-later
"""When a signal may interrupt: Ctrl-C, ``kill`` and a terminal that is closed.

Python raises whatever a signal's handler raises between any two steps of the program: after a process is started and
before anyone knows of it, or while what it left is being cleared away. Here steps that belong together are held
together, and the command gets handlers that end it with a sentence, from its first line to its last.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from types import FrameType
from typing import Any

NOTHING_DONE = "piezomotor: interrupted; nothing was written.\n"
_ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
_REMIND = 0.01  # s after which an interrupt comes again that came where nothing can be raised


@contextmanager
def held() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Hold back what signals raise until the end of the block, but for where it says that it listens.

    >>> with held() as listening:
    ...     place = "made, and cleared away whatever happens"
    ...     with listening():
    ...         pass  # the part that takes long; what came before it is raised at its beginning
    """
    if not _signals_come_here():
        yield nullcontext
        return
    handlers: dict[int, Any] = {}
    came: list[int] = []
    listens = False

    def note(number: int, frame: FrameType | None) -> None:
        if listens:
            handlers[number](number, frame)
        else:
            came.append(number)

    def raise_what_came() -> None:
        while came:
            number = came.pop(0)
            handlers[number](number, None)

    @contextmanager
    def listening() -> Iterator[None]:
        nonlocal listens
        try:
            listens = True
            raise_what_came()
            yield
        finally:
            listens = False

    for number in _ENDING:
        before = signal.getsignal(number)
        if callable(before):
            handlers[number] = before
            signal.signal(number, note)
    try:
        yield listening
    finally:
        for number, before in handlers.items():
            signal.signal(number, before)
        raise_what_came()


def end_at_once() -> None:
    """Let a signal end this process with a sentence, while nothing is begun."""
    _handle(_leave)
    atexit.register(_handle, signal.SIG_IGN)  # for all is done when Python clears away, and it would die of one there


def _leave(number: int, _: FrameType | None) -> None:
    os.write(2, NOTHING_DONE.encode())
    _leave_done(number, _)


def _leave_done(number: int, _: FrameType | None) -> None:
    os._exit(128 + number)


@contextmanager
def raised() -> Iterator[None]:
    """Let signals raise :exc:`Stopped`, wherever they come; then put back what was before.

    After :func:`end_at_once` they end the process still, but now there is something done.
    """
    if not _signals_come_here():
        yield
        return
    came: list[int] = []

    def stop(number: int, _: FrameType | None) -> None:
        came.append(number)
        raise Stopped(number)

    def remind(unraisable: sys.UnraisableHookArgs) -> None:
        """Raise it again if it came in a finaliser or a callback, where it only would be printed."""
        if isinstance(unraisable.exc_value, Stopped):
            threading.Timer(_REMIND, os.kill, (os.getpid(), unraisable.exc_value.number)).start()
        else:
            complain(unraisable)

    complain, sys.unraisablehook = sys.unraisablehook, remind
    before = _handle(stop)
    try:
        yield
    except Exception as error:
        if came and (isinstance(error, ImportError) or _comes_of_a_signal(error)):  # an extension that was being loaded
            raise Stopped(came[-1]) from None
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, _leave_done if handler is _leave else handler)
        sys.unraisablehook = complain


def _comes_of_a_signal(error: BaseException | None) -> bool:
    while error is not None and not isinstance(error, Stopped):
        error = error.__cause__ or error.__context__
    return error is not None


class Stopped(KeyboardInterrupt):
    """A signal came.

    Attributes:
        number: which one.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def _signals_come_here() -> bool:
    """Whether this is the thread in which Python calls the handlers of signals; elsewhere nothing is raised."""
    return threading.current_thread() is threading.main_thread()


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> dict[int, Any]:
    """Give the signals that are not ignored a handler, as ``nohup`` ignores SIGHUP; return what they had."""
    before = {number: signal.getsignal(number) for number in _ENDING}
    return {
        number: signal.signal(number, handler) for number, had in before.items() if had not in (signal.SIG_IGN, None)
    }
