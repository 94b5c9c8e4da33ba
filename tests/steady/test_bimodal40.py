# SPDX-License-Identifier: GPL-3.0-or-later
"""The plate motor does what it was designed for, at its drive and over its tolerances."""

import re
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor.load import SETS, stated_solid
from pyspice_runner.motor.solid.stator import solve_stator

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "motors.md").read_text(encoding="utf-8")
SCRIPT = run_path(str(DOCS / "bimodal40_bands.py"), run_name="bands")
BANDS = SCRIPT["stored"]()
MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR)
TORSION = 2  # number of the mode that does not move the tip


def row(name: str) -> list[str]:
    """Return the cells of a row of the page."""
    line = next(line for line in PAGE.splitlines() if line.startswith(f"|{name}|"))
    return [cell.strip() for cell in line.split("|")[2:-1]]


def test_it_has_the_force_speed_and_efficiency_of_its_page() -> None:
    stall, moving = (pr.steady_state(MOTOR, DRIVE, speed=speed) for speed in (0.0, 20.0))
    assert stall.load_torque_n_m / MOTOR.rotor.radius_m == pytest.approx(4.2, abs=0.05)  # the printed digits
    assert moving.load_torque_n_m / MOTOR.rotor.radius_m > 3.0
    assert moving.efficiency > 0.10
    assert stall.stable
    assert moving.stable
    limits = MOTOR.limits
    assert moving.quantities["ceramic_stress_pa"] < limits.dynamic_strength_pa
    assert moving.quantities["temperature_rise_k"] < 0.5 * limits.curie_temperature_c - limits.ambient_c


def test_a_law_without_a_slider_has_steady_states_with_the_compliance_of_the_plate() -> None:
    state = pr.steady_state(MOTOR, DRIVE, speed=20.0, contact="coulomb")
    assert state.converged
    assert state.normal_force_n == pytest.approx(MOTOR.contact.preload_n, rel=5e-3)  # the springs are soft


def test_plate_theory_gives_the_modes_of_three_dimensions() -> None:
    flat = SCRIPT["motor_of"]()
    solid = [mode for index, mode in enumerate(MOTOR.modes, start=1) if index != TORSION]
    assert len(flat.modes) == len(solid) == 3
    for ours, theirs in zip(flat.modes, solid, strict=True):
        expected = theirs.frequency_hz
        assert ours.frequency_hz == pytest.approx(expected, rel=5e-4)  # the plate is thin against a half wave
        assert ours.coupling_a_n_per_v == pytest.approx(theirs.coupling_a_n_per_v, rel=0.03)  # gaps of 0.5 mm


@pytest.mark.soak
def test_elements_of_twice_the_size_hardly_change_the_modes_that_move_the_tip() -> None:
    stated = stated_solid(SETS / "bimodal40.toml")
    coarse = solve_stator(stated.model_copy(update={"element_m": 2.0 * stated.element_m}))
    moving = [index for index in range(4) if index != TORSION - 1]
    # measured 2e-4; the torsional mode shears the thickness, which is then one element, and changes by 1.4 %
    ours = np.array([mode.frequency_hz for mode in MOTOR.modes])
    np.testing.assert_allclose(coarse.frequencies_hz[moving], ours[moving], rtol=1e-3)


def test_the_bands_are_those_of_the_stated_tolerances() -> None:
    motors = BANDS["motors"]
    assert len(motors) == SCRIPT["COUNT"]
    for number, sample in enumerate(SCRIPT["samples"]()):
        assert {name: motors[str(number)][name] for name in sample} == pytest.approx(sample, rel=1e-12)


def test_the_page_has_the_percentiles_of_the_bands() -> None:
    tuned = [motor for motor in BANDS["motors"].values() if "force_n" in motor]
    assert f"{len(tuned)} of {SCRIPT['COUNT']} reach this force" in PAGE
    assert all(motor["settled"] for motor in tuned)
    at_300 = BANDS["speeds_m_s"].index(SCRIPT["RATED_SPEED_M_S"])
    efficiencies = [max(value or 0.0 for value in motor["efficiency"]) for motor in tuned]
    assert sum(value >= 0.1 for value in efficiencies) >= 0.95 * len(tuned)

    def check(name: str, values: Any) -> None:
        expected = np.percentile(values, [5, 50, 95])
        for cell, value in zip(row(name), expected, strict=True):
            digits = len(cell.partition(".")[2])
            assert float(cell.removeprefix("≥ ")) == pytest.approx(value, abs=0.51 * 10.0**-digits), name

    check("stall force / N", [motor["force_n"][0] for motor in tuned])
    check("force at 300 mm/s / N", [motor["force_n"][at_300] for motor in tuned])
    check("speed without load / mm/s", [1e3 * SCRIPT["free_speed"](BANDS["speeds_m_s"], motor) for motor in tuned])
    check("maximum efficiency / %", [100.0 * value for value in efficiencies])
    check("power at 300 mm/s / W", [motor["power_w"][at_300] for motor in tuned])
    check("stress at 300 mm/s / MPa", [1e-6 * motor["ceramic_stress_pa"][at_300] for motor in tuned])
    check("temperature rise at 300 mm/s / K", [motor["temperature_rise_k"][at_300] for motor in tuned])


@pytest.mark.soak
@pytest.mark.parametrize("number", [0, 30])
def test_a_motor_of_the_bands_is_computed_again(number: int) -> None:
    stored = BANDS["motors"][str(number)]
    _, again = SCRIPT["measured"]((number, SCRIPT["samples"]()[number]))
    assert again["frequency_hz"] == stored["frequency_hz"]
    # the steady states are found to 0.1 % of the friction torque
    np.testing.assert_allclose(again["force_n"], stored["force_n"], atol=5e-3 * stored["force_n"][0])


@pytest.mark.soak
def test_the_speed_without_load_is_that_of_the_page() -> None:
    (printed,) = re.findall(r"\|speed without load\|(\d+) mm/s", PAGE)
    free = pr.steady_state(MOTOR, DRIVE)
    assert 1e3 * free.speed_rad_s * MOTOR.rotor.radius_m == pytest.approx(float(printed), rel=0.01)
