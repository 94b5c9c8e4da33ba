# SPDX-License-Identifier: GPL-3.0-or-later
"""The switching of a bridge: whether its transistors turn on without voltage, and what would make them.

The leg commutates in the dead time: the current of its output charges the output capacitances of both transistors. If
the voltage across a transistor has not come to zero when it turns on, its channel discharges the rest (hard
switching).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pyspice_runner.netlist.drivers import IRF610, Driver
from pyspice_runner.netlist.library import number, read_library
from pyspice_runner.netlist.source import GROUPS
from pyspice_runner.run.window import Array, Window

ON = 0.8  # V, of the ramp of a leg at which a gate is at half its voltage, in the libraries of the bridges
ZERO = (
    0.05  # of the rails, voltage left below which a transistor turns on without voltage: less than 0.3 % of the energy
)
_POINTS = 400  # of the integrals over the voltage
_BEFORE, _AFTER = 0.5, 1.0  # of a dead time around it, in the picture of an edge


@dataclass(frozen=True)
class TurnOn:
    """The turn-on of one transistor, means over the edges of the last periods."""

    transistor: str  # group and device, as in the losses: ``a.high``, ``b.pl``
    zero_voltage: bool  # whether hardly any voltage is left
    voltage_left_v: float  # across the transistor when it turns on
    current_a: float  # of the leg when the other transistor turns off; positive where it helps
    charge_c: float | None  # to be moved over the whole swing; ``None`` for a MOSFET of the user's own
    dead_time_s: (
        float | None
    )  # in which that current moves the charge; ``None`` where it does not help, or is not known
    hard_switching_w: float | None  # loss in the channel by the voltage that is left


@dataclass(frozen=True)
class _Leg:
    """One leg of a bridge."""

    ramp: str  # vector of its delayed control
    voltage: str  # vector of its output
    sign: float  # of the current in ``Vout``, positive out of the leg
    high: str  # names of its transistors
    low: str


def _legs(driver: Driver, group: str) -> list[_Leg]:
    """Return the legs of the bridge of a group."""
    stage = f"xstage_{group}"
    if driver.kind == "half-bridge":
        return [_Leg(f"v({stage}.ramp)", f"v(line_{group})", 1.0, "high", "low")]
    return [
        _Leg(f"v({stage}.ramp_p)", f"v(line_{group})", 1.0, "ph", "pl"),
        _Leg(f"v({stage}.ramp_n)", f"v(return_{group})", -1.0, "nh", "nl"),
    ]


def switching_vectors(driver: Driver) -> list[str]:
    """Return the vectors that :func:`turn_ons` takes, beside those of the report."""
    if driver.kind not in ("half-bridge", "full-bridge"):
        return []
    return [leg.ramp for group in GROUPS for leg in _legs(driver, group)]


def turn_ons(driver: Driver, samples: Mapping[str, Array], window: Window) -> tuple[TurnOn, ...]:
    """Return the turn-ons of all transistors of a bridge over the window; none for another stage."""
    found: list[TurnOn] = []
    for group in GROUPS if driver.kind in ("half-bridge", "full-bridge") else ():
        top, bottom = driver.rails(group)
        for leg in _legs(driver, group):
            for device, rising in ((leg.high, True), (leg.low, False)):
                edges = [edge for edge in _edges(samples, leg, rising) if edge[0] >= window.start]
                if edges:
                    found.append(_turn_on(driver, f"{group}.{device}", leg, rising, edges, samples, top, bottom))
    return tuple(found)


def edge_waveforms(driver: Driver, samples: Mapping[str, Array]) -> dict[str, Array]:
    """Return time, voltage and current of the first leg of group A around its last turn-on; empty for another stage."""
    if driver.kind not in ("half-bridge", "full-bridge"):
        return {}
    leg = _legs(driver, "a")[0]
    edges = _edges(samples, leg, rising=True)
    if not edges:
        return {}
    off, on = edges[-1]
    time = samples["time"]
    near = (time >= off - _BEFORE * (on - off)) & (time <= on + _AFTER * (on - off))
    return {
        "time_s": time[near] - off, "leg_voltage_v": samples[leg.voltage][near],
        "leg_current_a": leg.sign * samples["i(vout_a)"][near], "turn_on_s": np.array([on - off]),
    }  # fmt: skip


def _edges(samples: Mapping[str, Array], leg: _Leg, rising: bool) -> list[tuple[float, float]]:
    """Return the times at which the other transistor turns off and this one turns on, for every edge of a leg."""
    time, ramp = samples["time"], samples[leg.ramp] * (1.0 if rising else -1.0)
    offs, ons = (_crossings(time, ramp, level) for level in (-ON, ON))
    places = np.searchsorted(offs, ons) - 1
    return [(float(offs[place]), float(on)) for place, on in zip(places, ons, strict=True) if place >= 0]


def _crossings(time: Array, values: Array, level: float) -> Array:
    """Return the times at which a signal rises through a level."""
    before = np.flatnonzero((values[:-1] < level) & (values[1:] >= level))
    share = (level - values[before]) / (values[before + 1] - values[before])
    return np.asarray(time[before] + share * (time[before + 1] - time[before]))


def _turn_on(
    driver: Driver,
    name: str,
    leg: _Leg,
    rising: bool,
    edges: list[tuple[float, float]],
    samples: Mapping[str, Array],
    top: float,
    bottom: float,
) -> TurnOn:
    """Return the mean over the edges of a transistor."""
    time, offs, ons = samples["time"], *(np.array(times) for times in zip(*edges, strict=True))
    leg_v = np.interp(ons, time, samples[leg.voltage])
    left = float(np.mean(top - leg_v if rising else leg_v - bottom))
    helping = (-1.0 if rising else 1.0) * leg.sign
    current = helping * float(np.mean(np.interp(offs, time, samples[f"i(vout_{name[0]})"])))
    swing, charge, dead_time, loss = top - bottom, None, None, None
    if driver.mosfet == IRF610:
        charge = _integral(lambda volts: np.ones_like(volts), swing, swing)
        dead_time = charge / current if current > 0.0 else None
        loss = driver.frequency * _integral(lambda volts: volts, min(max(left, 0.0), swing), swing)
    return TurnOn(name, left <= ZERO * swing, left, current, charge, dead_time, loss)


def _integral(weight: Callable[[Array], Array], upper: float, swing: float) -> float:
    """Return ∫ weight(u) (C(u) + C(swing − u)) du from 0 to a voltage, for the capacitance C of the built-in MOSFET.

    With the weight 1 it is the charge that moves the leg, with the weight u the heat in the channel that moves it.
    """
    volts = np.linspace(0.0, upper, _POINTS)
    return float(np.trapezoid(weight(volts) * (output_capacitance(volts) + output_capacitance(swing - volts)), volts))


def output_capacitance(volts: Array) -> Array:
    """Return the output capacitance in F of the built-in MOSFET with its gate off, at voltages in V across it.

    By its model (ngspice manual, VDMOS): the junction of the body diode, and the capacitance between drain and gate.
    """
    words = dict(
        word.split("=") for word in read_library("driver_mosfet").subcircuit.replace("\n", " ").split() if "=" in word
    )
    names = ("Cjo", "Vj", "Cgdmin", "Cgdmax", "A")
    junction, potential, least, most, steepness = (number(words[name]) for name in names)
    share = (most - least) / (1.0 + 0.5 * np.pi)
    drain_gate = most - share - share * np.arctan(steepness * volts)
    return np.asarray(junction / np.sqrt(1.0 + volts / potential) + drain_gate)
