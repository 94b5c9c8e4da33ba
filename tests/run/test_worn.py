# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor with a worn tip: against the independent integrator, and in every analysis that takes or rejects it."""

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor.contact import contact_radius
from pyspice_runner.steady.speed_torque import held_point
from tests.motors import BEAM40
from tests.reference.integrator import integrate
from tests.runs import far

MOTOR = pr.load_motor(BEAM40).updated({"contact.worn_flat_radius_m": 60e-6})
DRIVE = pr.TwoPhaseDrive(voltage=110.0, frequency=40.1e3, phase_deg=120.0)


def test_a_run_is_that_of_the_independent_integrator() -> None:
    """The tip opens, sticks and slips. The integrator has no damping along the normal."""
    elastic = MOTOR.updated({"contact.restitution": 1.0})
    run = pr.simulate(elastic, DRIVE, duration=1e-3, step=5e-8)
    expected = integrate(elastic.to_dict(), DRIVE.tones_a, DRIVE.tones_b, duration=1e-3, output_step=5e-8)
    assert min(expected.state_fractions.values()) > 0.05
    # second order: 1/500 of the drive's period, 1/140 of the swing of the tip in contact
    assert far(run, expected, "tip_x_m", "tip_y_m", "rotor_speed_rad_s", "normal_force_n") < 0.01
    assert run.energy_residual < 1e-3


@pytest.mark.soak
def test_the_page_of_the_motor_has_the_numbers_new_and_run_in() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "motors.md").read_text(encoding="utf-8")
    page = page.partition("## Tip and wear")[2].partition("## andersen2002")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines() if " N|" in line]
    assert len(rows) == 3
    for flat, pressure, stall, free in rows:
        radius = 0.0 if "new" in flat else 1e-6 * float(flat.split()[0])
        motor = pr.load_motor("bimodal40").updated({"contact.worn_flat_radius_m": radius})
        preload, rim = motor.contact.preload_n, motor.rotor.radius_m
        mean = preload / np.pi / contact_radius(motor.contact, preload) ** 2
        states = [pr.steady_state(motor, pr.default_drive(motor), speed=speed) for speed in (0.0, None)]
        found = (1e-6 * mean, states[0].torque_n_m / rim, states[1].speed_rad_s * rim)
        for cell, value in zip((pressure, stall, free), found, strict=True):
            told = cell.split()[0]
            assert float(told) == pytest.approx(value, abs=0.6 * 10.0 ** -len(told.partition(".")[2])), (flat, cell)


@pytest.mark.soak
def test_a_steady_state_is_what_the_motor_settles_to() -> None:
    """At half of the voltage, where there is one steady state."""
    drive = DRIVE.updated({"voltage": 55.0})
    state = pr.steady_state(MOTOR, drive, speed=10.0)
    settled = held_point(MOTOR, drive, speed=10.0, mode="settle", tolerance=1e-3)
    friction = 0.3 * 6.5 * 0.015
    assert state.stable
    assert state.torque_n_m == pytest.approx(settled["torque_n_m"], abs=5e-3 * friction)  # as for a new tip
    assert np.isnan(state.peak_pressure_pa)
    assert state.wear_volume_m3_per_s > 1e-18


def test_what_has_no_worn_tip_says_so(tmp_path: Path) -> None:
    flat = r"contact.worn_flat_radius_m = 6e-05"
    with pytest.raises(pr.ParameterError, match=flat + r" has no averaged model: it must be 0"):
        pr.simulate_averaged(MOTOR, DRIVE, 1e-2)
    pr.export_motor(MOTOR, tmp_path / "motor.lib")
    assert " piezomotor_worn normal_stiffness" in (tmp_path / "motor.lib").read_text()


def test_a_row_of_sliders_on_a_worn_tip_takes_power_and_nearly_has_the_spring_of_all() -> None:
    """A flat slips at once, so that one slider is close. No part of the row delivers power."""
    drive = DRIVE.updated({"voltage": 60.0})
    one, row = (pr.steady_state(MOTOR, drive, speed=10.0, contact=law) for law in ("spring-slider", "brush"))
    assert row.stable
    assert row.torque_n_m == pytest.approx(one.torque_n_m, abs=0.01 * 0.3 * 6.5 * 0.015)
    assert row.friction_loss_w > 0.0
    put_in = row.power_a_w + row.power_b_w - row.shaft_power_w
    lost = row.dielectric_loss_w + row.damping_loss_w + row.friction_loss_w + row.normal_loss_w
    assert lost == pytest.approx(put_in, rel=2e-3)  # the balance of a steady state
