# SPDX-License-Identifier: GPL-3.0-or-later
r"""Resonances that are skewed by their amplitude within one sweep, by the pattern of the residuals.

A spring that softens by the share :math:`\tfrac34\gamma A^2` and losses that grow by :math:`\tfrac14\kappa A^2` change
the admittance of an arm, to first order, by

.. math::
    \delta Y \propto v^2\,\frac{j\omega_n^2}{\omega}\,\frac{|v|^2}{\omega^2}, \qquad
    \delta Y \propto v^2\,\frac{\omega_n}{Q}\,\frac{|v|^2}{\omega^2}

with the velocity v of the arm. No value of the linear circuit does that.
:mod:`~pyspice_runner.impedance.joint_fit` has the whole law.
"""

from __future__ import annotations

import numpy as np

from pyspice_runner.impedance.identify import errors
from pyspice_runner.impedance.identify.arms import Solution
from pyspice_runner.impedance.identify.problem import Problem

SHARE = 0.8  # of the squares: a skew of up to a bandwidth explains more than 0.9, the losses of a polymer 0.5


def skewed_arms(problem: Problem, solution: Solution) -> list[int]:
    """Return the arms in the band whose skew explains most of the residuals, more than their noise allows."""
    residual, jacobian = problem.linearised(solution)
    free = [place for place in range(len(jacobian)) if place not in solution.held]
    known = jacobian[free].view(float).T.copy()
    values, _, chain = problem.device_residual(solution)
    basis, _ = np.linalg.qr(known / np.maximum(np.linalg.norm(known, axis=0), 1e-300))
    rest = residual.view(float)
    rest = rest - basis @ (basis.T @ rest)
    found = []
    for arm in errors.resonances(problem, solution):
        velocity, frequency = values.velocity[arm], values.frequency[arm]
        size = chain * velocity**2 * np.abs(velocity / problem.w) ** 2
        columns = np.array([1j * frequency**2 / problem.w * size, values.own[arm] * size]).view(float).T
        columns = columns - basis @ (basis.T @ columns)
        pattern, _ = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))
        part = float(np.sum((pattern.T @ rest) ** 2)) / max(float(rest @ rest), 1e-300)
        noise = errors.SIGNIFICANT**2 / len(rest)
        if part > max(SHARE, noise):
            found.append(arm)
    return found
