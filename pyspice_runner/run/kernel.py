# SPDX-License-Identifier: GPL-3.0-or-later
"""The one way to run a bench: deck, verified vectors, final values and the time that it took."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.evaluated import Derived
from pyspice_runner.errors import Interrupted, SimulationError
from pyspice_runner.spice.ngspice import BatchSimulator, SpiceRun

Array = NDArray[np.float64]

_COLLAPSED = "timestep too small"  # in the log of a run whose steps fell below what ngspice allows


@dataclass(frozen=True)
class Outcome(SpiceRun):
    """A verified run of a bench; the vectors of the raw file are views of it."""

    deck: str = field(repr=False)  # the netlist that was run
    # the requested vectors that follow from others, by name.
    signals: Mapping[str, Derived] = field(default_factory=dict, repr=False)

    @property
    def deck_sha256(self) -> str:
        """Hash of the deck."""
        return hashlib.sha256(self.deck.encode()).hexdigest()

    def vectors(self, every: int = 1) -> dict[str, Array]:
        """Return every ``every``-th point of the real vectors by name, ``time`` first."""
        raw = self.raw.vectors if every == 1 else self.raw.thinned(every)
        return self._signals({name: np.asarray(values, dtype=float) for name, values in raw.items()})

    def phasors(self) -> dict[str, NDArray[np.complex128]]:
        """Return the complex vectors of an AC analysis by name."""
        return {name: np.asarray(values, dtype=complex) for name, values in self.raw.vectors.items()}

    def last(self) -> dict[str, float]:
        """Return the value of every vector at the end of the run: its final state, if the states were recorded."""
        ends = {name: values[-1:].real for name, values in self.raw.vectors.items()}
        return {name: float(values[0]) for name, values in self._signals(ends).items()}

    def _signals(self, vectors: dict[str, Array]) -> dict[str, Array]:
        """Add those that follow from others to vectors."""
        return vectors | {name: one.of(vectors) for name, one in self.signals.items()}


def simulator(bench: Bench, vectors: Sequence[str], timeout: float | None = None) -> BatchSimulator:
    """Return PySpice's simulator of a bench, with its options, initial voltages and recorded vectors."""
    ready = BatchSimulator(bench.circuit, timeout=timeout)
    ready.options(**bench.options)
    ready.initial_condition(**{node: voltage for node, voltage in bench.start.items() if voltage})
    terms: list[str] = []
    for name in vectors:
        terms += bench.signals[name].terms if name in bench.signals else [name]
    ready.save(*terms)
    return ready


def transient(
    bench: Bench,
    vectors: Sequence[str],
    *,
    step: float,
    duration: float,
    record_from: float = 0.0,
    timeout: float | None = None,
    progress: Callable[[float], object] | None = None,
    keep_partial: bool = False,
    uniform: bool = True,
) -> Outcome:
    """Run a bench from its initial state.

    Points are recorded from ``record_from`` (s) on.
    ``progress`` is called some times a second with the time in s that the run has reached. With ``keep_partial`` an
    interrupted run returns its points, as ``partial`` of :class:`Interrupted`.

    Where steps are not ``uniform`` by the options of the bench, a run that ends with "Timestep too small" is repeated
    once with half the step: whether steps collapse at a switching edge depends on their positions and on the version
    of ngspice.

    Raises:
        SimulationError: if ngspice fails or its result cannot be trusted.
        Interrupted: if interrupted and ``keep_partial``.
    """

    def run(step: float) -> Outcome:
        timing = transient_timing(step, duration, record_from=record_from)
        return run_bench(bench, vectors, timeout, "transient", timing, progress=progress, keep_partial=keep_partial)

    try:
        return run(step)
    except SimulationError as error:
        if uniform or _COLLAPSED not in error.log.lower():
            raise
    return run(step / 2.0)


def transient_timing(
    step: float, duration: float, longest: float | None = None, record_from: float = 0.0
) -> dict[str, Any]:
    """Return PySpice's arguments of a transient from the initial state, as of :func:`transient`.

    Steps are uniform unless ``longest`` (s) lets ngspice choose them.
    """
    return {
        "step_time": step, "end_time": duration, "start_time": record_from, "max_time": longest or step,
        "use_initial_condition": True,
    }  # fmt: skip


def progress_callback(progress: Callable[[float, float], object], duration: float) -> Callable[[float], None]:
    """Return a callback for :func:`transient` that reports the fraction of ``duration`` done and the seconds left."""
    began = monotonic()

    def report(reached: float) -> None:
        done = min(reached / duration, 1.0)
        if done > 0.0:
            progress(done, (monotonic() - began) * (1.0 - done) / done)

    return report


def run_bench(
    bench: Bench,
    vectors: Sequence[str],
    timeout: float | None,
    analysis: str,
    arguments: Mapping[str, Any],
    guess: Mapping[str, float] | None = None,
    **how: Any,
) -> Outcome:
    """Run an analysis of a bench; the arguments are PySpice's, and those of ``BatchSimulator.verified``.

    ``guess`` are the voltages of nodes with which the iteration to the operating point begins.

    Raises:
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    ready = simulator(bench, vectors, timeout)
    ready.node_set(**(guess or {}))
    signals = {name: bench.signals[name] for name in vectors if name in bench.signals}
    try:
        result = ready.verified(analysis, **how, **arguments)
    except Interrupted as interrupt:
        done = Outcome(**vars(interrupt.partial), deck=ready.deck, signals=signals)
        raise Interrupted(str(interrupt), done) from None
    return Outcome(**vars(result), deck=ready.deck, signals=signals)
