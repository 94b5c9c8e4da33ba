# SPDX-License-Identifier: GPL-3.0-or-later
"""The exercise of CONTRIBUTING: a new contact law is one library and one line, and everything takes it."""

import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit import law as laws
from pyspice_runner.circuit.law import Law
from pyspice_runner.cli import run
from pyspice_runner.spice import library
from pyspice_runner.sweeps.task import versions_here
from pyspice_runner.view import live_circuit

SHARP = "piezomotor_sharp"  # Coulomb friction, regularised by a root instead of a hyperbolic tangent
LINE = {"sharp": SHARP}
MOTOR = pr.load_motor("bimodal40")
DRIVE = pr.default_drive(MOTOR)


@pytest.fixture(autouse=True)
def new_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Put the library beside copies of the others, and the line into the list."""
    copies = shutil.copytree(library.data_path("behavioral"), tmp_path / "behavioral")
    text = (copies / "piezomotor_coulomb.lib").read_text(encoding="utf-8").replace("piezomotor_coulomb", SHARP)
    friction = "{mu}*V(normal)*tanh(V(slip)/{creep})"
    assert friction in text
    root = "{mu}*V(normal)*V(slip)/sqrt(V(slip)*V(slip)+{width*width})"
    text = text.replace(friction, root).replace("{creep}", "{width}").replace("creep=10m", "width=10m")
    (copies / f"{SHARP}.lib").write_text(text.replace("* PAR  creep", "* PAR  width"), encoding="utf-8")
    versions_here()  # without it, as the workers of later sweeps have them
    monkeypatch.setattr(library, "__file__", tmp_path / "package" / "spice" / "library.py")
    monkeypatch.setattr(laws, "LAWS", laws.LAWS | LINE)
    monkeypatch.setattr(live_circuit, "LAWS", laws.LAWS)
    library.library_names.cache_clear()
    yield
    library.library_names.cache_clear()


def test_it_runs_and_its_own_parameter_has_a_path() -> None:
    wide = MOTOR.updated({"law.width": 0.05})
    plain, other = (pr.simulate(motor, DRIVE, duration=1e-4, contact="sharp") for motor in (MOTOR, wide))
    assert np.abs(plain.friction_force_n - other.friction_force_n).max() > 0.1
    for motor, change in ((MOTOR, {"law.creep": 1.0}), (MOTOR, {"law.width": -1.0})):
        with pytest.raises(pr.ParameterError, match=r"law\.(creep|width)"):
            pr.simulate(motor.updated(change), DRIVE, duration=1e-4, contact="sharp")


def test_the_toml_of_the_motor_holds_the_parameter(tmp_path: Path) -> None:
    path = tmp_path / "wide.toml"
    path.write_text(MOTOR.updated({"law.width": 0.05}).to_toml(), encoding="utf-8")
    assert pr.load_motor(str(path)).law == {"width": 0.05}
    assert "law" not in MOTOR.to_dict()


def test_a_steady_state_moves_with_the_parameter_as_in_a_sweep() -> None:
    torques = [
        pr.steady_state(MOTOR.updated({"law.width": width}), DRIVE, speed=0.0, contact="sharp").torque_n_m
        for width in (0.01, 0.05)
    ]
    assert torques[0] < 0.99 * torques[1]
    swept = pr.sweep(  # in this process, which alone has the law
        MOTOR, DRIVE, over={"law.width": [0.01, 0.05]}, quantities=["torque_n_m"], analysis=pr.steady_state,
        executor=ThreadPoolExecutor(1), contact="sharp", speed=0.0,
    )  # fmt: skip
    np.testing.assert_allclose(swept["torque_n_m"], torques, rtol=1e-9)
    assert swept["law.width"].attrs["units"] == "m/s"


@pytest.mark.soak
def test_a_calibration_finds_the_parameter(tmp_path: Path) -> None:
    points = tmp_path / "points.csv"
    lines = ["speed_rad_s,torque_n_m,torque_n_m_error"]
    for speed in (5.0, 20.0):
        state = pr.steady_state(MOTOR.updated({"law.width": 0.2}), DRIVE, speed=speed, contact="sharp")
        lines.append(f"{speed},{state.torque_n_m!r},{1e-3 * abs(state.torque_n_m)!r}")
    points.write_text("\n".join(lines) + "\n", encoding="utf-8")
    fit = pr.calibrate(MOTOR.updated({"law.width": 0.1}), str(points), free=["law.width"], contact="sharp", drive=DRIVE)
    (found,) = fit.estimates
    assert found.path == "law.width"
    assert found.value == pytest.approx(0.2, rel=0.02)


def test_help_and_live_page_name_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert "sharp" in live_circuit.laws(MOTOR)
    assert Law("sharp").own.keys() == {"width"}
    assert run(["simulate", "bimodal40", "--contact", "sharp", "--duration", "1e-4", "--set", "law.width=0.05"]) == 0
    capsys.readouterr()
    assert run(["simulate", "--help"]) == 0
    assert "coulomb" in capsys.readouterr().out  # of the list in which the line stands
