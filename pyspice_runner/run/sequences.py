# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolation and a recursion over the points of a run, by numpy alone: scipy takes half a second to load."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NODES = 6  # of the interpolating polynomial: the error is of the order of a cubic spline's at 12 points a period


def interpolated(time: Array, values: Array, at: Array | float) -> Array:
    """Return values, along their last axis, at other times, by Lagrange's polynomial through the points around each.

    ``time`` rises; before and after it the polynomial through its first or last points counts.
    """
    nodes, places = min(NODES, len(time)), np.asarray(at, dtype=float)
    first = np.clip(np.searchsorted(time, places) - nodes // 2, 0, len(time) - nodes)
    found = np.zeros((*values.shape[:-1], *places.shape))
    for one in range(nodes):
        weight = np.ones_like(places)
        for other in range(nodes):
            if other != one:
                weight *= (places - time[first + other]) / (time[first + one] - time[first + other])
        found += weight * values[..., first + one]
    return found


def recursion(factors: Array, terms: Array, start: float) -> Array:
    """Return y₀ = start and yₙ₊₁ = factorₙ yₙ + termₙ, in blocks, each from 0 at first."""
    count = len(terms)
    size = max(ceil(sqrt(count)), 1)
    blocks = ceil(count / size)
    padded = np.zeros((2, blocks * size))
    padded[0, :count], padded[1, :count] = factors, terms
    factor, own = (one.reshape(blocks, size).T.copy() for one in padded)
    for place in range(1, size):
        own[place] += factor[place] * own[place - 1]
        factor[place] *= factor[place - 1]
    begins = np.empty(blocks)  # y before each block
    before = start
    for block in range(blocks):
        begins[block] = before
        before = own[-1, block] + factor[-1, block] * before
    return np.concatenate(([start], (own + factor * begins).T.ravel()[:count]))
