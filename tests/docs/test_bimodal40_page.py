# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/bimodal40.md: the motor with the modes that the set leaves out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import pyspice_runner as pr
from docs.bimodal40_truncation import FILE, HIGHEST_HZ, NAME, curve, table
from pyspice_runner.motor.load import changed_motor

PAGE = Path("docs/bimodal40.md")


def test_the_page_has_the_table_of_the_record() -> None:
    assert table(json.loads(FILE.read_text())) in PAGE.read_text()


@pytest.mark.parametrize(
    "highest_hz", [HIGHEST_HZ[0], *(pytest.param(each, marks=pytest.mark.soak) for each in HIGHEST_HZ[1:])]
)
def test_a_row_of_the_table_is_what_the_motor_does(highest_hz: float) -> None:
    """Steady states have an error of about 1e-4 of the stall force; the record has three decimals of 4 N."""
    row = next(row for row in json.loads(FILE.read_text()) if row["highest_hz"] == highest_hz)
    motor = changed_motor(NAME, {"solid.highest_hz": highest_hz})
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    assert len(motor.modes) == row["modes"]
    for name in ("as_it_is", "tuned"):
        found = curve(motor, drive.updated({"frequency": row[name]["frequency_hz"]}))
        assert found["force_n"] == pytest.approx(row[name]["force_n"], abs=2e-3)
        assert found["efficiency"] == pytest.approx(row[name]["efficiency"], abs=5e-4)
