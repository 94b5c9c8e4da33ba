# SPDX-License-Identifier: GPL-3.0-or-later
"""Other programs as child processes, on every system: started, listened to, and ended."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from functools import cache
from math import inf
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO

from pyspice_runner.errors import SimulationError

POSIX = os.name == "posix"  # or Windows
FREE_SPACE = "Free some space or set TMPDIR."
_NUDGE = 1.0  # s after which a wait looks for an interrupt, which on Windows does not end it


def answer(
    command: Sequence[str], *, timeout: float, hint: str, what: str = "", folder: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end and return its output.

    ``timeout`` is wall time in s; a message names the program as ``what`` and ends in ``hint``. Raise SimulationError
    if the program does not start, or does not end in time.
    """
    try:
        return subprocess.run(
            command, cwd=folder, capture_output=True, encoding="utf-8", errors="replace", timeout=timeout,
            stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SimulationError(f"{what or command[0]} does not run: {error}. {hint}") from error


def new_folder() -> Path:
    """Return a new temporary folder for one run of ngspice. Raise SimulationError if it cannot be created."""
    try:
        return Path(tempfile.mkdtemp(prefix="piezomotor-"))
    except OSError as error:
        raise SimulationError(f"Cannot write the netlist: {error.strerror}. {FREE_SPACE}") from error


class Child(subprocess.Popen[bytes]):
    """A program in a folder, as the leader of a process group of its own, that writes a log or has a dialogue.

    Only the main thread receives signals (:func:`.held`); a run of another thread that writes a log ends with that
    thread, where ``setpriv`` of util-linux is installed.

    Without a HOME ngspice 39 crashes; the user's own start-up file must not be read.
    """

    def __init__(self, command: Sequence[str], folder: Path, log: IO[bytes] | None = None) -> None:
        own = ("SPICE", "NGSPICE", "LC_")
        environment = {key: value for key, value in os.environ.items() if not key.startswith(own)}
        environment |= {"LC_ALL": "C", "HOME": str(folder)}
        if log and threading.current_thread() is not threading.main_thread():
            command = [*_ending_with_thread(), *command]
        super().__init__(
            command, cwd=folder, env=environment, start_new_session=POSIX,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
            stdin=subprocess.DEVNULL if log else subprocess.PIPE, stdout=log or subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )  # fmt: skip
        self._chunks: SimpleQueue[bytes] = SimpleQueue()
        self._buffer = b""
        if self.stdout is not None:  # a thread reads it, since Windows has no ``select`` for pipes
            threading.Thread(target=_listen, args=(self.stdout, self._chunks), daemon=True).start()

    def write(self, text: str) -> None:
        """Write to the standard input. Raise OSError if the program has ended."""
        assert self.stdin is not None
        self.stdin.write(text.encode())
        self.stdin.flush()

    def line(self, timeout: float | None) -> str | None:
        """Return the next line of the output without its end, or ``None`` at the end of the output.

        Raise subprocess.TimeoutExpired after a wall time in s without one.
        """
        ends = inf if timeout is None else time.monotonic() + timeout
        while b"\n" not in self._buffer:
            try:
                chunk = self._chunks.get(timeout=max(min(ends - time.monotonic(), _NUDGE), 0.0))
            except Empty:
                if time.monotonic() >= ends:
                    raise subprocess.TimeoutExpired(self.args, timeout or 0.0) from None
                continue
            if not chunk:
                self._chunks.put(chunk)
                return None
            self._buffer += chunk
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line.decode(errors="replace").strip()

    def read_until(self, last: str, timeout: float, lines: list[str]) -> bool:
        """Append the lines of the output before one, and return whether that one came before the end.

        Raise subprocess.TimeoutExpired after a wall time in s without it.
        """
        ends = time.monotonic() + timeout
        while (line := self.line(max(ends - time.monotonic(), 0.0))) is not None:
            if line == last:
                return True
            lines.append(line)
        return False

    def end(self) -> None:
        """Kill the program and its children, unless it has ended; on Windows its children stay."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                if POSIX:
                    os.killpg(self.pid, signal.SIGKILL)
                else:
                    self.kill()
        self.wait()
        if self.stdin is not None:
            with contextlib.suppress(OSError):  # what was written to it last is lost
                self.stdin.close()


def _listen(pipe: IO[bytes], chunks: SimpleQueue[bytes]) -> None:
    with pipe:
        while chunk := os.read(pipe.fileno(), 1 << 16):
            chunks.put(chunk)
    chunks.put(b"")


@cache
def _ending_with_thread() -> tuple[str, ...]:
    """Return the words before a command by which Linux kills it at the end of the thread that started it."""
    words = (shutil.which("setpriv") or "", "--pdeathsig", "KILL")
    with contextlib.suppress(OSError):
        if subprocess.run([*words, "true"], capture_output=True, check=False).returncode == 0:
            return words
    return ()
