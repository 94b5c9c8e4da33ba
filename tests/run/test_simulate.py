# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``simulate`` promises beside the reference: start, columns, files, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray

import pyspice_runner as pr
from pyspice_runner.run.waveforms import COLUMNS, Waveforms
from tests.motors import motor as asymmetric
from tests.runs import simulated

DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)


@pytest.fixture(scope="module")
def run(motor: pr.Motor) -> Waveforms:
    return pr.simulate(motor, DRIVE, duration=1e-3)


def test_a_run_starts_pressed_at_rest_with_the_drive_at_full_amplitude(run: Waveforms, motor: pr.Motor) -> None:
    bending = sum(motor.contact.preload_n * mode.tip_y**2 / mode.stiffness_n_per_m for mode in motor.modes)
    assert run.time_s[0] == 0.0
    assert (run.voltage_a_v[0], run.voltage_b_v[0]) == (0.0, pytest.approx(50.0))
    assert run.normal_force_n[:5] == pytest.approx(motor.contact.preload_n, rel=1e-4)
    # the netlist's stiffness is adapted to the step, by (ω h)²/12 at most
    assert run.tip_y_m[0] == pytest.approx(-bending, rel=1e-3)
    assert run.tip_x_m[0] == run.friction_force_n[0] == run.rotor_speed_rad_s[0] == 0.0
    assert run.contact_state[0] == 1


def test_an_undriven_motor_stays_where_it_is(motor: pr.Motor) -> None:
    run = pr.simulate(motor, pr.TwoPhaseDrive(voltage=0.0, frequency=10e3), duration=2e-4)
    assert run.normal_force_n == pytest.approx(motor.contact.preload_n, rel=1e-6)
    assert np.abs(run.rotor_speed_rad_s).max() < 1e-9
    assert run.energy_residual == 0.0 or abs(run.energy.electrical) < 1e-15


def test_an_asymmetric_stator_rests_under_its_preload_too() -> None:
    """Its preload bends the tip sideways as well; the rotor's crown stands over the tip as it rests."""
    subject = asymmetric()
    sway = -8.0 * sum(mode.tip_x * mode.tip_y / mode.stiffness_n_per_m for mode in subject.modes)
    assert abs(sway) > 1e-9
    drive = pr.TwoPhaseDrive(voltage=0.0, frequency=30e3)
    for law in ("spring-slider", "brush", "coulomb"):
        run = pr.simulate(subject, drive, duration=1e-4, contact=law)
        assert run.tip_x_m == pytest.approx(sway, rel=1e-3)  # the netlist's stiffness is adapted to the step
        assert np.ptp(run.tip_x_m) < 1e-6 * abs(sway)
        assert run.normal_force_n == pytest.approx(8.0, rel=1e-6)
        assert np.abs(run.friction_force_n).max() < 1e-5
    preloaded = pr.admittance(subject, start=20e3, stop=70e3, points=51, state="preloaded")
    assert preloaded.normal_force_n == pytest.approx(8.0)


def test_balance_of_a_dielectric_without_loss() -> None:
    lossless = asymmetric().updated({"piezo.loss_tangent": 0.0})
    run = pr.simulate(lossless, pr.TwoPhaseDrive(voltage=50.0, frequency=41e3), duration=3e-4)
    assert run.energy_residual < 1e-3


def test_a_contact_of_micronewtons_with_little_friction_is_not_lost_in_the_tolerances() -> None:
    tiny = asymmetric().updated({"contact.preload_n": 6e-6, "contact.friction": 1e-3})
    run = pr.simulate(tiny, pr.TwoPhaseDrive(voltage=1e-7, frequency=41e3), duration=2e-4, speed=0.01)
    assert ".options vntol = 6e-14" in run.deck
    limit = 1e-3 * run.normal_force_n
    assert np.all(np.abs(run.friction_force_n) <= limit + 1e-3 * limit.max())
    assert run.friction_force_n[-1] == pytest.approx(-limit[-1], rel=1e-3)  # it slips, dragged back


def test_a_free_tip_rings_at_the_closed_form_amplitude(motor: pr.Motor) -> None:
    run = simulated(motor, DRIVE, duration=6e-3, contact=None)
    omega = 2 * np.pi * DRIVE.frequency
    voltages = np.array([50.0, 50.0j])
    x = sum(
        mode.tip_x
        * (mode.coupling_a_n_per_v * voltages[0] + mode.coupling_b_n_per_v * voltages[1])
        / (mode.stiffness_n_per_m - mode.mass_kg * omega**2 + 1j * omega * mode.damping_n_s_per_m)
        for mode in motor.modes
    )
    last = run.time_s > 5.8e-3
    phase = np.exp(1j * omega * run.time_s[last])
    found = np.linalg.lstsq(np.column_stack([phase.imag, phase.real]), run.tip_x_m[last], rcond=None)[0]
    # exact at resonance; (ω h)²/12 = 2e-4 of the damping remains, as does e^(−6 ms/τ) of the start
    assert found[0] + 1j * found[1] == pytest.approx(x, rel=1e-3)
    assert not run.normal_force_n.any()
    assert run.state_fractions == {"separated": 1.0, "stick": 0.0, "slip": 0.0}


def test_reversing_the_phase_reverses_the_rotor(motor: pr.Motor) -> None:
    forward, backward = (
        simulated(motor, pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3, phase_deg=phase), duration=3e-3)
        for phase in (90.0, -90.0)
    )
    assert forward.mean_rotor_speed_rad_s > 0.1
    # the motor is symmetric; at t = 0 the two starts differ by the sign of U_B's jump, whose trace decays
    assert backward.mean_rotor_speed_rad_s == pytest.approx(-forward.mean_rotor_speed_rad_s, rel=0.2)


def test_a_held_shaft_turns_at_its_speed_and_tells_the_torque(motor: pr.Motor) -> None:
    run = pr.simulate(motor, DRIVE, duration=1e-3, speed=-3.0)
    assert run.rotor_speed_rad_s == pytest.approx(-3.0, rel=1e-12)
    assert run.mean_torque_n_m > 0.0  # slower than the motor would turn: it pushes forward
    assert abs(run.mean_torque_n_m) <= motor.contact.friction * 1.1 * motor.contact.preload_n * motor.rotor.radius_m


def test_a_free_tip_lets_a_load_turn_the_rotor(motor: pr.Motor) -> None:
    run = pr.simulate(motor, DRIVE, duration=1e-3, contact=None, load_torque=1e-4)
    inertia, damping = motor.rotor.inertia_kg_m2, motor.rotor.bearing_damping_n_m_s
    exact = -1e-4 / damping * -np.expm1(-run.time_s * damping / inertia)
    assert run.rotor_speed_rad_s == pytest.approx(exact, abs=1e-6)


def test_a_soft_start_raises_the_amplitude_linearly(motor: pr.Motor) -> None:
    soft = pr.TwoToneDrive(
        voltage_1=40.0, frequency_1=20e3, voltage_2=10.0, frequency_2=40e3, phase_deg=30.0, soft_start=4e-4
    )
    run = pr.simulate(motor, soft, duration=8e-4)
    t = run.time_s
    common, opposed = 40.0 * np.sin(2 * np.pi * 20e3 * t), 10.0 * np.sin(2 * np.pi * 40e3 * t + np.radians(30.0))
    ramp = np.minimum(1.0, t / 4e-4)
    assert run.voltage_a_v == pytest.approx(ramp * (common + opposed), abs=1e-6)
    assert run.voltage_b_v == pytest.approx(ramp * (common - opposed), abs=1e-6)


def test_forces_obey_hertz_and_coulomb_throughout(run: Waveforms, motor: pr.Motor) -> None:
    assert run.normal_force_n.min() >= 0.0
    assert np.all(np.abs(run.friction_force_n) <= motor.contact.friction * run.normal_force_n * (1 + 1e-9))


def test_csv_holds_the_columns_that_others_rely_on(run: Waveforms, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.csv")
    header = path.read_text(encoding="utf-8").splitlines()[0]
    assert header == (
        "time_s,voltage_a_v,voltage_b_v,current_a_a,current_b_a,tip_x_m,tip_y_m,normal_force_n,friction_force_n,"
        "contact_displacement_m,contact_state,rotor_speed_rad_s"
    )
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    for index, name in enumerate(COLUMNS):
        assert table[:, index] == pytest.approx(getattr(run, name), rel=1e-11, abs=1e-300)


def test_netcdf_comes_back_with_units_and_provenance(run: Waveforms, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.nc")
    with xarray.open_dataset(path, engine="h5netcdf") as data:
        assert data["tip_x_m"].attrs["units"] == "m"
        assert data["tip_x_m"].values == pytest.approx(run.tip_x_m)
        assert json.loads(data.attrs["summary"])["deck_sha256"] == run.provenance["deck_sha256"]


def test_json_has_the_keys_that_others_rely_on(run: Waveforms, tmp_path: Path) -> None:
    summary = json.loads(run.save(tmp_path / "run.json").read_text(encoding="utf-8"))
    assert {"mean_rotor_speed_rad_s", "mean_torque_n_m", "state_fractions", "energy_residual"} <= set(summary)
    assert {"points", "solver_seconds", "ngspice_version"} <= set(summary)
    assert set(summary["state_fractions"]) == {"separated", "stick", "slip"}


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"duration": -1.0}, "duration = -1 s is not valid"),
        ({"duration": float("nan")}, "duration = nan s is not valid"),
        ({"duration": 1e-8}, "shorter than ten steps"),
        ({"duration": 1e4}, "fit in memory"),
        ({"step": 1e-5}, "step = 1e-05 s is too coarse"),
        ({"step": 0.0}, "step = 0 s is not valid"),
        ({"speed": float("inf")}, "speed = inf rad/s is not valid"),
        ({"speed": 1.0, "load_torque": 1e-3}, "exclude each other"),
        ({"load_torque": float("nan")}, "load_torque = nan N·m is not valid"),
        ({"contact": "glue"}, "contact = 'glue' is not valid"),
    ],
)
def test_errors_say_what_is_allowed(motor: pr.Motor, settings: dict[str, object], says: str) -> None:
    with pytest.raises(pr.ParameterError) as refusal:
        pr.simulate(motor, DRIVE, **{"duration": 1e-3, **settings})  # type: ignore[arg-type]
    assert says in str(refusal.value)
