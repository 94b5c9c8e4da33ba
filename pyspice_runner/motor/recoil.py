# SPDX-License-Identifier: GPL-3.0-or-later
r"""Recoil: the modes of the stator shake the carrier that holds its supports.

With z the displacement of the carrier and :math:`w_n` the shape of mode n, the kinetic energy

.. math::
    T = \tfrac12\int\mu\,(\dot z + \dot w)^2\,dx = \tfrac12 m_c\dot z^2 + \dot z\sum\Gamma_n\dot r_n
    + \tfrac12\sum m_n\dot r_n^2, \qquad \Gamma_n = \int\mu\,w_n\,dx + m_t w_n(x_t)

has a cross term; the mass :math:`m_c` of the carrier contains that of the stator. A single mode has the equivalent
without recoil :math:`m' = m - \Gamma^2/m_c`, :math:`Y' = Y - \Gamma/m_c`, exact for soft springs: its other coordinate
is the centre of mass, :math:`z + \Gamma r/m_c`. A carrier that moves along the rotor has the same term with
:math:`\Gamma_x` there. ``docs/mount.md`` derives it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor.parameters import Mode, Mount

Array = NDArray[np.float64]


def recoils(modes: Sequence[Mode]) -> Array:
    """Return the recoil of the modes in kg along y and x, shape (2, modes); 0 where it is not known."""
    return np.array([[mode.recoil_kg or 0.0 for mode in modes], [mode.recoil_x_kg or 0.0 for mode in modes]])


def carriers(mount: Mount | None) -> tuple[Mount, ...]:
    """Return the springs of the carrier along y and, unless it is held along the rotor, along x."""
    return tuple(along for along in (mount, mount and mount.tangential) if along)


def mass_matrix(modes: Sequence[Mode], mount: Mount | None) -> Array:
    """Return the mass matrix in kg of the modes and, if there is a mount, of its carrier, the last."""
    n, moving = len(modes), carriers(mount)
    matrix = np.diag([*(mode.mass_kg for mode in modes), *(along.mass_kg for along in moving)])
    matrix[n:, :n] = recoils(modes)[: len(moving)]
    matrix[:n, n:] = matrix[n:, :n].T
    return matrix


def modes_on_carrier(modes: tuple[Mode, ...], mount: Mount | None) -> tuple[Mode, ...]:
    """Return the modes that a stator has on its carrier, without recoil, in the order of its own.

    They are the normal modes of stator, carrier and springs. What the damping couples between them is left out.
    """
    moving = carriers(mount)
    if not recoils(modes)[: len(moving)].any():
        return modes
    from scipy.linalg import eigh  # takes long to load
    from scipy.optimize import linear_sum_assignment

    springs: list[Mode | Mount] = [*modes, *moving]
    stiffnesses = np.array([spring.stiffness_n_per_m for spring in springs])
    _, shapes = eigh(np.diag(stiffnesses), mass_matrix(modes, mount))
    shares = stiffnesses[:, np.newaxis] * shapes**2
    shapes = shapes[:, linear_sum_assignment(shares / shares.sum(axis=0), maximize=True)[1]]
    shapes = (shapes / np.diag(shapes))[:, : len(modes)]

    def seen(name: str, *of_carrier: float) -> list[float]:
        values = [*(getattr(mode, name) for mode in modes), *(of_carrier or (0.0, 0.0))[: len(moving)]]
        return [float(x) for x in np.array(values) @ shapes]

    dampings = np.array([spring.damping_n_s_per_m for spring in springs])
    columns = {
        "mass_kg": np.sum(shapes * (mass_matrix(modes, mount) @ shapes), axis=0).tolist(),
        "stiffness_n_per_m": (stiffnesses @ shapes**2).tolist(),
        "damping_n_s_per_m": (dampings @ shapes**2).tolist(),
        "coupling_a_n_per_v": seen("coupling_a_n_per_v"), "coupling_b_n_per_v": seen("coupling_b_n_per_v"),
        "tip_x": seen("tip_x", 0.0, 1.0), "tip_y": seen("tip_y", 1.0, 0.0),
        "recoil_kg": [0.0] * len(modes), "recoil_x_kg": [0.0] * len(modes),
    }  # fmt: skip
    return tuple(
        mode.model_copy(update={name: column[index] for name, column in columns.items()})
        for index, mode in enumerate(modes)
    )


def unknown_recoil(modes: Sequence[Mode], mount: Mount | None) -> tuple[str, ...]:
    """Return one sentence for each mode whose recoil is not known and may shift it by half a bandwidth or more.

    Its estimate is that of a mode whose mass moves with the tip.
    """
    found = []
    for mode in modes:
        along = (("recoil_kg", mode.tip_y), ("recoil_x_kg", mode.tip_x))
        for carrier, (name, moves) in zip(carriers(mount), along, strict=False):
            if getattr(mode, name) is not None or not moves:
                continue
            estimate = mode.mass_kg * moves / (mode.tip_x**2 + mode.tip_y**2)
            shift = 0.5 * estimate**2 / (mode.mass_kg * carrier.mass_kg)
            if 2.0 * shift * mode.quality_factor > 1.0:
                found.append(
                    f"The recoil of mode {mode.name} on the carrier is not known: one of {1e3 * abs(estimate):.2g} g, "
                    f"an estimate, would raise its frequency by {100.0 * shift:.2g} %; half its bandwidth is "
                    f"{50.0 / mode.quality_factor:.2g} %. State {name} of the mode, or beam.recoil = true for a beam."
                )
    return tuple(found)
