# SPDX-License-Identifier: GPL-3.0-or-later
"""The benches of the steady state: many copies of a running motor in one circuit, each with its own initial state.

All copies have the same time axis, so that one run of ngspice maps all states over a period of the drive. Copies of the
same motor share its subcircuit; the state at the start is a set of parameters on the X line of each copy.

Behind a driver the inductances and capacitances of its parts are states too. They are found in the libraries of the
parts, by ``ic={start_NAME}``. The capacitances of a bridge's delays and transistors are no states: away from the
switching edges the control determines them.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import pi, sin
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit, SubCircuit

from pyspice_runner.circuit.bench import BRAKE, METERED, METERS, Bench, add_meters, connect_brake
from pyspice_runner.circuit.evaluated import LINE, Derived, plotted_nodes
from pyspice_runner.circuit.law import Law, laws_of
from pyspice_runner.circuit.motor import MotorSubCircuit, dielectric_branches, dielectric_matrix
from pyspice_runner.circuit.source import GROUPS, not_below_rounding, sine, transient_options
from pyspice_runner.circuit.state import (
    Discretisation,
    Kind,
    State,
    carrier,
    first_guess,
    motor_states,
    plate_nodes,
    start_values,
)
from pyspice_runner.drivers.driver import DELAY, Delay, Driver, add_breakpoints, add_channels, control_amplitude
from pyspice_runner.drivers.parts import CABLE, NO_CAPACITOR
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Drive, Load, Tone, TwoPhaseDrive, two_phases, two_phasors
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Mount
from pyspice_runner.run.point import Point
from pyspice_runner.run.window import Array
from pyspice_runner.spice.library import PREFIX, definition_texts, read_library

LEAD = 0.05  # of a period, from the start of a run to that of the period: charges of the transistors settle in it
# of copies whose transistors start without charge: with a smaller abstol (A) or trtol ngspice often fails there
OF_ONE, OF_SEVERAL = ({"abstol": abstol, "chgtol": "1e-12", "trtol": "7"} for abstol in ("3e-6", "1e-5"))
_CANDIDATES = 256  # phases at which a run may start
_EQUAL = 1e-6  # periods; distances from the edges whose difference is smaller count as equal
_STORE = re.compile(r"^([LC]\w*) (\S+) (\S+) (?:\{[^}]*\}|\S+) ic=\{(start_\w+)\}$", re.M)
_SECONDARY = "start_secondary"  # parameter of a transformer: the current into its secondary
_CAPACITORS = {"inductor": "start_voltage", "llcc": "start_series_voltage"}  # parameters of those in series
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
class Plant:
    """A motor, its drive and its load and the order of the states that a period maps.

    The states are those of modes, contact, stem, mount and, unless the shaft is held, rotor (:func:`.motor_states`).
    The plates are no states: ideal voltage sources set their voltages. A bench may leave them out, since their current
    does not act on the motion.
    """

    motor: Motor  # the motor
    drive: Drive  # the two voltages, without soft start
    load: Load  # on the shaft
    law: Law | None  # law of the contact; ``None`` for a free tip
    # what drives the pins instead of ideal voltages; ``drive`` is then the fundamental of its stage.
    driver: Driver | None = None
    # what was computed: the plants of :meth:`with_sliders`, and the SI values of 1 V or 1 A of the vectors, as a column
    _inner: dict[int, Plant] = field(default_factory=dict, init=False, repr=False, compare=False)
    _units: dict[Discretisation, Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, point: Point) -> Plant:
        """Return the plant of an operating point with a drive or a driver."""
        ideal = point.source.ideal
        if ideal is not None:
            return cls(point.motor, ideal, point.load, point.law)
        driver: Driver = point.source.given  # type: ignore[assignment]
        return cls(point.motor, TwoPhaseDrive(**two_phases(driver)), point.load, point.law, driver)

    @property
    def front(self) -> Driver:
        """The driver, of a plant that has one."""
        assert self.driver is not None
        return self.driver

    @cached_property
    def motor_name(self) -> str:
        """Name of the motor's subcircuit in a bench of copies. Motors with equal values have equal names."""
        return content_name("motor", self.motor.model_dump_json(), self.law)

    @cached_property
    def curve(self) -> str:
        """Name of the curve on which the point is: equal for plants that differ only in the load."""
        return content_name("curve", self.motor_name, self.drive.model_dump_json())

    @cached_property
    def dielectrics(self) -> dict[float, NDArray[np.complex128]]:
        """Admittances in S of the clamped capacitances at the frequencies of the drive, by frequency in Hz."""
        return {frequency: dielectric_matrix(self.motor, frequency) for frequency in self.drive.frequencies}

    @cached_property
    def states(self) -> tuple[State, ...]:
        """The states that a period maps, in their order."""
        turning: tuple[Kind, ...] = ("rotor",) if self.turns else ()
        plates: tuple[Kind, ...] = ("group",) if self.driver else ()
        return motor_states(self.motor, self.law, ("mode", "contact", "stem", "mount", "feedback", *turning, *plates))

    @cached_property
    def places(self) -> dict[Kind, slice]:
        """The places of the states of each part of the motor, which follow each other; an empty slice without any."""
        found: dict[Kind, slice] = dict.fromkeys(get_args(Kind), slice(0, 0))
        for place, state in enumerate(self.states):
            found[state.kind] = slice(found[state.kind].start if found[state.kind].stop else place, place + 1)
        return found

    def with_sliders(self, sliders: int) -> Plant:
        """Return the plant with the inner ones of the sliders of a brush, for a motion that touches no other."""
        assert self.law is not None
        if sliders == self.law.sliders:
            return self
        return self._inner.setdefault(sliders, replace(self, law=self.law.inner(sliders)))

    def widened(self, values: NDArray[Any], inner: Plant, *axes: int) -> NDArray[Any]:
        """Return values of the states of :meth:`with_sliders` along some axes with zeros for the sliders left out."""
        left_out = [inner.places["contact"].stop] * (self.order - inner.order)
        for axis in axes if left_out else ():
            values = np.insert(values, left_out, 0.0, axis)
        return values

    @cached_property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.motor.modes)

    @cached_property
    def mount(self) -> Mount | None:
        """The mount in the netlist."""
        return carrier(self.motor, self.law)

    @cached_property
    def moving(self) -> tuple[list[int], list[int]]:
        """The places of the displacements of modes and carriers, and those of their velocities."""
        n, mount = self.modes, [*range(self.order)[self.places["mount"]]]
        return [*range(n), *mount[::2]], [*range(n, 2 * n), *mount[1::2]]

    @property
    def laws(self) -> tuple[Law, ...]:
        """The law of each contact; of a free tip none."""
        return laws_of(self.motor, self.law)

    @cached_property
    def sliders(self) -> list[NDArray[np.int_]]:
        """The places of the states of each contact."""
        counts = [len(law.states) for law in self.laws] or [0] * len(self.motor.touching)
        return np.split(np.arange(self.order)[self.places["contact"]], np.cumsum(counts)[:-1])

    @property
    def friction_n(self) -> float:
        """The friction force of all contacts under the preload, at the radius of the rotor, N."""
        rest = self.motor.at_rest
        return float(self.motor.stator.lever @ (rest.friction * rest.preload_n))

    @cached_property
    def turns(self) -> bool:
        """Whether the speed of the rotor is a state."""
        return self.load.speed is None

    @cached_property
    def order(self) -> int:
        """Number of states, of which those of the driver are the last."""
        return len(self.states) + len(self.stores)

    def motor_texts(
        self, discretisation: Discretisation, *, plates: bool = True, plotted: bool = False
    ) -> dict[str, str]:
        """Return the subcircuit of the motor and those of its parts, by name.

        ``plates``: whether the motor has its clamped capacitances; ``plotted``: whether a brush has the nodes
        ``slider`` and ``state``.
        """
        name = self.motor_name
        definition = MotorSubCircuit(
            self.motor, law=self.law, discretisation=discretisation, startable=True, plates=plates, plotted=plotted,
            name=name, prefix=PREFIX,
        )  # fmt: skip
        return definition.part_texts | {name: str(definition).strip()}

    def start(
        self,
        state: Array,
        discretisation: Discretisation,
        begun: float = 0.0,
        *,
        plates: bool,
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Return the parameters of the X line for a state, and the initial voltages by node inside the motor.

        The voltages are those of plates and of states without a parameter.
        """
        motion = dict(zip((one.name for one in self.states), state.tolist(), strict=True))
        values, nodes = start_values(self.states, motion, discretisation)
        if self.load.speed is not None:
            values["start_speed"] = self.load.speed
        nodes |= first_guess(self.motor, self.law, motion, discretisation)
        for group, tones in zip("ab", self.drive.tones, strict=True) if plates else ():
            for node, (ohm, farad) in zip(plate_nodes(group), dielectric_branches(self.motor, group), strict=True):
                nodes[node] = 0.0
                for tone in tones:
                    gain = 1.0 / (1.0 + 2j * pi * tone.frequency * ohm * farad)  # of the capacitance in its branch
                    nodes[node] += float(phasor_at(tone, gain, begun)[0])
        return values, nodes

    def inside(self, copy: str) -> str:
        """Return the instance of the motor of a copy."""
        return f"{copy}.xmotor" if self.driver else copy

    def vectors(self, copy: str) -> list[str]:
        """Return the vectors of a copy that hold its states: those of the motor, then those of the stores."""
        inside, shaft = self.inside(copy), f"{copy}.shaft" if self.driver else f"{copy}_shaft"
        names = [state.vector.format(inside, shaft) for state in self.states]
        for store in self.stores:
            names += store.vectors(copy)
        return names

    def sampled(self, samples: Mapping[str, Array], copy: str, discretisation: Discretisation) -> Array:
        """Return the states from the samples of these vectors, shape (order, points), in SI units."""
        names = self.vectors(copy)[: len(self.states)]
        if discretisation not in self._units:
            self._units[discretisation] = np.array([[state.scale(discretisation)] for state in self.states])
        rows = np.array(list(map(samples.__getitem__, names))) * self._units[discretisation]
        return np.array([*rows, *(store.value(samples, copy) for store in self.stores)]) if self.stores else rows

    def pins(self, copy: str) -> dict[str, str]:
        """Return the vectors of voltages and currents behind a driver, by their names in a run of one motor."""
        found: dict[str, str] = {}
        for group in GROUPS if self.driver else ():
            found[f"v({group})"] = f"v({copy}.{group})"
            found[groups.current("pin", group)] = groups.current(f".{copy}.vpin", group)
        return found

    # --- behind a driver: its inductances and capacitances are states ---

    @cached_property
    def bench_name(self) -> str:
        """Name of the subcircuit of motor and driver. Plants with equal values have equal names."""
        return content_name("driven", self.motor_name, self.front.model_dump_json(), self.load)

    @cached_property
    def inner(self) -> int:
        """Number of states of the motor without its plates."""
        return self.places["group"].start if self.driver else len(self.states)

    @cached_property
    def stores(self) -> list[Store]:
        """The inductances and capacitances of the driver that are states."""
        found: list[Store] = []
        if self.driver is None:
            return found
        channels = SubCircuit("channels", "mark")
        add_channels(channels, self.driver, dict(zip(GROUPS, METERED, strict=True)))
        for group in GROUPS:
            for part in self.driver.parts(group):
                instance = part.instance.lower()
                nodes = channels[f"X{part.instance}"].node_names
                pins = {"0": "0"} | dict(zip(part.library.pin_names, nodes, strict=True))
                for device, first, second, start in _STORE.findall(part.library.subcircuit):
                    # a capacitance of 1 F stands for a short circuit
                    short = start == _CAPACITORS.get(part.label) and NO_CAPACITOR in (
                        part.values.get("capacitance"), part.values.get("series_capacitance")
                    )  # fmt: skip
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
            for part in self.front.parts(group):
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
        parts = [part for group in GROUPS for part in self.front.parts(group) if part.label == "inductor"]
        return sum(part.values["capacitance"] != NO_CAPACITOR and part.values["bleeder"] >= 1e12 for part in parts)

    def store_phasors(self, pins: Mapping[str, complex], currents: Mapping[str, complex]) -> list[complex]:
        """Return the phasors of the stores of network and transformer in a linear steady state; else 0.

        ``pins`` has the phasors of the voltages in V at the pins of the groups, ``currents`` of their currents in A.
        The core of a transformer has the alternating flux alone; the halves of a primary share its current.
        """
        omega, of_devices = 2.0 * pi * self.front.frequency, dict[tuple[str, str], complex]()
        for group, stage in two_phasors(self.front).items():
            through = currents[group]
            for part, before in self.front.passed(group, pins[group], currents[group], omega):
                of_devices |= {(part.instance.lower(), device): value for device, value in before.stores.items()}
                through = before.amperes
            for part in self.front.parts(group):
                if part.label == self.front.transformer_label:
                    linked = part.values["coupling"] * part.values["ratio"]
                    volts = self.front.fundamental(group) / (linked * self.front.raised(group)) * stage / abs(stage)
                    core = linked * through + volts / (1j * omega * part.values["magnetizing"])
                    shares = {"lprimary": core, "lp": 0.5 * core, "ln": 0.5 * core}
                    of_devices |= {(part.instance.lower(), device): value for device, value in shares.items()}
        return [of_devices.get((store.instance, store.device), 0j) for store in self.stores]

    @cached_property
    def begins(self) -> float:
        """Phase of group A's control at which a run starts, as a fraction of a period; it is far from the edges."""
        phases = np.arange(_CANDIDATES) / _CANDIDATES
        edges = []
        for group in GROUPS:
            half = 0.5 * self.front.dead_time(group) * self.front.frequency  # of the dead time, in periods
            for delay in self.front.delays(group).values() or (Delay(1.0, 0.0),):
                edges += [edge + half for edge in delay.edges(self.front.ahead(group))]
        distances = np.abs((phases[:, np.newaxis] - edges + 0.5) % 1.0 - 0.5).min(axis=1)
        # the first of equal ones: rounding errors of the parts do not choose where the period and its steps begin
        return float(phases[distances > distances.max() - _EQUAL][0] - 0.5 * LEAD)

    def bench_texts(self, discretisation: Discretisation, *, meters: bool) -> dict[str, str]:
        """Return the subcircuit of motor, driver and shaft and those of its parts, by name.

        The state is a set of parameters of the X line.
        """
        starts, _ = self.start(np.zeros(len(self.states)), discretisation, plates=False)
        parameters = dict.fromkeys([*starts, *(store.name for store in self.stores)], "0")
        circuit = SubCircuit(self.bench_name, "mark", **parameters)
        add_channels(circuit, self.front, dict(zip(GROUPS, METERED, strict=True)), risen=True)
        for store in self.stores:
            circuit[f"X{store.instance}"].parameters[store.start] = f"{{{store.name}}}"
        for (instance, start), current in self._in_series.items():
            circuit[f"X{instance}"].parameters[start] = f"{{{current}}}"
        self._add_controls(circuit)
        self._add_shaft(circuit, discretisation, meters=meters)
        passed = {name: f"{{{name}}}" for name in starts}
        circuit.X("motor", self.motor_name, "a", "b", circuit.gnd, "shaft", **passed)
        parts = {name: LINE.sub("", text) for name, text in definition_texts(*self.front.libraries()).items()}
        parts |= definition_texts(*map(read_library, (BRAKE, *METERS) if meters else ()))
        return parts | self.motor_texts(discretisation, plotted=meters) | {self.bench_name: str(circuit).strip()}

    def _add_controls(self, circuit: SubCircuit) -> None:
        """Add the sources of the controls, and the state of the delays; the supplies rose long ago."""
        for group in GROUPS:
            begins = self.begins + self.front.ahead(group)
            amplitude, turned = control_amplitude(self.front, group), 360.0 * (begins % 1.0)
            control = f"SIN(0 {amplitude!r} {self.front.frequency!r} 0 0 {turned!r})"
            circuit.V(groups.named("control", group), groups.named("control", group), circuit.gnd, control)
            level = sin(2.0 * pi * begins)
            for name, delay in self.front.delays(group).items():
                above = delay.sign * level > delay.level
                circuit[groups.named("Xstage", group)].parameters[name] = 1.0 if above else -1.0
            add_breakpoints(circuit, self.front, group, self.begins)

    def _add_shaft(self, circuit: SubCircuit, discretisation: Discretisation, *, meters: bool) -> None:
        """Add what holds or loads the shaft, and the meters, if any."""
        if meters:
            add_meters(circuit, self.motor, self.law, {"lag": discretisation.slider_time})
            circuit.V("set", "set", circuit.gnd, f"DC {float(self.load.speed or 0.0)!r}")
            connect_brake(circuit, self.motor, self.load.torque, grips=self.load.speed is not None)
            return
        for group, line in zip(GROUPS, METERED, strict=True):
            circuit.V(line, line, group, "DC 0")
        if self.load.speed is not None:
            circuit.V("shaft", "shaft", circuit.gnd, f"DC {float(self.load.speed)!r}")
        elif self.load.torque:
            circuit.I("load", "shaft", circuit.gnd, f"DC {float(self.load.torque)!r}")


# trtol of ngspice's control of the truncation error. At the usual 1e9 it shortens steps where the lags of a stem with a
# compliance of 1e-4 m/N come to rest, and the steps of a period are not uniform.
UNIFORM = "1e18"


def phasor_at(
    tone: Tone, gain: complex | NDArray[np.complex128], time: float | Array
) -> tuple[float | Array, float | Array]:
    """Return a linear response to a tone, and its rate, at a time in s: Im(gain · amplitude · e^(jωt + jφ))."""
    omega = 2.0 * pi * tone.frequency
    turning = tone.amplitude * gain * np.exp(1j * (omega * time + tone.phase))
    return turning.imag, (1j * omega * turning).imag


@dataclass(frozen=True)
class Copy:
    """One copy of a plant."""

    plant: Plant  # motor, drive, load and law
    state: Array  # at the start
    begun: float = 0.0  # time in s since the drive's phase was that of t = 0
    reach: int | None = None  # number of sliders of a brush that probably touch something; ``None`` if it is not known

    def with_sliders(self, sliders: int) -> Copy:
        """Return the copy with the inner sliders of a brush alone."""
        first = self.plant.places["contact"].start
        beyond = range(first + sliders, self.plant.places["contact"].stop)
        return replace(self, plant=self.plant.with_sliders(sliders), state=np.delete(self.state, beyond))


def content_name(prefix: str, *values: object) -> str:
    """Return a name that depends only on the values, in lower case as in ngspice's vectors."""
    return f"{prefix}_{hashlib.sha256(repr(values).encode()).hexdigest()[:16]}"


def copy_name(number: int) -> str:
    """Return the name of a copy's instance, in lower case as in ngspice's vectors."""
    return f"xc{number}"


def copies_bench(
    copies: Sequence[Copy],
    discretisation: Discretisation,
    texts: Mapping[str, dict[str, str]] | None = None,
    *,
    plates: bool = True,
) -> Bench:
    """Return the bench of many copies, instances ``Xc0``, ``Xc1``, … with their shafts at ``xc0_shaft``, ….

    Copies with the same drive in the same phase share their sources. The law is the same in all copies. ``texts`` has
    the subcircuits by :attr:`Plant.motor_name`; by default they are written. Without ``plates``, the clamped
    capacitances, the currents of the sources are those of the modes alone, and the motion is the same.
    """
    first, lines, motors, sources = copies[0].plant, list[str](), dict[str, Motor](), dict[tuple[Any, ...], int]()
    start, signals, subcircuits = dict[str, float](), dict[str, Derived](), dict[str, str]()
    options = dict(transient_options(first.motor, first.law))
    for number, copy in enumerate(copies):
        plant, instance = copy.plant, copy_name(number)
        if plant.motor_name not in motors:
            motors[plant.motor_name] = plant.motor
            known = texts and texts[plant.motor_name]
            subcircuits |= known or plant.motor_texts(discretisation, plates=plates)
            tolerances = transient_options(plant.motor, first.law)
            for name in ("vntol", "abstol"):
                options[name] = min(options[name], tolerances[name], key=float)
        signals |= plotted_nodes(plant.motor, plant.law, instance)
        key = (plant.drive, copy.begun)
        if key not in sources:
            sources[key] = len(sources)
            lines += _drive_lines(plant, copy.begun, sources[key])
        shaft = f"{instance}_shaft"
        if plant.load.speed is not None:
            lines.append(f"V{shaft} {shaft} 0 DC {float(plant.load.speed)!r}")
        elif plant.load.torque:
            lines.append(f"I{shaft} {shaft} 0 DC {float(plant.load.torque)!r}")
        starts, inside = plant.start(copy.state, discretisation, copy.begun, plates=plates)
        values = " ".join(f"{name}={value:.17g}" for name, value in starts.items())
        pins = f"a{sources[key]} b{sources[key]} 0 {shaft}"
        lines.append(f"{instance} {pins} {plant.motor_name} {values}")
        start |= {f"{instance}.{node}": value for node, value in inside.items()}
    circuit = Circuit(f"{len(copies)} copies of {first.motor.name}")
    circuit.raw_spice += "\n".join([*subcircuits.values(), *lines]) + "\n"
    options = not_below_rounding(options, motors.values(), first.law, discretisation)
    options["trtol"] = UNIFORM
    return Bench(circuit, options, start, signals)


def _drive_lines(plant: Plant, begun: float, number: int) -> list[str]:
    lines = []
    for group, tones in zip("ab", plant.drive.tones, strict=True):
        node = f"{group}{number}"
        for index, tone in enumerate(tones):
            after = f"{group}{number}_{index + 1}" if index + 1 < len(tones) else "0"
            lines.append(f"V{group}{number}_{index} {node} {after} {sine(tone, begun)}")
            node = after
    return lines


def drive_voltage(tones: Sequence[Tone], time: Array) -> Array:
    """Return the voltage of a group in V."""
    voltage = np.zeros(np.shape(time))
    for tone in tones:
        voltage += tone.amplitude * np.sin(2.0 * pi * tone.frequency * time + tone.phase)
    return voltage


def driven_bench(copies: Sequence[Copy], discretisation: Discretisation, *, meters: bool = False) -> Bench:
    """Return the bench of copies of motors behind their drivers: instances ``Xc0``, ``Xc1``, ….

    The period begins at :data:`LEAD` of it after the start of the run, where a pulse makes ngspice compute a point.
    With ``meters`` each shaft has a dynamometer, and the motor the meters of :func:`.dynamometer_bench`.
    """
    lines, subcircuits, start = [], dict[str, str](), dict[str, float]()
    signals: dict[str, Derived] = {}
    first = copies[0].plant
    if not first.front.uniform:
        lines.append(f"Vmark mark 0 PULSE(0 1 {LEAD * first.front.period!r} 1n 1n 1 2)")
    lines.append("Rmark mark 0 1")
    for number, copy in enumerate(copies):
        plant, instance = copy.plant, copy_name(number)
        if plant.bench_name not in subcircuits:
            subcircuits |= plant.bench_texts(discretisation, meters=meters)
        motor, stores = np.split(copy.state, [len(plant.states)])
        values, nodes = plant.start(motor, discretisation, plates=False)
        values |= zip((store.name for store in plant.stores), stores, strict=True)
        words = " ".join(f"{name}={value:.17g}" for name, value in values.items())
        lines.append(f"{instance} mark {plant.bench_name} {words}")
        start |= {f"{instance}.xmotor.{node}": float(value) for node, value in nodes.items()}
        signals |= {} if meters else plotted_nodes(plant.motor, plant.law, f"{instance}.xmotor")
    circuit = Circuit(f"{len(copies)} copies of {first.motor.name} behind a driver")
    circuit.raw_spice += "\n".join([*subcircuits.values(), *lines]) + "\n"
    options = {**first.front.options(first.motor, first.law)}
    if not first.front.uniform:
        options |= OF_SEVERAL if len(copies) > 1 else OF_ONE
    return Bench(circuit, options, start, signals=signals)
