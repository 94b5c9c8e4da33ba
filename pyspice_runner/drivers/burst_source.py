# SPDX-License-Identifier: GPL-3.0-or-later
"""Two phases at the pins with a higher voltage at the start, and a resistor across each group after the stop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians, sin
from typing import Any

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.fixtures import transient_options
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.source import GROUPS, Pins, Source
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor

_EDGE = 1e-6  # s, in which voltage and resistance change
_LINE = 1.0  # Ω between source and pin while it drives: 0.1 V at 0.1 A


@dataclass(frozen=True)
class BurstSource(Source):
    """A burst of two phases."""

    drive: TwoPhaseDrive
    stop_at: float  # s, from which on the sources are at 0 V
    boost: float = 1.0  # factor of the voltages from the start to ``boost_s``
    boost_s: float = 0.0
    resistors: tuple[float, float] | None = None  # Ω, across groups A and B from the stop on; ``None``: a short circuit

    @property
    def label(self) -> str:
        """Caption of the drive."""
        return self.drive.label

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Frequency of the drive in Hz."""
        return self.drive.frequencies

    def options(self, motor: Motor, law: Law | None) -> Mapping[str, str]:
        """Return ngspice's options."""
        return transient_options(motor, law)

    def _tones(self) -> dict[str, tuple[float, float]]:
        """Return amplitude in V and phase in rad of each group."""
        return {"a": (self.drive.voltage, 0.0), "b": (self.drive.voltage_b, radians(self.drive.phase_deg))}

    def add(self, circuit: Circuit, motor: Motor, pins: Pins, *, begun: float) -> None:  # noqa: ARG002
        """Add the sources; behind each a conductance that changes at the stop, and an ammeter."""
        first = 1.0 if self.boost_s == 0.0 else self.boost
        boosted = f" {self.boost_s!r} {first!r} {self.boost_s + _EDGE!r} 1" if self.boost_s else ""
        level = f"PWL(0 {first!r}{boosted} {self.stop_at!r} 1 {self.stop_at + _EDGE!r} 0)"
        circuit.V("level", "level", circuit.gnd, level)
        circuit.V("on", "on", circuit.gnd, f"PWL(0 1 {self.stop_at!r} 1 {self.stop_at + _EDGE!r} 0)")
        after = self.resistors or (_LINE, _LINE)
        for group, pin, ohms, (volts, phase) in zip(GROUPS, pins, after, self._tones().values(), strict=True):
            wave = f"{volts!r}*V(level)*sin({2.0 * pi * self.drive.frequency!r}*time+{phase!r})"
            siemens = f"V(on)*{1.0 / _LINE!r}+(1-V(on))*{1.0 / ohms!r}"
            circuit.raw_spice += f"Bburst_{group} burst_{group} 0 V={wave}\n"
            circuit.raw_spice += (
                f"Bline_{group} burst_{group} line_{group} I=V(burst_{group},line_{group})*({siemens})\n"
            )
            circuit.V(f"pin_{group}", f"line_{group}", pin, "DC 0")

    def initial_voltages(self) -> tuple[float, float]:
        """Return the voltages of the pins at t = 0."""
        first = self.boost if self.boost_s else 1.0
        a, b = (first * volts * sin(phase) for volts, phase in self._tones().values())
        return a, b

    def current(self, group: str) -> tuple[str, float]:
        """Return the vector of the current into a pin, and its sign."""
        return f"i(vpin_{group})", 1.0

    def to_dict(self) -> dict[str, Any]:
        """Return the drive and the burst, JSON-ready."""
        return {
            **self.drive.model_dump(), "kind": type(self).__name__, "label": self.label, "stop_at_s": self.stop_at,
            "boost": self.boost, "boost_s": self.boost_s, "resistors_ohm": self.resistors,
        }  # fmt: skip
