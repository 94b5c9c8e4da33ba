# SPDX-License-Identifier: GPL-3.0-or-later
"""Every prediction of docs/measured.md over what was measured: what the model predicts, and what it does not.

The values are those of the page, which the tests compute again.
"""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import numpy as np
from style import BLUE, GREEN, GREY, HERE, ORANGE, PURPLE, VERMILION, canvas, main, write

PAGE = HERE.parent / "docs" / "measured.md"
COLOURS = [BLUE, GREEN, VERMILION, ORANGE, PURPLE]  # of the sections, in the order of the page
CELL = re.compile(r"/ [^|]*\(([-+][\d.]+)\)")  # predicted / measured, and the error in per cent


def errors() -> dict[tuple[str, str], list[float]]:
    """Return the ratios of predicted to measured by section and column of the page."""
    found: dict[tuple[str, str], list[float]] = defaultdict(list)
    section, columns = "", [""]
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            section = line.lstrip("# ")
        elif line.startswith("| "):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            values = [CELL.search(cell) for cell in cells]
            if not any(values):
                columns = cells
            for column, value in zip(columns, values, strict=False):
                if value:
                    found[section, column].append(1.0 + float(value[1]) / 100.0)
    return found


def draw(folder: Path) -> list[str]:
    rows = errors()
    sections = list(dict.fromkeys(section for section, _ in rows))
    figure, axes = canvas(1, 1, 0.33 * len(rows) + 1.9)
    for place, ((section, _), ratios) in enumerate(rows.items()):
        spread = np.linspace(-0.18, 0.18, len(ratios)) if len(ratios) > 1 else np.zeros(1)
        colour = COLOURS[sections.index(section)]
        axes.plot(ratios, place + spread, "o", color=colour, mfc="white", ms=5, label=section)
    axes.axvline(1.0, color=GREY, lw=1.2)
    axes.axvspan(0.9, 1.1, color=GREY, alpha=0.15, lw=0)
    axes.set(xscale="log", xlim=(0.015, 15.0), xlabel="predicted / measured", ylim=(len(rows) - 0.4, -0.6))
    axes.set_yticks(range(len(rows)), [column.partition(",")[0] for _, column in rows])
    axes.set_xticks(
        [0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10], ["0.02", "0.05", "0.1", "0.2", "0.5", "1", "2", "5", "10"]
    )
    axes.minorticks_off()
    handles, labels = axes.get_legend_handles_labels()
    first = dict(zip(reversed(labels), reversed(handles), strict=True))
    axes.legend([first[section] for section in sections], sections, loc="lower left")
    caption = "Shaded: within 10 %. Sources, assumptions and the reasons of the errors: docs/measured.md."
    write(figure, folder / "measured.png", "Predicted versus measured", caption)
    everything = np.concatenate([np.asarray(ratios) for ratios in rows.values()])
    near, double = np.abs(everything - 1.0) <= 0.1, np.abs(np.log2(everything)) <= 1.0
    return [f"{len(everything)} predictions: {near.mean():.0%} within 10 %, {double.mean():.0%} within a factor of 2"]


if __name__ == "__main__":
    main(draw, __doc__)
