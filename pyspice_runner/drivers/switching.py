# SPDX-License-Identifier: GPL-3.0-or-later
"""The switching of a bridge: whether its transistors turn on without voltage, and what would make them.

The leg commutates in the dead time: the current of its output charges the output capacitances of both transistors. If
the voltage across a transistor has not come to zero when it turns on, its channel discharges the rest (hard
switching).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.driver import BRIDGES, Driver
from pyspice_runner.drivers.mosfets import MOSFETS, ratings
from pyspice_runner.run.window import Array, Window

ON, OFF = 0.8, 0.6  # V, of the ramp of a leg at which a gate rises and falls through half its voltage, in the libraries
ZERO = (
    0.05  # of the rails, voltage left below which a transistor turns on without voltage: less than 0.3 % of the energy
)
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
class _Switch:
    """One transistor and the one that turns off before it turns on."""

    name: str  # group and device
    ramp: str  # vector of the delayed control
    rising: bool  # whether it turns on where the ramp rises
    voltage: str  # vector of the output of its leg, or of its drain
    top: float | None  # V, the rail from which the voltage across it is counted down; ``None``: up from ``bottom``
    bottom: float  # V
    current: str  # vector of the current that the other transistor carries, or of the output
    helping: float  # sign of that current where it moves the leg towards this transistor


def _switches(driver: Driver, group: str) -> list[_Switch]:
    """Return the transistors of the bridge of a group."""
    stage, (top, bottom) = f"xstage_{group}", driver.rails(group)
    if driver.kind == "push-pull":
        return [
            _Switch(
                f"{group}.{own}", f"v({stage}.ramp)", own == "p", f"v({stage}.drain_{own})", None, 0.0,
                f"i(v.{stage}.vdrain_{other})", 1.0,
            )
            for own, other in ("pn", "np")
        ]  # fmt: skip
    out, line, back = f"i(vout_{group})", f"v(line_{group})", f"v(return_{group})"
    if driver.kind == "half-bridge":
        legs = [(f"v({stage}.ramp)", line, 1.0, "high", "low")]
    else:
        legs = [(f"v({stage}.ramp_p)", line, 1.0, "ph", "pl"), (f"v({stage}.ramp_n)", back, -1.0, "nh", "nl")]
    found = []
    for ramp, voltage, sign, high, low in legs:
        found.append(_Switch(f"{group}.{high}", ramp, True, voltage, top, bottom, out, -sign))
        found.append(_Switch(f"{group}.{low}", ramp, False, voltage, None, bottom, out, sign))
    return found


def switching_vectors(driver: Driver) -> list[str]:
    """Return the vectors that :func:`turn_ons` takes, beside those of the report."""
    switches = [switch for group in GROUPS if driver.kind in BRIDGES for switch in _switches(driver, group)]
    return [name for switch in switches for name in (switch.ramp, switch.voltage, switch.current)]


def turn_ons(driver: Driver, samples: Mapping[str, Array], window: Window) -> tuple[TurnOn, ...]:
    """Return the turn-ons of all transistors of a bridge over the window; none for another stage."""
    found: list[TurnOn] = []
    for group in GROUPS if driver.kind in BRIDGES else ():
        for switch in _switches(driver, group):
            edges = [edge for edge in _edges(samples, switch) if edge[0] >= window.start]
            if edges:
                found.append(_turn_on(driver, switch, edges, samples, driver.swing(group)))
    return tuple(found)


def edge_waveforms(driver: Driver, samples: Mapping[str, Array]) -> dict[str, Array]:
    """Return time, voltage and current of the first leg of group A around its last turn-on; empty for another stage."""
    if driver.kind not in BRIDGES:
        return {}
    switch = _switches(driver, "a")[0]
    edges = _edges(samples, switch)
    if not edges:
        return {}
    off, on = edges[-1]
    time = samples["time"]
    near = (time >= off - _BEFORE * (on - off)) & (time <= on + _AFTER * (on - off))
    sign = 1.0 if driver.kind == "push-pull" else -switch.helping
    return {
        "time_s": time[near] - off, "leg_voltage_v": samples[switch.voltage][near],
        "leg_current_a": sign * samples[switch.current][near], "turn_on_s": np.array([on - off]),
    }  # fmt: skip


def _edges(samples: Mapping[str, Array], switch: _Switch) -> list[tuple[float, float]]:
    """Return the times at which the other transistor turns off and this one turns on, for every edge."""
    time, ramp = samples["time"], samples[switch.ramp] * (1.0 if switch.rising else -1.0)
    offs, ons = (_crossings(time, ramp, level) for level in (-OFF, ON))
    places = np.searchsorted(offs, ons) - 1
    return [(float(offs[place]), float(on)) for place, on in zip(places, ons, strict=True) if place >= 0]


def _crossings(time: Array, values: Array, level: float) -> Array:
    """Return the times at which a signal rises through a level."""
    before = np.flatnonzero((values[:-1] < level) & (values[1:] >= level))
    share = (level - values[before]) / (values[before + 1] - values[before])
    return np.asarray(time[before] + share * (time[before + 1] - time[before]))


def _turn_on(
    driver: Driver,
    switch: _Switch,
    edges: list[tuple[float, float]],
    samples: Mapping[str, Array],
    swing: float,
) -> TurnOn:
    """Return the mean over the edges of a transistor."""
    time, offs, ons = samples["time"], *(np.array(times) for times in zip(*edges, strict=True))
    volts = np.interp(ons, time, samples[switch.voltage])
    left = float(np.mean(volts - switch.bottom if switch.top is None else switch.top - volts))
    current = switch.helping * float(np.mean(np.interp(offs, time, samples[switch.current])))
    charge, dead_time, loss = None, None, None
    if driver.mosfet in MOSFETS:
        part = ratings(driver.mosfet)
        charge = part.swing_charge(swing)
        dead_time = charge / current if current > 0.0 else None
        loss = driver.frequency * part.swing_loss(left, swing)
    return TurnOn(switch.name, left <= ZERO * swing, left, current, charge, dead_time, loss)
