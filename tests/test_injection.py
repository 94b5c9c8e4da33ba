# SPDX-License-Identifier: GPL-3.0-or-later
"""Injection: a hostile text is rejected, or stays text, at every place where text enters the package.

The first test shows that the attempts are real: ngspice itself runs such a line. ``make test`` has one place of each
kind and the attempts that differ most; ``make fuzz`` tries all attempts at all places.
"""

import csv
import json
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.cli import run
from pyspice_runner.export.circuit import CircuitExport, circuit_library
from pyspice_runner.motor.circuit_file import is_circuit_file, load_circuit
from pyspice_runner.motor.document import MOST_BYTES
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.motor.motor import Provenance
from pyspice_runner.spice.library import read_library
from tests.data.spectra import make
from tests.motor.toml_text import toml
from tests.selection import mostly
from validation.fuzz.entry_points import clear, harmless, nothing_runs, warm
from validation.fuzz.nasty import ATTEMPTS, MARKER
from validation.fuzz.watch import watched

MOTOR = pr.load_motor("andersen2002")
DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3)
CIRCUIT = EquivalentCircuit((MotionalArm(159.0, 0.05, 5e-11),), 1e-9, 0.01, 1e5, 0.0, 0.0)
ONE_MODE: dict[str, Any] = {
    "name": "mine",
    "modes": [MOTOR.modes[1].model_dump()],
    **{part: getattr(MOTOR, part).model_dump() for part in ("piezo", "contact", "rotor")},
}
NAMES = re.compile(r"[A-Za-z0-9][A-Za-z0-9_. -]{0,59}")  # valid names, which no program runs
KINDS = (
    "number of a motor",
    "--set, path",
    "--over, values",
    "--output, ending",
    "measured spectrum",
    "name of a library",
)
TYPICAL = ("a line of its own", "a zero byte", "double quotes", "half a pair", "nothing")


@pytest.fixture(scope="module", autouse=True)
def _warm() -> None:
    warm()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder; nothing may be written outside of it."""
    inside = tmp_path / "here"
    inside.mkdir()
    monkeypatch.chdir(inside)
    monkeypatch.setenv("XDG_CACHE_HOME", str(inside))
    (inside / "measured.csv").write_bytes(make.FILES["plain.csv"])
    return inside


def test_ngspice_runs_a_shell_command_from_an_unprotected_deck(tmp_path: Path) -> None:
    deck = f"x\n.control\nshell touch {MARKER}\n.endc\nR1 a 0 1\nV1 a 0 1\n.op\n.end\n"
    (tmp_path / "deck.cir").write_text(deck, encoding="utf-8")
    subprocess.run(["ngspice", "-b", "deck.cir"], cwd=tmp_path, capture_output=True, timeout=20, check=False)
    assert (tmp_path / MARKER).exists()
    with pytest.raises(AssertionError, match="a line that is not ours"):
        harmless(deck)


# --- a name, a path or a number: rejected ---


def _toml(document: dict[str, Any]) -> Callable[[str], object]:
    """Load a document in which the attempt replaces the word ATTEMPT."""

    def load(text: str) -> object:
        written = toml(json.loads(json.dumps(document).replace('"ATTEMPT"', json.dumps(text))))
        Path("mine.toml").write_text(written, encoding="utf-8", errors="surrogatepass")
        return pr.load_motor("mine.toml")

    return load


def _command(*words: str) -> Callable[[str], object]:
    """Run a command line in which the attempt replaces the word ATTEMPT."""

    def call(text: str) -> object:
        with nothing_runs(), watched(Path.cwd()) as (out, err):
            status = run([word.replace("ATTEMPT", text) for word in words])
        assert (out.text + err.text).replace("\n", "").isprintable()
        if status in (2, 3):  # "Nothing is run here." comes last, after all checks
            raise pr.ParameterError("The command line is rejected.")
        return None

    return call


MODE = ONE_MODE["modes"][0]
TEXTS: dict[str, Callable[[str], object]] = {
    "name of a motor": _toml(ONE_MODE | {"name": "ATTEMPT"}),
    "name of a mode": _toml(ONE_MODE | {"modes": [MODE | {"name": "ATTEMPT"}]}),
    "key of a motor": _toml(ONE_MODE | {"ATTEMPT": 1.0}),
    "key of a contact": _toml(ONE_MODE | {"contact": ONE_MODE["contact"] | {"ATTEMPT": 1.0}}),
    "number of a motor": _toml(ONE_MODE | {"rotor": ONE_MODE["rotor"] | {"radius_m": "ATTEMPT"}}),
    "kind of provenance": _toml(
        ONE_MODE | {"rotor": ONE_MODE["rotor"] | {"radius_m": {"value": 0.01, "ATTEMPT": "why"}}}
    ),
    "updated name": lambda text: MOTOR.updated({"name": text}),
    "updated name of a mode": lambda text: MOTOR.updated({"modes.0.name": text}),
    "updated path": lambda text: MOTOR.updated({f"contact.{text}": 1.0}),
    "updated number": lambda text: MOTOR.updated({"contact.preload_n": text}),
    "motor": _command("show", "ATTEMPT"),
    "motor to export": _command("export", "ATTEMPT", "--output=out.lib"),
    "--set, path": _command("show", "andersen2002", "--set=ATTEMPT=5"),
    "--set, value": _command("show", "andersen2002", "--set=contact.preload_n=ATTEMPT"),
    "--over, path": _command("sweep", "andersen2002", "--over=ATTEMPT=5,6"),
    "--over, values": _command("sweep", "andersen2002", "--over=contact.preload_n=ATTEMPT"),
    "--tolerance, path": _command("sweep", "andersen2002", "--tolerance=ATTEMPT=5%"),
    "--tolerance, value": _command("sweep", "andersen2002", "--tolerance=contact.friction=ATTEMPT"),
    "--drive": _command("simulate", "andersen2002", "--drive=ATTEMPT"),
    "--duration": _command("simulate", "andersen2002", "--duration=ATTEMPT"),
    "--signals": _command("simulate", "andersen2002", "--signals=ATTEMPT"),
    "--speeds": _command("speed-torque", "andersen2002", "--speeds=ATTEMPT"),
    "--driver": _command("drive", "andersen2002", "--driver=ATTEMPT"),
    "--driver, name in a file": _command("drive", "andersen2002", "--driver=my.lib:ATTEMPT"),
    "--mosfet": _command("drive", "andersen2002", "--driver=half-bridge", "--mosfet=ATTEMPT:x"),
    "--part, name": _command("drive", "andersen2002", "--part=ATTEMPT=5"),
    "--part, value": _command("drive", "andersen2002", "--part=supply_v=ATTEMPT"),
    "--output, ending": _command("export", "andersen2002", "--output=out.ATTEMPT"),
    "--plot, ending": _command("show", "andersen2002", "--plot=out.ATTEMPT"),
    "measured spectrum": _command("fit", "ATTEMPT"),
    "trace": _command("fit", "measured.csv", "--trace=ATTEMPT"),
    "--tip": _command("fit", "measured.csv", "--two-port", "--mass-kg=1", "--tip=ATTEMPT"),
    "--at": _command("compare", "measured.csv", "andersen2002", "--at=ATTEMPT"),
    "law of the contact": lambda text: motor_library(MOTOR, contact=text),  # type: ignore[arg-type]
    "name of a subcircuit": lambda text: circuit_library(CIRCUIT, name=text),
    "name of a library": read_library,
    "kind of a tracker": lambda text: pr.Tracker(kind=text, voltage=1.0, frequency=5e4),
    "distribution": lambda text: pr.Tolerance(0.1, text),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("place", mostly(pytest.mark.fuzz, TEXTS, KINDS))
def test_a_hostile_text_is_rejected(place: str, folder: Path) -> None:
    for what, text in ATTEMPTS.items():
        try:
            with watched(folder):
                TEXTS[place](text)
        except (pr.ParameterError, pr.SpectrumError, pr.SimulationError) as error:
            assert clear(str(error)), what  # noqa: PT017 - if it is rejected

        else:  # a plain word, such as nan, is a valid name
            assert "name" in place, what
            assert NAMES.fullmatch(text), what
        assert not list(folder.parent.rglob(MARKER)), what
        assert [path.name for path in folder.parent.iterdir()] == ["here"], what


# --- free text: it stays text ---

READ_AGAIN = {what: text[: MOST_BYTES // 2] for what, text in ATTEMPTS.items()}  # a longer file is refused, see below


@pytest.mark.parametrize("what", mostly(pytest.mark.fuzz, READ_AGAIN, TYPICAL))
@pytest.mark.usefixtures("folder")
def test_the_provenance_of_a_value_is_not_written_to_a_netlist(what: str) -> None:
    words = {"contact.friction": Provenance("assumed", READ_AGAIN[what]), "rotor.radius_m": Provenance("given", "")}
    motor = MOTOR.model_copy(update={"provenance": words})
    Path("mine.toml").write_text(motor.to_toml(), encoding="utf-8")
    again = pr.load_motor("mine.toml")
    assert again.to_dict() == motor.to_dict()
    assert again.provenance["contact.friction"].note == READ_AGAIN[what].replace("\udcff\ud800", "??")
    assert motor_library(again) == motor_library(MOTOR)
    harmless(str(motor_bench(again, DriveSource(DRIVE)).circuit))


@pytest.mark.parametrize("what", mostly(pytest.mark.fuzz, READ_AGAIN, TYPICAL))
@pytest.mark.usefixtures("folder")
def test_a_title_stays_on_one_line_in_every_format(what: str) -> None:
    for ending in (".lib", ".asy", ".kicad_sym", ".s1p", ".toml"):
        plain, made = (
            CircuitExport(CIRCUIT, title).save(f"out{ending}").read_text(encoding="utf-8").splitlines()
            for title in ("a fit", READ_AGAIN[what] or "x")
        )
        assert len(made) == len(plain)
        ((before, after),) = [pair for pair in zip(plain, made, strict=True) if pair[0] != pair[1]]
        assert after.startswith(before[: before.index("a fit")])
        assert after.count('"') == before.count('"') or ending not in (".asy", ".kicad_sym")
    assert load_circuit("out.toml") == CIRCUIT
    assert pr.read_spectrum("out.s1p").ports == 1
    harmless(Path("out.lib").read_text(encoding="utf-8"))


@pytest.mark.parametrize("ending", [".asy", ".kicad_sym"])
def test_a_symbol_holds_the_name_of_its_file_as_text(ending: str, folder: Path) -> None:
    plain = pr.export_motor(MOTOR, f"plain{ending}").read_text(encoding="utf-8")
    for what, text in ATTEMPTS.items():
        name = text.replace("/", "_") + ending
        try:
            with watched(folder):
                made = pr.export_motor(MOTOR, name).read_text(encoding="utf-8")
        except pr.ParameterError as error:
            assert clear(str(error)), what  # noqa: PT017 - if it is rejected
        else:
            assert made.replace(f"{Path(name).stem}.lib", "plain.lib") == plain, what
            assert "\n" not in name
            assert not {'"', "\\"} & set(name), what


@pytest.mark.usefixtures("folder")
def test_the_name_of_a_spectrum_is_shown_literally(capsys: pytest.CaptureFixture[str]) -> None:
    name = r"$\frac{1}{$ [bold]x[link=y] :bomb: \N{BOMB}, 'q'.csv".replace(r"\N{BOMB}", "\N{BOMB}")
    Path(name).write_bytes(make.FILES["plain.csv"])
    assert run(["fit", name, "--modes=2", "--plot=fit.png", "--output=fit.lib"]) == 0
    shown = capsys.readouterr()
    assert name in " ".join(shown.out.split())
    assert shown.err == ""  # such as the warning that a font has no bomb
    harmless(Path("fit.lib").read_text(encoding="utf-8"))
    words = ["compare", name, "measured.csv", "--modes=2", "--label=$x^{", "--at=1"]
    assert run([*words, "--output=table.csv", "--plot=fit.png"]) == 0
    with Path("table.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert {row[0] for row in rows[1:]} == {name}
    assert {len(row) for row in rows} == {len(rows[0])}


def test_a_valid_name_of_ngspice_commands_runs_none_of_them(folder: Path) -> None:
    modes = tuple(
        mode.model_copy(update={"name": name}) for mode, name in zip(MOTOR.modes, ("shell", "include"), strict=True)
    )
    name = f"shell touch {MARKER} .control .include"
    motor = MOTOR.model_copy(update={"name": name, "modes": modes})
    assert pr.simulate(pr.Motor.model_validate(motor), DRIVE, duration=5e-5).provenance["motor"]["name"] == name
    Path("motor.lib").write_text(motor_library(motor), encoding="utf-8")
    deck = f"{name}\n.include motor.lib\nVa a 0 1\nXm a a 0 s piezomotor\n.op\n.end\n"
    Path("deck.cir").write_text(deck, encoding="utf-8")
    done = subprocess.run(["ngspice", "-b", "deck.cir"], capture_output=True, text=True, timeout=20, check=False)
    assert name.lower() in done.stdout.lower()  # it was read, as a title
    assert not list(folder.parent.rglob(MARKER))


# --- files that are not regular files ---


@pytest.mark.parametrize(
    ("loads", "name"), [(pr.load_motor, "x.toml"), (load_circuit, "x.toml"), (load_circuit, "x.json")]
)
def test_a_pipe_a_device_and_a_huge_file_are_rejected(loads: Callable[[Path], object], name: str, folder: Path) -> None:
    path = folder / name
    os.mkfifo(path)
    with watched(folder), pytest.raises(pr.ParameterError, match=r"no file|not a regular file"):
        loads(path)
    with watched(folder):
        assert is_circuit_file(path) == (name == "x.json")
    path.unlink()
    path.symlink_to("/dev/zero")
    with watched(folder), pytest.raises(pr.ParameterError, match=r"no file|not a regular file"):
        loads(path)
    path.unlink()
    with path.open("wb") as file:
        file.truncate(2**40)  # a sparse file of a terabyte
    with watched(folder), pytest.raises(pr.ParameterError, match=r"the limit is 0\.25 MiB"):
        loads(path)
