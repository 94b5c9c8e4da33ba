# SPDX-License-Identifier: GPL-3.0-or-later
"""The KiCad example in KiCad 9: it opens, passes the electrical rules check, and its netlist runs. ``make kicad``.

``python -m tests.tools.kicad`` draws the schematic again for the page that shows it.
"""

import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from tests.circuit.batch import batch

ROOT = Path(__file__).parents[2]
KICAD = ROOT / ".tools" / "kicad" / "bin" / "kicad-cli"
PICTURE = ROOT / "docs" / "pictures" / "kicad.svg"
CUT = (80, 66, 88, 66)  # mm on the sheet: left, top, width, height


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(shutil.copytree(ROOT / "examples" / "kicad", tmp_path_factory.mktemp("kicad") / "project"))


def kicad(project: Path, *words: str) -> str:
    done = subprocess.run(
        [KICAD, "sch", *words], cwd=project, capture_output=True, text=True, timeout=120, check=False,
        env={"HOME": str(project.parent), "PATH": "/usr/bin:/bin"},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def test_the_electrical_rules_check_finds_nothing(project: Path) -> None:
    kicad(project, "erc", "--severity-all", "--format", "json", "--output", "erc.json", "motor.kicad_sch")
    report = json.loads((project / "erc.json").read_text(encoding="utf-8"))
    assert report["kicad_version"].startswith("9.")
    assert [found for sheet in report["sheets"] for found in sheet["violations"]] == []


def picture(project: Path) -> str:
    """Return the drawing as KiCad exports it, cut to what is on the sheet, and without the date."""
    kicad(project, "export", "svg", "--exclude-drawing-sheet", "--output", "drawn", "motor.kicad_sch")
    text = re.sub(r"<title>.*?</title>\n", "", (project / "drawn" / "motor.svg").read_text(encoding="utf-8"))
    x, y, width, height = CUT
    size = f'width="{width}mm" height="{height}mm" viewBox="{x} {y} {width} {height}"'
    return re.sub(r'width="\S+mm" height="\S+mm" viewBox="[^"]+"', size, text, count=1)


def test_the_picture_in_the_documentation_is_that_of_the_schematic(project: Path) -> None:
    assert PICTURE.read_text(encoding="utf-8") == picture(project), "run: python -m tests.tools.kicad"


@pytest.fixture(scope="module")
def netlist(project: Path) -> list[str]:
    """Return the lines of the netlist that KiCad exports, without its end."""
    said = kicad(project, "export", "netlist", "--format", "spice", "--output", "motor.cir", "motor.kicad_sch")
    assert "annotation" not in said
    lines = (project / "motor.cir").read_text(encoding="utf-8").splitlines()
    assert [line.split()[0] for line in lines if line.startswith((".tran", ".ac"))] == [".tran", ".ac"]
    return [line for line in lines if line != ".end"]


def ngspice(project: Path, lines: list[str]) -> str:
    return batch(project / "deck.cir", "\n".join([*lines, ".end", ""]))


def test_the_transient_of_the_exported_netlist_is_that_of_simulate(project: Path, netlist: list[str]) -> None:
    lines = [line.replace(" 5m ", " 500u ") for line in netlist if not line.startswith(".ac")]  # shorter
    said = ngspice(project, [*lines, ".measure tran speed_end FIND v(/shaft) AT=499u"])
    speed = float(re.findall(r"speed_end\s*=\s*(\S+)", said)[0])
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    run = pr.simulate(motor, drive, duration=0.5e-3)
    # without the exact resonance modes resonate 9e-5 low at 100 ns, which changes the phase after 20 periods by 0.01
    assert speed == pytest.approx(float(np.interp(499e-6, run.time_s, run.rotor_speed_rad_s)), rel=0.02)


def test_the_ac_analysis_of_the_exported_netlist_is_the_admittance_of_the_preloaded_stator(
    project: Path, netlist: list[str]
) -> None:
    """Group B is short-circuited for small signals; 1e-6 for the digits that ngspice writes."""
    lines = [line for line in netlist if not line.startswith(".tran")]
    ngspice(project, [*lines, ".control", "run", "wrdata ac.txt real(i(v1)) imag(i(v1))", "quit 0", ".endc"])
    frequency, real, _, imaginary = np.loadtxt(project / "ac.txt").T
    motor = pr.load_motor("bimodal40")
    expected = pr.admittance(motor, start=30e3, stop=50e3, points=len(frequency), state="preloaded")
    assert frequency == pytest.approx(expected.frequency_hz)
    own = expected.matrix_s[:, 0, 0]
    assert np.abs(-real - 1j * imaginary - own).max() < 1e-6 * np.abs(own).max()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        PICTURE.write_text(picture(Path(shutil.copytree(ROOT / "examples" / "kicad", Path(folder) / "project"))))
