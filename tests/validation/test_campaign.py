# SPDX-License-Identifier: GPL-3.0-or-later
"""The harness of the validation campaigns."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from validation import campaign
from validation.campaign import Campaign


def outcome(index: int) -> dict[str, Any] | None:
    """The square of an odd number; an even one has none."""
    return {"square": index**2} if index % 2 else None


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {"cases": len(record), "sum": sum(one["square"] for one in record)}


@pytest.fixture(autouse=True)
def records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(campaign, "RECORDS", tmp_path)
    return tmp_path


@pytest.mark.parametrize("workers", ["1", "2"])
def test_a_campaign_ends_with_the_number_of_cases_and_writes_their_summary(records: Path, workers: str) -> None:
    squares = Campaign("squares", outcome, summary)
    assert squares.main(["--count", "3", "--workers", workers]) == 0
    found = sorted(one["square"] for one in squares.cases())
    if workers == "1":
        assert found == [1, 9, 25]
    # with two workers a case may end before one that began earlier
    assert {one % 2 for one in found} == {1}
    assert json.loads((records / "squares.json").read_text()) == {"cases": 3, "sum": sum(found)}


def test_an_interrupted_campaign_goes_on_after_its_last_recorded_case() -> None:
    Campaign("squares", outcome, summary).main(["--count", "2"])
    calls = []
    Campaign("squares", lambda index: calls.append(index) or {"square": 0}, summary).main(["--count", "3"])  # type: ignore[func-returns-value]
    assert calls == [4]


def test_a_summary_that_does_not_pass_gives_the_exit_status_1() -> None:
    assert Campaign("squares", outcome, summary, lambda table: table["sum"] < 10).main(["--count", "3"]) == 1


def test_only_outcomes_that_count_end_a_campaign() -> None:
    large = Campaign("squares", outcome, summary, counts=lambda one: one["square"] > 10)
    large.main(["--count", "2"])
    assert [one["square"] for one in large.cases()] == [1, 9, 25, 49]


def test_one_case_is_shown_and_not_recorded(records: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert Campaign("squares", outcome, summary).main(["--case", "5"]) == 0
    assert '"square": 25' in capsys.readouterr().out
    assert list(records.iterdir()) == []
