# SPDX-License-Identifier: MIT
"""Resonance tracking by phase: a PI controller sets the frequency so that the motional current keeps its phase.

The current into group B is the sum of the current of its clamped capacitance and the motional current, which follows
the velocity of the modes. The controller subtracts the first and compares the phase of the second with a target: its
value at the recommended frequency. Above that frequency the phase is too low, and the frequency falls.

    python examples/controllers/resonance.py
"""

from __future__ import annotations

import cmath
from math import degrees, pi, radians

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun

MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR).model_copy(update={"frequency": 41.2e3})  # 1.2 % above the recommended frequency
LOAD_TORQUE = 20e-3  # N·m
SAMPLE_TIME = 0.5e-3  # s

TARGET = -66.0  # deg, phase of the motional current of group B ahead of its voltage
PROPORTIONAL = 1.5  # Hz/deg
INTEGRAL = 0.75  # Hz/deg for each sample
LOWEST, HIGHEST = 40.6e3, 42e3  # Hz


class Controller:
    """A PI controller of the phase of the motional current."""

    def __init__(self) -> None:
        self.integral = self.frequency = DRIVE.frequency

    def __call__(self, sample: pr.Sample) -> dict[str, float]:
        """Return the frequency until the next sample."""
        error = motional_phase(sample, self.frequency) - TARGET
        self.integral = limited(self.integral + INTEGRAL * error)
        self.frequency = limited(self.integral + PROPORTIONAL * error)
        return {"frequency": self.frequency}


def motional_phase(sample: pr.Sample, frequency: float) -> float:
    """Return the phase of the motional current in degrees: the current less that of the clamped capacitance."""
    current = cmath.rect(sample.current_b_amplitude_a, radians(sample.current_b_phase_deg - DRIVE.phase_deg))
    return degrees(cmath.phase(current - 2j * pi * frequency * MOTOR.piezo.capacitance_b_f * DRIVE.voltage_b))


def limited(frequency: float) -> float:
    """Return a frequency within the range of the controller."""
    return min(max(frequency, LOWEST), HIGHEST)


def run(duration: float, *, averaged: bool = True) -> ControlledRun:
    """Run the controller with the averaged motor, or with the full one."""
    return pr.simulate_controlled(
        MOTOR, DRIVE, Controller(), duration=duration, sample_time=SAMPLE_TIME, averaged=averaged,
        load_torque=LOAD_TORQUE,
    )  # fmt: skip


if __name__ == "__main__":
    print(run(50e-3))
