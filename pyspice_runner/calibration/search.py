# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for the parameters: least squares with Huber's loss by a fast model, checked by ngspice.

Beyond some standard errors a residual counts linearly, so that a wrong reading cannot pull the values away.
P. J. Huber, "Robust Statistics", Wiley 1981.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import cycle
from math import inf, log, nan

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from pyspice_runner.calibration.prediction import Prediction, Predictor
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.run.waveforms import Array

OUTLIER = 3.0  # standard errors: 0.3 % of normal residuals are beyond, so that the intervals remain those of the normal
START_REACH = log(2.0)  # of further starts about the first
_CLOSE_MODES, _STARTS = 3.0, 16  # half widths between modes, below which there are so many starts
_DESCENDED = 4  # of the starts: the best ones, from which the spectra alone are searched
_ROUGH_GAIN = 0.1  # by ngspice: 0.3 standard errors, as its values vary from event to event of a step
_STEPS = 40  # of each search
_CLOSE = 1e-4  # relative gain, and step of a coordinate, that are noise
# Steps in coordinates: beyond the long one, with a smooth model the short one, there is a new Jacobian; below the short
# one differences of ngspice are noise.
_LONG, _SHORT = 0.1, 0.025
_INSIDE = 0.05  # of a start at its bound: scipy's first step is as long as the start is from 0, which is in the middle
_NORMAL = 1.4826  # standard deviation over the median of the magnitudes


@dataclass(frozen=True)
class Tolerances:
    """Where a search ends. A gain is that of the sum of squares by a further step."""

    gain: float = 0.01  # by a smooth model: 0.1 standard errors
    settled: float = 0.1  # where the difference to ngspice was taken anew, by whose accuracy it varies that much
    refinements: int = 5  # searches by the fast model, each with its difference to ngspice where the last one ended


TOLERANCES = Tolerances()


class Search:
    """The search for the smallest sum of squares; every prediction is computed once.

    Args:
        predictor: the model; that of the result has the difference to ngspice at the solution.
        resumed: place of an interrupted search.
        keep: is called with each place at which the difference to ngspice is taken.
        tolerances: where the search ends.
        start: coordinates to start from, and others in further rows; NaN where no better value than the first is known.
    """

    def __init__(
        self, predictor: Predictor, resumed: Array | None = None, keep: Callable[[Array], object] = lambda _: None,
        tolerances: Tolerances = TOLERANCES, start: Array | None = None,
    ) -> None:  # fmt: skip
        self.predictor, self.resumed, self.keep, self.tolerances = predictor, resumed, keep, tolerances
        self.bounds = np.array([unknown.bounds for unknown in predictor.unknowns]).T
        self.prior = np.array([unknown.weight for unknown in predictor.unknowns])
        rows: Array = np.full((1, len(self.prior)), nan) if start is None else start
        self.start, self.others = rows[0], rows[1:]
        self.spectra = tuple(one for one in predictor.curves if one.smooth)
        self.found: dict[bytes, Prediction] = {}
        self.slopes: dict[bytes, Array] = {}
        self.last: Prediction | None = None
        self.roots: Array = np.ones(0)  # of the weights of Huber's loss, where the last search began
        self.way: tuple[Array, Array, Array] | None = None  # coordinates, residuals and slope of the last step

    def solved(self, starts: int | None = None) -> Array:
        """Return the coordinates of the smallest sum of squares. Raise SimulationError without a start that runs."""
        x: Array = np.clip(np.nan_to_num(self.start), self.bounds[0] + _INSIDE, self.bounds[1] - _INSIDE)
        if self.resumed is not None:
            x = np.clip(self.resumed, *self.bounds)
        elif (count := starts or self._starts(x)) > 1 or self.spectra:
            x = self._best(x, count, fine=starts is not None and count > 1)
        for _ in range(self.tolerances.refinements):
            self.predictor, here = self.predictor.refined(x, self.prediction(x))
            if not here.known:
                raise SimulationError(
                    "The motor has no steady state at any of the measured points with these values. Check drive and "
                    "load of the points with steady_state, start from other values, or give starts = 16."
                )
            self.keep(x)
            self._begin(x, here)
            if self._gain() < (_ROUGH_GAIN if self.predictor.rough else self.tolerances.settled):
                break
            x = self._descended(x)
        return x

    def _begin(self, x: Array, here: Prediction) -> None:
        """Begin a search at a place with its prediction."""
        self.found, self.last, self.way = {x.tobytes(): here}, here, None  # slopes come from the fast model
        residuals = self.residuals(x)
        size = max(1.0, _NORMAL * float(np.median(np.abs(residuals))))
        self.roots = np.sqrt(weights_of(residuals, size))
        self._jacobian(x)

    def _descended(self, x: Array) -> Array:
        """Return the end of a search by the fast model that begins at a place."""
        return np.asarray(least_squares(
            lambda x: self.roots * self.residuals(x), x, self._jacobian, bounds=self.bounds, x_scale="jac",
            xtol=_CLOSE, ftol=_CLOSE, gtol=1e-12, max_nfev=_STEPS, callback=self._end,
        ).x)  # fmt: skip

    def _starts(self, x: Array) -> int:
        """Return the default number of starts, by the distance of the modes at a place."""
        try:
            modes = sorted(self.predictor.motor(x).motor.modes, key=lambda mode: mode.frequency_hz)
        except ParameterError:
            return _STARTS
        widths = [mode.frequency_hz / mode.quality_factor for mode in modes]
        gaps = np.diff([mode.frequency_hz for mode in modes])
        return _STARTS if np.any(gaps < _CLOSE_MODES * np.maximum(widths[1:], widths[:-1])) else 1

    def _best(self, x: Array, starts: int, *, fine: bool) -> Array:
        """Return the best of several starts, with ``fine`` by ngspice, which averages unstable motions over time."""
        cube = qmc.Sobol(len(x), seed=0).random(1 << (starts - 1).bit_length())[: starts - 1]
        reach = START_REACH * np.isnan(self.start)
        places = [x, *(np.clip(np.nan_to_num(one), *self.bounds) for one in self.others)]
        around = zip(cycle(reversed(places)), cube, strict=False)
        starting = [*places, *(np.clip(one + reach * (2.0 * row - 1.0), *self.bounds) for one, row in around)]
        self.found = dict(zip([one.tobytes() for one in starting], self.predictor.at(starting, fine=fine), strict=True))

        def badness(one: Array) -> tuple[int, float]:
            prediction = self.found[one.tobytes()]
            residuals = float(np.sum(huber(self.residuals(one)))) if prediction.known else inf
            return int(np.isnan(prediction.values).sum()), residuals

        if self.spectra:  # they need no steady state, and most minima are theirs
            alone = Search(replace(self.predictor, points=None, curves=self.spectra))
            for one in sorted(starting, key=badness)[: _DESCENDED + len(self.others)]:
                alone._begin(one, alone.prediction(one))
                starting.append(alone._descended(one))
            ends = starting[len(places) + len(cube) :]
            self.found |= zip([one.tobytes() for one in ends], self.predictor.at(ends, fine=fine), strict=True)
        best: Array = min(starting, key=badness)
        if starts > 1 and not self.found[best.tobytes()].known:
            raise SimulationError(f"The motor has no steady state at any of the points from any of {starts} starts.")
        self.last = None
        return best

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
        before, measured = self.last, self.predictor.measured
        values = self.prediction(x).values
        if before is not None:
            values = np.where(np.isnan(values), before.values, values)
        values = np.where(np.isnan(values), measured, values)
        return np.concatenate([(values - measured) / self.predictor.errors, self.prior * x])

    def _slope(self, x: Array) -> Array:
        """Return the Jacobian of the residuals by differences."""
        key = x.tobytes()
        if key not in self.slopes:
            self.slopes[key] = self.predictor.jacobian(x, self.prediction(x))
        return np.vstack([self.slopes[key] / self.predictor.errors[:, None], np.diag(self.prior)])

    def _jacobian(self, x: Array) -> Array:
        """Return the weighted Jacobian: new after a long step, otherwise the last one, by Broyden's rule."""
        residuals, rough = self.residuals(x), self.predictor.rough
        before, known, slope = self.way or (x, residuals, self._slope(x))
        step = x - before
        length = float(np.linalg.norm(step))
        if length > (_LONG if rough else _SHORT):
            slope = self._slope(x)
        elif not rough or length >= _SHORT:
            slope = broyden(slope, residuals - known, step)
        self.way = x.copy(), residuals, slope
        return np.asarray(self.roots[:, None] * slope)

    def _end(self, _: object) -> None:
        """End the search of the optimiser where a further step would gain too little."""
        if self._gain() < (_ROUGH_GAIN if self.predictor.rough else self.tolerances.gain):
            raise StopIteration

    def _gain(self) -> float:
        """Return the reduction of the sum of squares by a step from the last place to its minimum."""
        assert self.way is not None
        x, residuals, slope = self.way
        slope, residuals = self.roots[:, None] * slope, self.roots * residuals
        gradient = slope.T @ residuals
        low, high = self.bounds
        free = ~((x < low + 1e-6) & (gradient > 0.0)) & ~((x > high - 1e-6) & (gradient < 0.0))
        inner = slope.T @ slope + 1e-6 * np.eye(len(x))
        return float(gradient[free] @ np.linalg.solve(inner[np.ix_(free, free)], gradient[free]))


def broyden(slope: Array, change: Array, step: Array) -> Array:
    """Return a Jacobian that is right along a step, by the change of the residuals there."""
    square = float(step @ step)
    return slope + np.outer(change - slope @ step, step) / square if square > 0.0 else slope


def weights_of(residuals: Array, scale: float = 1.0) -> Array:
    """Return the weights that Huber's loss gives to residuals."""
    return np.minimum(1.0, OUTLIER * scale / np.maximum(np.abs(residuals), 1e-12))


def huber(residuals: Array) -> Array:
    """Return the squares of residuals, linear beyond :data:`OUTLIER`."""
    size = np.abs(residuals)
    return np.where(size <= OUTLIER, size**2, OUTLIER * (2.0 * size - OUTLIER))
