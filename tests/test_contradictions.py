# SPDX-License-Identifier: GPL-3.0-or-later
"""A small part of ``python -m tests.contradictions``, checks that it can fail, and its record."""

from __future__ import annotations

import json
from typing import Any

import pytest

import pyspice_runner as pr
from tests import contradictions

CASE = contradictions.Case(
    (motor := pr.load_motor("andersen2002")).updated({"limits": None}), pr.default_drive(motor), "spring-slider", 5.0
)


@pytest.mark.parametrize(
    "names",
    [("steady", "speed-torque", "averaged"), pytest.param(tuple(contradictions.POINTS), marks=pytest.mark.soak)],
)
def test_the_analyses_agree_on_the_papers_motor(names: tuple[str, ...]) -> None:
    answers = {name: contradictions.POINTS[name](CASE) for name in names}
    found = list(contradictions.differences(CASE, answers))
    assert {one["kind"] for one in found} == {"agree"}
    assert len(found) >= 3 * (len(names) - 1)


def compared(torque: float, doubts: list[str]) -> list[dict[str, Any]]:
    friction = CASE.scales["torque_n_m"]
    one = contradictions.Answer({"torque_n_m": 0.5 * friction}, {"torque_n_m": 0.02 * friction})
    other = contradictions.Answer({"torque_n_m": torque * friction}, doubts=doubts)
    return list(contradictions.differences(CASE, {"one": one, "other": other}))


def test_a_difference_beyond_one_per_cent_and_the_stated_error_must_be_explained() -> None:
    assert [one["kind"] for one in compared(0.529, [])] == ["agree"]
    assert [one["kind"] for one in compared(0.531, [])] == ["contradiction"]
    (found,) = compared(0.531, ["settled"])
    assert (found["kind"], found["said"]) == ("explained", ["other: settled"])


def test_the_record_has_200_cases_and_no_contradiction() -> None:
    record = json.loads(contradictions.RESULT.read_text(encoding="utf-8"))
    assert record["cases"] >= contradictions.COUNT
    assert record["kinds"]["contradiction"] == len(record["contradictions"]) == 0
    assert record["kinds"]["agree"] > 5 * record["cases"]
