# SPDX-License-Identifier: GPL-3.0-or-later
"""A small part of ``python -m tests.random_runs``, and a check that it can fail."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pyspice_runner.run import accuracy
from tests import random_runs
from tests.selection import mostly

# one worker keeps all tests that compile the reference integrator
pytestmark = pytest.mark.xdist_group("reference")

SEED = 20
SHORT = 800.0  # steps


def short(law: str | None) -> random_runs.Case:
    index = next(index for index in range(100) if random_runs.case(SEED, index).law == law)
    return replace(random_runs.case(SEED, index), steps=SHORT)


@pytest.mark.parametrize("law", mostly(pytest.mark.soak, random_runs.LAWS, ["spring-slider", "coulomb"]))
def test_random_runs_keep_their_accuracy(law: str | None) -> None:
    default, asked = random_runs.outcomes(short(law), 0)
    assert default.kind in ("kept", "said")
    assert asked.kind == "kept"


def test_an_estimate_that_is_too_small_counts_as_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accuracy, "_distance", lambda *_: 1e-9)
    coarse = replace(short("spring-slider"), accuracy=1e-4)
    reference = random_runs.exact(coarse)
    # the step that the accuracy asks for is taken without a second trial, because the estimate is passed at once
    monkeypatch.setattr("pyspice_runner.run.simulate.points_per_period", lambda _: 40.0)
    found = random_runs._outcome(coarse, 0, 1e-4, reference, 0.0)
    assert found.kind == "broken"
    assert not random_runs.passes(random_runs.summary([found], SEED))


@pytest.mark.parametrize(
    ("error", "change", "said", "kind"),
    [
        (0.009, 1e-6, False, "kept"),
        (0.011, 1e-6, True, "said"),
        (0.011, 1e-6, False, "broken"),
        (0.011, 0.002, False, "chaotic"),
    ],
)
def test_a_run_is_judged_by_its_error_and_by_what_it_says(error: float, change: float, said: bool, kind: str) -> None:
    assert random_runs.judged(error, 0.01, change, said=said) == kind
