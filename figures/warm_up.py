# SPDX-License-Identifier: GPL-3.0-or-later
"""A phase-locked loop over ten minutes of warm-up by the averaged motor, and its first milliseconds cycle by cycle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, BLUE, GREEN, VERMILION, canvas, draft, main, motor_words, write

import pyspice_runner as pr
from pyspice_runner.trackers.tracker import running_resonance

MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": 50.0})
FIRST, WHOLE = (2.4e-3, 600.0) if draft() else (8e-3, 600.0)
OFFSET, TARGET = 0.01, -30.0


def draw(folder: Path) -> list[str]:
    voltages = {"voltage": DRIVE.voltage, "phase_deg": DRIVE.phase_deg, "target_deg": TARGET}
    lag = running_resonance(MOTOR, pr.Tracker(kind="pll", frequency=DRIVE.frequency, **voltages))
    tracker = pr.Tracker(kind="pll", frequency=lag.resonance_hz, offset=OFFSET, **voltages)
    full = pr.track(MOTOR, tracker, duration=FIRST, margin=False)
    start = pr.track(MOTOR, tracker, duration=FIRST, averaged=True, margin=False)
    whole = pr.track(MOTOR, tracker, disturb="warm-up", duration=WHOLE, averaged=True)
    fixed = pr.track(
        MOTOR, tracker.model_copy(update={"kind": "none", "frequency": start.end_frequency_hz, "offset": 0.0}),
        disturb="warm-up", duration=WHOLE, averaged=True,
    )  # fmt: skip

    figure, axes = canvas(3, 2, 6.6, sharex="col")
    for row, (name, scale, what) in enumerate(
        (("frequency_hz", 1e-3, "frequency / kHz"), ("phase_deg", 1.0, "phase of mode 4 / °"),
         ("rotor_speed_rad_s", 1.0, "speed / (rad/s)"))
    ):  # fmt: skip
        left, right = axes[row]
        left.plot(
            1e3 * full.time_s, scale * getattr(full, name), color=VERMILION, lw=2.4, alpha=0.5, label="full motor"
        )
        left.plot(1e3 * start.time_s, scale * getattr(start, name), color=BLUE, lw=1.1, label="averaged motor")
        left.set_ylabel(what)
        late = whole.time_s > 1.0
        right.plot(whole.time_s[late] / 60.0, scale * getattr(whole, name)[late], color=BLUE, label="tracked")
        late = fixed.time_s > 1.0
        right.plot(fixed.time_s[late] / 60.0, scale * getattr(fixed, name)[late], color=BLACK, ls="--", lw=0.9,
                   label="fixed frequency")  # fmt: skip
    axes[1, 0].set_ylim(-90.0, 60.0)
    heat = axes[0, 1].twinx()
    heat.grid(visible=False)
    heat.plot(whole.time_s / 60.0, whole.temperature_k, color=GREEN, lw=0.9)
    heat.set_ylabel("temperature rise / K", color=GREEN)
    axes[2, 0].set_xlabel("time / ms")
    axes[2, 1].set_xlabel("time / min")
    axes[0, 0].set_title("(a) lock, cycle by cycle and averaged")
    axes[0, 1].set_title("(b) warm-up, averaged")
    axes[0, 0].legend(loc="upper right")
    axes[2, 1].legend(loc="center right")
    assert whole.loop is not None
    at = np.linspace(0.3e-3, FIRST, 200)
    off = np.interp(at, start.time_s, start.rotor_speed_rad_s) - np.interp(at, full.time_s, full.rotor_speed_rad_s)
    error = 100.0 * np.sqrt(np.mean(off**2)) / np.abs(full.rotor_speed_rad_s).max()
    caption = (
        f"{motor_words(MOTOR)} Drive: {DRIVE.voltage:g} V, φ = {DRIVE.phase_deg:g}°. The loop starts at "
        f"{1e-3 * tracker.frequency * (1.0 + OFFSET):.2f} kHz and holds the motional current at −{-TARGET:g}°. "
        f"Speeds in (a) differ by {error:.1f} % RMS of the maximum. (b): {WHOLE:g} s; phase margin at "
        f"the end {whole.loop.phase_margin_deg:.0f}° at {whole.loop.crossover_hz:.0f} Hz. The copies of the clamped "
        "capacitances do not warm up, so that the phase drifts. Thermal model: that of the set, Thermal.of(motor)."
    )
    write(figure, folder / "warm_up.png", "Ten minutes of warm-up with a phase-locked loop", caption)
    drift = whole.frequency_hz[-1] - start.end_frequency_hz
    speeds = whole.rotor_speed_rad_s[-1], fixed.rotor_speed_rad_s[-1]
    return [
        f"{WHOLE:g} s of warm-up: {whole.temperature_k[-1]:.3g} K, {drift:.0f} Hz",
        f"speed at the end: {speeds[0]:.3g} rad/s tracked, {speeds[1]:.3g} rad/s at a fixed frequency",
        f"first {1e3 * FIRST:g} ms: speed within {error:.2g} % RMS of that cycle by cycle",
    ]


if __name__ == "__main__":
    main(draw, __doc__)
