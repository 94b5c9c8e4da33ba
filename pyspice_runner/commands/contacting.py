# SPDX-License-Identifier: GPL-3.0-or-later
"""The options by which commands choose the law of the contact."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

import typer


class LawKind(StrEnum):
    """Laws of the contact."""

    spring_slider = "spring-slider"
    brush = "brush"
    coulomb = "coulomb"


class ContactKind(StrEnum):
    """What the tip touches."""

    spring_slider = "spring-slider"
    brush = "brush"
    coulomb = "coulomb"
    none = "none"

    @property
    def law(self) -> Literal["spring-slider", "brush", "coulomb"] | None:
        """The law, as the package names it."""
        return None if self is ContactKind.none else LawKind(self.value).value


LawOption = Annotated[LawKind, typer.Option("--contact", help="Contact law.")]
ContactOption = Annotated[ContactKind, typer.Option("--contact", help="Contact law; none is a free tip.")]
SlidersOption = Annotated[int, typer.Option(help="Number of sliders of the brush.")]
