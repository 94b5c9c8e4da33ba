# SPDX-License-Identifier: GPL-3.0-or-later
"""The motors that ``docs/own_motor.md`` shows load and run, as the page says."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from tests.docs.numbers import missing

PAGE = (Path(__file__).parents[2] / "docs" / "own_motor.md").read_text(encoding="utf-8")
TABLES = re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)
SLIDER = TABLES[2]
MOVED = TABLES[0].replace("on_face = true\n", "")
MOTORS = [*TABLES[:2], re.sub(r"^\[rotor\].*", SLIDER, MOVED, flags=re.M | re.S), TABLES[0] + TABLES[3]]
COMMANDS = re.findall(r"^    (piezomotor .+)$", PAGE, re.M)


@pytest.mark.parametrize("text", MOTORS, ids=["modes", "arms", "slider", "feedback"])
def test_a_motor_loads_and_turns(text: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    motor = pr.load_motor(tmp_path / "mine.toml")
    drive = pr.TwoPhaseDrive(voltage=30.0, frequency=motor.modes[-1].frequency_hz, phase_deg=90.0)
    waves = pr.simulate(motor, drive, duration=1e-3)
    assert waves.energy_residual < 1e-3
    assert abs(waves.mean_rotor_speed_rad_s) * motor.rotor.radius_m > 1e-5


@pytest.mark.soak
def test_the_commands_run_and_the_torque_falls_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(MOTORS[0], encoding="utf-8")
    assert [run(shlex.split(words)[1:]) for words in COMMANDS] == [0] * len(COMMANDS)
    motor = pr.load_motor("mine.toml")
    torques = [pr.steady_state(motor, pr.default_drive(motor), speed=speed).torque_n_m for speed in (0.0, 40.0)]
    assert not missing("own_motor.md", *(f"{1e3 * torque:.0f} mN·m" for torque in torques))


def test_a_number_may_say_where_it_comes_from(tmp_path: Path) -> None:
    for line in re.findall(r"^    (preload_n = .+)$", PAGE, re.M):
        (tmp_path / "mine.toml").write_text(MOTORS[0].replace("preload_n = 22.0", line), encoding="utf-8")
        assert pr.load_motor(tmp_path / "mine.toml").contact.preload_n == 22.0


@pytest.mark.soak
def test_the_feedback_electrode_shows_what_the_page_says(tmp_path: Path) -> None:
    script = Path(__file__).parents[2] / "examples" / "feedback.py"
    done = subprocess.run([sys.executable, script, tmp_path], capture_output=True, text=True, check=True)
    rows = np.array([line.removesuffix("%").split() for line in done.stdout.splitlines()[1:]], dtype=float)
    _, kilohertz, load, whole, _, tip, ratio, *_, error = rows.T
    spreads = [100.0 * np.ptp(one) / (one.max() + one.min()) for one in (ratio, tip / whole)]
    usual, idle = kilohertz == 40.7, load == 0.0
    loaded = [error[usual & (load == at)] for at in (10.0, 20.0, 30.0)]
    ranges = ", ".join(f"{one.min():.0f}–{one.max():.0f}" for one in loaded)
    away = error[~usual & idle]
    assert not missing(
        "own_motor.md", f"{spreads[0]:.2f} %; {spreads[1]:.0f} %", f"{np.abs(error[usual & idle]).max():.1f} %",
        f"{ranges} %", f"−{-away.min():.0f} to {away.max():.0f} %",
    )  # fmt: skip
