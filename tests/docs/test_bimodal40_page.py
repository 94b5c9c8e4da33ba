# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/motors.md: bimodal40 with the modes that the set leaves out."""

from __future__ import annotations

import json
from pathlib import Path
from runpy import run_path
from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.motor.load import changed_motor

DOCS = Path(__file__).parents[2] / "docs"
SCRIPT = run_path(str(DOCS / "bimodal40_truncation.py"))
ROWS: list[dict[str, Any]] = json.loads(SCRIPT["FILE"].read_text())


def test_the_page_has_the_table_of_the_record() -> None:
    assert SCRIPT["table"](ROWS) in (DOCS / "motors.md").read_text()


@pytest.mark.parametrize("row", [ROWS[0], *(pytest.param(row, marks=pytest.mark.soak) for row in ROWS[1:])])
def test_a_row_of_the_table_is_what_the_motor_does(row: dict[str, Any]) -> None:
    """Steady states have an error of about 1e-4 of the stall force; the record has three decimals of 4 N."""
    motor = changed_motor(SCRIPT["NAME"], {"solid.highest_hz": row["highest_hz"]})
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    assert len(motor.modes) == row["modes"]
    for name in ("as_it_is", "tuned"):
        found = SCRIPT["curve"](motor, drive.updated({"frequency": row[name]["frequency_hz"]}))
        assert found["force_n"] == pytest.approx(row[name]["force_n"], abs=2e-3)
        assert found["efficiency"] == pytest.approx(row[name]["efficiency"], abs=5e-4)
