# SPDX-License-Identifier: GPL-3.0-or-later
"""The window over which every analysis averages, interpolation, and a recursion over the points of a run.

Means are taken by the trapezoidal rule on the simulator's own points, so that powers add up as the simulator's do.
Harmonics are Fourier coefficients of the waveform: by the same rule for uniform steps, where it is exact, and of the
piecewise linear waveform for nonuniform steps.
"""

from __future__ import annotations

from functools import cached_property
from math import ceil, exp, pi, sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
POINTS_TO_COME = 1000  # of an averaged run, from which its further change is extrapolated
AVERAGED_PERIODS = 20  # whole drive periods at the end of a run, or as many as were recorded
HARMONICS = 20
_FINE = 2000  # points per period for the slew rate
_SLOWEST = 0.99  # largest ratio of two successive changes for an extrapolation


class Window:
    """The last whole periods of a run: 20 of them, or as many as there are; all of it if there is none."""

    def __init__(
        self, time: Array, period: float, *, uniform: bool = True, periods: int = AVERAGED_PERIODS
    ) -> None:  # fmt: skip
        """Take the time of points and the period in s, whether steps are uniform, and the largest number of periods."""
        self.period = period  # in s
        self.uniform = uniform  # whether the steps are uniform
        # number of whole periods
        self.periods = min(periods, int((time[-1] - time[0]) / period * (1.0 + 1e-9)))
        # time in s at which the window begins, and its length in s
        self.start = float(time[-1]) - self.periods * period if self.periods else float(time[0])
        self.length = float(time[-1]) - self.start
        self._whole = time
        self._first = int(np.searchsorted(time, self.start, side="right"))

    @cached_property
    def time(self) -> Array:
        """Time in s of the window's points, the first of them where it begins."""
        return np.concatenate(([self.start], self._whole[self._first :]))

    @property
    def points(self) -> slice:
        """The points of the run in the window, from the last point before its start."""
        return slice(max(self._first - 1, 0), None)

    def cut(self, values: Array) -> Array:
        """Return a signal inside the window, starting with its value at the start of the window."""
        around = slice(max(self._first - 1, 0), self._first + 1)
        first = np.interp(self.start, self._whole[around], values[around])
        return np.concatenate(([first], values[self._first :]))

    def mean(self, values: Array) -> float:
        """Return the time average of a signal."""
        return float(np.trapezoid(self.cut(values), self.time) / self.length)

    def rms(self, values: Array) -> float:
        """Return the RMS value of a signal."""
        return sqrt(self.mean(values * values))

    def harmonics(self, values: Array) -> NDArray[np.complex128]:
        """Return the phasors of orders 1 to :data:`HARMONICS`: V_k of Im(V_k e^{jkωt})."""
        cut, time, turns = self.cut(values), self.time, self._turns
        omega = 2.0 * pi / self.period * np.arange(1, HARMONICS + 1)
        if self.uniform:
            return np.asarray(2j / self.length * np.trapezoid(cut * turns, time, axis=1))
        # by parts: ∫ v e^{-jωt} dt = [v e^{-jωt}] j/ω + Σ slope (e^{-jωt₁} − e^{-jωt₀})/ω²
        slopes = np.diff(cut) / np.diff(time)
        ends = 1j / omega * (cut[-1] * turns[:, -1] - cut[0] * turns[:, 0])
        return np.asarray(2j / self.length * (ends + np.diff(turns, axis=1) @ slopes / omega**2))

    @cached_property
    def _turns(self) -> NDArray[np.complex128]:
        """e^{-jkωt} of all orders k at the points of the window."""
        once = np.exp(-2j * pi / self.period * self.time)
        return np.cumprod(np.broadcast_to(once, (HARMONICS, len(once))), axis=0)

    def slew_rate(self, values: Array) -> float:
        """Return the largest rate of a signal, measured over 1/2000 of a period."""
        grid = np.linspace(self.start, self._whole[-1], _FINE * max(self.periods, 1) + 1)
        return float(np.abs(np.diff(np.interp(grid, self.time, self.cut(values)))).max() / (grid[1] - grid[0]))

    def settling(self, values: Array) -> float:
        """Return the relative change of a signal's mean from the first to the second half of the window's periods."""
        cut = self.cut(values)
        middle = self.start + max(1, self.periods // 2) * self.period
        integral = np.concatenate(([0.0], np.cumsum(0.5 * (cut[1:] + cut[:-1]) * np.diff(self.time))))
        first = float(np.interp(middle, self.time, integral))
        end = float(self._whole[-1])
        before, after = first / (middle - self.start), (integral[-1] - first) / max(end - middle, self.period)
        return float(abs(after - before) / max(abs(before), abs(after), 1e-300)) if self.periods > 1 else 1.0


def change_to_come(time: Array, values: Array, period: float, decay_s: float = 0.0) -> float:
    """Return the expected further change of a signal's mean, in units of the signal.

    The means at the middle, at three quarters and at the end of the run are extrapolated exponentially (Aitken);
    where they do not converge, the last change is multiplied by a hundred. A change is not taken to decay faster than
    the slowest free mode, in ``decay_s``: a mean that turns just at the end has a small last change. A run shorter than
    this, or than four periods, cannot tell.
    """
    quarter = int(0.25 * (time[-1] - time[0]) / period)  # in whole periods
    if quarter < 1 or time[-1] < decay_s:
        return float("inf")
    length = min(quarter, AVERAGED_PERIODS) * period
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))
    ends = time[-1] - period * quarter * np.array([2.0, 1.0, 0.0])
    middle, later, last = (np.interp(ends, time, integral) - np.interp(ends - length, time, integral)) / length
    before = abs(later - middle)
    change = max(abs(last - later), before * exp(-quarter * period / decay_s) if decay_s else 0.0)
    ratio = min(change / before, _SLOWEST) if before > 0.0 else 0.0
    return float(change * max(1.0, ratio / (1.0 - ratio)))


def averaged_to_come(time: Array, values: Array, begin: float = 0.0) -> float:
    """Return :func:`change_to_come` of an averaged signal from a time in s on; its points are not uniform."""
    grid = np.linspace(begin, time[-1], POINTS_TO_COME)
    return change_to_come(grid, np.interp(grid, time, values), float(grid[1] - grid[0]))


def recursion(factors: Array, terms: Array, start: float) -> Array:
    """Return y₀ = start and yₙ₊₁ = factorₙ yₙ + termₙ, in blocks, each from 0 at first."""
    count = len(terms)
    size = max(ceil(sqrt(count)), 1)
    blocks = ceil(count / size)
    padded = np.zeros((2, blocks * size))
    padded[0, :count], padded[1, :count] = factors, terms
    factor, own = padded.reshape(2, blocks, size).swapaxes(1, 2).copy()
    for place in range(1, size):
        own[place] += factor[place] * own[place - 1]
        factor[place] *= factor[place - 1]
    begins = np.empty(blocks)  # y before each block
    before = start
    for block in range(blocks):
        begins[block] = before
        before = own[-1, block] + factor[-1, block] * before
    return np.concatenate(([start], (own + factor * begins).T.ravel()[:count]))


def plate_voltage(time_s: Array, voltage_v: Array, lag_s: float) -> Array:
    """Return the voltage of a capacitance behind a resistance, which starts charged; ``lag_s`` is their time constant.

    Exact for a voltage that is linear within each step.
    """
    if not lag_s > 0.0:
        return voltage_v
    h = np.diff(time_s)
    kept = np.exp(-h / lag_s)
    lag = (1.0 - kept) * lag_s / np.where(h > 0.0, h, 1.0)
    driven = (1.0 - kept) * voltage_v[:-1] + (1.0 - lag) * np.diff(voltage_v)
    return recursion(kept, driven, float(voltage_v[0]))
