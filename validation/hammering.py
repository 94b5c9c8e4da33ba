# SPDX-License-Identifier: GPL-3.0-or-later
"""Default runs of motors whose contact hammers: ``python -m validation.hammering``, a part of ``make validation``.

Each case is run by ``simulate`` with its default step and integrated by the independent integrator of
``tests/reference``. The mean rotor speed must be within 1 % of the reference, or the run must say that it is not.
Motors and drives are drawn around those of ``andersen2002``. A case counts only if, in the averaged periods of the
reference, the tip is off the rotor for a share of the time within :data:`SEPARATED` and the greatest normal force is
at least :data:`LEAST_FORCE` times the preload.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain, count
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.motor.drive import check_together
from pyspice_runner.spice.ngspice import ngspice_version
from tests.reference.integrator import ReferenceRun, integrate
from validation.campaign import Campaign
from validation.runs import tones

COUNT, SEED = 60, 1
ALLOWED = 0.01  # of the mean rotor speed
SEPARATED = 0.4, 0.95  # share of the averaged periods
LEAST_FORCE = 10.0  # times the preload
PERIODS, AVERAGED = 40, 20  # of the drive; the package averages over the last 20, too
SAMPLES = 500  # of the reference in a period; only the means are compared
SUBSTEP = 4e-8  # s, of the reference; halved to see whether it has converged
PERTURBATION = 1e-13  # m, of the reference's start: 10^-7 of the motion, which a regular motion forgets
CONVERGED = 0.002  # greatest relative change of the reference's mean speed by either; above, the motion is chaotic
KINDS = ("within 1 %", "said", "silent", "chaotic, said", "chaotic, silent", "refused")


@dataclass(frozen=True)
class Case:
    """One motor, its drive, and how it is run."""

    motor: pr.Motor
    drive: pr.TwoPhaseDrive | pr.TwoToneDrive
    duration: float
    load_torque: float = 0.0
    accuracy: float | None = None


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Attributes:
        name: index of the case, or its name.
        kind: one of :data:`KINDS`.
        mean_speed_rad_s: mean rotor speed of the run.
        reference_rad_s: that of the reference.
        error: relative distance of the two.
        stated_error: the run's own estimate of it, relative to its mean speed.
        tip_error: the run's estimate of the tip's error.
        reference_change: greatest relative change of the reference's mean speed by half its step or another start.
        separated: share of the averaged time in which the tip is off the rotor, by the reference.
        greatest_force: greatest normal force in the averaged time over the preload, by the reference.
        said: the run's cautions about its error, or the error.
        seconds: wall time of the run.
    """

    name: str
    kind: str
    mean_speed_rad_s: float | None
    reference_rad_s: float
    error: float | None
    stated_error: float | None
    tip_error: float | None
    reference_change: float
    separated: float
    greatest_force: float
    said: str
    seconds: float


# --- what is drawn -------------------------------------------------------------------------------------------


def named() -> dict[str, Case]:
    """Cases by name: 17.9 kHz and 100 V, where the tip's accuracy did not cover the speed."""
    motor = pr.load_motor("andersen2002").updated({"mount": None})
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=17.9e3, phase_deg=90.0)
    return {"17.9 kHz, 100 V, accuracy 0.005": Case(motor, drive, duration=5e-3, accuracy=0.005)}


def case(seed: int, index: int) -> Case:
    """Draw a case that hammers; the same for the same arguments."""
    rng = np.random.default_rng((seed, index))
    while True:
        try:
            found = _drawn(rng)
        except pr.ParameterError:
            continue
        if hammers(found, _reference(found)):
            return found


def _drawn(rng: np.random.Generator) -> Case:
    base = pr.load_motor("andersen2002")

    def about(x: float, factor: float) -> float:
        return x * float(np.exp(rng.uniform(-1.0, 1.0) * math.log(factor)))

    mount = None
    if rng.random() < 0.5:
        mount = {"stiffness_n_per_m": about(2e4, 3.0), "mass_kg": about(0.05, 3.0), "damping_n_s_per_m": about(50, 2.0)}
    motor = base.updated(
        {
            "mount": mount,
            "modes.0.frequency_hz": about(base.modes[0].frequency_hz, 1.3),
            "modes.1.frequency_hz": about(base.modes[1].frequency_hz, 1.3),
            "modes.0.quality_factor": about(base.modes[0].quality_factor, 3.0),
            "modes.1.quality_factor": about(base.modes[1].quality_factor, 3.0),
            "contact.preload_n": about(1.5, 4.0),
            "contact.friction": about(0.25, 2.5),
            "contact.normal_stiffness_n_per_m15": about(base.contact.normal_stiffness_n_per_m15, 3.0),
            "rotor.radius_m": about(base.rotor.radius_m, 2.0),
            "rotor.inertia_kg_m2": about(base.rotor.inertia_kg_m2, 10.0),
        }
    )
    # the resonance of the mode that hammers rises while the tip is in contact
    frequency = motor.modes[0].frequency_hz * float(rng.uniform(0.85, 1.25))
    voltage, phase = about(200.0, 2.0), float(rng.uniform(-120.0, 120.0))
    drive: pr.TwoPhaseDrive | pr.TwoToneDrive
    if rng.random() < 0.75:
        drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    else:
        order = int(rng.integers(2, 5))
        drive = pr.TwoToneDrive(
            voltage_1=voltage, frequency_1=frequency, voltage_2=about(0.5 * voltage, 2.0),
            frequency_2=order * frequency, phase_deg=phase,
        )  # fmt: skip
    check_together(motor, drive)
    held = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    load = float(rng.uniform(-0.3, 0.3)) * held if rng.random() < 0.25 else 0.0
    return Case(motor, drive, PERIODS * drive.period, load)


# --- the reference -------------------------------------------------------------------------------------------


def _reference(subject: Case, *, step: float = SUBSTEP, perturbation: float = 0.0) -> ReferenceRun:
    """Integrate a case; the reference holds for stators that their preload does not bend sideways."""
    assert abs(sum(mode.tip_x * mode.tip_y / mode.stiffness_n_per_m for mode in subject.motor.modes)) < 1e-15
    return integrate(
        subject.motor.to_dict(),
        *tones(subject.drive),
        duration=subject.duration,
        output_step=subject.drive.period / SAMPLES,
        step=step,
        load_torque=subject.load_torque,
        perturbation_m=perturbation,
        statistics_from=subject.duration - AVERAGED * subject.drive.period,
    )


def hammers(subject: Case, reference: ReferenceRun) -> bool:
    """Whether the contact opens for much of the time and closes with large forces."""
    low, high = SEPARATED
    return low <= reference.state_fractions["separated"] <= high and _force(subject, reference) >= LEAST_FORCE


def _force(subject: Case, reference: ReferenceRun) -> float:
    """Greatest normal force in the averaged periods over the preload."""
    averaged = reference.time_s >= subject.duration - AVERAGED * subject.drive.period
    return float(reference.normal_force_n[averaged].max()) / subject.motor.contact.preload_n


def _mean_speed(subject: Case, reference: ReferenceRun) -> float:
    """Mean rotor speed over the last whole periods."""
    end = min(subject.duration, float(reference.time_s[-1]))
    grid = np.linspace(end - AVERAGED * subject.drive.period, end, AVERAGED * SAMPLES + 1)
    speed = np.interp(grid, reference.time_s, reference.rotor_speed_rad_s)
    return float(np.trapezoid(speed, dx=1.0) / (len(grid) - 1))


# --- what came of it -----------------------------------------------------------------------------------------


def compared(subject: Case, name: str) -> Outcome:
    """Run a case with the default step and compare its mean speed with the reference."""
    reference = _reference(subject)
    true = _mean_speed(subject, _reference(subject, step=0.5 * SUBSTEP))
    others = (reference, _reference(subject, perturbation=PERTURBATION))
    change = max(abs(_mean_speed(subject, other) / true - 1.0) for other in others)
    mean = error = stated = tip = None
    began = time.monotonic()
    try:
        run = pr.simulate(
            subject.motor, subject.drive, duration=subject.duration, load_torque=subject.load_torque,
            accuracy=subject.accuracy,
        )  # fmt: skip
    except pr.SimulationError as refusal:
        kind, said = "refused", str(refusal).partition(" The netlist is kept")[0]
    else:
        mean, tip = run.mean_rotor_speed_rad_s, run.error_estimate
        error = abs(mean - true) / abs(true)
        stated = None if run.speed_error_rad_s is None else run.speed_error_rad_s / abs(mean)
        said = " ".join(caution for caution in run.cautions if "estimated error exceeds" in caution)
        assert (run.accurate is False) == bool(said)
        kind = judged(error, change, said=bool(said))
    return Outcome(
        name, kind, mean, true, error, stated, tip, change, reference.state_fractions["separated"],
        _force(subject, reference), said, time.monotonic() - began,
    )  # fmt: skip


def judged(error: float, reference_change: float, *, said: bool) -> str:
    """Return the kind of a run by its true error, that of its reference, and whether it says that it is inaccurate."""
    if error <= ALLOWED and reference_change <= CONVERGED:
        return "within 1 %"
    chaotic = "chaotic, " if reference_change > CONVERGED else ""
    return chaotic + ("said" if said else "silent")


def outcome(key: int | str) -> dict[str, Any]:
    """Return the outcome of a drawn case, or of a named one, JSON-ready."""
    subject = named()[key] if isinstance(key, str) else case(SEED, key)
    found = asdict(compared(subject, str(key)))
    return {name: float(f"{x:.4g}") if isinstance(x, float) else x for name, x in found.items()}


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts of the drawn cases, and the named ones, JSON-ready."""
    drawn = [one for one in record if one["name"] not in named()]
    kinds = Counter(one["kind"] for one in drawn)
    return {
        "cases": len(drawn),
        "seed": SEED,
        "kinds": {kind: kinds[kind] for kind in KINDS},
        "within_1_percent_and_said_that_it_may_not_be": sum(
            one["kind"] == KINDS[0] and bool(one["said"]) for one in drawn
        ),
        "silent": [one["name"] for one in record if "silent" in one["kind"]],
        "ngspice": ngspice_version(),
    }  # fmt: skip


def passes(table: Mapping[str, Any]) -> bool:
    """Whether no run is silent about an error of more than 1 %."""
    return not table["silent"]


def keys() -> Iterator[int | str]:
    """Return the named cases, then the drawn ones."""
    return chain(named(), count())


CAMPAIGN = Campaign("hammering", outcome, summary, passes, COUNT + len(named()), keys=keys)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
