# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states of motors with several contacts: a travelling-wave ring, and tips on one stator."""

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.motor.drive import Load
from pyspice_runner.run.dynamometer import STUCK
from pyspice_runner.steady.copies import Plant
from pyspice_runner.steady.harmonic_balance import balanced
from pyspice_runner.steady.monodromy import differentiable
from tests.rings import RADIUS, ring, with_contacts
from tests.runs import simulated
from tests.steady.test_monodromy import check_derivative

FLAGSHIP = pr.load_motor("bimodal40")
PLATE = pr.load_motor("examples/plate40.toml")
SOFTNESS = ("tangential_compliance_tip_m_per_n23", "tangential_compliance_rotor_m_per_n23")
SLIDING = 0.2 * 170.0 * RADIUS  # friction torque of the ring under its preload, N·m


def unequal(motor, **changes):
    """Two tips: the second moves the other way along a longer lever, is rougher, and stands back."""
    back = {mode.name: -0.8 * mode.tip_x for mode in motor.modes}
    places = (
        {"name": "front", "share": 0.6},
        {"name": "back", "share": 0.4, "radius_m": 1.2 * motor.rotor.radius_m, "direction": -1, "tip_x": back,
         "height_m": -2e-8, "contact": {"friction": 0.3}, **changes},
    )  # fmt: skip
    return with_contacts(motor, *places)


@pytest.mark.parametrize("motor", [FLAGSHIP, PLATE], ids=lambda motor: motor.name)
@pytest.mark.parametrize("speed", [0.5, None], ids=["held", "free"])
def test_two_equal_contacts_have_the_steady_state_of_one_with_twice_the_points(motor, speed):
    both, twice = with_contacts(motor, {}, {}), with_contacts(motor, {"multiplicity": 2})
    ours, one = (pr.steady_state(own, pr.default_drive(motor), speed=speed) for own in (both, twice))
    assert ours.method == one.method == "newton"
    for name, value in one.quantities.items():  # the iteration of ngspice closes to 1e-6 of a force that alternates
        assert getattr(ours, name) == pytest.approx(value, rel=1e-5, abs=1e-6, nan_ok=True), name
    assert ours.speed_rad_s == pytest.approx(one.speed_rad_s, rel=1e-5)
    assert np.abs(ours.floquet_multipliers[:6]) == pytest.approx(np.abs(one.floquet_multipliers[:6]), rel=1e-6)
    first, second = (contact["normal_force_n"] for contact in ours.contacts)
    assert first == pytest.approx(second, rel=1e-6)
    assert first + second == pytest.approx(ours.normal_force_n, rel=1e-9)


@pytest.mark.parametrize(("speed", "frequency"), [(5.0, 39.9e3), (None, 40.3e3)], ids=["held", "free"])
def test_the_derivative_of_a_ring_is_that_of_perturbed_copies(speed, frequency, tmp_path):
    motor = ring(tmp_path)
    check_derivative(Plant(motor, pr.default_drive(motor).updated({"frequency": frequency}), Load(speed), Law()))


@pytest.mark.parametrize(
    ("compliance", "contact"),
    [(4e-8, {"restitution": 0.7}), (0.0, {"worn_flat_radius_m": 3e-5, "sliding_ratio": 0.8})],
)
def test_the_derivative_of_unequal_contacts_is_that_of_perturbed_copies(compliance, contact):
    motor = unequal(FLAGSHIP.updated({"contact.tangential_series_compliance_m_per_n": compliance}), contact=contact)
    check_derivative(Plant(motor, pr.default_drive(FLAGSHIP), Load(10.0), Law()))


@pytest.mark.parametrize("changes", [{"contact": {"series_compliance_m_per_n": 1e-8}}, {"law": {"name": "coulomb"}}])
def test_contacts_with_a_compliance_in_series_or_a_law_at_one_alone_are_differentiated_by_copies(changes):
    series = ("contact.series_compliance_m_per_n", "contact.tangential_series_compliance_m_per_n")
    stiff = FLAGSHIP.updated(dict.fromkeys(series, 0.0))
    motor, drive = unequal(stiff, **changes), pr.default_drive(FLAGSHIP)
    assert not differentiable(Plant(motor, drive, Load(10.0), Law()))
    state = pr.steady_state(motor, drive, speed=10.0)
    assert state.stable
    assert abs(state.balance_residual) < 1e-6
    if "law" in changes:
        with pytest.raises(pr.ParameterError, match="'spring-slider' of front beside 'coulomb' of back"):
            pr.small_signals(motor, drive, frequencies=[0.2], speed=10.0)


def test_points_on_a_soft_compliance_in_series_start_near_their_steady_state(tmp_path):
    motor = ring(tmp_path).updated({
        "contact.series_compliance_m_per_n": 7.2e-7, "contact.normal_stiffness_n_per_m15": 1.14e10,
        **{f"contact.{name}": 1.2e-7 for name in SOFTNESS},
    })  # fmt: skip
    state = pr.steady_state(motor, pr.default_drive(motor), speed=5.0)
    assert (state.method, state.iterations <= 3) == ("newton", True)


@pytest.mark.slow
def test_a_ring_settles_to_its_steady_state(tmp_path):
    motor, periods = ring(tmp_path, points=4), 240
    drive = pr.default_drive(motor)
    state = pr.steady_state(motor, drive, speed=5.0)
    run = simulated(motor, drive, duration=periods * drive.period, speed=5.0)  # 8 decay times, e^-8 = 3e-4
    last = run.time_s > (periods - 20) * drive.period
    assert RADIUS * run.friction_force_n[last].mean() == pytest.approx(state.torque_n_m, abs=1e-3 * SLIDING)
    assert run.normal_force_n[last].mean() == pytest.approx(state.normal_force_n, rel=1e-3)


def test_a_ring_mirrors_with_its_phase_and_eight_points_suffice(tmp_path):
    motor = ring(tmp_path)
    drive = pr.default_drive(motor)
    softer = {name: 2.0 ** (2.0 / 3.0) * getattr(motor.contact, name) for name in SOFTNESS}  # of points half as stiff
    sixteen = ring(tmp_path, points=16).updated({f"contact.{name}": value for name, value in softer.items()})
    speeds, of_turned, of_sixteen = (
        pr.working_points(one, drive, over={"drive.phase_deg": [-90.0, 90.0]}, objective="speed").speed_rad_s.values
        for one in (motor, ring(tmp_path, turn=0.2), sixteen)
    )
    assert speeds[1] > 5.0
    assert speeds[0] == pytest.approx(-speeds[1], rel=1e-4)  # of a free shaft, by the steps of ngspice
    for other in (of_turned, of_sixteen):  # 0.1 % was measured against 32 points
        assert other == pytest.approx(speeds, rel=1e-3)
    held = [pr.steady_state(motor, drive.updated({"phase_deg": 90.0 * by}), speed=5.0 * by) for by in (1.0, -1.0)]
    assert held[0].torque_n_m == pytest.approx(-held[1].torque_n_m, abs=1e-6 * SLIDING)
    assert abs(held[0].balance_residual) < 1e-6
    (balance,) = balanced([held[0].solution.plant])
    assert RADIUS * balance.forces.friction.mean(axis=2).sum() == pytest.approx(held[0].torque_n_m, abs=1e-3 * SLIDING)


def test_friction_holds_a_ring_that_hardly_vibrates(tmp_path):
    motor = ring(tmp_path)
    state = pr.steady_state(motor, pr.default_drive(motor).updated({"voltage": 0.5}), speed=0.0)
    assert STUCK in state.cautions
    bounds = [state.torque_min_n_m, state.torque_max_n_m]
    assert bounds == pytest.approx([-SLIDING, SLIDING], rel=0.02)  # 0.5 V moves it by less than 2 % of its penetration


def test_a_tip_that_stands_back_bears_less_and_opens_more():
    motor, drive = unequal(FLAGSHIP, height_m=-4e-7), pr.default_drive(FLAGSHIP)
    state = pr.steady_state(motor, drive.updated({"voltage": 40.0}), speed=10.0)
    front, back = state.contacts
    assert motor.stator.share[1] < 0.35
    assert back["separated"] > front["separated"]
    assert state.separated == pytest.approx(motor.stator.share @ [front["separated"], back["separated"]])
    assert state.to_dict()["contacts"] == list(state.contacts)
    assert abs(state.balance_residual) < 1e-6
    assert "normal_force_back_n" in state.columns()


def test_the_small_signals_of_two_tips_are_the_slopes_of_their_steady_states():
    motor, drive = unequal(FLAGSHIP), pr.default_drive(FLAGSHIP)
    found = pr.small_signals(motor, drive, frequencies=[0.2])
    speeds = [pr.steady_state(motor, drive.updated({"voltage": drive.voltage + by})).speed_rad_s for by in (-0.5, 0.5)]
    # 2 %: curvature within 1 V of 60 V, and events that pass from one step to another
    assert found.transfer("speed", "amplitude")[0].real == pytest.approx(speeds[1] - speeds[0], rel=0.02)
