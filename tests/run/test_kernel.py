# SPDX-License-Identifier: GPL-3.0-or-later
"""The one way to run a bench: the second attempt of a run whose steps collapsed at a switching edge."""

from __future__ import annotations

from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.run import kernel


def collapsing(monkeypatch: pytest.MonkeyPatch, runs: int) -> list[float]:
    """Let the first runs end as ngspice ends one whose steps collapsed; return the list of the steps of all runs."""
    steps: list[float] = []
    run = kernel.run_bench

    def failing(bench: Any, vectors: Any, timeout: Any, analysis: str, timing: Any, **how: Any) -> kernel.Outcome:
        steps.append(timing["max_time"])
        if len(steps) <= runs:
            raise pr.SimulationError("It failed.", log="doAnalyses: TRAN:  Timestep too small; time = 1e-05")
        return run(bench, vectors, timeout, analysis, timing, **how)

    monkeypatch.setattr(kernel, "run_bench", failing)
    return steps


STAGE = {"kind": "full-bridge", "voltage": 60.0, "frequency": 40.7e3, "phase_deg": 62.0}


def test_a_run_with_switching_edges_is_repeated_with_half_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = collapsing(monkeypatch, runs=1)
    report = pr.drive_report(pr.load_motor("bimodal40"), pr.Driver(**STAGE), duration=3e-4)
    assert steps[1] == steps[0] / 2.0
    assert abs(report.balance_residual) < 0.01


def test_a_run_with_switching_edges_is_repeated_only_once(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = collapsing(monkeypatch, runs=2)
    with pytest.raises(pr.SimulationError):
        pr.drive_report(pr.load_motor("bimodal40"), pr.Driver(**STAGE), duration=3e-4)
    assert len(steps) == 2


def test_a_run_with_uniform_steps_is_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = collapsing(monkeypatch, runs=100)
    motor = pr.load_motor("bimodal40")
    with pytest.raises(pr.SimulationError):
        pr.simulate(motor, pr.default_drive(motor), duration=1e-4, step=1e-7)
    assert min(steps) == 1e-7  # the others are the coarser runs of the error estimate
