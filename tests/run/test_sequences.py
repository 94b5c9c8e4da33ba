# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolation and recursion over the points of a run, against scipy."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from pyspice_runner.run.waveforms import interpolated
from pyspice_runner.run.window import recursion


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
