# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives of any shape: sampled voltages give the run of their drive, and malformed files are errors."""

from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.source import Waveform, read_waveform
from pyspice_runner.cli import run

DRIVE = pr.TwoPhaseDrive(voltage=150.0, frequency=54e3, phase_deg=90.0)
HEADER = "time_s,voltage_a_v,voltage_b_v\n"


def sampled(count: int, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time = np.linspace(0.0, duration, count)
    turns = 2.0 * np.pi * DRIVE.frequency * time
    return time, 150.0 * np.sin(turns), 150.0 * np.sin(turns + 0.5 * np.pi)


def test_sampled_voltages_give_the_run_of_their_drive(motor: pr.Motor) -> None:
    """100 points a period, linear in between: the fundamental is smaller by (π/100)²/3, 0.03 %.

    The current of the clamped capacitances follows the slope, which has steps.
    """
    shape = Waveform(*sampled(2701, 0.5e-3), frequency=DRIVE.frequency)
    given, exact = (pr.simulate(motor, drive, duration=0.5e-3) for drive in (shape, DRIVE))
    for name in ("tip_x_m", "tip_y_m", "voltage_a_v", "voltage_b_v"):
        ours, theirs = getattr(given, name), getattr(exact, name)
        assert np.abs(ours - theirs).max() <= 2e-3 * np.abs(theirs).max(), name
    assert given.energy_residual < 1e-3


def test_the_voltages_stay_after_the_last_point(motor: pr.Motor) -> None:
    shape = Waveform([0.0, 50e-6, 60e-6], [0.0, 0.0, 40.0], [0.0, 0.0, -20.0], frequency=54e3)
    found = pr.simulate(motor, shape, duration=0.2e-3)
    late = found.time_s > 61e-6
    assert found.voltage_a_v[late] == pytest.approx(40.0)
    assert found.voltage_b_v[late] == pytest.approx(-20.0)
    assert found.voltage_a_v[found.time_s < 50e-6] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no column time_s: its first line must name"),
        ("time_s,voltage_a_v\n0,1\n", "has no column voltage_b_v"),
        (HEADER + "0,1,2\n1e-6,1\n", "line 3: '1e-6,1' must have a number for each column"),
        (HEADER + "0,1,2\n1e-6,loud,2\n", "line 3: '1e-6,loud,2' must have a number"),
        (HEADER + "0,1,2\n", "has 1 points: it must have 2 to"),
        (HEADER + "0,1,2\n1e-6,nan,2\n", r"voltage_a_v\[1\] of a waveform is not a finite number"),
        (HEADER + "1e-6,1,2\n2e-6,1,2\n", r"time_s\[0\] = 1e-06 s: the times of a waveform must rise from 0 s"),
        (HEADER + "0,1,2\n2e-6,1,2\n1e-6,1,2\n", r"time_s\[2\] = 1e-06 s: the times"),
        (HEADER + "0,1,2\n1e-6,1e9,2\n", r"voltage = 1e\+09 V is not valid"),
    ],
)
def test_a_malformed_file_is_an_error_that_names_the_place(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text(text)
    with pytest.raises(pr.ParameterError, match=message):
        read_waveform(tmp_path / "drive.csv", 54e3)


def test_a_file_that_is_missing_or_binary_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("missing.csv", "binary.csv"):
        with pytest.raises(pr.ParameterError, match=f"Cannot read .*{name}: .*Give a .csv file"):
            read_waveform(tmp_path / name, 54e3)
    with pytest.raises(pr.ParameterError, match="Cannot read /dev/zero: it is not a regular file"):
        read_waveform("/dev/zero", 54e3)


def test_the_command_replays_what_it_has_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written, again = str(tmp_path / "run.csv"), str(tmp_path / "again.csv")
    plain = "simulate andersen2002 --frequency 54e3 --duration 0.2e-3"
    assert run(f"{plain} --voltage 150 --output {written}".split()) == 0
    assert run(f"{plain} --waveform {written} --output {again}".split()) == 0
    first, second = (np.genfromtxt(path, delimiter=",", names=True) for path in (written, again))
    assert np.abs(first["tip_y_m"] - second["tip_y_m"]).max() <= 2e-3 * np.abs(first["tip_y_m"]).max()
    capsys.readouterr()
    assert run(f"{plain} --waveform {written} --voltage 100".split()) == 2
    assert "--voltage has no effect with --waveform" in capsys.readouterr().err
    assert run(f"{plain} --averaged --waveform {written}".split()) == 2
