# SPDX-License-Identifier: GPL-3.0-or-later
"""Long measurements of the live page: ten settings against the package, 50 changes, 200 changes, five tasks.

``python -m validation.live_page`` writes ``records/live_page.json``; with ``latency`` it measures this part alone.
``make validation`` runs it.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from playwright.sync_api import Browser, Page, sync_playwright

import pyspice_runner as pr
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.steady.steady import SteadyState
from pyspice_runner.view.live import half_load, save_live_page

ROOT = Path(__file__).resolve().parents[1]
RECORD = ROOT / "validation" / "records" / "live_page.json"
CHANGES, MANY = 50, 200
AGREES = 0.05  # the page settles speeds to 2 %, and group B draws a tenth of the current of group A
SETTINGS: list[tuple[str, dict[str, Any]]] = [
    ("bimodal40", {}),
    ("bimodal40", {"voltage": 80}),
    ("bimodal40", {"frequency": 40.8e3}),
    ("bimodal40", {"phase": -90}),
    ("bimodal40", {"preload": 16, "friction": 0.3}),
    ("bimodal40", {"torque": 20e-3}),
    ("bimodal40", {"shaft": "held", "speed": 20}),
    ("bimodal40", {"mount": "held"}),
    ("andersen2002", {"voltage": 100}),
    ("andersen2002", {"voltage": 150, "torque": -1e-3}),
    ("andersen2002", {"voltage": 150, "torque": -5e-4, "law": "brush"}),
    ("andersen2002", {"kind": "two-tone", "voltage": 100, "frequency": 18e3, "voltage_2": 50, "frequency_2": 54e3,
                      "phase_2": 165, "mount": "held"}),
]  # fmt: skip
COMPARED = {
    "speed": "speed_rad_s", "torque": "torque_n_m", "current_a": "current_a_rms_a", "current_b": "current_b_rms_a",
}  # fmt: skip


@contextmanager
def opened() -> Iterator[tuple[Browser, Page, Path]]:
    """Yield a browser with the live page, after its first answer, and the file."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = save_live_page(pr.load_motor("bimodal40"), Path(folder, "live.html"))
        chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900}, offline=True)
        page.goto(file.as_uri())
        settled(page)
        yield browser, page, file
        browser.close()


def settled(page: Page) -> None:
    """Wait until the page has its settled answer."""
    page.wait_for_selector("html[data-busy=false]", state="attached", timeout=120_000)


def answered(page: Page, do: Callable[[], object]) -> None:
    """Change something and wait for the settled answer."""
    page.evaluate("document.documentElement.dataset.busy = 'asked'")
    do()
    settled(page)


def found(page: Page) -> dict[str, Any]:
    """Return the numbers of the shown setting."""
    values: dict[str, Any] = page.evaluate(
        "(({speed, torque, current_a, current_b, settled, open}) => "
        "({speed, torque, current_a, current_b, settled, open}))(page.results[page.slot].found)"
    )
    return values


def reference(name: str, changes: dict[str, Any]) -> SteadyState:
    """Return the steady state of the package with native ngspice."""
    motor, drive = pr.load_motor(name), pr.default_drive(pr.load_motor(name))
    paths = {"preload": "contact.preload_n", "friction": "contact.friction"}
    motor = motor.updated({paths[key]: value for key, value in changes.items() if key in paths})
    if changes.get("mount") == "held":
        motor = motor.updated({"mount": None})
    if changes.get("kind") == "two-tone":
        drive = pr.TwoToneDrive(
            voltage_1=changes["voltage"], frequency_1=changes["frequency"], voltage_2=changes["voltage_2"],
            frequency_2=changes["frequency_2"], phase_deg=changes["phase_2"],
        )  # fmt: skip
    else:
        named = {"voltage": "voltage", "frequency": "frequency", "phase": "phase_deg"}
        drive = drive.model_copy(update={named[key]: value for key, value in changes.items() if key in named})
    load = changes.get("torque", half_load(pr.load_motor(name)))
    shaft = {"speed": changes["speed"]} if changes.get("shaft") else {"load_torque": load}
    return pr.steady_state(motor, drive, contact=changes.get("law", "spring-slider"), **shaft)


def compare(page: Page, name: str, changes: dict[str, Any]) -> dict[str, Any]:
    """Return page, package and their relative differences for one setting."""
    words = urlencode({f"A.{key}": value for key, value in {"motor": name, **changes}.items()})
    answered(page, lambda: page.evaluate("words => { location.hash = words }", words))
    here, there = found(page), reference(name, changes)
    row = {"motor": name, "setting": changes, "settled": here["settled"], "quantities": {}}
    for key, attribute in COMPARED.items():
        wanted = float(getattr(there, attribute))
        if key == "speed" and changes.get("shaft") == "held":
            continue
        row["quantities"][key] = {"page": here[key], "package": wanted, "difference": here[key] / wanted - 1.0}
    return row


def latency(page: Page, changes: int = CHANGES) -> dict[str, Any]:
    """Return median and 95th percentile of the times in s from a slider to numbers and to the picture of the path."""
    numbers, pictures = [], []
    for count in range(changes):
        page.evaluate("delete document.documentElement.dataset.picture")
        page.locator("#voltage-slider").fill(f"{96 + (count * 7) % 41}")
        page.wait_for_selector("html[data-picture]", state="attached", timeout=60_000)
        data = page.evaluate("({...document.documentElement.dataset})")
        numbers.append(float(data["latency"]))
        pictures.append(float(data["picture"]))
    return {
        "changes": changes,
        "load_average": os.getloadavg()[0],
        "cores": os.cpu_count(),
        **{
            name: {"median_s": statistics.median(times), "p95_s": sorted(times)[int(0.95 * (len(times) - 1))]}
            for name, times in (("numbers", numbers), ("picture", pictures))
        },
    }


def memory(browser: Browser, page: Page, changes: int = MANY) -> list[dict[str, float]]:
    """Return the memory of the page's process after every 20th change: all of it, and that of its objects."""
    session, inside = browser.new_browser_cdp_session(), page.context.new_cdp_session(page)
    rows = []
    for count in range(changes + 1):
        if count % 20 == 0:
            settled(page)
            inside.send("HeapProfiler.collectGarbage")
            heap = inside.send("Runtime.getHeapUsage")["usedSize"]
            info = session.send("SystemInfo.getProcessInfo")["processInfo"]
            resident = max(_resident(one["id"]) for one in info if one["type"] == "renderer")
            rows.append({"changes": count, "resident_mb": resident, "objects_mb": heap / 1e6})
        page.evaluate("delete document.documentElement.dataset.picture")
        page.locator("#voltage-slider").fill(f"{96 + (count * 7) % 41}")
        page.wait_for_selector("html[data-picture]", state="attached", timeout=60_000)
    return rows


def _resident(process: int) -> float:
    pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


# --- five tasks, as a new user would do them ---


def _choose(page: Page, preset: str) -> None:
    name = preset.partition(":")[0]
    if page.input_value("#motor-choice") != name:
        answered(page, lambda: page.select_option("#motor-choice", name))
    answered(page, lambda: page.select_option("#preset-choice", label=preset))


def _set(page: Page, name: str, value: float) -> None:
    if float(page.input_value(f"#{name}-number")) == value:
        return  # without a change there is no answer

    def do() -> None:
        page.fill(f"#{name}-number", f"{value:g}")
        page.press(f"#{name}-number", "Tab")

    answered(page, do)


def task_reverse(page: Page) -> str:
    """Find the frequency at which the paper's motor with the unintended mode reverses."""
    _choose(page, "andersen2002-unintended-mode: recommended drive")
    page.wait_for_selector("html[data-further=done]", state="attached", timeout=60_000)
    page.locator("#response").scroll_into_view_if_needed()
    return page.inner_text("#response-note")


def task_preload(page: Page) -> str:
    """Find the preload with the largest stall torque at 60 V."""
    _choose(page, "bimodal40: stall: the shaft is held")
    _set(page, "voltage", 60)
    torques = {}
    for preload in (10, 16, 22, 28, 34):
        _set(page, "preload", preload)
        torques[preload] = found(page)["torque"]
    best = max(torques, key=lambda one: torques[one])
    _set(page, "preload", best)
    page.locator("#numbers").scroll_into_view_if_needed()
    return f"{best} N, {1e3 * torques[best]:.3g} mN·m"


def task_lift(page: Page) -> str:
    """Find the preload below which the contact opens."""
    _choose(page, "bimodal40: recommended drive")
    for preload in range(22, 4, -2):
        _set(page, "preload", preload)
        if found(page)["open"] > 0.0:
            break
    page.locator("#path").scroll_into_view_if_needed()
    return f"{preload} N"


def task_back(page: Page) -> str:
    """Make the motor run backwards at the same speed, and see both side by side."""
    _choose(page, "bimodal40: recommended drive")
    answered(page, lambda: page.click("#compare"))
    _set(page, "phase", -90)
    _set(page, "torque", -float(page.input_value("#torque-number")))
    rows = page.inner_text("#values tr:first-child")
    page.locator("#path").scroll_into_view_if_needed()
    return " ".join(rows.split())


def task_coil(page: Page) -> str:
    """See what a series inductor of 10 mH does to the speed."""
    if page.locator("#slot-b").is_visible():
        page.click("#compare")
    _choose(page, "bimodal40: recommended drive")
    before = found(page)["speed"]
    page.evaluate("document.getElementById('driver').open = true")
    page.fill("#driver-text", "La source_a a 10m\nLb source_b b 10m")
    answered(page, lambda: page.click("#driver-run"))
    page.locator("#driver").scroll_into_view_if_needed()
    return f"{before:.3g} rad/s without, {found(page)['speed']:.3g} rad/s with the inductors"


TASKS = {
    "reverse": task_reverse, "preload": task_preload, "lift": task_lift, "back": task_back, "coil": task_coil,
}  # fmt: skip


def run_task(page: Page, name: str) -> dict[str, Any]:
    """Do a task; return what it asks, its answer and its time."""
    began = time.monotonic()
    answer = TASKS[name](page)
    seconds = time.monotonic() - began
    return {"task": (TASKS[name].__doc__ or "").strip(), "answer": answer, "seconds": round(seconds, 1)}


def settings(page: Page) -> list[dict[str, Any]]:
    """Compare all settings with the package."""
    rows = []
    for name, changes in SETTINGS:
        rows.append(compare(page, name, changes))
        shown = {key: f"{100 * one['difference']:.2f} %" for key, one in rows[-1]["quantities"].items()}
        print(name, changes, shown, flush=True)
    return rows


def tasks(page: Page) -> list[dict[str, Any]]:
    """Do all tasks."""
    return [run_task(page, name) for name in TASKS]


def main(parts: list[str]) -> None:
    """Measure the named parts, or all, and write the record."""
    record = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    with opened() as (browser, page, file):
        measures: dict[str, Callable[[], Any]] = {
            "latency": lambda: latency(page),
            "memory": lambda: memory(browser, page),
            "settings": lambda: settings(page),
            "tasks": lambda: tasks(page),
        }
        record["page_mb"] = file.stat().st_size / 1e6
        record["ngspice_native"] = ngspice_version()
        for part in parts or measures:
            page.goto("about:blank")
            page.goto(file.as_uri())
            settled(page)
            record[part] = measures[part]()
            print(part, json.dumps(record[part], ensure_ascii=False)[:600], flush=True)
    RECORD.write_text(json.dumps(record, separators=(",", ":"), ensure_ascii=False) + "\n", encoding="utf-8")
    for row in record["settings"]:
        for name, one in row["quantities"].items():
            if abs(one["difference"]) > AGREES:
                sys.exit(f"{row['motor']} {row['setting']}: {name} is {one['page']:.4g}, not {one['package']:.4g}")


if __name__ == "__main__":
    main(sys.argv[1:])
