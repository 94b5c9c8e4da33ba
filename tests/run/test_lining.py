# SPDX-License-Identifier: GPL-3.0-or-later
"""Motors with a lining or rough surfaces: against the independent integrator, and in what takes or rejects them."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.unknowns import unknowns_of
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.motor.contact import stiffnesses_at_preload
from pyspice_runner.run.paths import parameter
from pyspice_runner.steady.speed_torque import held_point
from tests.reference.integrator import integrate
from tests.runs import far
from tests.selection import mostly

HERTZ = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(HERTZ)


def lined(power: float, **more: float) -> pr.Motor:
    """The bundled motor with a lining that is as stiff under the preload as its tip, and slips at 1.2 µ δ."""
    depth = power * HERTZ.contact.preload_n / stiffnesses_at_preload(HERTZ.contact)[1]
    table = {"exponent": power, "stiffness_n_per_m": HERTZ.contact.preload_n / depth**power, "stiffness_ratio": 1.2}
    stems = ("series_compliance_m_per_n", "tangential_series_compliance_m_per_n")
    loss = {"restitution_velocity_m_s": 2.0 * pi * DRIVE.frequency * depth} if more else {"restitution": 1.0}
    own = {f"contact.{name}": value for name, value in (dict.fromkeys(stems, 0.0) | loss).items()}
    return HERTZ.updated({"contact.lining": table | more, **own})


LOSSY = lined(1.0, loss_factor=0.05)


@pytest.mark.xdist_group("reference")
@pytest.mark.parametrize("power", mostly(pytest.mark.soak, [1.0, 2.0, 3.3], [1.0]))
def test_a_run_is_that_of_the_independent_integrator(power: float) -> None:
    motor, drive = lined(power), DRIVE.updated({"voltage": 2.0 * DRIVE.voltage})
    run = pr.simulate(motor, drive, duration=6e-4, step=5e-8)
    expected = integrate(motor.to_dict(), drive.tones_a, drive.tones_b, duration=6e-4, output_step=5e-8)
    assert min(expected.state_fractions.values()) > 0.05
    # second order, 1/500 of the drive's period; measured 1e-5 to 8e-5
    columns = ("tip_x_m", "tip_y_m", "rotor_speed_rad_s", "normal_force_n", "friction_force_n")
    assert far(run, expected, *columns) < 3e-4
    assert run.energy_residual < 1e-3


def test_the_exponent_of_hertz_changes_nothing() -> None:
    same = HERTZ.updated({"contact.exponent": 1.5})
    assert same.to_dict() == HERTZ.to_dict()
    assert motor_library(same) == motor_library(HERTZ)


@pytest.mark.soak
def test_a_steady_state_is_what_a_lining_settles_to() -> None:
    state = pr.steady_state(LOSSY, DRIVE, speed=10.0)
    settled = held_point(LOSSY, DRIVE, speed=10.0, mode="settle", tolerance=1e-3)
    grip = LOSSY.contact.friction * LOSSY.contact.preload_n * LOSSY.rotor.radius_m
    assert state.torque_n_m == pytest.approx(settled["torque_n_m"], abs=5e-3 * grip)  # as for a worn tip


def test_a_lining_loses_along_the_normal_and_has_neither_pressure_nor_brush(tmp_path: Path) -> None:
    state = pr.steady_state(LOSSY, DRIVE, speed=10.0)
    assert abs(state.balance_residual) < 1e-5
    assert state.normal_loss_w > 0.0
    assert np.isnan(state.peak_pressure_pa)
    assert any("exponent 1, not Hertz's" in caution for caution in state.cautions)
    assert "* PAR  exponent  " in pr.export_motor(LOSSY, tmp_path / "motor.lib").read_text(encoding="ascii")
    with pytest.raises(pr.ParameterError, match=r"exponent = 1 is not valid with the contact brush.* or set it to 1.5"):
        pr.simulate(LOSSY, DRIVE, duration=1e-4, contact="brush")


def test_a_lining_has_paths_and_its_own_range_of_stiffness():
    motor = lined(1.0)
    assert parameter("contact.lining.stiffness_ratio", motor, DRIVE, {}).nominal == 1.2
    with pytest.raises(pr.ParameterError, match=r"Did you mean 'contact\.lining\.stiffness_ratio'"):
        parameter("contact.lining.stiffness_rato", motor, DRIVE, {})
    for one, stiffest in ((HERTZ, 1e13), (motor, 1e10)):  # the same force at a micrometre
        (unknown,) = unknowns_of(one, DRIVE, ["contact.normal_stiffness_n_per_m15"])
        assert unknown.high == pytest.approx(stiffest)
