# SPDX-License-Identifier: GPL-3.0-or-later
"""Quadratic finite elements of piezoelectric solids and thin plates: stiffness, mass, and motion of faces.

Unknowns are the displacements of the nodes and, in a solid, their potentials in GV, which makes the entries of the
matrix alike. With the matrix of :mod:`.materials`, strain S and gradient ∇φ, the stiffness

    ( K   Cᵀ )
    ( C  −Q  )

is symmetric: positive in the displacements, negative in the potentials. Nodes under an electrode share its potential.

A thin plate has no stress along z and the field of two electrodes opposite each other. Both are eliminated from the
matrix, which gives the constants c* = c − c₃ᵀ c₃/c₃₃, e₃* = e₃ − e₃₃ c₃/c₃₃ and ε₃₃* = ε₃₃ + e₃₃²/c₃₃.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

VOLTS = 1e9  # the unit of the potentials
# row of the strain or the gradient, field that it comes from (3 is the potential), direction of its derivative
_ROWS = {
    3: [(0, 0, 0), (1, 1, 1), (2, 2, 2), (3, 1, 2), (3, 2, 1), (4, 0, 2), (4, 2, 0), (5, 0, 1), (5, 1, 0),
        (6, 3, 0), (7, 3, 1), (8, 3, 2)],
    2: [(0, 0, 0), (1, 1, 1), (2, 0, 1), (2, 1, 0)],
}  # fmt: skip
_KEPT = np.array([0, 1, 5, 8])  # of a plate: strains 11, 22 and 12, and the field along z
_FREE = np.array([2, 3, 4])  # no stress along z


@dataclass(frozen=True)
class Part:
    """Cells of one material and polarisation."""

    cells: Indices
    matrix: Array  # of strain and gradient of the potential: (9, 9), or that of a plate, (4, 4)
    density_kg_m3: float
    thickness_m: float = 1.0  # of a plate
    electrodes: tuple[int, int] = (0, 0)  # of a plate: unknowns of the potentials above and below
    ceramic: bool = False


def plate_matrix(matrix: Array, *, shorted: bool) -> Array:
    """Return the matrix of a thin plate, (4, 4); a plate without electrodes has no charge on its faces."""
    free = matrix[np.ix_(_FREE, _KEPT)]
    kept = matrix[np.ix_(_KEPT, _KEPT)] - free.T @ np.linalg.solve(matrix[np.ix_(_FREE, _FREE)], free)
    if not shorted:
        if kept[3, 3]:
            kept[:3, :3] -= np.outer(kept[:3, 3], kept[3, :3]) / kept[3, 3]
        kept[3, :] = kept[:, 3] = 0.0
    return np.asarray(kept)


def _operator(basis: Any, part: Part) -> tuple[Array, Array, Indices]:
    """Return the rows of strain and gradient at the quadrature points, their weights, and the unknowns of the cells."""
    gradient = np.stack([np.moveaxis(field[0].grad, 0, -1) for field in basis.basis], axis=2)  # cell, point, node, axis
    cells, points, nodes, dimension = gradient.shape
    plate = dimension == 2
    fields = 2 if plate else 4
    rows = np.zeros((cells, points, len(part.matrix), fields * nodes + 2 * plate))
    for row, field, axis in _ROWS[dimension]:
        rows[:, :, row, field : fields * nodes : fields] = gradient[..., axis] * (VOLTS if field == 3 else 1.0)
    unknowns = (fields * basis.element_dofs.T[:, :, None] + np.arange(fields)).reshape(cells, -1)
    if plate:
        rows[:, :, 3, -2:] = np.array([1.0, -1.0]) * (VOLTS / part.thickness_m)
        unknowns = np.hstack([unknowns, np.tile(part.electrodes, (cells, 1))])
    return rows, basis.dx * part.thickness_m, unknowns


def assemble(
    basis: Any, parts: Sequence[Part], place: Indices, size: int, springs: Sequence[tuple[Indices, Array]] = ()
) -> tuple[Any, Any]:
    """Return stiffness and mass as sparse matrices.

    ``place`` has the row of each unknown, −1 where it is held at 0; ``springs`` are unknowns of faces, (facets, n), and
    their matrices, (facets, n, n).
    """
    stiffness, mass = list(springs), []
    for part in parts:
        own = basis.with_elements(part.cells)
        rows, weights, unknowns = _operator(own, part)
        count = rows.shape[-1]
        weighted = (part.matrix @ rows) * weights[:, :, None, None]
        flat = rows.reshape(len(rows), -1, count)
        stiffness.append((unknowns, np.matmul(flat.transpose(0, 2, 1), weighted.reshape(flat.shape))))
        values = np.stack([np.asarray(field[0]) for field in own.basis])
        local = np.einsum("aeq,beq,eq->eab", values, values, part.density_kg_m3 * weights, optimize=True)
        directions = basis.mesh.dim()
        fields = directions if directions == 2 else 4
        mass += [(fields * own.element_dofs.T + axis, local) for axis in range(directions)]
    return _summed(stiffness, place, size), _summed(mass, place, size)


def assemble_field(basis: Any, parts: Sequence[Part], place: Indices, size: int) -> Any:
    """Return the matrix of charges per potential of a solid that does not move, in F, sparse.

    ``place`` has the row of the potential of each node, −1 where it is held at 0 or there is none.
    """
    entries = []
    for part in parts:
        own = basis.with_elements(part.cells)
        gradient = np.stack([field[0].grad for field in own.basis])  # node, axis, cell, point
        charged = np.einsum("ij,bjcq,cq->bicq", -part.matrix[6:, 6:], gradient, own.dx)
        entries.append((own.element_dofs.T, np.einsum("aicq,bicq->cab", gradient, charged, optimize=True)))
    return _summed(entries, place, size)


def _summed(entries: Sequence[tuple[Indices, Array]], place: Indices, size: int) -> Any:
    """Return the sum of matrices of elements, (cells, n, n), of the unknowns (cells, n), compressed by columns."""
    from scipy.sparse import coo_matrix

    parts = []
    for unknowns, local in entries:
        where = place[unknowns]
        rows, columns = (np.broadcast_to(side, local.shape) for side in (where[:, :, None], where[:, None, :]))
        kept = (rows >= 0) & (columns >= 0)
        parts.append((local[kept], rows[kept], columns[kept]))
    values, rows, columns = (np.concatenate(items) for items in zip(*parts, strict=True))
    return coo_matrix((values, (rows, columns)), shape=(size, size)).tocsc()


def factor(matrix: Any) -> Callable[[Array], Array]:
    """Return the solver of a sparse symmetric matrix, positive in displacements and negative in potentials.

    Such a matrix has factors in any order (R. J. Vanderbei, SIAM J. Optim. 5 (1995) 100), so that no pivot is sought.
    """
    from scipy.sparse.linalg import splu

    factor = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    solve: Callable[[Array], Array] = factor.solve
    return solve


def strains(basis: Any, part: Part, values: Array) -> Array:
    """Return strain and gradient in a part, (cells, points, rows, columns), of values of all unknowns (n, columns)."""
    rows, _, unknowns = _operator(basis.with_elements(part.cells), part)
    return np.asarray(np.einsum("eqrm,emc->eqrc", rows, values[unknowns], optimize=True))
