# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of a stator, and which of its cells, facets and nodes a box, an electrode or a support covers.

Meshes are built from boxes along the axes or read from a file. Both have straight edges: of second-order cells in a
file only the corners are taken, and the displacements are quadratic in either case.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from math import ceil, log
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.refusal import quoted
from pyspice_runner.motor.solid.elements import Array, Indices
from pyspice_runner.motor.solid.parameters import LARGEST, Box, Electrode, MeshFile, Placed, Solid, mesh_file

MOST_CELLS = 20_000  # about 350,000 unknowns, beyond the memory of most machines
_NEAR = 1e-6  # of an element: places that are meant to coincide
_FLAT = 1e-9  # of a cube's volume: of a cell without one
GRADING = 3.0  # ratio of neighbouring cells of a mesh that is graded towards the edges of electrodes

Mask = NDArray[np.bool_]


class _Blocks:
    """A mesh of boxes along the axes, cut into cells no longer than ``element_m``, and where its parts are.

    With ``finest_m`` the cells shrink towards edges and faces of electrodes to about this length, and are as long as
    the parts elsewhere: for the electric field alone. ``name`` is the path of an item, for messages.
    """

    def __init__(self, solid: Solid, finest_m: float | None = None) -> None:
        from skfem import ElementHexS2, ElementQuadS2, MeshHex, MeshQuad

        assert solid.element_m is not None
        self._near = _NEAR * solid.element_m
        plate = solid.theory == "plate"
        axes = range(2 if plate else 3)
        if finest_m is None:
            lines = [self._line(solid, axis, solid.element_m) for axis in axes]
        else:
            lines = [_graded(self._line(solid, axis, 2.0 * LARGEST), electrode_edges(solid, axis), finest_m)
                     for axis in axes]  # fmt: skip
        cells = int(np.prod([len(line) - 1 for line in lines]))
        if cells > MOST_CELLS:
            raise ParameterError(
                f"solid.element_m = {solid.element_m:g} m gives {cells} elements; the limit is {MOST_CELLS}, so raise "
                "it."
            )
        self.mesh = (MeshQuad if plate else MeshHex).init_tensor(*lines)
        self.element = (ElementQuadS2 if plate else ElementHexS2)()

    def _line(self, solid: Solid, axis: int, longest: float) -> Array:
        """Return the coordinates of the mesh along an axis: every edge of what is placed, and steps between them."""
        corners = [corner[axis] for box in solid.boxes for corner in box.corners]
        edges: list[float] = []
        for edge in sorted(corner[axis] for item in solid.placed.values() for corner in item.corners):
            within = min(corners) - self._near <= edge <= max(corners) + self._near
            if within and (not edges or edge - edges[-1] > self._near):
                edges.append(edge)
        steps = [ceil((high - low) / longest - _NEAR) for low, high in pairwise(edges)]
        pieces = [
            np.linspace(low, high, count, endpoint=False)
            for (low, high), count in zip(pairwise(edges), steps, strict=True)
        ]
        return np.concatenate([*pieces, edges[-1:]])

    def _inside(self, item: Placed, points: Array) -> Mask:
        """Return which points, (axes, …), lie within what is placed; a plate has no z."""
        shape = (-1, *[1] * (points.ndim - 1))
        low, high = (np.reshape(corner[: len(points)], shape) for corner in item.corners)
        return np.asarray(np.all((points >= low - self._near) & (points <= high + self._near), axis=0))

    def restrict(self, cells: Indices) -> None:
        """Keep these cells only."""
        self.mesh = self.mesh.restrict(cells)

    def cells(self, item: Placed, name: str) -> Mask:  # noqa: ARG002
        """Return which cells lie in an item."""
        return self._inside(item, self.mesh.p[:, self.mesh.t].mean(axis=1))

    def facets(self, item: Placed, name: str) -> Indices:  # noqa: ARG002
        """Return the facets of the boundary that an item covers, none of a point."""
        facets = self.mesh.boundary_facets()
        return np.asarray(facets[self._inside(item, self.mesh.p[:, self.mesh.facets[:, facets]]).all(axis=0)])

    def nodes(self, basis: Any, item: Placed, name: str) -> Mask:
        """Return which nodes of the elements an item covers. Raise ParameterError if there are none."""
        found = self._inside(item, basis.doflocs)
        if not found.any():
            raise ParameterError(f"solid.{name} touches no box; correct its from_m and to_m.")
        return found

    def side(self, electrode: Electrode, box: Box) -> int | None:
        """Return 0 for an electrode on the upper face of a plate, 1 on its lower face, None otherwise."""
        (_, _, low), (_, _, high) = electrode.corners
        for row, height in enumerate((box.corners[1][2], box.corners[0][2])):
            if abs(low - height) <= self._near and abs(high - height) <= self._near:
                return row
        return None


def electrode_edges(solid: Solid, axis: int) -> Array:
    """Return the coordinates in m along an axis of faces of electrodes, and of their edges within the ceramic."""
    ceramic = [box for box in solid.boxes if solid.material(box).stress_constants_c_m2.any()]
    ends = [corner[axis] for box in ceramic or solid.boxes for corner in box.corners]
    pairs = [tuple(corner[axis] for corner in item.corners) for item in solid.electrodes]
    return np.unique(
        [edge for low, high in pairs for edge in (low, high) if low == high or min(ends) < edge < max(ends)]
    )


def _graded(line: Array, edges: Array, finest_m: float) -> Array:
    """Return the coordinates of a mesh along an axis with cells that shrink towards ``edges`` to ``finest_m``."""
    found = [line]
    for low, high in pairwise(line):
        near = [bool(np.isclose(edges, end, rtol=0.0, atol=0.1 * finest_m).any()) for end in (low, high)]
        room = (high - low) / 2.0 if all(near) else high - low
        steps = room / GRADING ** np.arange(1, max(ceil(log(room / finest_m, GRADING) - 0.5), 0) + 1)
        found += [low + steps] if near[0] else []
        found += [high - steps] if near[1] else []
        found += [np.array([0.5 * (low + high)])] if all(near) else []
    return np.unique(np.concatenate(found))


_CORNERS = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "hexahedron": 8}
_WHAT = ("points", "curves", "surfaces", "volumes")


class _Regions:
    """The cells of a mesh file by gmsh, with its physical groups; the same questions as to :class:`_Blocks`."""

    def __init__(self, solid: Solid) -> None:
        assert solid.mesh is not None
        file = _read(solid.mesh)
        self._dimension = 2 if solid.theory == "plate" else 3
        self._kind, cells = _cells(file.cells, self._dimension)
        points = np.asarray(file.points, dtype=np.float64) * solid.mesh_unit_m
        _check_points(points[np.unique(cells)], self._dimension)
        self._points = points.T[: self._dimension]
        self._groups = _groups(file)
        self._build(cells)
        self._check_shapes()

    def _check_shapes(self) -> None:
        """Raise ParameterError for a cell without a volume, or folded so that its corners turn both ways."""
        size = np.ptp(self.mesh.p[:, self.mesh.t], axis=1).max(axis=0)[:, np.newaxis]
        shapes = (
            self.mesh.mapping().detDF(self.element.refdom.p) / size**self._dimension
        )  # at the corners; ±1 of a cube
        low, high = shapes.min(axis=1), shapes.max(axis=1)
        flat = np.flatnonzero((np.maximum(-low, high) < _FLAT) | (np.minimum(-low, high) > _FLAT))
        if len(flat):
            corner = ", ".join(f"{value:g}" for value in self.mesh.p[:, self.mesh.t[0, flat[0]]])
            raise ParameterError(
                f"The mesh has {len(flat)} flat or folded cells, one with a corner at ({corner}) m. Mesh the part anew."
            )

    def _build(self, cells: Indices) -> None:
        import skfem

        mesh, element = {
            "triangle": (skfem.MeshTri, skfem.ElementTriP2), "quad": (skfem.MeshQuad, skfem.ElementQuadS2),
            "tetra": (skfem.MeshTet, skfem.ElementTetP2), "hexahedron": (skfem.MeshHex, skfem.ElementHexS2),
        }[self._kind]  # fmt: skip
        used, numbers = np.unique(cells, return_inverse=True)
        self._cells, self._vertex = cells, np.full(self._points.shape[1], -1)
        self._vertex[used] = np.arange(len(used))
        self.mesh = mesh(np.ascontiguousarray(self._points[:, used]), numbers.reshape(cells.shape))
        self.element = element()

    def restrict(self, cells: Indices) -> None:
        self._build(self._cells[:, cells])

    def cells(self, item: Placed, name: str) -> Mask:
        _, corners = self._group(item, name, (self._dimension,))
        return _among(self.mesh.t, corners)

    def facets(self, item: Placed, name: str) -> Indices:
        dimension, corners = self._group(item, name, (self._dimension - 1, 0))
        if dimension == 0:
            return np.empty(0, dtype=np.int64)
        boundary = self.mesh.boundary_facets()
        found = boundary[_among(self.mesh.facets[:, boundary], corners)]
        if not len(found):
            raise ParameterError(f"solid.{name}.region = {quoted(item.region)} is no outer face; name one that is.")
        return np.asarray(found)

    def nodes(self, basis: Any, item: Placed, name: str) -> Mask:
        dimension, corners = self._group(item, name, (self._dimension - 1, self._dimension, 0))
        if dimension == self._dimension:
            nodes = basis.element_dofs[:, _among(self.mesh.t, corners)].ravel()
        elif dimension == 0:
            nodes = basis.nodal_dofs[0, corners.ravel()]
        else:
            nodes = basis.get_dofs(np.flatnonzero(_among(self.mesh.facets, corners))).flatten()
        found = np.zeros(basis.N, dtype=bool)
        found[nodes] = True
        return found

    def side(self, electrode: Electrode, box: Box) -> int | None:  # noqa: ARG002
        return ("+z", "-z").index(electrode.side or "+z")

    def _group(self, item: Placed, name: str, dimensions: tuple[int, ...]) -> tuple[int, Indices]:
        """Return the first of these dimensions that a group has, and the vertices of its parts, (n, corners)."""
        stated = f"solid.{name}.region = {quoted(item.region)}"
        group = self._groups.get(item.region or "")
        if group is None:
            known = ", ".join(map(quoted, self._groups)) or "none with a name"
            raise ParameterError(f"{stated} is not a physical group of the mesh; there are {known}.")
        dimension = next((wanted for wanted in dimensions if wanted in group), None)
        if dimension is None:
            has, wanted = (" or ".join(_WHAT[each] for each in these) for these in (sorted(group), dimensions))
            raise ParameterError(f"{stated} is a group of {has}; it must be one of {wanted}.")
        corners = self._vertex[group[dimension]]
        corners = corners[(corners >= 0).all(axis=1)]
        if not len(corners):
            raise ParameterError(f"{stated} touches no box; correct it.")
        return dimension, corners


Places = _Blocks | _Regions


def places_of(solid: Solid, finest_m: float | None = None) -> Places:
    """Return the mesh of a stator, built or read. Raise ParameterError for too many elements or an unfit file.

    A mesh of boxes with ``finest_m`` is graded for the electric field.
    """
    return _Blocks(solid, finest_m) if solid.mesh is None else _Regions(solid)


def _read(source: MeshFile) -> Any:
    """Return a mesh file as meshio reads it. Raise ParameterError if it cannot, or if the file has changed."""
    try:
        import meshio
    except ImportError:
        raise ParameterError("A mesh file needs meshio. Install it: `pip install 'piezomotor[solid]'`.") from None
    if mesh_file(Path(source.path)) != source:
        raise ParameterError(f"The mesh {source.path} has changed since the motor was read; read the motor again.")
    try:
        return meshio.gmsh.read(source.path)
    except Exception as error:  # noqa: BLE001 # a damaged file makes meshio raise errors of any type
        raise ParameterError(
            f"{source.path} is not a mesh that can be read ({type(error).__name__}). Save it with gmsh as version 4.1 "
            "or 2.2, with its physical groups only."
        ) from None


def _kind(block: Any) -> str:
    """Return the kind of cells without their order: ``triangle`` of ``triangle6``."""
    return str(block.type).rstrip("0123456789")


def _cells(blocks: Iterable[Any], dimension: int) -> tuple[str, Indices]:
    """Return the kind of the cells of that dimension, and their corners, (corners, cells), each cell once."""
    largest = max((block.dim for block in blocks), default=0)
    if largest != dimension:
        theory = "plate" if dimension == 2 else "solid"
        raise ParameterError(
            f"The mesh has {_WHAT[largest]}, and theory {theory} takes {_WHAT[dimension]}; change one of them."
        )
    own = [block for block in blocks if block.dim == dimension]
    kinds = sorted({_kind(block) for block in own})
    if len(kinds) > 1 or kinds[0] not in _CORNERS:
        raise ParameterError(
            f"The mesh has cells of the kind {' and '.join(kinds)}; it must have one kind, "
            f"{'triangle or quad' if dimension == 2 else 'tetra or hexahedron'}."
        )
    corners = np.vstack([block.data[:, : _CORNERS[kinds[0]]] for block in own])
    # version 2.2 has a cell once for each of its groups
    corners = corners[np.sort(np.unique(np.sort(corners, axis=1), axis=0, return_index=True)[1])]
    if len(corners) > MOST_CELLS:
        raise ParameterError(f"The mesh has {len(corners)} elements; the limit is {MOST_CELLS}, so make it coarser.")
    if kinds == ["hexahedron"]:
        from skfem.io.meshio import INV_HEX_MAPPING

        corners = corners[:, INV_HEX_MAPPING[:8]]
    return kinds[0], np.ascontiguousarray(corners.T)


def _check_points(points: Array, dimension: int) -> None:
    if not np.isfinite(points).all():
        raise ParameterError("The mesh has points whose coordinates are no numbers. Save it anew.")
    size = np.ptp(points, axis=0)
    if size.max() > 2.0 * LARGEST:
        raise ParameterError(
            f"The mesh is {size.max():g} m long; the limit is {2.0 * LARGEST:g} m. Specify solid.mesh_unit_m, the "
            "unit of its file: 0.001 for mm."
        )
    if dimension == 2 and size[2:].any() and size[2] > _NEAR * size.max():
        raise ParameterError(f"The mesh of a plate lies in a plane of constant z; this one has {size[2]:g} m along z.")


def _groups(file: Any) -> dict[str, dict[int, Indices]]:
    """Return the corners of the parts of each physical group, (n, corners), by name and dimension."""
    found: dict[str, dict[int, list[Indices]]] = {}
    tags = file.cell_data.get("gmsh:physical")
    for name, (tag, dimension) in file.field_data.items():
        for number, block in enumerate(file.cells):
            if block.dim != dimension or _kind(block) not in _CORNERS:
                continue
            # a part may have several groups: version 4.1 has them as sets
            rows = file.cell_sets[name][number] if name in file.cell_sets else np.flatnonzero(tags[number] == tag)
            if len(rows):
                corners = block.data[np.asarray(rows), : _CORNERS[_kind(block)]]
                found.setdefault(name, {}).setdefault(int(dimension), []).append(corners)
    return {name: {dimension: np.vstack(parts) for dimension, parts in group.items()} for name, group in found.items()}


def _among(table: Indices, corners: Indices) -> Mask:
    """Return which columns of a table, (corners, n), have the vertices of some row of (m, corners)."""
    if table.shape[0] != corners.shape[1]:
        return np.zeros(table.shape[1], dtype=bool)
    both = np.sort(np.hstack([table, corners.T]), axis=0)
    numbers = np.unique(both, axis=1, return_inverse=True)[1].ravel()
    return np.asarray(np.isin(numbers[: table.shape[1]], numbers[table.shape[1] :]))
