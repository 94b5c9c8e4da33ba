# SPDX-License-Identifier: GPL-3.0-or-later
r"""Resonance trackers as PySpice circuits: sensing, detector, filter and oscillator, in front of a motor; their design.

    oscillator --> two phases --> sense --> motor
         ^                          |
         +--- filter <-- detector <-+     or observer <-- power, or square of the motional current

The parts are the libraries ``behavioral/tracker_*.lib``; docs/tracking.md explains them.

The phase of a driven resonator follows a change of frequency like a first-order lag, whose time constant is that of
its free decay with the *loaded* quality factor,

.. math::
    \\tau = \\frac{2Q}{\\omega}, \\qquad \\delta\\varphi(s) = -\\frac{\\tau}{1 + s\\tau}\\,\\delta\\omega(s).

A mode that rubs along the rotor is not linear. Harmonic balance replaces friction by the effect of its fundamental over
a cycle of the tip amplitude: a stiffness, which shifts the resonance, and a loss. For small deviations of phase and
frequency a force that depends only on the amplitude acts as a resistance, force over velocity; this resistance, not the
derivative of the force, determines the loaded quality factor.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import degrees, inf, pi, sqrt, tan
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.averaged.library import schedule_text
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import dielectric_matrix, instantiate
from pyspice_runner.circuit.source import GROUPS, Excitation, Pins, Source
from pyspice_runner.circuit.state import FEEDBACK
from pyspice_runner.drivers.driver import SWITCHED_OPTIONS, Driver, add_driver, control_amplitude
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import two_phasors
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.numerics import root
from pyspice_runner.motor.parameters import Contact, quantity
from pyspice_runner.motor.refusal import Stated, checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.library import read_library

TrackerKind = Literal["none", "pll", "observe-current", "observe-power", "observe-speed"]
DisturbanceKind = Literal["start", "target", "load", "preload", "temperature", "supply", "warm-up"]
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

    def impedance(self, s: Any) -> Any:
        """Return its impedance in Ω at a complex frequency in 1/s, or at an array of them."""
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
    if motor.is_transducer:  # under its load, which couples the modes hardly
        loaded = motor.loaded_stator
        mass, damping, stiffness = (float(one[mode, mode]) for one in (loaded.mass, loaded.damping, loaded.stiffness))
        omega = sqrt(stiffness / mass)
        return StatorLag(omega / (2.0 * pi), mass * omega / damping, force_n / damping / omega)
    if not contact:
        return StatorLag(own.frequency_hz, own.quality_factor, highest)
    moved = motor.stator.contact[:, mode].reshape(-1, 2).tolist()
    tips = [(one, xy) for one, xy in zip(motor.touching, moved, strict=True) if one.share]  # that touch at rest
    normal = sum(contact_law.normal_stiffness_at_preload(one.contact) * y**2 for one, (_, y) in tips)

    def state(amplitude: float) -> tuple[float, float]:
        """Angular frequency of resonance, and the loss per amplitude in N/m."""
        stiffness = loss = 0.0
        for one, (x, _) in tips:
            if x:
                along = np.multiply(x**2, slider_cycle(one.contact, abs(x) * amplitude))
                stiffness, loss = stiffness + float(along[0]), loss + float(along[1])
        omega = sqrt((own.stiffness_n_per_m + normal + stiffness) / own.mass_kg)
        return omega, omega * own.damping_n_s_per_m + loss

    if any(x for _, (x, _) in tips):
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


SMOOTHED_PERIODS = 20  # over which phase and speed are averaged
RAIL = 5.0  # V, range of the control voltage
# Digital events shorten the steps; ngspice's error control is off, as with uniform steps. Nodes have 1 V to 50 kV.
TRACKER_OPTIONS = {"reltol": "1e-5", "vntol": "1e-7", "abstol": "1e-8", "trtol": "1e9", "method": "trap"}
# The edges of a bridge have no points of their own here. Where its low transistor takes the current from the other body
# diode, that breaks off by amperes, and an error of 3e-15 C would take steps of femtoseconds, in which rounding rules.
# 1e-13 C (reltol times chgtol) are nothing against the nanocoulombs of a gate; ngspice takes xtrtol where it counts
# Where the detector sees an edge while a transistor conducts amperes, Newton's method may not come to 1e-5 V
BRIDGE_OPTIONS = {**SWITCHED_OPTIONS, "vntol": "1e-4", "abstol": "3e-6", "chgtol": "1e-9", "trtol": "7", "xtrtol": "7"}
ROUNDING = 1e-9  # relative, of times
STEP_TIME = 0.2e-3  # s, rise time of a step of load, preload or supply: short for the loop, long for the modes
_NO_COPY = 1e-6  # of a clamped capacitance, where its current is sensed as well
LOST_DEG = 60.0  # phase error with which lock is lost: half the amplitude
LOST_PERIODS = 5.0  # time constant of the mean by which a loss of lock is seen: the ripple at 2 f is 1.6 %
HELD_LAGS = 10.0  # duration of a restart in time constants of the mode: what rang before it has decayed by e^-10


class Tracker(Stated, Excitation):
    """A two-phase drive whose frequency a tracker sets; with ``none`` the frequency is constant.

    Raises:
        ParameterError: by the constructor, for an invalid value.
    """

    kind: TrackerKind = Field(description="tracker")
    voltage: float = quantity("amplitude of group A", "V", ge=0.01, le=1e4)
    frequency: float = quantity("frequency in the middle of the oscillator's range", "Hz", ge=100.0, le=1e7)
    phase_deg: float = quantity("phase of group B ahead of group A", "°", default=90.0, ge=-360.0, le=360.0)
    ratio_b: float = quantity("amplitude of group B over that of group A", "1", default=1.0, ge=0.01, le=100.0)
    span: float = quantity("half the oscillator's range, relative", "1", default=0.07, ge=0.001, le=0.5)
    offset: float = quantity("at the start, relative to the middle frequency", "1", default=0.0, ge=-0.5, le=0.5)
    target_deg: float = quantity(
        "phase at which a phase-locked loop holds the motional current, ahead of the force; below 0 is above resonance",
        "°", default=0.0, ge=-60.0, le=60.0,
    )  # fmt: skip
    bandwidth_hz: float = quantity("unity-gain bandwidth of a phase-locked loop", "Hz", default=500.0, ge=1.0, le=1e5)
    ripple_ratio: float = quantity("pole against ripple over the bandwidth", "1", default=6.0, ge=1.0, le=100.0)
    pump_current_a: float = quantity("current of the charge pump", "A", default=20e-6, ge=1e-9, le=1.0)
    period_s: float = quantity("time between two steps of an observer", "s", default=0.8e-3, ge=1e-5, le=1.0)
    step_hz: float = quantity("size of an observer's steps", "Hz", default=80.0, ge=1e-3, le=1e6)
    average_hz: float = quantity("bandwidth of an observer's averaging", "Hz", default=3e3, ge=1.0, le=1e6)
    polarity: Literal[1, -1] = Field(default=1, description="-1: connected the wrong way round")
    restart: bool = Field(
        default=True, description="whether a phase-locked loop without lock returns to its starting frequency"
    )
    restart_after_s: float = quantity(
        "time without lock after which it returns; 0: twice the time in which it sweeps its range at an error of 60°",
        "s", default=0.0, ge=0.0, le=1e3,
    )  # fmt: skip
    lost_share: float = quantity(
        "motional current in phase with the target per volt, relative to resonance, below which lock is lost; the "
        "default is that of a resonator at 82°, beyond all targets",
        "1", default=0.02, ge=1e-4, le=0.5,
    )  # fmt: skip
    capacitance_error: float = quantity(
        "error of the copies of the clamped capacitances, relative", "1", default=0.0, ge=-0.9, le=2.0
    )
    copies: bool = Field(
        default=True, description="whether copies of the clamped capacitances are subtracted from the sensed currents"
    )
    sense: Literal["current", "feedback"] = Field(
        default="current", description="what is sensed: the currents of the groups, or the feedback electrode"
    )
    sense_ohm: float = quantity(
        "resistor in each line that senses its current, or burden of a current transformer, referred to the line; 0: "
        "an ideal ammeter", "Ω", default=0.0, ge=0.0, le=1e4,
    )  # fmt: skip
    magnetizing_h: float = quantity(
        "magnetising inductance of this current transformer, referred to the line; 0: a resistor",
        "H", default=0.0, ge=0.0, le=1e3,
    )  # fmt: skip
    copies_drift_per_k: float = quantity(
        "relative drift with which these copies follow the temperature of the stator", "1/K",
        default=0.0, ge=-0.02, le=0.02,
    )  # fmt: skip

    def __init__(self, *values: Any, **named: Any) -> None:
        super().__init__(*values, **named)
        if abs(self.offset) > self.span:
            raise ParameterError(
                f"Tracker: offset = {self.offset:g} is not valid; the oscillator reaches {self.span:g} either way, so "
                "widen its span."
            )
        if self.sense == "feedback" and self.sense_ohm:
            raise ParameterError("Tracker: sense_ohm is for sense = 'current'; leave it out with sense = 'feedback'.")

    @property
    def sense_corner_hz(self) -> float:
        """Frequency in Hz below which a current transformer passes little current; 0 of a resistor."""
        return self.sense_ohm / (2.0 * pi * self.magnetizing_h) if self.magnetizing_h else 0.0

    def sensed_share(self, frequency: Any) -> Any:
        """Return what is sensed of a current at a frequency in Hz, or at an array of them: it leads by the corner."""
        return 1.0 / (1.0 - 1j * self.sense_corner_hz / np.asarray(frequency))

    @property
    def gain_hz_per_v(self) -> float:
        """Gain of the oscillator in Hz/V."""
        return 2.0 * self.span * self.frequency / RAIL

    @property
    def tuned_hz(self) -> dict[str, float]:
        """Lowest and highest frequency of the oscillator."""
        return {"least": self.frequency * (1.0 - self.span), "greatest": self.frequency * (1.0 + self.span)}

    @property
    def start_v(self) -> float:
        """Control voltage at the start."""
        return RAIL / 2.0 + self.offset * self.frequency / self.gain_hz_per_v

    @property
    def wanted_deg(self) -> float:
        """Target phase of the motional current in degrees; that of an observer is 0, resonance."""
        return self.target_deg if self.kind == "pll" else 0.0

    def as_source(self, motor: Motor, law: Law | None) -> TrackedSource:
        """Return a tracker of the last mode, with the proposed filter for its bandwidth."""
        mode = motor.main_mode
        lag = running_resonance(motor, self, mode=mode, contact=law is not None)
        return TrackedSource(self, mode, propose_filter(self, lag))


# what the kinds of disturbances change; it is 0 before
CHANGED = {
    "load": "load_torque_n_m", "preload": "preload_change", "temperature": "drift", "target": "target_step_deg",
    "supply": "supply_change",
}  # fmt: skip


class Disturbance(Stated):
    """A disturbance of a tracked motor: what a kind changes, it moves from its last value to another one.

    Raises:
        ParameterError: by the constructor, for an invalid value.
    """

    kind: DisturbanceKind = Field(description="disturbance; the losses warm up the averaged motor only")
    begin_s: float = quantity("time at which it begins", "s", default=0.0, ge=0.0)
    load_torque_n_m: float = quantity("load torque after the step", "N·m", default=0.0, ge=-1e3, le=1e3)
    load_change_n_s_per_m: float | None = quantity(
        "change of the resistance of a transducer's load", "N·s/m", default=None, ge=-1e9, le=1e9
    )
    preload_change: float = quantity("relative change of the static normal force", "1", default=0.0, ge=-0.9, le=10.0)
    supply_change: float = quantity("relative change of the supply", "1", default=0.0, ge=-0.99, le=1.0)
    drift: float = quantity("relative drift of all resonance frequencies", "1", default=0.0, ge=-0.2, le=0.2)
    drift_time_s: float = quantity("duration of the drift", "s", default=50e-3, ge=1e-4, le=100.0)
    thermal: Thermal | None = Field(default=None, description="coefficients of the drift; only frequencies by default")
    target_step_deg: float = quantity("change of a loop's target phase", "°", default=0.0, ge=-60.0, le=60.0)

    @property
    def value(self) -> float:
        """What it changes, afterwards: the drift as a temperature rise in K."""
        if self.load_change_n_s_per_m is not None:
            return self.load_change_n_s_per_m
        return self.rise_k if self.kind == "temperature" else float(getattr(self, CHANGED.get(self.kind, ""), 0.0))

    @property
    def drifting(self) -> Thermal | None:
        """Coefficients of the drift; ``None`` without one."""
        if self.kind == "temperature":
            return self.thermal or Thermal(coupling_drift_per_k=0.0, capacitance_drift_per_k=0.0)
        return self.thermal or Thermal() if self.kind == "warm-up" else None

    @property
    def rise_k(self) -> float:
        """Temperature rise in K that causes the drift; 0 without one."""
        if not self.drift or self.drifting is None:
            return 0.0
        per_k = self.drifting.frequency_drift_per_k
        require(per_k, "thermal.frequency_drift_per_k", per_k, "other than 0, to cause a drift of the frequencies")
        return self.drift / per_k

    @property
    def end_s(self) -> float:
        """End of the disturbance in s."""
        lasts = {"temperature": self.drift_time_s, "start": 0.0, "target": 1e-6, "warm-up": 0.0}
        return self.begin_s + lasts.get(self.kind, STEP_TIME)

    def to_dict(self) -> dict[str, Any]:
        """Return the disturbance, JSON-ready; values of other kinds are ``None``."""
        kinds = {name: kind for kind, name in CHANGED.items()} | {"drift_time_s": "temperature"}
        values = {name: getattr(self, name) if kind == self.kind else None for name, kind in kinds.items()}
        if self.load_change_n_s_per_m is not None:
            values["load_change_n_s_per_m"] = self.load_change_n_s_per_m
        return {"kind": self.kind, "begin_s": self.begin_s, **values}


@dataclass(frozen=True)
class Disturbances:
    """The disturbances of a run, in the order of their beginnings.

    Raises:
        ParameterError: for two of a kind at the same time, or a ``"warm-up"`` beside a ``"temperature"``.
    """

    events: tuple[Disturbance, ...] = (Disturbance(kind="start"),)

    def __post_init__(self) -> None:
        kinds = {one.kind for one in self.events}
        if {"temperature", "warm-up"} <= kinds:
            raise ParameterError("disturbances: 'temperature' and 'warm-up' exclude each other. Give one.")
        for kind in kinds:
            for before, after in pairwise(self.of(kind)):
                if after.begin_s < before.end_s * (1.0 - ROUNDING):
                    raise ParameterError(
                        f"disturbances: {kind!r} at {after.begin_s:g} s is not valid: it must begin at "
                        f"{before.end_s:g} s or later, when the one before it has ended."
                    )

    def of(self, kind: str) -> list[Disturbance]:
        """Return those of a kind."""
        return [one for one in self.events if one.kind == kind]

    def course(self, kind: str, at: float = 0.0, by: float = 1.0) -> list[tuple[float, float]]:
        """Return times in s and what a kind changes, times ``by``, from ``at`` on."""
        found = [(0.0, at)]
        for one in self.of(kind):
            if one.begin_s > found[-1][0]:  # else it begins where the last one ends
                found.append((one.begin_s, found[-1][1]))
            found.append((one.end_s, at + by * one.value))
        return found

    def last(self, kind: str) -> float:
        """Return what a kind changes at the end."""
        return next((one.value for one in reversed(self.of(kind))), 0.0)

    def at(self, time: float) -> dict[str, float]:
        """Return what each kind has changed at a time in s."""
        return {kind: float(np.interp(time, *np.transpose(self.course(kind)))) for kind in CHANGED if self.of(kind)}

    @property
    def on_tool(self) -> bool:
        """Whether they change the resistance of a transducer's load."""
        return any(one.load_change_n_s_per_m is not None for one in self.events)

    @property
    def begin_s(self) -> float | None:
        """When the first begins; ``None`` where there are only the start and the losses."""
        return min((one.begin_s for one in self.events if one.kind in CHANGED), default=None)

    @property
    def end_s(self) -> float:
        """End of the last in s."""
        return max(one.end_s for one in self.events)

    @property
    def drifting(self) -> Thermal | None:
        """Coefficients of the drift; ``None`` without one."""
        return next((one.drifting for one in self.events if one.drifting), None)

    def add(self, circuit: Circuit, motor: Motor) -> None:
        """Add the sources at the motor."""
        sources = {"temperature": self.course("temperature")}
        if self.on_tool:
            sources["tool"] = self.course("load", motor.load_resistance_n_s_per_m)
        elif len(load := self.course("load")) > 1:
            circuit.I("load", "shaft", circuit.gnd, schedule_text(load))
        if self.of("preload"):
            preload = motor.contact.preload_n
            course = self.course("preload", preload, preload)
            sources["approach"] = [(at, 1e6 * motor.approach_m(force)) for at, force in course]
        for node, course in sources.items():
            if len(course) > 1:
                circuit.V(node, node, circuit.gnd, schedule_text(course))


def mode_force(motor: Motor, tracker: Tracker, mode: int) -> float:
    """Return the amplitude in N of the force on a mode."""
    volts = list(two_phasors(tracker).values())[: len(motor.groups)]
    return abs(complex(motor.stator.coupling[mode] @ volts))


@checked
def running_resonance(motor: Motor, tracker: Tracker, *, mode: int | None = None, contact: bool = True) -> StatorLag:
    """Return resonance and loaded quality factor of a running mode, by harmonic balance.

    Args:
        motor: the motor.
        tracker: voltages and phase of its drive.
        mode: index of the mode, from 0; by default the last.
        contact: whether the tip is on the rotor.
    """
    tracked = motor.main_mode if mode is None else mode
    return stator_lag(motor, tracked, mode_force(motor, tracker, tracked), contact=contact)


def loop_gain(tracker: Tracker, lag: StatorLag, loop_filter: LoopFilter, frequency_hz: Any) -> Any:
    """Return the averaged loop gain at a frequency or an array of them; −1 is its stability limit."""
    s = 2j * pi * frequency_hz
    tau, detuning = lag.time_constant_s, -tan(pi * tracker.target_deg / 180.0)
    stator = tau * (1.0 + s * tau) / ((1.0 + s * tau) ** 2 + detuning**2)
    return tracker.pump_current_a * loop_filter.impedance(s) * tracker.gain_hz_per_v * stator


def propose_filter(tracker: Tracker, lag: StatorLag) -> LoopFilter:
    """Propose a filter with which the loop gain of a tracker is 1 at its bandwidth.

    Its zero cancels the lag of the stator, so that the loop is an integrator. The ripple pole lies
    ``tracker.ripple_ratio`` above the bandwidth and takes atan(1/ripple_ratio) of the phase margin.
    """
    zero, pole = lag.time_constant_s, 1.0 / (2.0 * pi * tracker.bandwidth_hz * tracker.ripple_ratio)
    # of a farad altogether: R C = zero and R C c / (C + c) = pole, hence c = pole/zero of the whole
    ripple = min(pole / zero, 0.9)
    unit = LoopFilter(zero / (1.0 - ripple), 1.0 - ripple, ripple)
    whole = float(abs(loop_gain(tracker, lag, unit, tracker.bandwidth_hz)))
    return LoopFilter(unit.resistance_ohm / whole, unit.capacitance_f * whole, unit.ripple_f * whole)


def weights(motor: Motor, mode: int) -> dict[str, float]:
    """Return the weights of the groups' voltages and currents for one mode, for ``tracker_sense``.

    The motional currents are Σ θ v of all modes; the pseudo-inverse of the couplings gives the velocity of one mode.
    """
    couplings = np.pad(motor.stator.coupling, ((0, 0), (0, len(GROUPS) - len(motor.groups))))
    forces = couplings[mode]
    currents = np.linalg.pinv(couplings.T)[mode]
    if not np.abs(forces).max() > 0.0:
        raise ParameterError(f"Mode {mode + 1} of {motor.name} is not driven by any group; track another one.")
    forces, currents = forces / np.abs(forces).max(), currents / np.abs(currents).max()
    return {
        groups.named(kind, group): weight
        for kind, weights_of in (("force", forces), ("current", currents))
        for group, weight in zip(GROUPS, weights_of.tolist(), strict=True)
    }


def sensed_modes(motor: Motor, mode: int, sense: str = "current") -> NDArray[np.float64]:
    """Return the current in A that a tracker of a mode senses of each mode, per m/s."""
    if sense == "feedback" and motor.feedback:
        return motor.stator.sensed
    weighted = weights(motor, mode)
    return np.asarray(motor.stator.coupling @ [weighted[groups.named("current", group)] for group in motor.groups])


def sensed_velocity(motor: Motor, tracker: Tracker, mode: int) -> complex:
    """Return the current in A that a tracker senses per m/s of its mode, at resonance.

    A feedback electrode also senses modes that are close: on a ring it shows the wave where it is, with a phase. Each
    mode is taken with the loaded quality factor of the tracked one.
    """
    if tracker.sense == "current" or motor.feedback is None:
        return complex(sensed_modes(motor, mode)[mode])
    stator, lag = motor.stator, running_resonance(motor, tracker, mode=mode)
    omega = 2.0 * pi * motor.modes[mode].frequency_hz
    impedance = stator.mass * omega / lag.quality + 1j * (omega * stator.mass - stator.stiffness / omega)
    velocity = stator.coupling @ list(two_phasors(tracker).values()) / impedance
    return complex(stator.sensed @ velocity / velocity[mode])


def sensing(motor: Motor, tracker: Tracker, mode: int) -> dict[str, float]:
    """Return the copies of the clamped capacitances and the weights by which a tracker senses a mode."""
    copies, weighted = {}, weights(motor, mode)
    matrix = dielectric_matrix(motor, tracker.frequency)
    if len(motor.groups) == 1:  # the copy of the channel that is not there does not count
        matrix = np.eye(len(GROUPS)) * matrix
    for at, group in enumerate(GROUPS):
        weight, cross = (weighted[f"current_{one}"] for one in (group, GROUPS[1 - at]))
        # a copy also stands for the current that its voltage draws through the capacitance between the groups
        drawn = matrix[at, at] + (matrix[1 - at, at] * cross / weight if weight else 0.0)
        impedance = 1.0 / complex(drawn)
        capacitance = -1.0 / (2.0 * pi * tracker.frequency * impedance.imag)
        share = 1.0 + tracker.capacitance_error if tracker.copies else _NO_COPY
        copies[groups.named("capacitance", group)] = capacitance * share
        copies[groups.named("resistance", group)] = max(impedance.real, 1e-9)  # a capacitance without loss
    return copies | weighted


@dataclass(frozen=True)
class TrackedSource(Source):
    """An oscillator whose frequency a tracker sets, directly at the pins or in front of a driver circuit.

    Nodes: ``sine``, ``cosine``, ``tuned`` (Hz) of the oscillator, ``control`` and ``tuning`` before it; ``motional``,
    ``force``, ``ahead``, ``power`` of the sensing circuit at the pins; ``target`` (degrees).
    """

    tracker: Tracker  # the tracker, its drive and its oscillator
    mode: int  # index of the mode to track, from 0
    loop_filter: LoopFilter  # filter of a phase-locked loop
    # behind the oscillator, sets voltages and phase; ``None`` for ideal sources
    driver: Driver | None = None
    disturbances: Disturbances = Disturbances()  # what happens to the loop and the motor
    # parameters of ``tracker_restart``, and the ``conductance`` in S below which lock is lost
    restart: Mapping[str, float] | None = None
    inject: str = ""  # source between ``control`` and ``tuning``, by default 0 V
    vectors = ("v(tuned)",)
    fewest_points = 50  # the phase detector responds to an edge at the end of a step: 7 degrees

    @property
    def label(self) -> str:
        """Tracker, voltages and middle frequency."""
        through = f" through {self.driver.label}" if self.driver else ""
        return f"{self.tracker.kind} about {self.tracker.frequency / 1e3:.6g} kHz{through}"

    @property
    def frequencies(self) -> tuple[float, ...]:
        """The highest frequency of the oscillator in Hz."""
        return (self.tracker.frequency * (1.0 + self.tracker.span),)

    @property
    def period(self) -> float:
        """Period in s in the middle of the oscillator's range."""
        return 1.0 / self.tracker.frequency

    @property
    def points_per_period(self) -> int:
        """Default number of steps in a period of the fastest motion."""
        return 250 if self.filtered else 200

    @property
    def filtered(self) -> bool:
        """Whether low-pass filters precede the detector: harmonics of a bridge can add edges to those it counts."""
        return self.driver is not None and self.driver.switched

    def low_pass(self, frequency: Any) -> Any:
        """Return the transfer function of these filters at frequencies in Hz; 1 without filters."""
        ratio = np.asarray(frequency) / self.tracker.frequency
        return 1.0 / (1.0 - ratio**2 + 1j * ratio) if self.filtered else 1.0

    def ringing_step(self, motor: Motor) -> float:
        """Return the longest default step in s by what rings in the driver."""
        return self.driver.ringing_step(motor) if self.driver else inf

    def measured_period(self, samples: Mapping[str, Any]) -> float:
        """Return the period in s of the oscillator at the end of a run, from its mean frequency over 20 periods."""
        time, tuned = (np.asarray(samples[name]) for name in ("time", "v(tuned)"))
        late = time >= time[-1] - 20.0 * self.period
        return float((time[late][-1] - time[late][0]) / np.trapezoid(tuned[late], time[late]))

    def check(self, motor: Motor) -> None:
        """Raise a ParameterError if no group drives the mode, or the driver has no control input."""
        weights(motor, self.mode)
        if self.tracker.sense == "feedback" and not (motor.feedback and motor.stator.sensed[self.mode]):
            sensed = zip(motor.modes, motor.stator.sensed if motor.feedback else (), strict=False)
            others = " or ".join(mode.name for mode, value in sensed if value)
            raise ParameterError(
                f"sense = 'feedback' needs a feedback electrode on the mode {motor.modes[self.mode].name}, and "
                f"{motor.name} has {f'one on {others}: track this mode (mode)' if others else 'none: add [feedback]'}, "
                "or sense the current."
            )
        if self.driver and not self.driver.controlled:
            raise ParameterError(
                f"The driver {self.driver.name} has no pin in, so no tracker can set its frequency. Add the pin."
            )

    def options(self, motor: Motor, law: Law | None) -> Mapping[str, str]:  # noqa: ARG002
        """Return ngspice's options, behind switching edges with control of the steps."""
        return BRIDGE_OPTIONS if self.filtered else TRACKER_OPTIONS

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add oscillator, tracker, driver and sensing between ground and the nodes of groups A and B."""
        tracker, driver, disturbances = self.tracker, self.driver, self.disturbances
        parts = ["tracker_sense", "tracker_oscillator", "tracker_phases"]
        parts += {"none": [], "pll": ["tracker_detector", "tracker_filter"]}.get(tracker.kind, ["tracker_observer"])
        circuit.raw_spice += "\n".join(read_library(part).subcircuit for part in parts) + "\n"
        instantiate(
            circuit, "oscillator", "tracker_oscillator", ("tuning", "sine", "cosine", "tuned"),
            **tracker.tuned_hz, rail=RAIL,
        )  # fmt: skip
        pins = (*pins, *GROUPS[len(pins) :])  # without a group B its nodes carry no current
        lines = tuple(groups.named("sensed", group) if driver else groups.named("line", group) for group in GROUPS)
        controls = tuple(groups.named("control", group) for group in GROUPS) if driver else lines
        amplitudes = [control_amplitude(driver, group) for group in driver.groups] if driver else [
            tracker.voltage, tracker.voltage * tracker.ratio_b
        ]  # fmt: skip
        amplitudes.append(0.0)
        waves: Sequence[str] = ("sine", "cosine")
        supply = disturbances.course("supply", 1.0)
        if len(supply) > 1 and not (driver and driver.supplied):
            waves = ("supplied_sine", "supplied_cosine")
            circuit.V("supply", "supply", circuit.gnd, schedule_text(supply))
            circuit.raw_spice += "".join(f"B{wave} {wave} 0 V=V(supply)*V({wave[9:]})\n" for wave in waves)
        instantiate(
            circuit, "phases", "tracker_phases", (*waves, *controls, circuit.gnd),
            amplitude_a=amplitudes[0], amplitude_b=amplitudes[1],
            phase_deg=driver.phase_deg if driver else tracker.phase_deg,
        )  # fmt: skip
        if driver:
            add_driver(circuit, driver, dict(zip(driver.groups, lines, strict=False)), source=False, supply=supply[1:])
            if driver.channels == 1:
                circuit.R("idle", lines[1], circuit.gnd, 1e3)
        instantiate(
            circuit, "sense", "tracker_sense",
            (
                *self._sensed(circuit, lines, pins), circuit.gnd, self._add_electrode(circuit, motor), "force", "ahead",
                "power",
                "temperature" if disturbances.of("temperature") else circuit.gnd,
            ),
            frequency=tracker.frequency, drift=tracker.copies_drift_per_k, **sensing(motor, tracker, self.mode),
        )  # fmt: skip
        circuit.V("inject", "tuning", "control", self.inject or "DC 0")
        self._add_control(circuit, motor)
        disturbances.add(circuit, motor)

    def _sensed(self, circuit: Circuit, lines: Sequence[str], pins: Sequence[str]) -> list[str]:
        """Add the resistor or current transformer of each line; return the nodes between which its current is sensed.

        The magnetising inductance takes its current past the sensing circuit.
        """
        tracker, found = self.tracker, list[str]()
        for group, line, pin in zip(GROUPS, lines, pins, strict=True):
            if tracker.sense_ohm:
                drawn, sensed = groups.named("drawn", group), groups.named("meter", group)
                circuit.V(drawn, line, drawn, "DC 0")
                circuit.R(groups.named("sense", group), drawn, sensed, tracker.sense_ohm)
                if tracker.magnetizing_h:
                    circuit.L(groups.named("sense", group), drawn, pin, f"{tracker.magnetizing_h!r} ic=0")
                line = sensed
            found += [line, pin]
        return found

    def _add_electrode(self, circuit: Circuit, motor: Motor) -> str:
        """Add what senses the feedback electrode, if it does; return the node of the current that the lines carry.

        The voltage of the electrode less its shares of those of the groups follows the displacement; through a copy of
        its capacitance it drives the current of the electrode on a short circuit, in phase with the velocity.
        """
        electrode = motor.feedback
        if self.tracker.sense == "current" or electrode is None:
            return "motional"
        shares = [share * (1.0 + self.tracker.capacitance_error) * self.tracker.copies for share in electrode.shares]
        circuit.raw_spice += f"""\
Esensed sensed_f 0 xmotor.{FEEDBACK} 0 1
Eshare_a less_a sensed_f a 0 {-shares[0]!r}
Eshare_b less_b less_a b 0 {-shares[1]!r}
Celectrode less_b summed_f {electrode.capacitance_f!r}
Velectrode summed_f 0 DC 0
Helectrode motional 0 Velectrode -1
"""
        return "of_lines"

    def _add_control(self, circuit: Circuit, motor: Motor) -> None:
        """Add what sets the control voltage: a constant, detector and filter, or an observer."""
        tracker = self.tracker
        if tracker.kind == "none":
            circuit.V("control", "control", circuit.gnd, f"DC {tracker.start_v!r}")
            return
        if tracker.kind == "pll":
            ahead = degrees(phase(sensed_velocity(motor, tracker, self.mode)))
            targets = [(at, target + ahead) for at, target in self.targets]
            circuit.V("target", "target", circuit.gnd, schedule_text(targets))
            detected = self._add_low_passes(circuit) if self.filtered else ("motional", "force", "ahead")
            instantiate(
                circuit, "detector", "tracker_detector", (*detected, "target", "control"),
                current=tracker.pump_current_a, polarity=tracker.polarity, rail=RAIL,
            )  # fmt: skip
            add_filter(circuit, self.loop_filter, tracker.start_v)
            if self.restart:
                self._add_restart(circuit, **self.restart)
            return
        # about 1 V at the free resonance: the weighted motional current, the power, or the speed of the tip
        force = mode_force(motor, tracker, self.mode)
        velocity = force / motor.modes[self.mode].damping_n_s_per_m
        if tracker.kind == "observe-power":
            expression = f"{2.0 / (force * velocity):.10g}*V(power)"
        elif tracker.kind == "observe-speed":
            expression = f"abs(V(shaft))*{motor.rotor.radius_m / (abs(motor.modes[self.mode].tip_x) * velocity):.10g}"
        else:
            sensed = abs(sensed_velocity(motor, tracker, self.mode))
            expression = f"(V(motional)*{1.0 / (sensed * velocity):.10g})**2"
        circuit.raw_spice += f"Bquantity quantity 0 V={expression}\n"
        instantiate(
            circuit, "observer", "tracker_observer", ("quantity", "control"),
            bandwidth=tracker.average_hz, period=tracker.period_s, step=tracker.step_hz / tracker.gain_hz_per_v,
            polarity=tracker.polarity, rail=RAIL, start=tracker.start_v,
        )  # fmt: skip

    def _add_low_passes(self, circuit: Circuit) -> tuple[str, ...]:
        """Add these filters; return their outputs. The rate of the force is in phase with the current of its filter."""
        # impedance of all parts at the corner, so that Q is 1; with 1 Ω and amperes ngspice did not converge
        omega, ohm = 2.0 * pi * self.tracker.frequency, 1e3
        circuit.raw_spice += "* equal low-pass filters against harmonics of the bridge\n"
        for name in ("motional", "force"):
            circuit.raw_spice += f"""\
E{name} {name}_in 0 {name} 0 1
R{name} {name}_in {name}_coil {ohm!r}
L{name} {name}_coil {name}_low {ohm / omega!r} ic=0
C{name} {name}_low 0 {1.0 / (omega * ohm)!r} ic=0
"""
        circuit.raw_spice += "Eahead ahead_low 0 force_in force_coil 1\n"
        return "motional_low", "force_low", "ahead_low"

    def _add_restart(self, circuit: Circuit, conductance: float, **values: float) -> None:
        """Add the detection of a loss of lock, averaged over some periods, and the restart."""
        smoothed = LOST_PERIODS * self.period
        circuit.raw_spice += f"""\
{read_library("tracker_restart").subcircuit}
Bwanted wanted 0 V=cos({pi / 180.0!r}*V(target))*V(force)+sin({pi / 180.0!r}*V(target))*V(ahead)
Blost 0 lost I=V(wanted)*({conductance!r}*V(wanted)-V(motional))
Rlost lost 0 1
Clost lost 0 {smoothed!r} ic={-conductance!r}
"""
        current = self.tracker.pump_current_a
        instantiate(circuit, "restart", "tracker_restart", ("lost", "control", "restart"), current=current, **values)

    @property
    def unsteady(self) -> str:
        """Why shooting cannot find a steady state behind a tracker."""
        return f"A tracker ({self.label}) has feedback: its voltages have no fixed period."

    @property
    def targets(self) -> list[tuple[float, float]]:
        """The target phase in degrees over time in s."""
        return self.disturbances.course("target", self.tracker.target_deg)

    @property
    def pins(self) -> tuple[str, ...]:
        """Pins of the motor that the disturbances drive."""
        driven = {"temperature": ("temperature", "heat"), "preload": ("approach",)}
        pins = tuple(pin for kind, pins in driven.items() if self.disturbances.of(kind) for pin in pins)
        return (*pins, "tool") if self.disturbances.on_tool else pins

    @property
    def thermal(self) -> Thermal | None:
        """Drift of a motor whose temperature the disturbances change."""
        return self.disturbances.drifting

    def initial_voltages(self) -> tuple[float, ...]:
        """Return the voltages of the pins at t = 0: the oscillator starts with cosine 1."""
        if self.driver:
            return self.driver.initial_voltages()
        volts = two_phasors(self.tracker)
        return volts["a"].imag, volts["b"].imag

    def current(self, group: str) -> tuple[str, float]:
        """Return the vector of the current into a pin, and its sign."""
        return groups.current("drawn" if self.tracker.sense_ohm else ".xsense.vline", group), 1.0

    def to_dict(self) -> dict[str, Any]:
        """Return tracker, mode and driver, JSON-ready."""
        return {
            "kind": "tracker", "label": self.label, "tracker": self.tracker.model_dump(), "mode": self.mode,
            "driver": self.driver.to_dict() if self.driver else None,
        }  # fmt: skip


def restart_values(
    motor: Motor, tracker: Tracker, mode: int, lag: StatorLag, loop_filter: LoopFilter
) -> dict[str, float]:
    """Return the parameters of ``tracker_restart``, and the ``conductance`` in S below which lock is lost."""
    velocity = 2.0 * pi * lag.resonance_hz * lag.amplitude_m
    force = mode_force(motor, tracker, mode) / max(map(abs, motor.modes[mode].couplings))  # V, as sensed
    sweep = RAIL * (loop_filter.capacitance_f + loop_filter.ripple_f) / (tracker.pump_current_a * LOST_DEG / 360.0)
    return {
        "conductance": tracker.lost_share * abs(sensed_velocity(motor, tracker, mode)) * velocity / force,
        "wait": tracker.restart_after_s or 2.0 * sweep, "hold": HELD_LAGS * lag.time_constant_s,
        "home": tracker.start_v,
    }  # fmt: skip


def add_filter(circuit: Circuit, loop_filter: LoopFilter, start_v: float, *, suffix: str = "") -> None:
    """Add a loop filter at the node ``control``, charged to a voltage."""
    instantiate(
        circuit, f"filter{suffix}", "tracker_filter", (f"control{suffix}",), start=start_v,
        resistance=loop_filter.resistance_ohm, capacitance=loop_filter.capacitance_f, ripple=loop_filter.ripple_f,
    )  # fmt: skip
