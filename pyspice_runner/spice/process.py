# SPDX-License-Identifier: GPL-3.0-or-later
"""Processes of ngspice: one that ends with its deck, one that stays for the next, and one that pauses at samples.

A process that stays is ``ngspice -p``, which takes commands on its standard input. :func:`silent_fault` finds what
ngspice ignores in a netlist, with status 0 and no complaint in the log: measured with ngspice 39, an unknown parameter
on the line of a subcircuit's instance.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from functools import cache
from itertools import filterfalse
from math import isfinite
from pathlib import Path
from typing import Self, TypeVar

from pyspice_runner.errors import ParameterError, SimulationError, quoted
from pyspice_runner.interrupts import held
from pyspice_runner.spice import wasm
from pyspice_runner.spice.program import POSIX, Child, answer, new_folder

OLDEST_VERSION = 36  # behavioural sources and subcircuit parameters as the libraries use them
_VERSION_TIMEOUT = 20.0  # s; ngspice answers within about 5 ms
_INSTALL_HINT = (
    "Install it: `sudo apt-get install ngspice` (Debian, Ubuntu), `brew install ngspice` (macOS); or, on every system "
    "and without root, `pip install 'piezomotor[engine]'`, then `piezomotor engine install`."
)

_HANDSHAKE = 20.0  # s in which a new process must answer; ngspice takes 10 ms, Node.js 150 ms
_LONGEST = 600.0  # s for a run or between two samples
_MOST_FAILURES = 3  # processes that failed, after which no further one is started

_TROUBLE = re.compile(r"error|singular|too small|no such|unrecognized|cannot|can't|aborted|not available", re.I)
_ECHO = re.compile(r"ngspice \d+ ->")  # ngspice 46 repeats a command behind its prompt
# ngspice without a display; WebAssembly without start file and /proc
_HARMLESS = re.compile(r"no graphics interface|initialization file spinit|fopen\(\"/proc")
_NAME = re.compile(r"[a-z][a-z0-9_]*", re.ASCII)
_VECTOR = re.compile(r"[vi]\([a-z][a-z0-9_.]*\)", re.ASCII)
_STOPPED = re.compile(r"(\d+) *: condition met: stop")
_ALMOST = 1.0 - 1e-9  # of a sample time: ngspice's own sum of steps may end a rounding before it
# what is taken out of a netlist in lower case, in this order
_READING = (
    re.compile(r"^[^\S\n]*[*$].*\n?", re.M),  # comments
    re.compile(r"(?:;|\s\$\s|//).*"),
    re.compile(r"^[^\S\n]*\.control.*?(?:^[^\S\n]*\.endc.*?$|\Z)", re.M | re.S),
)
_QUOTED = re.compile(r"'[^'\n]*'|\"[^\"\n]*\"")
_BRACE = re.compile(r"([{}])")
_EQUALS = re.compile(r"[^\S\n]*=[^\S\n]*")
_GIVEN = re.compile(r"(?<!\S)([^\s=]*)=\S*")  # a parameter of an instance, name=value
T = TypeVar("T")


# --- the engine ---


def uses_wasm() -> bool:
    """Return whether decks run in ngspice as WebAssembly: by choice, or where there is no native ngspice.

    Raise ParameterError for another value of the environment variable PIEZOMOTOR_ENGINE than native and wasm.
    """
    stated = os.environ.get("PIEZOMOTOR_ENGINE", "")
    if stated not in ("", "native", "wasm"):
        raise ParameterError(f"PIEZOMOTOR_ENGINE is {stated!r}; set it to native or wasm, or leave it out.")
    if stated or _native():
        return stated == "wasm"
    with contextlib.suppress(SimulationError):
        return bool(wasm.version())
    return False


def ngspice_version() -> str:
    """Return the version of the ngspice that runs decks, such as "39", or "45.2 (WebAssembly)".

    Raises:
        SimulationError: if ngspice is missing, does not answer, or is older than version 36.
    """
    return wasm.version() if uses_wasm() else version_of(find_ngspice())


def _native() -> str | None:
    return (None if POSIX else shutil.which("ngspice_con")) or shutil.which("ngspice")  # the first has no window


def find_ngspice() -> str:
    """Return the path of the ngspice executable. Raise SimulationError if there is none on the PATH."""
    found = _native()
    if found is None:
        raise SimulationError(f"ngspice is not on the PATH. {_INSTALL_HINT}")
    return str(Path(found).absolute())  # an entry of PATH may be relative, and a run has a working folder of its own


@cache
def version_of(executable: str) -> str:
    """Return the version of the ngspice at a path.

    Raises:
        SimulationError: if it does not answer, or is older than version 36.
    """
    ended = answer([executable, "--version"], timeout=_VERSION_TIMEOUT, hint=_INSTALL_HINT)
    output = ended.stdout
    match = re.search(r"ngspice-(\d+)([.\d+]*)", output)
    if not match and ended.returncode < 0:
        how = signal.strsignal(-ended.returncode)
        raise SimulationError(f"`{executable} --version` was killed by signal {-ended.returncode} ({how}). Try again.")
    if not match:
        words = " / ".join((ended.stderr or output).strip().splitlines())
        said = f" It says {quoted(words)}." if words else ""
        raise SimulationError(f"{executable} does not state its version.{said} {_INSTALL_HINT}", log=output)
    if int(match.group(1)) < OLDEST_VERSION:
        raise SimulationError(f"ngspice {match.group(1)} is too old; version {OLDEST_VERSION} or later is needed.")
    return match.group(1) + match.group(2).rstrip("+.")


# --- the netlist ---


def _statements(deck: str) -> list[str]:
    """Return the lines ``.subckt`` and the instances that ngspice reads, with continuations joined.

    They are in lower case; expressions in braces or quotes are replaced by 0.
    """
    text = deck.lower().partition("\n")[2]
    for pattern in _READING:
        text = pattern.sub("", text)
    text = "\n".join(filter(None, map(str.strip, text.split("\n")))).replace("\n+", " ")
    lines = _QUOTED.sub("0", text).split("\n")
    return [_EQUALS.sub("=", _without_braces(line)) for line in lines if line.startswith((".subckt", "x"))]


def _without_braces(line: str) -> str:
    """Return a line with 0 for each outermost pair of braces; one that is not closed ends with the line."""
    kept, depth = [], 0
    for part in _BRACE.split(line):
        if part == "{":
            kept.append("" if depth else "0")
            depth += 1
        elif part == "}" and depth:
            depth -= 1
        elif not depth:
            kept.append(part)
    return "".join(kept)


def silent_fault(deck: str) -> str | None:
    """Return the first fault in a netlist that ngspice would ignore, as one sentence, or ``None``."""
    lines, pins = _statements(deck), dict[str, int]()
    known: dict[str, set[str]] = {}
    for line in lines:
        if line.startswith(".subckt"):
            words = _GIVEN.sub("", line.replace(" params:", " ")).split()
            subcircuit = words[1] if len(words) > 1 else ""
            known.setdefault(subcircuit, {"m"}).update(_GIVEN.findall(line))  # m multiplies any one
            pins[subcircuit] = min(len(words) - 2, pins.get(subcircuit, len(words)))
    for line in lines:
        if not line.startswith("x"):
            continue
        words = _GIVEN.sub("", line.replace(" params:", " ")).split()
        subcircuit, nodes = words[-1] if words else "", len(words) - 2
        if nodes < pins.get(subcircuit, nodes):
            return (
                f"The line of {words[0]} has {nodes} of the {pins[subcircuit]} nodes of subcircuit {subcircuit}, and "
                "ngspice 42 would take its name for one."
            )
        for name in _GIVEN.findall(line) if subcircuit in known else ():
            if name not in known[subcircuit]:
                has = ", ".join(sorted(known[subcircuit] - {"m"})) or "none"
                return (
                    f"Subcircuit {subcircuit} has no parameter {name}, and ngspice would ignore it without a message "
                    f"on the line of {words[0]}; it has {has}."
                )
    return None


# --- a process that stays ---


class Server:
    """A process ``ngspice -p`` in a folder of its own. ``timeout`` is wall time in s for one call of :meth:`send`.

    It ends with its standard input, hence also with this process.

    Raises:
        SimulationError: if ngspice fails; the process is ended.
    """

    def __init__(self) -> None:
        self.version, self.timeout = ngspice_version(), _HANDSHAKE
        self._marks = 0
        self.folder = new_folder()
        self._terminal: int | None = None
        self._process = wasm.dialogue(self.folder) if uses_wasm() else self._native()

    def _native(self) -> Child:
        command = [find_ngspice(), "-p", "-n"]
        if not POSIX:
            return Child(command, self.folder)
        # ngspice 46 -p ends with a segmentation fault if its session has no controlling terminal: the shell opens one
        self._terminal, terminal = os.openpty()
        try:
            return Child(["/bin/sh", "-c", ': <>"$0" && exec "$@"', os.ttyname(terminal), *command], self.folder)
        finally:
            os.close(terminal)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End ngspice and delete its files. A second call closes nothing, since the descriptor may be another's."""
        self._process.end()
        if self._terminal is not None:
            os.close(self._terminal)
            self._terminal = None
        shutil.rmtree(self.folder, ignore_errors=True)

    def send(self, *commands: str) -> list[str]:
        """Write commands and return ngspice's output until they are done."""
        self._marks += 1
        mark = f"done-{self._marks}."
        try:
            self._process.write("\n".join([*commands, f"echo {mark}", ""]))
        except OSError:  # a broken pipe
            raise self.failure("ngspice ended", []) from None
        output = self._listen(mark)
        complaint = list(filterfalse(_HARMLESS.search, filter(_TROUBLE.search, output)))
        if complaint:
            raise self.failure("ngspice complained", complaint)
        return output

    def _listen(self, mark: str) -> list[str]:
        output = list[str]()
        try:
            answered = self._process.read_until(mark, self.timeout, output)
        except subprocess.TimeoutExpired:
            raise self.failure(f"ngspice did not answer within {self.timeout:g} s", output) from None
        if not answered:
            raise self.failure("ngspice ended", output)
        return list(filterfalse(_ECHO.match, output))

    def failure(self, what: str, output: Sequence[str]) -> SimulationError:
        """End ngspice and return the error to raise, with ngspice's output."""
        self.close()
        quoted = " / ".join(line[:200] for line in output[:3] if line)
        return SimulationError(f'{what}: "{quoted}".' if quoted else f"{what}.", log="\n".join(output))


class KeptProcesses:
    """Processes of ngspice that run decks one after another, for :func:`.run_deck`. Threads may share them.

    That saves the start of ngspice, 6 ms of 10 to 60. The points are those of ``ngspice -b``, bit by bit.
    """

    def __init__(self) -> None:
        self._idle: list[Server] = []
        self._failures = 0
        self.stopped = False

    def __enter__(self) -> Self:
        return self

    def stop(self) -> None:
        """Let the threads that share them end, after an error or an interrupt."""
        self.stopped = True

    def __exit__(self, *_: object) -> None:
        while self._idle:
            self._idle.pop().close()

    def run(self, deck: str, verified: Callable[[Path, str, float, str], T]) -> T | None:
        """Run a transient and return what ``verified`` makes of raw file, log, wall time in s and version.

        ``None`` if a process or ``verified`` fails: only a run of its own reports why.
        """
        if self._failures >= _MOST_FAILURES:
            return None
        try:
            with held() as listening:  # an interrupt waits until the process is among the idle ones, or ended
                server = self._idle.pop() if self._idle else _started()
                try:
                    (server.folder / "deck.cir").write_text(deck, encoding="utf-8")
                    raw = server.folder / "out.raw"
                    began = time.perf_counter()
                    with listening():
                        log = "\n".join(server.send("source deck.cir", f"run {raw.name}", "destroy all", "remcirc"))
                    found = verified(raw, log, time.perf_counter() - began, server.version)
                    raw.unlink()  # it is mapped; the next run writes another file
                except BaseException:
                    server.close()
                    raise
                self._idle.append(server)
            return found
        except (SimulationError, OSError):
            self._failures += 1
            return None


def _started() -> Server:
    """Return a new process that has written its first lines."""
    server = Server()
    server.send()
    server.timeout = _LONGEST
    return server


class Session(Server):
    """A running transient that pauses at sample times to be read and altered: for a controller in the loop.

    The deck has ``.save`` and one ``.tran``; one of its sources must have edges at the sample times, so that ngspice
    has a time point there. ``timeout`` is wall time in s between two samples. Only checked names and numbers are
    written to ngspice's standard input, so that no user text reaches its control language.

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
        super().__init__()
        self._vectors = list(vectors)
        self._command = "run"
        (self.folder / "deck.cir").write_text(deck, encoding="utf-8")
        try:
            self.send()
            self.timeout = _LONGEST if timeout is None else timeout
            self.send("source deck.cir", "set numdgt=15")
        except BaseException:
            self.close()
            raise

    def advance(self, until: float) -> dict[str, float]:
        """Run to a sample time in s, and return the vectors there.

        Raises:
            SimulationError: if ngspice fails, stops early, or takes longer than the timeout.
        """
        # WebAssembly takes no >= here
        output = self.send(f"stop when time ge {until * _ALMOST!r}", self._command)
        self._command = "resume"
        stop = next((match.group(1) for line in output if (match := _STOPPED.search(line))), None)
        if stop is None:
            raise self.failure(f"ngspice did not stop at {until:g} s", output)
        names = ("time", *self._vectors)
        answers = self.send(f"delete {stop}", *(f"print {name}[length({name})-1]" for name in names))
        values = [line.rpartition(" = ")[2] for line in answers if " = " in line]
        try:
            numbers = [float(value) for value in values]
        except ValueError:
            numbers = []
        if len(numbers) != len(names) or not all(map(isfinite, numbers)):
            raise self.failure(f"ngspice gave no finite sample at {until:g} s", answers)
        return dict(zip(names, numbers, strict=True))

    def alter(self, source: str, value: float) -> None:
        """Set the value of an independent source from the present time on.

        Raises:
            SimulationError: for a name that is not that of a source, a value that is not finite, or if ngspice fails.
        """
        if not (_NAME.fullmatch(source) and source[0] in "vi" and isfinite(value)):
            raise SimulationError(f"{source!r} cannot be set to {value!r}: it takes the name of a source and a number.")
        self.send(f"alter {source} = {float(value)!r}")
