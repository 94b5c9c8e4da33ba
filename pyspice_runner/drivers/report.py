# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor and its drive electronics: currents, powers, harmonics, losses, efficiency, matching.

Supply = losses in the driver + input of the motor; every report states the residual of this balance.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import groupby
from math import degrees, isfinite
from typing import Any, Unpack

import numpy as np

from pyspice_runner.circuit.motor import force_vectors
from pyspice_runner.drivers import design as linear
from pyspice_runner.drivers import loads
from pyspice_runner.drivers.design import OPERATING, TURNING, Design, DriverSpec, NoDriverError, design_driver
from pyspice_runner.drivers.driver import RAILS, Driver, Part
from pyspice_runner.drivers.feedback import Loop, stability, stability_notes
from pyspice_runner.drivers.loads import TurnOn
from pyspice_runner.drivers.ratings import PartLoad, transistor_ratings
from pyspice_runner.errors import require
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Load, two_phasors
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.strength import depolarised
from pyspice_runner.result import Audit, Result, contact_row, json_ready
from pyspice_runner.run.audit import DRIVER_BOUND, audit_contact, audit_power, ceramic, modal_vectors
from pyspice_runner.run.kernel import progress_callback
from pyspice_runner.run.point import MOST_POINTS, Point, Settings
from pyspice_runner.run.recording import Recording
from pyspice_runner.run.simulate import JUDGED, CoarserRuns
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, SMALL_TORQUE, Array, has_settled, remark
from pyspice_runner.run.window import AVERAGED_PERIODS, Window, change_to_come
from pyspice_runner.steady.driven import running
from pyspice_runner.units import engineering, unit_in

_OF_SHAFT = ("shaft_power_w", "mean_torque_n_m", "mean_torque_error_n_m", "mean_rotor_speed_rad_s", "efficiency")
_DURATION = 3e-3  # s, of a run by default
_ABSENT = 1e-9  # of the power put in: losses of resistances that stand for parts that are not there
_SHORTEST = 1e-3  # s, of the run of a design: power-up, and the start of its motor
_SETTLING = 20  # periods in which the network settles before those at the operating point that are averaged
_LONGEST_BEAT = 80  # most of those, which are a beat; each takes 50 ms of CPU
_REACHED = 80  # periods of the run of a transducer from near its steady state; the last 20 are averaged
_CORRECTIONS = 4  # of the sources from which it starts, at most
_STEADY = 2e-3  # of the sources, by which they change: a fifth of a percent of the motional current
_START_PERIODS = 250, 2000  # of all channels, at most, of a transducer's start: 4 s of CPU; not of a bridge the second
SQUARE_THD = float(np.sqrt(np.pi**2 / 8.0 - 1.0))  # of a square wave: RMS of its harmonics relative to its fundamental
_LONGEST = 6e-3  # s, of the run of a design by default; a rotor that takes longer is followed on by steady states


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

    voltage_peak_v: float  # largest absolute value
    voltage_rms_v: float  # RMS value
    current_peak_a: float  # largest absolute value
    current_rms_a: float  # RMS value
    real_power_w: float  # mean of voltage times current
    reactive_power_var: float  # of the fundamental; positive where the current lags
    apparent_power_va: float  # RMS voltage times RMS current
    power_factor: float  # real over apparent power
    displacement_factor: float  # cosine of the angle between the fundamentals
    voltage_thd: float  # RMS of the harmonics from the second on, over the fundamental
    current_thd: float  # the same of the current
    slew_rate_v_per_s: float  # largest rate of the voltage
    resistance_ohm: float  # real part of the impedance at the fundamental
    reactance_ohm: float  # imaginary part of that impedance
    harmonics: tuple[Harmonic, ...] = field(repr=False)  # fundamental and harmonics


@dataclass(frozen=True, repr=False)
class Balance:
    """Currents, powers, losses and speed over the last whole periods of a run.

    Attributes:
        outputs: group → output of its power stage, in front of transformer and network.
        groups: group → input of the group at its pin.
        supply_power_w: mean power of all supplies but the gate drivers'. For a stage without supply pins, and for ideal
            sources: output power plus losses of the stage.
        gate_power_w: mean power of the gate drivers.
        supply_current_mean_a, supply_current_peak_a: rail → mean and peak current, both groups together.
        losses_w: ``PART_GROUP.DEVICE`` → mean loss. ``driver_GROUP.total`` is the difference of supply and output power
            of the user's own stage, if its header has no ``LOSS`` lines.
        stored_power_w: rate at which energy builds up in the driver's inductors and capacitors; 0 once settled.
        motor_power_w, shaft_power_w: mean powers into both groups, and of the contact on the rotor.
        mean_torque_n_m, mean_rotor_speed_rad_s: mean torque of the contact on the rotor, and mean speed.
        settling: relative change of the motor's power from the first to the second half of the window.
        switching: turn-on of each transistor of a bridge.
        parts: parts with their peaks, RMS values, ripple and losses.
    """

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
    switching: tuple[TurnOn, ...]
    parts: tuple[PartLoad, ...]

    @property
    def power_in_w(self) -> float:
        """Power of supplies and gate drivers."""
        return self.supply_power_w + self.gate_power_w

    @property
    def balance_residual(self) -> float:
        """Input power minus losses, stored power and motor power, over the input power."""
        return _quotient(self.power_in_w - self.power_found_w, self.power_in_w)

    @property
    def power_found_w(self) -> float:
        """Losses and stored power of the driver, and power into the motor."""
        return sum(self.losses_w.values()) + self.stored_power_w + self.motor_power_w

    @property
    def driver_efficiency(self) -> float:
        """Power into the motor over the input power."""
        return _quotient(self.motor_power_w, self.power_in_w)

    @property
    def efficiency(self) -> float:
        """Shaft power over the input power; negative where the shaft is driven."""
        return _quotient(self.shaft_power_w, self.power_in_w)

    @property
    def power_factor(self) -> float:
        """Real over apparent power of both stages together, at their outputs."""
        return _quotient(
            sum(port.real_power_w for port in self.outputs.values()),
            sum(port.apparent_power_va for port in self.outputs.values()),
        )

    def to_dict(self) -> dict[str, Any]:
        """Return powers, losses and ports, JSON-ready."""
        names = ("power_in_w", "driver_efficiency", "efficiency", "power_factor", "balance_residual")
        return dict(json_ready(vars(self) | {name: getattr(self, name) for name in names}))


@dataclass(frozen=True, repr=False)
class DriveReport(Balance, Result):
    """One driver and its motor, measured over the last whole periods of a run from power-up.

    Attributes:
        operating: balance of a design at its operating point, where the shaft is held behind the real stage; ``None``
            without one.
        motor, driver, run: the motor, the driver with every parameter of its parts, settings of the run, JSON-ready.
        mean_torque_error_n_m: its estimated error by the step; ``None`` of a run with edges, or with a given step.
        to_come: expected further relative change of each mean in a longer run; ``None`` where the run is too short.
        maxima: maxima of pins, stages and parts over the whole run from power-up.
        delivered: group → ``wanted_v`` and ``got_v``, amplitudes of the fundamental at the ``place``: ``"pin"``, or
            ``"stage"`` in front of a network that was not designed; and ``limited``: limit of the stage → share of the
            window in which it is reached.
        stability: group → loop of its amplifier with feedback; empty for other stages.
        steps: group → time in s and output of that amplifier after a small step, over what the step is worth.
        design: the design of the driver, completed by the run; ``None`` for a driver that was given.
        waveforms: time and the voltages and currents of outputs and groups over the window.
        solver_seconds, ngspice_version, deck: wall time that ngspice took, its version, netlist of the run.
        audit: outcome of the physical audit; it has findings only with ``audit=False``.
        events: maxima of further runs as in ``maxima``, by event: load step, stop, frequency sweep; empty if not asked.
        event_faults: a sentence for each limit that an event exceeds.
        ceramic: strain, stress and temperature rise of the ceramic, and ``cautions``; empty where not measured.
    """

    motor: dict[str, Any]
    driver: dict[str, Any]
    run: dict[str, Any]
    to_come: dict[str, float | None]
    maxima: dict[str, Any]
    design: Design | None
    waveforms: dict[str, Array] = field(repr=False)
    solver_seconds: float
    ngspice_version: str
    deck: str = field(repr=False)
    audit: Audit = field(default_factory=Audit)
    delivered: dict[str, dict[str, Any]] = field(default_factory=dict)
    stability: dict[str, Loop] = field(default_factory=dict)
    steps: dict[str, tuple[Array, Array]] = field(default_factory=dict, repr=False)
    ceramic: dict[str, Any] = field(default_factory=dict)
    events: dict[str, dict[str, Any]] = field(default_factory=dict)
    event_faults: list[str] = field(default_factory=list)
    mean_torque_error_n_m: float | None = None
    operating: Balance | None = None

    @property
    def linear(self) -> bool:
        """Whether the motor has a slider."""
        return "slider" in self.motor

    @property
    def of_transducer(self) -> bool:
        """Whether the device is a transducer, which has no shaft."""
        return "contact" not in self.motor

    @property
    def bill(self) -> tuple[PartLoad, ...]:
        """Parts with their maxima, of the design if there is one, else of the run."""
        return self.design.parts if self.design else tuple(PartLoad(**load) for load in self.maxima["parts"])

    @property
    def settled(self) -> bool:
        """Whether power, torque and speed would stay within 2 % in a longer run."""
        return all(map(has_settled, self.to_come.values()))

    def _limits(self) -> Iterator[str]:
        """Yield powers that are not valid, overloads and limits of the ceramic."""
        if not self.driver["supplied"] and self.driver["kind"] != "ideal":
            yield "The driver has no supply pins: powers and efficiencies count from its output."
        for group in self.groups:
            gain = -self.losses_w.get(f"driver_{group}.total", 0.0)
            if gain > DRIVER_BOUND * abs(self.power_in_w):
                yield (
                    f"The driver of group {group.upper()} puts out {gain:.3g} W more than its supplies give. It has "
                    "sources of its own, and its efficiency is not valid."
                )
        if self.design and not self.design.feasible:
            yield f"Do not build this driver. {self.design.reason}"
        for group, port in (self.operating or self).groups.items() if self.driver["network"] != "none" else ():
            if port.voltage_thd > SQUARE_THD:
                worst = max(port.harmonics[1:], key=lambda harmonic: harmonic.voltage_v)
                yield (
                    f"The pin of group {group.upper()} has a THD of {100.0 * port.voltage_thd:.3g} %, more than a "
                    f"square wave ({100.0 * SQUARE_THD:.0f} %): the network amplifies harmonic {worst.order} at "
                    f"{engineering(worst.frequency_hz, 'Hz')}. Take the network llcc, or another inductance."
                )
        notes = self.design.averages if self.design else self.maxima["exceeded"]  # a design has these in its reason
        yield from (*notes, *self.event_faults, *self.ceramic.get("cautions", ()))

    def to_dict(self) -> dict[str, Any]:
        """Return the report, JSON-ready."""
        names = (
            "motor", "driver", "run", "groups", "outputs", "power_factor", "supply_power_w", "gate_power_w",
            "supply_current_mean_a", "supply_current_peak_a", "losses_w", "stored_power_w", "motor_power_w",
            "shaft_power_w", "mean_torque_n_m", "mean_torque_error_n_m", "mean_rotor_speed_rad_s", "driver_efficiency",
            "efficiency", "balance_residual", "settling", "settled", "to_come", "delivered", "stability", "maxima",
            "events", "switching", "design", "operating",
        )  # fmt: skip
        left = [name for name in names if not (self.of_transducer and name in _OF_SHAFT)]
        return self._localised({
            **self._entries(*left),
            "points": len(self.waveforms["time_s"]),
            **self._entries("solver_seconds", "ngspice_version", "audit"),
            **self.ceramic,
            "cautions": list(self.cautions),
        })  # fmt: skip

    def columns(self) -> dict[str, Array]:
        """Return voltages and currents at the outputs of the stages and at the pins, over the time."""
        return self.waveforms

    def summary(self) -> dict[str, str]:
        """Return driver, powers, losses, efficiency, speed, torque, the parts with their peaks, and the design."""
        error, best = self.mean_torque_error_n_m, self.operating or self
        to_come = {} if self.operating else self.to_come
        share = f"{100.0 * best.driver_efficiency:.1f} %"
        found = {
            (device := "transducer" if self.of_transducer else "motor"): str(self.motor["name"]),
            "driver": str(self.driver["label"]),
            **contact_row(self.run),
            **({"state": "operating point"} if self.operating else {}),
            "power put in": engineering(best.power_in_w, "W"),
            f"power into the {device}": f"{engineering(best.motor_power_w, 'W')}, {share}"
            + remark(to_come.get("motor_power_w", 0.0)),
            "power factor": f"{best.power_factor:.3f}",
            "shaft power": engineering(best.shaft_power_w, "W"),
            "mean rotor speed": engineering(best.mean_rotor_speed_rad_s, "rad/s")
            + remark(to_come.get("mean_rotor_speed_rad_s", 0.0)),
            "mean torque": engineering(best.mean_torque_n_m, "N·m")
            + ("" if error is None or self.operating else f" ± {engineering(error, 'N·m')} by the step")
            + remark(to_come.get("mean_torque_n_m", 0.0)),
            "settling": f"{100.0 * best.settling:.2g} % change of the power over the window",
        }
        for name in ("shaft power", "mean rotor speed", "mean torque") if self.of_transducer else ():
            del found[name]
        for part, losses in groupby(best.losses_w.items(), key=lambda loss: loss[0].partition(".")[0]):
            notes = (
                f"{name.partition('.')[2]} {engineering(power, 'W')}" for name, power in losses
                if abs(power) >= _ABSENT * abs(best.power_in_w)
            )  # fmt: skip
            found[f"losses of {part}"] = ", ".join(notes)
        for group, port in best.groups.items():
            found |= self._of_group(group, port)
        for edge in best.switching:
            how = "without voltage" if edge.zero_voltage else f"at {edge.voltage_left_v:.3g} V"
            found[f"turn-on of {edge.transistor}"] = how
        if self.operating:
            shaft = f", {engineering(self.mean_rotor_speed_rad_s, 'rad/s')}, {engineering(self.mean_torque_n_m, 'N·m')}"
            found["start-up"] = (
                f"{engineering(self.power_in_w, 'W')} put in, {engineering(self.motor_power_w, 'W')} into the {device}"
                f"{'' if self.of_transducer else shaft} at the end of the run of "
                f"{engineering(self.run['duration_s'], 's')}"
            )
        for load in self.bill:
            found[load.name] = load.words()
            found |= {f"core of {load.name.partition(', turns')[0]}": load.core.words()} if load.core else {}
        found |= self._reached()
        return self._localised(found)

    def _reached(self) -> dict[str, str]:
        """Return the rows of what a transducer does, of a target, and of a design."""
        names = ("motional_current_amplitude_a_a", "load_power_w", "damping_loss_w", "amplitude_m")
        found = {
            name.rpartition("_")[0].replace("_", " "): engineering(self.ceramic[name], unit_in(name))
            for name in names
            if self.ceramic.get(name)
        }
        if self.design is None:
            return found
        for name, wanted in self.design.targets.items():
            words, got = (engineering(value, unit_in(name)) for value in (wanted, self.ceramic[name]))
            found["target"] = f"{words} of {name.rpartition('_')[0].replace('_', ' ')}; {got} behind the real stage"
        return found | self.design.summary()

    def _of_group(self, group: str, port: Port) -> dict[str, str]:
        """Return the rows of a group: what it gets, what was wanted, the loop of its amplifier, and its maxima."""
        found = {
            f"group {group}": f"{engineering(port.voltage_rms_v, 'V')} RMS, THD {100.0 * port.voltage_thd:.3g} %; "
            f"{engineering(port.current_rms_a, 'A')} RMS, THD {100.0 * port.current_thd:.3g} %"
        }
        if delivered := self.delivered.get(group):
            limits = delivered["limited"].items()
            got = port.harmonics[0].voltage_v if self.operating else delivered["got_v"]
            reached = (f"; {name} limit {100.0 * share:.3g} % of the time" for name, share in limits if share)
            found[f"group {group}, wanted"] = (
                f"{engineering(delivered['wanted_v'], 'V')} at the {delivered['place']}, which has "
                f"{engineering(got, 'V')}{''.join(reached)}"
            )
        if loop := self.stability.get(group):
            found[f"group {group}, loop"] = loop.words()
        for event, most in {"maximum": self.maxima, **self.events}.items():
            found[f"group {group}, {event}"] = (
                f"{engineering(most[f'voltage_{group}_v'], 'V')}; {engineering(most[f'current_{group}_a'], 'A')}"
            )
        return found


@checked
def drive_report(
    motor: Motor,
    driver: Driver | Design | DriverSpec,
    duration: float | None = None,
    *,
    audit: bool = True,
    events: bool = False,
    progress: Callable[[float, float], object] | None = None,
    **settings: Unpack[Settings],
) -> DriveReport:
    """Run a driver and its motor from power-up and report on both; design the driver of a specification first.

    Args:
        motor: the motor, at rest under its preload.
        driver: the driver; a design of :func:`design`, whose parts and start the run completes; or a specification,
            from which it is designed or built.
        duration: simulated time in s; by default 3 ms; for a design from 1 to 6 ms, until its motor has started.
        audit: whether findings of the physical audit are an error; if not, ``audit`` of the report has them.
        events: whether further runs find what a load step, a stop and a frequency sweep do to pins and parts. The parts
            of a design are then rated for the largest of all.
        progress: of the run from power-up, as in :func:`simulate`.
        settings: load, contact and solver, as in :class:`.Settings`; of a specification with a rail the speed is that
            of the operating point of the design, and the motor starts from rest.

    Raises:
        NoDriverError: if the design has no driver; a ``ParameterError``.
        ParameterError: for another invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    if isinstance(driver, DriverSpec):
        spec, of_design = driver, settings | {"step": None}
        driver = design_driver(motor, spec, **of_design) if spec.designed else spec.aimed(motor)[0].driver()
        settings = settings if spec.rail is None else settings | {"speed": None}
    design = driver if isinstance(driver, Design) else None
    if isinstance(driver, Design):
        if driver.driver is None:
            raise NoDriverError(driver)
        motor, driver = driver.motor or motor, driver.driver
    transistor_ratings(driver)  # refused before the run
    setup = Point.of(motor, driver, audit=audit, **settings)
    if duration is None:
        duration = _DURATION if design is None and not motor.is_transducer else _start_time(setup, design)
    shortest, longest = 10.0 * setup.source.period, MOST_POINTS * setup.step
    words = f"from {shortest:.3g} s, ten periods of the driver, to {longest:.3g} s, so that the points fit in memory"
    require(shortest <= duration <= longest, "duration", duration, words, unit="s")
    recording, judged, vectors = Recording(setup, setup.discretisation), _judged(setup), _vectors(setup, driver)
    coarser = CoarserRuns(setup, judged, duration) if judged and settings.get("step") is None else None
    with coarser or nullcontext():
        outcome = setup.run(duration, vectors, progress=progress and progress_callback(progress, duration))
        samples = outcome.vectors()
        errors = coarser.errors(recording.columns(samples, judged)) if coarser else None
    window = Window(samples["time"], driver.period, uniform=driver.uniform)
    measured = _Measurement(window, samples, driver)
    balance = measured.balance(setup)
    settled, sources = _operating(setup, design if setup.load.speed is None else None, vectors)
    operating = settled.balance(setup) if settled else None
    report = DriveReport(
        motor=motor.to_dict(),
        driver=driver.to_dict(),
        run={
            "duration_s": duration,
            **setup.to_dict(),
            "uniform_steps": driver.uniform,
            "averaged_periods": window.periods,
            "deck_sha256": outcome.deck_sha256,
        },
        **vars(balance),
        mean_torque_error_n_m=errors.torque_n_m if errors else None,
        to_come=_to_come(setup, measured),
        maxima=loads.maxima(motor, driver, samples, (operating or balance).parts, settled.late if settled else None),
        design=design,
        waveforms=measured.waveforms(),
        solver_seconds=outcome.seconds,
        ngspice_version=outcome.ngspice_version,
        deck=outcome.deck,
        ceramic=ceramic(motor, setup.law, setup.discretisation, samples, driver, window)
        | _motional(motor, settled or measured),
    )
    delivered = (settled or measured).delivered(operating or balance, design.wanted_v if design else {})
    loops, steps = stability(motor, driver)
    limits = [*stability_notes(loops), *loads.stage_notes(driver, delivered, pins=design is None)]
    limits += design.missed(delivered if operating else {}, report.ceramic) if design else []
    report.maxima["exceeded"] += limits
    report = replace(report, delivered=delivered, stability=loops, steps=steps, operating=operating)
    runs = [report.maxima]
    if events:
        found = loads.driver_events(setup, driver, vectors, *_starts(setup, design, sources))
        report = replace(report, events=found, event_faults=loads.event_cautions(setup, found))
        runs += found.values()
    peaks = {group: float(report.maxima[groups.column("voltage", group, "v")]) for group in driver.groups}
    if design:
        reached = None if setup.load.speed is not None or motor.is_transducer else report.mean_rotor_speed_rad_s
        parts = [tuple(PartLoad(**load) for load in run["parts"]) for run in runs]
        between = loads.recovery_peaks(setup, driver, vectors, samples)
        parts[0] = tuple(replace(part, peak_range_a=between.get(part.name)) for part in parts[0])
        most = {group: max(float(run[groups.column("voltage", group, "v")]) for run in runs) for group in driver.groups}
        design = design.ran(parts, reached, most, motor, _start_time(setup, design) - duration)
        if limits:
            reasons = [*limits, *([] if design.feasible else [design.reason])]
            design = replace(design, feasible=False, reason=" ".join(reasons))
        report = replace(report, design=design)
    report.ceramic["cautions"] = [*report.ceramic.get("cautions", ()), *depolarised(motor, peaks)]
    reactive = sum(port.apparent_power_va for port in report.groups.values())
    findings = audit_power(report.power_in_w, report.power_found_w, reactive)
    if setup.law:
        friction = max(one.contact.friction * one.radius_m for one in motor.touching) / motor.rotor.radius_m
        findings += audit_contact(friction, *(samples[name] for name in force_vectors(motor)))
    audited = Audit(findings)
    if audit:
        audited.withhold("report")
    return replace(report, audit=audited)


def _starts(setup: Point, design: Design | None, sources: Array) -> tuple[Any, ...]:
    """Return how the events of a target begin: idle device and its motion, share of the sweep and the motion there."""
    if design is None or not design.targets:
        return ()
    low = setup.drive.updated({"frequency": (1.0 - linear.MISTUNED) * setup.drive.frequency})
    idle = (design.idle, *linear.moving(design.idle, setup.drive, sources)) if design.idle else None
    return idle, linear.MISTUNED, linear.moving(setup.motor, low, sources)


def _operating(setup: Point, design: Design | None, vectors: list[str]) -> tuple[_Measurement | None, Array]:
    """Return what is measured at the operating point behind the real stage; ``None`` where it is not known.

    A motor needs a design, and its shaft is held. The run of a transducer starts with its motion behind the fundamental
    of the stages. It is repeated with the fundamental that the stages had in the run, until this no longer changes;
    these phasors in V are returned as well. An amplifier at its limit of current may not converge.
    """
    driver, setup = setup.drive, replace(setup, source=setup.drive.updated({"supply_rise_s": loads.AT_ONCE}))
    sources, orbit = np.zeros(0, complex), design.behind if design else None

    def measured(samples: dict[str, Array], periods: int = AVERAGED_PERIODS) -> _Measurement:
        window = Window(samples["time"], driver.period, uniform=driver.uniform, periods=periods)
        return _Measurement(window, samples, driver)

    if driver.own or not (orbit or setup.motor.is_transducer):
        return None, sources
    if orbit:
        held, frequency = replace(setup, load=Load(speed=orbit.plant.load.speed)), setup.source.frequencies[0]
        away = float(np.abs(setup.motor.pressed_stator.damped()[0] - frequency).min())
        # with the nearest resonance of the running motor
        beat = min(max(round(frequency / max(away, 1.0)), AVERAGED_PERIODS), _LONGEST_BEAT)
        beat = _LONGEST_BEAT if design and design.averages else beat  # or over an irregular motion
        return measured(running(held, orbit, _SETTLING + beat, _vectors(held, driver)), beat), sources
    phasors = two_phasors(driver.equivalent)
    sources = np.array([phasors[group] for group in driver.groups])
    series, across = np.array([linear.network_of(driver, group) for group in driver.groups]).T
    for _ in range(_CORRECTIONS):
        before, (charged, start) = sources, linear.moving(setup.motor, setup.drive, sources)
        begun = replace(setup, source=charged)
        found = measured(begun.run(_REACHED * driver.period, vectors, start=start).vectors())
        volts, amperes = np.array([found.pin(group) for group in driver.groups]).T
        sources = volts + series * (amperes + across * volts)
        if np.abs(sources - before).max() < _STEADY * np.abs(before).max():
            return found, sources
    return None, sources


def _motional(motor: Motor, measured: _Measurement) -> dict[str, float]:
    """Return amplitudes of a transducer: of the motional currents in A, and of a face whose motion is known, in m."""
    if not motor.is_transducer:
        return {}
    names = [name for name in modal_vectors(motor) if "vvelocity" in name]
    flows = np.array([measured.window.harmonics(measured.samples[name])[0] for name in names])
    found = {
        groups.column("motional_current_amplitude", group, "a"): float(abs(coupling @ flows))
        for group, coupling in zip(motor.groups, motor.stator.coupling.T, strict=True)
    }
    found["load_power_w"] = 0.5 * motor.load_resistance_n_s_per_m * float(abs(np.array(motor.load_motion) @ flows)) ** 2
    found["damping_loss_w"] = 0.5 * float(motor.stator.damping @ np.abs(flows) ** 2)
    moved = float(abs(motor.stator.contact[1] @ flows)) * measured.window.period / (2.0 * np.pi)
    return found | ({"amplitude_m": moved} if motor.stator.contact[1].any() else {})


def _vectors(setup: Point, driver: Driver) -> list[str]:
    """Return the vectors of a run from which a report is made."""
    names = [
        *([] if setup.motor.is_transducer else ["v(shaft)"]),
        *(force_vectors(setup.motor)[::-1] if setup.law else ()),
        *modal_vectors(setup.motor),
    ]
    for group in driver.groups:
        back = [groups.voltage("return", group)] if driver.kind == "full-bridge" else []
        names += [f"v({group})", groups.voltage("line", group), *back]
        names += [groups.current(place, group) for place in ("pin", "out")]
        for rail, volts in zip(RAILS, driver.rails(group), strict=True):
            names += [groups.voltage(rail, group), groups.current(rail, group)] if volts else []
        for part in driver.parts(group):
            names += part.power_vectors
    names += loads.load_vectors(driver)
    return list(dict.fromkeys([*names, *Recording(setup, setup.discretisation).vectors(_judged(setup))]))


def _judged(setup: Point) -> tuple[str, ...]:
    """Return the columns by which the error of the step is estimated; without a contact there is no torque."""
    return (*JUDGED, "normal_force_n") if setup.law and setup.source.uniform else ()


def _start_time(setup: Point, design: Design | None) -> float:
    """Return the time in s of the run of a design.

    A motor from rest reaches its operating point in it, or in :data:`_LONGEST` s begins to; with a bridge, whose runs
    take long, it begins to, by its torque at stall: under a load torque it has none to spare at its operating point.
    """
    motor, uniform = setup.motor, setup.source.uniform
    if motor.is_transducer:  # until it has settled, as far as that is affordable
        most = _START_PERIODS[uniform] // len(motor.groups) * setup.source.period
        return max(min(motor.settled_s, most), _SHORTEST)
    assert design is not None
    points = design.points or design.unmatched
    target = next(point for point in points if point.state == OPERATING)
    torque = min(abs(point.torque_n_m) for point in points[: 2 if uniform else 1]) - abs(setup.load.torque)
    whole = motor.rotor.inertia_kg_m2 * abs(target.speed_rad_s) / torque if torque > 0.0 else _LONGEST
    time = whole + 0.5 * motor.decay_s if uniform else 2.0 * TURNING * whole
    return min(max(_SHORTEST, time), _LONGEST)


def _to_come(setup: Point, measured: _Measurement) -> dict[str, float | None]:
    """Return the expected further relative change of the means of power and torque and of a free rotor's speed."""
    motor, samples, signals = setup.motor, measured.samples, {"motor_power_w": measured.power}
    time, friction = samples["time"], 0.0
    if not motor.is_transducer:
        friction = motor.rotor.radius_m * motor.contact.friction * motor.contact.preload_n
        signals["mean_torque_n_m"] = measured.torque(setup)
    least = {"motor_power_w": 0.0, "mean_torque_n_m": SMALL_TORQUE * friction, "mean_rotor_speed_rad_s": ROUNDING_RAD_S}
    if setup.load.speed is None and not motor.is_transducer:
        signals["mean_rotor_speed_rad_s"] = samples["v(shaft)"]
    window = Window(time, setup.source.period)
    found = {}
    for name, values in signals.items():
        change = change_to_come(time, values, setup.source.period, motor.decay_s)
        scale = abs(window.mean(values)) + least[name]
        found[name] = change / scale if isfinite(change) and scale > 0.0 else None
    return found


@dataclass(frozen=True)
class _Measurement:
    """Voltages, currents and powers of a driver over the window of a run.

    A place is ``"out"``, the output of a stage, or ``"pin"``, the pin of a group.
    """

    window: Window
    samples: dict[str, Array]
    driver: Driver

    def voltage(self, place: str, group: str) -> Array:
        if place == "pin":
            return self.samples[f"v({group})"]
        back = self.samples[groups.voltage("return", group)] if self.driver.kind == "full-bridge" else 0.0
        return self.samples[groups.voltage("line", group)] - back

    @property
    def late(self) -> dict[str, Array]:
        """The samples within the window."""
        return {name: self.window.cut(values) for name, values in self.samples.items()}

    def pin(self, group: str) -> tuple[complex, complex]:
        """Return the phasors of voltage and current of a pin."""
        signals = self.voltage("pin", group), self.samples[groups.current("pin", group)]
        volts, amperes = (self.window.harmonics(signal)[0] for signal in signals)
        return complex(volts), complex(amperes)

    @property
    def power(self) -> Array:
        found = np.zeros_like(self.samples["time"])
        for group in self.driver.groups:
            found += self.voltage("pin", group) * self.samples[groups.current("pin", group)]
        return found

    def torque(self, setup: Point) -> Array:
        """Return the torque of the contact on the rotor; 0 of a free tip."""
        if setup.law is None:
            return np.zeros_like(self.samples["time"])
        return np.asarray(setup.motor.rotor.radius_m * self.samples[force_vectors(setup.motor)[1]])

    def balance(self, setup: Point) -> Balance:
        window, driver, currents = self.window, self.driver, self.supply_currents()
        ports = {place: {group: self.port(place, group) for group in driver.groups} for place in ("out", "pin")}
        budgets = [self.budget(group, ports["out"][group].real_power_w) for group in driver.groups]
        put_in, losses, feeds, stored = zip(*budgets, strict=True)
        lost = {name: loss for of_group in losses for name, loss in of_group.items()}
        torque, speeds = self.torque(setup), self.samples.get("v(shaft)", np.zeros_like(self.samples["time"]))
        return Balance(
            outputs=ports["out"],
            groups=ports["pin"],
            supply_power_w=sum(put_in),
            gate_power_w=sum(feeds),
            supply_current_mean_a={rail: window.mean(values) for rail, values in currents.items()},
            supply_current_peak_a={rail: float(np.abs(window.cut(values)).max()) for rail, values in currents.items()},
            losses_w=lost,
            stored_power_w=sum(stored),
            motor_power_w=sum(port.real_power_w for port in ports["pin"].values()),
            shaft_power_w=window.mean(torque * speeds),
            mean_torque_n_m=window.mean(torque),
            mean_rotor_speed_rad_s=window.mean(speeds),
            settling=window.settling(self.power),
            switching=loads.turn_ons(driver, self.samples, window),
            parts=loads.settled_parts(driver, self.samples, window, lost),
        )

    def port(self, place: str, group: str) -> Port:
        window, voltage, current = self.window, self.voltage(place, group), self.samples[groups.current(place, group)]
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
            voltage_thd=_quotient(float(np.linalg.norm(volts[1:])), float(abs(volts[0]))),
            current_thd=_quotient(float(np.linalg.norm(amperes[1:])), float(abs(amperes[0]))),
            slew_rate_v_per_s=window.slew_rate(voltage),
            resistance_ohm=float(impedance.real),
            reactance_ohm=float(impedance.imag),
            harmonics=tuple(
                Harmonic(order, order / window.period, abs(u), degrees(phase(u)), abs(i), degrees(phase(i)))
                for order, (u, i) in enumerate(zip(volts.tolist(), amperes.tolist(), strict=True), start=1)
            ),
        )

    def budget(self, group: str, output_w: float) -> tuple[float, dict[str, float], float, float]:
        """Return the mean powers in W of the channel of a group whose stage delivers a power.

        They are the power of its supplies, losses by ``PART_GROUP.DEVICE``, the power of the gate drivers and the rate
        of the stored energy.

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
            return output_w + lost + inside, losses, sum(feeds), sum(stored)
        put_in = sum(
            self.window.mean(-self.samples[groups.voltage(rail, group)] * self.samples[groups.current(rail, group)])
            for rail in RAILS
            if groups.current(rail, group) in self.samples
        )
        if self.driver.own and not parts[0].library.losses:
            losses = {f"{parts[0].label}_{group}.total": put_in - inside - output_w} | losses
        return put_in, losses, sum(feeds), sum(stored)

    def delivered(self, balance: Balance, wanted_v: Mapping[str, float]) -> dict[str, Any]:
        """Return what :attr:`DriveReport.delivered` has, for the voltages that a design wants at the pins."""
        driver, place = self.driver, "pin" if wanted_v or self.driver.network == "none" else "stage"
        shares = loads.limited(driver, self.samples, max(self.window.start, driver.supply_rise_s))
        found = {}
        for group in driver.groups:
            got = (balance.groups if place == "pin" else balance.outputs)[group].harmonics[0].voltage_v
            ratio = driver.values(group, "transformer").get("ratio", 1.0) if place == "stage" else 1.0
            wanted = wanted_v.get(group, driver.amplitude(group))
            found[group] = {"place": place, "wanted_v": wanted, "got_v": ratio * got, "limited": shares[group]}
        return found

    def supply_currents(self) -> dict[str, Array]:
        found: dict[str, Array] = {}
        for group in self.driver.groups:
            for rail, name in zip(RAILS, ("positive", "negative"), strict=True):
                if groups.current(rail, group) in self.samples:
                    found[name] = found.get(name, 0.0) - self.samples[groups.current(rail, group)]
        return found

    def waveforms(self) -> dict[str, Array]:
        columns = {"time_s": self.window.time}
        for group in self.driver.groups:
            for place, name in (("out", groups.named("output", group)), ("pin", groups.named("group", group))):
                columns[f"{name}_v"] = self.window.cut(self.voltage(place, group))
                columns[f"{name}_a"] = self.window.cut(self.samples[groups.current(place, group)])
        return columns

    def _mean(self, part: Part, kind: str, name: str) -> float:
        return self.window.mean(self.samples[part.power_vector(kind, name)])

    def _growth(self, part: Part, name: str) -> float:
        energy = self.window.cut(self.samples[part.power_vector("store", name)])
        return 1e-6 * float(energy[-1] - energy[0]) / self.window.length


def _quotient(above: float, below: float) -> float:
    return above / below if below else 0.0
