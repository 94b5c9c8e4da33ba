# SPDX-License-Identifier: GPL-3.0-or-later
"""Pages: their links and their place in the navigation; and words that a native engineer does not write."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [page for folder in (".", "docs", "behavioral") for page in sorted((ROOT / folder).glob("*.md"))]


def headings(page: Path) -> set[str]:
    """The anchors that GitHub makes of a page's headings."""
    text = re.sub(r"^(```|~~~).*?^\1", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    titles = re.findall(r"^#+ +(.+?) *$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue  # another site
        file, _, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        assert there.exists(), f"{target}: no such file"
        assert not anchor or anchor in headings(there), f"{target}: no such heading"


# --- the site ---

GENERATED = {"CONVENTIONS", "api", "commands", "gallery", "index", "netlists"}  # by docs/site_pages.py


def test_navigation_and_pages_agree() -> None:
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    named = re.findall(r"(\w+)\.md$", navigation, re.M)
    assert sorted(named) == sorted({page.stem for page in (ROOT / "docs").glob("*.md")} | GENERATED)


# --- language ---

WORDS = (
    "greatest", "told", "tells", "bears", "formerly", "used to", "felt", "whilst", "amongst", "thereby", "moreover",
    "upon", "heretofore", "earlier version", "previous version", "older than the", "the former law", "some [0-9]",
    "dead easy", "of course",
)  # fmt: skip
PATTERN = re.compile(rf"\b(?:{'|'.join(WORDS)})\b", re.I)


@pytest.mark.parametrize("page", [*sorted(ROOT.glob("docs/*.md")), ROOT / "README.md"], ids=lambda page: page.stem)
def test_a_page_has_none_of_the_words(page: Path) -> None:
    assert PATTERN.findall(page.read_text(encoding="utf-8")) == []


def test_no_docstring_has_one_of_the_words() -> None:
    found = []
    for file in sorted(ROOT.glob("pyspice_runner/**/*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                words = PATTERN.findall(re.sub(r"``.+?``", "", ast.get_docstring(node) or ""))
                found += [f"{file.name}: {getattr(node, 'name', 'module')}: {word}" for word in words]
    assert found == []
