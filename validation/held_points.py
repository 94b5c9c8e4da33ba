# SPDX-License-Identifier: GPL-3.0-or-later
"""Held shafts at random drives: the steady state against settling from rest: a part of ``make validation``.

Motors are two built-in ones as they are, and a beam and the motor with every effect with a random contact. The
torque of a steady state that is determined must be that at which a run of the full motor settles from preloaded rest.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from random import Random
from typing import Any

import pyspice_runner as pr
from pyspice_runner.circuit.law import LAWS
from tests.motors import BEAM40
from validation.campaign import Campaign

SEED, COUNT = 47, 200
EVERY_EFFECT = Path(__file__).parents[1] / "tests" / "data" / "every_effect.toml"
MOTORS = ("andersen2002", "bimodal40", BEAM40, str(EVERY_EFFECT))
RANDOM_CONTACT = MOTORS[2:]
RANGES = {"andersen2002": (0.945, 0.975)}  # of the frequency over the nominal one: about 51.7 kHz, where friction holds
RANGE = (0.99, 1.01)  # of the other motors
NONLINEAR = ("softening_per_m2", "damping_growth_per_m2")  # of modes; a run that settles takes linear ones
LEAST_VOLTAGE = 2.0  # V
ALLOWED = 5e-3  # of the friction torque: to 1e-3 of it, a settled block repeats the one before
ERRORS = 3.0  # stated errors of the steady state, allowed as well
KINDS = ("agrees", "differs", "held", "unstable", "unsettled", "not found", "refused")


def drawn(index: int, seed: int = SEED) -> tuple[pr.Motor, pr.TwoPhaseDrive, str]:
    """Draw motor, drive and contact law of a case."""
    random = Random(f"{seed} {index}")
    name = MOTORS[index % len(MOTORS)]
    motor = pr.load_motor(name)
    curved = [place for place, mode in enumerate(motor.modes) if any(getattr(mode, of) for of in NONLINEAR)]
    motor = motor.updated({f"modes.{place}.{of}": 0.0 for place in curved for of in NONLINEAR})
    if name in RANDOM_CONTACT:
        factors = {path: 2.0 ** random.uniform(-1.0, 1.0) for path in ("friction", "preload_n")}
        motor = motor.updated({f"contact.{path}": by * getattr(motor.contact, path) for path, by in factors.items()})
    nominal = pr.default_drive(motor)
    assert isinstance(nominal, pr.TwoPhaseDrive)
    drive = pr.TwoPhaseDrive(
        voltage=LEAST_VOLTAGE * (nominal.voltage / LEAST_VOLTAGE) ** random.random(),
        frequency=nominal.frequency * random.uniform(*RANGES.get(name, RANGE)),
        phase_deg=random.choice([60.0, 90.0, 120.0, -90.0]),
    )
    return motor, drive, random.choice(list(LAWS))


def rounded(value: float) -> float:
    """Return a relative torque as it is recorded."""
    return round(value, 6)


def outcome(index: int, seed: int = SEED) -> dict[str, Any]:
    """Return the torques of a case relative to the friction torque under the preload, and how they compare."""
    motor, drive, law = drawn(index, seed)
    found: dict[str, Any] = {"motor": motor.name, "drive": drive.label, "contact": law}
    scale = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    try:
        state = pr.steady_state(motor, drive, speed=0.0, contact=law)
        if not state.converged:
            return found | {"kind": "not found"}
        names = ("torque_n_m", "torque_error_n_m", "torque_min_n_m", "torque_max_n_m")
        torque, inaccuracy, least, most = (getattr(state, name) / scale for name in names)
        found |= {"torque": rounded(torque), "error": rounded(inaccuracy)}
        if state.held_by_friction:
            found["range"] = [rounded(least), rounded(most)]
        if not state.determined:
            return found | {"kind": "held" if state.stable else "unstable"}
        curve = pr.speed_torque(motor, drive, speeds=[0.0], mode="settle", contact=law)
    except (pr.ParameterError, pr.SimulationError) as error:
        return found | {"kind": "refused", "why": str(error).partition(" The netlist is kept")[0][:200]}
    settled = curve["torque_n_m"].item() / scale
    found["settled"] = rounded(settled)
    close = abs(torque - settled) <= max(ERRORS * inaccuracy, ALLOWED)
    if not (close or curve["settled"].item()):
        return found | {"kind": "unsettled"}
    return found | {"kind": "agrees" if close else "differs"}


def summary(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the counts by motor, and the determined torques that differ, JSON-ready."""
    motors = dict.fromkeys(one["motor"] for one in found)
    return {
        "cases": len(found),
        "by_motor": {
            name: {kind: sum(one["kind"] == kind for one in found if one["motor"] == name) for kind in KINDS}
            for name in motors
        },
        "by_law": dict(Counter(one["contact"] for one in found)),
        "largest_difference": max(
            (abs(one["torque"] - one["settled"]) for one in found if one["kind"] == "agrees"), default=0.0
        ),
        "open": [one for one in found if one["kind"] in ("differs", "unsettled")],
    }


def passes(table: Mapping[str, Any]) -> bool:
    """Whether no determined torque differs from the settled one."""
    return not any(one["kind"] == "differs" for one in table["open"])


CAMPAIGN = Campaign("held_points", outcome, summary, passes, COUNT)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
