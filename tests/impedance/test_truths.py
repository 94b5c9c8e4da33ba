# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of spectra whose truth is known: arms, bias, coverage, and errors beside a fit that knows the model."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.impedance import truths


def judge(kind: str, found: dict[str, Any]) -> None:
    """Check a class: the limits are those that the fit is built for, in docs/impedance.md."""
    assert found["extra"] <= 3, kind
    assert found["missed"] == 0, kind
    assert 0.90 <= found["coverage"] <= 0.98, kind
    assert max(map(abs, found["bias_over_error"])) < 0.5, kind
    assert found["inductance_error_over_informed"] <= 1.5, kind


def test_the_recorded_fits_of_sixty_spectra_of_each_class_are_within_the_limits() -> None:
    recorded = json.loads(truths.RESULT.read_text(encoding="utf-8"))
    assert list(recorded) == list(truths.CLASSES)
    for kind, found in recorded.items():
        assert found["trials"] == truths.TRIALS
        judge(kind, found)
    assert truths.table(recorded) in truths.PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", truths.CLASSES)
def test_a_spectrum_of_each_class_has_the_arms_and_the_values_of_its_truth(kind: str) -> None:
    found = truths.trial(kind, 0)
    assert found["arms"] == found["true_arms"]
    assert found["leads"] == (kind in truths.BEHIND_LEADS)
    assert max(map(abs, found["deviations"])) < 4.0  # 1 of 16,000 values is farther off


@pytest.mark.soak
@pytest.mark.parametrize("kind", truths.CLASSES)
def test_sixty_spectra_of_each_class_are_within_the_limits(kind: str) -> None:
    judge(kind, truths.summary([truths.trial(kind, number) for number in range(truths.TRIALS)]))
