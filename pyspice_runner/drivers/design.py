# SPDX-License-Identifier: GPL-3.0-or-later
"""Design of a driver: network, transformer and rails, checked in steady states from stall to no load.

The currents of the motor at the wanted voltages of its pins, in steady states at stall, at the operating point and at
no load, give the impedance of each group over the range. A series pair of coil and capacitor cancels a share of the
reactance at the operating point: all of it is the usual match; none is a filter that is tuned to the drive and leaves
the voltages of the pins alone. The more it cancels, the better is the power factor of the stage, and the more the
voltages of the pins change with the load. The choice is the share with the largest power factor whose voltages stay
within :data:`PIN_BAND` of those wanted. The network with values of the E series is then solved for its own steady
states over the range.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import ceil, copysign, degrees, floor, inf, log10, pi, sqrt
from typing import Any, Literal, Unpack

import numpy as np

from pyspice_runner.circuit.law import ContactLaw
from pyspice_runner.circuit.state import Motion
from pyspice_runner.drivers import parts as stock
from pyspice_runner.drivers.driver import BRIDGES, HEADROOM, MOST_VOLTAGE, Driver, NetworkKind
from pyspice_runner.drivers.loads import NO_BLEEDER, NO_COIL, NO_PARALLEL, SHORT_OF, exceeded, part_loads
from pyspice_runner.drivers.magnetics import Wound, cores, wound_transformer
from pyspice_runner.drivers.parts import CABLE, MOSFETS, NO_CAPACITOR, match_to_source, nearest
from pyspice_runner.drivers.ratings import TRANSFORMER, TRANSISTOR, PartLoad, judged
from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Load, TwoPhaseDrive, two_phases, two_phasors
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.strength import depolarised
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.result import json_ready, wording
from pyspice_runner.run.point import Point
from pyspice_runner.run.point import Settings as Settings
from pyspice_runner.steady.shooting import Orbit
from pyspice_runner.steady.small_signals import cold_admittance
from pyspice_runner.steady.steady import STANDS, SteadyState, check_runs, steady_states
from pyspice_runner.steady.transducer import TARGETS, resonance, target_name, transducer_state, under_load
from pyspice_runner.units import engineering, unit_in

STALL, OPERATING, IDLE = "stall", "operating point", "no load"  # states of the range
WARM = "operating point, warm"  # the motor at its temperature, the frequency following its drift
ARRIVED = 0.9  # of the speed of the operating point, from which on a motor has reached it
_MOST_AT_PINS = 1e4  # V, of a drive
TURNING = 0.02  # of that speed, from which on a motor turns and is no longer in the first slips of its start


@dataclass(frozen=True)
class GroupPoint:
    """One group in a steady state: fundamentals at its pin."""

    voltage_v: float  # amplitude
    current_a: float  # amplitude of the current into the pin
    resistance_ohm: float  # real part of the impedance at the pin
    reactance_ohm: float  # imaginary part of that impedance
    power_factor: float  # of the fundamentals at the output of the stage; negative where power flows back

    @property
    def impedance_ohm(self) -> complex:
        """Impedance at the pin."""
        return complex(self.resistance_ohm, self.reactance_ohm)


@dataclass(frozen=True)
class RangePoint:
    """A steady state of the range of operation."""

    state: str  # stall, operating point or no load
    speed_rad_s: float
    torque_n_m: float  # mean torque of the contact on the rotor
    power_w: float  # real power into both groups
    # real power of the fundamentals of both stages, their resistance included; without a driver that of the pins
    stage_power_w: float
    power_factor: float  # real over apparent power of both stages, of the fundamentals
    a: GroupPoint
    b: GroupPoint | None  # not there for one channel
    motional_current_a: float | None = None  # amplitude of group A of a transducer
    detuning: float = 0.0  # relative to the frequency of the drive
    # error of the torque where the periodic motion is unstable, so that all values are time averages
    average_error_n_m: float | None = None

    def group(self, name: str) -> GroupPoint:
        """Return group ``"a"`` or ``"b"``."""
        found = self.a if name == "a" else self.b
        assert found is not None
        return found


class NoDriverError(ParameterError):
    """A design has no driver; the message has its reason.

    Attributes:
        design: the design.
    """

    def __init__(self, design: Design) -> None:
        super().__init__(f"There is no driver to be run. {design.reason}")
        self.design = design

    def __reduce__(self) -> tuple[object, ...]:
        """Keep the design when the error crosses a process boundary."""
        return type(self), (self.design,)


@dataclass(frozen=True)
class DriverSpec:
    """Specification of a driver: the drive wanted at the pins, and what is given of stage, network and parts.

    Attributes:
        drive: voltages, phase and frequency wanted at the pins.
        stage: kind of the power stage, as of :class:`Driver`.
        network: ``"inductor"``, ``"llcc"`` or ``"none"``; ``"l"`` is an LLCC filter of the two elements that a match
            to ``source_ohm`` needs.
        rail: voltage in V between the rails of the stage, to which the transformer is fitted; by default the rails are
            as the voltage requires.
        parts: further values of the driver, by their names or by PART.PARAMETER, as for :meth:`.Driver.updated`.
        match: whether the parts of a network are chosen for the motor, if none of them is given.
        source_ohm: resistance in Ω to which ``"l"`` (default 50 Ω) or ``"llcc"`` transforms the group at the operating
            point, behind stage and transformer; by default an LLCC filter keeps the voltages of the pins.
        power, current, amplitude: of a transducer, a target instead of the drive's voltage: power in W into its load,
            without one into its arms; motional current of group A in A, or motion of the face in m, amplitudes.
        at: of a transducer, ``"series"``, ``"parallel"`` or ``"between"``: resonance under its load in place of the
            drive's frequency.
        load_range: of a transducer, damping of its main mode idle and at the operating point, relative to the motor.
            The motional current is kept from one to the other.

    Raises:
        ParameterError: by the constructor, for a drive of two tones, or an invalid value.
    """

    drive: TwoPhaseDrive
    stage: str = "full-bridge"
    network: NetworkKind | Literal["l"] = "inductor"
    rail: float | None = None
    parts: Mapping[str, Any] = field(default_factory=dict)
    match: bool = True
    source_ohm: float | None = None
    power: float | None = None
    current: float | None = None
    amplitude: float | None = None
    at: Literal["series", "between", "parallel"] | None = None
    load_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if len(self.targets) > 1:
            raise ParameterError(f"{' and '.join(self.targets)} are given: give one of {', '.join(TARGETS)}.")
        units = {"rail": "V", "source_ohm": "Ω", "power": "W", "current": "A", "amplitude": "m"}
        for name, unit in units.items():
            value = getattr(self, name)
            require(value is None or _positive(value), name, value, f"a number > 0 {unit}", unit=unit)
        require(self.at in (None, "series", "between", "parallel"), "at", self.at, "series, between or parallel")
        parts: Any = self.parts
        require(isinstance(parts, Mapping), "parts", parts, "a dictionary of values by PART.PARAMETER")
        given: Any = (1.0, 1.0) if self.load_range is None else self.load_range
        valid = isinstance(given, Sequence) and len(given) == 2 and all(map(_positive, given)) and given[0] <= given[1]
        if not valid:
            shown = ":".join(map(str, given)) if isinstance(given, Sequence) else given
            raise ParameterError(f"load_range = {shown} is not valid: it must be idle to full load > 0, as 1:20.")
        if self.network == "l" and self.source_ohm is None:
            object.__setattr__(self, "source_ohm", SOURCE_OHM)
        valid = self.source_ohm is None or (self.source_ohm > 0.0 and self.network in ("l", "llcc"))
        require(valid, "source_ohm", self.source_ohm, "> 0 Ω, and left out without the network l or llcc", unit="Ω")
        if not isinstance(self.drive, TwoPhaseDrive):
            raise ParameterError("A driver makes two phases of one tone: give a TwoPhaseDrive.")

    @property
    def targets(self) -> dict[str, float]:
        """The target by its name; empty without one."""
        return {name: value for name in TARGETS if (value := getattr(self, name)) is not None}

    def aimed(self, motor: Motor) -> tuple[DriverSpec, Motor, Motor | None]:
        """Return the specification with the drive of its target, the device at its operating point, and idle.

        Raises:
            ParameterError: for a target of a motor, or of a quantity that is not known.
        """
        if not motor.is_transducer:
            if self.targets or self.at or self.load_range:
                words = "power, current, amplitude, at and load_range are targets of a transducer"
                raise ParameterError(f"{words}, and {motor.name} has a rotor: leave them out.")
            return self, motor, None
        idle = motor.model_copy(update={"load": None}) if any(motor.tool.model_dump().values()) else None
        if self.load_range:
            idle, motor = (under_load(motor, factor) for factor in self.load_range)
        drive = self.drive
        if self.at:
            drive = drive.updated({"frequency": resonance(motor, self.at)})
        for name, value in self.targets.items():
            volt = drive.updated({"voltage": 1.0})
            per_volt = transducer_state(motor, volt).quantities.get(target_name(motor, name))
            if per_volt is None:
                words = f"{name} is not known of {motor.name}: give its arms velocity_per_current, or a current"
                raise ParameterError(f"{words} as the target.")
            power, unit = 2.0 if name == "power" else 1.0, unit_in(TARGETS[name])
            most = per_volt * _MOST_AT_PINS**power
            words = f"at most {most:.3g} {unit}, which takes {_MOST_AT_PINS:g} V at the pins"
            require(value <= most, name, value, words, unit=unit)
            drive = drive.updated({"voltage": (value / per_volt) ** (1.0 / power)})
        return replace(self, drive=drive), motor, idle

    @property
    def name(self) -> str:
        """Stage, and behind a + the network."""
        return self.stage if self.network == "none" else f"{self.stage}+{self.network}"

    @property
    def _filter(self) -> NetworkKind:
        return "llcc" if self.network == "l" else self.network

    @property
    def designed(self) -> bool:
        """Whether the driver is designed for its motor: with a rail, or with a network whose parts are not given."""
        given = {path.partition(".")[0].removesuffix("_a").removesuffix("_b") for path in self.parts if "." in path}
        return self.rail is not None or (self.match and self.network != "none" and self._filter not in given)

    def driver(self, **values: Any) -> Driver:
        """Return the driver without a design; ``values`` take the place of values of the drive.

        Raises:
            ParameterError: for an invalid value.
        """
        own = {path: value for path, value in self.parts.items() if "." not in path}
        of_parts = {path: value for path, value in self.parts.items() if "." in path}
        channels: Any = len(self.drive.tones)
        phases = two_phases(self.drive) | values | own
        driver = Driver(kind=self.stage, network=self._filter, channels=channels, **phases)
        return driver.updated(of_parts)

    def built(self, motor: Motor, *, contact: ContactLaw | None, **settings: Any) -> Driver:
        """Return the driver for other analyses, designed by :func:`design_driver` with its settings if it is to be.

        Raises:
            ParameterError: for an invalid value, or if there is no such driver.
            SimulationError: if ngspice fails or its result cannot be trusted.
        """
        if not self.designed:
            return self.aimed(motor)[0].driver()
        design = design_driver(motor, self, contact=contact, **settings)
        if design.driver is None or not design.feasible:
            raise ParameterError(
                f"No network for the {self.name}: {design.reason} Specify its parts by --part, or add --no-match."
            )
        return design.driver


@dataclass(frozen=True)
class Design:
    """A driver with network, transformer and rails for a motor.

    Attributes:
        driver: the driver with its parts; ``None`` if there is none.
        wanted_v: group → amplitude wanted at its pin.
        unmatched: the range with the wanted voltages at the pins; the power factor is that of the pins.
        points: the range with the network, behind the fundamental of the stage.
        share: part of the reactance at the operating point that the network cancels, by its design.
        parts: the parts and what each must withstand in the range; with a run the larger of both.
        feasible: whether everything was simulated and within its limits.
        reason: why it is not feasible and what can be done, or the explanation of the network.
        starts: whether the motor started from rest behind the driver; ``None`` if no run shows it.
        cores: group → core of its transformer, for the largest current of the range.
        targets: the target by the name of its quantity; empty without one.
        behind: solution at the operating point behind the driver; ``None`` of a transducer, and without a driver.
        motor, idle: the device at the operating point, and a transducer idle, if it has a load.
    """

    driver: Driver | None
    wanted_v: dict[str, float]
    unmatched: tuple[RangePoint, ...] = ()
    points: tuple[RangePoint, ...] = ()
    share: float = 0.0
    parts: tuple[PartLoad, ...] = ()
    feasible: bool = False
    reason: str = ""
    starts: bool | None = None
    load_torque_n_m: float = 0.0
    cores: dict[str, Wound] = field(default_factory=dict)
    targets: dict[str, float] = field(default_factory=dict)
    behind: Orbit | None = field(default=None, repr=False, compare=False)
    motor: Motor | None = field(default=None, repr=False, compare=False)
    idle: Motor | None = field(default=None, repr=False, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """Return the design without the driver, which its report has, JSON-ready."""
        names = ("parts", "feasible", "reason", "starts", "wanted_v", "targets", "share", "unmatched", "points")
        return {name: json_ready(getattr(self, name)) for name in names}

    def summary(self) -> dict[str, str]:
        """Return the states of the range, whether the design is feasible, and whether the motor starts."""
        found = {}
        for point in self.points:
            pins = ", ".join(f"{group.upper()} {point.group(group).voltage_v:.4g} V" for group in self.wanted_v)
            rate, unit = _units(self.motor)
            shaft = f"{point.speed_rad_s:.4g} {rate}, {engineering(point.torque_n_m, unit)}"
            if point.average_error_n_m is not None:
                shaft += f" ± {engineering(point.average_error_n_m, unit)} (time average)"
            still = point.speed_rad_s == point.torque_n_m == 0.0  # as a transducer, which has no shaft
            if point.motional_current_a is not None:
                pins += f"; motional current {engineering(point.motional_current_a, 'A')}"
            found[point.state] = f"{engineering(point.power_w, 'W') if still else shaft}; pins {pins}"
        found["design"] = f"{'feasible' if self.feasible else 'not feasible'}: {self.reason}"
        if self.motor is None or not self.motor.is_transducer:
            found["starts from rest"] = {True: "yes", False: "no", None: "not shown"}[self.starts]
        return found

    @property
    def averages(self) -> list[str]:
        """A sentence with the states of the range that are time averages; none without one."""
        found = [point.state for point in self.points if point.average_error_n_m is not None]
        words = f"{len(found)} of {len(self.points)} states of the range ({'; '.join(found)}) have an unstable periodic"
        return [f"{words} motion: their values are time averages."] if found else []

    def ran(
        self, runs: Sequence[Sequence[PartLoad]], speed_rad_s: float | None, volts: Mapping[str, float], motor: Motor,
        missing_s: float = 0.0,
    ) -> Design:  # fmt: skip
        """Return the design after runs from rest, from the loads of their parts and the maximum voltages at the pins.

        ``speed_rad_s`` is the mean at the end of the first one, ``None`` for a held shaft; it should be longer by
        ``missing_s`` to show a start.
        """
        assert self.driver is not None
        known = [{part.name: part for part in parts} for parts in (*runs, self.parts)]
        most = (part.largest(parts[part.name] for parts in known if part.name in parts) for part in runs[0])
        both = tuple(judged(self.driver, part, self.cores) for part in most)
        starts = None if speed_rad_s is None else self._starts(speed_rad_s)
        notes = [*exceeded(both, self.driver), *depolarised(motor, volts)]
        notes += [
            f"No core of the list takes the {engineering(part.rms_current_a, 'A')} RMS of the {part.name}."
            for part in both
            if self.cores and part.name.startswith(TRANSFORMER) and part.rms_current_a and part.core is None
        ]
        notes = [note for note in notes if wording(note) not in wording(self.reason)]  # of one that is not feasible
        short, turns = "", f"it turns at {speed_rad_s or 0.0:.3g} rad/s at the end of the run."
        if starts is False and missing_s > 0.0:
            starts = None
            short = f" The run is too short by {engineering(missing_s, 's')} to show whether the motor starts: {turns}"
        elif starts is False:
            notes.append(f"The motor does not start: {turns}")
        feasible = self.feasible and not notes
        reason = self.reason if feasible else " ".join([*([] if self.feasible else [self.reason]), *notes])
        return replace(self, parts=both, feasible=feasible, reason=reason + short, starts=starts)

    def missed(self, delivered: Mapping[str, Mapping[str, Any]], found: Mapping[str, float]) -> list[str]:
        """Return a sentence for each pin and each target that the real stage misses at the operating point."""
        behind = "Behind the real stage, at the operating point,"
        notes = [
            f"{behind} group {group.upper()} gets {one['got_v']:.4g} V instead of {one['wanted_v']:.4g} V; the limit "
            f"is {100.0 * PIN_BAND:.0f} %."
            for group, one in delivered.items()
            if abs(one["got_v"] / one["wanted_v"] - 1.0) > PIN_BAND
        ]
        for name, wanted in self.targets.items():
            share = found[name] / wanted
            if abs((sqrt(share) if name.endswith("_w") else share) - 1.0) > SHORT_OF:
                got, asked = (engineering(value, unit_in(name)) for value in (found[name], wanted))
                what = name.rpartition("_")[0].replace("_", " ")
                notes.append(f"{behind} the {what} is {got} instead of {asked}.")
        return notes

    def _starts(self, speed_rad_s: float) -> bool:
        """Return whether a motor that has reached a speed comes to its operating point.

        It has, or it turns towards it and the torque of the steady states beyond its speed accelerates it on.
        """
        target = next(point for point in self.points or self.unmatched if point.state == OPERATING).speed_rad_s
        if abs(target) < STANDS:
            return True
        reached, sign = speed_rad_s / target, copysign(1.0, target)
        spare = [
            sign * (point.torque_n_m - self.load_torque_n_m)
            for point in self.points
            if point.speed_rad_s / target < 1.0
        ]
        return reached >= ARRIVED or (reached >= TURNING and min(spare, default=0.0) > 0.0)


SOURCE_OHM = 50.0  # Ω, of high-frequency amplifiers and of a network l by default
ACCURACY = 1e-2  # of the torque, of the friction torque under the preload: the design needs voltages and currents


def range_point(name: str, state: SteadyState, driver: Driver | None) -> RangePoint:
    """Return a steady state with the power factor at the outputs of the stages; without a driver that of the pins."""
    power_w, averaged = state.power_a_w + state.power_b_w, state.reached and not state.stable
    point = _point_of(name, state.pins, driver, power_w, state.speed_rad_s, state.torque_n_m)
    return replace(point, average_error_n_m=state.torque_error_n_m if averaged else None)


def linear_point(name: str, motor: Motor, drive: TwoPhaseDrive, driver: Driver | None) -> RangePoint:
    """Return such a point of a transducer, with a drive at its pins, or behind the fundamental of a driver."""
    phasors, frequency = two_phasors(driver.equivalent if driver else drive), (driver or drive).frequency
    volts = np.array([phasors[group] for group in motor.groups])
    if driver:
        volts = pin_voltages(motor, driver, volts)
    amperes = cold_admittance(motor, frequency) @ volts
    pins = {group: (complex(volts[at]), complex(amperes[at])) for at, group in enumerate(motor.groups)}
    point = _point_of(name, pins, driver, 0.5 * float((volts.conjugate() @ amperes).real))
    flow = 2.0 * pi * frequency * abs(motor.stator.coupling[:, 0] @ moved_by(motor, frequency, volts))
    return replace(point, motional_current_a=float(flow))


def moved_by(motor: Motor, frequency: float, volts: Any) -> Any:
    """Return the phasors in m of the modes of a transducer, for phasors in V at its pins."""
    stator = motor.loaded_stator
    return np.linalg.solve(stator.dynamic_stiffness(2.0 * pi * frequency), stator.coupling @ volts)


def pin_voltages(motor: Motor, driver: Driver, sources: Any) -> Any:
    """Return the phasors in V at the pins of a transducer behind a driver, by the open-circuit ones of its stages."""
    series, across = np.array([network_of(driver, group) for group in motor.groups]).T
    shunt = cold_admittance(motor, driver.frequency) + np.diag(across)
    return np.linalg.solve(np.eye(len(sources)) + np.diag(series) @ shunt, sources)


def moving(motor: Motor, driver: Driver, sources: Any) -> tuple[Driver, Motion]:
    """Return the driver and the motion of a transducer at t = 0 in that steady state.

    The capacitors in series are charged as well, or an offset of the pins would decay through their bleeders.
    """
    pins, omega = pin_voltages(motor, driver, sources), 2.0 * pi * driver.frequency
    moved = moved_by(motor, driver.frequency, pins)
    currents = cold_admittance(motor, driver.frequency) @ pins
    volts = {
        group: float(before.stores["cseries"].imag)
        for group, voltage, current in zip(driver.groups, pins, currents, strict=True)
        for _, before in driver.passed(group, voltage, current, omega)
        if "cseries" in before.stores
    }
    motion = {f"displacement_{at}": float(one.imag) for at, one in enumerate(moved, start=1)}
    motion |= {f"velocity_{at}": float((1j * omega * one).imag) for at, one in enumerate(moved, start=1)}
    return driver.charged(volts), motion


def _point_of(
    name: str, pins: Mapping[str, tuple[complex, complex]], driver: Driver | None, power_w: float, speed: float = 0.0,
    torque: float = 0.0,
) -> RangePoint:  # fmt: skip
    """Return a point by the phasors of voltage and current of the pins."""
    inputs, real, apparent = dict[str, GroupPoint](), 0.0, 0.0
    for group, (volts, amperes) in pins.items():
        source, through = at_stage(driver, group, volts, amperes)
        power, product = (source * through.conjugate()).real, abs(source) * abs(through)
        impedance = volts / amperes
        inputs[group] = GroupPoint(abs(volts), abs(amperes), impedance.real, impedance.imag, power / product)
        real, apparent = real + 0.5 * power, apparent + 0.5 * product
    return RangePoint(name, speed, torque, power_w, real, real / apparent, inputs["a"], inputs.get("b"))


def network_of(driver: Driver, group: str, frequency: float | None = None) -> tuple[complex, complex]:
    """Return the series impedance, stage and transformer included, and the admittance across the pin.

    They are those of the source at the pin: an admittance in front of a cable's inductance counts at its end.
    ``frequency`` in Hz is by default that of the driver; below 0 the values are those of a conjugate phasor.
    """
    open_v, _ = at_stage(driver, group, 1.0, 0.0, frequency)
    series, _ = at_stage(driver, group, 0.0, 1.0, frequency)
    return complex(series), complex((open_v - 1.0) / series)


def at_stage(
    driver: Driver | None, group: str, volts: complex, amperes: complex, frequency: float | None = None
) -> tuple[complex, complex]:
    """Return voltage and current of the lossless stage behind its transformer, for those of the pin."""
    if driver is not None:
        omega = 2.0 * pi * (driver.frequency if frequency is None else frequency)
        for _, found in driver.equivalent.passed(group, volts, amperes, omega):
            volts, amperes = found.volts, found.amperes
    return volts, amperes


def load_of(driver: Driver, group: str, load: complex) -> complex:
    """Return the impedance in front of the cable, if there is one, for that of the group at its pin."""
    for part, found in driver.passed(group, load, 1.0, 2.0 * pi * driver.frequency):
        if part.label == CABLE:
            return complex(found.volts / found.amperes)
    return load


def part_phasors(driver: Driver, points: tuple[RangePoint, ...]) -> dict[str, Any]:
    """Return phasors of the vectors of :func:`.part_loads`, an entry for each point, in a lossless stage's network."""
    found: dict[str, Any] = {}
    omega = 2.0 * pi * driver.frequency * np.array([1.0 + point.detuning for point in points])
    for group in driver.groups:
        pin = np.array([complex(point.group(group).voltage_v) for point in points])
        amperes = pin / np.array([point.group(group).impedance_ohm for point in points])
        line, through = pin, amperes
        for part, before in driver.passed(group, pin, amperes, omega):
            stores, instance = before.stores, groups.named("xnetwork", group)
            if part.label == CABLE:
                found[f"i(v.xcable_{group}.vcurrent)"] = stores["lline"]
                found[groups.voltage(driver.network, group)] = before.volts
            else:
                found |= {
                    f"v({instance}.inner)": before.inner, f"i(v.{instance}.vcurrent)": before.amperes,
                    f"i(v.{instance}.vcoil)": stores["lseries"], f"i(v.{instance}.vparallel)": stores["lparallel"],
                }  # fmt: skip
            line, through = before.volts, before.amperes
        ratio = 1.0 if driver.kind == "push-pull" else driver.ratio(group)  # whose transformer is in the stage
        found |= {
            f"v({group})": pin, groups.current("pin", group): amperes, groups.voltage("line", group): line / ratio,
            groups.voltage("transformer", group): line, groups.current("out", group): through * ratio,
        }  # fmt: skip
    return found


def warmed(point: Point, driver: Driver, rise_k: float) -> Point:
    """Return an operating point behind a driver with a warmer motor, which a tracker follows by the frequency."""
    thermal = Thermal.of(point.motor)
    frequency = driver.frequency * thermal.frequency_factor(rise_k)
    return replace(point, motor=thermal.warmed(point.motor, rise_k), source=driver.updated({"frequency": frequency}))


@checked
def driver_state(
    motor: Motor, driver: Driver, *, warmer_k: float = 0.0, **settings: Unpack[Settings]
) -> dict[str, Any]:
    """Return the steady state behind a driver with its network as it is: for sweeps over tolerances.

    The stage counts with its fundamental and its resistance (:meth:`.Driver.equivalent`).

    Args:
        motor: the motor, cold.
        driver: the driver.
        warmer_k: temperature in K of the motor above that of its parameters; the frequency follows its resonance.
        settings: load, contact and solver, as in :class:`.Settings`.

    Returns:
        Amplitudes ``voltage_a_v`` and ``current_a_a`` at the pins of each group, ``power_w`` into both,
        ``stage_power_w`` and ``power_factor`` of the fundamentals of the stages; of a motor ``torque_n_m`` with
        ``torque_error_n_m``, ``speed_rad_s`` and ``cautions``, of a transducer ``motional_current_a``.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if there is no stable steady state.
    """
    stage, own = driver.equivalent, dict[str, Any]()
    drive = TwoPhaseDrive(**two_phases(stage))
    if motor.is_transducer:
        found = linear_point("", motor, drive, driver)
        own["motional_current_a"] = found.motional_current_a
    else:
        cold = Point.of(motor, stage, audit=False, **settings)
        point = warmed(cold, stage, warmer_k) if warmer_k else cold
        # a start with the voltages of the stages at the pins, which a network that is tuned to the drive passes
        pins = drive.updated({"frequency": point.source.frequencies[0]})
        ideal = Point.of(point.motor, pins, audit=False, **settings)
        (pins_held,) = steady_states([ideal], accuracy=ACCURACY, averages=False)
        (state,) = _solved([point], [pins_held.solution])
        if not _steady(state):
            raise SimulationError("There is no stable steady state behind this driver.")
        found = range_point("", state, driver)
        own |= {name: getattr(state, name) for name in ("torque_n_m", "torque_error_n_m", "speed_rad_s")}
        own["cautions"] = list(state.cautions)
    of_groups = {
        groups.column(name, group, unit): getattr(found.group(group), f"{name}_{unit}")
        for group in driver.groups for name, unit in (("voltage", "v"), ("current", "a"))
    }  # fmt: skip
    return {name: getattr(found, name) for name in ("power_w", "stage_power_w", "power_factor")} | of_groups | own


PIN_BAND = 0.2  # by which the voltage of a pin may differ from the wanted one, from stall to no load
_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)  # of the reactance that a series network may cancel
# reactance of a coil behind switching edges over that of the clamped capacitance, both at the drive: the third harmonic
# of a square wave, a third of its fundamental, then is 9 % at the pin
_FILTER = 0.6
# of a transducer, largest reactance of that coil over the impedance at its pin. The coil and the clamped capacitance
# resonate at an even multiple of the drive, where a square wave has nothing
_TUNED = 3.0
_EVEN = 2.0  # the first even multiple, beyond which all harmonics of a square wave are weakened
MISTUNED = 0.005  # of the frequency, to both sides, at which the design of a target is computed as well
# of a bleeder over the reactance of its capacitor: it takes a hundredth of the current, and an offset of the pin decays
# in 100 (1 + C of the group over C in series) / ω, a few tens of periods
BLED = 100.0
_BLED_SLOWLY = 1000.0  # of a transducer, whose supply rises slowly and leaves no offset: a thousandth of the current
_PAIR = 2.0  # coil of an LLCC that transforms over that of the match; a capacitor takes the rest, and isolates
_SMALLEST = {"inductor": stock.SMALLEST_INDUCTANCE, "llcc": 1e-5}  # H, smallest series coil of a design
SPIKE = 2.0  # of the transistors of a push-pull stage over their swing, by the leakage between the halves: assumed
_LEAST_SHARE = 1e-3  # of a target, down to which a possible value is searched for
_SETTLED = 1.01  # of a possible value, to which it is found
_SLOW = 3.0  # decay times of the mode under load, in which the supply of a transducer with a load rises
_SLOWEST_RISE = 1e-2  # s, the upper limit of supply_rise_s
_ROUNDS = 4  # of transformer ratio and network, each of which depends on the other
_SECANTS = 4  # speeds at most at which no load is sought; two do where torque over speed is nearly a line
_SLOWER = 4  # times as many for a transducer, whose impedance is low compared with the stage's times the ratio squared
_SPARE = 0.9  # of a load torque, which a motor with pins of a somewhat lower voltage must give at least
_LEAST_STEP = 0.02  # of a ratio from 1, below which a half bridge needs no transformer
_RATIOS = (0.1, 100.0)  # of a transformer, as in its library
_DETUNED = 0.02  # of the reactance of a coil: a smaller difference needs no capacitor
_LEAST_BLEEDER = 1e3  # Ω, of the libraries of networks
_INSTEAD = {
    "none": "Take a network, --driver …+llcc, or a stage of lower resistance.",
    "inductor": "Series matching cannot follow this load. Take +llcc or no network, or lower or control the amplitude.",
    "llcc": "Lower the voltage, take no network, or control the amplitude.",
}


@checked
def design_driver(motor: Motor, spec: DriverSpec, *, seeks: bool = True, **settings: Unpack[Settings]) -> Design:
    """Design a driver whose pins keep their voltages from stall to no load, and check it in steady states.

    Args:
        motor: the motor.
        spec: the drive wanted at the pins, stage, network and rails, and the parts that are given; those of network
            and transformer are chosen here.
        seeks: whether the largest possible value is searched for where a target is not reached.
        settings: as in :class:`.Settings`; the speed is that of the operating point, by default half the speed at no
            load; the load torque is that at the operating point, and of the motor when it starts.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    given, (spec, motor, idle) = motor, spec.aimed(motor)
    load_torque, held = settings.get("load_torque", 0.0), settings.get("speed") is not None
    ideal = Point.of(motor, spec.drive, audit=False, **(settings | {"load_torque": 0.0} if held else settings))
    Load(torque=load_torque).check(motor)
    if ideal.law is None and not motor.is_transducer:
        raise ParameterError(
            "A driver is designed for a motor on its rotor. Give a law of the contact, not none, or leave the network "
            "unmatched."
        )
    phasors = two_phasors(spec.drive)
    wanted = {group: abs(phasors[group]) for group in motor.groups}
    choose = spec.rail is not None and spec.stage in BRIDGES and "mosfet" not in spec.parts
    # the one of the highest voltage, until the currents are known
    template = spec.driver(voltage=1.0, **({"mosfet": MOSFETS[-1]} if choose else {}))
    states = {} if motor.is_transducer else _range(ideal)
    targets = {target_name(motor, name): value for name, value in spec.targets.items()}
    draft = Design(None, wanted, targets=targets, load_torque_n_m=load_torque, motor=motor, idle=idle)
    if lost := _lost(states, wanted, "with the wanted voltages at the pins"):
        return replace(draft, reason=lost)
    search = _Search(ideal, spec, template, load_torque, states, choose, idle)
    draft = replace(draft, unmatched=search.points, reason=search.unreachable())
    if draft.reason:
        return draft
    try:
        best = search.best_share()
        found = search.verified(draft, best)
        found = found if found.feasible or best == 0.0 else search.verified(draft, 0.0)
    except _NotFeasibleError as error:
        found = replace(draft, reason=str(error))
    if not seeks or found.feasible or not spec.targets:
        return found
    return replace(found, reason=f"{found.reason} {_possible(given, spec)}")


def _possible(motor: Motor, spec: DriverSpec) -> str:
    """Return in a sentence the largest value of a target that a design reaches, rounded down to two digits."""
    ((name, value),), low, high = spec.targets.items(), _LEAST_SHARE, 1.0
    while high / low > _SETTLED:
        middle = sqrt(low * high)
        scaled: Any = {name: middle * value}
        try:
            reached = design_driver(motor, replace(spec, **scaled), seeks=False).feasible
        except ParameterError:
            reached = False
        low, high = (middle, high) if reached else (low, middle)
    if low == _LEAST_SHARE:
        return "No smaller value is possible either."
    digit = 10.0 ** (floor(log10(low * value)) - 1)
    return f"{engineering(floor(low * value / digit) * digit, unit_in(TARGETS[name]))} are possible, before the run."


def _positive(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < inf


def _units(motor: Motor | None) -> tuple[str, str]:
    """Return the units of speed and load of a motor."""
    return ("m/s", "N") if motor and motor.slider else ("rad/s", "N·m")


class _NotFeasibleError(Exception):
    """There is no such driver; the message says why and what can be done."""


def _range(ideal: Point) -> dict[str, SteadyState]:
    """Return the steady states at stall, at the operating point and at no load with the wanted voltages at the pins."""
    held, free = replace(ideal, load=Load(speed=0.0)), replace(ideal, load=Load())
    given = ideal.load.speed is not None or ideal.load.torque != 0.0
    stall, idle, *rest = steady_states([held, free, *([ideal] if given else [])], accuracy=ACCURACY)
    if not rest and idle.converged:
        middle = replace(ideal, load=Load(speed=0.5 * idle.speed_rad_s))
        rest = steady_states([middle], accuracy=ACCURACY, starts=[stall.solution])
    check_runs([stall, idle, *rest])
    return dict(zip((STALL, OPERATING, IDLE), (stall, *(rest or [idle]), idle), strict=True))


def _steady(state: SteadyState) -> bool:
    return state.reached or (state.converged and state.held_by_friction)


def _solved(points: Sequence[Point], starts: Sequence[Orbit | None]) -> list[SteadyState]:
    """Return steady states behind a driver; one that is not found from its start is searched for from rest."""
    found = steady_states(points, accuracy=ACCURACY, starts=starts)
    lost = [place for place, state in enumerate(found) if not _steady(state)]
    again = steady_states([points[place] for place in lost], accuracy=ACCURACY)
    for place, state in zip(lost, again, strict=True):
        found[place] = state
    check_runs(found)
    return found


def _lost(states: Mapping[str, SteadyState], wanted: Mapping[str, float], where: str) -> str:
    """Return in a sentence at which state there is no stable steady state; an empty text if there is at all."""
    lost = [name for name, state in states.items() if not _steady(state)]
    if not lost:
        return ""
    volts = " and ".join(f"{value:.4g} V" for value in wanted.values())
    return (
        f"At {', '.join(lost)} there is no stable steady state {where} ({volts}), so that no design can be checked. "
        "Change the frequency or the voltage, and look at the motor with simulate."
    )


@dataclass
class _Search:
    """The search for a driver over the range of a motor."""

    ideal: Point
    spec: DriverSpec
    driver: Driver
    load_torque: float
    states: Mapping[str, SteadyState]
    choose: bool  # whether the MOSFET is chosen, too
    idle: Motor | None = None  # a transducer without its load
    cores: dict[str, Wound] = field(default_factory=dict)  # of the transformers of the last driver

    def __post_init__(self) -> None:
        self.points = tuple(range_point(name, state, None) for name, state in self.states.items()) or self.linear(None)
        phasors = two_phasors(self.spec.drive)
        self.rail, self.pins = self.spec.rail, {group: phasors[group] for group in self.driver.groups}  # wanted
        self.omega = 2.0 * pi * self.driver.frequency
        self.middle = next(point for point in self.points if point.state == OPERATING)
        self.bled = _BLED_SLOWLY if self.ideal.motor.is_transducer else BLED  # bleeder over the reactance
        flows = [point.motional_current_a or 0.0 for point in self.points if not point.detuning]
        # a voltage that is kept does not keep the current
        self.current = self.spec.load_range is not None and max(flows) > (1.0 + PIN_BAND) * min(flows)

    def linear(self, driver: Driver | None) -> tuple[RangePoint, ...]:
        """Return the range of a transducer: under its load and, if it has one, without; of a target also mistuned."""
        ends = {OPERATING: (self.ideal.motor, 0.0)} | ({IDLE: (self.idle, 0.0)} if self.idle else {})
        for shift in (-MISTUNED, MISTUNED) if self.spec.targets else ():
            ends[f"{100.0 * shift:+g} % frequency"] = self.ideal.motor, shift
        found = []
        for name, (motor, shift) in ends.items():
            change = {"frequency": (1.0 + shift) * self.spec.drive.frequency}
            behind = driver.updated(change) if driver else None
            point = linear_point(name, motor, self.spec.drive.updated(change), behind)
            found.append(replace(point, detuning=shift))
        return tuple(found)

    def unreachable(self) -> str:
        """Return why the motor does not reach its operating point; an empty text if it does."""
        if self.ideal.motor.is_transducer:
            return ""
        idle, middle, load = self.points[-1].speed_rad_s, self.middle, self.ideal.load
        asked, volts = middle.speed_rad_s if load.speed is None else load.speed, abs(self.pins["a"])
        rate, unit = _units(self.ideal.motor)
        given = load.speed is not None or load.torque
        if given and asked and not (abs(idle) > STANDS and 0.0 < asked / idle < 1.0):
            what = f"turns at {asked:.4g} {rate}" if load.speed is not None else f"drives {load.torque:.4g} {unit}"
            return (
                f"With {volts:.4g} V at the pins the motor turns at {idle:.4g} {rate} without load, and never {what} "
                "forwards. Raise the voltage, change frequency or phase, or ask for less."
            )
        if load.speed is not None and copysign(1.0, asked) * (middle.torque_n_m - self.load_torque) < 0.0:
            return (
                f"At {asked:.4g} {rate} and {volts:.4g} V the motor gives {middle.torque_n_m:.3g} {unit}, less than "
                f"the load of {self.load_torque:.3g} {unit}. Raise the voltage, or ask for less."
            )
        return ""

    def best_share(self) -> float:
        """Return the share of the reactance to be cancelled, by the impedances of the motor at the wanted voltages.

        These change with the voltages, so that half of the band is allowed.
        """
        if self.driver.network != "inductor" or self.current:
            return 0.0
        found = []
        for share in _SHARES:
            driver = self.built(share)
            changes, factors = [], []
            for point in self.points:
                real = apparent = 0.0
                for group in () if point.detuning else self.pins:
                    load, source = point.group(group).impedance_ohm, driver.fundamental(group)
                    volts, amperes = at_stage(driver, group, load, 1.0)
                    changes.append(source * abs(load / volts) / abs(self.pins[group]) - 1.0)
                    real += source**2 * (amperes / volts).real
                    apparent += source**2 * abs(amperes / volts)
                factors += [real / apparent] if apparent else []
            found.append((share, max(map(abs, changes)), min(factors)))
        kept = [(factor, share) for share, change, factor in found if change <= 0.5 * PIN_BAND]
        return max(kept)[1] if kept else 0.0

    def built(self, share: float) -> Driver:
        """Return the driver whose network cancels a share of the reactance at the operating point."""
        driver = self.driver
        try:
            for _ in range(_ROUNDS * (_SLOWER if self.ideal.motor.is_transducer else 1)):
                driver = self._supplied(driver.updated(self._values(driver, share)))
                if self.choose:
                    driver = driver.updated({"mosfet": self._mosfet(driver)})
            _ = driver.equivalent  # raises if the resistance of the stage, times the ratio squared, is out of range
        except ParameterError as error:
            # the parts that are given were valid; with a target ratio and network run away
            reason = self._beyond(driver) if self.spec.targets else f"{error} Take another stage, rail or MOSFET."
            raise _NotFeasibleError(reason) from None
        return driver

    def _beyond(self, driver: Driver) -> str:
        """Return why the stage does not reach its target."""
        most = max(map(abs, self.pins.values()))
        if self.spec.at == "parallel" and not self.idle and most > MOST_VOLTAGE:
            return (
                f"The device runs idle at its antiresonance, and its pins need {engineering(most, 'V')}; the limit is "
                f"{engineering(MOST_VOLTAGE, 'V')}. Give it a load, by [load] in its file or --load-range, or take "
                "--at series."
            )
        rail = f" at a rail of {self.rail:g} V" if self.rail else ""
        current = self.current and driver.network != "llcc"
        way = "the network llcc" if current else "less, or another stage, rail or MOSFET"
        return f"The stage does not reach the target{rail}: its resistance takes the voltage. Take {way}."

    def _wanted(self, driver: Driver, group: str) -> tuple[complex, complex]:
        """Return voltage and current of the stage with the wanted voltage at the pin, at the operating point."""
        return at_stage(driver, group, self.pins[group], self.pins[group] / self.middle.group(group).impedance_ohm)

    def _mosfet(self, driver: Driver) -> str:
        """Return the MOSFET with the smallest loss at the operating point."""
        volts = driver.swing("a") * (SPIKE if driver.kind == "push-pull" else 1.0)
        stages = {group: self._wanted(driver, group)[1] for group in self.pins}
        current = max(driver.ratio(group) * abs(through) / sqrt(2.0) for group, through in stages.items())
        return stock.suited(volts, driver.swing("a"), current, driver.frequency) or MOSFETS[-1]

    def _values(self, driver: Driver, share: float) -> dict[str, float]:
        if driver.network == "none":
            return {}
        if self.spec.source_ohm is not None:
            return self._transforming(driver, self.spec.source_ohm)
        prefix, omega, values = "series_" if driver.network == "llcc" else "", self.omega, dict[str, float]()
        for group in self.pins:
            most = stock.largest_inductance(driver.frequency, driver.winding(group))
            label, leakage = groups.named(driver.network, group), driver.leakage(group)
            load = load_of(driver, group, self.middle.group(group).impedance_ohm)
            wanted = -share * load.imag
            filtering = driver.switched or driver.network == "llcc"
            clamped = self.ideal.motor.piezo.capacitance_f(group)
            clamped += driver.values(group, CABLE).get("capacitance", 0.0)
            if self.current:
                values |= self._current_source(driver, group, clamped)
                continue
            total = max(wanted, self._filter_ohm(group, clamped) if filtering else 0.0) / omega
            coil = least = _SMALLEST[driver.network]
            if total - leakage > least:
                coil = min(nearest(total - leakage, stock.E12), _largest(most))
            if driver.network == "llcc":
                values |= self._across(group, most, coil + leakage, clamped)
                if self.ideal.motor.is_transducer:  # the series pair cancels what the capacitor adds
                    wanted = -(1.0 / (1.0 / load + 1j * omega * values[f"{label}.parallel_capacitance"])).imag
            excess = omega * (coil + leakage) - wanted
            capacitor = NO_CAPACITOR
            if excess > _DETUNED * omega * (coil + leakage) and excess > 0.0 and (filtering or wanted < 0.0):
                capacitor = nearest(1.0 / (omega * excess), stock.E24)
            values[f"{label}.{prefix}inductance"] = coil
            values[f"{label}.{prefix}resistance"] = max(omega * coil / stock.WINDING_QUALITY, 1e-2)
            values[f"{label}.{prefix}capacitance"] = capacitor
            isolated = capacitor != NO_CAPACITOR and values.get(f"{label}.parallel_inductance", NO_COIL) == NO_COIL
            bled = nearest(max(self.bled / (omega * capacitor), _LEAST_BLEEDER), stock.E12)
            values[f"{label}.bleeder"] = bled if isolated else NO_BLEEDER
        return values

    def _filter_ohm(self, group: str, clamped_f: float) -> float:
        """Return the reactance in Ω, at the drive, of a coil behind switching edges."""
        capacitive = 1.0 / (self.omega * clamped_f)
        if not self.ideal.motor.is_transducer:
            return _FILTER * capacitive
        most = _TUNED * abs(load_of(self.driver, group, self.middle.group(group).impedance_ohm))
        if self.driver.network == "llcc":  # a capacitor across the group tunes it
            return min(most, capacitive / _EVEN**2)
        multiple = _EVEN * max(ceil(0.5 * sqrt(1.0 + capacitive / most)), 1.0)
        return capacitive / (multiple**2 - 1.0)

    def _current_source(self, driver: Driver, group: str, clamped_f: float) -> dict[str, float]:
        """Return the settings of a coil that resonates with the capacitance across a group.

        The motional current is then the stage's voltage divided by the reactance of the coil, and independent of
        the resistance of the arm. A parallel capacitor brings this reactance down to the largest resistance, where the
        coil has the voltage of the pin.
        """
        omega, label = self.omega, groups.named(driver.network, group)
        llcc, most = driver.network == "llcc", stock.largest_inductance(driver.frequency, driver.winding(group))
        load = load_of(self.driver, group, self.middle.group(group).impedance_ohm)
        arm = abs(1.0 / (1.0 / load - 1j * omega * clamped_f))
        reactance = min(arm, 1.0 / (omega * clamped_f)) if llcc else 1.0 / (omega * clamped_f)
        leakage, prefix = driver.leakage(group), "series_" if llcc else ""
        coil = nearest(max(reactance / omega - leakage, _SMALLEST[driver.network]), stock.E12)
        coil = min(coil, _largest(most))
        values = {
            f"{label}.{prefix}inductance": coil, f"{label}.{prefix}capacitance": NO_CAPACITOR,
            f"{label}.{prefix}resistance": max(omega * coil / stock.WINDING_QUALITY, 1e-2),
            f"{label}.bleeder": NO_BLEEDER,
        }  # fmt: skip
        if llcc:
            capacitor = 1.0 / (omega**2 * (coil + leakage)) - clamped_f
            present = capacitor >= stock.SMALLEST_CAPACITANCE
            values[f"{label}.parallel_capacitance"] = nearest(capacitor, stock.E24) if present else NO_PARALLEL
            values[f"{label}.parallel_inductance"] = NO_COIL
        return values

    def _transforming(self, driver: Driver, source_ohm: float) -> dict[str, float]:
        """Return the settings of a network that transforms each group, with the losses of its windings."""
        omega, values = self.omega, dict[str, float]()
        for group in self.pins:
            plain = load_of(driver, group, self.middle.group(group).impedance_ohm)
            resistance = lost = 0.0  # in series, and conductance of the parallel coil
            for _ in range(_ROUNDS):
                load = 1.0 / (1.0 / plain + lost)
                match = match_to_source(load, max(source_ohm - resistance, 0.5 * source_ohm), driver.frequency)
                coil = match["series_inductance"] * (1.0 if self.spec.network == "l" else _PAIR)
                excess, across = coil - match["series_inductance"], match.get("parallel_inductance", NO_COIL)
                bled = self.bled * omega * excess if excess and across == NO_COIL else NO_BLEEDER
                lost = 0.0 if across == NO_COIL else 1.0 / (omega * across * stock.WINDING_QUALITY)
                resistance = omega * coil / stock.WINDING_QUALITY + (omega * excess) ** 2 / bled
            found = {
                "series_inductance": coil - driver.leakage(group),
                "series_resistance": max(omega * coil / stock.WINDING_QUALITY, 1e-2),
                "series_capacitance": 1.0 / (omega**2 * excess) if excess else NO_CAPACITOR,
                "parallel_inductance": across,
                "parallel_resistance": max(lost * (omega * across) ** 2, 1e-2),
                "parallel_capacitance": match.get("parallel_capacitance", NO_PARALLEL),
                "bleeder": bled,
            }
            values |= {f"llcc_{group}.{name}": float(f"{value:.3g}") for name, value in found.items()}
        return values

    def _across(self, group: str, most: float, series_h: float, clamped_f: float) -> dict[str, float]:
        """Return the settings of the pair across a group, which cancels the middle of its susceptances.

        At a transducer it is a capacitor that tunes the series coil to the first even multiple of the drive.
        """
        loads = [load_of(self.driver, group, point.group(group).impedance_ohm) for point in self.points]
        susceptances = [(1.0 / load).imag for load in loads]
        middle, omega = 0.5 * (min(susceptances) + max(susceptances)), self.omega
        coil, capacitor = NO_COIL, -middle / omega
        if self.ideal.motor.is_transducer:
            capacitor = 1.0 / ((_EVEN * omega) ** 2 * series_h) - clamped_f
        elif middle > 0.0:
            coil = _largest(min(most, 1.0 / (omega * middle)))
            capacitor = 1.0 / (omega**2 * coil) - middle / omega
        capacitor = NO_PARALLEL if capacitor < stock.SMALLEST_CAPACITANCE else nearest(capacitor, stock.E24)
        label = f"llcc_{group}.parallel_"
        return {
            f"{label}inductance": coil, f"{label}capacitance": capacitor,
            f"{label}resistance": min(max(omega * coil / stock.WINDING_QUALITY, 1e-2), 1e4),
        }  # fmt: skip

    def _supplied(self, driver: Driver) -> Driver:
        """Return the driver with the voltages of its stage and the ratios of its transformer."""
        sources = {group: self._wanted(driver, group)[0] for group in self.pins}
        amplitudes = {group: abs(source) for group, source in sources.items()}
        changes: dict[str, Any] = {"voltage": amplitudes["a"]}
        if self.idle and "supply_rise_s" not in self.spec.parts:  # slower than the mode, or the coil rings up
            changes["supply_rise_s"] = min(_SLOW * self.ideal.motor.loaded_stator.decay_s, _SLOWEST_RISE)
        if "b" in sources:
            changes["ratio_b"] = amplitudes["b"] / amplitudes["a"]
            changes["phase_deg"] = degrees(phase(sources["b"] / sources["a"]))
        if self.rail is None:
            return driver.updated(changes)
        if driver.switched:
            changes["supply_v"], before = self.rail, (2.0 if driver.kind == "half-bridge" else 4.0) / pi * self.rail
        else:
            changes["supply_v"], before = 0.5 * self.rail, 0.5 * self.rail / 1.1 - HEADROOM
            if before < HEADROOM:
                raise _NotFeasibleError(
                    f"A linear stage between rails of {self.rail:g} V has {max(before, 0.0):.2g} V left, as it needs "
                    f"{HEADROOM:g} V to each rail. Take a higher rail or a bridge."
                )
        ratios = {group: amplitude / (before * driver.raised(group)) for group, amplitude in amplitudes.items()}
        if driver.switched:
            needed = driver.kind != "half-bridge" or any(abs(ratio - 1.0) > _LEAST_STEP for ratio in ratios.values())
        else:
            needed = any(ratio > 1.0 for ratio in ratios.values())
        least, most = _RATIOS
        for group, ratio in ratios.items() if needed else ():
            if not least <= ratio <= most:
                raise _NotFeasibleError(
                    f"Group {group.upper()} needs a transformer of 1 to {ratio:.3g} at a rail of {self.rail:g} V; the "
                    f"limits are {least:g} and {most:g}. Take another rail."
                )
            changes[f"{driver.transformer_label}_{group}.ratio"] = float(f"{ratio:.3g}")
        if needed and driver.kind in ("linear", "feedback", "half-bridge"):
            changes["transformer"] = True
        driver = driver.updated(changes)
        return driver.updated(self._windings(driver)) if needed else driver

    def _windings(self, driver: Driver) -> dict[str, float]:
        """Return magnetising inductance and resistances of the transformers on their cores, unless they are given."""
        label, found = driver.transformer_label, dict[str, float]()
        # the pins of a transducer need not keep their voltages: those behind this driver
        points = self.linear(driver) if self.ideal.motor.is_transducer else self.points
        through = part_phasors(driver, points)
        for group in self.pins:
            most = float(np.abs(through[groups.current("out", group)]).max()) / sqrt(2.0)
            most *= driver.ratio(group) if driver.kind == "push-pull" else 1.0  # of its secondary
            core = wound_transformer(driver, group, most)
            given = any(path.startswith(label) and path.endswith(".magnetizing") for path in self.spec.parts)
            if core is None and cores(driver.frequency) and not given:
                raise _NotFeasibleError(
                    f"No core of the list takes the {engineering(most, 'A')} RMS of the primary of the transformer of "
                    f"group {group.upper()}. Take less, or a higher rail."
                )
            if core is None:  # windings of the library or the user
                continue
            self.cores[group], halves = core, 2.0 if driver.kind == "push-pull" else 1.0
            values = {
                "magnetizing": min(core.inductance_h, 1.0),
                "primary_resistance": max(halves * core.winding_ohm, 1e-2),
                "secondary_resistance": max(core.winding_ohm * driver.ratio(group) ** 2, 1e-2),
            }
            for name, value in values.items():
                if not {f"{label}.{name}", f"{label}_{group}.{name}"} & self.spec.parts.keys():
                    found[f"{label}_{group}.{name}"] = float(f"{value:.3g}")
        return found

    def verified(self, draft: Design, share: float) -> Design:
        """Return the design for a share, with its steady states over the range and whether they are within limits."""
        driver = self.built(share)
        found = replace(draft, driver=driver, share=share, cores=dict(self.cores))
        if self.ideal.motor.is_transducer:
            return self.within(found, driver, self.linear(driver))
        behind = [
            replace(self.ideal, source=driver.equivalent, load=Load(None if point.state == IDLE else point.speed_rad_s))
            for point in self.points
        ]
        starts = [state.solution for state in self.states.values()]
        states = dict(zip(self.states, _solved(behind, starts), strict=True))
        if not _steady(states[IDLE]) and _steady(states[OPERATING]):
            states[IDLE] = self._unloaded(driver, states)
        lost = _lost(states, draft.wanted_v, where := "behind this driver; the voltages wanted at the pins")
        found = replace(found, behind=states[OPERATING].behind)
        if (rise := self.rise) and not lost:
            warm = warmed(behind[1], driver.equivalent, rise)
            states[WARM] = _solved([warm], starts[1:2])[0]
            lost = _lost(states, draft.wanted_v, where)
        if lost:
            return replace(found, reason=f"{lost} {_INSTEAD[driver.network]}")
        return self.within(found, driver, tuple(range_point(name, state, driver) for name, state in states.items()))

    def _unloaded(self, driver: Driver, states: Mapping[str, SteadyState]) -> SteadyState:
        """Return the state at no load of a shaft held at the speed where it takes no torque, which is easier to find.

        It is the given state if there is none.
        """
        motor, held, ideal = self.ideal.motor, replace(self.ideal, source=driver.equivalent), self.states[IDLE]
        least = ACCURACY * motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        before, speed = states[OPERATING], ideal.speed_rad_s
        for _ in range(_SECANTS):
            (last,) = _solved([replace(held, load=Load(speed=speed))], [ideal.solution])
            change = last.load_torque_n_m - before.load_torque_n_m
            if not _steady(last) or abs(last.load_torque_n_m) <= least or not change:
                break
            speed -= last.load_torque_n_m * (last.speed_rad_s - before.speed_rad_s) / change
            before = last
        return last if _steady(last) and abs(last.load_torque_n_m) <= least else states[IDLE]

    def within(self, found: Design, driver: Driver, points: tuple[RangePoint, ...]) -> Design:
        """Return the design with the points behind its driver, and whether they are within limits."""
        parts = part_loads(driver, part_phasors(driver, points))
        at = part_loads(driver, part_phasors(driver, tuple(one for one in points if one.state == OPERATING)))
        parts = tuple(_conducting(driver, part, one.peak_current_a) for part, one in zip(parts, at, strict=True))
        peaks = {group: max(point.group(group).voltage_v for point in points) for group in self.pins}
        faults = [*self._off(driver, points), *exceeded(parts, driver), *depolarised(self.ideal.motor, peaks)]
        reason = (
            " ".join([*faults, _INSTEAD[driver.network]]) if faults else self._explanation(driver, points, found.share)
        )
        return replace(found, points=points, parts=parts, feasible=not faults, reason=reason)

    @property
    def rise(self) -> float:
        """Temperature in K above cold at which the motor runs, at most that of its limit; 0 where it is not known."""
        limits = self.ideal.motor.limits
        if limits is None or self.ideal.motor.is_transducer:
            return 0.0
        rise = self.states[OPERATING].temperature_rise_k
        return min(rise, 0.5 * limits.curie_temperature_c - limits.ambient_c) if rise > 0.0 else 0.0

    def _off(self, driver: Driver, points: tuple[RangePoint, ...]) -> Iterator[str]:
        """Yield a sentence for each pin whose voltage leaves the band, a motor that brakes, an amplifier's overload."""
        wanted_a = (self.middle.motional_current_a or 0.0) if self.spec.load_range else 0.0
        for point in [point for point in points if not point.detuning] if wanted_a else ():
            if abs((flow := point.motional_current_a or 0.0) / wanted_a - 1.0) > PIN_BAND:
                yield (
                    f"At {point.state} the motional current is {engineering(flow, 'A')} instead of "
                    f"{engineering(wanted_a, 'A')}; the limit is {100.0 * PIN_BAND:.0f} %."
                )
        one = self.spec.source_ohm or self.spec.targets  # at the operating point alone
        kept = [] if wanted_a else [point for point in points if point.state == OPERATING or not one]
        for point, group in product(kept, self.pins):
            volts, wanted = point.group(group).voltage_v, abs(self.pins[group])
            if abs(volts / wanted - 1.0) > PIN_BAND:
                yield (
                    f"At {point.state} group {group.upper()} gets {volts:.4g} V instead of {wanted:.4g} V; the limit "
                    f"is {100.0 * PIN_BAND:.0f} %."
                )
        middle = next(point for point in points if point.state == OPERATING)
        spare = copysign(1.0, middle.speed_rad_s) * (middle.torque_n_m - _SPARE * self.load_torque)
        if abs(middle.speed_rad_s) > STANDS and spare < 0.0:
            rate, unit = _units(self.ideal.motor)
            yield f"At {middle.speed_rad_s:.4g} {rate} the motor gives {middle.torque_n_m:.3g} {unit}."
        for group in self.pins if driver.values("a", "amplifier") else ():
            pins = [point.group(group) for point in points]
            currents = [at_stage(driver, group, pin.voltage_v, pin.voltage_v / pin.impedance_ohm)[1] for pin in pins]
            limit, most = driver.setting("amplifier.current_limit"), max(map(abs, currents)) * driver.ratio(group)
            if most > limit:
                yield f"The amplifier of group {group.upper()} delivers {most:.3g} A; its limit is {limit:g} A."

    def _explanation(self, driver: Driver, points: tuple[RangePoint, ...], share: float) -> str:
        kept = [point for point in points if not point.detuning]
        if self.spec.load_range and (flow := self.middle.motional_current_a):
            worst = max(abs((point.motional_current_a or 0.0) / flow - 1.0) for point in kept)
            how = "The coil resonates with the capacitance across the pins: a" if self.current else "A"
            return f"{how}t any load of the range the motional current is within {100.0 * worst:.2g} % of the target."
        worst = max(
            abs(point.group(group).voltage_v / abs(self.pins[group]) - 1.0) for point in kept for group in self.pins
        )
        ends = ["At the operating point", "Under load and idle", "From stall to no load"][min(len(kept), 3) - 1]
        notes = f"{ends} the pins keep their voltages within {100.0 * worst:.2g} %"
        notes += f", and with the motor {self.rise:.3g} K warmer at a frequency that follows." if self.rise else "."
        if self.spec.source_ohm is not None:
            at = next(point for point in points if point.state == OPERATING)
            found = [driver.passed(group, at.group(group).impedance_ohm, 1.0, self.omega)[-1][1] for group in self.pins]
            seen = " and ".join(f"{one.volts / one.amperes:.3g} Ω" for one in found)
            return f"At the operating point the stage sees {seen}. {notes}"
        if self.driver.network == "inductor" and share < 1.0:
            notes += (
                f" The network cancels {100.0 * share:.0f} % of the reactance at the operating point; with more the "
                f"voltages would change by more than {100.0 * PIN_BAND:.0f} %, or the power factor fall."
            )
        return notes


def _conducting(driver: Driver, part: PartLoad, peak_a: float | None) -> PartLoad:
    """Return a transistor with RMS current and loss of its channel, which has a sine wave for half of the time."""
    if not part.name.startswith(TRANSISTOR) or driver.mosfet not in MOSFETS:
        return part
    rms = 0.5 * (peak_a or 0.0)
    return replace(part, rms_current_a=rms, loss_w=stock.ratings(driver.mosfet).on_resistance_ohm * rms**2)


def _largest(limit: float) -> float:
    """Return the largest inductance in H of the series E12, from 1 µH on, up to a limit."""
    values = (float(f"{value * 10.0**decade:.6g}") for decade in range(-6, 1) for value in stock.E12)
    return max(value for value in values if value <= limit)
