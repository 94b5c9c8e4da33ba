# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors, converters and timers between a sampled controller and a motor: what they round, add and delay."""

from __future__ import annotations

from math import tau

import numpy as np

from pyspice_runner.errors import require
from pyspice_runner.motor.parameters import quantity
from pyspice_runner.motor.refusal import Stated

EDGES = 4  # of an encoder in quadrature, for each line


class Electronics(Stated):
    """Sensors and actuators of a sampled controller. A value of 0 is an ideal part.

    The encoder counts four edges a line; its jitter and the noise of the converters are normal, their values rms.
    The current of a group is the mean of a synchronous detector over the sample time, whose two outputs are converted
    each. A timer counts period and phase in whole ticks of its clock. Commands act after the computing delay.

    Raises:
        ParameterError: by the constructor, for an invalid value.
    """

    encoder_lines: int = quantity("lines of the encoder in a turn, of a slider in 1 m", "1", default=0, ge=0, le=10**7)
    encoder_jitter_rad: float = quantity("jitter of an edge", "rad", default=0.0, ge=0.0, le=1.0)
    current_bits: int = quantity("bits of the converter of the currents", "1", default=0, ge=0, le=32)
    current_range_a: float = quantity("maximum amplitude that it converts", "A", default=1.0, ge=1e-6, le=1e3)
    current_noise_a: float = quantity("its noise", "A", default=0.0, ge=0.0, le=1e3)
    voltage_bits: int = quantity("bits of the converter of the voltages", "1", default=0, ge=0, le=32)
    voltage_range_v: float = quantity("maximum amplitude that it converts", "V", default=1e3, ge=1e-3, le=1e5)
    voltage_noise_v: float = quantity("its noise", "V", default=0.0, ge=0.0, le=1e3)
    amplitude_bits: int = quantity(
        "bits of the converter or pulse-width modulator that sets the amplitudes", "1", default=0, ge=0, le=32
    )
    amplitude_range_v: float = quantity("maximum amplitude that it sets", "V", default=1e3, ge=1e-3, le=1e5)
    timer_hz: float = quantity("clock that counts period and phase of the drive", "Hz", default=0.0, ge=0.0, le=1e12)
    delay_s: float = quantity("time from a sample to its commands", "s", default=0.0, ge=0.0, le=1.0)
    seed: int = quantity("seed of the noise", "1", default=0, ge=0, le=2**31)

    def check(self, sample_time: float, frequency: float) -> None:
        """Raise ParameterError for a delay that is not below the sample time, or a clock too slow for a drive in Hz."""
        allowed = f"below the sample time, {sample_time:g} s"
        require(self.delay_s < sample_time, "electronics.delay_s", self.delay_s, allowed, unit="s")
        allowed, fast = f"at least ten times the drive frequency, {10.0 * frequency:g} Hz", 10.0 * frequency
        require(not 0.0 < self.timer_hz < fast, "electronics.timer_hz", self.timer_hz, allowed, unit="Hz")

    def resolution(self, sample_time: float, frequency: float, *, linear: bool = False) -> dict[str, float]:
        """Return the steps of what is measured and set, at a drive frequency in Hz; 0 without a step.

        With ``linear`` those of a slider, in m and m/s.
        """
        edge = self._edge(linear=linear)
        return {
            "position_rad": edge, "speed_rad_s": edge / sample_time,
            "current_a": _step(self.current_bits, self.current_range_a),
            "voltage_v": _step(self.voltage_bits, self.voltage_range_v),
            "amplitude_v": _step(self.amplitude_bits, self.amplitude_range_v),
            "frequency_hz": frequency**2 / self.timer_hz if self.timer_hz else 0.0,
            "phase_deg": 360.0 * frequency / self.timer_hz if self.timer_hz else 0.0,
        }  # fmt: skip

    def _edge(self, *, linear: bool) -> float:
        return (1.0 if linear else tau) / (EDGES * self.encoder_lines) if self.encoder_lines else 0.0


class Rounding:
    """What the parts of some electronics make of values; the noise goes on from call to call."""

    def __init__(self, electronics: Electronics) -> None:
        self.electronics, self._noise = electronics, np.random.default_rng(electronics.seed)

    def position(self, value: float, *, linear: bool = False) -> float:
        """Return a measured angle in rad, or m of a slider."""
        parts = self.electronics
        if parts.encoder_jitter_rad:
            value += parts.encoder_jitter_rad * float(self._noise.standard_normal())
        edge = parts._edge(linear=linear)
        return round(value / edge) * edge if edge else value

    def current(self, value: complex) -> complex:
        """Return a measured complex amplitude of a current in A."""
        return self._converted(value, "current", "a")

    def voltage(self, value: complex) -> complex:
        """Return a measured complex amplitude of a voltage in V."""
        return self._converted(value, "voltage", "v")

    def _converted(self, value: complex, name: str, unit: str) -> complex:
        names = (f"{name}_bits", f"{name}_range_{unit}", f"{name}_noise_{unit}")
        bits, span, noise = (getattr(self.electronics, one) for one in names)
        if noise:
            value += noise * complex(*self._noise.standard_normal(2))
        if not bits:
            return value
        return complex(*(_rounded(part, _step(bits, span), span) for part in (value.real, value.imag)))

    def commands(self, given: dict[str, float]) -> dict[str, float]:
        """Return the frequency in Hz, the phase in degrees and the amplitudes in V that the parts can set."""
        parts = self.electronics
        found = dict(given)
        if parts.timer_hz:
            ticks = max(round(parts.timer_hz / given["frequency"]), 1)
            found["frequency"] = parts.timer_hz / ticks
            found["phase_deg"] = 360.0 * round(given["phase_deg"] / 360.0 * ticks) / ticks
        if parts.amplitude_bits:
            step = _step(parts.amplitude_bits, parts.amplitude_range_v)
            for name in ("voltage_a", "voltage_b"):
                found[name] = _rounded(given[name], step, parts.amplitude_range_v)
        return found


def _step(bits: int, span: float) -> float:
    """Return the step of a converter with a sign: its bits hold -span to span."""
    return 2.0 * span / 2**bits if bits else 0.0


def _rounded(value: float, step: float, span: float) -> float:
    return min(max(round(value / step) * step, -span), span - step)


IDEAL = Electronics()
