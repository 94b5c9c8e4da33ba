# SPDX-License-Identifier: GPL-3.0-or-later
"""Modes of the flagship that are left out move its tip by the voltages, and the force of the contact its charges."""

from math import pi
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor.motor import Motor, assemble
from pyspice_runner.run.point import Point
from pyspice_runner.steady.harmonic_balance import balanced_states

MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.TwoPhaseDrive(voltage=100.0, frequency=40.7e3, phase_deg=90.0)
NAMES = [f"piezo.motion_{axis}_{group}_m_per_v" for axis in "xy" for group in "ab"]
STILL = MOTOR.updated(dict.fromkeys(NAMES, 0.0))
QUANTITIES = ("torque_n_m", "power_a_w", "power_b_w", "current_a_rms_a", "current_b_rms_a")


def with_fast_modes(frequency_hz: float) -> Motor:
    """Return the flagship with modes far above its drive in the place of what is in series with the contact."""
    document: dict[str, Any] = MOTOR.model_dump() | {"drive": MOTOR.drive}
    capacitance, omega = np.array(MOTOR.piezo.matrix), 2.0 * pi * frequency_hz
    names = ("tangential_series_compliance_m_per_n", "series_compliance_m_per_n")
    for axis, moved, name in zip("xy", np.array(MOTOR.piezo.motion), names, strict=True):
        stiffness = 1.0 / document["contact"][name]
        couplings = dict(zip(("coupling_a_n_per_v", "coupling_b_n_per_v"), stiffness * moved, strict=True))
        ends = {"tip_x": float(axis == "x"), "tip_y": float(axis == "y"), "recoil_kg": 0.0, "recoil_x_kg": 0.0}
        inertia = {"mass_kg": stiffness / omega**2, "damping_n_s_per_m": stiffness / (3.0 * omega)}
        mode = {"name": f"fast-{axis}", "stiffness_n_per_m": stiffness, **inertia, **couplings, **ends}
        document["modes"] = [*document["modes"], mode]
        document["contact"][name] = 0.0
        capacitance -= stiffness * np.outer(moved, moved)
    (a, between), (_, b) = capacitance
    document["piezo"] |= {"capacitance_a_f": a, "capacitance_b_f": b, "capacitance_ab_f": -between}
    return assemble(document, None, {}, where="test")


def test_the_flagship_has_the_motion_that_its_finite_elements_give() -> None:
    (along_a, along_b), (towards_a, towards_b) = MOTOR.piezo.motion
    assert [along_a, -along_b] == pytest.approx([1.16e-10] * 2, rel=5e-3)
    assert [towards_a, towards_b] == pytest.approx([6.35e-11] * 2, rel=5e-3)


def test_the_steady_state_is_that_with_modes_far_above_the_drive() -> None:
    moved, fast = (pr.steady_state(one, DRIVE, speed=30.0).to_dict() for one in (MOTOR, with_fast_modes(6e5)))
    for name in QUANTITIES:  # the modes are dynamic by (40 kHz)²/(600 kHz)², and have a loss of their own
        assert moved[name] == pytest.approx(fast[name], rel=6e-3), name
    losses = sum(moved[name] for name in ("dielectric_loss_w", "damping_loss_w", "friction_loss_w", "normal_loss_w"))
    given = moved["power_a_w"] + moved["power_b_w"]
    assert given == pytest.approx(losses + moved["shaft_power_w"] + moved["stored_power_w"], rel=2e-5)


def test_harmonic_balance_moves_the_tip_by_the_voltages() -> None:
    points = [Point.of(one, DRIVE, speed=40.0) for one in (MOTOR, STILL, with_fast_modes(1e7))]
    found = balanced_states(points, [None] * 3)
    moved, still, fast = (one.values for one in found if one)
    assert moved["torque_n_m"] < 0.97 * still["torque_n_m"]
    for name in QUANTITIES:
        assert moved[name] == pytest.approx(fast[name], rel=5e-4), name


def test_a_run_balances_its_energy() -> None:
    for motor in (MOTOR, MOTOR.updated(dict(zip(NAMES, 5.0 * np.ravel(MOTOR.piezo.motion), strict=True)))):
        run = pr.simulate(motor, DRIVE, duration=3e-4, speed=20.0)
        assert run.energy.residual < 1e-3


def test_a_contact_without_a_compliance_in_series_is_not_moved() -> None:
    rigid = {"contact.series_compliance_m_per_n": 0.0, "contact.tangential_series_compliance_m_per_n": 0.0}
    assert not MOTOR.updated(rigid).stator.residual_per_volt.any()
    message = "motion_y_a_m_per_v and motion_y_b_m_per_v move the spring of contact.series_compliance_m_per_n = 1e-13"
    with pytest.raises(pr.ParameterError, match=message):
        MOTOR.updated({"contact.series_compliance_m_per_n": 1e-13})


def test_both_springs_together_leave_the_groups_a_capacitance() -> None:
    """Each spring alone takes 60 % of the capacitance of group A."""
    contact, taken = MOTOR.contact, 0.6 * MOTOR.piezo.capacitance_a_f
    moved = {
        f"piezo.motion_{axis}_a_m_per_v": float(np.sqrt(taken * softness))
        for axis, softness in (
            ("x", contact.tangential_series_compliance_m_per_n), ("y", contact.series_compliance_m_per_n)
        )
    }  # fmt: skip
    for path, value in moved.items():
        STILL.updated({path: value})
    with pytest.raises(pr.ParameterError, match="too stiff for them and the capacitances"):
        STILL.updated(moved)


def test_the_averaged_motor_follows_within_half_a_per_cent() -> None:
    strong = MOTOR.updated(dict(zip(NAMES, 3.0 * np.ravel(MOTOR.piezo.motion), strict=True)))
    balanced = balanced_states([Point.of(one, DRIVE, speed=40.0) for one in (STILL, strong)], [None] * 2)
    still, moved = (one.values["torque_n_m"] for one in balanced if one)
    averaged = [
        pr.simulate_averaged(one, DRIVE, duration=0.03, speed=40.0, phases=256).to_dict() for one in (STILL, strong)
    ]
    before, after = (one["mean_torque_n_m"] for one in averaged)
    assert moved / still == pytest.approx(0.894, abs=2e-3)
    assert after / before == pytest.approx(moved / still, abs=5e-3)
    assert averaged[1]["energy_residual"] < 1e-3
