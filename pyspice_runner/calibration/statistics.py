# SPDX-License-Identifier: GPL-3.0-or-later
r"""What the end of a search means: covariance, intervals, fit of each set of data, and warnings.

With the weights :math:`W` of the loss, the covariance is :math:`s^2 (J^T W J)^{-1}`, where s = 1 for given errors, and
the RMS residual otherwise.

The intervals follow from the profile likelihood. One parameter is moved until the sum of squares, minimised with
respect to all other parameters, has grown by 3.84 s². The other parameters follow by the Gauss-Newton method, with a
Jacobian that Broyden's rule updates. All parameters and both sides share the calls of the model. D. M. Bates, D. G.
Watts, "Nonlinear Regression Analysis and Its Applications", Wiley 1988, ch. 6.

The residuals of a fit that is linear near its solution have the covariance :math:`M = I - J (J^T J)^{-1} J^T`. So the
sum of squares of one set of data, with the block :math:`M_s`, has the mean :math:`m = \mathrm{tr}\,M_s` and the
variance :math:`v = 2\,\mathrm{tr}\,M_s^2`; it is a multiple of a chi-squared variable with :math:`2 m^2/v` degrees of
freedom (F. E. Satterthwaite, Biometrics Bulletin 2, 110, 1946). Each set is judged alone, since a few points that the
model does not explain have no weight in the sum of hundreds of values of a spectrum.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from pyspice_runner.calibration.points import DEFAULT_ERROR
from pyspice_runner.calibration.result import Calibration, Estimate, SetFit
from pyspice_runner.calibration.run_up import RunUp
from pyspice_runner.calibration.search import Search, broyden, huber, weights_of
from pyspice_runner.calibration.spectra import Band
from pyspice_runner.calibration.unknowns import WIDE, Unknown
from pyspice_runner.run.waveforms import Array

SIGNIFICANCE = 1e-3  # the model does not explain the data if the probability of one set is below this
WRONG_READING = 4.0  # standard errors: one normal residual in 16,000 is beyond
FEW = 10  # values, of which one may be a wrong reading
IDENTIFIED = 0.25  # largest relative standard error by the data of a value that they identify
_RISE = 3.8415  # of the sum of squares at the end of a 95 % interval: chi-squared with one degree of freedom
_ROUNDS = 6  # computations of the sum of squares at each end of a profile, most of them for curved valleys
_LONGEST_STEP = 0.3  # of the other parameters of a profile, in coordinates
_FLAT = 0.05  # of the rise, below which a profile counts as flat
_MOST_NAMED = 10  # outliers that are named
_EXPERIMENTS = {  # start of a path → what determines such a value; the first that matches
    "modes.": "measure a spectrum of the free stator about that mode",
    "piezo.": "measure a spectrum of the free stator",
    "thermal.": "measure the spectra at temperatures that differ more",
    "rotor.": "measure a run-up from rest",
    "slider.": "measure a run-up from rest",
    "contact.friction": "measure the torque at speeds at which the contact slips",
    "contact.": "measure a spectrum of the stator pressed on the rotor, and torque and current over speed",
    "mount.": "measure a spectrum of the stator pressed on the rotor",
}


class Judgement:
    """The solution of a search with its covariance and what it means."""

    def __init__(self, search: Search, x: Array) -> None:
        self.search, self.x = search, x
        predictor = self.predictor = search.predictor
        points, count = predictor.points, len(predictor.measured)
        self.here = search.prediction(x)
        self.known = np.append(np.isfinite(self.here.values), np.ones(len(x), dtype=bool))
        self.residuals: Array = np.where(self.known, search.residuals(x), 0.0)
        slope = predictor.jacobian(x, self.here, central=True) / predictor.errors[:, None]
        self.slope = np.vstack([slope, np.diag(search.prior)])
        weights = weights_of(self.residuals) * self.known
        weighted = self.slope * np.sqrt(weights)[:, None]
        priors = count + np.array([at for at, one in enumerate(predictor.unknowns) if one.prior is not None], dtype=int)
        self.freedom = int(self.known[:count].sum()) + len(priors) - len(x)
        self.squares = float(huber(self.residuals).sum())
        self.errors_given = points is None or points.errors_given
        scaled = not self.errors_given and self.freedom > 0
        self.scale = sqrt(self.squares / self.freedom) if scaled else 1.0
        data = weighted[:count].T @ weighted[:count] / self.scale**2
        self.by_data = np.linalg.inv(data + np.eye(len(x)) / WIDE**2)
        self.covariance = np.linalg.inv(data + np.diag(search.prior**2))
        sets = [(one.source, np.arange(count)[places]) for one, places in predictor.sets]
        sets += [("the priors", priors)] if len(priors) else []
        used = [(name, own[self.known[own]]) for name, own in sets]
        self.fits = fits_of(used, self.residuals, weighted) if self.errors_given and self.freedom > 0 else ()

    def calibration(self) -> Calibration:
        """Return the result."""
        predictor, x = self.predictor, self.x
        pairs = self._profiles()
        estimates = [self._estimate(*each) for each in zip(range(len(x)), predictor.unknowns, pairs, strict=True)]
        deviations = np.sqrt(np.diag(self.covariance))
        correlations = self.covariance / np.outer(deviations, deviations)
        count = len(predictor.measured)
        own, known = self.slope[:count], self.known[:count]
        return Calibration(
            estimates=tuple(estimates), calibrated=predictor.motor(x).motor, predictor=predictor,
            predicted=self.here.values,
            predicted_errors=np.sqrt(np.einsum("ij,jk,ik->i", own, self.covariance, own)) * predictor.errors,
            correlations=correlations, covariance=self.covariance, coordinates=x,
            ends=tuple(side.x for pair in pairs for side in pair if not side.open),
            rms_residual=float(np.sqrt(np.mean(self.residuals[:count][known] ** 2))) if known.any() else 0.0,
            squares=self.squares, freedom=self.freedom, scale=self.scale, fits=self.fits,
            warnings=tuple(self._warnings(estimates, correlations)), steady_states=predictor.counter.solved,
        )  # fmt: skip

    def _profiles(self) -> list[tuple[_Side, _Side]]:
        """Return both sides of the profile of each coordinate, at the ends of the interval."""
        predictor, prior = self.predictor, self.search.prior
        pairs = [(_Side(self, place, -1.0), _Side(self, place, 1.0)) for place in range(len(self.x))]
        for _ in range(_ROUNDS):
            pending = [side for pair in pairs for side in pair if not side.done]
            if not pending:
                break
            for side, one in zip(pending, predictor.at([side.x for side in pending], self.here), strict=True):
                residuals = np.append((one.values - predictor.measured) / predictor.errors, prior * side.x)
                side.take(np.where(self.known & np.isfinite(residuals), residuals, 0.0))
        return pairs

    def _estimate(self, place: int, unknown: Unknown, sides: tuple[_Side, _Side]) -> Estimate:
        x = float(self.x[place])
        low, high = sorted(unknown.value(x + side.sign * side.end) for side in sides)
        closed = not any(side.open for side in sides)
        return Estimate(
            unknown.value(x), unknown.spread(x, sqrt(self.covariance[place, place])), (low, high),
            sqrt(self.by_data[place, place]) <= IDENTIFIED and closed, unknown.start, unknown.unit, unknown.path,
        )  # fmt: skip

    # --- warnings ---

    def _warnings(self, estimates: Sequence[Estimate], correlations: Array) -> list[str]:
        count, found = len(self.predictor.measured), list[str]()
        known = int(self.known[:count].sum())
        if known < count:
            found.append(
                f"{count - known} of {count} measured values were left out: the calibrated motor has no steady state "
                "there, its contact sticks throughout, it has no resonance near the measured one, or its averaged "
                "motor does not run."
            )
        if averages := np.count_nonzero(self.here.scatter):
            found.append(
                f"{averages} of {count} values are compared with time averages, since the periodic motion is unstable "
                "there. The errors of these averages are included."
            )
        if self.freedom < 1:
            found.append(
                f"There are {known} values for {len(self.x)} parameters, so nothing is left to tell whether the model "
                "fits. Measure more points."
            )
        elif self.errors_given:
            unexplained = {fit.data for fit in misfits(self.fits)}
            bands = [(one, self.here.values[own]) for one, own in self.predictor.sets if isinstance(one, Band)]
            if astray := [one.source for one, own in bands if one.source in unexplained and one.far(own)]:
                text = (
                    f"The motor differs from {' and '.join(astray)} by far more than the noise: the search ended at a "
                    "local minimum, a value that must change is not free, or a mode is missing. No value holds: "
                    f"{', '.join(one.path for one in estimates)}. Set frequencies, quality factors, couplings and "
                    "capacitances to those of fit, free them, give starts = 64, or check the stated error."
                )
                return [*found, text]
            found += [
                f"The model does not explain {fit.data}: the sum of squares of its {fit.values} values is "
                f"{fit.squares:.4g}, expected are {fit.expected:.0f} ± {sqrt(2.0 * fit.expected):.2g}. The intervals "
                "do not hold. Free another parameter, compare with another contact law, give starts = 16, or check the "
                "stated errors."
                for fit in misfits(self.fits)
            ]
        else:
            found.append(
                "Errors of the points are not given: they were taken in the ratio of "
                f"{100.0 * DEFAULT_ERROR:g} % of the maximum of each column, and their size follows from the "
                "scatter about the fit."
            )
        if points := self.predictor.points:
            far = np.flatnonzero(np.abs(self.residuals[: len(points.values)]) > WRONG_READING * self.scale)
            found += [
                f"Point {points.rows[place] + 1}: {points.quantities[place]} = {points.values[place]:.4g} is "
                f"{abs(self.residuals[place]):.2g} standard errors off the fit and counts less."
                for place in far[:_MOST_NAMED]
            ]
        motor, thermal = self.predictor.motor(self.x), self.predictor.thermal(self.x)
        for curve in self.predictor.curves:
            if isinstance(curve, RunUp):
                found += curve.cautions(self.predictor.point(motor, curve.conditions, thermal))
        weak = [place for place, one in enumerate(estimates) if not one.identifiable]
        return [*found, *(_undecided(estimates, place, correlations[place]) for place in weak)]


class _Side:
    """One end of an interval: the other parameters follow, until the sum of squares has grown by what it may."""

    def __init__(self, solution: Judgement, place: int, sign: float) -> None:
        self.solution, self.place, self.sign = solution, place, sign
        variance = float(solution.covariance[place, place])
        self.limit = min(WIDE, abs(float(solution.search.bounds[int(sign > 0.0), place] - solution.x[place])))
        self.end = min(sqrt(_RISE * variance), self.limit)  # distance from the solution
        self.x = np.clip(
            solution.x + sign * self.end * solution.covariance[:, place] / variance, *solution.search.bounds
        )
        self.slope, self.residuals, self.at = solution.slope, solution.residuals, solution.x
        self.done = self.open = False

    def take(self, residuals: Array) -> None:
        """Take the residuals at the place, and go on to the next one."""
        solution, allowed = self.solution, _RISE * self.solution.scale**2
        self.slope = broyden(self.slope, residuals - self.residuals, self.x - self.at)
        self.residuals, self.at = residuals, self.x
        others = np.arange(len(solution.x)) != self.place
        roots = np.sqrt(weights_of(residuals) * solution.known)
        slope = self.slope[:, others] * roots[:, None]
        gradient = slope.T @ (roots * residuals)
        move = np.clip(np.linalg.solve(slope.T @ slope, gradient), -_LONGEST_STEP, _LONGEST_STEP)
        gain = float(gradient @ move)
        rise = max(float(huber(residuals).sum()) - solution.squares, 0.0)
        share = max((rise - gain) / allowed, _FLAT)  # what the other parameters will leave of it
        following = self.x.copy()
        following[others] -= move
        if gain > 0.1 * allowed:  # the other parameters are still on their way
            self.x = np.clip(following, *solution.search.bounds)
            return
        self.open = share < 1.0 and self.end >= self.limit
        self.done = self.open or 0.8 < share < 1.25
        grown = min(self.end * min(max(share**-0.5, 0.5), 2.0), self.limit)
        following += (grown / self.end - 1.0) * (following - solution.x)
        following[self.place] = solution.x[self.place] + self.sign * grown
        self.end, self.x = grown, np.clip(following, *solution.search.bounds)


def _undecided(estimates: Sequence[Estimate], place: int, correlations: Array) -> str:
    """Return what the data leave open of a value, and which measurement determines it."""
    one = estimates[place]
    unit = "" if one.unit == "1" else f" {one.unit}"
    low, high = one.interval_95
    text = f"The data do not identify {one.path}: any value from {low:.3g} to {high:.3g}{unit} explains them."
    others = np.abs(correlations) * (np.arange(len(estimates)) != place)
    if others.max(initial=0.0) > 0.9:
        other = int(np.argmax(others))
        text += f" It goes together with {estimates[other].path} (correlation {correlations[other]:+.3f})."
    experiment = next((words for path, words in _EXPERIMENTS.items() if one.path.startswith(path)), "measure more")
    return f"{text} To identify it, {experiment}, or leave it out of free."


def fits_of(sets: Sequence[tuple[str, Array]], residuals: Array, slope: Array) -> tuple[SetFit, ...]:
    """Return the fit of each set, by its name and the places of its values, without those that are not known.

    ``slope`` is the Jacobian of the ``residuals`` of all values and priors, with the roots of the weights of the loss.
    A set of :data:`FEW` values and more with one residual beyond :data:`WRONG_READING` is judged without it.
    """
    from scipy.special import gammaincc  # takes long to load

    hat = slope @ np.linalg.solve(slope.T @ slope, slope.T)
    found = []
    for name, own in sets:
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
