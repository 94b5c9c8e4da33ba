# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation site builds without a warning, needs no network, and has all that the code has."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import pyspice_runner as pr
from pyspice_runner.cli import app

ROOT = Path(__file__).parents[2]

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("site")]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", place],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
    return place


def text(site: Path, page: str) -> str:
    return (site / f"{page}.html").read_text(encoding="utf-8")


def test_every_page_of_docs_is_in_the_navigation(site: Path) -> None:
    links = re.findall(r'<a href="(\w+)\.html" class="md-nav__link', text(site, "index"))
    for page in [*(ROOT / "docs").glob("*.md"), Path("commands"), Path("api"), Path("netlists"), Path("gallery")]:
        assert page.stem in links, page.stem


def test_nothing_comes_from_the_network(site: Path) -> None:
    loads = r"<(?:script|img|iframe|source)[^>]+src=.?https?:|<link[^>]+rel=.?(?:stylesheet|preconnect)[^>]+https?:"
    for page in site.rglob("*.html"):
        assert not re.findall(loads, page.read_text(encoding="utf-8")), page.name


def test_every_command_and_option_is_there(site: Path) -> None:
    page = text(site, "commands")
    for name, command in typer.main.get_command(app).commands.items():
        assert f"piezomotor {name}" in page
        for item in command.params:
            assert all(option in page for option in item.opts if option.startswith("--"))


def test_every_public_name_is_there_with_what_it_takes(site: Path) -> None:
    page = text(site, "api")
    for name in pr.__all__:
        home = getattr(pr, name).__module__
        assert f'id="{home}.{name}"' in page, name
    assert "load_torque" in page


def test_every_subcircuit_and_parameter_is_there(site: Path) -> None:
    page = text(site, "netlists")
    for library in sorted((ROOT / "behavioral").glob("*.lib")):
        assert f'id="{library.stem}"' in page
        for name in re.findall(r"^\* PAR\s+(\w+)", library.read_text(encoding="utf-8"), re.M):
            assert f"<code>{name}</code>" in page, f"{library.stem}: {name}"


def test_every_figure_is_there_with_its_script(site: Path) -> None:
    page = text(site, "gallery")
    for picture in (ROOT / "figures").glob("*.png"):
        assert f'src="figures/{picture.name}"' in page
        assert (site / "figures" / picture.name).stat().st_size == picture.stat().st_size
        assert f"figures/{picture.stem}.py" in page


def test_formulas_are_mathml(site: Path) -> None:
    page = text(site, "physics")
    assert "arithmatex" not in page
    assert "```math" not in page
    fences = re.findall(r"^```math$", (ROOT / "docs" / "physics.md").read_text(encoding="utf-8"), re.M)
    assert page.count('display="block"') == len(fences) > 3
