# SPDX-License-Identifier: GPL-3.0-or-later
"""Designed controllers for :func:`simulate_controlled` about an operating point, and the dead band of a motor.

Below some amplitude, the dead band, the path of the tip fits into the pre-sliding of the contact, and the rotor stands.
A controller whose output passes through this band waits there, or jumps from one edge to the other in a limit cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import copysign
from typing import TYPE_CHECKING

from pyspice_runner.averaged.core import AveragedMotor
from pyspice_runner.control.simulate import Sample
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor

if TYPE_CHECKING:
    from pyspice_runner.control.loop import ControlLoop

STANDS = 1e-3  # rad/s or m/s, below which a motor does not turn
_RUN = 50e-3  # s from rest, after which the friction has stopped the rotor, or it turns
_HALVINGS = 8  # of the interval from 0 V to the drive


class LoopController:
    """A designed controller about its operating point: PI of a speed or a phase, PD of a position.

    Args:
        loop: the design.
        set_point: time in s → wanted value of the quantity: rad/s, rad or deg.
    """

    def __init__(self, loop: ControlLoop, set_point: Callable[[float], float]) -> None:
        run, self._drive = loop.provenance["run"], loop.provenance["drive"]
        self.quantity, self.set_point = loop.quantity, set_point
        self._proportional, self._other = loop.gains.values()
        self._step, self._speed, self._sum = run["sample_time_s"], run["operating_point"]["speed"], 0.0

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return the amplitudes, or of a phase the frequency, until the next sample."""
        wanted = self.set_point(sample.time_s)
        if self.quantity == "phase":
            error = (wanted - sample.current_phase_deg + 180.0) % 360.0 - 180.0
            return {"frequency": self._drive["frequency"] + self._regulated(error)}
        if self.quantity == "speed":
            output = self._regulated(wanted - sample.speed_rad_s)
        else:
            damped = self._other * (sample.speed_rad_s - self._speed)
            output = self._proportional * (wanted - sample.position_rad) - damped
        voltage = self._drive["voltage"] + output
        return {"voltage_a": voltage, "voltage_b": self._drive["ratio_b"] * voltage}

    def _regulated(self, error: float) -> float:
        """Return the output of the PI controller."""
        self._sum += self._step * error
        return float(self._proportional * error + self._other * self._sum)


def dead_band(motor: Motor, drive: TwoPhaseDrive, load_torque: float) -> float:
    """Return the amplitude of group A in V below which the motor does not turn as it does at the drive.

    Group B has its ratio. Each run begins at rest. Raise SimulationError if the equations have no solution.
    """
    running = AveragedMotor(motor)

    def speed(voltage: float) -> float:
        running.begin(
            amplitude_a=voltage, amplitude_b=voltage * drive.ratio_b, phase=drive.phase_deg, frequency=drive.frequency,
            load_torque=load_torque,
        )  # fmt: skip
        running.advance(0.0, 0.5 * _RUN)
        half = running.get("position")
        running.advance(0.5 * _RUN, _RUN)
        return (running.get("position") - half) / (0.5 * _RUN)

    direction = copysign(1.0, speed(drive.voltage))
    low, high = 0.0, drive.voltage
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if direction * speed(middle) > STANDS else (middle, high)
    return 0.5 * (low + high)
