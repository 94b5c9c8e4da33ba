# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor bimodal40 with more of its modes: docs/bimodal40_truncation.json.

``python -m docs.bimodal40_truncation`` computes motors with all modes up to some frequencies, in about five minutes.
Each is computed at the drive of the set, and again with its frequency tuned, as by a driver that comes from above the
resonances: to the highest frequency, in steps of 10 Hz, with the rated force at the rated speed.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyspice_runner as pr
from pyspice_runner.motor.load import changed_motor

NAME = "bimodal40"
FILE = Path(__file__).with_name("bimodal40_truncation.json")
HIGHEST_HZ = (60e3, 70e3, 85e3, 100e3, 115e3, 125e3)  # of the modes; the first is the set's
SHOWN_HZ = (60e3, 115e3)  # in the table
SPEEDS_M_S = (0.0, 0.3, 0.45, 0.6)
RATED_FORCE_N, RATED_SPEED_M_S = 3.0, 0.3
LOWEST_HZ, ABOVE_HZ, STEP_HZ = 40.4e3, 41.0e3, 10.0


def point(motor: pr.Motor, drive: pr.TwoPhaseDrive, speed_m_s: float) -> pr.SteadyState:
    """Return the steady state at a speed of the rim."""
    return pr.steady_state(motor, drive, speed=speed_m_s / motor.rotor.radius_m)


def tuned(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> pr.TwoPhaseDrive:
    """Return the drive at the highest frequency with the rated force at the rated speed."""
    low, high = 0, round((ABOVE_HZ - LOWEST_HZ) / STEP_HZ)
    while high - low > 1:
        middle = (low + high) // 2
        trial = drive.updated({"frequency": LOWEST_HZ + middle * STEP_HZ})
        force = point(motor, trial, RATED_SPEED_M_S).torque_n_m / motor.rotor.radius_m
        low, high = (middle, high) if force >= RATED_FORCE_N else (low, middle)
    return drive.updated({"frequency": LOWEST_HZ + low * STEP_HZ})


def curve(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> dict[str, Any]:
    """Return forces at the rim in N and efficiencies at the speeds."""
    found = [point(motor, drive, speed) for speed in SPEEDS_M_S]
    radius = motor.rotor.radius_m
    return {
        "frequency_hz": drive.frequency,
        "force_n": [round(one.torque_n_m / radius, 3) for one in found],
        "efficiency": [round(one.torque_n_m * one.speed_rad_s / (one.power_a_w + one.power_b_w), 4) for one in found],
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as the table of docs/motors.md."""
    lines = [
        "|modes up to|modes|drive, kHz|0|300|450|600 mm/s|efficiency at 450 mm/s|",
        "|" + "---|" * 8,
    ]
    for row in (one for one in rows if one["highest_hz"] in SHOWN_HZ):
        for name in ("as_it_is", "tuned"):
            one = row[name]
            forces = "|".join(f"{force:.2f}" for force in one["force_n"])
            lines.append(
                f"|{row['highest_hz'] / 1e3:g} kHz|{row['modes']}|{one['frequency_hz'] / 1e3:.2f}|{forces}|"
                f"{100.0 * one['efficiency'][2]:.1f} %|"
            )
    return "\n".join(dict.fromkeys(lines)).replace("-", "−").replace("|" + "−−−|" * 8, "|" + "---|" * 8)


def main() -> None:
    """Compute all motors and write them."""
    rows = []
    for highest in HIGHEST_HZ:
        motor = changed_motor(NAME, {"solid.highest_hz": highest})
        drive = pr.default_drive(motor)
        assert isinstance(drive, pr.TwoPhaseDrive)
        rows.append({
            "highest_hz": highest, "modes": len(motor.modes),
            "as_it_is": curve(motor, drive), "tuned": curve(motor, tuned(motor, drive)),
        })  # fmt: skip
        print(json.dumps(rows[-1]), flush=True)
    FILE.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
