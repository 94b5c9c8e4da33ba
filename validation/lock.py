# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts of phase-locked loops on the averaged flagship: ``python -m validation.lock --count 400``.

Voltage, target, starting frequency and middle of the oscillator's range are drawn at random.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import pyspice_runner as pr
from validation.campaign import Campaign

SEED, COUNT = 49, 400
VOLTAGES, TARGETS = (25.0, 150.0), (-60.0, 0.0)  # V, degrees
STARTS, MIDDLES = (39.0e3, 42.5e3), (40.3e3, 41.2e3)  # Hz
DURATION = 20e-3  # s: 25 time constants of the mode
LEAST = 0.99  # share that locks


def outcome(index: int) -> dict[str, Any]:
    """Start a loop at a random point; return whether it locks, its frequency and speed, and its cautions."""
    rng = np.random.default_rng((SEED, index))
    voltage, target, start, middle = (float(rng.uniform(*span)) for span in (VOLTAGES, TARGETS, STARTS, MIDDLES))
    tracker = pr.Tracker(
        kind="pll", voltage=voltage, frequency=middle, offset=start / middle - 1.0, target_deg=target
    )  # fmt: skip
    found = pr.track(pr.load_motor("bimodal40"), tracker, DURATION, averaged=True, margin=False)
    return {
        "voltage": voltage, "target_deg": target, "start_hz": start, "middle_hz": middle, "locked": found.locked,
        "end_frequency_hz": found.end_frequency_hz, "static_phase_error_deg": found.static_phase_error_deg,
        "rotor_speed_rad_s": found.speed_after_rad_s,
        "said": any(one.startswith("The tracker ") for one in found.cautions),
    }  # fmt: skip


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return how many loops lock, and how many of the others have no caution."""
    lost = [one for one in record if not one["locked"]]
    return {
        "cases": len(record), "locked": len(record) - len(lost),
        "lost_without_caution": sum(not one["said"] for one in lost),
    }  # fmt: skip


def passes(found: Mapping[str, Any]) -> bool:
    """Return whether 99 % lock, and each of the others has a caution."""
    return found["locked"] >= LEAST * found["cases"] and not found["lost_without_caution"]


CAMPAIGN = Campaign("lock", outcome, summary, passes, COUNT)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
