# SPDX-License-Identifier: GPL-3.0-or-later
"""Resonance frequencies and coupling over the position of the patches (after the companion paper).

Group A is centred at the position, group B at its mirror image; the tip stays as it is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREEN, ORANGE, VERMILLION, canvas, main, write

import pyspice_runner as pr

LENGTHS = {3e-3: BLUE, 4.5e-3: ORANGE, 6e-3: VERMILLION, 7.5e-3: GREEN}
POSITIONS = 31
EDGE = 0.2e-3  # what is left to the supports and to the middle


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    structure = motor.structure
    assert structure is not None
    half = structure.beam.length_m / 2
    figure, axes = canvas(2, 2, 6.2, sharex=True)
    best = {}
    for length, colour in LENGTHS.items():
        centres = np.linspace(length / 2 + EDGE, half - length / 2 - EDGE, POSITIONS)
        modes = [_modes(structure, centre, length) for centre in centres]
        for number, (frequency, coupling) in enumerate(axes.T):
            theta = np.array([abs(pair[number].coupling_a_n_per_v) for pair in modes])
            label = f"{1e3 * length:g} mm long"
            frequency.plot(
                1e3 * centres, [pair[number].frequency_hz / 1e3 for pair in modes], color=colour, label=label
            )
            coupling.plot(1e3 * centres, 1e3 * theta, color=colour, label=label)
            best[length, number] = centres[np.argmax(theta)]
    stands = structure.patches[0]
    centre, length = (stands.start_m + stands.end_m) / 2, stands.end_m - stands.start_m
    for number, (frequency, coupling) in enumerate(axes.T):
        mode = motor.modes[number]
        label = f"as the motor has them, {1e3 * length:g} mm"
        frequency.plot(1e3 * centre, mode.frequency_hz / 1e3, "D", ms=5, color=BLACK, label=label)
        coupling.plot(1e3 * centre, 1e3 * abs(mode.coupling_a_n_per_v), "D", ms=5, color=BLACK, label=label)
        frequency.set(title=f"mode {number + 1}: frequency", ylabel="frequency / kHz")
        coupling.set(
            title=f"mode {number + 1}: coupling of one group",
            ylabel=r"$|\theta_\mathrm{A}|$ / (mN/V)",
            ylim=(0.0, None),
        )
        coupling.set(xlabel="centre of group A from the support / mm", xlim=(0.0, 1e3 * half))
    beam = structure.beam
    write(
        figure,
        folder / "patch_position.png",
        "Where the patches sit sets the resonances and how well they drive them",
        f"Motor {motor.name}: beam {1e3 * beam.length_m:g} × {1e3 * beam.width_m:g} × {1e3 * beam.thickness_m:g} mm, simply "
        f"supported; plates {1e3 * stands.width_m:g} mm wide and {1e3 * stands.thickness_m:g} mm thick on both faces, group "
        f"A at the position and group B at its mirror image; tip of {1e6 * structure.tip.mass_kg:.0f} mg in the middle, as "
        "trimmed for the motor. Rayleigh–Ritz of the Bernoulli–Euler beam, electrodes shorted, tip free.",
        axes[0, 0].get_legend_handles_labels()[0],
    )
    return [
        f"patches {1e3 * length:g} mm long drive mode {number + 1} best {1e3 * centre:.1f} mm from the support"
        for (length, number), centre in best.items()
        if length == min(LENGTHS)
    ]


def _modes(structure: object, centre: float, length: float) -> tuple:
    """Return the modes with both groups' patches this long, A centred here and B at the mirror image."""
    width = structure.beam.length_m
    places = {"A": centre, "B": width - centre}
    patches = [
        patch.model_copy(
            update={"start_m": places[patch.group] - length / 2, "end_m": places[patch.group] + length / 2}
        )
        for patch in structure.patches
    ]
    return pr.resonator_modes(structure.beam, patches, structure.tip, structure.damping)


if __name__ == "__main__":
    main(draw, __doc__)
