# SPDX-License-Identifier: GPL-3.0-or-later
"""A speed loop designed from the small signals of the motor: loop gain, and its step response on both motors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREY, VERMILION, canvas, draft, drive_words, farthest, main, motor_words, samples, write

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun
from pyspice_runner.control.simulate import Sample

MOTOR = pr.load_motor("beam40")
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": 69.0})
SAMPLE_TIME = 0.5e-3  # s; the loop delays by it: half by the mean over the last interval, half by the next
CROSSOVER, MARGIN = 40.0, 60.0  # Hz, deg
BEGIN, END = (1.5e-3, 3e-3) if draft() else (50e-3, 90e-3)  # s: of the step, of the run
BEFORE, AFTER = 8.0, 9.0  # rad/s


def design(frequency: np.ndarray, plant: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Return gain and time constant of the PI controller, and the loop gain."""
    delayed = plant * np.exp(-2j * np.pi * frequency * SAMPLE_TIME)
    place = np.log(CROSSOVER)
    size = np.exp(np.interp(place, np.log(frequency), np.log(np.abs(delayed))))
    phase = np.interp(place, np.log(frequency), np.unwrap(np.angle(delayed)))
    lag = np.tan(np.radians(180.0 - MARGIN) + phase)  # that the integral part may have
    constant = 1.0 / (2.0 * np.pi * CROSSOVER * lag)
    gain = 1.0 / (size * np.hypot(1.0, lag))
    return gain, constant, gain * (1.0 + 1.0 / (2j * np.pi * frequency * constant)) * delayed


def run(gain: float, constant: float, *, averaged: bool) -> ControlledRun:
    """Run the loop from rest, and step its set point."""
    integral = 0.0

    def controller(sample: Sample) -> dict[str, float]:
        nonlocal integral
        error = (BEFORE if sample.time_s < BEGIN else AFTER) - sample.speed_rad_s
        output = DRIVE.voltage + gain * error + integral
        if 45.0 < output < 110.0:  # no windup
            integral += gain * error * SAMPLE_TIME / constant
        return {"voltage": min(max(output, 45.0), 110.0)}

    return pr.simulate_controlled(MOTOR, DRIVE, controller, duration=END, sample_time=SAMPLE_TIME, averaged=averaged)


def draw(folder: Path) -> list[str]:
    signals = pr.small_signals(MOTOR, DRIVE, frequencies=np.geomspace(1.0, 500.0, 28))
    frequency, plant = signals.modulation_hz, signals.transfer("speed", "amplitude")
    gain, constant, loop = design(frequency, plant)
    averaged, full = (run(gain, constant, averaged=averaged) for averaged in (True, False))
    figure, axes = canvas(2, 2, 5.4)
    (size, speed), (phase, voltage) = axes
    for values, colour, name in ((plant, GREY, "speed per amplitude, rad/s/V"), (loop, BLUE, "loop gain")):
        size.loglog(frequency, np.abs(values), color=colour, label=name)
        phase.semilogx(frequency, np.degrees(np.unwrap(np.angle(values))), color=colour)
    size.axhline(1.0, color=BLACK, lw=0.7)
    phase.axhline(-180.0, color=BLACK, lw=0.7)
    phase.plot([CROSSOVER] * 2, [-180.0, MARGIN - 180.0], "o-", color=VERMILION, ms=3, label=f"margin {MARGIN:g}°")
    size.set(ylabel="magnitude", title="(a) small signals")
    phase.set(ylabel="phase / °", xlabel="modulation frequency / Hz")
    samples(speed, averaged, full, "speed_rad_s", 1.0, "speed / rad/s")
    samples(voltage, averaged, full, "voltage_a_v", 1.0, "amplitude / V")
    speed.set_title("(b) step of the set point")
    speed.axhline(AFTER, xmin=BEGIN / END, color=BLACK, lw=0.9, ls="--", label="set point")
    voltage.set_xlabel("time / ms")
    size.legend(loc="lower left")
    phase.legend(loc="lower left")
    speed.legend(loc="lower right")
    late = averaged.time_s > BEGIN
    over = [100.0 * (one.speed_rad_s[late].max() - AFTER) / (AFTER - BEFORE) for one in (averaged, full)]
    caption = (
        f"{motor_words(MOTOR)} Drive: {drive_words(DRIVE)}. PI controller, {gain:.2f} V s/rad and "
        f"{1e3 * constant:.1f} ms, sampled every {1e3 * SAMPLE_TIME:g} ms: crossover {CROSSOVER:g} Hz. Overshoot "
        f"{over[0]:.0f} % averaged, {over[1]:.0f} % full. Speeds differ by "
        f"{farthest(averaged, full, 'speed_rad_s'):.2g} % of the greatest at most."
    )
    write(figure, folder / "speed_loop.png", "From the motor's small signals to a speed loop", caption)
    return [
        f"gain {gain:.3g} V s/rad, time constant {1e3 * constant:.3g} ms",
        f"overshoot {over[0]:.1f} % averaged, {over[1]:.1f} % full",
        f"samples within {farthest(averaged, full, 'speed_rad_s'):.2g} % of the greatest",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
