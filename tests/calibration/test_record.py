# SPDX-License-Identifier: GPL-3.0-or-later
"""The file of a calibration, as the report reads it."""

import json
from pathlib import Path
from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.result import Record
from tests.calibration.test_calibrate import SET, truth_and_points


def test_the_file_of_a_calibration_has_its_values_and_residuals(tmp_path: Path) -> None:
    columns = truth_and_points({"contact.friction": 0.25}, [4.0, 12.0])
    result = pr.calibrate(pr.load_motor(SET), columns, free=["contact.friction"])
    record = Record.read(result.save(tmp_path / "result.json"))
    (one,) = result.estimates
    assert record.parameters["contact.friction"].value == one.value
    assert record.parameters["contact.friction"].interval_95 == one.interval_95
    residuals = [point.residual for point in record.points]
    assert residuals == pytest.approx(result.columns()["residual"], rel=1e-9)
    assert [fit.values for fit in record.fits] == [4]
    drive = pr.default_drive(result.motor)
    again = pr.load_motor(result.save(tmp_path / "calibrated.toml"))
    assert record.differing(again, drive) == []
    assert record.differing(pr.load_motor(SET), drive) == ["contact.friction"]


@pytest.mark.parametrize("document", [[], {}, {"motor": "andersen2002", "fits": []}, "text", float("nan")])
def test_another_file_is_refused_before_any_run(tmp_path: Path, document: Any) -> None:
    file = tmp_path / "other.json"
    file.write_text(json.dumps(document), encoding="utf-8")
    motor = pr.load_motor(SET)
    with pytest.raises(pr.ParameterError, match="is not the result of a calibration"):
        pr.report(motor, pr.default_drive(motor), calibration=file)
