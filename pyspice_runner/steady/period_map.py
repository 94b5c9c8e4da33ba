# SPDX-License-Identifier: GPL-3.0-or-later
"""The map of a motor's state over one period of its drive, evaluated by ngspice for many states at once.

A run starts from the given states. ngspice's first steps grow from a small one and are of first order; the period
begins after them, at the first of the uniform steps, and has a whole number of these. So the state at the end of the
period is mapped from that at its beginning by uniform steps of second order alone.

The instruments of the dynamometer integrate inside the circuit; here the same means are taken of the recorded points.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from cmath import rect
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from math import ceil, nan
from threading import Lock
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from pyspice_runner.circuit.law import MOST_SLIDERS, reached
from pyspice_runner.circuit.state import Discretisation, pushes, static_places
from pyspice_runner.errors import SimulationError
from pyspice_runner.motor import groups, strength
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.stator import carriers
from pyspice_runner.run.dynamometer import quantities_of, stored_energy
from pyspice_runner.run.kernel import Outcome, run_bench, simulator, transient_timing
from pyspice_runner.run.window import Array
from pyspice_runner.spice.process import KeptProcesses
from pyspice_runner.steady.copies import (
    Copy,
    Plant,
    copies_bench,
    copy_name,
    drive_voltage,
    driven_bench,
    phasor_at,
)
from pyspice_runner.steady.monodromy import Course, differentiable

GRAZE = 0.01  # of the elastic range; one of 70 steps of a sine moves it by (2 pi / 70)^2 / 2 = 0.004 at its maximum
GROSS_SLIP = 1.999  # state of the contact from which on all its sliders slip
COPIES_PER_DECK = 8  # measured: beyond, the parse trees of the B-sources no longer fit the cache of a core
_SLIDERS_PER_DECK = 100  # the same of a brush: 3 copies with 32 sliders
_FEWEST = 4  # copies in a deck over one period; fewer take less time than the start of ngspice
_LONG = 1000  # steps that take longer than the start
# steps; the first uniform step begins after less than two and lets a slider that slips forget its start, and ngspice 46
# shortens the last two
_LEAD = 5.5
_MORE = 4.5  # steps beyond the period, where it has a lead of its own: ngspice 46 shortens the last two of a run
_PHASORS = ("volts", "amperes")  # beginnings of the names of the means that are parts of phasors
_PEAKS = ("peak_", "greatest_")  # beginnings of the names of the means that are maxima over time
CONTACT = ("normal{}", "friction{}", "state{}", "slider{}", "xcontact{}.delta")  # vectors, by the suffix of a contact


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


Given = TypeVar("Given")
Found = TypeVar("Found")


def in_threads(
    task: Callable[[Given], Found], parts: Sequence[Given], workers: int, stop: Callable[[], object] = bool
) -> list[Found]:
    """Return the results of a task for each part, in a number of threads at a time; one worker needs no thread.

    After an error or an interrupt, ``stop`` ends the running ones.
    """
    if min(workers, len(parts)) <= 1:
        return list(map(task, parts))
    with ThreadPoolExecutor(workers) as pool:
        try:
            return list(pool.map(task, parts))
        except BaseException:
            stop()
            raise


@dataclass(frozen=True)
class Trace:
    """A copy over one period: uniform points from its beginning to its end, both included."""

    time: Array  # since the drive's phase was that of t = 0, s
    states: Array  # shape (order, points), SI units
    normal: Array  # normal force, N; this and the following have the shape (k, points) of k contacts
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

    def forces(self, plant: Plant) -> Array:
        """Return the mean normal and the mean friction force of all contacts in N, as :func:`forces_on_rotor`."""
        return np.asarray(np.array(forces_on_rotor(plant, self))[:, 1:].mean(axis=1))


@dataclass
class Effort:
    """Cost of the evaluations of a map."""

    evaluations: int = 0  # number of states that were mapped
    simulated_s: float = 0.0  # simulated time in s, summed over the states
    seconds: float = 0.0  # wall time in s that ngspice took, summed over the runs
    ngspice_version: str = ""  # of the last run; empty before the first
    failure: SimulationError | None = None  # the first one, while every run fails
    _hashes: set[str] = field(default_factory=set, repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)  # decks run in threads

    def add(self, copies: int, duration: float, deck: str, outcome: Outcome) -> None:
        """Add the run of a deck with a number of copies over a time in s."""
        with self._lock:
            self.evaluations += copies
            self.simulated_s += copies * duration
            self.seconds += outcome.seconds
            self.ngspice_version = outcome.ngspice_version
            self._hashes.add(hashlib.sha256(deck.encode()).hexdigest())
            if self.failure is not None:
                _discard(self.failure)
                self.failure = None

    def fail(self, error: SimulationError) -> None:
        """Note the failure of a run, and keep its netlist if it is the first of runs that all failed."""
        with self._lock:
            if self.evaluations or self.failure is not None:
                _discard(error)
            else:
                self.failure = error

    def hashes(self) -> str:
        """Return the hashes of the circuits that were run, in an order that does not depend on their timing."""
        return "".join(sorted(self._hashes))


def _discard(error: SimulationError) -> None:
    """Delete the netlist of a failed run. Raise the error if it has none: ngspice did not run at all."""
    if error.deck is None:
        raise error
    shutil.rmtree(error.deck.parent, ignore_errors=True)


@dataclass
class PeriodMap:
    """The map over one period of the drive."""

    period: float  # period in s
    steps: int  # number of uniform steps in it
    timeout: float | None = None  # wall time in s after which a run of ngspice is ended
    workers: int = field(default_factory=cores)  # number of decks that run at a time
    processes: KeptProcesses | None = None  # in which decks run
    uniform: bool = True  # whether ngspice's steps are uniform; behind bridges it shortens them at edges
    lead: float = 0.0  # of a period, from the start of a run to that of the period; 0 without a driver
    effort: Effort = field(default_factory=Effort)
    _texts: dict[str, dict[str, str]] = field(default_factory=dict, repr=False)  # subcircuits of each motor, by name

    def of(self, period: float, steps: int) -> PeriodMap:
        """Return the map over another period in s, or with another number of steps, in the same processes."""
        lead = self.lead * self.period / period
        return PeriodMap(period, steps, self.timeout, self.workers, self.processes, self.uniform, lead)

    @property
    def step(self) -> float:
        """Time step in s."""
        return self.period / self.steps

    @property
    def discretisation(self) -> Discretisation:
        """How motors are adapted to the step."""
        return Discretisation(self.step, self.uniform)

    def traces(self, copies: Sequence[Copy], after: int = 0) -> list[Trace | None]:
        """Return the traces of the copies over a period, after a number of others; ``None`` if ngspice finds none.

        A run that begins anew at the last state of another one does not continue it: its first steps are of first order
        and are no part of its period. Where disturbances decay slowly, the means of that period then differ.

        Raises:
            SimulationError: if ngspice is missing or cannot be run.
        """
        if after:  # the derivative is that of a run from its start
            traces = self._evaluated(copies, after * self.period + self.duration, whole=True)
            return [trace and replace(trace, course=None) for trace in traces]
        law = copies[0].plant.law if copies else None  # the same in all
        if law is None or not law.row:
            return self._evaluated(copies, self.duration, whole=True)
        # the sliders of a brush that touch nothing are left out, if these are known
        sliders = min(law.sliders, max(copy.reach or MOST_SLIDERS for copy in copies))
        inner = [copy.with_sliders(sliders) for copy in copies]
        found: list[Trace | None] = []
        for copy, own, trace in zip(copies, inner, self._evaluated(inner, self.duration, whole=True), strict=True):
            if trace is not None:
                depth = None if trace.course is None else 1e-6 * float(trace.course.penetration_um.max())
                reach = None if depth is None else reached(law, copy.plant.motor.contact, depth)
                trace = replace(trace, states=copy.plant.widened(trace.states, own.plant, 0), reach=reach)
            found.append(trace)
        if sliders == law.sliders:
            return found
        beyond = [place for place, trace in enumerate(found) if trace is None or (trace.reach or 0) > sliders]
        again = self.traces([replace(copies[place], reach=None) for place in beyond])
        for place, trace in zip(beyond, again, strict=True):
            found[place] = trace
        return found

    def settled(self, copies: Sequence[Copy], periods: int) -> list[Array | None]:
        """Return the states after a number of periods from the start of the run."""
        found = self._evaluated(copies, periods * self.period, whole=False)
        return [None if trace is None else trace.states[:, -1] for trace in found]

    def deck(self, copy: Copy) -> str:
        """Return the deck that runs one copy over a period."""
        single = (driven_bench if self.lead else copies_bench)([copy], self.discretisation)
        ready = simulator(single, self._vectors(0, copy.plant, whole=True))
        return str(ready.prepare("transient", **transient_timing(self.duration, self.duration, self.step)))

    @property
    def duration(self) -> float:
        """Length in s of a run over a period."""
        steps = _MORE if self.lead else _LEAD
        return (1.0 + self.lead) * self.period + (steps * self.step if self.uniform else 0.0)

    def _evaluated(self, copies: Sequence[Copy], duration: float, whole: bool) -> list[Trace | None]:
        if not copies:
            return []
        # the subcircuits of new motors are written before the threads of the decks read them; none behind drivers
        for copy in copies:
            plant = copy.plant
            if not plant.driver and plant.motor_name not in self._texts:
                self._texts[plant.motor_name] = plant.motor_texts(self.discretisation, plates=False)
        workers, law = self.workers, copies[0].plant.law  # the same in all
        sliders = (law.sliders if law else 1) * max(len(copy.plant.motor.touching) for copy in copies)
        most = COPIES_PER_DECK if self.uniform else 1  # elsewhere the steps would depend on the other copies
        decks = ceil(len(copies) / max(1, min(most, _SLIDERS_PER_DECK // max(sliders, 1))))
        least = _FEWEST if whole and self.steps < _LONG else 1  # a long run is worth a deck of its own
        decks = max(ceil(decks / workers) * workers if decks > 1 else 1, min(workers, len(copies) // least))
        decks = min(decks, len(copies))
        ends = np.array_split(np.arange(len(copies)), decks)
        parts = [copies[places[0] : places[-1] + 1] for places in ends]
        found = in_threads(partial(self._deck, duration=duration, whole=whole), parts, workers)
        return list(chain.from_iterable(found))

    def _deck(self, copies: Sequence[Copy], duration: float, whole: bool) -> list[Trace | None]:
        """Run one deck; where that fails, run its halves, so that one copy does not take the others along."""
        began = perf_counter()
        if self.processes and self.processes.stopped:
            raise SimulationError("The run was stopped because another one failed.")
        try:
            return self._run(copies, duration, whole)[0]
        except _Uneven:
            pass
        except SimulationError as error:
            if error.deck is None or (self.timeout is not None and perf_counter() - began >= self.timeout):
                raise  # ngspice did not run at all, or took too long
            self.effort.fail(error)
        if len(copies) == 1:
            return [None]
        half = len(copies) // 2
        return [*self._deck(copies[:half], duration, whole), *self._deck(copies[half:], duration, whole)]

    def _run(
        self, copies: Sequence[Copy], duration: float, whole: bool, meters: Sequence[str] = ()
    ) -> tuple[list[Trace | None], dict[str, Array]]:
        """Return the traces of the copies, and the vectors of the run, those of ``meters`` among them."""
        if self.lead:
            bench = driven_bench(copies, self.discretisation, meters=bool(meters))
        else:
            bench = copies_bench(copies, self.discretisation, self._texts, plates=False)
        vectors = dict.fromkeys(meters)
        for number, copy in enumerate(copies):
            vectors |= dict.fromkeys(self._vectors(number, copy.plant, whole=whole))
        timing = transient_timing(duration, duration, self.step, duration - (self.duration if whole else self.step))
        outcome = run_bench(bench, list(vectors), self.timeout, "transient", timing, processes=self.processes)
        self.effort.add(len(copies), duration, str(bench.circuit.raw_spice), outcome)
        raw = outcome.vectors()
        return self._traces(copies, raw, whole=whole), raw

    def metered(self, copy: Copy, vectors: Sequence[str]) -> tuple[dict[str, Array], Trace, slice]:
        """Return a run of a copy behind a driver with the vectors of its meters, its trace, and the points of that."""
        (trace,), raw = self._run([copy], self.duration, whole=True, meters=vectors)
        window = self.window(raw["time"])
        assert trace is not None
        assert window is not None
        return raw, trace, window

    def _vectors(self, number: int, plant: Plant, *, whole: bool) -> list[str]:
        """Return the vectors to record of a copy: its states, and of a whole period its contact and driven pins."""
        copy = copy_name(number)
        names = plant.vectors(copy)
        if whole:
            names += _touching_vectors(plant, copy)
            names += plant.pins(copy).values()
        return names

    def _traces(self, copies: Sequence[Copy], raw: Mapping[str, Array], *, whole: bool) -> list[Trace | None]:
        """Return the traces of the copies from the vectors of a run."""
        time = raw["time"]
        window = self.window(time) if whole else slice(len(time) - 1, len(time))
        if window is None:
            raise _Uneven
        traces: list[Trace | None] = []
        for number, copy in enumerate(copies):
            plant, name = copy.plant, copy_name(number)
            states = plant.sampled(raw, name, self.discretisation)
            contact = np.zeros((len(CONTACT), len(plant.motor.touching), len(time)))
            if whole and plant.law:
                contact[:] = np.reshape(list(map(raw.__getitem__, _touching_vectors(plant, name))), contact.shape)
            if self.lead:
                traces.append(self._evened(plant, name, raw, np.vstack([states, *contact]), window))
                continue
            course = None
            if whole and differentiable(plant):
                states, contact = states[:, : window.stop], contact[..., : window.stop]
                normal, friction, *_, depth = contact
                course = Course(plant, time[: window.stop], states, normal, friction, depth, window.start, copy.begun)
            trace = Trace(copy.begun + time[window], states[:, window], *contact[..., window])
            traces.append(replace(trace, course=course))
        return traces

    def _evened(self, plant: Plant, copy: str, raw: Mapping[str, Array], values: Array, window: slice) -> Trace:
        """Return the trace of a copy behind a driver at uniform points, from its states and contact."""
        time = raw["time"]
        first, last = window.start, window.stop - 1
        even = np.linspace(time[first], time[last], self.steps + 1) if last > first else time[last:]
        rows = np.array([np.interp(even, time, row) for row in values])
        pins = {name: np.interp(even, time, raw[vector]) for name, vector in plant.pins(copy).items() if last > first}
        begun = even + plant.begins * plant.drive.period  # since the control of group A had the phase 0
        contact = rows[plant.order :].reshape(len(CONTACT), -1, len(even))
        return replace(Trace(begun, rows[: plant.order], *contact), pins=pins)

    def window(self, time: Array) -> slice | None:
        """Return the points of the period: after the lead, or the first uniform steps but one, a whole number."""
        if self.lead:
            first = int(np.abs(time - self.lead * self.period).argmin())
            return slice(first, first + self.steps + 1 if self.uniform else len(time))
        uniform = np.abs(np.diff(time) - self.step) < 1e-6 * self.step
        uneven = np.flatnonzero(~uniform[: -2 if len(uniform) > 2 else None])
        first = int(uneven[-1]) + 2 if uneven.size else 1
        if first + self.steps >= len(time) or not uniform[first : first + self.steps].all():
            return None
        return slice(first, first + self.steps + 1)

    def together(self, decks: Sequence[Sequence[Copy]]) -> list[list[tuple[Trace | None, Trace | None]]]:
        """Return for each deck the pairs of its first copy, the undisturbed one, and of each other.

        Those of a pair have their steps in common. Where ngspice fails, the deck is divided.
        """

        def evaluated(copies: Sequence[Copy]) -> list[tuple[Trace | None, Trace | None]]:
            first, *others = copies
            try:
                base, *near = self._run(copies, self.duration, whole=True)[0]
            except SimulationError as error:
                if error.deck is None:
                    raise  # ngspice did not run at all
                self.effort.fail(error)
                half = len(others) // 2
                parts = (others[:half], others[half:]) if half else ()
                return [pair for part in parts for pair in evaluated([first, *part])] or [(None, None)]
            return [(base, one) for one in near]

        return in_threads(evaluated, decks, self.workers)


def _touching_vectors(plant: Plant, copy: str) -> list[str]:
    """Return the vectors of :data:`CONTACT` of all contacts of a copy; none of a free tip."""
    touching, motor = plant.motor.touching if plant.law else (), plant.inside(copy)
    return [f"v({motor}.{name.format(one.suffix)})" for name in CONTACT for one in touching]


class _Uneven(Exception):
    """ngspice shortened steps, because Newton's iteration did not converge for one of the copies."""


# --- means over a period ---


def modal(plant: Plant, trace: Trace) -> tuple[Array, Array]:
    """Return the modal displacements (m) and velocities (m/s) of a period, shape (modes, points)."""
    count = plant.modes
    return trace.states[:count], trace.states[count : 2 * count]


def speed(plant: Plant, trace: Trace) -> Array:
    """Return the speed of the rotor in rad/s."""
    if plant.load.speed is not None:
        return np.full(len(trace.time), plant.load.speed)
    return np.asarray(trace.states[plant.places["rotor"]][0])


def contact_motion(plant: Plant, trace: Trace) -> tuple[Array, Array, Array, Array]:
    """Return the displacements x, y (m) of the contacts on their carrier and their velocities (m/s), (k, points)."""
    contact, (displacements, velocities) = plant.motor.stator.with_carrier(plant.mount).contact, plant.moving
    moved, moving = contact @ trace.states[displacements], contact @ trace.states[velocities]
    return moved[::2], moved[1::2], moving[::2], moving[1::2]


def forces_on_rotor(plant: Plant, trace: Trace) -> tuple[Array, Array]:
    """Return the normal force and the friction force of all contacts in N, the latter at the radius of the rotor."""
    return trace.normal.sum(axis=0), plant.motor.stator.lever @ trace.friction


def current(plant: Plant, group: str, trace: Trace) -> Array:
    """Return the current in A into a group."""
    place = GROUPS.index(group)
    amperes = plant.motor.stator.coupling[:, place] @ modal(plant, trace)[1]
    for at, tones in enumerate(plant.drive.tones):  # of the clamped capacitances
        for tone in tones:
            gain = complex(plant.dielectrics[tone.frequency][place, at])
            amperes += phasor_at(tone, gain, trace.time)[0]
    moved, forces = plant.motor.stator.residual_per_volt[:2, place], (trace.friction[0], trace.normal[0])
    for name, per_volt, force in zip(("stem_x", "stem"), moved, forces, strict=True):  # of a single contact
        if name in pushes(plant.motor, plant.law):
            amperes -= per_volt * np.gradient(force, trace.time, edge_order=2)
    return np.asarray(amperes)


def _dielectric_loss(plant: Plant) -> float:
    """Return the mean loss in W of the clamped capacitances: their admittance is linear, at each frequency alone."""
    loss, drive = 0.0, plant.drive
    for frequency in set(drive.frequencies):
        volts = np.zeros(len(drive.tones), dtype=complex)
        for place, tones in enumerate(drive.tones):
            for tone in tones:
                volts[place] += rect(tone.amplitude, tone.phase) if tone.frequency == frequency else 0.0
        loss += 0.5 * float(np.vdot(volts, plant.dielectrics[frequency] @ volts).real)
    return loss


def held_by_friction(plant: Plant, trace: Trace) -> bool:
    """Return whether friction holds a shaft at rest: all contacts stay closed, and none slips as a whole.

    In a periodic motion the slip of one direction is equal to that of the other. A path shorter than :data:`GRAZE` of
    the elastic range is no slip: single time steps exceed the limit where the direction of the motion changes.
    """
    if plant.load.speed != 0.0 or not plant.laws or not all(law.sliding and law.spring for law in plant.laws):
        return False
    state, (_, _, along_m_s, _) = trace.contact_state, contact_motion(plant, trace)
    path_m = np.where(state > GROSS_SLIP, np.abs(along_m_s), 0.0).sum(axis=1) * (trace.time[1] - trace.time[0])
    return bool(state.min() > 0.5 and np.all(path_m < 2.0 * GRAZE * plant.motor.at_rest.limit_m))


def parts_of_force(plant: Plant) -> Array:
    """Return the friction of each contact per force on the rotor, if they share it as they share the preload."""
    shares = plant.motor.stator.share
    return np.asarray(shares / (shares @ plant.motor.stator.lever))


def held_forces(plant: Plant, trace: Trace) -> tuple[float, float]:
    """Return the minimum and the maximum of a constant force in N that friction can carry in addition.

    The force shifts the friction of every step, which must stay within ±μ F_N. This is a lower bound of the range: the
    contact's tangential spring softens towards its limit, which reduces the alternating part. Contacts carry it as
    :func:`parts_of_force`.
    """
    part = parts_of_force(plant)[:, np.newaxis]
    bears = part[:, 0] > 0.0  # what does not touch at rest carries nothing
    limit, friction = (plant.motor.at_rest.friction[:, np.newaxis] * trace.normal)[bears, 1:], trace.friction[bears, 1:]
    part = part[bears]
    return min(float(np.max((-limit - friction) / part)), 0.0), max(float(np.min((limit - friction) / part)), 0.0)


def means(plant: Plant, trace: Trace, discretisation: Discretisation) -> dict[str, float]:
    """Return the means over a period from which the quantities follow; all are linear in time averages.

    Forces and powers are those of all contacts, shares of time their means with the shares of the preload as weights.
    What belongs to each contact has its number, from 0: ``normal_0`` and ``touching_0``, and ``greatest_0`` and
    ``rubbing_0`` of one of its points.
    """
    motor, radius, shares = plant.motor, plant.motor.rotor.radius_m, plant.motor.stator.share
    x, _, vx, vy = np.array(contact_motion(plant, trace))[..., 1:]
    x = x - static_places(motor, plant.law, discretisation)[:, :1]
    radii = motor.at_rest.radius_m[:, np.newaxis]
    towards = pushes(motor, plant.law)
    for moved, tones in zip(motor.stator.residual_per_volt.T, plant.drive.tones, strict=True):
        for tone in tones:  # what is in series with the contact stores, and gives it back
            rate = np.asarray(phasor_at(tone, 1.0, trace.time)[1])[1:]
            vx = vx + moved[0] * rate * ("stem_x" in towards)
            vy = vy + moved[1] * rate * ("stem" in towards)
    normal, friction, state = trace.normal[:, 1:], trace.friction[:, 1:], trace.contact_state[:, 1:]
    on_rotor, turning = forces_on_rotor(plant, trace)[1][1:], speed(plant, trace)[1:]
    points = state.shape[1]
    touching, slipping = state > 0.5, state > 1.5
    if held := held_by_friction(plant, trace):
        slipping[:] = False
    # slip that ended within a step: on average half of it
    ended = np.count_nonzero(touching & ~slipping & np.roll(slipping, 1, axis=1), axis=1)
    displacement, velocity = modal(plant, trace)
    mount_loss = 0.0
    for spring, rise in zip(carriers(plant.mount), trace.states[plant.moving[1][plant.modes :]], strict=True):
        mount_loss += spring.damping_n_s_per_m * float(rise[1:] @ rise[1:]) / points
    taken = 0.0  # by the resistance at the feedback electrode
    if motor.feedback:
        taken = float(np.mean(trace.states[plant.places["feedback"], 1:] ** 2)) / motor.feedback.resistance_ohm
    heating = velocity[:, 1:] ** 2
    if motor.stator.growth.any():
        heating *= 1.0 + motor.stator.growth[:, np.newaxis] * displacement[:, 1:] ** 2
    found = {
        **strength.peak_of_motion(motor, displacement),
        "friction": float(on_rotor.sum()) / points,
        "friction_square": float(on_rotor @ on_rotor) / points,
        "normal": float(normal.sum()) / points,
        "touching": float(shares @ np.count_nonzero(touching, axis=1)) / points,
        "slip": float(shares @ (np.count_nonzero(slipping, axis=1) - 0.5 * ended)) / points,
        "work": float(np.vdot(friction, vx + x * vy / radii)) / points,
        "press": float(np.vdot(normal, vy - x * vx / radii)) / points,
        "given": radius * float(on_rotor @ turning) / points,
        "speed": float(turning.sum()) / points,
        "damping_loss": float(motor.stator.damping @ heating.sum(axis=1)) / points + mount_loss + taken,
        "dielectric_loss": _dielectric_loss(plant),
        "stored": (_stored(plant, trace, -1) - _stored(plant, trace, 0)) / (trace.time[-1] - trace.time[0]),
    }
    found["held_min"], found["held_max"] = held_forces(plant, trace) if held else (0.0, 0.0)
    rubbed = rubbing(plant, trace, discretisation, found["work"] - found["given"])
    for number, one in enumerate(motor.touching):
        found[f"normal_{number}"] = float(normal[number].sum()) / points
        found[f"touching_{number}"] = np.count_nonzero(touching[number]) / points
        found[f"greatest_{number}"] = float(normal[number].max()) / one.multiplicity
        found[f"rubbing_{number}"] = rubbed[number]
    for group, tones in zip(GROUPS, plant.drive.tones, strict=True):
        voltage = drive_voltage(tones, trace.time)[1:]
        amperes = current(plant, group, trace)[1:]
        found |= {
            groups.named("power", group): float(voltage @ amperes) / points,
            groups.named("voltage_square", group): float(voltage @ voltage) / points,
            groups.named("current_square", group): float(amperes @ amperes) / points,
            groups.named("peak", group): float(np.abs(amperes).max()),
        }
        frequencies = {tone.frequency for tone in tones if tone.amplitude}
        if len(frequencies) == 1:
            found |= fundamental(group, trace.time[1:], frequencies.pop(), voltage, amperes)
    return found


def fundamental(group: str, time: Array, frequency: float, voltage: Array, amperes: Array) -> dict[str, float]:
    """Return the parts of the phasors of a group's voltage and current at a frequency, over whole periods."""
    turning, found = 2j * np.exp(-2j * np.pi * frequency * time), dict[str, float]()
    for name, wave in zip(_PHASORS, (voltage, amperes), strict=True):
        phasor = complex(np.mean(turning * wave))
        found |= {groups.named(f"{name}_real", group): phasor.real, groups.named(f"{name}_imag", group): phasor.imag}
    return found


def phasors(found: Mapping[str, float]) -> dict[str, tuple[complex, complex]]:
    """Return the phasors of voltage (V) and current (A) of each group with a tone, from means."""
    pairs = dict[str, tuple[complex, complex]]()
    for group in GROUPS:
        pair = list[complex]()
        for name in _PHASORS:
            real, imag = groups.named(f"{name}_real", group), groups.named(f"{name}_imag", group)
            if real in found:
                pair.append(complex(found[real], found[imag]))
        if pair:
            pairs[group] = pair[0], pair[1]
    return pairs


def rubbing(plant: Plant, trace: Trace, discretisation: Discretisation, loss_w: float) -> list[float]:
    """Return the mean of normal force times slip velocity in W at a point of each contact.

    Of other laws than the paper's it follows from the rest of the loss, which contacts share as the preload. The spring
    of the paper's law is not quite conservative: its loss also has what the spring gives or takes.
    """
    found, others = [nan] * len(plant.motor.touching), dict[int, float]()
    for at, (one, law) in enumerate(zip(plant.motor.touching, plant.laws, strict=False)):
        if "averaged" not in law.forms:
            others[at] = one.share
        else:
            slider, depth, normal = 1e-6 * trace.slider_um[at], 1e-6 * trace.penetration_um[at], trace.normal[at]
            velocity = strength.slip_velocity(one.contact, slider, depth, normal, discretisation.slider_time)
            found[at] = float(normal[1:] @ velocity[1:]) / len(velocity[1:]) / one.multiplicity
            loss_w -= one.contact.friction * one.multiplicity * found[at]
    for at, share in others.items():
        one = plant.motor.touching[at]
        found[at] = share / (sum(others.values()) or 1.0) * loss_w / one.contact.friction / one.multiplicity
    return found


def _stored(plant: Plant, trace: Trace, at: int) -> float:
    """Return the energy in J in the modes and the mount."""
    (displacement, velocity), carrier = modal(plant, trace), trace.states[plant.places["mount"]][:, at].tolist()
    motion = displacement[:, at].tolist(), velocity[:, at].tolist()
    return stored_energy(plant.motor, *motion, carrier[::2], carrier[1::2])


def mean_of(several: Sequence[Mapping[str, float]], weights: Array | None = None) -> dict[str, float]:
    """Return the mean, with weights, of the means of copies or of successive runs; of peaks the maximum."""
    values = np.array([list(found.values()) for found in several])
    found = dict(zip(several[0], np.average(values, axis=0, weights=weights).tolist(), strict=True))
    for place, name in enumerate(found):
        found[name] = float(values[:, place].max()) if name.startswith(_PEAKS) else found[name]
    return found


def extrapolated(fine: Mapping[str, float], coarse: Mapping[str, float], ratio: float) -> dict[str, float]:
    """Extrapolate the means at two time steps to a vanishing step; their error is of second order.

    Shares of time and squares stay in their range.
    """
    weight = 1.0 / (ratio**2 - 1.0)
    limit = {name: value + weight * (value - coarse[name]) for name, value in fine.items()}
    for name in limit:
        if name.startswith(("touching", "slip")):
            limit[name] = min(max(limit[name], 0.0), 1.0)
        if name.startswith((*_PEAKS, "rubbing_")):
            limit[name] = max(limit[name], 0.0)
    limit["slip"] = min(limit["slip"], limit["touching"])
    return limit


def quantities(plant: Plant, found: Mapping[str, float]) -> dict[str, float]:
    """Return the quantities of :data:`.dynamometer.UNITS` from means."""
    motor = plant.motor
    # of a held shaft that has turned, dry friction in the bearing takes all its torque
    dry = float(np.sign(plant.load.speed or 0.0)) * motor.rotor.bearing_friction_n_m
    bearing = motor.rotor.bearing_damping_n_m_s * found["speed"] + dry
    load_torque = motor.rotor.radius_m * found["friction"] - bearing
    loads = [(found[f"greatest_{at}"], found[f"rubbing_{at}"]) for at in range(len(motor.touching))]
    return quantities_of(motor, {**found, "load_torque": load_torque}) | strength.worst_contact(motor, loads)


def of_contacts(plant: Plant, found: Mapping[str, float]) -> tuple[dict[str, Any], ...]:
    """Return mean normal force and separated share of each of several contacts from means; none of one."""
    return tuple(
        {"name": one.name, "normal_force_n": found[f"normal_{at}"], "separated": 1.0 - found[f"touching_{at}"]}
        for at, one in enumerate(plant.motor.touching if plant.motor.contacts else ())
    )
