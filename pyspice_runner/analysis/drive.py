# SPDX-License-Identifier: GPL-3.0-or-later
"""What a driver and its motor do to each other: currents, powers, harmonics, losses, efficiency, matching.

Supply = losses in the driver + input of the motor; every report says how well that holds.
"""

from __future__ import annotations

import hashlib
from cmath import phase
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from math import degrees
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.analysis.audit import audit_contact, audit_power, mark, withhold
from pyspice_runner.analysis.driver_run import DriverBench, Window, power_at, voltage_at
from pyspice_runner.analysis.matching import Matching, State, proposal
from pyspice_runner.analysis.waveforms import Array
from pyspice_runner.engine.ngspice import ngspice_version
from pyspice_runner.errors import ParameterError
from pyspice_runner.files import save_by_ending, write_csv, write_json
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.contact import ContactLaw
from pyspice_runner.netlist.drivers import GROUPS, Driver


@dataclass(frozen=True)
class Harmonic:
    """One harmonic: amplitudes and phases of voltage and current, sin(2πk f t + phase)."""

    order: int
    frequency_hz: float
    voltage_v: float
    voltage_phase_deg: float
    current_a: float
    current_phase_deg: float


@dataclass(frozen=True)
class Port:
    """What passes through one place: the output of a power stage, or the pins of a group.

    Attributes:
        voltage_peak_v: greatest absolute value.
        voltage_rms_v: RMS value.
        current_peak_a: greatest absolute value.
        current_rms_a: RMS value.
        real_power_w: mean of voltage times current.
        reactive_power_var: of the fundamental; positive where the current lags.
        apparent_power_va: RMS voltage times RMS current.
        power_factor: real over apparent power.
        displacement_factor: cosine of the angle between the fundamentals.
        voltage_thd: RMS of the harmonics from the second on, over the fundamental.
        current_thd: the same of the current.
        slew_rate_v_per_s: greatest rate of the voltage.
        resistance_ohm: real part of the fundamentals' quotient.
        reactance_ohm: its imaginary part.
        harmonics: fundamental and harmonics.
    """

    voltage_peak_v: float
    voltage_rms_v: float
    current_peak_a: float
    current_rms_a: float
    real_power_w: float
    reactive_power_var: float
    apparent_power_va: float
    power_factor: float
    displacement_factor: float
    voltage_thd: float
    current_thd: float
    slew_rate_v_per_s: float
    resistance_ohm: float
    reactance_ohm: float
    harmonics: tuple[Harmonic, ...] = field(repr=False)


@dataclass(frozen=True)
class DriveReport:
    """One driver and its motor, measured over the last whole periods of a run.

    Attributes:
        motor: name of the motor.
        driver: the driver and every parameter of its parts, JSON-ready.
        run: settings of the run, JSON-ready.
        outputs: group → what leaves its power stage, before transformer and network.
        groups: group → what enters the group at its pin.
        supply_power_w: mean power of all supplies but the gate drivers'; for ideal sources that of the sources.
        gate_power_w: mean power of the gate drivers.
        supply_current_mean_a: rail → mean current asked of it, both groups together.
        supply_current_peak_a: rail → greatest current asked of it.
        losses_w: ``PART_GROUP.DEVICE`` → mean loss.
        stored_power_w: rate at which energy builds up in the driver's inductors and capacitors; 0 once settled.
        motor_power_w: mean power into both groups.
        shaft_power_w: mean power of the contact on the rotor.
        mean_torque_n_m: mean torque of the contact on the rotor.
        mean_rotor_speed_rad_s: mean speed.
        settling: relative change of the motor's power from the first to the second half of the window.
        matching: proposals, by state.
        waveforms: time and the voltages and currents of outputs and groups over the window.
        solver_seconds: wall time that ngspice took.
        ngspice_version: version of ngspice.
        deck: the netlist that was run.
        findings: what the audit found amiss (:mod:`.audit`); nothing, unless it was overridden.
    """

    motor: str
    driver: dict[str, Any]
    run: dict[str, Any]
    outputs: dict[str, Port]
    groups: dict[str, Port]
    supply_power_w: float
    gate_power_w: float
    supply_current_mean_a: dict[str, float]
    supply_current_peak_a: dict[str, float]
    losses_w: dict[str, float]
    stored_power_w: float
    motor_power_w: float
    shaft_power_w: float
    mean_torque_n_m: float
    mean_rotor_speed_rad_s: float
    settling: float
    matching: dict[str, Matching]
    waveforms: dict[str, Array] = field(repr=False)
    solver_seconds: float
    ngspice_version: str
    deck: str = field(repr=False)
    findings: tuple[str, ...] = ()

    @property
    def power_in_w(self) -> float:
        """Power of supplies and gate drivers."""
        return self.supply_power_w + self.gate_power_w

    @property
    def balance_residual(self) -> float:
        """Power put in that is neither lost or stored in the driver nor put into the motor, over the power put in."""
        found = sum(self.losses_w.values()) + self.stored_power_w + self.motor_power_w
        return (self.power_in_w - found) / self.power_in_w

    @property
    def driver_efficiency(self) -> float:
        """Power into the motor over the power put in."""
        return self.motor_power_w / self.power_in_w

    @property
    def efficiency(self) -> float:
        """Power on the shaft over the power put in; negative where the shaft is driven."""
        return self.shaft_power_w / self.power_in_w

    @property
    def power_factor(self) -> float:
        """Real over apparent power of both stages together, at their outputs."""
        return _quotient(
            sum(port.real_power_w for port in self.outputs.values()),
            sum(port.apparent_power_va for port in self.outputs.values()),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the report, JSON-ready."""
        return {
            "motor": self.motor,
            "driver": self.driver,
            "run": self.run,
            "groups": {name: asdict(port) for name, port in self.groups.items()},
            "outputs": {name: asdict(port) for name, port in self.outputs.items()},
            "power_factor": self.power_factor,
            "supply_power_w": self.supply_power_w,
            "gate_power_w": self.gate_power_w,
            "supply_current_mean_a": self.supply_current_mean_a,
            "supply_current_peak_a": self.supply_current_peak_a,
            "losses_w": self.losses_w,
            "stored_power_w": self.stored_power_w,
            "motor_power_w": self.motor_power_w,
            "shaft_power_w": self.shaft_power_w,
            "mean_torque_n_m": self.mean_torque_n_m,
            "mean_rotor_speed_rad_s": self.mean_rotor_speed_rad_s,
            "driver_efficiency": self.driver_efficiency,
            "efficiency": self.efficiency,
            "balance_residual": self.balance_residual,
            "settling": self.settling,
            "matching": {state: asdict(proposal) for state, proposal in self.matching.items()},
            "points": len(self.waveforms["time_s"]),
            "solver_seconds": self.solver_seconds,
            "ngspice_version": self.ngspice_version,
            "audit": mark(self.findings),
        }

    def save(self, path: str | Path) -> Path:
        """Write the report by the file's ending: ``.json`` (report), ``.csv`` (waveforms), ``.cir`` (deck).

        Raises:
            ParameterError: for another ending or a place that cannot be written.
        """
        return save_by_ending(
            path,
            {
                ".json": lambda file: write_json(file, self.to_dict()),
                ".csv": lambda file: write_csv(file, self.waveforms),
                ".cir": lambda file: file.write_text(self.deck, encoding="utf-8"),
            },
        )

    def plot(self, path: str | Path) -> Path:
        """Draw voltages, currents, their spectra and where the power goes."""
        from pyspice_runner.plots import plot_drive

        return plot_drive([self], path)


@checked
def drive_report(
    motor: Motor,
    driver: Driver,
    *,
    duration: float = 3e-3,
    contact: ContactLaw | None = "spring-slider",
    speed: float | None = None,
    load_torque: float = 0.0,
    match: State | None = None,
    proposals: bool = True,
    step: float | None = None,
    timeout: float | None = None,
    audit: bool = True,
) -> DriveReport:
    """Run a driver and its motor from power-up and report on both.

    Args:
        motor: the motor, at rest under its preload.
        driver: the driver; its ``voltage`` is that of its stage, or with ``match`` that of the groups.
        duration: simulated time in s.
        contact: law of the contact; ``None`` for a free tip.
        speed: if given, the shaft is held at this speed, rad/s.
        load_torque: torque in N·m that a load draws from the free shaft.
        match: state of the motor for which the driver is matched first, by a series inductor, or by its LLCC filter.
        proposals: whether to propose a matching for every state; it takes one more run.
        step: uniform time step in s, or with a bridge the largest; by default from the fastest motion.
        timeout: wall time in s after which a run is ended.
        audit: whether a report that fails the physical audit is an error. If not, ``findings`` has what was found.

    Raises:
        ParameterError: for a value that is refused.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    if match is not None and match not in get_args(State):
        raise ParameterError(f"match = {match!r} is refused; allowed are {', '.join(get_args(State))} and None.")
    bench = DriverBench(motor, driver, contact, speed, load_torque, duration, timeout)
    states: Sequence[State] = get_args(State) if proposals else [match] if match else []
    matching: dict[str, Matching] = {state: proposal(bench, state) for state in states}
    if match is not None:
        driver = matching[match].applied(driver)
        bench = DriverBench(motor, driver, contact, speed, load_torque, duration, timeout)
    samples, seconds, deck, largest = bench.run(step)
    window = Window(samples["time"], driver.period, uniform=not driver.switched)
    outputs = {group: _port(window, samples, driver, f"out_{group}", group) for group in GROUPS}
    groups = {group: _port(window, samples, driver, f"pin_{group}", group) for group in GROUPS}
    supplies = _supplies(samples)
    losses: dict[str, float] = {}
    gates = stored = 0.0
    for group in GROUPS:
        for part in driver.parts(group):
            for name, _ in part.library.losses:
                losses[f"{part.label}_{group}.{name}"] = window.mean(samples[f"v(x{part.instance}.loss_{name})"])
            for name, _ in part.library.feeds:
                gates += window.mean(samples[f"v(x{part.instance}.feed_{name})"])
            for name, _ in part.library.stores:
                energy = window.cut(samples[f"v(x{part.instance}.store_{name})"])
                stored += 1e-6 * float(energy[-1] - energy[0]) / window.length
    supply_power = sum(window.mean(volts * amperes) for volts, amperes, _ in supplies)
    if driver.kind == "ideal":
        supply_power = sum(port.real_power_w for port in outputs.values())
    currents = {
        rail: sum((amperes for _, amperes, name in supplies if name == rail), np.zeros_like(samples["time"]))
        for rail in dict.fromkeys(name for _, _, name in supplies)
    }
    pin_a, pin_b = (power_at(samples, driver, f"pin_{group}", group) for group in GROUPS)
    torque = motor.rotor.radius_m * samples.get("v(xmotor.friction)", np.zeros_like(samples["time"]))
    report = DriveReport(
        motor=motor.name,
        driver=driver.to_dict(),
        run={
            "duration_s": duration,
            "contact": contact,
            "speed_rad_s": speed,
            "load_torque_n_m": load_torque,
            "match": match,
            "step_s": largest,
            "uniform_steps": not driver.switched,
            "averaged_periods": window.periods,
            "deck_sha256": hashlib.sha256(deck.encode()).hexdigest(),
        },
        outputs=outputs,
        groups=groups,
        supply_power_w=supply_power,
        gate_power_w=gates,
        supply_current_mean_a={rail: window.mean(values) for rail, values in currents.items()},
        supply_current_peak_a={rail: float(np.abs(window.cut(values)).max()) for rail, values in currents.items()},
        losses_w=losses,
        stored_power_w=stored,
        motor_power_w=sum(port.real_power_w for port in groups.values()),
        shaft_power_w=window.mean(torque * samples["v(shaft)"]),
        mean_torque_n_m=window.mean(torque),
        mean_rotor_speed_rad_s=window.mean(samples["v(shaft)"]),
        settling=window.settling(pin_a + pin_b),
        matching=matching,
        waveforms=_waveforms(window, samples, driver),
        solver_seconds=seconds,
        ngspice_version=ngspice_version(),
        deck=deck,
    )
    findings = _audited(motor, report, samples)
    if audit:
        withhold(findings, "report")
    return replace(report, findings=findings)


def _audited(motor: Motor, report: DriveReport, samples: dict[str, Array]) -> tuple[str, ...]:
    """Return what cannot be true about the powers and the contact."""
    reactive = sum(port.apparent_power_va for port in report.groups.values())
    found = sum(report.losses_w.values()) + report.stored_power_w + report.motor_power_w
    findings = audit_power(report.power_in_w, found, reactive)
    if "v(xmotor.normal)" in samples:
        findings += audit_contact(motor.contact.friction, samples["v(xmotor.normal)"], samples["v(xmotor.friction)"])
    return findings


def _supplies(samples: dict[str, Array]) -> list[tuple[Array, Array, str]]:
    """Return voltage, delivered current and name of every rail of every group."""
    return [
        (samples[f"v({rail}_{group})"], -samples[f"i(v{rail}_{group})"], name)
        for group in GROUPS
        for rail, name in (("vp", "positive"), ("vn", "negative"))
        if f"i(v{rail}_{group})" in samples
    ]


def _port(window: Window, samples: dict[str, Array], driver: Driver, place: str, group: str) -> Port:
    voltage, current = voltage_at(samples, driver, place, group), samples[f"i(v{place})"]
    volts, amperes = window.harmonics(voltage), window.harmonics(current)
    rms_v, rms_a = window.rms(voltage), window.rms(current)
    power = window.mean(voltage * current)
    complex_power = 0.5 * volts[0] * amperes[0].conjugate()
    impedance = volts[0] / amperes[0] if abs(amperes[0]) else complex(0.0)
    return Port(
        voltage_peak_v=float(np.abs(window.cut(voltage)).max()),
        voltage_rms_v=rms_v,
        current_peak_a=float(np.abs(window.cut(current)).max()),
        current_rms_a=rms_a,
        real_power_w=power,
        reactive_power_var=float(complex_power.imag),
        apparent_power_va=rms_v * rms_a,
        power_factor=_quotient(power, rms_v * rms_a),
        displacement_factor=_quotient(float(complex_power.real), float(abs(complex_power))),
        voltage_thd=_distortion(volts),
        current_thd=_distortion(amperes),
        slew_rate_v_per_s=window.slew_rate(voltage),
        resistance_ohm=float(impedance.real),
        reactance_ohm=float(impedance.imag),
        harmonics=tuple(
            Harmonic(order, order / window.period, abs(u), degrees(phase(u)), abs(i), degrees(phase(i)))
            for order, (u, i) in enumerate(zip(volts.tolist(), amperes.tolist(), strict=True), start=1)
        ),
    )


def _distortion(phasors: NDArray[np.complex128]) -> float:
    return _quotient(float(np.linalg.norm(phasors[1:])), float(abs(phasors[0])))


def _quotient(above: float, below: float) -> float:
    return above / below if below else 0.0


def _waveforms(window: Window, samples: dict[str, Array], driver: Driver) -> dict[str, Array]:
    columns = {"time_s": window.time}
    for group in GROUPS:
        for place in ("out", "pin"):
            name = {"out": f"output_{group}", "pin": f"group_{group}"}[place]
            columns[f"{name}_v"] = window.cut(voltage_at(samples, driver, f"{place}_{group}", group))
            columns[f"{name}_a"] = window.cut(samples[f"i(v{place}_{group})"])
    return columns
