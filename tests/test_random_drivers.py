# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of ``python -m tests.random_drivers``, and a small part of it run again."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest

from tests.random_drivers import RECORD, outcome, specification
from tests.records import read


def test_each_specification_of_the_record_ends_in_a_driver_that_works_or_in_a_reason() -> None:
    record = read(RECORD)
    assert [one["index"] for one in record] == list(range(len(record)))
    for one in record:
        assert asdict(specification(one["index"])).items() <= one.items()
        assert one["reason"]
        assert not one["reason"].startswith("failed: ")
    page = (Path(__file__).parents[1] / "docs" / "drive.md").read_text(encoding="utf-8")
    assert f"Of {len(record)}, {sum(one['feasible'] for one in record)} end in parts" in page


@pytest.mark.soak
@pytest.mark.parametrize("index", range(0, 100, 10))
def test_a_specification_of_the_record_comes_out_as_recorded(index: int) -> None:
    assert outcome(specification(index))[0] == read(RECORD)[index]["feasible"]
