# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of ``python -m tests.random_lift_off``."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.random_lift_off import outcome, read

ROOT = Path(__file__).resolve().parent.parent

FIRST = 60  # of the cases; a third of them lift off for 5 to 80 % of the period


@pytest.mark.soak
def test_newtons_method_finds_the_steady_states_of_random_motors_that_lift_off() -> None:
    counted = [found for found in map(outcome, range(FIRST)) if found["counts"]]
    assert len(counted) >= 12
    newton = [found for found in counted if found["method"] in ("newton", "damped")]
    others = [found for found in counted if found not in newton and (found["stable"] or found["periodic"])]
    assert len(newton) >= 9 * len(others)
    assert not [found["index"] for found in counted if found["verdict"] == "leaves"]


def test_the_record_shows_newtons_method_in_nine_of_ten_and_the_page_names_each_that_leaves() -> None:
    counted = [one for one in read() if one["counts"]]
    newton = [one for one in counted if one["method"] in ("newton", "damped") and one["stable"]]
    others = [one for one in counted if one not in newton and (one["stable"] or one.get("periodic"))]
    assert len(newton) >= 9 * len(others)
    page = (ROOT / "docs" / "steady_state.md").read_text(encoding="utf-8")
    assert f"Of {len(counted)} so far:" in page
    for left in (one["index"] for one in counted if one["verdict"].startswith("leaves")):
        assert f"case {left} leaves: its cause is open" in page
    assert f"| found by Newton's method from harmonic balance, stable | {len(newton)} |" in page
    assert f"though a long run is periodic | {len(others)} |" in page
