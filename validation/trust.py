# SPDX-License-Identifier: GPL-3.0-or-later
"""Estimated against true errors of averaged transients: ``python -m validation.trust``.

The first 16 cases are spin-ups and steps of load, direction, preload, frequency and voltage of two motors at 30 to
150 V; the others are drawn, and no constant of the estimate was fitted to them. True errors are those of samples of
whole periods against the full motor, RMS; of the torque those at held speeds, at times that the estimate does not use.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.averaged.errors import QUANTITIES, operating_point, values_of
from pyspice_runner.averaged.point import AveragedPoint
from pyspice_runner.averaged.simulate import settled_at
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import steady_states
from validation.campaign import Campaign

SEED = 49
FLAGSHIP, PLATE = "bimodal40", str(Path(__file__).parents[1] / "examples" / "plate40.toml")
DURATION, CHANGE, AT_ONCE = 20e-3, 10e-3, 1e-6  # s: of a run, of the change in it, that the change takes
HELD = 9  # times at which the torque is compared
WITHIN = 3.0  # median of stated over true error
CLOSE = 0.02  # stated error of a run that needs no comparison with the full motor
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
SAMPLED = {  # curve → sample
    "rotor_speed_rad_s": "speed_rad_s", "current_amplitude_a_a": "current_amplitude_a",
    "current_amplitude_b_a": "current_b_amplitude_a", "electrical_power_w": "electrical_power_w",
}  # fmt: skip


def case(index: int) -> tuple[str, float, float, float, str, float, float]:
    """Return a row of the table, or draw one."""
    if index < len(TABLE):
        return TABLE[index]
    chance = np.random.default_rng((SEED, index))
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
    true[QUANTITIES[0]] = None if stated.unknown else _torque_error(found, motor, drive, courses)
    return {
        "index": index, "motor": motor.name, "voltage": voltage, "frequency": frequency, "event": what,
        "before": before, "after": after, "stated": dict(stated.shares), "true": true, "unknown": stated.unknown,
        "open": float(found.separated.max()),
    }  # fmt: skip


def _torque_error(found: Any, motor: pr.Motor, drive: pr.TwoPhaseDrive, courses: Mapping[str, Any]) -> float | None:
    run = AveragedPoint.of(Point.of(motor, drive), DURATION, courses=courses)
    rows = np.searchsorted(found.time_s, DURATION * (np.arange(HELD) + 0.5) / HELD)
    points = [operating_point(run, {name: float(one[row]) for name, one in found.curves.items()}) for row in rows]
    own = [settled_at(run, point)[QUANTITIES[0]] for point in points]
    errors = [
        one - values_of(state)[0] for one, state in zip(own, steady_states(points), strict=True) if state.determined
    ]
    limit = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    return float(np.sqrt(np.mean(np.square(errors))) / limit) if errors else None


def ratios(record: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    """Return stated over true error of a quantity, of the cases that state it."""
    return [one["stated"][name] / one["true"][name] for one in record if name in one["stated"] and one["true"][name]]


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the shares of unknown runs and of those within 2 %, and stated over true errors."""
    known = [one for one in record if not one["unknown"]]
    close = [one for one in known if max(one["stated"].values()) <= CLOSE]
    worst = [max(one["stated"].values()) / max(filter(None, one["true"].values())) for one in known]
    table = {name: ratios(record, name) for name in (*QUANTITIES, *SAMPLED)} | {"largest of a run": worst}
    return {
        "cases": len(record),
        "unknown": len(record) - len(known),
        "within_2_percent": len(close) / len(record),
        "largest_true_error_of_these": max((max(filter(None, one["true"].values())) for one in close), default=None),
        "stated_over_true": {
            name: {"minimum": min(values), "median": float(np.median(values)), "maximum": max(values)}
            for name, values in table.items()
        },
    }  # fmt: skip


def passes(table: Mapping[str, Any]) -> bool:
    """Whether no error is above the stated one, and the median of the largest of a run is within a factor of three."""
    found = table["stated_over_true"]
    return min(one["minimum"] for one in found.values()) >= 1.0 and found["largest of a run"]["median"] <= WITHIN


CAMPAIGN = Campaign("trust", outcome, summary, passes, 32)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
