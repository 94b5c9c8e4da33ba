# SPDX-License-Identifier: GPL-3.0-or-later
"""How an object is drawn, and shown on a line and in a notebook.

What can be drawn imports no plotting library. ``plot`` and the display of a notebook load
:mod:`pyspice_runner.view.plots` by name when they are called; that module imports the classes that it draws.
"""

from __future__ import annotations

import html
from base64 import b64encode
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyspice_runner.errors import ParameterError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_IN_REPR = 4  # entries of the summary


class Shown:
    """An object with a summary and a picture. A subclass has ``summary``; its panels are in the module of plots."""

    def summary(self) -> dict[str, str]:
        """Return the most important values, ready to print: name → value with unit."""
        raise NotImplementedError

    @property
    def cautions(self) -> tuple[str, ...]:
        """What to know before using the object, one sentence each; plots and notebooks show it."""
        return ()

    def plot(self, path: str | Path | None = None, ax: Axes | None = None, *, panel: str | None = None) -> Axes:
        """Draw the object.

        Args:
            path: picture to write, ``.png``, ``.svg`` or ``.pdf``.
            ax: Axes to draw into; by default a new figure.
            panel: name of the only panel to draw; by default all, or with ``ax`` the first.

        Returns:
            The Axes that was drawn into, of several the first; the others are in its ``figure.axes``.

        Raises:
            ParameterError: for an unknown panel, another ending, a place that cannot be written, or an object of which
                there is no picture.
        """
        drawn: Axes = _view().draw(self, path, ax, panel)
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
            picture = b64encode(_view().picture(self)).decode("ascii")
        except ParameterError:  # there is none, as of a motor that is given without its beam
            shown = ""
        else:
            shown = f'<img alt="plot of {type(self).__name__}" src="data:image/png;base64,{picture}">'
        return f"<div><strong>{type(self).__name__}</strong><table>{rows}</table>{warned}{shown}</div>"


def _view() -> Any:
    """Return the module that draws. It imports what it draws, so that it is loaded by name and late."""
    return import_module("pyspice_runner.view.plots")
