# SPDX-License-Identifier: GPL-3.0-or-later
"""Trackers on the flagship, and recovery from disturbances of it and ``plate40``: ``python -m validation.recovery``.

Numbers draw voltage, target and a disturbance of the averaged motor that ends; with copies of the clamped capacitances
that are 60 % too small some loops do not return on their own. Names are trackers of the full flagship, and a constant
drive at the frequency of the maximum speed.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.trackers.tracker import CHANGED, Disturbance
from validation.campaign import Campaign, Key

SEED, RANDOM = 49, 32
MOTORS = {"bimodal40": "bimodal40", "plate40": str(Path(__file__).parents[1] / "examples" / "plate40.toml")}
VOLTAGE, START, BEST = 70.0, 41.84e3, 40.5e3  # V; Hz: of all trackers, and where the speed has its maximum at 70 V
DURATION = 25e-3  # s of the full motor
TRACKERS: dict[str, dict[str, Any]] = {
    "pll": {"kind": "pll"}, "observe-current": {"kind": "observe-current"}, "observe-power": {"kind": "observe-power"},
    "none": {"kind": "none", "offset": 0.0, "frequency": BEST},
}  # fmt: skip
VOLTAGES, TARGETS, MIDDLES = (60.0, 150.0), (-60.0, 0.0), (40.3e3, 41.2e3)  # V, degrees, Hz
BEGIN, END, WHOLE = 30e-3, 60e-3, 120e-3  # s
ERRORS = (0.0, -0.6)  # of the copies of the clamped capacitances, relative
LEAST = 0.99  # share of the flagship's loops that are locked at the end, with right copies and a restart


def outcome(key: Key) -> dict[str, Any]:
    """Run a tracker of the full motor, or a random disturbance of the averaged one with and without a restart."""
    if isinstance(key, str):
        centre = {"frequency": 40.62e3, "offset": START / 40.62e3 - 1.0}
        tracker = pr.Tracker(**{"voltage": VOLTAGE, **centre, **TRACKERS[key]})
        found = pr.track(pr.load_motor("bimodal40"), tracker, DURATION, margin=False)
        return {
            "end_frequency_hz": found.end_frequency_hz, "rotor_speed_rad_s": found.speed_after_rad_s,
            "static_phase_error_deg": found.static_phase_error_deg,
        }  # fmt: skip
    rng = np.random.default_rng((SEED, key))
    name = list(MOTORS)[key % 2]
    motor = pr.load_motor(MOTORS[name])
    voltage, target, middle = (float(rng.uniform(*span)) for span in (VOLTAGES, TARGETS, MIDDLES))
    torque = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    spans = {
        "load": (0.2 * torque, 3.0 * torque),
        "supply": (-0.99, -0.4),
        "preload": (-0.8, 2.2),
        "temperature": (-0.1, 0.1),
    }
    kind = list(spans)[int(rng.integers(len(spans)))]
    value = float(rng.uniform(*spans[kind]))
    events = [
        Disturbance(**{"kind": kind, "begin_s": begin, CHANGED[kind]: to, "drift_time_s": 5e-3})
        for begin, to in ((BEGIN, value), (END, 0.0))
    ]
    runs = {}
    for error, restart in itertools.product(ERRORS, (False, True)):
        tracker = pr.Tracker(
            kind="pll", voltage=voltage, frequency=middle, target_deg=target, capacitance_error=error, restart=restart,
            phase_deg=pr.default_drive(motor).phase_deg,
        )  # fmt: skip
        found = pr.track(motor, tracker, WHOLE, disturbances=events, averaged=True, margin=False)
        runs[f"{error:g}, {'restart' if restart else 'no restart'}"] = {
            "began_locked": found.lock_time_s is not None, "kept": found.kept_lock, "locked": found.locked,
            "losses": found.to_dict()["losses"][:2], "restarts": len(found.restarts_s),
            "said": found.locked or any(one.startswith("The tracker ") for one in found.cautions),
        }  # fmt: skip
    return {"motor": name, "kind": kind, "value": value, "voltage": voltage, "target_deg": target, "runs": runs}


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return frequency and speed by each tracker, and how many loops kept lock, lost it, and are locked at the end."""
    trackers, cases = [one for one in record if "runs" not in one], [one for one in record if "runs" in one]
    found: dict[str, Any] = {
        "trackers": {
            str(one["index"]): {n: one[n] for n in ("end_frequency_hz", "rotor_speed_rad_s")} for one in trackers
        }
    }
    for name in MOTORS:
        for run in cases[0]["runs"] if cases else ():
            runs = [one["runs"][run] for one in cases if one["motor"] == name and one["runs"][run]["began_locked"]]
            lost = [one for one in runs if not one["kept"]]
            found[f"{name}, {run}"] = {
                "cases": len(runs), "lost": len(lost), "locked_at_the_end": sum(one["locked"] for one in runs),
                "without_lock_or_caution": sum(not one["locked"] and not one["said"] for one in runs),
            }  # fmt: skip
    return found


def passes(found: Mapping[str, Any]) -> bool:
    """Return whether the flagship with right copies and a restart returns, and each other loss has a caution."""
    counts = [one for name, one in found.items() if name != "trackers"]
    right = found["bimodal40, 0, restart"]
    return right["locked_at_the_end"] >= LEAST * right["cases"] and not any(
        one["without_lock_or_caution"] for one in counts
    )


KEYS: tuple[Key, ...] = (*range(RANDOM), *TRACKERS)
CAMPAIGN = Campaign("recovery", outcome, summary, passes, len(KEYS), keys=lambda: KEYS)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
