# SPDX-License-Identifier: GPL-3.0-or-later
"""Held shafts, time averages of unstable motions, and what averaged models say of both."""

import pytest

import pyspice_runner as pr
from pyspice_runner.run.dynamometer import STUCK
from pyspice_runner.run.point import Point
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.settling import time_averages
from pyspice_runner.steady.steady import steady_states
from tests.motors import HARD_TIP
from validation import held_points

BIMODAL = pr.load_motor("bimodal40")


def drive(voltage: float, frequency: float = 40.7e3, phase_deg: float = 90.0) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase_deg)


def test_a_determined_torque_of_a_held_shaft_is_that_of_a_run_that_settles_from_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A case of ``python -m validation.held_points``, with 20 times the damping and the voltage, to settle soon."""
    motor, given, law = held_points.drawn(29)
    damping = {f"modes.{n}.damping_n_s_per_m": 20.0 * mode.damping_n_s_per_m for n, mode in enumerate(motor.modes)}
    changed = (motor.updated(damping), given.updated({"voltage": 20.0 * given.voltage}), law)
    monkeypatch.setattr(held_points, "drawn", lambda *_: changed)
    found = held_points.outcome(29)
    assert found["kind"] == "agrees"
    assert abs(found["torque"]) > 0.1


@pytest.mark.parametrize(("voltage", "held"), [pytest.param(36.0, True, marks=pytest.mark.soak), (44.0, False)])
def test_an_averaged_run_says_where_friction_holds_the_shaft(voltage: float, held: bool) -> None:
    """By the full motor, whose contact sticks up to 40 V, and slips for 46 % of the period at 44 V."""
    run = pr.simulate_averaged(BIMODAL, drive(voltage), 20.0 * BIMODAL.decay_s, speed=0.0)
    assert any(text.startswith(STUCK) for text in run.cautions) == held
    system = pr.state_space(BIMODAL, drive(voltage), load_torque=0.02 if held else 0.0)
    assert any(text.startswith("Friction holds the shaft") for text in system.cautions) == held


def test_averaged_models_say_that_the_motion_of_a_closed_contact_is_unstable() -> None:
    """With a hard tip on a light carrier: every second period differs, and the full motor's contact stays closed."""
    motor = BIMODAL.updated({"mount.mass_kg": 1.5e-3} | HARD_TIP)
    given = drive(150.0, 38.4e3, phase_deg=0.0)
    # the coarse step alone has the periodic motion, and no time averages
    (state,) = steady_states([Point.of(motor, given, speed=0.0)], accuracy=None)
    assert state.separated == 0.0
    assert state.instability == "period doubling"
    run = pr.simulate_averaged(motor, given, 20.0 * motor.decay_s, speed=0.0)
    assert run.separated[-1] == 0.0
    for found in (run, pr.state_space(motor, given)):
        assert any("is unstable (period doubling" in caution for caution in found.cautions)


# --- time averages of stable and unstable motions ---


UNINTENDED = pr.load_motor("andersen2002-unintended-mode")
DRIVE = pr.default_drive(UNINTENDED).updated({"frequency": 46e3})
# the contact of this motor moves quasi-periodically at 100 V
RESTLESS = UNINTENDED.updated({
    "contact.friction": 0.24,
    "contact.normal_stiffness_n_per_m15": 1.2 * UNINTENDED.contact.normal_stiffness_n_per_m15,
})  # fmt: skip
STALL = 7.385e-3  # N·m at stall: validation/records/unstable.jsonl has 7.3846 mN·m of a long run


@pytest.mark.parametrize("speed", [2.0, None])
def test_the_time_average_of_a_stable_motion_is_its_mean(speed: float | None) -> None:
    changes = {f"modes.{at}.damping_n_s_per_m": 5.0 * one.damping_n_s_per_m for at, one in enumerate(UNINTENDED.modes)}
    motor = UNINTENDED.updated(changes | {"mount.damping_n_s_per_m": 500.0, "rotor.inertia_kg_m2": 1e-7})
    (state,) = steady_states([Point.of(motor, DRIVE, speed=speed)])
    assert state.stable
    assert state.solution is not None
    mean, error = time_averages({7: state.solution}, PeriodMap(DRIVE.period, 80), 1e-3)[0][7]
    radius, friction = motor.rotor.radius_m, motor.contact.friction * motor.contact.preload_n
    assert radius * mean["friction"] == pytest.approx(state.torque_n_m, abs=2e-3 * radius * friction)
    assert mean["speed"] == pytest.approx(state.speed_rad_s, rel=2e-3)
    assert mean["power_a"] == pytest.approx(state.power_a_w, rel=2e-3)
    assert error < 2e-3 * friction


@pytest.mark.soak  # each average takes 10 to 20 s of CPU time
def test_every_analysis_has_the_time_average_of_an_unstable_motion() -> None:
    for source in (DRIVE, pr.Driver(kind="ideal", voltage=100.0, frequency=46e3, phase_deg=180.0)):
        state = pr.steady_state(RESTLESS, source, speed=0.0)
        assert (state.stable, state.reached, state.determined, state.method) == (False, True, True, "time average")
        assert state.largest_multiplier == pytest.approx(1.0039, abs=1e-4)
        assert abs(state.torque_n_m - STALL) < state.torque_error_n_m < 2e-5
        assert "Its values are time averages of the motor that runs from rest." in state.cautions
    points = pr.working_points(RESTLESS, DRIVE, over={"drive.voltage": [60.0, 100.0]}, speed=0.0)
    assert points["torque_n_m"].values[1] == pytest.approx(STALL, abs=float(points["torque_error_n_m"][1]))
    assert "1 of 2 points have an unstable periodic motion: their values are time averages." in points.cautions
