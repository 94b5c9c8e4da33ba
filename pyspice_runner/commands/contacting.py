# SPDX-License-Identifier: GPL-3.0-or-later
"""The options by which commands choose the law of the contact."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer


class LawKind(StrEnum):
    """Laws of the contact."""

    spring_slider = "spring-slider"
    brush = "brush"
    coulomb = "coulomb"


LawOption = Annotated[LawKind, typer.Option("--contact", help="Contact law.")]
SlidersOption = Annotated[int, typer.Option(help="Number of sliders of the brush.")]
