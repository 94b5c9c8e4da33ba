# SPDX-License-Identifier: GPL-3.0-or-later
"""Words that a native engineer does not write are on no page and in no docstring."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
