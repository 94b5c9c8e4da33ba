# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor beam40 at its recommended drive: speed, torque, efficiency, preload, dead band, current and limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, canvas, draft, main, write

import pyspice_runner as pr

COLOURS = (ORANGE, GREEN, BLUE)


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("beam40")
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    radius, limits = motor.rotor.radius_m, motor.limits
    assert limits is not None
    speeds = np.linspace(0.0, 32.0, 2 if draft() else 9)
    voltages = [round(part * drive.voltage) for part in ((1.0,) if draft() else (0.5, 0.75, 1.0))]
    family = pr.speed_torque(motor, drive, speeds=speeds, over={"drive.voltage": voltages}, audit=False)
    preloads = np.array([3.0, 5.0, 6.5, 8.0, 10.0, 12.0])[:: 3 if draft() else 1]
    few = [0.0, 16.0] if draft() else [0.0, 8.0, 16.0]
    pressed = pr.speed_torque(motor, drive, speeds=few, over={"contact.preload_n": preloads}, audit=False)
    weak = np.linspace(0.5, 1.0, 2) * drive.voltage if draft() else np.linspace(0.1, 1.0, 10) * drive.voltage
    dead = pr.speed_torque(motor, drive, speeds=[0.0], over={"drive.voltage": weak}, audit=False)
    rim = 1e3 * radius * speeds
    figure, axes = canvas(4, 2, 11.0)
    flat = list(axes.flat)
    for voltage, colour in zip(voltages, COLOURS, strict=False):
        curve = family.sel({"drive.voltage": voltage})
        flat[0].plot(rim, curve["load_torque_n_m"] / radius, "o-", color=colour, ms=3, label=f"{voltage:g} V")
        flat[1].plot(rim, 100.0 * curve["efficiency"].where(curve["load_torque_n_m"] > 0.0), "o-", color=colour, ms=3)
        flat[4].plot(rim, 1e3 * curve["current_a_rms_a"], "o-", color=colour, ms=3)
        flat[4].plot(rim, 1e3 * curve["current_b_rms_a"], "o--", color=colour, ms=3)
        flat[5].plot(rim, curve["power_a_w"] + curve["power_b_w"], "o-", color=colour, ms=3)
        flat[5].plot(rim, curve["shaft_power_w"], "o--", color=colour, ms=3)
        flat[6].plot(rim, 1e-6 * curve["ceramic_stress_pa"], "o-", color=colour, ms=3)
        flat[7].plot(rim, curve["temperature_rise_k"], "o-", color=colour, ms=3)
    flat[0].axhline(0.0, color=BLACK, lw=0.6)
    stall = pressed["torque_n_m"].sel(speed_rad_s=0.0) / radius
    flat[2].plot(preloads, stall, "o-", color=VERMILION, ms=3, label="stall force, N")
    best = (100.0 * pressed["efficiency"]).max("speed_rad_s")
    flat[2].plot(preloads, 0.1 * best, "o-", color=PURPLE, ms=3, label="efficiency, 10 %")
    flat[3].plot(weak, dead["torque_n_m"].sel(speed_rad_s=0.0) / radius, "o-", color=VERMILION, ms=3)
    flat[6].axhline(1e-6 * limits.dynamic_strength_pa, color=BLACK, ls=":", lw=1.0)
    titles = (
        ("(a) force at the rim", "N"), ("(b) efficiency", "%"), ("(c) preload at the drive", ""),
        ("(d) stall force, dead band", "N"), ("(e) current, A solid, B dashed", "mA rms"),
        ("(f) power, shaft dashed", "W"), ("(g) stress of the ceramic, limit dotted", "MPa"),
        ("(h) temperature rise", "K"),
    )  # fmt: skip
    for index, (axis, (title, unit)) in enumerate(zip(flat, titles, strict=True)):
        across = {2: "preload / N", 3: "voltage / V"}.get(index, "speed of the rim / mm/s")
        axis.set(title=title, ylabel=unit, xlabel=across)
    flat[0].legend(fontsize=7)
    flat[2].legend(fontsize=7)
    full = family.sel({"drive.voltage": voltages[-1]})
    load = full["load_torque_n_m"].values
    free = f"{np.interp(0.0, -load, rim):.0f}" if (load < 0.0).any() else f"more than {rim[-1]:.0f}"
    facts = (
        f"{drive.label}: stall {float(full['torque_n_m'][0]) / radius:.2f} N at the rim, no load {free} mm/s, best "
        f"efficiency {100 * float(full['efficiency'].where(full['load_torque_n_m'] > 0).max()):.0f} %, at most "
        f"{float((full['power_a_w'] + full['power_b_w']).max()):.2f} W, "
        f"{1e3 * float(np.fmax(full['current_a_rms_a'], full['current_b_rms_a']).max()):.1f} mA rms, "
        f"{1e-6 * float(full['ceramic_stress_pa'].max()):.1f} MPa and {float(full['temperature_rise_k'].max()):.1f} K."
    )
    path = folder / "beam40.png"
    write(figure, path, "beam40 at its recommended drive", facts)
    return [str(path), facts]


if __name__ == "__main__":
    main(draw, __doc__)
