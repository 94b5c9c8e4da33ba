# SPDX-License-Identifier: GPL-3.0-or-later
"""The records of campaigns: their summaries pass, what they must not pass, and cases of them again."""

import json
from types import ModuleType
from typing import Any

import pytest

import pyspice_runner as pr
from validation import contacts, hidden, loops, soak, trust

CASES = {contacts: contacts.keys(), hidden: range(hidden.COUNT), loops: loops.CASES, trust: range(len(trust.TABLE))}


def recorded(of: ModuleType, index: object) -> dict[str, Any]:
    (then,) = (one for one in of.CAMPAIGN.cases() if one["index"] == index)
    return then


@pytest.mark.parametrize("of", CASES, ids=lambda of: of.__name__)
def test_a_record_is_complete_has_its_summary_and_passes(of: ModuleType) -> None:
    record = of.CAMPAIGN.cases()
    indices = {one["index"] for one in record}
    assert len(indices) == len(record)
    assert indices == {*CASES[of]} or (of is trust and indices > {*CASES[of]})  # which has cases beyond its table
    table = of.summary(record)
    assert table == json.loads(of.CAMPAIGN.record.with_suffix(".json").read_text(encoding="utf-8"))
    assert of.passes(table)


# --- loops designed without options, in the full motor ---


def test_a_margin_off_by_more_than_three_degrees_does_not_pass() -> None:
    assert not loops.passes(loops.summary([{**one, "margin_error_deg": 3.1} for one in loops.CAMPAIGN.cases()]))


@pytest.mark.parametrize("name", loops.MOTORS)
def test_the_recorded_loops_are_what_is_designed(name: str) -> None:
    motor = pr.load_motor(loops.MOTORS[name])
    loop = pr.control_loop(motor, pr.default_drive(motor), quantity="speed")
    assert loop.gains == pytest.approx(recorded(loops, f"{name} speed")["gains"], rel=1e-3)


@pytest.mark.soak
def test_a_recorded_loop_is_what_is_measured() -> None:
    then, again = recorded(loops, "bimodal40 speed"), loops.outcome("bimodal40 speed")
    assert again["crossover_error"] == pytest.approx(then["crossover_error"], abs=2e-3)
    assert again["margin_error_deg"] == pytest.approx(then["margin_error_deg"], abs=0.2)


# --- stated against true errors of the averaged motor ---


def test_an_error_above_the_stated_one_does_not_pass() -> None:
    record = trust.CAMPAIGN.cases()
    right = [one for one in record if all(value >= one["true"][name] for name, value in one.get("stated", {}).items())]
    wrong = {**record[0], "index": len(record), "unknown": ""}
    wrong |= {"stated": {"rotor_speed_rad_s": 0.01}, "true": {"rotor_speed_rad_s": 0.02}}
    assert min(one["minimum"] for one in trust.summary(right)["all"]["stated_over_true"].values()) >= 1.0
    assert not trust.passes(trust.summary([*right, wrong]))


def test_cases_beyond_the_table_are_drawn_from_both_motors() -> None:
    drawn = [trust.case(index) for index in range(len(trust.TABLE), len(trust.TABLE) + 12)]
    assert {one[0] == trust.FLAGSHIP for one in drawn} == {True, False}
    assert len({one[4] for one in drawn}) > 2
    assert trust.case(20) == trust.case(20)


@pytest.mark.soak
@pytest.mark.parametrize("index", [1, 8, 15])
def test_a_recorded_error_is_what_is_measured(index: int) -> None:
    then, again = recorded(trust, index), trust.outcome(index)
    for kind in ("stated", "true"):
        assert again[kind] == pytest.approx(then[kind], rel=0.05)


# --- hidden variants of the flagship and their calibrations ---

PATHS = [f"p{number}" for number in range(20)]


def passed(*cases: dict[str, Any]) -> bool:
    return hidden.passes(hidden.summary(cases))


def case(index: int, *, outside: int = 1, value: float = 1.5, warnings: tuple[str, ...] = ()) -> dict[str, Any]:
    """A case whose parameters are 1 ± 0.5; some values are outside of their intervals."""
    rows = {path: [value if place < outside else 1.1, 0.5, 0.9, 1.2, 1.0] for place, path in enumerate(PATHS)}
    for path in PATHS[:outside]:
        rows[path][2] = 1.3
    return {"index": index, "warnings": list(warnings), "processor_s": 1.0, "parameters": rows}


def test_gaps_grow_from_case_to_case_and_a_seed_draws_the_same_motor() -> None:
    gaps = []
    for index in range(hidden.COUNT):
        motor, values = hidden.hidden(index)
        first, second = (motor.modes[place].frequency_hz for place in hidden.MODES)
        assert values["contact.friction"] == motor.contact.friction
        gaps.append(second - first)
    assert hidden.GAPS[0] < min(gaps) < max(gaps) < hidden.GAPS[1]
    assert gaps == sorted(gaps)
    assert hidden.hidden(3)[1] == hidden.hidden(3)[1] != hidden.hidden(3, seed=1)[1]


def test_too_few_or_too_many_intervals_and_a_far_value_without_a_caution_fail() -> None:
    assert passed(case(0), case(1))
    assert not passed(case(0, outside=0))
    assert not passed(case(0, outside=3))
    assert hidden.summary([case(0, value=4.0)])["far_without_a_caution"] == ["0: p0"]
    assert not passed(case(0, value=4.0))
    assert passed(case(0, value=4.0, warnings=("The data do not identify p0: …",)))
    assert not passed(case(0), {"index": 1, "failed": "no steady state"})
    assert not passed()


@pytest.mark.soak
@pytest.mark.parametrize("index", [0, 15])
def test_a_recorded_calibration_comes_out_again(index: int) -> None:
    again = hidden.outcome(index)["parameters"]
    for path, (value, error, *_) in recorded(hidden, index)["parameters"].items():
        assert again[path][0] == pytest.approx(value, abs=0.1 * error), path


# --- the random cases of the soak ---


@pytest.mark.parametrize(
    "index",
    [
        346,  # a fit of the admittance diverged to an infinite quality factor
        558,
        pytest.param(817, marks=pytest.mark.soak),  # the steps of ngspice became 1e-8 of the longest
    ],
)
def test_a_case_that_failed_gives_a_result_or_an_error_that_names_its_cause(index: int) -> None:
    outcome = soak.outcome_of(soak.case(soak.SEED, index), index)
    assert outcome.kind == ("simulation error" if index == 817 else "result"), outcome.said


@pytest.mark.parametrize("index", range(6))
def test_drivers_and_trackers_are_drawn_beside_motors(index: int) -> None:
    assert soak.case(soak.SEED, index, "electronics").question in ("drive_report", "track")
