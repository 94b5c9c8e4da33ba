# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed over preload, without load and under load, and the stall torque over preload."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from style import BLACK, BLUE, GREY, ORANGE, VERMILION, canvas, draft, drive_words, main, write

import pyspice_runner as pr

PRELOADS = (3.0, 10.0) if draft() else (1.0, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 13.0, 16.0, 20.0)  # N
SPEEDS = np.arange(0.0, 36.1, 36.0 if draft() else 4.0)
SETTLING = {"tolerance": 0.1, "patience": 4} if draft() else {}
LOADS = {0.0: BLUE, 3e-3: ORANGE, 6e-3: VERMILION}  # N·m


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002-unintended-mode")
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
    preloads = np.array(PRELOADS)
    points = pr.working_points(
        motor, drive, over={"contact.preload_n": PRELOADS, "speed": SPEEDS.tolist()}, accuracy=0.002
    )
    torque = points["load_torque_n_m"].values
    stall = torque[:, 0]
    unstable = ~points["stable"].values.all(axis=1)
    settled = pr.speed_torque(
        motor, drive, speeds=[0.0], over={"contact.preload_n": preloads[unstable].tolist()}, mode="settle", **SETTLING
    )["load_torque_n_m"].values[:, 0]

    figure, (speed, holding) = canvas(1, 2, 5.6)
    stories = []
    for load, colour in LOADS.items():
        at = np.array([_speed(row, load) for row in torque])
        speed.plot(preloads, at, color=colour, label=f"{1e3 * load:g} mN·m")
        _mark(speed, preloads, at, unstable, colour)
        best = int(np.nanargmax(np.where(unstable, np.nan, at)))
        stories.append(f"load of {1e3 * load:g} mN·m: fastest, {at[best]:.1f} rad/s, at {preloads[best]:g} N")
    speed.set(title="(a) speed under load; hollow: unstable", ylabel="speed / (rad/s)")
    speed.set_ylim(bottom=0.0)
    speed.legend(title="load torque", title_fontsize=8)
    holding.plot(preloads, 1e3 * stall, color=BLACK, label="stall torque")
    _mark(holding, preloads, 1e3 * stall, unstable, BLACK)
    holding.plot(
        preloads[unstable], 1e3 * settled, color=VERMILION, marker="x", ms=6, ls="", label="mean of a transient"
    )
    friction = 1e3 * motor.contact.friction * motor.rotor.radius_m * preloads
    holding.plot(preloads, friction, color=GREY, ls="--", label="μ F₀ R")
    holding.set(title="(b) stall torque", ylabel="torque / (mN·m)", ylim=(0.0, 1.3e3 * stall.max()))
    holding.legend()
    for panel in (speed, holding):
        panel.set(xlabel="preload / N", xlim=(0.0, PRELOADS[-1] + 0.5))
    low, high = preloads[unstable][[0, -1]]
    pressed = motor.updated({"contact.preload_n": low})
    multiplier = pr.steady_state(pressed, drive, speed=0.0).floquet_multipliers[0]
    beat = abs(np.angle(multiplier)) / (2.0 * np.pi) * drive.frequency
    caption = (
        f"Motor {motor.name} on its mount, friction {motor.contact.friction:g}. Drive: {drive_words(drive)}. Steady "
        f"states at {len(SPEEDS)} held speeds and {len(PRELOADS)} preloads; speeds under load are read from these "
        f"curves. From {low:g} to {high:g} N the periodic motion is unstable: a second oscillation, of "
        f"{1e-3 * beat:.1f} kHz at {low:g} N, grows, and a transient has another mean torque (crosses). μ F₀ R is the "
        f"friction torque at the preload. ngspice {points.attrs['ngspice_version']}."
    )
    write(figure, folder / "preload.png", "Speed and stall torque versus preload", caption)
    strongest = int(np.argmax(stall))
    stories.append(f"most stall torque, {1e3 * stall[strongest]:.1f} mN·m, at {PRELOADS[strongest]:g} N")
    for preload, periodic, mean in zip(preloads[unstable], stall[unstable], settled, strict=True):
        stories.append(
            f"{preload:g} N: stall {1e3 * periodic:.1f} mN·m of the unstable motion, {1e3 * mean:.1f} of a transient"
        )
    return stories


def _mark(panel: Axes, places: np.ndarray, values: np.ndarray, unstable: np.ndarray, colour: str) -> None:
    """Mark points, the unstable ones hollow."""
    for chosen, face in ((unstable, "white"), (~unstable, colour)):
        panel.plot(places[chosen], values[chosen], color=colour, marker="o", mfc=face, ms=4, ls="", zorder=3)


def _speed(torque: np.ndarray, load: float) -> float:
    """Return the speed at which a falling curve has a torque; NaN where the motor does not reach it."""
    return float(np.interp(load, torque[::-1], SPEEDS[::-1], left=np.nan, right=np.nan))


if __name__ == "__main__":
    main(draw, __doc__)
