# SPDX-License-Identifier: GPL-3.0-or-later
"""Stated errors of steady states that lift off: ``python -m validation.lift_off_errors --count 30``.

The motors are those of :mod:`validation.lift_off` whose slowest disturbance fades within :data:`LONGEST` periods. The
fixed-step integrator of ``tests/reference`` runs from rest until that has faded, at two steps: its error is of first
order and late by varying amounts, so the finer run counts, with the distance of the two as its own error.
"""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from math import log
from typing import Any

import numpy as np

import pyspice_runner as pr
from tests.reference.damped import integrate_damped
from validation.campaign import Campaign
from validation.lift_off import CAMPAIGN as LIFT_OFF
from validation.lift_off import case
from validation.runs import tones
from validation.steady_states import LONGEST_CHECK

LONGEST, AVERAGED = 2000, 20  # periods of the drive
STEPS = 6400, 12800  # of the integrator in a period
FADED = 1e-5  # of the motion, what may be left of the slowest disturbance
ELSEWHERE = 0.02  # of the friction force, beyond which the run from rest has gone to another motion


def outcome(index: int) -> dict[str, Any] | None:
    """Return torque, its stated error and the reference, in % of μF₀R; ``None`` if the motion fades too slowly."""
    motor, drive, speed = case(index)
    state = pr.steady_state(motor, drive, speed=speed, audit=False, timeout=LONGEST_CHECK)
    if not state.stable:
        return None
    periods = int(log(FADED) / log(float(np.abs(state.floquet_multipliers).max(initial=0.5)))) + AVERAGED
    if periods > LONGEST:
        return None
    contact, last = motor.contact, (periods - AVERAGED) * drive.period
    percent = 100.0 / (contact.friction * contact.preload_n)
    groups = tones(drive)

    def mean(steps: int) -> float:
        """Return the mean friction force by the integrator with so many steps in a period."""
        run = integrate_damped(
            motor.to_dict(), *groups, duration=periods * drive.period, output_step=drive.period,
            step=drive.period / steps, speed=speed,
        )  # fmt: skip
        return percent * run.mean("friction_force", last)

    with ThreadPoolExecutor(len(STEPS)) as pool:
        coarse, fine = pool.map(mean, STEPS)
    radius = motor.rotor.radius_m
    return {
        "index": index, "restitution": contact.restitution, "open": round(state.separated, 3),
        "torque": percent * state.torque_n_m / radius, "stated": percent * state.torque_error_n_m / radius,
        "reference": fine, "reference_error": abs(fine - coarse),
    }  # fmt: skip


def judged(record: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the cases whose run from rest ends in the same motion."""
    return [one for one in record if abs(one["torque"] - one["reference"]) <= 100.0 * ELSEWHERE]


def too_small(record: list[dict[str, Any]]) -> list[int]:
    """Return the indices of the judged cases whose stated error is too small, beyond the error of the reference."""
    return [
        one["index"]
        for one in judged(record)
        if abs(one["torque"] - one["reference"]) > one["stated"] + one["reference_error"]
    ]


def summary(record: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the errors in percent of μF₀R: true, of the reference, stated."""
    same = judged(record)
    away = [abs(one["torque"] - one["reference"]) for one in same]
    return {
        "cases": len(record),
        "same_motion": len(same),
        "median_error": float(np.median(away)),
        "maximum_error": max(away),
        "median_reference_error": float(np.median([one["reference_error"] for one in same])),
        "median_stated_error": float(np.median([one["stated"] for one in same])),
        "stated_too_small": too_small(record),
    }


def keys() -> list[int]:
    """Return the motors of the campaign on lift-off that have a stable state."""
    return [one["index"] for one in LIFT_OFF.cases() if one["counts"] and one["stable"]]


CAMPAIGN = Campaign("lift_off_errors", outcome, summary, count=30, keys=keys)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
