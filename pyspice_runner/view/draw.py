# SPDX-License-Identifier: GPL-3.0-or-later
"""How a result becomes a picture: which panels it has, on which figure they stand, and where that goes.

:func:`sheet` has one implementation for each kind of result, in :mod:`pyspice_runner.view.plots`.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Callable, Sequence
from functools import singledispatch
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pyspice_runner.errors import ParameterError
from pyspice_runner.files import save_by_ending
from pyspice_runner.view.style import CAUTION

ENDINGS = (".png", ".svg", ".pdf")
_DPI = 150
_SCREEN_DPI = 80  # of the picture in a notebook
_LETTERS_PER_INCH = 15  # of the font of captions

Panel = Callable[[Axes], object]


class Sheet(NamedTuple):
    """The panels of a result.

    Attributes:
        panels: name → function that draws it into an Axes.
        columns: number of panels side by side.
        size: width and height of a panel in inches.
        title: title of the figure.
    """

    panels: dict[str, Panel]
    columns: int
    size: tuple[float, float]
    title: str = ""


@singledispatch
def sheet(result: Any) -> Sheet:
    """Return the panels of a result.

    Raises:
        ParameterError: for an object that has no picture.
    """
    raise ParameterError(f"There is no plot of an object of type {type(result).__name__}.")


def draw(result: Any, path: str | Path | None = None, ax: Axes | None = None, panel: str | None = None) -> Axes:
    """Draw a result; see :meth:`pyspice_runner.display.Shown.plot`."""
    page = sheet(result)
    if panel is not None and panel not in page.panels:
        raise ParameterError(f"There is no panel {panel!r}. The panels are {', '.join(page.panels)}.")
    if ax is not None:
        page.panels[panel or next(iter(page.panels))](ax)
        figure: Any = ax.figure
    else:
        if panel is not None:
            page = page._replace(panels={panel: page.panels[panel]}, columns=1)
        figure = _filled([page], getattr(result, "cautions", ()), shown=path is None)
        ax = figure.axes[0]
    if path is not None:
        save(figure, path)
    return ax


def draw_beside(results: Sequence[Any], path: str | Path) -> Path:
    """Draw several results of one kind side by side, a column of panels for each."""
    cautions = tuple(dict.fromkeys(caution for result in results for caution in result.cautions))
    pages = [sheet(result)._replace(columns=1) for result in results]
    return save(_filled(pages, cautions, shown=False), path)


def picture(result: Any) -> bytes:
    """Return the picture of a result as PNG, of the size that suits a notebook."""
    file = io.BytesIO()
    _write(_filled([sheet(result)], (), shown=False), file, _SCREEN_DPI, "png")
    return file.getvalue()


def save(figure: Figure, path: str | Path) -> Path:
    """Write a figure by the ending of the file.

    Raises:
        ParameterError: for another ending, or a place that cannot be written.
    """
    return save_by_ending(path, dict.fromkeys(ENDINGS, lambda file: _write(figure, file, _DPI, None)))


def plain(text: str) -> str:
    """Return a text from a file so that Matplotlib draws it unchanged: a dollar begins no formula."""
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text).replace("$", r"\$")


def _filled(pages: Sequence[Sheet], cautions: Sequence[str], *, shown: bool) -> Figure:
    """Return a figure with a group of columns for each page, and the cautions below them.

    Args:
        pages: sheets, of equally many rows.
        cautions: what to know before using what is drawn.
        shown: whether the figure is for the screen. Then pyplot makes it, so that a notebook or ``pyplot.show()`` shows
            it; otherwise no backend but Agg takes part.
    """
    rows = max(-(-len(page.panels) // page.columns) for page in pages)
    width = sum(page.columns * page.size[0] for page in pages)
    height = rows * pages[0].size[1]
    title = plain(pages[0].title) if len({page.title for page in pages}) == 1 else ""
    lines = [
        line for caution in cautions for line in textwrap.wrap(f"Caution: {caution}", int(_LETTERS_PER_INCH * width))
    ]
    with matplotlib.rc_context({"font.size": 9}):
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


def _write(figure: Figure, file: Any, dpi: int, kind: str | None) -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)  # a box is drawn instead
        figure.savefig(file, dpi=dpi, format=kind)
