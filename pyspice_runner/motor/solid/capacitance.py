# SPDX-License-Identifier: GPL-3.0-or-later
"""Clamped capacitances of a solid of boxes, from the electric field alone on a mesh that is graded for it.

At the edge of an electrode the field has the singularity r^(-1/2), so that the error of a capacitance is proportional
to the length h of the cells there. It is removed by extrapolation from two meshes: (3 C(h) - C(3 h))/2. What is left of
it is about a tenth of a per cent; half of the difference that the extrapolation makes is an upper bound.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.solid.elements import Array, assemble_field, factor
from pyspice_runner.motor.solid.geometry import build_geometry
from pyspice_runner.motor.solid.parameters import Solid
from pyspice_runner.motor.solid.places import GRADING, electrode_edges

_PER_GAP = 6.0  # cells of the finer mesh at an edge in the narrowest gap or electrode


def clamped_capacitance(solid: Solid, coarse_f: Array) -> Array:
    """Return the charges on groups A and B in C per volt on them, all displacements held at 0; shape (2, 2).

    ``coarse_f`` is that of the mesh of the displacements. It is returned for a plate, whose field has no edges, for a
    mesh file, which is refined by its author, and if the graded mesh would have too many cells.
    """
    if solid.theory == "plate" or solid.mesh is not None:
        return coarse_f
    widths = [high - low for axis in range(3) for low, high in pairwise(electrode_edges(solid, axis))]
    finest = min((width for width in widths if width > 0.0), default=0.0) / _PER_GAP
    if not finest:
        return coarse_f
    try:
        coarse, fine = _capacitance(solid, GRADING * finest), _capacitance(solid, finest)
    except ParameterError:
        return coarse_f
    return np.asarray(fine + (fine - coarse) / (GRADING - 1.0))


def _capacitance(solid: Solid, finest_m: float) -> Array:
    """Return the capacitances on one mesh. Raise ParameterError if it has too many cells."""
    geometry = build_geometry(solid, finest_m)
    nodes, size = geometry.basis.N, geometry.size - geometry.displacements
    rows = geometry.place[: geometry.fields * nodes].reshape(nodes, -1)[:, -1] - geometry.displacements
    field = assemble_field(geometry.basis, geometry.parts, np.maximum(rows, -1), size)
    between = slice(0, size - 2)
    electric = field[between, -2:].toarray()
    return np.asarray(field[-2:, -2:].toarray() - electric.T @ factor(field[between, between])(electric))
