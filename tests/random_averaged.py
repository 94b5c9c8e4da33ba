# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor at random drives: ``python -m tests.random_averaged --count 60``.

Each drive of one of four motors is compared twice with the full motor: the mean torque of a held shaft with
:func:`steady_state`, and a run-up of the free shaft from rest. The outcome of a case is written at once, so that an
interrupted study can be resumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun
from tests.records import extended

RECORD = Path(__file__).with_suffix(".json")
SEED = 32
MOTORS = ("andersen2002", "andersen2002-unintended-mode", "beam40", "bimodal40")
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


def sentences(record: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Return the sentences of docs/averaged.md for a record."""
    steady = [one for one in record if one["steady_error"] is not None]
    good, others = (
        [abs(one["steady_error"]) for one in steady if one["trusted"] == trusted] for trusted in (True, False)
    )
    run_up = [abs(one["run_up_error"]) for one in record]
    moved = [one["run_up_speed_error"] for one in record if one["run_up_speed_error"] is not None]
    false = [
        one for one in record
        if not one["trusted"] and max(abs(one["steady_error"] or 0.0), abs(one["run_up_error"])) <= ALLOWED
    ]  # fmt: skip
    wrong = [
        one for one in record if max(abs(one["steady_error"] or 0.0), abs(one["run_up_error"])) > ALLOWED
    ]  # fmt: skip
    trusted = [abs(one["run_up_error"]) for one in record if one["run_up_trusted"]]
    return (
        f"At {len(record)} random drives of {len(MOTORS)} motors",
        f"which finds a stable motion at {len(steady)}",
        f"at most {100.0 * max(good):.2f} % for the {len(good)} that are trusted",
        f"at most {100.0 * max(others):.2g} % for the {len(others)} others",
        f"mean torque is within {100.0 * max(trusted):.2f} % for the {len(trusted)} that are trusted",
        f"within {100.0 * max(run_up):.2g} % for all",
        f"within {100.0 * max(moved):.2g} % RMS of the greatest",
        f"{len(wrong)} drives have an error above 2 %, none of them is trusted",
        f"{len(false)} of the {len(record)} drives are false alarms, {100.0 * len(false) / len(record):.0f} %",
    )


def main() -> None:
    """Run cases until there are so many, or the time is over."""
    record = extended(RECORD, __doc__, 60, lambda record: map(outcome, count(len(record))))
    print(*sentences(record), sep="\n")


if __name__ == "__main__":
    main()
