# SPDX-License-Identifier: GPL-3.0-or-later
"""Designed controllers for :func:`simulate_controlled`: about an operating point, or from rest in both directions.

Below some amplitude, the dead band, the path of the tip fits into the pre-sliding of the contact, and the rotor stands.
A controller whose output passes through this band waits there, or jumps from one edge to the other in a limit cycle.
The compensation adds the dead band to the magnitude of the output; its sign turns the phase of group B, and so the
direction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import copysign, inf, radians, sin
from typing import Any, Protocol

import numpy as np

from pyspice_runner.averaged.core import AveragedMotor
from pyspice_runner.averaged.run import presliding
from pyspice_runner.control.simulate import Sample, simulate_controlled
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor

STANDS = 1e-3  # rad/s or m/s, below which a motor does not turn
_SIDEWAYS = 0.1  # |sin| of the phase, below which its sign does not turn the direction
_RUN = 50e-3  # s from rest, after which the friction has stopped the rotor, or it turns
_HALVINGS = 8  # of the interval from 0 V to the drive
_NONE = 1e-4  # of the set point: a static error that is none
_SETTLED = 0.01  # of the set point: peak to peak of a loop that has settled
_CYCLES = 60.0  # of the crossover, of a run near standstill: an integral part passes the dead band within them
_FEWEST = 300  # samples of it


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


class _Regulator:
    """The law of control: PI of a speed or a phase, P of a position with the measured speed."""

    def __init__(
        self, quantity: str, gains: Mapping[str, float], sample_time: float, set_point: Callable[[float], float],
        *, speed: float = 0.0, span: float = inf,
    ) -> None:  # fmt: skip
        self.quantity, self.set_point = quantity, set_point
        self._proportional, self._other = gains.values()
        self._step, self._speed, self._span, self._sum = sample_time, speed, span, 0.0

    def output(self, sample: Sample) -> float:
        """Return the output until the next sample; the integral stays while the output exceeds the span."""
        wanted = self.set_point(sample.time_s)
        if self.quantity == "position":
            damped = self._other * (sample.speed_rad_s - self._speed)
            return self._proportional * (wanted - sample.position_rad) - damped
        if self.quantity == "speed":
            error = wanted - sample.speed_rad_s
        else:
            error = (wanted - sample.current_phase_deg + 180.0) % 360.0 - 180.0
        grown = self._sum + self._step * error
        if abs(self._proportional * error + self._other * grown) < self._span:  # no windup
            self._sum = grown
        return self._proportional * error + self._other * self._sum


class LoopController(_Regulator):
    """A designed controller about its operating point.

    Args:
        loop: the design.
        set_point: time in s → wanted value of the quantity: rad/s, rad or deg.
    """

    def __init__(self, loop: DesignedLoop, set_point: Callable[[float], float]) -> None:
        run, self._drive = loop.provenance["run"], loop.provenance["drive"]
        speed = run["operating_point"]["speed"]
        super().__init__(loop.quantity, loop.gains, run["sample_time_s"], set_point, speed=speed)

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return the amplitudes, or of a phase the frequency, until the next sample."""
        if self.quantity == "phase":
            return {"frequency": self._drive["frequency"] + self.output(sample)}
        voltage = self._drive["voltage"] + self.output(sample)
        return {"voltage_a": voltage, "voltage_b": self._drive["ratio_b"] * voltage}


class TwoWayController(_Regulator):
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
        super().__init__(quantity, gains, sample_time, set_point, span=highest - dead_band)
        self._drive, self._dead_band = drive, dead_band

    def __call__(self, sample: Sample) -> Mapping[str, float]:
        """Return amplitudes and phase until the next sample."""
        output = self.output(sample)
        voltage = self._dead_band + min(abs(output), self._span)
        phase = self._drive.phase_deg
        if abs(sin(radians(phase))) < _SIDEWAYS:  # one direction: friction brakes
            voltage = voltage if output > 0.0 else 0.0
        else:
            phase = copysign(1.0, output) * phase
        return {"voltage_a": voltage, "voltage_b": self._drive.ratio_b * voltage, "phase_deg": phase}


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


@dataclass(frozen=True)
class NearStandstill:
    """A loop at a small set point, from rest, after it had time to settle; in rad/s, or rad for a position.

    Attributes:
        compensation_v: amplitude that is added to the magnitude of the output.
        set_point: wanted value.
        static_error: set point less the mean.
        ripple: standard deviation of the samples.
        frequency_hz: of the limit cycle; ``None`` of a loop that has settled.
        settling_s: time after which it stays where it settles; ``None`` of a limit cycle.
    """

    compensation_v: float
    set_point: float
    static_error: float
    ripple: float
    frequency_hz: float | None
    settling_s: float | None

    def words(self, unit: str) -> str:
        """Return static error and limit cycle in words, in a unit."""
        error = self.static_error if abs(self.static_error) > _NONE * abs(self.set_point) else 0.0
        if self.frequency_hz is not None:
            cycle = f"limit cycle of {self.ripple:.3g} {unit} rms at {self.frequency_hz:.3g} Hz"
        else:
            cycle = f"settled after {1e3 * (self.settling_s or 0.0):.3g} ms"
        return f"{cycle}, static error {error:.3g} {unit}"


def near_standstill(
    motor: Motor,
    drive: TwoPhaseDrive,
    quantity: str,
    gains: Mapping[str, float],
    *,
    run: Mapping[str, Any],
    set_point: float,
    compensation: float,
) -> NearStandstill:
    """Return how a loop behaves at a small set point; ``run`` are the settings of its design."""
    period = run["sample_time_s"]
    count = max(_FEWEST, int(_CYCLES / run["crossover_hz"] / period))
    usual = (motor.drive or {}).get("voltage", drive.voltage)
    controller = TwoWayController(
        quantity, gains, period, drive, max(usual, drive.voltage), lambda _: set_point, compensation
    )
    found = simulate_controlled(
        motor, drive.model_copy(update={"voltage": 0.0}), controller, duration=(count + 0.5) * period,
        sample_time=period, load_torque=run["load_torque_n_m"],
    )  # fmt: skip
    values = found.position_rad if quantity == "position" else found.speed_rad_s
    late = values[2 * count // 3 :]
    still = 2.0 * presliding(motor.to_dict()) / (1.0 if quantity == "position" else period)  # without slip
    band = max(_SETTLED * abs(set_point), still)
    spectrum = np.abs(np.fft.rfft(late - late.mean()))
    cycles = np.ptp(late) > band
    frequency = float(np.argmax(spectrum) / (len(late) * period)) if cycles else None
    away = np.flatnonzero(np.abs(values - late.mean()) > band)
    settling = None if cycles else float(found.time_s[away[-1]]) if away.size else 0.0
    return NearStandstill(
        compensation, set_point, set_point - float(late.mean()), float(late.std()), frequency, settling
    )
