# SPDX-License-Identifier: GPL-3.0-or-later
"""What an input may not do: hang, eat the memory, warn, start a process, write where it should not."""

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

MOST_SECONDS = 5.0
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
_allowed: Sequence[str] | None = None  # where may be written now; None while nothing is watched
_hooked = False


class Offence(BaseException):
    """What an input must not bring about; no `except Exception` may keep it in."""


class Said(io.TextIOWrapper):
    """Standard output or error as Python opens them: what cannot be encoded is an error, or is written with escapes."""

    def __init__(self, errors: str) -> None:
        self._bytes = io.BytesIO()
        super().__init__(self._bytes, encoding="utf-8", errors=errors, write_through=True)

    @property
    def text(self) -> str:
        return self._bytes.getvalue().decode()


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if _allowed is None:
        return
    if event in _PROCESSES or event == "socket.connect":
        raise Offence(f"{event}{arguments[:2]!r}"[:300])
    paths: tuple[Any, ...] = ()
    if event == "open" and arguments[2] & _WRITES:
        paths = arguments[:1]
    elif event in _CHANGES:
        paths = arguments[: _CHANGES[event]]
    for path in paths:
        if isinstance(path, str | bytes):
            real = os.path.realpath(os.fsdecode(path))
            if real != os.devnull and not any(real == one or real.startswith(one + os.sep) for one in _allowed):
                raise Offence(f"{event} of {real!r}"[:300])


def _late(*_: object) -> None:
    raise Offence(f"it took more than {MOST_SECONDS:g} s")


@contextmanager
def watched(*folders: Path) -> Iterator[tuple[Said, Said]]:
    """Hold what runs within to the rules; it may write into the folders. Yields what goes to stdout and stderr."""
    global _allowed, _hooked
    if not _hooked:
        sys.addaudithook(_hook)
        _hooked = True
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    before = signal.signal(signal.SIGALRM, _late)
    out, err = Said("strict"), Said("backslashreplace")
    try:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MOST_BYTES, hard))
        signal.setitimer(signal.ITIMER_REAL, MOST_SECONDS)
        _allowed = [os.path.realpath(folder) for folder in folders]
        with warnings.catch_warnings(), redirect_stdout(out), redirect_stderr(err):
            warnings.simplefilter("error")
            yield out, err
    finally:
        _allowed = None
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
