# SPDX-License-Identifier: GPL-3.0-or-later
"""The capacitance between the groups: against closed forms, and against the independent integrator."""

from math import atan, pi

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.motor import dielectric_matrix
from pyspice_runner.trackers.tracker import Tracker, sensing
from tests.motors import BEAM40
from tests.reference.integrator import integrate
from tests.runs import simulated

pytestmark = pytest.mark.xdist_group("reference")  # the integrator is compiled once there

# unlike groups, so that the two directions differ
WITHOUT = pr.load_motor(BEAM40).updated({"piezo.capacitance_b_f": 3e-10})
DRIVE = pr.TwoPhaseDrive(voltage=60.0, ratio_b=0.75, frequency=40.1e3, phase_deg=120.0)
PHASORS = np.array([60.0, 45.0 * np.exp(1j * np.radians(120.0))])


def with_between(farad: float, **changes: float) -> pr.Motor:
    return WITHOUT.updated({"piezo.capacitance_ab_f": farad, **changes})


def capacitances(motor: pr.Motor) -> np.ndarray:
    piezo = motor.piezo
    between = piezo.capacitance_ab_f
    return np.array([[piezo.capacitance_a_f, -between], [-between, piezo.capacitance_b_f]])


@pytest.mark.parametrize("farad", [2e-10, -1e-10])
def test_the_admittance_matrix_of_the_free_stator_is_the_closed_form(farad: float) -> None:
    motor = with_between(farad, **{"piezo.loss_tangent": 0.0})
    found = pr.admittance(motor, start=30e3, stop=60e3, points=301)
    omega = 2.0 * pi * found.frequency_hz[:, np.newaxis, np.newaxis]
    expected = 1j * omega * capacitances(motor)
    for mode in motor.modes:
        coupling = np.array([mode.coupling_a_n_per_v, mode.coupling_b_n_per_v])
        stiffness = mode.stiffness_n_per_m - omega**2 * mode.mass_kg + 1j * omega * mode.damping_n_s_per_m
        expected = expected + np.outer(coupling, coupling) * 1j * omega / stiffness
    # the circuit's least loss tangent is 1e-5
    np.testing.assert_allclose(found.matrix_s, expected, rtol=0.0, atol=3e-5 * np.abs(expected).max())


def test_the_currents_are_those_of_the_independent_integrator_and_the_energy_is_balanced() -> None:
    motor = with_between(2e-10, **{"piezo.loss_tangent": 0.0, "contact.restitution": 1.0})
    exact = integrate(motor.to_dict(), DRIVE.tones_a, DRIVE.tones_b, duration=5e-4, output_step=2e-7)
    run = simulated(motor, DRIVE, duration=5e-4)
    lossy = simulated(motor.updated({"piezo.loss_tangent": 0.1}), DRIVE, duration=5e-4)
    for one in (run, lossy):
        assert one.energy_residual < 1e-3
    np.testing.assert_allclose(lossy.tip_x_m, run.tip_x_m, rtol=0.0, atol=1e-9 * np.abs(run.tip_x_m).max())
    omega = 2.0 * pi * DRIVE.frequency
    rising = (1j * omega * PHASORS[:, np.newaxis] * np.exp(1j * omega * exact.time_s)).imag  # dU/dt
    couplings = np.array([[mode.coupling_a_n_per_v, mode.coupling_b_n_per_v] for mode in motor.modes]).T
    expected = couplings @ exact.modal_velocity_m_s + capacitances(motor) @ rising
    for ours, theirs in zip((run.current_a_a, run.current_b_a), expected, strict=True):
        # the default step gives 0.4 % of the motion; the first points follow the source's start
        error = (np.interp(exact.time_s, run.time_s, ours) - theirs)[10:]
        assert float(np.std(error)) < 5e-3 * float(np.std(theirs))


@pytest.mark.soak
def test_the_steady_state_has_the_loss_of_the_closed_form() -> None:
    # the motion is that without the capacitance, which takes its current from the sources alone
    motor = with_between(2e-10)
    state, without = (pr.steady_state(one, DRIVE, speed=15.0) for one in (motor, WITHOUT))
    assert state.torque_n_m == pytest.approx(without.torque_n_m, rel=1e-9)
    matrix = dielectric_matrix(motor, DRIVE.frequency) - dielectric_matrix(WITHOUT, DRIVE.frequency)
    added = 0.5 * float(np.vdot(PHASORS, matrix @ PHASORS).real)
    assert state.dielectric_loss_w - without.dielectric_loss_w == pytest.approx(added, rel=1e-9)
    assert abs(state.balance_residual) < 1e-5


@pytest.mark.soak
def test_steady_state_and_dynamometer_agree_on_currents_and_powers() -> None:
    motor = with_between(2e-10)
    state = pr.steady_state(motor, DRIVE, speed=15.0)
    settled = pr.speed_torque(motor, DRIVE, speeds=[15.0], mode="settle")
    # blocks of ten periods settle to 1e-3 of the torque, and the steady state is extrapolated to a vanishing step
    for name in ("current_a_rms_a", "current_b_rms_a", "dielectric_loss_w", "power_a_w", "power_b_w"):
        within = 1e-3 * state.power_a_w if name == "power_b_w" else 0.0  # a small difference
        assert float(settled[name][0]) == pytest.approx(getattr(state, name), rel=2e-3, abs=within), name
    assert abs(float(settled["balance_residual"][0])) < 1e-5


@pytest.mark.parametrize("farad", [2e-10, -2e-10])
def test_the_averaged_motor_has_the_heat_of_the_closed_form(farad: float) -> None:
    runs = [pr.simulate_averaged(one, DRIVE, 1e-3, speed=0.0) for one in (with_between(farad), WITHOUT)]
    loss, omega = WITHOUT.piezo.loss_tangent, 2.0 * pi * DRIVE.frequency
    at_frequency = farad * (1e5 / DRIVE.frequency) ** (2.0 / pi * atan(loss))
    added = -omega * at_frequency * loss * float((PHASORS[0] * PHASORS[1].conjugate()).real)
    # at equal times: ngspice chooses the steps, and the sources do not depend on the motion
    heats = [np.interp(runs[0].time_s, run.time_s, run.heat_w) for run in runs]
    assert heats[0][-1] - heats[1][-1] == pytest.approx(added, rel=0.01)
    assert not any(run.audit.findings for run in runs)


def test_the_copies_of_a_tracker_take_the_current_between_the_groups() -> None:
    motor, volts = with_between(1e-10), np.array([50.0, 20.0 + 30.0j])
    tracker = Tracker(kind="pll", voltage=50.0, frequency=40.1e3)
    for mode in range(len(motor.modes)):
        sensed = sensing(motor, tracker, mode)
        omega = 2.0 * pi * tracker.frequency
        copies = sum(
            sensed[f"current_{group}"]
            * volt
            / (sensed[f"resistance_{group}"] - 1j / omega / sensed[f"capacitance_{group}"])
            for group, volt in zip("ab", volts, strict=True)
        )
        clamped = dielectric_matrix(motor, tracker.frequency) @ volts
        assert copies == pytest.approx(sum(sensed[f"current_{g}"] * c for g, c in zip("ab", clamped, strict=True)))


def test_a_capacitance_between_the_groups_is_a_part_of_both() -> None:
    with pytest.raises(pr.ParameterError, match=r"capacitance_ab_f = 3e-10 F is a part .* smaller is 3e-10 F"):
        with_between(3e-10)
    assert "capacitance_ab_f" not in WITHOUT.to_dict()["piezo"]
    assert with_between(-1e-10).to_dict()["piezo"]["capacitance_ab_f"] == -1e-10
