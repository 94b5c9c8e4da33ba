# SPDX-License-Identifier: GPL-3.0-or-later
"""The built-in MOSFETs of the bridges: their libraries, with the ratings of their data sheets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.drivers.own_device import MOSFET
from pyspice_runner.spice.library import Header, Library, number, read_library

Array = NDArray[np.float64]
_POINTS = 400  # of the integrals over the voltage
DERATED = 0.9  # of the breakdown voltage, up to which a transistor is used
_LIBRARIES = {"IRF530": "driver_mosfet_irf530", "IRF610": MOSFET, "IRF820": "driver_mosfet_irf820"}
MOSFETS = tuple(_LIBRARIES)  # by their breakdown voltage


@dataclass(frozen=True)
class Ratings:
    """A MOSFET with the ratings of its data sheet."""

    library: Library  # its subcircuit bears the name of the part of the bridges that it is
    breakdown_v: float  # least
    on_resistance_ohm: float  # greatest, with 10 V at the gate
    gate_charge_nc: float  # greatest, to 10 V

    @property
    def highest_v(self) -> float:
        """Greatest voltage in V between drain and source."""
        return DERATED * self.breakdown_v

    def output_capacitance(self, volts: Array) -> Array:
        """Return the output capacitance in F with the gate off, at voltages in V across it.

        By its model (ngspice manual, VDMOS): the junction of the body diode, and the capacitance between drain and
        gate.
        """
        text = self.library.subcircuit.replace("\n", " ")
        words = dict(word.split("=") for word in text.split() if "=" in word)
        names = ("Cjo", "Vj", "Cgdmin", "Cgdmax", "A")
        junction, potential, least, most, steepness = (number(words[name]) for name in names)
        share = (most - least) / (1.0 + 0.5 * np.pi)
        drain_gate = most - share - share * np.arctan(steepness * volts)
        return np.asarray(junction / np.sqrt(1.0 + volts / potential) + drain_gate)

    def swing_charge(self, swing: float) -> float:
        """Return the charge in C that moves the middle of two transistors over a voltage in V."""
        return self._moved(lambda volts: np.ones_like(volts), swing, swing)

    def swing_loss(self, left: float, swing: float) -> float:
        """Return the heat in J of a channel that discharges a remaining voltage of a swing, both in V."""
        return self._moved(lambda volts: volts, min(max(left, 0.0), swing), swing)

    def _moved(self, weight: Callable[[Array], Array], upper: float, swing: float) -> float:
        """Return ∫ weight(u) (C(u) + C(swing − u)) du from 0 to a voltage, for the output capacitance C."""
        volts = np.linspace(0.0, upper, _POINTS)
        both = self.output_capacitance(volts) + self.output_capacitance(swing - volts)
        return float(np.trapezoid(weight(volts) * both, volts))


@cache
def ratings(name: str) -> Ratings:
    """Return a built-in MOSFET by its name, one of :data:`MOSFETS`."""
    library = read_library(_LIBRARIES[name])
    values = {key: number(text.split()[0]) for key, text in Header(library.name, library.text).entries("RATING", 2)}
    part = replace(library, name=MOSFET, subcircuit=library.subcircuit.replace(library.name, MOSFET))
    return Ratings(part, **values)


def suited(volts: float, swing: float, rms_a: float, frequency: float) -> str | None:
    """Return the MOSFET with the least loss of those that take a voltage in V; ``None`` if none does.

    The loss is that of a transistor that conducts for half of the time and discharges its swing in V when it turns on.
    """

    def loss(name: str) -> float:
        part = ratings(name)
        return 0.5 * part.on_resistance_ohm * rms_a**2 + frequency * part.swing_loss(swing, swing)

    return min((name for name in MOSFETS if volts <= ratings(name).highest_v), key=loss, default=None)
