# SPDX-License-Identifier: GPL-3.0-or-later
"""Guesses of the command line: synonyms, suffixes and shortcuts work; other guesses are answered with what to write."""

import json
import shlex
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.commands.common import number
from tests.said import output, printed, refusal


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("40.7k", 40.7e3), ("2ms", 2e-3), ("10u", 1e-5), ("10 µs", 1e-5), ("24V", 24.0), ("-3m", -3e-3),
        ("1.5meg", 1.5e6), ("4.07MEGHz", 4.07e6), ("1e-3", 1e-3), (".5n", 5e-10), ("40kHz", 40e3), ("2G", 2e9),
    ],
)  # fmt: skip
def test_a_number_may_have_a_suffix_and_a_unit_that_the_option_has(text: str, value: float) -> None:
    assert number(text, units="Test, V, s, Hz") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("text", ["2M", "2mm", "k", "1.2.3", "40,7k", "2kHz", "150A", "5 apples", "", "1e3k4"])
def test_another_text_is_not_a_number(text: str) -> None:
    with pytest.raises(pr.ParameterError, match=r"is not a number|has the unit"):
        number(text, units="Amplitude of group A, V")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("list", "bimodal40"),
        ("help drive", "--stage"),
        ("version", "ngspice"),
        ("pll --help", "piezomotor track"),
        ("montecarlo --help", "piezomotor sweep"),
        ("bode --help", "piezomotor small-signals"),
        ("torque-speed --help", "piezomotor speed-torque"),
        ("run andersen2002 --duration 0.1ms --frequency 51.7kHz --preload 5 --friction 0.3 --json", '"preload_n": 5.0'),
        ("impedance andersen2002 --points 20 --temperature 60", "andersen2002, free"),
        ("steady bimodal40 --load-torque 3m --json", '"load_torque_n_m": 0.003'),
        ("new mymotor.toml", "mymotor.toml"),
    ],
)
def test_a_guess_works(words: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert says in output(shlex.split(words), capsys)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("steady bimodal40 --frequency 40.7", "Did you mean 40.7k?"),
        ("steady bimodal40 --frequency 40.7s", "has the unit s"),
        ("steady bimodal40 --stall", "Write --speed 0."),
        ("simulate bimodal40 --time 2ms", "Write --duration TIME."),
        ("drive bimodal40 --supply 24", "Write --rail VOLTAGE."),
        ("drive bimodal40 --rail 24 --driver half-bridge", "--stage half-bridge"),
        ("loop bimodal40 --sample 2000", "write --sample 0.0005"),
        ("simulate bimodal40 --set preload=10", "Did you mean 'contact.preload_n'?"),
        ("simulate bimodal40 --preload 10 --set contact.preload_n=9", "contact.preload_n is given twice"),
        ("steady bimodal40 --temperature 500", "from -60 to 328 °C"),
        ("motors --plot m.png", "No such option: --plot"),
        ("export bimodal40 a.lib --output b.lib", "Two files are given"),
        ("sweep bimodal40 --preload 9 --over contact.preload_n=8,9", "given twice, by --preload and as an axis"),
        ("sweep bimodal40 --over drive.voltage=50,60 --limit mean_torque_n_m=3", "is not LOW:HIGH"),
        ("map bimodal40 --over drive.voltage=50,60 --limit torque_n_m=", "is not LOW:HIGH"),
        ("map bimodal40 --over drive.voltage=50,60 --limit torque_n_m=3:1", "LOW must be at most HIGH"),
    ],
)
def test_another_guess_shows_what_to_write(words: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert says in refusal(shlex.split(words), capsys)


def test_export_writes_the_file_that_is_named_second() -> None:
    assert run(["export", "bimodal40", "motor.lib", "--dialect", "ltspice"]) == 0
    assert ".subckt piezomotor a b com shaft" in Path("motor.lib").read_text(encoding="ascii")


def test_the_parameter_set_to_start_from_is_complete_runs_and_is_not_replaced() -> None:
    assert run(["new", "mymotor.toml"]) == 0
    motor = pr.load_motor("mymotor.toml")
    state = pr.steady_state(motor, pr.default_drive(motor), load_torque=0.02)
    assert state.stable
    assert state.speed_rad_s > 10.0
    assert not motor.cautions
    assert run(["new", "mymotor.toml"]) == 2


def test_a_curve_runs_from_stall_to_no_load_by_itself(capsys: pytest.CaptureFixture[str]) -> None:
    curve = printed(["speed-torque", "bimodal40"], capsys)
    speeds, torques = curve["speed_rad_s"], curve["torque_n_m"]
    assert len(speeds) == 9
    assert speeds[0] == 0.0
    assert abs(torques[-1]) < 0.02 * torques[0]  # what remains is the friction of the bearing


def test_a_limit_of_a_map_may_have_two_ends(capsys: pytest.CaptureFixture[str]) -> None:
    words = (
        "map bimodal40 --speed 0 --over drive.voltage=60,80 --limit tensile_stress_pa=3e9 --limit torque_n_m={} --json"
    )
    chosen = [shlex.split(words.format(limit)) for limit in ("0.001:", "10:", ":0.001")]
    best = [json.loads(output(one, capsys))["best"] for one in chosen]
    assert best[0]["torque_n_m"] > 0.001
    assert best[1:] == [None, None]
    lower = "--set limits.contact_tension_pa=2e6 --limit tensile_stress_pa=1e6: --json"
    assert run(shlex.split(f"map bimodal40 --speed 0 --over drive.voltage=60,80 {lower}")) == 0
    assert json.loads(capsys.readouterr().out)["best"] is None  # a minimum does not replace the motor's own maximum
