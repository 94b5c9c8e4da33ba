# SPDX-License-Identifier: GPL-3.0-or-later
"""Matching networks between a power stage and the groups, so that the stage sees a resistance."""

from __future__ import annotations

from cmath import phase, rect
from dataclasses import dataclass, replace
from math import degrees, pi, radians, sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.analysis.small_signals import small_signals
from pyspice_runner.errors import ParameterError
from pyspice_runner.model.drive import MatchState, TwoPhaseDrive, two_phases
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.contact import ContactLaw
from pyspice_runner.netlist.drivers import Driver
from pyspice_runner.netlist.source import GROUPS
from pyspice_runner.run.operating_point import MOST_POINTS, OperatingPoint
from pyspice_runner.run.window import Window
from pyspice_runner.spectra.admittance import admittance

WINDING_QUALITY = 100.0  # of a proposed inductor: assumed, that of a ferrite core at some ten kHz
FILTER_QUALITY = 2.0  # of a proposed LLCC filter: reactance of its series pair over the motor's resistance
BESIDE = 1e-3  # of the driver's frequency, to either side of which the hot admittance is taken
_SMALLEST_VOLTAGE = 0.1  # V, the least that a driver takes


@dataclass(frozen=True)
class MatchedGroup:
    """Network that cancels the reactance of one group at the fundamental, and its source voltage."""

    resistance_ohm: float  # real part of the group's impedance at its pin
    reactance_ohm: float  # imaginary part
    power_factor: float  # of the fundamental, without matching
    inductance_h: float  # series inductance; 0 for an inductive group
    capacitance_f: float  # series capacitance of an inductive group; otherwise 0
    winding_ohm: float  # resistance of the inductor, at a quality factor of 100
    parallel_inductance_h: float  # inductance across the pin, of an LLCC filter
    parallel_capacitance_f: float  # capacitance across the pin, of an LLCC filter
    source_voltage_v: float  # amplitude in front of the network that keeps the voltage at the pin
    source_phase_deg: float  # its phase against the pin of group A


@dataclass(frozen=True)
class Matching:
    """Matching for one state: free, preloaded (sticking, small signal), running (as simulated), hot (incremental)."""

    state: MatchState
    frequency_hz: float
    a: MatchedGroup
    b: MatchedGroup

    def group(self, name: str) -> MatchedGroup:
        """Return the proposal for group ``"a"`` or ``"b"``."""
        return self.a if name == "a" else self.b

    def applied(self, driver: Driver) -> Driver:
        """Return the driver with this matching: by its LLCC filter if it has one, else by a series inductor.

        The source voltage keeps the voltages of the groups. The leakage of a transformer counts as part of the
        inductor. Behind a bridge the reactance of the inductor is at least the group's impedance, to block the
        switching edges; a series capacitor compensates the excess.
        """
        if driver.network == "llcc":
            return driver.updated(self._filter(driver))
        omega = 2.0 * pi * self.frequency_hz
        changes: dict[str, Any] = {"network": "inductor"}
        for group in GROUPS:
            match = self.group(group)
            inductance, capacitance, winding = match.inductance_h, match.capacitance_f or 1.0, match.winding_ohm
            least = abs(complex(match.resistance_ohm, match.reactance_ohm))
            if driver.switched and omega * inductance < least:
                # too small to block the edges: a larger inductance, and a capacitor that compensates the excess
                inductance = least / omega
                capacitance = 1.0 / (omega * (least + match.reactance_ohm))
                winding = least / WINDING_QUALITY
            changes[f"inductor_{group}.inductance"] = max(inductance - _leakage(driver, group), 1e-6)
            changes[f"inductor_{group}.resistance"] = max(winding, 1e-3)
            changes[f"inductor_{group}.capacitance"] = capacitance
        changes["voltage"] = self.a.source_voltage_v
        changes["ratio_b"] = self.b.source_voltage_v / self.a.source_voltage_v
        ahead = radians(self.b.source_phase_deg - self.a.source_phase_deg)
        changes["phase_deg"] = degrees(phase(rect(1.0, ahead)))  # between −180° and 180°
        return driver.updated(changes)

    def _filter(self, driver: Driver) -> dict[str, float]:
        """Return the values of an LLCC filter: parallel pair cancels the susceptance, series pair is in resonance."""
        omega = 2.0 * pi * self.frequency_hz
        changes = {}
        for group in GROUPS:
            match = self.group(group)
            squared = match.resistance_ohm**2 + match.reactance_ohm**2
            reactance = FILTER_QUALITY * squared / max(abs(match.resistance_ohm), 0.1 * sqrt(squared))
            total = reactance / omega
            changes[f"llcc_{group}.series_inductance"] = max(total - _leakage(driver, group), 1e-5)
            changes[f"llcc_{group}.series_capacitance"] = 1.0 / (omega * reactance)
            changes[f"llcc_{group}.series_resistance"] = reactance / WINDING_QUALITY
            changes[f"llcc_{group}.parallel_inductance"] = match.parallel_inductance_h
            changes[f"llcc_{group}.parallel_capacitance"] = match.parallel_capacitance_f
            changes[f"llcc_{group}.parallel_resistance"] = omega * match.parallel_inductance_h / WINDING_QUALITY
        return changes


@checked
def propose_matching(
    motor: Motor,
    driver: Driver,
    *,
    state: MatchState = "running",
    contact: ContactLaw | None = "spring-slider",
    duration: float = 3e-3,
    speed: float | None = None,
    load_torque: float = 0.0,
    timeout: float | None = None,
) -> Matching:
    """Propose a matching network between a driver and each group, so that the driver sees a resistance.

    It holds at the driver's voltages, phase and frequency. ``"free"`` and ``"preloaded"`` use the small-signal two-port
    of the stator; ``"running"`` the currents of a transient with ideal sources; ``"hot"`` the two-port for a small
    additional voltage in the steady state (:func:`small_signals`).

    Args:
        motor: the motor.
        driver: frequency, voltages and phase of the groups.
        state: ``"free"``, ``"preloaded"``, ``"running"`` or ``"hot"``.
        contact: law of the contact, for ``"running"``; ``None`` for a free tip.
        duration: simulated time in s, for ``"running"``.
        speed: if given, the shaft is held at this speed, rad/s.
        load_torque: torque in N·m that a load draws from the free shaft.
        timeout: wall time in s after which a run is ended.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    setup = OperatingPoint.of(motor, driver, speed=speed, load_torque=load_torque, contact=contact, timeout=timeout)
    check_duration(setup, duration)
    return proposal(setup, driver, duration, state)


def check_duration(setup: OperatingPoint, duration: float) -> None:
    """Raise a ParameterError unless a run lasts ten periods of its driver, and its points fit in memory."""
    least, most = 10.0 * setup.source.period, MOST_POINTS * setup.step
    if not least <= duration <= most:
        raise ParameterError(
            f"duration = {duration:g} s is not valid: it must be from {least:.3g} s, ten periods of the driver, to "
            f"{most:.3g} s, so that the points fit in memory."
        )


def proposal(setup: OperatingPoint, driver: Driver, duration: float, state: MatchState) -> Matching:
    """Propose the matching of both groups; for ``"running"`` from the currents of a run with ideal sources."""
    voltages = driver.phasors()
    if state == "running":
        ideal = Driver(kind="ideal", **two_phases(driver))
        run = replace(setup, source=ideal, solver=replace(setup.solver, step=None))
        samples = run.run(duration, [f"{kind}{group})" for kind in ("v(", "i(vpin_") for group in GROUPS]).vectors()
        window = Window(samples["time"], driver.period)
        currents = {group: complex(window.harmonics(samples[f"i(vpin_{group})"])[0]) for group in GROUPS}
        voltages = {group: complex(window.harmonics(samples[f"v({group})"])[0]) for group in GROUPS}
    else:
        amperes = _two_port(setup, driver, state) @ np.array([voltages["a"], voltages["b"]])
        currents = dict(zip(GROUPS, amperes.tolist(), strict=True))
    return Matching(
        state,
        driver.frequency,
        *(_matched(voltages[group], currents[group], voltages["a"], driver.frequency) for group in GROUPS),
    )


def _two_port(
    setup: OperatingPoint, driver: Driver, state: Literal["free", "preloaded", "hot"]
) -> NDArray[np.complex128]:
    """Return the small-signal admittance matrix of the groups at the driver's frequency."""
    frequency = driver.frequency
    if state != "hot":
        spectrum = admittance(
            setup.motor, start=frequency * (1 - 1e-6), stop=frequency * (1 + 1e-6), points=3, state=state,
            timeout=setup.solver.timeout,
        )  # fmt: skip
        return np.asarray(spectrum.matrix_s[1])
    if setup.law is None:
        raise ParameterError("A free tip has no hot admittance: its two-port does not change. Take state = 'free'.")
    signals = small_signals(
        setup.motor, TwoPhaseDrive(**two_phases(driver)), frequencies=[BESIDE * frequency], speed=setup.load.speed,
        load_torque=setup.load.torque, contact=setup.law, timeout=setup.solver.timeout,
    )  # fmt: skip
    return np.asarray(signals.hot_admittance_s.mean(axis=0))


def _matched(voltage: complex, current: complex, reference: complex, frequency: float) -> MatchedGroup:
    """Match one group by its voltage and current phasors."""
    omega = 2.0 * pi * frequency
    impedance = voltage / current
    capacitive = impedance.imag < 0.0
    inductance = -impedance.imag / omega if capacitive else 0.0
    capacitance = 0.0 if capacitive or not impedance.imag else 1.0 / (omega * impedance.imag)
    winding = omega * inductance / WINDING_QUALITY
    source = current * (impedance.real + winding)
    # a filter's parallel pair; a group whose current lags has its susceptance made capacitive first
    susceptance = (1.0 / impedance).imag
    added = max(10e-12, (0.5 / abs(impedance) - susceptance) / omega)
    return MatchedGroup(
        resistance_ohm=impedance.real,
        reactance_ohm=impedance.imag,
        power_factor=impedance.real / abs(impedance),
        inductance_h=inductance,
        capacitance_f=capacitance,
        winding_ohm=winding,
        parallel_inductance_h=1.0 / (omega * (susceptance + omega * added)),
        parallel_capacitance_f=added,
        source_voltage_v=max(abs(source), _SMALLEST_VOLTAGE),
        source_phase_deg=degrees(phase(source / reference)),
    )


def _leakage(driver: Driver, group: str) -> float:
    """Return the leakage inductance in H of a transformer, in series with the network."""
    for part in driver.parts(group):
        if part.label == "transformer":
            values = part.values
            return values["magnetizing"] * values["ratio"] ** 2 * (1.0 - values["coupling"] ** 2)
    return 0.0
