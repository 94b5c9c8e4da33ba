# SPDX-License-Identifier: GPL-3.0-or-later
r"""The least-squares problem behind :func:`~pyspice_runner.spectra.fit.fit_spectrum`.

**Objective.** An analyser's error is a share of what it measures. The residual is therefore that of the complex
logarithm, ln Y_model − ln Y_measured: magnitude in its real part, phase in its imaginary part, each point with the same
weight. Noise of a constant share becomes noise of constant variance, and the estimate is unbiased to second order.

**Parameters** are the logarithms of C₀ and of each arm's frequency, reactance √(L/C) and quality factor, so that every
arm is passive; tan δ, R_ℓ and L_ℓ are bounded by zero, and L_ℓ resonates with C₀ at least half an octave above the
band. Levenberg–Marquardt steps use the exact Jacobian. An arm may leave the measured band by a quarter of its span: it
then stands for the modes out there.

**Start.** Vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999, doi:10.1109/61.772353) gives the
poles, non-negative least squares the amplitudes. Then the residuals are searched, by a matched filter over frequency
and bandwidth, for an arm that is missing: it is added, the least certain arm is taken out, and the better fit is kept.

**Number of arms.** Schwarz's criterion, BIC = 2 n ln σ² + p ln 2n, of n independent points and p parameters. Where the
circuit cannot follow a real device, residuals are no noise but correlated, and n is lowered to the equivalent number of
independent ones; standard errors grow accordingly. Real resonances are also no perfect circles, and more arms would
follow their dents closer and closer: a number of arms at which two of them share one peak is shown, but not taken.

**Long spectra.** The time of the search is proportional to the number of points. Of more than ``MOST_SEARCHED`` points
the search takes those of :func:`thinning`; a last descent takes all points.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from math import inf, log, pi, sqrt
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from pyspice_runner.errors import SpectrumError

GLOBALS = 4  # parameters that are no arm's: ln C₀, tan δ, R_ℓ, L_ℓ
RESONANT_QUALITY = 2.5  # a broader arm rounds off the background, it does not resonate
SIGNIFICANT = 5.0  # standard deviations by which a missing arm stands out of the residuals
MOST_SEARCHED = 4000  # points that the arms are searched with, which takes some 1 ms a point; an analyser writes 1601
SEARCHED_ARMS = 8  # tried when their number is not given
_NOISE_STEPS = 3.0  # medians of the steps of ln Y; a greater step is not noise, which exceeds 3 medians in 0.2 %
_MARGIN = 0.25  # of the span, by which an arm may lie outside the band
_LOWEST_QUALITY, _HIGHEST_QUALITY = 0.6, 1e6
_LONGEST_LEADS = 0.5  # ω² L_ℓ C₀ at the end of the band: leads that resonate with C₀ half an octave above it
_EXACT = 1e-24  # sum of squares of a fit that nothing can improve
_FLOOR = 1e-8  # relative accuracy that no measurement exceeds

Vector = NDArray[np.float64]
Complexes = NDArray[np.complex128]
NormalEquations = tuple[float, Vector, Vector]


@dataclass(frozen=True)
class Solution:
    """Parameters, in the problem's own units, and their sum of squared residuals."""

    parameters: Vector
    cost: float

    @property
    def arms(self) -> int:
        """Number of arms."""
        return (len(self.parameters) - GLOBALS) // 3


COST = attrgetter("cost")


class Problem:
    """The least-squares problem in units of its own: ω of the band's geometric centre, the median |Y|."""

    def __init__(self, frequency_hz: Vector, y: Complexes, leads: bool, *, deadline: float = inf) -> None:
        self.leads = leads
        self.deadline = deadline
        self.reference_hz = sqrt(frequency_hz[0] * frequency_hz[-1])
        self.unit_s = float(np.median(np.abs(y)))
        self.unit_henry = 1.0 / (2.0 * pi * self.reference_hz * self.unit_s)
        self._take(frequency_hz / self.reference_hz, y / self.unit_s)

    def _take(self, w: Vector, y: Complexes) -> None:
        self.w, self.y = w, y
        self.s: Complexes = np.asarray(1j * w, dtype=complex)
        self.finest = float(np.min(np.diff(np.log(w))))  # distance of the closest points, relative
        self.log_y = np.log(y)
        self._jacobian: Complexes = np.empty((0, len(y)), dtype=complex)  # kept, since a new one costs page faults

    def thinned(self) -> Problem:
        """Return the problem with no more than ``MOST_SEARCHED`` of its points, in the same units."""
        if len(self.w) <= MOST_SEARCHED:
            return self
        places = thinning(self.y, MOST_SEARCHED)
        fewer = copy(self)
        fewer._take(self.w[places], self.y[places])
        return fewer

    # --- model and its derivatives ---

    def lead_inductance(self, parameters: Vector) -> float:
        """Return L_ℓ; its parameter is (ω/ω_ℓ)² at the end of the band, with ω_ℓ the resonance of L_ℓ and C₀."""
        return float(parameters[3] * np.exp(-parameters[0]) / self.w[-1] ** 2)

    def _parts(self, parameters: Vector) -> tuple[Complexes, ...]:
        """Return Y₀ of the clamped capacitance, the arms' Y_n, Z and ∂ln Y/∂Y_d."""
        log_c, loss, lead_r, _ = parameters[:GLOBALS]
        lead_l = self.lead_inductance(parameters)
        frequency, reactance, quality = _columns(parameters)
        clamped = np.exp(log_c) / (loss + 1.0 / self.s)
        # 1/(X (1/Q + j d)), written in its parts: this is where the time goes, and complex division is slow
        detuning = self.w / frequency - frequency / self.w
        size = 1.0 / (reactance * (quality**-2 + detuning**2))
        arms = np.empty(size.shape, dtype=complex)
        np.multiply(size, 1.0 / quality, out=arms.real)
        np.multiply(size, -detuning, out=arms.imag)
        device = clamped + arms.sum(axis=0)
        z = lead_r + self.s * lead_l + 1.0 / device
        return clamped, arms, z, 1.0 / (z * device**2)

    def residual(self, parameters: Vector) -> Complexes:
        """Return ln Y_model − ln Y, its phase within ±π."""
        return self._wrapped(-np.log(self._parts(parameters)[2]))

    def _wrapped(self, log_model: Complexes) -> Complexes:
        difference = log_model - self.log_y
        return difference - 2j * pi * np.round(difference.imag / (2.0 * pi))

    def linearised(self, parameters: Vector) -> tuple[Complexes, Complexes]:
        """Return the residual and its derivatives, shape (parameters, points), which the next call overwrites."""
        clamped, arms, z, chain = self._parts(parameters)
        frequency, reactance, quality = _columns(parameters)
        by_reactance = -arms * chain
        slope = by_reactance * arms
        if len(parameters) != len(self._jacobian):
            self._jacobian = np.empty((len(parameters), len(self.w)), dtype=complex)
        jacobian = self._jacobian
        inductance_slope = -self.s / (z * np.exp(parameters[0]) * self.w[-1] ** 2)
        jacobian[0] = chain * clamped - inductance_slope * parameters[3]
        jacobian[1] = -chain * clamped**2 * np.exp(-parameters[0])
        jacobian[2] = -1.0 / z
        jacobian[3] = inductance_slope
        jacobian[GLOBALS::3] = slope * (-1j * reactance * (self.w / frequency + frequency / self.w))
        jacobian[GLOBALS + 1 :: 3] = by_reactance
        jacobian[GLOBALS + 2 :: 3] = slope * (-reactance / quality)
        return self._wrapped(-np.log(z)), jacobian

    def bounds(self, arms: int) -> tuple[Vector, Vector]:
        """Return the least and greatest value of every parameter."""
        margin = _MARGIN * (self.w[-1] - self.w[0])
        lowest = max(self.w[0] - margin, 0.5 * self.w[0])
        highest = self.w[-1] + margin
        leads = (1e3, _LONGEST_LEADS) if self.leads else (0.0, 0.0)
        least = np.array([-25.0, 0.0, 0.0, 0.0, *([log(lowest), -25.0, log(_LOWEST_QUALITY)] * arms)])
        greatest = np.array([25.0, 2.0, *leads, *([log(highest), 25.0, log(_HIGHEST_QUALITY)] * arms)])
        return least, greatest

    # --- descent ---

    def descend(self, start: Vector, *, steps: int = 100, tolerance: float = 1e-8) -> Solution:
        """Descend from start values to the nearest minimum within the bounds."""
        least, greatest = self.bounds((len(start) - GLOBALS) // 3)
        parameters, cost = descend(
            self.normal_equations, start, (least, greatest), self._reach, steps=steps, tolerance=tolerance
        )
        return Solution(parameters, cost)

    def _reach(self, parameters: Vector) -> Vector:
        """Return how far a step may go: an arm by its bandwidth or its distance from the band, in size by e²."""
        frequency = parameters[GLOBALS::3]
        outside = np.maximum(np.maximum(frequency - log(self.w[-1]), log(self.w[0]) - frequency), self.finest)
        reach = np.full(len(parameters), np.inf)
        reach[GLOBALS:] = 2.0
        reach[GLOBALS::3] = np.maximum(2.0 * np.exp(-parameters[GLOBALS + 2 :: 3]), outside)
        return reach

    def normal_equations(self, parameters: Vector) -> NormalEquations:
        """Return the sum of squares, half its gradient, and Gauss and Newton's approximation to half its Hessian.

        Raises:
            SpectrumError: after the deadline, a time of ``time.monotonic()``.
        """
        if time.monotonic() > self.deadline:
            raise SpectrumError("The fit did not end within the time allowed. Allow more, or fit a part of the band.")
        residual, jacobian = self.linearised(parameters)
        return squares(residual, jacobian)

    # --- strategy ---

    def fit_bare(self) -> Solution:
        """Fit the clamped capacitance and the leads alone."""
        resistance = float(np.median((1.0 / self.y).real))
        capacitance = float(np.median(np.maximum(self.y.imag / self.w, 1e-6)))
        return self.descend(np.array([log(capacitance), 0.01, max(resistance, 0.0), 0.0]))

    def fit(self, arms: int, start: Solution | None = None) -> Solution:
        """Fit a given number of arms, from vector fitting and, if given, from a solution with one arm less."""
        best = self.descend(self._start(arms))
        if self._settled(best):
            return best
        # leads and clamped capacitance resonate too, which a wider start takes for one more arm, the highest
        wide = self._start(arms + 1)
        highest = GLOBALS + 3 * int(np.argmax(wide[GLOBALS::3]))
        inductance = float(np.exp(wide[highest + 1] - wide[highest]))
        rivals = self._larger(start) if start is not None else []
        if inductance * np.exp(wide[0]) * self.w[-1] ** 2 < _LONGEST_LEADS:
            rivals.append(self._start(arms, inductance))
        if rivals:
            best = min(best, self.descend(self._race(rivals).parameters), key=COST)
        candidates = [wide]
        while not self._settled(best):
            rival = self._race(self._smaller(self._race(candidates + self._larger(best))))
            if rival.cost > 0.99 * best.cost:
                break
            before, best, candidates = best.cost, self.descend(rival.parameters), []
            if best.cost > before / 3.0:  # an arm that was really missing brings far more
                break
        return best

    def fit_exactly(self, arms: int, bare: Solution) -> Solution:
        """Fit a given number of arms: at once, or if they leave the band, one after the other."""
        best = self.fit(arms, bare if arms == 1 else None)
        if arms > 1 and not self.resonances(best):
            chained = bare
            for count in range(1, arms + 1):
                chained = self.fit(count, chained)
            best = min(best, chained, key=COST)
        return best

    def search(self, bare: Solution, progress: Callable[[int, int], object] | None) -> list[Solution]:
        """Fit one arm, two arms and so on, until the residuals hide no further one."""
        solutions: list[Solution] = []
        most = min(SEARCHED_ARMS, (2 * len(self.w) - GLOBALS - 1) // 3)
        for arms in range(1, most + 1):
            if progress is not None:
                progress(arms, most)
            solutions.append(self.fit(arms, solutions[-1] if solutions else bare))
            if solutions[-1].cost < _FLOOR**2 * len(self.w) or (arms > 1 and self._settled(solutions[-2])):
                break
        return solutions

    def _start(self, arms: int, lead_inductance: float = 0.0) -> Vector:
        """Return start values for so many arms behind leads of a given inductance."""
        y: Complexes = 1.0 / (1.0 / self.y - self.s * lead_inductance)
        poles = _relocated_poles(self.s, y, arms)
        frequency = np.abs(poles)
        quality = np.clip(frequency / (2.0 * np.abs(poles.real)), 1.0, 1e5)
        ratio = self.w / frequency[:, None]
        shapes = 1.0 / (1.0 + 1j * quality[:, None] * (ratio - 1.0 / ratio))
        stacked = (np.vstack([self.s, self.w**2 + 0j, shapes]) / np.abs(y)).view(float).T
        scale = np.linalg.norm(stacked, axis=0)
        amplitude = nnls(stacked / scale, np.ascontiguousarray(y / np.abs(y)).view(float))[0] / scale
        capacitance = max(amplitude[0], 1e-3 * float(np.median(np.abs(y) / self.w)))
        start = np.zeros(GLOBALS + 3 * arms)
        leads = lead_inductance * capacitance * self.w[-1] ** 2
        start[:GLOBALS] = log(capacitance), max(amplitude[1] / capacitance, 1e-4), 0.0, leads
        start[GLOBALS::3] = np.log(frequency)
        start[GLOBALS + 1 :: 3] = np.log(quality / np.maximum(amplitude[2:], 1e-3))
        start[GLOBALS + 2 :: 3] = np.log(quality)
        return start

    def missing(self, solution: Solution) -> list[tuple[float, Vector]]:
        """Return arms that the residuals ask for, the most significant first: standard deviations, parameters.

        The residual over ∂ln Y/∂Y_d is the device's missing admittance; its weighted mean over a window is compared
        with the mean's own deviation, for windows of all widths.
        """
        residual, chain = -self.residual(solution.parameters), self._parts(solution.parameters)[3]
        deviation = max(sqrt(solution.cost / (2 * len(self.w))), _FLOOR)
        numerator = np.concatenate([[0.0], np.cumsum((residual * chain.conj()).real)])
        denominator = np.concatenate([[0.0], np.cumsum(np.abs(chain) ** 2)])
        found = []
        index, half = np.arange(len(self.w)), 1
        while half == 1 or half < len(self.w) // 4:
            low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(self.w))
            sums, norms = numerator[high] - numerator[low], denominator[high] - denominator[low]
            norms = np.maximum(norms, 1e-15 * denominator[-1])  # differences of sums lose what is smaller
            score = sums / (np.sqrt(norms) * deviation)
            at = int(np.argmax(score))
            width = self.w[high[at] - 1] - self.w[low[at]]
            conductance = max(float(sums[at] / norms[at]), 1e-12)
            quality = min(max(1.5 * self.w[at] / width, 1.0), 1e5)
            found.append((float(score[at]), np.log([self.w[at], quality / conductance, quality])))
            half *= 2
        return sorted(found, key=lambda item: -item[0])

    def _race(self, starts: list[Vector]) -> Solution:
        """Descend a little from every start, and return the one that came lowest."""
        return min((self.descend(start, steps=30, tolerance=1e-3) for start in starts), key=COST)

    def _settled(self, solution: Solution) -> bool:
        """Tell whether the residuals hide no further arm: none stands out, and they look like noise."""
        if solution.cost < _FLOOR**2 * len(self.w):
            return True
        noise = self.independent_points(solution) > 0.5 * len(self.w)
        return noise and self.missing(solution)[0][0] < SIGNIFICANT

    def _larger(self, solution: Solution) -> list[Vector]:
        """Return starts with one more arm, where the residuals ask for it most."""
        return [np.concatenate([solution.parameters, arm]) for _, arm in self.missing(solution)[:2]]

    def _smaller(self, solution: Solution) -> list[Vector]:
        """Return starts with one arm less: without either of the two whose reactances are least certain."""
        variance = np.diag(self.covariance(solution, free=np.ones(len(solution.parameters), dtype=bool)))
        doubtful = GLOBALS + 3 * np.argsort(variance[GLOBALS + 1 :: 3])[-2:]
        return [np.delete(solution.parameters, slice(first, first + 3)) for first in doubtful]

    # --- judgement ---

    def independent_points(self, solution: Solution) -> float:
        """Return the number of independent points: fewer than measured where residuals are no noise."""
        if solution.cost < _FLOOR**2 * len(self.w):
            return float(len(self.w))
        return independent_points(self.residual(solution.parameters))

    def criterion(self, solution: Solution, independent: float) -> float:
        """Return Schwarz's criterion; the lowest is best."""
        variance = max(solution.cost / (2 * len(self.w)), _FLOOR**2)
        return 2.0 * independent * log(variance) + len(solution.parameters) * log(2.0 * independent)

    def covariance(self, solution: Solution, free: NDArray[np.bool_]) -> Vector:
        """Return the covariance of the parameters; zero for those that are not free."""
        _, _, hessian = self.normal_equations(solution.parameters)
        freedom = max(2 * len(self.w) - int(free.sum()), 1)
        variance = solution.cost / freedom * len(self.w) / self.independent_points(solution)
        covariance = np.zeros_like(hessian)
        covariance[np.ix_(free, free)] = variance * inverse(hessian[np.ix_(free, free)])
        return covariance

    def free(self, solution: Solution) -> NDArray[np.bool_]:
        """Tell which parameters are inside their range; zero loss and zero leads count as inside."""
        least, greatest = self.bounds(solution.arms)
        least[1:GLOBALS] = -1.0
        return (solution.parameters > least) & (solution.parameters < greatest)

    def resonances(self, solution: Solution) -> list[int]:
        """Return the arms that resonate in the band."""
        frequency = np.exp(solution.parameters[GLOBALS::3])
        quality = np.exp(solution.parameters[GLOBALS + 2 :: 3])
        inside = (frequency >= self.w[0]) & (frequency <= self.w[-1]) & (quality >= RESONANT_QUALITY)
        return [int(k) for k in np.flatnonzero(inside)]

    def overlap(self, solution: Solution) -> float:
        """Return the mean bandwidth of two neighbouring resonances over their distance, at its greatest.

        Above one they share a single peak: they do not stand for two modes, but for one that is no circle.
        """
        frequency, _, quality = np.exp(solution.parameters[GLOBALS:].reshape(-1, 3)[self.resonances(solution)]).T
        order = np.argsort(frequency)
        frequency, bandwidth = frequency[order], (frequency / quality)[order]
        distance = np.maximum(np.diff(frequency), 1e-12)
        return float(np.max(0.5 * (bandwidth[1:] + bandwidth[:-1]) / distance, initial=0.0))

    def rms_relative_error(self, solution: Solution) -> float:
        """Return the root mean square of |Y_model/Y − 1|."""
        return float(np.sqrt(np.mean(np.abs(np.expm1(self.residual(solution.parameters))) ** 2)))


def thinning(y: Complexes, most: int) -> NDArray[np.intp]:
    """Return the places of at most so many points, both ends among them.

    One half of them is spread evenly. The other half lies where ln Y changes by more than noise, as at a resonance: in
    proportion to the steps between means of blocks of neighbours, of which a few fit into each of the thinned points.
    """
    block = -(-len(y) // (2 * most))
    edges = np.arange(0, len(y), block)
    counts = np.diff(edges, append=len(y))
    means = np.add.reduceat(y, edges) / counts
    with np.errstate(all="ignore"):
        steps = np.nan_to_num(np.abs(np.log(means[1:] / means[:-1])), posinf=0.0)
    steps = np.maximum(steps - _NOISE_STEPS * np.median(steps), 0.0)
    change = np.append(steps, 0.0) + np.append(0.0, steps)
    share = 1.0 / len(y) + np.repeat(change / counts, counts) / max(float(change.sum()), 1e-300)
    grown = np.cumsum(share)
    places = np.searchsorted(grown, np.linspace(0.0, grown[-1], most - 1))
    return np.unique(np.append(np.minimum(places, len(y) - 1), len(y) - 1))


def _columns(parameters: Vector) -> Vector:
    """Return the arms' frequencies, reactances and quality factors, each as a column."""
    columns: Vector = np.exp(parameters[GLOBALS:]).reshape(-1, 3).T[:, :, None]
    return columns


def squares(residual: Complexes, jacobian: Complexes) -> NormalEquations:
    """Return sum of squares, half its gradient and half its Hessian of a complex residual and its derivatives."""
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

    Args:
        equations: see :func:`squares`, as functions of the parameters.
        start: start values, clipped to the bounds.
        bounds: least and greatest values.
        reach: how far each parameter may go in one step.
        steps: number of steps at most.
        tolerance: relative fall of the sum of squares at which the descent ends.
    """
    least, greatest = bounds
    parameters = np.clip(start, least, greatest)
    cost, gradient, hessian = equations(parameters)
    damping, growth = 1e-3, 2.0
    for _ in range(steps):
        held = ((parameters <= least) & (gradient > 0.0)) | ((parameters >= greatest) & (gradient < 0.0))
        step = _damped_step(gradient, hessian, ~held, damping)
        if damping <= 1.0 and float(-gradient @ step) <= 1e-3 * tolerance * cost:
            break
        step *= min(1.0, float(np.min(reach(parameters) / np.maximum(np.abs(step), 1e-300))))
        trial = np.clip(parameters + step, least, greatest)
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


def independent_points(residual: Complexes) -> float:
    """Return the number of independent residuals: twice that of their changes of sign, as of white noise."""
    count = len(residual)
    changes = 0.5 * sum(np.count_nonzero(np.diff(np.signbit(part))) for part in (residual.real, residual.imag))
    return float(count) if 2.0 * changes > count - 3.0 * sqrt(count) else 2.0 * changes + 1.0


def inverse(hessian: Vector) -> Vector:
    """Return the inverse of a symmetric matrix that may be ill-scaled; what it leaves undetermined becomes large."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    result = np.linalg.pinv(hessian * scale[:, None] * scale, rcond=1e-15, hermitian=True)
    return np.asarray(result * scale[:, None] * scale)


def _damped_step(gradient: Vector, hessian: Vector, free: NDArray[np.bool_], damping: float) -> Vector:
    """Return Levenberg and Marquardt's step; parameters that are not free stay."""
    step = np.zeros_like(gradient)
    diagonal = np.diag(hessian)[free]
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-30 * max(float(diagonal.max(initial=0.0)), 1e-270)))
    matrix = hessian[np.ix_(free, free)] * scale[:, None] * scale + damping * np.eye(len(scale))
    step[free] = np.linalg.solve(matrix, -gradient[free] * scale) * scale
    return step


def _relocated_poles(s: Complexes, y: Complexes, count: int, rounds: int = 12) -> Complexes:
    """Fit by vector fitting: relocate pole pairs until they settle; return those in the upper half plane."""
    poles = (-0.01 + 1j) * np.geomspace(s[0].imag, s[-1].imag, count + 2)[1:-1]
    weight = 1.0 / np.abs(y)[:, None]
    background = s[:, None] ** np.arange(3)  # the clamped capacitance is s, its loss s²
    target = np.ascontiguousarray(y * weight[:, 0]).view(float)
    for _ in range(rounds):
        basis = _pole_basis(s, poles)
        system = np.hstack([basis, background, -y[:, None] * basis]) * weight
        stacked: Vector = np.ascontiguousarray(system.T).view(float).T
        # the triangular factor has all that the least squares needs, and is small
        triangle: Vector = np.asarray(np.linalg.qr(np.column_stack([stacked, target]), mode="r"))
        scale = np.maximum(np.linalg.norm(triangle[:, :-1], axis=0), 1e-300)
        solution = np.linalg.lstsq(triangle[:, :-1] / scale, triangle[:, -1], rcond=None)[0] / scale
        moved = _only_pairs(_zeros_of_sigma(poles, solution[-2 * count :]), count, s.imag)
        settled = np.all(np.abs(moved - poles) < 0.02 * np.abs(moved.real))  # half a bandwidth: near enough to descend
        poles = moved
        if settled:
            break
    return poles


def _pole_basis(s: Complexes, poles: Complexes) -> Complexes:
    """Return two columns for each pair of poles, so that real coefficients give a real impulse response."""
    below, above = 1.0 / (s[:, None] - poles), 1.0 / (s[:, None] - poles.conj())
    basis = np.empty((len(s), 2 * len(poles)), dtype=complex)
    basis[:, ::2], basis[:, 1::2] = below + above, 1j * (below - above)
    return basis


def _zeros_of_sigma(poles: Complexes, residues: Vector) -> Complexes:
    """Return the zeros of 1 + Σ residues over (s − poles), which are the relocated poles."""
    matrix = np.zeros((2 * len(poles), 2 * len(poles)))
    for k, pole in enumerate(poles):
        matrix[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
        matrix[2 * k] -= 2.0 * residues
    return np.asarray(np.linalg.eigvals(matrix), dtype=complex)


def _only_pairs(values: Complexes, count: int, w: Vector) -> Complexes:
    """Return stable pole pairs by rising frequency; a real pole becomes a broad pair in the band."""
    pairs = values[values.imag > 0.0]
    pairs = -np.maximum(np.abs(pairs.real), 1e-9 * pairs.imag) + 1j * pairs.imag  # none may lie on a point
    real = np.sort(np.abs(values[values.imag == 0.0].real))[: count - len(pairs)]
    spread = 1.0 + 0.01 * np.arange(len(real))  # two of them must not coincide
    pairs = np.concatenate([pairs, (-0.05 + 1j) * np.clip(real, w[0], w[-1]) * spread])
    return np.asarray(pairs[np.argsort(pairs.imag)])
