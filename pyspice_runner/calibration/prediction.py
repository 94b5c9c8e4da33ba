# SPDX-License-Identifier: GPL-3.0-or-later
"""What a motor would show at the measured points and in the measured spectra, and how that depends on its parameters.

The values are those of a fast model, with the difference to ngspice that :meth:`Predictor.refine` takes at one set of
parameters. The search is repeated until this difference stays the same; so its result is that of ngspice, and its cost
that of the fast model.

The fast model of a spectrum is its closed form (:meth:`.Stator.admittance`), that of a run-up the averaged
motor (:mod:`.run_up`), that of a point is harmonic balance (:mod:`~pyspice_runner.steady.balanced`). Where that has
no solution, or is far from ngspice, it is ngspice itself at a coarse step: all points of many motors are one call of
:func:`~pyspice_runner.steady.steady.steady_states`, and a perturbed motor starts from the solution of the unperturbed
one, with the derivative of its period map.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.calibration.conditions import Condition, added, at_conditions, warmed
from pyspice_runner.calibration.points import PHASES, POWER, RESONANCE, SPEED, Points, measured_of, span
from pyspice_runner.calibration.resonance import Peak, near_hz, peaks
from pyspice_runner.calibration.run_up import RunUp
from pyspice_runner.calibration.unknowns import THERMAL, Unknown
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.impedance.spectrum import Connection, Spectrum, State, connect
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.point import Point as OperatingPoint
from pyspice_runner.run.two_port import sweep_two_port, two_port, two_port_bench
from pyspice_runner.run.waveforms import Array
from pyspice_runner.steady.balanced import QUANTITIES, BalancedState, balanced_states, balances
from pyspice_runner.steady.harmonic_balance import Balance
from pyspice_runner.steady.shooting import Point
from pyspice_runner.steady.steady import SteadyState, steady_states

# of a coordinate, for the derivative. The torque by ngspice varies from event to event of a step (2e-3 of mu F0 R), and
# a run-up with the steps that an estimated error selects (3e-5 of the speed): the coarse difference changes both more,
# and their curvature stays small. Harmonic balance is smooth
COARSE_DIFFERENCE, DIFFERENCE = 0.05, 0.002
ACCURACY = 2e-3  # of the friction torque, where the coarse step is compared with finer ones
FAR = 0.2  # of the span of a quantity: another motion, or one that the harmonics do not describe
STEP = 0.9  # of the default: the steps stay those of the first motor while its stiffness grows by a fifth
SPECTRUM_ERROR = 0.01  # relative error of a measured admittance: that of an impedance analyser with its fixture
SPECTRUM_POINTS = 200  # of a measured spectrum that are compared; its resonances are narrow, so they are chosen there


COLD = Condition()


@dataclass(frozen=True)
class Band:
    """A measured spectrum: what is compared of it."""

    spectrum: Spectrum
    state: State
    connection: Connection
    error: float  # standard error, relative to |Y|
    measured: Array  # real and imaginary parts
    condition: Condition = COLD

    @classmethod
    def of(
        cls, spectrum: Spectrum, state: State, connection: Connection, error: float, condition: Condition = COLD
    ) -> Band:
        """Return the comparison of a spectrum with at most :data:`SPECTRUM_POINTS` points."""
        places = np.unique(np.linspace(0, len(spectrum.frequency_hz) - 1, SPECTRUM_POINTS).round().astype(int))
        few = Spectrum(spectrum.frequency_hz[places], spectrum.matrix_s[places], spectrum.source, spectrum.format)
        own = few.driven(connection).matrix_s[:, 0, 0] if few.ports == 2 else few.matrix_s[:, 0, 0]
        return cls(few, state, connection, error, np.concatenate([own.real, own.imag]), condition)

    def errors(self, predicted: Array | None = None) -> Array:
        """Return the standard errors of the measured parts: a share of the predicted magnitude, or of the measured one.

        Shares of measured magnitudes would make values that are low by chance count more. A prediction that is more
        than :data:`_FAR_FACTOR` off has no say yet.
        """
        half = len(self.measured) // 2
        measured = np.hypot(self.measured[:half], self.measured[half:])
        if predicted is None or not np.isfinite(predicted).all():
            magnitude = measured
        else:
            own = np.hypot(predicted[:half], predicted[half:])
            magnitude = np.clip(own, measured / _FAR_FACTOR, measured * _FAR_FACTOR)
        return self.error * np.concatenate([magnitude, magnitude])

    def predicted(self, motor: Motor, *, fine: bool) -> Array:
        """Return the parts of a motor's admittance at the measured frequencies: in closed form, or by ngspice."""
        frequency = self.spectrum.frequency_hz
        if fine:
            own = self._by_ngspice(motor)
        else:
            pressed = self.state == "preloaded"
            stator = motor.pressed_stator if pressed else motor.stator.with_carrier(motor.mount)
            own = connect(stator.admittance(2.0 * pi * frequency), self.connection)
        if self.condition.level_v:
            own = own + added(motor, frequency, self.connection, self.condition.level_v)
        return np.concatenate([own.real, own.imag])

    def _by_ngspice(self, motor: Motor) -> NDArray[np.complex128]:
        """Return the admittance in S, complex."""
        frequency = self.spectrum.frequency_hz
        steps = np.diff(frequency)
        even = np.ptp(steps) < 1e-6 * steps.mean()
        points = len(frequency) if even else _FINE
        bench = two_port_bench(motor, preloaded=self.state == "preloaded")
        found, matrix = two_port(sweep_two_port(bench, None, float(frequency[0]), float(frequency[-1]), points))
        own = connect(matrix, self.connection)
        if not even:
            from scipy.interpolate import CubicSpline  # takes long to load

            own = CubicSpline(found, own)(frequency)
        return np.asarray(own, dtype=complex)


_FAR_FACTOR = 2.0
_FINE = 4001  # points of a sweep from which a spectrum with uneven frequencies is interpolated


@dataclass(frozen=True)
class Prediction:
    """What one motor would show; NaN where it has no steady state."""

    values: Array  # at the measured points, then in the spectra, then of the run-ups
    solutions: tuple[Point | Balance | None, ...] = ()  # of the points
    peaks: Mapping[int, Peak] = field(default_factory=dict)  # by the places of measured resonances
    states: tuple[SteadyState, ...] = ()

    @property
    def known(self) -> bool:
        """Whether anything of it is known."""
        return bool(np.isfinite(self.values).any())


@dataclass
class Predictor:
    """The measured points, spectra and run-ups as a function of the free parameters."""

    base: OperatingPoint  # motor at the start, drive, law and solver
    unknowns: tuple[Unknown, ...]
    points: Points | None
    bands: tuple[Band, ...] = ()
    progress: Callable[[int], None] = lambda _: None
    solved: int = 0  # number of steady states that were computed
    shift: Array | None = None  # of the values at the points by ngspice at fine steps; NaN where it has none
    reference: Prediction | None = None  # by ngspice, where the shift was taken last
    run_ups: tuple[RunUp, ...] = ()
    reference_c: float | None = None  # temperature of the values of the motor; ``None`` where none is stated
    _balanced: bool | None = field(default=None, init=False)  # whether harmonic balance is the fast model

    @property
    def measured(self) -> Array:
        """All measured values."""
        return np.concatenate([self.points.values, *self.compared] if self.points else self.compared)

    @property
    def compared(self) -> list[Array]:
        """Measured values of each spectrum, then of each run-up."""
        return [*(band.measured for band in self.bands), *(one.measured for one in self.run_ups)]

    @property
    def sets(self) -> list[tuple[str, slice]]:
        """Name and places of each set of data: the points, each spectrum, each run-up."""
        names = [self.points.source] if self.points else []
        names += [f"{band.spectrum.source or 'the spectrum'} ({band.state})" for band in self.bands]
        names += [one.source for one in self.run_ups]
        sizes = [len(self.points.values)] if self.points else []
        ends = np.cumsum([0, *sizes, *(len(one) for one in self.compared)]).tolist()
        return [(name, slice(*ends[place : place + 2])) for place, name in enumerate(names)]

    @property
    def errors(self) -> Array:
        """Their standard errors, since the last :meth:`refine` with the magnitudes of the spectra predicted there."""
        parts, place = [], len(self.points.values) if self.points else 0
        for band in self.bands:
            end = place + len(band.measured)
            parts.append(band.errors(self.reference.values[place:end] if self.reference else None))
            place = end
        parts += [one.errors for one in self.run_ups]
        return np.concatenate([self.points.errors, *parts] if self.points else parts)

    def changes(self, x: Array) -> dict[str, float]:
        """Return path → value of the motor for the coordinates of the free parameters."""
        return {path: value for path, value in self._values(x).items() if not path.startswith(THERMAL)}

    def thermal(self, x: Array) -> Thermal:
        """Return the drift for the coordinates of the free parameters."""
        own = {path.removeprefix(THERMAL): value for path, value in self._values(x).items() if path.startswith(THERMAL)}
        return Thermal.of(self.base.motor).model_copy(update=own)

    def _values(self, x: Array) -> dict[str, float]:
        return {unknown.path: unknown.value(float(one)) for unknown, one in zip(self.unknowns, x, strict=True)}

    @property
    def balanced(self) -> bool:
        """Whether harmonic balance is the fast model."""
        if self._balanced is None:
            points = self.points
            self._balanced = (
                points is not None
                and set(points.quantities) <= {*QUANTITIES, POWER, RESONANCE}
                and all(balances(self.point(self.base, conditions)) for conditions in points.conditions)
            )
        return self._balanced

    def point(
        self, motor: OperatingPoint, conditions: Mapping[str, float | None], thermal: Thermal | None = None
    ) -> OperatingPoint:
        """Return a motor at the conditions of a point or run-up; by default with the drift of the first motor."""
        return at_conditions(motor, conditions, thermal or Thermal.of(self.base.motor), self.reference_c)

    def moving(self, run_up: RunUp, x: Array) -> OperatingPoint:
        """Return the motor of a run-up for the coordinates of the free parameters."""
        return self.point(self.base.updated(self.changes(x)), run_up.conditions, self.thermal(x))

    def at(self, vectors: Sequence[Array], near: Prediction | None = None, *, fine: bool = False) -> list[Prediction]:
        """Predict for many sets of coordinates in one call of the model.

        Args:
            vectors: the sets.
            near: a prediction whose solutions are starts.
            fine: whether the values are those of ngspice at fine steps; if not, of the fast model with the last
                :meth:`refine`.
        """
        motors: list[OperatingPoint | None] = []
        setups: list[OperatingPoint] = []
        owners: list[tuple[int, int]] = []
        for number, x in enumerate(vectors):
            try:
                motor = self.base.updated(self.changes(x))
                every = self.points.conditions if self.points else ()
                own = [self.point(motor, conditions, self.thermal(x)) for conditions in every]
            except ParameterError:  # values that do not go together: there is no such motor
                motors.append(None)
                continue
            motors.append(motor)
            setups += own
            owners += [(number, place) for place in range(len(own))]
        starts = [near.solutions[place] if near and near.solutions else None for _, place in owners]
        by_owner = dict(zip(owners, self._solved(setups, starts, fine), strict=True))
        resonances = self._peaks(dict(zip(owners, setups, strict=True)), near, fine)
        found = [
            self._prediction(number, motor, self.thermal(x), by_owner, resonances, fine)
            for number, (motor, x) in enumerate(zip(motors, vectors, strict=True))
        ]
        if self.shift is None or fine:
            return found
        return [replace(one, values=one.values + self.shift) for one in found]

    def _solved(
        self, setups: Sequence[OperatingPoint], starts: Sequence[Point | Balance | None], fine: bool
    ) -> Sequence[SteadyState | BalancedState | None]:
        """Return steady states by the fast model, or with ``fine`` by ngspice at fine steps."""
        if not setups:
            return []
        states: Sequence[SteadyState | BalancedState | None]
        if self.balanced and not fine:
            states = balanced_states(setups, [start if isinstance(start, Balance) else None for start in starts])
        else:
            own = [start if isinstance(start, Point) else None for start in starts]
            states = steady_states(setups, accuracy=ACCURACY if fine else None, starts=own)
        self.solved += len(states)
        self.progress(self.solved)
        return states

    def _peaks(
        self, setups: Mapping[tuple[int, int], OperatingPoint], near: Prediction | None, fine: bool
    ) -> dict[tuple[int, int], Peak]:
        """Return the resonances by number of the motor and place of the measured one, each next to a known one.

        With ``fine`` they are those that the fast model found in ``near``.
        """
        points = self.points
        if points is None or RESONANCE not in points.quantities:
            return {}
        own = [place for place, quantity in enumerate(points.quantities) if quantity == RESONANCE]
        known = near.peaks if near else {}
        known = {place: peak for place, peak in known.items() if np.isfinite(peak.frequency_hz)}
        numbers = dict.fromkeys(number for number, _ in setups)
        asked = [(number, place) for number in numbers for place in own if place in known or not fine]
        starts = [known.get(place) or Peak(float(points.values[place])) for _, place in asked]
        distances = [
            near_hz(self.point(self.base, points.conditions[points.rows[place]]), float(points.values[place]))
            for _, place in asked
        ]

        def solve(asked: list[OperatingPoint], starts: list[Any]) -> list[tuple[float, Any]]:
            found = self._solved(asked, starts, fine)
            return [
                (measured_of(_values(state), POWER), state.solution) if state and _sound(state) else (np.nan, None)
                for state in found
            ]

        found = peaks(
            [setups[number, points.rows[place]] for number, place in asked], starts, distances, solve, fresh=not known
        )
        none = {(number, place): Peak(float("nan")) for number in numbers for place in own}
        return none | dict(zip(asked, found, strict=True))

    def refine(self, x: Array, near: Prediction | None = None) -> Prediction:
        """Take the difference between ngspice at fine steps and the fast model here; return the former's values."""
        self.shift = None
        (fast,) = self.at([x], near)
        (fine,) = self.at([x], replace(self.reference or fast, peaks=fast.peaks), fine=True)
        if self.balanced and self._far(fast, fine):
            self._balanced = False
            (fast,) = self.at([x], fine)
        self.shift, self.reference = fine.values - fast.values, fine
        return replace(fine, solutions=fast.solutions, peaks=fast.peaks)

    def _far(self, fast: Prediction, fine: Prediction) -> bool:
        """Whether a value by the fast model is missing, or farther from that by ngspice than :data:`FAR`."""
        assert self.points is not None
        names = np.array(self.points.quantities)
        for name in self.points.quantities:
            own = np.flatnonzero(names == name)
            there = own[np.isfinite(fine.values[own])]
            size = span(name, fine.values[there])
            if not np.all(np.abs(fast.values[there] - fine.values[there]) <= FAR * size):
                return True
        return False

    def _prediction(
        self,
        number: int,
        motor: OperatingPoint | None,
        thermal: Thermal,
        states: Mapping[tuple[int, int], SteadyState | BalancedState | None],
        resonances: Mapping[tuple[int, int], Peak],
        fine: bool,
    ) -> Prediction:
        if motor is None:
            return Prediction(np.full(len(self.measured), np.nan))
        parts: list[Array] = []
        own: tuple[SteadyState | BalancedState | None, ...] = ()
        resonant = {place: peak for (one, place), peak in resonances.items() if one == number}
        if points := self.points:
            own = tuple(states[number, place] for place in range(len(points)))
            parts.append(np.array([
                resonant[place].frequency_hz if quantity == RESONANCE
                else measured_of(_values(own[row]), quantity, measured) if _sound(own[row]) else np.nan
                for place, (row, quantity, measured) in
                enumerate(zip(points.rows, points.quantities, points.values.tolist(), strict=True))
            ]))  # fmt: skip
        parts += [_or_unknown(partial(self._admittance, band, motor, thermal, fine), band.measured)
                  for band in self.bands]  # fmt: skip
        parts += [_or_unknown(partial(self._run_up, one, motor, thermal, fine), one.measured) for one in self.run_ups]
        solutions = tuple(state.solution if state and _sound(state) else None for state in own)
        kept = tuple(replace(state, solution=None) for state in own if isinstance(state, SteadyState))
        return Prediction(np.concatenate(parts), solutions, resonant, kept)

    def _admittance(self, band: Band, motor: OperatingPoint, thermal: Thermal, fine: bool) -> Array:
        warm = warmed(motor, band.condition.temperature, thermal, self.reference_c)
        return band.predicted(warm.motor, fine=fine)

    def _run_up(self, run_up: RunUp, motor: OperatingPoint, thermal: Thermal, fine: bool) -> Array:
        return run_up.predicted(self.point(motor, run_up.conditions, thermal), fine=fine)

    def jacobian(self, x: Array, here: Prediction, *, central: bool = False) -> Array:
        """Return the derivative of the predicted values; 0 where it is not known.

        Central differences take twice the time and have no error by the curvature.
        """
        fast = self.points is None or self.balanced
        slope = self._differences(x, here, DIFFERENCE if fast else COARSE_DIFFERENCE, central)
        if fast and self.run_ups:
            moving = replace(self, points=None, bands=(), shift=None)
            first = len(slope) - len(moving.measured)
            own = Prediction(here.values[first:] - (0.0 if self.shift is None else self.shift[first:]))
            slope[first:] = moving._differences(x, own, COARSE_DIFFERENCE, central)
        return slope

    def _differences(self, x: Array, here: Prediction, size: float, central: bool) -> Array:
        """Return difference quotients with a change of each coordinate."""
        forward = np.array([1.0 if one + size <= unknown.bounds[1] else -1.0
                            for unknown, one in zip(self.unknowns, x, strict=True)])  # fmt: skip
        steps = size * np.diag(forward)
        near = self.at([*(x + steps), *(x - steps if central else ())], here)
        columns = []
        for place, sign in enumerate(forward):
            there = near[place].values
            back = near[len(x) + place].values if central else here.values
            one_sided = (there - here.values) / (sign * size)
            both = (there - back) / (2.0 * sign * size)
            columns.append(np.where(np.isfinite(both), both, one_sided) if central else one_sided)
        return np.asarray(np.nan_to_num(np.array(columns).T, nan=0.0))


def _or_unknown(predicted: Callable[[], Array], measured: Array) -> Array:
    """Return predicted values; NaN for a motor that does not exist at the temperature, or has no such run."""
    try:
        return predicted()
    except (ParameterError, SimulationError):
        return np.full(len(measured), np.nan)


def _sound(state: SteadyState | BalancedState | None) -> bool:
    """Whether a steady state is determined.

    Of a balanced motion this is not known; :meth:`Predictor.refine` leaves out what ngspice refuses.
    """
    return state.determined if isinstance(state, SteadyState) else state is not None


def _values(state: SteadyState | BalancedState | None) -> Mapping[str, float]:
    """Return the quantities of a state by name."""
    if isinstance(state, SteadyState):
        return {**state.quantities, **{name: getattr(state, name) for name in (SPEED, *PHASES)}}
    return state.values if state else {}
