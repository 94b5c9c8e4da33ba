# SPDX-License-Identifier: GPL-3.0-or-later
"""The stator of bimodal40: electrodes and the modes of the motor, in oblique view."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray
from style import canvas, main, write

import pyspice_runner as pr
from pyspice_runner.motor.load import SETS, stated_solid
from pyspice_runner.motor.solid.stator import stator_of

NAMES = ("first bending", "torsion", "longitudinal", "second bending")
SWING_MM = 3.0  # largest displacement in the drawing
DEPTH = np.array([0.45, 0.3])  # how far right and up a unit of depth is drawn


def outer_faces(nodes: NDArray[np.float64], cells: NDArray[np.int_]) -> NDArray[np.int_]:
    """Return the corners of the faces that belong to one cell only, in order around each, (4, faces)."""
    found: dict[tuple[int, ...], list[NDArray[np.int_]]] = {}
    for cell in cells.T:
        for axis in range(3):
            order = cell[np.argsort(nodes[axis][cell], kind="stable")]
            for face in (order[:4], order[4:]):
                found.setdefault(tuple(sorted(face)), []).append(face)
    faces = np.array([same[0] for same in found.values() if len(same) == 1])
    around = []
    for face in faces:
        points = nodes[:, face] - nodes[:, face].mean(axis=1, keepdims=True)
        plane = np.argsort(np.ptp(points, axis=1))[1:]
        around.append(face[np.argsort(np.arctan2(*points[plane]))])
    return np.array(around).T


def seen(nodes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coordinates in the picture."""
    return np.asarray(nodes[:2] - DEPTH[:, None] * nodes[2])


def draw_faces(
    axes: Axes, nodes: NDArray[np.float64], faces: NDArray[np.int_], size: NDArray[np.float64]
) -> PolyCollection:
    """Draw the faces from the farthest to the nearest, in colours by a size of each node."""
    depth = nodes[2][faces].mean(axis=0)
    order = np.lexsort((nodes[1][faces].mean(axis=0), nodes[0][faces].mean(axis=0), depth))
    corners = seen(nodes)[:, faces[:, order]].transpose(2, 1, 0)
    drawn = PolyCollection(list(corners), array=size[faces[:, order]].mean(axis=0), clim=(0.0, 1.0), lw=0.3)
    axes.add_collection(drawn)
    axes.set(aspect="equal", xlabel="x / mm", ylabel="y / mm", xlim=(-6.0, 49.0), ylim=(-5.0, 16.0))
    return drawn


def draw(folder: Path) -> list[str]:
    motor, solid = pr.load_motor("bimodal40"), stated_solid(SETS / "bimodal40.toml")
    assert solid is not None
    stator = stator_of(solid)
    nodes = 1e3 * stator.nodes_m
    faces = outer_faces(nodes, stator.cells)
    figure, axes = canvas(2, 2, 4.2)
    lines = []
    for index, (panel, name) in enumerate(zip(axes.flat, NAMES, strict=True)):
        mode, shape = motor.modes[index], stator.shapes[..., index]
        size = np.sqrt((shape**2).sum(axis=0))
        drawn = draw_faces(panel, nodes + SWING_MM / size.max() * shape, faces, size / size.max())
        panel.set_title(f"({'abcd'[index]}) {name}, {mode.frequency_hz / 1e3:.2f} kHz")
        share = (shape**2).sum(axis=1) / (shape**2).sum()
        lines.append(f"{mode.name}, {name}: {mode.frequency_hz / 1e3:.2f} kHz, x, y, z {np.round(share, 2)}")
    figure.colorbar(drawn, ax=axes, label="displacement / maximum", shrink=0.6)
    caption = (
        "Modes of the stator of motor bimodal40 by finite elements, in oblique view; displacements are exaggerated. "
        "The longitudinal mode moves the tip, at the right, towards the rotor; the second bending mode moves it along "
        "the rotor."
    )
    write(figure, folder / "bimodal40_modes.png", "The modes of bimodal40", caption)
    return lines


if __name__ == "__main__":
    main(draw, __doc__)
