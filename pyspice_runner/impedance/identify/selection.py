# SPDX-License-Identifier: GPL-3.0-or-later
"""Search of the arms and the rank of their coupling, the loss and the leads: starts, fit of each number, selection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, inf, log, sqrt

import numpy as np

from pyspice_runner.impedance.identify import errors
from pyspice_runner.impedance.identify.arms import CAUSAL, COST, FLAT, GLOBALS, LEADS, LOSSES, Solution
from pyspice_runner.impedance.identify.descent import FINEST, Vector, inverse, squares
from pyspice_runner.impedance.identify.problem import MARGIN, PLAUSIBLE_LEADS, Problem, ridge_of

SEARCHED_ARMS = 8  # tried when their number is not given
MOST_RANK = 2  # of the coupling; each column adds the complex residues of the poles of Y, and more say little
_COUPLED = 1e-4  # relative decrease of the sum of squares that ends a descent with coupled damping
_FINAL = 1e-5  # relative decrease that ends the last descents with a given number of arms
_EXHAUSTED = 1e-5  # relative residual below which there is nothing to find
_MISFIT = 1e-3  # relative residual above which damping may be coupled; analysers are accurate to half of it at best
_DISPERSION = 5e-3  # largest relative residual of a dielectric with another dispersion than the model
# difference of the criterion, twice that of very strong evidence (Kass and Raftery, doi:10.2307/2291091): noise exceeds
# 10 in one of 60 spectra
_TIE = 20.0
_AKAIKE = 2.0  # price of a parameter in the weights of the averages
# free parts of the loss to try; the part without dispersion, which no network has, only alone
_PARTS: tuple[tuple[int, ...], ...] = ((), (3,), (2,), (FLAT,), (1, 3), (1, 2, 3))
LEADS_AT_LIMIT = "leads at their limit"
_OUTSIDE = np.array([0.05, 0.2, 0.8])  # of the margin, where arms outside the band are tried
_QUALITY_OUTSIDE = 50.0  # of these

Progress = Callable[[int, int], object]
Asked = list[tuple[float, Vector]]  # significance of a missing arm in standard deviations, and its parameters


@dataclass(frozen=True)
class Candidate:
    """A number of arms that was tried."""

    arms: int  # number of arms
    rank: int  # rank of the coupling of their damping
    leads: bool  # whether it has leads
    criterion: float  # Schwarz's information criterion; the lowest is best
    rms_relative_error: float  # root mean square of the relative residual's magnitude
    # reason for rejection at any criterion: an arm is not determined, follows the background, or is narrower than the
    # points; leads are at their limit.
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
        best, bare = (errors.criterion(self.problem, each, self.points) for each in (self.best, self.bare))
        found = set(errors.resonances(self.problem, self.best)) - set(errors.lone(self.problem, self.best))
        return (best < bare or self.best.cost < 0.5 * self.bare.cost) and bool(found)


def select(problem: Problem, modes: int | None, leads: bool, progress: Progress | None) -> Outcome:
    """Try numbers of arms, leads and ranks of the coupling, and select the best by the criterion."""
    bare = fit_bare(problem)
    solutions = _search(problem, bare, leads, progress, modes)
    points = errors.independent(problem, min(solutions, key=COST))
    best = min(solutions, key=lambda solution: errors.criterion(problem, solution, points))
    if best.rank and not settled(problem, best):
        if modes is None:
            solutions += wider(problem, best)
        else:
            problem = problem.reaching(best)
            widest = problem.descend(replace(best, clamped=True), tolerance=_FINAL)
            solutions += [widest, *(problem.descend(more, tolerance=_FINAL) for more in wider(problem, widest))]
    candidates: list[Candidate] = []
    for solution in solutions:
        error = problem.rms_relative_error(solution)
        note = errors.doubts(problem, solution) if modes is None else ""
        fewer = [item.rms_relative_error for item in candidates if item.arms < solution.arms]
        idle = modes is None and len(errors.resonances(problem, solution)) < solution.arms
        if not note and idle and fewer and min(fewer) ** 2 - error**2 < _DISPERSION**2:
            note = "an arm follows the background"
        candidates.append(_candidate(problem, solution, points, note))
    tried = list(zip(candidates, solutions, strict=True))
    among = [pair for pair in tried if not pair[0].note]
    among = among or [pair for pair in tried if errors.resonances(problem, pair[1])] or tried
    chosen = min(among, key=lambda pair: pair[0].criterion)[1]
    # a given number that cannot follow the spectrum takes the lowest residual
    if problem.far:
        ranked = [min((item for item in solutions if item.rank), key=COST)]
    else:
        ranked = simplified(problem, chosen, points, leads)
        if _at_limit(problem, ranked[0]):
            candidates.append(_candidate(problem, ranked[0], points, LEADS_AT_LIMIT))
        ranked = [item for item in ranked if not _at_limit(problem, item)]
    bare = simplified(problem, bare, points, leads=False)[0]
    return Outcome(problem, bare, ranked[0], points, tuple(candidates), _shifts(problem, ranked, points))


def _candidate(problem: Problem, solution: Solution, points: float, note: str) -> Candidate:
    """Return the record of a solution that was tried."""
    value, error = errors.criterion(problem, solution, points), problem.rms_relative_error(solution)
    return Candidate(solution.arms, solution.rank, solution.has_leads, value, error, note)


def _search(
    problem: Problem, bare: Solution, leads: bool, progress: Progress | None, only: int | None
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
        plain = fit_arms(problem, arms, plain if only is None else bare, quick)
        solutions.append(plain)
        if not settled(problem, plain) and not done:
            behind = with_leads(problem, plain) if leads else plain
            if settled(problem, behind) and not _at_limit(problem, behind):
                solutions[-1] = behind
            elif arms > 1 and plain.cost > misfit:
                shared = grown(problem, plain, shared or coupled(problem, fit_arms(problem, 2, bare, quick=True)))
                solutions.append(shared)
        if errors.is_exact(problem, solutions[-1]) or done:
            break
        costs.append(min(solutions, key=COST).cost)
        if len(costs) >= 3 and (
            costs[-1] > 0.8 * costs[-3] or not any(errors.resonances(problem, solution) for solution in solutions)
        ):
            break  # more arms gain nothing, or none of them rings
        if len(costs) >= 2 and costs[-2] < misfit and len(errors.resonances(problem, plain)) < arms:
            break  # the residual is below the accuracy of analysers, and an arm that follows it rings nowhere
    first = solutions[0]
    if first.arms == 1 and first.cost > misfit and not any(settled(problem, item) for item in solutions):
        solutions.insert(1, coupled(problem, first))
    return solutions


def _shifts(problem: Problem, ranked: list[Solution], points: float) -> Vector:
    """Return the values of rivals less those of the best solution, each times the root of the rival's weight.

    The sum of their squares is the variance by the choice among the descriptions of loss and leads. The weights are
    those of Akaike's criterion: a description that fits as well counts, though another one was selected because it is
    simpler (Burnham and Anderson, "Model Selection and Multimodel Inference", Springer 2002, sec. 4.3).
    """
    scores = np.array([errors.criterion(problem, item, points, price=_AKAIKE) for item in ranked])
    odds = np.exp(-0.5 * (scores - scores.min()))
    best = errors.log_values(ranked[0])
    rivals = zip((odds / odds.sum()).tolist(), ranked, strict=True)
    return np.array([np.sqrt(share) * (errors.log_values(item) - best) for share, item in rivals if share > 1e-9])


def settled(problem: Problem, solution: Solution) -> bool:
    """Tell whether the residuals hide no further arm: none is significant, and they resemble noise."""
    if solution.cost < _EXHAUSTED**2 * len(problem.w):
        return True
    noise = errors.independent(problem, solution) > 0.5 * len(problem.w)
    return noise and missing(problem, solution)[0][0] < errors.SIGNIFICANT


def fit_bare(problem: Problem) -> Solution:
    """Fit the clamped capacitance alone, behind plausible leads."""
    capacitance = float(np.median(np.maximum(problem.y.imag / problem.w, 1e-6)))
    begin = np.array([log(capacitance), *[0.001] * len(LOSSES), *problem.stated_leads])
    return problem.descend(Solution(begin, inf, 0))


def fit_arms(problem: Problem, arms: int, before: Solution, quick: bool = False) -> Solution:
    """Fit a number of arms, one after the other from a solution with fewer."""
    while before.arms < arms - 1:
        before = fit_arms(problem, before.arms + 1, before, quick)
    best = problem.descend(problem.race(larger(problem, before)))
    for _ in range(3):
        if quick or settled(problem, best):
            break
        rival = problem.race(smaller(problem, problem.race(larger(problem, best))))
        if rival.cost > 0.99 * best.cost:
            break
        cost, best = best.cost, problem.descend(rival)
        if best.cost > cost / 3.0:  # a truly missing arm gains far more
            break
    return best


def coupled(problem: Problem, solution: Solution) -> Solution:
    """Return the fit with damping coupled by one column, started from one linear step, and with a causal loss."""
    both = float(solution.parameters[[CAUSAL, FLAT]].sum())
    solution = solution.changed((CAUSAL, FLAT), [both, 0.0], held=(*solution.held, FLAT))
    arms, last = solution.arms, solution.last
    problem.ridge = problem.ridge or ridge_of(solution)
    residual, jacobian = problem.linearised(solution)
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


# --- loss and leads ---


def _at_limit(problem: Problem, solution: Solution) -> bool:
    """Whether free leads are at the maximum of their range."""
    places, upper = list(LEADS), problem.bounds(solution)[1]
    return solution.has_leads and bool((solution.parameters[places] >= upper[places]).any())


def with_leads(problem: Problem, solution: Solution) -> Solution:
    """Return the fit with leads added."""
    held = tuple(place for place in solution.held if place not in LEADS)
    most = PLAUSIBLE_LEADS[0] * problem.unit_s, PLAUSIBLE_LEADS[1] / problem.unit_henry
    starts = [solution.changed(LEADS, [share * value for value in most], held=held) for share in (0.0, 0.1)]
    return problem.descend(problem.race(starts))


def simplified(problem: Problem, solution: Solution, points: float, leads: bool) -> list[Solution]:
    """Return fits with fewer parts of the loss, and with leads if they promise enough, the best one first.

    Leads have both resistance and inductance. Over a narrow band they cancel the dispersion of a constant loss tangent,
    which then resembles a falling and a rising part together, or one without dispersion: beside leads, each of these
    needs evidence as strong as the leads themselves.
    """

    def score(rival: Solution) -> float:
        free = set(LOSSES) - set(rival.held)
        doubtful = rival.has_leads and (len(free) > 1 or FLAT in free)
        return errors.criterion(problem, rival, points) + _TIE * (rival.has_leads + doubtful)

    def variants(kept: tuple[int, ...]) -> list[Solution]:
        found = []
        start = solution if kept else solution.changed(LEADS, problem.stated_leads)
        total = solution.parameters[list(LOSSES)].sum()
        for free in (part for part in _PARTS if not (solution.rank and FLAT in part)):
            held = tuple(place for place in (*LOSSES, *LEADS) if place not in (*free, *kept))
            share = [total / max(len(free), 1) if place in free else 0.0 for place in LOSSES]
            found.append(problem.descend(start.changed(LOSSES, share, held=held)))
        return found

    found = variants(LEADS if solution.has_leads else ())
    if solution.has_leads and all(_at_limit(problem, item) for item in found):
        found += variants(())
    white = leads and not solution.has_leads and points > 0.5 * len(problem.w)
    if white and _leads_promise(problem, min(found, key=score)) > log(2.0 * points):
        found += variants(LEADS)
    return sorted(found, key=score)


def _leads_promise(problem: Problem, solution: Solution) -> float:
    """Return the decrease of the sum of squares by leads in one linear step, in units of the error's variance."""
    _, gradient, hessian = squares(*problem.linearised(solution))
    free = [k for k in range(len(gradient)) if k not in solution.held]
    both = [*free, *LEADS]
    fall = [float(gradient[part] @ inverse(hessian[np.ix_(part, part)]) @ gradient[part]) for part in (both, free)]
    return (fall[0] - fall[1]) / max(solution.cost / (2 * len(problem.w)), FINEST**2)


# --- starts ---


def missing(problem: Problem, solution: Solution) -> Asked:
    """Return the arms that the residuals ask for, the most significant first.

    The residual over its derivative by Y_d is the missing admittance of the device; its weighted mean over a window is
    compared with the deviation of the mean, for windows of all widths.
    """
    _, residual, chain = problem.device_residual(solution)
    w, deviation = problem.w, problem.error(solution)
    numerator = np.concatenate([[0.0], np.cumsum((-residual * chain.conj()).real)])
    denominator = np.concatenate([[0.0], np.cumsum(np.abs(chain) ** 2)])
    found = []
    index, half = np.arange(len(w)), 1
    while half == 1 or half < len(w) // 4:
        low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(w))
        sums, norms = numerator[high] - numerator[low], denominator[high] - denominator[low]
        norms = np.maximum(norms, 1e-15 * denominator[-1])  # differences of sums lose smaller values
        score = sums / (np.sqrt(norms) * deviation)
        at = int(np.argmax(score))
        width = w[high[at] - 1] - w[low[at]]
        conductance = max(float(sums[at] / norms[at]), 1e-12)
        quality = min(max(1.5 * w[at] / width, 1.0), 1e5)
        found.append((float(score[at]), np.log([w[at], quality / conductance, quality])))
        half *= 2
    return sorted(found, key=lambda item: -item[0])


def _missing_outside(problem: Problem, solution: Solution) -> Asked:
    """Return the arms outside the band that the residuals ask for."""
    _, residual, chain = problem.device_residual(solution)
    w, deviation = problem.w, problem.error(solution)
    distance = _OUTSIDE * MARGIN * (w[-1] - w[0])
    found = []
    for place in np.concatenate([w[0] - distance, w[-1] + distance]):
        if place <= 0.5 * w[0]:
            continue
        effect = chain / (1.0 / _QUALITY_OUTSIDE + 1j * (w / place - place / w))
        asked, norm = float(np.sum((-residual * effect.conj()).real)), float(np.sum(np.abs(effect) ** 2))
        conductance = max(asked / norm, 1e-12)
        arm = np.log([place, _QUALITY_OUTSIDE / conductance, _QUALITY_OUTSIDE])
        found.append((asked / (sqrt(norm) * deviation), arm))
    return found


def larger(problem: Problem, solution: Solution) -> list[Solution]:
    """Return starts with one more arm, where the residuals ask for it most."""
    head, couplings = np.split(solution.parameters, [solution.last])
    asked = sorted(missing(problem, solution) + _missing_outside(problem, solution), key=lambda item: -item[0])
    tail = np.append(couplings, np.zeros(solution.rank))
    starts = [
        replace(solution, parameters=np.concatenate([head, arm, tail]), arms=solution.arms + 1) for _, arm in asked[:2]
    ]
    if solution.arms == 1 and errors.resonances(problem, solution):  # which may lie between two: half on each side
        frequency, reactance, quality = solution.columns[:, 0]
        sides = [[frequency + side * exp(-quality), reactance + log(2.0), quality] for side in (-0.75, 0.75)]
        starts.append(replace(solution, parameters=np.concatenate([head[:-3], *sides, tail]), arms=2))
    return starts if solution.arms else [*starts, _highest(problem, solution)]


def _highest(problem: Problem, bare: Solution) -> Solution:
    """Return a start with the arm of the highest conductance: residuals of the capacitance may not lead to it."""
    y, w = problem.y, problem.w
    at = int(np.argmax(y.real))
    conductance = max(float(y.real[at]), 1e-12)
    half = np.flatnonzero(y.real < 0.5 * conductance)
    low, high = half[half < at], half[half > at]
    width = w[high[0] if len(high) else -1] - w[low[-1] if len(low) else 0]
    quality = float(np.clip(w[at] / width, 1.0, 1e5))
    arm = conductance / (1.0 + 1j * quality * (w / w[at] - w[at] / w))
    capacitance = max(float(np.median((y - arm).imag / w)), 1e-6)
    values = [log(capacitance), *bare.parameters[1:], *np.log([w[at], quality / conductance, quality])]
    return replace(bare, parameters=np.array(values), arms=1)


def smaller(problem: Problem, solution: Solution) -> list[Solution]:
    """Return starts with one arm less: without either of the two with the least certain reactances."""
    variance = np.diag(errors.covariance(problem, solution))
    doubtful = GLOBALS + 3 * np.argsort(variance[GLOBALS + 1 : solution.last : 3])[-2:]
    return [
        replace(solution, parameters=np.delete(solution.parameters, np.s_[at : at + 3]), arms=solution.arms - 1)
        for at in doubtful
    ]
