# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets of panels, the figures made from them, and the helpers that the panels share."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pyspice_runner.files import save_by_ending
from pyspice_runner.run.waveforms import Array
from pyspice_runner.view.style import CAUTION, Label

ENDINGS = (".png", ".svg", ".pdf")
DASHES = ("-", "--", "-.", ":")
MARKS = ("o", "s", "^", "D")
LAST_PERIODS = 3  # of the drive, in panels that show the end of a run
AXIS: dict[str, Any] = {"color": "0.3", "linewidth": 0.8}  # of a line through zero
_DPI = 150
_LOOK: Any = {"font.size": 9, "text.usetex": False}  # TeX would read names and units as its commands
_LETTERS_PER_INCH = 15  # of the font of captions

Panel = Callable[[Axes], object]


class Sheet(NamedTuple):
    """The panels of a result."""

    panels: dict[str, Panel]  # name → function that draws it into an Axes
    columns: int  # number of panels side by side
    size: tuple[float, float]  # width and height of a panel in inches
    title: str = ""  # title of the figure


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure by the ending of the file; see :func:`.save_by_ending`."""
    return save_by_ending(path, dict.fromkeys(ENDINGS, lambda file: write(figure, file, _DPI)))


def write(figure: Figure, file: Any, dpi: int, kind: str | None = None) -> None:
    """Write a figure; a character without a glyph becomes a box."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)
        with matplotlib.rc_context(_LOOK):  # some texts are made here
            figure.savefig(file, dpi=dpi, format=kind)


def plain(text: str) -> str:
    """Return a text from a file so that Matplotlib draws it unchanged: a dollar begins no formula."""
    text = text.replace("\N{NO-BREAK SPACE}", " ")  # between value and unit; Python calls it not printable
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text).replace("$", r"\$")


def filled(pages: Sequence[Sheet], cautions: Sequence[str] = (), *, shown: bool = False) -> Figure:
    """Return a figure with a group of columns for each page, and the cautions below them.

    A figure that is ``shown`` is made by pyplot, so that a notebook or ``pyplot.show()`` shows it; otherwise only the
    Agg backend is used.
    """
    rows = max(-(-len(page.panels) // page.columns) for page in pages)
    width = sum(page.columns * page.size[0] for page in pages)
    height = rows * pages[0].size[1]
    title = plain(pages[0].title) if len({page.title for page in pages}) == 1 else ""
    lines = [
        line for caution in cautions for line in textwrap.wrap(f"Caution: {caution}", int(_LETTERS_PER_INCH * width))
    ]
    with matplotlib.rc_context(_LOOK):
        if shown:
            from matplotlib import pyplot

            figure = pyplot.figure(figsize=(width, height), layout="constrained")
        else:
            figure = Figure(figsize=(width, height), layout="constrained")
            FigureCanvasAgg(figure)
        grid = figure.subplots(rows, sum(page.columns for page in pages), squeeze=False)
        column = 0
        for page in pages:
            places = list(grid[:, column : column + page.columns].flat)
            column += page.columns
            for place, panel in zip(places, page.panels.values(), strict=False):
                panel(place)
            for place in places[len(page.panels) :]:
                place.remove()
        if title:
            figure.suptitle(title, fontsize=10)
        if lines:
            figure.supxlabel("\n".join(map(plain, lines)), fontsize=9, color=CAUTION)
    return figure


# --- helpers of the panels ---


def dress(ax: Axes, x: Label | str, y: Label | str, title: str = "", *, legend: bool = True, **look: Any) -> None:
    """Label the axes of a drawn panel, and give it a grid and, if its lines have labels, a legend."""
    ax.set(xlabel=str(x), ylabel=str(y))
    if title:
        ax.set_title(title)
    ax.grid(True, alpha=0.3)
    if legend and ax.get_legend_handles_labels()[0]:
        ax.legend(**{"fontsize": "small", **look})


def draw_lines(
    ax: Axes,
    x: tuple[Label, Any],
    y: Label,
    lines: Iterable[tuple[Any, dict[str, Any]]],
    title: str = "",
    **legend: Any,
) -> None:
    """Draw lines in SI values with their Matplotlib properties over one axis, in the units of the labels.

    They get a legend if they have labels.
    """
    for values, look in lines:
        ax.plot(x[0].scale * x[1], y.scale * values, **look)
    dress(ax, x[0], y, title, **legend)


def last_periods(time_s: Array, period_s: float, periods: int = LAST_PERIODS) -> tuple[Any, Array]:
    """Return a mask of the points in the last drive periods, and their time from the first of them in s."""
    last = np.asarray(time_s >= time_s[-1] - periods * period_s)
    return last, time_s[last] - time_s[last][0]
