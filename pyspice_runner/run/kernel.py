# SPDX-License-Identifier: GPL-3.0-or-later
"""The one way to run a bench: deck, verified vectors, final values and the time that it took."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.engine.ngspice import Result, ngspice_version
from pyspice_runner.engine.pyspice import BatchSimulator
from pyspice_runner.errors import Interrupted
from pyspice_runner.netlist.sources import Bench

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """A verified run of a bench.

    Attributes:
        result: what ngspice gave; the vectors are views of its file.
        deck: the netlist that was run.
    """

    result: Result
    deck: str = field(repr=False)

    @property
    def deck_sha256(self) -> str:
        """Hash of the deck."""
        return hashlib.sha256(self.deck.encode()).hexdigest()

    @property
    def seconds(self) -> float:
        """Wall time in s that ngspice took."""
        return self.result.seconds

    @property
    def ngspice_version(self) -> str:
        """Version of ngspice."""
        return ngspice_version()

    def vectors(self, every: int = 1) -> dict[str, Array]:
        """Return the real vectors by name, ``time`` first; every so-many-th point of them."""
        raw = self.result.raw.vectors if every == 1 else self.result.raw.thinned(every)
        return {name: np.asarray(values, dtype=float) for name, values in raw.items()}

    def phasors(self) -> dict[str, NDArray[np.complex128]]:
        """Return the complex vectors of an AC analysis by name."""
        return {name: np.asarray(values, dtype=complex) for name, values in self.result.raw.vectors.items()}

    def last(self) -> dict[str, float]:
        """Return the value of every vector at the end of the run: its final state, if the states were recorded."""
        return {name: float(values[-1].real) for name, values in self.result.raw.vectors.items()}


def simulator(bench: Bench, vectors: Sequence[str], timeout: float | None = None) -> BatchSimulator:
    """Return PySpice's simulator of a bench, with its options, its start and what is to be recorded."""
    ready = BatchSimulator(bench.circuit, timeout=timeout)
    ready.options(**bench.options)
    ready.initial_condition(**{node: voltage for node, voltage in bench.start.items() if voltage})
    ready.save(*vectors)
    return ready


def transient(
    bench: Bench,
    vectors: Sequence[str],
    *,
    step: float,
    duration: float,
    longest: float | None = None,
    record_from: float = 0.0,
    timeout: float | None = None,
    progress: Callable[[float], object] | None = None,
    keep_partial: bool = False,
) -> Outcome:
    """Run a bench from its initial state.

    Args:
        bench: the bench.
        vectors: what to record, as ngspice's ``.save`` takes it.
        step: time step in s.
        longest: longest time step in s where ngspice chooses them; by default ``step``, which makes them uniform.
        duration: time in s that is simulated.
        record_from: time in s from which on points are recorded.
        timeout: wall time in s after which ngspice is ended.
        progress: called some times a second with the time in s that the run has reached.
        keep_partial: whether an interrupted run returns its points, as ``partial`` of :class:`Interrupted`.

    Raises:
        SimulationError: if ngspice fails or its result cannot be trusted.
        Interrupted: if interrupted and ``keep_partial``.
    """
    timing = {
        "step_time": step, "end_time": duration, "start_time": record_from, "max_time": longest or step,
        "use_initial_condition": True,
    }  # fmt: skip
    return _run(simulator(bench, vectors, timeout), "transient", timing, progress=progress, keep_partial=keep_partial)


def ac(
    bench: Bench,
    vectors: Sequence[str],
    *,
    guess: Mapping[str, float] | None = None,
    timeout: float | None = None,
    **sweep: Any,
) -> Outcome:
    """Run a small-signal analysis of a bench; ``sweep`` is what PySpice's ``.ac()`` takes.

    Args:
        bench: the bench.
        vectors: what to record.
        guess: voltages of nodes with which the iteration to the operating point begins.
        timeout: wall time in s after which ngspice is ended.
        sweep: as said.

    Raises:
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    ready = simulator(bench, vectors, timeout)
    ready.node_set(**(guess or {}))
    return _run(ready, "ac", sweep)


def _run(ready: BatchSimulator, analysis: str, arguments: Mapping[str, Any], **how: Any) -> Outcome:
    deck = str(ready.prepare(analysis, **arguments))
    ready.reset_analysis()
    try:
        return Outcome(ready.verified(analysis, **how, **arguments), deck)
    except Interrupted as interrupt:
        raise Interrupted(str(interrupt), Outcome(interrupt.partial, deck)) from None
