# SPDX-License-Identifier: GPL-3.0-or-later
"""A few of the inputs of `make fuzz` for every entry point; the fuzzer detects each kind of failure."""

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
from tests.selection import mostly
from validation.fuzz import watch
from validation.fuzz.__main__ import drawn, fault
from validation.fuzz.entry_points import ENTRY_POINTS, EntryPoint, warm

COUNT, SEED = 20, 7

sys.dont_write_bytecode = True  # the watch refuses the file of a module that an input is the first to import


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    warm()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "out"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "out"))
    (tmp_path / "out").mkdir()
    return tmp_path / "out"


@pytest.mark.parametrize(
    "entry_point",
    mostly(pytest.mark.fuzz, ENTRY_POINTS.values(), [one for name, one in ENTRY_POINTS.items() if name != "fit"]),
    ids=lambda entry_point: entry_point.name,
)
def test_every_entry_point_accepts_an_input_or_rejects_it_clearly(entry_point: EntryPoint, folder: Path) -> None:
    for number in range(round(COUNT * entry_point.share)):
        _, words = fault(entry_point, drawn(entry_point, SEED, number), folder)
        assert words is None, (
            f"python -m validation.fuzz --entry-point {entry_point.name} --seed {SEED} --first {number} --count 1\n"
            f"{words}"
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
def test_the_fuzzer_detects_what_an_input_must_not_cause(
    deed: Callable[[], None], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch, "MOST_SECONDS", 0.2)
    (folder.parent / "precious").touch()
    taken, words = fault(EntryPoint("bad", lambda rng: rng, lambda _, __: deed()), None, folder)
    assert not taken
    assert words is not None
    assert sorted(path.name for path in folder.parent.iterdir()) == ["out", "precious"]


def test_the_same_seed_gives_the_same_input() -> None:
    for entry_point in ENTRY_POINTS.values():
        assert repr(drawn(entry_point, 1, 2))[:5000] == repr(drawn(entry_point, 1, 2))[:5000]
