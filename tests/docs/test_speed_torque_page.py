# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of docs/speed_torque.md, computed again."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pyspice_runner as pr

PAGE = (Path(__file__).parents[2] / "docs" / "speed_torque.md").read_text(encoding="utf-8")
MOTOR = pr.load_motor("bimodal40")


def rows(header: str) -> list[list[float]]:
    """Return the numbers of the table below a header that begins with these words."""
    (table,) = re.findall(rf"^\| ?{header}.*\n\|[-|]+\|\n((?:\|.*\n)+)", PAGE, re.M)
    lines = table.replace("−", "-").splitlines()
    return [[float(re.findall(r"-?[\d.]+", cell)[0]) for cell in line.strip("|").split("|")] for line in lines]


@pytest.mark.parametrize(
    "row", [pytest.param(row, marks=[pytest.mark.soak] * (row[0] != 40.4)) for row in rows("frequency")]
)
def test_phase_and_resonance_reverse_the_motor(row: list[float]) -> None:
    for phase, printed in ((90.0, row[1]), (-90.0, row[2])):
        drive = pr.TwoPhaseDrive(voltage=100.0, frequency=1e3 * row[0], phase_deg=phase)
        assert 1e3 * pr.steady_state(MOTOR, drive, speed=0.0).torque_n_m == pytest.approx(printed, abs=0.06)


@pytest.mark.soak
@pytest.mark.parametrize(("header", "axis"), [("preload", "contact.preload_n"), ("voltage", "drive.voltage")])
def test_preload_and_voltage(header: str, axis: str) -> None:
    table = rows(header)
    found = pr.speed_torque(
        MOTOR, pr.default_drive(MOTOR), speeds=[0.0, 20.0, 30.0], over={axis: [row[0] for row in table]}, audit=False
    )
    for row, torques, efficiencies in zip(table, found["torque_n_m"].values, found["efficiency"].values, strict=True):
        assert row[1:4] == pytest.approx(1e3 * torques, abs=0.06)
        assert row[4:] == pytest.approx(100.0 * efficiencies[-1:][: len(row[4:])], abs=0.06)
