# SPDX-License-Identifier: GPL-3.0-or-later
"""The two-port in closed form against that of the circuit by ngspice."""

from __future__ import annotations

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor.two_port import closed_two_port
from tests import calibration_study as study


@pytest.mark.parametrize("state", ["free", "preloaded"])
def test_the_admittance_in_closed_form_is_that_of_the_circuit(state: str) -> None:
    motor = study.base().updated({"piezo.capacitance_ab_f": 3e-10})  # with a mount and losses of impacts
    found = pr.admittance(motor, start=20e3, stop=70e3, points=401, state=state)  # type: ignore[arg-type]
    closed = closed_two_port(motor, found.frequency_hz, preloaded=state == "preloaded")
    size = np.abs(found.matrix_s).max(axis=(1, 2), keepdims=True)
    # The ladder of the circuit holds the loss angle of 0.02 within a tenth: 2e-3 of the capacitance's admittance. The
    # rest is linear in both.
    assert np.all(np.abs(closed - found.matrix_s) < 3e-3 * size)


def test_bearing_recoil_and_springs_in_series_are_in_the_closed_form() -> None:
    motor = pr.load_motor("bimodal40")
    for state in ("free", "preloaded"):
        found = pr.admittance(motor, start=30e3, stop=50e3, points=401, state=state)  # type: ignore[arg-type]
        closed = closed_two_port(motor, found.frequency_hz, preloaded=state == "preloaded")
        # the damping of impacts acts on the contact alone, not on the spring in series with it as in the closed form
        limit = 3e-3 if state == "free" else 0.2
        size = np.abs(found.matrix_s).max(axis=(1, 2), keepdims=True)
        assert np.all(np.abs(closed - found.matrix_s) < limit * size), state
