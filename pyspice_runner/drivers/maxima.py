# SPDX-License-Identifier: GPL-3.0-or-later
"""What the parts of a driver and the groups of a motor must bear: maxima over a whole run, from power-up on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pyspice_runner.circuit.source import GROUPS
from pyspice_runner.drivers.driver import BRIDGES, RAILS, Driver, Part
from pyspice_runner.drivers.mosfets import MOSFETS, ratings
from pyspice_runner.drivers.networks import CABLE, NO_CAPACITOR
from pyspice_runner.drivers.stock import FEWEST_TIMES, WINDING_CAPACITANCE, beyond
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.strength import electrode_distance
from pyspice_runner.run.window import Array
from pyspice_runner.units import engineering

TRANSISTOR = "MOSFET"  # first word of the names of transistors
TRANSFORMER = "transformer"  # of the names of values of transformers
LEAST_COIL = 1e-6  # H in series, which stands for none
NO_BLEEDER = 1e12  # Ω across it, which stands for none
NO_COIL = 1.0  # H across a group, which stands for none
_DRAINS = {  # sources in the libraries of the bridges that carry the currents into the drains
    "half-bridge": ("high", "low"), "full-bridge": ("ph", "pl", "nh", "nl"), "push-pull": ("drain_p", "drain_n"),
}  # fmt: skip
NO_PARALLEL = 1e-12  # F across a group, which stands for none


@dataclass(frozen=True)
class PartLoad:
    """A part of a driver, with its value and what it must bear; ``None`` where that does not apply."""

    name: str  # with its group
    value: float  # in its unit
    unit: str  # H, F, Ω, V, s, or 1 for a ratio of turns or a number of pieces
    peak_voltage_v: float | None  # greatest voltage across it
    peak_current_a: float | None  # greatest current through it


def load_vectors(driver: Driver) -> list[str]:
    """Return the vectors that :func:`part_loads` takes, beside the voltages and currents of stages and pins."""
    names = []
    for group in GROUPS:
        before = {part.label: node for part, node in zip(_behind(driver, group), _nodes(driver, group), strict=True)}
        names += [f"v({node})" for node in before.values()]
        names += [*_drain_voltages(driver, group), *_drain_currents(driver, group)]
        if CABLE in before:
            names.append(f"i(v.xcable_{group}.vcurrent)")
        if driver.network != "none":
            names.append(f"v(xnetwork_{group}.inner)")
            places = ("current", "coil", *(["parallel"] if driver.network == "llcc" else []))
            names += [f"i(v.xnetwork_{group}.v{place})" for place in places]
    return names


def part_loads(driver: Driver, samples: Mapping[str, Array]) -> tuple[PartLoad, ...]:
    """Return the parts of both groups, from the stage to the pin, with the maxima over a run."""
    found: list[PartLoad] = []
    for group in GROUPS:
        found += _of_group(driver, group, samples)
    return tuple(found)


def _behind(driver: Driver, group: str) -> list[Part]:
    """Return the parts behind the stage of a group."""
    parts = list(driver.parts(group))
    return parts if driver.kind == "ideal" else parts[1:]


def _nodes(driver: Driver, group: str) -> list[str]:
    """Return the node in front of each part behind the stage."""
    nodes, line = [], f"line_{group}"
    for part in _behind(driver, group):
        nodes.append(line)
        line = f"{part.label}_{group}"
    return nodes


def _drain_currents(driver: Driver, group: str) -> list[str]:
    """Return the vectors of the currents into the drains of a bridge."""
    return [f"i(v.xstage_{group}.v{leg})" for leg in _DRAINS.get(driver.kind, ())]


def _drain_voltages(driver: Driver, group: str) -> list[str]:
    """Return the vectors of the drains whose voltage is not held between the rails."""
    return [f"v(xstage_{group}.{leg})" for leg in _DRAINS["push-pull"]] if driver.kind == "push-pull" else []


def _greatest(values: Array) -> float:
    return float(np.abs(values).max())


def _most(least: float, vectors: Sequence[str], samples: Mapping[str, Array]) -> float:
    """Return the greatest magnitude of the vectors that the samples have, but at least a value."""
    return max([least, *(_greatest(samples[name]) for name in vectors if name in samples)])


def _of_group(driver: Driver, group: str, samples: Mapping[str, Array]) -> list[PartLoad]:
    """Return the parts of a group, from the supply to the pin."""
    found = _of_stage(driver, group, samples)
    nodes = [*_nodes(driver, group), group]
    for part, node, behind in zip(_behind(driver, group), nodes, nodes[1:], strict=False):
        before, after = samples[f"v({node})"], samples[f"v({behind})"]
        if part.label == "transformer":
            name = f"{TRANSFORMER}, group {group.upper()}, turns secondary to primary"
            current = _greatest(samples[f"i(vout_{group})"])
            found.append(PartLoad(name, part.values["ratio"], "1", _greatest(after), current))
            found += _winding(part, group, _greatest(after))
        elif part.label == CABLE:
            told, through = f"group {group.upper()}", _greatest(samples[f"i(v.xcable_{group}.vcurrent)"])
            coil, capacitor = part.values["inductance"], part.values["capacitance"]
            found.append(PartLoad(f"cable inductance, {told}", coil, "H", _greatest(before - after), through))
            found.append(PartLoad(f"cable capacitance, {told}", capacitor, "F", _greatest(after), None))
        else:
            found += _of_network(part, group, before, after, samples)
    return found


def _of_stage(driver: Driver, group: str, samples: Mapping[str, Array]) -> list[PartLoad]:
    """Return supplies, transistors and dead time."""
    found: list[PartLoad] = []
    if driver.kind == "ideal":
        return found
    high, low = driver.rails(group)
    for rail, volts in zip(RAILS, (high, low), strict=True):
        current = f"i(v{rail}_{group})"
        if current in samples and volts:
            found.append(
                PartLoad(f"supply {rail}, group {group.upper()}", volts, "V", abs(volts), _greatest(samples[current]))
            )
    if driver.kind in BRIDGES:
        name = f"{TRANSISTOR} {driver.mosfet.rpartition(':')[2]}, group {group.upper()}"
        borne_v, current_a = driver.swing(group), _greatest(samples[f"i(vout_{group})"])
        if driver.kind == "push-pull":
            told = f"{TRANSFORMER}, group {group.upper()}, turns secondary to a half of the primary"
            line_v = _greatest(samples[f"v(line_{group})"])
            found.append(PartLoad(told, driver.ratio(group), "1", line_v, current_a))
            found += _winding(driver.parts(group)[0], group, line_v)
            current_a *= driver.ratio(group)
        # beside the current of the output, a transistor bears the reverse current of the diode that it commutates
        current_a = _most(current_a, _drain_currents(driver, group), samples)
        borne_v = _most(borne_v, _drain_voltages(driver, group), samples)
        found.append(PartLoad(name, BRIDGES[driver.kind], "1", borne_v, current_a))
        dead_time = driver.setting(f"bridge_{group}.dead_time")
        found.append(PartLoad(f"dead time, group {group.upper()}", dead_time, "s", None, None))
    return found


def _winding(part: Part, group: str, volts: float) -> list[PartLoad]:
    """Return the capacitance of a transformer's winding, if it is stated."""
    capacitance = part.values["winding_capacitance"]
    name = f"{TRANSFORMER}, group {group.upper()}, winding capacitance"
    return [PartLoad(name, capacitance, "F", volts, None)] if capacitance else []


def _of_network(part: Part, group: str, before: Array, after: Array, samples: Mapping[str, Array]) -> list[PartLoad]:
    """Return coils and capacitors of a network between two voltages."""
    values, llcc, told = part.values, part.label == "llcc", f"group {group.upper()}"
    prefix, instance = "series_" if llcc else "", f"xnetwork_{group}"
    inner, through = samples[f"v({instance}.inner)"], samples[f"i(v.{instance}.vcurrent)"]
    coil, capacitor = values[f"{prefix}inductance"], values[f"{prefix}capacitance"]
    found: list[PartLoad] = []
    if coil > LEAST_COIL:
        wound = _greatest(samples[f"i(v.{instance}.vcoil)"])
        found.append(PartLoad(f"series coil, {told}", coil, "H", _greatest(before - inner), wound))
    if capacitor != NO_CAPACITOR:
        found.append(
            PartLoad(f"series capacitor, {told}", capacitor, "F", _greatest(inner - after), _greatest(through))
        )
    if (bleeder := values["bleeder"]) != NO_BLEEDER:
        volts = _greatest(inner - after)
        found.append(PartLoad(f"bleeder, {told}", bleeder, "Ω", volts, volts / bleeder))
    if not llcc:
        return found
    across, volts = samples[f"i(v.{instance}.vparallel)"], _greatest(after)
    drawn = samples.get(f"i(v.xcable_{group}.vcurrent)", samples[f"i(vpin_{group})"])
    coil, capacitor = values["parallel_inductance"], values["parallel_capacitance"]
    if coil != NO_COIL:
        found.append(PartLoad(f"parallel coil, {told}", coil, "H", volts, _greatest(across)))
    if capacitor != NO_PARALLEL:
        rest = _greatest(through - drawn - across)
        found.append(PartLoad(f"parallel capacitor, {told}", capacitor, "F", volts, rest))
    return found


def maxima(motor: Motor, driver: Driver, samples: Mapping[str, Array]) -> dict[str, Any]:
    """Return the maxima of pins, stages and parts over a run and when the pins had theirs, JSON-ready.

    ``exceeded`` has a sentence for each limit of a part that is exceeded.

    The field of a group is its greatest voltage over the distance of its electrodes; ``None`` where that is not known.
    """
    found: dict[str, Any] = {}
    for group in GROUPS:
        voltage = np.abs(samples[f"v({group})"])
        distance = electrode_distance(motor, group)
        found |= {
            f"voltage_{group}_v": float(voltage.max()),
            f"voltage_{group}_at_s": float(samples["time"][voltage.argmax()]),
            f"current_{group}_a": float(np.abs(samples[f"i(vpin_{group})"]).max()),
            f"field_{group}_v_per_m": None if distance is None else float(voltage.max()) / distance,
            f"stage_current_{group}_a": float(np.abs(samples[f"i(vout_{group})"]).max()),
        }
    loads = part_loads(driver, samples)
    found["parts"] = [load.__dict__ for load in loads]
    found["exceeded"] = exceeded(loads, driver)
    return found


def winding_of(driver: Driver, group: str) -> float:
    """Return the capacitance in F of the winding of the coil in series; 0 if it is not stated."""
    return driver.setting(f"{driver.network}_{group}.winding_capacitance") if driver.network != "none" else 0.0


def exceeded(parts: Sequence[PartLoad], driver: Driver) -> list[str]:
    """Return one sentence for each limit of a coil, a capacitor or a built-in MOSFET that is exceeded."""
    frequency = driver.frequency
    resonances = {group: driver.transformer_resonance(group) for group in GROUPS}
    told = [
        f"Leakage and winding capacitance of the {TRANSFORMER} of group {group.upper()} resonate at "
        f"{engineering(resonance, 'Hz')}; the limit is {engineering(FEWEST_TIMES * frequency, 'Hz')}."
        for group, resonance in resonances.items()
        if resonance < FEWEST_TIMES * frequency
    ]
    for part in parts:
        if part.name.startswith(TRANSISTOR) and driver.mosfet in MOSFETS:
            most, borne = ratings(driver.mosfet).breakdown_v, part.peak_voltage_v or 0.0
            if borne > most:
                told.append(
                    f"The {part.name} bears {borne:.4g} V; it breaks down at {most:g} V. Take another one or lower the "
                    "rail."
                )
        if part.unit in ("H", "F") and not part.name.startswith((CABLE, TRANSFORMER)):
            volts, amperes = part.peak_voltage_v or 0.0, part.peak_current_a or 0.0
            winding = winding_of(driver, part.name[-1].lower()) if part.name.startswith("series") else 0.0
            told += beyond(part.name, part.value, part.unit, volts, amperes, frequency, winding or WINDING_CAPACITANCE)
    return told
