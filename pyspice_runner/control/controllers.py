# SPDX-License-Identifier: GPL-3.0-or-later
"""Designed controllers for :func:`simulate_controlled`: about an operating point, or from rest in both directions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import copysign, radians, sin
from typing import Any, Protocol

from pyspice_runner.control.simulate import Sample
from pyspice_runner.motor.drive import TwoPhaseDrive

_SIDEWAYS = 0.1  # |sin| of the phase, below which its sign does not turn the direction


class DesignedLoop(Protocol):
    """What a controller takes of a :class:`ControlLoop`."""

    @property
    def quantity(self) -> str:
        """The controlled quantity."""

    @property
    def gains(self) -> Mapping[str, float]:
        """The gains, SI units and degrees."""

    @property
    def provenance(self) -> dict[str, Any]:
        """Drive, operating point and settings."""


class LoopController:
    """A designed controller, for :func:`simulate_controlled`.

    Args:
        loop: the design.
        set_point: time in s → wanted value of the quantity: rad/s, rad or deg.
    """

    def __init__(self, loop: DesignedLoop, set_point: Callable[[float], float]) -> None:
        run, drive = loop.provenance["run"], loop.provenance["drive"]
        self.quantity, self.set_point, self._step = loop.quantity, set_point, run["sample_time_s"]
        self._proportional, self._other = loop.gains.values()
        self._speed = run["operating_point"]["speed"]
        self._voltage, self._frequency = drive["voltage"], drive["frequency"]
        self._ratio_b, self._sum = drive["ratio_b"], 0.0

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return the amplitudes, or of a phase the frequency, until the next sample."""
        wanted = self.set_point(sample.time_s)
        if self.quantity == "position":
            damped = self._other * (sample.speed_rad_s - self._speed)
            output = self._proportional * (wanted - sample.position_rad) - damped
        else:
            if self.quantity == "speed":
                error = wanted - sample.speed_rad_s
            else:
                error = (wanted - sample.current_phase_deg + 180.0) % 360.0 - 180.0
            self._sum += self._step * error
            output = self._proportional * error + self._other * self._sum
        return self._commands(output)

    def _commands(self, output: float) -> dict[str, float]:
        if self.quantity == "phase":
            return {"frequency": self._frequency + output}
        voltage = self._voltage + output
        return {"voltage_a": voltage, "voltage_b": self._ratio_b * voltage}


class TwoWayController:
    """A designed controller of speed or position for both directions, from rest.

    Args:
        quantity: ``speed`` or ``position``.
        gains: its gains, as of a designed loop.
        sample_time: time between two samples, s.
        drive: phase and ratio of the groups, for the positive direction.
        highest: greatest amplitude of group A, V.
        set_point: time in s → wanted value, rad/s or rad.
        dead_band: amplitude in V that is added to the magnitude of the output; 0 is no compensation.
    """

    def __init__(
        self,
        quantity: str,
        gains: Mapping[str, float],
        sample_time: float,
        drive: TwoPhaseDrive,
        highest: float,
        set_point: Callable[[float], float],
        dead_band: float = 0.0,
    ) -> None:
        self.quantity, self._drive, self.set_point = quantity, drive, set_point
        self._proportional, self._other = gains.values()
        self._step, self._dead_band, self._span = sample_time, dead_band, highest - dead_band
        self._sum = 0.0

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return amplitudes and phase until the next sample."""
        wanted = self.set_point(sample.time_s)
        if self.quantity == "position":
            output = self._proportional * (wanted - sample.position_rad) - self._other * sample.speed_rad_s
        else:
            error = wanted - sample.speed_rad_s
            grown = self._sum + self._step * error
            output = self._proportional * error + self._other * grown
            if abs(output) < self._span:  # no windup
                self._sum = grown
            output = self._proportional * error + self._other * self._sum
        voltage = self._dead_band + min(abs(output), self._span)
        phase = self._drive.phase_deg
        if abs(sin(radians(phase))) < _SIDEWAYS:  # one direction: friction brakes
            voltage = voltage if output > 0.0 else 0.0
        else:
            phase = copysign(1.0, output) * phase
        return {"voltage_a": voltage, "voltage_b": self._drive.ratio_b * voltage, "phase_deg": phase}
