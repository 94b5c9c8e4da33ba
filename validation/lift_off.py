# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states of random motors whose tip lifts off: ``python -m validation.lift_off --count 300``.

The motors are bimodal, with two to four modes, with and without mount, damping and compliance of the contact. A motor
counts if its contact is open for 5 to 80 % of the period. Each start is tried alone: harmonic balance and the response
of the free stator. Where Newton's method finds nothing stable, the motor is run for many decay times to see whether it
has a periodic motion. What :func:`steady_state` finds must be a motion that stays for many periods at half of the step:
these long runs follow when all motors are counted.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

import pyspice_runner as pr
from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.drive import Load
from pyspice_runner.motor.parameters import Mode, Piezo
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.shooting import Orbit, Shooting, start_balanced, start_point
from pyspice_runner.steady.steady import SteadyState
from tests.motors import mode, motor
from validation.campaign import Campaign
from validation.steady_states import LONGEST_CHECK, STAYING, staying

SEED = 30
OPEN = (0.05, 0.8)  # of the period
STEPS = 72  # in a period of the drive, for the starts alone
DECAYS = 60.0  # decay times of the slowest mode for which a motor runs to see whether its motion is periodic
FADED, LONGEST = 6.0, 2000  # time constants, and most periods, for which a solution must stay
PERIODIC = 1e-3  # of the size of the motion, change in a period of a motion that is periodic


def case(index: int) -> tuple[pr.Motor, pr.TwoPhaseDrive, float]:
    """Draw a motor, its drive and its speed in rad/s."""
    rng = np.random.default_rng((SEED, index))

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    frequency, quality, force = log(20e3, 80e3), log(50.0, 1000.0), log(0.02, 0.3)
    signs = [(1.0, 1.0), (1.0, -1.0), (1.0, 1.0), (1.0, -1.0)]
    places = [(0.0, 1.0), (1.0, 0.0), (0.8, 0.05), (0.1, 0.3)]
    nearness = [1.0, rng.uniform(0.96, 1.04), rng.uniform(0.4, 0.6), rng.uniform(1.5, 2.5)]
    modes: list[Mode] = []
    for number in range(int(rng.integers(2, 5))):
        x, y = (place + rng.normal(0.0, 0.05) for place in places[number])
        coupling = force * log(0.5, 2.0)
        modes.append(mode(
            f"mode{number}", frequency * nearness[number], log(1e-3, 1e-2), quality * log(0.7, 1.4), tip_x=x, tip_y=y,
            coupling_a_n_per_v=signs[number][0] * coupling, coupling_b_n_per_v=signs[number][1] * coupling,
        ))  # fmt: skip
    preload, radius, depth = log(2.0, 30.0), log(0.005, 0.05), log(1e-7, 3e-6)
    stored = max(sum(one.coupling_a_n_per_v**2 / one.stiffness_n_per_m for one in modes), 1e-10)
    piezo = Piezo(capacitance_a_f=3.0 * stored, capacitance_b_f=3.0 * stored, loss_tangent=0.01)
    base = motor(modes=tuple(modes), piezo=piezo)
    changes: dict[str, Any] = {
        "contact.preload_n": preload, "contact.friction": float(rng.uniform(0.1, 0.5)), "rotor.radius_m": radius,
        "contact.normal_stiffness_n_per_m15": preload / depth**1.5,
        "contact.restitution": float(rng.choice([1.0, rng.uniform(0.7, 1.0)])),
        "mount": None,
    }  # fmt: skip
    compliance = depth / preload ** (2.0 / 3.0) * rng.uniform(0.5, 1.0)  # u_lim = μ K_t F^(2/3), of the size of μ δ
    changes |= {f"contact.tangential_compliance_{part}_m_per_n23": compliance for part in ("tip", "rotor")}
    if rng.random() < 0.7:
        stiffness, mass = log(1e4, 1e6), log(5e-3, 5e-2)
        damping = rng.uniform(0.3, 1.0) * np.sqrt(stiffness * mass)
        changes["mount"] = {"stiffness_n_per_m": stiffness, "mass_kg": mass, "damping_n_s_per_m": float(damping)}
    found = base.updated(changes)
    if rng.random() < 0.5:
        share = float(rng.uniform(0.0, 0.5))
        series = share / contact_law.normal_stiffness_at_preload(found.contact)
        found = found.updated({"contact.series_compliance_m_per_n": series})
    first = modes[0]
    speed = force / first.damping_n_s_per_m  # m/s per V, of the first mode at its resonance
    amplitude = depth * log(3.0, 60.0)
    voltage = float(np.clip(amplitude * 2.0 * np.pi * frequency / speed, 0.1, 1000.0))
    drive = pr.TwoPhaseDrive(
        voltage=voltage, frequency=frequency * rng.uniform(0.99, 1.03), phase_deg=rng.uniform(-180.0, 180.0)
    )
    tip_speed = amplitude * 2.0 * np.pi * frequency
    return found, drive, float(rng.uniform(-0.3, 0.8) * tip_speed / radius)


def outcome(index: int) -> dict[str, Any]:
    """Return the outcome of a case."""
    subject, drive, speed = case(index)
    plant = Plant(subject, drive, Load(speed), PAPER_LAW)
    began = time.process_time()
    state = pr.steady_state(subject, drive, speed=speed, audit=False, timeout=LONGEST_CHECK)
    seconds = time.process_time() - began
    found: dict[str, Any] = {"index": index, "method": state.method or "not found", "stable": state.stable}
    if state.converged:
        found |= {"open": round(state.separated, 3), "torque_n_m": state.torque_n_m, "python_s": round(seconds, 3)}
    if not (state.stable and state.method in ("newton", "damped")):
        found |= _run_long(plant)
    if not OPEN[0] <= found.get("open", -1.0) <= OPEN[1]:
        return found | {"counts": False}
    return found | {"counts": True, **_starts(plant), "verdict": _verdict(state)}


def _verdict(state: SteadyState) -> str | None:
    """Return the verdict on a steady state without a long run; ``None`` if a long run is needed."""
    if not state.converged:
        return ""
    return None if state.stable else "said to be unstable"


def stays(index: int) -> str:
    """Return whether a stable steady state is a motion that stays."""
    subject, drive, speed = case(index)
    state = pr.steady_state(subject, drive, speed=speed, audit=False, timeout=LONGEST_CHECK)
    # the run starts from the solution at the coarse step, and must end where the slowest disturbance has decayed
    largest = float(np.abs(state.floquet_multipliers).max(initial=0.0))
    return staying(state, int(np.clip(FADED / -np.log(largest), STAYING, LONGEST)))


def _starts(plant: Plant) -> dict[str, bool]:
    """Return whether Newton's method succeeds from each start alone."""
    period_map = PeriodMap(plant.drive.period, STEPS, LONGEST_CHECK)
    balanced, free = start_point(plant), start_point(plant)
    start_balanced([balanced])
    Shooting([balanced, free], period_map).solve()
    return {
        "balanced": balanced.informed, "from_balance": balanced.done and balanced.informed, "from_free": free.done,
    }  # fmt: skip


def _run_long(plant: Plant) -> dict[str, Any]:
    """Run a motor from rest; return whether its motion is then periodic, and the share of time in which it is open."""
    period_map = PeriodMap(plant.drive.period, STEPS, LONGEST_CHECK)
    point: Orbit = start_point(plant)
    state, decays = np.zeros(plant.order), DECAYS
    longest = decays * max(2.0 * one.mass_kg / one.damping_n_s_per_m for one in plant.motor.modes)
    for place, one in enumerate(plant.motor.modes):
        state[place] = -one.tip_y * plant.motor.contact.preload_n / one.stiffness_n_per_m
    try:
        (trace,) = period_map.traces([Copy(plant, state)], round(longest / period_map.period))
    except pr.SimulationError:
        return {"periodic": False}
    if trace is None:
        return {"periodic": False}
    point.trace = trace
    kept = np.ones(plant.order, dtype=bool)
    kept[plant.places["contact"]] = False
    return {
        "periodic": bool(np.abs(point.gap[kept]).max() < PERIODIC),
        "open": round(float((trace.contact_state < 0.5).mean()), 3),
    }


def summary(record: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the counts of the motors that lift off, and the 95 % interval of Newton's share of them."""
    counted = [one for one in record if one["counts"]]
    newton = [one for one in counted if one["method"] in ("newton", "damped") and one["stable"]]
    others = [one for one in counted if one not in newton]
    stable = [one for one in others if one.get("periodic") or one["stable"]]
    share = binomtest(len(newton), len(newton) + len(stable)).proportion_ci()
    return {
        "cases": len(record),
        "lift_off": len(counted),
        "newton": len(newton),
        "other_stable": len(stable),
        "without_periodic_motion": len(others) - len(stable),
        "newton_share_interval_95": [share.low, share.high],
        "methods": dict(Counter(one["method"] for one in counted)),
        "starts_alone": {name: sum(one[name] for one in counted) for name in ("balanced", "from_balance", "from_free")},
        "verdicts": dict(Counter(one["verdict"] for one in counted)),
        "leave": [one["index"] for one in counted if one["verdict"] == "leaves"],
    }


CAMPAIGN = Campaign("lift_off", outcome, summary, count=300, counts=lambda one: bool(one["counts"]))

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
