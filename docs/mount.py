# SPDX-License-Identifier: GPL-3.0-or-later
"""Compute the table of ``docs/mount.md``, what the mount changes: ``python -m docs.mount`` writes it into the page.

Each row is a quantity that a figure shows, with the stator at a fixed distance, on the mount of the set, on a carrier
four times as heavy and on springs five times as stiff. It takes a few minutes of one core.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

import pyspice_runner as pr

PAGE = Path(__file__).with_name("mount.md")
MARK, END = "<!-- table by python -m docs.mount -->", "<!-- end of the table -->"
PAPER, THIRD = "andersen2002", "andersen2002-unintended-mode"
MOUNTS: dict[str, dict[str, float | None]] = {
    "fixed distance": {"mount": None},
    "mount of the set": {},
    "carrier of 0.2 kg": {"mount.mass_kg": 0.2, "mount.damping_n_s_per_m": 100.0},
    "springs of 10⁵ N/m": {"mount.stiffness_n_per_m": 1e5, "mount.damping_n_s_per_m": 112.0},
}


def phases(voltage: float, frequency: float, phase: float) -> pr.TwoPhaseDrive:
    """Return a drive of two phases."""
    return pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)


def tones(u_1: float, f_1: float, u_2: float, f_2: float, phase: float = 0.0) -> pr.TwoToneDrive:
    """Return a drive of two tones."""
    return pr.TwoToneDrive(voltage_1=u_1, frequency_1=f_1, voltage_2=u_2, frequency_2=f_2, phase_deg=phase)


def span(drive: pr.TwoPhaseDrive | pr.TwoToneDrive) -> Callable[[pr.Motor], str]:
    """Return a bench that measures the span of the tip towards the held rotor, µm, and the mean force."""

    def measure(motor: pr.Motor) -> str:
        run = pr.simulate(motor, drive, duration=12e-3, speed=0.0)
        late = run.window()
        return f"{1e6 * np.ptp(run.tip_y_m[late]):.2f} µm, {run.normal_force_n[late].mean():.2f} N"

    return measure


def held(drive: pr.TwoPhaseDrive | pr.TwoToneDrive, speed: float = 0.0) -> Callable[[pr.Motor], str]:
    """Return a bench that measures torque and mean force at a speed."""

    def measure(motor: pr.Motor) -> str:
        point = pr.speed_torque(motor, drive, speeds=[speed])
        remark = "" if bool(point["settled"][0]) else " (not settled)"
        return f"{1e3 * float(point['torque_n_m'][0]):.2f} mN·m, {float(point['normal_force_n'][0]):.2f} N{remark}"

    return measure


def curve(drive: pr.TwoPhaseDrive) -> Callable[[pr.Motor], str]:
    """Return a bench that measures stall torque and no-load speed."""

    def measure(motor: pr.Motor) -> str:
        speeds = np.linspace(0.0, 28.0, 8)
        points = pr.speed_torque(motor, drive, speeds=speeds)
        loads = points["load_torque_n_m"].to_numpy()
        k = int(np.flatnonzero((loads[:-1] > 0.0) & (loads[1:] <= 0.0))[0])
        speed = np.interp(0.0, -loads[k : k + 2], speeds[k : k + 2])
        return f"{1e3 * loads[0]:.1f} mN·m, {speed:.1f} rad/s"

    return measure


ROWS: dict[str, tuple[str, Callable[[pr.Motor], str]]] = {
    "figure 5 (a), 21 kHz, 200 V": (PAPER, span(phases(200.0, 21e3, -90.0))),
    "figure 5 (c), 40 and 80 kHz, 200 V": (PAPER, span(tones(200.0, 40e3, 200.0, 80e3))),
    "figure 5 (e), 13.5 kHz, 50 V": (PAPER, span(phases(50.0, 13.5e3, -90.0))),
    "figure 5 (f), 17.9 kHz, 50 V": (PAPER, span(phases(50.0, 17.9e3, -90.0))),
    "figure 6, 44.5 kHz, 100 V": (THIRD, curve(phases(100.0, 44.5e3, 180.0))),
    "figure 6, speed and torque, preload: 46 kHz, 100 V": (THIRD, curve(phases(100.0, 46e3, 180.0))),
    "frequency sweep: 30 V, 17 kHz": (PAPER, held(phases(30.0, 17e3, 90.0))),
    "hammering with 100 V, 17 kHz": (PAPER, held(phases(100.0, 17e3, 90.0))),
    "contact laws, drivers, tracking: 51.7 kHz, 50 V": (PAPER, held(phases(50.0, 51.7e3, 90.0))),
    "spin-up and tolerance before: 18 and 54 kHz": (PAPER, held(tones(100.0, 18e3, 50.0, 54e3, 165.0))),
}


def main() -> None:
    """Write the table into the page."""
    lines = [f"| figure, drive | {' | '.join(MOUNTS)} |", "|---" * (len(MOUNTS) + 1) + "|"]
    for name, (source, measure) in ROWS.items():
        cells = [measure(pr.load_motor(source).updated(change)) for change in MOUNTS.values()]
        lines.append(f"| {name} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    text = PAGE.read_text(encoding="utf-8")
    new = f"{MARK}\n" + "\n".join(lines) + f"\n{END}"
    PAGE.write_text(re.sub(f"{re.escape(MARK)}.*?{re.escape(END)}", new, text, flags=re.DOTALL), encoding="utf-8")


if __name__ == "__main__":
    main()
