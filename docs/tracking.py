# SPDX-License-Identifier: GPL-3.0-or-later
"""Run every tracker through every disturbance and write the table of ``docs/tracking.md``: ``python -m docs.tracking``.

It takes some minutes of one core.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pyspice_runner as pr
from pyspice_runner.trackers.track import Tracking
from pyspice_runner.trackers.tracker import running_resonance

PAGE = Path(__file__).with_name("tracking.md")
BEGIN, END = "<!-- table by python -m docs.tracking -->", "<!-- end of the table -->"
KINDS = ("pll", "observe-current", "observe-power", "none")
CASES: dict[str, dict[str, Any]] = {
    "start 3 % below": {"disturb": "start", "offset": -0.03},
    "start 3 % above": {"disturb": "start", "offset": 0.03},
    "load, half the stall torque": {"disturb": "load"},
    "preload +30 %": {"disturb": "preload", "preload_change": 0.3},
    "preload −30 %": {"disturb": "preload", "preload_change": -0.3},
    "drift −2 % in 50 ms": {"disturb": "temperature"},
}
HEAD = """\
| disturbance | tracker | locked | lock time | phase error RMS, worst | detuning left | speed before → after | lost |
|---|---|---|---|---|---|---|---|"""


def motor() -> pr.Motor:
    """Return the motor: with a light rotor, so that speeds settle within milliseconds."""
    return pr.load_motor("andersen2002").updated({"mount": None, "rotor.inertia_kg_m2": 1e-7})


def tracker(kind: str, offset: float = 0.0) -> pr.Tracker:
    """Return a tracker with its drive, in the middle of its range at the running resonance."""
    drive = {"kind": kind, "voltage": 50.0, "ratio_b": 2.0, "phase_deg": 90.0, "offset": offset}
    lag = running_resonance(motor(), pr.Tracker(frequency=50e3, **drive))
    return pr.Tracker(frequency=lag.resonance_hz, **drive)


def row(case: str, kind: str, found: Tracking) -> str:
    """Return a line of the table."""
    lock = "–" if found.lock_time_s is None else f"{1e3 * found.lock_time_s:.1f} ms"
    locked = "–" if kind == "none" else "yes" if found.locked else "no"
    return (
        f"| {case} | {kind} | {locked} | {lock} | {found.rms_phase_error_deg:.1f}°, "
        f"{found.worst_phase_error_deg:.1f}° | {round(found.residual_detuning_hz)} Hz | "
        f"{found.speed_before_rad_s:.2f} → {found.speed_after_rad_s:.2f} rad/s | {found.speed_lost_rad_s:.2f} rad/s |"
    )


def main() -> None:
    """Write the table, and print it as it grows."""
    lines = [HEAD]
    load = None
    for case, settings in CASES.items():
        settings = dict(settings)
        offset = settings.pop("offset", 0.0)
        for kind in KINDS:
            if settings["disturb"] == "load":
                settings["load_torque"] = load
            found = pr.track(motor(), tracker(kind, offset), **settings, margin=False)
            if found.stall_torque_n_m is not None:
                load = 0.5 * found.stall_torque_n_m
            lines.append(row(case, kind, found))
            sys.stdout.write(lines[-1] + "\n")
            sys.stdout.flush()
    page = PAGE.read_text(encoding="utf-8")
    new = f"{BEGIN}\n" + "\n".join(lines) + f"\n{END}"
    PAGE.write_text(re.sub(f"{BEGIN}.*?{END}", lambda _: new, page, flags=re.S), encoding="utf-8")


if __name__ == "__main__":
    main()
