# SPDX-License-Identifier: GPL-3.0-or-later
"""Built-in parts of a driver: MOSFETs with the ratings of data sheets, networks and a match, values to be bought."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import floor, log10, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.drivers.own_device import MOSFET
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.spice.library import Header, Library, number, read_library

CABLE = "cable"  # label of the part between network and pin
NO_CAPACITOR = 1.0  # F in series, which stands for none


class Passed(NamedTuple):
    """A part in a linear steady state. Phasors are complex numbers or arrays of them."""

    volts: Any  # in front of it, V
    amperes: Any  # into it, A
    inner: Any  # voltage at the node ``inner`` of a network
    stores: dict[str, Any]  # currents of its inductances and voltages of its capacitances, by device in lower case


def passed(label: str, values: Mapping[str, float], volts: Any, amperes: Any, omega: Any) -> Passed | None:
    """Return the phasors in front of a part for those behind it, at an angular frequency in rad/s.

    ``None`` for a part that is none of these. Below 0 rad/s the phasors are conjugate ones.
    """
    if label == CABLE:
        through = amperes + 1j * omega * values["capacitance"] * volts
        before = volts + (values["resistance"] + 1j * omega * values["inductance"]) * through
        return Passed(before, through, volts, {"lline": through, "cline": volts})
    if label not in ("inductor", "llcc"):
        return None
    prefix, through, across = "", amperes, 0j
    if label == "llcc":
        prefix = "series_"
        across = volts / (values["parallel_resistance"] + 1j * omega * values["parallel_inductance"])
        through = amperes + across + 1j * omega * values["parallel_capacitance"] * volts
    capacitance, capacitor = values[f"{prefix}capacitance"], 0j
    if capacitance != NO_CAPACITOR:
        capacitor = through / (1j * omega * capacitance + 1.0 / values["bleeder"])
    coil = values[f"{prefix}resistance"] + 1j * omega * values[f"{prefix}inductance"]
    winding = through * coil / (1.0 + 1j * omega * values["winding_capacitance"] * coil)
    stores = {"lseries": winding / coil, "cseries": capacitor, "cwinding": winding, "lparallel": across}
    return Passed(volts + capacitor + winding, through, volts + capacitor, stores | {"cparallel": volts})


Array = NDArray[np.float64]
_POINTS = 400  # of the integrals over the voltage
DERATED = 0.9  # of the breakdown voltage, up to which a transistor is used
_LIBRARIES = {"IRF530": "driver_mosfet_irf530", "IRF610": MOSFET, "IRF820": "driver_mosfet_irf820"}
MOSFETS = tuple(_LIBRARIES)  # by their breakdown voltage


@dataclass(frozen=True)
class Ratings:
    """A MOSFET with the ratings of its data sheet."""

    library: Library  # its subcircuit has the name of the part of the bridges that it is
    breakdown_v: float  # smallest
    on_resistance_ohm: float  # largest, with 10 V at the gate
    gate_charge_nc: float  # largest, to 10 V
    drain_a: float  # continuous, at a case of 25 °C
    drain_pulsed_a: float
    junction_case_k_per_w: float  # largest
    case_ambient_k_per_w: float  # largest, without a heat sink
    junction_c: float  # highest

    @property
    def highest_v(self) -> float:
        """Largest voltage in V between drain and source."""
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
    """Return the MOSFET with the smallest loss of those that take a voltage in V; ``None`` if none does.

    The loss is that of a transistor that conducts for half of the time and discharges its swing in V when it turns on.
    """

    def loss(name: str) -> float:
        part = ratings(name)
        return 0.5 * part.on_resistance_ohm * rms_a**2 + frequency * part.swing_loss(swing, swing)

    return min((name for name in MOSFETS if volts <= ratings(name).highest_v), key=loss, default=None)


# IEC 60063: preferred values of a decade
E12 = (1.0, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 3.9, 4.7, 5.6, 6.8, 8.2)
E24 = (
    1.0, 1.1, 1.2, 1.3, 1.5, 1.6, 1.8, 2.0, 2.2, 2.4, 2.7, 3.0,
    3.3, 3.6, 3.9, 4.3, 4.7, 5.1, 5.6, 6.2, 6.8, 7.5, 8.2, 9.1,
)  # fmt: skip

WINDING_QUALITY = 100.0  # of an inductor: assumed, that of a gapped ferrite core at some ten kHz
SMALLEST_INDUCTANCE, LARGEST_INDUCTANCE = 1e-6, 0.1  # H; catalogues of wound ferrite inductors end near 100 mH
WINDING_CAPACITANCE = 20e-12  # F: assumed, of a coil of several layers in a bobbin of two chambers
FEWEST_TIMES = 3.0  # self-resonance of a coil over the frequency; below, its inductance is more than an eighth too high
# V·s, the flux linkage at which the largest core saturates: 0.3 T (ferrite N87 at 100 °C, TDK data sheet: 0.39 T) in
# the 198 mm² of an RM 14 core (IEC 62317-4), times 1000 turns, about what its bobbin takes of wire of 0.2 mm
LARGEST_FLUX = 0.3 * 198e-6 * 1000.0
HIGHEST_COIL_VOLTAGE = 1000.0  # V, amplitude: assumed, two chambers of enamelled wire
HIGHEST_CAPACITOR_VOLTAGE = 1000.0  # V, amplitude: film and C0G capacitors of a nominal 1.6 kV or 2 kV
SMALLEST_CAPACITANCE, LARGEST_CAPACITANCE = 47e-12, 1e-6  # F; below, the wiring counts


def nearest(value: float, series: Sequence[float]) -> float:
    """Return the value of a series that is nearest to a positive one, by ratio."""
    decade = 10.0 ** floor(log10(value))
    chosen = min((*series, 10.0), key=lambda step: abs(log10(step * decade / value)))
    return float(f"{chosen * decade:.6g}")


def largest_inductance(frequency_hz: float, winding_f: float = WINDING_CAPACITANCE) -> float:
    """Return the largest inductance in H of a coil whose self-resonance is high enough above a frequency.

    ``winding_f`` is the capacitance of its winding.
    """
    return min(LARGEST_INDUCTANCE, 1.0 / ((2.0 * pi * FEWEST_TIMES * frequency_hz) ** 2 * winding_f))


def match_to_source(load_ohm: complex, source_ohm: float, frequency_hz: float) -> dict[str, float]:
    """Return the lossless elements that transform an impedance to a resistance, both in Ω, at a frequency in Hz.

    They are a coil in series, ``series_inductance`` in H, and across the load ``parallel_capacitance`` in F or
    ``parallel_inductance`` in H. With the load G + jB they have a susceptance b in total, and the impedance
    G/(G² + b²) − jb/(G² + b²): its real part is R for b = √(G/R − G²), and the coil cancels −jbR/G.

    Raises:
        ParameterError: for a source resistance that is not positive or above that of the load in its parallel form.
    """
    require(load_ohm.real > 0.0, "load_ohm", load_ohm, "of a positive resistance", unit="Ω")
    load, omega = 1.0 / load_ohm, 2.0 * pi * frequency_hz
    if not 0.0 < load.real * source_ohm <= 1.0:
        raise ParameterError(
            f"source_ohm = {source_ohm:g} Ω is not valid for a load of {1.0 / load.real:.4g} Ω in parallel with a "
            "reactance: it must be > 0 and at most that resistance. Take another one, or a transformer."
        )
    total = sqrt(load.real / source_ohm - load.real**2)
    across = (total - load.imag) / omega
    parallel = {"parallel_capacitance": across} if across > 0.0 else {"parallel_inductance": -1.0 / (omega**2 * across)}
    return {"series_inductance": total * source_ohm / load.real / omega, **parallel}
