# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor fit`` as a user types it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from tests.resonators import resonator, spectrum

CIRCUIT = resonator([20e3, 33e3], [120.0, 300.0], [0.05, 0.02], reference=25e3)
SPECTRA = Path(__file__).parent / "data" / "spectra"


@pytest.fixture
def measured(tmp_path: Path) -> str:
    return str(spectrum(CIRCUIT, np.linspace(15e3, 40e3, 801), noise=0.005).to_csv(tmp_path / "measured.csv"))


def test_fit_prints_the_json_that_others_rely_on(measured: str, capsys: pytest.CaptureFixture[str]) -> None:
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


def test_fit_prints_a_table_and_writes_what_is_asked(
    measured: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    targets = [tmp_path / "fit.lib", tmp_path / "fit.png"]
    assert run(["fit", measured, "--modes", "2", "--output", str(targets[0]), "--plot", str(targets[1])]) == 0
    out, err = capsys.readouterr()
    assert "20\N{NO-BREAK SPACE}kHz" in out
    assert "clamped capacitance" in out
    assert err == ""
    assert "2 arms" in out
    assert ".subckt resonator p n" in targets[0].read_text(encoding="ascii")
    assert targets[1].stat().st_size > 20_000


def test_fit_of_a_two_port_takes_a_connection(capsys: pytest.CaptureFixture[str]) -> None:
    found = []
    for connection in ("A", "B"):
        assert run(["fit", str(SPECTRA / "two_port.csv"), "--modes", "2", "--connection", connection, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["clamped_capacitance_f"])
    assert found[1] == pytest.approx(1.1 * found[0], rel=1e-3)


def test_fit_tells_what_was_repaired_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fit", str(SPECTRA / "hp4294a_turned.txt")]) == 0
    assert "off by 180°" in capsys.readouterr().err


def test_fit_refuses_in_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frequency = np.geomspace(1e3, 1e5, 401)
    coil = pr.Spectrum.from_impedance(frequency, 1.0 + 2j * np.pi * frequency * 2e-4).to_csv(tmp_path / "coil.csv")
    assert run(["fit", str(coil)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("piezomotor: coil.csv is not capacitive at any frequency")
    assert run(["fit", str(tmp_path / "absent.csv"), "--json"]) == 2
    assert "No such file" in capsys.readouterr().err
    assert run(["fit", str(coil), "--output", str(tmp_path / "fit.xyz")]) == 2
    assert "let it end in" in capsys.readouterr().err
