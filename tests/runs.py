# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs whose error a test measures itself, or need not know."""

from typing import Any, TypeVar

import pyspice_runner as pr
from pyspice_runner.averaged.run import ErrorEstimate, Estimated
from pyspice_runner.motor.drive import Drive
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Waveforms

Run = TypeVar("Run", bound=Estimated)


def simulated(motor: pr.Motor, drive: Drive, **settings: Any) -> Waveforms:
    """Simulate with the default step, which is stated, so that no two more runs estimate the error."""
    point = Point.of(motor, drive, contact=settings.get("contact", "spring-slider"))
    return pr.simulate(motor, drive, step=point.step, **settings)


def unestimated(run: Run) -> Run:
    """Leave out the estimate of the error against the full motor, which takes eight times as long as the run."""
    vars(run)["error_estimate"] = ErrorEstimate()
    return run
