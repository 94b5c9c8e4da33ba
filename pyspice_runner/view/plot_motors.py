# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of motors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import motor as model
from pyspice_runner.motor.beam import solve_resonator
from pyspice_runner.motor.solid.elements import Indices
from pyspice_runner.motor.solid.geometry import regions_of
from pyspice_runner.motor.solid.parameters import Solid
from pyspice_runner.motor.solid.stator import stator_of
from pyspice_runner.run.waveforms import Array
from pyspice_runner.view.draw import DASHES, Panel, Sheet, dress
from pyspice_runner.view.outlines import COLOURS, axes_of
from pyspice_runner.view.style import BLUE, CYCLE, GREY, LABELS

_SWING = 0.08  # of the largest dimension of a solid: how far a mode is drawn to move


def motor(motor: model.Motor) -> Sheet:
    """Return the shapes of the modes, with the patches and the tip of a beam, or the geometry of a solid."""
    structure = motor.structure
    if motor.solid is not None:
        return _solid(motor, motor.solid)
    if structure is None:
        given = "[ring]" if motor.ring else "[[modes]] or [[arms]]"
        raise ParameterError(f"{motor.name} follows from {given}. Shapes are drawn of a beam or a [solid] only.")

    def draw_modes(ax: Axes) -> None:
        resonator = solve_resonator(structure.beam, structure.patches, structure.tip, count=len(motor.modes))
        x = np.linspace(0.0, structure.beam.length_m, 401)
        for index, (mode, shape) in enumerate(zip(motor.modes, resonator.deflection(x).T, strict=True)):
            label = f"{mode.name}, {mode.frequency_hz / 1e3:.4g} kHz"
            ax.plot(1e3 * x, shape, DASHES[index % 4], color=CYCLE[index % 4], label=label)
        for patch in structure.patches:
            ax.axvspan(1e3 * patch.start_m, 1e3 * patch.end_m, color=GREY, alpha=0.15)
            ax.text(0.5e3 * (patch.start_m + patch.end_m), -1.15, f"group {patch.group}", ha="center", color="0.3")
        ax.axvline(1e3 * structure.tip.position_m, color="0.3", linewidth=1, linestyle=":")
        title = f"{motor.name}: bending modes (dotted: tip)"
        dress(ax, "position along the beam in mm", "deflection (largest = 1)", title)
        ax.set_ylim(-1.3, 1.3)

    return Sheet({"modes": draw_modes}, 1, (7.0, 4.0))


def _solid(motor: model.Motor, solid: Solid) -> Sheet:
    """Return boxes and electrodes, and the displacement of each mode, seen along the axis of the rotor."""
    stator, contact = stator_of(solid), solid.contact
    plane = axes_of(solid)
    nodes = 1e3 * stator.nodes_m
    swing = _SWING * np.ptp(nodes, axis=1).max()
    cells = _towards_viewer(nodes, stator.cells, plane)

    def draw_geometry(ax: Axes) -> None:
        x, y = _draw_regions(ax, solid, plane)
        for sense, name in ((contact.normal, "normal"), (contact.tangent, "tangent")):
            dx, dy = np.eye(3)["xyz".index(sense[1])][plane] * (swing if sense[0] == "+" else -swing)
            ax.annotate("", (x + dx, y + dy), (x, y), arrowprops={"arrowstyle": "->"})
            ax.text(x + dx, y + dy, name, fontsize=7)
        _frame(ax, plane, f"{motor.name}: materials and electrodes")

    def mode_panel(index: int) -> Panel:
        mode, shape = motor.modes[index], stator.shapes[..., index]
        moved = (nodes + swing * shape)[plane]

        def draw_mode(ax: Axes) -> None:
            size = np.sqrt((shape**2).sum(axis=0))[cells].mean(axis=0)
            faces = list(moved[:, cells].transpose(2, 1, 0))
            ax.add_collection(PolyCollection(faces, array=size, clim=(0.0, 1.0), lw=0.2))
            ax.autoscale_view()
            title = f"{mode.name}, {mode.frequency_hz / 1e3:.4g} kHz"
            _frame(ax, plane, f"{title}: displacement, drawn up to {swing:.2g} mm")

        return draw_mode

    panels = {"geometry": draw_geometry} | {mode.name: mode_panel(i) for i, mode in enumerate(motor.modes)}
    return Sheet(panels, 2, (5.5, 2.8))


def _draw_regions(ax: Axes, solid: Solid, plane: list[int]) -> Array:
    """Draw the cells of the boxes and the faces of the electrodes, and return the middle of the contact in mm."""
    points, boxes, electrodes, contact = regions_of(solid)
    points = 1e3 * points
    for box, cells in zip(solid.boxes, boxes, strict=True):
        faces = points[plane][:, _towards_viewer(points, cells, plane)]
        ax.add_collection(PolyCollection(list(faces.transpose(2, 1, 0)), facecolor="0.9", edgecolor="0.6", lw=0.2))
        x, y = faces.min(axis=(1, 2))
        ax.annotate(box.material, (x, y), (2, -2), textcoords="offset points", fontsize=7, color="0.3", va="top")
    for electrode, cells in zip(solid.electrodes, electrodes, strict=True):
        if electrode.group != "ground":
            faces, color = points[plane][:, _around(points[plane], cells)], COLOURS[electrode.group]
            ax.add_collection(PolyCollection(list(faces.transpose(2, 1, 0)), facecolor=color, alpha=0.35))
            x, y = faces.mean(axis=(1, 2))
            ax.text(x, y, electrode.group, ha="center", va="center")
    return np.asarray(1e3 * contact[plane])


def _towards_viewer(nodes: Array, cells: Indices, plane: list[int]) -> Indices:
    """Return of each cell the corners towards the viewer, in order around it, the nearest cells last."""
    if len(nodes) == 3:
        depth = nodes[3 - sum(plane)]
        order = np.argsort(depth[cells], axis=0)[-4 if len(cells) == 8 else -3 :]
        cells = np.take_along_axis(cells, order, axis=0)
        cells = cells[:, np.argsort(depth[cells].mean(axis=0))]
    return _around(nodes[plane], cells)


def _around(points: Array, cells: Indices) -> Indices:
    """Return the corners of each face in order around its middle."""
    centres = points[:, cells].mean(axis=1, keepdims=True)
    turn = np.argsort(np.arctan2(*(points[:, cells] - centres)), axis=0)
    return np.take_along_axis(cells, turn, axis=0)


def _frame(ax: Axes, plane: list[int], title: str) -> None:
    dress(ax, f"{'xyz'[plane[0]]} in mm", f"{'xyz'[plane[1]]} in mm", title)
    ax.set_aspect("equal")
    ax.margins(0.12)
    ax.autoscale_view()


def motors(motors: Sequence[model.Motor]) -> Sheet:
    """Return the mode frequencies of several motors, one below the other."""

    def draw_frequencies(ax: Axes) -> None:
        for row, motor in enumerate(motors):
            ax.plot([mode.frequency_hz / 1e3 for mode in motor.modes], [row] * len(motor.modes), "o", color=BLUE)
        ax.set_yticks(range(len(motors)), [motor.name for motor in motors])
        dress(ax, LABELS["frequency_hz"], "", "Modes of the parameter sets")
        ax.set_ylim(-0.7, len(motors) - 0.3)

    return Sheet({"frequencies": draw_frequencies}, 1, (7.0, 1.6 + 0.5 * len(motors)))
