# SPDX-License-Identifier: GPL-3.0-or-later
"""A process ``ngspice -p`` that takes commands on its standard input."""

from __future__ import annotations

import contextlib
import os
import re
import selectors
import shutil
import subprocess
import time
from collections.abc import Sequence
from typing import Self

from pyspice_runner.errors import SimulationError
from pyspice_runner.spice.ngspice import find_ngspice, ngspice_version
from pyspice_runner.spice.process import end, new_folder, start

_TROUBLE = re.compile(r"error|singular|too small|no such|unrecognized|cannot|can't|aborted|not available", re.I)
_ECHO = re.compile(r"ngspice \d+ -> ")  # ngspice 46 repeats a command behind its prompt
_HARMLESS = "no graphics interface"  # ngspice says so where there is no display


class Pipe:
    """A process ``ngspice -p`` in a folder of its own. ``timeout`` is wall time in s for one call of :meth:`tell`.

    It ends with its standard input, hence also with this process.

    Raises:
        SimulationError: if ngspice fails; the process is ended.
    """

    def __init__(self, timeout: float) -> None:
        self.version = ngspice_version()
        self.timeout = timeout
        self.marks = 0
        self._buffer = b""
        self.folder = new_folder()
        # ngspice 46 -p ends with a segmentation fault if its session has no controlling terminal: the shell opens one
        self._terminal: int | None
        self._terminal, terminal = os.openpty()
        try:
            self._process = start(
                ["/bin/sh", "-c", ': <>"$0" && exec "$@"', os.ttyname(terminal), find_ngspice(), "-p", "-n"],
                self.folder, ends_with_thread=False, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )  # fmt: skip
        finally:
            os.close(terminal)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End ngspice and delete its files. A second call closes nothing, since the descriptor may be another's."""
        end(self._process)
        if self._terminal is not None:
            os.close(self._terminal)
            self._terminal = None
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if stream is not None:
                    stream.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def tell(self, *commands: str) -> list[str]:
        """Write commands and return ngspice's output until they are done."""
        self.marks += 1
        mark = f"done-{self.marks}."
        assert self._process.stdin is not None
        try:
            self._process.stdin.write("".join(f"{command}\n" for command in (*commands, f"echo {mark}")).encode())
            self._process.stdin.flush()
        except BrokenPipeError:
            raise self.failure("ngspice ended", []) from None
        said = self._listen(mark)
        complaint = [line for line in said if _TROUBLE.search(line) and _HARMLESS not in line]
        if complaint:
            raise self.failure("ngspice complained", complaint)
        return said

    def _listen(self, mark: str) -> list[str]:
        assert self._process.stdout is not None
        ends, said = time.monotonic() + self.timeout, list[str]()
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            while True:
                while b"\n" in self._buffer:
                    line, _, self._buffer = self._buffer.partition(b"\n")
                    text = line.decode(errors="replace").strip()
                    if text == mark:
                        return said
                    if not _ECHO.match(text):
                        said.append(text)
                if not selector.select(max(ends - time.monotonic(), 0.0)):
                    raise self.failure(f"ngspice did not answer within {self.timeout:g} s", said)
                chunk = os.read(self._process.stdout.fileno(), 1 << 16)
                if not chunk:
                    raise self.failure("ngspice ended", said)
                self._buffer += chunk

    def failure(self, what: str, said: Sequence[str]) -> SimulationError:
        """End ngspice and return the error to raise, with what it said."""
        self.close()
        quoted = " / ".join(line[:200] for line in said[:3] if line)
        return SimulationError(f'{what}: "{quoted}".' if quoted else f"{what}.", log="\n".join(said))
