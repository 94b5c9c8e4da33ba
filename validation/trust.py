# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimated against true errors of averaged transients: ``python -m validation.trust``.

The first 16 cases are spin-ups and steps of load, direction, preload, frequency and voltage of two motors at 30 to
150 V. By them and the first drawn ones the parts and the margin of the estimate were chosen; it is validated on the
last ones, drawn with another seed. True errors compare samples of whole periods with the full motor, RMS. The
error of the mean torque follows from the error δ of the speed: J dδ/dt + b δ, with the damping b of the bearing.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.averaged.errors import COLUMN
from pyspice_runner.averaged.run import Array
from pyspice_runner.units import linear_name
from validation.campaign import Campaign

SEED = 49  # of the first drawn cases; further draws have the next seeds
FRESH = 57  # number of the first case that was not looked at before
DRAWS = (24, 41, FRESH)  # number of the first case of each further draw
FLAGSHIP, PLATE = "bimodal40", str(Path(__file__).parents[1] / "examples" / "plate40.toml")
DURATION, CHANGE, AT_ONCE = 20e-3, 10e-3, 1e-6  # s: of a run, of the change in it, that the change takes
WITHIN = 3.0  # median of stated over true error
# set, V, Hz, degrees, changing quantity, its values before and after
TABLE: tuple[tuple[str, float, float, float, str, float, float], ...] = (
    (FLAGSHIP, 30.0, 40.5e3, 90.0, "spin-up", 0.0, 0.0),
    (FLAGSHIP, 60.0, 40.7e3, 90.0, "spin-up", 0.0, 0.0),
    (FLAGSHIP, 150.0, 40.7e3, 90.0, "spin-up", 0.0, 0.0),
    (FLAGSHIP, 100.0, 40.7e3, 90.0, "load_torque", 0.0, 20e-3),
    (FLAGSHIP, 80.0, 40.7e3, 90.0, "phase_deg", 90.0, -90.0),
    (FLAGSHIP, 100.0, 40.7e3, 90.0, "preload", 22.0, 27.0),
    (FLAGSHIP, 100.0, 41e3, 90.0, "frequency", 41e3, 40e3),
    (FLAGSHIP, 50.0, 40.7e3, 90.0, "voltage", 50.0, 130.0),
    (PLATE, 60.0, 40.2e3, 70.0, "spin-up", 0.0, 0.0),
    (PLATE, 40.0, 41.5e3, -90.0, "spin-up", 0.0, 0.0),
    (PLATE, 150.0, 40.2e3, 70.0, "spin-up", 0.0, 0.0),
    (PLATE, 100.0, 40.2e3, 70.0, "load_torque", 0.0, 1.0),
    (PLATE, 100.0, 40.2e3, 70.0, "phase_deg", 70.0, -110.0),
    (PLATE, 120.0, 40.2e3, 70.0, "preload", 18.0, 22.0),
    (PLATE, 80.0, 41e3, 70.0, "frequency", 41e3, 40e3),
    (PLATE, 80.0, 40.2e3, 70.0, "voltage", 80.0, 140.0),
)
TORQUE = COLUMN["torque"]
SAMPLED = {  # curve → sample
    "rotor_speed_rad_s": "speed_rad_s", "current_amplitude_a_a": "current_amplitude_a",
    "current_amplitude_b_a": "current_b_amplitude_a", "electrical_power_w": "electrical_power_w",
}  # fmt: skip


def case(index: int) -> tuple[str, float, float, float, str, float, float]:
    """Return a row of the table, or draw one."""
    if index < len(TABLE):
        return TABLE[index]
    chance = np.random.default_rng((SEED + sum(index >= first for first in DRAWS), index))
    name, frequency, phase = ((FLAGSHIP, 40.7e3, 90.0), (PLATE, 40.2e3, 70.0))[index % 2]
    preload = pr.load_motor(name).contact.preload_n
    voltage, frequency = float(chance.uniform(40.0, 150.0)), 1e3 * float(chance.choice([40.0, 40.2, 40.5, 40.7, 41.0]))
    what = str(chance.choice(["spin-up", "load_torque", "phase_deg", "preload", "frequency", "voltage"]))
    before, after = {
        "spin-up": (0.0, 0.0), "load_torque": (0.0, float(chance.uniform(2e-3, 15e-3)) * (50.0 if index % 2 else 1.0)),
        "phase_deg": (phase, phase - 180.0), "preload": (preload, preload * float(chance.uniform(0.8, 1.25))),
        "frequency": (frequency, frequency + 1e3 * float(chance.choice([-1.0, 1.0]))),
        "voltage": (voltage, float(chance.uniform(40.0, 150.0))),
    }[what]  # fmt: skip
    return name, voltage, frequency, phase, what, before, after


def outcome(index: int) -> dict[str, Any]:
    """Return the shares of a case: stated and true."""
    name, voltage, frequency, phase, what, before, after = case(index)
    motor, drive = pr.load_motor(name), pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    rows = [(0.0, before), (CHANGE, before), (CHANGE + AT_ONCE, after)]
    courses: dict[str, Any] = {} if what == "spin-up" else {what: rows}
    # whole periods of both frequencies, so that samples have no ripple at twice the frequency
    sample = 5e-3 if what == "frequency" and frequency % 1e3 else 1e-3 if what == "frequency" else 20.0 / frequency
    found = pr.simulate_averaged(motor, drive, DURATION, courses=courses)
    stated = found.error_estimate
    averaged, full = (
        pr.simulate_controlled(motor, drive, lambda _: {}, DURATION, sample_time=sample, courses=courses, averaged=one)
        for one in (True, False)
    )
    true = {}
    for curve, column in SAMPLED.items():
        error = averaged.samples[column] - full.samples[column]
        true[curve] = float(np.sqrt(np.mean(error**2)) / np.abs(full.samples[column]).max())
    speeds = [one.samples["speed_rad_s"] for one in (averaged, full)]
    true[TORQUE] = _torque_error(motor, speeds[0] - speeds[1], sample)
    shares = {name: stated.shares.get(name, stated.shares.get(linear_name(name))) for name in COLUMN.values()}
    return {
        "index": index, "motor": motor.name, "voltage": voltage, "frequency": frequency, "event": what,
        "before": before, "after": after, "stated": {} if stated.unknown else shares, "true": true,
        "unknown": stated.unknown, "trusted": found.trusted, "open": float(found.separated.max()),
    }  # fmt: skip


def _torque_error(motor: pr.Motor, error: Array, sample: float) -> float:
    """Return the RMS error of the mean torque as a share, by the errors of the mean speed in samples of a time in s."""
    at_ends = np.concatenate([[0.0], 0.5 * (error[1:] + error[:-1]), error[-1:]])
    torque = motor.rotor.inertia_kg_m2 * np.diff(at_ends) / sample + motor.rotor.bearing_damping_n_m_s * error
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    return float(np.sqrt(np.mean(torque**2)) / limit)


def ratios(record: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    """Return stated over true error of a quantity, of the cases that state it."""
    return [one["stated"][name] / one["true"][name] for one in record if name in one["stated"] and one["true"][name]]


def counts(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the shares of unknown and trusted runs, and stated over true errors."""
    trusted = [one for one in record if one["trusted"]]
    found = {name: ratios(record, name) for name in COLUMN.values()}
    return {
        "cases": len(record),
        "unknown": sum(bool(one["unknown"]) for one in record),
        "trusted": len(trusted) / len(record),
        "largest_true_error_of_trusted": max(
            (max(filter(None, one["true"].values())) for one in trusted), default=None
        ),
        "stated_over_true": {
            name: {"minimum": min(values), "median": float(np.median(values)), "maximum": max(values)}
            for name, values in found.items()
        },
    }


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts of the listed, the first drawn, the last drawn and all cases."""
    bounds = {"listed": (0, len(TABLE)), "drawn": (len(TABLE), FRESH), "fresh": (FRESH, inf), "all": (0, inf)}
    return {
        name: counts([one for one in record if first <= one["index"] < last]) for name, (first, last) in bounds.items()
    }


def table(record: Sequence[Mapping[str, Any]]) -> str:
    """Return the listed cases, with stated / true errors in percent."""
    lines = ["motor; event; trusted; stated / true, %: " + ", ".join(COLUMN)]
    for one in sorted(record, key=lambda one: int(one["index"]))[: len(TABLE)]:
        errors = [
            f"{100.0 * one['stated'][name]:.2f} / {100.0 * one['true'][name]:.2f}"
            for name in COLUMN.values()
            if name in one["stated"]
        ]
        event = f"{one['event']} at {one['voltage']:g} V, {1e-3 * one['frequency']:g} kHz"
        lines.append(
            f"{one['motor']}; {event}; {'yes' if one['trusted'] else 'no'}; {', '.join(errors) or one['unknown']}"
        )
    return "\n".join(lines)


def passes(found: Mapping[str, Any]) -> bool:
    """Whether no error is above the stated one, and medians of listed and of all cases are within a factor of three."""
    every, listed = ([*found[part]["stated_over_true"].values()] for part in ("all", "listed"))
    return min(one["minimum"] for one in every) >= 1.0 and max(one["median"] for one in [*every, *listed]) <= WITHIN


CAMPAIGN = Campaign("trust", outcome, summary, passes, 73)

if __name__ == "__main__":
    status = CAMPAIGN.main()
    print(table(CAMPAIGN.cases()))
    sys.exit(status)
