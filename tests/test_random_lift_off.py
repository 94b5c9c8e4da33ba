# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of ``python -m tests.random_lift_off``."""

from __future__ import annotations

import pytest

from tests.random_lift_off import outcome

FIRST = 60  # of the cases; a third of them lift off for 5 to 80 % of the period


@pytest.mark.soak
def test_newtons_method_finds_the_steady_states_of_random_motors_that_lift_off() -> None:
    counted = [found for found in map(outcome, range(FIRST)) if found["counts"]]
    assert len(counted) >= 12
    newton = [found for found in counted if found["method"] in ("newton", "damped")]
    others = [found for found in counted if found not in newton and (found["stable"] or found["periodic"])]
    assert len(newton) >= 9 * len(others)
    assert not [found["index"] for found in counted if found["verdict"] == "leaves"]
