# SPDX-License-Identifier: GPL-3.0-or-later
"""The table on docs/speed_torque.md of what reverses the motor, measured again."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pyspice_runner as pr
from tests.runs import simulated

PAGE = (Path(__file__).parents[2] / "docs" / "speed_torque.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (\d+) kHz \| [^|]+ \| (\S+) \| (\S+) \|$", PAGE, re.M)
MOTOR = pr.load_motor("andersen2002").updated({"mount": None})


def torque_m_n_m(frequency_hz: float, phase_deg: float) -> float:
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=frequency_hz, phase_deg=phase_deg)
    return 1e3 * simulated(MOTOR, drive, duration=5e-3, speed=0.0, audit=False).mean_torque_n_m


@pytest.mark.soak
@pytest.mark.parametrize(
    "row",
    [pytest.param(row, marks=[] if row in ROWS[1:3] else pytest.mark.soak) for row in ROWS],  # between the resonances
    ids=[f"{row[0]} kHz" for row in ROWS],
)
def test_phase_and_resonance_reverse_the_motor(row: tuple[str, str, str]) -> None:
    for phase, printed in ((90.0, row[1]), (-90.0, row[2])):
        value = float(printed.replace("−", "-"))
        # three digits are printed; both phases differ by up to 0.4 % after 5 ms, since the start is not symmetric
        assert torque_m_n_m(1e3 * float(row[0]), phase) == pytest.approx(value, rel=0.01)


def test_the_table_has_both_sides_of_two_resonances() -> None:
    signs = [[cell.startswith("−") for cell in row[1:]] for row in ROWS]
    assert signs == [[False, True], [True, False], [True, False], [False, True]]
