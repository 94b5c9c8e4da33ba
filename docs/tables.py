# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of ``docs/accuracy.md``, each known by its head."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

PAGE = Path(__file__).with_name("accuracy.md")


def put(head: str, rows: Iterable[str]) -> None:
    """Replace the rows below a head."""
    lines = "\n".join([head, "|---" * (head.count("|") - 1) + "|", *rows]) + "\n"
    text, count = re.subn(re.escape(head) + r"\n(\|.*\n)+", lambda _: lines, PAGE.read_text(encoding="utf-8"))
    if count != 1:
        raise ValueError(f"The page has {count} tables with the head {head}.")
    PAGE.write_text(text, encoding="utf-8", newline="\n")
