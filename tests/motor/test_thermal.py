# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat balance of a motor's stator."""

import pytest

import pyspice_runner as pr
from pyspice_runner.motor.thermal import heat_capacity_of_boxes
from tests.motors import BEAM40


def test_a_motor_heats_by_its_own_resistance_and_capacity() -> None:
    """Steel of 470 and ceramic of 440 J/(kg K); the unintended mode has no beam, and keeps the default capacity."""
    assert pr.Thermal.of(pr.load_motor("andersen2002")).heat_capacity_j_per_k == pytest.approx(2.1, rel=0.02)
    plate = 41e-3 * 11.8e-3 * 3e-3 * 7500.0 * 440.0 + 2e-3 * 4e-3 * 3e-3 * 3900.0 * 880.0  # with its tip of alumina
    assert pr.Thermal.of(pr.load_motor("bimodal40")).heat_capacity_j_per_k == pytest.approx(plate)
    small = pr.Thermal.of(pr.load_motor(BEAM40))
    assert small.thermal_resistance_k_per_w == 60.0
    assert small.time_constant == pytest.approx(60.0 * small.heat_capacity_j_per_k)
    assert pr.Thermal.of(pr.load_motor("andersen2002-unintended-mode")) == pr.Thermal()
    assert pr.Thermal.of(pr.load_motor(BEAM40).updated({"limits": None})).thermal_resistance_k_per_w == 100.0


def test_boxes_that_overlap_count_once() -> None:
    """A tip of alumina that reaches into the plate displaces its ceramic: the later box counts."""
    solid = pr.load_motor("bimodal40").solid
    plate = solid.boxes[0]
    low, high = plate.corners
    corner = tuple(0.5 * (a + b) for a, b in zip(low, high, strict=True))
    inner = solid.boxes[1].model_copy(update={"from_m": low, "to_m": corner})
    both = solid.model_copy(update={"boxes": (plate, inner)})
    ceramic = heat_capacity_of_boxes(solid.model_copy(update={"boxes": (plate,)}))
    alumina = heat_capacity_of_boxes(solid.model_copy(update={"boxes": (inner,)}))
    assert heat_capacity_of_boxes(both) == pytest.approx(7.0 / 8.0 * ceramic + alumina)
