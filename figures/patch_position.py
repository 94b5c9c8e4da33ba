# SPDX-License-Identifier: GPL-3.0-or-later
"""Resonance frequencies and coupling over the position of the patches (after the companion paper).

Group A is centred at the position, group B at its mirror image; beam and tip are unchanged.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from style import BLACK, BLUE, GREEN, ORANGE, VERMILION, canvas, draft, main, write

import pyspice_runner as pr
from pyspice_runner.motor.beam import resonator_modes

LENGTHS = {3e-3: BLUE, 4.5e-3: ORANGE, 6e-3: VERMILION, 7.5e-3: GREEN}
POSITIONS = 7 if draft() else 31
GAP = 0.2e-3  # distance to the support and to the middle, m


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    structure = motor.structure
    assert structure is not None
    beam, tip, (patch, _) = structure.beam, structure.tip, structure.patches
    figure, axes = canvas(2, 2, 6.2, sharex=True)
    best = {}
    for length, colour in LENGTHS.items():
        centres = np.linspace(length / 2 + GAP, (beam.length_m - length) / 2 - GAP, POSITIONS)
        modes = [_modes(structure, centre, length) for centre in centres]
        _draw_modes(axes, centres, modes, color=colour, label=f"{1e3 * length:g} mm long")
        best[length] = [1e3 * centres[np.argmax([abs(pair[n].coupling_a_n_per_v) for pair in modes])] for n in (0, 1)]
    centre, length = (patch.start_m + patch.end_m) / 2, patch.end_m - patch.start_m
    own = {"ls": "", "marker": "D", "ms": 5, "color": BLACK, "label": f"as the motor has them, {1e3 * length:g} mm"}
    _draw_modes(axes, np.array([centre]), [motor.modes], **own)
    for number, (frequency, coupling) in enumerate(axes.T, start=1):
        frequency.set(title=f"mode {number}: frequency", ylabel="frequency / kHz")
        coupling.set(title=f"mode {number}: coupling of group A", ylabel=r"$|\theta_\mathrm{A}|$ / (mN/V)")
        coupling.set(xlabel="centre of group A from the support / mm", xlim=(0.0, 500.0 * beam.length_m))
        coupling.set_ylim(bottom=0.0)
    title = "Where the patches sit sets the resonances and how well they are driven"
    caption = (
        f"Motor {motor.name}: beam {1e3 * beam.length_m:g} × {1e3 * beam.width_m:g} × {1e3 * beam.thickness_m:g} mm, "
        f"simply supported; plates {1e3 * patch.width_m:g} mm wide and {1e3 * patch.thickness_m:g} mm thick on both "
        f"faces, group B at the mirror image of A, both {1e3 * GAP:g} mm or more from support and middle; tip of "
        f"{1e6 * tip.mass_kg:.0f} mg in the middle, trimmed for the motor's own patches. Rayleigh–Ritz of the "
        "Bernoulli–Euler beam, electrodes shorted, tip free."
    )
    write(figure, folder / "patch_position.png", title, caption, axes[0, 0].get_legend_handles_labels()[0])
    length, (first, second) = next(iter(best.items()))
    where = f"mode 1 best {first:.1f} mm from the support (as near to the middle as they go), mode 2 at {second:.1f} mm"
    return [f"patches {1e3 * length:g} mm long drive {where}"]


def _modes(structure: Any, centre: float, length: float) -> tuple[Any, ...]:
    """Return the modes for a length of the patches and a position of group A; B is at the mirror image."""
    middles = {"A": centre, "B": structure.beam.length_m - centre}
    patches = [
        patch.model_copy(
            update={"start_m": middles[patch.group] - length / 2, "end_m": middles[patch.group] + length / 2}
        )
        for patch in structure.patches
    ]
    return resonator_modes(structure.beam, patches, structure.tip, structure.damping)


def _draw_modes(axes: np.ndarray, centres: np.ndarray, modes: list[tuple[Any, ...]], **style: Any) -> None:
    for number, (frequency, coupling) in enumerate(axes.T):
        frequency.plot(1e3 * centres, [pair[number].frequency_hz / 1e3 for pair in modes], **style)
        coupling.plot(1e3 * centres, [1e3 * abs(pair[number].coupling_a_n_per_v) for pair in modes], **style)


if __name__ == "__main__":
    main(draw, __doc__)
