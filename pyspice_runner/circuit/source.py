# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources at the pins of a motor: the interface of all of them, and ideal voltages."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.fixtures import FEWEST_POINTS_PER_PERIOD, UNIFORM_POINTS, add_drive, transient_options
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.powers import Power
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import Drive, check_together
from pyspice_runner.motor.groups import GROUPS as GROUPS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import Stated
from pyspice_runner.motor.thermal import Thermal

Pins = tuple[str, str]  # nodes of groups A and B


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
        raise ParameterError(f"The parameters of a {type(self).__name__} have no paths.")

    @property
    def ideal(self) -> Drive | None:
        """The drive, if the voltages of the pins are its sines at any current; ``None`` for another source."""
        return None

    @property
    def pins(self) -> tuple[str, ...]:
        """Pins of the motor beside a, b, com and shaft that the source drives, each at the node of its name."""
        return ()

    @property
    def thermal(self) -> Thermal | None:
        """Drift of the motor whose temperature the source sets; ``None`` if it sets none."""
        return None

    def updated(self, changes: Mapping[str, Any]) -> Excitation | Drive:
        """Return the source with changed values of :attr:`given`. Raise ParameterError for an invalid one."""
        return self.given.updated(changes)  # type: ignore[return-value]

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

    @property
    def continues(self) -> bool:
        """Whether a run can continue from the motion of the motor alone, because the source has no state."""
        return False

    @property
    def rise_time(self) -> float:
        """Time in s over which the amplitude rises at the start."""
        return 0.0

    @property
    def fewest_points(self) -> int:
        """Least number of steps in a period of the fastest motion."""
        return FEWEST_POINTS_PER_PERIOD

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
    def vectors(self) -> tuple[str, ...]:
        """Vectors that a run records in addition to those of the motor."""
        return ()

    @property
    def powers(self) -> Mapping[str, Power]:
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
    def initial_voltages(self) -> tuple[float, float]:
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

    def initial_voltages(self) -> tuple[float, float]:
        """Return U_A and U_B at t = 0 in V."""
        return self.drive.initial_voltages()

    def current(self, group: str) -> tuple[str, float]:
        """Return the current of the group's source, which ngspice counts from the pin into the source."""
        return f"i(v{group})", -1.0

    def to_dict(self) -> dict[str, Any]:
        """Return kind and label, and the values of the drive."""
        return {"kind": type(self).__name__, "label": self.label, **self.drive.model_dump()}


@dataclass(frozen=True)
class DriveSource(UniformSource):
    """Ideal voltage sources at the pins: ``Va`` and ``Vb``."""

    drive: Drive  # the two voltages
    continues = True

    @property
    def given(self) -> Stated:
        """The drive."""
        return self.drive

    @property
    def ideal(self) -> Drive:
        """The drive."""
        return self.drive

    @property
    def rise_time(self) -> float:
        """Soft start of the drive in s."""
        return self.drive.soft_start

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add the two sources."""
        add_drive(circuit, self.drive, pins, begun=begun)

    def to_dict(self) -> dict[str, Any]:
        """Return kind, label and values of the drive."""
        return super().to_dict() | {"kind": type(self.drive).__name__}


def source_of(excitation: Drive | Excitation, motor: Motor, law: Law | None) -> Source:
    """Return the source for a drive, or what else drives a motor."""
    return DriveSource(excitation) if isinstance(excitation, Drive) else excitation.as_source(motor, law)
