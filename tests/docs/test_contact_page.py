# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors of the brush on docs/contact.md are recomputed; the motor's table in test_contact_laws.py."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.selection import mostly
from tests.tools.test_hysteresis import loss, worst_force, worst_loss
from tests.validation.test_impact import worst
from tools.benches.traction import microslip_loss

pytestmark = pytest.mark.xdist_group("impact")

PAGE = re.sub(r"\s+", " ", (Path(__file__).parents[2] / "docs" / "contact.md").read_text(encoding="utf-8"))


@pytest.mark.parametrize("sliders", mostly(pytest.mark.soak, [4, 8, 16], [4]))
def test_errors_by_the_number_of_sliders(sliders: int) -> None:
    found = (
        f"{100 * worst_force(sliders):.2f} % | {100 * worst_loss(sliders):.2f} % | {worst('brush', 0.0, sliders):.4f} |"
    )
    assert f"| {sliders} | {found}" in PAGE


@pytest.mark.soak
def test_loss_at_an_amplitude_relative_to_itself() -> None:
    def off(amplitude: float, sliders: int) -> float:
        return loss("brush", amplitude, sliders) / float(microslip_loss(amplitude)) - 1.0

    assert "within 6 % from half of $u_{\\lim}$ on" in PAGE
    assert max(abs(off(amplitude, 8)) for amplitude in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)) == pytest.approx(0.06, abs=0.005)
    assert "71 % too high at a fifth" in PAGE
    assert off(0.2, 8) == pytest.approx(0.71, abs=0.01)
    assert "nothing below an eighth" in PAGE
    assert off(0.11, 8) == pytest.approx(-1.0, abs=1e-3)
    assert "32 are within 2 % from 0.3 $u_{\\lim}$ on" in PAGE
    assert all(abs(off(amplitude, 32)) < 0.02 for amplitude in (0.3, 0.5))
