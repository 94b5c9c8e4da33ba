# SPDX-License-Identifier: GPL-3.0-or-later
"""One motor with every effect goes through every analysis.

Its tip is worn and stands on compliances along both axes, its contact is damped, its modes shake a carrier that moves
along both axes, its bearing is dry, its ceramic softens, and its groups have a capacitance between them.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import LAWS
from pyspice_runner.motor.contact import normal_damping, stiffnesses_at_preload
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.steady.steady import SteadyState, steady_states
from tests.circuit.batch import measured
from tests.reference.damped import integrate_damped
from tests.reference.integrator import integrate
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("reference")  # the integrators are compiled once there

MOTOR = pr.load_motor(Path(__file__).parent / "data" / "every_effect.toml")
DRIVE = pr.default_drive(MOTOR)
SPEED = 10.0  # rad/s, a sixth of that without load
LIMIT = MOTOR.contact.friction * MOTOR.contact.preload_n * MOTOR.rotor.radius_m  # N·m
LINEAR = MOTOR.updated(
    {f"modes.{mode}.{what}": 0.0 for mode in (2, 3) for what in ("softening_per_m2", "damping_growth_per_m2")}
)
NEW = LINEAR.updated({"contact.worn_flat_radius_m": 0.0})
# the event-driven reference has no loss along the normal and no compliance in series
WORN = LINEAR.updated(
    {"contact.restitution": 1.0, "contact.series_compliance_m_per_n": 0.0,
     "contact.tangential_series_compliance_m_per_n": 0.0}
)  # fmt: skip


@cache
def steady(law: str = "spring-slider") -> SteadyState:
    return pr.steady_state(MOTOR, DRIVE, speed=SPEED, contact=law)


def away(run: Waveforms, exact: Any) -> float:
    """RMS of the difference of the tip's path from that of a reference, relative to its motion."""
    difference = motion = 0.0
    for name in ("tip_x_m", "tip_y_m"):
        wanted = getattr(exact, name)
        difference = hypot(difference, float(np.std(np.interp(exact.time_s, run.time_s, getattr(run, name)) - wanted)))
        motion = hypot(motion, float(np.std(wanted)))
    return difference / motion


# --- runs ---


def test_a_run_balances_its_energy_and_opens_sticks_and_slips() -> None:
    run = pr.simulate(MOTOR, DRIVE, duration=1e-3)
    assert run.energy_residual < 1e-3  # required; measured 6e-4
    assert min(run.state_fractions.values()) > 0.05
    assert not run.audit.findings


@pytest.mark.parametrize("reference", mostly(pytest.mark.soak, ["events", "losses"], ["events"]))
def test_a_run_is_that_of_an_independent_integrator(reference: str) -> None:
    """One has the worn tip, the other damping and both compliances; both have recoil, mount and dry bearing."""
    duration, step = 6e-4, 5e-8
    tones = (DRIVE.tones_a, DRIVE.tones_b)
    motor = WORN if reference == "events" else NEW
    run = pr.simulate(motor, DRIVE, duration=duration, step=step)
    exact: Any
    if reference == "events":
        exact = integrate(motor.to_dict(), *tones, duration=duration, output_step=step)
    else:
        exact = integrate_damped(motor.to_dict(), *tones, duration=duration, output_step=step, step=step / 20)
    assert away(run, exact) < 5e-4  # measured 2e-5, and 1e-4 against the one that is late by a step at each event
    speed = np.interp(exact.time_s, run.time_s, run.rotor_speed_rad_s)
    np.testing.assert_allclose(speed, exact.rotor_speed_rad_s, rtol=0.0, atol=5e-4 * np.abs(speed).max())
    assert run.energy_residual < 1e-3


@pytest.mark.parametrize("law", LAWS)
def test_the_contact_is_separated_while_its_normal_force_is_zero(law: str) -> None:
    """Damping ends the force of a contact that opens before its penetration ends."""
    run = pr.simulate(MOTOR, DRIVE, duration=3e-4, contact=law, audit=False)
    assert np.array_equal(run.normal_force_n > 1e-9, run.contact_state > 0.5)
    assert 0.1 < np.mean(run.contact_state > 0.5) < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("law", mostly(pytest.mark.soak, LAWS, ["spring-slider"]))
@pytest.mark.soak
def test_a_steady_state_is_what_a_run_settles_to(law: str) -> None:
    state = steady(law)
    assert state.stable
    assert abs(state.balance_residual) < 1e-5
    run = pr.simulate(MOTOR, DRIVE, duration=1.2e-2, speed=SPEED, contact=law, step=state.step_s)
    # the accuracy of a torque; the run is two decay times of the slowest mode long
    assert run.mean_torque_n_m == pytest.approx(state.torque_n_m, abs=2e-3 * LIMIT)


def test_a_curve_has_the_steady_states_at_its_speeds() -> None:
    curve = pr.speed_torque(MOTOR, DRIVE, speeds=[0.0, SPEED])
    assert curve["settled"].values.all()
    assert curve["torque_n_m"].values[1] == pytest.approx(steady().torque_n_m, abs=1e-3 * LIMIT)
    assert curve["torque_n_m"].values[0] == pytest.approx(LIMIT, rel=2e-3)  # all slips in one direction


@pytest.mark.soak
def test_small_signals_have_the_slow_gain_of_two_steady_states() -> None:
    """Near the speed without load, where the torque depends on the voltage."""
    speed, step = 50.0, 2.0
    found = pr.small_signals(LINEAR, DRIVE, frequencies=[0.01], speed=speed)
    points = [
        Point.of(LINEAR, DRIVE.updated({"voltage": DRIVE.voltage + change}), speed=speed) for change in (-step, step)
    ]
    low, high = (state.torque_n_m for state in steady_states(points))
    # each torque to 1e-3 of the friction torque would be 1.5 %; measured 0.3 %
    assert found.transfer("torque", "amplitude")[0].real == pytest.approx((high - low) / (2 * step), rel=0.02)


def test_the_exported_library_runs_in_ngspice_alone_as_the_motor_does(tmp_path: Path) -> None:
    duration, step = 3e-4, 1e-7
    library = pr.export_motor(MOTOR, tmp_path / "motor.lib").read_text(encoding="ascii")
    (tmp_path / "motor.lib").unlink()
    deck = f"""every effect
{library}
Va a 0 SIN(0 {DRIVE.voltage} {DRIVE.frequency} 0 0 0)
Vb b 0 SIN(0 {DRIVE.voltage} {DRIVE.frequency} 0 0 {DRIVE.phase_deg})
Xmotor a b 0 shaft piezomotor
.options reltol=1e-6 vntol=1e-9 abstol=1e-9 trtol=1e9 method=trap
.measure TRAN speed FIND v(shaft) AT={duration}
.measure TRAN turned INTEG v(shaft) FROM=0 TO={duration}
.tran {step} {duration} 0 {step} uic
.end
"""
    found = measured(deck, tmp_path)
    run = pr.simulate(MOTOR, DRIVE, duration=duration, step=step)
    turned = float(np.trapezoid(run.rotor_speed_rad_s, run.time_s))
    # the library is not adapted to the step, which costs 1/12 (ω h)² = 5e-5 of a frequency
    assert found["speed"] == pytest.approx(run.rotor_speed_rad_s[-1], rel=1e-2)
    assert found["turned"] == pytest.approx(turned, rel=1e-2)


@pytest.mark.slow
def test_a_driver_without_impedance_gives_the_power_of_the_ideal_voltages() -> None:
    driver = pr.Driver(kind="linear", voltage=DRIVE.voltage, frequency=DRIVE.frequency, phase_deg=DRIVE.phase_deg)
    found = pr.drive_report(MOTOR, driver, 1e-3, step=2e-7)
    assert abs(found.balance_residual) < 0.01
    assert not found.audit.findings


def test_a_sweep_has_the_run_of_each_point(tmp_path: Path) -> None:
    run: dict[str, Any] = {"duration": 2e-4, "step": 2e-7}
    with ThreadPoolExecutor(1) as pool:
        found = pr.sweep(MOTOR, DRIVE, over={"contact.friction": [0.2, 0.25]}, store=tmp_path, executor=pool, **run)
    for friction, torque in zip((0.2, 0.25), found["mean_torque_n_m"].values, strict=True):
        assert torque == pr.simulate(MOTOR.updated({"contact.friction": friction}), DRIVE, **run).mean_torque_n_m


@pytest.mark.soak
def test_a_point_of_its_own_gives_back_the_friction() -> None:
    columns = {"speed_rad_s": [SPEED], "torque_n_m": [steady().torque_n_m], "torque_n_m_error": [1e-4]}
    result = pr.calibrate(MOTOR.updated({"contact.friction": 0.23}), columns, free=["contact.friction"], drive=DRIVE)
    (found,) = result.estimates
    assert abs(found.value - MOTOR.contact.friction) < 0.3 * found.standard_error  # the data have no noise
    assert found.standard_error == pytest.approx(MOTOR.contact.friction * 1e-4 / steady().torque_n_m, rel=0.1)


# --- the averaged motor ---


@pytest.mark.parametrize(("motor", "name"), [(MOTOR, "softening_per_m2"), (LINEAR, "worn_flat_radius_m")])
def test_the_averaged_motor_rejects_an_effect_that_it_lacks_by_its_name(motor: pr.Motor, name: str) -> None:
    with pytest.raises(pr.ParameterError, match=name):
        pr.simulate_averaged(motor, DRIVE, 1e-2)
    with pytest.raises(pr.ParameterError, match=name):
        pr.state_space(motor, DRIVE)


@pytest.mark.slow
def test_the_averaged_motor_settles_to_the_steady_state() -> None:
    full = pr.steady_state(NEW, DRIVE, speed=SPEED)
    found = pr.simulate_averaged(NEW, DRIVE, 5e-2, speed=SPEED)
    assert found.settled
    # the averaged model's 2 % of the friction force; measured 6e-4
    assert found.torque_n_m[-1] == pytest.approx(full.torque_n_m, abs=0.02 * LIMIT)


@pytest.mark.soak
def test_a_loop_designed_on_the_linear_plant_has_its_crossover() -> None:
    system = pr.state_space(NEW, DRIVE)
    gain = system.transfer("speed", "amplitude", np.array([1e-3]))[0].real
    low, high = (
        pr.state_space(NEW, DRIVE.updated({"voltage": DRIVE.voltage + step})).point["speed"] for step in (-0.5, 0.5)
    )
    assert gain == pytest.approx(high - low, rel=0.02)
    loop = pr.control_loop(NEW, DRIVE, quantity="speed", crossover=5.0, margin=100.0, sample_time=1e-3)
    assert loop.crossover_hz == pytest.approx(5.0, rel=1e-3)  # the grid of the loop gain


# --- the stator ---


def test_the_free_admittance_is_that_of_the_stator_s_matrices() -> None:
    found = pr.admittance(LINEAR, start=35e3, stop=45e3, points=101)
    exact = LINEAR.carried_stator.admittance(2.0 * np.pi * found.frequency_hz)
    # the circuit's ladders hold the loss angle of 0.01 within a twentieth; measured 6e-5
    assert np.abs(found.matrix_s - exact).max() < 2e-4 * np.abs(exact).max()


@pytest.mark.parametrize("restitution", [1.0, MOTOR.contact.restitution])
def test_the_preloaded_admittance_is_that_of_stator_and_contact_in_closed_form(restitution: float) -> None:
    motor = LINEAR.updated({"contact.restitution": restitution})
    contact, rotor = motor.contact, motor.rotor
    found = pr.admittance(motor, start=35e3, stop=45e3, points=101, state="preloaded")
    springs = stiffnesses_at_preload(contact)
    damping = normal_damping(contact) * contact.preload_n
    stator = motor.carried_stator.pressed(
        springs,
        (0.0, damping),
        rotor.inertia_kg_m2 / rotor.radius_m**2,
        rotor.bearing_damping_n_m_s / rotor.radius_m**2,
    )
    exact = stator.admittance(2.0 * np.pi * found.frequency_hz)
    # measured 3e-3 and 5e-3: the preload leans on the rotor's curvature, and the damper is no small one
    assert np.abs(found.matrix_s - exact).max() < 1e-2 * np.abs(exact).max()
    assert found.normal_force_n == pytest.approx(contact.preload_n, rel=1e-6)
