# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of ``python -m tests.random_steady``, and a small part of it run again."""

from __future__ import annotations

from collections import Counter

import pytest

from tests import random_steady
from tests.records import read


def test_no_steady_state_of_the_record_differs_from_settling_or_from_a_long_run() -> None:
    record = read(random_steady.RECORD)
    found = [one for one in record if one["method"] in random_steady.FOUND]
    assert len(record) >= 200
    assert not [one for one in found if one["verdict"] in ("differs", "leaves")]
    methods = Counter(one["method"] for one in record)
    assert methods["not found"] + methods["failed"] <= 0.05 * (len(record) - methods["refused"])


@pytest.mark.soak
def test_cases_of_the_record_come_out_as_recorded() -> None:
    agreeing = [one for one in read(random_steady.RECORD) if one["verdict"] == "agrees"]
    for one in agreeing[:5]:
        again = random_steady.outcome(one["index"])
        assert again is not None
        assert again["verdict"] in ("agrees", "stays"), one["index"]


@pytest.mark.soak
def test_a_turning_shaft_that_a_soft_tip_follows_has_no_steady_state_that_sticks() -> None:
    """The tip of case 219 follows it for some 1e5 periods, by 4.5 µm in each, a tenth of the limit of stick."""
    found = random_steady.outcome(219)
    assert found is not None
    assert found["method"] not in random_steady.FOUND
