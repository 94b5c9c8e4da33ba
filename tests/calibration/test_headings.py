# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed–force tables as papers and data sheets print them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.points import read_points


def test_a_speed_force_table_of_a_stage_is_read_in_its_units(tmp_path: Path) -> None:
    table = tmp_path / "stage.csv"
    table.write_text("Voltage (Vrms);Force [mN];Speed / mm/s\n80;0;300\n80;2000;150\n80;4000;0\n", encoding="utf-8")
    points = read_points(table, motor_is_linear=True)
    assert [there["load.speed"] for there in points.conditions] == pytest.approx([0.3, 0.15, 0.0])
    assert points.conditions[0]["drive.voltage"] == pytest.approx(80.0 * np.sqrt(2.0))
    assert set(points.quantities) == {"torque_n_m"}  # of the rotor of 1 m that stands for a slider: N
    assert points.values == pytest.approx([0.0, 2.0, 4.0])
    assert not points.errors_given


def test_a_speed_torque_table_of_a_motor_is_read_in_its_units(tmp_path: Path) -> None:
    table = tmp_path / "motor.csv"
    table.write_text("Output speed (rpm),Load torque (mN·m),Input power [mW]\n60,1.5,900\n30,3,\n", encoding="utf-8")
    points = read_points(table)
    assert [there["load.speed"] for there in points.conditions] == pytest.approx([2.0 * np.pi, np.pi])
    measured = dict(zip(zip(points.rows, points.quantities, strict=True), points.values, strict=True))
    assert measured == pytest.approx({(0, "torque_n_m"): 1.5e-3, (1, "torque_n_m"): 3e-3, (0, "power_w"): 0.9})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Speed (furlongs),Force (N)\n1,2\n", "there is no column"),
        ("Speed (mm/s),Velocity (m/s),Force (N)\n1,2,3\n", "second column of speed_m_s"),
        ("Speed (mm/s),Force (N)\n1,2\n", "there is no column"),  # of a rotor
    ],
)
def test_a_heading_that_means_nothing_here_is_refused(text: str, says: str, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=says):
        read_points(table)
