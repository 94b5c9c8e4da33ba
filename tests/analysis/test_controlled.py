# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampled controllers in the loop with the averaged and the full motor."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.analysis.controlled import Sample, SharedLibrary, simulate_controlled

DRIVE = pr.TwoPhaseDrive(voltage=150.0, frequency=54e3, phase_deg=90.0)
FIRMWARE = """
static double sum;
void step(double t, const double *in, double *out) {
    double error = 2.0 - in[0];
    sum += 3.0 * error;
    out[0] = 150.0 + 10.0 * error + sum;
    if (out[0] < 0.0) out[0] = 0.0;
    if (out[0] > 300.0) out[0] = 300.0;
}
"""


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


@pytest.mark.xdist_group("controlled")
def test_the_same_controller_gives_the_same_samples_on_both_motors(motor: pr.Motor) -> None:
    """3 % RMS of the greatest value, over the samples after the first, in which the tip swings up."""
    averaged, full = (
        simulate_controlled(motor, DRIVE, speed_loop(), duration=6e-3, sample_time=0.5e-3, averaged=averaged)
        for averaged in (True, False)
    )
    for name in ("speed_rad_s", "current_amplitude_a", "voltage_a_v", "position_rad"):
        ours, theirs = averaged.samples[name][1:], full.samples[name][1:]
        assert np.sqrt(np.mean((ours - theirs) ** 2)) <= 0.03 * np.abs(theirs).max(), name
    assert np.abs(averaged.current_phase_deg - full.current_phase_deg)[1:].max() < 3.0


@pytest.mark.xdist_group("controlled")
def test_firmware_in_c_gives_the_samples_of_the_same_law_in_python(motor: pr.Motor, tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler here")
    (tmp_path / "firmware.c").write_text(FIRMWARE)
    library = tmp_path / "firmware.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, tmp_path / "firmware.c"], check=True, timeout=60)
    runs = [
        simulate_controlled(motor, DRIVE, controller, duration=5e-3, sample_time=1e-3)
        for controller in (SharedLibrary(library), speed_loop())
    ]
    np.testing.assert_allclose(runs[0].voltage_a_v, runs[1].voltage_a_v, rtol=1e-12)


def test_a_library_without_step_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "nothing.so").write_bytes(b"no library")
    with pytest.raises(pr.ParameterError, match="cannot be used as a controller"):
        SharedLibrary(tmp_path / "nothing.so")


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
