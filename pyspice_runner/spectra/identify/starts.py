# SPDX-License-Identifier: GPL-3.0-or-later
"""Start values: poles by vector fitting, amplitudes by non-negative least squares, missing arms by a matched filter."""

from __future__ import annotations

from dataclasses import replace
from math import inf, log, sqrt

import numpy as np
from scipy.optimize import nnls

from pyspice_runner.model.dielectric import LARGEST_LOSS_TANGENT
from pyspice_runner.spectra.identify.arms import GLOBALS, Solution
from pyspice_runner.spectra.identify.descent import Complexes, Vector
from pyspice_runner.spectra.identify.errors import covariance
from pyspice_runner.spectra.identify.problem import MARGIN, Problem

_BESIDE = np.array([0.05, 0.2, 0.8])  # of that margin, where arms outside the band are tried
_QUALITY_BESIDE = 50.0  # of these

Asked = list[tuple[float, Vector]]  # significance of a missing arm in standard deviations, and its parameters


def start(problem: Problem, arms: int) -> Solution:
    """Return start values for a number of arms."""
    s, w = problem.model.s, problem.w
    y: Complexes = 1.0 / (1.0 / problem.y - problem.stated_leads[0] - s * problem.stated_leads[1])
    weight = 1.0 / problem.deviation
    poles = _relocated_poles(s, y, arms, weight)
    frequency = np.abs(poles)
    quality = np.clip(frequency / (2.0 * np.abs(poles.real)), 1.0, 1e5)
    ratio = w / frequency[:, None]
    shapes = 1.0 / (1.0 + 1j * quality[:, None] * (ratio - 1.0 / ratio))
    slope = s * problem.model.constant_loss(0.0, derivative=True)
    stacked = (np.vstack([s, slope, shapes]) * weight).view(float).T
    scale = np.linalg.norm(stacked, axis=0)
    amplitude = nnls(stacked / scale, np.ascontiguousarray(y * weight).view(float))[0] / scale
    capacitance = max(amplitude[0], 1e-3 * float(np.median(np.abs(y) / w)))
    found = np.zeros(GLOBALS + 3 * arms)
    loss = min(max(amplitude[1] / capacitance, 1e-4), 0.5 * LARGEST_LOSS_TANGENT)
    found[:GLOBALS] = log(capacitance), 0.1 * loss, 0.8 * loss, 0.1 * loss, *problem.stated_leads
    found[GLOBALS::3] = np.log(frequency)
    found[GLOBALS + 1 :: 3] = np.log(quality / np.maximum(amplitude[2:], 1e-3))
    found[GLOBALS + 2 :: 3] = np.log(quality)
    return Solution(found, inf, arms)


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


def _beside(problem: Problem, solution: Solution) -> Asked:
    """Return the arms outside the band that the residuals ask for."""
    _, residual, chain = problem.device_residual(solution)
    w, deviation = problem.w, problem.error(solution)
    distance = _BESIDE * MARGIN * (w[-1] - w[0])
    found = []
    for place in np.concatenate([w[0] - distance, w[-1] + distance]):
        if place <= 0.5 * w[0]:
            continue
        effect = chain / (1.0 / _QUALITY_BESIDE + 1j * (w / place - place / w))
        asked, norm = float(np.sum((-residual * effect.conj()).real)), float(np.sum(np.abs(effect) ** 2))
        conductance = max(asked / norm, 1e-12)
        arm = np.log([place, _QUALITY_BESIDE / conductance, _QUALITY_BESIDE])
        found.append((asked / (sqrt(norm) * deviation), arm))
    return found


def larger(problem: Problem, solution: Solution) -> list[Solution]:
    """Return starts with one more arm, where the residuals ask for it most."""
    head, couplings = np.split(solution.parameters, [solution.last])
    asked = missing(problem, solution)
    if solution.rank:
        asked = sorted(asked + _beside(problem, solution), key=lambda item: -item[0])
    tail = np.append(couplings, np.zeros(solution.rank))
    return [
        replace(solution, parameters=np.concatenate([head, arm, tail]), arms=solution.arms + 1) for _, arm in asked[:2]
    ]


def smaller(problem: Problem, solution: Solution) -> list[Solution]:
    """Return starts with one arm less: without either of the two with the least certain reactances."""
    variance = np.diag(covariance(problem, solution))
    doubtful = GLOBALS + 3 * np.argsort(variance[GLOBALS + 1 : solution.last : 3])[-2:]
    return [
        replace(solution, parameters=np.delete(solution.parameters, np.s_[at : at + 3]), arms=solution.arms - 1)
        for at in doubtful
    ]


def _relocated_poles(s: Complexes, y: Complexes, count: int, weights: Vector, rounds: int = 12) -> Complexes:
    """Relocate pole pairs by vector fitting until they settle; return those in the upper half plane."""
    poles = (-0.01 + 1j) * np.geomspace(s[0].imag, s[-1].imag, count + 2)[1:-1]
    weight = weights[:, None]
    background = s[:, None] ** np.arange(3)  # the clamped capacitance is s, its loss s²
    target = np.ascontiguousarray(y * weight[:, 0]).view(float)
    for _ in range(rounds):
        basis = _pole_basis(s, poles)
        system = np.hstack([basis, background, -y[:, None] * basis]) * weight
        stacked: Vector = np.ascontiguousarray(system.T).view(float).T
        # the triangular factor is small and suffices for the least squares
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
