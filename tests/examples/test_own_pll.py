# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop of one's own around an exported motor, in ngspice alone, against ``track``."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import pyspice_runner as pr

DECK = Path(__file__).resolve().parents[2] / "examples" / "own_pll.cir"


def test_a_loop_of_b_sources_around_an_exported_motor_locks_where_track_does(tmp_path: Path) -> None:
    motor, text = pr.load_motor("bimodal40"), DECK.read_text(encoding="utf-8")
    header = pr.export_motor(motor, tmp_path / "motor.lib").read_text(encoding="utf-8").partition(".subckt")[0]
    copy, alone = (float(re.search(rf"{name} = ?([\d.]+) nF|$", header)[1]) for name in (r"C \+ C_AB", "C - C_AB"))
    assert copy + alone == pytest.approx(2.0 * float(re.search(r"C of A ([\d.]+) nF", header)[1]), abs=0.002)
    assert f".param copy={copy:g}n " in text  # C + C_AB
    shutil.copy(DECK, tmp_path)
    done = subprocess.run(
        ["ngspice", "-b", DECK.name], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=120
    )
    found = {name: float(value) for name, value in re.findall(r"^(\w+) += +(\S+)", done.stdout, re.M)}
    assert found["check"] == 0.0
    assert abs(found["detector_v"]) < 0.01  # within 1°: 2/π V per radian
    page = (DECK.parents[1] / "docs" / "tracking.md").read_text(encoding="utf-8")
    assert f"locks\nat {1e-3 * found['frequency_hz']:.3f} kHz" in page
    tracker = pr.Tracker(kind="pll", voltage=60.0, frequency=40.6e3, target_deg=-30.0)
    tracked = pr.track(
        motor.updated({"rotor.inertia_kg_m2": 1e-6}), tracker, disturb="start", duration=12e-3, margin=False
    )
    assert tracked.locked
    assert found["frequency_hz"] == pytest.approx(tracked.end_frequency_hz, abs=10.0)  # 2° of 390 Hz a radian
    assert found["speed_rad_s"] == pytest.approx(tracked.speed_after_rad_s, rel=0.05)
