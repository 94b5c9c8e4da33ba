# SPDX-License-Identifier: GPL-3.0-or-later
"""Selection of the number of arms, the rank of their coupling, the loss and the leads; the fit of each number."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, log

import numpy as np

from pyspice_runner.spectra.identify.arms import COST, GLOBALS, Solution
from pyspice_runner.spectra.identify.descent import Vector
from pyspice_runner.spectra.identify.errors import (
    SIGNIFICANT,
    criterion,
    doubts,
    independent,
    is_exact,
    log_values,
    resonances,
)
from pyspice_runner.spectra.identify.losses import Ranked, simplified, with_leads
from pyspice_runner.spectra.identify.problem import Problem, ridge_of
from pyspice_runner.spectra.identify.starts import larger, missing, smaller, start

SEARCHED_ARMS = 8  # tried when their number is not given
MOST_RANK = 2  # of the coupling; each column adds the complex residues of the poles of Y, and more say little
_COUPLED = 1e-4  # relative decrease of the sum of squares that ends a descent with coupled damping
_FINAL_STEPS, _FINAL = 100, 1e-5  # of the last descents with a stated number of arms
_EXHAUSTED = 1e-5  # relative residual below which there is nothing to find
_MISFIT = 1e-3  # relative residual above which damping may be coupled; analysers are accurate to half of it at best
_DISPERSION = 5e-3  # largest relative residual of a dielectric with another dispersion than the model

Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Candidate:
    """A number of arms that was tried.

    Attributes:
        arms: number of arms.
        rank: rank of the coupling of their damping.
        leads: whether it has leads.
        criterion: Schwarz's information criterion; the lowest is best.
        rms_relative_error: root mean square of the relative residual's magnitude.
        note: reason for rejection at any criterion: an arm is not determined, follows the background, or is narrower
            than the points.
    """

    arms: int
    rank: int
    leads: bool
    criterion: float
    rms_relative_error: float
    note: str = ""


@dataclass(frozen=True)
class Outcome:
    """The result of a selection."""

    problem: Problem  # with the points of the search
    bare: Solution  # without arms
    best: Solution
    points: float  # independent ones
    candidates: tuple[Candidate, ...]  # all numbers of arms that were tried
    shifts: Vector  # differences of the values among the descriptions, see _shifts

    def finds_resonance(self) -> bool:
        """Whether the criterion asks for the selected arms, and one of them resonates in the band."""
        needed = criterion(self.problem, self.best, self.points) < criterion(self.problem, self.bare, self.points)
        return (needed or self.best.cost < 0.5 * self.bare.cost) and bool(resonances(self.problem, self.best))


def select(problem: Problem, modes: int | None, leads: bool, progress: Progress | None) -> Outcome:
    """Try numbers of arms, leads and ranks of the coupling, and select the best by the criterion."""
    bare = fit_bare(problem)
    solutions = _search(problem, bare, leads, progress, modes)
    points = independent(problem, min(solutions, key=COST))
    best = min(solutions, key=lambda solution: criterion(problem, solution, points))
    if best.rank and not settled(problem, best):
        if modes is None:
            solutions += wider(problem, best)
        else:
            problem = problem.reaching(best)
            solutions += polished(problem, best)
    candidates: list[Candidate] = []
    for solution in solutions:
        error = problem.rms_relative_error(solution)
        note = doubts(problem, solution) if modes is None else ""
        fewer = [item.rms_relative_error for item in candidates if item.arms < solution.arms]
        idle = modes is None and len(resonances(problem, solution)) < solution.arms
        if not note and idle and fewer and min(fewer) ** 2 - error**2 < _DISPERSION**2:
            note = "an arm follows the background"
        value = criterion(problem, solution, points)
        candidates.append(Candidate(solution.arms, solution.rank, solution.has_leads, value, error, note))
    among = [k for k in range(len(solutions)) if not candidates[k].note] or [
        k for k in range(len(solutions)) if resonances(problem, solutions[k])
    ]
    chosen = min(among or range(len(solutions)), key=lambda k: candidates[k].criterion)
    # a stated number that cannot follow the spectrum takes the lowest residual
    lowest = [(0.0, min(solutions, key=COST))]
    ranked = lowest if problem.far else simplified(problem, solutions[chosen], points, leads)
    bare = simplified(problem, bare, points, leads=False)[0][1]
    return Outcome(problem, bare, ranked[0][1], points, tuple(candidates), _shifts(ranked))


def _search(
    problem: Problem, bare: Solution, leads: bool, progress: Progress | None, only: int | None = None
) -> list[Solution]:
    """Fit one arm, two arms and so on, until the residuals hide no further one; or only one number of arms.

    For each number that leaves more than noise, add a fit with leads if that leaves only noise, or one with coupled
    damping.
    """
    solutions: list[Solution] = []
    plain, shared, costs = bare, None, list[float]()
    misfit = _MISFIT**2 * len(problem.w)
    most = min(SEARCHED_ARMS, (2 * len(problem.w) - GLOBALS - 1) // 3)
    for arms in range(1, most + 1) if only is None else (only,):
        if progress is not None:
            progress(arms, most)
        done = arms > 1 and any(settled(problem, solution) for solution in solutions)
        # if coupling does far better than arms with one resistance each, these need no long search
        quick = shared is not None and shared.cost < 0.5 * plain.cost
        plain = fit_arms(problem, arms, plain, quick) if only is None else fit_exactly(problem, arms, bare)
        solutions.append(plain)
        if not settled(problem, plain) and not done:
            behind = with_leads(problem, plain) if leads else plain
            if settled(problem, behind):
                solutions[-1] = behind
            elif arms > 1 and plain.cost > misfit:
                shared = grown(problem, plain, shared or coupled(problem, fit_arms(problem, 2, bare, quick=True)))
                solutions.append(shared)
        if is_exact(problem, solutions[-1]) or done:
            break
        costs.append(min(solutions, key=COST).cost)
        if len(costs) >= 3 and (
            costs[-1] > 0.8 * costs[-3] or not any(resonances(problem, solution) for solution in solutions)
        ):
            break  # more arms gain nothing, or none of them rings
        if len(costs) >= 2 and costs[-2] < misfit and len(resonances(problem, plain)) < arms:
            break  # the residual is below the accuracy of analysers, and an arm that follows it rings nowhere
    first = solutions[0]
    if first.arms == 1 and first.cost > misfit and not any(settled(problem, item) for item in solutions):
        solutions.insert(1, coupled(problem, first))
    return solutions


def _shifts(ranked: Ranked) -> Vector:
    """Return the values of rivals less those of the best solution, each times the root of the rival's probability.

    The sum of their squares is the variance by the choice among the descriptions (Hoeting et al., Statistical Science
    14, 1999, doi:10.1214/ss/1009212519).
    """
    odds = np.exp(-0.5 * (np.array([score for score, _ in ranked]) - ranked[0][0]))
    best = log_values(ranked[0][1].parameters, ranked[0][1].arms)
    rivals = zip((odds / odds.sum()).tolist(), ranked, strict=True)
    return np.array([
        np.sqrt(share) * (log_values(item.parameters, item.arms) - best)
        for share, (_, item) in rivals if share > 1e-9
    ])  # fmt: skip


def settled(problem: Problem, solution: Solution) -> bool:
    """Tell whether the residuals hide no further arm: none is significant, and they resemble noise."""
    if solution.cost < _EXHAUSTED**2 * len(problem.w):
        return True
    noise = independent(problem, solution) > 0.5 * len(problem.w)
    return noise and missing(problem, solution)[0][0] < SIGNIFICANT


def fit_bare(problem: Problem) -> Solution:
    """Fit the clamped capacitance alone, behind plausible leads."""
    capacitance = float(np.median(np.maximum(problem.y.imag / problem.w, 1e-6)))
    begin = np.array([log(capacitance), 0.001, 0.001, 0.001, *problem.stated_leads])
    return problem.descend(Solution(begin, inf, 0))


def fit_arms(problem: Problem, arms: int, before: Solution | None = None, quick: bool = False) -> Solution:
    """Fit a number of arms, from vector fitting and from a solution with one arm less, if given."""
    best = problem.descend(start(problem, arms))
    if settled(problem, best):
        return best
    if before is not None and before.arms == arms - 1:
        best = min(best, problem.descend(problem.race(larger(problem, before))), key=COST)
    candidates = [start(problem, arms + 1)]
    for _ in range(3):
        if quick or settled(problem, best):
            break
        rival = problem.race(smaller(problem, problem.race(candidates + larger(problem, best))))
        if rival.cost > 0.99 * best.cost:
            break
        cost, best, candidates = best.cost, problem.descend(rival), []
        if best.cost > cost / 3.0:  # a truly missing arm gains far more
            break
    return best


def fit_exactly(problem: Problem, arms: int, bare: Solution) -> Solution:
    """Fit a stated number of arms: at once, or if they leave the band, one after the other."""
    best = fit_arms(problem, arms, bare if arms == 1 else None)
    if arms > 1 and not resonances(problem, best):
        chained = bare
        for count in range(1, arms + 1):
            chained = fit_arms(problem, count, chained)
        best = min(best, chained, key=COST)
    return best


def coupled(problem: Problem, solution: Solution) -> Solution:
    """Return the fit with damping coupled by one column, started from one linear step."""
    arms, last = solution.arms, solution.last
    problem.ridge = problem.ridge or ridge_of(solution)
    residual, jacobian = problem.linearised(solution.parameters, arms)
    values, _, chain = problem.device_residual(solution)
    currents = np.sqrt(values.frequency) * values.velocity
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
    eigenvalues, vectors = np.linalg.eigh(matrix)
    starts = []
    for share in (0.5, 0.9):
        column = vectors[:, -1] * np.sqrt(eigenvalues[-1])
        column = column * np.minimum(1.0, np.sqrt(share * own / np.maximum(column**2, 1e-300)))
        parameters = solution.parameters.copy()
        parameters[GLOBALS + 2 : last : 3] = -np.log(own - column**2)
        # a single arm shares with the clamped capacitance only, which has little loss itself
        starts += [
            replace(solution, parameters=np.concatenate([parameters, [size], column]), clamped=arms == 1)
            for size in ((0.1, -0.1) if arms == 1 else (0.0,))
        ]
    return problem.descend(problem.race(starts), tolerance=_COUPLED)


def grown(problem: Problem, plain: Solution, before: Solution) -> Solution:
    """Return a fit with coupled damping and as many arms as a plain one, from that and from one with fewer."""
    while before.arms < plain.arms:
        before = problem.descend(problem.race(larger(problem, before)), tolerance=_COUPLED)
    return min(coupled(problem, plain), before, key=COST)


def wider(problem: Problem, solution: Solution) -> list[Solution]:
    """Return fits with more coupling: of the clamped capacitance too, and by one more column."""
    found = [] if solution.clamped else [problem.descend(replace(solution, clamped=True), tolerance=_COUPLED)]
    if solution.rank < MOST_RANK and solution.arms > 1:
        signs = np.array([[0.0], *[[(-1.0) ** k] for k in range(solution.arms)]])
        more = 0.1 * np.append(0.0, np.exp(-0.5 * solution.columns[2]))[:, None] * signs
        tail = np.hstack([solution.couplings, more]).ravel()
        parameters = np.concatenate([solution.parameters[: solution.last], tail])
        found.append(problem.descend(replace(solution, parameters=parameters), tolerance=_COUPLED))
    return found


def polished(problem: Problem, solution: Solution) -> list[Solution]:
    """Return fits with the widest coupling, from one with as many arms."""
    found = problem.descend(replace(solution, clamped=True), steps=_FINAL_STEPS, tolerance=_FINAL)
    rest = [problem.descend(more, steps=_FINAL_STEPS, tolerance=_FINAL) for more in wider(problem, found)]
    return [found, *rest]
