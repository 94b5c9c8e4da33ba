# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaging window, whether a mean has settled, and sequences of points: against closed forms and scipy."""

from math import exp, inf, pi

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

import pyspice_runner as pr
from pyspice_runner.run.waveforms import interpolated
from pyspice_runner.run.window import Window, change_to_come, recursion

TIME = np.linspace(0.0, 100.0, 100 * 128 + 1)
RIPPLE = 0.3 * np.sin(2.0 * pi * TIME + 0.4)


@pytest.mark.parametrize("time_constant", [5.0, 20.0, 50.0, 100.0])
def test_the_rest_of_an_exponential_approach_is_extrapolated(time_constant: float) -> None:
    values = 2.0 * (1.0 - np.exp(-TIME / time_constant)) + RIPPLE
    rest = 2.0 * exp(-100.0 / time_constant)
    found = change_to_come(TIME, values, 1.0)
    assert found >= rest
    if time_constant > 30.0:  # a faster approach is judged by its last change, which is more than the rest
        # the mean over the last 20 periods lags behind the end by half of them
        assert found == pytest.approx(rest * exp(10.0 / time_constant), rel=0.02)


def test_a_ripple_about_a_constant_has_settled_and_a_steady_rise_has_not() -> None:
    assert change_to_come(TIME, 2.0 + RIPPLE, 1.0) < 1e-9
    assert change_to_come(TIME, 0.01 * TIME + RIPPLE, 1.0) > 1.0


def test_a_mean_that_turns_just_at_the_end_has_not_settled_if_a_mode_still_decays() -> None:
    """The last two means of a decaying oscillation are equal, on both sides of its first maximum."""
    decay, turn = 50.0, 2.0 * pi / 180.0
    values = 1.0 - np.exp(-TIME / decay) * np.cos(turn * TIME)
    rest = exp(-2.0) * abs(np.cos(100.0 * turn))  # at the end
    assert change_to_come(TIME, values, 1.0) < 0.3 * rest
    assert change_to_come(TIME, values, 1.0, decay) > rest


def test_a_run_shorter_than_four_periods_or_the_decay_of_a_mode_cannot_tell() -> None:
    short = TIME <= 3.0
    assert change_to_come(TIME[short], RIPPLE[short], 1.0) == inf
    assert change_to_come(TIME, RIPPLE, 1.0, decay_s=101.0) == inf


@pytest.mark.parametrize(("end", "periods"), [(100.0, 20), (7.3, 7), (0.4, 0)])
def test_the_window_has_whole_periods_at_the_end(end: float, periods: int) -> None:
    time = TIME[end >= TIME]
    window = Window(time, 1.0)
    assert window.periods == periods
    assert window.length == pytest.approx(periods or time[-1])
    if periods:
        assert window.mean(RIPPLE[: len(time)]) == pytest.approx(0.0, abs=1e-12)


def test_a_run_in_mid_spin_up_says_that_its_means_are_not_settled() -> None:
    motor = pr.load_motor("andersen2002").updated({"mount": None, "rotor.inertia_kg_m2": 1e-8})
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)
    early, late = (pr.simulate(motor, drive, duration=duration, step=2e-7) for duration in (2e-4, 5e-3))
    assert early.settled is False
    assert late.to_come["mean_rotor_speed_rad_s"] < 0.02
    assert early.remark("mean_rotor_speed_rad_s") == ", not settled"
    assert early.to_dict()["settled"] is False
    assert "not settled" in early.summary()["mean rotor speed"]
    held = pr.simulate(motor, drive, duration=2e-4, speed=1.0)
    assert "mean_rotor_speed_rad_s" not in held.to_come


# --- interpolation and recursion over the points of a run, against scipy ---


@pytest.mark.parametrize("points", [12, 24])
def test_a_sine_is_interpolated_at_least_as_well_as_by_a_spline(points: int) -> None:
    time = np.linspace(0.0, 3.0, 3 * points + 1)
    at = np.linspace(0.5, 2.5, 1001)  # a spline is worse at the ends
    values = np.vstack([np.sin(2.0 * np.pi * time), np.cos(2.0 * np.pi * time)])
    exact = np.vstack([np.sin(2.0 * np.pi * at), np.cos(2.0 * np.pi * at)])
    error = np.abs(interpolated(time, values, at) - exact).max()
    assert error <= np.abs(CubicSpline(time, values, axis=1)(at) - exact).max()


def test_a_polynomial_of_the_fifth_degree_is_exact_between_uneven_points_and_beyond_them() -> None:
    time = np.array([0.0, 0.1, 0.3, 0.4, 0.8, 0.9, 1.3, 1.4])
    for at in (-0.05, 0.05, 0.35, 1.0, 1.45):
        # the rounding of six terms of the size of 1
        assert float(interpolated(time, time**5 - time, at)) == pytest.approx(at**5 - at, abs=1e-13)


def test_few_points_are_interpolated_by_a_polynomial_of_lower_degree() -> None:
    assert float(interpolated(np.array([0.0, 1.0]), np.array([1.0, 3.0]), 0.25)) == pytest.approx(1.5)


@pytest.mark.parametrize("count", [1, 2, 7, 100, 1001])
def test_a_recursion_is_that_of_a_filter(count: int) -> None:
    terms = np.random.default_rng(1).normal(size=count)
    found = recursion(np.full(count, 0.99), terms, 0.0)
    assert found == pytest.approx(np.concatenate(([0.0], lfilter([1.0], [1.0, -0.99], terms))), abs=1e-12)


def test_a_recursion_follows_factors_that_change() -> None:
    rng = np.random.default_rng(2)
    factors, terms = rng.uniform(0.0, 1.0, 50), rng.normal(size=50)
    expected = [2.0]
    for factor, term in zip(factors, terms, strict=True):
        expected.append(factor * expected[-1] + term)
    assert recursion(factors, terms, 2.0) == pytest.approx(expected, abs=1e-12)
