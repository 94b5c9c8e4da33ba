# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/parameters.md is what docs/generate.py writes today, and leaves no parameter out."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.motor import parameters
from pyspice_runner.motor.load import Arm
from pyspice_runner.motor.materials import Materials
from pyspice_runner.motor.parameters import Parameters

DOCS = Path(__file__).parents[2] / "docs"
KINDS = [kind for kind in vars(parameters).values() if isinstance(kind, type) and issubclass(kind, Parameters)]


@pytest.fixture(scope="module")
def pages() -> dict[str, str]:
    written: dict[str, str] = runpy.run_path(str(DOCS / "generate.py"))["pages"]()
    return written


def test_pages_are_fresh(pages: dict[str, str]) -> None:
    for name, text in pages.items():
        stale = (DOCS / name).read_text(encoding="utf-8") != text
        assert not stale, f"docs/{name} is stale: run `python docs/generate.py` and commit it with the change"


@pytest.mark.parametrize("kind", [*KINDS, Arm, Materials], ids=lambda kind: kind.__name__)
def test_every_parameter_has_a_line(kind: type[Parameters], pages: dict[str, str]) -> None:
    lines = pages["parameters.md"].splitlines()
    for name, field in kind.model_fields.items():
        assert any(f".{name}`|" in line and f"|{field.description}" in line for line in lines), name


def test_every_value_of_the_set_has_an_origin() -> None:
    for path, origin in pr.load_motor("andersen2002").provenance.items():
        assert origin.kind in ("given", "derived", "assumed", "default") or not origin.note
        if not origin.note:
            assert path == "name" or path.endswith((".group", ".faces", ".kind")), f"{path} has no origin"
