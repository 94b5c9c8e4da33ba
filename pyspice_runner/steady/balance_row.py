# SPDX-License-Identifier: GPL-3.0-or-later
"""The balanced motion of a brush, from that of the spring-slider (:mod:`.harmonic_balance`).

The row of sliders changes the forces of the contact by some percent. So the derivative of the equations with the
spring-slider serves as a first one; each step improves it. C. G. Broyden, Math. Comp. 19, 577 (1965).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.evaluated import library_function
from pyspice_runner.circuit.law import contact_library
from pyspice_runner.steady.balance_equations import (
    PINS,
    Array,
    Forces,
    Grid,
    Response,
    Stators,
    clipped,
    contact_parameters,
    missed,
    moving_tip,
)
from pyspice_runner.steady.copies import Plant

CLOSE = 1e-3  # last step over the static penetration; shooting then needs one more step as a rule
MOST_STEPS = 10


class Row:
    """The brushes of operating points with the same law."""

    def __init__(self, plants: Sequence[Plant], stators: Stators, grid: Grid, response: Response) -> None:
        law = plants[0].law
        assert law is not None
        assert law.sliders is not None
        self.stators, self.grid, self.response, self.count = stators, grid, response, law.sliders
        self.function = library_function(contact_library(law, plants[0].motor.contact))
        self.constants = {name: values[:, np.newaxis] for name, values in contact_parameters(plants, law).items()}

    def acting(self, unknowns: Array) -> tuple[Forces, Array]:
        """Return the forces, and the sliders at the phases in µm, shape (sliders, points, phases)."""
        pins, slid = moving_tip(self.stators, self.grid, unknowns)
        known = self.constants | dict(zip(PINS[:-1], pins, strict=False))
        cells = range(self.count)
        names = [*(f"y{1 + cell}" for cell in cells), *(f"x{cell}" for cell in cells)]
        found = self.function.of(names, known | dict.fromkeys(self.function.states, 0.0))
        limits = 2.0 * np.stack([found[f"y{1 + cell}"] for cell in cells])  # of a slider at 0
        beyond = np.stack([*(found[f"x{cell}"] for cell in cells), np.zeros_like(slid)])
        moved = -np.diff(beyond, axis=0) * slid
        phases = slid.shape[1]
        sliders = clipped(moved.reshape(-1, phases), limits.reshape(-1, phases))[0].reshape(moved.shape)
        forces = self.function.of(
            ("fx", "fy", "friction", "normal"), known | dict(zip(self.function.states, sliders, strict=True))
        )
        return Forces(*forces.values()), sliders

    def balanced(self, unknowns: Array, single: Forces, inverse: Array) -> tuple[Array, Forces, Array]:
        """Return unknowns, forces, and the sliders at t = 0 in µm, shape (points, sliders).

        The unknowns, forces and the inverse of the derivative with a single slider are given. Where the iteration does
        not end, they stay, and only the sliders are those of the row.
        """
        given, near = unknowns, np.zeros(len(unknowns), dtype=bool)
        forces, sliders = self.acting(unknowns)
        first = sliders
        with np.errstate(all="ignore"):  # where it does not end
            unknowns, forces, sliders = self._iterated(unknowns, forces, sliders, inverse, near)
        chosen = near[:, np.newaxis]
        forces = Forces(*(np.where(chosen, getattr(forces, name), getattr(single, name)) for name in vars(single)))
        at_start = np.where(near, sliders[..., 0], first[..., 0]).T
        return np.asarray(np.where(chosen, unknowns, given)), forces, np.asarray(at_start)

    def _iterated(
        self, unknowns: Array, forces: Forces, sliders: Array, inverse: Array, near: NDArray[np.bool_]
    ) -> tuple[Array, Forces, Array]:
        """Return unknowns, forces and sliders after Broyden's steps, and mark in ``near`` those that are a solution."""
        step = np.zeros_like(unknowns)
        for number in range(MOST_STEPS):
            residual = missed(self.stators, self.grid, self.response, unknowns, forces)
            after = -np.einsum("pij,pj->pi", inverse, residual)
            if number:
                gained = step - after
                size = np.einsum("pi,pi->p", step, gained)
                row = np.einsum("pi,pij->pj", step / np.where(size, size, 1.0)[:, np.newaxis], inverse)
                inverse = inverse + after[:, :, np.newaxis] * row[:, np.newaxis]
                after = -np.einsum("pij,pj->pi", inverse, residual)
            step = np.where(near[:, np.newaxis], 0.0, after)
            unknowns = unknowns + step
            forces, sliders = self.acting(unknowns)
            near |= np.linalg.norm(step, axis=1) < CLOSE * self.stators.depth[:, 0]
            if near.all():
                break
        return unknowns, forces, sliders
