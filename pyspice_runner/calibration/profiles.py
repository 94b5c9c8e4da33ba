# SPDX-License-Identifier: GPL-3.0-or-later
"""Intervals by the profile likelihood.

A value moves until the sum of squares, minimised over all other parameters, has grown by 3.84 s². The other parameters
follow by Gauss and Newton's method, with a Jacobian that Broyden's rule keeps up to date. All parameters and both sides
share the calls of the model. D. M. Bates, D. G. Watts, "Nonlinear Regression Analysis and Its Applications", Wiley
1988, ch. 6.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.calibration.misfit import huber, weights_of
from pyspice_runner.calibration.unknowns import WIDE
from pyspice_runner.run.waveforms import Array

RISE = 3.8415  # of the sum of squares at the end of a 95 % interval: chi-squared with one degree of freedom
ROUNDS = 6  # computations of the sum of squares at each end of a profile, most of them for curved valleys
_FARTHEST = 0.3  # step of the other parameters of a profile, in coordinates
_LEAST = 0.05  # of the rise, below which a profile counts as flat


@dataclass(frozen=True)
class Solution:
    """The least sum of squares and its surroundings."""

    x: Array  # coordinates
    covariance: Array
    slope: Array  # Jacobian of the residuals
    residuals: Array
    known: NDArray[np.bool_]  # which residuals are known
    squares: float  # sum of squares, with Huber's loss
    scale: float  # of the standard errors of the data


class Side:
    """One end of an interval: the other parameters follow, until the sum of squares has grown by what it may."""

    def __init__(self, solution: Solution, place: int, sign: float, bounds: Array, step: float) -> None:
        self.solution, self.place, self.sign, self.bounds = solution, place, sign, bounds
        self.limit = min(WIDE, abs(float(bounds[int(sign > 0.0), place] - solution.x[place])))
        self.end = min(step, self.limit)  # distance from the solution
        along = solution.covariance[:, place] / solution.covariance[place, place]
        self.x = np.clip(solution.x + sign * self.end * along, *bounds)
        self.slope, self.residuals, self.at = solution.slope.copy(), solution.residuals, solution.x
        self.others = np.arange(len(solution.x)) != place
        self.done = self.open = False

    def take(self, residuals: Array) -> None:
        """Take the residuals at the place, and go on to the next one."""
        solution, step = self.solution, self.x - self.at
        if float(step @ step) > 0.0:  # Broyden's rule: the slope is that of the way that was gone
            self.slope = self.slope + np.outer(residuals - self.residuals - self.slope @ step, step) / float(
                step @ step
            )
        self.residuals, self.at = residuals, self.x
        weights = weights_of(residuals) * solution.known
        slope = self.slope[:, self.others] * np.sqrt(weights)[:, None]
        inner = slope.T @ slope
        gradient = slope.T @ (np.sqrt(weights) * residuals)
        move = np.clip(np.linalg.solve(inner, gradient), -_FARTHEST, _FARTHEST)
        gain = float(gradient @ move)
        rise = max(float(huber(residuals).sum()) - solution.squares, 0.0) / (RISE * solution.scale**2)
        share = max(rise - gain / (RISE * solution.scale**2), _LEAST)  # what the other parameters will leave of it
        following = self.x.copy()
        following[self.others] -= move
        if gain > 0.1 * RISE * solution.scale**2:  # the other parameters are still on their way
            self.x = np.clip(following, *self.bounds)
            return
        self.open = share < 1.0 and self.end >= self.limit
        self.done = self.open or 0.8 < share < 1.25
        grown = min(self.end * min(max(share**-0.5, 0.5), 2.0), self.limit)
        following += (grown / self.end - 1.0) * (following - solution.x)
        following[self.place] = solution.x[self.place] + self.sign * grown
        self.end, self.x = grown, np.clip(following, *self.bounds)


def profiles(solution: Solution, bounds: Array, residuals_at: Callable[[list[Array]], list[Array]]) -> list[Side]:
    """Return both sides of the profile of each coordinate, the lower one first, at the ends of the interval.

    Args:
        solution: from which they start.
        bounds: least and greatest coordinates.
        residuals_at: returns the residuals at several places.
    """
    deviations = np.sqrt(np.diag(solution.covariance))
    sides = [
        Side(solution, place, sign, bounds, sqrt(RISE) * float(deviations[place]))
        for place in range(len(solution.x))
        for sign in (-1.0, 1.0)
    ]
    for _ in range(ROUNDS):
        pending = [side for side in sides if not side.done]
        if not pending:
            break
        for side, residuals in zip(pending, residuals_at([side.x for side in pending]), strict=True):
            side.take(residuals)
    return sides
