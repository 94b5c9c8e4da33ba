# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests themselves rely on."""

import pytest

from tests import quantities


@pytest.mark.xdist_group("together")
def test_tests_that_share_a_fixture_stay_on_one_worker(request: pytest.FixtureRequest) -> None:
    """Otherwise every worker pays for every costly fixture; pytest-xdist groups by what it appends to the name."""
    if request.config.getoption("loadgroup", default=False):
        assert request.node.nodeid.endswith("@together")


# --- the comparison of two trees, python -m tests.quantities ---


DOCUMENT = {
    "torque_n_m": 0.06, "stable": True, "method": "newton", "curve": {"speed_rad_s": [0.0, 1.0, 2.0, 3.0, 4.0]},
    "solver_seconds": 0.3, "pairs": [[1, 2], [3, 4]],
}  # fmt: skip


def test_the_quantities_of_a_result_are_its_numbers_without_those_of_the_solver() -> None:
    assert dict(quantities.numbers(DOCUMENT)) == {
        ".torque_n_m": 0.06, ".curve.speed_rad_s[0]": 0.0, ".curve.speed_rad_s[2]": 2.0, ".curve.speed_rad_s[4]": 4.0,
        ".pairs[0][0]": 1.0, ".pairs[0][1]": 2.0, ".pairs[1][0]": 3.0, ".pairs[1][1]": 4.0,
    }  # fmt: skip


def test_a_motor_that_runs_twice_gives_equal_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    """A difference between two trees then comes from the code."""
    monkeypatch.setattr(quantities, "OF_A_MOTOR", ("steady {} --speed 3 --no-audit", "simulate {} --duration 1e-4"))
    monkeypatch.setattr(quantities, "OTHERS", ())
    first, second = (quantities.measured(("andersen2002",)) for _ in range(2))
    assert len(first) > 60
    assert first == second
    assert not any(value for name, value in first.items() if name.endswith("exit status"))
