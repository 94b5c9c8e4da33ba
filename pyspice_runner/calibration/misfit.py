# SPDX-License-Identifier: GPL-3.0-or-later
r"""Whether the model explains each set of data of a calibration.

The residuals of a fit that is linear near its solution have the covariance :math:`M = I - J (J^T J)^{-1} J^T`. So the
sum of squares of one set, with the block :math:`M_s`, has the mean :math:`m = \mathrm{tr}\,M_s` and the variance
:math:`v = 2\,\mathrm{tr}\,M_s^2`; it is a multiple of a chi-squared variable with :math:`2 m^2/v` degrees of freedom
(F. E. Satterthwaite, Biometrics Bulletin 2, 110, 1946). Each set is judged alone, since a few points that the model
does not explain have no weight in the sum of hundreds of values of a spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pyspice_runner.run.waveforms import Array

SIGNIFICANCE = 1e-3  # probability of the least probable set, below which the model does not explain the data
OUTLIER = 3.0  # standard errors: 0.3 % of normal residuals are beyond, so that the intervals stay those of the normal
WRONG_READING = 4.0  # standard errors: one normal residual in 16,000 is beyond
FEW = 10  # values, of which one may be a wrong reading


@dataclass(frozen=True)
class SetFit:
    """How the calibrated motor fits one set of data."""

    data: str  # name of the file, and the state of a spectrum
    values: int
    squares: float  # sum of squares, with Huber's loss
    expected: float  # its mean if the model holds
    probability: float  # of a sum that is as large, if the model holds


def weights_of(residuals: Array, scale: float = 1.0) -> Array:
    """Return the weights that Huber's loss gives to residuals."""
    return np.minimum(1.0, OUTLIER * scale / np.maximum(np.abs(residuals), 1e-12))


def huber(residuals: Array) -> Array:
    """Return the squares of residuals, linear beyond :data:`OUTLIER`."""
    size = np.abs(residuals)
    return np.where(size <= OUTLIER, size**2, OUTLIER * (2.0 * size - OUTLIER))


def fits_of(names: Sequence[str], sets: Sequence[Array], residuals: Array, slope: Array) -> tuple[SetFit, ...]:
    """Return the fit of each set.

    A set of :data:`FEW` values and more with one residual beyond :data:`WRONG_READING` is judged without it.

    Args:
        names: of the sets.
        sets: places of their values, without those that are not known.
        residuals: of all values and priors.
        slope: their Jacobian, with the roots of the weights of the loss.
    """
    from scipy.special import gammaincc  # takes long to load

    hat = slope @ np.linalg.solve(slope.T @ slope, slope.T)
    found = []
    for name, own in zip(names, sets, strict=True):
        far = np.abs(residuals[own]) > WRONG_READING
        used = own[~far] if far.sum() == 1 and len(own) >= FEW else own
        left = np.eye(len(used)) - hat[np.ix_(used, used)]
        mean, variance = float(np.trace(left)), 2.0 * float(np.sum(left**2))
        squares = float(huber(residuals[used]).sum())
        ratio = 2.0 * mean / variance if variance > 0.0 else 0.0
        # parameters that take up all values of a set leave nothing to judge
        probability = float(gammaincc(0.5 * mean * ratio, 0.5 * squares * ratio)) if mean > 0.5 else 1.0
        found.append(SetFit(name, len(own), squares, mean, probability))
    return tuple(found)


def misfits(fits: Sequence[SetFit]) -> list[SetFit]:
    """Return the sets that the model does not explain: in all, one calibration in 1,000 has one by chance."""
    return [fit for fit in fits if fit.probability < SIGNIFICANCE / len(fits)]
