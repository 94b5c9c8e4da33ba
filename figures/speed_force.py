# SPDX-License-Identifier: GPL-3.0-or-later
"""Force, power and efficiency of the motor versus speed, from stall to no load, in steady states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLUE, GREEN, GREY, VERMILION, canvas, draft, drive_words, main, motor_words, write

import pyspice_runner as pr

POINTS = 4 if draft() else 13


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    free = pr.steady_state(motor, drive, load_torque=0.0)
    curve = pr.speed_torque(motor, drive, speeds=np.linspace(0.0, free.speed_rad_s, POINTS).tolist())
    radius = motor.rotor.radius_m
    speed = 1e3 * radius * curve["speed_rad_s"].values
    force, shaft = curve["torque_n_m"].values / radius, curve["shaft_power_w"].values
    put_in = (curve["power_a_w"] + curve["power_b_w"]).values
    efficiency = 100.0 * curve["efficiency"].values

    figure, axes = canvas(3, 1, 7.0, sharex=True)
    axes[0].plot(speed, force, "o-", color=BLUE, label="force")
    axes[0].set(title="(a) force on the rotor's rim", ylabel="force / N", ylim=(0.0, None))
    axes[1].plot(speed, put_in, "o-", color=VERMILION, label="electrical")
    axes[1].plot(speed, shaft, "o-", color=GREEN, label="at the shaft")
    axes[1].set(title="(b) power", ylabel="power / W", ylim=(0.0, None))
    axes[1].legend(loc="center right")
    axes[2].plot(speed, efficiency, "o-", color=GREY, label="efficiency")
    axes[2].set(title="(c) efficiency", xlabel="speed of the rim / (mm/s)", ylabel="efficiency / %", ylim=(0.0, None))
    best = int(np.nanargmax(efficiency))
    caption = (
        f"{motor_words(motor)} Drive: {drive_words(drive)}. {POINTS} steady states with the shaft held, from stall to "
        f"no load; the radius at the contact is {1e3 * radius:g} mm. ngspice {curve.attrs['ngspice_version']}."
    )
    write(figure, folder / "speed_force.png", "Force, power and efficiency versus speed", caption)
    return [
        f"{force[0]:.2f} N at stall, {speed[-1]:.0f} mm/s without load",
        f"best efficiency {efficiency[best]:.1f} % at {speed[best]:.0f} mm/s and {force[best]:.2f} N",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
