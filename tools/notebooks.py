# SPDX-License-Identifier: GPL-3.0-or-later
"""A tutorial of docs/ as a notebook in ``examples/``: ``python -m tools.notebooks`` writes it.

Text becomes cells of text, each block of Python a cell of code. A test compares the notebook with its page.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = {"control_loops.ipynb": "tutorial_tracking.md"}  # in examples/ → in docs/
_BLOCK = re.compile(r"^```python\n(.*?)^```\n", re.M | re.S)


def notebook_of(page: str) -> str:
    """Return the notebook of a page, as text; the identifiers of its cells are their numbers."""
    cells: list[dict[str, Any]] = []
    for number, part in enumerate(_BLOCK.split(page)):
        if text := part.strip():
            code: dict[str, Any] = {"cell_type": "code", "execution_count": None, "outputs": []}
            kind = code if number % 2 else {"cell_type": "markdown"}
            cells.append(kind | {"id": f"cell{number}", "metadata": {}, "source": text.splitlines(keepends=True)})
    notebook = {"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(notebook, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


def main() -> None:
    """Write the notebooks."""
    for name, page in NOTEBOOKS.items():
        text = notebook_of((ROOT / "docs" / page).read_text(encoding="utf-8"))
        (ROOT / "examples" / name).write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
