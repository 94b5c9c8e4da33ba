# SPDX-License-Identifier: GPL-3.0-or-later
"""The clamped capacitances of solids, against the closed form of a gap by conformal mapping."""

from math import log, pi, sqrt, tanh
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pyspice_runner import load_motor
from pyspice_runner.motor.solid import stator
from pyspice_runner.motor.solid.materials import materials
from pyspice_runner.motor.solid.parameters import Solid, solid_from

LONG, WIDE = 0.04, 0.01


def _slab(gap_m: float, height_m: float, *, element_m: float = 2e-3, turned: bool = False) -> Solid:
    """Return a slab of PZT-4 above ground with groups A and B on its top, a gap between them."""
    order = (1, 0, 2) if turned else (0, 1, 2)

    def place(*corner: float) -> list[float]:
        return [corner[axis] for axis in order]

    def item(low: list[float], high: list[float], **others: Any) -> dict[str, Any]:
        return {"from_m": low, "to_m": high, **others}

    left, right = 0.5 * (LONG - gap_m), 0.5 * (LONG + gap_m)
    return solid_from({
        "theory": "solid", "element_m": element_m, "lowest_hz": 1e3, "highest_hz": 60e3, "quality_factor": 100.0,
        "contact": item(place(LONG, 0.0, 0.0), place(LONG, WIDE, height_m),
                        normal="+y" if turned else "+x", tangent="+z"),
        "boxes": [item(place(0.0, 0.0, 0.0), place(LONG, WIDE, height_m), material="PZT-4", polarisation="+z")],
        "electrodes": [
            item(place(0.0, 0.0, height_m), place(left, WIDE, height_m), group="A"),
            item(place(right, 0.0, height_m), place(LONG, WIDE, height_m), group="B"),
            item(place(0.0, 0.0, 0.0), place(LONG, WIDE, 0.0), group="ground"),
        ],
    }, "slab", Path())  # fmt: skip


@pytest.mark.parametrize(
    ("gap_m", "height_m", "turned"), [(0.5e-3, 3e-3, False), (0.2e-3, 3e-3, True), (2e-3, 1e-3, False)]
)
def test_the_capacitance_across_a_gap_is_the_closed_form(gap_m: float, height_m: float, turned: bool) -> None:
    """C' = (ε/π) ln coth(π g/(4 h)) per length of the gap, by the map ζ = exp(π z/h) of a grounded slab.

    ε = √(ε₁₁ ε₃₃) and h √(ε₁₁/ε₃₃) stand for those of an isotropic slab. The field outside of the ceramic is left out
    in both. 0.5 % is five times the change by cells a third as long.
    """
    card = -materials()["PZT-4"].matrix("+z")[6:, 6:]
    along, through = card[0, 0], card[2, 2]
    angle = pi * gap_m / (4.0 * height_m * sqrt(along / through))
    expected = -WIDE * sqrt(along * through) / pi * log(1.0 / tanh(angle))
    found = stator.clamped_capacitance(_slab(gap_m, height_m, turned=turned), np.zeros((2, 2)))
    assert found[0, 1] == pytest.approx(expected, rel=5e-3)
    assert found[1, 0] == pytest.approx(found[0, 1])
    assert found[0, 0] == pytest.approx(found[1, 1], rel=1e-6)


@pytest.mark.soak
def test_the_capacitances_of_the_bundled_plate_are_converged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells a third as long at the edges change them by 0.1 % at most."""
    solid = load_motor("bimodal40").solid
    assert solid is not None
    found = stator.clamped_capacitance(solid, np.zeros((2, 2)))
    monkeypatch.setattr(stator, "_PER_GAP", 3.0 * stator._PER_GAP)
    assert found == pytest.approx(stator.clamped_capacitance(solid, np.zeros((2, 2))), rel=1.2e-3)


def test_electrodes_that_meet_no_other_group_have_the_capacitance_of_the_mesh() -> None:
    """A plate's electrodes have no edges in its theory: its capacitances stay as they are."""
    coarse = np.array([[1e-9, 0.0], [0.0, 1e-9]])
    solid = load_motor("examples/plate40.toml").solid
    assert solid is not None
    assert stator.clamped_capacitance(solid, coarse) is coarse
