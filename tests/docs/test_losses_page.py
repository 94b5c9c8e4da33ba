# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of docs/losses.md are measured again."""

from __future__ import annotations

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.steady.speed_torque import held_point

PAGE = Path(__file__).parents[2] / "docs" / "losses.md"
CHANGES = {
    "as in the set": {},
    "sliding friction 0.8 of static, over 50 mm/s": {
        "contact.sliding_ratio": 0.8,
        "contact.stribeck_velocity_m_s": 0.05,
    },
}


@pytest.mark.parametrize("effect", CHANGES)
def test_a_stall_torque_of_the_page_is_what_the_motor_gives(effect: str) -> None:
    motor = pr.load_motor("andersen2002-unintended-mode")
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
    text = PAGE.read_text(encoding="utf-8")
    section = text[text.index("46 kHz") :]
    row = next(line for line in section.splitlines() if line.startswith(f"| {effect} |"))
    changes = CHANGES[effect]
    point = held_point(motor.updated(changes) if changes else motor, drive, speed=0.0)
    # two digits behind the point are printed; the steady state is found to 0.2 % of the friction torque
    assert 1e3 * point["torque_n_m"] == pytest.approx(float(row.split("|")[2]), abs=0.04)


def test_a_square_wave_loses_what_a_constant_loss_tangent_says() -> None:
    """Every harmonic of V_n volts loses half of V_n^2 times its susceptance times the loss tangent, within 5 %."""
    losses = run_path(str(PAGE.with_suffix(".py")))["square_wave_loss"]
    motor = pr.load_motor("bimodal40")
    order = np.arange(1, 250, 2)
    expected = 0.5 * (440.0 / (np.pi * order)) ** 2 * 2.0 * np.pi * 40e3 * order * motor.piezo.capacitance_a_f * 0.01
    found = losses(motor, 110.0, 40e3)
    assert found["ladder"][1] == pytest.approx(expected.sum(), rel=0.05)
    assert found["resistance in series"][1] > 5.0 * expected.sum()
    assert found["resistance in parallel"][1] < 0.5 * expected.sum()
