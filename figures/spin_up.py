# SPDX-License-Identifier: GPL-3.0-or-later
"""Spin-up of the rotor: its speed, and the contact's forces and state in the last periods.

Eq. (2), the common tone near the contact resonance (17.9 kHz), so that the tip hits the rotor, the opposed tone at
three times its frequency, near the second mode under preload (55.5 kHz), so that the tip moves along the rotor. With
this phase the normal force is at its maximum during the forward motion.
"""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from style import (
    BLACK,
    ORANGE,
    PURPLE,
    canvas,
    draft,
    drive_words,
    main,
    motor_words,
    recent,
    simulated,
    state_handles,
    state_path,
    write,
)

import pyspice_runner as pr

LOAD = 30e-3  # N·m
DURATION = 2e-3 if draft() else 30e-3
PERIODS = 3


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    run = simulated(motor, drive, duration=DURATION)
    loaded = simulated(motor, drive, duration=DURATION, load_torque=LOAD)

    figure, axes = canvas(4, 1, 8.8, height_ratios=(1.4, 1.0, 1.0, 1.0))
    axes[0].plot(1e3 * run.time_s, run.rotor_speed_rad_s, color=PURPLE, label="no load")
    axes[0].plot(1e3 * run.time_s, loaded.rotor_speed_rad_s, color=ORANGE, label=f"load of {1e3 * LOAD:g} mN·m")
    axes[0].set(title="(a) speed of the rotor", xlabel="time / ms", ylabel="speed / (rad/s)")
    axes[0].set_xlim(0.0, 1e3 * DURATION)
    axes[0].legend(loc="lower right")

    part = recent(run, PERIODS)
    time = 1e6 * (run.time_s[part] - run.time_s[part][0])
    tip = np.gradient(1e3 * run.tip_x_m, run.time_s)
    panels = [
        (run.normal_force_n, "(b) normal force, last periods, no load", "force / N"),
        (run.friction_force_n, "(c) friction force, positive where it drives the rotor", "force / N"),
        (tip, "(d) velocity of the tip along the rotor", "velocity / (mm/s)"),
    ]
    for panel, (values, title, label) in zip(axes[1:], panels, strict=True):
        state_path(panel, time, values[part], run.contact_state[part])
        panel.set(title=title, ylabel=label, xlim=(0.0, time[-1]))
    axes[1].axhline(motor.contact.preload_n, color=BLACK, lw=1.0, ls="--")
    axes[3].plot(time, 1e3 * motor.rotor.radius_m * run.rotor_speed_rad_s[part], color=BLACK, lw=1.0)
    axes[3].set_xlabel(f"time from {1e3 * run.time_s[part][0]:.2f} ms on / µs")
    handles = [
        *state_handles(),
        Line2D([], [], color=BLACK, lw=1.0, ls="--", label="preload"),
        Line2D([], [], color=BLACK, lw=1.0, label="surface of the rotor"),
    ]
    shares = run.state_fractions
    times = f"separated {shares['separated']:.0%}, stick {shares['stick']:.0%}, slip {shares['slip']:.0%} of the time"
    caption = (
        f"{motor_words(motor)} Rotor: inertia {1e7 * motor.rotor.inertia_kg_m2:g} g·cm², radius "
        f"{1e3 * motor.rotor.radius_m:g} mm, bearing {1e6 * motor.rotor.bearing_damping_n_m_s:g} µN·m·s. Drive: "
        f"{drive_words(drive)}, at full amplitude from t = 0. Steps of {1e6 * run.provenance['run']['step_s']:.2f} µs; "
        f"ngspice {run.ngspice_version}. Last 20 periods without load: {times}."
    )
    title = "Friction drives the rotor forward for a part of each period"
    write(figure, folder / "spin_up.png", title, caption, handles)
    speed, under_load = run.mean_rotor_speed_rad_s, loaded.mean_rotor_speed_rad_s
    return [
        f"{speed:.2f} rad/s ({speed * 30 / pi:.0f} rpm) without load, {under_load:.2f} rad/s at {1e3 * LOAD:g} mN·m",
        f"contact: {times}, up to {run.normal_force_n[part].max():.0f} N at a preload of {motor.contact.preload_n:g} N",
        f"energy: {1e3 * run.energy.electrical:.2f} mJ put in, {1e6 * run.energy_residual:.1g} ppm unaccounted for",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
