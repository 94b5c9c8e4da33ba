# SPDX-License-Identifier: GPL-3.0-or-later
"""The yield of a sweep: the share of its points that meet a specification."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.result import json_ready

if TYPE_CHECKING:
    import xarray

_DEVIATIONS = 1.96  # standard deviations of an interval of 95 %


def met(dataset: xarray.Dataset, limits: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """Return the share of the points of a sweep within all limits, JSON-ready.

    A point that failed does not meet them. The interval of 95 % is that of E. B. Wilson (J. Am. Stat. Assoc. 22, 1927)
    for samples that are drawn at random; those of a Sobol sequence lie closer.

    Args:
        dataset: the result of ``sweep``.
        limits: name of a quantity → minimum and maximum.

    Raises:
        ParameterError: for a name that is no quantity of the sweep.
    """
    from pyspice_runner.datasets import Sweep

    known = Sweep(dataset).quantities
    for name in limits:
        if name not in known:
            raise ParameterError(f"{name} is no quantity of the sweep; it has {', '.join(known)}.")
    within = {
        name: (dataset[name].values >= low) & (dataset[name].values <= high) for name, (low, high) in limits.items()
    }
    count, good = int(np.prod(list(dataset.sizes.values()))), int(np.all([*within.values()], axis=0).sum())
    share, spread = good / count, _DEVIATIONS**2 / count
    centre = (share + 0.5 * spread) / (1.0 + spread)
    half = _DEVIATIONS * np.sqrt(share * (1.0 - share) / count + 0.25 * spread / count) / (1.0 + spread)
    return {
        "points": count, "good": good, "yield": share,
        "interval_95": [max(float(centre - half), 0.0), min(float(centre + half), 1.0)],
        "limits": {name: json_ready(list(ends)) for name, ends in limits.items()},
        "each": {name: int(points.sum()) for name, points in within.items()},
    }  # fmt: skip
