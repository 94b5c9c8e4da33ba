# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of one spectrum of each class whose truth is known; :mod:`validation.fits` has more of each."""

import pytest

import pyspice_runner as pr
from validation import fits


@pytest.mark.parametrize("kind", fits.CLASSES)
def test_a_spectrum_of_each_class_has_the_arms_and_the_values_of_its_truth(kind: str) -> None:
    found = fits.outcome(f"{kind} 0")
    assert found["arms"] == found["true_arms"]
    assert found["leads"] == (kind in fits.BEHIND_LEADS)
    assert max(map(abs, found["deviations"])) < 4.0  # 1 of 16,000 values is farther off


def test_two_modes_are_found_though_one_arm_settles_between_them() -> None:
    case = fits.draw("two close modes", 144, seed=42006)  # 2.4 bandwidths apart
    found = pr.fit_spectrum(pr.Spectrum.from_admittance(case["f"], case["measured"]))
    assert [arm.inductance_h for arm in found.arms] == pytest.approx(case["arms"][:, 1].tolist(), rel=2e-3)
