# SPDX-License-Identifier: GPL-3.0-or-later
"""Quantities of operating points by harmonic balance, for differences between motors that are close to each other.

They take a hundredth of the time of a steady state by ngspice, and differ from it by what the harmonics leave out: as a
rule one percent. So they serve for derivatives, and for values together with the difference to a steady state nearby.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, sqrt

import numpy as np

from pyspice_runner.motor import groups
from pyspice_runner.run.point import Point
from pyspice_runner.steady.copies import Plant
from pyspice_runner.steady.harmonic_balance import Balance, balanced, tones
from pyspice_runner.steady.monodromy import differentiable

QUANTITIES = (
    "speed_rad_s", "torque_n_m", "load_torque_n_m", "normal_force_n", "power_a_w", "power_b_w", "current_a_rms_a",
    "current_b_rms_a", "current_a_phase_deg", "current_b_phase_deg",
)  # fmt: skip


@dataclass(frozen=True)
class BalancedState:
    """An operating point by harmonic balance."""

    values: dict[str, float]  # of :data:`QUANTITIES`
    solution: Balance  # a start for others


def balances(setup: Point) -> bool:
    """Return whether harmonic balance describes a point: paper's contact, linear modes, few harmonics of the drive."""
    if setup.source.ideal is None or not setup.law or "averaged" not in setup.law.forms:
        return False
    plant = _plant(setup)
    return differentiable(plant) and tones(plant) > 0


def balanced_states(setups: Sequence[Point], starts: Sequence[Balance | None]) -> list[BalancedState | None]:
    """Return the points by harmonic balance; ``None`` where it has no solution. ``starts`` are solutions nearby."""
    plants = [_plant(setup) for setup in setups]
    groups: dict[float, list[int]] = {}
    for place, plant in enumerate(plants):
        groups.setdefault(plant.drive.period, []).append(place)
    found: dict[int, BalancedState | None] = {}
    for places in groups.values():
        solved = balanced([plants[place] for place in places], [starts[place] for place in places])
        found |= {place: None if one is None else _state(one) for place, one in zip(places, solved, strict=True)}
    return [found[place] for place in range(len(setups))]


def _state(balance: Balance) -> BalancedState:
    motor, plant = balance.plant.motor, balance.plant
    torque = motor.rotor.radius_m * balance.friction
    bearing = motor.rotor.bearing_damping_n_m_s * balance.speed
    dry = float(np.sign(plant.load.speed or 0.0)) * motor.rotor.bearing_friction_n_m
    values = {
        "speed_rad_s": balance.speed, "torque_n_m": torque, "load_torque_n_m": torque - bearing - dry,
        "normal_force_n": balance.normal,
    }  # fmt: skip
    for group in "ab":
        volts, amperes = balance.phasors(group)
        values[groups.column("power", group, "w")] = 0.5 * float(np.vdot(volts, amperes).real)
        values[groups.column("current", group, "rms_a")] = float(np.linalg.norm(amperes)) / sqrt(2.0)
        (orders,) = np.nonzero(volts)
        ahead = np.angle(amperes[orders[0]] / volts[orders[0]], deg=True) if len(orders) == 1 else nan
        values[groups.column("current", group, "phase_deg")] = float(ahead)
    return BalancedState(values, balance)


def _plant(setup: Point) -> Plant:
    drive = setup.source.ideal
    assert drive is not None
    return Plant(setup.motor, drive, setup.load, setup.law)
