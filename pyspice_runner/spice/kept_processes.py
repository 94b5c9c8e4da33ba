# SPDX-License-Identifier: GPL-3.0-or-later
"""Many short runs in few processes: ngspice stays after a run and takes the next deck.

That saves the start of ngspice, 6 ms of 10 to 60. The points are those of ``ngspice -b``, bit by bit. A deck that gives
the slightest complaint is run again by :func:`.run_deck`, which tells what is wrong.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Self

from pyspice_runner.errors import SimulationError
from pyspice_runner.interrupts import held
from pyspice_runner.spice.deck_lint import silent_fault
from pyspice_runner.spice.ngspice import SpiceRun, run_deck, verified_run
from pyspice_runner.spice.pipe import Pipe

_HANDSHAKE = 5.0  # s in which a new process must answer; it takes 10 ms
_LONGEST = 600.0  # s for a run, after which it is begun anew in a process of its own
_MOST_FAILURES = 3  # processes that did not do, after which no further one is tried


class KeptProcesses:
    """Processes of ngspice that run decks one after another. The threads of a process may share them."""

    def __init__(self) -> None:
        self._idle: list[Pipe] = []
        self._failures = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        while self._idle:
            self._idle.pop().close()

    def run(self, deck: str, vectors: Sequence[str], stop_time: float) -> SpiceRun:
        """Run a transient and return its vectors, as :func:`.run_deck` does.

        Raises:
            SimulationError: with ngspice's message.
        """
        if self._failures < _MOST_FAILURES and not silent_fault(deck):
            try:
                return self._run(deck, vectors, stop_time)
            except (SimulationError, OSError):
                self._failures += 1
        return run_deck(deck, vectors=vectors, stop_time=stop_time)

    def _run(self, deck: str, vectors: Sequence[str], stop_time: float) -> SpiceRun:
        with held() as listening:  # an interrupt waits until the process is among the idle ones, or ended
            pipe = self._idle.pop() if self._idle else _begun()
            try:
                (pipe.folder / "deck.cir").write_text(deck, encoding="utf-8")
                raw = pipe.folder / "out.raw"
                began = time.perf_counter()
                with listening():
                    log = "\n".join(pipe.tell("source deck.cir", f"run {raw.name}", "destroy all", "remcirc"))
                seconds = time.perf_counter() - began
                found = verified_run(raw, log, vectors, stop_time)
                raw.unlink()  # it is mapped; the next run writes another file
            except BaseException:
                pipe.close()
                raise
            self._idle.append(pipe)
        return SpiceRun(found, seconds, log, pipe.version)


def _begun() -> Pipe:
    """Return a new process that has said what it says at its start."""
    pipe = Pipe(_HANDSHAKE)
    pipe.tell()
    pipe.timeout = _LONGEST
    return pipe
