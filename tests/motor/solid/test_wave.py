# SPDX-License-Identifier: GPL-3.0-or-later
"""A ring by finite elements of one wave, against the theory of plates."""

from __future__ import annotations

from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.motor.ring import ring_cautions, wave_of_plate
from pyspice_runner.motor.solid.wave import wave_of_solid
from tests.motor.test_ring import ring

BARE: dict[str, Any] = {"teeth": 0, "tooth_height_m": 0.0}


SOON: list[dict[str, Any]] = [
    {},
    BARE | {"thickness_m": 0.5e-3, "inner_radius_m": 0.0285},
    BARE | {"ceramic_thickness_m": 2e-3, "thickness_m": 1e-3},
]
LATE = [
    BARE | {"thickness_m": 6e-3}, BARE | {"inner_radius_m": 0.012}, {"waves": 4, "waves_a": 1.5, "waves_b": 1.5},
    {"material": "steel", "thickness_m": 2e-3}, {"tooth_height_m": 1e-3}, {"tooth_share": 0.6},
]  # fmt: skip


@pytest.mark.parametrize("changes", [*SOON, *(pytest.param(each, marks=pytest.mark.soak) for each in LATE)])
def test_within_its_limits_the_plate_has_the_modes_of_finite_elements(changes: dict[str, Any]) -> None:
    one = ring(**changes)
    assert not ring_cautions(one)
    plate, solid = wave_of_plate(one), wave_of_solid(one)
    assert plate.frequency_hz == pytest.approx(solid.frequency_hz, rel=0.02)
    # docs/ring.md: the motion at the teeth, and with it the mass and the force per motion there, is less exact
    assert plate.mass_kg == pytest.approx(solid.mass_kg, rel=0.10)
    assert plate.force_n_per_v == pytest.approx(solid.force_n_per_v, rel=0.10)
    assert plate.lever == pytest.approx(solid.lever, rel=0.10)


def test_finite_elements_of_one_wave_need_the_same_teeth_on_each() -> None:
    with pytest.raises(pr.ParameterError, match=r"ring.teeth = 70 must be a multiple of ring.waves = 9"):
        wave_of_solid(ring(teeth=70))
