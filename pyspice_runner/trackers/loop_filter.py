# SPDX-License-Identifier: GPL-3.0-or-later
r"""Design of a resonance tracker: the phase lag of the stator and the loop filter.

The phase of a driven resonator follows a change of frequency like a first-order lag, whose time constant is that of
its free decay with the *loaded* quality factor,

.. math::
    \tau = \frac{2Q}{\omega}, \qquad \delta\varphi(s) = -\frac{\tau}{1 + s\tau}\,\delta\omega(s).

A mode that rubs along the rotor is not linear. Harmonic balance replaces friction by the effect of its fundamental over
a cycle of the tip's amplitude: a stiffness, which shifts the resonance, and a loss. For small deviations of phase and
frequency a force that depends only on the amplitude acts as a resistance, force over velocity; this resistance, not the
derivative of the force, determines the loaded quality factor.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt, tan
from typing import Literal

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Contact
from pyspice_runner.motor.roots import root

TrackerKind = Literal["none", "pll", "observe-current", "observe-power"]
DisturbanceKind = Literal["start", "target", "load", "preload", "temperature", "warm-up"]
_CYCLE = 720  # points of a cycle of the slider


@dataclass(frozen=True)
class StatorLag:
    """Resonance of one mode of a running motor, and its phase lag."""

    resonance_hz: float  # frequency at which the mode's velocity is in phase with the force of the groups
    quality: float  # loaded quality factor
    amplitude_m: float = 0.0  # modal amplitude at resonance; 0 where it does not matter

    @property
    def time_constant_s(self) -> float:
        """Time constant of the phase, 2Q/ω."""
        return self.quality / (pi * self.resonance_hz)

    def detuning_hz(self, phase_deg: float) -> float:
        """Return the detuning above resonance at which the velocity leads by a phase."""
        return -tan(pi * phase_deg / 180.0) / (2.0 * pi * self.time_constant_s)


@dataclass(frozen=True)
class LoopFilter:
    """Values of ``behavioral/tracker_filter.lib``."""

    resistance_ohm: float
    capacitance_f: float
    ripple_f: float

    def impedance(self, s: complex) -> complex:
        """Return its impedance in Ω at a complex frequency in 1/s."""
        parallel = self.capacitance_f * self.ripple_f / (self.capacitance_f + self.ripple_f)
        whole = s * (self.capacitance_f + self.ripple_f)
        return (1.0 + s * self.resistance_ohm * self.capacitance_f) / (
            whole * (1.0 + s * self.resistance_ohm * parallel)
        )


def stator_lag(motor: Motor, mode: int, force_n: float, *, contact: bool = True) -> StatorLag:
    """Return resonance and loaded quality factor of a mode, counted from 0, under a force of an amplitude in N.

    The tip slides at the preload on a rotor surface that is at rest or slow compared with the tip. Raise ParameterError
    if the force does not drive the mode.
    """
    own = motor.modes[mode]
    if not force_n > 0.0:
        raise ParameterError(f"Nothing drives mode {own.name}; choose another mode, or another phase of the groups.")
    highest = force_n / own.damping_n_s_per_m / (2.0 * pi * own.frequency_hz)
    if not contact:
        return StatorLag(own.frequency_hz, own.quality_factor, highest)
    normal = contact_law.normal_stiffness_at_preload(motor.contact) * own.tip_y**2

    def state(amplitude: float) -> tuple[float, float]:
        """Angular frequency of resonance, and the loss per amplitude in N/m."""
        stiffness, loss = slider_cycle(motor.contact, abs(own.tip_x) * amplitude) if own.tip_x else (0.0, 0.0)
        omega = sqrt((own.stiffness_n_per_m + normal + own.tip_x**2 * stiffness) / own.mass_kg)
        return omega, omega * own.damping_n_s_per_m + own.tip_x**2 * loss

    if own.tip_x:
        amplitude = root(lambda r: state(r)[1] * r - force_n, 1e-9 * highest, highest, 1e-9 * highest)
    else:  # no rubbing: the loss does not depend on the amplitude
        amplitude = force_n / state(highest)[1]
    omega, loss = state(amplitude)
    return StatorLag(omega / (2.0 * pi), own.mass_kg * omega**2 / loss, amplitude)


def slider_cycle(contact: Contact, amplitude_m: float) -> tuple[float, float]:
    """Return stiffness and loss in N/m of the tangential contact over a cycle, at the preload.

    For a motion a·sin θ the fundamental of the friction force is a·(stiffness·sin θ + loss·cos θ).
    """
    limit = contact_law.limit_ratio(contact) * contact_law.static_penetration(contact)
    theta = 2.0 * pi * np.arange(2 * _CYCLE + 1) / _CYCLE
    moves = np.diff(amplitude_m * np.sin(theta))
    displaced = np.zeros(theta.size)
    for index, move in enumerate(moves):
        displaced[index + 1] = min(limit, max(-limit, displaced[index] + move))
    left = contact_law.static_penetration(contact) * (1.0 - np.abs(displaced / limit))
    held = contact.preload_n - contact_law.elastic_force(contact, left)
    force = contact.friction * np.sign(displaced) * held
    last, angle = force[_CYCLE:-1], theta[_CYCLE:-1]
    scale = 2.0 / _CYCLE / amplitude_m
    return float(scale * last @ np.sin(angle)), float(scale * last @ np.cos(angle))


def loop_gain(
    lag: StatorLag, loop_filter: LoopFilter, frequency_hz: float, *, gain_hz_per_v: float, current_a: float,
    target_deg: float = 0.0,
) -> complex:  # fmt: skip
    """Return the averaged loop's gain at a frequency; negative feedback, so that −1 is the limit of stability."""
    s = 2j * pi * frequency_hz
    tau, detuning = lag.time_constant_s, -tan(pi * target_deg / 180.0)
    stator = tau * (1.0 + s * tau) / ((1.0 + s * tau) ** 2 + detuning**2)
    return current_a * loop_filter.impedance(s) * gain_hz_per_v * stator


def propose_filter(
    lag: StatorLag,
    bandwidth_hz: float,
    *,
    gain_hz_per_v: float,
    current_a: float,
    target_deg: float = 0.0,
    ripple_ratio: float = 6.0,
) -> LoopFilter:
    """Propose a filter with which the loop gain is 1 at the bandwidth.

    Its zero cancels the lag of the stator, so that the loop is an integrator. The ripple pole lies ``ripple_ratio``
    above the bandwidth and takes atan(1/ripple_ratio) of the phase margin.

    Args:
        lag: of the stator.
        bandwidth_hz: frequency of unity gain.
        gain_hz_per_v: of the oscillator.
        current_a: of the charge pump.
        target_deg: target phase of the motional current.
        ripple_ratio: pole against ripple over the bandwidth.
    """
    zero, pole = lag.time_constant_s, 1.0 / (2.0 * pi * bandwidth_hz * ripple_ratio)
    # of a farad altogether: R C = zero and R C c / (C + c) = pole, hence c = pole/zero of the whole
    ripple = min(pole / zero, 0.9)
    unit = LoopFilter(zero / (1.0 - ripple), 1.0 - ripple, ripple)
    whole = abs(
        loop_gain(lag, unit, bandwidth_hz, gain_hz_per_v=gain_hz_per_v, current_a=current_a, target_deg=target_deg)
    )
    return LoopFilter(unit.resistance_ohm / whole, unit.capacitance_f * whole, unit.ripple_f * whole)
