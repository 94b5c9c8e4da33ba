# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor and its drive electronics: currents, powers, harmonics, losses, efficiency, matching.

Supply = losses in the driver + input of the motor; every report states the residual of this balance.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import degrees, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.analysis.matching import Matching, check_duration, proposal
from pyspice_runner.model.drive import MatchState
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.contact import ContactLaw
from pyspice_runner.netlist.drivers import RAILS, Driver, Part
from pyspice_runner.netlist.source import GROUPS
from pyspice_runner.result import Audit, Result
from pyspice_runner.run.audit import DRIVER_BOUND, audit_contact, audit_power
from pyspice_runner.run.ceramic import ceramic, modal_vectors
from pyspice_runner.run.operating_point import OperatingPoint
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, SETTLED, SMALL_TORQUE, Array
from pyspice_runner.run.window import Window, change_to_come
from pyspice_runner.units import engineering

_PROPOSED: tuple[MatchState, ...] = ("free", "preloaded", "running")  # a report's proposals
_MEANS = {
    "motor_power_w": "power of the motor", "mean_torque_n_m": "mean torque",
    "mean_rotor_speed_rad_s": "mean rotor speed",
}  # fmt: skip


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
    """Voltage, current and power at one place: the output of a power stage, or the pins of a group."""

    voltage_peak_v: float  # greatest absolute value
    voltage_rms_v: float  # RMS value
    current_peak_a: float  # greatest absolute value
    current_rms_a: float  # RMS value
    real_power_w: float  # mean of voltage times current
    reactive_power_var: float  # of the fundamental; positive where the current lags
    apparent_power_va: float  # RMS voltage times RMS current
    power_factor: float  # real over apparent power
    displacement_factor: float  # cosine of the angle between the fundamentals
    voltage_thd: float  # RMS of the harmonics from the second on, over the fundamental
    current_thd: float  # the same of the current
    slew_rate_v_per_s: float  # greatest rate of the voltage
    resistance_ohm: float  # real part of the impedance at the fundamental
    reactance_ohm: float  # imaginary part of that impedance
    harmonics: tuple[Harmonic, ...] = field(repr=False)  # fundamental and harmonics


@dataclass(frozen=True, repr=False)
class DriveReport(Result):
    """One driver and its motor, measured over the last whole periods of a run.

    Attributes:
        motor: the motor, JSON-ready.
        driver: the driver and every parameter of its parts, JSON-ready.
        run: settings of the run, JSON-ready.
        outputs: group → output of its power stage, in front of transformer and network.
        groups: group → input of the group at its pin.
        supply_power_w: mean power of all supplies but the gate drivers'. For a stage without supply pins, and for ideal
            sources: output power plus losses of the stage.
        gate_power_w: mean power of the gate drivers.
        supply_current_mean_a: rail → mean current, both groups together.
        supply_current_peak_a: rail → peak current, both groups together.
        losses_w: ``PART_GROUP.DEVICE`` → mean loss. ``driver_GROUP.total`` is the difference of supply and output power
            of the user's own stage, if its header has no ``LOSS`` lines.
        stored_power_w: rate at which energy builds up in the driver's inductors and capacitors; 0 once settled.
        motor_power_w: mean power into both groups.
        shaft_power_w: mean power of the contact on the rotor.
        mean_torque_n_m: mean torque of the contact on the rotor.
        mean_rotor_speed_rad_s: mean speed.
        to_come: expected further relative change of each mean in a longer run; ``None`` where the run is too short.
        settling: relative change of the motor's power from the first to the second half of the window.
        matching: proposals, by state.
        waveforms: time and the voltages and currents of outputs and groups over the window.
        solver_seconds: wall time that ngspice took.
        ngspice_version: version of ngspice.
        deck: netlist of the run.
        audit: outcome of the physical audit; it has findings only with ``audit=False``.
        ceramic: strain, stress and temperature rise of the ceramic, and ``cautions``; empty where not measured.
    """

    motor: dict[str, Any]
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
    to_come: dict[str, float | None]
    matching: dict[str, Matching]
    waveforms: dict[str, Array] = field(repr=False)
    solver_seconds: float
    ngspice_version: str
    deck: str = field(repr=False)
    audit: Audit = field(default_factory=Audit)
    ceramic: dict[str, Any] = field(default_factory=dict)

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self.motor

    @property
    def power_in_w(self) -> float:
        """Power of supplies and gate drivers."""
        return self.supply_power_w + self.gate_power_w

    @property
    def balance_residual(self) -> float:
        """Input power minus losses, stored power and motor power, over the input power."""
        return (self.power_in_w - self.power_found_w) / self.power_in_w

    @property
    def power_found_w(self) -> float:
        """Losses and stored power of the driver, and power into the motor."""
        return sum(self.losses_w.values()) + self.stored_power_w + self.motor_power_w

    @property
    def driver_efficiency(self) -> float:
        """Power into the motor over the input power."""
        return self.motor_power_w / self.power_in_w

    @property
    def efficiency(self) -> float:
        """Shaft power over the input power; negative where the shaft is driven."""
        return self.shaft_power_w / self.power_in_w

    @property
    def power_factor(self) -> float:
        """Real over apparent power of both stages together, at their outputs."""
        return _quotient(
            sum(port.real_power_w for port in self.outputs.values()),
            sum(port.apparent_power_va for port in self.outputs.values()),
        )

    @property
    def settled(self) -> bool:
        """Whether power, torque and speed would stay within 2 % in a longer run."""
        return all(share is not None and share <= SETTLED for share in self.to_come.values())

    @property
    def cautions(self) -> tuple[str, ...]:
        """Findings of the audit, means that have not settled, and powers that are not valid."""
        moving = [_MEANS[name] for name, share in self.to_come.items() if share is None or share > SETTLED]
        told = [f"Not settled at the end of the run: {', '.join(moving)}. Run it longer."] if moving else []
        if not self.driver["supplied"] and self.driver["kind"] != "ideal":
            told.append("The driver has no supply pins: powers and efficiencies count from its output.")
        for group in GROUPS:
            gain = -self.losses_w.get(f"driver_{group}.total", 0.0)
            if gain > DRIVER_BOUND * abs(self.power_in_w):
                told.append(
                    f"The driver of group {group.upper()} puts out {gain:.3g} W more than its supplies give. It has "
                    "sources of its own, and its efficiency is not valid."
                )
        return self._told((*self.audit.findings, *told, *self.ceramic.get("cautions", ())))

    def to_dict(self) -> dict[str, Any]:
        """Return the report, JSON-ready."""
        names = (
            "motor", "driver", "run", "groups", "outputs", "power_factor", "supply_power_w", "gate_power_w",
            "supply_current_mean_a", "supply_current_peak_a", "losses_w", "stored_power_w", "motor_power_w",
            "shaft_power_w", "mean_torque_n_m", "mean_rotor_speed_rad_s", "driver_efficiency", "efficiency",
            "balance_residual", "settling", "settled", "to_come", "matching",
        )  # fmt: skip
        return self._keyed({
            **self._entries(*names),
            "points": len(self.waveforms["time_s"]),
            **self._entries("solver_seconds", "ngspice_version", "audit"),
            **self.ceramic,
            "cautions": list(self.cautions),
        })  # fmt: skip

    def columns(self) -> dict[str, Array]:
        """Return voltages and currents at the outputs of the stages and at the pins, over the time."""
        return self.waveforms

    def summary(self) -> dict[str, str]:
        """Return driver, powers, losses, efficiency, speed, torque and the proposals of series matching."""
        found = {
            "motor": str(self.motor["name"]),
            "driver": str(self.driver["label"]),
            "power put in": engineering(self.power_in_w, "W"),
            "power into the motor": f"{engineering(self.motor_power_w, 'W')}, {100.0 * self.driver_efficiency:.1f} %",
            "power factor": f"{self.power_factor:.3f}",
            "shaft power": engineering(self.shaft_power_w, "W"),
            "mean rotor speed": engineering(self.mean_rotor_speed_rad_s, "rad/s"),
            "mean torque": engineering(self.mean_torque_n_m, "N·m"),
            "settling": f"{100.0 * self.settling:.2g} % change of the power over the window",
            "losses": ", ".join(f"{name} {engineering(power, 'W')}" for name, power in self.losses_w.items()),
        }
        for group, port in self.groups.items():
            found[f"group {group}"] = (
                f"{engineering(port.voltage_rms_v, 'V')}, {engineering(port.current_rms_a, 'A')} RMS, distortion "
                f"{100.0 * port.voltage_thd:.3g} % and {100.0 * port.current_thd:.3g} %"
            )
        for state, matching in self.matching.items():
            for group in GROUPS:
                match = matching.group(group)
                element = engineering(match.inductance_h or match.capacitance_f, "H" if match.inductance_h else "F")
                found[f"series match of {group}, {state}"] = (
                    f"{element}; power factor {match.power_factor:.3f} without; source "
                    f"{match.source_voltage_v:.4g} V at {match.source_phase_deg:.4g}°"
                )
        return self._worded(found)


@checked
def drive_report(
    motor: Motor,
    driver: Driver,
    duration: float = 3e-3,
    *,
    contact: ContactLaw | None = "spring-slider",
    speed: float | None = None,
    load_torque: float = 0.0,
    match: MatchState | None = None,
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
        match: state of the motor for which to match the driver first, by a series inductor or by its LLCC filter.
        proposals: whether to propose a matching for every state, which takes one more run.
        step: uniform time step in s, or with a bridge the largest; by default from the fastest motion.
        timeout: wall time in s after which a run is ended.
        audit: whether findings of the physical audit are an error; if not, ``audit`` of the report has them.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    setup = OperatingPoint.of(
        motor, driver, speed=speed, load_torque=load_torque, contact=contact, step=step, timeout=timeout, audit=audit
    )
    check_duration(setup, duration)
    states: Sequence[MatchState] = _PROPOSED if proposals else [match] if match else []
    matching: dict[str, Matching] = {state: proposal(setup, driver, duration, state) for state in states}
    if match is not None:
        driver = matching[match].applied(driver)
        setup = replace(setup, source=driver)
    vectors = [*_saved(driver, contact=setup.law is not None), *modal_vectors(motor)]
    outcome = setup.run(duration, list(dict.fromkeys(vectors)))
    samples = outcome.vectors()
    window = Window(samples["time"], driver.period, uniform=driver.uniform)
    measured = _Measurement(window, samples, driver)
    ports = {place: {group: measured.port(place, group) for group in GROUPS} for place in ("out", "pin")}
    budgets = [measured.budget(group, ports["out"][group].real_power_w) for group in GROUPS]
    power = measured.power("pin", "a") + measured.power("pin", "b")
    torque = motor.rotor.radius_m * samples.get("v(xmotor.friction)", np.zeros_like(samples["time"]))
    currents = measured.supply_currents()
    report = DriveReport(
        motor=motor.to_dict(),
        driver=driver.to_dict(),
        run={
            "duration_s": duration,
            **setup.to_dict(),
            "match": match,
            "uniform_steps": driver.uniform,
            "averaged_periods": window.periods,
            "deck_sha256": outcome.deck_sha256,
        },
        outputs=ports["out"],
        groups=ports["pin"],
        supply_power_w=sum(budget.put_in for budget in budgets),
        gate_power_w=sum(budget.feed for budget in budgets),
        supply_current_mean_a={rail: window.mean(values) for rail, values in currents.items()},
        supply_current_peak_a={rail: float(np.abs(window.cut(values)).max()) for rail, values in currents.items()},
        losses_w={name: loss for budget in budgets for name, loss in budget.losses.items()},
        stored_power_w=sum(budget.stored for budget in budgets),
        motor_power_w=sum(port.real_power_w for port in ports["pin"].values()),
        shaft_power_w=window.mean(torque * samples["v(shaft)"]),
        mean_torque_n_m=window.mean(torque),
        mean_rotor_speed_rad_s=window.mean(samples["v(shaft)"]),
        settling=window.settling(power),
        to_come=_to_come(setup, samples, {"motor_power_w": power, "mean_torque_n_m": torque}),
        matching=matching,
        waveforms=measured.waveforms(),
        solver_seconds=outcome.seconds,
        ngspice_version=outcome.ngspice_version,
        deck=outcome.deck,
        ceramic=ceramic(motor, setup.law, setup.discretisation, samples, driver, window),
    )
    reactive = sum(port.apparent_power_va for port in report.groups.values())
    findings = audit_power(report.power_in_w, report.power_found_w, reactive)
    if setup.law:
        findings += audit_contact(motor.contact.friction, samples["v(xmotor.normal)"], samples["v(xmotor.friction)"])
    audited = Audit(findings)
    if audit:
        audited.withhold("report")
    return replace(report, audit=audited)


def _to_come(setup: OperatingPoint, samples: dict[str, Array], signals: dict[str, Array]) -> dict[str, float | None]:
    """Return the expected further relative change of the means of signals and of a free rotor's speed."""
    motor, time = setup.motor, samples["time"]
    friction = motor.rotor.radius_m * motor.contact.friction * motor.contact.preload_n
    least = {"motor_power_w": 0.0, "mean_torque_n_m": SMALL_TORQUE * friction, "mean_rotor_speed_rad_s": ROUNDING_RAD_S}
    if setup.load.speed is None:
        signals = {**signals, "mean_rotor_speed_rad_s": samples["v(shaft)"]}
    window = Window(time, setup.source.period)
    found = {}
    for name, values in signals.items():
        change = change_to_come(time, values, setup.source.period, motor.decay_s)
        scale = abs(window.mean(values)) + least[name]
        found[name] = change / scale if isfinite(change) and scale > 0.0 else None
    return found


@dataclass(frozen=True)
class _Budget:
    """Mean powers in W of the channel of one group."""

    put_in: float  # power of its supplies
    losses: dict[str, float]  # ``PART_GROUP.DEVICE`` → loss
    feed: float  # power of the gate drivers
    stored: float  # rate of the stored energy


@dataclass(frozen=True)
class _Measurement:
    """Voltages, currents and powers of a driver over the window of a run.

    A place is ``"out"``, the output of a stage, or ``"pin"``, the pin of a group.
    """

    window: Window
    samples: dict[str, Array]
    driver: Driver

    def voltage(self, place: str, group: str) -> Array:
        """Return the voltage at a place."""
        if place == "pin":
            return self.samples[f"v({group})"]
        back = self.samples[f"v(return_{group})"] if self.driver.kind == "full-bridge" else 0.0
        return self.samples[f"v(line_{group})"] - back

    def current(self, place: str, group: str) -> Array:
        """Return the current at a place."""
        return self.samples[f"i(v{place}_{group})"]

    def power(self, place: str, group: str) -> Array:
        """Return the power that passes through a place."""
        return self.voltage(place, group) * self.current(place, group)

    def port(self, place: str, group: str) -> Port:
        """Return the means and harmonics at a place."""
        window, voltage, current = self.window, self.voltage(place, group), self.current(place, group)
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

    def budget(self, group: str, output_w: float) -> _Budget:
        """Return the powers of the channel of a group whose stage delivers a power.

        The header of the user's own stage may have no ``LOSS`` lines. Its loss is then the difference of supply and
        output power, which is negative if the stage has sources of its own.
        """
        parts = self.driver.parts(group)
        losses = {
            f"{part.label}_{group}.{name}": self._mean(part, "loss", name)
            for part in parts
            for name, _ in part.library.losses
        }
        feeds = [sum(self._mean(part, "feed", name) for name, _ in part.library.feeds) for part in parts]
        stored = [sum(self._growth(part, name) for name, _ in part.library.stores) for part in parts]
        inside = stored[0] - feeds[0] if self.driver.own else 0.0  # of the user's own stage, besides its losses
        if not self.driver.supplied:
            lost = sum(loss for name, loss in losses.items() if self.driver.own and name.startswith("driver_"))
            return _Budget(output_w + lost + inside, losses, sum(feeds), sum(stored))
        put_in = sum(
            self.window.mean(-self.samples[f"v({rail}_{group})"] * self.samples[f"i(v{rail}_{group})"])
            for rail in RAILS
            if f"i(v{rail}_{group})" in self.samples
        )
        if self.driver.own and not parts[0].library.losses:
            losses = {f"{parts[0].label}_{group}.total": put_in - inside - output_w} | losses
        return _Budget(put_in, losses, sum(feeds), sum(stored))

    def supply_currents(self) -> dict[str, Array]:
        """Return the currents that the rails deliver, both groups together."""
        found: dict[str, Array] = {}
        for group in GROUPS:
            for rail, name in zip(RAILS, ("positive", "negative"), strict=True):
                if f"i(v{rail}_{group})" in self.samples:
                    found[name] = found.get(name, 0.0) - self.samples[f"i(v{rail}_{group})"]
        return found

    def waveforms(self) -> dict[str, Array]:
        """Return voltages and currents of both groups over the window."""
        columns = {"time_s": self.window.time}
        for group in GROUPS:
            for place, name in (("out", f"output_{group}"), ("pin", f"group_{group}")):
                columns[f"{name}_v"] = self.window.cut(self.voltage(place, group))
                columns[f"{name}_a"] = self.window.cut(self.current(place, group))
        return columns

    def _mean(self, part: Part, kind: str, name: str) -> float:
        return self.window.mean(self.samples[part.power_vector(kind, name)])

    def _growth(self, part: Part, name: str) -> float:
        energy = self.window.cut(self.samples[part.power_vector("store", name)])
        return 1e-6 * float(energy[-1] - energy[0]) / self.window.length


def _distortion(phasors: NDArray[np.complex128]) -> float:
    return _quotient(float(np.linalg.norm(phasors[1:])), float(abs(phasors[0])))


def _quotient(above: float, below: float) -> float:
    return above / below if below else 0.0


def _saved(driver: Driver, *, contact: bool) -> list[str]:
    names = ["v(shaft)", *(["v(xmotor.friction)", "v(xmotor.normal)"] if contact else [])]
    for group in GROUPS:
        names += [f"v({group})", f"i(vpin_{group})", f"v(line_{group})", f"i(vout_{group})"]
        if driver.kind == "full-bridge":
            names.append(f"v(return_{group})")
        if driver.kind != "ideal":
            rails = [rail for rail, volts in zip(RAILS, driver.rails(group), strict=True) if volts]
            names += [item for rail in rails for item in (f"v({rail}_{group})", f"i(v{rail}_{group})")]
        for part in driver.parts(group):
            names += part.power_vectors
    return names
