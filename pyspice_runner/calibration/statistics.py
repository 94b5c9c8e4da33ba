# SPDX-License-Identifier: GPL-3.0-or-later
r"""What the end of a search means: covariance, intervals, fit of each set of data, and warnings.

With the weights :math:`W` of the loss, the covariance is :math:`s^2 (J^T W J)^{-1}`, where s = 1 for stated errors, and
the RMS residual otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from pyspice_runner.calibration.misfit import FAR, SetFit, fits_of, huber, misfits, weights_of
from pyspice_runner.calibration.next_experiment import advice, informations
from pyspice_runner.calibration.points import DEFAULT_ERROR
from pyspice_runner.calibration.prediction import Prediction
from pyspice_runner.calibration.profiles import Side, Solution, profiles
from pyspice_runner.calibration.result import Calibration, Estimate
from pyspice_runner.calibration.search import Search
from pyspice_runner.calibration.unknowns import WIDE
from pyspice_runner.run.waveforms import Array

IDENTIFIED = 0.25  # largest relative standard error by the data of a value that they identify
_MOST_TOLD = 10  # outliers that are named


@dataclass
class Judged:
    """The solution with its covariance and what it means."""

    search: Search
    x: Array

    def __post_init__(self) -> None:
        search = self.search
        self.here = search.prediction(self.x)
        self.known = np.append(np.isfinite(self.here.values), np.ones(len(search.prior), dtype=bool))
        residuals = search.residuals(self.x)
        self.residuals: Array = np.where(self.known, residuals, 0.0)
        weights = weights_of(self.residuals) * self.known
        slope = search.predictor.jacobian(self.x, self.here, central=True)
        slope = np.vstack([slope / search.errors[:, None], np.diag(search.prior)])
        self.slope = slope
        self.weighted = slope * np.sqrt(weights)[:, None]
        count = len(search.measured)
        self.freedom = int(self.known[:count].sum()) + search.stated_priors - len(self.x)
        self.squares = float(huber(self.residuals).sum())
        stated = search.predictor.points is None or search.predictor.points.stated
        self.stated = stated
        self.scale = 1.0 if stated or self.freedom < 1 else sqrt(self.squares / self.freedom)
        self.fits = self._fits() if stated and self.freedom > 0 else ()
        wide = np.eye(len(self.x)) / WIDE**2
        self.data = self.weighted[:count].T @ self.weighted[:count] / self.scale**2 + wide
        self.by_data = np.linalg.inv(self.data)
        self.covariance = np.linalg.inv(self.data - wide + np.diag(search.prior**2))

    def _fits(self) -> tuple[SetFit, ...]:
        """Return the fit of points, of each spectrum and run-up, and of what was known before."""
        predictor = self.search.predictor
        every = np.arange(len(predictor.measured))
        names = [name for name, _ in predictor.sets]
        sets = [every[places] for _, places in predictor.sets]
        known = [place for place, unknown in enumerate(predictor.unknowns) if unknown.prior is not None]
        if known:
            names.append("the priors")
            sets.append(len(every) + np.array(known))
        return fits_of(names, [own[self.known[own]] for own in sets], self.residuals, self.weighted)

    def calibration(self, law: str) -> Calibration:
        """Return the result."""
        search, predictor = self.search, self.search.predictor
        deviations = np.sqrt(np.diag(self.covariance))
        sides = self._profiles()
        pairs = list(zip(sides[::2], sides[1::2], strict=True))
        ends = [[float(self.x[side.place] + side.sign * side.end) for side in pair] for pair in pairs]
        open_ends = [any(side.open for side in pair) for pair in pairs]
        estimates = []
        for place, unknown in enumerate(predictor.unknowns):
            x, deviation = float(self.x[place]), float(deviations[place])
            low, high = sorted(unknown.value(float(end)) for end in ends[place])
            by_data = sqrt(self.by_data[place, place])
            estimates.append(Estimate(
                unknown.path, unknown.value(x), unknown.spread(x, deviation), (low, high),
                by_data <= IDENTIFIED and not open_ends[place], unknown.start, unknown.unit,
            ))  # fmt: skip
        changed = predictor.base.motor.updated(predictor.changes(self.x))
        correlations = self.covariance / np.outer(deviations, deviations)
        count = len(search.measured)
        kept, own = self.residuals[:count], self.slope[:count]
        return Calibration(
            estimates=tuple(estimates), start=predictor.base.motor, calibrated=changed, law=law,
            points=predictor.points, bands=predictor.bands, run_ups=predictor.run_ups,
            predicted=self.here.values, measured=search.measured,
            predicted_errors=np.sqrt(np.einsum("ij,jk,ik->i", own, self.covariance, own)) * search.errors,
            errors=search.errors, correlations=correlations, covariance=self.covariance, coordinates=self.x,
            ends=tuple(side.x for side in sides if not side.open),
            predictor=replace(predictor, progress=lambda _: None),
            rms_residual=float(np.sqrt(np.mean(kept[self.known[:count]] ** 2))) if self.known[:count].any() else 0.0,
            squares=self.squares, freedom=self.freedom, scale=self.scale, fits=self.fits,
            warnings=tuple(self._warnings(estimates, correlations)), steady_states=predictor.solved,
            states=self.here.states,
        )  # fmt: skip

    # --- intervals ---

    def _profiles(self) -> list[Side]:
        """Return both sides of the profile of each coordinate."""
        predictor = self.search.predictor
        bounds = np.array([unknown.bounds for unknown in predictor.unknowns]).T
        solution = Solution(self.x, self.covariance, self.slope, self.residuals, self.known, self.squares, self.scale)

        def residuals_at(places: list[Array]) -> list[Array]:
            found = predictor.at(places, self.here)
            return [self._residuals_of(prediction, x) for prediction, x in zip(found, places, strict=True)]

        return profiles(solution, bounds, residuals_at)

    def _residuals_of(self, prediction: Prediction, x: Array) -> Array:
        """Return the residuals of a prediction; 0 for what is not known at the solution or there."""
        search = self.search
        residuals = np.append((prediction.values - search.measured) / search.errors, search.prior * x)
        return np.where(self.known & np.isfinite(residuals), residuals, 0.0)

    # --- warnings ---

    def _warnings(self, estimates: Sequence[Estimate], correlations: Array) -> list[str]:
        search = self.search
        count = len(search.measured)
        found: list[str] = []
        missing = int(np.sum(~self.known[:count]))
        if missing:
            found.append(
                f"{missing} of {count} measured values were left out: the calibrated motor has no stable steady state "
                "there, its contact sticks throughout, it has no resonance near the measured one, or its averaged "
                "motor does not run."
            )
        if self.freedom < 1:
            found.append(
                f"There are {int(self.known[:count].sum())} values for {len(self.x)} parameters, so nothing is left to "
                "tell whether the model fits. Measure more points."
            )
        elif self.stated:
            found += [
                f"The model does not explain {fit.data}: the sum of squares of its {fit.values} values is "
                f"{fit.squares:.4g}, expected are {fit.expected:.0f} ± {sqrt(2.0 * fit.expected):.2g}. The intervals "
                "do not hold. Free another parameter, compare with another contact law, or check the stated errors."
                for fit in misfits(self.fits)
            ]
        else:
            found.append(
                "Errors of the points are not stated: they were taken in the ratio of "
                f"{100.0 * DEFAULT_ERROR:g} % of the greatest value of each column, and their size is that of the "
                "scatter about the fit."
            )
        if self.search.predictor.points is not None:
            found += self._outliers()
        for run_up in search.predictor.run_ups:
            found += run_up.cautions(search.predictor.moving(run_up, self.x))
        weak = [place for place, one in enumerate(estimates) if not one.identifiable]
        further = informations(search.predictor, self.x) if weak else {}
        return [*found, *(self._undecided(place, estimates, correlations, further) for place in weak)]

    def _outliers(self) -> list[str]:
        points = self.search.predictor.points
        assert points is not None
        far = np.flatnonzero(np.abs(self.residuals[: len(points.values)]) > FAR * self.scale)
        return [
            f"Point {points.rows[place] + 1}: {points.quantities[place]} = {points.values[place]:.4g} is "
            f"{abs(self.residuals[place]):.2g} standard errors off the fit and counts less."
            for place in far[:_MOST_TOLD]
        ]

    def _undecided(
        self, place: int, estimates: Sequence[Estimate], correlations: Array, further: Mapping[str, Array]
    ) -> str:
        one = estimates[place]
        said = f"The data do not decide {one.path}: any value from {one.interval_95[0]:.3g} to {one.interval_95[1]:.3g}"
        said += f" {one.unit} explains them." if one.unit != "1" else " explains them."
        others = np.abs(correlations[place]) * (np.arange(len(estimates)) != place)
        if others.max(initial=0.0) > 0.9:
            other = int(np.argmax(others))
            said += f" It goes together with {estimates[other].path} (correlation {correlations[place, other]:+.3f})."
        return f"{said} {advice(place, self.data, further, IDENTIFIED)}"
