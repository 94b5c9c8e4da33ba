# SPDX-License-Identifier: GPL-3.0-or-later
"""The live page of bimodal40 in Chromium: time to its first paint, and to the first answer of its engine.

.venv/bin/python -m benchmarks.live_page
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from statistics import median

from playwright.sync_api import sync_playwright

import pyspice_runner as pr
from pyspice_runner.view.live import save_live_page
from tests.view.pages import FIRST_PAINT, opened

TIMES = 5
READY = "html:not([data-state=loading])"  # after the first answer
GOAL = 500.0  # ms until the first paint, on an idle machine


def main() -> None:
    """Print the median of both times and their range."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = save_live_page(pr.load_motor("bimodal40"), Path(folder) / "live.html")
        chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        times: dict[str, list[float]] = {"first paint": [], "first answer": []}
        for _ in range(TIMES):
            page, _ = opened(browser, file, READY)
            times["first paint"].append(page.evaluate(FIRST_PAINT))
            times["first answer"].append(page.evaluate("window.readyAt"))
            page.close()
        browser.close()
    for name, all_ in times.items():
        print(f"{name}: {median(all_):.0f} ms ({min(all_):.0f} to {max(all_):.0f}), of {TIMES}")
    print(f"goal of the first paint: {GOAL:g} ms")
