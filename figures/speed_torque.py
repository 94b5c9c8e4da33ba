# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed–torque curves at several voltages, with efficiency and the power of the driver.

In (a) a curve covers three quadrants: below zero speed the shaft is turned against the motor, above the no-load speed
it is driven faster than the motor.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import colormaps
from style import BLACK, canvas, draft, drive_words, main, motor_words, write

import pyspice_runner as pr

VOLTAGES = (60.0, 100.0) if draft() else (40.0, 55.0, 70.0, 85.0, 100.0)
SPEEDS = np.arange(-10.0, 31.0, 20.0 if draft() else 1.0)  # rad/s


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002-unintended-mode")
    drive = pr.TwoPhaseDrive(voltage=VOLTAGES[-1], frequency=46e3, phase_deg=180.0)
    family = pr.speed_torque(motor, drive, speeds=SPEEDS, over={"drive.voltage": VOLTAGES})

    figure, axes = canvas(2, 2, 6.6)
    (torque, efficiency), (power, current) = axes
    fine = np.linspace(SPEEDS[0], SPEEDS[-1], 400)
    stories = []
    highest = 0.0
    for number, voltage in enumerate(VOLTAGES):
        curve = family.sel({"drive.voltage": voltage})
        colour = colormaps["viridis"](0.9 * number / (len(VOLTAGES) - 1))
        line = {"color": colour, "label": f"{voltage:g} V"}
        load = curve["load_torque_n_m"]
        electrical = curve["power_a_w"] + curve["power_b_w"]
        share = 100.0 * load * SPEEDS / electrical
        forward = SPEEDS >= 0.0
        torque.plot(SPEEDS, 1e3 * load, **line)
        efficiency.plot(SPEEDS[forward], share[forward], **line)
        power.plot(SPEEDS, electrical, **line)
        current.plot(SPEEDS, 1e3 * curve["current_a_rms_a"], **line)
        best = int(np.argmax(share.values))
        highest = max(highest, float(share[best]))
        no_load = float(np.interp(0.0, -np.interp(fine, SPEEDS, load), fine))
        stories.append(
            f"{voltage:g} V: stall {1e3 * float(np.interp(0.0, SPEEDS, load)):.1f} mN·m, no load {no_load:.1f} rad/s, "
            f"{float(share[best]):.1f} % of {float(electrical[best]):.2f} W at {SPEEDS[best]:g} rad/s"
        )
    torque.set(title="(a) torque on the load", ylabel="torque / (mN·m)")
    efficiency.set(title="(b) efficiency, motoring", ylabel="efficiency / %", ylim=(0.0, 1.1 * highest))
    power.set(title="(c) electrical power of both groups", ylabel="power / W", ylim=(0.0, None))
    current.set(title="(d) current of group A", ylabel="RMS current / mA", ylim=(0.0, None))
    torque.axhline(0.0, color=BLACK, lw=0.6)
    for panel in axes.flat:
        panel.set(xlabel="speed / (rad/s)", xlim=(SPEEDS[0] - 1.0, SPEEDS[-1] + 1.0))
        panel.axvline(0.0, color=BLACK, lw=0.6)
    torque.legend(title="amplitude", title_fontsize=8)
    if not bool(family["settled"].all()):
        raise pr.SimulationError(
            "Some points of the family did not settle: choose voltages at which the motion is periodic."
        )
    words = drive_words(drive).replace(f"{VOLTAGES[-1]:g} V", f"{VOLTAGES[0]:g} to {VOLTAGES[-1]:g} V")
    caption = (
        f"{motor_words(motor)} Drive: {words}. {family['settled'].size} steady states on the mount, shaft held. "
        f"The load torque is the torque of the contact minus that of the bearing; efficiency is its power over the "
        f"electrical real power, without the losses of an amplifier that supplies the reactive current of (d). "
        f"ngspice {family.attrs['ngspice_version']}."
    )
    write(
        figure, folder / "speed_torque.png", "Speed–torque curves at several voltages, with power and current", caption
    )
    return stories


if __name__ == "__main__":
    main(draw, __doc__)
