# SPDX-License-Identifier: GPL-3.0-or-later
"""The motors that ``docs/own_motor.md`` shows load and run, as the page says."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from tests.docs.numbers import missing

PAGE = (Path(__file__).parents[2] / "docs" / "own_motor.md").read_text(encoding="utf-8")
TABLES = re.findall(r"^```toml\n(.*?)^```", PAGE, re.M | re.S)
SLIDER = TABLES[2]
MOVED = TABLES[0].replace("on_face = true\n", "")
MOTORS = [*TABLES[:2], re.sub(r"^\[rotor\].*", SLIDER, MOVED, flags=re.M | re.S)]
COMMANDS = re.findall(r"^    (piezomotor .+)$", PAGE, re.M)


@pytest.mark.parametrize("text", MOTORS, ids=["modes", "arms", "slider"])
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
