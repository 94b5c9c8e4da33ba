# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of random motors against independent references: ``python -m validation.runs``, a part of ``make validation``.

Each case is run by ``simulate`` twice, with its default step and with a drawn ``accuracy``. The error is the RMS
distance of the tip from that of the reference, relative to the motion. A run with an accuracy must keep it. A default
run must be within 1 %, or say that it is not. The reference depends on the law of the contact:

- spring-slider and free tip: the event-driven integrator of ``tests/reference``;
- coulomb: :func:`smooth`, the equations of motion by scipy's DOP853;
- brush: ``simulate`` with an eighth of the step. This one is not independent: it checks the step, not the equations.

Each reference is computed twice, the second time with a coarser step or tolerance and a start that is 0.1 pm away. A
case counts only where the two agree to a tenth of what is asked: elsewhere the motion is chaotic.
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import pyspice_runner as pr
from pyspice_runner.circuit.law import law_of
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.motor.drive import Drive, check_together, free_tip
from pyspice_runner.motor.parameters import Mode
from pyspice_runner.run.point import Point
from pyspice_runner.spice.ngspice import ngspice_version
from tests.reference.integrator import Tone, integrate
from validation.campaign import Campaign

Array = NDArray[np.float64]
COUNT, SEED = 200, 1
DEFAULT = 0.01  # error of the tip that a default run may have without a note
MOST_MODES, STEPS = 6, (800.0, 9000.0)
QUALITY, FREQUENCY = (5.0, 800.0), (8e3, 90e3)
LAWS = {"spring-slider": 0.6, "coulomb": 0.15, "brush": 0.15, None: 0.1}  # shares of the cases
CREEP = 1e-2  # m/s, of the package's Coulomb law
FINER = 16  # steps of the reference in one of the default run
PERTURBATION = 1e-13  # m, of the second reference's start
AGREE = 0.1  # of what is asked: greatest distance of the two references
KINDS = ("kept", "said", "broken", "error", "chaotic")


@dataclass(frozen=True)
class Case:
    """One motor, its drive, and how it is run.

    Attributes:
        motor: the motor.
        drive: two-phase or two-tone.
        law: law of the contact.
        steps: number of default steps in the run.
        accuracy: asked for in the second run.
        shaft: held ``speed`` or ``load_torque``; empty for a free shaft.
    """

    motor: pr.Motor
    drive: Drive
    law: str | None
    steps: float
    accuracy: float
    shaft: dict[str, float]

    @property
    def setup(self) -> Point:
        """What ``simulate`` runs by default."""
        return Point(self.motor, DriveSource(self.drive), law=law_of(self.law))  # type: ignore[arg-type]

    @property
    def duration(self) -> float:
        """Simulated time in s."""
        return self.steps * self.setup.step


@dataclass(frozen=True)
class Outcome:
    """What came of a run.

    Attributes:
        case: its index.
        law: law of the contact.
        asked: accuracy; ``None`` for the default run.
        kind: one of :data:`KINDS`.
        error: true error of the tip.
        stated: the run's own estimate.
        reference_change: distance of the two references.
        separated: share of the time in which the tip is off the rotor.
        steps: number of steps of the run.
        modes: number of modes.
        said: an error message.
        seconds: wall time.
    """

    case: int
    law: str | None
    asked: float | None
    kind: str
    error: float | None
    stated: float | None
    reference_change: float | None
    separated: float | None
    steps: int | None
    modes: int
    said: str
    seconds: float


# --- what is drawn ---


def case(seed: int, index: int) -> Case:
    """Draw a case that the model accepts; the same for the same arguments."""
    rng = np.random.default_rng((seed, index))
    while True:
        try:
            return _drawn(rng)
        except (pr.ParameterError, ValidationError):
            continue


def _drawn(rng: np.random.Generator) -> Case:
    base = pr.load_motor("andersen2002")

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    def about(x: float, factor: float) -> float:
        return x * log(1.0 / factor, factor)

    modes = []
    for number in range(int(rng.integers(1, MOST_MODES + 1))):
        frequency, mass = log(*FREQUENCY), log(1e-3, 6e-3)
        stiffness = mass * (2.0 * math.pi * frequency) ** 2
        coupling = log(0.02, 0.3)
        towards = rng.random() < 0.5  # a mode that moves the tip mainly towards the rotor
        modes.append(
            Mode(
                name=f"m{number}",
                mass_kg=mass,
                stiffness_n_per_m=stiffness,
                damping_n_s_per_m=math.sqrt(stiffness * mass) / log(*QUALITY),
                coupling_a_n_per_v=coupling,
                coupling_b_n_per_v=coupling * float(rng.choice([-1.0, 1.0])) * float(rng.uniform(0.8, 1.2)),
                tip_x=float(rng.uniform(-0.2, 0.2) if towards else rng.uniform(0.5, 2.5)),
                tip_y=float(rng.uniform(0.5, 1.5) if towards else rng.uniform(-0.2, 0.2)),
            )
        )
    mount = None
    if rng.random() < 0.4:
        mount = {"stiffness_n_per_m": log(1e4, 1e6), "mass_kg": log(0.02, 0.2), "damping_n_s_per_m": log(20.0, 200.0)}
    motor = base.updated(
        {
            "mount": mount,
            "contact.preload_n": log(1.0, 20.0),
            "contact.friction": float(rng.uniform(0.1, 0.6)),
            "contact.normal_stiffness_n_per_m15": about(base.contact.normal_stiffness_n_per_m15, 3.0),
            "contact.tangential_compliance_tip_m_per_n23": about(base.contact.tangential_compliance_tip_m_per_n23, 2.0),
            "rotor.radius_m": log(4e-3, 2e-2),
            "rotor.inertia_kg_m2": log(1e-8, 1e-6),
        }
    )
    modes = _upright(sorted(modes, key=lambda mode: mode.frequency_hz))
    motor = pr.Motor.model_validate(motor.model_copy(update={"modes": tuple(modes)}).model_dump())
    mode = motor.modes[rng.integers(len(motor.modes))]
    frequency, phase = mode.frequency_hz * log(0.9, 1.3), float(rng.uniform(-180.0, 180.0))

    def driven(voltage: float) -> Drive:
        if two_tones:
            return pr.TwoToneDrive(
                voltage_1=voltage, frequency_1=frequency, voltage_2=share * voltage, frequency_2=order * frequency,
                phase_deg=phase,
            )  # fmt: skip
        return pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)

    two_tones, share, order = rng.random() < 0.25, log(0.2, 1.0), int(rng.integers(2, 4))
    drive = driven(log(0.02, 1.0) / free_tip(motor, driven(1.0))[0])  # the velocity of a free tip, m/s
    check_together(motor, drive)
    law = list(LAWS)[rng.choice(len(LAWS), p=list(LAWS.values()))]
    shaft, chance = {}, rng.random()
    if law and chance < 0.25:
        shaft = {"speed": float(rng.uniform(-0.3, 0.3)) / motor.rotor.radius_m}
    elif law and chance < 0.5:
        held = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
        shaft = {"load_torque": float(rng.uniform(-0.3, 0.3)) * held}
    return Case(motor, drive, law, log(*STEPS), log(1e-3, 2e-2), shaft)


def _upright(modes: list[Mode]) -> list[Mode]:
    """Change the tangential motion of one mode so that the preload does not bend the stator sideways.

    The references start from r = -Y F₀/k, which is at rest only then: the Hertz contact pushes a tip that is not under
    the rotor's centre to the side.
    """
    softest = max(range(len(modes)), key=lambda place: abs(modes[place].tip_y) / modes[place].stiffness_n_per_m)
    sideways = sum(
        mode.tip_x * mode.tip_y / mode.stiffness_n_per_m for place, mode in enumerate(modes) if place != softest
    )
    mode = modes[softest]
    upright = mode.model_copy(update={"tip_x": -sideways * mode.stiffness_n_per_m / mode.tip_y})
    return [*modes[:softest], upright, *modes[softest + 1 :]]


# --- the references ---


@dataclass(frozen=True)
class Tip:
    """The tip's motion in m over time in s."""

    time: Array
    x: Array
    y: Array
    separated: float | None = None

    def away_from(self, other: Tip) -> float:
        """RMS distance of this tip from another one, relative to the motion of the other one."""
        inside = other.time <= self.time[-1]
        gaps = [
            CubicSpline(self.time, ours)(other.time[inside]) - theirs[inside]
            for ours, theirs in ((self.x, other.x), (self.y, other.y))
        ]
        motion = math.sqrt(np.var(other.x[inside]) + np.var(other.y[inside]))
        return math.sqrt(sum(float(np.mean(gap**2)) for gap in gaps)) / motion


def tones(drive: Drive) -> tuple[list[Tone], list[Tone]]:
    """The voltages of both groups for the references."""
    of_a, of_b = (
        [Tone(tone.amplitude, tone.frequency, tone.phase) for tone in group] for group in (drive.tones_a, drive.tones_b)
    )
    return of_a, of_b


def exact(subject: Case, *, second: bool = False) -> Tip:
    """Return the reference, or the second one."""
    step = subject.setup.step
    if subject.law == "brush":
        run = pr.simulate(
            subject.motor, subject.drive, duration=subject.duration, contact="brush",
            step=step / (4.0 if second else 8.0), **subject.shaft,
        )  # fmt: skip
        return Tip(run.time_s, run.tip_x_m, run.tip_y_m, run.state_fractions["separated"])
    shift = PERTURBATION if second else 0.0
    if subject.law == "coulomb":
        return smooth(subject, 1e-7 if second else 1e-9, shift)
    run_ = integrate(
        subject.motor.to_dict(), *tones(subject.drive), duration=subject.duration, output_step=step,
        step=step / (FINER / 2 if second else FINER), contact=subject.law is not None, perturbation_m=shift,
        **subject.shaft,
    )  # fmt: skip
    separated = run_.state_fractions["separated"] if subject.law else None
    return Tip(run_.time_s, run_.tip_x_m, run_.tip_y_m, separated)


def smooth(subject: Case, tolerance: float, shift: float) -> Tip:
    """Return the tip of a motor with regularised Coulomb friction, by scipy's DOP853.

    The equations are those of ``tests/reference/integrator.py`` with F_T = μ F_N tanh(v_rel/v_creep) instead of the
    spring and its slider, written here a second time.
    """
    motor, (tones_a, tones_b) = subject.motor, tones(subject.drive)
    columns = ("mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "coupling_a_n_per_v", "coupling_b_n_per_v")
    mass, damping, stiffness, by_a, by_b = (np.array([getattr(mode, name) for mode in motor.modes]) for name in columns)
    along, towards = (np.array([getattr(mode, name) for mode in motor.modes]) for name in ("tip_x", "tip_y"))
    contact, rotor, mount, n = motor.contact, motor.rotor, motor.mount, len(motor.modes)
    hertz, preload, radius = contact.normal_stiffness_n_per_m15, contact.preload_n, rotor.radius_m
    approach = (preload / hertz) ** (2.0 / 3.0)
    gap = approach + preload * float(np.sum(towards**2 / stiffness))
    held, load = subject.shaft.get("speed"), subject.shaft.get("load_torque", 0.0)

    def voltage(group: Sequence[Tone], t: float) -> float:
        return sum(one.amplitude_v * math.sin(2.0 * math.pi * one.frequency_hz * t + one.phase_rad) for one in group)

    def rates(t: float, z: Array) -> Array:
        r, v, omega, lift, rise = z[:n], z[n : 2 * n], z[2 * n], z[2 * n + 1], z[2 * n + 2]
        x, h = along @ r, radius - gap - towards @ r - lift
        distance = math.hypot(x, h)
        depth = radius - distance
        normal = hertz * depth**1.5 if depth > 0.0 else 0.0
        e_x, e_y = x / distance, h / distance
        speed = (along @ v) * e_y + (towards @ v + rise) * e_x - omega * radius
        friction = contact.friction * normal * math.tanh(speed / CREEP)
        f_x, f_y = normal * e_x - friction * e_y, -normal * e_y - friction * e_x
        force = by_a * voltage(tones_a, t) + by_b * voltage(tones_b, t) + along * f_x + towards * f_y
        change = np.zeros(2 * n + 3)
        change[:n], change[n : 2 * n] = v, (force - damping * v - stiffness * r) / mass
        if held is None:
            change[2 * n] = (radius * friction - rotor.bearing_damping_n_m_s * omega - load) / rotor.inertia_kg_m2
        if mount is not None:
            change[2 * n + 1] = rise
            spring = mount.damping_n_s_per_m * rise + mount.stiffness_n_per_m * lift
            change[2 * n + 2] = (preload + f_y - spring) / mount.mass_kg
        return change

    start = np.zeros(2 * n + 3)
    start[:n] = -towards * preload / stiffness
    start[0] += shift
    start[2 * n] = held or 0.0
    time_s = np.arange(int(subject.steps) + 1) * subject.setup.step
    size = approach * tolerance  # the tip moves by the approach or more
    absolute = np.full(start.size, size)
    absolute[n : 2 * n] *= 2.0 * math.pi * motor.modes[0].frequency_hz
    absolute[2 * n] = 1e-3 * tolerance / radius  # 1 mm/s at the rim
    found = solve_ivp(
        rates, (0.0, time_s[-1]), start, "DOP853", t_eval=time_s, rtol=tolerance, atol=absolute,
        max_step=8.0 * subject.setup.step,
    )  # fmt: skip
    if not found.success:
        raise RuntimeError(found.message)
    return Tip(time_s, along @ found.y[:n], towards @ found.y[:n])  # relative to the carrier


# --- what came of it ---


def outcomes(subject: Case, index: int) -> list[Outcome]:
    """Run a case with the default step and with its accuracy."""
    reference = exact(subject)
    change = exact(subject, second=True).away_from(reference)
    return [_outcome(subject, index, asked, reference, change) for asked in (None, subject.accuracy)]


def _outcome(subject: Case, index: int, asked: float | None, reference: Tip, change: float) -> Outcome:
    began = time.monotonic()
    error = stated = steps = None
    said = ""
    try:
        run = pr.simulate(
            subject.motor, subject.drive, duration=subject.duration, contact=subject.law,  # type: ignore[arg-type]
            accuracy=asked, **subject.shaft,
        )  # fmt: skip
    except (pr.SimulationError, pr.ParameterError) as fault:
        kind, said = "error", str(fault).partition(" The netlist is kept")[0]
    else:
        error = Tip(run.time_s, run.tip_x_m, run.tip_y_m).away_from(reference)
        stated, steps = run.error_estimate, len(run.time_s)
        kind = judged(error, DEFAULT if asked is None else asked, change, said=asked is None and run.accurate is False)
    return Outcome(
        index, subject.law, asked, kind, error, stated, change, reference.separated, steps, len(subject.motor.modes),
        said, time.monotonic() - began,
    )  # fmt: skip


def judged(error: float, allowed: float, change: float, *, said: bool) -> str:
    """Return the kind of a run: its error against what is allowed, and whether it states that it is inaccurate."""
    if error <= allowed:
        return "kept"
    if said:
        return "said"
    return "chaotic" if change > AGREE * allowed else "broken"


def outcome(index: int) -> dict[str, Any]:
    """Return the outcomes of a case, JSON-ready."""
    runs = outcomes(case(SEED, index), index)
    return {
        "runs": [
            {key: float(f"{x:.4g}") if isinstance(x, float) else x for key, x in asdict(one).items()} for one in runs
        ]
    }


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts, JSON-ready."""
    runs = [run for one in record for run in one["runs"]]
    table: dict[str, Any] = {"cases": len(record), "seed": SEED, "ngspice": ngspice_version()}
    for name, chosen in {
        "default": [run for run in runs if run["asked"] is None],
        "accuracy": [run for run in runs if run["asked"] is not None],
    }.items():
        kinds = Counter(run["kind"] for run in chosen)
        errors = [run["error"] for run in chosen if run["error"] is not None]
        table[name] = {
            "kinds": {kind: kinds[kind] for kind in KINDS},
            "median_error": float(f"{np.median(errors):.3g}") if errors else None,
        }
    return table


def passes(table: Mapping[str, Any]) -> bool:
    """Whether no default run is silent about more than 1 %, and 99 of 100 runs keep the accuracy that was asked for."""
    kinds = table["accuracy"]["kinds"]
    decided = sum(kinds.values()) - kinds["chaotic"]
    return table["default"]["kinds"]["broken"] == 0 and kinds["broken"] <= 0.01 * decided


CAMPAIGN = Campaign("runs", outcome, summary, passes, COUNT)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
