# SPDX-License-Identifier: GPL-3.0-or-later
"""The map of a motor's state over one period of its drive, evaluated by ngspice for many states at once.

A run starts from the given states. ngspice's first steps grow from a small one and are of first order; the period
begins after them, at the first of the uniform steps, and has a whole number of these. So the state at the end of the
period is mapped from that at its beginning by uniform steps of second order alone.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from threading import Lock
from time import perf_counter
from typing import Any, Self

import numpy as np

from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.law import MOST_SLIDERS, reached
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.errors import SimulationError
from pyspice_runner.run.kernel import run_bench, simulator
from pyspice_runner.run.window import Array
from pyspice_runner.spice.process import KeptProcesses
from pyspice_runner.steady.copies import Copy, Plant, copies_bench, copy_name, motor_texts
from pyspice_runner.steady.monodromy import Course, differentiable
from pyspice_runner.steady.threads import in_threads

COPIES_PER_DECK = 8  # measured: beyond, the parse trees of the B-sources no longer fit the cache of a core
_SLIDERS_PER_DECK = 100  # the same of a brush: 3 copies with 32 sliders
_FEWEST = 4  # copies in a deck over one period; fewer take less time than the start of ngspice
# steps; the first uniform step begins after less than two and lets a slider that slips forget its start, and ngspice 46
# shortens the last two
_LEAD = 5.5
CONTACT = ("normal", "friction", "state", "slider", "xcontact.delta")


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class Trace:
    """A copy over one period: uniform points from its beginning to its end, both included."""

    time: Array  # since the drive's phase was that of t = 0, s
    states: Array  # shape (order, points), SI units
    normal: Array  # normal force, N
    friction: Array  # friction force, N
    contact_state: Array  # switch state, 0 separated, 1 stick, 2 slip
    slider_um: Array  # displacement of the slider, not cut off at its limit, µm
    penetration_um: Array  # penetration, negative where there is a gap, µm
    # voltages and currents of the pins behind a driver, by vectors as v(a) and i(vpin_a).
    pins: Mapping[str, Array] = field(default_factory=dict)
    course: Course | None = field(default=None, repr=False)  # the whole run, if its derivative follows from it
    reach: int | None = None  # number of sliders of a brush that touch something in the run, if it is known

    def later(self, begun: float) -> Array:
        """Return the states a period after a time in s, by linear interpolation."""
        time, at = self.time, begun + self.time[-1] - self.time[0]
        place = min(max(int(np.searchsorted(time, at)), 1), len(time) - 1)
        share = min(max((at - time[place - 1]) / (time[place] - time[place - 1]), 0.0), 1.0)
        return np.asarray((1.0 - share) * self.states[:, place - 1] + share * self.states[:, place])

    @property
    def forces(self) -> Array:
        """Mean normal and mean friction force in N."""
        return np.array([self.normal[1:].mean(), self.friction[1:].mean()])


@dataclass
class Effort:
    """Cost of the evaluations of a map."""

    evaluations: int = 0  # number of states that were mapped
    simulated_s: float = 0.0  # simulated time in s, summed over the states
    seconds: float = 0.0  # wall time in s that ngspice took, summed over the runs
    ngspice_version: str = ""  # of the last run; empty before the first
    _hashes: set[str] = field(default_factory=set, repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)  # decks run in threads

    def add(self, copies: int, duration: float, deck: str, seconds: float, ngspice_version: str) -> None:
        """Add the run of a deck with a number of copies over a time in s."""
        with self._lock:
            self.evaluations += copies
            self.simulated_s += copies * duration
            self.seconds += seconds
            self.ngspice_version = ngspice_version
            self._hashes.add(hashlib.sha256(deck.encode()).hexdigest())

    def hashes(self) -> str:
        """Return the hashes of the circuits that were run, in an order that does not depend on their timing."""
        return "".join(sorted(self._hashes))


@dataclass
class PeriodMap:
    """The map over one period of the drive."""

    period: float  # period in s
    steps: int  # number of uniform steps in it
    timeout: float | None = None  # wall time in s after which a run of ngspice is ended
    workers: int = field(default_factory=cores)  # number of decks that run at a time
    processes: KeptProcesses | None = None  # in which decks run
    effort: Effort = field(default_factory=Effort)
    _texts: dict[str, dict[str, str]] = field(default_factory=dict, repr=False)  # subcircuits of each motor, by name

    @property
    def step(self) -> float:
        """Time step in s."""
        return self.period / self.steps

    @property
    def discretisation(self) -> Discretisation:
        """How motors are adapted to the step."""
        return Discretisation(self.step)

    def with_steps(self, steps: int) -> PeriodMap:
        """Return a map over the same period with another number of steps."""
        return PeriodMap(self.period, steps, self.timeout, self.workers, self.processes)

    def shared_by(self, threads: int) -> Self:
        """Return the same map for one of several threads, with its share of the workers and a common effort."""
        return replace(self, workers=max(1, self.workers // threads))

    def traces(self, copies: Sequence[Copy], after: int = 0) -> list[Trace | None]:
        """Return the traces of the copies over a period, after a number of others; ``None`` if ngspice finds none.

        A run that begins anew at the last state of another one does not continue it: its first steps are of first order
        and are no part of its period. Where disturbances decay slowly, the means of that period then differ.

        Raises:
            SimulationError: if ngspice is missing or cannot be run.
        """
        if after:  # the derivative is that of a run from its start
            found = self._evaluated(copies, after * self.period + self.duration, whole=True)
            return [trace and replace(trace, course=None) for trace in found]
        return self._within_reach(copies)

    def _within_reach(self, copies: Sequence[Copy]) -> list[Trace | None]:
        """Return the traces over a period; leave out the sliders of a brush that touch nothing, if these are known."""
        sliders = max((copy.reach or MOST_SLIDERS for copy in copies), default=MOST_SLIDERS)
        law = copies[0].plant.law if copies else None  # the same in all
        if law is None or not law.row or sliders >= law.sliders:
            return [trace and _reaching(copy, trace) for copy, trace in self._whole(copies)]
        inner = [copy.with_sliders(sliders) for copy in copies]
        found: list[Trace | None] = []
        for copy, (own, trace) in zip(copies, self._whole(inner), strict=True):
            if trace is not None:
                states = copy.plant.widened(trace.states, own.plant, 0)
                trace = _reaching(copy, replace(trace, states=states))
            found.append(trace)
        beyond = [place for place, trace in enumerate(found) if trace is None or (trace.reach or 0) > sliders]
        again = self._within_reach([replace(copies[place], reach=None) for place in beyond])
        for place, trace in zip(beyond, again, strict=True):
            found[place] = trace
        return found

    def _whole(self, copies: Sequence[Copy]) -> list[tuple[Copy, Trace | None]]:
        return list(zip(copies, self._evaluated(copies, self.duration, whole=True), strict=True))

    def settled(self, copies: Sequence[Copy], periods: int) -> list[Array | None]:
        """Return the states after a number of periods from the start of the run."""
        found = self._evaluated(copies, periods * self.period, whole=False)
        return [None if trace is None else trace.states[:, -1] for trace in found]

    def deck(self, copy: Copy) -> str:
        """Return the deck that runs one copy over a period."""
        ready = simulator(self._single(copy), self._vectors(0, copy.plant, whole=True))
        return str(ready.prepare("transient", **self._timing(self.duration, whole=True)))

    def _single(self, copy: Copy) -> Bench:
        """Return the bench of one copy, with its subcircuits."""
        return copies_bench([copy], self.discretisation)

    @property
    def copies_per_deck(self) -> int:
        """Greatest number of copies in a deck."""
        return COPIES_PER_DECK

    @property
    def duration(self) -> float:
        """Length in s of a run over a period."""
        return self.period + _LEAD * self.step

    def _timing(self, duration: float, whole: bool) -> dict[str, Any]:
        return {
            "step_time": duration, "end_time": duration, "max_time": self.step, "use_initial_condition": True,
            "start_time": duration - (self.duration if whole else self.step),
        }  # fmt: skip

    def _evaluated(self, copies: Sequence[Copy], duration: float, whole: bool) -> list[Trace | None]:
        if not copies:
            return []
        self._write(copies)
        workers = self.workers
        sliders = max(max(copy.plant.law.sliders, 1) if copy.plant.law else 1 for copy in copies)
        decks = ceil(len(copies) / max(1, min(self.copies_per_deck, _SLIDERS_PER_DECK // sliders)))
        least = _FEWEST if whole else 1  # a long run is worth a deck of its own
        decks = max(ceil(decks / workers) * workers if decks > 1 else 1, min(workers, len(copies) // least))
        decks = min(decks, len(copies))
        parts = [part.tolist() for part in np.array_split(np.arange(len(copies)), decks)]

        def evaluated(part: list[int]) -> list[Trace | None]:
            return self._deck([copies[place] for place in part], duration, whole)

        return [trace for traces in in_threads(evaluated, parts, workers) for trace in traces]

    def _write(self, copies: Sequence[Copy]) -> None:
        """Write the subcircuits of new motors, before the threads of the decks read them."""
        new = [copy for copy in copies if copy.plant.motor_name not in self._texts]
        self._texts |= motor_texts(new, self.discretisation, plates=False)

    def _deck(self, copies: Sequence[Copy], duration: float, whole: bool) -> list[Trace | None]:
        """Run one deck; where that fails, run its halves, so that one copy does not take the others along."""
        began = perf_counter()
        try:
            return self._run(copies, duration, whole)
        except _Uneven:
            pass
        except SimulationError as error:
            if error.deck is None or (self.timeout is not None and perf_counter() - began >= self.timeout):
                raise  # ngspice did not run at all, or took too long
            shutil.rmtree(error.deck.parent, ignore_errors=True)
        if len(copies) == 1:
            return [None]
        half = len(copies) // 2
        return [*self._deck(copies[:half], duration, whole), *self._deck(copies[half:], duration, whole)]

    def _run(self, copies: Sequence[Copy], duration: float, whole: bool) -> list[Trace | None]:
        bench = self._bench(copies)
        names = [self._vectors(number, copy.plant, whole=whole) for number, copy in enumerate(copies)]
        every = list(dict.fromkeys(name for own in names for name in own))
        timing = self._timing(duration, whole)
        outcome = run_bench(bench, every, self.timeout, "transient", timing, processes=self.processes)
        deck = str(bench.circuit.raw_spice)
        self.effort.add(len(copies), duration, deck, outcome.seconds, outcome.ngspice_version)
        return self._traces(copies, names, outcome.vectors(), whole=whole)

    def _bench(self, copies: Sequence[Copy]) -> Bench:
        return copies_bench(copies, self.discretisation, self._texts, plates=False)

    def _vectors(self, number: int, plant: Plant, *, whole: bool) -> list[str]:
        """Return the vectors to record of a copy: its states, and of a whole period its contact."""
        instance = copy_name(number)
        contact = CONTACT if whole and plant.law else ()
        return [*plant.vectors(instance, f"{instance}_shaft"), *(f"v({instance}.{name})" for name in contact)]

    def _traces(
        self, copies: Sequence[Copy], names: Sequence[Sequence[str]], raw: Mapping[str, Array], *, whole: bool
    ) -> list[Trace | None]:
        """Return the traces of the copies from the vectors of a run."""
        time = raw["time"]
        window = self._window(time) if whole else slice(-1, None)
        if window is None:
            raise _Uneven
        traces: list[Trace | None] = []
        for copy, own in zip(copies, names, strict=True):
            units = copy.plant.units(self.discretisation)
            values = np.array([raw[name][: window.stop] for name in own])
            order = copy.plant.order
            states, contact = values[:order] * units[:, np.newaxis], np.zeros((len(CONTACT), values.shape[1]))
            contact[: len(values) - order] = values[order:]
            course = None
            if whole and differentiable(copy.plant):
                normal, friction, *_, depth = contact
                course = Course(copy.plant, time[: window.stop], states, normal, friction, depth, window.start)
            trace = Trace(copy.begun + time[window], states[:, window], *contact[:, window])
            traces.append(replace(trace, course=course))
        return traces

    def _window(self, time: Array) -> slice | None:
        """Return the points of the period: the first uniform steps but one, as many as there are in it."""
        uniform = np.abs(np.diff(time) - self.step) < 1e-6 * self.step
        uneven = np.flatnonzero(~uniform[: -2 if len(uniform) > 2 else None])
        first = int(uneven[-1]) + 2 if uneven.size else 1
        if first + self.steps >= len(time) or not uniform[first : first + self.steps].all():
            return None
        return slice(first, first + self.steps + 1)


def _reaching(copy: Copy, trace: Trace) -> Trace:
    """Return the trace of a copy with the number of sliders of a brush that touch something in the whole run."""
    law, contact = copy.plant.law, copy.plant.motor.contact
    if law is None or not law.row or trace.course is None:
        return trace
    return replace(trace, reach=reached(law, contact, 1e-6 * float(trace.course.penetration_um.max())))


class _Uneven(Exception):
    """ngspice shortened steps, because Newton's iteration did not converge for one of the copies."""
