# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibration with time averages: their errors, and their derivative beside that of the periodic motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration import prediction
from pyspice_runner.calibration.points import read_points
from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.calibration.unknowns import unknowns_of
from pyspice_runner.run.point import Point


def test_a_calibration_has_errors_and_slopes_of_time_averages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first point counts as one here: the prediction a step beside is that of ngspice, and its error is larger."""
    motor = pr.load_motor("andersen2002-unintended-mode")
    base = Point.of(motor, pr.default_drive(motor).updated({"frequency": 46e3}), audit=False)
    points = read_points({"speed_rad_s": [2.0, 8.0], "torque_n_m": [0.01, 0.008], "torque_n_m_error": [1e-4, 1e-4]})
    plain = Predictor(base, unknowns_of(motor, base.drive, ["contact.friction", "contact.preload_n"]), points)
    monkeypatch.setattr(prediction, "_scatter", lambda state, _: 1e-2 * (getattr(state, "speed_rad_s", 0) == 2.0))
    monkeypatch.setattr(prediction, "SLOPED", float("inf"))
    found, here = plain.refined(np.zeros(2))
    beside = np.array([0.0, prediction.COARSE_DIFFERENCE])
    (fast,), (fine,) = found.at([beside], here), plain.at([beside], here, fine=True)
    untilted = replace(found, tilt=None).at([beside], here)[0].values[0]
    # what is left is the end of Newton's method from other starts
    assert abs(fast.values[0] - fine.values[0]) < 0.1 * abs(untilted - fine.values[0])
    assert found.errors[0] == pytest.approx(np.hypot(1e-4, 1e-2 * here.values[0]))
    assert found.errors[1] == 1e-4
