# SPDX-License-Identifier: GPL-3.0-or-later
"""Stribeck friction, a dry bearing and a compliance in series with the contact: each against its own yardstick."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from math import hypot, pi

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pyspice_runner as pr
from pyspice_runner.analysis.dynamometer import delivering
from pyspice_runner.analysis.simulate import _delivering
from pyspice_runner.errors import ParameterError
from pyspice_runner.model.contact import normal_damping, normal_stiffness_at_preload, static_penetration
from pyspice_runner.run.waveforms import EnergyBalance, Waveforms
from tests.reference.integrator import ReferenceRun, Tone, integrate
from tests.runs import simulated
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("reference")  # the integrator is compiled once there

PAPER = pr.load_motor("andersen2002")
DURATION = 4e-3  # s
STRIBECK = {"contact.sliding_ratio": 0.7, "contact.stribeck_velocity_m_s": 0.05}
DRY = {"rotor.bearing_friction_n_m": 2e-4, "rotor.bearing_presliding_rad": 1e-3}


def two_phase(voltage: float, frequency: float) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=90.0)


@dataclass(frozen=True)
class Point:
    """One operating point of the paper's motor."""

    drive: pr.TwoPhaseDrive
    changes: dict[str, float | None]
    load: dict[str, float] = field(default_factory=dict)


POINTS = {
    "Stribeck, held stator": Point(two_phase(100.0, 51.7e3), STRIBECK | {"mount": None}),
    "Stribeck, opens": Point(two_phase(60.0, 17.9e3), STRIBECK | {"contact.preload_n": 3.0}),
    "Stribeck, held shaft": Point(two_phase(200.0, 53e3), {**STRIBECK}, {"speed": 3.0}),
    "Stribeck, strong drive": Point(two_phase(300.0, 52.5e3), STRIBECK | {"contact.preload_n": 10.0}),
    "dry bearing": Point(two_phase(200.0, 53e3), {**DRY}),
    "dry bearing, held shaft": Point(two_phase(200.0, 53e3), {**DRY}, {"speed": 2.0}),
    "dry bearing, opens": Point(
        two_phase(60.0, 17.9e3), DRY | {"contact.preload_n": 3.0, "rotor.bearing_friction_n_m": 5e-5}
    ),
    "both": Point(two_phase(300.0, 52.5e3), STRIBECK | DRY | {"contact.preload_n": 10.0}),
}


@cache
def pair(name: str) -> tuple[Waveforms, ReferenceRun]:
    """Return our run and that of the reference."""
    point = POINTS[name]
    motor = PAPER.updated(point.changes)
    tones = [
        [Tone(t.amplitude, t.frequency, t.phase) for t in some] for some in (point.drive.tones_a, point.drive.tones_b)
    ]
    exact = integrate(
        motor.to_dict(), tones[0], tones[1], duration=DURATION, output_step=2e-7,
        statistics_from=DURATION - 20 * point.drive.period, **point.load,
    )  # fmt: skip
    return simulated(motor, point.drive, duration=DURATION, **point.load), exact


@pytest.mark.parametrize(
    "name",
    mostly(
        pytest.mark.soak,
        POINTS,
        ["Stribeck, opens", "dry bearing, opens", "both"],
    ),
)
def test_tip_rotor_states_and_energy_are_those_of_the_reference(name: str) -> None:
    run, exact = pair(name)
    ours = [CubicSpline(run.time_s, values)(exact.time_s) for values in (run.tip_x_m, run.tip_y_m)]
    away = hypot(*(float(np.std(a - b)) for a, b in zip(ours, (exact.tip_x_m, exact.tip_y_m), strict=True)))
    motion = hypot(float(np.std(exact.tip_x_m)), float(np.std(exact.tip_y_m)))
    assert away / motion < 0.005  # required; measured at most 0.07 %
    speed = CubicSpline(run.time_s, run.rotor_speed_rad_s)(exact.time_s)
    late = exact.time_s > DURATION - 20 * run.drive_period_s
    fastest = float(np.abs(exact.rotor_speed_rad_s).max())
    assert abs(float(np.mean((speed - exact.rotor_speed_rad_s)[late]))) < 0.01 * fastest  # required
    for state, share in exact.state_fractions.items():
        assert run.state_fractions[state] == pytest.approx(share, abs=0.01)  # required
    assert run.energy_residual < 1e-3  # required; measured at most 8e-6


def test_what_is_off_leaves_no_trace_in_circuit_and_document() -> None:
    off = {
        "contact.sliding_ratio": 1.0, "contact.stribeck_velocity_m_s": 0.3, "contact.series_compliance_m_per_n": 0.0,
        "rotor.bearing_friction_n_m": 0.0, "rotor.bearing_presliding_rad": 0.01,
    }  # fmt: skip
    drive = two_phase(50.0, 51.7e3)
    plain, same = (pr.simulate(motor, drive, duration=5e-5) for motor in (PAPER, PAPER.updated(off)))
    assert same.deck == plain.deck
    assert PAPER.updated(off).to_dict() == PAPER.to_dict()
    on = PAPER.updated(STRIBECK | DRY | {"contact.series_compliance_m_per_n": 1e-8}).to_dict()
    assert on["contact"]["sliding_ratio"] == 0.7
    assert on["rotor"]["bearing_presliding_rad"] == 1e-3


def test_stribeck_friction_is_refused_where_a_law_has_one_coefficient() -> None:
    with pytest.raises(ParameterError, match="sliding_ratio"):
        pr.simulate(PAPER.updated(STRIBECK), two_phase(50.0, 51.7e3), duration=1e-4, contact="brush")


COMPLIANCE = 4e-8  # m/N, which halves the normal stiffness at 5 N


def test_a_compliance_in_series_leaves_the_preload_and_softens_the_contact() -> None:
    """δ_total = δ + c F_N at every instant, and F_N = K_N δ^(3/2); the operating point stays F₀."""
    motor = PAPER.updated({"contact.series_compliance_m_per_n": COMPLIANCE, "mount": None})
    contact = motor.contact
    alone = normal_stiffness_at_preload(PAPER.contact)
    assert normal_stiffness_at_preload(contact) == pytest.approx(1.0 / (1.0 / alone + COMPLIANCE), rel=1e-14)
    rest = pr.simulate(motor, two_phase(0.0, 51.7e3), duration=2e-4)
    np.testing.assert_allclose(rest.normal_force_n, contact.preload_n, rtol=1e-6)
    run = simulated(motor, two_phase(100.0, 17e3), duration=2e-3)
    assert run.state_fractions["separated"] > 0.1
    depth = np.cbrt((run.normal_force_n / contact.normal_stiffness_n_per_m15) ** 2)
    bending = contact.preload_n / motor.modes[0].stiffness_n_per_m
    seat = static_penetration(contact) + COMPLIANCE * contact.preload_n + bending
    pressed = run.normal_force_n > 0.05
    # the rotor's curvature takes x²/2R of the approach
    approach = seat + run.tip_y_m - 0.5 * run.tip_x_m**2 / motor.rotor.radius_m
    # the adapted stiffness of the mode bends it by 0.4 % less; Newton's iteration is closed to 1e-6
    np.testing.assert_allclose((depth + COMPLIANCE * run.normal_force_n)[pressed], approach[pressed], atol=4e-10)
    assert run.energy_residual < 1e-3


def test_a_compliance_in_series_lowers_the_contact_resonance_as_computed() -> None:
    motor = PAPER.updated({"contact.series_compliance_m_per_n": COMPLIANCE, "mount": None})
    found = pr.admittance(motor, start=14e3, stop=20e3, points=201, state="preloaded").resonances["A"]
    mode = motor.modes[0]
    stiffness = mode.stiffness_n_per_m + normal_stiffness_at_preload(motor.contact)
    expected = (stiffness / mode.mass_kg) ** 0.5 / (2.0 * pi)
    assert found[0].fs == pytest.approx(expected, rel=2e-4)  # of a quality factor of 75, read off a grid


@pytest.mark.parametrize(("restitution", "allowed"), [(0.9, 0.02), (0.8, 0.05)])
def test_damping_works_on_the_penetration_and_not_on_the_compliance_in_series(
    restitution: float, allowed: float
) -> None:
    """F_N = K_N δ^(3/2) (1 + a δ̇) with δ the approach less c F_N, in a contact that opens."""
    compliance = 1e-8  # m/N: a tenth to a half of that of the contact in this run
    motor = PAPER.updated({
        "contact.series_compliance_m_per_n": compliance, "contact.restitution": restitution, "mount": None,
    })  # fmt: skip
    contact = motor.contact
    run = pr.simulate(motor, two_phase(100.0, 17e3), duration=2e-3, step=5e-8)
    late = run.time_s > 1e-3
    seat = static_penetration(contact) + contact.preload_n * (compliance + 1.0 / motor.modes[0].stiffness_n_per_m)
    approach = seat + run.tip_y_m - 0.5 * run.tip_x_m**2 / motor.rotor.radius_m
    depth = approach - compliance * run.normal_force_n
    elastic = contact.normal_stiffness_n_per_m15 * np.maximum(depth, 0.0) ** 1.5
    exact = elastic * np.maximum(1.0 + normal_damping(contact) * np.gradient(depth, run.time_s), 0.0)
    time, force = run.time_s[late], run.normal_force_n[late]
    loss = np.trapezoid(force * np.gradient(approach, run.time_s)[late], time)
    # The model takes dδ/dy without damping. The rate of the total approach gave 15 and 27 % less loss.
    assert loss == pytest.approx(np.trapezoid((exact * np.gradient(depth, run.time_s))[late], time), rel=0.01)
    # the remaining error, c F_N a d²δ/dt², grows with the damping
    assert np.std((exact - run.normal_force_n)[late]) < allowed * np.std(force)


def test_a_run_says_where_damping_and_a_compliance_in_series_make_the_normal_force_inexact() -> None:
    """The limit is 0.1 % of the force: below, no random motor was more than 1 % off a reference without this error."""
    motor = PAPER.updated({"mount": None, "contact.series_compliance_m_per_n": 2e-8})
    drive = two_phase(100.0, 17e3)  # opens the contact
    said = [
        any(text.startswith("The normal force is off by") for text in run.cautions)
        for restitution in (1.0, 0.5)
        for run in [simulated(motor.updated({"contact.restitution": restitution}), drive, duration=5e-4)]
    ]
    assert said == [False, True]


def test_a_loss_that_is_negative_has_its_sentence_with_the_largest_share() -> None:
    point = {
        "power_a_w": 1.0, "power_b_w": 1.0, "shaft_power_w": -2.0, "friction_loss_w": 0.1, "normal_loss_w": -0.001,
        "damping_loss_w": 0.1, "dielectric_loss_w": 0.0,
    }  # fmt: skip
    assert delivering([point]) == ()  # 1 mW of the 4 W that come from the source and the shaft are below 0.1 %
    some, more = (point | {"friction_loss_w": loss} for loss in (-0.02, -0.08))
    (told,) = delivering([some, more, point])
    assert told.startswith("Friction delivers 2 % of the power put in")
    unknown = dict.fromkeys(point, float("nan"))
    assert delivering([unknown]) == ()


def test_a_stalled_motor_whose_friction_delivers_power_says_so_and_the_brush_does_not() -> None:
    motor = pr.load_motor("beam40")
    drive = pr.default_drive(motor)
    spring, brush = (pr.steady_state(motor, drive, speed=0.0, contact=law) for law in ("spring-slider", "brush"))
    assert spring.friction_loss_w < 0.0 < brush.friction_loss_w
    assert any(text.startswith("Friction delivers") for text in spring.cautions)
    assert not any("delivers" in text for text in brush.cautions)
    assert spring.efficiency == 0.0


def test_a_run_whose_friction_delivers_energy_says_so() -> None:
    nothing = dict.fromkeys((item.name for item in fields(EnergyBalance)), 0.0)
    assert _delivering(EnergyBalance(**nothing | {"passed": 1.0, "friction": -0.0009})) == ()
    (told,) = _delivering(EnergyBalance(**nothing | {"passed": 1.0, "friction": -0.0075}))
    assert told.startswith("Friction delivers 0.75 % of the power put in")
