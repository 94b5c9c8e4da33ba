# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests themselves rely on."""

import pytest


@pytest.mark.xdist_group("together")
def test_tests_that_share_a_fixture_stay_on_one_worker(request: pytest.FixtureRequest) -> None:
    """Otherwise every worker pays for every costly fixture; pytest-xdist groups by what it appends to the name."""
    if request.config.getoption("loadgroup", default=False):
        assert request.node.nodeid.endswith("@together")
