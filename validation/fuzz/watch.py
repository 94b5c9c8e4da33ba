# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits for the processing of an input: time, memory, no warning, no process, no file outside of its folder."""

from __future__ import annotations

import io
import os
import resource
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

# Of processor time. The most that a valid input takes, a fit of 20 arms, is 2.3 s on an idle machine and was 5 s on one
# whose cores were shared; what hangs takes more than any limit.
MOST_SECONDS = 15.0
_PATIENCE = 4.0  # times as much of wall time
MOST_BYTES = 2 * 2**30  # of address space beyond what was there

_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = {  # event → which of its arguments are paths
    **dict.fromkeys(("os.mkdir", "os.rmdir", "os.remove", "os.truncate", "os.chmod"), 1),
    **dict.fromkeys(("os.rename", "os.link", "os.symlink"), 2),
}
_PROCESSES = (
    "subprocess.Popen",
    "os.system",
    "os.exec",
    "os.fork",
    "os.forkpty",
    "os.posix_spawn",
    "os.spawn",
    "pty.spawn",
)
_allowed: Sequence[str] | None = None  # folders that may be written now; None while nothing is watched
_hooked = False


class Violation(BaseException):
    """A limit was exceeded. Not an ``Exception``, so that no handler of the package catches it."""


class Said(io.TextIOWrapper):
    """Standard output or error as Python opens them: a character that cannot be encoded is an error, or is escaped."""

    def __init__(self, errors: str) -> None:
        self._bytes = io.BytesIO()
        super().__init__(self._bytes, encoding="utf-8", errors=errors, write_through=True)

    @property
    def text(self) -> str:
        """What was written."""
        return self._bytes.getvalue().decode()


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if _allowed is None:
        return
    if event in _PROCESSES or event == "socket.connect":
        raise Violation(f"{event}{arguments[:2]!r}"[:300])
    paths: tuple[Any, ...] = ()
    if event == "open" and arguments[2] & _WRITES:
        paths = arguments[:1]
    elif event in _CHANGES:
        paths = arguments[: _CHANGES[event]]
    for path in paths:
        if isinstance(path, str | bytes):
            real = os.path.realpath(os.fsdecode(path))
            if real != os.devnull and not any(real == one or real.startswith(one + os.sep) for one in _allowed):
                raise Violation(f"{event} of {real!r}"[:300])


def _late(number: int, _: object) -> None:
    seconds, of = (MOST_SECONDS, "processor") if number == signal.SIGPROF else (_PATIENCE * MOST_SECONDS, "wall")
    raise Violation(f"it took more than {seconds:g} s of {of} time")


@contextmanager
def watched(*folders: Path) -> Iterator[tuple[Said, Said]]:
    """Apply the limits to what runs within; it may write to the folders only. Yields its standard output and error."""
    global _allowed, _hooked
    if not _hooked:
        sys.addaudithook(_hook)
        _hooked = True
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    before = {number: signal.signal(number, _late) for number in (signal.SIGPROF, signal.SIGALRM)}
    out, err = Said("strict"), Said("backslashreplace")
    cached, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # of modules that are imported within
    try:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MOST_BYTES, hard))
        signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)
        signal.setitimer(signal.ITIMER_REAL, _PATIENCE * MOST_SECONDS)
        _allowed = [os.path.realpath(folder) for folder in folders]
        with warnings.catch_warnings(), redirect_stdout(out), redirect_stderr(err):
            warnings.simplefilter("error")
            yield out, err
    finally:
        _allowed, sys.dont_write_bytecode = None, cached
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
