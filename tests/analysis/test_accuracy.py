# SPDX-License-Identifier: GPL-3.0-or-later
"""Accuracy by request: the error that a run reports, against its distance from the independent integrator."""

from __future__ import annotations

import pytest

import pyspice_runner as pr
from tests.analysis.test_reference import DURATION, POINTS, Point, trajectory_error, two_phase

# one worker keeps all of these tests, which share reference runs
pytestmark = pytest.mark.xdist_group("reference")

MORE = {
    "slippery": Point(two_phase(80.0, 40e3, 45.0), 10.0, changes={"contact.friction": 0.1}),
    "loaded below resonance": Point(two_phase(150.0, 50e3, 90.0), 15.0, {"load_torque": 2e-4}),
}


def accurate(name: str, accuracy: float) -> pr.Waveforms:
    point = POINTS[name]
    return pr.simulate(point.motor, point.drive, duration=DURATION, accuracy=accuracy, **point.load)


# a third of the twenty points, for time; all of them passed when the estimate was made
@pytest.mark.parametrize("name", [*POINTS, *MORE][::3])
def test_the_estimated_error_is_the_true_one_within_a_factor_of_three(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name in MORE:
        monkeypatch.setitem(POINTS, name, MORE[name])  # where the reference looks it up
    run = accurate(name, 0.005)
    true = trajectory_error(name, run)
    assert run.error_estimate is not None
    assert run.error_estimate <= 0.005
    assert true / 3.0 <= run.error_estimate <= 3.0 * true  # required; at 18 points measured 0.69 to 1.16 times
    assert true <= 0.006


@pytest.mark.parametrize("accuracy", [0.02, 0.0005])
def test_a_finer_accuracy_is_kept_too(accuracy: float) -> None:
    run = accurate("two tones, hammering", accuracy)
    assert trajectory_error("two tones, hammering", run) < 1.2 * accuracy


def test_a_step_that_is_too_coarse_is_refused_with_the_largest_that_would_do() -> None:
    point = POINTS["mostly slip"]
    settings = {"duration": 1e-3, "accuracy": 1e-3}
    with pytest.raises(pr.ParameterError, match=r"step = 5e-07 s is too coarse .* Allowed is about") as refusal:
        pr.simulate(point.motor, point.drive, step=5e-7, **settings)
    allowed = float(str(refusal.value).partition("Allowed is about ")[2].split()[0])
    run = pr.simulate(point.motor, point.drive, step=allowed, **settings)
    assert run.provenance["run"]["step_s"] == allowed
    assert run.error_estimate is not None
    assert 0.5e-3 < run.error_estimate < 1e-3  # the largest, not any that would do


@pytest.mark.parametrize("accuracy", [0.0, 1e-6, 0.5, float("nan")])
def test_an_accuracy_out_of_range_is_refused(accuracy: float) -> None:
    point = POINTS["mostly slip"]
    with pytest.raises(pr.ParameterError, match=r"accuracy = .* allowed is a relative error from 0\.0001 to 0\.05"):
        pr.simulate(point.motor, point.drive, duration=1e-3, accuracy=accuracy)


def test_without_an_accuracy_there_is_no_estimate() -> None:
    point = POINTS["mostly slip"]
    run = pr.simulate(point.motor, point.drive, duration=2e-4)
    assert run.error_estimate is None
    assert run.to_dict()["error_estimate"] is None
