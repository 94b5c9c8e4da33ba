# SPDX-License-Identifier: GPL-3.0-or-later
"""A speed loop designed from the small signals of the motor: loop gain, and its step response on both motors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREY, VERMILION, canvas, draft, drive_words, farthest, main, motor_words, samples, write

import pyspice_runner as pr
from pyspice_runner.control.loop import LoopController

MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": 60.0})
SAMPLE_TIME = 0.5e-3  # s; the loop delays by it: half by the mean over the last interval, half by the next
CROSSOVER, MARGIN = 40.0, 75.0  # Hz, deg
BEGIN, END = (1.5e-3, 3e-3) if draft() else (25e-3, 45e-3)  # s: of the step, of the run
STEP = 3.0  # rad/s


def draw(folder: Path) -> list[str]:
    loop = pr.control_loop(
        MOTOR, DRIVE, quantity="speed", crossover=CROSSOVER, margin=MARGIN, sample_time=SAMPLE_TIME
    )  # fmt: skip
    before = loop.provenance["run"]["operating_point"]["speed"]
    averaged, full = (
        pr.simulate_controlled(
            MOTOR, DRIVE, LoopController(loop, lambda time: before + STEP * (time > BEGIN)), duration=END,
            sample_time=SAMPLE_TIME, averaged=averaged,
        )
        for averaged in (True, False)
    )  # fmt: skip
    figure, axes = canvas(2, 2, 5.4)
    (size, speed), (phase, voltage) = axes
    frequency = loop.frequency_hz
    for values, colour, name in (
        (loop.plant, GREY, "speed per amplitude / (rad/(V s))"),
        (loop.loop_gain, BLUE, "loop gain"),
    ):
        size.loglog(frequency, np.abs(values), color=colour, label=name)
        phase.semilogx(frequency, np.degrees(np.unwrap(np.angle(values))), color=colour)
    size.axhline(1.0, color=BLACK, lw=0.7)
    phase.axhline(-180.0, color=BLACK, lw=0.7)
    margin = loop.phase_margin_deg
    phase.plot([CROSSOVER] * 2, [-180.0, margin - 180.0], "o-", color=VERMILION, ms=3, label=f"margin {margin:.0f}°")
    size.set(ylabel="magnitude", title="(a) small signals")
    phase.set(ylabel="phase / °", xlabel="modulation frequency / Hz")
    samples(speed, averaged, full, "speed_rad_s", 1.0, "speed / (rad/s)")
    samples(voltage, averaged, full, "voltage_a_v", 1.0, "amplitude / V")
    speed.set_title("(b) step of the set point")
    speed.axhline(before + STEP, xmin=BEGIN / END, color=BLACK, lw=0.9, ls="--", label="set point")
    voltage.set_xlabel("time / ms")
    size.legend(loc="lower left")
    phase.legend(loc="lower left")
    speed.legend(loc="lower right")
    apart = farthest(averaged, full, "speed_rad_s")
    gains = ", ".join(f"{name} {value:.3g} {loop.gain_units[name]}" for name, value in loop.gains.items())
    bound = "" if loop.gain_margin_db is None else f", gain margin {loop.gain_margin_db:.1f} dB"
    caption = (
        f"{motor_words(MOTOR)} Drive: {drive_words(DRIVE)}. PI controller ({gains}), sampled every "
        f"{1e3 * SAMPLE_TIME:g} ms: crossover {CROSSOVER:g} Hz{bound}. Speeds of the averaged and the full motor "
        f"differ by at most {apart:.2g} % of the maximum."
    )
    write(figure, folder / "speed_loop.png", "From the motor's small signals to a speed loop", caption)
    return [gains, f"from {before:.2f} rad/s by {STEP:g} rad/s", f"samples within {apart:.2g} % of the maximum"]


if __name__ == "__main__":
    main(draw, __doc__)
