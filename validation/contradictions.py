# SPDX-License-Identifier: GPL-3.0-or-later
"""Random operating points, each by every analysis: ``python -m validation.contradictions``, in ``make validation``.

Motors and drives are those of the soak (:mod:`validation.soak`), drawn from the whole ranges that their parameters
declare; the shaft is held at a drawn speed. The mean torque, the electrical power and the mean normal force of one
operating point come from ``steady_state``, ``simulate``, ``speed_torque``, ``working_points``, ``drive_report`` and
``simulate_averaged``. ``small_signals`` gives the change of the torque with the voltage, which is compared with two
further steady states. ``track`` gives a frequency, at which the mode of a steady state must have the phase that the
loop was asked for.

Two answers contradict each other where they differ by more than 1 % and the errors that they state. The scale of a
torque is the greatest of the friction torque, its ripple and the torque itself, of a power the apparent and the shaft
power, of a force the preload. A contradiction is explained where one of the two says that it is not settled, stable,
accurate or trusted, or has another caution. The random motors state no limits of their ceramic, whose cautions would
explain nothing.
"""

from __future__ import annotations

import json
import math
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
from pydantic import ValidationError

import pyspice_runner as pr
from pyspice_runner.circuit.law import law_of
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.errors import SpectrumError
from pyspice_runner.motor.drive import check_together, free_tip
from pyspice_runner.run.dynamometer import Dynamometer
from pyspice_runner.run.point import Point
from validation.campaign import Campaign
from validation.soak import FruitlessError, cause, random_motor

COUNT, SEED = 200, 28
LONGEST, MOST_SECONDS = 6.0, 10  # s, of a run of ngspice, and of an analysis
SHARE = 3  # one case of so many is also run by the analyses of PAIRS, which take most of the time
MOST_STEPS = 10_000  # of a run that settles
MOST_POINTS = 400  # steps in a drive period: more in stiff motors, whose runs would take hours
VOLTAGES, FREQUENCIES = (0.1, 1000.0), (1e3, 5e5)  # V and Hz, of a driver
SETTLING = 6.0  # decay times of the slowest mode in such a run
ALLOWED = 0.01  # of the scale, besides the stated errors
TRUSTED = 0.02  # of the friction torque: the error that the averaged motor's check allows
ERRORS = (pr.ParameterError, pr.SimulationError, SpectrumError)
QUANTITIES = ("torque_n_m", "power_w", "normal_force_n")
KINDS = ("agree", "explained", "contradiction")


@dataclass(frozen=True)
class Case:
    """A motor at one operating point."""

    motor: pr.Motor
    drive: pr.TwoPhaseDrive
    contact: str
    speed: float

    @property
    def point(self) -> dict[str, Any]:
        """The operating point as keywords of an analysis."""
        return {"contact": self.contact, "speed": self.speed, "timeout": LONGEST}

    @property
    def scales(self) -> dict[str, float]:
        """Scale of each quantity, without that of the answers themselves."""
        contact = self.motor.contact
        friction = contact.friction * contact.preload_n * self.motor.rotor.radius_m
        return {"torque_n_m": friction, "power_w": 0.0, "normal_force_n": contact.preload_n}


@dataclass(frozen=True)
class Answer:
    """What one analysis says of an operating point.

    Attributes:
        values: quantity → value; a quantity that the analysis does not report is left out.
        errors: quantity → error that the analysis states.
        scales: quantity → its own scale, such as the apparent power.
        doubts: reasons it gives for not relying on the values.
    """

    values: dict[str, float] = field(default_factory=dict)
    errors: dict[str, float] = field(default_factory=dict)
    scales: dict[str, float] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)


def subject(index: int, seed: int = SEED) -> Case:
    """Draw the case of an index."""
    rng = np.random.default_rng((seed, index))
    while True:
        try:
            one = _drawn(rng, damped=bool(index % 4))
        except (*ERRORS, ValidationError, FruitlessError):
            continue
        if one is not None and one.drive.period / setup(one).step <= MOST_POINTS:
            return one


def _drawn(rng: np.random.Generator, *, damped: bool) -> Case | None:
    """Draw a case whose drive is near the resonance of a mode that drivers reach, or None if no mode is.

    In a damped one, every mode has a quality factor of 5 to 300, so that runs settle.
    """
    motor = random_motor(rng).updated({"contact.sliding_ratio": 1.0})  # as the averaged motor
    if damped:
        motor = motor.updated({"rotor.bearing_friction_n_m": 0.0})  # as the averaged motor and a free shaft
        quality = np.exp(rng.uniform(np.log(5.0), np.log(300.0), len(motor.modes)))
        damping = {
            f"modes.{place}.damping_n_s_per_m": math.sqrt(mode.stiffness_n_per_m * mode.mass_kg) / q
            for place, (mode, q) in enumerate(zip(motor.modes, quality, strict=True))
        }
        motor = motor.updated(damping)
    reached = [mode for mode in motor.modes if FREQUENCIES[0] <= mode.frequency_hz <= FREQUENCIES[1]]
    if not reached:
        return None
    mode = reached[rng.integers(len(reached))]
    frequency = mode.frequency_hz * (1.0 + rng.normal() / mode.quality_factor)
    phase = float(rng.uniform(-180.0, 180.0))
    velocity, _ = free_tip(motor, pr.TwoPhaseDrive(voltage=1.0, frequency=frequency, phase_deg=phase))
    tip = float(10.0 ** rng.uniform(-2.0, 1.0))  # m/s
    voltage = tip / velocity if velocity > 0.0 else math.inf
    if not VOLTAGES[0] <= voltage <= VOLTAGES[1]:
        return None
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    check_together(motor, drive)
    law = str(rng.choice(["spring-slider", "coulomb", "brush"], p=[0.8, 0.1, 0.1]))
    speed = float(rng.uniform(-1.0, 1.0)) * tip / motor.rotor.radius_m if rng.random() < 0.5 else 0.0
    return Case(motor, drive, law, speed)


def doubts(document: Mapping[str, Any], **must: bool) -> list[str]:
    """Return the flags of a result that differ from the required values, and its cautions."""
    return [name for name, wanted in must.items() if document.get(name) is not wanted] + list(document["cautions"])


# --- the analyses ---


def setup(one: Case) -> Point:
    """Return the point as a run takes it by default."""
    return Point(one.motor, DriveSource(one.drive), law=law_of(one.contact))  # type: ignore[arg-type]


def duration(one: Case) -> float:
    """Return the duration of a run that settles, s, or of the longest run."""
    wanted = max(SETTLING * Dynamometer(setup(one)).duration, 80.0 * one.drive.period)
    return float(min(wanted, MOST_STEPS * setup(one).step))


def _steady(one: Case) -> Answer:
    state = pr.steady_state(one.motor, one.drive, **one.point)
    if not state.converged:
        raise pr.SimulationError("No steady state was found.")
    return _point(state.to_dict(), doubts(state.to_dict(), converged=True, stable=True))


def _point(found: Mapping[str, Any], said: list[str]) -> Answer:
    flowing = found["apparent_power_a_va"] + found["apparent_power_b_va"] + abs(found["shaft_power_w"])
    return Answer(
        {
            "torque_n_m": found["torque_n_m"],
            "power_w": found["power_a_w"] + found["power_b_w"],
            "normal_force_n": found["normal_force_n"],
        },
        {"torque_n_m": found["torque_error_n_m"]},
        {"power_w": flowing, "torque_n_m": abs(found["torque_ripple_n_m"])},
        said,
    )


def _simulate(one: Case) -> Answer:
    run = pr.simulate(one.motor, one.drive, duration(one), **one.point)
    document = run.to_dict()
    still_to_come = document["to_come"] or {}
    return Answer(
        {"torque_n_m": document["mean_torque_n_m"]},
        {
            "torque_n_m": (document["mean_torque_error_n_m"] or 0.0)
            + abs(still_to_come.get("mean_torque_n_m") or 0.0) * abs(document["mean_torque_n_m"])
        },
        {},
        doubts(document, settled=True, accurate=True),
    )


def _row(dataset: Any, place: Mapping[str, float], *must: str) -> Answer:
    found = {name: column.item() for name, column in dataset.sel(place, method="nearest").data_vars.items()}
    said = [name for name in must if not found[name]]
    said += doubts({"cautions": json.loads(dataset.attrs.get("cautions", "[]"))})
    if not math.isfinite(found["torque_n_m"]):
        raise pr.SimulationError("The dataset has no value at this point.")
    return _point(found, said)


def _curve(one: Case) -> Answer:
    beside = one.speed * 0.9 if one.speed else 1e-3 / one.motor.rotor.radius_m
    settings = {name: value for name, value in one.point.items() if name != "speed"}
    curve = pr.speed_torque(one.motor, one.drive, speeds=[beside, one.speed], **settings)
    return _row(curve, {"speed_rad_s": one.speed}, "settled", "audit_passed")


def _map(one: Case) -> Answer:
    volts = one.drive.voltage
    table = pr.working_points(one.motor, one.drive, over={"drive.voltage": [0.98 * volts, volts]}, **one.point)
    return _row(table, {"drive.voltage": volts}, "converged", "stable")


def _drive(one: Case) -> Answer:
    values = {name: getattr(one.drive, name) for name in ("voltage", "frequency", "phase_deg", "ratio_b")}
    driver = pr.Driver(kind="ideal", network="none", **values)
    report = pr.drive_report(one.motor, driver, duration(one), **one.point)
    document = report.to_dict()
    coming = document["to_come"] or {}
    return Answer(
        {"torque_n_m": report.mean_torque_n_m, "power_w": report.motor_power_w},
        {
            "torque_n_m": (report.mean_torque_error_n_m or 0.0)
            + abs(coming.get("mean_torque_n_m") or 0.0) * abs(report.mean_torque_n_m),
            "power_w": abs(coming.get("motor_power_w") or 0.0) * abs(report.motor_power_w),
        },
        {"power_w": sum(port.apparent_power_va for port in report.groups.values())},
        doubts(document, settled=True),
    )


def _averaged(one: Case) -> Answer:
    lasts = max(SETTLING * one.motor.decay_s, 200.0 * one.drive.period)
    run = pr.simulate_averaged(one.motor, one.drive, lasts, **one.point)
    document = run.to_dict()
    end = document["end"]
    return Answer(
        {
            "torque_n_m": end["torque_n_m"],
            "power_w": end["electrical_power_w"],
            "normal_force_n": end["normal_force_n"],
        },
        {"torque_n_m": TRUSTED * one.scales["torque_n_m"]},
        {},
        doubts(document, trusted=True),
    )


POINTS: dict[str, Callable[[Case], Answer]] = {
    "steady": _steady, "simulate": _simulate, "speed-torque": _curve, "map": _map, "drive": _drive,
    "averaged": _averaged,
}  # fmt: skip


# --- the analyses that do not give an operating point ---


def _small_signals(one: Case) -> Iterator[tuple[str, Answer]]:
    """Yield torque per volt at a low frequency of modulation, and that of steady states."""
    slowest = min(mode.frequency_hz / (2.0 * mode.quality_factor) for mode in one.motor.modes)
    found = pr.small_signals(one.motor, one.drive, frequencies=[1e-3 * slowest], **one.point).to_dict()
    name = "torque_per_amplitude"
    change = 1e-3 * one.drive.voltage
    sides, said, error = [], [], 0.0
    for volts in (one.drive.voltage - change, one.drive.voltage + change):
        state = pr.steady_state(one.motor, one.drive.updated({"voltage": volts}), accuracy=1e-4, **one.point)
        said += doubts(state.to_dict(), converged=True, stable=True)
        error += state.torque_error_n_m
        sides.append(state.torque_n_m)
    friction = one.scales["torque_n_m"] / one.drive.voltage
    yield (
        "small-signals",
        Answer(
            {"torque_per_volt": found["transfers"][name][0][0]},
            {"torque_per_volt": found["errors"][name][0]},
            {"torque_per_volt": friction},
            doubts(found),
        ),
    )
    yield (
        "steady",
        Answer(
            {"torque_per_volt": (sides[1] - sides[0]) / (2.0 * change)},
            {"torque_per_volt": error / (2.0 * change)},
            {},
            said,
        ),
    )


def _track(one: Case) -> Iterator[tuple[str, Answer]]:
    """Yield the phase of a mode that a loop keeps, and that of the steady state at the frequency it ends at, in rad."""
    mode = max(range(len(one.motor.modes)), key=lambda place: one.motor.modes[place].quality_factor)
    values = {name: getattr(one.drive, name) for name in ("voltage", "phase_deg", "ratio_b")}
    frequency = one.motor.modes[mode].frequency_hz
    tracker = pr.Tracker(kind="pll", frequency=frequency, bandwidth_hz=frequency / 60.0, **values)
    run = pr.track(one.motor, tracker, 250.0 / frequency, mode=mode, margin=False, **one.point)
    document = run.to_dict()
    # the edges of the detector have the resolution of a step, ωh; and a run with a tracker is not corrected for the
    # shift of the resonance by the trapezoidal rule, (ωh)²/12
    step = 2.0 * math.pi * frequency * document["run"]["step_s"]
    resolution = step + document["lag"]["quality"] / 6.0 * step**2
    yield (
        "track",
        Answer(
            {"phase_rad": math.radians(tracker.target_deg)},
            {"phase_rad": math.radians(document["rms_phase_error_deg"] or 0.0) + resolution},
            {"phase_rad": 1.0},
            doubts(document, locked=True, kept_lock=True),
        ),
    )
    drive = one.drive.updated({"frequency": document["end_frequency_hz"]})
    state = pr.steady_state(one.motor, drive, **one.point)
    if state.solution is None or state.solution.trace is None:
        raise pr.SimulationError("No steady state was found.")
    trace, own = state.solution.trace, one.motor.modes[mode]
    turn = np.exp(-2j * np.pi * drive.frequency * trace.time[1:])
    velocity = np.mean(trace.states[len(one.motor.modes) + mode, 1:] * turn)
    second = drive.voltage_b * np.exp(1j * math.radians(drive.phase_deg))
    force = -0.5j * (own.coupling_a_n_per_v * drive.voltage + own.coupling_b_n_per_v * second)
    yield "steady", Answer(
        {"phase_rad": float(np.angle(velocity / force))}, {}, {},
        doubts(state.to_dict(), converged=True, stable=True),
    )  # fmt: skip


PAIRS = {"small-signals": _small_signals, "track": _track}


# --- what came of it ---


def differences(one: Case, answers: Mapping[str, Answer]) -> Iterator[dict[str, Any]]:
    """Yield the comparison of each two answers in each quantity that both have."""
    for (first, ours), (second, theirs) in combinations(answers.items(), 2):
        for name in ours.values.keys() & theirs.values.keys():
            scale = max(
                one.scales.get(name, 0.0), ours.scales.get(name, 0.0), theirs.scales.get(name, 0.0),
            )  # fmt: skip
            scale = max(scale, abs(ours.values[name]), abs(theirs.values[name]))
            apart = abs(ours.values[name] - theirs.values[name])
            stated = sum(error for of in (ours, theirs) if math.isfinite(error := of.errors.get(name, 0.0)))
            said = [f"{first}: {text}" for text in ours.doubts] + [f"{second}: {text}" for text in theirs.doubts]
            yield {
                "pair": f"{first}, {second}",
                "quantity": name,
                "difference": apart / scale if scale else 0.0,
                "kind": judged(apart, stated, scale, said),
                "said": said if apart > ALLOWED * scale + stated else [],
            }


def judged(apart: float, stated: float, scale: float, said: Sequence[str]) -> str:
    """Return the kind of a difference, of :data:`KINDS`."""
    if apart <= ALLOWED * scale + stated:
        return "agree"
    return "explained" if said else "contradiction"


def outcome(index: int, seed: int = SEED) -> dict[str, Any]:
    """Run a case by all analyses, and compare them."""
    one = subject(index, seed)
    refused: dict[str, str] = {}
    answers: dict[str, Answer] = {}
    for name, analysis in POINTS.items():
        with _refusals(refused, name):
            answers[name] = analysis(one)
    found = list(differences(one, answers))
    for name, pair in PAIRS.items() if index % SHARE == 0 else ():
        with _refusals(refused, name):
            found += differences(one, dict(pair(one)))
    return {"contact": one.contact, "refused": refused, "differences": found}


class _SlowError(Exception):
    """An analysis takes too long."""


def _slow(*_: object) -> None:
    raise _SlowError(f"It takes more than {MOST_SECONDS} s.")


@contextmanager
def _refusals(refused: dict[str, str], name: str) -> Iterator[None]:
    signal.signal(signal.SIGALRM, _slow)
    signal.alarm(MOST_SECONDS)
    try:
        yield
    except (*ERRORS, _SlowError) as error:
        refused[name] = str(error).partition(" The netlist is kept")[0][:200]
    finally:
        signal.alarm(0)


def summary(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts and the contradictions, JSON-ready."""
    every = [difference for one in found for difference in one["differences"]]
    kinds: dict[str, dict[str, int]] = {}
    for difference in every:
        kinds.setdefault(difference["pair"], dict.fromkeys(KINDS, 0))[difference["kind"]] += 1
    said = Counter(cause(text) for difference in every for text in difference["said"][:1])
    refused = {
        name: Counter(cause(one["refused"][name]) for one in found if name in one["refused"])
        for name in (*POINTS, *PAIRS)
    }
    return {
        "cases": len(found),
        "comparisons": len(every),
        "kinds": {kind: sum(counts[kind] for counts in kinds.values()) for kind in KINDS},
        "by_pair": kinds,
        "explained_by": dict(said.most_common()),
        "refused": {name: dict(counts.most_common(5)) for name, counts in refused.items()},
        "contradictions": [
            {"index": one["index"], **difference}
            for one in found for difference in one["differences"] if difference["kind"] == "contradiction"
        ],
    }  # fmt: skip


def passes(table: Mapping[str, Any]) -> bool:
    """Whether no answer contradicts another one in silence."""
    return not table["contradictions"]


CAMPAIGN = Campaign("contradictions", outcome, summary, passes, COUNT)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
