# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of docs/simulators.md, measured again. ``make verilog-a``."""

from __future__ import annotations

from pathlib import Path
from runpy import run_path

import pytest

from tests.docs.test_simulators_page import PAIRS, ROWS

SCRIPT = run_path(str(Path(__file__).parents[2] / "docs" / "simulators.py"))


@pytest.mark.parametrize("name", ["mostly slip", "opens, 10 kHz", "another motor"])
def test_a_point_of_the_page_is_what_is_measured(name: str) -> None:
    for run, told in zip(SCRIPT["runs"]().values(), PAIRS[name], strict=True):
        assert SCRIPT["errors"](name, run(name)) == pytest.approx(told, rel=0.1, abs=0.02)


def test_the_admittances_of_the_page_are_what_is_measured() -> None:
    told = [float(cell) for cell in ROWS["beam40"]]
    assert SCRIPT["deviations"]("beam40") == pytest.approx(told, rel=0.2)
