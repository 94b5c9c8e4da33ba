# SPDX-License-Identifier: MIT
"""Position control with a burst at the end: a speed profile to near the target, then one burst of calibrated amplitude.

Near the target the amplitude of a continuous controller falls into the dead band, where the motor creeps or stops. So
the drive is switched off some milliradians before the target. The rotor stops by friction, which also holds it. A burst
of 2 ms then turns it by the rest: its amplitude results from a table that was measured with the averaged motor.

    python examples/controllers/position.py
"""

from __future__ import annotations

from math import copysign, sqrt

import numpy as np

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun

MOTOR = pr.load_motor("bimodal40")
DEAD_BAND, HIGHEST = 37.0, 120.0  # V
PHASE = 90.0  # deg, of the recommended drive
DRIVE = pr.default_drive(MOTOR).model_copy(update={"voltage": DEAD_BAND})
SAMPLE_TIME = 0.25e-3  # s

TARGET = 0.1  # rad
FASTEST, BRAKING = 10.0, 1000.0  # rad/s, rad/s²: profile of the speed over the distance left
FEED_FORWARD, PROPORTIONAL = 2.0, 3.0  # V s/rad
NEAR = 10e-3  # rad, where the drive is switched off
BURST, LENGTH = 25e-3, 2e-3  # s, when and for how long
VOLTAGES = (27.5, 30.0, 32.5, 35.0, 37.5, 40.0, 45.0, 50.0)  # V, of a burst
ANGLES = (0.53e-3, 1.03e-3, 1.76e-3, 2.74e-3, 3.92e-3, 5.26e-3, 8.19e-3, 11.35e-3)  # rad, by which it turns the rotor


class Controller:
    """A profile of the speed, a pause, a burst."""

    def __init__(self) -> None:
        self.arrived = False
        self.voltage = 0.0

    def __call__(self, sample: pr.Sample) -> dict[str, float]:
        """Return amplitude and phase until the next sample."""
        left = TARGET - sample.position_rad
        self.arrived = self.arrived or abs(left) < NEAR
        if not self.arrived:
            wanted = copysign(min(FASTEST, sqrt(2.0 * BRAKING * abs(left))), left)
            output = FEED_FORWARD * wanted + PROPORTIONAL * (wanted - sample.speed_rad_s)
            return {"voltage": min(DEAD_BAND + abs(output), HIGHEST), "phase_deg": copysign(PHASE, output)}
        since = sample.time_s - BURST + 0.5 * SAMPLE_TIME
        if 0.0 <= since < SAMPLE_TIME:
            return {"voltage": float(np.interp(abs(left), ANGLES, VOLTAGES)), "phase_deg": copysign(PHASE, left)}
        return {} if 0.0 <= since < LENGTH else {"voltage": 0.0}


def run(duration: float, *, averaged: bool = True) -> ControlledRun:
    """Run the controller with the averaged motor, or with the full one."""
    return pr.simulate_controlled(
        MOTOR, DRIVE, Controller(), duration=duration, sample_time=SAMPLE_TIME, averaged=averaged
    )


if __name__ == "__main__":
    print(run(50e-3))
