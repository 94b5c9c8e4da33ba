# SPDX-License-Identifier: GPL-3.0-or-later
"""The recorded study of random motors, and its table in docs/calibrate.md."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests import calibration_study

PAGE = Path(__file__).parents[1] / "docs" / "calibrate.md"


def test_the_page_has_the_table_of_the_recorded_study() -> None:
    recorded = json.loads(calibration_study.RECORD.read_text(encoding="utf-8"))
    summary = calibration_study.summary(recorded["cases"])
    assert calibration_study.table(summary) in PAGE.read_text(encoding="utf-8")
    for subject, found in summary.items():
        indices = sorted(case["index"] for case in recorded["cases"] if case["subject"] == subject)
        assert indices == list(range(found["cases"])), subject  # the first ones: none was left out


@pytest.mark.soak
def test_a_case_of_the_study_comes_out_as_recorded() -> None:
    recorded = json.loads(calibration_study.RECORD.read_text(encoding="utf-8"))["cases"]
    before = next(case for case in recorded if (case["subject"], case["index"]) == ("truth", 0))
    now = calibration_study.outcome("truth", 0)
    for path, (value, error, *_) in before["parameters"].items():
        if path not in before["named"]:
            # the search ends within 0.3 standard errors
            assert abs(now["parameters"][path][0] - value) < 0.6 * error, path
