# SPDX-License-Identifier: GPL-3.0-or-later
"""Designs of drivers for random specifications; ``python -m tests.random_drivers 100`` counts their outcomes."""

from __future__ import annotations

import random
import sys
from collections import Counter
from dataclasses import dataclass

import pyspice_runner as pr
from pyspice_runner.analysis.design import Design
from pyspice_runner.analysis.drive import DriveReport

MOTORS = ("bimodal40", "beam40", "andersen2002")
STAGES = ("linear", "half-bridge", "full-bridge")
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


NO_LOAD = {"bimodal40": 44.5, "beam40": 65.3, "andersen2002": 0.687}  # rad/s, with the recommended drive


def designed(spec: Specification) -> tuple[Design, DriveReport | None]:
    """Return the design of a specification and its run from rest; without a driver there is none."""
    motor = pr.load_motor(spec.motor)
    drive, speed = pr.default_drive(motor), spec.speed * NO_LOAD[spec.motor]
    found = pr.propose_matching(motor, drive, spec.stage, spec.network, rail=spec.rail, speed=speed)
    if found.driver is None:
        return found, None
    report = pr.drive_report(motor, found, audit=False)
    assert report.design is not None
    return report.design, report


def outcome(spec: Specification) -> str:
    """Return ``feasible``, or the kind of the reason why not.

    Raises:
        AssertionError: for a design without a reason, or a feasible one that was not simulated.
    """
    found, report = designed(spec)
    assert found.reason
    if not found.feasible:
        return f"not feasible: {found.reason.split('.')[0][:60]}"
    assert report is not None
    assert found.starts
    assert len(found.points) >= 3
    assert all(part.peak_voltage_v for part in found.parts if part.unit in ("H", "F"))
    return "feasible"


if __name__ == "__main__":
    first, last = (0, int(sys.argv[1])) if len(sys.argv) == 2 else (int(sys.argv[1]), int(sys.argv[2]))
    counted: Counter[str] = Counter()
    for number in range(first, last):
        told = outcome(specification(number))
        counted["feasible" if told == "feasible" else "not feasible"] += 1
        print(number, specification(number), told, flush=True)
    print(dict(counted))
