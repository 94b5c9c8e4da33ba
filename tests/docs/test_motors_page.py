# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/motors.md: modes that bimodal40 leaves out, its losses, and figure 6 of the paper, computed again."""

from __future__ import annotations

import json
import re
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor.load import changed_motor
from pyspice_runner.steady.speed_torque import held_point

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "motors.md").read_text(encoding="utf-8")
PAGE = " ".join(TEXT.split())

# --- modes that bimodal40 leaves out ---

TRUNCATION = run_path(str(DOCS / "bimodal40_truncation.py"))
ROWS: list[dict[str, Any]] = json.loads(TRUNCATION["FILE"].read_text())


def test_the_page_has_the_table_of_the_record() -> None:
    assert TRUNCATION["table"](ROWS) in TEXT


@pytest.mark.parametrize("row", [ROWS[0], *(pytest.param(row, marks=pytest.mark.soak) for row in ROWS[1:])])
def test_a_row_of_the_table_is_what_the_motor_does(row: dict[str, Any]) -> None:
    """Steady states have an error of about 1e-4 of the stall force; the record has three decimals of 4 N."""
    motor = changed_motor(TRUNCATION["NAME"], {"solid.highest_hz": row["highest_hz"]})
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    assert len(motor.modes) == row["modes"]
    for name in ("as_it_is", "tuned"):
        found = TRUNCATION["curve"](motor, drive.updated({"frequency": row[name]["frequency_hz"]}))
        assert found["force_n"] == pytest.approx(row[name]["force_n"], abs=2e-3)
        assert found["efficiency"] == pytest.approx(row[name]["efficiency"], abs=5e-4)


# --- losses ---

LOSSES = run_path(str(DOCS / "losses.py"))
MOTOR = pr.load_motor("bimodal40")


@pytest.mark.parametrize("effect", ["as in the set", "sliding friction 0.8 of static, above 50 mm/s"])
def test_a_stall_torque_of_the_page_is_what_the_motor_gives(effect: str) -> None:
    (torque,) = re.findall(rf"^\|{effect}\|([\d.]+)\|", TEXT, re.M)
    changes = LOSSES["effects"](MOTOR)[effect]
    point = held_point(MOTOR.updated(changes) if changes else MOTOR, pr.default_drive(MOTOR), speed=0.0)
    assert 1e3 * point["torque_n_m"] == pytest.approx(float(torque), abs=0.2)  # 0.2 % of the friction torque


def test_a_square_wave_loses_what_a_constant_loss_tangent_says() -> None:
    """Every harmonic of V_n volts loses half of V_n^2 times its susceptance times the loss tangent, within 5 %."""
    order = np.arange(1, 250, 2)
    expected = 0.5 * (440.0 / (np.pi * order)) ** 2 * 2.0 * np.pi * 40e3 * order * MOTOR.piezo.capacitance_a_f * 0.01
    found = LOSSES["square_wave_loss"](MOTOR, 110.0, 40e3)
    assert found["ladder"][1] == pytest.approx(expected.sum(), rel=0.05)
    assert found["resistance in series"][1] > 5.0 * expected.sum()
    assert found["resistance in parallel"][1] < 0.5 * expected.sum()
    assert "{:.1f} times the dielectric loss".format(found["ladder"][1] / found["ladder"][0]) in TEXT


# --- figure 6 of the paper, on the sprung mount ---

RECORD = json.loads((DOCS / "figure_6_search.json").read_text(encoding="utf-8"))
SEARCH = run_path(str(DOCS / "figure_6_search.py"))
BOX, CURVES, DRAWN, VOLTAGE, changes = (SEARCH[name] for name in ("BOX", "CURVES", "DRAWN", "VOLTAGE", "changes"))
SET = pr.load_motor("andersen2002-unintended-mode")


def curve(motor: pr.Motor, name: str, speeds: tuple[float, ...]) -> np.ndarray:
    drive = pr.TwoPhaseDrive(voltage=VOLTAGE, frequency=CURVES[name], phase_deg=180.0)
    return pr.speed_torque(motor, drive, speeds=speeds)["load_torque_n_m"].to_numpy()


@pytest.mark.xdist_group("paper")
def test_the_package_confirms_the_orders_of_the_best_mode() -> None:
    best = RECORD["best"]["on the mount"]
    assert RECORD["best"]["changes"] == changes(best["point"])
    motor = SET.updated(RECORD["best"]["changes"])
    slow, fast = best["speed_high_torque_rad_s"], best["speed_high_speed_rad_s"]
    high_torque, high_speed = (curve(motor, name, (0.0, slow, fast)) for name in CURVES)
    assert high_torque[0] > 1.3 * high_speed[0] > 0.0
    # where the independent integrator found that the one no longer turns, the other still pushes
    assert high_torque[2] < 0.0 < high_speed[1]
    for ours, name in ((high_torque, "stall_high_torque_n_m"), (high_speed, "stall_high_speed_n_m")):
        assert ours[0] == pytest.approx(best[name], rel=5e-3)  # measured 5e-4


@pytest.mark.xdist_group("paper")
def test_on_the_mount_the_bundled_mode_keeps_one_order_only() -> None:
    found = RECORD["set"]["on the mount"]
    stalls = [float(curve(SET, name, (0.0,))[0]) for name in CURVES]
    assert stalls == pytest.approx([found["stall_high_torque_n_m"], found["stall_high_speed_n_m"]], rel=5e-3)
    assert f"{1e3 * stalls[0]:.1f} against {1e3 * stalls[1]:.1f} mN·m" in PAGE
    assert f"{found['speed_high_torque_rad_s']:.1f} against {found['speed_high_speed_rad_s']:.1f} rad/s" in " ".join(
        TEXT.split()
    )
    assert found["speed_high_speed_rad_s"] < found["speed_high_torque_rad_s"]
