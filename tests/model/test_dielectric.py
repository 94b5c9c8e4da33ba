# SPDX-License-Identifier: GPL-3.0-or-later
"""The ladder of a constant loss tangent, against that loss tangent and the relation of Kramers and Kronig."""

from __future__ import annotations

import numpy as np
import pytest

from pyspice_runner.model.dielectric import loss_ladder


def test_the_ladder_has_the_loss_tangent_within_its_band_and_the_capacitance_that_belongs_to_it() -> None:
    frequency = np.geomspace(1e4, 1e6, 201)
    s = 2j * np.pi * frequency
    branches = loss_ladder(2e-9, 0.01, 1e2, 1e8, 13)
    y = sum(s * c / (1.0 + s * r * c) for r, c in branches)
    # ripple 0.08 %; each end, two decades away, lacks 2/π · 1/100 of the loss
    assert np.abs(y.real / (2e-9 * s.imag) / 0.01 - 1.0).max() < 0.0075
    fall = np.polyfit(np.log(frequency), (y / s).real / 2e-9, 1)[0]
    assert fall == pytest.approx(-2.0 / np.pi * 0.01, rel=0.01)
