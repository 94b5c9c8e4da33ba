# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of a sweep: grids and tolerances of parameters."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any, Literal

import numpy as np

from pyspice_runner.drivers.driver import of_groups
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import Stated, as_number, quoted
from pyspice_runner.run.paths import Parameter, canonical, parameter
from pyspice_runner.run.waveforms import Array

Distribution = Literal["uniform", "normal"]
Sampling = Literal["sobol", "latin-hypercube"]

MOST_POINTS = 1_000_000


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of a parameter about its nominal value.

    Attributes:
        relative: half the width, as a fraction of the nominal value: 0.1 for ±10 %.
        distribution: ``"uniform"`` over the width, or ``"normal"`` with half the width as three standard deviations.

    Raises:
        ParameterError: by the constructor, for an invalid value.
    """

    relative: float
    distribution: Distribution = "uniform"

    def __post_init__(self) -> None:
        share = as_number(self.relative)
        if share is None or not 0.0 < share < 1.0:
            given = quoted(self.relative) if share is None else f"±{100.0 * share:g} %"
            raise ParameterError(f"A tolerance of {given} is not valid: it must be > 0 and < 100 %.")
        known = self.distribution in ("uniform", "normal")
        require(known, "distribution", self.distribution, "'uniform' or 'normal'")

    def factors(self, quantiles: Array) -> Array:
        """Return the factors of the nominal value at quantiles from 0 to 1."""
        if self.distribution == "uniform":
            return 1.0 + self.relative * (2.0 * quantiles - 1.0)
        from scipy.stats import norm

        inside = 0.5 + (1.0 - 1e-10) * (quantiles - 0.5)  # 0 and 1 themselves lie at infinity
        return 1.0 + self.relative / 3.0 * np.asarray(norm.ppf(inside))


Values = Sequence[float] | Array | Tolerance  # of an axis


def named(path: str, motor: Motor, drive: Stated, run: Mapping[str, Any]) -> list[Parameter]:
    """Return the parameters that a path names: one, or with ``modes.*`` one of each mode.

    A parameter of a driver's part that differs between the groups is one of each group.
    """
    if path.startswith("drive.") and "." in path[6:]:
        both = parameter(path, motor, drive, run)
        each = [parameter(f"drive.{one}", motor, drive, run) for one in of_groups(path[6:])[: len(motor.groups)]]
        return each if len({one.nominal for one in each}) > 1 else [both]
    places = range(len(motor.modes)) if path.startswith("modes.*.") else ["*"]
    return [parameter(path.replace("*", str(place), 1), motor, drive, run) for place in places]


def plan_of(
    over: Mapping[str, Values], parameters: Mapping[str, list[Parameter]], samples: int, sampling: Sampling, seed: int
) -> tuple[dict[str, int], dict[str, tuple[str, Array, dict[str, Any]]], list[dict[str, float]]]:
    """Return the sizes of the dimensions, the coordinates, and the changes at each point, by dimension.

    Raise ParameterError for a parameter given twice, or invalid values, samples or seed.
    """
    touched = Counter(canonical(one.path) for several in parameters.values() for one in several)
    if not touched or max(touched.values()) > 1:
        which = f"{touched.most_common(1)[0][0]} twice; name it once" if touched else "nothing; name a parameter"
        raise ParameterError(f"The sweep goes over {which}.")
    steps: dict[str, list[dict[str, float]]] = {}
    coordinates: dict[str, tuple[str, Array, dict[str, Any]]] = {}
    for path, values in over.items():
        if not isinstance(values, Tolerance):
            grid = _grid(path, values)
            coordinates[path] = (path, grid, parameters[path][0].attributes)
            steps[path] = [{one.path: float(value) for one in parameters[path]} for value in grid]
    tolerances = {path: values for path, values in over.items() if isinstance(values, Tolerance)}
    if tolerances:
        quantiles = _quantiles(len(tolerances), samples, sampling, seed)
        steps["sample"] = [{} for _ in range(samples)]
        for (path, tolerance), column in zip(tolerances.items(), quantiles.T, strict=True):
            factors = tolerance.factors(column)
            coordinates[path] = ("sample", *_scatter(parameters[path], tolerance, factors))
            for step, factor in zip(steps["sample"], factors, strict=True):
                step |= {one.path: float((one.nominal or 0.0) * factor) for one in parameters[path]}
    shape = {dimension: len(changes) for dimension, changes in steps.items()}
    if prod(shape.values()) > MOST_POINTS:
        raise ParameterError(f"The sweep has {prod(shape.values()):.3g} points; at most {MOST_POINTS:.0e} are allowed.")
    changes = [{path: value for part in parts for path, value in part.items()} for parts in product(*steps.values())]
    return shape, coordinates, changes


def _scatter(parameters: Sequence[Parameter], tolerance: Tolerance, factors: Array) -> tuple[Array, dict[str, Any]]:
    """Return the coordinate of a parameter within its tolerance: its values, or one factor for those of all modes."""
    first = parameters[0]
    if not any(one.nominal for one in parameters):
        raise ParameterError(f"{first.path} = {first.nominal} has no tolerance; give it a nominal value other than 0.")
    attributes = {**first.attributes, "tolerance": tolerance.relative, "distribution": tolerance.distribution}
    if len(parameters) > 1:
        return factors, attributes | {"units": "1", "comment": "factor by which the values of all are multiplied"}
    value = first.nominal or 0.0
    return value * factors, attributes | {"nominal": value}


def _grid(path: str, values: Any) -> Array:
    try:
        grid = np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        grid = np.array([])
    valid = grid.ndim == 1 and grid.size and np.all(np.isfinite(grid))
    require(valid, path, values, "one or more numbers, or a Tolerance")
    return grid


def _quantiles(parameters: int, samples: int, sampling: Sampling, seed: int) -> Array:
    """Return numbers from 0 to 1, shape (samples, parameters)."""
    from scipy.stats import qmc

    require(1 <= samples <= MOST_POINTS, "samples", samples, f"a whole number > 0 and ≤ {MOST_POINTS}")
    require(seed >= 0, "seed", seed, "a whole number ≥ 0")
    if sampling == "latin-hypercube":
        return np.asarray(qmc.LatinHypercube(parameters, rng=seed).random(samples))
    if samples & (samples - 1):
        raise ParameterError(
            f"samples = {samples} is not valid: a Sobol sequence is balanced only for a power of two. "
            f"Give {1 << samples.bit_length()}, or sampling = 'latin-hypercube'."
        )
    return np.asarray(qmc.Sobol(parameters, rng=seed).random(samples))
