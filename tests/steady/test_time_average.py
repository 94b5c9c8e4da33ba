# SPDX-License-Identifier: GPL-3.0-or-later
"""Time averages: those of a stable motion are its means; those of unstable ones are what every analysis has."""

import pytest

import pyspice_runner as pr
from pyspice_runner.run.point import Point
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.settling import time_averages
from pyspice_runner.steady.steady import steady_states

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
    state = pr.steady_state(RESTLESS, DRIVE, speed=0.0)
    assert (state.stable, state.reached, state.determined, state.method) == (False, True, True, "time average")
    assert state.largest_multiplier == pytest.approx(1.0039, abs=1e-4)
    assert abs(state.torque_n_m - STALL) < state.torque_error_n_m < 2e-5
    assert "Its values are time averages of the motor that runs from rest." in state.cautions
    points = pr.working_points(RESTLESS, DRIVE, over={"drive.voltage": [60.0, 100.0]}, speed=0.0)
    assert points["torque_n_m"].values[1] == pytest.approx(STALL, abs=float(points["torque_error_n_m"][1]))
    assert "1 of 2 points have an unstable periodic motion: their values are time averages." in points.cautions
