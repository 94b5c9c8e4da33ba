# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of a stator: cells with their materials, unknowns with their places, springs and the face of contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.solid.elements import Array, Indices, Part, plate_matrix
from pyspice_runner.motor.solid.parameters import Box, Placed, Solid, Support
from pyspice_runner.motor.solid.places import Places, places_of


@dataclass(frozen=True)
class Geometry:
    """A mesh with its materials, electrodes and supports."""

    basis: Any  # quadratic elements of one field
    parts: list[Part]
    place: Indices  # row of each unknown: displacements, then potentials, then groups; −1 where it is held at 0
    displacements: int
    size: int
    springs: list[tuple[Indices, Array]]  # unknowns and matrices of sprung faces
    contact: Array
    """Mean motion of each face of contact along normal and tangent, of all displacements: (2k, nodes, axes)."""

    @property
    def groups(self) -> int:
        """Number of groups: A, B and the feedback electrode, if there is one."""
        return len(self.place) - self.fields * int(self.basis.N) - 1

    @property
    def dimension(self) -> int:
        """2 of a plate, 3 of a solid."""
        return int(self.basis.mesh.dim())

    @property
    def fields(self) -> int:
        """Unknowns of a node."""
        return 2 if self.dimension == 2 else 4


def build_geometry(solid: Solid, finest_m: float | None = None) -> Geometry:
    """Return mesh, materials and places of a stator. Raise ParameterError for parts that miss it or touch wrongly.

    With ``finest_m`` the mesh of boxes is graded for the electric field (:func:`.places_of`).
    """
    try:
        from skfem import Basis
    except ImportError:
        raise ParameterError(
            "[solid] needs the finite elements of scikit-fem. Install them: `pip install 'piezomotor[solid]'`."
        ) from None
    plate = solid.theory == "plate"
    shape, owner = _owned(solid, finest_m)
    basis = Basis(shape.mesh, shape.element, intorder=4)
    base = (2 if plate else 4) * basis.N
    used = [(np.flatnonzero(owner == index), box) for index, box in enumerate(solid.boxes)]
    parts = [part for cells, box in used if len(cells) for part in _parts(solid, shape, cells, box, base)]
    place, displacements, size = _places(solid, shape, basis, parts)
    springs = []
    fields = 2 if plate else 4
    for index, support in enumerate(solid.supports):
        if support.stiffness_n_per_m is not None:
            nodes, local = _spread(shape, basis, support, f"supports.{index}")
            held = support.stiffness_n_per_m * local
            springs += [(fields * nodes + axis, held) for axis in _axes(support, shape.mesh.dim())]
    contact = np.zeros((2 * len(solid.touched), basis.N, shape.mesh.dim()))
    for number, (name, face) in enumerate(solid.touched.items()):
        nodes, local = _spread(shape, basis, face, name)
        mean = np.bincount(nodes.ravel(), local.sum(axis=2).ravel(), minlength=basis.N)
        for row, sense in enumerate((face.normal, face.tangent), start=2 * number):
            contact[row, :, "xyz".index(sense[1])] = mean if sense[0] == "+" else -mean
    return Geometry(basis, parts, place, displacements, size, springs, contact)


def _owned(solid: Solid, finest_m: float | None = None) -> tuple[Places, Indices]:
    """Return the mesh without the cells that no box has, and the number of the box that each cell belongs to."""
    shape = places_of(solid, finest_m)
    owner = np.full(shape.mesh.nelements, -1)
    for index, box in enumerate(solid.boxes):
        owner[shape.cells(box, f"boxes.{index}")] = index
    kept = np.flatnonzero(owner >= 0)
    shape.restrict(kept)
    return shape, owner[kept]


def regions_of(solid: Solid) -> tuple[Array, list[Indices], list[Indices], Array]:
    """Return the places of the vertices in m, what boxes and electrodes cover, and the middle of the contact in m.

    A box covers cells, an electrode facets, or cells of a plate, each as numbers of vertices, (corners, n). Raise
    ParameterError as :func:`build_geometry`.
    """
    from skfem import Basis

    shape, owner = _owned(solid)
    mesh, electrodes = shape.mesh, []
    for index, electrode in enumerate(solid.electrodes):
        name = f"electrodes.{index}"
        if solid.theory == "plate":
            electrodes.append(mesh.t[:, shape.cells(electrode, name)])
        else:
            electrodes.append(mesh.facets[:, shape.facets(electrode, name)])
    boxes = [mesh.t[:, owner == index] for index in range(len(solid.boxes))]
    basis = Basis(mesh, shape.element)
    touched = basis.doflocs[:, shape.nodes(basis, solid.contact, "contact")]
    return mesh.p, boxes, electrodes, touched.mean(axis=1)


def _parts(solid: Solid, shape: Places, cells: Indices, box: Box, base: int) -> list[Part]:
    """Return the cells of a box as parts: of a plate those between the same electrodes."""
    card = solid.material(box)
    matrix, ceramic = card.matrix(box.polarisation), bool(card.stress_constants_c_m2.any())
    if solid.theory == "solid":
        return [Part(cells, matrix, card.density_kg_m3, ceramic=ceramic)]
    faces = np.full((2, len(cells)), -1)
    for index, electrode in enumerate(solid.electrodes):
        side = shape.side(electrode, box)
        if side is not None:
            covered = shape.cells(electrode, f"electrodes.{index}")[cells]
            faces[side, covered] = solid.groups.index(electrode.group)
    found, ground = [], base + len(solid.groups) - 1
    for upper, lower in np.unique(faces, axis=1).T:
        shorted = min(upper, lower) >= 0
        found.append(
            Part(
                cells[(faces[0] == upper) & (faces[1] == lower)],
                plate_matrix(matrix, shorted=shorted),
                card.density_kg_m3,
                box.height_m,
                (base + int(upper), base + int(lower)) if shorted else (ground, ground),
                ceramic,
            )
        )
    return found


def _places(solid: Solid, shape: Places, basis: Any, parts: list[Part]) -> tuple[Indices, int, int]:
    """Return the row of each unknown, and the numbers of displacements and of all rows."""
    dimension = basis.mesh.dim()
    fields = 2 if dimension == 2 else 4
    free = np.ones((basis.N, dimension), dtype=bool)
    for index, support in enumerate(solid.supports):
        if support.stiffness_n_per_m is None:
            held = shape.nodes(basis, support, f"supports.{index}")
            for axis in _axes(support, dimension):
                free[held, axis] = False
    place = np.full((basis.N, fields), -1)
    displacements = int(free.sum())
    place[:, :dimension][free] = np.arange(displacements)
    unknown, groups = displacements, len(solid.groups) - 1
    if dimension == 3:
        potential = np.full(basis.N, -1)
        for part in parts:
            if part.matrix[6:, 6:].any():
                potential[basis.element_dofs[:, part.cells]] = groups + 1
        for index, electrode in enumerate(solid.electrodes):
            covered = shape.nodes(basis, electrode, f"electrodes.{index}") & (potential >= 0)
            _cover(potential, covered, solid, index)
        between = potential == groups + 1
        place[between, 3] = displacements + np.arange(between.sum())
        unknown += int(between.sum())
        for group in range(groups):
            place[potential == group, 3] = unknown + group
    return np.append(place.ravel(), [*range(unknown, unknown + groups), -1]), displacements, unknown + groups


def _cover(potential: Indices, covered: NDArray[np.bool_], solid: Solid, index: int) -> None:
    """Give the nodes under an electrode its group. Raise ParameterError if there are none, or another has them."""
    if not covered.any():
        raise ParameterError(f"solid.electrodes.{index} touches no ceramic; correct its place.")
    groups, own = solid.groups, solid.electrodes[index].group
    group = groups.index(own)
    others = set(potential[covered]) - {group, len(groups)}
    if others:
        raise ParameterError(
            f"solid.electrodes.{index} of group {own} touches one of group {groups[min(others)]}; leave a "
            "gap between them."
        )
    potential[covered] = group


def _axes(support: Support, dimension: int) -> list[int]:
    """Return the directions that a support holds; a plate moves in its plane only."""
    return [axis for axis in range(dimension) if "xyz"[axis] in support.directions]


def _spread(shape: Places, basis: Any, item: Placed, name: str) -> tuple[Indices, Array]:
    """Return the nodes of a face, (facets, n), and ∫NᵢNⱼ over its area, (facets, n, n); of a point its nodes."""
    facets = shape.facets(item, name)
    if len(facets):
        try:
            face = basis.boundary(facets)
        except Exception as error:
            if "Newton" not in str(error):  # scikit-fem has no class of its own for cells that it cannot invert
                raise
            raise ParameterError(
                f"solid.{name} has cells that are too thin for finite elements; where edges of boxes and electrodes "
                "almost coincide, give them the same coordinate."
            ) from error
        values = np.stack([np.asarray(field[0]) for field in face.basis])
        local = np.einsum("afq,bfq,fq->fab", values, values, face.dx / face.dx.sum())
        return face.element_dofs.T, np.asarray(local)
    nodes = np.flatnonzero(shape.nodes(basis, item, name))
    return nodes[:, None], np.full((len(nodes), 1, 1), 1.0 / len(nodes))
