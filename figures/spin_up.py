# SPDX-License-Identifier: GPL-3.0-or-later
"""Spin-up of the rotor: its speed, and the contact's force and state in the last periods.

Eq. (2) with the common tone at the contact resonance (17.9 kHz, the tip hits the rotor) and the opposed tone at three
times that frequency, near the second mode under preload (55.5 kHz, the tip swings along the rotor). The phase lets the
tip press while it moves forward.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from style import BLACK, ORANGE, PURPLE, canvas, main, recent, state_handles, state_path, write

import pyspice_runner as pr

LOADS = {0.0: (PURPLE, "no load"), 1e-3: (ORANGE, "load of 1 mN·m")}
DURATION = 15e-3
PERIODS = 3


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoToneDrive(voltage_1=100.0, frequency_1=18e3, voltage_2=50.0, frequency_2=54e3, phase_deg=165.0)
    runs = {load: pr.simulate(motor, drive, duration=DURATION, load_torque=load) for load in LOADS}

    figure, axes = canvas(4, 1, 8.8, height_ratios=(1.4, 1.0, 1.0, 1.0))
    for run, (colour, name) in zip(runs.values(), LOADS.values(), strict=True):
        axes[0].plot(1e3 * run.time_s, run.rotor_speed_rad_s, color=colour, label=name)
    axes[0].set(
        title="(a) speed of the rotor", xlabel="time / ms", ylabel="speed / (rad/s)", xlim=(0.0, 1e3 * DURATION)
    )
    axes[0].legend(loc="lower right")

    run = runs[0.0]
    part = recent(run, PERIODS)
    time = 1e6 * (run.time_s[part] - run.time_s[part][0])
    velocity = np.gradient(1e3 * run.tip_x_m, run.time_s)
    panels = [
        (run.normal_force_n, "(b) normal force, last periods, no load", "force / N"),
        (run.friction_force_n, "(c) friction force, positive where it drives the rotor", "force / N"),
        (velocity, "(d) velocity of the tip along the rotor", "velocity / (mm/s)"),
    ]
    for panel, (values, title, label) in zip(axes[1:], panels, strict=True):
        state_path(panel, time, values[part], run.contact_state[part])
        panel.set(title=title, ylabel=label, xlim=(0.0, time[-1]))
        panel.sharex(axes[3])
    for panel in axes[1:3]:
        panel.tick_params(labelbottom=False)
    axes[1].axhline(motor.contact.preload_n, color=BLACK, lw=1.0, ls="--")
    axes[3].plot(time, 1e3 * motor.rotor.radius_m * run.rotor_speed_rad_s[part], color=BLACK, lw=1.0)
    axes[3].set_xlabel(f"time from {1e3 * run.time_s[part][0]:.2f} ms on / µs")
    handles = [
        *state_handles(),
        Line2D([], [], color=BLACK, lw=1.0, ls="--", label="preload"),
        Line2D([], [], color=BLACK, lw=1.0, label="surface of the rotor"),
    ]
    shares = run.state_fractions
    write(
        figure,
        folder / "spin_up.png",
        "The rotor spins up, pushed a little on every landing of the tip",
        f"Motor {motor.name}, preload {motor.contact.preload_n:g} N, friction {motor.contact.friction:g}, rotor "
        f"{motor.rotor.inertia_kg_m2:g} kg·m², radius {1e3 * motor.rotor.radius_m:g} mm. Eq. (2): U₁ = {drive.voltage_1:g} V "
        f"at {drive.frequency_1 / 1e3:g} kHz, U₂ = {drive.voltage_2:g} V at {drive.frequency_2 / 1e3:g} kHz, φ = "
        f"{drive.phase_deg:g}°, at full amplitude from t = 0; steps of {1e6 * run.provenance['run']['step_s']:.2f} µs; "
        f"ngspice {run.ngspice_version}. Last 20 periods: separated {shares['separated']:.0%}, stick {shares['stick']:.0%}, "
        f"slip {shares['slip']:.0%} of the time.",
        handles,
    )
    return [
        f"turns: {run.mean_rotor_speed_rad_s:.2f} rad/s ({run.mean_rotor_speed_rad_s * 60 / 2 / np.pi:.0f} rpm) after "
        f"{1e3 * DURATION:g} ms without load, {runs[1e-3].mean_rotor_speed_rad_s:.2f} rad/s against 1 mN·m",
        f"hits the rotor with up to {run.normal_force_n[part].max():.0f} N at a preload of {motor.contact.preload_n:g} N; "
        f"flies {shares['separated']:.0%}, sticks {shares['stick']:.0%}, slips {shares['slip']:.0%} of the time",
        f"energy balance closes to {100 * run.energy_residual:.1g} % of the {1e3 * run.energy.electrical:.2f} mJ put in",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
