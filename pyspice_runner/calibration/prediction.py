# SPDX-License-Identifier: GPL-3.0-or-later
"""What a motor would show at the measured points and in the measured spectra, and how that depends on its parameters.

The values are those of a fast model, with the difference to ngspice that :meth:`Predictor.refined` takes at one set of
parameters. The search is repeated until this difference stays the same; so its result is that of ngspice, and its cost
that of the fast model.

The fast model of a spectrum is its closed form (:meth:`.Stator.admittance`), that of a run-up the averaged
motor (:mod:`.run_up`), that of a point is harmonic balance (:func:`.balanced_states`). Where that has
no solution, or is far from ngspice, it is ngspice itself at a coarse step: all points of many motors are one call of
:func:`~pyspice_runner.steady.steady.steady_states`, and a perturbed motor starts from the solution of the unperturbed
one, with the derivative of its period map.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pyspice_runner.calibration.points import (
    CURRENT,
    PHASES,
    POWER,
    RESONANCE,
    SPEED,
    TEMPERATURE,
    Curve,
    Points,
    measured_of,
    span,
)
from pyspice_runner.calibration.unknowns import THERMAL, Unknown
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array
from pyspice_runner.steady import shooting
from pyspice_runner.steady.harmonic_balance import QUANTITIES, Balance, BalancedState, balanced_states, balances
from pyspice_runner.steady.steady import ACCURACY, SteadyState, check_runs, steady_states

# of a coordinate, for the derivative. The torque by ngspice varies from event to event of a step (2e-3 of mu F0 R), and
# a run-up with the steps that an estimated error selects (3e-5 of the speed): the coarse difference changes both more,
# and their curvature stays small. Harmonic balance is smooth
COARSE_DIFFERENCE, DIFFERENCE = 0.05, 0.002
LARGEST_DIFFERENCE = 0.2  # of the span of a quantity: another motion, or one that the harmonics do not describe
SLOPED = 0.1  # error of a time average over its distance from the periodic motion, up to which it has a derivative
STEP = 0.9  # of the default: the steps stay those of the first motor while its stiffness grows by a fifth
NEAR = 0.125  # distance of the last three frequencies at a resonance, in bandwidths of the nearest mode
ROUNDS = 12  # of three frequencies
_FARTHEST = 4.0  # step to the next middle one, in their distance
_CENTRED = 0.03  # distance of the vertex from the middle one, likewise, at the end

State = SteadyState | BalancedState | None
Solution = shooting.Orbit | Balance | None


class Peak:
    r"""The resonance of a running motor, the drive frequency of maximum electrical power, and the search for it.

    A bench finds it by a sweep of the drive frequency at constant voltages, with the load or the speed of the point.
    Here three frequencies are solved at a time. The reciprocal of the power at a resonance is a parabola over the
    frequency, :math:`1/P \propto (f - f_0)^2 + w^2`, so its vertex is the next middle one, until the vertex lies
    between them. The last distance of the three is the same in every search, so that its error drops out of
    differences.
    """

    def __init__(self, setup: Point, first: Point, measured_hz: float, known: Peak | None, *, fresh: bool) -> None:
        """Take the point, as set up now and with the first motor, and where to start; ``fresh`` from farther away."""
        mode = min(first.motor.modes, key=lambda mode: abs(mode.frequency_hz - measured_hz))
        self.setup, self.near = setup, NEAR * mode.frequency_hz / mode.quality_factor
        self.distance = (2.0 if fresh else 1.0) * self.near
        self.middle = known.frequency_hz if known else measured_hz
        self.solution: Solution = known.solution if known else None  # at the middle frequency of the last three
        self.frequency_hz: float = np.nan  # where none was found
        self.done = False

    @property
    def setups(self) -> list[Point]:
        """The points at the three frequencies."""
        return [self.setup.updated({"drive.frequency": self.middle + sign * self.distance}) for sign in (-1, 0, 1)]

    def take(self, solved: Sequence[State]) -> None:
        """Take the states at the three frequencies."""
        powers = np.array([measured_of(_values(one), POWER) if one else np.nan for one in solved])
        if not np.all(powers > 0.0):  # one of them is not known
            self.done = True
            return
        self.solution = solved[1].solution if solved[1] else None
        below, here, above = 1.0 / powers
        curvature = below - 2.0 * here + above
        between = here <= min(below, above)
        vertex = 0.5 * (below - above) / curvature if curvature > 0.0 else float(np.sign(below - above)) * _FARTHEST
        step = float(np.clip(vertex, -_FARTHEST, _FARTHEST))
        self.middle += step * self.distance
        if between and self.distance == self.near:
            self.frequency_hz, self.done = self.middle, abs(step) <= _CENTRED
        self.distance = self.near if between else self.distance


@dataclass(frozen=True)
class Prediction:
    """What one motor would show; NaN where it has no steady state."""

    values: Array  # at the measured points, then of the curves
    solutions: tuple[Solution, ...] = ()  # of the points
    peaks: Mapping[int, Peak] = field(default_factory=dict)  # by the places of measured resonances
    scatter: Array | float = 0.0  # errors of values that are time averages, 0 for other values

    @property
    def known(self) -> bool:
        """Whether anything of it is known."""
        return bool(np.isfinite(self.values).any())


@dataclass
class Counter:
    """The number of steady states that were computed."""

    progress: Callable[[int], None] = lambda _: None
    solved: int = 0

    def add(self, number: int) -> None:
        """Count further ones."""
        self.solved += number
        self.progress(self.solved)


@dataclass(eq=False)
class _Trial:
    """A motor with its points; ``motor`` is ``None`` where values do not go together."""

    motor: Point | None
    thermal: Thermal
    setups: list[Point]
    states: Sequence[State] = ()
    peaks: dict[int, Peak] = field(default_factory=dict)


@dataclass(frozen=True)
class Predictor:
    """The measured points and curves as a function of the coordinates of the free parameters."""

    base: Point  # motor at the start, drive, law and solver
    unknowns: tuple[Unknown, ...]
    points: Points | None
    curves: tuple[Curve, ...] = ()
    reference_c: float | None = None  # temperature of the values of the motor; ``None`` where none is known
    motor_of: Callable[[Point, Mapping[str, float]], Point] = Point.updated  # of the motor at the start and values
    counter: Counter = field(default_factory=Counter)
    shift: Array | None = None  # of the values by ngspice at fine steps; NaN where it has none
    tilt: Array | None = None  # derivative of the shift of time averages; the fast model has the periodic motion
    origin: Array | float = 0.0  # coordinates where both were taken
    reference: Prediction | None = None  # by ngspice there
    harmonic: bool = True  # whether harmonic balance is close to ngspice

    @cached_property
    def measured(self) -> Array:
        """All measured values."""
        return np.concatenate([*([self.points.values] if self.points else ()), *(one.measured for one in self.curves)])

    @cached_property
    def sets(self) -> list[tuple[Points | Curve, slice]]:
        """The points, then each curve, with the places of its values."""
        every: list[Points | Curve] = [*([self.points] if self.points else []), *self.curves]
        ends = np.cumsum([0, *(len(one.errors) for one in every)]).tolist()
        return list(zip(every, map(slice, ends, ends[1:]), strict=True))

    @cached_property
    def errors(self) -> Array:
        """Standard errors of the measured values, once refined with those of predicted time averages.

        Those of spectra are by the magnitudes predicted there.
        """
        predicted = self.reference.values if self.reference else np.full(len(self.measured), np.nan)
        errors = np.concatenate([
            one.errors_at(predicted[own]) if isinstance(one, Curve) else one.errors for one, own in self.sets
        ])  # fmt: skip
        return np.hypot(errors, self.reference.scatter) if self.reference else errors

    @cached_property
    def balanced(self) -> bool:
        """Whether harmonic balance is the fast model of the points."""
        return (
            self.harmonic
            and self.points is not None
            and set(self.points.quantities) <= {*QUANTITIES, POWER, CURRENT, RESONANCE}
            and all(balances(self.point(self.base, conditions)) for conditions in self.points.conditions)
        )

    @property
    def rough(self) -> bool:
        """Whether the fast model of the points is ngspice at a coarse step, whose values vary from event to event."""
        return self.points is not None and not self.balanced

    def values(self, x: Array) -> dict[str, float]:
        """Return path → value of the free parameters for their coordinates."""
        return {unknown.path: unknown.value(float(one)) for unknown, one in zip(self.unknowns, x, strict=True)}

    def thermal(self, x: Array) -> Thermal:
        """Return the drift for the coordinates of the free parameters."""
        own = {path.removeprefix(THERMAL): value for path, value in self.values(x).items() if path.startswith(THERMAL)}
        return Thermal.of(self.base.motor).model_copy(update=own)

    def motor(self, x: Array) -> Point:
        """Return the motor for the coordinates. Raise ParameterError for values that do not go together."""
        own = {path: value for path, value in self.values(x).items() if not path.startswith(THERMAL)}
        return self.motor_of(self.base, own)

    def point(self, motor: Point, conditions: Mapping[str, float | None], thermal: Thermal | None = None) -> Point:
        """Return a motor at the conditions of a point or curve, by default with the drift of the first motor."""
        temperature = conditions.get(TEMPERATURE)
        if temperature is not None and self.reference_c is not None and temperature != self.reference_c:
            thermal = thermal or Thermal.of(self.base.motor)
            motor = replace(motor, motor=thermal.warmed(motor.motor, temperature - self.reference_c))
        return motor.updated({path: value for path, value in conditions.items() if path != TEMPERATURE})

    def at(self, vectors: Sequence[Array], near: Prediction | None = None, *, fine: bool = False) -> list[Prediction]:
        """Predict for many sets of coordinates in one call of the model.

        Args:
            vectors: the sets.
            near: a prediction whose solutions are starts.
            fine: whether the values are those of ngspice at fine steps; if not, of the fast model with the shift.
        """
        trials = [self._trial(x) for x in vectors]
        setups = [setup for trial in trials for setup in trial.setups]
        starts = near.solutions if near and near.solutions else (None,) * len(self.points or ())
        states = iter(self._solved(setups, [*starts] * (len(setups) // max(len(starts), 1)), fine))
        for trial in trials:
            trial.states = [next(states) for _ in trial.setups]
        self._find_peaks([trial for trial in trials if trial.setups], near, fine)
        found = [self._prediction(trial, fine) for trial in trials]
        if self.shift is None or fine:
            return found
        return [
            replace(one, values=one.values + self.shift + (0.0 if self.tilt is None else self.tilt @ (x - self.origin)))
            for x, one in zip(vectors, found, strict=True)
        ]

    def _trial(self, x: Array) -> _Trial:
        thermal = self.thermal(x)
        try:
            motor = self.motor(x)
            every = self.points.conditions if self.points else ()
            return _Trial(motor, thermal, [self.point(motor, conditions, thermal) for conditions in every])
        except ParameterError:
            return _Trial(None, thermal, [])

    def _solved(self, setups: Sequence[Point], starts: Sequence[Solution], fine: bool) -> Sequence[State]:
        """Return steady states by the fast model, or with ``fine`` by ngspice at fine steps; ``None`` without one.

        Whether a balanced motion is determined is not known; :meth:`refined` leaves out what ngspice refuses.
        """
        if not setups:
            return []
        states: Sequence[State]
        if self.balanced and not fine:
            states = balanced_states(setups, [start if isinstance(start, Balance) else None for start in starts])
        else:
            own = [start if isinstance(start, shooting.Orbit) else None for start in starts]
            full = steady_states(setups, accuracy=ACCURACY if fine else None, starts=own)
            if fine:
                check_runs(full)
            # where the motion is unstable the fast model has the periodic one, and the shift leads to the time average
            states = [
                state if state.determined or (not fine and state.converged and not state.held_by_friction) else None
                for state in full
            ]
        self.counter.add(len(states))
        return states

    def _find_peaks(self, trials: Sequence[_Trial], near: Prediction | None, fine: bool) -> None:
        """Find the resonances of the trials, each next to a known one, with ``fine`` those of ``near``."""
        points = self.points
        if points is None or RESONANCE not in points.quantities:
            return
        own = [place for place, quantity in enumerate(points.quantities) if quantity == RESONANCE]
        known = {place: peak for place, peak in (near.peaks if near else {}).items() if np.isfinite(peak.frequency_hz)}
        for trial in trials:
            for place in [place for place in own if place in known or not fine]:
                row, measured = points.rows[place], float(points.values[place])
                first = self.point(self.base, points.conditions[row])
                trial.peaks[place] = Peak(trial.setups[row], first, measured, known.get(place), fresh=not known)
        for _ in range(ROUNDS):
            active = [peak for trial in trials for peak in trial.peaks.values() if not peak.done]
            starts = [peak.solution for peak in active for _ in range(3)]
            states = self._solved([setup for peak in active for setup in peak.setups], starts, fine)
            for number, peak in enumerate(active):
                peak.take(states[3 * number : 3 * number + 3])

    def refined(self, x: Array, near: Prediction | None = None) -> tuple[Predictor, Prediction]:
        """Return the predictor with the difference between ngspice at fine steps and the fast model here.

        The prediction is that of ngspice, with the solutions of the fast model.
        """
        plain = replace(self, shift=None, tilt=None)
        (fast,) = plain.at([x], near)
        (fine,) = plain.at([x], replace(self.reference or fast, peaks=fast.peaks), fine=True)
        if self.balanced and self._far(fast, fine):
            plain = replace(plain, harmonic=False)
            (fast,) = plain.at([x], fine)
        shift = fine.values - fast.values
        tilt = plain._tilt(x, shift, fast, fine)
        found = replace(plain, shift=shift, tilt=tilt, origin=x, reference=fine)
        return found, replace(fine, solutions=fast.solutions, peaks=fast.peaks)

    def _tilt(self, x: Array, shift: Array, fast: Prediction, fine: Prediction) -> Array | None:
        """Return the derivative of the shift where time averages are known well enough, 0 elsewhere."""
        sloped = (fine.scatter > 0.0) & (fine.scatter <= SLOPED * np.abs(shift))
        if not np.any(sloped):
            return None
        steps = self._steps(x, COARSE_DIFFERENCE)
        pairs = zip(self.at([*(x + steps)], fast), self.at([*(x + steps)], fine, fine=True), strict=True)
        changes = np.array([there.values - near.values - shift for near, there in pairs]).T / steps.sum(axis=1)
        return np.where(sloped[:, None], np.nan_to_num(changes, nan=0.0), 0.0)

    def _steps(self, x: Array, size: float) -> Array:
        """Return a change of each coordinate within its bounds, as rows."""
        forward = [unknown.sharp * (1.0 if one + size <= unknown.bounds[1] else -1.0)
                   for unknown, one in zip(self.unknowns, x, strict=True)]  # fmt: skip
        return size * np.diag(forward)

    def _far(self, fast: Prediction, fine: Prediction) -> bool:
        """Whether a point by the fast model is missing, or too far off where the periodic motion is stable."""
        assert self.points is not None
        names = np.array(self.points.quantities)
        known = (np.isfinite(fine.values) & (fine.scatter == 0.0))[: len(names)]
        for name in self.points.quantities:
            there = np.flatnonzero((names == name) & known)
            size = span(name, fine.values[there])
            if not np.all(np.abs(fast.values[there] - fine.values[there]) <= LARGEST_DIFFERENCE * size):
                return True
        return False

    def _prediction(self, trial: _Trial, fine: bool) -> Prediction:
        """Return the values of a trial. With ``fine``, raise the error of a curve if no value is known."""
        if trial.motor is None:
            return Prediction(np.full(len(self.measured), np.nan))
        parts, states, scatter = [], trial.states, np.zeros(len(self.measured))
        if points := self.points:
            own = np.array([
                trial.peaks[place].frequency_hz if place in trial.peaks
                else measured_of(_values(state), quantity, measured) if quantity != RESONANCE and (state := states[row])
                else np.nan
                for place, (row, quantity, measured) in
                enumerate(zip(points.rows, points.quantities, points.values.tolist(), strict=True))
            ])  # fmt: skip
            if points.logarithmic:  # of the other sign there is none
                own = points.signs * own
                own = np.log(np.where(own > 0.0, own, np.nan))
            parts.append(own)
            shares = [_scatter(states[row], name) for row, name in zip(points.rows, points.quantities, strict=True)]
            scatter[: len(own)] = np.nan_to_num(np.multiply(shares, 1.0 if points.logarithmic else np.abs(own)))
        lost: ParameterError | SimulationError | None = None
        for one in self.curves:
            try:
                parts.append(one.predicted(self.point(trial.motor, one.conditions, trial.thermal), fine=fine))
            except (ParameterError, SimulationError) as error:  # no such motor at the temperature, or no such run
                parts.append(np.full(len(one.measured), np.nan))
                lost = error
        if fine and lost is not None and np.isnan(np.concatenate(parts)).all():
            raise lost
        solutions = tuple(state.solution if state else None for state in states)
        return Prediction(np.concatenate(parts), solutions, trial.peaks, scatter)

    def jacobian(self, x: Array, here: Prediction, *, central: bool = False) -> Array:
        """Return the derivative of the predicted values; 0 where it is not known.

        Central differences take twice the time and have no error by the curvature.
        """
        sizes = COARSE_DIFFERENCE, DIFFERENCE
        slope = self._differences(x, here, sizes[not self.rough], central)
        other = [(one, own) for one, own in self.sets if isinstance(one, Curve) and one.smooth == self.rough]
        for curve, own in other:  # with the other size
            alone = replace(self, points=None, curves=(curve,), shift=None, tilt=None)
            values = here.values[own] - (0.0 if self.shift is None else self.shift[own])
            slope[own] = alone._differences(x, Prediction(values), sizes[curve.smooth], central)
        return slope

    def _differences(self, x: Array, here: Prediction, size: float, central: bool) -> Array:
        """Return difference quotients with a change of each coordinate."""
        steps = self._steps(x, size)
        near = np.array([one.values for one in self.at([*(x + steps), *(x - steps if central else ())], here)])
        length = steps.sum(axis=1)[:, None]
        found = (near[: len(x)] - here.values) / length
        if central:
            both = (near[: len(x)] - near[len(x) :]) / (2.0 * length)
            found = np.where(np.isfinite(both), both, found)
        return np.asarray(np.nan_to_num(found.T, nan=0.0))


def _scatter(state: State, quantity: str) -> float:
    """Return the error of a time average relative to the torque, or to the friction torque; 0 for other values."""
    if not isinstance(state, SteadyState) or state.stable or not state.reached or quantity == RESONANCE:
        return 0.0
    contact = state.motor.contact
    torque = contact.friction * contact.preload_n * state.motor.rotor.radius_m
    return state.torque_error_n_m / (abs(state.torque_n_m) if quantity == "torque_n_m" else torque)


def _values(state: SteadyState | BalancedState) -> Mapping[str, float]:
    """Return the quantities of a state by name."""
    if isinstance(state, SteadyState):
        return {**state.quantities, **{name: getattr(state, name) for name in (SPEED, *PHASES)}}
    return state.values
