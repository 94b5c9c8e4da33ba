# SPDX-License-Identifier: GPL-3.0-or-later
"""Drive electronics as PySpice circuits: control source, power stage and network of both groups, in front of a motor.

    control --> power stage (--> transformer) --> network --> group

The parts are the libraries ``behavioral/driver_*.lib``. Their parameters, with unit, default and range, are in the
headers of the libraries; :attr:`Driver.settings` names them as ``PART.PARAMETER``. The power stage, or
the MOSFETs of a bridge, may be a subcircuit of the user's own (:mod:`.own_device`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise
from math import asin, inf, log, pi, sqrt
from typing import Any, Literal, NamedTuple, Self, get_args

from pydantic import Field, PrivateAttr
from PySpice.Spice.Netlist import Circuit, Netlist

from pyspice_runner.circuit.evaluated import Derived, powers_of
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import instantiate
from pyspice_runner.circuit.source import GROUPS, UNIFORM_POINTS, Pins, Source, transient_options
from pyspice_runner.drivers.own_device import DRIVEN, MOSFET, is_reference, read_driver, read_mosfet
from pyspice_runner.drivers.parts import CABLE, MOSFETS, WINDING_CAPACITANCE, Passed, passed, ratings
from pyspice_runner.errors import ParameterError, did_you_mean, located, require
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import two_phasors
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import quantity
from pyspice_runner.motor.refusal import Stated, quoted
from pyspice_runner.spice.library import Library, LibraryParameter, check_parameters, definitions, number, read_library

DriverKind = Literal["ideal", "linear", "feedback", "half-bridge", "full-bridge", "push-pull"]
NetworkKind = Literal["none", "inductor", "llcc"]

RAILS = ("vp", "vn")  # supply pins
BRIDGES = {"half-bridge": 2, "full-bridge": 4, "push-pull": 2}  # stages that switch, with their transistors
RATED = ("drain_a", "drain_pulsed_a", "junction_case_k_per_w", "case_ambient_k_per_w", "junction_c")  # of a MOSFET
_TRANSIT = re.compile(r"\bTT\s*=\s*([\w.+-]+)", re.I)  # time of the body diode, in a model
IRF610 = "IRF610"  # the MOSFET of a bridge by default
START = "start_"  # of the names of parameters for the state at the start, which are no settings
MOST_VOLTAGE = 1000.0  # V, amplitude of a stage
HEADROOM = 3.0  # V between an amplifier's output and its rails, if it does not state another one
LARGEST_DEAD_TIME = 0.2  # of a period; with a quarter the transistors do not conduct at all
LARGEST_GATE_EDGE = 0.125  # of the dead time; a longer edge would begin before the comparator switches
_OWN = "driver"  # label of the user's own stage


# At switching edges ngspice chooses the steps. With its default tolerances they fall to a picosecond and less where the
# reverse current of a body diode breaks off, and the run ends with "Timestep too small". An error of 3e-15 C (reltol
# times chgtol) is nothing against the nanocoulombs of a gate. 0.3 µA (trtol times abstol) in a capacitance are 30 µW at
# 100 V; with 7 µA some losses were 8 % off. docs/limits.md has measurements.
SWITCHED_POINTS = 250  # steps in a period of the fastest motion, at least; ngspice takes more at the edges
SWITCHED_OPTIONS = {
    "reltol": "1e-4", "vntol": "1e-5", "abstol": "1e-7", "chgtol": "3e-11", "trtol": "3", "method": "trap"
}  # fmt: skip
# steps in a period of what rings with leakage or coils: its phase depends on the steps that ngspice chooses after an
# edge. docs/steady_state.md has what that does to Newton's method
RINGING_POINTS = 50


_SERIES = {"inductor": ("inductance", "resistance"), "llcc": ("series_inductance", "series_resistance")}  # of networks


DELAY = "start_delay"  # first part of parameters of a bridge: the control charges a capacitance to 1 V of its sign
COMPARATOR_V = 1e-3  # control at which the comparators of bridges are at their limits
TURN_ON = log(10.0) / log(8.0)  # dead times from a comparator to half the voltage of a gate, see driver_half_bridge.lib
BEFORE_TURN_ON = 2.0  # gate edges between the last corner of a pulse and that
RESTART_S = 3e-10  # s, between two corners; behind 25 ps steps can fall to where round-off rules, and the run ends


class Delay(NamedTuple):
    """A delay of a bridge: the sign of the control and the level that its comparator compares."""

    sign: float
    level: float

    def edges(self, ahead: float) -> tuple[float, float]:
        """Return the phases of group A's control at which the control, ``ahead`` of it, passes the level up and down.

        All are in periods.
        """
        rise = 0.5 * (self.sign < 0.0) + asin(self.level) / (2.0 * pi) - ahead
        return rise, rise + 0.5 - asin(self.level) / pi


@dataclass(frozen=True)
class Part:
    """One instance in the chain of one group."""

    instance: str  # name of the instance, without the X
    label: str  # the name of its parameters and losses: ``amplifier``, ``bridge``, ``transformer``, ..
    group: str  # ``"a"`` or ``"b"``
    library: Library  # its subcircuit
    values: dict[str, float]  # every parameter of the subcircuit

    def power_vector(self, kind: str, name: str) -> str:
        """Return the vector of a ``loss``, ``feed`` (1 V = 1 W), ``store`` (1 V = 1 µJ) or ``limit`` of the header."""
        return f"v(x{self.instance}.{kind}_{name})"

    @property
    def power_vectors(self) -> list[str]:
        """Vectors of all losses, feeds, stores and limits."""
        kinds = {"loss": self.library.losses, "feed": self.library.feeds, "store": self.library.stores}
        kinds["limit"] = self.library.limits
        return [self.power_vector(kind, name) for kind, entries in kinds.items() for name, _ in entries]


class Driver(Stated, Source):
    """Drive electronics: two equal channels for two sines with a settable phase.

    ``voltage`` is the fundamental of the lossless power stage, between transformer and network. It determines the
    control, and the supply of a bridge.

    Raises:
        ParameterError: by the constructor, for an invalid value.
    """

    kind: str = Field(
        description="power stage: ideal, linear, feedback, half-bridge, full-bridge, push-pull, or FILE:NAME of the "
        "user's own subcircuit"
    )
    voltage: float = quantity("amplitude of the stage's fundamental, group A", "V", ge=0.1, le=MOST_VOLTAGE)
    frequency: float = quantity("frequency", "Hz", ge=1e3, le=1e7)
    phase_deg: float = quantity("phase of group B ahead of group A", "°", default=90.0, ge=-360.0, le=360.0)
    ratio_b: float = quantity("amplitude of group B over that of group A", "1", default=1.0, ge=1e-3, le=1e3)
    channels: Literal[1, 2] = Field(default=2, description="number of channels, one for each group of the device")
    network: NetworkKind = Field(default="none", description="network between stage and group")
    supply_v: float = quantity(
        "supply: voltage between the rails of a bridge, each rail of a linear amplifier or the user's own stage; 0: as "
        "the voltage requires",
        "V",
        default=0.0,
        ge=0.0,
        le=2000.0,
    )
    transformer: bool = Field(
        default=False,
        description="transformer behind a linear stage or a half bridge; a full bridge and a push-pull stage have one",
    )
    supply_rise_s: float = quantity("rise time of the supply at power-up", "s", default=20e-6, ge=1e-6, le=1e-2)
    mosfet: str = Field(
        default=IRF610,
        description="MOSFET of a bridge: IRF530, IRF610, IRF820, or FILE:NAME of a .subckt or .model of the user's own",
    )
    drain_a: float = quantity("continuous drain current of a MOSFET; 0: of its data sheet", "A", default=0.0, ge=0.0)
    drain_pulsed_a: float = quantity("pulsed drain current; 0: of data sheet or .model", "A", default=0.0, ge=0.0)
    junction_case_k_per_w: float = quantity("thermal resistance; 0: the same", "K/W", default=0.0, ge=0.0)
    case_ambient_k_per_w: float = quantity("thermal resistance; 0: without heat sink", "K/W", default=0.0, ge=0.0)
    junction_c: float = quantity("highest temperature of a junction; 0: as above", "°C", default=0.0, ge=0.0)
    ambient_c: float = quantity("temperature of the ambient air", "°C", default=25.0, ge=-60.0, le=150.0)
    settings: dict[str, float] = Field(default_factory=dict, description="parameters of the parts, by PART.PARAMETER")
    _stage: Library | None = PrivateAttr(None)  # the user's own files as read when the driver was created
    _transistor: Library | None = PrivateAttr(None)

    def __init__(self, *values: Any, **named: Any) -> None:
        super().__init__(*values, **named)
        kinds = get_args(DriverKind)
        for name, known, own in (("kind", kinds, "a subcircuit"), ("mosfet", MOSFETS, "a .subckt or .model")):
            value, allowed = getattr(self, name), f"{', '.join(known)} or FILE:NAME of {own}"
            require(value in known or is_reference(value), f"Driver: {name}", value, allowed)
        if is_reference(self.kind):
            self._stage = read_driver(self.kind)
        if is_reference(self.mosfet):
            self._transistor = read_mosfet(self.mosfet)
        elif self.mosfet != IRF610:
            self._transistor = ratings(self.mosfet).library
        self._check()

    def _check(self) -> None:
        if self.transformer and (self.own or self.kind in ("ideal", "push-pull")):
            raise ParameterError(
                f"Driver: transformer has no effect on a {self.name}. Leave it out, or choose linear or half-bridge."
            )
        for path in self.settings:
            self._located(path)
        for group in self.groups:
            self.parts(group)
        for group in self.groups if self._stage else ():  # the control is the voltage over the gain
            gain = self.parts(group)[0].values.get("gain", 1.0)
            require(gain > 0.0, "Driver: driver.gain", gain, "> 0, since the control is the voltage over the gain")
        idle = [*(["mosfet"] if self._transistor else []), *(name for name in RATED if getattr(self, name))]
        if idle and not any(MOSFET in part.library.needs for part in self.parts("a")):
            raise ParameterError(
                f"Driver: {idle[0]} has no effect on a {self.name}. Leave it out, or choose {', '.join(BRIDGES)}."
            )
        if self.kind in BRIDGES:
            self._check_bridge()

    def _check_bridge(self) -> None:
        for group in self.groups if self.mosfet in MOSFETS else ():
            most, borne = ratings(self.mosfet).highest_v, self.swing(group)
            if borne > most:
                high, low = self.rails(group)
                twice = ", which must withstand twice that," if borne > high - low else ""
                raise ParameterError(
                    f"Driver: {high - low:.4g} V between the rails of the {self.kind} of group {group.upper()} are too "
                    f"high; its transistors {self.mosfet}{twice} take {most:g} V, so lower the voltage or choose "
                    f"another one of {', '.join(MOSFETS)}."
                )
        longest = LARGEST_DEAD_TIME / self.frequency
        for group in self.groups:
            dead_time, edge = (self.setting(f"bridge_{group}.{name}") for name in ("dead_time", "gate_edge"))
            allowed = f"at {self.frequency:g} Hz at most a fifth of a period, {longest:.3g} s"
            require(dead_time <= longest, f"Driver: bridge_{group}.dead_time", dead_time, allowed, unit="s")
            most = LARGEST_GATE_EDGE * dead_time
            allowed = f"with a dead time of {dead_time:g} s at most an eighth of that, {most:.3g} s"
            require(edge <= most, f"Driver: bridge_{group}.gate_edge", edge, allowed, unit="s")

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups that it drives."""
        return GROUPS[: self.channels]

    @property
    def name(self) -> str:
        """The power stage: its kind, or the name of the user's own subcircuit."""
        return self.kind.rpartition(":")[2]

    @property
    def own(self) -> bool:
        """Whether the stage is the user's own subcircuit."""
        return self._stage is not None

    @property
    def own_text(self) -> str:
        """The user's own subcircuits, for a netlist."""
        transistor = self._transistor if is_reference(self.mosfet) else None
        return "\n".join(library.subcircuit for library in (self._stage, transistor) if library)

    @property
    def supplied(self) -> bool:
        """Whether the stage has supply pins, so that its supply power is known."""
        if self._stage:
            return bool({*RAILS} & {*self._stage.pin_names})
        return self.kind != "ideal"

    @property
    def controlled(self) -> bool:
        """Whether the stage follows a control voltage; otherwise it has an oscillator of its own."""
        return self._stage is None or "in" in self._stage.pin_names

    @property
    def switched(self) -> bool:
        """Whether the stage may have switching edges, which need non-uniform steps."""
        return self.own or self.kind in BRIDGES

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies in Hz that the time step must resolve; ngspice shortens its steps at edges."""
        return (self.frequency,)

    @property
    def uniform(self) -> bool:
        """Whether a run has uniform steps."""
        return not self.switched

    @property
    def points_per_period(self) -> int:
        """Default number of steps in a period of the fastest motion, of a bridge between its edges."""
        return SWITCHED_POINTS if self.switched else UNIFORM_POINTS

    def ringing_step(self, motor: Motor) -> float:
        """Return the longest default step in s: :data:`RINGING_POINTS` to a period of what the edges set off.

        It rings in the inductance in series, leakage included, with the capacitances of network and group.
        """
        rings = [found for group in self.groups if self.switched and (found := self.ringing(motor, group))]
        return min((2.0 * pi * sqrt(coil * capacitor) / RINGING_POINTS for coil, capacitor in rings), default=inf)

    def ringing(self, motor: Motor, group: str) -> tuple[float, float] | None:
        """Return inductance in H and capacitance in F behind the stage of a group; ``None`` where they are damped."""
        inductance, capacitance = self.leakage(group), motor.piezo.capacitance_f(group)
        resistance = 0.0
        for part in self.parts(group):
            if part.label == self.network:
                coil, ohms = (part.values[name] for name in _SERIES[part.label])
                inductance, resistance = inductance + coil, resistance + ohms
                capacitance += part.values.get("parallel_capacitance", 0.0)
                series = part.values.get("series_capacitance", part.values.get("capacitance", inf))
                capacitance = 1.0 / (1.0 / capacitance + 1.0 / series)
        return (inductance, capacitance) if 4.0 * inductance > resistance**2 * capacitance else None

    @property
    def label(self) -> str:
        """Caption of a figure."""
        network = "" if self.network == "none" else f" with {self.network}"
        apart = f", {self.phase_deg:.4g}° apart" if self.channels == 2 else ""
        return f"{self.name}{network}, {self.voltage:.4g} V at {self.frequency / 1e3:.6g} kHz{apart}"

    def amplitude(self, group: str) -> float:
        """Return the amplitude in V of a group."""
        return self.voltage * (self.ratio_b if group == "b" else 1.0)

    def rails(self, group: str) -> tuple[float, float]:
        """Return the voltages in V of the upper and the lower rail; both 0 for ideal sources."""
        if self.kind == "ideal":
            return 0.0, 0.0
        if self._stage:
            high, low = (self._own_rail(group) if rail in self._stage.pin_names else 0.0 for rail in RAILS)
            return high, -low
        if self.kind in ("full-bridge", "push-pull"):
            return self.supply_v or self._square(group), 0.0
        if self.kind == "half-bridge":
            rail = 0.5 * self.supply_v or self._square(group)
        else:
            rail = self.supply_v or self._amplifier_rail(self._setting("amplifier", "headroom", group, HEADROOM))
        return rail, -rail

    def swing(self, group: str) -> float:
        """Return the voltage in V that a transistor of a bridge withstands while it is off."""
        high, low = self.rails(group)
        return (high - low) * (2.0 if self.kind == "push-pull" else 1.0)

    def dead_time(self, group: str) -> float:
        """Return the dead time in s of a bridge; 0 without one."""
        return self.values(group, "bridge").get("dead_time", 0.0)

    def delays(self, group: str) -> dict[str, Delay]:
        """Return the delays of the bridge of a group, by the parameters of their state at the start; else none."""
        if not self.switched:
            return {}
        stage, *_ = self.parts(group)
        names = [name for parameter in stage.library.parameters if (name := parameter.name).startswith(DELAY)]
        return {name: Delay(-1.0 if name.endswith("_n") else 1.0, stage.values.get("level", 0.0)) for name in names}

    def ahead(self, group: str) -> float:
        """Return by what part of a period a group is ahead of group A."""
        return self.phase_deg / 360.0 if group == "b" else 0.0

    def winding(self, group: str) -> float:
        """Return the capacitance in F of the winding of the coil in series; an assumed one if it is not stated."""
        return self.values(group, self.network).get("winding_capacitance") or WINDING_CAPACITANCE

    @property
    def transformer_label(self) -> str:
        """The part with the parameters of the transformer: that of a push-pull stage belongs to the stage."""
        return "bridge" if self.kind == "push-pull" else "transformer"

    def ratio(self, group: str) -> float:
        """Return the voltage ratio of the transformer of a group; 1 without one."""
        return self._transformer(group).get("ratio", 1.0)

    def _transformer(self, group: str) -> Mapping[str, float]:
        return self.values(group, self.transformer_label)

    @cached_property
    def equivalent(self) -> Driver:
        """Ideal sources of the fundamental of the stage, with the same network behind them.

        Resistance of the stage, and resistance and leakage of a transformer, are in series with the network. Dead time,
        harmonics and the diodes of a bridge are left out; so is the resistance of a stage or MOSFET of the user's own.
        """
        if self.kind == "ideal":
            return self
        changes: dict[str, float] = {}
        network = "inductor" if self.network == "none" else self.network
        for group in self.groups:
            inductance, resistance = self._in_series(group)
            label, (coil, ohms), values = groups.named(network, group), _SERIES[network], self.values(group, network)
            changes |= {f"{label}.{name}": values[name] for name in values}
            changes[f"{label}.{coil}"] = max(values.get(coil, 0.0) + inductance, 1e-6)
            changes[f"{label}.{ohms}"] = max(values.get(ohms, 0.0) + resistance, 1e-3)
            changes |= {f"{CABLE}_{group}.{name}": value for name, value in self.values(group, CABLE).items()}
        amplitudes = {group: self.fundamental(group) for group in self.groups}
        return Driver(
            kind="ideal", network=network, voltage=amplitudes["a"], ratio_b=amplitudes.get("b", 1.0) / amplitudes["a"],
            frequency=self.frequency, phase_deg=self.phase_deg, settings=changes, channels=self.channels,
        )  # fmt: skip

    def fundamental(self, group: str) -> float:
        """Return the amplitude in V of the fundamental of the lossless stage behind its open transformer."""
        high, low = self.rails(group)
        volts = self.amplitude(group)
        if self.kind in ("full-bridge", "push-pull"):
            level = self._setting("bridge", "level", group, 0.0)
            volts = 4.0 / pi * (high - low) * self.ratio(group) * sqrt(1.0 - level**2)
        elif self.kind == "half-bridge":
            volts = 2.0 / pi * (high - low) * self.ratio(group)
        values = self._transformer(group)
        return volts * values["coupling"] * self.raised(group) if values else volts

    def reachable(self, group: str) -> float:
        """Return the largest amplitude in V between the rails, behind the transformer; infinite where not known."""
        if self.own or self.kind == "ideal" or self.transformer_resonance(group) <= self.frequency:
            return inf
        if self.kind in BRIDGES:
            return self.fundamental(group)
        return (self.rails(group)[0] - self.values(group, "amplifier")["headroom"]) * self.ratio(group)

    def raised(self, group: str) -> float:
        """Return the factor by which the capacitance of a transformer's winding raises the voltage behind its leakage.

        Raises:
            ParameterError: if they resonate below the frequency of the drive.
        """
        resonance = self.transformer_resonance(group)
        if resonance <= self.frequency:
            raise ParameterError(
                f"Driver: leakage and winding capacitance of the transformer of group {group.upper()} resonate at "
                f"{resonance:.4g} Hz, below the drive at {self.frequency:g} Hz. Lower {self.transformer_label}."
                "winding_capacitance, magnetizing or ratio, or raise the coupling."
            )
        return 1.0 / (1.0 - (self.frequency / resonance) ** 2)

    def transformer_resonance(self, group: str) -> float:
        """Return the resonance in Hz of leakage and winding capacitance of a transformer; infinite without them."""
        values = self._transformer(group)
        product = self.leakage(group) * values["winding_capacitance"] if values else 0.0
        return 1.0 / (2.0 * pi * sqrt(product)) if product else inf

    def _in_series(self, group: str) -> tuple[float, float]:
        """Return inductance in H and resistance in Ω of stage and transformer, seen from the network."""
        parts = {part.label: part.values for part in self.parts(group)}
        resistance = parts["amplifier"]["output_resistance"] if "amplifier" in parts else 0.0
        inductance = 0.0
        if self.kind == "feedback":  # behind the loop, and output_resistance by its gain: that of an inductance
            own = parts["amplifier"]
            inductance = resistance * own["gain"] / (2.0 * pi * own["gain_bandwidth"])
            resistance = own["isolation_resistance"]
        if "bridge" in parts and self.mosfet in MOSFETS:
            resistance = ratings(self.mosfet).on_resistance_ohm * (2.0 if self.kind == "full-bridge" else 1.0)
        values = self._transformer(group)
        if not values:
            return inductance, resistance
        raised = self.raised(group)  # R + jωL beside the capacitance: (R + jωL)/(1 - ω²LC + jωRC), with ωRC small
        resistance = (resistance + values["primary_resistance"]) * values["ratio"] ** 2 * raised**2
        inductance = self.leakage(group) + inductance * values["ratio"] ** 2
        return inductance * raised, resistance + values["secondary_resistance"]

    def leakage(self, group: str) -> float:
        """Return the leakage inductance in H of a transformer, in series with the network; 0 without one."""
        values = self._transformer(group)
        return values["magnetizing"] * values["ratio"] ** 2 * (1.0 - values["coupling"] ** 2) if values else 0.0

    def updated(self, changes: Mapping[str, Any]) -> Self:
        """Return a driver with changed values: its own by their name, those of its parts by PART.PARAMETER.

        A value for both groups takes the place of those of each group.

        Raises:
            ParameterError: for a name that does not exist or an invalid value.
        """
        own = {name: value for name, value in changes.items() if "." not in name}
        of_parts = {name: value for name, value in changes.items() if "." in name}
        replaced = {path for name in of_parts for path in of_groups(name)} - of_parts.keys()
        kept = {path: value for path, value in own.get("settings", self.settings).items() if path not in replaced}
        return super().updated({**own, "settings": {**kept, **of_parts}})

    def recovering(self, factor: float) -> Self:
        """Return the driver with the transit time of its body diodes times a factor; without one as it is."""
        library, changed = self._transistor or ratings(IRF610).library, self.model_copy()
        text = _TRANSIT.sub(lambda found: f"TT={factor * number(found[1])!r}", library.subcircuit)
        changed._transistor = replace(library, subcircuit=text)
        return changed

    def charged(self, volts: Mapping[str, float]) -> Self:
        """Return the driver whose capacitors in series with the groups have voltages in V at the start of a run."""
        name = {"inductor": "start_voltage", "llcc": "start_series_voltage"}.get(self.network)
        return self.updated({f"{self.network}_{group}.{name}": value for group, value in volts.items() if name})

    @property
    def given(self) -> Self:
        """The driver itself."""
        return self

    @property
    def unsteady(self) -> str:
        """Why shooting cannot find a steady state behind the driver; empty if it can.

        A winding that rings with the inductance of a cable after each edge of a bridge, at some ten megahertz, takes a
        thousand steps of ngspice; what they miss is 1e-3 of the states, and Newton's method does not get nearer.
        """
        if self.own:
            return f"The driver {self.name} is a subcircuit of your own, whose states are not known."
        chains = [self.parts(group) for group in self.groups] if self.switched else []
        for before, last in chain.from_iterable(map(pairwise, chains)):
            if last.label == CABLE and (winding := before.values.get("winding_capacitance")):
                inductance = last.values["inductance"]
                hertz = 1.0 / (2.0 * pi * sqrt(inductance * winding))
                return (
                    f"{before.label}.winding_capacitance = {winding:g} F rings with cable.inductance = {inductance:g} "
                    f"H of group {last.group.upper()} at {1e-6 * hertz:.4g} MHz after each edge of the bridge, too "
                    "fast for a steady state by shooting. Set winding_capacitance = 0, or leave the cable out."
                )
        return ""

    def of_part(self, path: str) -> tuple[float, str] | None:
        """Return value and unit of a part's parameter, by PART.PARAMETER; ``None`` for a name without a part."""
        return (self.setting(path), self.unit(path)) if "." in path else None

    def setting(self, path: str) -> float:
        """Return the value of a part's parameter, by PART.PARAMETER; for a part of both groups that of group A.

        Raises:
            ParameterError: for a part or a parameter that does not exist.
        """
        part, parameter = self._located(path)
        return part.values[parameter.name]

    def unit(self, path: str) -> str:
        """Return the unit of a part's parameter, by PART.PARAMETER."""
        return self._located(path)[1].unit

    def left_out(self, path: str) -> bool:
        """Return whether the value of PART.PARAMETER is an end of its range, which stands for a part that is not there.

        For a part of both groups it is that of either.
        """
        found = [self._located(one) for one in of_groups(path)[: self.channels] or (path,)]
        return any(part.values[one.name] in (one.least, one.greatest) for part, one in found)

    def parts(self, group: str) -> tuple[Part, ...]:
        """Return the chain of one group, from the stage to the pin; a cable if one of its parameters is set."""
        return self.chains[group]

    @cached_property
    def chains(self) -> dict[str, tuple[Part, ...]]:
        """Group → its chain, from the stage to the pin."""
        return {group: self._chain_of(group) for group in self.groups}

    def values(self, group: str, label: str) -> Mapping[str, float]:
        """Return the parameters of a part of a group by its label; empty without it."""
        return next((part.values for part in self.parts(group) if part.label == label), {})

    def passed(self, group: str, volts: Any, amperes: Any, omega: Any) -> list[tuple[Part, Passed]]:
        """Return the network of a group from the pin to the stage, a cable first, for phasors of the pin."""
        found = []
        for part in reversed(self.parts(group)):
            before = passed(part.label, part.values, volts, amperes, omega)
            if before is None:
                break
            found.append((part, before))
            volts, amperes = before.volts, before.amperes
        return found

    def _chain_of(self, group: str) -> tuple[Part, ...]:
        chain = list[tuple[str, str, Library]]()  # first part of the instance's name, label, library
        if self._stage:
            chain.append(("stage", _OWN, self._stage))
        elif self.kind != "ideal":
            names = {"linear": ("amplifier", "amplifier"), "feedback": ("amplifier", "feedback")}
            label, name = names.get(self.kind, ("bridge", self.kind))
            chain.append(("stage", label, read_library(f"driver_{name.replace('-', '_')}")))
        if self.transformer or self.kind == "full-bridge":
            chain.append(("transformer", "transformer", read_library("driver_transformer")))
        if self.network != "none":
            chain.append(("network", self.network, read_library(f"driver_{self.network}")))
        if {CABLE, groups.named(CABLE, group)} & {path.partition(".")[0] for path in self.settings}:
            chain.append((CABLE, CABLE, read_library("driver_cable")))
        return tuple(self._part(label, library, groups.named(name, group), group) for name, label, library in chain)

    def check(self, motor: Motor) -> None:
        """Raise a ParameterError for a number of channels that is not that of the groups."""
        if self.channels != len(motor.groups):
            raise ParameterError(
                f"The driver has channels = {self.channels}, and {motor.name} has {len(motor.groups)} "
                f"group{'s' if len(motor.groups) == 2 else ''}: give a driver as many."
            )

    def options(self, motor: Motor, law: Law | None) -> Mapping[str, str]:
        """Return ngspice's options for a run with the driver."""
        return SWITCHED_OPTIONS if self.switched else transient_options(motor, law)

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add both channels and their control source between ground and the nodes of groups A and B.

        For group g the supply is ``Vvp_g`` and ``Vvn_g``; the stage's output is the node ``out_g`` (against
        ``return_g`` for a full bridge) with its current in ``Vout_g``; the current into the pin is that of ``Vpin_g``.
        """
        add_driver(circuit, self, dict(zip(self.groups, pins, strict=True)))

    @property
    def powers(self) -> dict[str, Derived]:
        """Powers, energies and limits of the parts that the package has, by the vectors of their nodes."""
        chains = [one for group in self.groups for one in _chain(self, group) if one[0].label != _OWN]
        return {
            name: power
            for part, nodes in chains
            for name, power in powers_of(part.library, f"x{part.instance}".lower(), nodes, part.values)
        }

    def initial_voltages(self) -> tuple[float, ...]:
        """Return the voltages of the pins at t = 0: an ideal source must not have a step at a capacitance."""
        direct = self.kind == "ideal" and self.network == "none"
        return tuple(volts.imag if direct else 0.0 for volts in two_phasors(self).values())[: self.channels]

    def current(self, group: str) -> tuple[str, float]:
        """Return the vector of the current into a pin, and its sign."""
        return groups.current("pin", group), 1.0

    def to_dict(self) -> dict[str, Any]:
        """Return the driver and every parameter of its parts, JSON-ready."""
        return self.model_dump(exclude={"settings"}) | {
            "label": self.label,
            "supplied": self.supplied,
            "rails_v": {group: list(self.rails(group)) for group in self.groups},
            "parts": {group: {part.label: part.values for part in self.parts(group)} for group in self.groups},
        }

    def libraries(self) -> list[Library]:
        """Return the libraries of all parts; a MOSFET other than the default comes first."""
        parts = [part.library for group in self.groups for part in self.parts(group)]
        return [self._transistor, *parts] if self._transistor else parts

    def _part(self, label: str, library: Library, instance: str, group: str) -> Part:
        values = {
            parameter.name: self._setting(label, parameter.name, group, parameter.default)
            for parameter in library.parameters
            if label == _OWN
            or not parameter.name.startswith(START)
            or f"{label}_{group}.{parameter.name}" in self.settings
        }
        if label == _OWN:
            phase_deg = self.phase_deg if group == "b" else 0.0
            driven = dict(zip(DRIVEN, (self.amplitude(group), self.frequency, phase_deg), strict=True))
            values |= {name: value for name, value in driven.items() if name in values}
        with located(f"Driver: {label} of group {group.upper()}"):
            check_parameters(library.name, library.parameters, values)
        return Part(instance, label, group, library, values)

    def _setting(self, label: str, name: str, group: str, default: float) -> float:
        for path in (f"{label}_{group}.{name}", f"{label}.{name}"):
            if path in self.settings:
                return self.settings[path]
        return default

    def _located(self, path: str) -> tuple[Part, LibraryParameter]:
        """Return part and parameter of PART.PARAMETER. Raise ParameterError for one that does not exist."""
        label, _, name = path.partition(".")
        plain, group = (label[:-2], label[-1]) if label.endswith(("_a", "_b")) else (label, "a")
        present = {part.label: part for part in self.chains.get(group, ())}
        if plain not in present:
            labels = ", ".join(present) or "none"
            raise ParameterError(f"Driver: there is no part {quoted(label)} in this {self.name}; its parts: {labels}.")
        if plain == _OWN and name in DRIVEN:
            raise ParameterError(f"Driver: {path} follows from the driver's voltage, frequency and phase. Set these.")
        known = list(present[plain].values)
        if name not in known:
            hint = did_you_mean(name, known, "It has")
            raise ParameterError(f"Driver: the {plain} has no parameter {quoted(name)}. {hint}")
        return present[plain], next(one for one in present[plain].library.parameters if one.name == name)

    def _amplifier_rail(self, headroom: float) -> float:
        """Return the rail voltage of an amplifier for the larger of both amplitudes, with a margin."""
        return 1.1 * max(self.amplitude(group) / self.ratio(group) for group in self.groups) + headroom + 2.0

    def _own_rail(self, group: str) -> float:
        """Return a rail voltage of the user's own stage.

        It is that of the built-in amplifier if the stage has a gain or an amplitude, otherwise that of a half bridge. A
        single rail has the voltage of both.
        """
        stage = self.parts(group)[0]
        amplifies = {"gain", "amplitude"} & {*stage.values}
        headroom = stage.values.get("headroom", HEADROOM)
        rail = self._amplifier_rail(headroom) if amplifies else self.amplitude(group) / self.ratio(group) * pi / 4.0
        return self.supply_v or (rail if {*RAILS} <= {*stage.library.pin_names} else 2.0 * rail)

    def _square(self, group: str) -> float:
        """Return the amplitude in V of the square wave in front of the transformer that the voltage requires."""
        level = self._setting("bridge", "level", group, 0.0)
        return self.amplitude(group) / (self.ratio(group) * sqrt(1.0 - level**2)) * pi / 4.0


def of_groups(path: str) -> tuple[str, ...]:
    """Return the paths of a part's parameter in each group, for PART.PARAMETER of both; else none."""
    label, _, name = path.partition(".")
    return () if label.endswith(("_a", "_b")) else tuple(f"{label}_{group}.{name}" for group in GROUPS)


def add_driver(
    circuit: Circuit, driver: Driver, pins: Mapping[str, str], *, source: bool = True,
    supply: Sequence[tuple[float, float]] = (),
) -> None:  # fmt: skip
    """Add both channels of a driver to a circuit, up to the pin of each group.

    Without its source, another one drives the nodes ``control_a`` and ``control_b``: 1 V amplitude for a bridge, the
    voltage over the gain for a linear amplifier. The rails follow ``supply``: times in s and shares of their voltages.
    """
    source = source and driver.controlled
    libraries = [*([read_library("driver_source")] if source else []), *driver.libraries()]
    circuit.raw_spice += definitions(*libraries) + "\n"
    if source and driver.delays("a"):
        circuit.raw_spice += "* Vedges, Vbefore, Von: points at and before each edge of a bridge, and at its gates\n"
    if source:
        amplitudes = {groups.named("amplitude", group): control_amplitude(driver, group) for group in driver.groups}
        nodes = ("control_a", "control_b", circuit.gnd)
        instantiate(
            circuit, "source", "driver_source", nodes,
            frequency=driver.frequency, phase_deg=driver.phase_deg, **amplitudes,
        )  # fmt: skip
        for group in driver.groups:
            add_breakpoints(circuit, driver, group)
    add_channels(circuit, driver, pins, supply=supply)


def add_breakpoints(circuit: Netlist, driver: Driver, group: str, begins: float = 0.0) -> None:
    """Add pulses with corners where a bridge's comparators switch and before its gates turn on, for points there.

    Otherwise the time of an edge depends on the steps around it, and the step to the edge of a gate is as long as
    those. ngspice shortens the step before a corner and at most doubles the next one, so that all steps of the edge
    would have the relative rounding error of a short step. A second corner, :data:`RESTART_S` later, prevents this.

    The run starts at the phase ``begins`` of group A's control, in periods.
    """
    period, gap = driver.period, RESTART_S
    for name, delay in driver.delays(group).items():
        stage = driver.chains[group][0].values  # of the user's own as well, by these names
        on = TURN_ON * stage.get("dead_time", 0.0) - BEFORE_TURN_ON * stage.get("gate_edge", 0.0)
        rise, fall = (edge * period for edge in delay.edges(driver.ahead(group)))
        half = COMPARATOR_V * period / (2.0 * pi * sqrt(1.0 - delay.level**2))
        for place, after, width in (("edges", -half, 2.0 * half), ("before", -half - gap, gap), ("on", on - gap, gap)):
            first = (rise + after - begins * period) % period
            pulse = f"PULSE(0 1 {first!r} {width!r} {width!r} {fall - rise - width!r} {period!r})"
            node = f"{place}_{group}{name.removeprefix(DELAY)}"
            circuit.V(node, node, circuit.gnd, pulse)


def add_channels(
    circuit: Netlist, driver: Driver, pins: Mapping[str, str], *, risen: bool = False,
    supply: Sequence[tuple[float, float]] = (),
) -> None:  # fmt: skip
    """Add both channels of a driver, without their subcircuits and the control source, up to the pin of each group.

    If ``risen``, the supplies have risen before the start of the run.
    """
    for group in driver.groups:
        chain, output, line = _chain(driver, group), groups.named("control", group), groups.named("line", group)
        if driver.kind != "ideal":
            (stage, nodes), *chain = chain
            for rail, volts in zip(RAILS, driver.rails(group), strict=True):
                later = "".join(f" {time!r} {share * volts!r}" for time, share in supply if time > driver.supply_rise_s)
                ramp = f"DC {volts!r}" if risen else f"PWL(0 0 {driver.supply_rise_s!r} {volts!r}{later})"
                if rail in nodes:
                    circuit.V(groups.named(rail, group), nodes[rail], circuit.gnd, ramp if volts else "DC 0")
            instantiate(circuit, stage.instance, stage.library, list(nodes.values()), **stage.values)
            output = groups.named("out", group)
        circuit.V(groups.named("out", group), output, line, "DC 0")
        for part, nodes in chain:
            instantiate(circuit, part.instance, part.library, list(nodes.values()), **part.values)
            line = groups.named(part.label, group)
        circuit.V(groups.named("pin", group), line, pins[group], "DC 0")


def control_amplitude(driver: Driver, group: str) -> float:
    """Return the amplitude in V of a control: the voltage over the gain of a stage that has one, else 1 V.

    For ideal sources it is the voltage itself.
    """
    if driver.kind == "ideal":
        return driver.amplitude(group)
    gain = driver.parts(group)[0].values.get("gain")
    return driver.amplitude(group) / (gain * driver.ratio(group)) if gain else 1.0


def _chain(driver: Driver, group: str) -> list[tuple[Part, dict[str, str]]]:
    """Return the parts of a channel from the stage on, each with the node of each pin."""
    back = groups.named("return", group) if driver.kind == "full-bridge" else "0"
    line, found = groups.named("line", group), list[tuple[Part, dict[str, str]]]()
    for part in driver.parts(group):
        if driver.kind != "ideal" and not found:
            before, after = groups.named("control", group), groups.named("out", group)
        else:
            before, line = line, groups.named(part.label, group)
            after = line
        nodes = {
            "in": before, "out": after, "com": "0", "out_p": after, "out_n": back,
            "p1": before, "p2": back, "s1": after, "s2": "0", **{rail: groups.named(rail, group) for rail in RAILS},
        }  # fmt: skip
        found.append((part, {name: nodes[name] for name in part.library.pin_names}))
    return found
