# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states of random motors, compared with settling and long runs.

Motors and drives are those of the soak (:mod:`validation.soak`), whose parameters are drawn from the whole ranges that
they declare; most drives of two tones get a common period.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from pydantic import ValidationError

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.motor.drive import check_together
from pyspice_runner.run.dynamometer import STUCK, Dynamometer
from pyspice_runner.run.point import Point
from pyspice_runner.steady.copies import Copy
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.shooting import Shooting
from pyspice_runner.steady.speed_torque import held_point
from pyspice_runner.steady.steady import SteadyState
from validation.campaign import Campaign
from validation.soak import Case, case

SEED = 16
LONGEST = 10.0  # s, of a run of ngspice
LONGEST_CHECK = 120.0  # s, of a run that checks a steady state
AGREES = 5e-3  # of the friction torque, besides the error that the steady state states
FOUND = ("newton", "damped", "neighbour", "settled")
RATIOS = (Fraction(2), Fraction(3), Fraction(3, 2), Fraction(4, 3), Fraction(5, 2), Fraction(7, 4))  # of two tones
BEATING = 0.1  # share of the drives of two tones whose frequencies stay as drawn, without a common period
QUICK = 0.3  # s that ngspice may take for a decay time of the slowest mode, if the case is left to settle as well
STAYING = 40  # periods for which a motion is shown to stay where it was found, at half of its step
POINT = 2e-5  # s that ngspice takes for a step


def subject_of(index: int) -> Case:
    """Draw a case; most drives of two tones get frequencies with a ratio of small whole numbers."""
    subject = case(SEED, index)
    drive = subject.drive
    rng = np.random.default_rng((SEED, index, 1))
    if not isinstance(drive, pr.TwoToneDrive) or rng.random() < BEATING:
        return subject
    low, high = sorted(("frequency_1", "frequency_2"), key=lambda name: getattr(drive, name))
    ratio = RATIOS[rng.integers(len(RATIOS))]
    for name, value in ((low, getattr(drive, high) / float(ratio)), (high, getattr(drive, low) * float(ratio))):
        try:
            changed = pr.TwoToneDrive(**{**drive.model_dump(), name: value})
            check_together(subject.motor, changed)
        except (ValidationError, pr.ParameterError):
            continue
        return replace(subject, drive=changed)
    return subject


def outcome(index: int) -> dict[str, Any] | None:
    """Return the outcome of a case; ``None`` for one without a plain drive or a contact."""
    subject = subject_of(index)
    if not isinstance(subject.drive, pr.TwoPhaseDrive | pr.TwoToneDrive) or subject.settings.get("contact") is None:
        return None
    point: dict[str, Any] = {"speed": subject.settings.get("speed") or 0.0, "contact": subject.settings["contact"]}
    point |= {"timeout": LONGEST, "audit": False}
    try:
        state = pr.steady_state(subject.motor, subject.drive, **point)
    except (pr.ParameterError, pr.SimulationError) as error:
        slow = "did not finish within" in str(error)
        how = "refused" if isinstance(error, pr.ParameterError) else "too slow" if slow else "failed"
        return {"index": index, "method": how, "verdict": re.sub(r"/\S+", "…", str(error))[:120]}
    method = state.method or "not found"
    return {"index": index, "method": method, "verdict": _verdict(subject, state, point) if state.converged else ""}


def _verdict(subject: Case, state: SteadyState, point: dict[str, Any]) -> str:
    """Return how a steady state compares with settling, if that is quick, or with a long run from it."""
    if not state.stable:
        return "unstable"
    if state.audit.findings:
        return "fails the audit"
    setup = Point(subject.motor, DriveSource(subject.drive), law=Law(point["contact"]))
    history = STUCK in state.cautions  # torque and normal force depend on it
    if not history and POINT * Dynamometer(setup).duration / setup.step < QUICK:
        try:
            settled = held_point(subject.motor, subject.drive, mode="settle", **point)
        except (pr.ParameterError, pr.SimulationError):
            settled = {"settled": False}
        if settled["settled"]:
            return "agrees" if _close(state, settled["torque_n_m"], settled["normal_force_n"]) else "differs"
    return staying(state)


def _close(state: SteadyState, torque: float, force: float) -> bool:
    contact = state.motor.contact
    scale = contact.friction * max(contact.preload_n, force)
    allowed = AGREES * scale * state.motor.rotor.radius_m + state.torque_error_n_m
    return abs(state.torque_n_m - torque) <= allowed


def staying(state: SteadyState, periods: int = STAYING) -> str:
    """Run the full model from the steady state for many periods at half of its step, and compare means."""
    point = state.solution
    assert point is not None
    plant, period = point.plant, point.plant.drive.period
    finer = PeriodMap(period, 2 * round(period / state.step_s), LONGEST_CHECK)
    begun = point.moved(0.0, finer.step)
    try:
        # the solution at this step, if there is one: the distance to the coarser one may decay by 1e-4 in a period only
        Shooting([begun], finer).solve()
        start = [Copy(plant, begun.state if begun.done else point.state)]
        (trace,) = finer.traces(start, periods)
        # ngspice shortens steps at an impact, so that means over them are not those of the map
        (end,) = (None,) if trace else finer.settled(start, periods)
    except pr.SimulationError:
        return "the long run takes too long"
    if trace is None:
        if end is None:
            return "the long run fails"
        modes = slice(2 * plant.modes)  # displacements and velocities
        return "stays" if (np.abs(end - point.state)[modes] <= AGREES * point.scale[modes]).all() else "leaves"
    force, friction = trace.forces(plant).tolist()
    if point.sticks:  # a standing shaft is held at any torque
        return "stays" if abs(force - state.normal_force_n) <= AGREES * state.normal_force_n else "leaves"
    return "stays" if _close(state, friction * plant.motor.rotor.radius_m, force) else "leaves"


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts of the methods, and of the verdicts on what was found."""
    return {
        "cases": len(record),
        "methods": dict(Counter(one["method"] for one in record)),
        "verdicts": dict(Counter(one["verdict"] for one in record if one["method"] in FOUND)),
    }


CAMPAIGN = Campaign("steady_states", outcome, summary, count=200)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
