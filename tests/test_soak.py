# SPDX-License-Identifier: GPL-3.0-or-later
"""A small part of ``make soak``, and a check that a soak can fail."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pyspice_runner as pr
from pyspice_runner.motor.parameters import Contact, Mode
from pyspice_runner.run.recording import Recording
from pyspice_runner.run.waveforms import Waveforms
from tests import soak

SEED = 20
NUMBERS = [field for field in Contact.model_json_schema()["properties"].values() if field.get("type") == "number"]


@settings(max_examples=6, derandomize=True, deadline=None)
@given(index=st.integers(0, 10**6))
def test_a_random_motor_gives_a_result_that_passes_the_audit(index: int) -> None:
    found = soak.outcome(SEED, index)
    if found.kind == "simulation error":  # one in two hundred; an impact much harder than the preload
        assert "Use a step <=" in found.said
    else:
        assert found.kind == "result", found.said


@pytest.mark.parametrize("index", [0, *(pytest.param(index, marks=pytest.mark.soak) for index in (1, 2, 3))])
def test_a_random_driver_or_tracker_gives_a_result_that_passes_the_audit(index: int) -> None:
    found = soak.outcome(SEED, index, "electronics")
    assert found.kind == "result", found.said


def test_the_same_numbers_give_the_same_case() -> None:
    assert soak.case(SEED, 3) == soak.case(SEED, 3) != soak.case(SEED, 4)


@pytest.mark.parametrize("schema", [*NUMBERS, Mode.model_json_schema()["properties"]["tip_x"]])
def test_random_values_cover_the_whole_range(schema: dict[str, Any]) -> None:
    rng = np.random.default_rng(0)
    values = np.array([soak.value(rng, {key: item for key, item in schema.items() if key != "default"})
                       for _ in range(2000)])  # fmt: skip
    low, high = (schema.get(name, schema.get(f"exclusive{name.capitalize()}")) for name in ("minimum", "maximum"))
    assert low <= values.min() <= values.max() <= high
    positive = values[values > 0.0]
    decades = math.log10(high / (low if low > 0.0 else positive.min()))
    assert math.log10(high / positive.max()) < 0.02 * decades
    if low > 0.0:
        assert math.log10(values.min() / low) < 0.02 * decades
    else:
        assert (values == 0.0).any()
        assert (values < 0.0).any() == (low < 0.0)


# --- kinds of outcome ---


def driven(index: int) -> bool:
    """Whether a case is a free rotor on the paper's law, with a voltage at group A from the start."""
    case = soak.case(SEED, index)
    return (
        case.asked == "simulate, spring-slider"
        and case.drive.soft_start == 0.0
        and sum(tone.amplitude for tone in case.drive.tones_a) > 0.1
    )


FIRST = next(index for index in range(200) if driven(index))


def falsified(monkeypatch: pytest.MonkeyPatch, change: Callable[[dict[str, Any]], object]) -> soak.Outcome:
    """The outcome of a run whose waveforms are falsified after ngspice wrote them."""
    columns = Recording.columns

    def changed(*arguments: Any) -> dict[str, Any]:
        waves = columns(*arguments)
        if "voltage_a_v" in waves:  # the coarser runs of the estimate have fewer columns
            change(waves)
        return waves

    monkeypatch.setattr(Recording, "columns", changed)
    return soak.outcome(SEED, FIRST)


def test_a_falsified_result_counts_as_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    assert soak.outcome(SEED, FIRST).kind == "result"
    found = falsified(monkeypatch, lambda waves: waves.update(current_a_a=1e3 * np.sign(waves["voltage_a_v"])))
    assert (found.kind, found.said[:25]) == ("simulation error", "The energy balance misses")
    found = falsified(monkeypatch, lambda waves: waves.update(normal_force_n=-waves["normal_force_n"]))
    assert (found.kind, "contact pulls" in found.said) == ("simulation error", True)


def test_each_kind_of_failure_is_recognized(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Waveforms, "to_dict", lambda _: {"audit": {"passed": False, "findings": ["x"]}})
    assert soak.outcome(SEED, FIRST).kind == "not audited"
    monkeypatch.setattr(Waveforms, "to_dict", lambda _: {})
    assert soak.outcome(SEED, FIRST).kind == "not audited"
    for raised, kind in (
        (ZeroDivisionError("x"), "traceback"),
        (pr.ParameterError("x"), "refused"),
        (pr.SimulationError("ngspice did not finish within 120 s and was stopped."), "hang"),
        (pr.SimulationError("ngspice gave up."), "simulation error"),
    ):

        def fails(*_: Any, error: Exception = raised, **__: Any) -> Any:
            raise error

        monkeypatch.setattr(soak, "_run", fails)
        assert soak.outcome(SEED, FIRST).kind == kind


def made_up(index: int, kind: str = "result", said: str = "") -> soak.Outcome:
    return soak.Outcome(index, kind, "simulate, brush", said, "stuck", 0.1, {"modes": 1.0})


@pytest.mark.parametrize(("kind", "number", "passes"), [
    ("simulation error", 2, True), ("simulation error", 3, False), ("traceback", 1, False), ("hang", 1, False),
    ("refused", 1, False), ("not audited", 1, False),
])  # fmt: skip
def test_two_percent_of_simulation_errors_are_allowed_and_nothing_else(kind: str, number: int, passes: bool) -> None:
    failed = [made_up(index, kind, f"It stopped at {index} s.") for index in range(number)]
    outcomes = [*failed, *(made_up(index) for index in range(number, 100))]
    found = soak.summary(outcomes, SEED)
    assert found["results"] == 100 - number
    assert [(one["kind"], one["cause"], one["count"]) for one in found["failures"]] == [
        (kind, "It stopped at # s.", number)
    ]
    assert soak.passes(found) is passes


def test_an_interrupted_soak_resumes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[int] = []

    def note(_: int, index: int, what: str) -> soak.Outcome:
        assert what == "motors"
        ran.append(index)
        return made_up(index)

    def threads(workers: int) -> Executor:
        return ThreadPoolExecutor(workers)

    monkeypatch.setattr(soak, "outcome", note)
    monkeypatch.setattr(soak, "ProcessPoolExecutor", threads)
    notes = tmp_path / "notes.jsonl"
    begun = soak.soak(9, SEED, 1, notes)
    assert next(begun).index in range(9)
    begun.close()
    done = [json.loads(line)["index"] for line in notes.read_text(encoding="utf-8").splitlines()]
    assert done
    ran.clear()
    assert sorted(one.index for one in soak.soak(9, SEED, 2, notes)) == list(range(9))
    assert sorted(ran) == sorted(set(range(9)) - set(done))
