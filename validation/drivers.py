# SPDX-License-Identifier: GPL-3.0-or-later
"""Designs of drivers for random specifications.

``python -m validation.drivers --count 100`` continues the record and counts the outcomes.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pyspice_runner as pr
from pyspice_runner.drivers.design import Design
from pyspice_runner.drivers.report import DriveReport
from tests.motors import BEAM40
from validation.campaign import Campaign

MOTORS = ("bimodal40", "beam40", "andersen2002")
FILES = {"beam40": BEAM40}
STAGES = ("linear", "half-bridge", "full-bridge", "push-pull")
NETWORKS = ("inductor", "llcc")
RAILS = (12.0, 400.0)  # V
SEED = 31


@dataclass(frozen=True)
class Specification:
    """What is asked of a driver."""

    motor: str
    stage: str
    network: str
    rail: float  # V
    speed: float  # of the operating point over the speed at no load with the recommended drive


def specification(index: int) -> Specification:
    """Return the specification of a number; the rail is uniform on a logarithmic scale."""
    chance = random.Random(f"{SEED}/{index}")
    low, high = RAILS
    rail = low * (high / low) ** chance.random()
    return Specification(
        chance.choice(MOTORS),
        chance.choice(STAGES),
        chance.choice(NETWORKS),
        float(f"{rail:.3g}"),
        chance.uniform(0.1, 1.3),
    )


NO_LOAD = {"bimodal40": 48.5, "beam40": 65.3, "andersen2002": 0.687}  # rad/s, with the recommended drive


def designed(spec: Specification) -> tuple[Design, DriveReport | None]:
    """Return the design of a specification and its run from rest; without a driver there is none."""
    motor = pr.load_motor(FILES.get(spec.motor, spec.motor))
    drive, speed = pr.default_drive(motor), spec.speed * NO_LOAD[spec.motor]
    found = pr.design(motor, pr.DriverSpec(drive, spec.stage, spec.network, spec.rail), speed=speed)
    if found.driver is None:
        return found, None
    report = pr.drive_report(motor, found, audit=False)
    assert report.design is not None
    return report.design, report


def outcome(spec: Specification) -> tuple[bool, str]:
    """Return whether there is a feasible design, and its reason.

    Raises:
        AssertionError: for a design without a reason, or a feasible one that was not simulated.
    """
    try:
        found, report = designed(spec)
    except pr.SimulationError as error:
        return False, f"failed: {error}"
    assert found.reason
    if not found.feasible:
        return False, found.reason
    assert report is not None
    assert found.starts
    assert len(found.points) >= 3
    assert not report.maxima["exceeded"]
    assert all(part.peak_voltage_v for part in found.parts if part.unit in ("H", "F"))
    return True, found.reason


def case(index: int) -> dict[str, Any]:
    """Return the specification of a number and its outcome."""
    spec = specification(index)
    feasible, reason = outcome(spec)
    return {"index": index, **asdict(spec), "feasible": feasible, "reason": reason}


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return how many designs are feasible."""
    return {"cases": len(record), "feasible": sum(bool(one["feasible"]) for one in record)}


CAMPAIGN = Campaign("drivers", case, summary)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
