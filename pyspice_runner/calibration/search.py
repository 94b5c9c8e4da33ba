# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for the parameters: least squares with Huber's loss by a fast model, checked by ngspice.

Beyond some standard errors a residual counts linearly, so that a wrong reading cannot pull the values away.
P. J. Huber, "Robust Statistics", Wiley 1981.
"""

from __future__ import annotations

from collections.abc import Callable
from math import log

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from pyspice_runner.calibration.misfit import huber, weights_of
from pyspice_runner.calibration.prediction import Prediction, Predictor
from pyspice_runner.calibration.unknowns import WIDE
from pyspice_runner.errors import SimulationError
from pyspice_runner.run.waveforms import Array

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
_SETTLED = 0.1  # gain where the difference to ngspice was taken anew, by whose accuracy it varies that much


class _Found(Exception):
    """The search has found its place: a further step would gain less than :data:`_GAIN` of the sum of squares."""

    def __init__(self, x: Array) -> None:
        super().__init__()
        self.x = x.copy()


class Search:
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
        starting = [x, *others]
        for one, prediction in zip(starting, self.predictor.at(starting), strict=True):
            self.found[one.tobytes()] = prediction
        every = [one for one in starting if self.found[one.tobytes()].known]
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
