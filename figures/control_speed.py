# SPDX-License-Identifier: GPL-3.0-or-later
"""A sampled controller of the speed with dead-band compensation: averaged and full motor give the same samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, GREY, canvas, controller, drive_words, farthest, main, motor_words, samples, write


def draw(folder: Path) -> list[str]:
    defined, averaged, full = controller("speed", 40e-3)
    drive, speed, reversal = defined["DRIVE"], defined["SPEED"], defined["REVERSAL"]
    figure, axes = canvas(3, 1, 6.2, sharex=True)
    time = averaged.time_s
    axes[0].plot(1e3 * time, np.where(time < reversal, speed, -speed), color=BLACK, lw=0.9, ls="--", label="set point")
    samples(axes[0], averaged, full, "speed_rad_s", 1.0, "speed / (rad/s)")
    samples(axes[1], averaged, full, "voltage_a_v", 1.0, "amplitude / V")
    axes[1].axhline(defined["DEAD_BAND"], color=GREY, lw=0.9, ls="--", label="dead band")
    samples(axes[2], averaged, full, "phase_deg", 1.0, "phase of group B / °")
    axes[2].set_xlabel("time / ms")
    for axis in axes[:2]:
        axis.legend(loc="upper right", bbox_to_anchor=(1.0, 0.95))
    names = ("speed_rad_s", "position_rad", "current_amplitude_a", "voltage_a_v")
    worst = max(farthest(averaged, full, name) for name in names)
    caption = (
        f"{motor_words(defined['MOTOR'])} Drive at the start: {drive_words(drive)}. A PI controller, sampled every "
        f"{1e3 * defined['SAMPLE_TIME']:g} ms, sets the amplitude above the dead band of {defined['DEAD_BAND']:g} V, "
        f"and the phase by its sign. Speed, position, current and amplitude differ by at most {worst:.2g} % of "
        "their maximum. examples/controllers/speed.py and speed.c."
    )
    write(figure, folder / "control_speed.png", "Speed control with dead-band compensation", caption)
    return [f"{name}: {farthest(averaged, full, name):.2g} %" for name in names]


if __name__ == "__main__":
    main(draw, __doc__)
