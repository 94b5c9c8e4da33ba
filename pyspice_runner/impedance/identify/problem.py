# SPDX-License-Identifier: GPL-3.0-or-later
"""A spectrum as a weighted least-squares problem: units, weights, residuals, bounds and descent."""

from __future__ import annotations

import time
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from math import inf, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import SpectrumError
from pyspice_runner.impedance.identify.arms import COST, GLOBALS, ArmModel, Solution, Values
from pyspice_runner.impedance.identify.descent import FINEST, Complexes, NormalEquations, Vector, descend, rms, squares
from pyspice_runner.impedance.noise import Noise, difference
from pyspice_runner.motor.dielectric import LARGEST_LOSS_TANGENT

MOST_SEARCHED = 4000  # points for the search of arms, at about 1 ms per point; an analyser writes 1601
PLAUSIBLE_LEADS = 5.0, 1e-5  # Ω and H of a fixture with cables: about 1 µH and less than 1 Ω a metre
MARGIN = 0.25  # of the span, by which an arm may lie outside the band
_FARTHEST = 10.0  # of the ends of the band, where arms of a given number may lie outside it
_LOWEST_QUALITY, _HIGHEST_QUALITY = 0.6, 1e6
_NOISE_STEPS = 3.0  # medians of the steps of ln Y; noise exceeds 3 medians in 0.2 % of the steps
_RIDGE = 1e-4  # of the sum of squares, for couplings as large as the losses of the arms


class Problem:
    """The least-squares problem in units of its own: ω of the geometric centre of the band, the median |Y|."""

    def __init__(
        self,
        frequency_hz: Vector,
        y: Complexes,
        noise: Noise,
        leads: tuple[float, float] = (0.0, 0.0),
        *,
        deadline: float = inf,
    ) -> None:
        self.deadline = deadline  # a time of time.monotonic()
        self.ridge = 0.0  # weight of the squared couplings in the sum of squares
        self.far = False  # whether arms may lie up to a decade from the band
        self.reference_hz = sqrt(frequency_hz[0] * frequency_hz[-1])
        self.unit_s = float(np.median(np.abs(y)))
        self.unit_henry = 1.0 / (2.0 * pi * self.reference_hz * self.unit_s)
        self.stated_leads = leads[0] * self.unit_s, leads[1] / self.unit_henry
        self._take(frequency_hz / self.reference_hz, y / self.unit_s)
        self._weigh(noise, y)

    def _take(self, w: Vector, y: Complexes) -> None:
        self.w, self.y, self.model = w, y, ArmModel(w)
        self.finest = float(np.min(np.diff(np.log(w))))  # relative distance of the closest points

    def _weigh(self, noise: Noise, smooth_s: Complexes) -> None:
        """Set the error model; ``smooth_s`` is the admittance at all points with the minimum noise."""
        self.noise = noise
        deviation = noise.deviation(smooth_s) / self.unit_s
        size = 1.0 if noise.stated else float(np.median(deviation / np.abs(smooth_s))) * self.unit_s
        slope = np.abs(difference(noise.domain, smooth_s, smooth_s)[1]) * self.unit_s
        self.deviation = deviation / size  # relative size of the error of Y
        self.weight = 1.0 / (self.deviation * slope)  # derivative of a weighted residual by the residual

    def reweighted(self, noise: Noise, smooth_s: Complexes) -> Problem:
        """Return the problem with another error model."""
        other = copy(self)
        other._weigh(noise, smooth_s)
        return other

    def thinned(self) -> Problem:
        """Return the problem with no more than ``MOST_SEARCHED`` of its points, in the same units."""
        if len(self.w) <= MOST_SEARCHED:
            return self
        places = thinning(self.y, MOST_SEARCHED)
        fewer = copy(self)
        fewer._take(self.w[places], self.y[places])
        fewer.weight, fewer.deviation = self.weight[places], self.deviation[places]
        return fewer

    def reaching(self, solution: Solution) -> Problem:
        """Return the problem with arms up to a decade from the band, and the ridge for a solution."""
        other = copy(self)
        other.far, other.ridge = True, min(self.ridge, ridge_of(solution))
        return other

    # --- residuals ---

    def admittance(self, solution: Solution) -> Complexes:
        """Return the fitted admittance, in the unit of this problem."""
        return self.model.at(solution).y

    def rms_relative_error(self, solution: Solution) -> float:
        """Return the root mean square of |Y_model/Y − 1|."""
        return rms(self.admittance(solution) / self.y - 1.0)

    def _residual(self, y: Complexes) -> tuple[Complexes, Complexes]:
        """Return the weighted residual and its derivative by Y."""
        unit = self.unit_s
        found, slope = difference(self.noise.domain, y * unit, self.y * unit)
        return found * self.weight, slope * (unit * self.weight)

    def device_residual(self, solution: Solution) -> tuple[Values, Complexes, Complexes]:
        """Return the values of the model, the weighted residual and its derivative by Y behind the leads."""
        values = self.model.at(solution)
        residual, outer = self._residual(values.y)
        return values, residual, outer * (values.y / values.device) ** 2

    def linearised(self, solution: Solution) -> tuple[Complexes, Complexes]:
        """Return the residual and its derivatives, shape (parameters, points)."""
        values = self.model.at(solution)
        residual, outer = self._residual(values.y)
        return residual, self.model.jacobian(values, solution.parameters, outer)

    def error(self, solution: Solution) -> float:
        """Return the root mean square of the real and imaginary parts of the weighted residual, at least ``FINEST``."""
        return max(sqrt(solution.cost / (2 * len(self.w))), FINEST)

    # --- descent ---

    def bounds(self, solution: Solution) -> tuple[Vector, Vector]:
        """Return the minimum and maximum of every parameter."""
        margin = MARGIN * (self.w[-1] - self.w[0])
        lowest = max(self.w[0] - margin, 0.5 * self.w[0]) if not self.far else self.w[0] / _FARTHEST
        highest = self.w[-1] + margin if not self.far else self.w[-1] * _FARTHEST
        ohm, henry = PLAUSIBLE_LEADS
        arms, rest = solution.arms, solution.rank * (solution.arms + 1)
        lower = [-25.0] + [0.0] * (GLOBALS - 1)
        upper = [25.0, 2.0, LARGEST_LOSS_TANGENT, 2.0, LARGEST_LOSS_TANGENT, ohm * self.unit_s, henry / self.unit_henry]
        for place in solution.held:
            lower[place] = upper[place] = solution.parameters[place]
        lower += [log(lowest), -25.0, log(_LOWEST_QUALITY)] * arms + [-2.0] * rest
        upper += [log(highest), 25.0, log(_HIGHEST_QUALITY)] * arms + [2.0] * rest
        low, high = np.array(lower), np.array(upper)
        if not solution.clamped:
            low[solution.last :][: solution.rank] = high[solution.last :][: solution.rank] = 0.0
        return low, high

    def descend(self, start: Solution, *, steps: int = 100, tolerance: float = 1e-8) -> Solution:
        """Descend to the nearest minimum within the bounds. Raise SpectrumError after the deadline."""
        last = start.last

        def reach(parameters: Vector) -> Vector:
            """Return the largest step: of an arm its bandwidth or its distance from the band, in size e²."""
            solution = replace(start, parameters=parameters)
            frequency = solution.columns[0]
            outside = np.maximum(np.maximum(frequency - log(self.w[-1]), log(self.w[0]) - frequency), self.finest)
            found = np.full(len(parameters), np.inf)
            found[GLOBALS:last] = 2.0
            found[GLOBALS:last:3] = np.maximum(2.0 * solution.widths, outside)
            return found

        def equations(parameters: Vector) -> NormalEquations:
            if time.monotonic() > self.deadline:
                raise SpectrumError(
                    "The fit did not end within the time allowed. Allow more, or fit a part of the band."
                )
            cost, gradient, hessian = squares(*self.linearised(replace(start, parameters=parameters)))
            if self.ridge and len(parameters) > last:
                gradient[last:] += self.ridge * parameters[last:]
                hessian[range(last, len(parameters)), range(last, len(parameters))] += self.ridge
                cost += self.ridge * float(parameters[last:] @ parameters[last:])
            return cost, gradient, hessian

        parameters, cost = descend(
            equations, start.parameters, self.bounds(start), reach, steps=steps, tolerance=tolerance
        )
        return replace(start, parameters=parameters, cost=cost)

    def race(self, starts: Sequence[Solution]) -> Solution:
        """Descend a little from every start, and return the lowest."""
        return min((self.descend(start, steps=30, tolerance=1e-3) for start in starts), key=COST)


def ridge_of(solution: Solution) -> float:
    """Return the weight of the ridge at a solution, in proportion to its residuals and quality factors."""
    return _RIDGE * solution.cost * float(np.exp(-np.log(solution.widths).mean()))


def thinning(y: Complexes, most: int) -> NDArray[np.intp]:
    """Return the places of at most ``most`` points, with both ends.

    One half is spread evenly. The other half lies where ln Y changes by more than noise, as at a resonance, in
    proportion to the steps between means of blocks of neighbours, several for each of the thinned points.
    """
    block = -(-len(y) // (2 * most))
    edges = np.arange(0, len(y), block)
    counts = np.diff(edges, append=len(y))
    means = np.add.reduceat(y, edges) / counts
    with np.errstate(all="ignore"):
        steps = np.nan_to_num(np.abs(np.log(means[1:] / means[:-1])), posinf=0.0)
    steps = np.maximum(steps - _NOISE_STEPS * np.median(steps), 0.0)
    change = np.append(steps, 0.0) + np.append(0.0, steps)
    share = 1.0 / len(y) + np.repeat(change / counts, counts) / max(float(change.sum()), 1e-300)
    grown = np.cumsum(share)
    places = np.searchsorted(grown, np.linspace(0.0, grown[-1], most - 1))
    return np.unique(np.append(np.minimum(places, len(y) - 1), len(y) - 1))
