# SPDX-License-Identifier: GPL-3.0-or-later
"""The random cases of the soak: what is drawn is valid, and motors that once failed, by their numbers."""

import pytest

from validation.soak import SEED, case, outcome_of


@pytest.mark.parametrize(
    "index",
    [
        346,  # a fit of the admittance diverged to an infinite quality factor
        558,
        pytest.param(817, marks=pytest.mark.soak),  # the steps of ngspice became 1e-8 of the longest
    ],
)
def test_a_case_that_failed_gives_a_result_or_an_error_that_names_its_cause(index: int) -> None:
    outcome = outcome_of(case(SEED, index), index)
    assert outcome.kind == ("simulation error" if index == 817 else "result"), outcome.said


@pytest.mark.parametrize("index", range(6))
def test_drivers_and_trackers_are_drawn_beside_motors(index: int) -> None:
    assert case(SEED, index, "electronics").question in ("drive_report", "track")
