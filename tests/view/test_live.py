# SPDX-License-Identifier: GPL-3.0-or-later
"""The live page in Chromium, without a network: ngspice runs in it, and its numbers are those of the package."""

from __future__ import annotations

import gzip
import hashlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.view.live import ASSETS, engine_facts

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("live")]

PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("live") / "live.html"
    assert run(["live", "bimodal40", "--output", str(target)]) == 0
    return target


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    assert found, "There is no Chromium here; `make setup` installs one."
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield running
        running.close()


def opened(browser: Browser, file: Path, link: str = "", **settings: Any) -> tuple[Page, list[str]]:
    """The page, offline, after its first answer; and what went wrong."""
    page = browser.new_page(viewport=settings.pop("viewport", DESKTOP), **settings)
    wrong: list[str] = []
    page.on("console", lambda message: wrong.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "request", lambda asked: None if asked.url.startswith(("file:", "blob:", "data:")) else wrong.append(asked.url)
    )
    page.on("dialog", lambda dialog: (wrong.append(dialog.message), dialog.dismiss()))
    page.context.set_offline(True)
    page.goto(file.as_uri() + link)
    page.wait_for_selector("html:not([data-state=loading])", state="attached", timeout=60_000)
    return page, wrong


@pytest.fixture(scope="module")
def desktop(browser: Browser, page_file: Path) -> Iterator[tuple[Page, list[str]]]:
    page, wrong = opened(browser, page_file)
    yield page, wrong
    page.close()


def answered(page: Page, do: Callable[[], object]) -> dict[str, str]:
    """Change something on the page, wait for the settled answer, and return the data of the root element."""
    page.evaluate("document.documentElement.dataset.busy = 'asked'")
    do()
    page.wait_for_selector("html[data-busy=false]", state="attached", timeout=60_000)
    return data(page)


def data(page: Page) -> dict[str, str]:
    found: dict[str, str] = page.evaluate("({...document.documentElement.dataset})")
    return found


def typed(page: Page, name: str, value: float) -> Callable[[], None]:
    def do() -> None:
        page.locator(f"#{name}-number").fill(f"{value:g}")
        page.locator(f"#{name}-number").press("Tab")

    return do


def test_the_engine_is_the_stated_one() -> None:
    facts = engine_facts()
    wasm = gzip.decompress((ASSETS / "ngspice.wasm.gz").read_bytes())
    assert (len(wasm), hashlib.sha256(wasm).hexdigest()) == (facts["wasm_bytes"], facts["wasm_sha256"])
    assert hashlib.sha256((ASSETS / "ngspice.js").read_bytes()).hexdigest() == facts["loader_sha256"]
    script = (Path(__file__).parents[2] / "scripts" / "live_engine.py").read_text(encoding="utf-8")
    assert facts["package_sha512_base64"] in script
    assert (ASSETS / "LICENSE").read_text(encoding="utf-8").startswith("MIT License")


def test_the_page_is_small_states_its_engine_and_paints_at_once(
    page_file: Path, desktop: tuple[Page, list[str]]
) -> None:
    page, wrong = desktop
    assert page_file.stat().st_size < 12_000_000
    assert page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime") < 500.0
    footer = page.inner_text("footer")
    for name in ("ngspice", "package", "package_licence", "wasm_sha256", "loader_sha256"):
        assert str(engine_facts()[name]) in footer
    policy = page.get_attribute("meta[http-equiv=Content-Security-Policy]", "content")
    assert policy is not None
    assert "default-src 'none'" in policy
    assert "connect-src 'none'" in policy
    assert "unsafe-inline" not in policy
    assert page.evaluate("fetch('https://example.org').then(() => 'reached', () => 'blocked')") == "blocked"
    assert [message for message in wrong if "example.org" not in message] == []
    wrong.clear()


def test_the_speed_is_that_of_the_steady_state(desktop: tuple[Page, list[str]]) -> None:
    page, _ = desktop
    found = answered(page, lambda: page.select_option("#preset-choice", label="bimodal40: recommended drive"))
    motor = pr.load_motor("bimodal40")
    steady = pr.steady_state(motor, pr.default_drive(motor), load_torque=0.0)
    assert found["settled"] == "true"
    # the mean speed of both is settled to 0.2 %, the step is 1/80 here and 1/128 there
    assert float(found["speed"]) == pytest.approx(steady.speed_rad_s, rel=0.01)
