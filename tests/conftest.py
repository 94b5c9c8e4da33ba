# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests share."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser

    from pyspice_runner.motor.motor import Motor

# before NumPy loads: two workers with two threads each would wait for each other on two cores
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# each Python that a test starts would compile the package again, which takes 0.1 s, and this one its assertions: 3 s
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# a shell without job control starts `make test &` with SIGINT ignored, and so would all processes of the tests be
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# the same of SIGHUP under nohup; the tests of signals need it as a terminal's processes have it
if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

gc.disable()  # while the tests are collected, which makes many objects and little garbage: half of the time


@pytest.fixture(autouse=True, scope="session")
def _wide_tables() -> Iterator[None]:
    """Let tables be as wide as their content; otherwise they fold at 80 characters, where a test does not expect it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "400")
        yield


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put files first whose tests take long or must stay on one worker, so that both workers end at the same time."""
    marks = ("slow", "xdist_group")
    ranks: dict[Path, int] = {}
    for item in items:
        rank = next((place for place, name in enumerate(marks) if item.get_closest_marker(name)), len(marks))
        ranks[item.path] = min(rank, ranks.get(item.path, rank))
    items.sort(key=lambda item: ranks[item.path])


def pytest_collection_finish() -> None:
    """Collect garbage from here on, but do not search what is needed to the end."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def motor() -> Motor:
    """The motor of the paper; files that test another one have a fixture of that name."""
    from pyspice_runner.motor.load import load_motor

    return load_motor("andersen2002")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium for the tests of a file. Its event loop would disturb further tests of the process if it stayed."""
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    assert found, "There is no Chromium here; `make setup` installs one."
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield running
        running.close()
