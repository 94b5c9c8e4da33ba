# SPDX-License-Identifier: GPL-3.0-or-later
r"""The least-squares problem behind :func:`~pyspice_runner.spectra.fit.fit_spectrum`.

**Objective.** The residual is the difference between model and measurement in the quantity whose error is the same at
all
points (:mod:`.noise`): ln Y for an analyser whose error is a share of what it measures, the reflection coefficient for
a network analyser.

**Parameters** are the logarithms of C₀ and of each arm's frequency, reactance √(L/C) and quality factor, so that every
arm is passive; three parts of the loss tangent, R_ℓ and L_ℓ are bounded by zero. With coupled damping each arm has
further parameters b_k: the damping matrix is :math:`D = \operatorname{diag}(\omega_n/Q_n) + BB^T`,
:math:`B_{nk} = \sqrt{\omega_n}\,b_{nk}`, which is positive definite. The clamped capacitance takes part in it.
Levenberg–Marquardt steps use the exact Jacobian: with
:math:`v = (j\omega + D + K/j\omega)^{-1}\theta` (by Woodbury's formula) it is :math:`\partial Y = 2 v^T \partial\theta
-
v^T (\partial D + \partial K/j\omega) v`. An arm may leave the measured band by a quarter of its span: it then
stands for the modes out there. If the number of arms is stated, and they cannot follow the spectrum to the noise, arms
may stand up to a decade from the band, and the coupling has its highest rank.

**Start.** Vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999, doi:10.1109/61.772353) gives the
poles, non-negative least squares the amplitudes. Then the residuals are searched, by a matched filter over frequency
and bandwidth, for an arm that is missing: it is added, the least certain arm is taken out, and the better fit is kept.
The coupling starts from the leading eigenvectors of the off-diagonal damping that one linear step asks for.

**Choice.** Schwarz's criterion, BIC = 2 n ln σ² + p ln 2n, of n independent points and p parameters, decides on the
number
of arms, the rank of the coupling, the parts of the loss and the leads. Where the circuit cannot follow a real device,
residuals are no noise but correlated, and n is lowered to the equivalent number of independent ones; standard errors
grow accordingly. Descriptions of the loss and the leads that are about as probable by the criterion (a difference d
makes one less probable by exp(d/2)) add the spread of their values to the errors. Leads are looked for only where the
fit with them follows the spectrum to the noise: in what a model leaves over otherwise, leads are not seen.

**Long spectra.** The time of the search is proportional to the number of points. Of more than ``MOST_SEARCHED`` points
the search takes those of :func:`thinning`; a last descent takes all points.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import inf, log, pi, sqrt
from operator import attrgetter, itemgetter

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy.optimize import nnls

from pyspice_runner.errors import SpectrumError
from pyspice_runner.model.dielectric import LARGEST_LOSS_TANGENT
from pyspice_runner.model.equivalent import constant_loss
from pyspice_runner.spectra.noise import Noise, difference

GLOBALS = 6  # parameters that are no arm's: ln C₀; tan δ that falls, stays, rises with frequency; R_ℓ, L_ℓ
LOSSES, LEADS = (1, 2, 3), (4, 5)  # their places
RESONANT_QUALITY = 2.5  # a broader arm rounds off the background, it does not resonate
SIGNIFICANT = 5.0  # standard deviations by which a missing arm stands out of the residuals
MOST_SEARCHED = 4000  # points that the arms are searched with, which takes some 1 ms a point; an analyser writes 1601
SEARCHED_ARMS = 8  # tried when their number is not given
MOST_RANK = 2  # of the coupling; a column gives each pole of Y its complex residue, so that more tell little
PLAUSIBLE_LEADS = 5.0, 1e-5  # Ω and H of a fixture with cables: some 1 µH and less than 1 Ω a metre
_NOISE_STEPS = 3.0  # medians of the steps of ln Y; a greater step is not noise, which exceeds 3 medians in 0.2 %
_BESIDE = np.array([0.05, 0.2, 0.8])  # of that margin, where arms outside the band are tried
_QUALITY_BESIDE = 50.0  # of these
_MARGIN = 0.25  # of the span, by which an arm may lie outside the band
_FARTHEST = 10.0  # of the band's ends, where arms of a stated number may lie outside it
_LOWEST_QUALITY, _HIGHEST_QUALITY = 0.6, 1e6
UNDETERMINED = 0.3  # standard error of ln √(L/C) of an arm that is none
_COUPLED = 1e-4  # relative fall of the sum of squares at which a descent with coupled damping ends
_FINAL_STEPS, _FINAL = 100, 1e-5  # of the last descents with a stated number of arms
_TERMS = 10  # of the polynomials in the loss tangent, for an accuracy of 1e-10
_STEP = 1e-6  # of central differences of functions that are smooth over 1
_RIDGE = 1e-4  # of the sum of squares, for couplings as large as the arms' own losses
_FLAT = 1e-12  # share of the greatest eigenvalue below which a direction changes nothing
# of the criterion, twice what is very strong evidence (Kass and Raftery, doi:10.2307/2291091): one in 60 spectra
# exceeds 10 by noise
_TIE = 20.0
_FINEST = 1e-5  # relative residual below which nothing is left to be found
_MISFIT = 1e-3  # relative residual above which damping may be coupled; analysers are accurate to half of it at best
_EXACT = 1e-24  # sum of squares of a fit that nothing can improve
_FLOOR = 1e-8  # relative accuracy that no measurement exceeds

Vector = NDArray[np.float64]
Complexes = NDArray[np.complex128]
NormalEquations = tuple[float, Vector, Vector]


@dataclass(frozen=True)
class Solution:
    """Parameters, in the problem's own units, and their sum of squared residuals.

    Attributes:
        parameters: ``GLOBALS``, then three of each arm, then the couplings b of the clamped capacitance and of each
            arm.
        cost: sum of squares.
        arms: number of arms.
        held: places of the parameters among ``GLOBALS`` that stay as they are.
        clamped: whether the clamped capacitance takes part in the coupling.
    """

    parameters: Vector
    cost: float
    arms: int
    held: tuple[int, ...] = LEADS
    clamped: bool = False

    @property
    def rank(self) -> int:
        """Rank of the coupling of the arms' damping."""
        return (len(self.parameters) - GLOBALS - 3 * self.arms) // (self.arms + 1)

    @property
    def free_count(self) -> int:
        """Number of independent parameters; the couplings' columns may be rotated among each other."""
        idle = len(self.held) + (0 if self.clamped else self.rank) + self.rank * (self.rank - 1) // 2
        return len(self.parameters) - idle

    @property
    def columns(self) -> Vector:
        """Ln f, ln X and ln Q of the arms, each a row."""
        return self.parameters[GLOBALS : GLOBALS + 3 * self.arms].reshape(-1, 3).T


COST = attrgetter("cost")


class Problem:
    """The least-squares problem in units of its own: ω of the band's geometric centre, the median |Y|."""

    def __init__(
        self,
        frequency_hz: Vector,
        y: Complexes,
        noise: Noise,
        leads: tuple[float, float] = (0.0, 0.0),
        *,
        deadline: float = inf,
    ) -> None:
        self.deadline = deadline
        self.ridge = 0.0  # on the couplings, see the module
        self.far = False  # whether arms may lie up to a decade from the band
        self.reference_hz = sqrt(frequency_hz[0] * frequency_hz[-1])
        self.unit_s = float(np.median(np.abs(y)))
        self.unit_henry = 1.0 / (2.0 * pi * self.reference_hz * self.unit_s)
        self.stated_leads = leads[0] * self.unit_s, leads[1] / self.unit_henry
        self._take(frequency_hz / self.reference_hz, y / self.unit_s)
        self._weigh(noise, y)

    def _take(self, w: Vector, y: Complexes) -> None:
        self.w, self.y = w, y
        self.s: Complexes = np.asarray(1j * w, dtype=complex)
        self.finest = float(np.min(np.diff(np.log(w))))  # distance of the closest points, relative
        self.dielectric = _dielectric(self.s)
        self._jacobian: Complexes = np.empty((0, len(y)), dtype=complex)  # kept, since a new one costs page faults

    def _weigh(self, noise: Noise, smooth_s: Complexes) -> None:
        """Set the error model; ``smooth_s`` is the admittance at all points, as free of noise as it is known."""
        self.noise = noise
        deviation = noise.deviation(smooth_s) / self.unit_s
        size = 1.0 if noise.stated else float(np.median(deviation / np.abs(smooth_s))) * self.unit_s
        slope = np.abs(difference(noise.domain, smooth_s, smooth_s)[1]) * self.unit_s
        self.deviation = deviation / size
        self.weight = 1.0 / (self.deviation * slope)

    def reweighted(self, noise: Noise, smooth_s: Complexes) -> Problem:
        """Return the problem with another error model."""
        other = copy(self)
        other._weigh(noise, smooth_s)
        return other

    def thinned(self) -> Problem:
        """Return the problem with no more than ``MOST_SEARCHED`` of its points, in the same units."""
        if len(self.w) <= MOST_SEARCHED:
            return self
        places = thinning(self.y, MOST_SEARCHED)
        fewer = copy(self)
        fewer._take(self.w[places], self.y[places])
        fewer.weight, fewer.deviation = self.weight[places], self.deviation[places]
        return fewer

    # --- model and its derivatives ---

    def _of_loss(self, loss_tangent: float, derivative: bool = False) -> Complexes:
        """Return the clamped capacitance, of 1 at the reference frequency, with a constant loss tangent."""
        x, orders = 2.0 * loss_tangent / LARGEST_LOSS_TANGENT - 1.0, np.arange(_TERMS)
        factors = x**orders
        if derivative:
            factors = np.append(0.0, orders[1:] * factors[:-1]) * 2.0 / LARGEST_LOSS_TANGENT
        return np.asarray((factors @ self.dielectric).view(complex))

    def _model(self, parameters: Vector, arms: int) -> _Model:
        """Evaluate the model."""
        size, falling, constant, rising, lead_r, lead_l = parameters[:GLOBALS]
        size = np.exp(size)
        inner = size * (self.s * self._of_loss(constant) + falling)
        behind = 1.0 / (1.0 + rising / size * inner)
        clamped = inner * behind
        frequency, reactance, quality = np.exp(parameters[GLOBALS : GLOBALS + 3 * arms]).reshape(-1, 3).T[:, :, None]
        theta = np.sqrt(frequency / reactance)
        own = frequency / quality
        detuning = self.w - frequency**2 / self.w
        # 1/(own + j detuning), written in its parts: this is where the time goes, and complex division is slow
        scale = 1.0 / (own**2 + detuning**2)
        compliance = np.empty(scale.shape, dtype=complex)
        np.multiply(scale, own, out=compliance.real)
        np.multiply(scale, -detuning, out=compliance.imag)
        velocity = compliance * theta
        coupling = couplings(parameters, arms) * np.sqrt(np.vstack([[[1.0 / size]], frequency]))
        first = clamped
        rank = coupling.shape[1]
        shared: Complexes = np.zeros((0, len(self.w)), dtype=complex)
        if rank:  # by Woodbury's formula, see the module
            parts = np.vstack([clamped, compliance])
            shared = (coupling[1:].T @ velocity + np.outer(coupling[0], clamped)).astype(np.complex128)
            if rank == 1:
                shared = np.asarray(shared / (1.0 + (coupling**2).T @ parts), dtype=complex)
            else:
                matrix = np.eye(rank) + np.einsum("ni,np,nj->pij", coupling, parts, coupling, optimize=True)
                shared = np.asarray(np.linalg.solve(matrix, shared.T[:, :, None])[:, :, 0].T, dtype=complex)
            first = clamped - clamped * (coupling[0] @ shared)
            velocity = velocity - compliance * (coupling[1:] @ shared)
        device = first + (theta * velocity).sum(axis=0)
        y = 1.0 / (lead_r + self.s * lead_l + 1.0 / device)
        return _Model(clamped, first, inner, behind, frequency, own, theta, coupling, velocity, shared, device, y)

    def admittance(self, solution: Solution) -> Complexes:
        """Return the fitted admittance, in this problem's unit."""
        return self._model(solution.parameters, solution.arms).y

    def _residual(self, y: Complexes) -> tuple[Complexes, Complexes]:
        """Return the weighted residual and its derivative by Y."""
        unit = self.unit_s
        found, slope = difference(self.noise.domain, y * unit, self.y * unit)
        return found * self.weight, slope * (unit * self.weight)

    def residual(self, parameters: Vector, arms: int) -> Complexes:
        """Return the weighted residual."""
        return self._residual(self._model(parameters, arms).y)[0]

    def linearised(self, parameters: Vector, arms: int) -> tuple[Complexes, Complexes]:
        """Return the residual and its derivatives, shape (parameters, points), which the next call overwrites."""
        m = self._model(parameters, arms)
        residual, outer = self._residual(m.y)
        chain = outer * (m.y / m.device) ** 2
        if len(parameters) != len(self._jacobian):
            self._jacobian = np.empty((len(parameters), len(self.w)), dtype=complex)
        jacobian = self._jacobian
        size = np.exp(parameters[0])
        at_clamped = chain * (m.first / m.clamped) ** 2
        inner = at_clamped * m.behind**2
        jacobian[0] = at_clamped * m.clamped
        jacobian[1] = inner * size
        jacobian[2] = inner * size * self.s * self._of_loss(float(parameters[2]), derivative=True)
        jacobian[3] = -inner * m.inner**2 / size
        jacobian[4] = -outer * m.y**2
        jacobian[5] = jacobian[4] * self.s
        last = GLOBALS + 3 * arms
        along = chain * m.velocity
        squared = along * m.velocity
        by_theta = along * m.theta
        jacobian[GLOBALS:last:3] = by_theta - squared * (m.own - 2j * m.frequency**2 / self.w)
        jacobian[GLOBALS + 1 : last : 3] = -by_theta
        jacobian[GLOBALS + 2 : last : 3] = squared * m.own
        if len(m.shared):
            by_shared = np.vstack([chain * m.first, along])[:, None, :] * m.shared
            drift = (m.coupling[:, :, None] * by_shared).sum(axis=1)
            jacobian[0] += drift[0]
            jacobian[GLOBALS:last:3] -= drift[1:]
            root = np.sqrt(np.vstack([[[1.0 / size]], m.frequency]))
            jacobian[last:] = (-2.0 * root[:, :, None] * by_shared).reshape(-1, len(self.w))
        return residual, jacobian

    def bounds(self, solution: Solution) -> tuple[Vector, Vector]:
        """Return the least and greatest value of every parameter."""
        margin = _MARGIN * (self.w[-1] - self.w[0])
        lowest = max(self.w[0] - margin, 0.5 * self.w[0]) if not self.far else self.w[0] / _FARTHEST
        highest = self.w[-1] + margin if not self.far else self.w[-1] * _FARTHEST
        ohm, henry = PLAUSIBLE_LEADS
        arms, rest = solution.arms, solution.rank * (solution.arms + 1)
        least = [-25.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        greatest = [25.0, 2.0, LARGEST_LOSS_TANGENT, 2.0, ohm * self.unit_s, henry / self.unit_henry]
        for place in solution.held:
            least[place] = greatest[place] = solution.parameters[place]
        least += [log(lowest), -25.0, log(_LOWEST_QUALITY)] * arms + [-2.0] * rest
        greatest += [log(highest), 25.0, log(_HIGHEST_QUALITY)] * arms + [2.0] * rest
        low, high = np.array(least), np.array(greatest)
        if not solution.clamped:
            low[GLOBALS + 3 * arms :][: solution.rank] = high[GLOBALS + 3 * arms :][: solution.rank] = 0.0
        return low, high

    # --- descent ---

    def descend(self, start: Solution, *, steps: int = 100, tolerance: float = 1e-8) -> Solution:
        """Descend from start values to the nearest minimum within the bounds."""
        arms = start.arms

        def reach(parameters: Vector) -> Vector:
            """Return how far a step may go: an arm by its bandwidth or its distance from the band, in size by e²."""
            frequency = parameters[GLOBALS : GLOBALS + 3 * arms : 3]
            outside = np.maximum(np.maximum(frequency - log(self.w[-1]), log(self.w[0]) - frequency), self.finest)
            found = np.full(len(parameters), np.inf)
            found[GLOBALS : GLOBALS + 3 * arms] = 2.0
            widths = np.exp(-parameters[GLOBALS + 2 : GLOBALS + 3 * arms : 3])
            if start.rank:
                widths = widths + (couplings(parameters, arms)[1:] ** 2).sum(axis=1)
            found[GLOBALS : GLOBALS + 3 * arms : 3] = np.maximum(2.0 * widths, outside)
            return found

        parameters, cost = descend(
            lambda parameters: self.normal_equations(parameters, arms),
            start.parameters,
            self.bounds(start),
            reach,
            steps=steps,
            tolerance=tolerance,
        )
        return replace(start, parameters=parameters, cost=cost)

    def normal_equations(self, parameters: Vector, arms: int) -> NormalEquations:
        """Return the sum of squares, half its gradient, and Gauss and Newton's approximation to half its Hessian.

        Raises:
            SpectrumError: after the deadline, a time of ``time.monotonic()``.
        """
        if time.monotonic() > self.deadline:
            raise SpectrumError("The fit did not end within the time allowed. Allow more, or fit a part of the band.")
        cost, gradient, hessian = squares(*self.linearised(parameters, arms))
        last = GLOBALS + 3 * arms
        if self.ridge and len(parameters) > last:
            gradient[last:] += self.ridge * parameters[last:]
            hessian[range(last, len(parameters)), range(last, len(parameters))] += self.ridge
            cost += self.ridge * float(parameters[last:] @ parameters[last:])
        return cost, gradient, hessian

    # --- strategy ---

    def fit_bare(self) -> Solution:
        """Fit the clamped capacitance alone, behind plausible leads."""
        capacitance = float(np.median(np.maximum(self.y.imag / self.w, 1e-6)))
        start = np.array([log(capacitance), 0.001, 0.001, 0.001, *self.stated_leads])
        return self.descend(Solution(start, inf, 0))

    def fit(self, arms: int, before: Solution | None = None, quick: bool = False) -> Solution:
        """Fit a given number of arms, from vector fitting and, if given, from a solution with one arm less."""
        best = self.descend(self._start(arms))
        if self.settled(best):
            return best
        if before is not None and before.arms == arms - 1:
            best = min(best, self.descend(self._race(self._larger(before))), key=COST)
        candidates = [self._start(arms + 1)]
        for _ in range(3):
            if quick or self.settled(best):
                break
            rival = self._race(self._smaller(self._race(candidates + self._larger(best))))
            if rival.cost > 0.99 * best.cost:
                break
            cost, best, candidates = best.cost, self.descend(rival), []
            if best.cost > cost / 3.0:  # an arm that was really missing brings far more
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

    def with_leads(self, solution: Solution) -> Solution:
        """Return the fit with leads besides."""
        held = tuple(place for place in solution.held if place not in LEADS)
        starts = []
        for share in (0.0, 0.1):
            parameters = solution.parameters.copy()
            parameters[list(LEADS)] = (
                share * PLAUSIBLE_LEADS[0] * self.unit_s,
                share * PLAUSIBLE_LEADS[1] / self.unit_henry,
            )
            starts.append(replace(solution, parameters=parameters, held=held))
        return self.descend(self._race(starts))

    def coupled(self, solution: Solution) -> Solution:
        """Return the fit with damping coupled by one column, from that which one linear step asks for."""
        arms, last = solution.arms, GLOBALS + 3 * solution.arms
        self.ridge = self.ridge or _ridge(solution)
        residual, jacobian = self.linearised(solution.parameters, arms)
        m = self._model(solution.parameters, arms)
        chain = self._residual(m.y)[1] * (m.y / m.device) ** 2
        currents = np.sqrt(m.frequency) * m.velocity
        first, second = np.triu_indices(arms, 1)
        asked = -2.0 * chain * currents[first] * currents[second]
        free = [k for k in range(last) if k not in solution.held]
        system = np.vstack([jacobian[free], asked]).view(float).T
        scale = np.maximum(np.linalg.norm(system, axis=0), 1e-300)
        step = np.linalg.lstsq(system / scale, -residual.view(float), rcond=1e-6)[0] / scale
        own = np.exp(-solution.columns[2])
        matrix = np.diag(own)
        limit = np.sqrt(own[first] * own[second])
        matrix[first, second] = matrix[second, first] = np.clip(step[len(free) :], -limit, limit)
        values, vectors = np.linalg.eigh(matrix)
        starts = []
        for share in (0.5, 0.9):
            column = vectors[:, -1] * np.sqrt(values[-1])
            column = column * np.minimum(1.0, np.sqrt(share * own / np.maximum(column**2, 1e-300)))
            parameters = solution.parameters.copy()
            parameters[GLOBALS + 2 : last : 3] = -np.log(own - column**2)
            # one arm alone shares with the clamped capacitance only, which loses little itself
            clamped = (0.1, -0.1) if arms == 1 else (0.0,)
            starts += [
                replace(solution, parameters=np.concatenate([parameters, [size], column]), clamped=arms == 1)
                for size in clamped
            ]
        return self.descend(self._race(starts), tolerance=_COUPLED)

    def wider(self, solution: Solution) -> list[Solution]:
        """Return fits with more coupling: of the clamped capacitance too, and by one more column."""
        found = [] if solution.clamped else [self.descend(replace(solution, clamped=True), tolerance=_COUPLED)]
        if solution.rank < MOST_RANK and solution.arms > 1:
            signs = np.array([[0.0], *[[(-1.0) ** k] for k in range(solution.arms)]])
            more = 0.1 * np.append(0.0, np.exp(-0.5 * solution.columns[2]))[:, None] * signs
            columns = np.hstack([couplings(solution.parameters, solution.arms), more])
            head = solution.parameters[: GLOBALS + 3 * solution.arms]
            start = replace(solution, parameters=np.concatenate([head, columns.ravel()]))
            found.append(self.descend(start, tolerance=_COUPLED))
        return found

    def reaching(self, solution: Solution) -> Problem:
        """Return the problem in which arms may lie far from the band, with the ridge that a solution asks for."""
        other = copy(self)
        other.far, other.ridge = True, min(self.ridge, _ridge(solution))
        return other

    def polished(self, solution: Solution) -> list[Solution]:
        """Return fits with the coupling as wide as it may be, from one with as many arms."""
        found = self.descend(replace(solution, clamped=True), steps=_FINAL_STEPS, tolerance=_FINAL)
        rest = [self.descend(more, steps=_FINAL_STEPS, tolerance=_FINAL) for more in self.wider(found)]
        return [found, *rest]

    def search(
        self, bare: Solution, leads: bool, progress: Callable[[int, int], object] | None, only: int | None = None
    ) -> list[Solution]:
        """Fit one arm, two arms and so on, until the residuals hide no further one; or only one number of arms.

        Of each number that does not leave noise alone, there are a fit with leads, if it does, and one with coupled
        damping.
        """
        solutions: list[Solution] = []
        plain, coupled, costs = bare, None, list[float]()
        most = min(SEARCHED_ARMS, (2 * len(self.w) - GLOBALS - 1) // 3)
        for arms in range(1, most + 1) if only is None else (only,):
            if progress is not None:
                progress(arms, most)
            settled = arms > 1 and any(self.settled(solution) for solution in solutions)
            # where coupling does far better than arms with one resistance each, these need no long search
            quick = coupled is not None and coupled.cost < 0.5 * plain.cost
            plain = self.fit(arms, plain, quick) if only is None else self.fit_exactly(arms, bare)
            solutions.append(plain)
            if not self.settled(plain) and not settled:
                behind = self.with_leads(plain) if leads else plain
                if self.settled(behind):
                    solutions[-1] = behind
                elif arms > 1 and plain.cost > _MISFIT**2 * len(self.w):
                    coupled = self._grown(plain, coupled or self.coupled(self.fit(2, bare, quick=True)))
                    solutions.append(coupled)
            if solutions[-1].cost < _FLOOR**2 * len(self.w) or settled:
                break
            costs.append(min(solutions, key=COST).cost)
            if len(costs) >= 3 and (costs[-1] > 0.8 * costs[-3] or not any(map(self.resonances, solutions))):
                break  # more arms bring nothing, or none of them rings
            if len(costs) >= 2 and costs[-2] < _MISFIT**2 * len(self.w) and len(self.resonances(plain)) < arms:
                break  # no analyser shows what is left, and what follows it rings nowhere
        if (
            solutions[0].arms == 1
            and solutions[0].cost > _MISFIT**2 * len(self.w)
            and not any(map(self.settled, solutions))
        ):
            solutions.insert(1, self.coupled(solutions[0]))
        return solutions

    def _grown(self, plain: Solution, coupled: Solution) -> Solution:
        """Return a fit with coupled damping and as many arms as a plain one, from that and from one with fewer."""
        while coupled.arms < plain.arms:
            coupled = self.descend(self._race(self._larger(coupled)), tolerance=_COUPLED)
        return min(self.coupled(plain), coupled, key=COST)

    def simplified(self, solution: Solution, points: float, leads: bool) -> list[tuple[float, Solution]]:
        """Take out the parts of the loss that the criterion does not ask for, look for leads, and descend.

        Return the descriptions that were tried, each with its score, the best first.

        Leads have both resistance and inductance. Over a narrow band they cancel the dispersion of a constant loss
        tangent, so that it resembles a falling and a rising part together: beside leads, a second part of the loss
        needs evidence as strong as the leads themselves.
        """

        def score(rival: Solution) -> float:
            led = not set(LEADS) & set(rival.held)
            several = len(set(LOSSES) - set(rival.held)) > 1
            return self.criterion(rival, points) + _TIE * (led + (led and several))

        def variants(losses: Sequence[tuple[int, ...]], places: tuple[int, ...]) -> list[Solution]:
            found = []
            for free in losses:
                parameters = solution.parameters.copy()
                held = tuple(place for place in (*LOSSES, *LEADS) if place not in (*free, *places))
                total = parameters[list(LOSSES)].sum() / max(len(free), 1)
                parameters[list(LOSSES)] = [total if place in free else 0.0 for place in LOSSES]
                if not set(LEADS) <= set(solution.held):
                    parameters[[place for place in LEADS if place not in places]] = 0.0
                found.append(self.descend(replace(solution, parameters=parameters, held=held)))
            return found

        found = [solution]
        if set(LEADS) <= set(solution.held):
            found += variants([(), (3,), (2,), (1, 3)], ())
            white = leads and points > 0.5 * len(self.w)
            if white and self._leads_promise(min(found, key=score)) > log(2.0 * points):
                found += variants([(), (3,), (2,), (1, 3)], LEADS)
        else:
            found += variants([(), (3,), (2,), (1, 3)], LEADS)
        return sorted(((score(rival), rival) for rival in found), key=itemgetter(0))

    def _leads_promise(self, solution: Solution) -> float:
        """Return how much leads would lower the sum of squares by one linear step, in units of the error's variance."""
        _, gradient, hessian = squares(*self.linearised(solution.parameters, solution.arms))
        free = [k for k in range(len(gradient)) if k not in solution.held]
        both = [*free, *LEADS]
        fall = [float(gradient[part] @ inverse(hessian[np.ix_(part, part)]) @ gradient[part]) for part in (both, free)]
        return (fall[0] - fall[1]) / max(solution.cost / (2 * len(self.w)), _FLOOR**2)

    def _start(self, arms: int) -> Solution:
        """Return start values for so many arms."""
        y: Complexes = 1.0 / (1.0 / self.y - self.stated_leads[0] - self.s * self.stated_leads[1])
        weight = 1.0 / self.deviation
        poles = _relocated_poles(self.s, y, arms, weight)
        frequency = np.abs(poles)
        quality = np.clip(frequency / (2.0 * np.abs(poles.real)), 1.0, 1e5)
        ratio = self.w / frequency[:, None]
        shapes = 1.0 / (1.0 + 1j * quality[:, None] * (ratio - 1.0 / ratio))
        stacked = (np.vstack([self.s, self.s * self._of_loss(0.0, derivative=True), shapes]) * weight).view(float).T
        scale = np.linalg.norm(stacked, axis=0)
        amplitude = nnls(stacked / scale, np.ascontiguousarray(y * weight).view(float))[0] / scale
        capacitance = max(amplitude[0], 1e-3 * float(np.median(np.abs(y) / self.w)))
        start = np.zeros(GLOBALS + 3 * arms)
        loss = min(max(amplitude[1] / capacitance, 1e-4), 0.5 * LARGEST_LOSS_TANGENT)
        start[:GLOBALS] = log(capacitance), 0.1 * loss, 0.8 * loss, 0.1 * loss, *self.stated_leads
        start[GLOBALS::3] = np.log(frequency)
        start[GLOBALS + 1 :: 3] = np.log(quality / np.maximum(amplitude[2:], 1e-3))
        start[GLOBALS + 2 :: 3] = np.log(quality)
        return Solution(start, inf, arms)

    def missing(self, solution: Solution) -> list[tuple[float, Vector]]:
        """Return arms that the residuals ask for, the most significant first: standard deviations, parameters.

        The residual over its derivative by Y_d is the device's missing admittance; its weighted mean over a window is
        compared with the mean's own deviation, for windows of all widths.
        """
        m = self._model(solution.parameters, solution.arms)
        residual, outer = self._residual(m.y)
        chain = outer * (m.y / m.device) ** 2
        deviation = max(sqrt(solution.cost / (2 * len(self.w))), _FLOOR)
        numerator = np.concatenate([[0.0], np.cumsum((-residual * chain.conj()).real)])
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

    def _beside(self, solution: Solution) -> list[tuple[float, Vector]]:
        """Return arms outside the band that the residuals ask for: standard deviations, parameters."""
        m = self._model(solution.parameters, solution.arms)
        residual, outer = self._residual(m.y)
        chain = outer * (m.y / m.device) ** 2
        deviation = max(sqrt(solution.cost / (2 * len(self.w))), _FLOOR)
        distance = _BESIDE * _MARGIN * (self.w[-1] - self.w[0])
        found = []
        for place in np.concatenate([self.w[0] - distance, self.w[-1] + distance]):
            if place <= 0.5 * self.w[0]:
                continue
            effect = chain / (1.0 / _QUALITY_BESIDE + 1j * (self.w / place - place / self.w))
            asked, norm = float(np.sum((-residual * effect.conj()).real)), float(np.sum(np.abs(effect) ** 2))
            conductance = max(asked / norm, 1e-12)
            arm = np.log([place, _QUALITY_BESIDE / conductance, _QUALITY_BESIDE])
            found.append((asked / (sqrt(norm) * deviation), arm))
        return found

    def _race(self, starts: Sequence[Solution]) -> Solution:
        """Descend a little from every start, and return the one that came lowest."""
        return min((self.descend(start, steps=30, tolerance=1e-3) for start in starts), key=COST)

    def settled(self, solution: Solution) -> bool:
        """Tell whether the residuals hide no further arm: none stands out, and they look like noise."""
        if solution.cost < _FINEST**2 * len(self.w):
            return True
        noise = self.independent_points(solution) > 0.5 * len(self.w)
        return noise and self.missing(solution)[0][0] < SIGNIFICANT

    def _larger(self, solution: Solution) -> list[Solution]:
        """Return starts with one more arm, where the residuals ask for it most."""
        last = GLOBALS + 3 * solution.arms
        head, tail = solution.parameters[:last], np.zeros(solution.rank)
        asked = self.missing(solution)
        if solution.rank:
            asked = sorted(asked + self._beside(solution), key=lambda item: -item[0])
        return [
            replace(
                solution,
                parameters=np.concatenate([head, arm, solution.parameters[last:], tail]),
                arms=solution.arms + 1,
            )
            for _, arm in asked[:2]
        ]

    def _smaller(self, solution: Solution) -> list[Solution]:
        """Return starts with one arm less: without either of the two whose reactances are least certain."""
        variance = np.diag(self.covariance(solution))
        doubtful = GLOBALS + 3 * np.argsort(variance[GLOBALS + 1 : GLOBALS + 3 * solution.arms : 3])[-2:]
        return [
            replace(
                solution, parameters=np.delete(solution.parameters, slice(first, first + 3)), arms=solution.arms - 1
            )
            for first in doubtful
        ]

    # --- judgement ---

    def independent_points(self, solution: Solution) -> float:
        """Return the number of independent points: fewer than measured where residuals are no noise."""
        if solution.cost < _FLOOR**2 * len(self.w):
            return float(len(self.w))
        return independent_points(self.residual(solution.parameters, solution.arms))

    def criterion(self, solution: Solution, independent: float) -> float:
        """Return Schwarz's criterion; the lowest is best."""
        variance = max(solution.cost / (2 * len(self.w)), _FLOOR**2)
        if self.noise.stated and independent == len(self.w):
            return 2.0 * solution.cost + solution.free_count * log(2.0 * independent)
        return 2.0 * independent * log(variance) + solution.free_count * log(2.0 * independent)

    def covariance(self, solution: Solution, free: NDArray[np.bool_] | None = None) -> Vector:
        """Return the covariance of the parameters; zero for those that are not free."""
        _, _, hessian = squares(*self.linearised(solution.parameters, solution.arms))
        if free is None:
            free = np.ones(len(solution.parameters), dtype=bool)
            free[list(solution.held)] = False
        freedom = max(2 * len(self.w) - solution.free_count, 1)
        independent = self.independent_points(solution)
        variance = solution.cost / freedom * len(self.w) / independent
        if self.noise.stated and independent == len(self.w):
            variance = 0.5
        covariance = np.zeros_like(hessian)
        covariance[np.ix_(free, free)] = variance * inverse(hessian[np.ix_(free, free)])
        return covariance

    def free(self, solution: Solution) -> NDArray[np.bool_]:
        """Tell which parameters are not known: those inside their range, and leads that are looked for.

        Leads that came out as zero may as well be greater by their error, and the arms' values with them.
        """
        least, greatest = self.bounds(solution)
        free = (solution.parameters > least) & (solution.parameters < greatest)
        free[[place for place in LEADS if place not in solution.held]] = True
        return free

    def resonances(self, solution: Solution) -> list[int]:
        """Return the arms that resonate in the band."""
        frequency, _, quality = np.exp(modal(solution.parameters, solution.arms))
        inside = (frequency >= self.w[0]) & (frequency <= self.w[-1]) & (quality >= RESONANT_QUALITY)
        return [int(k) for k in np.flatnonzero(inside)]

    def doubts(self, solution: Solution) -> str:
        """Return why an arm of a solution is none; empty if all are."""
        if solution.cost < _FLOOR**2 * len(self.w):
            return ""
        slope = derivatives(lambda parameters: modal(parameters, solution.arms)[1], solution.parameters)
        variance = np.einsum("ki,ij,kj->k", slope, self.covariance(solution, self.free(solution)), slope)
        if not np.all(variance < UNDETERMINED**2):
            return "an arm is not determined"
        frequency, _, quality = np.exp(solution.columns)
        spacing = np.interp(frequency, 0.5 * (self.w[1:] + self.w[:-1]), np.diff(self.w))
        narrow = np.flatnonzero(frequency / quality < spacing) if not solution.rank else ()
        for k in narrow:
            far = np.abs(self.w - frequency[k]) > 1.5 * spacing[k]
            m = self._model(solution.parameters, solution.arms)
            effect = (self._residual(m.y)[1] * (m.y / m.device) ** 2 * m.theta[k] * m.velocity[k])[far]
            if float(np.sum(np.abs(effect) ** 2)) < SIGNIFICANT**2 * solution.cost / len(self.w):
                return "an arm is narrower than the points"
        return ""

    def rms_relative_error(self, solution: Solution) -> float:
        """Return the root mean square of |Y_model/Y − 1|."""
        return float(np.sqrt(np.mean(np.abs(self.admittance(solution) / self.y - 1.0) ** 2)))


@dataclass(frozen=True)
class _Model:
    """Values of the model at all points, for its derivatives."""

    clamped: Complexes  # Y₀ with its series loss
    first: Complexes  # current of the clamped capacitance
    inner: Complexes  # Y₀ without it
    behind: Complexes  # ratio of the two
    frequency: Vector
    own: Vector  # the arms' own damping, 1/s
    theta: Vector
    coupling: Vector  # B
    velocity: Complexes  # v
    shared: Complexes  # Bᵀv
    device: Complexes  # Y behind the leads
    y: Complexes


def modal(parameters: Vector, arms: int) -> Vector:
    """Return ln f, ln X and ln Q of the resonances, each a row, by rising frequency.

    They are those of the poles p and residues c of Y, which do not depend on how a coupled damping is shared out:
    ω is the magnitude of p, Q = −ω / (2 Re p), L = 1 / (2 Re c), X = ωL. Of arms without coupling they are the arms'
    own.
    """
    own = parameters[GLOBALS : GLOBALS + 3 * arms].reshape(-1, 3)
    coupling = couplings(parameters, arms)[1:]
    if not coupling.size:
        return own[np.argsort(own[:, 0])].T
    frequency, reactance, quality = np.exp(own).T
    scaled = np.sqrt(frequency)[:, None] * coupling
    spring = np.diag(frequency)
    damping = np.diag(frequency / quality) + scaled @ scaled.T
    # states: velocities, and deflections times the arms' frequencies
    poles, vectors = np.linalg.eig(np.block([[-damping, -spring], [spring, np.zeros((arms, arms))]]))
    drive = np.append(np.sqrt(frequency / reactance), np.zeros(arms))
    residues = (drive @ vectors) * np.linalg.solve(vectors, drive)
    order = np.argsort(poles.imag)[arms:]
    size = np.abs(poles[order])
    with np.errstate(all="ignore"):  # of a pole that does not oscillate, or a residue that is no arm's
        found = np.log([size, size / (2.0 * residues[order].real), size / (2.0 * np.abs(poles[order].real))])
    return np.where(poles[order].imag > 0.0, found, np.nan)


def _dielectric(s: Complexes) -> Vector:
    """Return a clamped capacitance over s in units of the reference frequency, by powers of its loss.

    It is interpolated at Chebyshev's nodes, so that the ladder is not computed in every step. The rows are of the
    powers of the loss tangent, scaled from -1 to 1; real and imaginary parts stand side by side.
    """
    nodes = chebyshev.chebpts1(_TERMS)
    values = []
    for loss in 0.5 * LARGEST_LOSS_TANGENT * (nodes + 1.0):
        branches = constant_loss(1.0, float(loss), 1.0)  # at 1 Hz, so that corners in rad/s are 2π
        values.append(np.sum([c / (1.0 + 2.0 * pi * s * r * c) for r, c in branches], axis=0))
    powers: Vector = np.linalg.solve(np.vander(nodes, increasing=True), np.array(values).view(float))
    return powers


def _ridge(solution: Solution) -> float:
    """Return the weight of the ridge at a solution: in proportion to what it leaves, and to its quality factors."""
    width = np.exp(-solution.columns[2])
    if solution.rank:
        width = width + (couplings(solution.parameters, solution.arms)[1:] ** 2).sum(axis=1)
    return _RIDGE * solution.cost * float(np.exp(-np.log(width).mean()))


def derivatives(function: Callable[[Vector], Vector], parameters: Vector) -> Vector:
    """Return the derivatives of a function of the parameters, shape (values, parameters), by central differences."""
    steps = _STEP * np.eye(len(parameters))
    return np.array([(function(parameters + step) - function(parameters - step)) / (2.0 * _STEP) for step in steps]).T


def couplings(parameters: Vector, arms: int) -> Vector:
    """Return the couplings b of the clamped capacitance and the arms, shape (1 + arms, rank)."""
    return parameters[GLOBALS + 3 * arms :].reshape(arms + 1, (len(parameters) - GLOBALS - 3 * arms) // (arms + 1))


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
    result = np.linalg.pinv(hessian * scale[:, None] * scale, rcond=_FLAT, hermitian=True)
    return np.asarray(result * scale[:, None] * scale)


def _damped_step(gradient: Vector, hessian: Vector, free: NDArray[np.bool_], damping: float) -> Vector:
    """Return Levenberg and Marquardt's step; parameters that are not free stay."""
    step = np.zeros_like(gradient)
    diagonal = np.diag(hessian)[free]
    scale = 1.0 / np.sqrt(np.maximum(diagonal, 1e-30 * max(float(diagonal.max(initial=0.0)), 1e-270)))
    matrix = hessian[np.ix_(free, free)] * scale[:, None] * scale + damping * np.eye(len(scale))
    step[free] = np.linalg.solve(matrix, -gradient[free] * scale) * scale
    return step


def _relocated_poles(s: Complexes, y: Complexes, count: int, weights: Vector, rounds: int = 12) -> Complexes:
    """Fit by vector fitting: relocate pole pairs until they settle; return those in the upper half plane."""
    poles = (-0.01 + 1j) * np.geomspace(s[0].imag, s[-1].imag, count + 2)[1:-1]
    weight = weights[:, None]
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
