# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of the dielectric loss, and whether leads, the spectrum asks for."""

from __future__ import annotations

from math import log
from operator import itemgetter

import numpy as np

from pyspice_runner.spectra.identify.arms import LEADS, LOSSES, Solution
from pyspice_runner.spectra.identify.descent import FINEST, inverse, squares
from pyspice_runner.spectra.identify.errors import criterion
from pyspice_runner.spectra.identify.problem import PLAUSIBLE_LEADS, Problem

# difference of the criterion, twice that of very strong evidence (Kass and Raftery, doi:10.2307/2291091): noise exceeds
# 10 in one of 60 spectra
_TIE = 20.0
_PARTS: tuple[tuple[int, ...], ...] = ((), (3,), (2,), (1, 3))  # free parts of the loss to try

Ranked = list[tuple[float, Solution]]  # descriptions with their scores, the best first


def with_leads(problem: Problem, solution: Solution) -> Solution:
    """Return the fit with leads added."""
    held = tuple(place for place in solution.held if place not in LEADS)
    most = PLAUSIBLE_LEADS[0] * problem.unit_s, PLAUSIBLE_LEADS[1] / problem.unit_henry
    starts = [solution.changed(LEADS, [share * value for value in most], held=held) for share in (0.0, 0.1)]
    return problem.descend(problem.race(starts))


def simplified(problem: Problem, solution: Solution, points: float, leads: bool) -> Ranked:
    """Remove parts of the loss that the criterion does not ask for, look for leads, and descend.

    Leads have both resistance and inductance. Over a narrow band they cancel the dispersion of a constant loss tangent,
    which then resembles a falling and a rising part together: beside leads, a second part of the loss needs evidence as
    strong as the leads themselves.
    """

    def score(rival: Solution) -> float:
        several = len(set(LOSSES) - set(rival.held)) > 1
        return criterion(problem, rival, points) + _TIE * (rival.has_leads + (rival.has_leads and several))

    def variants(kept: tuple[int, ...]) -> list[Solution]:
        found = []
        total = solution.parameters[list(LOSSES)].sum()
        dropped = [place for place in LEADS if place not in kept] if solution.has_leads else []
        for free in _PARTS:
            held = tuple(place for place in (*LOSSES, *LEADS) if place not in (*free, *kept))
            share = [total / max(len(free), 1) if place in free else 0.0 for place in LOSSES]
            found.append(
                problem.descend(solution.changed((*LOSSES, *dropped), share + [0.0] * len(dropped), held=held))
            )
        return found

    found = [solution]
    if solution.has_leads:
        found += variants(LEADS)
    else:
        found += variants(())
        white = leads and points > 0.5 * len(problem.w)
        if white and _leads_promise(problem, min(found, key=score)) > log(2.0 * points):
            found += variants(LEADS)
    return sorted(((score(rival), rival) for rival in found), key=itemgetter(0))


def _leads_promise(problem: Problem, solution: Solution) -> float:
    """Return the decrease of the sum of squares by leads in one linear step, in units of the error's variance."""
    _, gradient, hessian = squares(*problem.linearised(solution.parameters, solution.arms))
    free = [k for k in range(len(gradient)) if k not in solution.held]
    both = [*free, *LEADS]
    fall = [float(gradient[part] @ inverse(hessian[np.ix_(part, part)]) @ gradient[part]) for part in (both, free)]
    return (fall[0] - fall[1]) / max(solution.cost / (2 * len(problem.w)), FINEST**2)
