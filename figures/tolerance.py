# SPDX-License-Identifier: GPL-3.0-or-later
"""Effect of tolerances: speed–torque curves with their 5–95 % band, and the sensitivity to each parameter.

Friction, preload, the frequency of the fourth mode and the coupling of group A vary together within
their tolerances (a Sobol sequence); the shaft is held at each speed. The points are steady states. The drive is that
of the spin-up and does not follow the resonance.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREY, VERMILION, canvas, draft, drive_words, main, motor_words, write

import pyspice_runner as pr
from pyspice_runner.steady.speed_torque import held_point

TOLERANCES = {
    "contact.friction": (0.20, "friction"),
    "contact.preload_n": (0.10, "preload / N"),
    "modes.3.frequency_hz": (0.002, "frequency of mode 4 / kHz"),
    "modes.*.coupling_a_n_per_v": (0.05, "coupling of A / nominal"),
}
SPEEDS = (10.0, 30.0) if draft() else (0.0, 10.0, 20.0, 30.0)  # rad/s
SAMPLES = 2 if draft() else 16


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    speeds = {"run.speed": SPEEDS}
    tolerances = {path: pr.Tolerance(relative) for path, (relative, _) in TOLERANCES.items()}
    keep = {"torque": "torque_n_m"}
    nominal = pr.sweep(motor, drive, over=speeds, analysis=held_point, quantities=keep)["torque"]
    swept = pr.sweep(motor, drive, over=speeds | tolerances, analysis=held_point, quantities=keep, samples=SAMPLES)
    cloud = swept["torque"]
    low, median, high = 1e3 * cloud.quantile([0.05, 0.5, 0.95], dim="sample").values

    figure, all_axes = canvas(2, 4, 6.4, height_ratios=(2.0, 1.0))
    grid = all_axes[0, 0].get_gridspec()
    for unused in all_axes[0]:
        unused.remove()
    axes = figure.add_subplot(grid[0, :])
    axes.plot(SPEEDS, 1e3 * cloud.transpose("run.speed", "sample"), color=GREY, lw=0.5)
    axes.fill_between(SPEEDS, low, high, color=BLUE, alpha=0.25, lw=0.0)
    axes.plot(SPEEDS, median, color=BLUE)
    axes.plot(SPEEDS, 1e3 * nominal, color=BLACK, ls="--")
    axes.axhline(0.0, color=BLACK, lw=0.6)
    axes.set(title="(a) torque versus speed", xlabel="speed / (rad/s)", ylabel="torque / (mN·m)")
    axes.set_xlim(SPEEDS[0], SPEEDS[-1])

    stall = 1e3 * cloud.sel({"run.speed": SPEEDS[0]})
    for letter, panel, (path, (_, label)) in zip("bcde", all_axes[1], TOLERANCES.items(), strict=True):
        x = cloud[path] / (1e3 if label.endswith("kHz") else 1.0)
        panel.plot(x, stall, "o", ms=2.8, color=VERMILION)
        panel.set(title=f"({letter}) r = {float(np.corrcoef(x, stall)[0, 1]):.2f}".replace("-", "−"), xlabel=label)
        panel.sharey(all_axes[1, 0])
        panel.label_outer()
    all_axes[1, 0].set_ylabel("stall torque / (mN·m)")
    widths = ", ".join(f"{name.partition(' / ')[0]} ±{100 * relative:g} %" for relative, name in TOLERANCES.values())
    caption = (
        f"{motor_words(motor)} Drive: {drive_words(drive)}. Evenly within {widths}: {SAMPLES} samples of a scrambled "
        f"Sobol sequence, seed 0, each with the shaft held at {len(SPEEDS)} speeds: steady states, or settled runs "
        "where these are not stable. (b–e) the same samples at stall, r: coefficient of correlation. "
        f"ngspice {swept.attrs['ngspice_version']}."
    )
    handles = [
        *axes.plot([], [], color=GREY, lw=0.8, label="samples"),
        axes.fill_between([], [], color=BLUE, alpha=0.25, lw=0.0, label="5 to 95 %"),
        *axes.plot([], [], color=BLUE, label="median"),
        *axes.plot([], [], color=BLACK, ls="--", label="nominal"),
    ]
    write(figure, folder / "tolerance.png", "What tolerances do to the speed–torque curve", caption, handles)
    strongest = max(TOLERANCES, key=lambda path: abs(float(np.corrcoef(cloud[path], stall)[0, 1])))
    return [
        f"stall torque {1e3 * float(nominal[0]):.2f} mN·m; within tolerances {low[0]:.2f} to {high[0]:.2f} (5–95 %)",
        f"what counts most is {TOLERANCES[strongest][1].partition(' / ')[0]}",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
