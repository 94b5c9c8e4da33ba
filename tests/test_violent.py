# SPDX-License-Identifier: GPL-3.0-or-later
"""A small part of ``python -m tests.violent``, and a check that it can fail."""

from __future__ import annotations

import json
from typing import Any

import pytest

from pyspice_runner.run import simulate
from pyspice_runner.run.accuracy import Errors
from tests import violent

# one worker keeps all tests that compile the reference integrator
pytestmark = pytest.mark.xdist_group("reference")

SEED = 20
(NAME, NAMED), *_ = violent.named().items()


def test_a_speed_that_the_accuracy_of_the_tip_does_not_cover_is_said_to_be_inaccurate() -> None:
    found = violent.outcome(NAMED, NAME)
    assert found.tip_error is not None
    assert found.stated_error is not None
    assert found.error is not None
    assert found.tip_error < 0.005 < found.stated_error  # 0.005 is asked for
    assert "the mean rotor speed" in found.said
    assert found.error <= found.stated_error  # 0.2 % and 2 %


def test_a_wrong_estimate_of_the_error_counts_as_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(violent, "ALLOWED", 1e-3)  # the error is 2e-3
    monkeypatch.setattr(simulate.CoarserRuns, "errors", lambda *_: Errors(1e-4, 0.0, 0.0, 0.0))
    found = violent.outcome(NAMED, NAME)
    assert found.kind == "silent"
    assert not violent.passes(violent.summary([found], SEED))


@pytest.mark.parametrize("index", [0, pytest.param(1, marks=pytest.mark.soak)])
def test_a_motor_that_hammers_is_within_one_per_cent_or_says_that_it_is_not(index: int) -> None:
    subject = violent.case(SEED, index)
    found = violent.outcome(subject, str(index))
    assert found.reference_change <= violent.CONVERGED
    assert found.kind in ("within 1 %", "said")


@pytest.mark.parametrize(
    ("error", "change", "said", "kind"),
    [
        (0.009, 1e-6, False, "within 1 %"),
        (0.011, 1e-6, True, "said"),
        (0.011, 1e-6, False, "silent"),
        (0.009, 0.01, True, "chaotic, said"),
        (0.011, 0.01, False, "chaotic, silent"),
    ],
)
def test_a_run_is_judged_by_its_error_and_by_what_it_says(error: float, change: float, said: bool, kind: str) -> None:
    assert violent.judged(error, change, said=said) == kind


def test_the_last_run_found_no_silent_case() -> None:
    found: dict[str, Any] = json.loads(violent.RESULT.read_text(encoding="utf-8"))
    assert found["cases"] == sum(found["kinds"].values())
    assert violent.passes(found)
