# SPDX-License-Identifier: GPL-3.0-or-later
"""The effects of losses in docs/motors.md are computed again."""

from __future__ import annotations

import re
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.steady.speed_torque import held_point

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "motors.md").read_text(encoding="utf-8")
SCRIPT = run_path(str(DOCS / "losses.py"))
MOTOR = pr.load_motor("bimodal40")


@pytest.mark.parametrize("effect", ["as in the set", "sliding friction 0.8 of static, above 50 mm/s"])
def test_a_stall_torque_of_the_page_is_what_the_motor_gives(effect: str) -> None:
    (torque,) = re.findall(rf"^\|{effect}\|([\d.]+)\|", TEXT, re.M)
    changes = SCRIPT["effects"](MOTOR)[effect]
    point = held_point(MOTOR.updated(changes) if changes else MOTOR, pr.default_drive(MOTOR), speed=0.0)
    assert 1e3 * point["torque_n_m"] == pytest.approx(float(torque), abs=0.2)  # 0.2 % of the friction torque


def test_a_square_wave_loses_what_a_constant_loss_tangent_says() -> None:
    """Every harmonic of V_n volts loses half of V_n^2 times its susceptance times the loss tangent, within 5 %."""
    order = np.arange(1, 250, 2)
    expected = 0.5 * (440.0 / (np.pi * order)) ** 2 * 2.0 * np.pi * 40e3 * order * MOTOR.piezo.capacitance_a_f * 0.01
    found = SCRIPT["square_wave_loss"](MOTOR, 110.0, 40e3)
    assert found["ladder"][1] == pytest.approx(expected.sum(), rel=0.05)
    assert found["resistance in series"][1] > 5.0 * expected.sum()
    assert found["resistance in parallel"][1] < 0.5 * expected.sum()
    assert (
        "{:.1f} times the dielectric loss".format(found["ladder"][1] / found["ladder"][0])
        in (DOCS / "motors.md").read_text()
    )
