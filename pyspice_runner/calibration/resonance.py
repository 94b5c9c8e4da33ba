# SPDX-License-Identifier: GPL-3.0-or-later
r"""The resonance of a running motor: the drive frequency of maximum electrical power.

A bench finds it by a sweep of the drive frequency at constant voltages, with the load or the speed of the point. Here
three frequencies are solved at a time. The reciprocal of the power at a resonance is a parabola over the frequency,
:math:`1/P \propto (f - f_0)^2 + w^2`, so its vertex is the next middle one, until the vertex lies between them. The
last distance of the three is the same in every search, so that its error drops out of differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pyspice_runner.run.point import Point

Solve = Callable[[list[Point], list[Any]], list[tuple[float, Any]]]  # points, starts → power (W), solutions

NEAR = 0.125  # distance of the last three frequencies, in bandwidths of the nearest mode
ROUNDS = 12  # of three frequencies
_FARTHEST = 4.0  # step to the next middle one, in their distance
_CENTRED = 0.03  # distance of the vertex from the middle one, likewise, at the end


@dataclass(frozen=True)
class Peak:
    """A resonance; NaN where none was found."""

    frequency_hz: float
    solution: Any = None  # at the middle frequency of the last three


class _Search:
    """The search for the resonance of one point."""

    def __init__(self, setup: Point, start: Peak, near_hz: float, *, fresh: bool) -> None:
        self.setup, self.solution, self.middle, self.near = setup, start.solution, start.frequency_hz, near_hz
        self.distance = (2.0 if fresh else 1.0) * near_hz
        self.found = float("nan")
        self.done = False

    @property
    def setups(self) -> list[Point]:
        """The points at the three frequencies."""
        return [self.setup.updated({"drive.frequency": self.middle + sign * self.distance}) for sign in (-1, 0, 1)]

    def take(self, solved: Sequence[tuple[float, Any]]) -> None:
        """Take the powers at the three frequencies."""
        powers = np.array([power for power, _ in solved])
        if not np.all(powers > 0.0):  # one of them is not known
            self.done = True
            return
        self.solution = solved[1][1]
        below, here, above = 1.0 / powers
        curvature = below - 2.0 * here + above
        between = here <= min(below, above)
        vertex = 0.5 * (below - above) / curvature if curvature > 0.0 else float(np.sign(below - above)) * _FARTHEST
        step = float(np.clip(vertex, -_FARTHEST, _FARTHEST))
        self.middle += step * self.distance
        if between and self.distance == self.near:
            self.found, self.done = self.middle, abs(step) <= _CENTRED
        self.distance = self.near if between else self.distance


def peaks(
    setups: Sequence[Point], starts: Sequence[Peak], near_hz: Sequence[float], solve: Solve, *, fresh: bool
) -> list[Peak]:
    """Return the resonances of points, each next to its start.

    ``near_hz`` are the distances of the last three frequencies; with ``fresh`` the starts are farther away. ``solve``
    returns electrical power and solution of points, NaN where there is none.
    """
    searches = [_Search(*each, fresh=fresh) for each in zip(setups, starts, near_hz, strict=True)]
    for _ in range(ROUNDS):
        active = [search for search in searches if not search.done]
        if not active:
            break
        asked = [setup for search in active for setup in search.setups]
        solved = solve(asked, [search.solution for search in active for _ in range(3)])
        for place, search in enumerate(active):
            search.take(solved[3 * place : 3 * place + 3])
    return [Peak(search.found, search.solution) for search in searches]


def near_hz(setup: Point, frequency_hz: float) -> float:
    """Return the distance of the last three frequencies in Hz about a resonance of a motor."""
    mode = min(setup.motor.modes, key=lambda mode: abs(mode.frequency_hz - frequency_hz))
    return NEAR * mode.frequency_hz / mode.quality_factor
