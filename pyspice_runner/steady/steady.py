# SPDX-License-Identifier: GPL-3.0-or-later
"""The periodic steady state of a motor, without a transient that settles.

Newton's method (:mod:`.shooting`) finds it at a coarse step. The result is then corrected at two steps, in copies whose
steps lie between each other's, and extrapolated to a vanishing step: a change of state is seen at the end of its step,
which biases the small mean of a large alternating torque.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from math import ceil
from operator import attrgetter
from typing import Any, Generic, TypeVar, Unpack

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.motor import ALL
from pyspice_runner.circuit.source import FEWEST_POINTS_PER_PERIOD, DriveSource
from pyspice_runner.circuit.state import motor_states
from pyspice_runner.drivers.driver import Driver
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.motor.drive import Drive, too_fast
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.strength import exceeded
from pyspice_runner.result import Audit, Result, contact_row, json_ready
from pyspice_runner.run.audit import audit_point, delivering
from pyspice_runner.run.dynamometer import STUCK, Quantities, stuck
from pyspice_runner.run.point import Point, Settings
from pyspice_runner.run.recording import VECTORS, Recording
from pyspice_runner.run.waveforms import Array, Waveforms, described
from pyspice_runner.spice.process import KeptProcesses
from pyspice_runner.steady.copies import Copy, Plant, drive_voltage
from pyspice_runner.steady.driven import ROUGH, check_driven, driven_answers
from pyspice_runner.steady.period_map import (
    CONTACT,
    Effort,
    PeriodMap,
    cores,
    current,
    extrapolated,
    forces_on_rotor,
    in_threads,
    mean_of,
    means,
    speed,
)
from pyspice_runner.steady.settling import AVERAGE, time_averages
from pyspice_runner.steady.shooting import Answer, Orbit, Shooting, answer_of, start_point
from pyspice_runner.units import engineering

Place = TypeVar("Place")

STANDS = 1e-3  # rad/s or m/s, below which a motor does not turn
OFFSETS = 2  # copies of each point, whose steps lie between each other's
MOST_REFINEMENTS = 2  # halvings of the step beyond the default
ACCURACY = 2e-3  # of the friction torque under the preload, μ F₀ R
FROM_SPREAD = 4.0  # bound of the error of the mean of two copies over their distance, where the contact stays closed
LONGEST_PERIOD = 1000  # periods of the fastest motion in one of the drive; beyond, settling is cheaper


@dataclass(frozen=True, repr=False, kw_only=True)
class SteadyState(Quantities, Result):
    """A periodic steady state, with the quantities of ``speed_torque``; they are NaN without a solution.

    Attributes:
        motor: the motor.
        drive: the voltages of both groups, or the driver.
        speed_rad_s: mean speed of the rotor.
        current_a_phase_deg, current_b_phase_deg: phase of a group's current ahead of its voltage, both at the drive's
            frequency: 90° of a capacitance; NaN without a voltage, and with tones at two frequencies.
        torque_error_n_m: estimated error of the torque by the time step, of a time average also by its scatter.
        floquet_multipliers: eigenvalues of the map over one period, the largest first.
        converged: whether there is a solution at every step that was used.
        residual: the last Newton step, relative to the size of the motion and to the mean forces that it would change.
        iterations: Newton steps at the coarse step.
        method: how it was found: ``newton`` from a start of its own, ``damped`` with shortened steps, ``neighbour``
            from another point of a curve or a map, ``settled`` after a transient; ``time average`` where the periodic
            motion is unstable: the quantities are those of the motor that runs from rest; empty without a solution.
        step_s: finest time step, s.
        audit: outcome of the physical audit.
        waveforms: one period at the finest step, stable or not, with the deck that runs it; ``None`` without a
            solution.
        provenance: settings, numbers of runs and hashes, JSON-ready.
        solution: the solved point at the coarse step; ``None`` without a solution, and behind a driver.
        behind: the solved point behind a driver, or a period of the motor where it is unstable; else ``None``.
        failure: the first failure of ngspice if every run failed, else ``None``.
        contacts: name, mean normal force and separated share of each of several contacts.
        pins: group → phasors of its voltage in V and current in A, of a tone at the drive's frequency.
    """

    motor: Motor = field(repr=False)
    drive: Drive | Driver
    speed_rad_s: float
    torque_error_n_m: float
    floquet_multipliers: NDArray[np.complex128]
    converged: bool
    residual: float
    iterations: int
    method: str
    step_s: float
    audit: Audit = field(default=Audit(done=False))
    waveforms: Waveforms | None = field(default=None, repr=False)
    provenance: dict[str, Any] = field(default_factory=dict, repr=False)
    solution: Orbit | None = field(default=None, repr=False)
    behind: Orbit | None = field(default=None, repr=False)
    failure: SimulationError | None = field(default=None, repr=False)
    current_a_phase_deg: float = float("nan")
    current_b_phase_deg: float = float("nan")
    contacts: tuple[dict[str, Any], ...] = ()
    pins: Mapping[str, tuple[complex, complex]] = field(default_factory=dict, repr=False)

    @property
    def stable(self) -> bool:
        """Whether the motion returns to it after a small disturbance: all multipliers are inside the unit circle."""
        return self.converged and bool(np.all(np.abs(self.floquet_multipliers) < 1.0))

    @property
    def largest_multiplier(self) -> float:
        """Magnitude of the largest Floquet multiplier; NaN without a solution."""
        return float(np.abs(self.floquet_multipliers).max(initial=0.0)) if self.converged else float("nan")

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return self.motor.slider is not None

    @property
    def speed_m_s(self) -> float:
        """Mean speed of the slider, or of the rotor's rim, m/s."""
        return self.motor.rotor.radius_m * self.speed_rad_s

    @property
    def force_n(self) -> float:
        """Mean force of the contact on the slider, or on the rotor's rim, N."""
        return self.torque_n_m / self.motor.rotor.radius_m

    @property
    def held_by_friction(self) -> bool:
        """Whether the contact of a held shaft sticks throughout: only regularised friction has a unique torque then."""
        laws = self.solution.plant.laws if self.solution else ()
        held = self.provenance["run"]["speed_rad_s"] is not None
        return held and bool(laws) and all(law.spring for law in laws) and stuck(self.quantities)

    @property
    def reached(self) -> bool:
        """Whether the quantities are those of a motor that runs: the motion is stable, or they are time averages."""
        return self.stable or self.method == AVERAGE

    @property
    def determined(self) -> bool:
        """Whether the motor has these quantities, and no others: friction holds a stuck shaft at any torque."""
        return self.reached and not self.held_by_friction

    @property
    def instability(self) -> str:
        """How a small disturbance grows, empty if it decays.

        ``jump``: a multiplier beyond 1, the motion leaves for another one; ``period doubling``: a multiplier beyond -1,
        the motion alternates from period to period; ``irrational``: a complex pair, a second frequency appears.
        """
        if self.stable or not self.converged:
            return ""
        largest = complex(self.floquet_multipliers[0])
        if abs(largest.imag) > 1e-6 * abs(largest):
            return "irrational"
        return "jump" if largest.real > 0.0 else "period doubling"

    def to_dict(self) -> dict[str, Any]:
        """Return the result without its waveforms, JSON-ready."""
        return self._localised({
            "speed_rad_s": self.speed_rad_s,
            **json_ready(self.quantities),
            **self._entries("current_a_phase_deg", "current_b_phase_deg", "torque_error_n_m"),
            **self.sensed(),
            **(self._entries("contacts") if self.contacts else {}),
            **self._entries("floquet_multipliers", "stable", "instability", "converged"),
            **self._entries("residual", "iterations", "method", "step_s", "audit", "cautions"),
            **self.provenance,
        })  # fmt: skip

    def sensed(self) -> dict[str, float]:
        """Return amplitude and phase of a feedback electrode as :meth:`.Waveforms.sensed`, if there are waveforms."""
        return self.waveforms.sensed() if self.waveforms else {}

    @property
    def deck(self) -> str | None:  # type: ignore[override]
        """The netlist that runs the period of the waveforms."""
        return self.waveforms.deck if self.waveforms else None

    def _limits(self) -> Iterator[str]:
        """Yield failed convergence, instability, and exceeded limits."""
        if self.failure is not None:
            yield f"Every run failed: {self.failure}"
        elif not self.converged:
            yield "No steady state was found. Run simulate to see how the motor moves."
        elif not self.stable:
            yield f"The steady state is not stable: {self.instability}."
            average, own = "time averages of the motor that runs from rest", "those of the unstable motion"
            yield f"Its values are {average if self.reached else own}."
        if self.held_by_friction:
            yield STUCK
            bounds = (engineering(value, "N·m") for value in (self.torque_min_n_m, self.torque_max_n_m))
            yield "Friction holds the shaft at least from {} to {}; the torque shown is one of these.".format(*bounds)
        yield from delivering([self.quantities])
        yield from exceeded(self.motor, self.quantities)
        yield from too_fast(self.motor.to_dict(), self.speed_rad_s)

    def summary(self) -> dict[str, str]:
        """Return speed, torque, forces, powers, stability and how the state was found."""
        electrical = self.power_a_w + self.power_b_w
        return self._localised({
            "speed": engineering(self.speed_rad_s, "rad/s"),
            "torque": engineering(self.torque_n_m, "N·m"),
            "load torque": engineering(self.load_torque_n_m, "N·m"),
            "normal force": engineering(self.normal_force_n, "N"),
            "shaft power": engineering(self.shaft_power_w, "W"),
            "electrical power": engineering(electrical, "W"),
            "stress of the ceramic": engineering(self.ceramic_stress_pa, "Pa"),
            "peak pressure of the contact": engineering(self.peak_pressure_pa, "Pa"),
            "temperature rise": engineering(self.temperature_rise_k, "K"),
            **described(self.sensed()),
            "estimated error of the torque": engineering(self.torque_error_n_m, "N·m"),
            "stable": f"{'yes' if self.stable else 'no'}, largest multiplier {self.largest_multiplier:.5g}",
            "found by": f"{self.method or 'no method'}, {self.iterations} iteration{'s' * (self.iterations != 1)}",
            **contact_row(self.provenance["run"]),
        })  # fmt: skip

    def columns(self) -> Mapping[str, Array]:
        """Return one period of the waveforms, if they are there."""
        return self.waveforms.columns() if self.waveforms else {}


@checked
def steady_state(
    motor: Motor,
    drive: Drive | Driver,
    *,
    accuracy: float = ACCURACY,
    audit: bool = True,
    **settings: Unpack[Settings],
) -> SteadyState:
    """Find the periodic steady state of a motor by shooting.

    Args:
        motor: the motor.
        drive: the voltages of both groups, or a built-in driver with any network. The tones of a two-tone drive must
            have a common period.
        accuracy: error of the torque, relative to the friction torque under the preload, above which the step is
            halved, twice at most.
        audit: whether a result that fails the physical audit is an error. If not, the result carries the finding.
        settings: load, contact and solver, as in :class:`.Settings`.

    Returns:
        The steady state; the quantities of an unstable one are time averages. ``converged`` is false if none was found;
        then they are NaN.

    Raises:
        ParameterError: for an invalid value, or for tones without a common period.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    return settled(Point.of(motor, drive, audit=audit, **settings), accuracy)


def settled(point: Point, accuracy: float = ACCURACY, *, averages: bool = True) -> SteadyState:
    """Return the steady state of an operating point, with waveforms; for the settings see :func:`steady_states`."""
    (state,) = steady_states([point], accuracy=accuracy, waveforms=True, averages=averages)
    if state.failure:
        raise state.failure
    unit = "N" if point.motor.slider else "N·m"
    if point.load.torque and (faster := too_fast(point.motor.to_dict(), state.speed_rad_s)):
        raise ParameterError(
            f"load_torque = {point.load.torque:g} {unit} is not valid: the contact gives {state.torque_n_m:.3g} "
            f"{unit}, and the load drives the shaft. {faster[0]}"
        )
    return state


def check_runs(states: Iterable[SteadyState]) -> None:
    """Raise the first failure of ngspice if every run of all states failed."""
    failures = [state.failure for state in states]
    if failures and failures[0] is not None and None not in failures:
        raise failures[0]


def steady_states(
    setups: Sequence[Point],
    *,
    accuracy: float | None = ACCURACY,
    waveforms: bool = False,
    starts: Sequence[Orbit | None] | None = None,
    averages: bool = True,
) -> list[SteadyState]:
    """Find the steady states of many operating points together; see :func:`steady_state`.

    Points whose drives have the same period share runs of ngspice.

    ``starts`` are guesses to start from; ``None`` stands for a start of the point's own. Behind a driver they are
    solutions with ideal voltages near those at its pins. Without ``accuracy`` the quantities are those at the coarse
    step, for differences between points that are close to each other. Without ``averages`` unstable points keep the
    quantities of their periodic motion, for callers that refuse them.

    Raises:
        ParameterError: for a drive that has no steady state to be found.
        SimulationError: if ngspice fails.
    """
    check_accuracy(accuracy)
    for setup in setups:
        _ = setup.motor.rotor  # a transducer has none; its steady state is that of transducer_state
    ideal: dict[int, Point] = {}
    behind: dict[tuple[Any, ...], list[int]] = {}
    for place, setup in enumerate(setups):
        if setup.source.ideal is not None:
            ideal[place] = setup
        else:
            check_driven(setup)
            behind.setdefault((setup.source.period, setup.source.uniform, setup.step), []).append(place)
    near = dict(enumerate(starts or [None] * len(setups)))
    parts = divided(ideal)
    found: dict[int, Any] = dict.fromkeys(near)
    with KeptProcesses() as processes:
        solved = partial(
            solve_part, accuracy=accuracy, starts=near, processes=processes, waveforms=waveforms, averages=averages
        )
        for part, states in zip(parts, in_threads(solved, parts, cores(), processes.stop), strict=True):
            found |= zip(part.setups, states, strict=True)
        for places in behind.values():
            some, begun = [setups[place] for place in places], [near[place] for place in places]
            moving = _free_shafts(some, begun)
            answers, maps = driven_answers(some, begun, moving, accuracy or ACCURACY, processes, averages)
            for place, answer in zip(places, answers, strict=True):
                state = _result(setups[place], answer.point, answer, maps, waveforms=waveforms)
                found[place] = replace(state, behind=(answer.running or answer.point) if state.converged else None)
    return list(found.values())


def _free_shafts(setups: Sequence[Point], starts: Sequence[Orbit | None]) -> list[Orbit | None]:
    """Return for each free shaft without a start the solution with the stage's ideal voltages, else ``None``.

    A short transient from rest leaves rotor and carrier far from where they stay.
    """
    free = [place for place, setup in enumerate(setups) if setup.load.speed is None and starts[place] is None]
    ideal = [replace(setups[place], source=DriveSource(Plant.of(setups[place]).drive)) for place in free]
    found = {place: state.solution for place, state in zip(free, steady_states(ideal, averages=False), strict=True)}
    return [found.get(place) for place in range(len(setups))]


def check_accuracy(accuracy: float | None) -> None:
    """Check an accuracy, relative to the friction torque. Raise ParameterError for one that is not valid."""
    require(accuracy is None or 1e-6 <= accuracy <= 0.1, "accuracy", accuracy, "a number from 1e-6 to 0.1")


@dataclass(frozen=True)
class Part(Generic[Place]):
    """Operating points that share runs of ngspice: their drives have the same period, their contacts the same law."""

    setups: Mapping[Place, Point]  # by their places in the whole
    steps: tuple[int, int]  # numbers of fine and of coarse steps in the period
    workers: int  # number of runs at a time, where the parts run side by side


def divided(setups: Mapping[Place, Point]) -> list[Part[Place]]:
    """Divide operating points with ideal voltages into parts, the largest first. The points of a curve stay together.

    Raise a ParameterError for a drive that has no steady state to be found.
    """
    groups: dict[tuple[Any, ...], dict[str, dict[Place, Point]]] = {}
    for place, setup in setups.items():
        curves = groups.setdefault((_drive(setup).period, setup.law), {})
        curves.setdefault(Plant.of(setup).curve, {})[place] = setup
    parts: list[tuple[dict[Place, Point], tuple[int, int]]] = []
    for (period, _), curves in groups.items():
        each, most = list(curves.values()), ceil(cores() / len(groups))
        own = list(chain.from_iterable(map(dict.values, each)))
        steps = 2 * ceil(0.5 * period / min(map(attrgetter("step"), own)) - 1e-9)
        shortest = min(map(attrgetter("shortest_period"), own))
        coarse = max(steps // 2, ceil(period / shortest * FEWEST_POINTS_PER_PERIOD))
        for first in range(min(most, len(each))):
            some: dict[Place, Point] = {}
            for curve in each[first::most]:
                some |= curve
            parts.append((some, (steps, coarse)))
    parts.sort(key=lambda part: len(part[0]), reverse=True)  # so that none of the long ones is left alone at the end
    workers = max(1, cores() // max(len(parts), 1))
    return [Part(some, steps, workers) for some, steps in parts]


def _drive(setup: Point) -> Drive:
    """Return the drive of an operating point. Raise a ParameterError if shooting cannot find its steady state."""
    drive = setup.source.ideal
    assert drive is not None
    if setup.load.speed is None and setup.motor.rotor.bearing_friction_n_m:
        raise ParameterError(
            "{} = {:g} {}: the steady state of a free shaft on a bearing with dry friction is not found by shooting. "
            "Hold the shaft, or take simulate.".format(*setup.motor.dry_friction)
        )
    setup.source.check(setup.motor)
    for frequency in drive.frequencies:
        turns = frequency * drive.period
        if abs(turns - round(turns)) > 1e-6:
            raise ParameterError(
                f"The drive ({drive.label}) has no short common period: {frequency:g} Hz makes {turns:.6g} periods in "
                f"{drive.period:.4g} s. Choose frequencies in a ratio of small whole numbers, or take mode = 'settle'."
            )
    if drive.period > LONGEST_PERIOD * setup.shortest_period:
        raise ParameterError(
            f"The drive ({drive.label}) repeats after {drive.period:.4g} s only, {LONGEST_PERIOD} times the period of "
            "the fastest motion; take mode = 'settle'."
        )
    return drive


def solve_part(
    part: Part[Any],
    accuracy: float | None,
    starts: Mapping[Any, Orbit | None],
    processes: KeptProcesses,
    *,
    waveforms: bool = False,
    averages: bool = True,
) -> list[SteadyState]:
    """Find the steady states of a part, in its order; the arguments are those of :func:`steady_states`, by place."""
    setups, (steps, coarse) = list(part.setups.values()), part.steps
    solver, period = setups[0].solver, setups[0].source.period
    maps = [PeriodMap(period, coarse, solver.timeout, part.workers, processes)]
    points = []
    for place, setup in part.setups.items():
        points.append(start_point(Plant.of(setup)))
        if start := starts[place]:
            points[-1].guess(start)
    Shooting(points, maps[0]).search()
    if accuracy is None:  # the coarse step alone, of which no error is known
        answers = {
            place: answer_of(point, maps[0], means(point.plant, point.trace, maps[0].discretisation), float("nan"))
            for place, point in enumerate(points)
            if point.done and point.trace
        }
    else:
        answers = _answers(points, maps, steps, accuracy)
        unstable = {place: points[place] for place, one in answers.items() if averages and one.unstable}
        averaged, blocks, _ = time_averages(unstable, maps[0], accuracy) if unstable else ({}, [], {})
        maps += blocks
        for place, average in averaged.items():
            mean = answer_of(answers[place].point, blocks[0], *average)
            answers[place] = replace(mean, map=answers[place].map, method=AVERAGE)
    found = []
    for place, (setup, point) in enumerate(zip(setups, points, strict=True)):
        answer = answers[place] if place in answers and point.done else Answer(point)
        state = _result(setup, point, answer, maps, len(points), waveforms=waveforms)
        found.append(replace(state, solution=point) if state.converged else state)
    return found


def _answers(points: Sequence[Orbit], maps: list[PeriodMap], steps: int, accuracy: float) -> dict[int, Answer]:
    """Refine solved points at finer steps until their error is small enough, and extrapolate; append the maps.

    A point that fails at a finer step keeps the answer of the step before; without one it is no longer solved.
    """
    answers: dict[int, Answer] = {}
    level = _between(dict(enumerate(points)), maps[0])
    pending = list(level)
    averages = _averages(level, maps[0])
    if accuracy >= ROUGH:
        for place, (found, spread) in averages.items():  # the coarse step alone does where the contact stays closed
            error = FROM_SPREAD * spread
            if found["touching"] >= 1.0 and error <= accuracy * points[place].plant.friction_n:
                answers[place] = answer_of(level[place][0], maps[0], found, error)
        pending = [place for place in pending if place not in answers]
    for refinement in range(MOST_REFINEMENTS + 1):
        if not pending:
            break
        before = averages
        maps.append(maps[0].of(maps[0].period, steps * 2**refinement))
        moved = {place: points[place].moved(0.0, maps[-1].step) for place in pending}
        _correct(moved.values(), maps[-1])
        level = _between(moved, maps[-1])
        averages = _averages(level, maps[-1])
        still = []
        for place in pending:
            if not (place in averages and place in before):
                points[place].done = place in answers
                continue
            (fine, spread), (rough, _) = averages[place], before[place]
            ratio = maps[-1].steps / maps[-2].steps
            limit = extrapolated(fine, rough, ratio) if ratio > 1.0 else fine
            error = abs(limit["friction"] - fine["friction"]) + 0.5 * spread
            answers[place] = answer_of(level[place][0], maps[-1], limit, error)
            if error > accuracy * points[place].plant.friction_n and points[place].plant.law:
                still.append(place)
        pending = still
    return answers


def _between(points: Mapping[int, Orbit], period_map: PeriodMap) -> dict[int, list[Orbit]]:
    """Return those of some points that are solved on a map, each with copies whose steps lie between each other's."""
    copies = {place: [point] for place, point in points.items() if point.done}
    for number in range(1, OFFSETS):
        begun = number / OFFSETS * period_map.step
        moved = {place: several[0].moved(begun, period_map.step) for place, several in copies.items()}
        _correct(moved.values(), period_map, near=True)
        for place, several in copies.items():
            several.append(moved[place])
    return copies


def _correct(copies: Collection[Orbit], period_map: PeriodMap, *, near: bool = False) -> None:
    """Solve copies on a map, first with the derivative that they have; ``near`` is that of :class:`.Shooting`."""
    shooting = Shooting([*copies], period_map, near=near)
    shooting.solve()
    if lost := [copy for copy in copies if not copy.done]:
        for copy in lost:  # the derivative of the coarse step did not serve
            copy.restart(copy.state)
        shooting.solve(lost)
        shooting.shift(lost, "newton")


def _averages(level: Mapping[int, Sequence[Orbit]], period_map: PeriodMap) -> dict[int, tuple[dict[str, float], float]]:
    """Return the means over the copies of each point, and the largest difference (N) of their mean friction forces.

    A point of which a copy is not solved has none.
    """
    averages = {}
    for place, copies in level.items():
        several = [means(one.plant, one.trace, period_map.discretisation) for one in copies if one.done and one.trace]
        if len(several) < OFFSETS:
            continue
        averages[place] = mean_of(several), float(np.ptp([found["friction"] for found in several]))
    return averages


def _result(
    setup: Point, point: Orbit, answer: Answer, maps: Sequence[PeriodMap], points: int = 1, *, waveforms: bool
) -> SteadyState:
    """Return the steady state of a point at the coarse step, with audit and provenance; ``points`` share the maps."""
    found, last = answer.found, answer.point
    step = answer.map.step if answer.map else setup.step
    speed_rad_s = setup.load.speed if answer.speed is None else answer.speed
    audit = Audit(done=False)
    if found and setup.law:
        audit = Audit(audit_point(setup.motor, found, step))
        if setup.solver.audit:
            audit.withhold(f"steady state at {speed_rad_s:.4g} rad/s")
    total, decks = Effort(), ""
    for period_map in maps:
        decks += period_map.effort.hashes()
        total.evaluations += period_map.effort.evaluations
        total.simulated_s += period_map.effort.simulated_s
        total.seconds += period_map.effort.seconds
    coarse = maps[0].effort
    provenance: dict[str, Any] = {
        "motor": setup.motor.to_dict(),
        "drive": setup.source.to_dict(),
        "run": setup.to_dict(),
        "ngspice_version": coarse.ngspice_version,
        "simulated_s": total.simulated_s / points,
        "deck_sha256": hashlib.sha256(decks.encode()).hexdigest(),
        "period_maps": total.evaluations,
        "solver_seconds": total.seconds,
        "audit": audit.to_dict(),
    }
    return SteadyState(
        **found, motor=setup.motor, drive=setup.drive,
        speed_rad_s=float("nan") if speed_rad_s is None else speed_rad_s, torque_error_n_m=answer.error,
        floquet_multipliers=last.multipliers if found else np.zeros(0, complex), converged=bool(found),
        residual=last.residual, iterations=point.iterations, step_s=step,
        method=(answer.method or point.method) if found else "",
        audit=audit, waveforms=_waveforms(setup, answer, provenance) if found and waveforms else None,
        provenance=provenance, contacts=answer.contacts, pins=answer.pins, solution=None, behind=None,
        failure=coarse.failure,
    )  # fmt: skip


def _waveforms(setup: Point, answer: Answer, provenance: dict[str, Any]) -> Waveforms:
    """Return one period of a solved point as a recording of ``simulate`` is."""
    point, period_map = answer.point, answer.map
    plant, trace = point.plant, point.trace
    assert trace is not None
    assert period_map is not None
    discretisation = period_map.discretisation
    samples = {"time": trace.time, "v(shaft)": speed(plant, trace)}
    moved = 1e6 * plant.motor.stator.contact @ trace.states[: plant.modes]
    for number, one in enumerate(plant.motor.touching):
        samples |= {f"v(xmotor.{axis}{one.suffix})": moved[2 * number + at] for at, axis in enumerate("xy")}
        of_contact = (trace.normal, trace.friction, trace.contact_state, trace.slider_um, trace.penetration_um)
        for name, values in zip(CONTACT, of_contact if plant.law else (), strict=False):
            samples[f"v(xmotor.{name.format(one.suffix)})"] = values[number]
    for name, force in zip(("normal", "friction"), forces_on_rotor(plant, trace), strict=True):
        samples[f"v(xmotor.{name}{ALL})"] = force
    for state, row in zip(plant.states, trace.states, strict=False):  # behind a driver its own states follow
        samples[state.within("xmotor")] = row / state.scale(discretisation)
    for state in motor_states(setup.motor, plant.law, ("bearing",)):
        samples[state.within("xmotor")] = np.full(len(trace.time), np.sign(setup.load.speed or 0.0))
    samples |= trace.pins
    for group, tones in zip("ab", plant.drive.tones, strict=True) if not trace.pins else ():
        name, sign = setup.source.current(group)
        samples[f"v({group})"] = drive_voltage(tones, trace.time)
        samples[name] = sign * current(plant, group, trace)
    if electrode := plant.motor.feedback:
        shared = sum(share * samples[f"v({group})"] for group, share in zip("ab", electrode.shares, strict=True))
        samples[VECTORS["feedback_v"][0]] = trace.states[plant.places["feedback"]][0] + shared
    recording = Recording(setup, discretisation, started=False)
    waves = recording.columns(samples, recording.all_columns)
    arrays: dict[str, Any] = {name: waves.get(name) for name in Waveforms.units}
    return Waveforms(
        **arrays,
        of_contacts={name: values for name, values in waves.items() if name not in Waveforms.units},
        energy=recording.energy(waves, samples),
        drive_period_s=period_map.period,
        rotor_radius_m=setup.motor.rotor.radius_m,
        decay_s=setup.motor.decay_s,
        solver_seconds=period_map.effort.seconds,
        ngspice_version=period_map.effort.ngspice_version,
        provenance=provenance,
        deck=period_map.deck(Copy(plant, point.state, point.begun)),
        periodic=True,
    )
