# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs whose error a test measures itself, or need not know."""

from typing import Any, TypeVar

import numpy as np

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


def far(run: Waveforms, exact: Any, *columns: str) -> float:
    """Return the largest RMS difference of columns from those of a reference, over the deviation from their mean."""
    inside = exact.time_s <= run.time_s[-1]
    wanted = [getattr(exact, name)[inside] for name in columns]
    found = [np.interp(exact.time_s[inside], run.time_s, getattr(run, name)) for name in columns]
    return max(float(np.sqrt(np.mean((a - b) ** 2)) / np.std(b)) for a, b in zip(found, wanted, strict=True))


def unestimated(run: Run) -> Run:
    """Leave out the estimate of the error against the full motor, which takes eight times as long as the run."""
    vars(run)["error_estimate"] = ErrorEstimate()
    return run
