# SPDX-License-Identifier: GPL-3.0-or-later
"""The voltages that drive the two piezo groups (paper eqs. 1 and 2), and the load of the shaft."""

from __future__ import annotations

from cmath import exp, rect
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import chain
from math import pi, radians, sin, sqrt
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.contact import static_penetration
from pyspice_runner.motor.motor import Motor, derived
from pyspice_runner.motor.parameters import quantity
from pyspice_runner.motor.refusal import Stated

# Range of drive frequencies. At a thousandth of its frequency a mode responds like a spring, at a hundred times it with
# 1e-4 of that: a frequency farther away is probably in another unit.
SLOWEST_DRIVE, FASTEST_DRIVE = 1e-3, 1e2
# m/s: the strain is this velocity over that of sound, about 5000 m/s; no stator survives 2 %
FASTEST_TIP = 100.0
FASTEST_SHAFT, FASTEST_SURFACE = 1e6, 1e3  # rad/s; m/s at the rim, where the strongest flywheels burst
FASTEST_SLIDER = FASTEST_TIP  # m/s: no tip pushes it faster
WIDEST_SWING = 0.1  # amplitude over the radius of the rotor: the tip stays near the crown of the rotor
FLATTEST = 0.05  # of the penetration: fall x²/2R of a slider's face at the amplitude x, where R = 1 m stands for flat


class Tone(NamedTuple):
    """One sine: ``amplitude`` (V) · sin(2π ``frequency`` (Hz) t + ``phase`` (rad))."""

    amplitude: float
    frequency: float
    phase: float


class Drive(Stated):
    """Base of the drives: full amplitude from t = 0, or a soft start.

    Raises:
        ParameterError: by every constructor, for a value out of range.
    """

    soft_start: float = quantity(
        "time over which the amplitude rises linearly from zero", "s", default=0.0, ge=0.0, le=100.0
    )

    @property
    def tones(self) -> tuple[tuple[Tone, ...], ...]:
        """For each group the sines whose sum is its voltage."""
        raise NotImplementedError

    @property
    def tones_a(self) -> tuple[Tone, ...]:
        """Sines whose sum is U_A."""
        return self.tones[0]

    @property
    def tones_b(self) -> tuple[Tone, ...]:
        """Sines whose sum is U_B."""
        return self.tones[-1]

    @property
    def label(self) -> str:
        """Description of the drive for captions."""
        raise NotImplementedError

    @cached_property
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies present, in Hz."""
        return tuple(sorted(set(map(attrgetter("frequency"), chain(*self.tones)))))

    @cached_property
    def period(self) -> float:
        """Time in s after which both voltages repeat; for frequencies without a short one, that of the lowest."""
        base = Fraction(self.frequencies[0])
        repeats = 1
        for frequency in self.frequencies[1:]:
            ratio = (Fraction(frequency) / base).limit_denominator(20)
            if abs(float(ratio) * self.frequencies[0] - frequency) < 1e-9 * frequency:
                repeats = max(repeats, ratio.denominator)
        return repeats / self.frequencies[0]

    def initial_voltages(self) -> tuple[float, ...]:
        """Return the voltage of each group just after t = 0, in V."""
        begun = 0.0 if self.soft_start > 0.0 else 1.0
        return tuple(sum(begun * tone.amplitude * sin(tone.phase) for tone in tones) for tones in self.tones)


class TwoPhaseDrive(Drive):
    """Eq. (1): U_A = U sin(2πft), U_B = ρ U sin(2πft + φ); the paper has ρ = 1."""

    voltage: float = quantity("amplitude U of group A, and of group B at ρ = 1", "V", ge=0.0, le=1e4)
    frequency: float = quantity("frequency f", "Hz", ge=1.0, le=1e8)
    phase_deg: float = quantity("phase φ of group B ahead of group A", "°", default=90.0, ge=-360.0, le=360.0)
    ratio_b: float = quantity("amplitude of group B over that of group A, ρ", "1", default=1.0, ge=0.01, le=100.0)

    @property
    def label(self) -> str:
        """Amplitude, frequency and phase."""
        ratio = f", B {self.ratio_b:g} times A" if self.ratio_b != 1.0 else ""
        return f"{self.voltage:g} V at {self.frequency / 1e3:g} kHz, {self.phase_deg:g}° apart{ratio}"

    @cached_property
    def voltage_b(self) -> float:
        """Amplitude of group B in V."""
        return self.ratio_b * self.voltage

    @cached_property
    def tones(self) -> tuple[tuple[Tone, ...], ...]:
        """One sine for each group."""
        return (
            (Tone(self.voltage, self.frequency, 0.0),),
            (Tone(self.voltage_b, self.frequency, radians(self.phase_deg)),),
        )


class OnePhaseDrive(TwoPhaseDrive):
    """U sin(2πft) at the one group of a transducer; phase and ratio of group B have no effect."""

    @property
    def label(self) -> str:
        """Amplitude and frequency."""
        return f"{self.voltage:g} V at {self.frequency / 1e3:g} kHz"

    @cached_property
    def tones(self) -> tuple[tuple[Tone, ...], ...]:
        """The sine of group A."""
        return ((Tone(self.voltage, self.frequency, 0.0),),)


def ideal_drive(voltage_a: float, voltage_b: float, phase_deg: float, frequency: float) -> TwoPhaseDrive:
    """Return the drive of two amplitudes in V; one that is below a hundredth of the other is raised to it."""
    voltage = max(voltage_a, 0.01 * voltage_b)
    return TwoPhaseDrive(
        voltage=voltage, ratio_b=max(voltage_b / voltage, 0.01), phase_deg=180.0 - (180.0 - phase_deg) % 360.0,
        frequency=frequency,
    )  # fmt: skip


def two_phases(drive: Any) -> dict[str, float]:
    """Return the values of two phases by their names, of a drive, a driver or a tracker."""
    return {name: getattr(drive, name) for name in ("voltage", "frequency", "phase_deg", "ratio_b")}


def two_phasors(drive: Any) -> dict[str, complex]:
    """Return the phasors in V of two phases, group A at phase 0, of a drive, a driver or a tracker."""
    return {"a": complex(drive.voltage), "b": rect(drive.voltage * drive.ratio_b, radians(drive.phase_deg))}


class TwoToneDrive(Drive):
    """Eq. (2): U_A,B = U₁ sin(2πf₁t) ± U₂ sin(2πf₂t + φ).

    The first tone drives both groups alike and so moves the tip towards the rotor; the second drives them against each
    other and moves it along the rotor. With f₂ = 2 f₁ the tip moves on a figure eight.
    """

    voltage_1: float = quantity("amplitude U₁ of the common tone", "V", ge=0.0, le=1e4)
    frequency_1: float = quantity("frequency f₁ of the common tone", "Hz", ge=1.0, le=1e8)
    voltage_2: float = quantity("amplitude U₂ of the opposed tone", "V", ge=0.0, le=1e4)
    frequency_2: float = quantity("frequency f₂ of the opposed tone", "Hz", ge=1.0, le=1e8)
    phase_deg: float = quantity("phase φ of the opposed tone", "°", default=0.0, ge=-360.0, le=360.0)

    @property
    def label(self) -> str:
        """Amplitude and frequency of both tones, and the phase."""
        common = f"{self.voltage_1:g} V at {self.frequency_1 / 1e3:g} kHz"
        return f"{common} ± {self.voltage_2:g} V at {self.frequency_2 / 1e3:g} kHz, {self.phase_deg:g}°"

    @cached_property
    def tones(self) -> tuple[tuple[Tone, ...], ...]:
        """The two sines whose sum drives a group, for each group."""
        common = Tone(self.voltage_1, self.frequency_1, 0.0)
        signs, phase = (1.0, -1.0), radians(self.phase_deg)
        return tuple((common, Tone(sign * self.voltage_2, self.frequency_2, phase)) for sign in signs)


DRIVES: dict[str, type[TwoPhaseDrive] | type[TwoToneDrive]] = {
    "two-phase": TwoPhaseDrive, "two-tone": TwoToneDrive, "one-phase": OnePhaseDrive,
}  # fmt: skip
_USUAL_VOLTAGE = 50.0  # V, without a recommended drive: moves the tip of a small stator by some micrometres


def default_drive(motor: Motor) -> TwoPhaseDrive | TwoToneDrive:
    """Return the recommended drive of a motor's parameter set.

    The default is two phases 90° apart, one for one group, with 50 V at the frequency of the main mode.
    """
    if motor.drive is not None:
        values = dict(motor.drive)
        return DRIVES[values.pop("kind", "two-phase")](**values)
    kind = TwoPhaseDrive if len(motor.groups) == 2 else OnePhaseDrive
    return kind(voltage=_USUAL_VOLTAGE, frequency=motor.modes[motor.main_mode].frequency_hz)


def free_tip(motor: Motor, drive: Drive) -> tuple[float, float]:
    """Return upper bounds of the velocity (m/s) and amplitude (m) of the free tip that moves most, when steady."""
    stator = motor.stator
    velocity = swing = np.zeros(len(stator.contact) // 2)
    for tones in zip(*drive.tones, strict=True):
        omega = 2.0 * pi * tones[0].frequency
        forces = stator.coupling @ [tone.amplitude * exp(1j * tone.phase) for tone in tones]
        moved = forces / (stator.stiffness - stator.mass * omega**2 + 1j * omega * stator.damping)
        along, towards = np.abs(stator.contact * moved).sum(axis=1).reshape(-1, 2).T
        swing = swing + np.hypot(along, towards)
        velocity = velocity + omega * np.hypot(along, towards)
    return float(velocity.max()), float(swing.max())


@derived
def check_together(motor: Motor, drive: Drive) -> None:
    """Check that a drive suits a motor.

    Raise ParameterError for a frequency far from the modes, or a voltage beyond the strength of the stator.
    """
    lowest, highest = (bound(mode.frequency_hz for mode in motor.modes) for bound in (min, max))
    for frequency in drive.frequencies:
        if not SLOWEST_DRIVE * lowest <= frequency <= FASTEST_DRIVE * highest:
            raise ParameterError(
                f"A drive at {frequency:g} Hz does not suit {motor.name}, whose modes lie from {lowest:.4g} to "
                f"{highest:.4g} Hz: give a frequency ≥ {SLOWEST_DRIVE * lowest:.3g} and ≤ "
                f"{FASTEST_DRIVE * highest:.3g} Hz."
            )
    if len(drive.tones) != len(motor.groups):
        channels = "one group: give a OnePhaseDrive" if len(motor.groups) == 1 else "two groups: give a TwoPhaseDrive"
        raise ParameterError(f"The drive ({drive.label}) does not suit {motor.name}, which has {channels}.")
    velocity, swing = free_tip(motor, drive)
    if motor.is_transducer:
        if velocity > FASTEST_TIP:
            raise ParameterError(
                f"The drive ({drive.label}) is too strong for {motor.name}: without its load the face would move at "
                f"{velocity:.3g} m/s; the limit is {FASTEST_TIP:g} m/s, above which a stator breaks. Lower the voltage."
            )
        return
    if motor.slider:
        furthest = sqrt(2.0 * FLATTEST * static_penetration(motor.contact) * motor.rotor.radius_m)
        reason = "within which the model's slider is flat"
    else:
        furthest, reason = WIDEST_SWING * motor.rotor.radius_m, "a tenth of the rotor's radius"
    if velocity > FASTEST_TIP or swing > furthest:
        raise ParameterError(
            f"The drive ({drive.label}) is too strong for {motor.name}: the free tip would move by {swing:.3g} m at "
            f"{velocity:.3g} m/s; the limits are {furthest:.3g} m, {reason}, and "
            f"{FASTEST_TIP:g} m/s, above which a stator breaks. Lower the voltage, or correct the couplings."
        )


def _fastest(radius_m: float | None) -> tuple[float, str, str]:
    """Return the largest speed of a rotor, or of a slider, its unit, and what happens above it."""
    if radius_m is None:
        return FASTEST_SLIDER, "m/s", "at which a stator breaks"
    return min(FASTEST_SHAFT, FASTEST_SURFACE / radius_m), "rad/s", "above which its rim bursts"


def too_fast(motor: Mapping[str, Any], speed: float) -> tuple[str, ...]:
    """Return in a sentence that a rotor turns faster, in rad/s, than a shaft may be held; nothing if it does not.

    The motor is specified as by :meth:`.Motor.to_dict`; with a slider the speed is in m/s.
    """
    moved = "slider" if "slider" in motor else "rotor"
    fastest, unit, reason = _fastest(motor[moved].get("radius_m"))
    if not abs(speed) > fastest:
        return ()
    return (f"The {moved} moves at {speed:.4g} {unit}; the limit is {fastest:.3g} {unit}, {reason}. Lower the load.",)


@dataclass(frozen=True)
class Load:
    """Load of the shaft: none, a torque, or a held speed; in m/s and N for a slider."""

    speed: float | None = None  # speed in rad/s at which the shaft is held; ``None`` leaves it free
    # torque in N·m that a load draws from the free shaft at any speed; positive against the positive direction.
    torque: float = 0.0

    def check(self, motor: Motor) -> None:
        """Raise ParameterError for a value out of range for a motor's shaft, or for speed and torque together."""
        if motor.is_transducer:
            if self.speed is not None or self.torque:
                raise ParameterError(f"{motor.name} has no shaft: leave speed and load_torque out. [load] is its load.")
            return
        fastest, unit, reason = _fastest(None if motor.slider else motor.rotor.radius_m)
        if self.speed is not None and not abs(self.speed) <= fastest:
            raise ParameterError(
                f"speed = {self.speed:g} {unit} is not valid for the {motor.moved} of {motor.name}: it must be a "
                f"number from {-fastest:.3g} to {fastest:.3g} {unit}, {reason}."
            )
        unit = "N" if motor.slider else "N·m"
        require(abs(self.torque) <= 1e6, "load_torque", self.torque, f"from -1e6 to 1e6 {unit}", unit=unit)
        if self.speed is not None and self.torque:
            raise ParameterError(
                "speed and load_torque exclude each other: a shaft held at a speed takes any torque. Give one."
            )


class ShaftLoad(Stated):
    """A mass that the shaft moves, by a rigid or an elastic coupling with play.

    Of a slider, 1 rad stands for 1 m, 1 N·m for 1 N and 1 kg·m² for 1 kg.

    Raises:
        ParameterError: by the constructor, for an invalid value, or values without an effect.
    """

    inertia_kg_m2: float = quantity("moment of inertia of the load", "kg·m²", default=0.0, ge=0.0, le=1e3)
    damping_n_m_s: float = quantity("viscous friction of the load", "N·m·s", default=0.0, ge=0.0, le=1e3)
    spring_n_m_per_rad: float = quantity(
        "stiffness of a spring that pulls the load to the angle 0, where a run starts", "N·m/rad", default=0.0, ge=0.0,
        le=1e6,
    )  # fmt: skip
    gravity_n_m: float = quantity(
        "maximum torque of the load's weight: mass, 9.81 m/s² and distance of its centre from the axis", "N·m",
        default=0.0, ge=0.0, le=1e3,
    )  # fmt: skip
    gravity_angle_deg: float = quantity(
        "angle at the start between the centre of mass and its lowest place", "°", default=0.0, ge=-360.0, le=360.0
    )
    coupling_stiffness_n_m_per_rad: float = quantity(
        "stiffness of the shaft between rotor and load; 0: rigid", "N·m/rad", default=0.0, ge=0.0, le=1e6
    )
    coupling_damping_n_m_s: float = quantity("damping of this shaft", "N·m·s", default=0.0, ge=0.0, le=1e3)
    backlash_rad: float = quantity(
        "play of the coupling from end to end; a run starts in its middle", "rad", default=0.0, ge=0.0, le=1.0
    )

    def __init__(self, *values: float, **named: float) -> None:
        super().__init__(*values, **named)
        if not self.inertia_kg_m2 and any(self.model_dump().values()):
            raise ParameterError("ShaftLoad: inertia_kg_m2 = 0 is not valid with other values: the load needs a mass.")
        if not self.coupling_stiffness_n_m_per_rad and (self.coupling_damping_n_m_s or self.backlash_rad):
            raise ParameterError(
                "ShaftLoad: coupling_damping_n_m_s and backlash_rad have no effect on a rigid coupling. Give "
                "coupling_stiffness_n_m_per_rad, or leave them out."
            )


UNCOUPLED = ShaftLoad()
