# SPDX-License-Identifier: GPL-3.0-or-later
"""Which unintended modes give the orders of the paper's figure 6 on a sprung mount.

The results are those of ``python -m docs.figure_6_search``, which runs several hundred curves.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from matplotlib.ticker import NullLocator
from style import BLACK, BLUE, GREY, VERMILION, canvas, main, write

SEARCH = Path(__file__).parents[1] / "docs" / "figure_6_search.json"


def draw(folder: Path) -> list[str]:
    record = json.loads(SEARCH.read_text(encoding="utf-8"))
    drawn = list(record["search"].values())
    best = record["best"]["on the mount"]
    figure, grid = canvas(2, 2, 6.4, height_ratios=(1.3, 1.0), width_ratios=(1.0, 1.25))
    for unused in grid[1]:
        unused.remove()
    axes = [*grid[0], figure.add_subplot(grid[0, 0].get_gridspec()[1, :])]

    holds = np.array([one["margin"] > 0.0 for one in drawn])
    frequency = np.array([one["point"]["frequency_hz"] for one in drawn]) / 1e3
    # what the voltage and the mode's impedance make of the motion at resonance
    drive = np.array([one["point"]["coupling"] / one["point"]["damping"] for one in drawn])
    for chosen, colour, marker, label in ((~holds, GREY, "x", "no"), (holds, BLUE, "o", "yes")):
        axes[0].plot(frequency[chosen], drive[chosen], marker, color=colour, ms=3.5, label=label)
    axes[0].set(
        title="(a) modes drawn: both orders?", xlabel="frequency / kHz", yscale="log",
        ylabel="coupling over damping, relative to the set",
    )  # fmt: skip
    axes[0].yaxis.set_minor_locator(NullLocator())
    axes[0].set_yticks([0.2, 0.5, 1.0, 2.0, 5.0], ["0.2", "0.5", "1", "2", "5"])
    axes[0].legend(loc="lower right", frameon=True, framealpha=0.9, edgecolor="none")

    points = list(record["map"].values())
    x = np.array(sorted({one["point"]["frequency_hz"] for one in points})) / 1e3
    y = np.array(sorted({one["point"]["coupling"] for one in points}))
    margin = np.array([one["margin"] for one in points]).reshape(len(x), len(y)).T
    filled = axes[1].pcolormesh(x, y, 100.0 * np.maximum(margin, -0.4), cmap="PuOr", vmin=-40.0, vmax=40.0)
    if margin.min() < 0.0 < margin.max():
        axes[1].contour(x, y, margin, levels=[0.0], colors=[BLACK], linewidths=1.2)
    axes[1].plot(best["point"]["frequency_hz"] / 1e3, best["point"]["coupling"], "D", color=BLACK, ms=5, mfc="white")
    axes[1].set(
        title="(b) around the best one", xlabel="frequency / kHz", ylabel="coupling, relative to the set", yscale="log"
    )
    axes[1].minorticks_off()
    axes[1].set_yticks(y, [f"{value:.2g}" for value in y])
    figure.colorbar(filled, ax=axes[1], label="smaller difference / %")

    changes = {"as found": best["margin"]} | {name: one["margin"] for name, one in record["sensitivity"].items()}
    places = np.arange(len(changes))
    colours = [BLUE if value > 0.0 else VERMILION for value in changes.values()]
    axes[2].barh(places, [100.0 * max(value, -0.4) for value in changes.values()], color=colours, height=0.6)
    axes[2].axvline(0.0, color=BLACK, lw=0.8)
    axes[2].set_yticks(places, [name.replace("contact stiffness", r"$K_N$") for name in changes])
    axes[2].invert_yaxis()
    axes[2].set(title="(c) one change at a time", xlabel="smaller difference / %")
    caption = (
        "Motor andersen2002-unintended-mode on its mount, 100 V, φ = 180°, 5 N. Smaller difference: by how much "
        "the stall torque at 44.5 kHz exceeds that at 46 kHz, or the no-load speed at 46 kHz that at 44.5 kHz, "
        f"whichever is less; negative where an order is reversed. (a) {len(drawn)} modes and carriers of a Sobol "
        "sequence. (b) The diamond is the best of (a); black: the limit of the region. −40 % stands for all that is "
        "lower and for motors that do not turn."
    )
    share = float(holds.mean())
    write(
        figure,
        folder / "figure_6_region.png",
        "Both orders of figure 6 hold in a part of the space, with a small margin",
        caption,
    )
    return [
        f"{share:.0%} of {len(drawn)} modes give both orders; the best by {100 * best['margin']:.0f} %",
        *(f"{name}: {100 * value:+.0f} %" for name, value in changes.items()),
    ]


if __name__ == "__main__":
    main(draw, __doc__)
