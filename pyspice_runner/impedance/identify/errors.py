# SPDX-License-Identifier: GPL-3.0-or-later
"""Judgement of a solution: Schwarz's criterion, doubtful arms, covariance, and values with standard errors."""

from __future__ import annotations

from dataclasses import replace
from math import log, pi
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.impedance.identify import descent
from pyspice_runner.impedance.identify.arms import GLOBALS, LEADS, LOSSES, Solution, modal
from pyspice_runner.impedance.identify.descent import FINEST, Vector, derivatives
from pyspice_runner.impedance.identify.problem import Problem
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm

Errors = dict[str, float | None]  # name → standard error; None at the limit of a range

GLOBAL_NAMES = ("clamped_capacitance_f", "loss_tangent", "lead_resistance_ohm", "lead_inductance_h")
ARM_NAMES = ("resistance_ohm", "inductance_h", "capacitance_f", "series_resonance_hz", "quality_factor")
RESONANT_QUALITY = 2.5  # a broader arm follows the background and does not resonate
SIGNIFICANT = 5.0  # standard deviations by which a missing arm exceeds the residuals
# of the squares: a skew of up to a bandwidth explains more than 0.9, the losses of a polymer 0.5
SKEWED_SHARE = 0.8
UNDETERMINED = 0.3  # standard error of ln √(L/C) of an arm that is not determined


def independent(problem: Problem, solution: Solution) -> float:
    """Return the number of independent points: fewer than measured if the residuals are not noise."""
    if is_exact(problem, solution):
        return float(len(problem.w))
    return descent.independent_points(problem.device_residual(solution)[1])


def is_exact(problem: Problem, solution: Solution) -> bool:
    """Whether the residuals are smaller than any error of measurement."""
    return solution.cost < FINEST**2 * len(problem.w)


def criterion(problem: Problem, solution: Solution, points: float, price: float | None = None) -> float:
    """Return Schwarz's criterion for a number of independent points; the lowest is best.

    ``price`` is that of a free parameter: 2 makes it Akaike's criterion.
    """
    penalty = solution.free_count * (log(2.0 * points) if price is None else price)
    if problem.noise.stated and points == len(problem.w):
        return 2.0 * solution.cost + penalty
    return 2.0 * points * log(max(solution.cost / (2 * len(problem.w)), FINEST**2)) + penalty


def covariance(problem: Problem, solution: Solution, free: NDArray[np.bool_] | None = None) -> Vector:
    """Return the covariance of the parameters; zero for those that are not free."""
    _, _, hessian = descent.squares(*problem.linearised(solution))
    if free is None:
        free = np.ones(len(solution.parameters), dtype=bool)
        free[list(solution.held)] = False
    points = independent(problem, solution)
    found = np.zeros_like(hessian)
    found[np.ix_(free, free)] = descent.variance(
        solution.cost, len(problem.w), solution.free_count, points, problem.noise.stated
    ) * descent.inverse(hessian[np.ix_(free, free)])
    return found


def free_parameters(problem: Problem, solution: Solution) -> NDArray[np.bool_]:
    """Tell which parameters have an error: those inside their range, and free leads.

    Leads at zero may be greater by their error, and the values of the arms with them.
    """
    lower, upper = problem.bounds(solution)
    free = (solution.parameters > lower) & (solution.parameters < upper)
    free[[place for place in LEADS if place not in solution.held]] = True
    return free


def resonances(problem: Problem, solution: Solution) -> list[int]:
    """Return the arms that resonate in the band."""
    frequency, _, quality = np.exp(modal(solution))
    inside = (frequency >= problem.w[0]) & (frequency <= problem.w[-1]) & (quality >= RESONANT_QUALITY)
    return [int(k) for k in np.flatnonzero(inside)]


def doubts(problem: Problem, solution: Solution) -> str:
    """Return why an arm of a solution is not one; empty if all are."""
    if is_exact(problem, solution):
        return ""
    slope = derivatives(lambda parameters: modal(replace(solution, parameters=parameters))[1], solution.parameters)
    spread = np.einsum("ki,ij,kj->k", slope, covariance(problem, solution, free_parameters(problem, solution)), slope)
    if not np.all(spread < UNDETERMINED**2):
        return "an arm is not determined"
    return "an arm is narrower than the points" if lone(problem, solution) else ""


def lone(problem: Problem, solution: Solution) -> list[int]:
    """Return the arms, by rising frequency, that are narrower than the points and that no other point shows."""
    if is_exact(problem, solution) or solution.rank:
        return []
    frequency, _, quality = np.exp(solution.columns)
    w, found = problem.w, []
    spacing = np.interp(frequency, 0.5 * (w[1:] + w[:-1]), np.diff(w))
    values, _, chain = problem.device_residual(solution)
    for rank, k in enumerate(np.argsort(frequency)):
        effect = (chain * values.theta[k] * values.velocity[k])[np.abs(w - frequency[k]) > 1.5 * spacing[k]]
        unseen = float(np.sum(np.abs(effect) ** 2)) < SIGNIFICANT**2 * solution.cost / len(w)
        if unseen and frequency[k] / quality[k] < spacing[k]:
            found.append(rank)
    return found


def skewed_arms(problem: Problem, solution: Solution) -> list[int]:
    r"""Return the arms in the band whose skew by their amplitude explains most of the residuals, more than their noise.

    A spring that softens by the share :math:`\tfrac34\gamma A^2` and losses that grow by :math:`\tfrac14\kappa A^2`
    change the admittance of an arm, to first order, by

    .. math::
        \delta Y \propto v^2\,\frac{j\omega_n^2}{\omega}\,\frac{|v|^2}{\omega^2}, \qquad
        \delta Y \propto v^2\,\frac{\omega_n}{Q}\,\frac{|v|^2}{\omega^2}

    with the velocity v of the arm. No value of the linear circuit does that.
    :mod:`~pyspice_runner.impedance.joint_fit` has the whole law.
    """
    residual, jacobian = problem.linearised(solution)
    free = [place for place in range(len(jacobian)) if place not in solution.held]
    basis = _orthonormal(jacobian[free].view(float).T)
    values, _, chain = problem.device_residual(solution)
    rest = residual.view(float)
    rest = rest - basis @ (basis.T @ rest)
    found = []
    for arm in resonances(problem, solution):
        velocity, frequency = values.velocity[arm], values.frequency[arm]
        size = chain * velocity**2 * np.abs(velocity / problem.w) ** 2
        columns = np.array([1j * frequency**2 / problem.w * size, values.own[arm] * size]).view(float).T
        pattern = _orthonormal(columns - basis @ (basis.T @ columns))
        part = float(np.sum((pattern.T @ rest) ** 2)) / max(float(rest @ rest), 1e-300)
        if part > max(SKEWED_SHARE, SIGNIFICANT**2 / len(rest)):
            found.append(arm)
    return found


def _orthonormal(columns: Vector) -> Vector:
    """Return an orthonormal basis of columns of any scale."""
    return np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]


def log_values(solution: Solution) -> Vector:
    """Return ln C₀, tan δ, R_ℓ, L_ℓ and ln R, L, C, f, Q of each arm, in the units of the problem."""
    parameters, (frequency, reactance, _) = solution.parameters, solution.columns
    quality = -np.log(solution.widths)
    found = [reactance - quality, reactance - frequency, -reactance - frequency, frequency, quality]
    first = [parameters[0], parameters[list(LOSSES)].sum(), *parameters[list(LEADS)]]
    return np.concatenate([first, np.array(found).T.ravel()])


def circuit_of(problem: Problem, solution: Solution) -> EquivalentCircuit:
    """Return the circuit of a solution, with arms in the order of its parameters."""
    omega = 2.0 * pi * problem.reference_hz
    coupling = solution.couplings
    frequency, reactance, quality = np.exp(solution.columns)
    ohm = reactance / problem.unit_s
    resistance = ohm * (1.0 / quality + (coupling[1:] ** 2).sum(axis=1))
    inductance, capacitance = ohm / (omega * frequency), 1.0 / (ohm * omega * frequency)
    arms = [MotionalArm(*map(float, values)) for values in zip(resistance, inductance, capacitance, strict=True)]
    columns = coupling * np.sqrt(np.append(np.exp(-solution.parameters[0]) / problem.unit_s, ohm))[:, None]
    size, *losses, lead_ohm, lead_henry = solution.parameters[:GLOBALS].tolist()
    return EquivalentCircuit(
        arms=tuple(arms),
        clamped_capacitance_f=float(np.exp(size)) * problem.unit_s / omega,
        loss_tangent=sum(losses),
        loss_reference_hz=problem.reference_hz,
        lead_resistance_ohm=lead_ohm / problem.unit_s,
        lead_inductance_h=lead_henry * problem.unit_henry,
        loss_tangent_falling=losses[0],
        loss_tangent_rising=losses[2],
        loss_tangent_flat=losses[3],
        shared_losses=tuple(map(tuple, columns.T.tolist())),
    )


def estimates(
    problem: Problem, solution: Solution, shifts: Vector
) -> tuple[Solution, EquivalentCircuit, Errors, list[Errors], Vector]:
    """Return the solution and its circuit with arms by rising frequency, and errors.

    These are the standard errors of ``GLOBAL_NAMES``, those of ``ARM_NAMES`` of each arm, and the correlations of all.
    They contain the spread over the descriptions (see :mod:`.selection`).
    """
    order = np.argsort(solution.columns[0])
    places = [0, 1, 2, 3, *(4 + 5 * arm + k for arm in order for k in range(5))]
    columns, coupling = solution.columns.T[order], solution.couplings[[0, *(1 + order)]]
    parameters = [solution.parameters[:GLOBALS], columns.ravel(), coupling.ravel()]
    solution = replace(solution, parameters=np.concatenate(parameters))
    circuit = circuit_of(problem, solution)
    free = free_parameters(problem, solution)

    transform = derivatives(
        lambda parameters: log_values(replace(solution, parameters=parameters)), solution.parameters
    )
    shifts = shifts[:, places]
    spread = transform @ covariance(problem, solution, free) @ transform.T + shifts.T @ shifts
    deviation = np.sqrt(np.maximum(np.diag(spread), 0.0))
    # damping in the coupling is known even if the rest is at its limit
    known = (np.abs(transform) @ ~free) < 1e-2
    known[1] = free[list(LOSSES)].any()

    def errors(names: tuple[str, ...], first: int, units: tuple[float, ...]) -> Errors:
        items = zip(names, units, deviation[first:], known[first:], strict=False)
        return {name: float(unit * error) if sure else None for name, unit, error, sure in items}

    arms = [
        errors(ARM_NAMES, len(GLOBAL_NAMES) + 5 * index, attrgetter(*ARM_NAMES)(arm))
        for index, arm in enumerate(circuit.arms)
    ]
    units = (circuit.clamped_capacitance_f, 1.0, 1.0 / problem.unit_s, problem.unit_henry)
    divisor = np.where(deviation > 0.0, deviation, 1.0)
    correlation = np.clip(spread / np.outer(divisor, divisor), -1.0, 1.0)
    return solution, circuit, errors(GLOBAL_NAMES, 0, units), arms, correlation
