# SPDX-License-Identifier: GPL-3.0-or-later
"""The outlines of a stator and its electrodes, and how its modes move them, for the pages that draw it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from pyspice_runner.motor.beam import solve_resonator
from pyspice_runner.motor.motor import Structure
from pyspice_runner.motor.solid.parameters import Box, Electrode, Solid
from pyspice_runner.motor.solid.stator import stator_of
from pyspice_runner.run.waveforms import Array
from pyspice_runner.view.style import BLUE, GREEN, GREY, VERMILION

COLOURS = {"A": BLUE, "B": VERMILION, "feedback": GREEN}  # of the groups
POINTS = 20  # on each side of a box
_INSIDE = 1.0 - 1e-6


@dataclass(frozen=True)
class Outline:
    """The outlines of all parts of a kind, in the plane of the contact."""

    name: str  # what it is
    colour: str  # as #RRGGBB
    line_m: Array  # positions along the two axes of the plane, (2, points); NaN between parts
    shapes: (
        Array  # displacement per modal coordinate, (2, points, modes), of a solid that of the face towards the viewer
    )


def beam_outlines(structure: Structure, count: int) -> list[Outline]:
    """Return the middle of a beam, its patches and its tip.

    The first ``count`` modes move them by the deflection and, away from the middle, by its slope.
    """
    beam, tip = structure.beam, structure.tip
    kinds = {("beam", GREY): [np.array([np.linspace(0.0, beam.length_m, 81), np.zeros(81)])]}
    for group, colour in COLOURS.items():
        sides = []
        for patch in (patch for patch in structure.patches if patch.group == group):
            height = 0.5 * (beam.thickness_m + patch.thickness_m)
            for side in {"top": (1.0,), "bottom": (-1.0,)}.get(patch.faces, (1.0, -1.0)):
                line = np.linspace(patch.start_m, patch.end_m, 21)
                sides += [np.array([line, np.full(21, side * height)]), np.full((2, 1), np.nan)]
        if sides:
            kinds[f"patches of group {group}", colour] = sides
    kinds["tip", GREEN] = [np.array([np.full(2, tip.position_m), [0.0, tip.length_m]])]
    resonator = solve_resonator(beam, structure.patches, tip, count=count)
    found = []
    for (name, colour), sides in kinds.items():
        along, height = line = np.concatenate(sides, axis=1)
        shapes = np.array([-height[:, None] * resonator.slope(along), resonator.deflection(along)])
        found.append(Outline(name, colour, line, shapes))
    return found


def axes_of(solid: Solid) -> list[int]:
    """Return the two axes of the plane of the contact, 0 for x, in rising order."""
    return sorted("xyz".index(sense[1]) for sense in (solid.contact.normal, solid.contact.tangent))


def outlines(solid: Solid) -> list[Outline]:
    """Return the outlines of the boxes of a solid and of the electrodes of its groups."""
    stator, plane = stator_of(solid), axes_of(solid)
    depths = stator.nodes_m[3 - sum(plane)] if len(stator.nodes_m) == 3 else np.zeros(stator.nodes_m.shape[1])
    face = depths >= depths.max() - 1e-9
    nodes = stator.nodes_m[plane][:, face].T
    middle = 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))
    kinds = {("solid", GREY): [_outline(box, plane) for box in solid.boxes]}
    for group, colour in COLOURS.items():
        sides = [_outline(electrode, plane) for electrode in solid.electrodes if electrode.group == group]
        if sides:
            kinds[f"electrodes of group {group}", colour] = sides
    shape = LinearNDInterpolator(Delaunay(nodes), np.moveaxis(stator.shapes[plane][:, face], 1, 0))
    found = []
    for (name, colour), sides in kinds.items():
        line = np.concatenate(sides, axis=1)
        inside = middle + _INSIDE * (line.T - middle)  # rounding may put a corner beyond the hull
        found.append(Outline(name, colour, line, np.moveaxis(shape(inside), 0, 1)))
    return found


def _outline(item: Box | Electrode, plane: list[int]) -> Array:
    """Return points around a box in m, (2, n), that end with a gap."""
    low, high = (np.array(corner)[plane] for corner in (item.from_m, item.to_m))
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1]), low])
    points = np.concatenate([np.linspace(*side, POINTS, endpoint=False) for side in pairwise(corners)])
    return np.vstack([points, low, np.full(2, np.nan)]).T
