# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts by harmonic balance, against the period that ngspice maps and against settled motions."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.motor.drive import Load
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.harmonic_balance import balanced
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.shooting import start_point
from tests.motors import BEAM40

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
