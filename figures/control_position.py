# SPDX-License-Identifier: GPL-3.0-or-later
"""A sampled controller of the position with a burst at the end: averaged and full motor give the same samples."""

from __future__ import annotations

from pathlib import Path

from style import BLACK, BLUE, VERMILION, canvas, controller, farthest, main, motor_words, samples, write


def draw(folder: Path) -> list[str]:
    defined, averaged, full = controller("position", 30e-3)
    target, burst, length = defined["TARGET"], defined["BURST"], defined["LENGTH"]
    figure, axes = canvas(4, 1, 7.6, sharex=True)
    axes[0].axhline(1e3 * target, color=BLACK, lw=0.9, ls="--", label="target")
    samples(axes[0], averaged, full, "position_rad", 1e3, "position / mrad")
    samples(axes[1], averaged, full, "speed_rad_s", 1.0, "speed / (rad/s)")
    samples(axes[2], averaged, full, "voltage_a_v", 1.0, "amplitude / V")
    for run, mark, colour in ((averaged, "-", BLUE), (full, ".", VERMILION)):
        axes[3].semilogy(1e3 * run.time_s, 1e6 * abs(target - run.position_rad), mark, ms=3.5, color=colour)
    axes[3].set(ylabel="distance / µrad", xlabel="time / ms", ylim=(1.0, 2e5))
    for axis in axes:
        axis.axvspan(1e3 * burst, 1e3 * (burst + length), color="#EEEEEE")
    axes[0].legend(loc="lower right")
    ends = [1e6 * (target - run.position_rad[-1]) for run in (averaged, full)]
    names = ("position_rad", "speed_rad_s", "current_amplitude_a", "voltage_a_v")
    worst = max(farthest(averaged, full, name) for name in names)
    caption = (
        f"{motor_words(defined['MOTOR'])} A profile of the speed, sampled every {1e3 * defined['SAMPLE_TIME']:g} ms, "
        f"to {1e3 * defined['NEAR']:g} mrad before the target; there the drive is switched off. Grey: a burst of "
        f"{1e3 * length:g} ms, whose amplitude results from the distance to the target. At the end "
        f"the distance is {ends[0]:.0f} µrad with the averaged and {ends[1]:.0f} µrad with the full motor. Position, "
        f"speed, current and amplitude differ by at most {worst:.2g} % of their maximum. "
        "examples/controllers/position.py."
    )
    write(figure, folder / "control_position.png", "Position control with a burst at the end", caption)
    return [f"distance at the end: {ends[0]:.0f} and {ends[1]:.0f} µrad", *(
        f"{name}: {farthest(averaged, full, name):.2g} %" for name in names
    )]  # fmt: skip


if __name__ == "__main__":
    main(draw, __doc__)
