# SPDX-License-Identifier: GPL-3.0-or-later
r"""Error models of a measured admittance.

=================  ==========================================  =============================
name               the error is the same at all points in      deviation of Y
=================  ==========================================  =============================
``proportional``   ln Y: a share of what is measured           σ |Y|
``s11``            the reflection coefficient in 50 Ω          σ |1 + Z₀Y|² / 2Z₀
``z``              the impedance, as of a display's last digit  σ |Y|²
=================  ==========================================  =============================

σ is the root mean square of the complex error (in Ω for ``z``). Variances add. An estimate selects a single error, or
the proportional one with one of the others, by maximum likelihood and Schwarz's criterion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log, sqrt

import numpy as np

from pyspice_runner.errors import require
from pyspice_runner.impedance.identify.descent import Complexes, Vector, rms

KINDS = ("proportional", "s11", "z")
REFERENCE_OHM = 50.0
_RATIOS = np.geomspace(0.03, 30.0, 21)  # of the medians of two errors; outside, the smaller is negligible
_DEGREES = 3.0  # of Student's distribution, whose tails treat a resonance between the points as an outlier
_LEAST = 1e-12  # relative error of exact data
_GAIN = sqrt(20.0)  # of a third difference for white noise: √(1 + 9 + 9 + 1)


@dataclass(frozen=True)
class Noise:
    """An error model."""

    sigma: dict[str, float]  # kind → σ; of one kind, or of ``proportional`` and another
    stated: bool = False  # whether σ is known and not estimated from the residuals

    @property
    def domain(self) -> str:
        """The quantity of the residuals: that of the additive error if there is one."""
        return next((kind for kind in ("s11", "z") if kind in self.sigma), "proportional")

    def deviation(self, y: Complexes) -> Vector:
        """Return the standard deviation of Y in S at admittances in S."""
        return np.sqrt(sum((sigma * _shape(kind, y)) ** 2 for kind, sigma in self.sigma.items()))

    def refined(self, fitted: Complexes, residuals: Complexes, white: bool, magnitude: Complexes) -> Noise:
        """Return the error model by the residuals of a fit; correlated residuals count as a share of a magnitude."""
        if self.stated:
            return self
        if white:
            return estimate(fitted, residuals)
        return Noise({"proportional": max(rms(residuals / magnitude), _LEAST)})


def noise_of(noise: Mapping[str, float] | None, y: Complexes) -> Noise:
    """Return the error model, as specified or else estimated. Raise ParameterError for other kinds or values."""
    if noise is None:
        return estimate(y)
    valid = noise and noise.keys() <= set(KINDS) and len(noise.keys() - {"proportional"}) < 2
    require(valid, "noise", dict(noise), "a σ of proportional, s11 or z, or of proportional and one other")
    for kind, sigma in noise.items():
        require(0.0 < sigma < 1e6, f"noise: {kind}", sigma, "a number > 0 and < 1e6")
    return Noise({kind: float(sigma) for kind, sigma in noise.items()}, stated=True)


def _shape(kind: str, y: Complexes) -> Vector:
    """Return the deviation of Y for σ = 1."""
    if kind == "s11":
        return np.asarray(np.abs(1.0 + REFERENCE_OHM * y) ** 2 / (2.0 * REFERENCE_OHM))
    return np.asarray(np.abs(y) if kind == "proportional" else np.abs(y) ** 2)


def difference(domain: str, model: Complexes, measured: Complexes) -> tuple[Complexes, Complexes]:
    """Return model less measurement in a domain, and the derivative by the model's Y."""
    if domain == "s11":
        inverse = 1.0 / (1.0 + REFERENCE_OHM * model)
        factor = -2.0 * REFERENCE_OHM * inverse
        return factor * (model - measured) / (1.0 + REFERENCE_OHM * measured), factor * inverse
    if domain == "z":
        return (measured - model) / (model * measured), -1.0 / model**2
    return np.log(model / measured), 1.0 / model


def estimate(y: Complexes, error: Complexes | None = None) -> Noise:
    """Return the error model of an admittance in S, with the errors measured less fitted in S.

    They are by default third differences of neighbouring points, which contain little else.
    """
    robust = error is None
    if error is None:
        error = np.diff(y, 3) / _GAIN if len(y) > 8 else y - y.mean()
        y = (y[:-3] + 3.0 * y[1:-2] + 3.0 * y[2:-1] + y[3:]) / 8.0 if len(y) > 8 else y
    size = np.maximum(np.abs(error), 1e-14 * np.abs(y))
    found = []
    for kinds in (("proportional",), ("s11",), ("z",), ("proportional", "s11"), ("proportional", "z")):
        shapes = [_shape(kind, y) for kind in kinds]
        medians = [float(np.median(shape)) for shape in shapes]
        for ratio in _RATIOS if len(kinds) > 1 else (0.0,):
            relative = [1.0 / medians[0], ratio / medians[-1]][: len(kinds)]
            spread = np.sqrt(sum((share * shape) ** 2 for share, shape in zip(relative, shapes, strict=True)))
            scaled = size / spread
            if robust:
                scale = float(np.median(scaled)) / sqrt(log(2.0))
                tails = (_DEGREES / 2.0 + 1.0) * np.log1p(2.0 * (scaled / scale) ** 2 / _DEGREES)
            else:
                scale = sqrt(float(np.mean(scaled**2)))
                tails = (scaled / scale) ** 2
            minus_log = float(np.sum(tails + 2.0 * np.log(spread * scale)))
            sigma = {kind: float(scale * share) for kind, share in zip(kinds, relative, strict=True)}
            found.append((2.0 * minus_log + len(kinds) * log(2.0 * len(y)), sigma))
    return Noise(min(found, key=lambda item: item[0])[1])


def same_shape(first: Noise, second: Noise, y: Complexes) -> bool:
    """Whether two error models give the same relative weights, within 10 % at 9 of 10 points."""
    ratio = first.deviation(y) / second.deviation(y)
    low, middle, high = np.quantile(ratio, [0.05, 0.5, 0.95])
    return bool(high < 1.1 * middle and low > middle / 1.1)
