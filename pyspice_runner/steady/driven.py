# SPDX-License-Identifier: GPL-3.0-or-later
"""The steady state of a motor behind a driver circuit, whose inductances and capacitances are states like the motor's.

The edges of the control are at fixed phases of the drive; a run starts far from them, and has a point at each. In
between ngspice chooses its steps, and a small change of the state may change them. The derivative of the map is
therefore measured in decks whose copies have their steps in common, one of them undisturbed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.motor import require_linear
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor import groups, strength
from pyspice_runner.run.dynamometer import Block, Dynamometer, ammeter, metered
from pyspice_runner.run.kernel import run_bench, transient_timing
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import interpolated
from pyspice_runner.spice.process import KeptProcesses
from pyspice_runner.steady.copies import LEAD, PRIMARY, Copy, Plant, copy_name, driven_bench
from pyspice_runner.steady.period_map import (
    PeriodMap,
    cores,
    current,
    fundamental,
    in_threads,
    modal,
    rubbing,
    speed,
)
from pyspice_runner.steady.settling import AVERAGE, time_averages
from pyspice_runner.steady.shooting import NEWTON, Answer, Orbit, Shooting, answer_of, start_point

Array = NDArray[np.float64]
# singular value, relative to the largest, below which a state at the start of the run does not affect the period: the
# other states have 0.02 or more, the lags of stem and slider 0.001 or less
FADED = 5e-3
ROUGH = 5e-3  # accuracy from which on steps twice as long may do
SOLVED = 0.1  # of the accuracy, how near to the solution Newton's method ends, but not nearer than elsewhere
FEWEST_PERIODS = 10  # of the transient from which a curve starts
_EVEN = 20  # a number of steps that has LEAD of a period in it


class DrivenShooting(Shooting):
    """Newton's method with the derivative by copies that share the steps of the undisturbed one."""

    decks = 2  # of a derivative

    def evaluate(self, points: Sequence[Orbit]) -> None:
        """Do what :meth:`.Shooting.evaluate` does."""
        traces = self.map.traces([Copy(point.plant, point.state) for point in points])
        for point, trace in zip(points, traces, strict=True):
            point.trace = trace
            point.failed = trace is None
        self._renew([point for point in points if point.at_end is None and not point.failed])
        for point in points:
            if not point.failed:
                point.judge()

    def _renew(self, points: Sequence[Orbit]) -> None:
        """Measure the derivatives of points that have a trace."""
        decks = [
            [Copy(point.plant, state) for state in (point.state, *(point.state + part))]
            for point in points
            for part in np.array_split(NEWTON.perturbation * np.diag(point.scale), self.decks)
        ]
        found = iter(self.map.together(decks))
        for point in points:
            point.differentiate([pair for _ in range(self.decks) for pair in next(found)])

    def search(self) -> None:
        """Solve points without a guess: of each curve one first, the others from it or after a longer transient."""
        curves: dict[tuple[str, bool], list[Orbit]] = {}
        for point in self.points:  # a free shaft has a state more
            curves.setdefault((point.plant.curve, point.plant.turns), []).append(point)
        seeds = [curve[len(curve) // 2] for curve in curves.values()]
        for decays in (0.0, *NEWTON.settling):
            self._run_up([seed for seed in seeds if not seed.done], decays)
        for seed, curve in zip(seeds, curves.values(), strict=True):
            for point in curve:
                if point is not seed and seed.done:
                    point.guess(seed)
        self.solve_by([point for point in self.points if point.guessed], "neighbour")
        for decays in NEWTON.settling:
            self._run_up([point for point in self.points if not point.done], decays)

    def _run_up(self, points: Sequence[Orbit], decays: float) -> None:
        """Solve points after some decay times of the slowest mode from rest, or a short run from where they are."""
        times = [2.0 * mode.mass_kg / mode.damping_n_s_per_m for point in points for mode in point.plant.motor.modes]
        periods = max(FEWEST_PERIODS, ceil(decays * max(times, default=0.0) / self.map.period))
        copies = [Copy(point.plant, np.zeros(point.plant.order) if decays else point.state) for point in points]
        for point, end in zip(points, self.map.settled(copies, periods), strict=True):
            point.restart(point.state if end is None else end)
        self.solve_by(points, "settled" if decays else "newton")


class DrivenPoint(Orbit):
    """A point with states, as the plates behind a bridge, that fade between the start of the run and the period."""

    def newton_step(self) -> Array:
        """Return the step of the scaled state that closes the gap, as far as it lasts until the period begins.

        What does not last, and a slider that is not free, go to where they are a period later.
        """
        assert self.trace is not None
        free = self.free
        begun, back, monodromy, faded = self._reduced()
        left, sizes, right = np.linalg.svd(monodromy - np.eye(len(monodromy)))
        # what sticks, and charges that are isolated, stay where they are
        kept = np.arange(len(sizes)) < len(sizes) - self.sticks - self.plant.isolated
        moved = right.T @ np.where(kept, -(left.T @ (begun.T @ self.gap[free])) / np.where(kept, sizes, 1.0), 0.0)
        step = np.asarray((self.trace.later(self.plant.begins * self.plant.drive.period) - self.state) / self.scale)
        step[free] = back @ moved + faded.T @ (faded @ step[free])
        return step

    def _reduced(self) -> tuple[Array, Array, Array, Array]:
        """Return orthogonal directions of the free state at the beginning of the period, in columns, and the rest.

        They are those that the start of the run reaches. The rest is the state at the start that leads to each, the
        derivative of the state at the end of the period along them, and the directions of the start that fade, in rows.
        """
        assert self.at_start is not None
        assert self.at_end is not None
        free = np.ix_(self.free, self.free)
        left, sizes, right = np.linalg.svd(self.at_start[free])
        kept = sizes > FADED * sizes[0]
        begun, back = left[:, kept], right[kept].T / sizes[kept]
        return begun, back, begun.T @ self.at_end[free] @ back, right[~kept]

    def remaining(self, step: Array) -> float:
        """Return the size of a Newton step without what fades before the period begins."""
        faded, lasting = self._reduced()[3], step.copy()
        lasting[self.free] -= faded.T @ (faded @ step[self.free])
        return super().remaining(lasting)

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, the largest first, without the 1 of sliders that stick and of isolated charges.

        The charge between a capacitor in series and a group has no path away.
        """
        values = np.linalg.eigvals(self._reduced()[2]).astype(complex)
        values = np.delete(values, np.argsort(np.abs(values - 1.0))[: self.sticks + self.plant.isolated])
        return np.asarray(values[np.argsort(-np.abs(values))])

    def _update(self, step: Array, gap: Array) -> None:
        """Keep the derivative: what it neglects would mix with the noise of the steps at the edges."""


def check_driven(setup: Point) -> None:
    """Raise a ParameterError for a source that shooting cannot handle."""
    settle = "Take mode = 'settle', or simulate it until it settles."
    if setup.source.unsteady:
        raise ParameterError(f"{setup.source.unsteady} {settle}")
    if setup.law is None:
        raise ParameterError(f"contact = None is not valid behind a driver. Give a law. {settle}")
    if setup.load.speed is None and setup.motor.rotor.bearing_friction_n_m:
        raise ParameterError(
            f"The steady state of a free shaft on a bearing with dry friction is not found by shooting. {settle}"
        )
    require_linear(setup.motor, "A steady state behind a driver")


def driven_answers(
    setups: Sequence[Point],
    starts: Sequence[Orbit | None],
    near: Sequence[Orbit | None],
    accuracy: float,
    processes: KeptProcesses,
    averages: bool,
) -> tuple[list[Answer], tuple[PeriodMap, ...]]:
    """Solve operating points of motors behind drivers of the same frequency; return the answers and the maps.

    ``starts`` are solutions with ideal voltages at the pins, near those behind the driver, from which Newton's method
    is tried alone. Without them the first point of each curve starts from a short transient, from rest or
    with the motor as in ``near``; the others from that point's solution, and where this fails after a longer transient.

    The step is that of the operating points, for a rough ``accuracy`` twice as long, and half of it to compare. Where
    uniform steps have a larger error of the torque, it is halved once more. Floquet multipliers are those of the
    longest step.
    """
    points: list[DrivenPoint] = []
    for setup, start, moving in zip(setups, starts, near, strict=True):
        plant = Plant.of(setup)
        state = np.zeros(plant.order) if start is None else _behind_network(plant, start)
        if start is None and moving is not None:
            state[: plant.inner] = moving.moved(plant.begins * plant.drive.period).state[: plant.inner]
        tolerance = max(NEWTON.residual, SOLVED * accuracy)
        points.append(DrivenPoint(plant, state, _scale(plant), guessed=start is not None, tolerance=tolerance))
    first = setups[0]
    rough = accuracy >= ROUGH and first.source.uniform
    steps = (0.5, 1.0, 2.0) if rough else (1.0, 2.0)
    maps = [
        PeriodMap(
            first.source.period, _EVEN * ceil(finer * first.source.period / first.step / _EVEN), first.solver.timeout,
            uniform=first.source.uniform, processes=processes, lead=LEAD,
        )
        for finer in steps
    ]  # fmt: skip
    DrivenShooting([point for point in points if not point.guessed], maps[0]).search()
    stability = DrivenShooting(points, maps[0])
    stability.solve_by([point for point in points if point.guessed], "newton")
    answers = [Answer(point, maps[1]) for point in points]
    torques = [point.plant.friction_n * point.plant.motor.rotor.radius_m for point in points]
    before: dict[int, tuple[dict[str, float], Copy]] = {}
    pending = dict(enumerate(points))
    for period_map in maps:
        if period_map is not maps[0]:
            DrivenShooting([*pending.values()], period_map).solve([one for one in pending.values() if one.done])
            stability._renew([point for point in pending.values() if point.done and point.far])
        copies = {place: Copy(point.plant, point.state) for place, point in pending.items() if point.done}
        found = _metered(setups, copies, period_map)
        for place in found.keys() & before.keys():
            (fine, _), (coarse, _) = found[place], before[place]
            error = abs(fine["friction"] - coarse["friction"])
            answers[place] = answer_of(points[place], period_map, fine, error)
        pending = {
            place: point for place, point in pending.items() if not answers[place].error <= accuracy * torques[place]
        }
        before = found
    unstable = {place: points[place] for place, one in enumerate(answers) if averages and one.unstable}
    if unstable:
        averaged, blocks, ends = time_averages(unstable, maps[0], accuracy, partial(_metered, setups))
        maps += blocks
        moved = maps[0].traces([ends[place] for place in averaged])
        for (place, average), trace in zip(averaged.items(), moved, strict=True):
            running = replace(points[place], state=ends[place].state, trace=trace) if trace else None
            mean = answer_of(points[place], blocks[0], *average)
            answers[place] = replace(mean, map=answers[place].map, method=AVERAGE, running=running)
    return answers, tuple(maps)


def _metered(
    setups: Sequence[Point], copies: Mapping[int, Copy], period_map: PeriodMap
) -> dict[int, tuple[dict[str, float], Copy]]:
    """Do behind a driver what :func:`.run_block` does, with the meters of the dynamometer."""

    def measured(place: int) -> tuple[dict[str, float], Copy] | None:
        try:
            return _measured(setups[place], copies[place], period_map)
        except SimulationError as error:
            period_map.effort.fail(error)
            return None

    found = zip(copies, in_threads(measured, list(copies), cores()), strict=True)
    return {place: one for place, one in found if one is not None}


def running(setup: Point, start: Orbit, periods: int, vectors: Sequence[str]) -> dict[str, Array]:
    """Return vectors of a run behind a driver, by their names in a run of one motor.

    It starts with the motor as it moves in a steady state that is near, and the network to suit.
    """
    plant = Plant.of(setup)
    powers = {
        name: replace(power, terms={_inside(term): word for term, word in power.terms.items()})
        for name, power in plant.front.powers.items()
    }
    names = {name: name if name in powers else _inside(name) for name in vectors}
    bench = driven_bench([Copy(plant, _behind_network(plant, start))], setup.discretisation)
    found = run_bench(
        replace(bench, signals={**bench.signals, **powers}), list(names.values()), setup.solver.timeout, "transient",
        transient_timing(setup.step, periods * setup.source.period),
    ).vectors()  # fmt: skip
    return {"time": found["time"], **{name: found[own] for name, own in names.items()}}


def _inside(vector: str) -> str:
    """Return the name that a vector of a run of one motor has in the first copy of a bench."""
    kind, _, name = vector.partition("(")
    return f"{kind}({'v.' if kind == 'i' else ''}{copy_name(0)}.{name.removeprefix('v.')}"


def _behind_network(plant: Plant, start: Orbit) -> Array:
    """Return the state with the motor as it moves in a steady state, and the network to suit its pins."""
    assert start.trace is not None
    drive, time, waves = start.plant.drive, start.trace.time, start.trace.pins
    omega, begun = 2.0 * pi / drive.period, plant.begins * drive.period
    turns, pins, currents = np.exp(-1j * omega * time), {}, {}
    for group in GROUPS:
        (tone,) = groups.of(drive.tones, group)
        amperes = waves[groups.current("pin", group)] if waves else current(start.plant, group, start.trace)
        pins[group] = tone.amplitude * np.exp(1j * tone.phase)
        if waves:
            pins[group] = complex(2j * np.trapezoid(waves[f"v({group})"] * turns, time) / drive.period)
        currents[group] = complex(2j * np.trapezoid(amperes * turns, time) / drive.period)
    turned = np.exp(1j * omega * begun)
    plates = [float((pins[state.name[len("xgroup_")]] * turned).imag) for state in plant.states[plant.inner :]]
    stores = [float((phasor * turned).imag) for phasor in plant.store_phasors(pins, currents)]
    return np.array([*start.moved(begun).state[: plant.inner], *plates, *stores])  # a held shaft has no state


def _scale(plant: Plant) -> Array:
    """Return the size of each state: voltages by the stage's, currents by those of the clamped capacitance.

    They are those at the drive's frequency or, if larger, those of its ringing with the inductance in series.
    """
    driver, motor = plant.front, plant.motor
    volts = max(driver.amplitude(group) for group in GROUPS)
    amperes = {}
    for group in GROUPS:
        charged = max(motor.piezo.capacitance_f(group), 1e-12)
        amperes[group] = 2.0 * pi * driver.frequency * charged * driver.amplitude(group)
        if rings := driver.ringing(motor, group):
            amperes[group] = max(amperes[group], driver.amplitude(group) * sqrt(rings[1] / rings[0]))
    stores = []
    for store in plant.stores:
        group = store.instance[-1]
        of_primary = driver.ratio(group) if store.start in PRIMARY else 1.0
        stores.append(amperes[group] * of_primary if store.coil else volts)
    plates = len(plant.states) - plant.inner
    return np.array([*start_point(plant).scale, *(volts,) * plates, *stores])


def _measured(setup: Point, copy: Copy, period_map: PeriodMap) -> tuple[dict[str, float], Copy]:
    """Return the means of a copy over the period of a map, as :func:`.means`, and the copy a period later."""
    plant = copy.plant
    bench = Dynamometer(setup.with_step(period_map.step), period_map.period)
    vectors = [*bench.integrals(meters=True), *bench.setup.state_vectors(), *(ammeter(group) for group in "ab")]
    inside = {one: _inside(one) for one in vectors}
    raw, trace, window = period_map.metered(copy, list(inside.values()))
    start, end = ({one: float(raw[own][at]) for one, own in inside.items()} for at in (window.start, window.stop - 1))
    integrals = bench.means({one: end[one] - start[one] for one in end})
    peaks = {group: float(np.abs(raw[inside[ammeter(group)]][window]).max()) for group in "ab"}
    block = Block(bench, integrals, peaks, bench.setup.motion(start), bench.setup.motion(end), bench.duration, "")
    found = metered([block]) | strength.peak_of_motion(plant.motor, modal(plant, trace)[0])
    found["speed"] = float(np.mean(speed(plant, trace)[1:]))
    worn = rubbing(plant, trace, period_map.discretisation, found["work"] - found["given"])
    for at, (one, rubbed) in enumerate(zip(plant.motor.touching, worn, strict=True)):
        found[f"normal_{at}"] = float(trace.normal[at, 1:].mean())
        found[f"touching_{at}"] = integrals[f"xcontactmeter{one.suffix}.v_contact"]
        found[f"greatest_{at}"] = float(trace.normal[at].max()) / one.multiplicity
        found[f"rubbing_{at}"] = rubbed
    for group in GROUPS:
        volts, amperes = (trace.pins[name][1:] for name in (f"v({group})", groups.current("pin", group)))
        found |= fundamental(group, trace.time[1:], 1.0 / plant.drive.period, volts, amperes)
    later = interpolated(trace.time, trace.states, plant.begins * plant.drive.period + period_map.period)
    return found, replace(copy, state=later)
