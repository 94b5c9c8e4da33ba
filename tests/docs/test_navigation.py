# SPDX-License-Identifier: GPL-3.0-or-later
"""Every page of docs/ is in the navigation of the site, and the other way round."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
GENERATED = {"CONVENTIONS", "api", "commands", "gallery", "index", "netlists"}  # by docs/site_pages.py


def test_navigation_and_pages_agree() -> None:
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    named = re.findall(r"(\w+)\.md$", navigation, re.M)
    assert sorted(named) == sorted({page.stem for page in (ROOT / "docs").glob("*.md")} | GENERATED)
