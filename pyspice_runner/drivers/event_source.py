# SPDX-License-Identifier: GPL-3.0-or-later
"""A driver whose control stops or sweeps its frequency in a run, and a load that steps: what a driver must survive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians
from typing import Any

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.powers import Power
from pyspice_runner.circuit.source import GROUPS, Pins, Source
from pyspice_runner.drivers.driver import Driver, add_driver, control_amplitude
from pyspice_runner.motor.motor import Motor

_EDGE = 1e-6  # s, in which a load steps and a control stops


@dataclass(frozen=True)
class EventfulDriver(Source):
    """A driver with events in its run, each of which may be left out."""

    driver: Driver
    load_at: float | None = None  # s, when the load steps
    load_torque: float = 0.0  # N·m, that it draws from then on
    stop_at: float | None = None  # s, when the controls stop: the gates of a bridge, the input of an amplifier
    first: float | None = None  # Hz, at which the frequency begins to sweep; ``None``: it stays
    rate: float = 0.0  # Hz/s, of the sweep

    @property
    def label(self) -> str:
        """Caption of the driver."""
        return self.driver.label

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Frequencies in Hz that the time step must resolve."""
        return self.driver.frequencies

    @property
    def uniform(self) -> bool:
        """Whether a run has uniform steps; the events shorten them."""
        return False

    @property
    def rise_time(self) -> float:
        """Time in s over which the supply rises."""
        return self.driver.rise_time

    @property
    def points_per_period(self) -> int:
        """Default number of steps in a period of the fastest motion."""
        return self.driver.points_per_period

    def ringing_step(self, motor: Motor) -> float:
        """Return the longest default step in s by what rings in the driver."""
        return self.driver.ringing_step(motor)

    @property
    def powers(self) -> Mapping[str, Power]:
        """Powers and energies inside the driver."""
        return self.driver.powers

    def options(self, motor: Motor, law: Law | None) -> Mapping[str, str]:
        """Return ngspice's options for a run with the driver."""
        return self.driver.options(motor, law)

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add driver, controls and the step of the load."""
        driver = self.driver
        add_driver(circuit, driver, dict(zip(GROUPS, pins, strict=True)), source=False)
        begins = driver.frequency if self.first is None else self.first
        on = "1"
        if self.stop_at is not None:
            on = "V(on)"
            circuit.V("on", "on", circuit.gnd, f"PWL(0 1 {self.stop_at!r} 1 {self.stop_at + _EDGE!r} 0)")
        for group in GROUPS:
            turned = radians(driver.phase_deg) if group == "b" else 0.0
            angle = f"{2.0 * pi!r}*({begins!r}+{0.5 * self.rate!r}*time)*time+{turned!r}"
            control = f"{control_amplitude(driver, group)!r}*{on}*sin({angle})"
            circuit.raw_spice += f"Bcontrol_{group} control_{group} 0 V={control}\n"
        if self.load_at is not None:
            step = f"PWL(0 0 {self.load_at!r} 0 {self.load_at + _EDGE!r} {self.load_torque!r})"
            circuit.I("step", "shaft", circuit.gnd, step)

    def initial_voltages(self) -> tuple[float, float]:
        """Return the voltages of the pins at t = 0."""
        return self.driver.initial_voltages()

    def current(self, group: str) -> tuple[str, float]:
        """Return the vector of the current into a pin, and its sign."""
        return self.driver.current(group)

    def to_dict(self) -> dict[str, Any]:
        """Return the driver, JSON-ready."""
        return self.driver.to_dict()
