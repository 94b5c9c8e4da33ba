# SPDX-License-Identifier: GPL-3.0-or-later
"""The current scan of an Elliptec module, in the shape that its serial port sends."""

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.elliptec import read_current_scan
from pyspice_runner.calibration.points import read_points

PERIODS = [210 - number for number in range(87)]  # 70.2 to 118.9 kHz
COUNTS = [400 + round(1200 * np.exp(-(((number - 40) / 6.0) ** 2))) for number in range(87)]


def answer(motor: int = 1, points: int = 87) -> str:
    rows = zip(PERIODS[:points], COUNTS, strict=False)
    data = b"".join(period.to_bytes(2, "little") + count.to_bytes(4, "little") for period, count in rows)
    return f"0C{motor}{data.hex().upper()}"


def test_a_scan_gives_points_of_frequency_and_power(tmp_path: Path) -> None:
    log = tmp_path / "ell17.log"
    log.write_text(f"0GS00\r\n{answer()}\r\n0GS00\r\n", encoding="utf-8")
    found = read_current_scan(log, supply_v=5.0)
    # by the manual: period 0x00D2 = 210 is 14.74 MHz / 210 = 70190 Hz, and 1866 counts are 1 A
    assert found["frequency"][0] == pytest.approx(70190.476)
    assert found["power_w"][40] == pytest.approx(5.0 * 1600.0 / 1866.0)
    points = read_points(found)
    assert len(points) == 87
    assert points.conditions[0]["drive.frequency"] == pytest.approx(70190.476)


def test_a_scan_with_a_current_for_each_direction_is_told_by_its_numbers(tmp_path: Path) -> None:
    """The other driver's layout: period, forward and backward of two bytes each, the high byte first."""
    log = tmp_path / "ell14.log"
    rows = [(period, count, count // 2) for period, count in zip(PERIODS, COUNTS, strict=True)]
    log.write_text("0C1" + b"".join(one.to_bytes(2, "big") for row in rows for one in row).hex(), encoding="utf-8")
    forward, backward = read_current_scan(log), read_current_scan(log, backward=True)
    assert forward["frequency"] == backward["frequency"]
    assert forward["frequency"][0] == pytest.approx(70190.476)
    assert forward["power_w"][40] == pytest.approx(5.0 * 1600.0 / 1866.0)
    assert backward["power_w"][40] == pytest.approx(5.0 * 800.0 / 1866.0)
    log.write_text(answer(), encoding="utf-8")
    with pytest.raises(pr.ParameterError, match="has one current for each frequency"):
        read_current_scan(log, backward=True)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (answer(2), "has no answer C1"),
        (answer(points=86), "has 1032 digits; it must have 1044"),
        (answer()[:-12] + "FFFF01000000", "another layout"),
        (answer()[:-12] + "D200FFFFFF00", "another layout"),
        (answer()[:-12] + "00D200010000", "another layout"),
        ("0C1 not hexadecimal", "has no answer C1"),
    ],
)
def test_another_answer_is_refused(content: str, says: str, tmp_path: Path) -> None:
    log = tmp_path / "ell17.log"
    log.write_text(content, encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=says):
        read_current_scan(log)
