# SPDX-License-Identifier: GPL-3.0-or-later
"""A few of the inputs that `make fuzz` gives every door; and that the fuzzer sees what it looks for."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from tests.fuzz import watch
from tests.fuzz.__main__ import drawn, fault
from tests.fuzz.doors import DOORS, Door, warm

COUNT, SEED = 50, 7


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    warm()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "out"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "out"))
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


@pytest.mark.parametrize("door", DOORS.values(), ids=lambda door: door.name)
def test_every_door_takes_an_input_or_refuses_it_clearly(door: Door, folder: Path) -> None:
    for number in range(round(COUNT * door.share)):
        _, words = fault(door, drawn(door, SEED, number), folder)
        assert words is None, (
            f"python -m tests.fuzz --door {door.name} --seed {SEED} --first {number} --count 1\n{words}"
        )


def _sleep() -> None:
    time.sleep(10.0)


def _eat() -> None:
    np.zeros(2**30)


def _warn() -> None:
    warnings.warn("careful", stacklevel=1)


def _start() -> None:
    subprocess.run([sys.executable, "-c", ""], check=False)


def _write() -> None:
    Path("../stray").write_text("", encoding="utf-8")


def _remove() -> None:
    os.remove("../precious")  # noqa: PTH107


def _swallow() -> None:
    with contextlib.suppress(Exception):  # as careless code does
        _write()


def _mumble() -> None:
    raise pr.ParameterError("no")


def _crash() -> None:
    raise KeyError("x")


@pytest.mark.parametrize("deed", [_sleep, _eat, _warn, _start, _write, _remove, _swallow, _mumble, _crash])
def test_it_sees_what_an_input_must_not_bring_about(
    deed: Callable[[], None], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch, "MOST_SECONDS", 0.2)
    (folder.parent / "precious").touch()
    taken, words = fault(Door("bad", lambda rng: rng, lambda _, __: deed()), None, folder)
    assert not taken
    assert words is not None
    assert sorted(path.name for path in folder.parent.iterdir()) == ["out", "precious"]


def test_an_input_is_the_same_each_time() -> None:
    for door in DOORS.values():
        assert repr(drawn(door, 1, 2))[:5000] == repr(drawn(door, 1, 2))[:5000]
