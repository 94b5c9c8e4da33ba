# SPDX-License-Identifier: GPL-3.0-or-later
"""The one way to run a bench: the second attempt of a run whose steps collapsed at a switching edge."""

from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import Bench
from pyspice_runner.run import kernel


def steps_of(monkeypatch: pytest.MonkeyPatch, log: str, failures: int, *, uniform: bool) -> list[float]:
    """Return the steps of the runs of one transient, of which the first ones end as ngspice ends them with a log."""
    steps: list[float] = []

    def run(*positional: Any, **_: Any) -> None:
        timing = positional[4]
        steps.append(timing["max_time"])
        if len(steps) <= failures:
            raise pr.SimulationError("It failed.", log=log)

    monkeypatch.setattr(kernel, "run_bench", run)
    try:
        kernel.transient(Bench(None, {}), [], step=1e-7, duration=1e-3, uniform=uniform)  # type: ignore[arg-type]
    except pr.SimulationError:
        steps.append(float("inf"))
    return steps


COLLAPSED = "doAnalyses: TRAN:  Timestep too small; time = 1e-05, timestep = 1e-20"


def test_a_run_with_switching_edges_is_repeated_once_with_half_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    assert steps_of(monkeypatch, COLLAPSED, 0, uniform=False) == [1e-7]
    assert steps_of(monkeypatch, COLLAPSED, 1, uniform=False) == [1e-7, 5e-8]
    assert steps_of(monkeypatch, COLLAPSED, 2, uniform=False) == [1e-7, 5e-8, float("inf")]


def test_another_failure_and_a_run_with_uniform_steps_are_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    assert steps_of(monkeypatch, "singular matrix", 1, uniform=False) == [1e-7, float("inf")]
    assert steps_of(monkeypatch, COLLAPSED, 1, uniform=True) == [1e-7, float("inf")]
