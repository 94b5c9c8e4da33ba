# SPDX-License-Identifier: GPL-3.0-or-later
"""Voltages and currents of the motor behind two half bridges with LLCC filters."""

from __future__ import annotations

from pathlib import Path

from style import canvas, draft, drive_words, main, motor_words, write

import pyspice_runner as pr

RAIL = 100.0  # V, of the supply
SPEED = 20.0  # rad/s, of the shaft held on the dynamometer
DURATION = 0.3e-3 if draft() else 8e-3  # s, from power-up until the modes have settled


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    design = pr.design(motor, pr.DriverSpec(drive, "half-bridge", "llcc", RAIL))
    report = pr.drive_report(motor, design, duration=DURATION, speed=SPEED)
    figure, axes = canvas(2, 1, 5.6)
    report.plot(ax=axes[0], panel="voltages")
    report.plot(ax=axes[1], panel="currents")
    for axis, title in zip(axes, ("(a) voltages", "(b) currents"), strict=True):
        low, high = axis.get_ylim()
        axis.set(title=title, ylim=(low, high + 0.25 * (high - low)))  # room for the legend
        axis.legend(loc="upper center", ncols=4)
    caption = (
        f"{motor_words(motor)} Target: {drive_words(drive)}, shaft held at {SPEED:g} rad/s, {1e3 * DURATION:g} ms "
        f"after power-up. Each group has a half bridge at {RAIL:g} V with an LLCC filter."
    )
    write(figure, folder / "half_bridge.png", "Voltages and currents behind half bridges", caption)
    peaks = [max(abs(item.current_a) for item in report.groups[group].harmonics) for group in "ab"]
    return [
        f"{report.power_in_w:.2f} W from the supply, {100 * report.driver_efficiency:.0f} % reach the motor",
        f"fundamental current {1e3 * peaks[0]:.0f} mA into A, {1e3 * peaks[1]:.0f} mA into B",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
