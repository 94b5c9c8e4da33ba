# SPDX-License-Identifier: GPL-3.0-or-later
"""The steady state of a motor behind a driver circuit, whose inductances and capacitances are states like the motor's.

The switching edges are at fixed phases of the drive, but ngspice chooses its steps there, and a small change of the
state may change them. The derivative of the map is therefore measured at uniform steps, with the stage replaced by the
harmonics of its output; it neglects how the output of the stage depends on its current. Newton's method with it
converges linearly, to a fixed point of the map with the stage itself.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from math import ceil, pi

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.analysis.dynamometer import Block, Dynamometer, ammeter, quantities
from pyspice_runner.analysis.period_map import CONTACT, PeriodMap, Trace, cores
from pyspice_runner.analysis.period_means import current
from pyspice_runner.analysis.shooting import PERTURBATION, TOLERANCE, Point, Shooting, start_point
from pyspice_runner.engine.processes import KeptProcesses
from pyspice_runner.errors import ParameterError
from pyspice_runner.model.drive import Tone, TwoPhaseDrive, two_phases
from pyspice_runner.netlist.copies import Copy, Plant, copy_name
from pyspice_runner.netlist.driven import (
    LEAD,
    DrivenPlant,
    driven_bench,
    driven_states,
    driven_vectors,
)
from pyspice_runner.netlist.drivers import Driver
from pyspice_runner.netlist.motor import require_linear
from pyspice_runner.netlist.source import GROUPS
from pyspice_runner.netlist.sources import Bench
from pyspice_runner.netlist.state import Discretisation
from pyspice_runner.run.kernel import run_bench, transient_timing
from pyspice_runner.run.operating_point import OperatingPoint

Array = NDArray[np.float64]
HARMONICS = (1, 2, 3, 5, 7, 9)  # of a stage's output for the derivative
FADED = 1e-6  # part of the largest singular value below which a state at the start has no influence but by rounding
ROUGH = 5e-3  # accuracy from which on steps twice as long may do
SOLVED = 0.1  # of the accuracy, how near to the solution Newton's method ends, but not nearer than elsewhere
NEUTRAL = 1e-5  # distance of a multiplier from 1 within the error of a derivative by finite differences
FEWEST_PERIODS = 10  # of the transient from which a curve starts
SETTLING = (1.0, 4.0)  # decay times of the slowest mode for which a point runs if Newton's method fails
_MORE = 4.5  # steps beyond the period: ngspice 46 shortens the last two of a run
_EVEN = 20  # a number of steps that has LEAD of a period in it


@dataclass
class DrivenMap(PeriodMap):
    """The map over one period of a driver."""

    uniform: bool = False  # whether ngspice's steps are uniform; otherwise it shortens them at edges

    @property
    def discretisation(self) -> Discretisation:
        """How motors are adapted to the step."""
        return Discretisation(self.step, self.uniform)

    def _write(self, copies: Sequence[Copy]) -> None:
        """Leave the subcircuits to :func:`driven_bench`."""

    @property
    def duration(self) -> float:
        """Length in s of a run over a period."""
        return (1.0 + LEAD) * self.period + (_MORE * self.step if self.uniform else 0.0)

    def _bench(self, copies: Sequence[Copy]) -> Bench:
        return driven_bench(copies, self.discretisation)

    def _single(self, copy: Copy) -> Bench:
        return self._bench([copy])

    def _vectors(self, number: int, plant: Plant, *, whole: bool) -> list[str]:
        instance = copy_name(number)
        assert isinstance(plant, DrivenPlant)
        names = driven_vectors(plant, instance)
        names += [f"v({instance}.xmotor.{name})" for name in CONTACT if whole]
        names += [name for name in pin_vectors(instance).values() if whole]
        return names + [f"v({instance}.out_{group})" for group in GROUPS if whole and not self.uniform]

    def _traces(
        self, copies: Sequence[Copy], names: Sequence[Sequence[str]], raw: Mapping[str, Array], *, whole: bool
    ) -> list[Trace | None]:
        time = raw["time"]
        first, last = self.ends(time) if whole else (len(time) - 1, len(time) - 1)
        even = np.linspace(time[first], time[last], self.steps + 1) if whole else time[-1:]
        within = slice(first, last + 1)
        traces: list[Trace | None] = []
        for number, (copy, own) in enumerate(zip(copies, names, strict=True)):
            assert isinstance(copy.plant, DrivenPlant)
            states = driven_states(copy.plant, raw, copy_name(number), self.discretisation)
            contact = (
                [raw[f"v({copy_name(number)}.xmotor.{name})"] for name in CONTACT] if whole else [time] * len(CONTACT)
            )
            rows = [np.interp(even, time, row) for row in (*states, *contact)]
            outputs = {name[-2]: self._harmonics(time[within], raw[name][within]) for name in own if ".out_" in name}
            named = pin_vectors(copy_name(number)).items() if whole else ()
            pins = {name: np.interp(even, time, raw[vector]) for name, vector in named}
            begun = even + copy.plant.begins * self.period  # since the control of group A had the phase 0
            trace = Trace(begun, np.array(rows[: len(states)]), *rows[len(states) :])
            traces.append(replace(trace, outputs=outputs, pins=pins))
        return traces

    def ends(self, time: Array) -> tuple[int, int]:
        """Return the first and the last point of the period."""
        first = int(np.abs(time - LEAD * self.period).argmin())
        return first, first + self.steps if self.uniform else len(time) - 1

    def _harmonics(self, time: Array, voltage: Array) -> tuple[Tone, ...]:
        """Return the harmonics of a voltage over a period."""
        tones = []
        for number in HARMONICS:
            wave = np.exp(-2j * pi * number * time / self.period)
            phasor = 2.0 * np.trapezoid(voltage * wave, time) / self.period
            tones.append(Tone(float(abs(phasor)), number / self.period, float(np.angle(phasor)) + 0.5 * pi))
        return tuple(tones)


def pin_vectors(copy: str) -> dict[str, str]:
    """Return the vectors of voltages and currents of the pins of a copy, by their names in a run of one motor."""
    found: dict[str, str] = {}
    for group in GROUPS:
        found |= {f"v({group})": f"v({copy}.{group})", f"i(vpin_{group})": f"i(v.{copy}.vpin_{group})"}
    return found


class DrivenShooting(Shooting):
    """Newton's method with the derivative of the motor behind the harmonics of its stage's output."""

    def __init__(self, points: Sequence[Point], period_map: DrivenMap) -> None:
        super().__init__(points, period_map)
        self.even = period_map if period_map.uniform else DrivenMap(
            period_map.period, _EVEN * ceil(period_map.steps / 2 / _EVEN), period_map.timeout, uniform=True,
            processes=period_map.processes,
        )  # fmt: skip

    def _evaluate(self, points: Sequence[Point]) -> None:
        for point, trace in zip(
            points, self.map.traces([Copy(point.plant, point.state) for point in points]), strict=True
        ):
            point.trace = trace
            point.failed = trace is None
        self.measure([point for point in points if point.at_end is None and not point.failed])
        for point in points:
            if not point.failed:
                point.step = point.newton_step()
                point.judge()

    def _renew(self, points: Sequence[Point]) -> None:
        self.measure(points)

    def measure(self, points: Sequence[Point]) -> None:
        """Measure the derivatives of points that have a trace."""
        copies: list[Copy] = []
        for point in points:
            plant = point.plant
            assert isinstance(plant, DrivenPlant)
            if not plant.driver.uniform:
                assert point.trace is not None
                plant = replace(plant, stage=point.trace.outputs)
            states = np.vstack([point.state, point.state + PERTURBATION * np.diag(point.scale)])
            copies += [Copy(plant, state) for state in states]
        traces = self.even.traces(copies)
        for point in points:
            count = point.plant.order + 1
            base, *near = traces[:count]
            del traces[:count]
            point.failed = base is None
            if base is not None:
                point.differentiate(near, base)


class DrivenPoint(Point):
    """A point whose fast states, plates and the capacitance across them, fade between start and period."""

    @property
    def felt(self) -> NDArray[np.bool_]:
        """All states: those that fade are told by the singular values."""
        return np.ones(self.plant.order, dtype=bool)

    @property
    def free(self) -> NDArray[np.bool_]:
        """All states are Newton's unknowns."""
        return self.felt

    def newton_step(self) -> Array:
        """Return the step of the scaled state that closes the gap, by least squares."""
        assert self.at_start is not None
        assert self.at_end is not None
        left, sizes, right = np.linalg.svd(self.at_end - self.at_start)
        kept = (sizes > FADED * sizes[0]) & (np.arange(len(sizes)) < len(sizes) - self.sticks)
        return np.asarray(right.T @ np.where(kept, -(left.T @ self.gap) / np.where(kept, sizes, 1.0), 0.0))

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, the largest first, without the 1 of sliders that stick and of isolated charges.

        The charge between a capacitor in series and a group has no path away.
        """
        assert self.at_start is not None
        assert self.measured_end is not None
        values = np.linalg.eigvals(self.measured_end @ np.linalg.pinv(self.at_start, rcond=FADED)).astype(complex)
        values = np.delete(values, np.argsort(np.abs(values - 1.0))[: self.sticks])
        values = values[np.abs(values - 1.0) > NEUTRAL]
        return np.asarray(values[np.argsort(-np.abs(values))])

    def _update(self, step: Array, gap: Array) -> None:
        """Keep the derivative: what it neglects would mix with the noise of the steps at the edges."""


@dataclass(frozen=True)
class Answer:
    """The answer to one operating point."""

    point: Point  # the point at the finest step
    map: PeriodMap | None = None  # the map at that step; ``None`` if only the coarse step has been tried
    # the quantities of :data:`.dynamometer.UNITS`; empty without a solution.
    found: Mapping[str, float] = field(default_factory=dict)
    error: float = float("nan")  # estimated error of the torque, N·m
    speed: float | None = None  # mean speed of the rotor, rad/s; ``None`` for a held shaft


def check_driven(setup: OperatingPoint) -> None:
    """Raise a ParameterError for a source that shooting cannot handle."""
    source = setup.source
    settle = "Take mode = 'settle', or simulate it until it settles."
    if not isinstance(source, Driver):
        raise ParameterError(f"A tracker ({source.label}) has feedback: its voltages have no fixed period. {settle}")
    if source.own:
        raise ParameterError(
            f"The driver {source.name} is a subcircuit of your own, whose states are not known. {settle}"
        )
    if source.kind in ("full-bridge", "push-pull"):
        raise ParameterError(
            f"A {source.kind} with its transformer has no steady state by shooting. {settle} Or take "
            "driver.equivalent(), which leaves out dead time and harmonics."
        )
    if setup.law is None:
        raise ParameterError(f"contact = None is not valid behind a driver. Give a law. {settle}")
    if setup.load.speed is None and setup.motor.rotor.bearing_friction_n_m:
        raise ParameterError(
            f"The steady state of a free shaft on a bearing with dry friction is not found by shooting. {settle}"
        )
    require_linear(setup.motor, "A steady state behind a driver")


def driven_answers(
    setups: Sequence[OperatingPoint], starts: Sequence[Point | None], accuracy: float, processes: KeptProcesses
) -> tuple[list[Answer], tuple[DrivenMap, ...]]:
    """Solve operating points of motors behind drivers of the same frequency; return the answers and the maps.

    ``starts`` are solutions with ideal voltages at the pins, near those behind the driver, from which Newton's method
    is tried alone. Without them the first point of each curve starts from a short transient, the others from that
    point's solution, and where this fails after a longer transient.

    The step is that of the operating points, for a rough ``accuracy`` twice as long, and half of it to compare. Where
    uniform steps have a larger error of the torque, it is halved once more. Floquet multipliers are those of the
    longest step.
    """
    points: list[DrivenPoint] = []
    for setup, start in zip(setups, starts, strict=True):
        driver = setup.source
        assert isinstance(driver, Driver)
        stage = TwoPhaseDrive(**two_phases(driver))
        plant = DrivenPlant(setup.motor, stage, setup.load, setup.law, driver)
        state = np.zeros(plant.order) if start is None else _behind_network(plant, start)
        tolerance = max(TOLERANCE, SOLVED * accuracy)
        points.append(DrivenPoint(plant, state, _scale(plant), guessed=start is not None, tolerance=tolerance))
    first = setups[0]
    rough = accuracy >= ROUGH and first.source.uniform
    steps = (0.5, 1.0, 2.0) if rough else (1.0, 2.0)
    maps = [
        DrivenMap(
            first.source.period, _EVEN * ceil(finer * first.source.period / first.step / _EVEN), first.solver.timeout,
            uniform=first.source.uniform, processes=processes,
        )
        for finer in steps
    ]  # fmt: skip
    _search([point for point in points if not point.guessed], maps[0])
    _place([point for point in points if point.guessed], maps[0])
    answers = [Answer(point, maps[1]) for point in points]
    before = _metered(setups, points, maps[0])
    stability = DrivenShooting(points, maps[0])
    pending = list(range(len(points)))
    for period_map in maps[1:]:
        some = [points[place] for place in pending]
        DrivenShooting(some, period_map).solve([point for point in some if point.done])
        stability.measure([point for point in some if point.done and point.far])
        found = _metered([setups[place] for place in pending], some, period_map)
        for place, fine in zip(pending, found, strict=True):
            answers[place] = _answer(points[place], period_map, fine, before[place])
            before[place] = fine
        pending = [place for place in pending if answers[place].error > accuracy * _friction(points[place])]
        if not pending:
            break
    return answers, tuple(maps)


def _answer(
    point: DrivenPoint, period_map: DrivenMap, fine: Mapping[str, float], coarse: Mapping[str, float]
) -> Answer:
    """Return the answer for the quantities at a step and at one twice as long; both are empty without a solution."""
    if not (fine and coarse):
        return Answer(point, period_map)
    assert isinstance(point.plant, DrivenPlant)
    assert point.trace is not None
    speed = float(point.trace.states[point.plant.inner - 1].mean()) if point.plant.turns else None
    return Answer(point, period_map, fine, abs(fine["torque_n_m"] - coarse["torque_n_m"]), speed)


def _friction(point: Point) -> float:
    """Return the friction torque under the preload, N·m."""
    motor = point.plant.motor
    return motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m


def _behind_network(plant: DrivenPlant, start: Point) -> Array:
    """Return the state with the motor as it moves with ideal voltages at its pins, and the network to suit."""
    assert start.trace is not None
    drive, time = start.plant.drive, start.trace.time
    omega, begun = 2.0 * pi / drive.period, plant.begins * drive.period
    turns = np.exp(-1j * omega * time)
    pins, currents = {}, {}
    for group in GROUPS:
        (tone,) = getattr(drive, f"tones_{group}")
        pins[group] = tone.amplitude * np.exp(1j * tone.phase)
        currents[group] = complex(
            2j * np.trapezoid(current(start.plant, group, start.trace) * turns, time) / drive.period
        )
    turned = np.exp(1j * omega * begun)
    plates = [float((pins[state.field[len("plates_")]] * turned).imag) for state in plant.states[plant.inner :]]
    stores = [float((phasor * turned).imag) for phasor in plant.store_phasors(pins, currents)]
    return np.array([*start.moved(begun).state[: plant.inner], *plates, *stores])  # a held shaft has no state


def _scale(plant: DrivenPlant) -> Array:
    """Return the size of each state: voltages by the stage's, currents by that of the clamped capacitance."""
    volts = max(plant.driver.amplitude(group) for group in "ab")
    amperes = 2.0 * pi * plant.driver.frequency * max(plant.motor.piezo.capacitance_a_f, 1e-12) * volts
    stores = [amperes if store.coil else volts for store in plant.stores]
    plates = len(plant.states) - plant.inner
    return np.array([*start_point(plant).scale, *(volts,) * plates, *stores])


def _place(points: Sequence[DrivenPoint], period_map: DrivenMap) -> None:
    """Solve points from where they are."""
    DrivenShooting(points, period_map).solve()
    for point in points:
        point.method = "newton" if point.done else ""


def _search(points: Sequence[DrivenPoint], period_map: DrivenMap) -> None:
    shooting = DrivenShooting(points, period_map)
    curves: dict[tuple[str, bool], list[DrivenPoint]] = {}
    for point in points:  # a free shaft has a state more
        curves.setdefault((point.plant.curve, point.plant.turns), []).append(point)
    seeds = [curve[len(curve) // 2] for curve in curves.values()]
    for decays in (0.0, *SETTLING):
        _retry([seed for seed in seeds if not seed.done], shooting, period_map, decays)
    for seed, curve in zip(seeds, curves.values(), strict=True):
        for point in curve:
            if point is not seed and seed.done:
                point.guess(seed)
    near = [point for point in points if point.guessed]
    shooting.solve(near)
    for point in near:
        point.method = "neighbour" if point.done else ""
    for decays in SETTLING:
        _retry([point for point in points if not point.done], shooting, period_map, decays)


def _retry(points: Sequence[DrivenPoint], shooting: DrivenShooting, period_map: DrivenMap, decays: float) -> None:
    """Solve points after a transient from rest of a number of decay times of the slowest mode."""
    if not points:
        return
    times = [2.0 * mode.mass_kg / mode.damping_n_s_per_m for point in points for mode in point.plant.motor.modes]
    periods = max(FEWEST_PERIODS, ceil(decays * max(times) / period_map.period))
    copies = [Copy(point.plant, np.zeros(point.plant.order)) for point in points]
    for point, end in zip(points, period_map.settled(copies, periods), strict=True):
        point.restart(point.state if end is None else end)
    shooting.solve(points)
    for point in points:
        point.method = ("settled" if decays else "newton") if point.done else ""


def _metered(
    setups: Sequence[OperatingPoint], points: Sequence[Point], period_map: DrivenMap
) -> list[dict[str, float]]:
    """Return the quantities of solved points over a period with the meters of the dynamometer; of others nothing."""
    places = [place for place, point in enumerate(points) if point.done]

    def measured(place: int) -> dict[str, float]:
        return _quantities(setups[place], points[place], period_map)

    with ThreadPoolExecutor(cores()) as pool:
        found = dict(zip(places, pool.map(measured, places), strict=True))
    return [found.get(place, {}) for place in range(len(points))]


class _Period(Dynamometer):
    """A dynamometer that runs for one period."""

    @property
    def periods(self) -> int:
        return 1


def _quantities(setup: OperatingPoint, point: Point, period_map: DrivenMap) -> dict[str, float]:
    bench = _Period(setup.with_step(period_map.step))
    vectors = [*bench.integrals(meters=True), *bench.setup.state_vectors(), *(ammeter(group) for group in "ab")]
    inside = {name: re.sub(r"^(v|i)\((v\.)?", rf"\1(\2{copy_name(0)}.", name) for name in vectors}
    found = run_bench(
        driven_bench([Copy(point.plant, point.state)], period_map.discretisation, meters=True), list(inside.values()),
        period_map.timeout, "transient", transient_timing(period_map.step, period_map.duration),
        processes=period_map.processes,
    ).vectors()  # fmt: skip
    first, last = period_map.ends(found["time"])
    start, end = ({name: float(found[own][at]) for name, own in inside.items()} for at in (first, last))
    means = bench.means({name: end[name] - start[name] for name in end})
    peaks = {group: float(np.abs(found[inside[ammeter(group)]][first : last + 1]).max()) for group in "ab"}
    block = Block(bench, means, peaks, bench.setup.motion(start), bench.setup.motion(end), bench.duration, "")
    return quantities([block])
