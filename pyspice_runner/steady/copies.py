# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench of the steady state: many copies of a running motor in one circuit, each with its own initial state.

All copies have the same time axis, so that one run of ngspice maps all states over a period of the drive. Copies of the
same motor share its subcircuit; the state at the start is a set of parameters on the X line of each copy.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.bench import Bench, Derived
from pyspice_runner.circuit.evaluated import plotted_nodes
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import MotorSubCircuit, dielectric_branches, dielectric_matrix
from pyspice_runner.circuit.source import not_below_rounding, sine, transient_options
from pyspice_runner.circuit.state import (
    Discretisation,
    Kind,
    State,
    carrier,
    first_guess,
    motion_of,
    motor_states,
    plate_nodes,
    start_nodes,
    start_parameters,
)
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Drive, Load, Tone
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Mount
from pyspice_runner.spice.library import PREFIX

Array = NDArray[np.float64]


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
        return motor_states(self.motor, self.law, ("mode", "contact", "stem", "mount", *turning))

    @cached_property
    def period(self) -> float:
        """Period of the drive in s."""
        return self.drive.period

    @cached_property
    def _places(self) -> dict[Kind, slice]:
        """The places of the states of each part of the motor, which follow each other."""
        found: dict[Kind, slice] = {}
        for place, state in enumerate(self.states):
            found[state.kind] = slice(found[state.kind].start if state.kind in found else place, place + 1)
        return found

    def where(self, kind: Kind) -> slice:
        """Return the place of the states of a part of the motor."""
        return self._places.get(kind, slice(0, 0))

    @cached_property
    def _inner(self) -> dict[int, Plant]:
        return {}

    def with_sliders(self, sliders: int) -> Plant:
        """Return the plant with the inner ones of the sliders of a brush, for a motion that touches no other."""
        assert self.law is not None
        if sliders == self.law.sliders:
            return self
        return self._inner.setdefault(sliders, replace(self, law=self.law.inner(sliders)))

    def widened(self, values: Array, inner: Plant, *axes: int) -> Array:
        """Return values of the states of :meth:`with_sliders` along some axes with zeros for the sliders left out."""
        left_out = [inner.where("contact").stop] * (self.order - inner.order)
        for axis in axes if left_out else ():
            values = np.insert(values, left_out, 0.0, axis)
        return values

    @property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.motor.modes)

    @property
    def slider(self) -> int | None:
        """Place of the slider of a law with a single one."""
        return 2 * self.modes if self.law and self.law.sliding and not self.law.row else None

    @property
    def mount(self) -> Mount | None:
        """The mount in the netlist."""
        return carrier(self.motor, self.law)

    @property
    def carrier(self) -> slice:
        """Place of displacement and velocity of the carrier, if there is one."""
        return self.where("mount")

    @property
    def turns(self) -> bool:
        """Whether the speed of the rotor is a state."""
        return self.load.speed is None

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.states)

    def motor_texts(
        self, discretisation: Discretisation, *, plates: bool = True, plotted: bool = False
    ) -> dict[str, str]:
        """Return the subcircuit of the motor and those of its parts, by name.

        ``plates`` tells whether the motor has its clamped capacitances, and ``plotted`` whether a brush has the nodes
        ``slider`` and ``state``.
        """
        name = self.motor_name
        definition = MotorSubCircuit(
            self.motor, law=self.law, discretisation=discretisation, startable=True, plates=plates, plotted=plotted,
            name=name, prefix=PREFIX,
        )  # fmt: skip
        return definition.part_texts | {name: str(definition).strip()}

    def start_values(self, state: Array, discretisation: Discretisation) -> dict[str, float]:
        """Return the parameters of the X line for a state."""
        values = start_parameters(self.states, state.tolist(), discretisation)
        return values if self.load.speed is None else values | {"start_speed": self.load.speed}

    def start_nodes(
        self,
        state: Array,
        begun: float,
        discretisation: Discretisation,
        probes: Sequence[Probe] = (),
        *,
        plates: bool = True,
    ) -> dict[str, float]:
        """Return the initial voltages by node inside the motor: of plates and of states without a parameter."""
        nodes = start_nodes(self.states, state.tolist(), discretisation)
        stem_m = motion_of(self.states, state.tolist()).stem_m
        nodes |= first_guess(self.motor, self.law, stem_m, discretisation)
        for group in "ab" if plates else "":
            tones = self.tones(group, probes)
            for node, branch in zip(plate_nodes(group), dielectric_branches(self.motor, group), strict=True):
                volts = (phasor_at(tone, branch.gain(tone.frequency), begun)[0] for tone in tones)
                nodes[node] = float(sum(volts))
        return nodes

    def tones(self, group: str, probes: Sequence[Probe] = ()) -> tuple[Tone, ...]:
        """Return the sines at the pin of a group, with those of the probes."""
        return (*groups.of(self.drive.tones, group), *(probe.tone for probe in probes if probe.place == group))

    def vectors(self, instance: str, shaft: str) -> list[str]:
        """Return the vectors that hold the states, in their order, for an instance and the node of its shaft."""
        return [state.within(instance, shaft) for state in self.states]

    def units(self, discretisation: Discretisation) -> Array:
        """Return the SI value of 1 V or 1 A of each of these vectors."""
        return np.array([state.scale(discretisation) for state in self.states])


# trtol of ngspice's control of the truncation error. At the usual 1e9 it shortens steps where the lags of a stem with a
# compliance of 1e-4 m/N come to rest, and the steps of a period are not uniform.
UNIFORM = "1e18"


def phasor_at(tone: Tone, gain: complex, time: float | Array) -> tuple[float | Array, float | Array]:
    """Return a linear response to a tone, and its rate, at a time in s: Im(gain · amplitude · e^(jωt + jφ))."""
    omega = 2.0 * pi * tone.frequency
    turning = tone.amplitude * gain * np.exp(1j * (omega * time + tone.phase))
    return turning.imag, (1j * omega * turning).imag


@dataclass(frozen=True)
class Probe:
    """A small sine in addition to the drive or the load."""

    # ``"a"`` or ``"b"``, in series with the source of that group, V; ``"shaft"``, a torque on the rotor, N·m.
    place: str
    tone: Tone  # the sine


@dataclass(frozen=True)
class Copy:
    """One copy of a plant."""

    plant: Plant  # motor, drive, load and law
    state: Array  # at the start
    begun: float = 0.0  # time in s since the drive's phase was that of t = 0
    probes: tuple[Probe, ...] = ()  # small sines in addition to drive and load
    reach: int | None = None  # number of sliders of a brush that probably touch something; ``None`` if it is not known

    def with_sliders(self, sliders: int) -> Copy:
        """Return the copy with the inner sliders of a brush alone."""
        first = self.plant.where("contact").start
        beyond = range(first + sliders, self.plant.where("contact").stop)
        return replace(self, plant=self.plant.with_sliders(sliders), state=np.delete(self.state, beyond))


def content_name(prefix: str, *values: object) -> str:
    """Return a name that depends only on the values, in lower case as in ngspice's vectors."""
    return f"{prefix}_{hashlib.sha256(repr(values).encode()).hexdigest()[:16]}"


def copy_name(number: int) -> str:
    """Return the name of a copy's instance, in lower case as in ngspice's vectors."""
    return f"xc{number}"


def motor_texts(
    copies: Sequence[Copy], discretisation: Discretisation, *, plates: bool = True
) -> dict[str, dict[str, str]]:
    """Return the subcircuits of each motor, by its name; the arguments are those of :func:`copies_bench`."""
    plants = {copy.plant.motor_name: copy.plant for copy in copies}
    return {name: plant.motor_texts(discretisation, plates=plates) for name, plant in plants.items()}


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
    first = copies[0].plant
    texts = texts or motor_texts(copies, discretisation, plates=plates)
    sources: dict[tuple[Any, ...], int] = {}
    start: dict[str, float] = {}
    signals: dict[str, Derived] = {}
    plants = list({copy.plant.motor_name: copy.plant for copy in copies}.values())
    for plant in plants:
        own = [copy_name(number) for number, copy in enumerate(copies) if copy.plant.motor_name == plant.motor_name]
        signals |= plotted_nodes(plant.motor, plant.law, *own)
    subcircuits = {part: text for plant in plants for part, text in texts[plant.motor_name].items()}
    lines = [*subcircuits.values()]
    for number, copy in enumerate(copies):
        plant, instance = copy.plant, copy_name(number)
        at_pins = tuple(probe for probe in copy.probes if probe.place != "shaft")
        key = (plant.drive, copy.begun, at_pins)
        if key not in sources:
            sources[key] = len(sources)
            lines += _drive_lines(plant, at_pins, copy.begun, sources[key])
        shaft = f"{instance}_shaft"
        if plant.load.speed is not None:
            lines.append(f"V{shaft} {shaft} 0 DC {float(plant.load.speed)!r}")
        elif plant.load.torque:
            lines.append(f"I{shaft} {shaft} 0 DC {float(plant.load.torque)!r}")
        for place, probe in enumerate(copy.probes):
            if probe.place == "shaft":
                lines.append(f"I{shaft}_{place} 0 {shaft} {sine(probe.tone, copy.begun)}")
        start_values = plant.start_values(copy.state, discretisation)
        values = " ".join(f"{name}={value:.17g}" for name, value in start_values.items())
        pins = f"a{sources[key]} b{sources[key]} 0 {shaft}"
        lines.append(f"{instance} {pins} {plant.motor_name} {values}")
        inside = plant.start_nodes(copy.state, copy.begun, discretisation, copy.probes, plates=plates)
        start |= {f"{instance}.{node}": value for node, value in inside.items()}
    circuit = Circuit(f"{len(copies)} copies of {first.motor.name}")
    circuit.raw_spice += "\n".join(lines) + "\n"
    tolerances = [transient_options(plant.motor, first.law) for plant in plants]
    options = tolerances[0] | {name: min((own[name] for own in tolerances), key=float) for name in ("vntol", "abstol")}
    options = not_below_rounding(options, (plant.motor for plant in plants), first.law, discretisation)
    options["trtol"] = UNIFORM
    return Bench(circuit, options, start, signals)


def _drive_lines(plant: Plant, probes: Sequence[Probe], begun: float, number: int) -> list[str]:
    lines = []
    for group in "ab":
        tones = plant.tones(group, probes)
        nodes = [f"{group}{number}", *(f"{group}{number}_{index}" for index in range(1, len(tones))), "0"]
        for index, tone in enumerate(tones):
            lines.append(f"V{group}{number}_{index} {nodes[index]} {nodes[index + 1]} {sine(tone, begun)}")
    return lines


def drive_voltage(tones: Sequence[Tone], time: Array) -> Array:
    """Return the voltage of a group in V."""
    return np.asarray(sum(tone.amplitude * np.sin(2.0 * pi * tone.frequency * time + tone.phase) for tone in tones))
