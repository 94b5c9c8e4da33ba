# SPDX-License-Identifier: GPL-3.0-or-later
"""Resonance trackers as PySpice circuits: sense, detect, filter, oscillate, in front of a motor that is disturbed.

    oscillator --> two phases --> sense --> motor
         ^                          |
         +--- filter <-- detector <-+     or observer <-- power, or square of the motional current

The parts are the libraries ``behavioral/tracker_*.lib``; docs/tracking.md explains them.
"""

from __future__ import annotations

from cmath import rect
from dataclasses import dataclass
from math import pi, radians, tan
from typing import Any, Literal, get_args

import numpy as np
from pydantic import Field
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import quantity
from pyspice_runner.model.refusal import Stated
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.model.tracking import LoopFilter, StatorLag, propose_filter, stator_lag
from pyspice_runner.netlist.contact import ContactLaw
from pyspice_runner.netlist.library import read_library
from pyspice_runner.netlist.motor import Discretisation, add_motor, dielectric_resistance, instantiate

TrackerKind = Literal["none", "pll", "observe-current", "observe-power"]
DisturbanceKind = Literal["start", "target", "load", "preload", "temperature"]

RAIL = 5.0  # V, range of the control voltage
# Digital events shorten steps, so that the error control of ngspice is left out as for uniform steps; trackers hold
# voltages of some volts and frequencies of some ten thousand.
TRACKER_OPTIONS = {"reltol": "1e-5", "vntol": "1e-7", "abstol": "1e-8", "trtol": "1e9", "method": "trap"}
STEP_TIME = 0.2e-3  # s, over which a load or a preload steps: faster than any loop, slow for the modes


class Tracker(Stated):
    """A two-phase drive whose frequency a tracker sets; with ``none`` it stays where it is.

    Raises:
        ParameterError: by the constructor, for a value that is refused.
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
    capacitance_error: float = quantity(
        "error of the copies of the clamped capacitances, relative", "1", default=0.0, ge=-0.9, le=2.0
    )

    def __init__(self, **values: Any) -> None:
        super().__init__(**values)
        if abs(self.offset) > self.span:
            raise ParameterError(
                f"Tracker: offset = {self.offset:g} is refused; the oscillator reaches {self.span:g} either way, so "
                "widen its span."
            )

    @property
    def gain_hz_per_v(self) -> float:
        """Gain of the oscillator."""
        return 2.0 * self.span * self.frequency / RAIL

    @property
    def start_v(self) -> float:
        """Control voltage at the start."""
        return RAIL / 2.0 + self.offset * self.frequency / self.gain_hz_per_v

    @property
    def wanted_deg(self) -> float:
        """Phase at which the motional current is wanted; an observer climbs to resonance."""
        return self.target_deg if self.kind == "pll" else 0.0

    def phasors(self) -> dict[str, complex]:
        """Return the voltages' phasors in V, group A at phase 0."""
        return {"a": complex(self.voltage), "b": rect(self.voltage * self.ratio_b, radians(self.phase_deg))}


@dataclass(frozen=True)
class Disturbance:
    """What happens to a motor that is tracked.

    Attributes:
        kind: ``"start"``: nothing but the start; ``"target"``, ``"load"``, ``"preload"`` or ``"temperature"``.
        begin_s: when it begins.
        load_torque_n_m: torque that a load draws from then on.
        preload_change: relative change of the static normal force.
        drift: relative drift of all resonance frequencies.
        drift_time_s: time that the drift takes.
        thermal: what drifts besides; by default nothing but the frequencies.
        target_step_deg: step of the phase that a phase-locked loop is to hold.
    """

    kind: DisturbanceKind
    begin_s: float = 0.0
    load_torque_n_m: float = 0.0
    preload_change: float = 0.0
    drift: float = 0.0
    drift_time_s: float = 50e-3
    thermal: Thermal | None = None
    target_step_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in get_args(DisturbanceKind):
            allowed = ", ".join(get_args(DisturbanceKind))
            raise ParameterError(f"disturb = {self.kind!r} is refused; allowed are {allowed}.")
        for name, value, low, high, unit in (
            ("load_torque", self.load_torque_n_m, -1e3, 1e3, " N·m"),
            ("preload_change", self.preload_change, -0.9, 10.0, ""),
            ("drift", self.drift, -0.2, 0.2, ""),
            ("drift_time", self.drift_time_s, 1e-4, 100.0, " s"),
            ("target_step", self.target_step_deg, -60.0, 60.0, "°"),
        ):
            if not low <= value <= high:
                raise ParameterError(
                    f"{name} = {value:g}{unit} is refused; allowed is a number from {low:g} to {high:g}{unit}."
                )

    @property
    def coefficients(self) -> Thermal:
        """Coefficients of the thermal motor."""
        return self.thermal or Thermal(coupling_drift_per_k=0.0, capacitance_drift_per_k=0.0)

    @property
    def end_s(self) -> float:
        """When it has ended."""
        return self.begin_s + {"start": 0.0, "target": 0.0, "temperature": self.drift_time_s}.get(self.kind, STEP_TIME)


def mode_force(motor: Motor, tracker: Tracker, mode: int) -> float:
    """Return the amplitude in N of the force on a mode."""
    own, volts = motor.modes[mode], tracker.phasors()
    return abs(own.coupling_a_n_per_v * volts["a"] + own.coupling_b_n_per_v * volts["b"])


def tracked_lag(motor: Motor, tracker: Tracker, mode: int, *, contact: bool) -> StatorLag:
    """Return resonance and lag of the mode that a tracker is to follow."""
    return stator_lag(motor, mode, mode_force(motor, tracker, mode), contact=contact)


def tracker_filter(tracker: Tracker, lag: StatorLag) -> LoopFilter:
    """Return the filter that is proposed for a tracker's bandwidth."""
    return propose_filter(
        lag, tracker.bandwidth_hz, gain_hz_per_v=tracker.gain_hz_per_v, current_a=tracker.pump_current_a,
        target_deg=tracker.target_deg, ripple_ratio=tracker.ripple_ratio,
    )  # fmt: skip


def weights(motor: Motor, mode: int) -> dict[str, float]:
    """Return the weights by which the groups' voltages and currents single out one mode, for ``tracker_sense``.

    The motional currents are Σ θ v of all modes; the least-squares inverse of the couplings gives one mode's velocity.
    """
    couplings = np.array([[own.coupling_a_n_per_v, own.coupling_b_n_per_v] for own in motor.modes])
    forces = couplings[mode]
    currents = np.linalg.pinv(couplings.T)[mode]
    if not np.abs(forces).max() > 0.0:
        raise ParameterError(f"Mode {mode + 1} of {motor.name} is not driven by any group; track another one.")
    forces, currents = forces / np.abs(forces).max(), currents / np.abs(currents).max()
    return {
        "force_a": float(forces[0]), "force_b": float(forces[1]),
        "current_a": float(currents[0]), "current_b": float(currents[1]),
    }  # fmt: skip


def tracking_bench(
    motor: Motor,
    tracker: Tracker,
    disturbance: Disturbance,
    *,
    mode: int,
    loop_filter: LoopFilter,
    step: float,
    contact: ContactLaw | None = "spring-slider",
    speed: float | None = None,
    inject: str = "",
    title: str = "",
) -> Circuit:
    """Put a tracker in front of a motor, and what disturbs it around it.

    Nodes: ``sine``, ``cosine``, ``tuned`` (Hz) of the oscillator, ``control`` and ``tuning`` before it; ``a``, ``b``
    the pins; ``motional``, ``force``, ``ahead``, ``power`` what is sensed; ``target`` (degrees).

    Args:
        motor: the motor; instance ``Xmotor``.
        tracker: the tracker and its drive.
        disturbance: what happens.
        mode: index of the mode to follow, from 0.
        loop_filter: filter of a phase-locked loop.
        step: largest time step in s.
        contact: law of the contact; ``None`` for a free tip.
        speed: if given, the shaft is held at this speed, rad/s.
        inject: source between ``control`` and ``tuning``, which otherwise are the same.
        title: title line of the deck.
    """
    circuit = Circuit(title or f"{motor.name}: {tracker.kind}, {disturbance.kind}")
    parts = ["tracker_sense", "tracker_oscillator", "tracker_phases"]
    parts += {"none": [], "pll": ["tracker_detector", "tracker_filter"]}.get(tracker.kind, ["tracker_observer"])
    circuit.raw_spice += "\n".join(read_library(part).subcircuit for part in parts) + "\n"
    instantiate(
        circuit, "oscillator", "tracker_oscillator", ("tuning", "sine", "cosine", "tuned"),
        least=tracker.frequency * (1.0 - tracker.span), greatest=tracker.frequency * (1.0 + tracker.span), rail=RAIL,
    )  # fmt: skip
    instantiate(
        circuit, "phases", "tracker_phases", ("sine", "cosine", "line_a", "line_b", circuit.gnd),
        amplitude_a=tracker.voltage, amplitude_b=tracker.voltage * tracker.ratio_b, phase_deg=tracker.phase_deg,
    )  # fmt: skip
    copies = {}
    for group in ("a", "b"):
        copies[f"capacitance_{group}"] = getattr(motor.piezo, f"capacitance_{group}_f") * (
            1 + tracker.capacitance_error
        )
        copies[f"resistance_{group}"] = dielectric_resistance(motor, group)
    instantiate(
        circuit, "sense", "tracker_sense",
        ("line_a", "a", "line_b", "b", circuit.gnd, "motional", "force", "ahead", "power"),
        frequency=tracker.frequency, **copies, **weights(motor, mode),
    )  # fmt: skip
    circuit.V("inject", "tuning", "control", inject or "DC 0")
    _add_tracker(circuit, motor, tracker, mode, loop_filter, disturbance)
    nodes = _add_disturbance(circuit, motor, disturbance)
    if speed is not None:
        circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(speed)!r}")
    add_motor(
        circuit, motor, ("a", "b", circuit.gnd, "shaft", *nodes), contact=contact,
        discretisation=Discretisation(step, exact_resonance=False),
        thermal=disturbance.coefficients if disturbance.kind == "temperature" else None,
        approach=disturbance.kind == "preload",
    )  # fmt: skip
    return circuit


def averaged_bench(
    tracker: Tracker, lag: StatorLag, loop_filter: LoopFilter, *, closed: bool, target: str = "DC 0", title: str = ""
) -> Circuit:
    """Return the averaged loop: cut open at the oscillator's input and driven there by ``AC 1``, or closed.

    Cut open, the voltage at ``control`` is minus the loop gain. Closed, ``phase`` follows ``target``, both in rad.
    """
    circuit = Circuit(title or "averaged loop")
    circuit.raw_spice += "\n".join(read_library(f"tracker_{part}").subcircuit for part in ("average", "filter")) + "\n"
    circuit.V("target", "target", circuit.gnd, target)
    add_average(circuit, tracker, lag, loop_filter, source=None if closed else "DC 0 AC 1")
    return circuit


def add_average(
    circuit: Circuit,
    tracker: Tracker,
    lag: StatorLag,
    loop_filter: LoopFilter,
    *,
    suffix: str = "",
    source: str | None = None,
) -> None:
    """Add an averaged loop to a circuit: closed, or cut open and driven by a source at the oscillator's input."""
    control = f"control{suffix}"
    if source:
        circuit.V(f"tuning{suffix}", f"tuning{suffix}", circuit.gnd, source)
    instantiate(
        circuit, f"average{suffix}", "tracker_average",
        (f"tuning{suffix}" if source else control, "target", f"phase{suffix}", control),
        lag=lag.time_constant_s, detune=-tan(radians(tracker.target_deg)), gain=tracker.gain_hz_per_v,
        current=tracker.pump_current_a, polarity=tracker.polarity,
    )  # fmt: skip
    instantiate(circuit, f"filter{suffix}", "tracker_filter", (control,), start=0.0, **_filter_values(loop_filter))
    circuit.R(f"leak{suffix}", control, circuit.gnd, 1e15)  # a way for the direct current of the operating point


def _filter_values(loop_filter: LoopFilter) -> dict[str, float]:
    return {
        "resistance": loop_filter.resistance_ohm,
        "capacitance": loop_filter.capacitance_f,
        "ripple": loop_filter.ripple_f,
    }


def _add_tracker(
    circuit: Circuit, motor: Motor, tracker: Tracker, mode: int, loop_filter: LoopFilter, disturbance: Disturbance
) -> None:
    if tracker.kind == "none":
        circuit.V("control", "control", circuit.gnd, f"DC {tracker.start_v!r}")
        return
    if tracker.kind == "pll":
        begin, before = disturbance.begin_s, tracker.target_deg
        after = before + (disturbance.target_step_deg if disturbance.kind == "target" else 0.0)
        wanted = (
            f"DC {before!r}"
            if after == before
            else f"PWL(0 {before!r} {begin!r} {before!r} {begin + 1e-6!r} {after!r})"
        )
        circuit.V("target", "target", circuit.gnd, wanted)
        instantiate(
            circuit, "detector", "tracker_detector", ("motional", "force", "ahead", "target", "control"),
            current=tracker.pump_current_a, polarity=tracker.polarity, rail=RAIL,
        )  # fmt: skip
        instantiate(
            circuit, "filter", "tracker_filter", ("control",), start=tracker.start_v, **_filter_values(loop_filter)
        )
        return
    # about 1 V at resonance, free: the motional current as the sense circuit weighs it, or the power
    own, weight = motor.modes[mode], weights(motor, mode)
    force = mode_force(motor, tracker, mode)
    velocity = force / own.damping_n_s_per_m
    if tracker.kind == "observe-power":
        expression = f"{2.0 / (force * velocity):.10g}*V(power)"
    else:
        sensed = weight["current_a"] * own.coupling_a_n_per_v + weight["current_b"] * own.coupling_b_n_per_v
        expression = f"(V(motional)*{1.0 / (sensed * velocity):.10g})**2"
    circuit.raw_spice += f"Bquantity quantity 0 V={expression}\n"
    instantiate(
        circuit, "observer", "tracker_observer", ("quantity", "control"),
        bandwidth=tracker.average_hz, period=tracker.period_s, step=tracker.step_hz / tracker.gain_hz_per_v,
        polarity=tracker.polarity, rail=RAIL, start=tracker.start_v,
    )  # fmt: skip


def _add_disturbance(circuit: Circuit, motor: Motor, disturbance: Disturbance) -> tuple[str, ...]:
    """Add the sources and return the nodes of the motor's further pins."""

    def ramp(value: float) -> str:
        return f"PWL(0 0 {disturbance.begin_s:.9g} 0 {disturbance.end_s:.9g} {value:.10g})"

    if disturbance.kind == "load":
        circuit.I("load", "shaft", circuit.gnd, ramp(disturbance.load_torque_n_m))
    if disturbance.kind == "preload":
        factor = 1.0 + disturbance.preload_change
        deeper = contact_law.static_penetration(motor.contact) * (factor ** (2.0 / 3.0) - 1.0)
        bent = contact_law.static_deflection(motor.contact, motor.modes) * disturbance.preload_change
        circuit.V("approach", "approach", circuit.gnd, ramp(1e6 * (deeper + bent)))
        return ("approach",)
    if disturbance.kind == "temperature":
        temperature = disturbance.drift / disturbance.coefficients.frequency_drift_per_k
        circuit.V("temperature", "temperature", circuit.gnd, ramp(temperature))
        return ("temperature", "heat")
    return ()


def settling_hint(tracker: Tracker, lag: StatorLag) -> float:
    """Return a time in s after which a tracker that starts at resonance may be disturbed."""
    slow = 1.0 / (2.0 * pi * tracker.bandwidth_hz) if tracker.kind == "pll" else 0.0
    return 20.0 * lag.time_constant_s + 8.0 * slow
