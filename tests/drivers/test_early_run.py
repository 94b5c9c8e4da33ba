# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs that begin while the design of their driver is checked."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

import pyspice_runner as pr
from pyspice_runner.drivers import report as drive
from pyspice_runner.drivers.early_run import EarlyRun


def slow(subject: str, reached: Callable[[float], None]) -> str:
    """Run for 5 s, or until it is ended."""
    for _ in range(500):
        time.sleep(0.01)
        reached(0.0)
    return subject


def quick(subject: str, reached: Callable[[float], None]) -> str:
    """Return at once; a subject ``wrong`` fails."""
    reached(0.0)
    if subject == "wrong":
        raise pr.SimulationError("It failed.")
    return f"outcome of {subject}"


def test_the_outcome_is_that_of_the_last_subject() -> None:
    with EarlyRun(quick) as early:
        assert early.outcome("first") is None
        early.begin("first")
        early.begin("second")
        assert early.outcome("first") is None
        assert early.outcome("second") == "outcome of second"


def test_an_error_of_the_run_comes_with_its_outcome() -> None:
    with EarlyRun(quick) as early:
        early.begin("wrong")
        with pytest.raises(pr.SimulationError, match="It failed"):
            early.outcome("wrong")


def test_a_run_whose_outcome_is_not_needed_ends() -> None:
    began = time.monotonic()
    with EarlyRun(slow) as early:
        early.begin("first")
        early.begin("second")
    assert time.monotonic() - began < 2.0


def test_a_report_of_an_early_run_is_that_of_a_late_one() -> None:
    motor = pr.load_motor("andersen2002")
    bridge = pr.Driver(kind="half-bridge", voltage=20.0, frequency=46e3)
    with EarlyRun(drive.run_task) as early:
        drive.begin_early(early, motor, bridge, 3e-4, contact="coulomb")
        report = pr.drive_report(motor, bridge, 3e-4, contact="coulomb", early=early)
        other = pr.drive_report(motor, bridge, 3e-4, contact="spring-slider", early=early)
    late = pr.drive_report(motor, bridge, 3e-4, contact="coulomb")
    assert report.losses_w == late.losses_w
    assert other.run["contact"] != report.run["contact"]


def test_a_driver_with_uniform_steps_does_not_run_early() -> None:
    with EarlyRun(drive.run_task) as early:
        drive.begin_early(early, pr.load_motor("andersen2002"), pr.Driver(kind="linear", voltage=20.0, frequency=46e3))
        assert early._future is None
