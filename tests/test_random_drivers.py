# SPDX-License-Identifier: GPL-3.0-or-later
"""Each of many random specifications ends in parts that were simulated and work, or in a reason."""

from __future__ import annotations

import pytest

from tests.random_drivers import outcome, specification


@pytest.mark.soak
@pytest.mark.parametrize("index", range(100))
def test_a_random_specification_ends_in_a_driver_that_works_or_in_a_reason(index: int) -> None:
    assert outcome(specification(index))
