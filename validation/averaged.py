# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor at random drives: ``python -m validation.averaged --count 60``.

Each drive of one of four motors is compared twice with the full motor: the mean torque of a held shaft with
:func:`steady_state`, and a run-up of the free shaft from rest. The outcome of a case is written at once, so that an
interrupted study can be resumed.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun
from tests.motors import BEAM40
from validation.campaign import Campaign

SEED = 32
MOTORS = ("andersen2002", "andersen2002-unintended-mode", BEAM40, "bimodal40")
VOLTAGES = (20.0, 300.0)  # V
DETUNED = (0.98, 1.04)  # frequency over the recommended one
PHASES = (30.0, 150.0)  # deg, either sign: 0 and 180° turn no motor, or either way
SPEEDS = (-0.3, 1.2)  # of the speed at no load
NO_LOAD, SETTLED = 0.2, 60e-3  # s, runs until the speed and the torque have settled
RUN_UP, SAMPLE = 6e-3, 0.25e-3  # s
MOVES = 2.0  # rad/s, above which the speed of a run-up is compared; below it is that of the contact's pre-sliding
ALLOWED = 0.02  # of the friction torque μ F₀ R: error of a run that is trusted


def case(index: int) -> tuple[pr.Motor, pr.TwoPhaseDrive, float]:
    """Return a motor, a drive and the speed of the held shaft over that at no load."""
    chance = np.random.default_rng((SEED, index))
    motor = pr.load_motor(MOTORS[index % len(MOTORS)])
    low, high = np.log(VOLTAGES)
    usual = pr.default_drive(motor)
    assert isinstance(usual, pr.TwoPhaseDrive)
    drive = pr.TwoPhaseDrive(
        voltage=float(np.exp(chance.uniform(low, high))),
        frequency=float(usual.frequency * chance.uniform(*DETUNED)),
        phase_deg=float(chance.choice([-1.0, 1.0]) * chance.uniform(*PHASES)),
    )
    return motor, drive, float(chance.uniform(*SPEEDS))


def outcome(index: int) -> dict[str, Any]:
    """Return the outcome of a case, with errors relative to the friction torque."""
    motor, drive, share = case(index)
    scale = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    speed = share * float(pr.simulate_averaged(motor, drive, NO_LOAD).rotor_speed_rad_s[-1])
    held = pr.simulate_averaged(motor, drive, SETTLED, speed=speed)
    try:
        state = pr.steady_state(motor, drive, speed=speed, audit=False)
        known = state.converged and state.stable
    except pr.SimulationError:
        known = False
    averaged, full = (_run_up(motor, drive, averaged=averaged) for averaged in (True, False))
    begun, fastest = averaged.speed_rad_s, float(np.abs(full.speed_rad_s).max())
    accelerating = motor.rotor.inertia_kg_m2 * float(begun[-1] - full.speed_rad_s[-1]) / RUN_UP
    moved = float(np.sqrt(np.mean((begun - full.speed_rad_s) ** 2)) / fastest) if fastest > MOVES else None
    return {
        "index": index,
        "steady_error": (float(held.torque_n_m[-1]) - state.torque_n_m) / scale if known else None,
        "trusted": held.trusted,
        "check": float(held.check.max()),
        "separated": float(held.separated.max()),
        "run_up_error": accelerating / scale,
        "run_up_speed_error": moved,
        "run_up_trusted": averaged.trusted,
    }


def _run_up(motor: pr.Motor, drive: pr.TwoPhaseDrive, *, averaged: bool) -> ControlledRun:
    return pr.simulate_controlled(motor, drive, lambda _: {}, RUN_UP, sample_time=SAMPLE, averaged=averaged)


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the errors of the drives, in percent, by whether the averaged run is trusted."""
    steady = [one for one in record if one["steady_error"] is not None]
    error = [max(abs(one["steady_error"] or 0.0), abs(one["run_up_error"])) for one in record]
    wrong = [one for one, size in zip(record, error, strict=True) if size > ALLOWED]
    return {
        "cases": len(record),
        "stable": len(steady),
        "maximum_torque_error": {
            str(trusted): 100.0 * max(
                (abs(one["steady_error"]) for one in steady if one["trusted"] == trusted), default=0.0
            )
            for trusted in (True, False)
        },
        "maximum_run_up_error": 100.0 * max(abs(one["run_up_error"]) for one in record),
        "maximum_run_up_error_trusted": 100.0 * max(
            abs(one["run_up_error"]) for one in record if one["run_up_trusted"]
        ),
        "maximum_speed_error": 100.0 * max(
            one["run_up_speed_error"] for one in record if one["run_up_speed_error"] is not None
        ),
        "wrong": len(wrong),
        "wrong_but_trusted": sum(one["trusted"] for one in wrong),
        "false_alarms": sum(
            not one["trusted"] and size <= ALLOWED for one, size in zip(record, error, strict=True)
        ),
    }  # fmt: skip


def passes(table: Mapping[str, Any]) -> bool:
    """Whether no drive with an error above 2 % is trusted."""
    return table["wrong_but_trusted"] == 0


CAMPAIGN = Campaign("averaged", outcome, summary, passes, 60)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
