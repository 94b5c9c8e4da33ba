# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor demo`` and ``engine``."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pyspice_runner.cli import run
from pyspice_runner.commands import first


def test_the_demo_runs_its_scripts_and_prints_one_json_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other.py").write_text("def draw(folder):\n    print('drawn')\n    return [folder.name]\n")
    (tmp_path / "demo.py").write_text("import other\ndraw = other.draw\n")
    monkeypatch.setattr(first, "data_path", lambda _: tmp_path)
    assert run(["demo", "--output", str(tmp_path / "made"), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out) == {"folder": str(tmp_path / "made"), "results": ["made"]}
    assert said.err.startswith("drawn")


def test_the_engine_in_use_is_shown(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("PIEZOMOTOR_ENGINE", "wasm")
    assert run(["engine", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"ngspice": "45.2 (WebAssembly)"}
    assert run(["engine", "--from", "engine.tgz"]) == 2
    assert "--from has no effect without install" in capsys.readouterr().err
