# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed over preload, without load and under load, and the stall torque over preload."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREY, ORANGE, VERMILION, canvas, draft, drive_words, main, write

import pyspice_runner as pr

PRELOADS = (2.0, 10.0) if draft() else (1.0, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 13.0, 16.0, 20.0)  # N
SPEEDS = np.arange(0.0, 36.1, 36.0 if draft() else 4.0)
SETTLING = {"tolerance": 0.1, "patience": 4} if draft() else {}
LOADS = {0.0: BLUE, 3e-3: ORANGE, 6e-3: VERMILION}  # N·m


def draw(folder: Path) -> list[str]:
    motor = pr.load_motor("andersen2002-unintended-mode")
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
    curves = pr.speed_torque(motor, drive, speeds=SPEEDS, over={"contact.preload_n": PRELOADS}, **SETTLING)
    torque = curves["load_torque_n_m"].values
    stall = torque[:, 0]

    figure, (speed, holding) = canvas(1, 2, 5.6)
    stories = []
    for load, colour in LOADS.items():
        at = np.array([_speed(row, load) for row in torque])
        speed.plot(PRELOADS, at, color=colour, marker="o", ms=3, label=f"{1e3 * load:g} mN·m")
        best = int(np.nanargmax(at))
        stories.append(f"load of {1e3 * load:g} mN·m: fastest, {at[best]:.1f} rad/s, at {PRELOADS[best]:g} N")
    speed.set(title="(a) speed under load", ylabel="speed / (rad/s)")
    speed.set_ylim(bottom=0.0)
    speed.legend(title="load torque", title_fontsize=8)
    holding.plot(PRELOADS, 1e3 * stall, color=BLACK, marker="o", ms=3, label="stall torque")
    friction = 1e3 * motor.contact.friction * motor.rotor.radius_m * np.array(PRELOADS)
    holding.plot(PRELOADS, friction, color=GREY, ls="--", label="μ F₀ R")
    holding.set(title="(b) stall torque", ylabel="torque / (mN·m)", ylim=(0.0, 1.3e3 * stall.max()))
    holding.legend()
    for panel in (speed, holding):
        panel.set(xlabel="preload / N", xlim=(0.0, PRELOADS[-1] + 0.5))
    settled = "all settled" if bool(curves["settled"].all()) else "not all of them settled"
    caption = (
        f"Motor {motor.name}, friction {motor.contact.friction:g}. Drive: {drive_words(drive)}. Speeds under load are "
        f"read from curves of {len(SPEEDS)} held speeds at {len(PRELOADS)} preloads, {settled}. μ F₀ R is what the "
        f"contact could hold at the preload; a tip that lifts off presses harder meanwhile. "
        f"ngspice {curves.attrs['ngspice_version']}."
    )
    write(figure, folder / "preload.png", "Press harder: more torque, less speed", caption)
    strongest = int(np.argmax(stall))
    return [*stories, f"most stall torque, {1e3 * stall[strongest]:.1f} mN·m, at {PRELOADS[strongest]:g} N"]


def _speed(torque: np.ndarray, load: float) -> float:
    """Return the speed at which a falling curve has a torque; NaN where the motor does not reach it."""
    return float(np.interp(load, torque[::-1], SPEEDS[::-1], left=np.nan, right=np.nan))


if __name__ == "__main__":
    main(draw, __doc__)
