# SPDX-License-Identifier: GPL-3.0-or-later
"""A ring by finite elements of one wave, against the theory of plates."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.motor.ring import Wave, ring_cautions, wave_of_plate
from pyspice_runner.motor.solid.wave import wave_of_solid
from tests.motor.test_ring import ring
from tests.selection import mostly

BARE: dict[str, Any] = {"teeth": 0, "tooth_height_m": 0.0}
RINGS: dict[str, dict[str, Any]] = {
    "`ring60`": {}, "no teeth": BARE, "no teeth, metal 1 mm": BARE | {"thickness_m": 1e-3},
    "no teeth, metal 6 mm": BARE | {"thickness_m": 6e-3},
    "no teeth, metal 1 mm, ceramic 2 mm": BARE | {"ceramic_thickness_m": 2e-3, "thickness_m": 1e-3},
    "teeth of 1 mm": {"tooth_height_m": 1e-3}, "teeth of 3 mm": {"tooth_height_m": 3e-3},
    "teeth fill 60 %": {"tooth_share": 0.6}, "steel": {"material": "steel"},
    "four waves": {"waves": 4, "waves_a": 1.5, "waves_b": 1.5},
}  # fmt: skip
PAGE = (Path(__file__).parents[3] / "docs" / "ring.md").read_text(encoding="utf-8")
OTHERS = [
    BARE | {"thickness_m": 0.5e-3, "inner_radius_m": 0.0285}, BARE | {"inner_radius_m": 0.012},
    {"material": "steel", "thickness_m": 2e-3},
]  # fmt: skip
KINDS = ("frequency_hz", "mass_kg", "force_n_per_v", "lever")
SOON = ["no teeth", "no teeth, metal 1 mm"]  # others take up to 15 s


def row(name: str, one: Wave, other: Wave) -> str:
    """Return the row of the page for a ring."""
    errors = [round(100.0 * (getattr(one, kind) / getattr(other, kind) - 1.0), 1) + 0.0 for kind in KINDS]
    first = f"|{name}|{1e-3 * one.frequency_hz:.2f}|{1e-3 * other.frequency_hz:.2f}|"
    return first + "".join(f"{error:.1f} %|".replace("-", "−") for error in errors)


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, list(RINGS), SOON))
def test_a_row_of_the_page_is_what_theory_and_finite_elements_give(name: str) -> None:
    one = ring(**RINGS[name])
    assert not ring_cautions(one)
    assert row(name, wave_of_plate(one), wave_of_solid(one)) in PAGE.splitlines()


def test_the_page_has_a_row_within_2_per_cent_for_each_ring() -> None:
    table = dict(re.findall(r"^\|([^|]+)\|([\d.]+\|[\d.]+)\|", PAGE, re.M))
    assert list(table) == list(RINGS)
    for name, values in table.items():
        plate, solid = map(float, values.split("|"))
        assert f"{1e-3 * wave_of_plate(ring(**RINGS[name])).frequency_hz:.2f}" == f"{plate:.2f}"
        assert plate == pytest.approx(solid, rel=0.02)


@pytest.mark.parametrize("changes", mostly(pytest.mark.soak, OTHERS, OTHERS[:1]))
def test_within_its_limits_the_plate_has_the_modes_of_finite_elements(changes: dict[str, Any]) -> None:
    one = ring(**changes)
    assert not ring_cautions(one)
    plate, solid = wave_of_plate(one), wave_of_solid(one)
    assert plate.frequency_hz == pytest.approx(solid.frequency_hz, rel=0.02)
    for kind in KINDS[1:]:  # the motion at the teeth, and with it the mass and the force per motion, is less exact
        assert getattr(plate, kind) == pytest.approx(getattr(solid, kind), rel=0.10)


def test_finite_elements_of_one_wave_need_the_same_teeth_on_each() -> None:
    with pytest.raises(pr.ParameterError, match=r"ring.teeth = 70 must be a multiple of ring.waves = 9"):
        wave_of_solid(ring(teeth=70))
