# SPDX-License-Identifier: GPL-3.0-or-later
"""Several stators on one shaft, several tips on one stator, and a loop of one's own around an exported motor."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from tests.circuit.batch import batch, results

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(EXAMPLES / "several_motors.py"))


@pytest.mark.soak
@pytest.mark.parametrize(
    ("deck", "which", "fastest"), [("three_stators", "DISC", 70.0), ("four_elements", "SLIDER", 1.0)]
)
def test_stators_on_one_shaft_run_as_their_curves_say(example, deck, which, fastest, tmp_path):
    name, preloads, *_ = example[which]
    pr.export_motor(pr.load_motor(name), tmp_path / "motor.lib")
    text = (EXAMPLES / f"{deck}.cir").read_text(encoding="utf-8")
    assert [float(one) for one in re.findall(r"preload=(\S+)", text)] == list(preloads)
    found = results(batch(tmp_path / "deck.cir", text))
    speed, forces = example["shared_speed"](*example[which], np.linspace(0.0, fastest, 15))
    assert found["check"] == 0.0
    assert found["speed"] == pytest.approx(speed, rel=0.015)  # straight lines between the points of the curves
    lever = pr.load_motor(name).rotor.radius_m
    shares = [lever * found[f"friction_{number}"] for number in range(1, len(forces) + 1)]
    assert shares == pytest.approx(forces, abs=0.06 * max(forces))  # where a curve is steep


def test_a_tip_that_stands_back_leaves_its_preload_to_the_other(example):
    motor = pr.load_motor(EXAMPLES / "two_tips.toml")
    drive, cases = pr.default_drive(motor), example["CASES"]
    whole, back = (example["tips"](motor.updated(cases[one]), drive) for one in ("as built", "left 0.3 um lower"))
    assert back["left N"] < whole["left N"] - 0.5
    for one in (whole, back):
        assert one["left N"] + one["right N"] == pytest.approx(motor.contact.preload_n, rel=0.01)
    assert abs(whole["phase deg"]) > 5.0  # the bending modes move the tips in opposite directions


# --- a loop of one's own around an exported motor, in ngspice alone ---


ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.soak
def test_a_loop_of_b_sources_around_an_exported_motor_locks_where_track_does(tmp_path: Path) -> None:
    motor, text = pr.load_motor("bimodal40"), (ROOT / "examples/own_pll.cir").read_text(encoding="utf-8")
    header = pr.export_motor(motor, tmp_path / "motor.lib").read_text(encoding="utf-8").partition(".subckt")[0]
    assert f".param copy={re.findall(r'C . C_AB = ([0-9.]+) nF', header)[0]}n " in text
    found = results(batch(tmp_path / "deck.cir", text))
    assert found["check"] == 0.0
    assert f"locks\nat {1e-3 * found['frequency_hz']:.3f} kHz" in (ROOT / "docs/tracking.md").read_text("utf-8")
    tracker = pr.Tracker(kind="pll", voltage=60.0, frequency=40.6e3, target_deg=-30.0)
    tracked = pr.track(motor.updated({"rotor.inertia_kg_m2": 1e-6}), tracker, duration=12e-3, margin=False)
    assert tracked.locked
    assert found["frequency_hz"] == pytest.approx(tracked.end_frequency_hz, abs=10.0)  # 1.5° at 390 Hz a radian
    assert found["speed_rad_s"] == pytest.approx(tracked.speed_after_rad_s, rel=0.05)
