# SPDX-License-Identifier: GPL-3.0-or-later
"""Loops designed without options in the full motor: the record, the designs again, and a case again."""

import json

import pytest

import pyspice_runner as pr
from validation.loops import CAMPAIGN, MOTORS, outcome, passes, summary


def test_the_recorded_loops_have_crossover_and_margin_of_the_design() -> None:
    record = CAMPAIGN.cases()
    table = summary(record)
    assert passes(table)
    assert table == json.loads(CAMPAIGN.record.with_suffix(".json").read_text(encoding="utf-8"))
    assert not passes(summary([{**one, "margin_error_deg": 3.1} for one in record]))


@pytest.mark.parametrize("name", MOTORS)
def test_the_recorded_loops_are_what_is_designed(name: str) -> None:
    motor = pr.load_motor(MOTORS[name])
    loop = pr.control_loop(motor, pr.default_drive(motor), quantity="speed")
    (then,) = (one for one in CAMPAIGN.cases() if one["index"] == f"{name} speed")
    assert loop.gains == pytest.approx(then["gains"], rel=1e-3)


@pytest.mark.soak
def test_a_case_of_the_record_is_what_is_measured() -> None:
    (then,) = (one for one in CAMPAIGN.cases() if one["index"] == "bimodal40 speed")
    again = outcome("bimodal40 speed")
    assert again["crossover_error"] == pytest.approx(then["crossover_error"], abs=2e-3)
    assert again["margin_error_deg"] == pytest.approx(then["margin_error_deg"], abs=0.2)
