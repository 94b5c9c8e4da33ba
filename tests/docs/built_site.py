# SPDX-License-Identifier: GPL-3.0-or-later
"""The documentation site that ``make docs`` has built needs no network, and has all that the code has."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
import typer
from playwright.sync_api import Browser

import pyspice_runner as pr
from pyspice_runner.cli import app
from pyspice_runner.spice.library import library_names, read_library

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.xdist_group("site")


@pytest.fixture(scope="module")
def site() -> Path:
    """Return the folder into which ``make docs`` has built the site."""
    place = ROOT / "site"
    assert (place / "index.html").is_file(), "site/ is missing; run make docs"
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
    pages = runpy.run_path(str(ROOT / "docs" / "site_pages.py"))
    for name in pages["result_names"]():
        assert f'id="{name}"' in page, name


def test_every_subcircuit_and_parameter_is_there(site: Path) -> None:
    page = text(site, "netlists")
    for library in library_names():
        assert f'id="{library}"' in page
        for name in re.findall(r"^\* PAR\s+(\w+)", read_library(library).text, re.M):
            assert f"<code>{name}</code>" in page, f"{library}: {name}"


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


@pytest.mark.parametrize("name", ["physics", "contact", "tracking", "drive"])
def test_the_live_figure_of_a_page_runs_offline(site: Path, browser: Browser, name: str) -> None:
    page = browser.new_page(offline=True)
    page.goto((site / f"{name}.html").as_uri())
    assert "Try it." in page.inner_text("article")
    page.locator("iframe.live").scroll_into_view_if_needed()
    figure = page.frame_locator("iframe.live").locator("html[data-state=ready]")
    figure.wait_for(state="attached", timeout=60_000)
    assert float(figure.get_attribute("data-speed") or "0") > 10.0
    page.close()


MEASURE = """async () => {
  await document.fonts.ready;
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const cut = [...document.querySelectorAll(".commands > code")].filter((code) => code.scrollWidth > code.clientWidth);
  return [document.documentElement.scrollWidth, cut.length];
}"""


def test_no_page_is_wider_than_a_phone_and_no_command_is_cut(site: Path, browser: Browser) -> None:
    page = browser.new_page(offline=True, viewport={"width": 390, "height": 844})
    page.route("**/playground.html*", lambda route: route.abort())  # ngspice runs in it; see test_live.py
    page.route("**/search/**", lambda route: route.abort())  # each page would build the index of the search again
    found = {}
    for file in site.glob("*.html"):
        if file.name != "playground.html":
            page.goto(file.as_uri())
            found[file.name] = page.evaluate(MEASURE)
    page.close()
    assert "index.html" in found
    assert {name: [width, cut] for name, (width, cut) in found.items() if width > 390 or cut} == {}
