# SPDX-License-Identifier: MIT
"""Speed control with dead-band compensation: a PI controller sets the amplitude, and the phase for the direction.

Below about 37 V the motor does not turn. The controller adds this voltage to the magnitude of its output, so that a
small output has an effect. The sign of the output selects the direction: group B ahead of group A, or behind it. The
set point reverses at 25 ms. ``speed.c`` is the same controller as firmware.

    python examples/controllers/speed.py
"""

from __future__ import annotations

from math import copysign

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun

MOTOR = pr.load_motor("bimodal40")
DEAD_BAND, HIGHEST = 37.0, 120.0  # V
PHASE = 90.0  # deg, of the recommended drive
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": DEAD_BAND})
SAMPLE_TIME = 0.5e-3  # s

SPEED, REVERSAL = 10.0, 25e-3  # rad/s, s
PROPORTIONAL = 2.0  # V s/rad
INTEGRAL = 0.4  # V s/rad for each sample


class Controller:
    """A PI controller of the speed."""

    def __init__(self) -> None:
        self.integral = 0.0

    def __call__(self, sample: pr.Sample) -> dict[str, float]:
        """Return amplitude and phase until the next sample."""
        error = (SPEED if sample.time_s < REVERSAL else -SPEED) - sample.speed_rad_s
        span = HIGHEST - DEAD_BAND
        if abs(PROPORTIONAL * error + self.integral) < span:  # no windup
            self.integral += INTEGRAL * error
        output = PROPORTIONAL * error + self.integral
        return {"voltage": DEAD_BAND + min(abs(output), span), "phase_deg": copysign(PHASE, output)}


def run(duration: float, *, averaged: bool = True, library: str | None = None) -> ControlledRun:
    """Run the controller, or the one in a shared library, with the averaged motor, or with the full one."""
    return pr.simulate_controlled(
        MOTOR, DRIVE, library or Controller(), duration=duration, sample_time=SAMPLE_TIME, averaged=averaged
    )


if __name__ == "__main__":
    print(run(50e-3))
