# SPDX-License-Identifier: GPL-3.0-or-later
"""Random motors with every loss and recoil: ``python -m validation.losses``, a part of ``make validation``.

Motors and drives are those of :mod:`validation.runs`, with dielectric loss, damping along the normal, compliances in
series, Stribeck friction, a dry bearing, and a mount that the modes shake. Each is run by ``simulate`` with its default
step and, its shaft held, by ``steady_state``.

- No loss may be negative by more than 0.1 % of the power put in without a caution.
- The first cases are compared with :mod:`tests.reference.damped`. Each mean, each energy or power relative to the
  input, and the path of the tip must be within 1 %, or the result says that it may not be. The torque of a steady state
  is relative to the friction torque, as its accuracy.
"""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError

import pyspice_runner as pr
from pyspice_runner.motor.contact import normal_stiffness_at_preload, tangential_stiffness_at_preload
from pyspice_runner.motor.drive import check_together
from pyspice_runner.run.audit import GAIN
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, SMALL_TORQUE
from pyspice_runner.spice.ngspice import ngspice_version
from tests.reference.damped import DampedRun, integrate_damped
from validation import runs as random_runs
from validation.campaign import Campaign
from validation.runs import Tip

COUNT, COMPARED, SEED = 200, 30, 3
ALLOWED = 0.01
STILL = 1e-3  # of the greatest speed: the scale of a mean speed is not below
CONVERGED = 0.002  # change of the reference by half its step and another start; more is chaotic
LADDER = 0.05  # error of the loss tangent that the ladder of the dielectric may have
PERIODS, MOST_STEPS = 30.0, 8000.0  # of a run
DECAYS, MOST_REFERENCE_STEPS = 8.0, 1.5e7  # of a reference that settles
FINER, SETTLING = 6400, 1600  # steps of the reference in the shortest period, of a run and to settle
LONGEST = 20.0  # s, of a run of ngspice
LOSSES = ("dielectric", "damping", "contact_damping", "friction", "mount_damping", "bearing")
OF_STATE = ("dielectric_loss_w", "damping_loss_w", "friction_loss_w", "normal_loss_w")
ERRORS = (pr.ParameterError, pr.SimulationError)
KINDS = ("within 1 %", "said", "chaotic", "silent")


def case(seed: int, index: int) -> random_runs.Case:
    """Draw a case; one that is compared has the spring-slider."""
    rng = np.random.default_rng((seed, index))
    while True:
        found = random_runs.case(int(rng.integers(1 << 30)), index)
        law = "spring-slider" if index < COMPARED else found.law
        if law is None:
            continue
        try:
            motor = _lossy(rng, found.motor, law)
            check_together(motor, found.drive)
        except (*ERRORS, ValidationError):
            continue
        return random_runs.Case(motor, found.drive, law, found.steps, found.accuracy, found.shaft)


def _lossy(rng: np.random.Generator, motor: pr.Motor, law: str) -> pr.Motor:
    """Add the losses, each to half of the motors at least."""

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(math.log(low), math.log(high))))

    contact, mount = motor.contact, log(0.02, 0.2)
    stall = contact.friction * contact.preload_n * motor.rotor.radius_m
    recoils = rng.uniform(-1.0, 1.0, len(motor.modes))
    shaken = sum(recoil**2 / mode.mass_kg for recoil, mode in zip(recoils, motor.modes, strict=True))
    recoils *= math.sqrt(rng.uniform(0.0, 0.3) * mount / shaken)
    changes: dict[str, Any] = {
        "piezo.loss_tangent": log(1e-3, 0.1),
        "contact.restitution": float(rng.uniform(0.6, 1.0)),
        "contact.restitution_velocity_m_s": log(0.03, 0.3),
        "rotor.bearing_damping_n_m_s": stall * log(1e-5, 1e-2),
        "mount": {"stiffness_n_per_m": log(1e4, 1e6), "mass_kg": mount, "damping_n_s_per_m": log(20.0, 200.0)},
        **{f"modes.{place}.recoil_kg": float(recoil) for place, recoil in enumerate(recoils)},
    }
    if rng.random() < 0.5:
        share = float(rng.uniform(0.0, 0.5))
        changes["contact.series_compliance_m_per_n"] = share / normal_stiffness_at_preload(contact)
    falls, soft = rng.random() < 0.5, rng.random() < 0.5
    if soft and not falls:
        share = float(rng.uniform(0.0, 0.5))
        changes["contact.tangential_series_compliance_m_per_n"] = share / tangential_stiffness_at_preload(contact)
    if law == "spring-slider" and falls:
        changes["contact.sliding_ratio"] = float(rng.uniform(0.6, 1.0))
        changes["contact.stribeck_velocity_m_s"] = log(0.02, 0.5)
    if rng.random() < 0.5:
        changes["rotor.bearing_friction_n_m"] = stall * log(1e-3, 0.2)
        changes["rotor.bearing_presliding_rad"] = log(1e-4, 1e-2)
    return motor.updated(changes)


# --- the reference ---


def _reference(one: random_runs.Case, duration: float, finer: int, *, coarse: bool = False, **shaft: Any) -> DampedRun:
    """Integrate a case; ``coarse`` takes twice the step and starts 0.1 pm away."""
    return integrate_damped(
        one.motor.to_dict(), *random_runs.tones(one.drive), duration=duration,
        output_step=duration / math.ceil(duration / one.setup.step),
        step=(2.0 if coarse else 1.0) * one.setup.shortest_period / finer,
        perturbation_m=random_runs.PERTURBATION if coarse else 0.0, **shaft,
    )  # fmt: skip


def dielectric_loss(one: random_runs.Case) -> float:
    """Return the loss in W of capacitances with a constant loss tangent, C(f) = C (f/100 kHz)^(-2δ/π)."""
    piezo, total = one.motor.piezo, 0.0
    angle = math.atan(piezo.loss_tangent)
    for capacitance, tones in zip(
        (piezo.capacitance_a_f, piezo.capacitance_b_f), random_runs.tones(one.drive), strict=True
    ):
        for tone in tones:
            size = capacitance * (tone.frequency_hz / 1e5) ** (-2.0 * angle / math.pi)
            total += math.pi * tone.frequency_hz * size * math.sin(angle) * tone.amplitude_v**2
    return total


# --- differences: name → (relative difference, the same of the two references, what the result states) ---

Differences = dict[str, tuple[float, float, float]]


def of_run(one: random_runs.Case, run: Any, duration: float) -> Differences:
    """Compare a run with the reference."""
    fine, coarse = (_reference(one, duration, FINER, coarse=coarse, **one.shaft) for coarse in (False, True))
    begin = duration - min(20, int(duration / one.drive.period * (1.0 + 1e-9))) * one.drive.period
    contact, radius = one.motor.contact, one.motor.rotor.radius_m
    found: Differences = {}

    def add(name: str, ours: float, theirs: float, other: float, scale: float, stated: float = 0.0) -> None:
        found[name] = abs(ours - theirs) / scale, abs(other - theirs) / scale, stated / scale

    force, other = fine.mean("friction_force", begin), coarse.mean("friction_force", begin)
    scale = abs(force) + SMALL_TORQUE * contact.friction * contact.preload_n
    add("torque", run.mean_torque_n_m / radius, force, other, scale, (run.torque_error_n_m or 0.0) / radius)
    if "speed" not in one.shaft:
        speed, other = fine.mean("speed", begin), coarse.mean("speed", begin)
        scale = abs(speed) + STILL * float(np.abs(fine.rotor_speed_rad_s).max()) + ROUNDING_RAD_S
        add("speed", run.mean_rotor_speed_rad_s, speed, other, scale, run.speed_error_rad_s or 0.0)
    energy = run.energy
    ours = {
        "input": energy.electrical - energy.dielectric, "damping": energy.damping,
        "mount_damping": energy.mount_damping, "normal": energy.contact_damping, "friction": energy.friction,
        "bearing": energy.bearing,
    }  # fmt: skip
    scale = max(abs(float(fine.integrals[name][-1])) for name in ours)
    for name, value in ours.items():  # the input is a difference of what passes through the pins
        of = max(scale, energy.passed) if name == "input" else scale
        add(name, value, float(fine.integrals[name][-1]), float(coarse.integrals[name][-1]), of)
    paths = [Tip(which.time_s, which.tip_x_m, which.tip_y_m) for which in (run, coarse, fine)]
    found["tip"] = paths[0].away_from(paths[2]), paths[1].away_from(paths[2]), run.error_estimate or 0.0
    return found


def of_state(one: random_runs.Case, state: Any) -> Differences | None:
    """Compare a steady state with a reference that has settled; ``None`` if it takes too long to."""
    period, motor = one.drive.period, one.motor
    periods = math.ceil(max(DECAYS * motor.decay_s, 40.0 * period) / period) + 20
    if periods * period / one.setup.shortest_period * SETTLING > MOST_REFERENCE_STEPS:
        return None
    duration, radius = periods * period, motor.rotor.radius_m
    fine, coarse = (
        _reference(one, duration, SETTLING, coarse=coarse, speed=state.speed_rad_s) for coarse in (False, True)
    )
    begin = duration - 20.0 * period
    mean, other = ({name: run.mean(name, begin) for name in run.integrals} for run in (fine, coarse))
    found: Differences = {}
    contact = motor.contact
    force_scale = max(abs(mean["friction_force"]), contact.friction * contact.preload_n)  # as steady_state's accuracy
    power_scale = abs(mean["input"]) + max(-state.speed_rad_s * radius * mean["friction_force"], 0.0)

    def add(name: str, ours: float, theirs: float, change: float, scale: float, stated: float = 0.0) -> None:
        found[name] = abs(ours - theirs) / scale, change / scale, stated / scale

    def change(name: str) -> float:
        return abs(mean[name] - other[name])

    add(
        "torque", state.torque_n_m / radius, mean["friction_force"], change("friction_force"), force_scale,
        state.torque_error_n_m / radius,
    )  # fmt: skip
    add("normal_force", state.normal_force_n, mean["normal_force"], change("normal_force"), contact.preload_n)
    mechanical = state.power_a_w + state.power_b_w - state.dielectric_loss_w
    add("input", mechanical, mean["input"], change("input"), power_scale)
    lost = mean["damping"] + mean["mount_damping"]
    add("damping", state.damping_loss_w, lost, change("damping"), power_scale)
    for name in ("normal", "friction"):
        add(name, getattr(state, f"{name}_loss_w"), mean[name], change(name), power_scale)
    expected = dielectric_loss(one)
    add("dielectric", state.dielectric_loss_w, expected, 0.0, expected, LADDER * expected)
    return found


def judged(differences: Mapping[str, Sequence[float]], *, said: bool) -> str:
    """Return the kind of a result, of :data:`KINDS`, by its largest differences and what it states."""
    off = {name: one for name, one in differences.items() if one[0] > ALLOWED}
    if not off:
        return KINDS[0]
    open_ = {name: one for name, one in off.items() if one[0] > one[2]}
    if said or not open_:
        return "said"
    return "chaotic" if all(one[1] > CONVERGED for one in open_.values()) else "silent"


# --- what came of it ---


def gains(losses: Mapping[str, float], put_in: float) -> dict[str, float]:
    """Return the losses that are negative by more than 0.1 % of what is put in, as shares of it."""
    return {name: loss / put_in for name, loss in losses.items() if -loss > GAIN * put_in > 0.0}


def outcome(index: int, seed: int = SEED) -> dict[str, Any]:
    """Run a case by both analyses, and judge it."""
    one = case(seed, index)
    found: dict[str, Any] = {"contact": one.law}
    for name, part in (("run", _run), ("state", _state)):
        try:
            found[name] = part(one, index)
        except ERRORS as error:
            found[name] = {"refused": str(error).partition(" The netlist is kept")[0][:200]}
    return found


def _run(one: random_runs.Case, index: int) -> dict[str, Any]:
    duration = min(PERIODS * one.drive.period, MOST_STEPS * one.setup.step)
    run = pr.simulate(one.motor, one.drive, duration, contact=one.law, timeout=LONGEST, **one.shaft)  # type: ignore[arg-type]
    losses = {name: getattr(run.energy, name) for name in LOSSES}
    compared = of_run(one, run, duration) if index < COMPARED else None
    return _judged(losses, run.energy.passed, run.cautions, compared, said=run.accurate is False)


def _state(one: random_runs.Case, index: int) -> dict[str, Any]:
    speed = one.shaft.get("speed", (-1) ** index * 0.05 / one.motor.rotor.radius_m)
    state = pr.steady_state(one.motor, one.drive, speed=speed, contact=one.law, timeout=LONGEST)  # type: ignore[arg-type]
    if not state.converged:
        return {"refused": "No steady state was found."}
    losses = {name: getattr(state, name) for name in OF_STATE}
    put_in = max(state.power_a_w + state.power_b_w, 0.0) + max(-state.shaft_power_w, 0.0)
    said = not state.stable or state.held_by_friction
    compared = of_state(one, state) if index < COMPARED and not said else None
    return _judged(losses, put_in, state.cautions, compared, said=said)


def _judged(
    losses: Mapping[str, float], put_in: float, cautions: Sequence[str], compared: Differences | None, *, said: bool
) -> dict[str, Any]:
    told = any("deliver" in text for text in cautions)
    found: dict[str, Any] = {"gains": gains(losses, put_in), "told": told}
    if compared is not None:
        found["kind"] = judged(compared, said=said)
        found["differences"] = {
            name: [float(f"{value:.2g}") for value in one] for name, one in compared.items()
        }  # fmt: skip
    return found


def _parts(found: Sequence[Mapping[str, Any]], name: str) -> Iterator[tuple[int, Mapping[str, Any]]]:
    for one in found:
        if "refused" not in one[name]:
            yield one["index"], one[name]


def summary(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts and what is not within 1 %, JSON-ready."""
    table: dict[str, Any] = {"cases": len(found), "seed": SEED, "ngspice": ngspice_version()}
    for name in ("run", "state"):
        parts = list(_parts(found, name))
        compared = [(index, part) for index, part in parts if "kind" in part]
        kinds = Counter(part["kind"] for _, part in compared)
        largest: dict[str, list[float]] = {}
        for _, part in compared:
            for quantity, one in part["differences"].items():
                largest.setdefault(quantity, []).append(one[0])
        table[name] = {
            "results": len(parts),
            "refused": dict(Counter(one[name]["refused"] for one in found if "refused" in one[name])),
            "gain_told": [index for index, part in parts if part["gains"] and part["told"]],
            "gain_silent": {index: part["gains"] for index, part in parts if part["gains"] and not part["told"]},
            "kinds": {kind: kinds[kind] for kind in KINDS},
            "median_and_largest_difference": {
                quantity: [float(f"{np.median(values):.2g}"), max(values)] for quantity, values in largest.items()
            },
            "beyond": {
                index: {"kind": part["kind"]}
                | {quantity: one for quantity, one in part["differences"].items() if one[0] > ALLOWED}
                for index, part in compared if part["kind"] != KINDS[0]
            },
        }  # fmt: skip
    return table


def passes(table: Mapping[str, Any]) -> bool:
    """Whether no result is silent about a gain or a difference."""
    return not any(table[name]["gain_silent"] or table[name]["kinds"]["silent"] for name in ("run", "state"))


CAMPAIGN = Campaign("losses", outcome, summary, passes, COUNT)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
