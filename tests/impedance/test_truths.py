# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of one spectrum of each class whose truth is known; :mod:`validation.fits` has 60 of each."""

from __future__ import annotations

import pytest

from validation import fits


@pytest.mark.parametrize("kind", fits.CLASSES)
def test_a_spectrum_of_each_class_has_the_arms_and_the_values_of_its_truth(kind: str) -> None:
    found = fits.outcome(f"{kind} 0")
    assert found["arms"] == found["true_arms"]
    assert found["leads"] == (kind in fits.BEHIND_LEADS)
    assert max(map(abs, found["deviations"])) < 4.0  # 1 of 16,000 values is farther off
