# SPDX-License-Identifier: GPL-3.0-or-later
"""A sampled controller keeps the phase of the motional current: averaged and full motor give the same samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from style import BLACK, GREY, canvas, controller, drive_words, farthest, main, motor_words, samples, write

import pyspice_runner as pr


def draw(folder: Path) -> list[str]:
    defined, averaged, full = controller("resonance", 40e-3)
    motor, drive = defined["MOTOR"], defined["DRIVE"]
    constant = pr.simulate_controlled(
        motor, drive, lambda _: {}, duration=averaged.time_s[-1], sample_time=defined["SAMPLE_TIME"],
        load_torque=defined["LOAD_TORQUE"],
    )  # fmt: skip
    figure, axes = canvas(3, 1, 6.2, sharex=True)
    samples(axes[0], averaged, full, "frequency_hz", 1e-3, "frequency / kHz")
    for run in (averaged, full):
        before = np.concatenate(([drive.frequency], run.frequency_hz[:-1]))
        samples_of = zip(*(run.samples[name] for name in pr.Sample.__dataclass_fields__), before, strict=True)
        phases = [defined["motional_phase"](pr.Sample(*each[:-1]), each[-1]) for each in samples_of]
        run.samples["motional_phase_deg"] = np.array(phases)
    samples(axes[1], averaged, full, "motional_phase_deg", 1.0, "motional phase of B / °")
    axes[1].axhline(defined["TARGET"], color=BLACK, lw=0.9, ls="--", label="target")
    samples(axes[2], averaged, full, "speed_rad_s", 1.0, "speed / (rad/s)")
    axes[2].plot(1e3 * constant.time_s, constant.speed_rad_s, color=GREY, label="averaged motor, not tracked")
    axes[2].set_xlabel("time / ms")
    axes[1].legend(loc="lower right")
    axes[2].legend(loc="center right")
    caption = (
        f"{motor_words(motor)} Drive at the start: {drive_words(drive)}, 1.2 % above the recommended frequency. Load "
        f"{1e3 * defined['LOAD_TORQUE']:g} mN·m. A PI controller, sampled every {1e3 * defined['SAMPLE_TIME']:g} ms, "
        f"holds the phase of the motional current of group B at {defined['TARGET']:g}°".replace("-", "−")
        + " by the frequency. "
        f"Speeds of the two motors differ by at most {farthest(averaged, full, 'speed_rad_s'):.2g} % of the maximum. "
        "examples/controllers/resonance.py."
    )
    write(
        figure,
        folder / "control_resonance.png",
        "A PI controller of the phase of the current tracks the resonance",
        caption,
    )
    return [
        f"tracked: {averaged.speed_rad_s[-1]:.3g} rad/s at {1e-3 * averaged.frequency_hz[-1]:.4g} kHz",
        f"not tracked: {constant.speed_rad_s[-1]:.3g} rad/s at {1e-3 * drive.frequency:.4g} kHz",
        *(f"{name}: {farthest(averaged, full, name):.2g} %" for name in ("frequency_hz", "speed_rad_s")),
    ]


if __name__ == "__main__":
    main(draw, __doc__)
