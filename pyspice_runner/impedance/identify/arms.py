# SPDX-License-Identifier: GPL-3.0-or-later
"""The model: clamped capacitance with loss, motional arms with coupled damping and leads, and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from pyspice_runner.impedance.identify.descent import Complexes, Vector
from pyspice_runner.motor.dielectric import LARGEST_LOSS_TANGENT
from pyspice_runner.motor.equivalent import constant_loss

# parameters before the arms: ln C₀; tan δ that falls, stays, rises with frequency, stays without dispersion;
# R_ℓ, L_ℓ
GLOBALS = 7
LOSSES, LEADS = (1, 2, 3, 4), (5, 6)  # their places
CAUSAL, FLAT = 2, 4  # constant parts, with and without dispersion
_TERMS = 10  # of the polynomials in the loss tangent, for an accuracy of 1e-10
COST = attrgetter("cost")


@dataclass(frozen=True)
class Solution:
    """Parameters, in the units of the problem, and their sum of squared residuals."""

    # ``GLOBALS``, then ln f, ln X and ln Q of each arm, then the couplings b of the clamped capacitance and of each
    # arm.
    parameters: Vector
    cost: float  # sum of squares
    arms: int  # number of arms
    held: tuple[int, ...] = LEADS  # places of the constant parameters among ``GLOBALS``
    clamped: bool = False  # whether the clamped capacitance takes part in the coupling

    @property
    def last(self) -> int:
        """Number of parameters before the couplings."""
        return GLOBALS + 3 * self.arms

    @property
    def rank(self) -> int:
        """Rank of the coupling of the damping."""
        return (len(self.parameters) - self.last) // (self.arms + 1)

    @property
    def has_leads(self) -> bool:
        """Whether the leads are free."""
        return LEADS[0] not in self.held

    @property
    def free_count(self) -> int:
        """Number of independent parameters; the columns of the couplings may be rotated among each other."""
        idle = len(self.held) + (0 if self.clamped else self.rank) + self.rank * (self.rank - 1) // 2
        return len(self.parameters) - idle

    @property
    def columns(self) -> Vector:
        """Ln f, ln X and ln Q of the arms, each a row."""
        return self.parameters[GLOBALS : self.last].reshape(-1, 3).T

    @property
    def couplings(self) -> Vector:
        """The couplings b of the clamped capacitance and the arms, shape (1 + arms, rank)."""
        return self.parameters[self.last :].reshape(self.arms + 1, self.rank)

    @property
    def widths(self) -> Vector:
        """Relative bandwidths of the arms, with their share in the coupled damping."""
        return np.asarray(np.exp(-self.columns[2]) + (self.couplings[1:] ** 2).sum(axis=1))

    def changed(self, places: tuple[int, ...], values: Any, **fields: Any) -> Solution:
        """Return the solution with other values at some places, and other fields."""
        parameters = self.parameters.copy()
        parameters[list(places)] = values
        return replace(self, parameters=parameters, **fields)


@dataclass(frozen=True)
class Values:
    """Values of the model at all points, for its derivatives."""

    clamped: Complexes  # Y₀ with its series loss
    first: Complexes  # current of the clamped capacitance
    inner: Complexes  # Y₀ without it
    behind: Complexes  # ratio of the two
    frequency: Vector
    own: Vector  # damping of each arm itself, 1/s
    theta: Vector
    coupling: Vector  # B
    velocity: Complexes  # v
    shared: Complexes  # Bᵀv
    device: Complexes  # Y behind the leads
    y: Complexes


class ArmModel:
    """The model at the relative frequencies w."""

    def __init__(self, w: Vector) -> None:
        self.w = w
        self.s: Complexes = np.asarray(1j * w, dtype=complex)
        self._powers = _dielectric(self.s)

    def constant_loss(self, loss_tangent: float, derivative: bool = False) -> Complexes:
        """Return the clamped capacitance, of 1 at the reference frequency, with a constant loss tangent."""
        x, orders = 2.0 * loss_tangent / LARGEST_LOSS_TANGENT - 1.0, np.arange(_TERMS)
        factors = x**orders
        if derivative:
            factors = np.append(0.0, orders[1:] * factors[:-1]) * 2.0 / LARGEST_LOSS_TANGENT
        return np.asarray((factors @ self._powers).view(complex))

    def at(self, solution: Solution) -> Values:
        """Evaluate the model."""
        size, falling, constant, rising, flat, lead_r, lead_l = solution.parameters[:GLOBALS]
        size = np.exp(size)
        inner = size * (self.s * self.constant_loss(constant) + falling + flat * self.w)
        behind = 1.0 / (1.0 + rising / size * inner)
        clamped = inner * behind
        arms = np.exp(solution.parameters[GLOBALS : solution.last]).reshape(-1, 3)
        frequency, reactance, quality = arms.T[:, :, None]
        theta = np.sqrt(frequency / reactance)
        own = frequency / quality
        detuning = self.w - frequency**2 / self.w
        # 1/(own + j detuning) in parts: most of the time is spent here, and complex division is slow
        scale = 1.0 / (own**2 + detuning**2)
        compliance = np.empty(scale.shape, dtype=complex)
        np.multiply(scale, own, out=compliance.real)
        np.multiply(scale, -detuning, out=compliance.imag)
        velocity = compliance * theta
        coupling = solution.couplings * np.sqrt(np.vstack([[[1.0 / size]], frequency]))
        first = clamped
        rank = coupling.shape[1]
        shared: Complexes = np.zeros((0, len(self.w)), dtype=complex)
        if rank:  # by Woodbury's formula
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
        return Values(clamped, first, inner, behind, frequency, own, theta, coupling, velocity, shared, device, y)

    def jacobian(self, m: Values, parameters: Vector, outer: Complexes) -> Complexes:
        """Return the derivatives, (parameters, points), of a function of Y with the derivative ``outer`` by Y."""
        chain = outer * (m.y / m.device) ** 2
        jacobian = np.empty((len(parameters), len(self.w)), dtype=complex)
        size = np.exp(parameters[0])
        at_clamped = chain * (m.first / m.clamped) ** 2
        inner = at_clamped * m.behind**2
        jacobian[0] = at_clamped * m.clamped
        jacobian[1] = inner * size
        jacobian[2] = inner * size * self.s * self.constant_loss(float(parameters[2]), derivative=True)
        jacobian[3] = -inner * m.inner**2 / size
        jacobian[4] = jacobian[1] * self.w
        jacobian[5] = -outer * m.y**2
        jacobian[6] = jacobian[5] * self.s
        last = GLOBALS + 3 * len(m.frequency)
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
        return jacobian


def _dielectric(s: Complexes) -> Vector:
    """Return a clamped capacitance over s in units of the reference frequency, by powers of its loss.

    Interpolation at Chebyshev nodes saves the ladder in every step. The rows belong to powers of the loss tangent,
    scaled from -1 to 1; real and imaginary parts stand side by side.
    """
    nodes = chebyshev.chebpts1(_TERMS)
    values = []
    for loss in 0.5 * LARGEST_LOSS_TANGENT * (nodes + 1.0):
        branches = constant_loss(1.0, float(loss), 1.0)  # at 1 Hz, so that corners in rad/s are 2π
        values.append(np.sum([c / (1.0 + 2.0 * pi * s * r * c) for r, c in branches], axis=0))
    powers: Vector = np.linalg.solve(np.vander(nodes, increasing=True), np.array(values).view(float))
    return powers


def modal(solution: Solution) -> Vector:
    """Return ln f, ln X and ln Q of the resonances, each a row, by rising frequency.

    They follow from the poles p and residues c of Y, which do not depend on the division of a coupled damping: ω is the
    magnitude of p, Q = −ω / (2 Re p), L = 1 / (2 Re c), X = ωL. Without coupling they are the values of the arms.
    """
    own, coupling, arms = solution.columns, solution.couplings[1:], solution.arms
    if not coupling.size:
        return own[:, np.argsort(own[0])]
    frequency, reactance, quality = np.exp(own)
    scaled = np.sqrt(frequency)[:, None] * coupling
    spring = np.diag(frequency)
    damping = np.diag(frequency / quality) + scaled @ scaled.T
    # states: velocities, and deflections times the arms' frequencies
    poles, vectors = np.linalg.eig(np.block([[-damping, -spring], [spring, np.zeros((arms, arms))]]))
    drive = np.append(np.sqrt(frequency / reactance), np.zeros(arms))
    residues = (drive @ vectors) * np.linalg.solve(vectors, drive)
    order = np.argsort(poles.imag)[arms:]
    size = np.abs(poles[order])
    with np.errstate(all="ignore"):  # of a pole that does not oscillate, or a residue that belongs to no arm
        found = np.log([size, size / (2.0 * residues[order].real), size / (2.0 * np.abs(poles[order].real))])
    return np.where(poles[order].imag > 0.0, found, np.nan)
