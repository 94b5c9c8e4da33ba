# SPDX-License-Identifier: GPL-3.0-or-later
"""The controllers in examples/: each with the averaged and the full motor, one of them as firmware in C too."""

import shutil
import subprocess
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.control.run import ControlledRun
from tests.selection import mostly

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "controllers"
SHORT, LONG = 3e-3, 50e-3  # s, six or twelve samples at least
ENOUGH = {"resonance": 40e-3, "speed": 35e-3, "position": 30e-3}  # s, to see what each controller is for
ALLOWED = 0.03  # of the greatest sample: what the averaged motor is to be worth in a loop
pytestmark = pytest.mark.xdist_group("controllers")


@pytest.fixture(scope="module")
def examples() -> dict[str, tuple[dict[str, Any], ControlledRun]]:
    """What each example defines, and its run with the averaged motor."""
    defined = {name: run_path(str(FOLDER / f"{name}.py")) for name in ENOUGH}
    return {name: (script, script["run"](ENOUGH[name])) for name, script in defined.items()}


def check_equal_samples(averaged: ControlledRun, full: ControlledRun, motor: pr.Motor) -> None:
    """Every sample within 3 % of its maximum; the currents as phasors too, of the larger current of both groups."""
    count = len(full.time_s)
    ours = {name: values[:count] for name, values in averaged.samples.items()}
    theirs = dict(full.samples)
    ours["electrical_power_w"] = ours["electrical_power_w"] + charging_power(full, motor)
    largest = max(full.current_amplitude_a.max(), full.current_b_amplitude_a.max())
    for group in ("", "_b"):
        of_group = (f"current{group}_amplitude_a", f"current{group}_phase_deg")
        currents = [
            samples[of_group[0]] * np.exp(1j * np.radians(samples.pop(of_group[1]))) for samples in (ours, theirs)
        ]
        assert np.abs(currents[0] - currents[1]).max() <= ALLOWED * largest, of_group
    for name, values in theirs.items():
        assert np.abs(ours[name] - values).max() <= ALLOWED * np.abs(values).max(), name


def charging_power(full: ControlledRun, motor: pr.Motor) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the mean power in W of each sample by which a source charges the groups as its voltage jumps.

    The averaged motor has no such current. Where the voltage u1 becomes u2 within a time step, a group takes
    C u2 (u2 - u1).
    """
    angle = 2.0 * np.pi * full.frequency_hz * full.time_s
    energy = np.zeros(len(full.time_s))
    for voltage, phase, capacitance in (
        (full.voltage_a_v, np.zeros(len(angle)), motor.piezo.capacitance_a_f),
        (full.voltage_b_v, np.radians(full.phase_deg), motor.piezo.capacitance_b_f),
    ):
        after = voltage[1:] * np.sin(angle[1:] + phase[1:])
        before = voltage[:-1] * np.sin(angle[1:] + phase[:-1])
        energy[2:] += (capacitance * after * (after - before))[:-1]
    return energy / np.diff(full.time_s, prepend=0.0)


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, ENOUGH, ["position", "speed"]))
def test_full_motor_gives_the_samples_of_the_averaged_one(
    name: str, examples: dict[str, tuple[dict[str, Any], ControlledRun]]
) -> None:
    defined, averaged = examples[name]
    check_equal_samples(averaged, defined["run"](SHORT, averaged=False), defined["MOTOR"])


APART = pytest.mark.xfail(strict=True, reason="4.1 % of the current of group B, where the contact opens")


@pytest.mark.soak
@pytest.mark.parametrize("name", [pytest.param(name, marks=[APART] * (name == "position")) for name in ENOUGH])
def test_full_motor_gives_the_samples_of_the_averaged_one_for_50_ms(name: str) -> None:
    defined = run_path(str(FOLDER / f"{name}.py"))
    run = defined["run"]
    check_equal_samples(run(LONG), run(LONG, averaged=False), defined["MOTOR"])


def test_the_tracker_holds_the_phase_and_the_motor_runs_faster(
    examples: dict[str, tuple[dict[str, Any], ControlledRun]],
) -> None:
    defined, run = examples["resonance"]
    last = pr.Sample(*(run.samples[name][-1] for name in pr.Sample.__dataclass_fields__))
    phase = defined["motional_phase"](last, run.frequency_hz[-2])
    assert phase == pytest.approx(defined["TARGET"], abs=2.0)  # an integral part follows a drift with an error
    still = pr.simulate_controlled(
        defined["MOTOR"], defined["DRIVE"], lambda _: {}, duration=20e-3, sample_time=5e-3,
        load_torque=defined["LOAD_TORQUE"],
    )  # fmt: skip
    assert run.speed_rad_s[-1] > 1.9 * still.speed_rad_s[-1]


def test_the_speed_follows_its_set_point_in_both_directions(
    examples: dict[str, tuple[dict[str, Any], ControlledRun]],
) -> None:
    defined, run = examples["speed"]
    before = np.flatnonzero(run.time_s < defined["REVERSAL"])[-1]
    assert run.speed_rad_s[[before, -1]] == pytest.approx([defined["SPEED"], -defined["SPEED"]], rel=0.1)  # 10 ms later
    assert run.voltage_a_v.min() >= defined["DEAD_BAND"]


def test_the_burst_covers_the_distance_that_is_left(examples: dict[str, tuple[dict[str, Any], ControlledRun]]) -> None:
    defined, run = examples["position"]
    left = np.abs(defined["TARGET"] - run.position_rad)
    at = int(np.searchsorted(run.time_s, defined["BURST"]))
    assert 3e-3 < left[at] < defined["NEAR"]
    assert left[-1] < 0.05 * left[at]  # the table has steps of 10 V
    assert not run.voltage_a_v[-1]


def test_firmware_in_c_gives_the_samples_of_the_same_law_in_python(
    tmp_path: Path, examples: dict[str, tuple[dict[str, Any], ControlledRun]]
) -> None:
    """A second run of the same library begins anew."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler here")
    library = tmp_path / "speed.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, FOLDER / "speed.c"], check=True, timeout=60)
    defined, run = examples["speed"]
    for _ in range(2):
        firmware = defined["run"](SHORT, library=str(library))
        np.testing.assert_allclose(firmware.voltage_a_v, run.voltage_a_v[: len(firmware.time_s)], rtol=1e-12)
