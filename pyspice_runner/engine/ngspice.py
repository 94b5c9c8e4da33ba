# SPDX-License-Identifier: GPL-3.0-or-later
"""Netlist text in, verified waveforms out.

Each run is a process ``ngspice -b -n -r`` of its own in a folder of its own, so that concurrent runs do not meet and
no user's start-up file is read. ngspice's exit status and the presence of a raw file do not mean success; a run counts
only if the status is 0, the log is clean, every vector asked for is there and finite, and the analysis reached its end.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from pyspice_runner.engine.rawfile import RawFile, RawFileError, read_rawfile
from pyspice_runner.errors import SimulationError

OLDEST_VERSION = 36  # behavioural sources and subcircuit parameters as the libraries use them
_INSTALL_HINT = "Install it: `sudo apt-get install ngspice` (Debian, Ubuntu), `brew install ngspice` (macOS)."

# Words by which ngspice 36 to 44 tells that something is amiss, on standard output or standard error alike.
_TROUBLE = re.compile(
    r"error|warning|singular|unknown|unrecogni[sz]ed|undefined|can't|cannot|could not|fail|abort|too small|"
    r"no such|not found|no convergence|ignored|out of memory|iteration limit",
    re.I,
)


@dataclass(frozen=True)
class Result:
    """What a verified run gave.

    Attributes:
        raw: the vectors.
        seconds: wall time of the ngspice process.
        log: ngspice's words.
    """

    raw: RawFile
    seconds: float
    log: str


def find_ngspice() -> str:
    """Return the path of the ngspice executable.

    Raises:
        SimulationError: if there is none on the PATH.
    """
    found = shutil.which("ngspice")
    if found is None:
        raise SimulationError(f"ngspice is not on the PATH. {_INSTALL_HINT}")
    return found


def ngspice_version() -> str:
    """Return ngspice's version, such as "39".

    Raises:
        SimulationError: if ngspice is missing, does not answer, or is older than version 36.
    """
    return _version_of(find_ngspice())


@cache
def _version_of(executable: str) -> str:
    try:
        answer = subprocess.run(
            [executable, "--version"],
            capture_output=True,
            text=True,
            timeout=20,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise SimulationError(f"{executable} does not run: {error}. {_INSTALL_HINT}") from error
    match = re.search(r"ngspice-(\d+)([.\d+]*)", answer.stdout)
    if not match:
        raise SimulationError(f"{executable} does not say which version it is. {_INSTALL_HINT}", log=answer.stdout)
    if int(match.group(1)) < OLDEST_VERSION:
        raise SimulationError(f"ngspice {match.group(1)} is too old; version {OLDEST_VERSION} or later is needed.")
    return match.group(1) + match.group(2).rstrip("+.")


def run_deck(
    deck: str, *, vectors: Sequence[str], stop_time: float | None = None, timeout: float | None = None
) -> Result:
    """Run a netlist and return its vectors, or raise.

    Args:
        deck: the complete netlist, with ``.save`` and one analysis.
        vectors: names that must be present in the result, all finite.
        stop_time: for a transient, the time in s that it must reach.
        timeout: wall time in s after which the run is ended.

    Raises:
        SimulationError: with ngspice's own words and, as ``deck``, the file kept for inspection.
    """
    executable = find_ngspice()
    ngspice_version()
    try:
        folder = Path(tempfile.mkdtemp(prefix="piezomotor-"))
        deck_path = folder / "deck.cir"
        deck_path.write_text(deck, encoding="utf-8")
    except OSError as error:
        raise SimulationError(
            f"Cannot write the netlist to {tempfile.gettempdir()}: {error.strerror}. Free some space or set TMPDIR."
        ) from error
    keep = False
    try:
        status, log, seconds = _execute(executable, folder, deck_path, timeout)
        raw = _verified(folder / "out.raw", status, log, vectors, stop_time)
    except _Unsound as error:
        keep = True
        (folder / "out.raw").unlink(missing_ok=True)
        raise SimulationError(f"{error} The netlist is kept as {deck_path}.", deck=deck_path, log=error.log) from None
    finally:
        if not keep:
            shutil.rmtree(folder, ignore_errors=True)
    return Result(raw, seconds, log)


class _Unsound(Exception):
    """A run that must not be believed, with ngspice's log."""

    def __init__(self, message: str, log: str) -> None:
        super().__init__(message)
        self.log = log


def _execute(executable: str, folder: Path, deck: Path, timeout: float | None) -> tuple[int, str, float]:
    """Run ngspice to its end; an interrupt or a timeout ends the child first."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("SPICE", "NGSPICE", "LC_"))}
    environment["LC_ALL"] = "C"
    started = time.perf_counter()
    with (folder / "log").open("w+b") as log_file:
        process = subprocess.Popen(
            [executable, "-b", "-n", "-r", "out.raw", deck.name],
            cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=log_file, stderr=subprocess.STDOUT,
            start_new_session=True,
        )  # fmt: skip
        try:
            status = process.wait(timeout=timeout)
        except subprocess.TimeoutExpired:
            raise _Unsound(f"ngspice did not finish within {timeout:g} s and was stopped.", _read(log_file)) from None
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            process.wait()
        return status, _read(log_file), time.perf_counter() - started


def _read(log_file: object) -> str:
    log_file.seek(0)  # type: ignore[attr-defined]
    text: bytes = log_file.read(1 << 20)  # type: ignore[attr-defined]
    return text.decode("utf-8", errors="replace")


def _verified(path: Path, status: int, log: str, vectors: Sequence[str], stop_time: float | None) -> RawFile:
    words = _own_words(log)
    if status != 0:
        how = f"was killed by signal {-status}" if status < 0 else f"ended with status {status}"
        raise _Unsound(f"ngspice {how}{words}.", log)
    if words:
        raise _Unsound(f"ngspice finished but complained{words}.", log)
    try:
        raw = read_rawfile(path)
    except RawFileError as error:
        raise _Unsound(f"ngspice gave no usable result: {error}.", log) from None
    missing = [name for name in vectors if name.lower() not in raw.vectors]
    if missing:
        raise _Unsound(f"ngspice left out the vector {missing[0]}.", log)
    for name in vectors:
        if not np.all(np.isfinite(raw.vectors[name.lower()])):
            raise _Unsound(f"ngspice gave values of {name} that are not finite.", log)
    if stop_time is not None:
        reached = float(raw.vectors["time"][-1].real)
        if reached < stop_time * (1.0 - 1e-9):
            raise _Unsound(f"ngspice stopped at {reached:g} s, before the end at {stop_time:g} s.", log)
    return raw


def _own_words(log: str) -> str:
    """Return the first lines of complaint in a log, ready to be put behind a sentence."""
    lines = [line.strip() for line in log.splitlines() if _TROUBLE.search(line)]
    return f': "{" / ".join(lines[:3])}"' if lines else ""
