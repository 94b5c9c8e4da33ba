# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources at the pins of a motor: the interface of all of them, and ideal voltages, as sines or of any shape."""

from __future__ import annotations

import csv
import io
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import degrees, inf, pi
from pathlib import Path
from sys import float_info
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.evaluated import Derived
from pyspice_runner.circuit.law import PAPER_LAW, Law
from pyspice_runner.circuit.state import Discretisation, stems
from pyspice_runner.errors import ParameterError, located
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import groups
from pyspice_runner.motor.document import read_document
from pyspice_runner.motor.drive import Drive, OnePhaseDrive, Tone, TwoPhaseDrive, check_together
from pyspice_runner.motor.groups import GROUPS as GROUPS
from pyspice_runner.motor.motor import Motor, derived
from pyspice_runner.motor.refusal import Stated
from pyspice_runner.motor.thermal import Thermal

Pins = tuple[str, ...]  # nodes of the groups


# Newton's iteration ends at a relative change of 10⁻⁶, so that its error is far below that of the time step. Nodes have
# V, N, µm, m/s and rad/s of order one; a nanovolt and a nanoampere are negligible. The step is uniform: trtol switches
# off the control of the truncation error, which would shorten steps.
TRANSIENT_OPTIONS = {"reltol": "1e-6", "vntol": "1e-9", "abstol": "1e-9", "trtol": "1e9", "method": "trap"}
FEWEST_POINTS_PER_PERIOD = 16  # of the fastest motion; fewer points do not resolve it
UNIFORM_POINTS = 128  # steps in a period of the fastest motion, see Source.points_per_period
_SUMS = 16.0  # margin above the rounding error of one force; random motors needed up to 8
_SMALL = 1e-5  # tolerance over the smallest of a motor's forces and displacements, if a nanovolt is larger

MOST_POINTS = 20_000  # of a waveform: ngspice searches them at every step
_MOST_BYTES = 2**25  # of a file: that many points with all signals of a run
COLUMNS = ("time_s", "voltage_a_v", "voltage_b_v")
_EVER = 1e9  # s
_ON_A_LINE = 6


class Excitation(ABC):
    """What can drive a motor: a source, or what becomes one for a motor, such as a tracker."""

    @abstractmethod
    def as_source(self, motor: Motor, law: Law | None) -> Source:
        """Return the source for a motor with a law of its contact, ``None`` for a free tip."""


class Source(Excitation):
    """A source at the pins of a motor.

    A source adds itself to a circuit between ground and the nodes ``a`` and ``b``, and states the settings of a run.
    """

    def as_source(self, motor: Motor, law: Law | None) -> Source:  # noqa: ARG002
        """Return the source itself."""
        return self

    @property
    def given(self) -> Stated:
        """The drive or the driver whose values the paths ``drive.*`` name.

        Raises:
            ParameterError: for a source without such values.
        """
        if self.ideal is None:
            raise ParameterError(f"The parameters of a {type(self).__name__} have no paths.")
        return self.ideal

    @property
    def ideal(self) -> Drive | None:
        """The drive, if the voltages of the pins are its sines at any current; ``None`` for another source.

        The source then has no state, so that a run can continue from the motion of the motor alone.
        """
        return None

    @property
    def pins(self) -> tuple[str, ...]:
        """Pins of the motor beside a, b, com and shaft that the source drives, each at the node of its name."""
        return ()

    @property
    def thermal(self) -> Thermal | None:
        """Drift of the motor whose temperature the source sets; ``None`` if it sets none."""
        return None

    @property
    def own(self) -> bool:
        """Whether it is a subcircuit of the user's own, whose states are not known."""
        return False

    @property
    def unsteady(self) -> str:
        """Why shooting cannot find a steady state behind the source, as a sentence; empty if it can."""
        return f"The source ({self.label}) does not repeat after a fixed period, or has states that are not known."

    @property
    @abstractmethod
    def label(self) -> str:
        """Caption of a figure."""

    @property
    @abstractmethod
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies in Hz that the time step must resolve."""

    @property
    def period(self) -> float:
        """Period of the voltages in s; means are over whole periods."""
        return 1.0 / self.frequencies[0]

    @property
    def uniform(self) -> bool:
        """Whether a run takes uniform steps. Switching edges and digital events shorten them."""
        return False

    fewest_points = FEWEST_POINTS_PER_PERIOD  # minimum number of steps in a period of the fastest motion
    vectors: ClassVar[tuple[str, ...]] = ()  # that a run records in addition to those of the motor

    @property
    def points_per_period(self) -> int:
        """Default number of steps in a period of the fastest motion.

        With uniform steps and modes exact at resonance the error of the trapezoidal rule falls with the square of the
        step; at 128 it is below 0.1 % of the tip's motion at all reference points of the tests.
        """
        return UNIFORM_POINTS

    def ringing_step(self, motor: Motor) -> float:  # noqa: ARG002
        """Return the longest default step in s by what rings in the source itself with the motor's capacitances."""
        return inf

    @property
    def powers(self) -> Mapping[str, Derived]:
        """Powers and energies inside the source that a run need not compute, by the vectors of their nodes."""
        return {}

    def check(self, motor: Motor) -> None:
        """Raise a ParameterError if the source does not suit the motor."""

    @abstractmethod
    def options(self, motor: Motor, law: Law | None) -> Mapping[str, str]:
        """Return ngspice's options."""

    @abstractmethod
    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:
        """Add the source between ground and the nodes of groups A and B; it has been on for ``begun`` seconds."""

    @abstractmethod
    def initial_voltages(self) -> tuple[float, ...]:
        """Return the voltages of the pins in V just after t = 0, with which the plates start."""

    @abstractmethod
    def current(self, group: str) -> tuple[str, float]:
        """Return the vector of the current of a group, and the factor from it to the current into the pin in A."""

    def measured_period(self, samples: Mapping[str, Any]) -> float:  # noqa: ARG002
        """Return the period in s at the end of a run, if the source changes it, otherwise :attr:`period`."""
        return self.period

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the source with every setting, JSON-ready."""


class UniformSource(Source):
    """Ideal voltages with uniform steps; a subclass has ``drive`` and ``add``."""

    drive: Drive
    uniform = True
    unsteady = ""

    @property
    def label(self) -> str:
        """Caption of the drive."""
        return self.drive.label

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies of the drive in Hz."""
        return self.drive.frequencies

    @property
    def period(self) -> float:
        """Period of the drive in s."""
        return self.drive.period

    def check(self, motor: Motor) -> None:
        """Raise a ParameterError for a frequency far from the modes, or a voltage above what a stator withstands."""
        check_together(motor, self.drive)

    def options(self, motor: Motor, law: Law | None) -> Mapping[str, str]:
        """Return the options of a run with uniform steps."""
        return transient_options(motor, law)

    def initial_voltages(self) -> tuple[float, ...]:
        """Return U_A and U_B at t = 0 in V."""
        return self.drive.initial_voltages()

    def current(self, group: str) -> tuple[str, float]:
        """Return the current of the group's source, which ngspice counts from the pin into the source."""
        return f"i(v{group})", -1.0

    def to_dict(self) -> dict[str, Any]:
        """Return kind, label and values of the drive."""
        return {"kind": type(self.drive).__name__, "label": self.label, **self.drive.model_dump()}


@dataclass(frozen=True)
class DriveSource(UniformSource):
    """Ideal voltage sources at the pins: ``Va`` and ``Vb``."""

    drive: Drive  # the two voltages

    @property
    def ideal(self) -> Drive:
        """The drive."""
        return self.drive

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:
        """Add the sources ``Va`` and ``Vb``, which have been on for ``begun`` seconds."""
        for group, node, tones in zip(motor.groups, pins, self.drive.tones, strict=True):
            active = [tone for tone in tones if tone.amplitude] or [tones[0]]
            if self.drive.soft_start > 0.0:
                shape = "+".join(
                    f"({tone.amplitude!r})*sin({2.0 * pi * tone.frequency!r}*time"
                    f"+({tone.phase + 2.0 * pi * ((tone.frequency * begun) % 1.0)!r}))"
                    for tone in active
                )
                since = f"(time+{begun!r})" if begun else "time"
                source = groups.named("drive", group)
                circuit.raw_spice += f"B{source} {source} 0 V=min(1,{since}/{self.drive.soft_start!r})*({shape})\n"
                circuit.V(group, node, source, "DC 0")
                continue
            series = (f"{groups.named('drive', group)}{index}" for index in range(1, len(active)))
            nodes = [node, *series, circuit.gnd]
            for index, tone in enumerate(active):
                circuit.V(f"{group}{index or ''}", nodes[index], nodes[index + 1], sine(tone, begun))


@dataclass(frozen=True)
class Waveform(UniformSource):
    """Voltages at given times, with linear interpolation; the last values hold afterwards.

    They are functions of time in behavioural sources, which set no breakpoints: the steps stay uniform.

    Attributes:
        time_s: times in s, rising from 0.
        voltage_a_v: voltage of group A in V at them.
        voltage_b_v: that of group B.
        frequency: of the drive in Hz; means are over its periods, and it determines the time step.

    Raises:
        ParameterError: by the constructor, for arrays of different lengths, or a value out of range.
    """

    time_s: ArrayLike
    voltage_a_v: ArrayLike
    voltage_b_v: ArrayLike
    frequency: float

    def __post_init__(self) -> None:
        arrays = [_numbers(name, getattr(self, name)) for name in COLUMNS]
        for name, values in zip(COLUMNS, arrays, strict=True):
            object.__setattr__(self, name, values)
        time = arrays[0]
        if len({len(values) for values in arrays}) > 1:
            lengths = ", ".join(f"{name} {len(values)}" for name, values in zip(COLUMNS, arrays, strict=True))
            raise ParameterError(f"A waveform's columns must have one length, and have {lengths}.")
        if not 2 <= len(time) <= MOST_POINTS:
            raise ParameterError(f"A waveform has {len(time)} points: it must have 2 to {MOST_POINTS}. Thin it out.")
        if time[0] != 0.0 or (np.diff(time) <= 0.0).any():
            at = 0 if time[0] else int(np.argmax(np.diff(time) <= 0.0)) + 1
            raise ParameterError(f"time_s[{at}] = {time[at]:g} s: the times of a waveform must rise from 0 s.")
        _ = self.drive  # it checks frequency and largest voltage

    @property
    def drive(self) -> TwoPhaseDrive:  # type: ignore[override]
        """A drive of the same frequency and largest voltage, for the checks."""
        greatest = float(max(np.abs(self.voltage_a_v).max(), np.abs(self.voltage_b_v).max()))
        return TwoPhaseDrive(voltage=greatest, frequency=self.frequency)

    def check(self, motor: Motor) -> None:
        """Raise a ParameterError for a frequency far from the modes, or a voltage above what a stator withstands."""
        kind = TwoPhaseDrive if len(motor.groups) == 2 else OnePhaseDrive
        check_together(motor, kind(voltage=self.drive.voltage, frequency=self.frequency))

    @property
    def label(self) -> str:
        """Number of points and end time."""
        return f"waveform of {len(np.asarray(self.time_s))} points to {1e3 * np.asarray(self.time_s)[-1]:g} ms"

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add the two sources ``Va`` and ``Vb`` as ``pwl`` of the time, over many lines."""
        for group, pin, values in zip("ab", pins, (self.voltage_a_v, self.voltage_b_v), strict=False):
            times, volts = np.append(np.asarray(self.time_s), _EVER), np.append(values, np.asarray(values)[-1])
            pairs = [f"{at!r},{volt!r}" for at, volt in zip(times.tolist(), volts.tolist(), strict=True)]
            lines = [",".join(pairs[place : place + _ON_A_LINE]) for place in range(0, len(pairs), _ON_A_LINE)]
            voltage = "pwl(time,\n+ " + ",\n+ ".join(lines) + ")"
            source = groups.named("drive", group)
            circuit.raw_spice += f"B{source} {source} 0 V={voltage}\n"
            circuit.V(group, pin, source, "DC 0")

    def initial_voltages(self) -> tuple[float, ...]:
        """Return U_A and U_B at t = 0."""
        return float(np.asarray(self.voltage_a_v)[0]), float(np.asarray(self.voltage_b_v)[0])

    def to_dict(self) -> dict[str, Any]:
        """Return kind, number of points and frequency, JSON-ready."""
        points = len(np.asarray(self.time_s))
        return {"kind": type(self).__name__, "label": self.label, "points": points, "frequency": self.frequency}


def read_waveform(path: str | Path, frequency: float) -> Waveform:
    """Return a waveform from a CSV file with the columns time_s, voltage_a_v and voltage_b_v; others are ignored.

    The file of ``simulate --output`` is one. ``frequency`` is that of :class:`Waveform`.

    Raises:
        ParameterError: for a file that cannot be read, lacks a column, or has a cell that is not a number.
    """
    text = read_document(Path(path), "a .csv file", _MOST_BYTES)
    try:
        rows = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise ParameterError(f"{path} cannot be read as a waveform: {error}.") from None
    header = [name.strip() for name in rows[0]] if rows else []
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise ParameterError(f"{path} has no column {missing[0]}: its first line must name {', '.join(COLUMNS)}.")
    places = [header.index(name) for name in COLUMNS]
    found = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            found += [[float(row[place]) for place in places]] if any(row) else []
        except (ValueError, IndexError):
            raise ParameterError(
                f"{path}, line {number}: {','.join(row)[:60]!r} must have a number for each column."
            ) from None
    time, voltage_a, voltage_b = np.array(found, dtype=float).reshape(-1, len(COLUMNS)).T
    with located(str(path)):
        return Waveform(time, voltage_a, voltage_b, frequency)


def _numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        found = np.empty((0, 0))
    if found.ndim != 1:
        raise ParameterError(f"{name} of a waveform must be a list of numbers.")
    if not np.isfinite(found).all():
        raise ParameterError(f"{name}[{int(np.argmin(np.isfinite(found)))}] of a waveform is not a finite number.")
    return found


def source_of(excitation: Drive | Excitation, motor: Motor, law: Law | None) -> Source:
    """Return the source for a drive, or what else drives a motor."""
    return DriveSource(excitation) if isinstance(excitation, Drive) else excitation.as_source(motor, law)


@derived
def transient_options(motor: Motor, law: Law | None = PAPER_LAW) -> dict[str, str]:
    """Return :data:`TRANSIENT_OPTIONS`, with smaller tolerances for a motor with small contact forces.

    A nanovolt and a nanoampere are negligible in a motor of centimetres, but not against micronewtons in a MEMS.
    """
    if law is None:
        return TRANSIENT_OPTIONS
    depth = 1e6 * contact_law.static_penetration(motor.contact)
    friction = motor.contact.friction * motor.contact.preload_n
    volts = (motor.contact.preload_n, friction, depth, contact_law.limit_ratio(motor.contact) * depth)
    amperes = motor.rotor.radius_m * friction
    return TRANSIENT_OPTIONS | {
        name: f"{_SMALL * least:.3g}"
        for name, least in (("vntol", min(volts)), ("abstol", amperes))
        if _SMALL * least < float(TRANSIENT_OPTIONS[name])
    }


def not_below_rounding(
    options: Mapping[str, str], motors: Iterable[Motor], law: Law | None, discretisation: Discretisation | None
) -> dict[str, str]:
    """Return ngspice's options with tolerances that are not below rounding errors, 1 V = 1 A = 1 m/s.

    A compliance in series is compressed by the difference of two forces, and its rate is a difference over half a step:
    with 1e-5 m/N, 5 N and steps of 10 ps the error of the rate is 4e-8 m/s, below which no iteration comes. Damping
    changes the limit of stick by it, and so the velocity at which a slider is pulled back.
    """
    if discretisation is None or law is None:
        return dict(options)
    found, half_step = dict(options), discretisation.slider_time
    for motor in motors:
        contact = motor.contact
        compressed = contact.preload_n * stems(motor, law).get("stem", 0.0)
        rate = _SUMS * float_info.epsilon * compressed / half_step  # error of that of the compliance, m/s
        limit = contact_law.limit_ratio(contact) * contact_law.static_penetration(contact)
        pulled = limit * contact_law.normal_damping(contact) * rate / half_step  # error of that of the slider, m/s
        for name, least in (("vntol", rate), ("abstol", pulled)):
            found[name] = f"{least:.3g}" if least > float(found[name]) else found[name]
    return found


def sine(tone: Tone, begun: float = 0.0) -> str:
    """Return the value of a voltage source for a sine that has been on for ``begun`` seconds."""
    phase = degrees(tone.phase) + 360.0 * ((tone.frequency * begun) % 1.0)
    return f"SIN(0 {tone.amplitude!r} {tone.frequency!r} 0 0 {phase!r})"
