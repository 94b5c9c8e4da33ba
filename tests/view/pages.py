# SPDX-License-Identifier: GPL-3.0-or-later
"""A page in Chromium, without a network."""

import json
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page

LONGEST = 600_000  # ms until a condition holds, far beyond what a busy machine takes
FIRST_PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime"  # ms
# the time at which an element is there, ms
READY_AT = """new MutationObserver((_, observer) => {
  if (!document.querySelector(%s)) return;
  window.readyAt = performance.now();
  observer.disconnect();
}).observe(document, { attributes: true, childList: true, subtree: true });"""
PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}


def opened(browser: Browser, file: Path, ready: str, link: str = "", **settings: Any) -> tuple[Page, list[str]]:
    """Return the page, offline, when an element ``ready`` is there; and what went wrong."""
    page = browser.new_page(viewport=settings.pop("viewport", DESKTOP), **settings)
    page.set_default_timeout(LONGEST)
    wrong: list[str] = []
    local = ("file:", "blob:", "data:")
    page.on("console", lambda message: wrong.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda asked: None if asked.url.startswith(local) else wrong.append(asked.url))
    page.on("dialog", lambda dialog: (wrong.append(dialog.message), dialog.dismiss()))
    page.context.set_offline(True)
    page.add_init_script(READY_AT % json.dumps(ready))
    page.goto(file.as_uri() + link)
    page.wait_for_selector(ready, state="attached")
    return page, wrong


def first_paint_share(page: Page) -> float:
    """Time of the first paint divided by the time at which the page was ready: it does not depend on the machine."""
    return float(page.evaluate(f"{FIRST_PAINT} / window.readyAt"))
