# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands, the Python and the decks of the pages are run from an empty directory, one page after the other.

`make soak` runs those of the pages named in LONG; `make test` only parses their commands. test_readme.py runs the
commands of docs/getting_started.md.
"""

from __future__ import annotations

import os
import re
import shlex
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pyspice_runner.cli import run
from tests.circuit.batch import batch, results
from tests.processes import other_cache
from tests.test_readme import COMMANDS as README_COMMANDS
from tests.test_readme import parse

ROOT = Path(__file__).parents[2]
ELSEWHERE = ("own_motor", "getting_started", "tutorial_contact_law")  # their own tests run these
PAGES = [path for path in sorted((ROOT / "docs").glob("*.md")) if path.stem not in ELSEWHERE]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty folder, and a store of sweeps for all tests: the Python of a page may sweep as its command did."""
    base = tmp_path_factory.getbasetemp()
    monkeypatch.chdir(tmp_path)
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    monkeypatch.setenv("XDG_CACHE_HOME", other_cache(base / "cache"))


def commands(page: Path) -> list[str]:
    """Return the commands of a page; one that goes on in the next line ends its line with a backslash."""
    text = re.sub(r" *\\\n +", " ", page.read_text(encoding="utf-8"))
    return re.findall(r"^    (piezomotor .+)$", text, re.M)


def decks(page: Path) -> list[str]:
    return re.findall(r"^```spice\n(.*?^\.end\n)```", page.read_text(encoding="utf-8"), re.M | re.S)


def snippets(page: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)


# pages whose commands or Python take 4 to 12 s
LONG = {"drive", "impedance", "other_tools", "ring", "speed_torque", "steady_state", "sweeps", "tracking"}
LONG |= {
    "tutorial_driver",
    "tutorial_impedance",
    "tutorial_tracking",
}


def pages_with(parts: Callable[[Path], list[str]]) -> list[Any]:
    """Return the pages that have such parts; those that take long are marked."""
    return [
        pytest.param(page, marks=[pytest.mark.soak] if page.stem in LONG else [], id=page.stem)
        for page in PAGES
        if parts(page)
    ]


def run_decks(page: Path, folder: Path) -> None:
    """Run the decks of a page in the folder of what its commands have written."""
    for deck in decks(page):
        measured = results(batch(folder / "mine.cir", deck))
        for name in re.findall(r"^meas \w+ (\w+)", deck, re.M):
            assert (measured[name] == 0.0) == (name == "check")


@pytest.mark.parametrize("page", [page for page in PAGES if page.stem in LONG], ids=lambda page: page.stem)
def test_commands_of_long_pages_are_valid(page: Path) -> None:
    for command in commands(page):
        parse(command)


# test_tutorial_driver_page.py runs the commands of its page
@pytest.mark.parametrize("page", [page for page in pages_with(commands) if page.id != "tutorial_driver"])
def test_commands(page: Path, tmp_path: Path) -> None:
    for command in commands(page):
        words = shlex.split(command)[1:]
        if command in README_COMMANDS and words[0] != "export":  # later commands and decks read what is exported
            continue
        assert run(words) == 0, command
        for option in ("--output", "--plot"):
            if option in words:
                assert (tmp_path / words[words.index(option) + 1]).stat().st_size > 0
    run_decks(page, tmp_path)


@pytest.mark.parametrize("page", pages_with(snippets))
def test_python(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In this process, since an interpreter that begins anew loads the libraries for a second each time."""
    for number, snippet in enumerate(snippets(page)):
        if re.search(r"^(import|from) ", snippet, re.M):  # a snippet without imports continues the one before it
            names: dict[str, object] = {"__name__": "__main__"}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            exec(compile(snippet, f"{page.name}, snippet {number}", "exec"), names)
        assert capsys.readouterr().out
