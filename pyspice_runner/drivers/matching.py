# SPDX-License-Identifier: GPL-3.0-or-later
"""The search for network, transformer and rails of a driver, checked in steady states from stall to no load.

The motor's currents at the wanted voltages of its pins, in steady states at stall, at the operating point and at no
load, tell the impedance of each group over the range. A series pair of coil and capacitor cancels a share of the
reactance at the operating point: all of it is the usual match; none is a filter that is tuned to the drive and leaves
the voltages of the pins alone. The more it cancels, the better is the power factor of the stage, and the more the
voltages of the pins change with the load. The choice is the share with the largest power factor whose voltages stay
within :data:`PIN_BAND` of those wanted. The network with values of the E series is then solved for its own steady
states over the range.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import degrees, pi, radians, sqrt
from typing import Any

from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.design import (
    IDLE,
    OPERATING,
    STALL,
    STANDS,
    WARM,
    Design,
    RangePoint,
)
from pyspice_runner.drivers.driver import BRIDGES, HEADROOM, Driver, NetworkKind
from pyspice_runner.drivers.maxima import NO_BLEEDER, NO_COIL, NO_PARALLEL, exceeded, part_loads, winding_of
from pyspice_runner.drivers.mosfets import MOSFETS, suited
from pyspice_runner.drivers.networks import NO_CAPACITOR
from pyspice_runner.drivers.state import (
    ACCURACY,
    at_stage,
    impedance,
    load_of,
    part_phasors,
    range_point,
    warmed,
)
from pyspice_runner.drivers.stock import (
    E12,
    E24,
    SMALLEST_CAPACITANCE,
    SMALLEST_INDUCTANCE,
    WINDING_CAPACITANCE,
    WINDING_QUALITY,
    largest_inductance,
    nearest,
)
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import Load, TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.strength import depolarised
from pyspice_runner.run.point import Point
from pyspice_runner.steady.shooting import Orbit
from pyspice_runner.steady.steady import SteadyState, steady_states

PIN_BAND = 0.2  # by which the voltage of a pin may differ from the wanted one, from stall to no load
_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)  # of the reactance that a series network may cancel
# reactance of a coil behind switching edges over that of the clamped capacitance, both at the drive: the third harmonic
# of a square wave, a third of its fundamental, then is 9 % at the pin
_FILTER = 0.6
# of a bleeder over the reactance of its capacitor: it takes a hundredth of the current, and an offset of the pin decays
# in 100 (1 + C of the group over C in series) / ω, a few tens of periods
BLED = 100.0
_SMALLEST = {"inductor": SMALLEST_INDUCTANCE, "llcc": 1e-5}  # H, least series coil: those of the libraries
SPIKE = 2.0  # of the transistors of a push-pull stage over their swing, by the leakage between the halves: assumed
_ROUNDS = 4  # of transformer ratio and network, each of which depends on the other
_SPARE = 0.9  # of a load torque, which a motor with pins of a somewhat lower voltage must give at least
_LEAST_STEP = 0.02  # of a ratio from 1, below which a half bridge needs no transformer
_RATIOS = (0.1, 100.0)  # of a transformer, as in its library
_DETUNED = 0.02  # of the reactance of a coil: a smaller difference needs no capacitor
_INSTEAD = {
    "none": "Take a network, --driver …+llcc, or a stage of lower resistance.",
    "inductor": "Series matching cannot follow this load. Take +llcc, lower the voltage, or control the amplitude.",
    "llcc": "Lower the voltage, or control the amplitude.",
}


@checked
def propose_matching(
    motor: Motor,
    drive: TwoPhaseDrive,
    stage: str,
    network: NetworkKind = "inductor",
    *,
    parts: Mapping[str, Any] | None = None,
    speed: float | None = None,
    load_torque: float = 0.0,
    rail: float | None = None,
    contact: ContactLaw = PAPER_LAW,
    timeout: float | None = None,
    on_driver: Callable[[Driver], object] | None = None,
) -> Design:
    """Design a driver whose pins keep their voltages from stall to no load, and check it in steady states.

    Args:
        motor: the motor.
        drive: voltages, phase and frequency wanted at the pins.
        stage: kind of the power stage, as of :class:`Driver`.
        network: ``"inductor"``, ``"llcc"`` or ``"none"``.
        parts: further values of the driver, by their names or by PART.PARAMETER, as for :meth:`.Driver.updated`; those
            of network and transformer are chosen here.
        speed: of the operating point, rad/s; by default half the speed at no load.
        load_torque: torque in N·m of the load at the operating point, and of the motor when it starts.
        rail: voltage in V between the rails of the stage, to which the transformer is fitted; by default the rails are
            as the voltage requires.
        contact: law of the contact.
        timeout: wall time in s after which a run is ended.
        on_driver: called with each driver before its steady states are solved.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    ideal = Point.of(
        motor, drive, speed=speed, load_torque=0.0 if speed is not None else load_torque, contact=contact,
        timeout=timeout, audit=False,
    )  # fmt: skip
    Load(torque=load_torque).check(motor)
    if ideal.law is None:
        raise ParameterError("A driver is designed for a motor on its rotor. Give a law of the contact, not none.")
    wanted = {group: abs(volts) for group, volts in _pins(drive).items()}
    values = {name: value for name, value in (parts or {}).items() if "." not in name}
    choose = rail is not None and stage in BRIDGES and "mosfet" not in values
    if choose:
        values["mosfet"] = MOSFETS[-1]  # of the highest voltage, until the currents are known
    template = Driver(kind=stage, network=network, frequency=drive.frequency, voltage=1.0, **values)
    template = template.updated({name: value for name, value in (parts or {}).items() if "." in name})
    states = _range(ideal)
    begun = Design(None, wanted, load_torque_n_m=load_torque)
    if told := _lost(states, wanted, "with the wanted voltages at the pins"):
        return replace(begun, reason=told)
    search = _Search(ideal, drive, template, rail, load_torque, states, choose, on_driver)
    begun = replace(begun, unmatched=search.points, reason=search.unreachable())
    if begun.reason:
        return begun
    try:
        best = search.best_share()
        found = search.verified(begun, best)
        return found if found.feasible or best == 0.0 else search.verified(begun, 0.0)
    except _NotFeasibleError as error:
        return replace(begun, reason=str(error))


class _NotFeasibleError(Exception):
    """There is no such driver; the message says why and what can be done."""


def _range(ideal: Point) -> dict[str, SteadyState]:
    """Return the steady states at stall, at the operating point and at no load with the wanted voltages at the pins."""
    held, free = replace(ideal, load=Load(speed=0.0)), replace(ideal, load=Load())
    given = ideal.load.speed is not None or ideal.load.torque != 0.0
    stall, idle, *rest = steady_states([held, free, *([ideal] if given else [])], accuracy=ACCURACY, waveforms=True)
    if not rest and idle.converged:
        middle = replace(ideal, load=Load(speed=0.5 * idle.speed_rad_s))
        rest = steady_states([middle], accuracy=ACCURACY, waveforms=True, starts=[stall.solution])
    return dict(zip((STALL, OPERATING, IDLE), (stall, *(rest or [idle]), idle), strict=True))


def _solved(points: Sequence[Point], starts: Sequence[Orbit | None], *, surely: bool) -> list[SteadyState]:
    """Return steady states behind a driver; if ``surely``, those that Newton's method does not find at once, too."""
    found = steady_states(points, accuracy=ACCURACY, waveforms=True, starts=starts)
    lost = [place for place, state in enumerate(found) if surely and not state.converged]
    again = steady_states([points[place] for place in lost], accuracy=ACCURACY, waveforms=True)
    for place, state in zip(lost, again, strict=True):
        found[place] = state
    return found


def _lost(states: Mapping[str, SteadyState], wanted: Mapping[str, float], where: str) -> str:
    """Return in a sentence at which state there is no stable steady state; an empty text if there is at all."""
    lost = [
        name for name, state in states.items() if not (state.converged and (state.stable or state.held_by_friction))
    ]
    if not lost:
        return ""
    volts = " and ".join(f"{value:.4g} V" for value in wanted.values())
    return (
        f"At {', '.join(lost)} there is no stable steady state {where} ({volts}), so that no design can be checked. "
        "Change the frequency or the voltage, and look at the motor with simulate."
    )


def _pins(drive: TwoPhaseDrive) -> dict[str, complex]:
    """Return the phasors in V that are wanted at the pins, group A at phase 0."""
    return {"a": complex(drive.voltage), "b": rect(drive.voltage_b, radians(drive.phase_deg))}


class _Search:
    """The search for a driver over the range of a motor."""

    def __init__(
        self,
        ideal: Point,
        drive: TwoPhaseDrive,
        driver: Driver,
        rail: float | None,
        load_torque: float,
        states: Mapping[str, SteadyState],
        choose: bool,
        on_driver: Callable[[Driver], object] | None,
    ) -> None:
        self.choose, self.on_driver = choose, on_driver  # whether the MOSFET is chosen, too
        self.ideal, self.driver, self.rail, self.states = ideal, driver, rail, states
        self.load_torque = load_torque
        self.points = tuple(range_point(name, state, None) for name, state in states.items())
        self.pins = _pins(drive)  # wanted phasors
        self.omega = 2.0 * pi * driver.frequency
        self.middle = next(point for point in self.points if point.state == OPERATING)

    def unreachable(self) -> str:
        """Return why the motor does not reach its operating point; an empty text if it does."""
        idle, middle = self.points[-1].speed_rad_s, self.middle
        load = self.ideal.load
        asked = load.speed if load.speed is not None else middle.speed_rad_s
        given = load.speed is not None or load.torque
        if not given or not asked or (abs(idle) > STANDS and 0.0 < asked / idle < 1.0):
            ahead = 1.0 if asked >= 0.0 else -1.0
            if load.speed is None or ahead * middle.torque_n_m >= ahead * self.load_torque:
                return ""
            return (
                f"At {asked:.4g} rad/s and {abs(self.pins['a']):.4g} V the motor gives {middle.torque_n_m:.3g} N·m, "
                f"less than the load of {self.load_torque:.3g} N·m. Raise the voltage, or ask for less."
            )
        what = f"turns at {asked:.4g} rad/s" if load.speed is not None else f"drives {load.torque:.4g} N·m"
        return (
            f"With {abs(self.pins['a']):.4g} V at the pins the motor turns at {idle:.4g} rad/s without load, and never "
            f"{what} forwards. Raise the voltage, change frequency or phase, or ask for less."
        )

    def best_share(self) -> float:
        """Return the share of the reactance to be cancelled, by the impedances of the motor at the wanted voltages.

        These change with the voltages, so that half of the band is allowed.
        """
        if self.driver.network != "inductor":
            return 0.0
        found = []
        for share in _SHARES:
            driver = self.built(share)
            changes, factors = [], []
            for point in self.points:
                real = apparent = 0.0
                for group in GROUPS:
                    load, source = impedance(point, group), driver.fundamental(group)
                    volts, amperes = at_stage(driver, group, load, 1.0)
                    changes.append(source * abs(load / volts) / abs(self.pins[group]) - 1.0)
                    real += source**2 * (amperes / volts).real
                    apparent += source**2 * abs(amperes / volts)
                factors.append(real / apparent)
            found.append((share, max(map(abs, changes)), min(factors)))
        kept = [(factor, share) for share, change, factor in found if change <= 0.5 * PIN_BAND]
        return max(kept)[1] if kept else 0.0

    def built(self, share: float) -> Driver:
        """Return the driver whose network cancels a share of the reactance at the operating point."""
        driver = self.driver
        try:
            for _ in range(_ROUNDS):
                driver = self._supplied(driver.updated(self._values(driver, share)))
                if self.choose:
                    driver = driver.updated({"mosfet": self._mosfet(driver)})
        except ParameterError as error:
            raise _NotFeasibleError(f"{error} Take another stage, rail or MOSFET.") from None
        return driver

    def _mosfet(self, driver: Driver) -> str:
        """Return the MOSFET with the least loss at the operating point."""
        volts = driver.swing("a") * (SPIKE if driver.kind == "push-pull" else 1.0)
        current = 0.0
        for group, pin in self.pins.items():
            _, through = at_stage(driver, group, pin, pin / impedance(self.middle, group))
            current = max(current, driver.ratio(group) * abs(through) / sqrt(2.0))
        return suited(volts, driver.swing("a"), current, driver.frequency) or MOSFETS[-1]

    def _values(self, driver: Driver, share: float) -> dict[str, float]:
        """Return the settings of the network."""
        if driver.network == "none":
            return {}
        prefix, omega, values = "series_" if driver.network == "llcc" else "", self.omega, {}
        for group in GROUPS:
            most = largest_inductance(driver.frequency, winding_of(driver, group) or WINDING_CAPACITANCE)
            label, leakage = f"{driver.network}_{group}", driver.leakage(group)
            wanted = -share * load_of(driver, group, impedance(self.middle, group)).imag
            filtering = driver.switched or driver.network == "llcc"
            clamped = getattr(self.ideal.motor.piezo, f"capacitance_{group}_f") + driver.cable_f(group)
            total = max(wanted, _FILTER / (omega * clamped) if filtering else 0.0) / omega
            coil = least = _SMALLEST[driver.network]
            if total - leakage > least:
                coil = min(nearest(total - leakage, E12), max(value for value in _decades(E12) if value <= most))
            excess = omega * (coil + leakage) - wanted
            capacitor = NO_CAPACITOR
            if excess > _DETUNED * omega * (coil + leakage) and excess > 0.0 and (filtering or wanted < 0.0):
                capacitor = nearest(1.0 / (omega * excess), E24)
            values[f"{label}.{prefix}inductance"] = coil
            values[f"{label}.{prefix}resistance"] = max(omega * coil / WINDING_QUALITY, 1e-2)
            values[f"{label}.{prefix}capacitance"] = capacitor
            if driver.network == "llcc":
                values |= self._across(group, most)
            isolated = capacitor != NO_CAPACITOR and values.get(f"{label}.parallel_inductance", NO_COIL) == NO_COIL
            values[f"{label}.bleeder"] = nearest(BLED / (omega * capacitor), E12) if isolated else NO_BLEEDER
        return values

    def _across(self, group: str, most: float) -> dict[str, float]:
        """Return the settings of the pair across a group, which cancels the middle of its susceptances."""
        susceptances = [(1.0 / load_of(self.driver, group, impedance(point, group))).imag for point in self.points]
        middle, omega = 0.5 * (min(susceptances) + max(susceptances)), self.omega
        coil, capacitor = NO_COIL, -middle / omega
        if middle > 0.0:
            largest = min(most, 1.0 / (omega * middle))
            coil = max(value for value in _decades(E12) if value <= largest)
            capacitor = 1.0 / (omega**2 * coil) - middle / omega
        capacitor = NO_PARALLEL if capacitor < SMALLEST_CAPACITANCE else nearest(capacitor, E24)
        label = f"llcc_{group}.parallel_"
        return {
            f"{label}inductance": coil, f"{label}capacitance": capacitor,
            f"{label}resistance": min(max(omega * coil / WINDING_QUALITY, 1e-2), 1e4),
        }  # fmt: skip

    def _supplied(self, driver: Driver) -> Driver:
        """Return the driver with the voltages of its stage and the ratios of its transformer."""
        sources = {}
        for group, volts in self.pins.items():
            sources[group], _ = at_stage(driver, group, volts, volts / impedance(self.middle, group))
        amplitudes = {group: abs(source) for group, source in sources.items()}
        changes: dict[str, Any] = {
            "voltage": amplitudes["a"], "ratio_b": amplitudes["b"] / amplitudes["a"],
            "phase_deg": degrees(phase(sources["b"] / sources["a"])),
        }  # fmt: skip
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
        if needed and driver.kind in ("linear", "half-bridge"):
            changes["transformer"] = True
        return driver.updated(changes)

    def verified(self, begun: Design, share: float) -> Design:
        """Return the design for a share, with its steady states over the range and whether they are within limits."""
        driver = self.built(share)
        if self.on_driver:
            self.on_driver(driver)
        behind = [
            replace(self.ideal, source=driver.equivalent(), load=Load(speed=point.speed_rad_s)) for point in self.points
        ]
        starts, surely = [state.solution for state in self.states.values()], share == 0.0
        found = replace(begun, driver=driver, share=share)
        states = dict(zip(self.states, _solved(behind, starts, surely=surely), strict=True))
        lost = _lost(states, begun.wanted_v, where := "behind this driver; the voltages wanted at the pins")
        if (rise := self.rise) and not lost:
            warm = warmed(behind[1], rise)
            states[WARM] = _solved([warm], starts[1:2], surely=surely)[0]
            lost = _lost(states, begun.wanted_v, where)
        if lost:
            return replace(found, reason=f"{lost} {_INSTEAD[driver.network]}")
        points = tuple(range_point(name, state, driver) for name, state in states.items())
        parts = part_loads(driver, part_phasors(driver, points))
        peaks = {group: max(point.group(group).voltage_v for point in points) for group in GROUPS}
        faults = [*self._off(driver, points), *exceeded(parts, driver), *depolarised(self.ideal.motor, peaks)]
        reason = " ".join([*faults, _INSTEAD[driver.network]]) if faults else self._told(points, share)
        return replace(found, points=points, parts=parts, feasible=not faults, reason=reason)

    @property
    def rise(self) -> float:
        """Temperature in K above cold at which the motor runs, at most that of its limit; 0 where it is not known."""
        limits = self.ideal.motor.limits
        if limits is None:
            return 0.0
        rise = self.states[OPERATING].temperature_rise_k
        return min(rise, 0.5 * limits.curie_temperature_c - limits.ambient_c) if rise > 0.0 else 0.0

    def _off(self, driver: Driver, points: tuple[RangePoint, ...]) -> list[str]:
        """Return a sentence for each pin whose voltage leaves the band, and for a motor that brakes."""
        told = []
        for point in points:
            for group in GROUPS:
                volts, wanted = point.group(group).voltage_v, abs(self.pins[group])
                if abs(volts / wanted - 1.0) > PIN_BAND:
                    told.append(
                        f"At {point.state} group {group.upper()} gets {volts:.4g} V instead of {wanted:.4g} V; the "
                        f"limit is {100.0 * PIN_BAND:.0f} %."
                    )
        middle = next(point for point in points if point.state == OPERATING)
        ahead, load = 1.0 if middle.speed_rad_s > 0.0 else -1.0, _SPARE * self.load_torque
        if abs(middle.speed_rad_s) > STANDS and ahead * middle.torque_n_m < ahead * load:
            told.append(f"At {middle.speed_rad_s:.4g} rad/s the motor gives {middle.torque_n_m:.3g} N·m.")
        return [*told, *_overdriven(driver, points)]

    def _told(self, points: tuple[RangePoint, ...], share: float) -> str:
        """Return the explanation of a feasible network."""
        worst = max(
            abs(point.group(group).voltage_v / abs(self.pins[group]) - 1.0) for point in points for group in GROUPS
        )
        told = f"From stall to no load the pins keep their voltages within {100.0 * worst:.2g} %"
        told += f", and with the motor {self.rise:.3g} K warmer at a frequency that follows." if self.rise else "."
        if self.driver.network == "inductor" and share == 0.0 and not self.driver.switched:
            told += (
                f" No series network is proposed: the voltages would change by more than {100.0 * PIN_BAND:.0f} %, or "
                "the power factor fall. An LLCC filter can raise it."
            )
        elif self.driver.network == "inductor" and share < 1.0:
            told += (
                f" The network cancels {100.0 * share:.0f} % of the reactance at the operating point; with more the "
                f"voltages would change by more than {100.0 * PIN_BAND:.0f} %, or the power factor fall."
            )
        return told


def _overdriven(driver: Driver, points: tuple[RangePoint, ...]) -> list[str]:
    """Return a sentence for each linear amplifier whose current exceeds its limit."""
    told = []
    for group in GROUPS if driver.kind == "linear" else ():
        limit, most = driver.setting("amplifier.current_limit"), 0.0
        for point in points:
            volts = point.group(group).voltage_v
            _, through = at_stage(driver, group, volts, volts / impedance(point, group))
            most = max(most, abs(through) * driver.ratio(group))
        if most > limit:
            told.append(f"The amplifier of group {group.upper()} delivers {most:.3g} A; its limit is {limit:g} A.")
    return told


def _decades(series: tuple[float, ...]) -> list[float]:
    """Return the values of a series from 1 µH on."""
    return [float(f"{value * 10.0**decade:.6g}") for decade in range(-6, 1) for value in series]
