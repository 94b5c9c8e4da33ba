# SPDX-License-Identifier: GPL-3.0-or-later
"""Stated against true errors of the averaged motor: the record, and cases of it again."""

import json

import pytest

from validation.trust import CAMPAIGN, FLAGSHIP, TABLE, case, outcome, passes, summary


def test_no_recorded_error_is_above_the_stated_one() -> None:
    assert passes(summary(CAMPAIGN.cases()))


def test_the_record_has_every_listed_case_and_an_error_above_the_stated_one_fails() -> None:
    record = CAMPAIGN.cases()
    assert {one["index"] for one in record} >= set(range(len(TABLE)))
    assert summary(record) == json.loads(CAMPAIGN.record.with_suffix(".json").read_text(encoding="utf-8"))
    right = [one for one in record if all(value >= one["true"][name] for name, value in one.get("stated", {}).items())]
    wrong = {**record[0], "index": len(record), "unknown": ""}
    wrong |= {"stated": {"rotor_speed_rad_s": 0.01}, "true": {"rotor_speed_rad_s": 0.02}}
    assert min(one["minimum"] for one in summary(right)["all"]["stated_over_true"].values()) >= 1.0
    assert not passes(summary([*right, wrong]))


def test_cases_beyond_the_table_are_drawn_from_both_motors() -> None:
    drawn = [case(index) for index in range(len(TABLE), len(TABLE) + 12)]
    assert {one[0] == FLAGSHIP for one in drawn} == {True, False}
    assert len({one[4] for one in drawn}) > 2
    assert case(20) == case(20)


@pytest.mark.soak
@pytest.mark.parametrize("index", [1, 8, 15])
def test_a_case_of_the_record_is_what_is_measured(index: int) -> None:
    (then,) = (one for one in CAMPAIGN.cases() if one["index"] == index)
    again = outcome(index)
    assert again["stated"] == pytest.approx(then["stated"], rel=0.05)
    assert again["true"] == pytest.approx(then["true"], rel=0.05)
