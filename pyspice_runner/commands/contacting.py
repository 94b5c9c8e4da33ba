# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that choose the contact law, declared once for all commands."""

from __future__ import annotations

from typing import Annotated

import typer

import pyspice_runner as pr

DEFAULT_LAW = "spring-slider"
NONE = "none"
_LAWS = (DEFAULT_LAW, "brush", "coulomb")


def _complete_law(incomplete: str) -> list[str]:
    return [name for name in (*_LAWS, NONE) if name.startswith(incomplete)]


ContactOption = Annotated[
    str,
    typer.Option(
        "--contact",
        metavar="LAW",
        help="Contact law: spring-slider, brush, coulomb, the path of a .lib file, or none for a free tip.",
        autocompletion=_complete_law,
    ),
]
SlidersOption = Annotated[int | None, typer.Option(help="Number of sliders of the brush; default: 8.")]


def law_named(contact: str, sliders: int | None = None) -> pr.Law | None:
    """Return the law of ``--contact`` and ``--sliders``; ``None`` for a free tip.

    Raises:
        ParameterError: for an unknown law, or sliders without a brush.
    """
    if sliders is not None and contact != "brush":
        raise pr.ParameterError("--sliders has no effect without --contact brush. Leave it out.")
    return None if contact == NONE else pr.Law(contact, sliders)
