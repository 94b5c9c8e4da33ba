# SPDX-License-Identifier: GPL-3.0-or-later
"""Roots of functions of one variable, without scipy.optimize, which takes half a second to load."""

from __future__ import annotations

from collections.abc import Callable


def root(function: Callable[[float], float], low: float, high: float, tolerance: float = 0.0) -> float:
    """Return where a continuous function changes its sign between two places, by bisection.

    The values at the two places differ in sign, or one of them is 0. A tolerance of 0 gives neighbouring numbers.
    """
    at_low = function(low)
    if at_low == 0.0 or function(high) == 0.0:
        return low if at_low == 0.0 else high
    while abs(high - low) > tolerance:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if (function(middle) > 0.0) == (at_low > 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
