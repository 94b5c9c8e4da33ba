# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit`` as a user types it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from tests.motors import BEAM40
from tests.resonators import resonator, spectrum
from tests.said import output, printed, refusal

CIRCUIT = resonator([20e3, 33e3], [120.0, 300.0], [0.05, 0.02], reference=25e3)
SPECTRA = Path(__file__).parent / "data" / "spectra"


@pytest.fixture
def measured(tmp_path: Path) -> str:
    return str(spectrum(CIRCUIT, np.linspace(15e3, 40e3, 801), noise=0.005).save(tmp_path / "measured.csv"))


def test_fit_prints_the_documented_json(measured: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fit", measured, "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    document = json.loads(out)
    assert {
        "format", "points", "arms", "clamped_capacitance_f", "loss_tangent", "coupling_factor", "rms_relative_error",
        "warnings",
    } <= document.keys()  # fmt: skip
    assert (document["points"], len(document["arms"])) == (801, 2)
    assert document["arms"][0]["series_resonance_hz"] == pytest.approx(20e3, rel=1e-4)
    assert [item["arms"] for item in document["candidates"]] == [1, 2, 3]


def test_fit_prints_a_table_and_writes_the_requested_files(
    measured: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    targets = [tmp_path / "fit.lib", tmp_path / "fit.png"]
    assert run(["fit", measured, "--modes", "2", "--output", str(targets[0]), "--plot", str(targets[1])]) == 0
    out, err = capsys.readouterr()
    assert "20 kHz" in out
    assert "clamped capacitance" in out
    assert err == ""
    assert "2 arms" in out
    assert re.search(r"main arm by one arm +│ R1 1\.\d+\skΩ, L1 1\.\d+\sH, C1 50\.\d+\spF, Q 1\d\d", out)
    assert out.count("±") == 2 * 5 + 2 + 1  # five values of each arm, clamped capacitance, loss tangent, and the title
    assert ".subckt resonator p n" in targets[0].read_text(encoding="ascii")
    assert targets[1].stat().st_size > 20_000


def test_a_table_in_a_pipe_fits_a_terminal(measured: str, monkeypatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    out = output(["fit", measured, "--modes", "2"], capsys)
    assert max(map(len, out.splitlines())) == 80
    assert out.count("±") == 13  # as in a wide table: nothing is lost


def test_fit_of_a_part_of_the_band(measured: str, capsys: pytest.CaptureFixture[str]) -> None:
    document = printed(["fit", measured, "--start", "28e3", "--stop", "38e3"], capsys)
    assert (document["start_hz"], document["stop_hz"]) == (28e3, 38e3)
    # within a fifth of its bandwidth: what the mode that was cut off leaves in the band biases it
    assert document["arms"][-1]["series_resonance_hz"] == pytest.approx(33e3, abs=22.0)
    assert "fewer than 2 points from 50000 Hz" in refusal(["fit", measured, "--start", "50e3"], capsys)


def test_fit_of_a_two_port_takes_a_connection(capsys: pytest.CaptureFixture[str]) -> None:
    found = []
    for connection in ("A", "B"):
        assert run(["fit", str(SPECTRA / "two_port.csv"), "--modes", "2", "--connection", connection, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["clamped_capacitance_f"])
    assert found[1] == pytest.approx(1.1 * found[0], rel=1e-3)


def test_fit_reports_repairs_on_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fit", str(SPECTRA / "hp4294a_turned.txt")]) == 0
    assert "off by 180°" in capsys.readouterr().err


def test_every_command_that_reads_a_spectrum_takes_columns(
    measured: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = Path(measured).read_text(encoding="utf-8").splitlines()[1:]
    bare = "\n".join(row.replace(",", ";").replace(".", ",") for row in [*rows, ""])
    Path("bare.csv").write_text(bare, encoding="utf-8")
    columns = ["--columns", "frequency_hz, conductance_s, susceptance_s"]
    assert run(["fit", "bare.csv"]) == 2
    assert "or the columns given by --columns frequency_hz,magnitude_ohm,phase_deg" in capsys.readouterr().err
    first, second = (printed(words, capsys) for words in (["fit", measured], ["fit", "bare.csv", *columns]))
    assert first["arms"] == second["arms"]
    assert printed(["compare", "bare.csv", "bare.csv", *columns], capsys)["comparisons"][0]["rms_deviation"] < 0.01
    wrong = ["--columns", "frequency_hz,magnitud_ohm,phase_deg"]
    for words in (["fit", "bare.csv"], ["compare", "bare.csv", "andersen2002"], ["report", "andersen2002", "--measured",
        "bare.csv"], ["fit", "bare.csv", "--b", "bare.csv", "--sum", "bare.csv"]):  # fmt: skip
        assert "columns: there is no 'magnitud_ohm'. Did you mean 'magnitude_ohm'?" in refusal([*words, *wrong], capsys)
    assert run(["report", "andersen2002", *columns]) == 2
    assert "--columns has no effect without --measured. Leave it out." in capsys.readouterr().err


def test_fit_of_a_shunt_between_two_ports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frequency = np.linspace(15e3, 40e3, 801)
    z = 1.0 / CIRCUIT.admittance(frequency)
    s11, s21 = -50.0 / (50.0 + 2.0 * z), 2.0 * z / (50.0 + 2.0 * z)
    rows = np.array([frequency, *(part for s in (s11, s21, s21, s11) for part in (s.real, s.imag))]).T.tolist()
    path = tmp_path / "shunt.s2p"
    path.write_text("\n".join(["# Hz S RI R 50", *(" ".join(map(repr, row)) for row in rows), ""]), encoding="ascii")
    for words in ([], ["--through", "shunt"]):
        document = printed(["fit", str(path), "--modes", "2", *words], capsys)
        assert document["arms"][0]["series_resonance_hz"] == pytest.approx(20e3, rel=1e-6)
        told = [warning for warning in document["warnings"] if "from the line to ground (a shunt)" in warning]
        assert len(told) == (0 if words else 1)


def test_timeout_ends_a_fit_and_a_comparison(measured: str, capsys: pytest.CaptureFixture[str]) -> None:
    two_port = [str(SPECTRA / "two_port.csv"), "--two-port"]
    for words in (["fit", measured], ["fit", *two_port], ["compare", measured, measured]):
        assert "did not end within the time allowed" in refusal([*words, "--timeout", "1e-6"], capsys)
        assert run([*words, "--timeout", "0"]) == 2
        assert "timeout = 0 is not valid: it must be a number of seconds > 0" in capsys.readouterr().err
    assert run(["fit", measured, "--modes", "2", "--timeout", "600", "--json"]) == 0


def test_fit_rejects_input_in_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frequency = np.geomspace(1e3, 1e5, 401)
    coil = pr.Spectrum.from_impedance(frequency, 1.0 + 2j * np.pi * frequency * 2e-4).save(tmp_path / "coil.csv")
    assert run(["fit", str(coil)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("piezomotor: coil.csv is not capacitive at any frequency")
    assert "No such file" in refusal(["fit", str(tmp_path / "absent.csv"), "--json"], capsys)
    assert "let it end in" in refusal(["fit", str(coil), "--output", str(tmp_path / "fit.xyz")], capsys)


# --- both groups ---


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The four spectra of the paper's motor, and all in one file."""
    folder = tmp_path_factory.mktemp("bench")
    result = pr.admittance(pr.load_motor("andersen2002"), start=8e3, stop=70e3, points=600)
    spectrum = pr.Spectrum.from_admittance(result.frequency_hz, result.matrix_s)
    spectrum.save(folder / "both.csv")
    for connection in ("A", "B", "A+B", "A-B"):
        spectrum.driven(connection).save(folder / f"{connection}.csv")  # type: ignore[arg-type]
    return folder


def test_four_spectra_and_a_mass_make_a_motor_that_runs(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    motor, expected = str(tmp_path / "motor.toml"), pr.load_motor("andersen2002")
    masses = ",".join(str(mode.mass_kg) for mode in expected.modes)
    files = [str(bench / f"{name}.csv") for name in ("A", "B", "A+B", "A-B")]
    words = ["fit", files[0], "--b", files[1], "--sum", files[2], "--difference", files[3], "--output", motor, "--json"]
    words += ["--mass-kg", masses, "--tip", "0,1", "--tip", "2.2520976710522804,0"]
    document = json.loads(output(words, capsys))
    assert [mode["coupling_b_n_per_v_kg05"] > 0.0 for mode in document["modes"]] == [True, False]
    assert [mode["mass_kg"] for mode in document["motor"]["modes"]] == [mode.mass_kg for mode in expected.modes]
    for name in (motor, "andersen2002"):  # the motor of a fit has neither a recommended drive nor a mount
        options = ["--frequency", "54e3", "--voltage", "50", "--duration", "1e-4", "--set", "mount=none"]
        assert run(["simulate", name, *options, "--json"]) == 0
    of_fit, of_truth = map(json.loads, capsys.readouterr().out.splitlines())
    assert of_fit["mean_rotor_speed_rad_s"] == pytest.approx(of_truth["mean_rotor_speed_rad_s"], rel=1e-3)


@pytest.mark.soak
def test_a_two_port_file_gives_the_same_motor(bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    both = str(bench / "both.csv")
    out = " ".join(output(["fit", both, "--two-port"], capsys).split())
    assert "couplings in N/V" in out
    assert out.count("±") == 2 * 2 + 1  # both couplings of both modes, and the title
    words = ["fit", both, "--two-port", "--velocity-per-current", "31.79", "--output", str(tmp_path / "motor.toml")]
    assert run(words) == 0
    mode = pr.load_motor(tmp_path / "motor.toml").modes[0]
    assert mode.coupling_a_n_per_v == pytest.approx(1.0 / 31.79, rel=1e-6)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["fit", "both.csv", "--mass-kg", "1e-3"], "belong to --two-port"),
        (["fit", "both.csv", "--two-port", "--tip", "0,1"], "add --mass-kg or --velocity-per-current"),
        (["fit", "both.csv", "--two-port", "--mass-kg", "1e-3", "--tip", "1"], "write X,Y as 0,1"),
        (["fit", "both.csv", "--two-port", "--mass-kg", "x"], "--mass-kg"),
        (["fit", "both.csv", "--two-port", "--plot", "x.png"], "--plot draws one connection"),
        (["fit", "both.csv", "--two-port", "--output", "x.toml"], "let it end in .json"),
        (["fit", "both.csv", "--two-port", "--b", "both.csv"], "--two-port takes one file"),
        (["fit", "both.csv", "--two-port", "--leads", "none"], "--leads has no effect where both groups are fitted"),
        (["fit", "both.csv", "--two-port", "--open", "both.csv"], "--open has no effect"),
        (["fit", "both.csv", "--two-port", "--with", "both.csv"], "--with has no effect"),
        (["fit", "both.csv", "--two-port", "--base", BEAM40], "--base has no effect without --mass-kg"),
        (
            ["fit", "both.csv", "--two-port", "--connection", "B"],
            "--connection has no effect where both groups are fitted",
        ),
        (["fit", "both.csv", "--two-port", "--mass-kg", "1e-3", "--connection", "B"], "without --velocity-per-current"),
        (["fit", "both.csv", "--two-port", "--start", "1e6"], "from 1e+06 Hz to inf Hz"),
        (["fit", "both.csv", "--base", BEAM40], "--base has no effect without --two-port"),
        (["fit", "both.csv", "--load-ohm", "75"], "--load-ohm has no effect without --load"),
        (["fit", "A.csv", "--mass-kg", ""], "--mass-kg, --velocity-per-current and --tip belong to --two-port or --b"),
        (["fit", "both.csv", "--two-port", "--mass-kg", ""], "--mass-kg: '' is not valid"),
        (["fit", "A.csv", "--connection", "B"], "--connection has no effect on A.csv, which has one port"),
        (["compare", "A.csv", "B.csv", "--connection", "B"], "--connection has no effect on spectra of one port"),
        (["compare", "A.csv", "B.csv", "--state", "preloaded"], "--state has no effect on a spectrum"),
        (["compare", "A.csv", "B.csv", "--label", "age"], "--label has no effect without --at"),
        (["motor-from", "both.csv", "--mass-kg", "1e-3", "--voltage", "9"], "--voltage has no effect without"),
        (["motor-from", "both.csv", "--mass-kg", "1e-3", "--torque-error", "1"], "--torque-error has no effect"),
        (
            ["motor-from", "both.csv", "--no-load-speed", "1", "--mass-kg", "1e-3", "--speed-error", "1"],
            "or with --mass-kg",
        ),
        (["motor-from", "both.csv", "--mass-kg", "1e-3", "--connection", "B"], "without a --preloaded two-port"),
        (["export", "andersen2002", "--contact", "brush", "--output", "m.asy"], "--contact has no effect on a .asy"),
        (["export", "andersen2002", "--name", "other", "--output", "m.s2p"], "--name has no effect on a .s2p"),
        (["export", "andersen2002", "--thermal", "--output", "m.toml"], "--thermal has no effect on a .toml"),
    ],
)
def test_options_that_do_not_fit_what_is_given_are_errors(
    words: list[str], says: str, bench: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(bench)
    assert says in " ".join(refusal(words, capsys).split())
