# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of the admittance of every passive part, which reveal swapped columns and reversed signs.

*Foster*: reactance rises with frequency; |Z| falls where Z is capacitive and rises where it is inductive. *Causality*:
with rising frequency the circles of resonances in the planes of Y and of Z run clockwise; swapping real and imaginary
part, or reversing the sign of one, mirrors them. *Reciprocity*: the matrix of a two-port is symmetric.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Complexes = NDArray[np.complex128]

_LOOP = 0.55  # enclosed share of the bounding box: a circle has 0.79, a locus that does not turn back at most 0.5


def foster(y: Complexes) -> float:
    """Return a positive number if the reactance rises on the whole, a negative one if that of −Y does."""
    inductive = np.sign(-y.imag[:-1] - y.imag[1:])
    size = np.maximum(np.abs(y), np.finfo(float).tiny)
    return float(np.sum(inductive * -np.diff(np.log(size))))


def turns_backwards(y: Complexes) -> bool:
    """Whether the locus clearly has circles that run counterclockwise."""
    with np.errstate(all="ignore"):
        z = 1.0 / y
    if not np.isfinite(z).all():
        return False
    (area_y, swept_y), (area_z, swept_z) = _enclosed(y), _enclosed(z)
    return max(area_y, area_z) > _LOOP and min(swept_y, swept_z) > 0.5


def reciprocal(matrix: Complexes) -> bool:
    """Whether a two-port's transfer admittances agree at most points, within 20 % or 1 % of its largest admittance."""
    there, back = matrix[:, 0, 1], matrix[:, 1, 0]
    bound = np.maximum(0.1 * (np.abs(there) + np.abs(back)), 0.01 * np.abs(matrix).max(axis=(1, 2)))
    return bool(np.mean(np.abs(there - back) > bound) < 0.5)


def passive(matrix: Complexes) -> bool:
    """Whether the part delivers no power at most points, within 2 % of its largest admittance."""
    loss = np.linalg.eigvalsh(0.5 * (matrix + matrix.conj().transpose(0, 2, 1)))[:, 0]
    return bool(np.mean(loss < -0.02 * np.abs(matrix).max(axis=(1, 2))) < 0.5)


def _enclosed(locus: Complexes) -> tuple[float, float]:
    """Return the enclosed area, positive counterclockwise, over that of the bounding box and over the swept area.

    The second ratio is small for noise, which sweeps area in both directions.
    """
    largest = float(np.abs(locus).max())
    if not largest > 0.0:
        return 0.0, 0.0
    locus = locus / largest  # products of very large or very small values leave the range of numbers
    arms = locus - locus.mean()
    sectors = 0.5 * (arms.conj() * np.roll(arms, -1)).imag
    box = np.ptp(locus.real) * np.ptp(locus.imag)
    swept = np.abs(sectors).sum()
    area = float(sectors.sum())
    return (area / float(box), area / float(swept)) if box > 0.0 and swept > 0.0 else (0.0, 0.0)
