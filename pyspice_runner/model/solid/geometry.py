# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of a stator: cells with their materials, unknowns with their places, springs and the face of contact."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.model.solid.elements import Array, Indices, Part, plate_matrix
from pyspice_runner.model.solid.materials import materials
from pyspice_runner.model.solid.parameters import Box, Electrode, Placed, Solid, Support

MOST_CELLS = 20_000  # some 350,000 unknowns, beyond the memory of most machines
_NEAR = 1e-6  # of an element: places that are meant to coincide
_GROUPS = ("A", "B", "ground")


@dataclass(frozen=True)
class Geometry:
    """A mesh with its materials, electrodes and supports."""

    basis: Any
    """Quadratic elements of one field."""
    parts: list[Part]
    place: Indices
    """Row of each unknown: displacements, then potentials, then groups A and B; −1 where it is held at 0."""
    displacements: int
    size: int
    springs: list[tuple[Indices, Array]]
    """Unknowns and matrices of sprung faces."""
    contact: Array
    """Mean motion of the face of contact along normal and tangent, of all displacements of nodes: (2, nodes, axes)."""

    @property
    def dimension(self) -> int:
        """2 of a plate, 3 of a solid."""
        return int(self.basis.mesh.dim())

    @property
    def fields(self) -> int:
        """Unknowns of a node."""
        return 2 if self.dimension == 2 else 4


def build_geometry(solid: Solid) -> Geometry:
    """Return mesh, materials and places of a stator. Raise ParameterError for parts that miss it or touch wrongly."""
    try:
        from skfem import Basis, ElementHexS2, ElementQuadS2, MeshHex, MeshQuad
    except ImportError:
        raise ParameterError(
            "[solid] needs the finite elements of scikit-fem. Install them: `pip install 'pyspice-runner[solid]'`."
        ) from None
    plate = solid.theory == "plate"
    lines = [_lines(solid, axis) for axis in range(2 if plate else 3)]
    cells = int(np.prod([len(line) - 1 for line in lines]))
    if cells > MOST_CELLS:
        raise ParameterError(
            f"solid.element_m = {solid.element_m:g} m gives {cells} elements; the limit is {MOST_CELLS}, so raise it."
        )
    mesh = (MeshQuad if plate else MeshHex).init_tensor(*lines)
    mesh = mesh.restrict(np.flatnonzero(_owners(solid, mesh) >= 0))
    basis = Basis(mesh, ElementQuadS2() if plate else ElementHexS2(), intorder=4)
    owner = _owners(solid, mesh)
    base = (2 if plate else 4) * basis.N
    used = [(np.flatnonzero(owner == index), box) for index, box in enumerate(solid.boxes)]
    parts = [part for cells, box in used if len(cells) for part in _parts(solid, mesh, cells, box, base)]
    place, displacements, size = _places(solid, basis, parts)
    springs = []
    fields = 2 if plate else 4
    for index, support in enumerate(solid.supports):
        if support.stiffness_n_per_m is not None:
            nodes, local = _spread(solid, basis, support, f"supports.{index}")
            held = support.stiffness_n_per_m * local
            springs += [(fields * nodes + axis, held) for axis in _axes(support, mesh.dim())]
    nodes, local = _spread(solid, basis, solid.contact, "contact")
    mean = np.bincount(nodes.ravel(), local.sum(axis=2).ravel(), minlength=basis.N)
    contact = np.zeros((2, basis.N, mesh.dim()))
    for row, sense in enumerate((solid.contact.normal, solid.contact.tangent)):
        contact[row, :, "xyz".index(sense[1])] = mean if sense[0] == "+" else -mean
    return Geometry(basis, parts, place, displacements, size, springs, contact)


def _lines(solid: Solid, axis: int) -> Array:
    """Return the coordinates of the mesh along an axis: every edge of what is placed, and steps between them."""
    corners = [corner[axis] for box in solid.boxes for corner in (box.from_m, box.to_m)]
    placed = (*solid.boxes, *solid.electrodes, *solid.supports, solid.contact)
    near = _NEAR * solid.element_m
    edges: list[float] = []
    for edge in sorted(corner[axis] for item in placed for corner in (item.from_m, item.to_m)):
        if min(corners) - near <= edge <= max(corners) + near and (not edges or edge - edges[-1] > near):
            edges.append(edge)
    steps = [ceil((high - low) / solid.element_m - _NEAR) for low, high in pairwise(edges)]
    pieces = [
        np.linspace(low, high, count, endpoint=False) for (low, high), count in zip(pairwise(edges), steps, strict=True)
    ]
    return np.concatenate([*pieces, edges[-1:]])


def inside(item: Placed, points: Array, near: float) -> NDArray[np.bool_]:
    """Return which points, (axes, …), lie within what is placed; a plate has no z."""
    shape = (-1, *[1] * (points.ndim - 1))
    low, high = (np.reshape(corner[: len(points)], shape) for corner in (item.from_m, item.to_m))
    return np.asarray(np.all((points >= low - near) & (points <= high + near), axis=0))


def _centres(mesh: Any) -> Array:
    return np.asarray(mesh.p[:, mesh.t].mean(axis=1))


def _owners(solid: Solid, mesh: Any) -> Indices:
    """Return the number of the box that each cell belongs to, −1 for none."""
    owner, centres = np.full(mesh.t.shape[1], -1), _centres(mesh)
    for index, box in enumerate(solid.boxes):
        owner[inside(box, centres, 0.0)] = index
    return owner


def _parts(solid: Solid, mesh: Any, cells: Indices, box: Box, base: int) -> list[Part]:
    """Return the cells of a box as parts: of a plate those between the same electrodes."""
    card = materials()[box.material]
    matrix, ceramic = card.matrix(box.polarisation), bool(card.stress_constants_c_m2.any())
    if solid.theory == "solid":
        return [Part(cells, matrix, card.density_kg_m3, ceramic=ceramic)]
    centres = _centres(mesh)[:, cells]
    near = _NEAR * solid.element_m
    faces = np.full((2, len(cells)), -1)
    for row, height in enumerate((box.to_m[2], box.from_m[2])):
        for electrode in solid.electrodes:
            if abs(electrode.from_m[2] - height) <= near and abs(electrode.to_m[2] - height) <= near:
                faces[row, inside(electrode, centres, near)] = _GROUPS.index(electrode.group)
    found = []
    for upper, lower in np.unique(faces, axis=1).T:
        shorted = min(upper, lower) >= 0
        found.append(
            Part(
                cells[(faces[0] == upper) & (faces[1] == lower)],
                plate_matrix(matrix, shorted=shorted),
                card.density_kg_m3,
                box.to_m[2] - box.from_m[2],
                (base + int(upper), base + int(lower)) if shorted else (base + 2, base + 2),
                ceramic,
            )
        )
    return found


def _places(solid: Solid, basis: Any, parts: list[Part]) -> tuple[Indices, int, int]:
    """Return the row of each unknown, and the numbers of displacements and of all rows."""
    dimension, nodes, near = basis.mesh.dim(), basis.doflocs, _NEAR * solid.element_m
    fields = 2 if dimension == 2 else 4
    free = np.ones((basis.N, dimension), dtype=bool)
    for index, support in enumerate(solid.supports):
        if support.stiffness_n_per_m is None:
            held = inside(support, nodes, near)
            if not held.any():
                raise _misses(f"supports.{index}")
            for axis in _axes(support, dimension):
                free[held, axis] = False
    place = np.full((basis.N, fields), -1)
    displacements = int(free.sum())
    place[:, :dimension][free] = np.arange(displacements)
    unknown = displacements
    if dimension == 3:
        potential = np.full(basis.N, -1)
        for part in parts:
            if part.matrix[6:, 6:].any():
                potential[basis.element_dofs[:, part.cells]] = len(_GROUPS)
        for index, electrode in enumerate(solid.electrodes):
            _cover(potential, inside(electrode, nodes, near) & (potential >= 0), electrode, index)
        between = potential == len(_GROUPS)
        place[between, 3] = displacements + np.arange(between.sum())
        unknown += int(between.sum())
        for group in (0, 1):
            place[potential == group, 3] = unknown + group
    return np.append(place.ravel(), [unknown, unknown + 1, -1]), displacements, unknown + 2


def _cover(potential: Indices, covered: NDArray[np.bool_], electrode: Electrode, index: int) -> None:
    """Give the nodes under an electrode its group. Raise ParameterError if there are none, or another has them."""
    if not covered.any():
        raise _misses(f"electrodes.{index}")
    group = _GROUPS.index(electrode.group)
    others = set(potential[covered]) - {group, len(_GROUPS)}
    if others:
        raise ParameterError(
            f"solid.electrodes.{index} of group {electrode.group} touches one of group {_GROUPS[min(others)]}; leave a "
            "gap between them."
        )
    potential[covered] = group


def _axes(support: Support, dimension: int) -> list[int]:
    """Return the directions that a support holds; a plate moves in its plane only."""
    return [axis for axis in range(dimension) if "xyz"[axis] in support.directions]


def _spread(solid: Solid, basis: Any, item: Placed, name: str) -> tuple[Indices, Array]:
    """Return the nodes of a face, (facets, n), and ∫NᵢNⱼ over its area, (facets, n, n); of a point its nodes."""
    mesh, near = basis.mesh, _NEAR * solid.element_m
    facets = mesh.boundary_facets()
    facets = facets[inside(item, mesh.p[:, mesh.facets[:, facets]], near).all(axis=0)]
    if len(facets):
        face = basis.boundary(facets)
        values = np.stack([np.asarray(field[0]) for field in face.basis])
        local = np.einsum("afq,bfq,fq->fab", values, values, face.dx / face.dx.sum())
        return face.element_dofs.T, np.asarray(local)
    nodes = np.flatnonzero(inside(item, basis.doflocs, near))
    if not len(nodes):
        raise _misses(name)
    return nodes[:, None], np.full((len(nodes), 1, 1), 1.0 / len(nodes))


def _misses(name: str) -> ParameterError:
    return ParameterError(f"solid.{name} touches no box; correct its from_m and to_m.")
