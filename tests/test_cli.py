# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: results, files, exit statuses and error messages."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer

import pyspice_runner as pr
from pyspice_runner.cli import FIRST_STEPS, app, run
from pyspice_runner.motor.load import changed_motor
from tests.said import printed

COMMANDS = typer.main.get_command(app()).commands
SHORT = ["simulate", "andersen2002", "--duration", "2e-4"]


def command(*words: str, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-m", "pyspice_runner", *words],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(Path(pr.__file__).parents[1]), **environment},
        timeout=120,
        check=False,
    )


def sentences(text: str) -> int:
    """Count sentences; a dot inside a number, a name or an ending does not end one."""
    return len(re.findall(r"[.?!](?=\s|$)", text.strip()))


def test_show_prints_the_documented_json(capsys: pytest.CaptureFixture[str]) -> None:
    motor = printed(["show", "andersen2002"], capsys)
    assert set(motor) == {"name", "modes", "piezo", "contact", "rotor", "mount", "limits", "cautions"}
    assert set(motor["modes"][0]) == {
        "name", "frequency_hz", "mass_kg", "damping_n_s_per_m", "stiffness_n_per_m", "coupling_a_n_per_v",
        "coupling_b_n_per_v", "tip_x", "tip_y", "recoil_kg", "recoil_x_kg",
    }  # fmt: skip
    assert {"capacitance_a_f", "capacitance_b_f", "loss_tangent"} <= set(motor["piezo"])
    assert set(motor["contact"]) == {
        "normal_stiffness_n_per_m15", "tangential_compliance_tip_m_per_n23", "tangential_compliance_rotor_m_per_n23",
        "friction", "preload_n", "effective_radius_m", "poisson",
    }  # fmt: skip
    assert set(motor["rotor"]) == {"radius_m", "inertia_kg_m2", "bearing_damping_n_m_s"}
    assert [mode["frequency_hz"] for mode in motor["modes"]] == pytest.approx([13.5e3, 51.7e3], rel=1e-3)


@pytest.mark.parametrize(
    ("name", "recoils_kg"),
    [
        ("bimodal40", [0.0] * 4),
        # the file does not specify the recoil of mode 2
        (str(Path(__file__).parent / "data" / "every_effect.toml"), [1e-4, None, 2e-4, 1e-4]),
        ("andersen2002", [None, None]),
    ],
)
def test_show_has_the_recoil_of_each_mode_also_where_it_is_zero(
    name: str, recoils_kg: list[float | None], capsys: pytest.CaptureFixture[str]
) -> None:
    assert [mode["recoil_kg"] for mode in printed(["show", name], capsys)["modes"]] == recoils_kg


def test_simulate_prints_one_json_object_and_writes_the_requested_files(tmp_path: Path) -> None:
    changes = {"beam.theory": "bernoulli-euler", "beam.recoil": False}  # by the user, not the paper
    words = [f"--set={path}={value}".lower() for path, value in changes.items()]
    done = command(*SHORT, *words, "--json", "--output", "run.csv", "--plot", "run.png", cwd=tmp_path)
    cautions = [f"piezomotor: {sentence}" for sentence in changed_motor("andersen2002", changes).cautions]
    assert (done.returncode, done.stderr.splitlines()) == (0, cautions)
    assert "The recoil of mode bending-1 on the carrier is not known" in done.stderr
    summary = json.loads(done.stdout)
    assert {"mean_rotor_speed_rad_s", "mean_torque_n_m", "state_fractions", "energy_residual"} <= set(summary)
    assert (tmp_path / "run.csv").read_text(encoding="utf-8").startswith("time_s,")
    assert (tmp_path / "run.png").stat().st_size > 20_000


def test_settings_reach_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--drive", "two-tone", "--frequency-1", "20e3", "--frequency-2", "40e3", "--set", "contact.preload_n=8"]
    summary = printed([*SHORT, *words, "--speed", "1.5"], capsys)
    assert summary["drive"]["frequency_2"] == 40e3
    assert summary["motor"]["contact"]["preload_n"] == 8.0
    assert summary["mean_rotor_speed_rad_s"] == pytest.approx(1.5)


def test_every_command_prints_json_and_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, ending in (
        (["show", "andersen2002"], "csv"),
        (["admittance", "andersen2002", "--points", "20"], "nc"),
        (["speed-torque", "andersen2002", "--speeds=0,1", "--patience", "4"], "nc"),
        (["export", "andersen2002"], "lib"),
        (SHORT, "cir"),
    ):
        output, plot = tmp_path / f"{words[0]}.{ending}", tmp_path / f"{words[0]}.png"
        assert isinstance(printed([*words, "--output", str(output), "--plot", str(plot)], capsys), dict)
        assert output.stat().st_size > 0
        assert plot.stat().st_size > 5_000
        if words[0] in ("show", "simulate"):
            assert run(words) == 0
            assert "andersen2002" in capsys.readouterr().out
    assert run(["motors", "--json", "--output", str(tmp_path / "motors.csv")]) == 0
    assert "bimodal40" in [motor["name"] for motor in json.loads(capsys.readouterr().out)["motors"]]


def test_the_demo_runs_its_scripts_and_prints_one_json_object(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "demo.py").write_text("def draw(at):\n    print('drawn')\n    return [at.name]\n", encoding="utf-8")
    monkeypatch.setattr("pyspice_runner.commands.pages.data_path", lambda _: tmp_path)
    assert run(["demo", "--output", str(tmp_path / "made"), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out) == {"folder": str(tmp_path / "made"), "results": ["made"]}
    assert said.err.startswith("drawn")


def test_the_deck_that_simulate_writes_runs_by_the_command_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*SHORT, "--output", str(tmp_path / "run $1.cir")]) == 0
    words = shlex.split(capsys.readouterr().err.partition("Run it with: ")[2])
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, timeout=60, check=False)
    assert done.returncode == 0
    assert (tmp_path / "out.raw").stat().st_size > 10_000


def test_the_command_alone_prints_the_first_steps() -> None:
    done = command()
    assert (done.returncode, done.stdout, done.stderr) == (0, FIRST_STEPS, "")


def test_the_versions_are_those_of_the_package_and_of_ngspice(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert re.fullmatch(rf"piezomotor {re.escape(pr.__version__)}, ngspice \d+\S*\n", capsys.readouterr().out)


def parsed(words: list[str]) -> None:
    """Parse a command line as the program does, without running it."""
    group = typer.main.get_command(app())
    name, group_command, rest = group.resolve_command(group.make_context("piezomotor", list(words)), list(words))
    group_command.make_context(name, rest)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_help_has_a_valid_example(name: str) -> None:
    text = " ".join((COMMANDS[name].help or "").split())
    if name == "motors":  # takes nothing
        return
    (example,) = re.findall(r"Example: piezomotor (.+)$", text)
    assert example.startswith(f"{name} ")
    parsed(shlex.split(example))


def test_the_first_steps_are_valid_commands() -> None:
    for words in re.findall(r"piezomotor (\w.*?)  ", FIRST_STEPS.partition("Help")[0]):
        parsed(shlex.split(words))


@pytest.mark.parametrize(
    ("words", "completed"),
    [
        ("piezomotor sim", ["simulate"]),
        pytest.param("piezomotor simulate andersen2002-", ["andersen2002-unintended-mode"], marks=pytest.mark.soak),
        ("piezomotor simulate mi", ["mine.toml"]),
        pytest.param("piezomotor simulate **mi", [], marks=pytest.mark.fuzz),  # which is no pattern
        pytest.param("piezomotor simulate andersen2002 --dur", ["--duration"], marks=pytest.mark.soak),
    ],
)
def test_tab_completes_commands_motors_and_options(words: str, completed: list[str], tmp_path: Path) -> None:
    (tmp_path / "mine.toml").touch()
    shell = {"_PIEZOMOTOR_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    # the program's name is what the shell knows it by
    start = "import sys; from pyspice_runner.__main__ import main; sys.argv = ['piezomotor']; main()"
    done = subprocess.run(
        [sys.executable, "-c", start], capture_output=True, text=True, cwd=tmp_path, timeout=60, check=False,
        env={**os.environ, "PYTHONPATH": str(Path(pr.__file__).parents[1]), **shell},
    )  # fmt: skip
    assert done.stdout.split() == completed


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["simulate", "andersen2003"], "Did you mean 'andersen2002'?"),
        (["simulate", "nowhere.toml"], "no file 'nowhere.toml'"),
        (["simulate", "andersen2002", "--voltage", "1e9"], "voltage = 1e+09 V is not valid"),
        (["simulate", "andersen2002", "--duration", "nan"], "duration = nan s is not valid"),
        (["simulate", "andersen2002", "--set", "contact.preload_n=-1"], "contact.preload_n = -1 N is not valid"),
        (["simulate", "andersen2002", "--set", "contact.preload=1"], "Did you mean"),
        (["simulate", "andersen2002", "--set", "friction"], "not PATH=VALUE"),
        (
            ["simulate", "andersen2002", "--set", "contact.friction=rough"],
            "contact.friction = 'rough' is not valid: it must be a number",
        ),
        (["simulate", "andersen2002", "--drive", "two-tone"], "needs --frequency-1 and --frequency-2"),
        (["simulate", "andersen2002", "--output", "run.doc"], "let it end in .csv"),
        (["simulate", "andersen2002", "--output", "folder.csv"], "it is a folder"),
        (["simulate", "andersen2002", "--output", "no/such/run.csv"], "a folder that does not exist"),
        (["simulate", "andersen2002", "--plot", f"{'x' * 300}.png"], "File name too long. Choose another place."),
        (["speed-torque", "andersen2002", "--speeds=0:1:9999999999"], "--speeds: '0:1:9999999999' is not valid"),
        (["speed-torque", "andersen2002", "--speeds", "slow"], "--speeds: 'slow' is not valid"),
        (["speed-torque", "andersen2002", "--patience", "1"], "patience = 1 is not valid"),
        (["simulate", "andersen2002", "--voltage", "much"], "--voltage"),
        (["fly"], "fly"),
        (["show"], "MOTOR"),
    ],
)
def test_invalid_input_ends_with_status_2_and_one_or_two_sentences(
    words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder.csv").mkdir()
    assert run(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in re.sub(r"[\s│]+", " ", err)
    if err.startswith("piezomotor: "):  # the others are typer's own, with its usage line
        assert 1 <= sentences(err) <= 2


def test_a_simulator_that_fails_ends_with_status_3(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "andersen2002", "--duration", "1", "--timeout", "0.3"]) == 3
    assert "did not finish within 0.3 s" in capsys.readouterr().err
