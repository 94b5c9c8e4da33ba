# SPDX-License-Identifier: GPL-3.0-or-later
"""Hidden variants of the flagship and their calibrations: how they are drawn and judged, and the record."""

import json
from typing import Any

import pytest

from validation.hidden import CAMPAIGN, COUNT, GAPS, MODES, hidden, outcome, passes, summary

PATHS = [f"p{number}" for number in range(20)]


def case(index: int, *, outside: int = 1, value: float = 1.5, warnings: tuple[str, ...] = ()) -> dict[str, Any]:
    """A case whose parameters are 1 ± 0.5; some values are outside of their intervals."""
    rows = {path: [value if place < outside else 1.1, 0.5, 0.9, 1.2, 1.0] for place, path in enumerate(PATHS)}
    for path in PATHS[:outside]:
        rows[path][2] = 1.3
    return {"index": index, "warnings": list(warnings), "processor_s": 1.0, "parameters": rows}


def test_gaps_grow_from_case_to_case_and_a_seed_draws_the_same_motor() -> None:
    gaps = []
    for index in range(COUNT):
        motor, values = hidden(index)
        first, second = (motor.modes[place].frequency_hz for place in MODES)
        assert values["contact.friction"] == motor.contact.friction
        gaps.append(second - first)
    assert GAPS[0] < min(gaps) < max(gaps) < GAPS[1]
    assert gaps == sorted(gaps)
    assert hidden(3)[1] == hidden(3)[1] != hidden(3, seed=1)[1]


def test_too_few_or_too_many_intervals_and_a_far_value_without_a_caution_fail() -> None:
    assert passes(summary([case(0), case(1)]))
    assert not passes(summary([case(0, outside=0)]))
    assert not passes(summary([case(0, outside=3)]))
    far = summary([case(0, value=4.0)])
    assert far["far_without_a_caution"] == ["0: p0"]
    assert not passes(far)
    assert passes(summary([case(0, value=4.0, warnings=("The data do not identify p0: …",))]))
    assert not passes(summary([case(0), {"index": 1, "failed": "no steady state"}]))
    assert not passes(summary([]))


def test_the_record_shows_what_it_must() -> None:
    record = CAMPAIGN.cases()
    assert sorted(one["index"] for one in record) == list(range(COUNT))
    found = summary(record)
    assert found == json.loads(CAMPAIGN.record.with_suffix(".json").read_text(encoding="utf-8"))
    assert passes(found)


@pytest.mark.soak
@pytest.mark.parametrize("index", [0, 15])
def test_a_case_of_the_record_comes_out_again(index: int) -> None:
    (then,) = (one for one in CAMPAIGN.cases() if one["index"] == index)
    again = outcome(index)
    for path, (value, error, *_) in then["parameters"].items():
        assert again["parameters"][path][0] == pytest.approx(value, abs=0.1 * error), path
