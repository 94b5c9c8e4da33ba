# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute the tables of ``docs/paper.md``: ``python -m docs.paper`` writes them between the marks of the page.

It takes a few minutes of one core.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import pyspice_runner as pr

PAGE = Path(__file__).with_name("paper.md")
MARK, END = "<!-- table by python -m docs.paper -->", "<!-- end of the table -->"
MOTOR = "andersen2002"
RATED_V = 50.0  # of every row but the last
POINTS: dict[str, pr.TwoPhaseDrive | pr.TwoToneDrive] = {
    "eq. (1), first mode free": pr.TwoPhaseDrive(voltage=RATED_V, frequency=13.5e3),
    "eq. (1), first mode in contact": pr.TwoPhaseDrive(voltage=RATED_V, frequency=17.9e3),
    "eq. (1), second mode free": pr.TwoPhaseDrive(voltage=RATED_V, frequency=51.7e3),
    "eq. (1), second mode in contact": pr.TwoPhaseDrive(voltage=RATED_V, frequency=54e3),
    "eq. (2), first mode free, and twice": pr.TwoToneDrive(
        voltage_1=RATED_V, frequency_1=13.5e3, voltage_2=RATED_V, frequency_2=27e3, phase_deg=90.0
    ),
    "eq. (2), half of the second mode": pr.TwoToneDrive(
        voltage_1=RATED_V, frequency_1=25.85e3, voltage_2=RATED_V, frequency_2=51.7e3, phase_deg=90.0
    ),
    "the second mode free, 100 V": pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3),
}
SPEEDS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # rad/s
HEAD = """\
| drive | free tip: x, y / µm | in contact / µm | lifted | stall torque / μF₀R | no-load rad/s | best efficiency |
|---|---|---|---|---|---|---|"""


def amplitudes(run: pr.Waveforms) -> tuple[float, float]:
    """Return half the span of the tip along and towards the rotor at the end of a run, µm."""
    late = run.window()
    return float(0.5e6 * np.ptp(run.tip_x_m[late])), float(0.5e6 * np.ptp(run.tip_y_m[late]))


def row(name: str, drive: pr.TwoPhaseDrive | pr.TwoToneDrive) -> str:
    """Return a line of the table."""
    motor = pr.load_motor(MOTOR)
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    free = amplitudes(pr.simulate(motor, drive, duration=8e-3, contact=None))
    curve = pr.speed_torque(motor, drive, speeds=SPEEDS)
    held = pr.steady_state(motor, drive, speed=0.0)
    touching = amplitudes(held.waveforms) if held.waveforms else (np.nan, np.nan)
    loads = curve["load_torque_n_m"].to_numpy()
    falls = np.flatnonzero((loads[:-1] > 0.0) & (loads[1:] <= 0.0))
    speed = "–"
    if falls.size:
        k = int(falls[0])
        speed = f"{np.interp(0.0, -loads[k : k + 2], np.array(SPEEDS)[k : k + 2]):.2f}"
    settled = "" if bool(curve["settled"].all()) else " (not settled)"
    lifted, stall = 100.0 * float(curve["separated"][0]), 100.0 * loads[0] / limit
    best = max(0.0, float(curve["efficiency"].max()))
    return (
        f"| {name} | {free[0]:.2f}, {free[1]:.2f} | {touching[0]:.2f}, {touching[1]:.2f} | "
        f"{lifted:.0f} % | {stall:.1f} %{settled} | {speed} | {best:.2g} |"
    )


def main() -> None:
    """Write the table into the page."""
    table = "\n".join([HEAD, *(row(name, drive) for name, drive in POINTS.items())])
    text = PAGE.read_text(encoding="utf-8")
    mark, end = "<!-- table by python -m docs.paper -->", "<!-- end of the table -->"
    PAGE.write_text(
        re.sub(f"{re.escape(mark)}.*?{re.escape(end)}", f"{mark}\n{table}\n{end}", text, flags=re.DOTALL),
        encoding="utf-8",
    )
    print(table)


if __name__ == "__main__":
    main()
