# SPDX-License-Identifier: GPL-3.0-or-later
r"""Calibration: the parameters of a motor from measured operating points and spectra.

With the coordinates x of the free parameters (:class:`~.unknowns.Unknown`), the residuals are
:math:`r_i = (f_i(x) - y_i)/\sigma_i` of each measured value, and :math:`x_j/w_j` of what was known before, at
least the order of magnitude. Least
squares with Huber's loss find x: beyond :data:`OUTLIER` standard errors a residual counts linearly, so that a wrong
reading cannot pull the values away. With the weights :math:`W` of the loss, the covariance is
:math:`s^2 (J^T W J)^{-1}`, where s = 1 for stated errors, and the RMS residual otherwise.

The intervals are those of the profile likelihood: the value moves until the sum of squares, minimised over all other
parameters, has grown by 3.84 s². The other parameters follow by Gauss and Newton's method, with a Jacobian that
Broyden's rule keeps up to date. All parameters and both sides share the calls of steady states.

P. J. Huber, "Robust Statistics", Wiley 1981; D. M. Bates, D. G. Watts, "Nonlinear Regression Analysis and Its
Applications", Wiley 1988, ch. 6, for profiles.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import log, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import SkipValidation
from scipy.optimize import least_squares
from scipy.stats import qmc

from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model.drive import Drive, default_drive
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.contact import ContactLaw, touching_law
from pyspice_runner.run.operating_point import OperatingPoint
from pyspice_runner.run.waveforms import Array
from pyspice_runner.spectra.spectrum import Connection
from pyspice_runner.study.calibration.checkpoint import Checkpoint
from pyspice_runner.study.calibration.conditions import conditions_of, scales, temperatures_of
from pyspice_runner.study.calibration.decisive import advice, informations
from pyspice_runner.study.calibration.misfit import FAR, SetFit, fits_of, huber, misfits, weights_of
from pyspice_runner.study.calibration.points import DEFAULT_ERROR, read_points
from pyspice_runner.study.calibration.prediction import SPECTRUM_ERROR, STEP, Band, Prediction, Predictor
from pyspice_runner.study.calibration.result import Calibration, Estimate, Rival
from pyspice_runner.study.calibration.run_up import run_ups
from pyspice_runner.study.calibration.unknowns import THERMAL, unknowns_of

RISE = 3.8415  # of the sum of squares at the end of a 95 % interval: chi-squared with one degree of freedom
WIDE = log(10.0)  # a factor of 10 in the value: longest step of a profile, and what is always known of a value
ROUNDS = 6  # computations of the sum of squares at each end of a profile, most of them for curved valleys
IDENTIFIED = 0.25  # largest relative standard error by the data of a value that they identify
_MOST_TOLD = 10  # outliers that are named
START_REACH = log(2.0)  # of further starts about the first
_MOST_STEPS = 40
_INSIDE = 0.05  # of a start at its bound: scipy's first step is as long as the start is from 0, which is in the middle
# Steps of the search. Beyond the long one (of a smooth model: the short one) there is a new Jacobian; below the short
# one the differences of ngspice are noise.
_LONG, _SHORT = 0.1, 0.025
# of the sum of squares by a further step, by a smooth model and by ngspice: 0.1 and 0.3 standard errors
_GAIN, _ROUGH_GAIN = 0.01, 0.1
_NORMAL = 1.4826  # standard deviation over the median of the magnitudes
_CLOSE = 1e-4  # relative gain of the sum of squares, and step of a coordinate, that are noise
_REFINEMENTS = 5  # searches by the fast model, each with its difference to ngspice where the last one ended
_FARTHEST = 0.3  # step of the other parameters of a profile, in coordinates
_LEAST = 0.05  # of the rise, below which a profile counts as flat
_SETTLED = 0.1  # gain where the difference to ngspice was taken anew, by whose accuracy it varies that much


@checked
def calibrate(
    motor: Motor,
    data: SkipValidation[str | Path | Mapping[str, Any] | Any] = None,
    *,
    free: Sequence[str],
    spectra: SkipValidation[Sequence[tuple[Any, ...]]] = (),
    connection: Connection = "A",
    spectrum_error: float = SPECTRUM_ERROR,
    transients: SkipValidation[Sequence[Any]] = (),
    priors: Mapping[str, float] | None = None,
    drive: Drive | None = None,
    contact: ContactLaw | None = "spring-slider",
    against: Sequence[ContactLaw] = (),
    starts: int = 1,
    timeout: float | None = None,
    progress: Callable[[int], None] | None = None,
    checkpoint: str | Path | None = None,
) -> Calibration:
    """Calibrate parameters of a motor against measured operating points, spectra and run-ups.

    Args:
        motor: the motor, with the values to start from.
        data: the measured points: path of a CSV file, a dictionary of columns or a pandas table (:mod:`.points`);
            ``None`` without points.
        free: dotted paths of the parameters to calibrate; ``modes.*.quality_factor`` stands for each mode's.
        spectra: measured spectra with the state of the tip, ``"free"`` or ``"preloaded"``, and with
            ``{"temperature": °C, "level": V}``, or one of these, where it is known (:mod:`.conditions`).
        connection: of the groups in the spectra.
        spectrum_error: standard error of a measured admittance, relative to its magnitude.
        transients: measured run-ups from rest, each a table like ``data`` with ``time_s`` (:mod:`.run_up`).
        priors: path of a free parameter → relative standard deviation of its value in ``motor``, as a soft limit.
        drive: conditions that the points do not state; by default the recommended drive.
        contact: law of the contact, as in :func:`~pyspice_runner.simulate`.
        against: other laws, with which the parameters are calibrated too; ``rivals`` of the result compares them.
        starts: number of starts; all but the first lie within a factor of 2 about the values of ``motor``.
        timeout: wall time in s after which a run of ngspice is ended.
        progress: called with the number of steady states found so far.
        checkpoint: path of a JSON file in which an unfinished calibration is kept. The same calibration, started again
            with it, goes on there. The file is removed at the end.

    Returns:
        The values with standard errors, intervals, correlations and warnings; ``motor`` of it is the calibrated motor.

    Raises:
        ParameterError: for invalid values, unknown paths, no data, or a ``checkpoint`` that is damaged or belongs to
            another calibration.
        KeyboardInterrupt: when interrupted; the message names the ``checkpoint``, if there is one.
        SimulationError: if the motor has no steady state at any of the points, or ngspice fails.
    """
    if data is None and not spectra and not transients:
        raise ParameterError("There is nothing to calibrate against: give measured points, spectra or transients.")
    if not 1 <= starts <= 64:
        raise ParameterError(f"starts = {starts} is not valid: it must be a whole number from 1 to 64.")
    if not 0.0 < spectrum_error < 1.0:
        raise ParameterError(f"spectrum_error = {spectrum_error:g} is not valid: it must be a number > 0 and < 1.")
    points = read_points(data, motor.slider is not None) if data is not None else None
    moving = run_ups(transients, motor.slider is not None)
    laws = [touching_law(one, "A free tip has no torque.") for one in (contact, *against)]
    excitation = drive or default_drive(motor)
    stated = conditions_of(spectra)
    sizes = scales(motor, connection, [condition for *_, condition in stated])
    unknowns = unknowns_of(motor, excitation, free, priors, sizes)
    others = [(f"point {row}", one) for row, one in enumerate(points.conditions if points else (), start=1)]
    others += [(one.source, one.conditions) for one in moving]
    warm = temperatures_of([condition for *_, condition in stated], others)
    if any(one.path.startswith(THERMAL) for one in unknowns) and len(set(warm)) < 2:
        raise ParameterError(
            "A drift takes spectra, points or run-ups at temperatures that differ; state that of each of them."
        )
    bands = tuple(Band.of(spectrum, state, connection, spectrum_error, one) for spectrum, state, one in stated)
    predictors = []
    for law in laws:
        base = OperatingPoint.of(motor, excitation, contact=law, timeout=timeout, audit=False)
        base = base.with_step(STEP * base.step)
        predictor = Predictor(
            base, unknowns, points, bands, progress or (lambda _: None), run_ups=moving,
            reference_c=warm[0] if warm else None,
        )  # fmt: skip
        # a wrong path or value is an error now, not a point that is left out
        if points:
            points.check([predictor.point(base, conditions) for conditions in points.conditions])
        for one in moving:
            one.check(predictor.point(base, one.conditions))
        predictors.append(predictor)
    with Checkpoint(checkpoint, predictors) as kept:
        searches = [_Search(one, kept.place(law), partial(kept.keep, law)) for law, one in enumerate(predictors)]
        found = _calibrated(searches[0], starts)
        return replace(found, rivals=tuple(_rival(search, starts) for search in searches[1:]))


def _calibrated(search: _Search, starts: int) -> Calibration:
    predictor, x = search.predictor, search.solved(starts)
    assert predictor.base.law is not None
    return _Judged(search, x).calibration(str(predictor.base.law.to_dict()["contact"]))


def _rival(search: _Search, starts: int) -> Rival:
    """Return the fit with another law of the contact."""
    assert search.predictor.base.law is not None
    law = str(search.predictor.base.law.to_dict()["contact"])
    try:
        found = _calibrated(search, starts)
    except SimulationError as error:
        return Rival(law, float("nan"), 0, (), str(error))
    return Rival(law, found.aicc, found.freedom, tuple(fit.data for fit in misfits(found.fits)))


class _Found(Exception):
    """The search has found its place: a further step would gain less than :data:`_GAIN` of the sum of squares."""

    def __init__(self, x: Array) -> None:
        super().__init__()
        self.x = x.copy()


class _Search:
    """The search for the least sum of squares; every prediction is computed once."""

    def __init__(self, predictor: Predictor, kept: Array | None, keep: Callable[[Array], None]) -> None:
        self.predictor, self.kept, self.keep = predictor, kept, keep  # place of an interrupted search, and its keeper
        self.measured = predictor.measured
        known = [0.0 if unknown.prior is None else 1.0 / unknown.prior for unknown in predictor.unknowns]
        self.stated_priors = int(np.count_nonzero(known))
        self.prior = np.hypot(
            known, 1.0 / WIDE
        )  # what the data leave open stays at the order of magnitude of its start
        self.found: dict[bytes, Prediction] = {}
        self.slopes: dict[bytes, Array] = {}
        self.last: Prediction | None = None
        self.roots: Array = np.ones(0)  # of the weights of Huber's loss, where the last search began
        self.way: tuple[Array, Array, Array] | None = None  # coordinates, residuals and slope of the last step

    @property
    def errors(self) -> Array:
        """Standard errors of the measured values."""
        return self.predictor.errors

    def solved(self, starts: int) -> Array:
        """Return the coordinates of the least sum of squares.

        Raises:
            SimulationError: if there is no steady state at the start.
        """
        bounds = np.array([unknown.bounds for unknown in self.predictor.unknowns]).T
        x = np.clip(np.zeros(len(self.prior)), bounds[0] + _INSIDE, bounds[1] - _INSIDE)
        if self.kept is not None:
            x = np.clip(self.kept, *bounds)
        elif starts > 1:
            x = self._best(x, bounds, starts)
        for _ in range(_REFINEMENTS):
            here = self.predictor.refine(x, self.prediction(x))
            if not here.known:
                raise SimulationError(
                    "The motor has no steady state at any of the measured points with these values. Check drive and "
                    "load of the points with steady_state, start from other values, or give starts = 16."
                )
            self.keep(x)
            self.found, self.last, self.way = {x.tobytes(): here}, here, None  # slopes are those of the fast model
            residuals = self.residuals(x)
            self.roots = np.sqrt(weights_of(residuals, max(1.0, _NORMAL * float(np.median(np.abs(residuals))))))
            if self._gain(x, self.slope(x), residuals) < (_ROUGH_GAIN if self.rough else _SETTLED):
                break
            try:
                x = np.asarray(least_squares(
                    lambda x: self.roots * self.residuals(x), x, self.descent, bounds=bounds, x_scale="jac",
                    xtol=_CLOSE, ftol=_CLOSE, gtol=1e-12, max_nfev=_MOST_STEPS,
                ).x)  # fmt: skip
            except _Found as found:
                x = found.x
        return x

    def _best(self, x: Array, bounds: Array, starts: int) -> Array:
        """Return the best of several starts."""
        cube = qmc.Sobol(len(x), seed=0).random(1 << (starts - 1).bit_length())[: starts - 1]
        others = [np.clip(x + START_REACH * (2.0 * row - 1.0), *bounds) for row in cube]
        for other, prediction in zip(others, self.predictor.at(others), strict=True):
            self.found[other.tobytes()] = prediction
        every = [one for one in (x, *others) if self.found[one.tobytes()].known]
        if not every:
            raise SimulationError(f"The motor has no steady state at any of the points from any of {starts} starts.")

        def missed(one: Array) -> tuple[int, float]:
            own = np.isnan(self.found[one.tobytes()].values)
            return int(own.sum()), float(np.sum(huber(self.residuals(one))))

        self.last = None
        return min(every, key=missed)

    def prediction(self, x: Array) -> Prediction:
        """Return the prediction at a place."""
        key = x.tobytes()
        if key not in self.found:
            (self.found[key],) = self.predictor.at([x], self.last)
        if self.found[key].known:
            self.last = self.found[key]
        return self.found[key]

    def residuals(self, x: Array) -> Array:
        """Return the residuals. A value that is not known there keeps the last known one, so that it has no pull."""
        before = self.last
        values = self.prediction(x).values
        if before is not None:
            values = np.where(np.isnan(values), before.values, values)
        values = np.where(np.isnan(values), self.measured, values)
        return np.concatenate([(values - self.measured) / self.errors, self.prior * x])

    def slope(self, x: Array) -> Array:
        """Return the Jacobian of the residuals."""
        key = x.tobytes()
        if key not in self.slopes:
            self.slopes[key] = self.predictor.jacobian(x, self.prediction(x))
        return np.vstack([self.slopes[key] / self.errors[:, None], np.diag(self.prior)])

    @property
    def rough(self) -> bool:
        """Whether the fast model is ngspice at a coarse step, whose values vary from event to event."""
        return self.predictor.points is not None and not self.predictor.balanced

    def _followed(self, x: Array) -> Array:
        """Return the Jacobian: new after a long step, otherwise the last one, by Broyden's rule."""
        if self.way is None:
            return self.slope(x)
        before, residuals, slope = self.way
        step = x - before
        length = float(np.linalg.norm(step))
        if length > (_LONG if self.rough else _SHORT):
            return self.slope(x)
        if (self.rough and length < _SHORT) or length == 0.0:
            return slope
        missed = self.residuals(x) - residuals - slope @ step
        return np.asarray(slope + np.outer(missed, step) / length**2)

    def descent(self, x: Array) -> Array:
        """Return the Jacobian for a step of the search. Raise :class:`_Found` where the step would gain too little."""
        slope, residuals = self._followed(x), self.residuals(x)
        self.way = x.copy(), residuals, slope
        if self._gain(x, slope, residuals) < (_ROUGH_GAIN if self.rough else _GAIN):
            raise _Found(x)
        return np.asarray(self.roots[:, None] * slope)

    def _gain(self, x: Array, slope: Array, residuals: Array) -> float:
        """Return the reduction of the sum of squares by a step to its minimum."""
        slope, residuals = self.roots[:, None] * slope, self.roots * residuals
        free = np.ones(len(x), dtype=bool)
        gradient = slope.T @ residuals
        for place, (low, high) in enumerate(unknown.bounds for unknown in self.predictor.unknowns):
            free[place] = not (x[place] < low + 1e-6 and gradient[place] > 0.0) and not (
                x[place] > high - 1e-6 and gradient[place] < 0.0
            )
        inner = slope.T @ slope + 1e-6 * np.eye(len(x))
        return float(gradient[free] @ np.linalg.solve(inner[np.ix_(free, free)], gradient[free]))


class _Side:
    """One end of an interval: the other parameters follow, until the sum of squares has grown by what it may."""

    def __init__(self, judged: _Judged, place: int, sign: float, bounds: Array, step: float) -> None:
        self.judged, self.place, self.sign, self.bounds = judged, place, sign, bounds
        self.limit = min(WIDE, abs(float(bounds[int(sign > 0.0), place] - judged.x[place])))
        self.end = min(step, self.limit)  # distance from the solution
        along = judged.covariance[:, place] / judged.covariance[place, place]
        self.x = np.clip(judged.x + sign * self.end * along, *bounds)
        self.slope, self.residuals, self.at = judged.slope.copy(), judged.residuals, judged.x
        self.others = np.arange(len(judged.x)) != place
        self.done = self.open = False

    def take(self, residuals: Array) -> None:
        """Take the residuals at the place, and go on to the next one."""
        judged, step = self.judged, self.x - self.at
        if float(step @ step) > 0.0:  # Broyden's rule: the slope is that of the way that was gone
            self.slope = self.slope + np.outer(residuals - self.residuals - self.slope @ step, step) / float(
                step @ step
            )
        self.residuals, self.at = residuals, self.x
        weights = weights_of(residuals) * judged.known
        slope = self.slope[:, self.others] * np.sqrt(weights)[:, None]
        inner = slope.T @ slope
        gradient = slope.T @ (np.sqrt(weights) * residuals)
        move = np.clip(np.linalg.solve(inner, gradient), -_FARTHEST, _FARTHEST)
        gain = float(gradient @ move)
        rise = max(float(huber(residuals).sum()) - judged.squares, 0.0) / (RISE * judged.scale**2)
        share = max(rise - gain / (RISE * judged.scale**2), _LEAST)  # what the other parameters will leave of it
        following = self.x.copy()
        following[self.others] -= move
        if gain > 0.1 * RISE * judged.scale**2:  # the other parameters are still on their way
            self.x = np.clip(following, *self.bounds)
            return
        self.open = share < 1.0 and self.end >= self.limit
        self.done = self.open or 0.8 < share < 1.25
        grown = min(self.end * min(max(share**-0.5, 0.5), 2.0), self.limit)
        following += (grown / self.end - 1.0) * (following - judged.x)
        following[self.place] = judged.x[self.place] + self.sign * grown
        self.end, self.x = grown, np.clip(following, *self.bounds)


@dataclass
class _Judged:
    """The solution with its covariance and what it means."""

    search: _Search
    x: Array

    def __post_init__(self) -> None:
        search = self.search
        self.here = search.prediction(self.x)
        self.known = np.append(np.isfinite(self.here.values), np.ones(len(search.prior), dtype=bool))
        residuals = search.residuals(self.x)
        self.residuals: Array = np.where(self.known, residuals, 0.0)
        weights = weights_of(self.residuals) * self.known
        slope = search.predictor.jacobian(self.x, self.here, central=True)
        slope = np.vstack([slope / search.errors[:, None], np.diag(search.prior)])
        self.slope = slope
        self.weighted = slope * np.sqrt(weights)[:, None]
        count = len(search.measured)
        self.freedom = int(self.known[:count].sum()) + search.stated_priors - len(self.x)
        self.squares = float(huber(self.residuals).sum())
        stated = search.predictor.points is None or search.predictor.points.stated
        self.stated = stated
        self.scale = 1.0 if stated or self.freedom < 1 else sqrt(self.squares / self.freedom)
        self.fits = self._fits() if stated and self.freedom > 0 else ()
        wide = np.eye(len(self.x)) / WIDE**2
        self.data = self.weighted[:count].T @ self.weighted[:count] / self.scale**2 + wide
        self.by_data = np.linalg.inv(self.data)
        self.covariance = np.linalg.inv(self.data - wide + np.diag(search.prior**2))

    def _fits(self) -> tuple[SetFit, ...]:
        """Return the fit of points, of each spectrum and run-up, and of what was known before."""
        predictor = self.search.predictor
        every = np.arange(len(predictor.measured))
        names = [name for name, _ in predictor.sets]
        sets = [every[places] for _, places in predictor.sets]
        known = [place for place, unknown in enumerate(predictor.unknowns) if unknown.prior is not None]
        if known:
            names.append("the priors")
            sets.append(len(every) + np.array(known))
        return fits_of(names, [own[self.known[own]] for own in sets], self.residuals, self.weighted)

    def calibration(self, law: str) -> Calibration:
        """Return the result."""
        search, predictor = self.search, self.search.predictor
        deviations = np.sqrt(np.diag(self.covariance))
        sides = self._profiles(deviations)
        pairs = list(zip(sides[::2], sides[1::2], strict=True))
        ends = [[float(self.x[side.place] + side.sign * side.end) for side in pair] for pair in pairs]
        open_ends = [any(side.open for side in pair) for pair in pairs]
        estimates = []
        for place, unknown in enumerate(predictor.unknowns):
            x, deviation = float(self.x[place]), float(deviations[place])
            low, high = sorted(unknown.value(float(end)) for end in ends[place])
            by_data = sqrt(self.by_data[place, place])
            estimates.append(Estimate(
                unknown.path, unknown.value(x), unknown.spread(x, deviation), (low, high),
                by_data <= IDENTIFIED and not open_ends[place], unknown.start, unknown.unit,
            ))  # fmt: skip
        changed = predictor.base.motor.updated(predictor.changes(self.x))
        correlations = self.covariance / np.outer(deviations, deviations)
        count = len(search.measured)
        kept, own = self.residuals[:count], self.slope[:count]
        return Calibration(
            estimates=tuple(estimates), start=predictor.base.motor, calibrated=changed, law=law,
            points=predictor.points, bands=predictor.bands, run_ups=predictor.run_ups,
            predicted=self.here.values, measured=search.measured,
            predicted_errors=np.sqrt(np.einsum("ij,jk,ik->i", own, self.covariance, own)) * search.errors,
            errors=search.errors, correlations=correlations, covariance=self.covariance, coordinates=self.x,
            ends=tuple(side.x for side in sides if not side.open),
            predictor=replace(predictor, progress=lambda _: None),
            rms_residual=float(np.sqrt(np.mean(kept[self.known[:count]] ** 2))) if self.known[:count].any() else 0.0,
            squares=self.squares, freedom=self.freedom, scale=self.scale, fits=self.fits,
            warnings=tuple(self._warnings(estimates, correlations)), steady_states=predictor.solved,
            states=self.here.states,
        )  # fmt: skip

    # --- intervals ---

    def _profiles(self, deviations: Array) -> list[_Side]:
        """Return both sides of the profile of each coordinate, the lower one first, at the ends of the interval."""
        bounds = np.array([unknown.bounds for unknown in self.search.predictor.unknowns]).T
        sides = [
            _Side(self, place, sign, bounds, sqrt(RISE) * float(deviations[place]))
            for place in range(len(self.x))
            for sign in (-1.0, 1.0)
        ]
        for _ in range(ROUNDS):
            pending = [side for side in sides if not side.done]
            if not pending:
                break
            for side, prediction in zip(
                pending, self.search.predictor.at([side.x for side in pending], self.here), strict=True
            ):
                side.take(self.residuals_of(prediction, side.x))
        return sides

    def residuals_of(self, prediction: Prediction, x: Array) -> Array:
        """Return the residuals of a prediction; 0 for what is not known at the solution or there."""
        search = self.search
        residuals = np.append((prediction.values - search.measured) / search.errors, search.prior * x)
        return np.where(self.known & np.isfinite(residuals), residuals, 0.0)

    # --- warnings ---

    def _warnings(self, estimates: Sequence[Estimate], correlations: Array) -> list[str]:
        search = self.search
        count = len(search.measured)
        found: list[str] = []
        missing = int(np.sum(~self.known[:count]))
        if missing:
            found.append(
                f"{missing} of {count} measured values were left out: the calibrated motor has no stable steady state "
                "there, its contact sticks throughout, or its averaged motor does not run."
            )
        if self.freedom < 1:
            found.append(
                f"There are {int(self.known[:count].sum())} values for {len(self.x)} parameters, so nothing is left to "
                "tell whether the model fits. Measure more points."
            )
        elif self.stated:
            found += [
                f"The model does not explain {fit.data}: the sum of squares of its {fit.values} values is "
                f"{fit.squares:.4g}, expected are {fit.expected:.0f} ± {sqrt(2.0 * fit.expected):.2g}. The intervals "
                "do not hold. Free another parameter, compare with another contact law, or check the stated errors."
                for fit in misfits(self.fits)
            ]
        else:
            found.append(
                "Errors of the points are not stated: they were taken in the ratio of "
                f"{100.0 * DEFAULT_ERROR:g} % of the greatest value of each column, and their size is that of the "
                "scatter about the fit."
            )
        if self.search.predictor.points is not None:
            found += self._outliers()
        for run_up in search.predictor.run_ups:
            found += run_up.cautions(search.predictor.moving(run_up, self.x))
        weak = [place for place, one in enumerate(estimates) if not one.identifiable]
        further = informations(search.predictor, self.x) if weak else {}
        return [*found, *(self._undecided(place, estimates, correlations, further) for place in weak)]

    def _outliers(self) -> list[str]:
        points = self.search.predictor.points
        assert points is not None
        far = np.flatnonzero(np.abs(self.residuals[: len(points.values)]) > FAR * self.scale)
        return [
            f"Point {points.rows[place] + 1}: {points.quantities[place]} = {points.values[place]:.4g} is "
            f"{abs(self.residuals[place]):.2g} standard errors off the fit and counts less."
            for place in far[:_MOST_TOLD]
        ]

    def _undecided(
        self, place: int, estimates: Sequence[Estimate], correlations: Array, further: Mapping[str, Array]
    ) -> str:
        one = estimates[place]
        said = f"The data do not decide {one.path}: any value from {one.interval_95[0]:.3g} to {one.interval_95[1]:.3g}"
        said += f" {one.unit} explains them." if one.unit != "1" else " explains them."
        others = np.abs(correlations[place]) * (np.arange(len(estimates)) != place)
        if others.max(initial=0.0) > 0.9:
            other = int(np.argmax(others))
            said += f" It goes together with {estimates[other].path} (correlation {correlations[place, other]:+.3f})."
        return f"{said} {advice(place, self.data, further, IDENTIFIED)}"
