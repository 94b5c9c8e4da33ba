# SPDX-License-Identifier: GPL-3.0-or-later
"""Levenberg–Marquardt descent within bounds, and the statistics of its residuals."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Complexes = NDArray[np.complex128]
NormalEquations = tuple[float, Vector, Vector]  # sum of squares, half its gradient, half its Hessian

FINEST = 1e-8  # relative accuracy that no measurement exceeds
_STEP = 1e-6  # of central differences of functions that are smooth over 1
_FLAT = 1e-12  # share of the maximum eigenvalue below which a direction changes nothing
_EXACT = 1e-24  # sum of squares of a fit that nothing can improve


def squares(residual: Complexes, jacobian: Complexes) -> NormalEquations:
    """Return the normal equations of a complex residual and its derivatives."""
    flat, flat_jacobian = residual.view(float), jacobian.view(float)  # real and imaginary parts side by side
    return float(flat @ flat), flat_jacobian @ flat, flat_jacobian @ flat_jacobian.T


def descend(
    equations: Callable[[Vector], NormalEquations],
    start: Vector,
    bounds: tuple[Vector, Vector],
    reach: Callable[[Vector], Vector],
    *,
    steps: int = 100,
    tolerance: float = 1e-8,
) -> tuple[Vector, float]:
    """Run Levenberg–Marquardt within bounds; return the parameters and their sum of squares.

    ``reach`` is the largest step at the parameters, ``tolerance`` the last relative decrease of the sum of squares.
    """
    lower, upper = bounds
    parameters = np.clip(start, lower, upper)
    cost, gradient, hessian = equations(parameters)
    damping, growth = 1e-3, 2.0
    for _ in range(steps):
        held = ((parameters <= lower) & (gradient > 0.0)) | ((parameters >= upper) & (gradient < 0.0))
        step = _damped_step(gradient, hessian, ~held, damping)
        if damping <= 1.0 and float(-gradient @ step) <= 1e-3 * tolerance * cost:
            break
        step *= min(1.0, float(np.min(reach(parameters) / np.maximum(np.abs(step), 1e-300))))
        trial = np.clip(parameters + step, lower, upper)
        step = trial - parameters
        expected = float(-(2.0 * gradient + hessian @ step) @ step)
        trial_cost, trial_gradient, trial_hessian = equations(trial)
        if trial_cost < cost:
            gain = (cost - trial_cost) / max(expected, 1e-300)
            converged = cost - trial_cost <= tolerance * cost and damping <= 1e-2
            parameters, cost, gradient, hessian = trial, trial_cost, trial_gradient, trial_hessian
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * min(gain, 1.0) - 1.0) ** 3), 1e-12)
            growth = 2.0
            if converged or cost < _EXACT:
                break
        else:
            if damping > 1e8 or float(np.max(np.abs(step))) < 1e-15:
                break
            damping, growth = damping * growth, 2.0 * growth
    return parameters, cost


def _damped_step(gradient: Vector, hessian: Vector, free: NDArray[np.bool_], damping: float) -> Vector:
    """Return the Levenberg–Marquardt step; zero for parameters that are not free."""
    step = np.zeros_like(gradient)
    diagonal = np.diag(hessian)[free]
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-30 * max(float(diagonal.max(initial=0.0)), 1e-270)))
    matrix = hessian[np.ix_(free, free)] * scale[:, None] * scale + damping * np.eye(len(scale))
    step[free] = np.linalg.solve(matrix, -gradient[free] * scale) * scale
    return step


def derivatives(function: Callable[[Vector], Vector], parameters: Vector) -> Vector:
    """Return the derivatives of a function of the parameters, shape (values, parameters), by central differences."""
    steps = _STEP * np.eye(len(parameters))
    return np.array([(function(parameters + step) - function(parameters - step)) / (2.0 * _STEP) for step in steps]).T


def inverse(hessian: Vector) -> Vector:
    """Return the inverse of a symmetric matrix that may be ill-scaled; large in undetermined directions."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    result = np.linalg.pinv(hessian * scale[:, None] * scale, rcond=_FLAT, hermitian=True)
    return np.asarray(result * scale[:, None] * scale)


def independent_points(residual: Complexes) -> float:
    """Return the number of independent residuals: twice that of their sign changes, as for white noise."""
    count = len(residual)
    changes = 0.5 * sum(np.count_nonzero(np.diff(np.signbit(part))) for part in (residual.real, residual.imag))
    return float(count) if 2.0 * changes > count - 3.0 * sqrt(count) else 2.0 * changes + 1.0


def variance(cost: float, points: int, free: int, independent: float, stated: bool = False) -> float:
    """Return the variance of a weighted residual, of ``free`` parameters and ``points`` complex residuals.

    If the weights are the given errors, white residuals do not change them.
    """
    if stated and independent == points:
        return 0.5
    return cost / max(2 * points - free, 1) * points / independent


def rms(ratio: Complexes) -> float:
    """Return the root mean square of the magnitude of complex numbers."""
    return float(np.sqrt(np.mean(np.abs(ratio) ** 2)))
