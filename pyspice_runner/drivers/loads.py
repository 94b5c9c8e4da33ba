# SPDX-License-Identifier: GPL-3.0-or-later
"""What the parts of a driver and the groups of a motor must withstand, how a bridge switches, and events of a run.

Maxima are over a whole run, from power-up on. The leg of a bridge commutates in the dead time: the current of its
output charges the output capacitances of both transistors. The channel of one that turns on discharges the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain
from math import pi, radians
from typing import Any

import numpy as np
from pydantic import PrivateAttr
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.source import Pins
from pyspice_runner.circuit.state import Motion
from pyspice_runner.drivers.driver import BRIDGES, RAILS, Driver, Part, add_driver, control_amplitude
from pyspice_runner.drivers.parts import CABLE, FEWEST_TIMES, MOSFETS, NO_CAPACITOR, largest_inductance, ratings
from pyspice_runner.drivers.ratings import TRANSFORMER, TRANSISTOR, PartLoad, judged, rating_notes
from pyspice_runner.errors import SimulationError
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Load
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.strength import depolarised, electrode_distance
from pyspice_runner.result import grouped
from pyspice_runner.run.point import Point
from pyspice_runner.run.window import Array, Window
from pyspice_runner.units import engineering

Samples = Mapping[str, Array]  # by the names of their vectors
LEAST_COIL = 1e-6  # H in series, which stands for none
NO_BLEEDER = 1e12  # Ω across it, which stands for none
NO_COIL = 1.0  # H across a group, which stands for none
_DRAINS = {  # sources in the libraries of the bridges that carry the currents into the drains
    "half-bridge": ("high", "low"), "full-bridge": ("ph", "pl", "nh", "nl"), "push-pull": ("drain_p", "drain_n"),
}  # fmt: skip
_LOSSES = {  # in the libraries → first words of the name of a part
    "winding": "series coil", "series": "series coil", "parallel": "parallel coil", "bleeder": "bleeder",
    "primary": TRANSFORMER, "secondary": TRANSFORMER, "conductors": "cable inductance",
    **dict.fromkeys(("high", "low", "ph", "pl", "nh", "nl", "p", "n"), TRANSISTOR),
}  # fmt: skip
NO_PARALLEL = 1e-12  # F across a group, which stands for none


def load_vectors(driver: Driver) -> Iterator[str]:
    """Yield the vectors that :func:`part_loads` and :func:`turn_ons` take, beside those of stages and pins."""
    for group in driver.groups:
        for part, before, _ in _behind(driver, group):
            yield f"v({before})"
            if part.label == CABLE:
                yield f"i(v.xcable_{group}.vcurrent)"
        yield from chain.from_iterable(_drains(driver, group))
        if driver.network != "none":
            yield f"v(xnetwork_{group}.inner)"
            places = ("current", "coil", *(["parallel"] if driver.network == "llcc" else []))
            yield from (f"i(v.xnetwork_{group}.v{place})" for place in places)
    yield from (name for switch in _switches(driver) for name in (switch.ramp, switch.voltage, switch.current))


def part_loads(driver: Driver, samples: Samples, measure: Measure | None = None) -> tuple[PartLoad, ...]:
    """Return the parts of both groups, from the supply to the pin, with the maxima over a run, or another measure."""
    found, measure = list[PartLoad](), measure or _peak
    for group in driver.groups:
        of_group = [*_of_stage(driver, group, samples, measure)]
        for part, before, after in _behind(driver, group):
            of_group += _of_part(part, samples[f"v({before})"], samples[f"v({after})"], samples, measure)
        found += [replace(load, group=group) for load in of_group]
    return tuple(found)


def settled_parts(
    driver: Driver, samples: Samples, window: Window, losses: Mapping[str, float]
) -> tuple[PartLoad, ...]:
    """Return the parts with RMS values, ripple and losses in a window; ``losses`` in W come from a balance."""

    def ripple(values: Array) -> float:
        return float(np.ptp(window.cut(values)[window.time >= window.time[-1] - window.period]))

    found, several = [], (part_loads(driver, samples, measure) for measure in (_peak, window.rms, ripple))
    for peak, rms, swing in zip(*several, strict=True):
        volts, amperes, transistor = rms.peak_voltage_v, rms.peak_current_a, peak.name.startswith(TRANSISTOR)
        lost = [
            loss for path, loss in losses.items() if f"_{peak.group}." in path and not path.startswith("driver")
            and peak.name.startswith(_LOSSES.get(path.partition(".")[2], "?"))
        ]  # fmt: skip
        found.append(replace(
            peak, rms_voltage_v=None if transistor else volts, rms_current_a=amperes,
            apparent_power_va=None if transistor or volts is None or amperes is None else volts * amperes,
            ripple_v=swing.peak_voltage_v if peak.unit == "F" else None,
            primary_rms_voltage_v=rms.primary_peak_voltage_v, primary_rms_current_a=rms.primary_peak_current_a,
            loss_w=(max(lost) if transistor else sum(lost)) if lost else None,
        ))  # fmt: skip
    return tuple(judged(driver, part) for part in found)


def _behind(driver: Driver, group: str) -> list[tuple[Part, str, str]]:
    """Return the parts behind the stage of a group, each with the nodes in front of it and behind it."""
    parts = list(driver.parts(group))[0 if driver.kind == "ideal" else 1 :]
    nodes = [groups.named("line", group), *(groups.named(part.label, group) for part in parts[:-1]), group]
    return list(zip(parts, nodes, nodes[1:], strict=False))


def _drains(driver: Driver, group: str) -> tuple[list[str], list[str]]:
    """Return the vectors of the drains of a bridge: currents, and voltages that are not held between the rails."""
    legs, stage = _DRAINS.get(driver.kind, ()), groups.named("xstage", group)
    volts = [f"v({stage}.{leg})" for leg in legs] if driver.kind == "push-pull" else []
    return [f"i(v.{stage}.v{leg})" for leg in legs], volts


Measure = Callable[[Array], float]


def _peak(values: Array) -> float:
    return float(np.abs(values).max())


def _of_part(part: Part, before: Array, after: Array, samples: Samples, measure: Measure) -> Iterator[PartLoad]:
    """Yield the values of a part behind the stage of a group, between two voltages."""
    group, of_group = part.group, f"group {part.group.upper()}"
    if part.label == "transformer":
        places = (f"i(v.xnetwork_{group}.vcurrent)", f"i(v.xcable_{group}.vcurrent)", groups.current("pin", group))
        secondary = next(samples[name] for name in places if name in samples)
        primary = before - samples.get(groups.voltage("return", group), 0.0)
        yield PartLoad(
            f"{TRANSFORMER}, {of_group}, turns secondary to primary", part.values["ratio"], "1", measure(after),
            measure(secondary), primary_peak_voltage_v=measure(primary),
            primary_peak_current_a=measure(samples[groups.current("out", group)]),
        )  # fmt: skip
        yield from _winding(part, measure(after))
    elif part.label == CABLE:
        through = measure(samples[f"i(v.xcable_{group}.vcurrent)"])
        yield PartLoad(
            f"cable inductance, {of_group}", part.values["inductance"], "H", measure(before - after), through
        )
        yield PartLoad(f"cable capacitance, {of_group}", part.values["capacitance"], "F", measure(after), None)
    else:
        yield from _of_network(part, before, after, samples, measure)


def _of_stage(driver: Driver, group: str, samples: Samples, measure: Measure) -> Iterator[PartLoad]:
    of_group = f"group {group.upper()}"
    for rail, volts in zip(RAILS, driver.rails(group), strict=True):
        current = groups.current(rail, group)
        if current in samples and volts:
            yield PartLoad(f"supply {rail}, {of_group}", volts, "V", abs(volts), measure(samples[current]))
    if driver.kind in BRIDGES:
        borne_v, current_a = driver.swing(group), measure(samples[groups.current("out", group)])
        # beside the current of the output, a transistor withstands the reverse current of the diode that it commutates
        currents, voltages = ([measure(samples[name]) for name in names if name in samples] for names in
                              _drains(driver, group))  # fmt: skip
        if driver.kind == "push-pull":
            name = f"{TRANSFORMER}, {of_group}, turns secondary to a half of the primary"
            turns, line_v = driver.ratio(group), measure(samples[groups.voltage("line", group)])
            half_v, half_a = line_v / turns, max(currents or [turns * current_a])
            yield PartLoad(
                name, turns, "1", line_v, current_a, primary_peak_voltage_v=half_v, primary_peak_current_a=half_a
            )
            yield from _winding(driver.parts(group)[0], line_v)
            current_a *= turns
        name = f"{TRANSISTOR} {driver.mosfet.rpartition(':')[2]}, {of_group}"
        peaks = max([borne_v, *voltages]), max(currents or [current_a])
        yield PartLoad(name, BRIDGES[driver.kind], "1", *peaks)
        dead_time = driver.setting(f"bridge_{group}.dead_time")
        yield PartLoad(f"dead time, {of_group}", dead_time, "s", None, None)


def _winding(part: Part, volts: float) -> Iterator[PartLoad]:
    """Yield the capacitance of a transformer's winding, if it is stated."""
    if capacitance := part.values["winding_capacitance"]:
        name = f"{TRANSFORMER}, group {part.group.upper()}, winding capacitance"
        yield PartLoad(name, capacitance, "F", volts, None)


def _of_network(part: Part, before: Array, after: Array, samples: Samples, measure: Measure) -> list[PartLoad]:
    values, llcc, group = part.values, part.label == "llcc", part.group
    prefix, instance = "series_" if llcc else "", groups.named("xnetwork", group)
    inner, through = samples[f"v({instance}.inner)"], samples[f"i(v.{instance}.vcurrent)"]
    coil, capacitor, bleeder = values[f"{prefix}inductance"], values[f"{prefix}capacitance"], values["bleeder"]
    # name, value, unit, voltage, current, and whether it is there
    rows = [
        ("series coil", coil, "H", before - inner, samples[f"i(v.{instance}.vcoil)"], coil > LEAST_COIL),
        ("series capacitor", capacitor, "F", inner - after, through, capacitor != NO_CAPACITOR),
        ("bleeder", bleeder, "Ω", inner - after, (inner - after) / bleeder, bleeder != NO_BLEEDER),
    ]
    if llcc:
        across = samples[f"i(v.{instance}.vparallel)"]
        drawn = samples.get(f"i(v.xcable_{group}.vcurrent)", samples[groups.current("pin", group)])
        coil, capacitor = values["parallel_inductance"], values["parallel_capacitance"]
        rows += [
            ("parallel coil", coil, "H", after, across, coil != NO_COIL),
            ("parallel capacitor", capacitor, "F", after, through - drawn - across, capacitor != NO_PARALLEL),
        ]
    return [
        PartLoad(f"{name}, group {group.upper()}", value, unit, measure(volts), measure(amperes))
        for name, value, unit, volts, amperes, present in rows
        if present
    ]


def maxima(
    motor: Motor, driver: Driver, samples: Samples, at: Sequence[PartLoad] = (), later: Samples | None = None
) -> dict[str, Any]:
    """Return the maxima of pins, stages and parts over a run and when the pins had theirs, JSON-ready.

    ``later`` are samples of the settled state, if it is another run: a time is ``None`` if the maximum is there. ``at``
    are the parts in that state. ``exceeded`` has a sentence for each limit of a part that is exceeded. The field of a
    group is its largest voltage over the distance of its electrodes; ``None`` where that is not known.
    """
    found: dict[str, Any] = {}
    runs = [samples, later] if later else [samples]
    for group in driver.groups:
        names = f"v({group})", groups.current("pin", group), groups.current("out", group)
        volts, amperes, of_stage = (max(_peak(run[name]) for run in runs) for name in names)
        own, distance = np.abs(samples[names[0]]), electrode_distance(motor, group)
        at_s = float(samples["time"][own.argmax()]) if own.max() == volts else None
        found |= {
            groups.column("voltage", group, "v"): volts,
            groups.column("voltage", group, "at_s"): at_s,
            groups.column("current", group, "a"): amperes,
            groups.column("field", group, "v_per_m"): None if distance is None else volts / distance,
            groups.column("stage_current", group, "a"): of_stage,
        }
    settled, several = {part.name: part for part in at}, zip(*(part_loads(driver, run) for run in runs), strict=True)
    most = (part.largest(others) for part, *others in several)
    loads = tuple(judged(driver, part.settled(settled.get(part.name, part))) for part in most)
    found["parts"] = [load.__dict__ for load in loads]
    found["exceeded"] = exceeded(loads, driver)
    return found


def exceeded(parts: Sequence[PartLoad], driver: Driver) -> list[str]:
    """Return one sentence for each limit of a coil or capacitor that is exceeded, and for the MOSFETs."""
    frequency = driver.frequency
    notes = rating_notes(driver, parts)
    notes += [
        f"Leakage and winding capacitance of the {TRANSFORMER} of group {group.upper()} resonate at "
        f"{engineering(resonance, 'Hz')}; the limit is {engineering(FEWEST_TIMES * frequency, 'Hz')}."
        for group in driver.groups
        if (resonance := driver.transformer_resonance(group)) < FEWEST_TIMES * frequency
    ]
    for part in parts:
        if part.unit in ("H", "F") and not part.name.startswith((CABLE, TRANSFORMER)):
            winding = [driver.winding(part.group)] if part.name.startswith("series") else []
            notes += part.beyond(largest_inductance(frequency, *winding))
    return notes


LIMITED = 0.01  # of the time; a limit that is reached for longer is exceeded
SHORT_OF = 0.1  # of the wanted voltage, by which less is a caution: a tenth of the amplitude is a fifth of the power


def limited(driver: Driver, samples: Samples, begin_s: float) -> dict[str, dict[str, float]]:
    """Return group → limit of its stage → share of the time from ``begin_s`` on in which it is reached."""
    time = samples["time"]
    later = time >= (begin_s if begin_s < time[-1] else time[0])
    return {
        group: {
            name: float(np.trapezoid(samples[part.power_vector("limit", name)][later], time[later]))
            / float(np.ptp(time[later]))
            for part in driver.parts(group)
            for name, _ in part.library.limits
        }
        for group in driver.groups
    }


def stage_notes(driver: Driver, delivered: Mapping[str, Mapping[str, Any]], *, pins: bool = True) -> list[str]:
    """Return one sentence for each limit of a stage that is reached for more than :data:`LIMITED` of the time.

    With ``pins`` also for each group that gets less than its wanted voltage, by more than :data:`SHORT_OF`.
    """
    notes = [
        f"The {part.label} of group {group.upper()} is at a limit for {100.0 * share:.3g} % of the time: {meaning}."
        for group in driver.groups
        for part in driver.parts(group)
        for name, meaning in part.library.limits
        if (share := delivered[group]["limited"][name]) > LIMITED
    ]
    for group, found in delivered.items() if pins else ():
        got, wanted, most = found["got_v"], found["wanted_v"], driver.reachable(group)
        high, low = driver.rails(group)
        why = "The difference is in the impedance of the stage and the parts behind it."
        if most < wanted:
            why = f"{high - low:.4g} V between the rails are enough for {most:.4g} V. Raise supply_v."
        elif max(found["limited"].values(), default=0.0) > LIMITED:
            why = "The stage is at a limit. Raise it, or lower the voltage."
        if got < (1.0 - SHORT_OF) * wanted:
            notes.append(
                f"The {found['place']} of group {group.upper()} has {got:.4g} V, {100.0 * got / wanted:.3g} % of the "
                f"{wanted:.4g} V wanted. {why}"
            )
    return notes


ON, OFF = 0.8, 0.6  # V, of the ramp of a leg at which a gate rises and falls through half its voltage, in the libraries
ZERO = 0.05  # of the rails, voltage left below which a transistor turns on without voltage: 0.3 % of the energy


@dataclass(frozen=True)
class TurnOn:
    """The turn-on of one transistor, means over the edges of the last periods."""

    transistor: str  # group and device, as in the losses: ``a.high``, ``b.pl``
    zero_voltage: bool  # whether hardly any voltage is left
    voltage_left_v: float  # across the transistor when it turns on
    current_a: float  # of the leg when the other transistor turns off; positive where it helps
    charge_c: float | None  # to be moved over the whole swing; ``None`` for a MOSFET of the user's own
    dead_time_s: float | None  # in which that current moves the charge; ``None`` where it does not, or is not known
    hard_switching_w: float | None  # loss in the channel by the voltage that is left


@dataclass(frozen=True)
class _Switch:
    """One transistor and the one that turns off before it turns on."""

    name: str  # group and device
    ramp: str  # vector of the delayed control
    rising: bool  # whether it turns on where the ramp rises
    voltage: str  # vector of the output of its leg, or of its drain
    top: float | None  # V, the rail from which the voltage across it is counted down; ``None``: up from ``bottom``
    bottom: float  # V
    current: str  # vector of the current that the other transistor carries, or of the output
    helping: float  # sign of that current where it moves the leg towards this transistor


def _switches(driver: Driver) -> Iterator[_Switch]:
    """Yield the transistors of the bridges of both groups; none for another stage."""
    for group in driver.groups if driver.kind in BRIDGES else ():
        stage, (top, bottom) = groups.named("xstage", group), driver.rails(group)
        if driver.kind == "push-pull":
            for own, other in ("pn", "np"):
                drain, current = f"v({stage}.drain_{own})", f"i(v.{stage}.vdrain_{other})"
                yield _Switch(f"{group}.{own}", f"v({stage}.ramp)", own == "p", drain, None, 0.0, current, 1.0)
            continue
        out, line, back = groups.current("out", group), groups.voltage("line", group), groups.voltage("return", group)
        if driver.kind == "half-bridge":
            legs = [(f"v({stage}.ramp)", line, 1.0, "high", "low")]
        else:
            legs = [(f"v({stage}.ramp_p)", line, 1.0, "ph", "pl"), (f"v({stage}.ramp_n)", back, -1.0, "nh", "nl")]
        for ramp, voltage, sign, high, low in legs:
            yield _Switch(f"{group}.{high}", ramp, True, voltage, top, bottom, out, -sign)
            yield _Switch(f"{group}.{low}", ramp, False, voltage, None, bottom, out, sign)


def turn_ons(driver: Driver, samples: Samples, window: Window) -> tuple[TurnOn, ...]:
    """Return the turn-ons of all transistors of a bridge, means over the window; none for another stage."""
    found, time = [], samples["time"]
    part = ratings(driver.mosfet) if driver.mosfet in MOSFETS else None
    for switch in _switches(driver):
        ramp = samples[switch.ramp] * (1.0 if switch.rising else -1.0)
        offs, ons = (_crossings(time, ramp, level) for level in (-OFF, ON))
        places = np.searchsorted(offs, ons) - 1  # of the turn-off of the other transistor before each turn-on
        offs, ons = offs[places[places >= 0]], ons[places >= 0]
        late = offs >= window.start
        if not late.any():
            continue
        volts = np.interp(ons[late], time, samples[switch.voltage])
        left = float(np.mean(volts - switch.bottom if switch.top is None else switch.top - volts))
        current = switch.helping * float(np.mean(np.interp(offs[late], time, samples[switch.current])))
        swing = driver.swing(switch.name[0])  # of its group
        charge = part.swing_charge(swing) if part else None
        found.append(
            TurnOn(
                switch.name, left <= ZERO * swing, left, current, charge,
                dead_time_s=charge / current if charge is not None and current > 0.0 else None,
                hard_switching_w=driver.frequency * part.swing_loss(left, swing) if part else None,
            )
        )  # fmt: skip
    return tuple(found)


def _crossings(time: Array, values: Array, level: float) -> Array:
    """Return the times at which a signal rises through a level."""
    before = np.flatnonzero((values[:-1] < level) & (values[1:] >= level))
    share = (level - values[before]) / (values[before + 1] - values[before])
    return np.asarray(time[before] + share * (time[before + 1] - time[before]))


AT_ONCE = 20e-6  # s, in which the supply rises where the motor moves from the beginning
_EDGE = 1e-6  # s, in which a load steps and a control stops


@dataclass(frozen=True)
class Events:
    """What happens in a run; each event may be left out."""

    load_at: float | None = None  # s, when the load steps
    load_torque: float = 0.0  # N·m, that it draws from then on
    stop_at: float | None = None  # s, when the controls stop: the gates of a bridge, the input of an amplifier
    first: float | None = None  # Hz, at which the frequency begins to sweep; ``None``: it stays
    rate: float = 0.0  # Hz/s, of the sweep
    control_at: float | None = None  # s, when the controls, which are no sines then, step to their voltages
    controls: Mapping[str, float] = field(default_factory=dict)  # group → V
    tool: Sequence[tuple[float, float]] = ()  # times in s and resistances in N·s/m of the load of a transducer


class EventfulDriver(Driver):
    """A driver with events in its run."""

    _events: Events = PrivateAttr()

    def __init__(self, driver: Driver, events: Events) -> None:
        super().__init__(**driver.model_dump())
        self._events = events

    @property
    def uniform(self) -> bool:
        """Whether a run has uniform steps; the events shorten them."""
        return False

    @property
    def pins(self) -> tuple[str, ...]:
        """The pin of the load of a transducer, if it steps."""
        return ("tool",) if self._events.tool else ()

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add driver, controls and the step of the load."""
        events = self._events
        add_driver(circuit, self, dict(zip(self.groups, pins, strict=True)), source=False)
        begins = self.frequency if events.first is None else events.first
        on = "1"
        if events.stop_at is not None:
            on = "V(on)"
            circuit.V("on", "on", circuit.gnd, f"PWL(0 1 {events.stop_at!r} 1 {events.stop_at + _EDGE!r} 0)")
        if events.tool:
            circuit.V("tool", "tool", circuit.gnd, f"PWL({' '.join(f'{at!r} {ohms!r}' for at, ohms in events.tool)})")
        for group in self.groups:
            turned = radians(self.phase_deg) if group == "b" else 0.0
            angle = f"{2.0 * pi!r}*({begins!r}+{0.5 * events.rate!r}*time)*time+{turned!r}"
            control = f"{control_amplitude(self, group)!r}*{on}*sin({angle})"
            if events.control_at is not None:
                control = f"{events.controls.get(group, 0.0)!r}*u(time-{events.control_at!r})"
            circuit.raw_spice += f"Bcontrol_{group} control_{group} 0 V={control}\n"
        if events.load_at is not None:
            step = f"PWL(0 0 {events.load_at!r} 0 {events.load_at + _EDGE!r} {events.load_torque!r})"
            circuit.I("step", "shaft", circuit.gnd, step)


LOAD_STEP, LOAD_OFF, STOP, SWEEP = "load step", "load off", "stop", "frequency sweep"
SWEPT = 0.05  # of the frequency to both sides, that a sweep covers: about that in which a tracker searches
_IDLE_PERIODS = 40  # of a transducer, whose network settles, before its load steps; twice as many after it is gone
_BUILT_UP = 3.0  # decay times of a mode under its load, after which its amplitude is within 5 %
_BEGIN, _LASTS, _SWEEPS = 1e-3, 0.5e-3, 2e-3  # s: power-up, each event, a sweep


def driver_events(
    setup: Point, driver: Driver, vectors: Sequence[str], idle: tuple[Motor, Driver, Motion] | None = None,
    share: float = SWEPT, moving: tuple[Driver, Motion] | None = None,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Return the maxima of a run, as :func:`.maxima`, for each event, from the vectors that it takes.

    The load steps from nothing to its torque, or to the friction torque under the preload, which stalls the motor. A
    held shaft has no step. A transducer steps from the load of ``idle``, in its steady state there, to its own, and
    back. The sweep covers a ``share`` of the frequency to both sides, from what is ``moving``, by default from rest.
    Raise SimulationError if ngspice fails or its result cannot be trusted.
    """
    motor = setup.motor
    steps = setup.load.speed is None and not motor.is_transducer
    torque = setup.load.torque
    if steps and not torque:
        torque = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    stops = _BEGIN + (_LASTS if steps else 0.0)
    tool, start, charged = list[tuple[float, float]](), None, driver
    if idle:  # on until the mode has settled under the load, then off
        begin, (light, charged, start) = _IDLE_PERIODS * driver.period, idle
        off = begin + max(_BUILT_UP * motor.loaded_stator.decay_s, _IDLE_PERIODS * driver.period)
        stops = off + 2.0 * _IDLE_PERIODS * driver.period
        ohms = light.load_resistance_n_s_per_m, motor.load_resistance_n_s_per_m
        tool = [(0.0, ohms[0]), (begin, ohms[0]), (begin + _EDGE, ohms[1]), (off, ohms[1]), (off + _EDGE, ohms[0])]
    low, motion = moving or (driver, None)
    if moving:
        driver, charged, low = (one.updated({"supply_rise_s": AT_ONCE}) for one in (driver, charged, low))
    stopped = EventfulDriver(charged, Events(_BEGIN if steps else None, torque, stops, tool=tool))
    first = (1.0 - share) * driver.frequency
    swept = EventfulDriver(
        low.updated({"frequency": driver.frequency}), Events(first=first, rate=2.0 * share * driver.frequency / _SWEEPS)
    )
    load = Load() if steps else setup.load
    runs = [(replace(setup, source=stopped, load=load), stops + _LASTS), (replace(setup, source=swept), _SWEEPS)]
    with ThreadPoolExecutor() as pool:
        starts = (start, motion)
        one, other = pool.map(lambda run, at: run[0].run(run[1], vectors, start=at).vectors(), runs, starts)
    windows = [(LOAD_STEP, one, _BEGIN, stops)] if steps else []
    windows += [(LOAD_STEP, one, begin, off), (LOAD_OFF, one, off, stops)] if idle else []
    windows += [(STOP, one, stops, np.inf), (SWEEP, other, 0.0, np.inf)]
    found = {}
    for name, samples, begin, end in windows:
        within = (samples["time"] >= begin) & (samples["time"] <= end)
        cut = {vector: values[within] for vector, values in samples.items()}
        found[name] = maxima(motor, driver, cut)
        shares = limited(driver, cut, driver.supply_rise_s)
        notes = stage_notes(driver, {group: {"limited": shares[group]} for group in driver.groups}, pins=False)
        found[name]["exceeded"] += notes
    return found


# of the transit time: none, and the largest ratio of maximum to typical recovered charge in the data sheets of the
# built-in MOSFETs, 1.4 to 0.6 µC (IRF610)
RECOVERY = (0.0, 2.3)


def recovery_peaks(
    setup: Point, driver: Driver, vectors: Sequence[str], samples: Samples
) -> dict[str, tuple[float, float]]:
    """Return transistor or supply → smallest and largest peak current in A at power-up by the recovery of body diodes.

    Two further runs pass the largest current of the first one. Empty for other stages, and where ngspice fails.
    """
    drains = [name for group in driver.groups for name in _drains(driver, group)[0]]
    if not drains:
        return {}
    last = max(float(samples["time"][np.abs(samples[name]).argmax()]) for name in drains) + driver.period
    runs = [replace(setup, source=driver.recovering(factor)) for factor in RECOVERY]
    try:
        with ThreadPoolExecutor() as pool:
            several = [samples, *pool.map(lambda run: run.run(last, vectors).vectors(), runs)]
    except SimulationError:  # the first run stays valid, without a range
        return {}
    found: dict[str, list[float]] = {}
    for part in chain.from_iterable(part_loads(driver, one) for one in several):
        if part.name.startswith((TRANSISTOR, "supply")):
            found.setdefault(part.name, []).append(part.peak_current_a or 0.0)
    return {name: (min(peaks), max(peaks)) for name, peaks in found.items()}


def event_cautions(setup: Point, events: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return a sentence for each limit of a part or of the ceramic that events exceed, with the worst value."""
    faults = []
    for found in events.values():
        peaks = {group: float(found[groups.column("voltage", group, "v")]) for group in setup.motor.groups}
        faults.append((*found["exceeded"], *depolarised(setup.motor, peaks)))
    return [f"During {note}" for note in grouped([(), *faults], ["", *events])]
