# SPDX-License-Identifier: GPL-3.0-or-later
"""The voltages that drive the two piezo groups (paper eqs. 1 and 2)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import radians, sin

from pyspice_runner.model.parameters import quantity
from pyspice_runner.model.refusal import Stated


@dataclass(frozen=True)
class Tone:
    """One sine: ``amplitude`` (V) · sin(2π ``frequency`` (Hz) t + ``phase`` (rad))."""

    amplitude: float
    frequency: float
    phase: float


class Drive(Stated):
    """What all drives share: full amplitude from t = 0, unless a soft start is asked for.

    Raises:
        ParameterError: by every constructor, for a value out of range.
    """

    soft_start: float = quantity(
        "time over which the amplitude rises linearly from zero", "s", default=0.0, ge=0.0, le=100.0
    )

    @property
    def tones_a(self) -> tuple[Tone, ...]:
        """Sines whose sum is U_A."""
        raise NotImplementedError

    @property
    def tones_b(self) -> tuple[Tone, ...]:
        """Sines whose sum is U_B."""
        raise NotImplementedError

    @property
    def label(self) -> str:
        """What a figure's caption says of the drive."""
        raise NotImplementedError

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies present, in Hz."""
        return tuple(sorted({tone.frequency for tone in (*self.tones_a, *self.tones_b)}))

    @property
    def period(self) -> float:
        """Time in s after which both voltages repeat; for frequencies without a short one, that of the lowest."""
        base = Fraction(self.frequencies[0])
        repeats = 1
        for frequency in self.frequencies[1:]:
            ratio = (Fraction(frequency) / base).limit_denominator(20)
            if abs(float(ratio) * self.frequencies[0] - frequency) < 1e-9 * frequency:
                repeats = max(repeats, ratio.denominator)
        return repeats / self.frequencies[0]

    def initial_voltages(self) -> tuple[float, float]:
        """Return U_A and U_B just after t = 0, in V."""
        if self.soft_start > 0.0:
            return 0.0, 0.0
        return _at_zero(self.tones_a), _at_zero(self.tones_b)


class TwoPhaseDrive(Drive):
    """Eq. (1): U_A = U sin(2πft), U_B = U sin(2πft + φ)."""

    voltage: float = quantity("amplitude U of both groups", "V", ge=0.0, le=1e5)
    frequency: float = quantity("frequency f", "Hz", ge=1.0, le=1e8)
    phase_deg: float = quantity("phase φ of group B ahead of group A", "°", default=90.0, ge=-360.0, le=360.0)

    @property
    def label(self) -> str:
        """Amplitude, frequency and phase."""
        return f"{self.voltage:g} V at {self.frequency / 1e3:g} kHz, {self.phase_deg:g}° apart"

    @property
    def tones_a(self) -> tuple[Tone, ...]:
        """The sine of group A."""
        return (Tone(self.voltage, self.frequency, 0.0),)

    @property
    def tones_b(self) -> tuple[Tone, ...]:
        """The sine of group B."""
        return (Tone(self.voltage, self.frequency, radians(self.phase_deg)),)


class TwoToneDrive(Drive):
    """Eq. (2): U_A,B = U₁ sin(2πf₁t) ± U₂ sin(2πf₂t + φ).

    The first tone drives both groups alike and so moves the tip towards the rotor; the second drives them against each
    other and moves it along the rotor. With f₂ = 2 f₁ the tip writes a figure eight.
    """

    voltage_1: float = quantity("amplitude U₁ of the common tone", "V", ge=0.0, le=1e5)
    frequency_1: float = quantity("frequency f₁ of the common tone", "Hz", ge=1.0, le=1e8)
    voltage_2: float = quantity("amplitude U₂ of the opposed tone", "V", ge=0.0, le=1e5)
    frequency_2: float = quantity("frequency f₂ of the opposed tone", "Hz", ge=1.0, le=1e8)
    phase_deg: float = quantity("phase φ of the opposed tone", "°", default=0.0, ge=-360.0, le=360.0)

    @property
    def label(self) -> str:
        """Amplitude and frequency of both tones, and the phase."""
        common = f"{self.voltage_1:g} V at {self.frequency_1 / 1e3:g} kHz"
        return f"{common} ± {self.voltage_2:g} V at {self.frequency_2 / 1e3:g} kHz, {self.phase_deg:g}°"

    @property
    def tones_a(self) -> tuple[Tone, ...]:
        """The two sines whose sum drives group A."""
        return (
            Tone(self.voltage_1, self.frequency_1, 0.0),
            Tone(self.voltage_2, self.frequency_2, radians(self.phase_deg)),
        )

    @property
    def tones_b(self) -> tuple[Tone, ...]:
        """The two sines whose sum drives group B."""
        common, opposed = self.tones_a
        return (common, Tone(-opposed.amplitude, opposed.frequency, opposed.phase))


def _at_zero(tones: tuple[Tone, ...]) -> float:
    return sum(tone.amplitude * sin(tone.phase) for tone in tones)
