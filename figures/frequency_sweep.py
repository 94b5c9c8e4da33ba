# SPDX-License-Identifier: GPL-3.0-or-later
"""Stall torque and no-load speed over the drive's frequency, swept up and down, near the contact resonance.

A tip that lifts off is in contact for part of the period only, so that its resonance frequency falls with the
amplitude. In a range of frequencies the tip either hammers or stays in contact, which depends on the direction of the
sweep. Each point continues from the end of the previous one (``follow``), separately for each speed of the shaft.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray
from style import BLACK, BLUE, GREEN, VERMILION, canvas, draft, drive_words, main, motor_words, write

import pyspice_runner as pr

VOLTAGE = 30.0
FREQUENCIES = 1e3 * np.array([16.2, 16.4, *np.arange(16.5, 17.01, 0.05), 17.2, 17.5, 17.8, 18.1, 18.4])
if draft():
    FREQUENCIES = FREQUENCIES[5::8]
SPEEDS = (0.0, 0.4) if draft() else (-0.3, 0.0, 0.4, 0.8)  # rad/s
SETTLING = {"tolerance": 0.1, "patience": 4} if draft() else {"patience": 8}


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=VOLTAGE, frequency=FREQUENCIES[0], phase_deg=90.0)
    there_and_back = np.concatenate([FREQUENCIES, FREQUENCIES[::-1]])
    swept = pr.speed_torque(
        motor,
        drive,
        speeds=SPEEDS,
        over={"drive.frequency": there_and_back},
        mode="settle",
        follow="drive.frequency",
        **SETTLING,
    )
    count = len(FREQUENCIES)
    up = swept.isel({"drive.frequency": slice(count)})
    down = swept.isel({"drive.frequency": slice(None, count - 1, -1)})
    stall = [one.sel(speed_rad_s=0.0) for one in (up, down)]
    differs = np.abs(stall[0]["separated"].values - stall[1]["separated"].values) > 0.05

    figure, (torque, speed, force) = canvas(3, 1, 7.4, sharex=True)
    kilohertz = FREQUENCIES / 1e3
    for one, held, colour, label, marker in (
        (up, stall[0], BLUE, "up", "^"),
        (down, stall[1], VERMILION, "down", "v"),
    ):
        line = {"color": colour, "marker": marker, "ms": 4, "label": f"swept {label}"}
        for panel, values in (
            (torque, 1e3 * held["torque_n_m"].values),
            (speed, _no_load(one)),
            (force, held["normal_force_n"].values),
        ):
            panel.plot(kilohertz, values, **line)
        drifting = ~held["settled"].values
        torque.plot(
            kilohertz[drifting], 1e3 * held["torque_n_m"].values[drifting],
            marker=marker, ms=4, ls="", mfc="white", mec=colour, zorder=3,
        )  # fmt: skip
    torque.set(title="(a) stall torque; hollow: it still creeps", ylabel="torque / (mN·m)")
    speed.set(title="(b) no-load speed", ylabel="speed / (rad/s)")
    force.set(title="(c) mean normal force at stall", ylabel="force / N", xlabel="frequency / kHz")
    force.axhline(motor.contact.preload_n, color=BLACK, lw=0.8, ls="--", label="preload")
    for panel in (torque, speed):
        panel.axhline(0.0, color=BLACK, lw=0.6)
    for panel in (torque, speed, force):
        if differs.any():
            low, high = kilohertz[differs][[0, -1]]
            panel.axvspan(low - 0.025, high + 0.025, color=GREEN, alpha=0.12, lw=0.0)
        panel.legend()
    band = f"{kilohertz[0]:g} to {kilohertz[-1]:g} kHz"
    words = drive_words(drive).replace(f"{kilohertz[0]:.4g} kHz", band)
    caption = (
        f"{motor_words(motor)} Drive: {words}. Shaft held at {len(SPEEDS)} speeds; the no-load speed is read between "
        f"them, where only the bearing's torque is left. Green: the tip lifts off on the way down but not on the way "
        f"up. Where it stays down (left), it sticks: a standing rotor is held by friction at any torque that was "
        f"there, which creeps. ngspice {swept.attrs['ngspice_version']}."
    )
    write(figure, folder / "frequency_sweep.png", "Up or down: near the contact resonance the motor remembers", caption)
    if not differs.any():
        return ["the sweeps up and down agree everywhere"]
    place = int(np.flatnonzero(differs)[len(np.flatnonzero(differs)) // 2])
    values = [float(one["normal_force_n"][place]) for one in stall]
    story = (
        f"up and down differ from {low:.4g} to {high:.4g} kHz: at {kilohertz[place]:.4g} kHz the mean normal force is "
        f"{values[0]:.1f} N on the way up, {values[1]:.1f} N on the way down"
    )
    return [story]


def _no_load(swept: xarray.Dataset) -> np.ndarray:
    """Return the speed at which the load torque is zero, over frequency; NaN outside the calculated speeds."""
    torques = swept["load_torque_n_m"].values
    return np.array([np.interp(0.0, -row, SPEEDS, left=np.nan, right=np.nan) for row in torques])


if __name__ == "__main__":
    main(draw, __doc__)
