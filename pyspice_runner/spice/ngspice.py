# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a netlist in ngspice and verify its result.

Each run is a separate process ``ngspice -b -n -r`` in a separate folder, so that concurrent runs do not interfere and
the user's start-up file is not read. ngspice's exit status and the presence of a raw file do not mean success. A run is
valid only if the netlist has none of the faults that ngspice ignores (:func:`.silent_fault`), the status is 0, the log
has no complaint, every requested vector is present and finite, and the analysis reached its end.

:func:`run_deck` is the only way from the text of a deck to waveforms: an engine other than the native program takes its
place there. PySpice writes the decks (:class:`BatchSimulator`). Its own runners are not used, because they may return
the data of the previous run after a netlist with a syntax error.
"""

from __future__ import annotations

import errno
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import dropwhile
from pathlib import Path
from typing import IO, Any

from PySpice.Spice.Netlist import Circuit
from PySpice.Spice.Simulation import CircuitSimulation, CircuitSimulator

from pyspice_runner.errors import Interrupted, ParameterError, SimulationError, require
from pyspice_runner.interrupts import Listening, held
from pyspice_runner.spice import wasm
from pyspice_runner.spice.process import KeptProcesses, silent_fault, uses_wasm
from pyspice_runner.spice.process import find_ngspice as find_ngspice
from pyspice_runner.spice.process import ngspice_version as ngspice_version
from pyspice_runner.spice.program import FREE_SPACE, Child, new_folder
from pyspice_runner.spice.rawfile import RawFile, RawFileError, read_rawfile

Progress = Callable[[float], object] | None  # called with the simulated time in s

LARGEST = 1e100  # of a value, in any unit: no physical quantity is near it, and its square is still a number
_PROGRESS_PERIOD = 0.2  # s; ngspice reports its progress no more often
_PATIENCE = 10.0  # s of wall time, in which a transient must advance by _MIN_ADVANCE
# of its duration, which would take 12 days; a run of 1e8 steps, half an hour, advances by 500 times as much
_MIN_ADVANCE = 1e-5
_LONGEST_LOG = 1 << 24  # bytes; a good run writes about 1 kB
_FULL = 1 << 16  # bytes; a disk that ngspice has filled has less than this free, the size of one write

# Words by which ngspice 36 to 46 reports a problem, on standard output or standard error.
_TROUBLE = re.compile(
    r"error|warning|singular|unknown|unrecogni[sz]ed|undefined|can't|cannot|could not|fail|abort|"
    r"too (?:small|few|many)|no such|not found|no convergence|ignored|out of memory|iteration limit|interrupted|"
    r"no \.measure possible",
    re.I,
)
# Lines of every run. They name the netlist's title and nodes, which may hold any of the words above.
_CHATTER = re.compile(
    r"Circuit: |Note: |Doing analysis at|binary raw file|No\. of Data|Using transient initial|"
    r"Using (?:SPARSE|KLU)|Operating point simulation skipped|now using transient initial|No\. of Data Columns|"
    r"Initial Transient Solution|Node +Voltage|Reference value|or no active circuit available|-+ *-*$|"
    r"\S+ +-?(?:\d[\d.]*(?:e[-+]\d+)?|nan|inf)$|Total (?:analysis|elapsed)|Total DRAM|DRAM currently|.* program size =|"
    r"Shared ngspice pages|Text \(code\) pages|Stack =|Library pages|ngspice-\d+ done|"
    r"fopen\(\"/proc/|Warning: can't find the initialization file spinit"  # WebAssembly has neither
)
_STEPPING = re.compile(r"(Trying gmin =|Supplies reduced to) *\S+ *")  # the outcome follows on the same line


@dataclass(frozen=True)
class SpiceRun:
    """The result of a verified run."""

    raw: RawFile  # the vectors
    seconds: float  # wall time of the ngspice process
    log: str  # the log of ngspice
    ngspice_version: str  # version of ngspice


def run_deck(
    deck: str,
    *,
    vectors: Sequence[str],
    stop_time: float | None = None,
    stop_frequency: float | None = None,
    timeout: float | None = None,
    progress: Progress = None,
    keep_partial: bool = False,
    processes: KeptProcesses | None = None,
) -> SpiceRun:
    """Run a netlist and return its vectors, or raise.

    The netlist has ``.save`` and one analysis, which must reach ``stop_time`` in s or ``stop_frequency`` in Hz. The
    ``vectors``, as ``.save`` takes them (``v(out)``, ``out``, ``i(v1)``, ``@r1[i]``), must be present and finite.
    ``timeout`` is wall time in s. ``progress`` is called several times a second with the simulated time in s. A
    transient may run in one of the ``processes``; if it fails there, it runs again in a process of its own, whose
    message names the cause. Those of WebAssembly stay in any case.

    Raises:
        SimulationError: with ngspice's message and, as ``deck``, the file kept for inspection.
        Interrupted: for ``keep_partial``, when interrupted; ``partial`` is a :class:`SpiceRun` that ended too early.
    """
    in_wasm = uses_wasm()
    fault = silent_fault(deck) or (wasm.refused(deck) if in_wasm else None)
    verified = partial(_verified, vectors, stop_time, stop_frequency)
    if processes and not fault and not in_wasm and (found := processes.run(deck, verified)):
        return found
    version = ngspice_version()
    with held() as listening:  # while ngspice runs; an interrupt before or after waits until its files are cleared away
        folder = new_folder()
        deck_path = folder / "deck.cir"
        keep = False
        try:
            deck_path.write_text(deck, encoding="utf-8")
            if fault:
                raise SimulationError(fault)
            started = time.perf_counter()
            try:
                status, log, seconds = _execute(in_wasm, folder, timeout, progress, stop_time, listening)
            except KeyboardInterrupt as interrupt:
                if not keep_partial:
                    raise
                raise _interrupted(folder / "out.raw", vectors, time.perf_counter() - started, version) from interrupt
            _check_status(status, log)
            return verified(folder / "out.raw", log, seconds, version)
        except SimulationError as error:
            keep = True
            full = "" if shutil.disk_usage(folder).free > _FULL else f" The disk of {folder} is full. {FREE_SPACE}"
            for scrap in ("out.raw", "log"):
                (folder / scrap).unlink(missing_ok=True)
            raise SimulationError(
                f"{error}{full} The netlist is kept as {deck_path}.", deck=deck_path, log=error.log
            ) from None
        except OSError as error:
            if error.errno == errno.ENOMEM:  # a result is mapped, not read
                raise MemoryError(error.strerror) from error
            raise SimulationError(f"Cannot write to {folder}: {error.strerror}. {FREE_SPACE}") from error
        finally:
            if not keep:
                shutil.rmtree(folder, ignore_errors=True)


def _execute(
    in_wasm: bool, folder: Path, timeout: float | None, progress: Progress, stop: float | None, listening: Listening
) -> tuple[int, str, float]:
    """Run ngspice to its end; an interrupt or a timeout ends the child first."""
    started = time.perf_counter()
    with (folder / "log").open("w+b") as log_file:
        words = ("-b", "-n", "-r", "out.raw", "deck.cir")
        try:
            process = wasm.Batch(folder, *words) if in_wasm else Child([find_ngspice(), *words], folder, log_file)
        except OSError as error:
            raise SimulationError(f"{error.filename} does not run: {error.strerror}.") from None
        try:
            with listening():
                status = _wait(process, timeout, progress, stop, log_file)
        except subprocess.TimeoutExpired:
            raise SimulationError(
                f"ngspice did not finish within {timeout:g} s and was stopped.", log=_read(log_file)
            ) from None
        finally:
            process.end()
        return status, _read(log_file), time.perf_counter() - started


def _wait(
    process: Child | wasm.Batch, timeout: float | None, progress: Progress, stop: float | None, log_file: IO[bytes]
) -> int:
    """Wait for the end of ngspice, and report the simulated time.

    Raise SimulationError for a transient that hardly advances, because its iteration needs very small steps.
    """
    if progress is None and stop is None:
        return process.wait(timeout=timeout)
    period = _PROGRESS_PERIOD if progress else 0.1 * _PATIENCE
    ends, last = (None if timeout is None else time.monotonic() + timeout), b""
    advanced, crawled = 0.0, 0.0  # s: simulated time, and the wall time since then
    while True:
        left = period if ends is None else max(min(period, ends - time.monotonic()), 0.0)
        try:
            return process.wait(timeout=left)
        except subprocess.TimeoutExpired:
            if ends is not None and time.monotonic() >= ends:
                raise
        tail = Path(log_file.name).read_bytes()[-200:]  # log_file shares its position with ngspice
        reached = re.findall(rb"Reference value : +(\d\S*e\S+)", tail)
        if reached and reached[-1] != last:
            last, now = reached[-1], float(reached[-1])
            if progress:
                progress(now)
            crawled += period
            if stop is None or now - advanced > _MIN_ADVANCE * stop:
                advanced, crawled = now, 0.0
            elif crawled > _PATIENCE:
                raise SimulationError(
                    f"The time steps of ngspice become too small at {now:.4g} s of {stop:g} s, and it was "
                    "stopped. Halve the step, or check stiffness, damping and compliance of the contact.",
                    log=_read(log_file),
                )


def _interrupted(path: Path, vectors: Sequence[str], seconds: float, version: str) -> KeyboardInterrupt:
    """Return the interrupt to raise, with the complete points of the run, if any."""
    try:
        raw = read_rawfile(path, partial=True)
    except RawFileError:
        return KeyboardInterrupt()
    if raw.missing(vectors) or raw.beyond(LARGEST, vectors):
        return KeyboardInterrupt()
    return Interrupted("The run was interrupted.", SpiceRun(raw, seconds, "", version))


def _read(log_file: IO[bytes]) -> str:
    log_file.seek(0)
    text = log_file.read(_LONGEST_LOG + 1)
    if len(text) > _LONGEST_LOG:
        raise SimulationError(f"ngspice wrote a log of more than {_LONGEST_LOG >> 20} MiB, too long to be checked.")
    return text.decode("utf-8", errors="replace")


def _check_status(status: int, log: str) -> None:
    if status != 0:
        how = f"ended with status {status}"
        if status < 0:
            how = f"was killed by signal {-status} ({signal.strsignal(-status)})"
            how += ", as the system does when memory runs out" if -status == signal.SIGKILL else ""
        raise SimulationError(f"ngspice {how}{_quoted(_spoken(log))}.", log=log)


def _verified(
    vectors: Sequence[str], stop_time: float | None, stop_frequency: float | None,
    path: Path, log: str, seconds: float, version: str,
) -> SpiceRun:  # fmt: skip
    """Return the run that wrote a raw file; the first arguments are those of :func:`run_deck`.

    Raises:
        SimulationError: if the log has a complaint, a vector is missing or not finite, or the end was not reached.
    """
    complaint = list(dropwhile(lambda line: not _TROUBLE.search(line), _spoken(log)))
    if complaint:
        raise SimulationError(f"ngspice finished but complained{_quoted(complaint)}.", log=log)
    try:
        raw = read_rawfile(path)
    except RawFileError as error:
        raise SimulationError(f"ngspice gave no usable result: {error}.", log=log) from None
    absent = raw.missing(vectors)
    if absent:
        raise SimulationError(f"ngspice left out the vector {absent}; check that the netlist has it.", log=log)
    spoiled = raw.beyond(LARGEST, vectors)
    if spoiled:
        raise SimulationError(f"ngspice gave values of {spoiled} that are not finite or exceed {LARGEST:g}.", log=log)
    _check_end(raw, "time", stop_time, "s", log)
    _check_end(raw, "frequency", stop_frequency, "Hz", log)
    return SpiceRun(raw, seconds, log, version)


def _check_end(raw: RawFile, abscissa: str, stop: float | None, unit: str, log: str) -> None:
    """Raise if an analysis ended before the requested time or frequency."""
    if stop is None:
        return
    if abscissa not in raw.vectors:
        raise SimulationError(f"ngspice gave no {abscissa}; its result is {raw.plot!r}.", log=log)
    axis = raw.vectors[abscissa].real
    reached = float(axis[-1])
    if abscissa == "frequency" and len(axis) > 1 and axis[-1] - axis[-2] < 1e-9 * len(axis) * stop:
        # ngspice adds up the steps of a sweep. The rounding error of many steps exceeds its tolerance for the end, 1e-6
        # of a step, and the last step may be dropped
        stop -= 1.01 * float(axis[-1] - axis[-2])
    if not reached >= stop * (1.0 - 1e-9):
        raise SimulationError(f"ngspice stopped at {reached:g} {unit}, before the end at {stop:g} {unit}.", log=log)


def _spoken(log: str) -> list[str]:
    """Return the lines of a log that not every run has."""
    lines = map(str.strip, _STEPPING.sub("", log).splitlines())
    return [line for line in lines if line and not _CHATTER.match(line)]


def _quoted(lines: Sequence[str]) -> str:
    """Return the first few lines, to append to a sentence."""
    few = [line[:200] for line in list(dict.fromkeys(lines))[:3]]
    return f': "{" / ".join(few)}"' if few else ""


# --- the runner as a simulator of PySpice ---


class BatchSimulator(CircuitSimulator):
    """A PySpice simulator that runs ``ngspice -b`` in a process of its own and verifies the result.

    ``ac``, ``transient`` and ``operating_point`` take PySpice's arguments and return the verified vectors, which are in
    :attr:`result`. The deck that would run is ``str(simulator)``. ``timeout`` is wall time in s.

    Raises:
        ParameterError: by another analysis.
        SimulationError: by every analysis that fails or cannot be trusted.
    """

    SIMULATOR = "ngspice"

    def __init__(self, circuit: Circuit, *, timeout: float | None = None) -> None:
        require(timeout is None or timeout > 0.0, "timeout", timeout, "a number > 0 s", unit="s")
        super().__init__(circuit)
        self._options.clear()  # both temperatures are ngspice's 27 degrees
        self._timeout = timeout
        self._saved_nodes: list[str] = []  # PySpice's own is a set, which Python orders anew in every process
        self.result: SpiceRun | None = None
        self.deck = ""  # the netlist that was run last

    def save(self, *names: str) -> None:
        """Add vectors to the ``.save`` line, in the order given."""
        self._saved_nodes = list(dict.fromkeys([*self._saved_nodes, *names]))

    def prepare(self, analysis: str, *values: Any, **arguments: Any) -> BatchSimulator:
        """Add an analysis (``"transient"``, ``"ac"``) for ``str(simulator)``; nothing runs."""
        self.reset_analysis()
        # PySpice's own _run also writes the deck, to log it
        getattr(CircuitSimulation, analysis)(self, *values, **arguments)
        return self

    def verified(
        self, analysis_method: str, *args: Any, progress: Progress = None, keep_partial: bool = False,
        processes: KeptProcesses | None = None, **kwargs: Any,
    ) -> SpiceRun:  # fmt: skip
        """Run an analysis and return the vectors of the raw file.

        ``progress`` and ``keep_partial`` are those of :func:`run_deck`. A transient
        without a timeout runs in one of the ``processes``, if they are given.
        """
        self.result = None
        if analysis_method not in ("ac", "transient", "operating_point"):
            raise ParameterError(
                f"BatchSimulator does not run {analysis_method}; it runs ac, transient, operating_point."
            )
        self.deck = str(self.prepare(analysis_method, *args, **kwargs))
        parameters = next(iter(self.analysis_iter()))
        self.reset_analysis()
        self.result = run_deck(
            self.deck,
            vectors=self._saved_nodes,
            stop_time=float(parameters.end_time) if analysis_method == "transient" else None,
            stop_frequency=_last_frequency(parameters) if analysis_method == "ac" else None,
            timeout=self._timeout,
            progress=progress,
            keep_partial=keep_partial,
            processes=None if self._timeout else processes,
        )
        return self.result

    _run = verified


def _last_frequency(parameters: Any) -> float:
    """Return the frequency in Hz that a sweep must reach: its end, or one step before it for a logarithmic sweep."""
    base = {"dec": 10.0, "oct": 2.0}.get(str(parameters.variation).lower(), 1.0)
    step: float = base ** (1.0 / int(parameters.number_of_points))
    return float(parameters.stop_frequency) / step
