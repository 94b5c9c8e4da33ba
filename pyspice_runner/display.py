# SPDX-License-Identifier: GPL-3.0-or-later
"""The plot of an object, and its display on a line and in a notebook.

An object with a plot imports no plotting library. The package registers the module that draws, with :func:`draw_with`;
it is loaded when the first plot is drawn.
"""

from __future__ import annotations

import html
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyspice_runner.errors import ParameterError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_IN_REPR = 4  # entries of the summary
_drawing: Callable[[], Any]


def draw_with(module: Callable[[], Any]) -> None:
    """Register the function that loads the module with ``draw`` and ``picture``."""
    global _drawing
    _drawing = module


class Shown:
    """An object with a summary and a plot. A subclass defines ``summary``; its panels are in ``view/``."""

    def summary(self) -> dict[str, str]:
        """Return the most important values, ready to print: name → value with unit."""
        raise NotImplementedError

    @property
    def cautions(self) -> tuple[str, ...]:
        """Limits of the validity of the object, one sentence each; plots and notebooks show them."""
        return ()

    def plot(self, path: str | Path | None = None, ax: Axes | None = None, *, panel: str | None = None) -> Axes:
        """Draw the object.

        Args:
            path: picture to write, ``.png``, ``.svg`` or ``.pdf``.
            ax: Axes to draw into; by default a new figure.
            panel: name of a panel to draw alone; by default all panels, or with ``ax`` the first.

        Returns:
            The first Axes of the figure; the others are in its ``figure.axes``.

        Raises:
            ParameterError: for an unknown panel or ending, a place that cannot be written, or an object without a plot.
        """
        drawn: Axes = _drawing().draw(self, path, ax, panel)
        return drawn

    def __repr__(self) -> str:
        entries = list(self.summary().items())[:_IN_REPR]
        return f"{type(self).__name__}({', '.join(f'{name}: {value}' for name, value in entries)})"

    def _repr_html_(self) -> str:
        rows = "".join(
            f'<tr><th style="text-align:left">{html.escape(name)}</th>'
            f'<td style="text-align:left">{html.escape(value)}</td></tr>'
            for name, value in self.summary().items()
        )
        warned = "".join(f"<p><strong>Caution:</strong> {html.escape(caution)}</p>" for caution in self.cautions)
        try:
            picture = b64encode(_drawing().picture(self)).decode("ascii")
        except ParameterError:  # no plot, such as of a motor without a beam
            shown = ""
        else:
            shown = f'<img alt="plot of {type(self).__name__}" src="data:image/png;base64,{picture}">'
        return f"<div><strong>{type(self).__name__}</strong><table>{rows}</table>{warned}{shown}</div>"
