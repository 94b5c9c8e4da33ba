# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of motors, and of an impact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from pyspice_runner.analysis.impact import Impact
from pyspice_runner.errors import ParameterError
from pyspice_runner.model import motor as model
from pyspice_runner.model.beam import solve_resonator
from pyspice_runner.view.draw import DASHES, Panel, Sheet, draw_lines, dress
from pyspice_runner.view.style import BLUE, CYCLE, GREY, LABELS, VERMILION, Label


def motor(motor: model.Motor) -> Sheet:
    """Return the shapes of the modes, with the patches and the tip."""
    structure = motor.structure
    if structure is None:
        raise ParameterError(f"Motor {motor.name} is given by its modes, not by a beam; there are no shapes to draw.")

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
        ax.legend()

    return Sheet({"modes": draw_modes}, 1, (7.0, 4.0))


def motors(motors: Sequence[model.Motor]) -> Sheet:
    """Return the mode frequencies of several motors, one below the other."""

    def draw_frequencies(ax: Axes) -> None:
        for row, motor in enumerate(motors):
            ax.plot([mode.frequency_hz / 1e3 for mode in motor.modes], [row] * len(motor.modes), "o", color=BLUE)
        ax.set_yticks(range(len(motors)), [motor.name for motor in motors])
        dress(ax, LABELS["frequency_hz"], "", "Modes of the parameter sets")
        ax.set_ylim(-0.7, len(motors) - 0.3)

    return Sheet({"frequencies": draw_frequencies}, 1, (7.0, 1.6 + 0.5 * len(motors)))


def impact(result: Impact) -> Sheet:
    """Return the forces of an impact, the velocity of the contact patch, and the part of it that slips."""
    time = LABELS["time_us"], result.time_s

    forces = [
        (result.normal_force_n, {"color": BLUE, "label": "normal"}),
        (result.friction_force_n, {"color": VERMILION, "linestyle": "--", "label": "friction, on the sphere"}),
    ]
    velocity, velocities = Label("velocity", "m/s"), [(result.patch_velocity_m_s, {"color": BLUE})]

    def draw_slip(ax: Axes) -> None:
        slip = np.clip(result.contact_state - 1.0, 0.0, 1.0)
        ax.plot(time[0].scale * time[1], slip, color=VERMILION)
        dress(ax, time[0], "part of the contact", "Slip")
        ax.set_ylim(-0.05, 1.05)

    law, poisson = result.provenance["contact"], result.provenance["throw"]["poisson"]
    title = f"{law}, ν = {poisson:g}: ψ = {result.psi_1:.4g} rebounds as {result.psi_2:.4g}"
    panels: dict[str, Panel] = {
        "forces": lambda ax: draw_lines(ax, time, LABELS["force_n"], forces, "Forces"),
        "velocity": lambda ax: draw_lines(ax, time, velocity, velocities, "Tangential velocity of the contact patch"),
        "slip": draw_slip,
    }
    return Sheet(panels, 1, (8.0, 2.7), title)
