# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of a page: tests recompute them, and leave its words to the writer."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
NUMBER = re.compile(r"(?<![\w.])[−-]?\d+(?:\.\d+)?(?: (?:%|[GMkmµn]?(?:Hz|V|N|W|J|m|s|Pa|F)(?:·m|/mm)?)(?!\w))?")


def missing(page: str, *sentences: str) -> list[str]:
    """The numbers of sentences, with their units, that ``docs/PAGE`` does not print."""
    text = re.sub(r"\s+", " ", (DOCS / page).read_text(encoding="utf-8"))
    printed = set(NUMBER.findall(text))
    return [number for sentence in sentences for number in NUMBER.findall(sentence) if number not in printed]
