# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that choose the contact law, declared once for all commands."""

from __future__ import annotations

from typing import Annotated

import typer

from pyspice_runner.commands.common import refuse_idle

DEFAULT_LAW = "spring-slider"
NONE = "none"
_LAWS = (DEFAULT_LAW, "brush", "coulomb")


def _complete_law(incomplete: str) -> list[str]:
    return [name for name in (*_LAWS, NONE) if name.startswith(incomplete)]


LawOption = Annotated[
    str,
    typer.Option(
        "--contact",
        metavar="LAW",
        help="Contact law: spring-slider, brush, coulomb, or the path of a .lib file.",
        autocompletion=_complete_law,
    ),
]
ContactOption = Annotated[
    str,
    typer.Option(
        "--contact",
        metavar="LAW",
        help="Contact law: spring-slider, brush, coulomb, the path of a .lib file, or none for a free tip.",
        autocompletion=_complete_law,
    ),
]
SlidersOption = Annotated[int, typer.Option(help="Number of sliders of the brush.")]


def law_named(contact: str) -> str | None:
    """Return the law as the package names it: ``None`` for a free tip."""
    return None if contact == NONE else contact


def check_contact(context: typer.Context, contact: str) -> None:
    """Refuse ``--sliders`` for a law that has none.

    Raises:
        ParameterError: naming the option.
    """
    if contact != "brush":
        refuse_idle(context, "without --contact brush", "sliders")
