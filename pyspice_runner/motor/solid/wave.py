# SPDX-License-Identifier: GPL-3.0-or-later
r"""Modes of a travelling-wave ring by finite elements of one wave, with its teeth.

The sector of the angle 2π/n is one wave long, so that the motion at its two ends is the same in cylindrical
components: the unknowns are u_r, u_θ and u_z of each node, those of the one end are those of the other. Modes of n
waves appear as pairs of the same frequency, besides those of 0, 2n, … waves.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import pi
from typing import Any

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.numerics import one_thread_of_scipy
from pyspice_runner.motor.ring import Ring, Wave, wave_of_plate
from pyspice_runner.motor.solid.elements import VOLTS, Array, Indices, Part, assemble, factor
from pyspice_runner.motor.solid.materials import materials
from pyspice_runner.motor.solid.stator import lowest_modes

# more cells change the frequency by less than 0.1 %, that of a ring with teeth by less than 0.3 %
_AROUND = {False: 16, True: 32}  # cells of a wave at least, without teeth and with them
_ACROSS = 2  # cells across the width at least
_UP = 4  # cells in the height of the metal, and of the teeth
_GRADING = 2.5  # power by which these cells shrink towards the roots of the teeth, whose edges are singular
_NEAR = 1e-7  # of the outer radius: places that are meant to coincide


def wave_of(ring: Ring) -> Wave:
    """Return the mode of a ring by its own theory. Raise ParameterError as :func:`wave_of_solid`."""
    return wave_of_plate(ring) if ring.theory == "plate" else wave_of_solid(ring)


@cache
@one_thread_of_scipy()  # the modes enter decks and the addresses of stored points
def wave_of_solid(ring: Ring) -> Wave:
    """Return the mode of a ring that bends out of its plane. Raise ParameterError without scikit-fem, or unequal teeth.

    It is the lowest pair of modes of n waves that moves the circle of contact along the axis.
    """
    if ring.teeth % ring.waves:
        raise ParameterError(
            f'ring.teeth = {ring.teeth} must be a multiple of ring.waves = {ring.waves} with theory = "solid", which '
            'takes one wave for all. Correct one of them, or use theory = "plate".'
        )
    try:
        from skfem import Basis, ElementHexS2
    except ImportError:
        raise ParameterError(
            'ring.theory = "solid" needs the finite elements of scikit-fem. Install them: '
            "`pip install 'piezomotor[solid]'`."
        ) from None
    mesh, ceramic = _mesh(ring)
    basis = Basis(mesh, ElementHexS2(), intorder=4)
    nodes = basis.N
    height, angle = basis.doflocs[2], np.arctan2(basis.doflocs[1], basis.doflocs[0])
    near = _NEAR * ring.outer_radius_m
    # potentials within the ceramic, and of the electrode below it; its upper face is ground
    inside = np.zeros(nodes, dtype=bool)
    inside[basis.element_dofs[:, ceramic]] = True
    inside &= height < ring.ceramic_thickness_m - near
    electrode = inside & (height < near)
    inside &= ~electrode
    count = 3 * nodes + int(inside.sum())
    place = np.full((nodes, 4), -1)
    place[:, :3] = np.arange(3 * nodes).reshape(-1, 3)
    place[inside, 3] = np.arange(3 * nodes, count)
    place[electrode, 3] = count
    stiffness, mass = assemble(basis, _parts(ring, mesh, ceramic), place.ravel(), count + 1)
    tie, moving = _periodic(basis.doflocs, 2.0 * pi / ring.waves, place[:, 3], near)
    stiffness, mass = (tie.T @ stiffness @ tie).tocsc(), (tie.T @ mass @ tie).tocsc()
    inner = slice(0, stiffness.shape[0] - 1)
    highest = (1.3 * 2.0 * pi * wave_of_plate(ring).frequency_hz) ** 2
    shift = -0.0625 * highest
    solve = factor(stiffness[inner, inner] - shift * mass[inner, inner])
    squares, vectors = lowest_modes(solve, mass[:moving, :moving].tocsr(), inner.stop, shift, highest)
    force = -(stiffness[inner, -1:].toarray().T @ vectors)[0] / VOLTS

    circle = (np.abs(height - ring.top_m) < near) & (
        np.abs(np.hypot(*basis.doflocs[:2]) - ring.contact_radius_m) < 1e-3 * ring.contact_radius_m
    )
    motion = (tie[: 3 * nodes, : inner.stop] @ vectors).reshape(nodes, 3, -1)[circle]
    phase = ring.waves * angle[circle]
    around = np.stack([np.cos(phase), np.sin(phase)], axis=1)
    forward = -np.sin(angle[circle])[:, None] * motion[:, 0] + np.cos(angle[circle])[:, None] * motion[:, 1]
    axial, along = (np.linalg.lstsq(around, part, rcond=None)[0] for part in (motion[:, 2], forward))
    moves = np.hypot(*axial)
    pair = np.flatnonzero(moves > 0.5 * moves.max())[:2]  # others bend in the plane, or with circular nodes
    mix = np.linalg.solve(axial[:, pair], [1.0, 0.0])  # of the pair to cos φ
    return Wave(
        frequency_hz=float(np.sqrt(squares[pair].mean()) / (2.0 * pi)),
        mass_kg=float(ring.waves * mix @ mix),
        force_n_per_v=float(abs(force[pair] @ mix)),
        lever=float(along[1, pair] @ mix),
    )


def _mesh(ring: Ring) -> tuple[Any, Indices]:
    """Return the mesh of one wave and the numbers of the cells of ceramic."""
    from skfem import MeshHex

    face = ring.face_m
    pitch = 2.0 * pi / ring.waves
    per_wave = ring.teeth // ring.waves
    space = 0.5 * (1.0 - ring.tooth_share)
    edges = {0.0, 0.25, 0.5, 0.75, 1.0}
    edges |= {(tooth + at) / per_wave for tooth in range(per_wave) for at in (space, 1.0 - space)}
    graded = np.linspace(0.0, 1.0, _UP + 1) ** (_GRADING if ring.teeth else 1.0)
    heights = np.concatenate([[0.0], face - ring.thickness_m * graded[::-1]])
    if ring.teeth:
        heights = np.concatenate([heights, face + ring.tooth_height_m * graded[1:]])
    circles = {ring.inner_radius_m, ring.contact_radius_m, ring.outer_radius_m}
    across = _refined(circles, (ring.outer_radius_m - ring.inner_radius_m) / _ACROSS)
    around = pitch * _refined(edges, 1.0 / _AROUND[ring.teeth > 0])
    mesh = MeshHex.init_tensor(across, around, heights)
    _, angle, height = mesh.p[:, mesh.t].mean(axis=1)
    within = (angle / pitch * max(per_wave, 1)) % 1.0
    mesh = mesh.restrict(np.flatnonzero((height < face) | (np.abs(within - 0.5) < 0.5 - space)))
    ceramic = np.flatnonzero(mesh.p[2, mesh.t].mean(axis=0) < ring.ceramic_thickness_m)
    radius, angle, height = mesh.p
    return MeshHex(np.stack([radius * np.cos(angle), radius * np.sin(angle), height]), mesh.t), ceramic


def _refined(edges: set[float], longest: float) -> Array:
    """Return the edges in order, with equal steps between them that are no longer than ``longest``."""
    order = sorted(edges)
    order = [low for low, high in zip(order, [*order[1:], np.inf], strict=True) if high - low > 1e-6 * longest]
    parts = [
        np.linspace(low, high, int(np.ceil((high - low) / longest - 1e-9)), endpoint=False)
        for low, high in pairwise(order)
    ]
    return np.concatenate([*parts, order[-1:]])


def _parts(ring: Ring, mesh: Any, ceramic: Indices) -> list[Part]:
    """Return metal, and ceramic that is poled by the sign of cos φ."""
    x, y, _ = mesh.p[:, mesh.t].mean(axis=1)
    forward = np.cos(ring.waves * np.arctan2(y, x)) > 0.0
    metal, card = materials()[ring.material], materials()[ring.ceramic]
    found = [Part(np.setdiff1d(np.arange(mesh.nelements), ceramic), metal.matrix(), metal.density_kg_m3)]
    for poled, cells in (("+z", ceramic[forward[ceramic]]), ("-z", ceramic[~forward[ceramic]])):
        found.append(Part(cells, card.matrix(poled), card.density_kg_m3, ceramic=True))
    return found


def _periodic(places: Array, pitch: float, potential: Indices, near: float) -> tuple[Any, int]:
    """Return the matrix from the unknowns of a sector to those of its nodes, and how many of the former are motions.

    Its rows are the displacements along x, y and z, then the potentials with the numbers ``potential`` of the nodes.
    """
    from scipy.sparse import coo_matrix

    nodes = places.shape[1]
    angle = np.arctan2(places[1], places[0])
    section = np.round(np.stack([np.hypot(places[0], places[1]), places[2]]) / near)
    first, last = (np.flatnonzero(np.abs(angle - end) * places[0].max() < near) for end in (0.0, pitch))
    partner = np.arange(nodes)
    partner[last[np.lexsort(section[:, last])]] = first[np.lexsort(section[:, first])]
    own = np.unique(partner)
    number = np.searchsorted(own, partner)
    rows, columns = 3 * np.arange(nodes), 3 * number
    cosine, sine = np.cos(angle), np.sin(angle)
    entries = [
        (rows, columns, cosine), (rows, columns + 1, -sine), (rows + 1, columns, sine),
        (rows + 1, columns + 1, cosine), (rows + 2, columns + 2, np.ones(nodes)),
    ]  # fmt: skip
    moving = 3 * len(own)
    charged = np.flatnonzero(potential >= 0)
    leader, place = np.unique(potential[partner[charged]], return_inverse=True)  # the electrode is the last
    _, once = np.unique(potential[charged], return_index=True)
    entries.append((potential[charged][once], moving + place[once], np.ones(len(once))))
    row, column, value = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    return coo_matrix((value, (row, column)), shape=(potential.max() + 1, moving + len(leader))).tocsc(), moving
