# SPDX-License-Identifier: GPL-3.0-or-later
"""Running motors that a sampled controller can read and command: in ngspice, or as compiled code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Protocol

import numpy as np

from pyspice_runner.averaged.core import AveragedMotor
from pyspice_runner.averaged.library import Course
from pyspice_runner.averaged.simulate import INPUT_OF
from pyspice_runner.control.circuit import CHECKED, COMMANDS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.shaft import ShaftLoad
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.process import Session


@dataclass(frozen=True)
class State:
    """What a sample and the check are made of."""

    time: float  # s
    position: float = 0.0  # rad
    charge_a: complex = 0.0  # integral of the amplitude of the current into group A, A·s
    charge_b: complex = 0.0  # of group B; both relative to the voltage of group A
    flux_a: complex = 0.0  # integral of the amplitude of the voltage of group A, V·s
    flux_b: complex = 0.0
    load_position: float = 0.0  # rad, of what is coupled to the shaft
    temperature: float = 0.0  # K
    check: float = 0.0
    separated: float = 0.0
    tip_y_amplitude: float = 0.0  # m, fundamental of the tip towards the rotor
    heat: float = 0.0  # W
    energy: float = 0.0  # J, electrical, into both groups since the start


class Motion(Protocol):
    """A running motor."""

    def advance(self, until: float) -> State:
        """Run to a time in s."""

    def alter(self, name: str, value: float) -> None:
        """Set a command from now on."""


def first(course: Course) -> float:
    """Return the value of a course at the start."""
    return float(np.interp(0.0, *np.transpose(course)))


class Spice:
    """A motor in ngspice."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def advance(self, until: float) -> State:
        """Run to a time in s."""
        now = self._session.advance(until)

        def phasor(name: str, unit: float) -> complex:
            return unit * complex(now[f"v({name}_re)"], now[f"v({name}_im)"])

        check, separated, heat, *tip = (now.get(name, 0.0) for name in CHECKED)
        return State(
            now["time"], now["v(position)"], phasor("sum_a", 1e-6), phasor("sum_b", 1e-6), phasor("flux_a", 1e-3),
            phasor("flux_b", 1e-3), now.get("v(load_position)", now["v(position)"]), now.get("v(temperature)", 0.0),
            check, separated, 1e-6 * hypot(*tip), heat, 1e-3 * now["v(energy)"],
        )  # fmt: skip

    def alter(self, name: str, value: float) -> None:
        """Set a command from now on."""
        self._session.alter(COMMANDS[name], value)


class Compiled:
    """The compiled averaged motor."""

    def __init__(
        self, motor: Motor, settings: Mapping[str, Course], thermal: Thermal | None, shaft: ShaftLoad, *, steady: bool,
        networks: Sequence[Mapping[str, float]] = (),
    ) -> None:  # fmt: skip
        self._motor, self._time = AveragedMotor(motor, thermal=thermal, shaft=shaft, networks=networks), 0.0
        inputs = {of_c: settings[name] for name, of_c in INPUT_OF.items() if name in settings}
        self._motor.begin(**{name: first(course) for name, course in inputs.items()})
        self._courses = {name: course for name, course in inputs.items() if len(course) > 1}
        if steady:
            self._motor.settle()

    def advance(self, until: float) -> State:
        """Run to a time in s."""
        self._motor.advance(self._time, until, self._courses)
        self._time = until
        names = ("load_position", "temperature", "check", "separated", "tip_y_amplitude", "heat")
        numbers = {name: self._motor.get(name) for name in names}
        integrals, energy = self._motor.sums
        return State(until, self._motor.get("position"), *integrals, energy=energy, **numbers)

    def alter(self, name: str, value: float) -> None:
        """Set a command from now on."""
        self._motor.set(**{INPUT_OF[name]: value})
