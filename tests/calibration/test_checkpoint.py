# SPDX-License-Identifier: GPL-3.0-or-later
"""A calibration that is interrupted, and goes on from its file."""

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.estimate import Checkpoint
from pyspice_runner.calibration.points import read_points
from pyspice_runner.calibration.prediction import Predictor
from pyspice_runner.calibration.unknowns import unknowns_of
from pyspice_runner.circuit.law import Law, contact_library
from pyspice_runner.cli import run
from pyspice_runner.run.point import Point
from tests.calibration.test_calibrate import SET, truth_and_points

FREE = ["contact.friction"]


def calibrated(points: Any, **settings: Any) -> Any:
    return pr.calibrate(pr.load_motor(SET), points, **{"free": FREE} | settings)


def test_an_interrupted_calibration_goes_on_and_computes_fewer_steady_states(tmp_path: Path) -> None:
    points = truth_and_points({"contact.friction": 0.26}, [4.0, 12.0])
    counts: list[int] = []
    whole = calibrated(points, progress=counts.append)
    file = tmp_path / "unfinished.json"

    def stop(solved: int) -> None:
        if solved == whole.steady_states:  # in the intervals
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="start the same calibration again"):
        calibrated(points, progress=stop, checkpoint=file)
    with pytest.raises(pr.ParameterError, match="belongs to another calibration"):
        calibrated(points, checkpoint=file, priors={"contact.friction": 0.3})
    resumed = calibrated(points, checkpoint=file)
    assert not file.exists()
    assert resumed.steady_states < whole.steady_states
    for found, other in zip(resumed.estimates, whole.estimates, strict=True):
        # both searches end within 0.3 standard errors of the least sum of squares
        assert abs(found.value - other.value) < 0.6 * other.standard_error
        assert found.standard_error == pytest.approx(other.standard_error, rel=0.1)


POINTS = {"speed_rad_s": [4.0], "torque_n_m": [0.008]}


def test_an_interrupted_command_without_a_file_names_the_one_to_go_on_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    table, plain = tmp_path / "points.csv", pr.calibrate
    table.write_text("speed_rad_s,torque_n_m\n4,0.008\n", encoding="utf-8")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def stop(_: int) -> None:
        if any('"0"' in file.read_text(encoding="utf-8") for file in tmp_path.glob("piezomotor-kept-*/*.json")):
            raise KeyboardInterrupt

    monkeypatch.setattr(pr, "calibrate", lambda *data, **how: plain(*data, **how | {"progress": stop}))
    assert run(["calibrate", SET, "--points", str(table), "--free", "contact.friction"]) == 130
    (file,) = tmp_path.glob("piezomotor-kept-*/calibration.json")
    assert f"start the same calibration again to continue it: --resume {file}." in capfd.readouterr().err
    assert list(json.loads(file.read_text(encoding="utf-8"))["places"]) == ["0"]


@pytest.mark.parametrize("text", ["", "[]", '{"problem": "1", "places": {"0": [0.1, 0.2]}}', "[" * 10_000])
def test_a_damaged_file_is_refused_and_left_alone(tmp_path: Path, text: str, capfd: pytest.CaptureFixture[str]) -> None:
    table, file = tmp_path / "points.csv", tmp_path / "unfinished.json"
    table.write_text("speed_rad_s,torque_n_m\n4,0.008\n", encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    command = ["calibrate", SET, "--points", str(table), "--free", "contact.friction", "--resume", str(file)]
    assert run(command) == 2
    assert "is damaged. Remove it" in capfd.readouterr().err
    assert file.read_text(encoding="utf-8") == text


@pytest.mark.parametrize("name", ["unfinished.txt", "missing/unfinished.json"])
def test_a_place_that_cannot_be_written_is_reported_before_the_work_begins(tmp_path: Path, name: str) -> None:
    def never(_: int) -> None:
        raise AssertionError

    with pytest.raises(pr.ParameterError, match=r"No format follows|Cannot write"):
        calibrated(POINTS, checkpoint=tmp_path / name, progress=never)


def test_a_law_of_ones_own_whose_file_changed_is_another_problem(tmp_path: Path) -> None:
    text = f"* NEEDS piezomotor_normal\n{contact_library(Law('coulomb')).subcircuit}"
    own, file = tmp_path / "own.lib", tmp_path / "unfinished.json"
    own.write_text(text, encoding="utf-8")
    motor = pr.load_motor(SET)
    base = Point.of(motor, pr.default_drive(motor), contact=str(own))
    predictor = Predictor(base, unknowns_of(motor, base.drive, FREE), read_points(POINTS))
    Checkpoint(file, [predictor]).keep(0, np.array([0.1]))
    (kept,) = Checkpoint(file, [predictor]).place(0)
    assert kept == 0.1
    own.write_text(f"{text}\n* friction as measured in May\n", encoding="utf-8")
    assert Checkpoint(file, [predictor]).place(0) == kept  # a comment changes nothing
    own.write_text(text.replace("creep=10m", "creep=20m"), encoding="utf-8")
    with pytest.raises(pr.ParameterError, match="belongs to another calibration"):
        Checkpoint(file, [predictor])


def test_a_motor_without_the_structure_of_its_stator_is_another_problem(tmp_path: Path) -> None:
    motor, file = pr.load_motor("bimodal40"), tmp_path / "unfinished.json"
    damping = motor.modes[0].damping_n_s_per_m
    nominal = motor.updated({"modes.0.damping_n_s_per_m": damping})  # the same numbers, without the solid
    assert nominal.to_dict() == motor.to_dict()
    first, other = (
        Predictor(Point.of(one, drive), unknowns_of(one, drive, FREE), read_points(POINTS))
        for one, drive in ((motor, pr.default_drive(motor)), (nominal, pr.default_drive(nominal)))
    )
    Checkpoint(file, [first]).keep(0, np.array([0.1]))
    with pytest.raises(pr.ParameterError, match="belongs to another calibration"):
        Checkpoint(file, [other])


def test_an_interruption_before_the_first_refinement_leaves_no_file(tmp_path: Path) -> None:
    def stop(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as interrupt:
        calibrated(POINTS, checkpoint=tmp_path / "unfinished.json", progress=stop)
    assert str(interrupt.value) == ""
    assert list(tmp_path.iterdir()) == []
