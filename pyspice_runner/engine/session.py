# SPDX-License-Identifier: GPL-3.0-or-later
"""A transient that pauses at sample times to be read and altered: for a controller in the loop.

One process ``ngspice -p`` runs from beginning to end and keeps the exact state of the circuit. Only checked names and
numbers are written to its standard input, so that no user text reaches ngspice's control language.
"""

from __future__ import annotations

import contextlib
import os
import re
import selectors
import shutil
import subprocess
import time
from collections.abc import Sequence
from math import isfinite
from typing import Self

from pyspice_runner.engine.ngspice import find_ngspice, ngspice_version
from pyspice_runner.engine.process import end, new_folder, start
from pyspice_runner.engine.rawfile import RawFile, RawFileError, read_rawfile
from pyspice_runner.engine.silent import silent_fault
from pyspice_runner.errors import SimulationError

_NAME = re.compile(r"[a-z][a-z0-9_]*", re.ASCII)
_VECTOR = re.compile(r"[vi]\([a-z][a-z0-9_.]*\)", re.ASCII)
_STOPPED = re.compile(r"(\d+) *: condition met: stop")
_TROUBLE = re.compile(r"error|singular|too small|no such|unrecognized|cannot|can't|aborted|not available", re.I)
_ECHO = re.compile(r"ngspice \d+ -> ")  # ngspice 46 repeats a command behind its prompt
_HARMLESS = "no graphics interface"  # ngspice says so where there is no display
_ALMOST = 1.0 - 1e-9  # of a sample time: ngspice's own sum of steps may end a rounding before it
_DEFAULT_TIMEOUT = 600.0  # s of wall time between two samples


class Session:
    """A running transient.

    The deck has ``.save`` and one ``.tran``; one of its sources must have edges at the sample times, so that ngspice
    has a time point there. ``timeout`` is wall time in s between two samples.

    Raises:
        SimulationError: if ngspice fails; the process is ended.
    """

    def __init__(self, deck: str, vectors: Sequence[str], *, timeout: float | None = None) -> None:
        fault = silent_fault(deck)
        if fault:
            raise SimulationError(fault)
        for name in vectors:
            if not _VECTOR.fullmatch(name):
                raise SimulationError(
                    f"The vector {name!r} cannot be read in a session: it must be v(node) or i(source)."
                )
        ngspice_version()
        self._vectors = list(vectors)
        self._timeout = _DEFAULT_TIMEOUT if timeout is None else timeout
        self._log: list[str] = []
        self._marks = 0
        self._begun = False
        self._buffer = b""
        self._folder = new_folder()
        (self._folder / "deck.cir").write_text(deck, encoding="utf-8")
        # ngspice 46 -p ends with a segmentation fault if its session has no controlling terminal: the shell opens one
        self._terminal, terminal = os.openpty()
        try:
            self._process = start(
                ["/bin/sh", "-c", ': <>"$0" && exec "$@"', os.ttyname(terminal), find_ngspice(), "-p", "-n"],
                self._folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )  # fmt: skip
        finally:
            os.close(terminal)
        try:
            self._tell("source deck.cir", "set numdgt=15")
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def advance(self, until: float) -> dict[str, float]:
        """Run to a sample time in s, and return the vectors there.

        Raises:
            SimulationError: if ngspice fails, stops early, or takes longer than the timeout.
        """
        goal = until * _ALMOST
        said = self._tell(f"stop when time >= {goal!r}", "resume" if self._begun else "run")
        self._begun = True
        stop = next((match.group(1) for line in said if (match := _STOPPED.search(line))), None)
        if stop is None:
            raise self._failure(f"ngspice did not stop at {until:g} s", said)
        prints = [f"print {name}[length({name})-1]" for name in ("time", *self._vectors)]
        answers = self._tell(f"delete {stop}", *prints)
        values = [line.rpartition(" = ")[2] for line in answers if " = " in line]
        try:
            numbers = [float(value) for value in values]
        except ValueError:
            numbers = []
        if len(numbers) != len(prints) or not all(map(isfinite, numbers)):
            raise self._failure(f"ngspice gave no finite sample at {until:g} s", answers)
        return dict(zip(("time", *self._vectors), numbers, strict=True))

    def alter(self, source: str, value: float) -> None:
        """Set the value of an independent source from the present time on.

        Raises:
            SimulationError: for a name that is not that of a source, a value that is not finite, or if ngspice fails.
        """
        if not (_NAME.fullmatch(source) and source[0] in "vi" and isfinite(value)):
            raise SimulationError(f"{source!r} cannot be set to {value!r}: it takes the name of a source and a number.")
        self._tell(f"alter {source} = {float(value)!r}")

    def finish(self) -> RawFile:
        """Return all saved vectors up to the last sample, and end ngspice.

        Raises:
            SimulationError: if the vectors cannot be read.
        """
        said = self._tell("set filetype=binary", "write out.raw")
        try:
            return read_rawfile(self._folder / "out.raw")
        except RawFileError as error:
            raise self._failure(f"ngspice gave no usable result: {error}", said) from None
        finally:
            self.close()

    def close(self) -> None:
        """End ngspice and delete its files."""
        end(self._process)
        with contextlib.suppress(OSError):
            os.close(self._terminal)
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):
                if stream is not None:
                    stream.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _tell(self, *commands: str) -> list[str]:
        """Write commands and return ngspice's output until they are done."""
        self._marks += 1
        mark = f"done-{self._marks}."
        assert self._process.stdin is not None
        try:
            self._process.stdin.write("".join(f"{command}\n" for command in (*commands, f"echo {mark}")).encode())
            self._process.stdin.flush()
        except BrokenPipeError:
            raise self._failure("ngspice ended", []) from None
        said = self._listen(mark)
        complaint = [line for line in said if _TROUBLE.search(line) and _HARMLESS not in line]
        if complaint:
            raise self._failure("ngspice complained", complaint)
        return said

    def _listen(self, mark: str) -> list[str]:
        assert self._process.stdout is not None
        ends, said = time.monotonic() + self._timeout, list[str]()
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
                    raise self._failure(f"ngspice did not answer within {self._timeout:g} s", said)
                chunk = os.read(self._process.stdout.fileno(), 1 << 16)
                if not chunk:
                    raise self._failure("ngspice ended", said)
                self._buffer += chunk

    def _failure(self, what: str, said: Sequence[str]) -> SimulationError:
        self.close()
        quoted = " / ".join(line[:200] for line in said[:3] if line)
        return SimulationError(f'{what}: "{quoted}".' if quoted else f"{what}.", log="\n".join(said))
