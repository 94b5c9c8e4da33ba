# SPDX-License-Identifier: GPL-3.0-or-later
from math import cos, pi

import pytest

from pyspice_runner.motor.numerics import root


@pytest.mark.parametrize("places", [(1.0, 2.0), (2.0, 1.0)])
def test_a_root_is_found_to_the_last_bit(places: tuple[float, float]) -> None:
    assert root(cos, *places) == pytest.approx(pi / 2, rel=3e-16)


def test_a_root_at_an_end_is_that_end() -> None:
    assert root(lambda x: x, 0.0, 1.0) == 0.0
    assert root(lambda x: x - 1.0, 0.0, 1.0) == 1.0


def test_a_tolerance_ends_the_search() -> None:
    tried: list[float] = []
    assert root(lambda x: tried.append(x) or x - 0.3, 0.0, 1.0, 1e-3) == pytest.approx(0.3, abs=1e-3)  # type: ignore[func-returns-value]
    assert len(tried) < 15
