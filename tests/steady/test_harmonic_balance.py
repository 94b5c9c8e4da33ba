# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts, quantities and derivatives by harmonic balance: against steady states by ngspice, and settled motions."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.motor.drive import Load
from pyspice_runner.run.point import Point
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.harmonic_balance import QUANTITIES, balanced, balanced_states, balances
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.shooting import start_point
from pyspice_runner.steady.steady import steady_states
from tests.motors import BEAM40
from validation import calibration as study

PLATE = str(Path(__file__).parents[2] / "examples" / "plate40.toml")
STEPS = 72
# of the size of the motion, by which the state may change in a period. The first seven harmonics of a force that is
# open for half of the period leave less than 1 % of it.
START = 0.01


def gap(plant: Plant, state: np.ndarray) -> float:
    """Return the change of a state over a period, without the slider, relative to the size of the motion."""
    (trace,) = PeriodMap(plant.drive.period, STEPS).traces([Copy(plant, state)])
    assert trace is not None
    point = start_point(plant)
    point.trace = trace
    kept = np.ones(plant.order, dtype=bool)
    kept[plant.places["contact"]] = False
    return float(np.abs(point.gap[kept]).max())


@pytest.mark.parametrize("law", [Law(), pytest.param(Law("brush", 8), marks=pytest.mark.soak)])
@pytest.mark.parametrize("name", ["bimodal40", BEAM40, "andersen2002", PLATE])
def test_a_motor_starts_near_its_steady_state_however_it_lifts_off(name: str, law: Law) -> None:
    motor = pr.load_motor(name)
    plants = [Plant(motor, pr.default_drive(motor), Load(0.1 * at / motor.rotor.radius_m), law) for at in (-1, 0, 3)]
    for plant, balance in zip(plants, balanced(plants), strict=True):
        assert gap(plant, balance.state) < START


@pytest.mark.parametrize(
    "changes",
    [
        {"contact.worn_flat_radius_m": 5e-5},
        {"contact.lining": {"exponent": 3.0, "stiffness_n_per_m": 2e17, "stiffness_ratio": 1.2}},
        {"contact.sliding_ratio": 0.7, "contact.tangential_series_compliance_m_per_n": 0.0},
        {"contact.tangential_series_compliance_m_per_n": 2e-8},
    ],
)
def test_a_changed_contact_starts_near_its_steady_state(changes: dict[str, Any]) -> None:
    motor = pr.load_motor("bimodal40").updated(changes)
    plants = [Plant(motor, pr.default_drive(motor), Load(speed), Law()) for speed in (0.0, 20.0)]
    for plant, balance in zip(plants, balanced(plants), strict=True):
        assert gap(plant, balance.state) < START


def test_a_free_shaft_starts_at_its_speed() -> None:
    motor = pr.load_motor("bimodal40")
    plant = Plant(motor, pr.default_drive(motor), Load(None), Law())
    (balance,) = balanced([plant])
    settled = pr.steady_state(motor, pr.default_drive(motor))
    # without a load the torque is nearly flat: a mean force of 1 % of the friction force is 3 % of the speed
    assert balance.state[-1] == pytest.approx(settled.speed_rad_s, rel=0.05)


def test_a_free_tip_and_a_law_without_sliders_have_no_such_start() -> None:
    motor = pr.load_motor(BEAM40)
    plants = [Plant(motor, pr.default_drive(motor), Load(1.0), law) for law in (None, Law("coulomb"))]
    assert balanced(plants) == [None, None]


# --- quantities and their derivatives, against steady states by ngspice ---


SET = "andersen2002-unintended-mode"


def points(changes: dict[str, float]) -> list[Point]:
    motor = pr.load_motor(SET).updated({"contact.restitution": 0.8, **changes})
    return [Point.of(motor, pr.default_drive(motor), speed=speed, audit=False) for speed in (2.0, 12.0)]


def values(changes: dict[str, float], *, fast: bool) -> np.ndarray:
    """Values of the points: a row for each."""
    some = points(changes)
    if fast:
        rows = [state.values for state in balanced_states(some, [None] * len(some)) if state]
    else:
        rows = [{name: getattr(state, name) for name in QUANTITIES} for state in steady_states(some)]
    return np.array([[row[name] for name in QUANTITIES] for row in rows])


def test_harmonic_balance_gives_forces_currents_and_their_changes_with_a_parameter() -> None:
    assert all(balances(point) for point in points({}))
    slow, fast = values({}, fast=False), values({}, fast=True)
    # of a phase a radian: a change of the current by a share of it turns it by as many radians
    turns = np.array([name.endswith("_deg") for name in QUANTITIES])
    size = np.where(turns, np.degrees(1.0), np.abs(slow).max(axis=0))
    # Seven harmonics of a force that is open for a part of the period leave less than 1 % of the motion, see
    # test_harmonic_balance. The mean friction follows from the motion with a slope of order one.
    assert np.all(np.abs(fast - slow) < 0.01 * size)
    step = 0.05
    for path, value in (("contact.friction", 0.3), ("contact.preload_n", 5.0)):
        changes = {path: value * (1.0 + step)}
        rise = values(changes, fast=True) - fast, values(changes, fast=False) - slow
        # a steady state is accurate to 2e-3 of the friction torque, and a difference of two to twice that
        assert np.all(np.abs(rise[0] - rise[1]) < 4e-3 * size), path


def test_values_of_a_tip_that_opens_in_each_period_are_smooth_in_a_parameter() -> None:
    # Without the moment of touching between two phases the torque rises in steps, as it goes from phase to phase.
    motor = study.base()
    drive = pr.default_drive(motor).updated({"voltage": 100.0})
    frictions = 0.3 * (1.0 + np.linspace(-0.05, 0.05, 9))
    some = [
        Point.of(motor.updated({"contact.friction": friction}), drive, speed=12.0, audit=False)
        for friction in frictions
    ]
    torques = np.array([state.values["torque_n_m"] for state in balanced_states(some, [None] * 9) if state])
    (slow,) = steady_states(some[4:5], accuracy=2e-4)
    assert slow.separated > 0.3
    grip = motor.rotor.radius_m * 0.3 * motor.contact.preload_n
    # phases of 1/64 period: an error of second order, 1e-2, of what the contact does while it opens or closes
    assert abs(torques[4] - slow.torque_n_m) < 5e-3 * grip
    bend = np.diff(torques, 2)
    slope = np.diff(torques).mean()
    # a parabola through the curve of a smooth function: its third difference is a small part of the first one
    assert np.all(np.abs(np.diff(bend)) < 0.05 * abs(slope))
