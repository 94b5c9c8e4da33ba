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
from pyspice_runner.calibration.search import broyden
from pyspice_runner.calibration.unknowns import WIDE
from pyspice_runner.run.waveforms import Array

RISE = 3.8415  # of the sum of squares at the end of a 95 % interval: chi-squared with one degree of freedom
ROUNDS = 6  # computations of the sum of squares at each end of a profile, most of them for curved valleys
_LONGEST_STEP = 0.3  # of the other parameters of a profile, in coordinates
_FLAT = 0.05  # of the rise, below which a profile counts as flat


@dataclass(frozen=True)
class Solution:
    """The least sum of squares and its surroundings."""

    x: Array  # coordinates
    bounds: Array  # minimum and maximum coordinates
    covariance: Array
    slope: Array  # Jacobian of the residuals
    residuals: Array
    known: NDArray[np.bool_]  # which residuals are known
    squares: float  # sum of squares, with Huber's loss
    scale: float  # of the standard errors of the data


class Side:
    """One end of an interval: the other parameters follow, until the sum of squares has grown by what it may."""

    def __init__(self, solution: Solution, place: int, sign: float) -> None:
        self.solution, self.place, self.sign = solution, place, sign
        variance = float(solution.covariance[place, place])
        self.limit = min(WIDE, abs(float(solution.bounds[int(sign > 0.0), place] - solution.x[place])))
        self.end = min(sqrt(RISE * variance), self.limit)  # distance from the solution
        self.x = np.clip(solution.x + sign * self.end * solution.covariance[:, place] / variance, *solution.bounds)
        self.slope, self.residuals, self.at = solution.slope, solution.residuals, solution.x
        self.done = self.open = False

    def take(self, residuals: Array) -> None:
        """Take the residuals at the place, and go on to the next one."""
        solution, allowed = self.solution, RISE * self.solution.scale**2
        self.slope = broyden(self.slope, residuals - self.residuals, self.x - self.at)
        self.residuals, self.at = residuals, self.x
        others = np.arange(len(solution.x)) != self.place
        roots = np.sqrt(weights_of(residuals) * solution.known)
        slope = self.slope[:, others] * roots[:, None]
        gradient = slope.T @ (roots * residuals)
        move = np.clip(np.linalg.solve(slope.T @ slope, gradient), -_LONGEST_STEP, _LONGEST_STEP)
        gain = float(gradient @ move)
        rise = max(float(huber(residuals).sum()) - solution.squares, 0.0)
        share = max((rise - gain) / allowed, _FLAT)  # what the other parameters will leave of it
        following = self.x.copy()
        following[others] -= move
        if gain > 0.1 * allowed:  # the other parameters are still on their way
            self.x = np.clip(following, *solution.bounds)
            return
        self.open = share < 1.0 and self.end >= self.limit
        self.done = self.open or 0.8 < share < 1.25
        grown = min(self.end * min(max(share**-0.5, 0.5), 2.0), self.limit)
        following += (grown / self.end - 1.0) * (following - solution.x)
        following[self.place] = solution.x[self.place] + self.sign * grown
        self.end, self.x = grown, np.clip(following, *solution.bounds)


def profiles(solution: Solution, residuals_at: Callable[[list[Array]], list[Array]]) -> list[tuple[Side, Side]]:
    """Return the lower and the upper side of the profile of each coordinate, at the ends of the interval.

    Args:
        solution: from which they start.
        residuals_at: returns the residuals at several places.
    """
    pairs = [(Side(solution, place, -1.0), Side(solution, place, 1.0)) for place in range(len(solution.x))]
    for _ in range(ROUNDS):
        pending = [side for pair in pairs for side in pair if not side.done]
        if not pending:
            break
        for side, residuals in zip(pending, residuals_at([side.x for side in pending]), strict=True):
            side.take(residuals)
    return pairs
