# SPDX-License-Identifier: GPL-3.0-or-later
"""The ladders of a constant loss tangent, against that loss tangent and the relation of Kramers and Kronig."""

from math import atan, pi

import numpy as np
import pytest
from numpy.typing import NDArray

from pyspice_runner.motor.dielectric import HIGH_HZ, LOW_HZ, Branch, lossy_capacitance

Complex = NDArray[np.complex128]


def admittance(branches: tuple[Branch, ...], frequency_hz: NDArray[np.float64]) -> Complex:
    s = 2j * pi * frequency_hz
    return np.asarray(sum(s * c / (1.0 + s * r * c) for r, c in branches))


@pytest.mark.parametrize("loss_tangent", [1e-6, 0.004, 0.02, 0.1, 0.5])
@pytest.mark.parametrize("band", [(LOW_HZ, HIGH_HZ), (20e3, 300e3), (1e2, 1e8)], ids=["motor", "narrow", "wide"])
def test_the_loss_tangent_is_constant_over_the_band(loss_tangent: float, band: tuple[float, float]) -> None:
    low, high = band
    frequency = np.geomspace(low, high, 401)
    y = admittance(lossy_capacitance(2.2e-9, loss_tangent, low_hz=low, high_hz=high), frequency)
    # what the ladder promises: 5 %
    assert y.real / y.imag == pytest.approx(loss_tangent, rel=0.05)
    # the constant-phase element of the same capacitance at the centre; the loss that the ladder lacks beyond its ends
    # and its ripple change the capacitance at the ends of the band by up to a quarter of the loss tangent
    delta = atan(loss_tangent)
    exact = 2.2e-9 * (frequency / (low * high) ** 0.5) ** (-2.0 * delta / pi)
    assert y.imag / (2.0 * pi * frequency) == pytest.approx(exact, rel=0.25 * loss_tangent)


def test_the_band_of_the_motor_needs_six_branches() -> None:
    assert len(lossy_capacitance(2e-9, 0.02)) == 6


def test_more_branches_approach_the_constant_phase_element() -> None:
    """Inside of the band, where the ends of the ladder are far, only the ripple is left: 2 / cosh(pi^2 / ln r)."""
    frequency = np.geomspace(3e4, 3e5, 101)
    for branches, spacing in ((5, 6.25e4**0.25), (6, 6.25e4**0.2), (9, 6.25e4**0.125)):
        y = admittance(lossy_capacitance(1.0, 0.01, branches=branches), frequency)
        ripple = 2.0 / np.cosh(pi**2 / np.log(spacing))
        worst = np.abs(y.real / y.imag / 0.01 - 1.0).max()
        assert worst < 1.02 * ripple + 2e-3  # + the ends, a factor of 75 and more away


def test_a_ladder_consists_of_positive_elements_and_is_passive() -> None:
    for loss_tangent in (1e-9, 0.02, 0.5):
        branches = lossy_capacitance(1e-9, loss_tangent)
        assert all(r > 0.0 and c > 0.0 for r, c in branches)
        assert (admittance(branches, np.geomspace(1e-3, 1e12, 301)).real > 0.0).all()


def test_without_loss_it_is_one_capacitance() -> None:
    assert lossy_capacitance(3e-9, 0.0) == ((0.0, 3e-9),)
    (_, fast), *slower = lossy_capacitance(3e-9, 1e-12)
    assert fast == pytest.approx(3e-9, rel=1e-11)
    assert sum(c for _, c in slower) < 3e-9 * 1e-10
