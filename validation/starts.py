# SPDX-License-Identifier: GPL-3.0-or-later
"""``.op`` and ``.ac`` of the averaged decks at random operating points: ``python -m validation.starts --count 200``.

At each point both run by themselves, and with the start by a transient that docs/tracking.md gives.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np

from tests.averaged.test_averaged_start import deck, expected, recipe, result
from validation.campaign import Campaign

SEED, COUNT = 32, 200
VOLTAGES, FREQUENCIES, PHASES, TORQUES = (40.0, 150.0), (39.6e3, 41.2e3), (60.0, 140.0), (-6e-3, 6e-3)  # V, Hz, °, N·m
LIMIT = 2.0  # s of CPU time
AGREES = 0.01  # of the speed of the settled C code
LEAST = 0.05  # rad/s: differences of a rotor that stands are not relative


def point(index: int) -> tuple[float, float, float, float]:
    """Draw frequency, voltage, phase and load torque."""
    rng = np.random.default_rng((SEED, index))
    voltage, frequency, phase, torque = (float(rng.uniform(*span)) for span in (VOLTAGES, FREQUENCIES, PHASES, TORQUES))
    return frequency, voltage, phase * float(rng.choice((-1.0, 1.0))), torque


def ended(analysis: str, text: str, folder: Path) -> tuple[float, float]:
    """Return the result of a deck and its CPU time in s; NaN and infinity where it fails or does not end."""
    try:
        return result(analysis, text, folder)
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError):
        return nan, inf


def outcome(index: int) -> dict[str, Any]:
    """Run ``.op`` and ``.ac`` at a point, alone and from the transient; return CPU times in s and right speeds."""
    at = point(index)
    settled = expected(at)
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start = re.sub(r"\.control.*?\.endc\n", lambda _: recipe(), deck("op", at), flags=re.S)
        found["transient_s"] = result("start", start, folder)[1]
        for analysis, mark in (("op", ".control"), ("ac", ".ac dec")):
            text = deck(analysis, at)
            for kind, own in (("", text), ("_from_transient", text.replace(mark, f".include start.nodeset\n{mark}"))):
                value, seconds = ended(analysis, own, folder)
                found[f"{analysis}{kind}_s"] = seconds if seconds < inf else None
                if analysis == "op" and seconds < inf:
                    found[f"op{kind}_right"] = abs(value - settled) <= max(AGREES * abs(settled), LEAST)
    return found


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return how many analyses end in time, how many find the settled speed, and the slowest transient in s."""
    ways = ("op_s", "ac_s", "op_from_transient_s", "ac_from_transient_s")
    return {
        "cases": len(record),
        "within_limit": {way: sum((one[way] or inf) < LIMIT for one in record) for way in ways},
        "settled_speed": {
            way: sum(one.get(way, False) for one in record) for way in ("op_right", "op_from_transient_right")
        },
        "slowest_transient_s": max(one["transient_s"] for one in record),
    }


CAMPAIGN = Campaign("starts", outcome, summary, count=COUNT)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
