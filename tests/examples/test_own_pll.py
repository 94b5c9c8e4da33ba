# SPDX-License-Identifier: GPL-3.0-or-later
"""The loop of one's own around an exported motor, in ngspice alone, against ``track``."""

import re
import subprocess
from pathlib import Path

import pytest

import pyspice_runner as pr

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.soak
def test_a_loop_of_b_sources_around_an_exported_motor_locks_where_track_does(tmp_path: Path) -> None:
    motor, text = pr.load_motor("bimodal40"), (ROOT / "examples/own_pll.cir").read_text(encoding="utf-8")
    header = pr.export_motor(motor, tmp_path / "motor.lib").read_text(encoding="utf-8").partition(".subckt")[0]
    assert f".param copy={re.findall(r'C . C_AB = ([0-9.]+) nF', header)[0]}n " in text
    done = subprocess.run(["ngspice", "-b"], input=text, cwd=tmp_path, capture_output=True, text=True, check=True)
    found = {name: float(value) for name, value in re.findall(r"^(\w+) += +(\S+)", done.stdout, re.M)}
    assert found["check"] == 0.0
    assert f"locks\nat {1e-3 * found['frequency_hz']:.3f} kHz" in (ROOT / "docs/tracking.md").read_text("utf-8")
    tracker = pr.Tracker(kind="pll", voltage=60.0, frequency=40.6e3, target_deg=-30.0)
    tracked = pr.track(motor.updated({"rotor.inertia_kg_m2": 1e-6}), tracker, duration=12e-3, margin=False)
    assert tracked.locked
    assert found["frequency_hz"] == pytest.approx(tracked.end_frequency_hz, abs=10.0)  # 1.5° at 390 Hz a radian
    assert found["speed_rad_s"] == pytest.approx(tracked.speed_after_rad_s, rel=0.05)
