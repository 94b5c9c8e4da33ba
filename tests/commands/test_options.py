# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that would have no effect are errors, and tables lose nothing."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.commands.common import load_changed, say
from tests.said import output, printed

TONES = "--frequency-1 20e3 --frequency-2 40e3"
COIL = "--driver linear+inductor --part inductor.inductance=1e-6"
MAP = "map bimodal40 --over drive.voltage=50"
STEADY = (  # commands to which a soft start is nothing
    "steady bimodal40",
    "small-signals bimodal40",
    "map bimodal40 --over drive.voltage=100:150:2",
    "speed-torque bimodal40",
    "state-space bimodal40",
    "loop bimodal40",
    "sweep bimodal40 --over drive.voltage=100,150 --analysis operating-point",
    "calibrate bimodal40 --points p.csv --free contact.friction",
)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two spectra."""
    folder = tmp_path_factory.mktemp("measured")
    spectrum = pr.admittance(pr.load_motor("andersen2002"), start=10e3, stop=20e3, points=50)
    for name in ("A.csv", "B.csv"):
        spectrum.save(folder / name)
    return folder


COVERED = [
    # words, axis, what is given twice, and by which option
    ("sweep --speed 3", "load.speed=4,5", "load.speed", "--speed"),
    ("sweep --load-torque 1", "run.load_torque=4", "load.torque", "--load"),
    ("sweep --voltage 60", "drive.voltage=50", "drive.voltage", "--voltage"),
    ("sweep --drive two-tone --frequency-1 4e4 --frequency-2 8e4", "drive.frequency_1=3e4", "drive.frequency_1",
     "--frequency-1"),
    ("sweep --analysis drive --part amplifier.headroom=1", "drive.amplifier.headroom=2", "drive.amplifier.headroom",
     "--part"),
    ("map --load 2", "load.torque=1", "load.torque", "--load"),
    ("map --objective power --speed 5 --phase 60", "drive.phase_deg=50", "drive.phase_deg", "--phase"),
    ("map --set contact.friction=0.2", "contact.friction=0.3", "contact.friction", "--set"),
    ("speed-torque --ratio-b 1", "drive.ratio_b=1,2", "drive.ratio_b", "--ratio-b"),
    ("speed-torque --follow drive.frequency --frequency 4e4", "drive.frequency=4e4,4.1e4", "drive.frequency",
     "--frequency"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "over", "path", "option"), COVERED)
def test_an_option_that_an_axis_replaces_is_an_error(
    words: str, over: str, path: str, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command, *options = words.split()
    assert run([command, "bimodal40", *options, "--over", over]) == 2
    assert f"{path} is given twice, by {option} and as an axis. Give it once." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (f"simulate andersen2002 {TONES}", "--frequency-1 has no effect on a two-phase drive. Add --drive two-tone"),
        (
            f"simulate andersen2002 --drive two-tone {TONES} --voltage 5",
            "--voltage has no effect on a two-tone drive. Add --drive two-phase",
        ),
        ("simulate andersen2002 --sliders 3", "--sliders has no effect without --contact brush"),
        ("drive andersen2002 --no-match", "--match has no effect without a matching network"),
        ("report andersen2002 --connection B", "--connection has no effect without --measured"),
        (
            "report andersen2002 --tracker pll --drive two-tone --frequency-1=18e3 --frequency-2=54e3",
            "--tracker needs two phases of one tone",
        ),
        ("track andersen2002 --drift 0.01", "--drift has no effect on --disturb start"),
        ("track andersen2002 --period 1e-3", "--period has no effect on --tracker pll"),
        ("sweep andersen2002 --over drive.voltage=1,2 --samples 4", "--samples has no effect without --tolerance"),
        (
            "sweep andersen2002 --analysis operating-point --duration 1e-3",
            "--duration has no effect on --analysis operating-point",
        ),
        (
            f"sweep andersen2002 --analysis driver-state {COIL} --tolerance drive.inductor.inductance=5%",
            "drive.inductor.inductance has no tolerance: at 1e-06 H",
        ),
        ("steady bimodal40 --voltage 50 --voltage 60", "--voltage is given twice"),
        ("steady bimodal40 --audit --no-audit", "--audit is given twice"),
        (f"{MAP} --over drive.voltage=60", "--over drive.voltage is given twice"),
        (f"{MAP} --limit current_a=1e-9 --limit current_a=10", "--limit current_a is"),
        ("show bimodal40 --set contact.friction=1 --set 'contact.friction =2'", "--set contact.friction is"),
        (
            "drive bimodal40 --part amplifier.headroom=1 --set driver.x=1 --set driver.x=2",
            "--part driver.x is given twice",
        ),
        (
            f"drive bimodal40 {COIL} --part Inductor.Inductance=1e-3",
            "--part Inductor.Inductance is given twice, with different capitalisation.",
        ),
        ("fit A.csv --no-leads --leads auto", "--leads has no effect beside --no-leads"),
        ("fit A.csv --noise z=1,z=2", "--noise z is given twice"),
        ("compare A.csv B.csv --tolerance 5% --tolerance 9%", "--tolerance of all quantities is"),
        (f"{MAP} --speed 3 --over speed=4", "load.speed is given twice"),
        (f"{MAP} --load 1e-3", "objective = 'torque' is not valid: the load fixes"),
        ("map bimodal40 --over drive.voltage=5,6,5", "drive.voltage has the value 5 more than once"),
        ("speed-torque bimodal40 --speeds=5,5,5", "speeds has the value 5 more than once"),
        ("report bimodal40 --speeds=5,0,5", "speeds has the value 5 more than once"),
        *((f"{words} --soft-start 1e-3", "--soft-start has no effect") for words in STEADY),
        (
            "calibrate bimodal40 --points p.csv --free contact.friction --connection B",
            "--connection has no effect",
        ),
    ],
)
def test_what_has_no_effect_is_given_twice_or_is_fixed_is_an_error(
    words: str, says: str, measured: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(measured)
    assert run(shlex.split(words)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"piezomotor: {says}")


def test_speed_torque_takes_two_further_axes(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["speed-torque", "andersen2002", "--speeds=0", "--over", "drive.voltage=40,50"]
    document = printed([*words, "--over", "contact.preload_n=4,5,6"], capsys)
    assert np.shape(document["torque_n_m"]) == (2, 3, 1)


def test_the_table_of_a_run_shows_its_drive(capsys: pytest.CaptureFixture[str]) -> None:
    words = "simulate andersen2002 --duration 1e-4 --voltage 30 --frequency 51e3 --phase -90"
    assert "andersen2002, 30 V at 51 kHz, -90° apart, 0.0001 s" in " ".join(output(words.split(), capsys).split())


def test_a_table_in_a_pipe_is_not_cut(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table(*(f"mean_rotor_speed_rad_s_{number}" for number in range(8)))
    table.add_row(*(f"9.3761234e-{number:02d}" for number in range(8)))
    say(table)
    shown = capsys.readouterr().out
    assert all(
        f"mean_rotor_speed_rad_s_{number}" in shown and f"9.3761234e-{number:02d}" in shown for number in range(8)
    )
    assert "…" not in shown


@pytest.mark.parametrize(
    ("change", "path", "value"),
    [
        ("modes.0.quality_factor=300", "quality_factor", 300.0),
        ("modes.0.frequency_hz=13e3", "frequency_hz", 13e3),
    ],
)
def test_set_takes_the_aliases_of_a_mode(
    change: str, path: str, value: float, capsys: pytest.CaptureFixture[str]
) -> None:
    motor = load_changed("andersen2002", [change])
    assert getattr(motor.modes[0], path) == pytest.approx(value, rel=1e-12)
    assert run(["show", "andersen2002", "--set", "modes.0.quality_factor=0.4"]) == 2
    assert "modes.0.quality_factor = 0.4 is not valid: it must be a number > 0.5" in capsys.readouterr().err


def test_set_takes_what_the_file_of_a_beam_states() -> None:
    plain = load_changed("andersen2002", None)
    changed = load_changed("andersen2002", ["beam.thickness_m=1.9e-3", "contact.materials.tip_poisson=0.3"])
    assert changed.modes[0].frequency_hz > 1.01 * plain.modes[0].frequency_hz  # a thicker beam is stiffer
    assert changed.contact.normal_stiffness_n_per_m15 > plain.contact.normal_stiffness_n_per_m15
    assert changed.provenance["beam.thickness_m"].kind == "set"
    shorter = load_changed("andersen2002", ["patches.0.end_m=0.008"])
    assert shorter.piezo.capacitance_a_f < plain.piezo.capacitance_a_f
    assert shorter.piezo.capacitance_b_f == plain.piezo.capacitance_b_f


def test_a_part_of_an_own_driver_may_be_written_in_either_case(tmp_path: Path) -> None:
    library = tmp_path / "own.lib"
    library.write_text(".subckt own in out com L=1u\nE1 x com in com 20\nL1 x out {L}\n.ends\n", encoding="utf-8")
    words = ["drive", "bimodal40", "--driver", f"{library}:own", "--duration", "3e-4", "--json", "--output"]
    inductances = []
    for number, part in enumerate(("driver.L=2e-6", "driver.l=2e-6")):
        assert run([*words, str(tmp_path / f"{number}.json"), "--part", part]) == 0
        inductances.append(json.loads((tmp_path / f"{number}.json").read_text())["driver"]["parts"]["a"]["driver"]["l"])
    assert inductances == [2e-6, 2e-6]


def test_a_motor_saved_with_a_byte_order_mark_is_the_same_motor(tmp_path: Path) -> None:
    text = Path("tests/data/every_effect.toml").read_bytes()
    (tmp_path / "marked.toml").write_bytes(b"\xef\xbb\xbf" + text)
    assert pr.load_motor(tmp_path / "marked.toml") == pr.load_motor("tests/data/every_effect.toml")


def test_a_state_space_at_a_speed_beyond_the_limit_has_the_caution_of_the_steady_state() -> None:
    motor = pr.load_motor("bimodal40")
    system = pr.state_space(motor, pr.default_drive(motor), load_torque=10.0)
    assert system.point["speed"] < -1e5
    assert any("above which its rim bursts. Lower the load." in caution for caution in system.cautions)


@pytest.mark.parametrize("kind", ["half-bridge", "full-bridge", "push-pull", "linear"])
def test_the_smallest_ratio_of_amplitudes_holds_behind_every_stage(kind: str) -> None:
    driver = pr.Driver(kind=kind, network="inductor", voltage=50.0, ratio_b=0.01, frequency=40.7e3)
    assert driver.equivalent.ratio_b == pytest.approx(0.01, rel=0.02)
