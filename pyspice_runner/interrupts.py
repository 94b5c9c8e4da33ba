# SPDX-License-Identifier: GPL-3.0-or-later
"""Handling of SIGINT (Ctrl-C), SIGTERM (``kill``), SIGHUP (a closed terminal) and SIGBREAK (Ctrl-Break in Windows).

Python runs a signal's handler between any two steps of the program, for example after a process is started and before
its number is stored, or while its files are being removed. :func:`held` delays signals in such places. :func:`raised`
and :func:`end_at_once` install handlers that end the command with a message.
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
# the signals of a terminal's keys and of its end; Windows has no SIGHUP, and only Windows has SIGBREAK
TERMINAL = [getattr(signal, name) for name in ("SIGINT", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]
_ENDING = [*TERMINAL, signal.SIGTERM]
_REMIND = 0.01  # s; delay before a signal received where no exception can be raised is sent again


Listening = Callable[[], AbstractContextManager[None]]


def held() -> AbstractContextManager[Listening]:
    """Delay signals until the end of the block, except within ``listening()``.

    A signal without a handler ends the process behind the block, so that a child process in it is ended before.

    >>> with held() as listening:
    ...     place = "created here, and always removed"
    ...     with listening():
    ...         pass  # the long part; a pending signal is raised at its beginning
    """
    return _delayed() if _signals_come_here() else nullcontext(nullcontext)


@contextmanager
def _delayed() -> Iterator[Listening]:
    handlers: dict[int, Any] = {}
    came, fatal, listens = list[int](), list[int](), False  # fatal: signals without a handler

    def note(number: int, frame: FrameType | None) -> None:
        if not listens:
            came.append(number)
        elif callable(handlers[number]):
            handlers[number](number, frame)
        else:
            fatal.append(number)
            raise Stopped(number)

    @contextmanager
    def listening() -> Iterator[None]:
        nonlocal listens
        try:
            listens = True
            while came:
                note(came.pop(0), None)
            yield
        finally:
            listens = False

    for number in _ENDING:
        before = signal.getsignal(number)
        if callable(before) or before is signal.SIG_DFL:
            handlers[number] = before
            signal.signal(number, note)
    try:
        yield listening
    finally:
        for number, before in handlers.items():
            signal.signal(number, before)
        for number in (*fatal, *(number for number in came if not callable(handlers[number]))):
            signal.raise_signal(number)
        with listening():
            pass


def end_at_once() -> None:
    """Let a signal end this process with a message that nothing was written."""
    _handle(_leave)
    atexit.register(_handle, signal.SIG_IGN)  # at exit a signal would cause a traceback


def _leave(number: int, _: FrameType | None) -> None:
    os.write(2, NOTHING_DONE.encode())
    _leave_done(number, _)


def _leave_done(number: int, _: FrameType | None) -> None:
    os._exit(128 + number)


@contextmanager
def raised() -> Iterator[list[int]]:
    """Let signals raise :exc:`Stopped`, wherever they come; then restore the former handlers.

    After :func:`end_at_once` a signal still ends the process, without the message that nothing was written.

    Yields:
        The numbers of the received signals, in order; the list grows during the block.
    """
    came: list[int] = []
    if not _signals_come_here():
        yield came
        return

    reminding = False

    def stop(number: int, _: FrameType | None) -> None:
        if reminding:  # on a busy machine the signal is back before the hook has ended
            _send_again(number)
            return
        came.append(number)
        raise Stopped(number)

    def remind(unraisable: sys.UnraisableHookArgs) -> None:
        """Raise the exception again if it came in a finaliser or a callback, where Python only prints it."""
        nonlocal reminding
        if isinstance(unraisable.exc_value, Stopped):
            reminding = True
            _send_again(unraisable.exc_value.number)
            reminding = False
        else:
            complain(unraisable)

    complain, sys.unraisablehook = sys.unraisablehook, remind
    before = _handle(stop)
    try:
        yield came
    except Exception as error:
        # a signal breaks the import of an extension
        if came and (isinstance(error, ImportError) or _comes_of_a_signal(error)):
            raise Stopped(came[-1]) from None
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, _leave_done if handler is _leave else handler)
        sys.unraisablehook = complain


def _send_again(number: int) -> None:
    threading.Timer(_REMIND, to_main_thread, (number,)).start()


def to_main_thread(number: int) -> None:
    """Send a signal to the main thread, which runs its handler; a system call that it waits in ends at once.

    Windows sends no signals between threads: there the handler runs after the call, for SIGINT at once.
    """
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)


def _comes_of_a_signal(error: BaseException | None) -> bool:
    while error is not None and not isinstance(error, Stopped):
        error = error.__cause__ or error.__context__
    return error is not None


class Stopped(KeyboardInterrupt):
    """A signal was received.

    Attributes:
        number: the number of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def _signals_come_here() -> bool:
    """Return whether this is the main thread, the only one in which Python runs signal handlers."""
    return threading.current_thread() is threading.main_thread()


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> dict[int, Any]:
    """Set a handler for the signals that are not ignored, as ``nohup`` ignores SIGHUP; return the former handlers."""
    before = {number: signal.getsignal(number) for number in _ENDING}
    return {
        number: signal.signal(number, handler) for number, had in before.items() if had not in (signal.SIG_IGN, None)
    }
