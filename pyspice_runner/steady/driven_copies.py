# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench of a motor behind a driver circuit, with the state of both as parameters: for the steady state.

The inductances and capacitances of the driver's parts are found in their libraries, by ``ic={start_NAME}``. The
capacitances of a bridge's delays and transistors are no states: away from the switching edges the control determines
them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi, sin

import numpy as np
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit, SubCircuit

from pyspice_runner.circuit.bench import Bench, Derived
from pyspice_runner.circuit.evaluated import LINE, plotted_nodes
from pyspice_runner.circuit.fixtures import METERED, add_meters, add_set_speed, brake_parts, connect_brake
from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.circuit.state import Discretisation, State, motor_states
from pyspice_runner.drivers.driver import DELAY, Delay, Driver, add_breakpoints, add_channels, control_amplitude
from pyspice_runner.drivers.parts import CABLE, NO_CAPACITOR, passed
from pyspice_runner.motor import groups
from pyspice_runner.spice.library import definition_texts
from pyspice_runner.steady.copies import Copy, Plant, content_name, copy_name

Array = NDArray[np.float64]
LEAD = 0.05  # of a period, from the start of a run to that of the period: charges of the transistors settle in it
# of copies whose transistors start without charge: with a smaller abstol (A) or trtol ngspice often fails there
OF_ONE, OF_SEVERAL = ({"abstol": abstol, "chgtol": "1e-12", "trtol": "7"} for abstol in ("3e-6", "1e-5"))
_CANDIDATES = 256  # phases at which a run may start
_STORE = re.compile(r"^([LC]\w*) (\S+) (\S+) (?:\{[^}]*\}|\S+) ic=\{(start_\w+)\}$", re.M)
_SECONDARY = "start_secondary"  # parameter of a transformer: the current into its secondary
PRIMARY = ("start_primary", "start_p", "start_n")  # those of the currents into its primary
_COILS = (_SECONDARY, "start_current", "start_series_current")  # parameters of coils between a stage and a pin


@dataclass(frozen=True)
class Store:
    """An inductance or capacitance of a driver."""

    instance: str  # instance of the part that it belongs to
    device: str  # its name there, in lower case
    start: str  # parameter of the part for its current or voltage at the start
    ends: tuple[str, str]  # nodes of the bench at its ends

    @property
    def name(self) -> str:
        """The parameter of the bench that sets its current or voltage at the start."""
        return f"{self.instance}_{self.device}"

    @property
    def coil(self) -> bool:
        """Whether it is an inductance."""
        return self.device[0] == "l"

    def vectors(self, copy: str) -> tuple[str, ...]:
        """Return the vectors of its current, or of the voltages at its ends."""
        if self.coil:
            return (f"i(l.{copy}.x{self.instance}.{self.device})",)
        return tuple(f"v({copy}.{node})" for node in self.ends if node != "0")

    def value(self, samples: Mapping[str, Array], copy: str) -> Array:
        """Return its current in A or its voltage in V."""
        if self.coil:
            return samples[self.vectors(copy)[0]]
        first, second = (samples[f"v({copy}.{node})"] if node != "0" else 0.0 for node in self.ends)
        return np.asarray(first - second)


@dataclass(frozen=True)
class DrivenPlant(Plant):
    """A motor behind a driver. Its states are followed by the plates of both groups and by the driver's stores."""

    driver: Driver  # the driver; ``drive`` is the fundamental of its stage

    @cached_property
    def bench_name(self) -> str:
        """Name of the subcircuit of motor and driver. Plants with equal values have equal names."""
        return content_name("driven", self.motor_name, self.driver.model_dump_json(), self.load)

    @cached_property
    def states(self) -> tuple[State, ...]:
        """The states of the motor, with those of its plates at the end."""
        kinds = ("mode", "contact", "stem", "mount", *(("rotor",) if self.turns else ()), "group")
        return motor_states(self.motor, self.law, kinds)

    @property
    def inner(self) -> int:
        """Number of states of the motor without its plates."""
        return int(self.where("group").start)

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.states) + len(self.stores)

    @cached_property
    def stores(self) -> list[Store]:
        """The inductances and capacitances of the driver that are states."""
        found = []
        channels = SubCircuit("channels", "mark")
        add_channels(channels, self.driver, dict(zip(GROUPS, METERED, strict=True)))
        for group in GROUPS:
            for part in self.driver.parts(group):
                instance = part.instance.lower()
                nodes = channels[f"X{part.instance}"].node_names
                pins = {"0": "0"} | dict(zip(part.library.pin_names, nodes, strict=True))
                for device, first, second, start in _STORE.findall(part.library.subcircuit):
                    # a capacitance of 1 F stands for a short circuit
                    short = start == "start_voltage" and part.values.get("capacitance") == NO_CAPACITOR
                    no_winding = start == "start_winding" and part.values["winding_capacitance"] == 0.0
                    follows = start.startswith(DELAY) or (part.instance, start) in self._in_series
                    if short or no_winding or follows:
                        continue
                    ends = [str(pins.get(node, f"x{instance}.{node}")) for node in (first, second)]
                    found.append(Store(instance, device.lower(), start, (ends[0], ends[1])))
        return found

    @cached_property
    def _in_series(self) -> dict[tuple[str, str], str]:
        """Currents at the start that are those of a later coil of the branch: instance and parameter → signed store."""
        found: dict[tuple[str, str], str] = {}
        for group in GROUPS:
            before: list[tuple[str, str, str]] = []
            for part in self.driver.parts(group):
                starts = [name for parameter in part.library.parameters if (name := parameter.name) in _COILS]
                if starts == [_SECONDARY]:
                    before = [] if part.values["winding_capacitance"] else [(part.instance, _SECONDARY, "-")]
                    continue
                single = starts and not part.values.get("winding_capacitance")
                if single:
                    store = f"{part.instance.lower()}_{'lline' if part.label == CABLE else 'lseries'}"
                    found |= {(instance, start): f"{sign}{store}" for instance, start, sign in before}
                before = [*before, (part.instance, starts[0], "")] if single and part.label == "inductor" else []
        return found

    @property
    def isolated(self) -> int:
        """Number of charges that stay: between a group and a capacitance in series with it, without a bleeder."""
        parts = [part for group in GROUPS for part in self.driver.parts(group) if part.label == "inductor"]
        return sum(part.values["capacitance"] != NO_CAPACITOR and part.values["bleeder"] >= 1e12 for part in parts)

    def store_phasors(self, pins: Mapping[str, complex], currents: Mapping[str, complex]) -> list[complex]:
        """Return the phasors of the stores of a network in a linear steady state; 0 for those of a stage.

        Args:
            pins: group → phasor of the voltage at its pin, V.
            currents: group → phasor of the current into its pin, A.
        """
        omega, of_devices = 2.0 * pi * self.driver.frequency, dict[tuple[str, str], complex]()
        for group in GROUPS:
            volts, amperes = pins[group], currents[group]
            for part in reversed(self.driver.parts(group)):
                before = passed(part.label, part.values, volts, amperes, omega)
                if before is None:
                    break
                of_devices |= {(part.instance.lower(), device): value for device, value in before.stores.items()}
                volts, amperes = before.volts, before.amperes
        return [of_devices.get((store.instance, store.device), 0j) for store in self.stores]

    @cached_property
    def begins(self) -> float:
        """Phase of group A's control at which a run starts, as a fraction of a period; it is far from the edges."""
        phases = np.arange(_CANDIDATES) / _CANDIDATES
        edges = []
        for group in GROUPS:
            half = 0.5 * self.driver.dead_time(group) * self.driver.frequency  # of the dead time, in periods
            for delay in self.driver.delays(group).values() or (Delay(1.0, 0.0),):
                edges += [edge + half for edge in delay.edges(self.driver.ahead(group))]
        distances = np.abs((phases[:, np.newaxis] - edges + 0.5) % 1.0 - 0.5).min(axis=1)
        return float(phases[distances.argmax()] - 0.5 * LEAD)

    def _switched(self, group: str) -> dict[str, bool]:
        """Return whether each delay of a bridge is at 1 V as a run starts, by its parameter."""
        control = sin(2.0 * pi * (self.begins + self.driver.ahead(group)))
        return {name: delay.sign * control > delay.level for name, delay in self.driver.delays(group).items()}

    def bench_texts(self, discretisation: Discretisation, *, meters: bool) -> dict[str, str]:
        """Return the subcircuit of motor, driver and shaft and those of its parts, by name.

        The state is a set of parameters of the X line.
        """
        starts = [*self.start_values(np.zeros(len(self.states)), discretisation)]
        parameters = dict.fromkeys([*starts, *(store.name for store in self.stores)], "0")
        circuit = SubCircuit(self.bench_name, "mark", **parameters)
        add_channels(circuit, self.driver, dict(zip(GROUPS, METERED, strict=True)), risen=True)
        for store in self.stores:
            circuit[f"X{store.instance}"].parameters[store.start] = f"{{{store.name}}}"
        for (instance, start), current in self._in_series.items():
            circuit[f"X{instance}"].parameters[start] = f"{{{current}}}"
        self._add_controls(circuit)
        self._add_shaft(circuit, discretisation, meters=meters)
        passed = {name: f"{{{name}}}" for name in starts}
        circuit.X("motor", self.motor_name, "a", "b", circuit.gnd, "shaft", **passed)
        parts = {name: LINE.sub("", text) for name, text in definition_texts(*self.driver.libraries()).items()}
        parts |= definition_texts(*(brake_parts(meters=True) if meters else ()))
        return parts | self.motor_texts(discretisation, plotted=meters) | {self.bench_name: str(circuit).strip()}

    def _add_controls(self, circuit: SubCircuit) -> None:
        """Add the sources of the controls, and the state of the delays; the supplies rose long ago."""
        for group in GROUPS:
            begins = self.begins + self.driver.ahead(group)
            amplitude, turned = control_amplitude(self.driver, group), 360.0 * (begins % 1.0)
            control = f"SIN(0 {amplitude!r} {self.driver.frequency!r} 0 0 {turned!r})"
            circuit.V(groups.named("control", group), groups.named("control", group), circuit.gnd, control)
            for name, above in self._switched(group).items():
                circuit[groups.named("Xstage", group)].parameters[name] = 1.0 if above else -1.0
            add_breakpoints(circuit, self.driver, group, self.begins)

    def _add_shaft(self, circuit: SubCircuit, discretisation: Discretisation, *, meters: bool) -> None:
        """Add what holds or loads the shaft, and the meters, if any."""
        if meters:
            add_meters(circuit, self.motor, {"lag": discretisation.slider_time})
            add_set_speed(circuit, self.load.speed)
            connect_brake(circuit, self.load.torque, grips=self.load.speed is not None)
            return
        for group, line in zip(GROUPS, METERED, strict=True):
            circuit.V(line, line, group, "DC 0")
        if self.load.speed is not None:
            circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(self.load.speed)!r}")
        elif self.load.torque:
            circuit.I("load", "shaft", circuit.gnd, f"DC {float(self.load.torque)!r}")


def driven_vectors(plant: DrivenPlant, copy: str) -> list[str]:
    """Return the vectors of a copy that hold its states."""
    stores = [name for store in plant.stores for name in store.vectors(copy)]
    return [*plant.vectors(f"{copy}.xmotor", f"{copy}.shaft"), *stores]


def driven_states(plant: DrivenPlant, samples: Mapping[str, Array], copy: str, discretisation: Discretisation) -> Array:
    """Return the states from the samples of these vectors, shape (order, points), in SI units."""
    names = plant.vectors(f"{copy}.xmotor", f"{copy}.shaft")
    rows = [samples[name] * unit for name, unit in zip(names, plant.units(discretisation).tolist(), strict=True)]
    return np.array([*rows, *(store.value(samples, copy) for store in plant.stores)])


def driven(plant: Plant) -> DrivenPlant:
    """Return the plant of a copy behind a driver, for the type checker."""
    assert isinstance(plant, DrivenPlant)
    return plant


def driven_bench(copies: Sequence[Copy], discretisation: Discretisation, *, meters: bool = False) -> Bench:
    """Return the bench of copies of motors behind their drivers: instances ``Xc0``, ``Xc1``, ….

    The period begins at :data:`LEAD` of it after the start of the run, where a pulse makes ngspice compute a point.
    With ``meters`` each shaft has a dynamometer, and the motor the meters of :func:`.dynamometer_bench`.
    """
    lines, subcircuits, start = [], dict[str, str](), dict[str, float]()
    signals: dict[str, Derived] = {}
    first = driven(copies[0].plant)
    if not first.driver.uniform:
        lines.append(f"Vmark mark 0 PULSE(0 1 {LEAD * first.driver.period!r} 1n 1n 1 2)")
    lines.append("Rmark mark 0 1")
    for number, copy in enumerate(copies):
        plant, instance = driven(copy.plant), copy_name(number)
        if plant.bench_name not in subcircuits:
            subcircuits |= plant.bench_texts(discretisation, meters=meters)
        motor, stores = np.split(copy.state, [len(plant.states)])
        values = plant.start_values(motor, discretisation)
        values |= zip((store.name for store in plant.stores), stores, strict=True)
        words = " ".join(f"{name}={value:.17g}" for name, value in values.items())
        lines.append(f"{instance} mark {plant.bench_name} {words}")
        nodes = plant.start_nodes(motor, 0.0, discretisation, plates=False)
        start |= {f"{instance}.xmotor.{node}": float(value) for node, value in nodes.items()}
        signals |= {} if meters else plotted_nodes(plant.motor, plant.law, f"{instance}.xmotor")
    circuit = Circuit(f"{len(copies)} copies of {first.motor.name} behind a driver")
    circuit.raw_spice += "\n".join([*subcircuits.values(), *lines]) + "\n"
    options = {**first.driver.options(first.motor, first.law)}
    if not first.driver.uniform:
        options |= OF_SEVERAL if len(copies) > 1 else OF_ONE
    return Bench(circuit, options, start, signals=signals)
