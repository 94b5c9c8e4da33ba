# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of ``python -m tests.random_averaged``, and a small part of it run again."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.random_averaged import ALLOWED, RECORD, outcome, sentences
from tests.records import read

PAGE = Path(__file__).parents[1] / "docs" / "averaged.md"


def test_each_error_above_two_per_cent_of_the_friction_torque_is_told() -> None:
    record = read(RECORD)
    assert [one["index"] for one in record] == list(range(len(record)))
    assert len(record) >= 60
    for one in record:
        assert not one["trusted"] or abs(one["steady_error"] or 0.0) <= ALLOWED
        assert not one["run_up_trusted"] or abs(one["run_up_error"]) <= ALLOWED


def test_the_page_says_what_the_record_has() -> None:
    page = " ".join(PAGE.read_text(encoding="utf-8").split())
    for sentence in sentences(read(RECORD)):
        assert sentence in page


@pytest.mark.soak
@pytest.mark.parametrize("index", range(0, 60, 12))
def test_a_drive_of_the_record_comes_out_as_recorded(index: int) -> None:
    again, then = outcome(index), read(RECORD)[index]
    assert again["trusted"] == then["trusted"]
    for name in ("steady_error", "run_up_error"):  # the error of a settled run
        assert again[name] == (None if then[name] is None else pytest.approx(then[name], abs=1e-4))
