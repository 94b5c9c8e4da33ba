# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampled controllers in the loop with the averaged and the full motor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner import simulate_controlled
from pyspice_runner.analysis.controlled import Sample

DRIVE = pr.TwoPhaseDrive(voltage=150.0, frequency=54e3, phase_deg=90.0)


@pytest.fixture(scope="module")
def motor() -> pr.Motor:
    return pr.load_motor("andersen2002")


def speed_loop() -> Callable[[Sample], Mapping[str, float]]:
    """A proportional-integral controller of the speed, which sets the amplitude."""
    state = {"sum": 0.0}

    def step(sample: Sample) -> Mapping[str, float]:
        error = 2.0 - sample.speed_rad_s
        state["sum"] += 3.0 * error
        return {"voltage": min(max(150.0 + 10.0 * error + state["sum"], 0.0), 300.0)}

    return step


def test_a_library_without_step_is_an_error(motor: pr.Motor, tmp_path: Path) -> None:
    (tmp_path / "nothing.so").write_bytes(b"no library")
    for name in ("nothing.so", "missing.so"):
        with pytest.raises(pr.ParameterError, match=f"{name} cannot be used as a controller"):
            simulate_controlled(motor, DRIVE, tmp_path / name, duration=1e-3, sample_time=0.5e-3)


def test_a_controller_that_is_neither_a_function_nor_a_path_is_an_error(motor: pr.Motor) -> None:
    with pytest.raises(pr.ParameterError, match="controller = 3 is not valid"):
        simulate_controlled(motor, DRIVE, 3, duration=1e-3, sample_time=0.5e-3)  # type: ignore[arg-type]


def test_a_rotor_that_bursts_is_told(motor: pr.Motor) -> None:
    run = simulate_controlled(motor, DRIVE, lambda _: {}, duration=2e-3, sample_time=0.5e-3, load_torque=100.0)
    assert "the limit is 1e+05 rad/s" in " ".join(run.cautions)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ({"colour": 1.0}, "The controller set 'colour': it must be voltage or one of"),
        ({"voltage": float("nan")}, "voltage_a = nan: it must be"),
        ({"frequency": 1e12}, r"frequency = 1000000000000\.0: it must be"),
        (None, "it must return a mapping"),
    ],
)
def test_what_a_controller_returns_is_checked(motor: pr.Motor, returned: object, message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        simulate_controlled(motor, DRIVE, lambda _: returned, duration=1e-3, sample_time=0.5e-3)  # type: ignore[arg-type, return-value]


def test_an_error_in_a_controller_ends_ngspice_and_is_raised(motor: pr.Motor) -> None:
    def fails(sample: Sample) -> Mapping[str, float]:
        raise RuntimeError(f"sensor lost at {sample.time_s:g} s")

    with pytest.raises(RuntimeError, match=r"sensor lost at 0\.0005 s"):
        simulate_controlled(motor, DRIVE, fails, duration=1e-3, sample_time=0.5e-3)


def test_a_sample_time_below_a_period_is_an_error(motor: pr.Motor) -> None:
    with pytest.raises(pr.ParameterError, match="at least one period of the drive"):
        simulate_controlled(motor, DRIVE, speed_loop(), duration=1e-3, sample_time=1e-6)
