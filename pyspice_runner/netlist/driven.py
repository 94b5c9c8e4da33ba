# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench of a motor behind a driver circuit, with the state of both as parameters: for the steady state.

The inductances and capacitances of the driver's parts are found in their libraries, by ``ic=0``. The capacitances of a
bridge's delays and transistors are no states: away from the switching edges the control determines them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import degrees, pi, sin

import numpy as np
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.model.drive import Tone
from pyspice_runner.netlist.benches import (
    METERED,
    add_brake,
    add_meters,
    add_set_speed,
    connect_brake,
    transient_options,
)
from pyspice_runner.netlist.copies import Copy, Plant, content_name, copy_name
from pyspice_runner.netlist.drivers import Driver, Part, add_driver, control_amplitude
from pyspice_runner.netlist.library import Library
from pyspice_runner.netlist.motor import Discretisation, plate_nodes
from pyspice_runner.netlist.source import GROUPS
from pyspice_runner.netlist.sources import Bench

Array = NDArray[np.float64]
LEAD = 0.05  # of a period, from the start of a run to that of the period: charges of the transistors settle in it
_CANDIDATES = 256  # phases at which a run may start
_STORE = re.compile(r"^([LC]\w*) (\S+) (\S+) (\{[^}]*\}|\S+) ic=0$", re.M)
_DELAY = "cdelay"  # device of a half bridge that the control charges to 1 V of its sign


@dataclass(frozen=True)
class Store:
    """An inductance or capacitance of a driver.

    Attributes:
        instance: instance of the part that it belongs to.
        device: its name there, in lower case.
        ends: nodes of the bench at its ends.
    """

    instance: str
    device: str
    ends: tuple[str, str]

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

    def value(self, samples: dict[str, Array], copy: str) -> Array:
        """Return its current in A or its voltage in V."""
        if self.coil:
            return samples[self.vectors(copy)[0]]
        first, second = (samples[f"v({copy}.{node})"] if node != "0" else 0.0 for node in self.ends)
        return np.asarray(first - second)


@dataclass(frozen=True)
class DrivenPlant(Plant):
    """A motor behind a driver. Its states are followed by the plates of both groups and by the driver's stores.

    Attributes:
        driver: the driver; ``drive`` is the fundamental of its stage.
        stage: sines that take the place of the power stage of each group, if any; the time is that of the run.
    """

    driver: Driver
    stage: Mapping[str, tuple[Tone, ...]] = field(default_factory=dict)

    @cached_property
    def bench_name(self) -> str:
        """Name of the subcircuit of motor and driver. Plants with equal values have equal names."""
        return content_name("driven", self.motor_name, self.driver.model_dump_json(), self.load, self.stage)

    @property
    def uniform(self) -> bool:
        """Whether ngspice's steps are uniform, because nothing switches."""
        return bool(self.stage) or self.driver.uniform

    @property
    def inner(self) -> int:
        """Number of states of the motor without its plates."""
        return super().order

    @property
    def order(self) -> int:
        """Number of states."""
        return self.inner + len(self.plates) + len(self.stores)

    @property
    def plates(self) -> list[str]:
        """Nodes of the capacitances of both groups inside the motor."""
        return [node for group in GROUPS for node in plate_nodes(group)]

    @cached_property
    def stores(self) -> list[Store]:
        """The inductances and capacitances of the driver that are states."""
        found = []
        lines = {line.split()[0].lower(): line.split()[1:] for line in self._body().splitlines() if line[:1] == "X"}
        for group in GROUPS:
            for part in self.driver.parts(group):
                instance = part.instance.lower()
                pins = dict(zip(part.library.pin_names, lines[f"x{instance}"], strict=False))
                for device, first, second, value in _STORE.findall(part.library.subcircuit):
                    if device.lower() == _DELAY or self._bridged(part, value):
                        continue
                    ends = [node if node == "0" else pins.get(node, f"x{instance}.{node}") for node in (first, second)]
                    found.append(Store(instance, device.lower(), (ends[0], ends[1])))
        return found

    @staticmethod
    def _bridged(part: Part, value: str) -> bool:
        """Whether the value of a capacitance, as an expression, is one farad, which stands for a connection."""
        return part.values.get(value.strip("{}")) == 1.0 and value == "{capacitance}"

    @cached_property
    def begins(self) -> float:
        """Part of a period, counted from the control of group A, after which a run starts: far from the edges."""
        phases = np.arange(_CANDIDATES) / _CANDIDATES
        edges = np.array([half - self._ahead(group) for group in GROUPS for half in (0.0, 0.5)])
        distances = np.abs((phases[:, np.newaxis] - edges + 0.5) % 1.0 - 0.5).min(axis=1)
        return float(phases[distances.argmax()] - 0.5 * LEAD)

    def _ahead(self, group: str) -> float:
        """Return by what part of a period a group is ahead of group A."""
        return self.driver.phase_deg / 360.0 if group == "b" else 0.0

    def _body(self) -> str:
        """Return the lines of the driver without its subcircuits and controls."""
        circuit = Circuit("driver")
        add_driver(circuit, self.driver, dict(zip(GROUPS, METERED, strict=True)), source=False)
        return _split(str(circuit))[1]

    def bench_text(self, discretisation: Discretisation, name: str, *, meters: bool) -> str:
        """Return the subcircuit of motor, driver and shaft, with the state as parameters of the X line."""
        start = self.start_values(np.zeros(self.order), discretisation)
        lines = [self._stage_lines(), *self._control_lines(), self._shaft_lines(discretisation, meters=meters)]
        lines.append(f"Xmotor a b 0 shaft {self.motor_name} {' '.join(f'{one}={{{one}}}' for one in start)}")
        text = "\n".join(lines)
        for store in self.stores:
            text = _append(text, f"X{store.instance}", f"start_{store.device}={{{store.name}}}")
        circuit = Circuit("parts")
        add_driver(circuit, self.driver, dict(zip(GROUPS, METERED, strict=True)), source=False)
        if meters:
            add_brake(circuit, meters=True)
        parts = _split(str(circuit))[0]
        for library in {library.name: library for library in self.driver.libraries()}.values():
            parts = _with_start(parts, library)
        parameters = " ".join(f"{one}=0" for one in [*start, *(store.name for store in self.stores)])
        motor = "\n".join(self.motor_texts(discretisation).values())
        whole = f"{parts}\n{motor}\n.subckt {name} mark {parameters}\n{text}\n.ends"
        return re.sub(r"\n\n+", "\n", whole)

    def _stage_lines(self) -> str:
        """Return the lines of the driver, its supplies risen long ago, or with sines in place of the stage."""
        text = re.sub(r"PWL\(0 0 \S+ (\S+)\)", r"DC \1", self._body()).strip()
        if self.stage:
            text = re.sub(r"^(Xstage_|Vvp_|Vvn_).*\n", "", text, flags=re.M | re.I)
        elif self.driver.kind == "half-bridge":
            for group in GROUPS:
                sign = 1.0 if sin(2.0 * pi * (self.begins + self._ahead(group))) > 0.0 else -1.0
                text = _append(text, f"Xstage_{group}", f"start_{_DELAY}={sign!r}")
        return text

    def _control_lines(self) -> list[str]:
        """Return the sources of the controls, and those in place of the stage."""
        lines = []
        for group, tones in self.stage.items():
            ends = [f"out_{group}", *(f"out_{group}_{index}" for index in range(1, len(tones))), "0"]
            for index, tone in enumerate(tones):
                sine = f"SIN(0 {tone.amplitude!r} {tone.frequency!r} 0 0 {degrees(tone.phase)!r})"
                lines.append(f"Vstage_{group}_{index} {ends[index]} {ends[index + 1]} {sine}")
        for group in GROUPS:
            turned = 360.0 * ((self.begins + self._ahead(group)) % 1.0)
            amplitude = control_amplitude(self.driver, group)
            sine = f"SIN(0 {amplitude!r} {self.driver.frequency!r} 0 0 {turned!r})"
            lines.append(f"Vcontrol_{group} control_{group} 0 {sine}")
        return lines

    def _shaft_lines(self, discretisation: Discretisation, *, meters: bool) -> str:
        """Return what holds or loads the shaft, and the meters, if any."""
        shaft = Circuit("shaft")
        if meters:
            add_meters(shaft, self.motor, {"lag": discretisation.slider_time})
            add_set_speed(shaft, self.load.speed)
            connect_brake(shaft, self.load.torque, grips=self.load.speed is not None)
            return _split(str(shaft))[1].strip()
        for group, line in zip(GROUPS, METERED, strict=True):
            shaft.V(line, line, group, "DC 0")
        if self.load.speed is not None:
            shaft.V("shaft", "shaft", shaft.gnd, f"DC {float(self.load.speed)!r}")
        elif self.load.torque:
            shaft.I("load", "shaft", shaft.gnd, f"DC {float(self.load.torque)!r}")
        return _split(str(shaft))[1].strip()


def driven_vectors(plant: DrivenPlant, copy: str) -> list[str]:
    """Return the vectors of a copy that hold its states."""
    own = [name.format(f"{copy}.xmotor") for name in Plant.vectors(plant)[: plant.inner - plant.turns]]
    own += [f"v({copy}.shaft)"] if plant.turns else []
    plates = [f"v({copy}.xmotor.{node})" for node in plant.plates]
    return [*own, *plates, *(name for store in plant.stores for name in store.vectors(copy))]


def driven_states(plant: DrivenPlant, samples: dict[str, Array], copy: str, discretisation: Discretisation) -> Array:
    """Return the states from the samples of these vectors, shape (order, points), in SI units."""
    names = driven_vectors(plant, copy)[: plant.inner + len(plant.plates)]
    units = np.append(Plant.units(plant, discretisation), np.ones(len(plant.plates)))
    rows = [samples[name] * unit for name, unit in zip(names, units.tolist(), strict=True)]
    return np.array([*rows, *(store.value(samples, copy) for store in plant.stores)])


def driven_bench(copies: Sequence[Copy], discretisation: Discretisation, *, meters: bool = False) -> Bench:
    """Return the bench of copies of motors behind their drivers: instances ``Xc0``, ``Xc1``, ….

    The period begins at :data:`LEAD` of it after the start of the run, where a pulse makes ngspice compute a point.

    Args:
        copies: the copies; their plants are :class:`DrivenPlant`.
        discretisation: adaptation to the step.
        meters: whether each shaft has a dynamometer, and the motor the meters of :func:`.dynamometer_bench`.
    """
    lines, names, start = [], set[str](), dict[str, float]()
    first = copies[0].plant
    assert isinstance(first, DrivenPlant)
    if not first.uniform:
        lines.append(f"Vmark mark 0 PULSE(0 1 {LEAD * first.driver.period!r} 1n 1n 1 2)")
    lines.append("Rmark mark 0 1")
    for number, copy in enumerate(copies):
        plant, instance = copy.plant, copy_name(number)
        assert isinstance(plant, DrivenPlant)
        if plant.bench_name not in names:
            names.add(plant.bench_name)
            text = plant.bench_text(discretisation, plant.bench_name, meters=meters)
            lines += [text] if len(names) == 1 else [_without_known(text, lines)]
        values = plant.start_values(copy.state[: plant.inner], discretisation)
        values |= zip(
            (store.name for store in plant.stores), copy.state[plant.inner + len(plant.plates) :], strict=True
        )
        words = " ".join(f"{name}={value:.17g}" for name, value in values.items())
        lines.append(f"{instance} mark {plant.bench_name} {words}")
        nodes = dict(zip(plant.plates, copy.state[plant.inner :], strict=False))
        nodes |= plant.start_nodes(copy.state[: plant.inner], 0.0, plates=False)
        start |= {f"{instance}.xmotor.{node}": float(value) for node, value in nodes.items()}
    circuit = Circuit(f"{len(copies)} copies of {first.motor.name} behind a driver")
    circuit.raw_spice += "\n".join(lines) + "\n"
    uniform = transient_options(first.motor, first.law)
    return Bench(circuit, uniform if first.uniform else first.driver.options(first.motor, first.law), start)


def _split(text: str) -> tuple[str, str]:
    """Return the subcircuits of a netlist, and its other lines without the title."""
    blocks = re.findall(r"^\.subckt .*?^\.ends[^\n]*\n", text, re.M | re.S | re.I)
    rest = re.sub(r"^\.subckt .*?^\.ends[^\n]*\n", "", text, flags=re.M | re.S | re.I)
    return "".join(blocks), re.sub(r"^\.title.*\n", "", rest, flags=re.M | re.I)


def _with_start(text: str, library: Library) -> str:
    """Make the initial values of a library's inductances and capacitances parameters of its subcircuit."""
    devices = [device.lower() for device, *_ in _STORE.findall(library.subcircuit)]
    if not devices:
        return text

    def changed(block: re.Match[str]) -> str:
        body = _STORE.sub(lambda line: f"{line.group()[:-1]}{{start_{line.group(1).lower()}}}", block.group())
        head, _, rest = body.partition("\n")
        return f"{head} {' '.join(f'start_{device}=0' for device in devices)}\n{rest}"

    return re.sub(rf"^\.subckt {library.name} .*?^\.ends", changed, text, count=1, flags=re.M | re.S | re.I)


def _append(text: str, instance: str, words: str) -> str:
    """Append parameters to the line of an instance."""
    return re.sub(rf"^{instance} .*$", lambda line: f"{line.group()} {words}", text, flags=re.M | re.I)


def _without_known(text: str, lines: Sequence[str]) -> str:
    """Return subcircuits without those of the driver that the lines already have."""
    known = {word.lower() for word in re.findall(r"^\.subckt (\S+)", "\n".join(lines), re.M | re.I)}
    blocks = re.findall(r"^\.subckt \S+ .*?^\.ends[^\n]*", text, re.M | re.S | re.I)
    return "\n".join(block for block in blocks if block.split()[1].lower() not in known)
