# SPDX-License-Identifier: GPL-3.0-or-later
"""Every analysis takes every source: drivers, trackers, ideal voltages."""

from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.trackers.tracker import running_resonance
from tests.runs import simulated

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)


def driver(kind: str, **values: Any) -> pr.Driver:
    return pr.Driver(**{"kind": kind, "voltage": 50.0, "frequency": 51.7e3, **values})


@pytest.fixture(scope="module")
def ideal() -> Waveforms:
    return pr.simulate(MOTOR, driver("ideal"), duration=5e-4)


def test_ideal_driver_and_drive_of_the_same_voltages_give_the_same_run(ideal: Waveforms) -> None:
    run = pr.simulate(MOTOR, DRIVE, duration=5e-4)
    # the same circuit but for ammeters; Newton's iteration is closed to 1e-6
    assert ideal.tip_x_m == pytest.approx(run.tip_x_m, abs=1e-5 * np.ptp(run.tip_x_m))
    assert ideal.current_a_a == pytest.approx(run.current_a_a, abs=1e-5 * np.ptp(run.current_a_a))
    assert ideal.energy_residual == pytest.approx(run.energy_residual, rel=0.01)


def test_simulate_and_drive_report_take_the_same_mean_of_the_same_run(ideal: Waveforms) -> None:
    report = pr.drive_report(MOTOR, driver("ideal"), duration=5e-4)
    # one kernel, one step rule, one window: 82.0 and 91.0 µN·m before
    assert report.mean_torque_n_m == pytest.approx(ideal.mean_torque_n_m, rel=1e-9)
    assert report.mean_rotor_speed_rad_s == pytest.approx(ideal.mean_rotor_speed_rad_s, rel=1e-9)


def test_simulate_runs_a_motor_behind_a_half_bridge() -> None:
    bridge = driver("half-bridge", network="llcc")
    run = simulated(MOTOR, bridge, duration=2e-4)
    report = pr.drive_report(MOTOR, bridge, duration=2e-4)
    assert run.mean_torque_n_m == pytest.approx(report.mean_torque_n_m, rel=0.02)  # other vectors, other rounding
    power = run.mean(run.voltage_a_v * run.current_a_a + run.voltage_b_v * run.current_b_a)
    assert power == pytest.approx(report.motor_power_w, rel=0.02)
    assert run.audit.passed
    assert run.to_dict()["drive"]["kind"] == "half-bridge"


def test_simulate_runs_a_tracked_motor_and_averages_over_its_own_periods() -> None:
    tracker = pr.Tracker(kind="none", voltage=50.0, frequency=51.7e3, offset=0.02)
    run = pr.simulate(MOTOR, tracker, duration=5e-4)
    assert 1.0 / run.drive_period_s == pytest.approx(1.02 * 51.7e3, rel=1e-3)
    assert run.audit.passed


def test_a_warming_motor_drifts_and_its_energy_still_balances() -> None:
    # a hundred thousandth of the heat capacity: 1 ms stands for 100 s
    thermal = pr.Thermal(heat_capacity_j_per_k=2.1e-5)
    drive = pr.TwoPhaseDrive(voltage=20.0, frequency=51.7e3, phase_deg=180.0)
    cold = simulated(MOTOR, drive, duration=3e-3, contact=None)
    warm = simulated(MOTOR, drive, duration=3e-3, contact=None, thermal=thermal)
    assert "temperature_k" not in cold.recorded
    assert warm.temperature_k[-1] > 20.0
    assert warm.temperature_k[0] == 0.0
    heat = warm.energy.damping + warm.energy.dielectric
    # the heat capacity takes the losses but for what flows to the surroundings, whose time constant is 2.1 ms, and for
    # what the plates hold
    assert 0.4 * heat < 2.1e-5 * warm.temperature_k[-1] < heat
    assert warm.energy.drift != 0.0
    assert warm.energy_residual < 2e-3
    assert np.ptp(warm.tip_x_m[warm.window()]) < 0.9 * np.ptp(cold.tip_x_m[cold.window()])  # it left the drive


def test_a_run_says_its_final_state(ideal: Waveforms) -> None:
    state = ideal.final_state
    tip = sum(mode.tip_x * state[f"displacement_{at}"] for at, mode in enumerate(MOTOR.modes, start=1))
    assert tip == pytest.approx(ideal.tip_x_m[-1], rel=1e-6)
    assert state["speed"] == ideal.rotor_speed_rad_s[-1]
    assert pr.simulate(MOTOR, DRIVE, duration=1e-4, signals=["tip_x_m"]).final_state is None


@pytest.mark.soak
def test_a_loop_tracks_through_an_amplifier() -> None:
    tracker = pr.Tracker(kind="pll", voltage=50.0, ratio_b=2.0, frequency=54e3, offset=0.01)
    amplifier = pr.Driver(kind="linear", voltage=50.0, ratio_b=2.0, frequency=54e3)
    through = pr.track(MOTOR, tracker, driver=amplifier, duration=2.7e-3, step=1.8e-7, margin=False)
    assert through.locked
    # where harmonic balance has it, as test_track.py finds of the loop without an amplifier
    assert through.end_frequency_hz == pytest.approx(running_resonance(MOTOR, tracker).resonance_hz, rel=2e-3)
    assert through.to_dict()["driver"]["kind"] == "linear"
