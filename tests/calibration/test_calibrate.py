# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibration against data of a motor whose parameters are known, and what it refuses."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration import prediction
from pyspice_runner.calibration.points import read_points
from pyspice_runner.calibration.result import Record, Rival
from pyspice_runner.calibration.unknowns import unknowns_of
from pyspice_runner.cli import run
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import steady_states

SET = "andersen2002-unintended-mode"
CASES = Path(__file__).parents[1] / "data" / "cases"
ERRORS = {"torque_n_m": 1e-4, "current_a_rms_a": 4e-4}  # 1 % of their greatest value at this drive


def truth_and_points(
    changes: dict[str, float], speeds: list[float], noise: int | None = None, contact: Any = "spring-slider"
) -> dict[str, Any]:
    """Columns of measured points of a motor with changed values; with the noise of a seed, or without."""
    motor = pr.load_motor(SET).updated(changes)
    drive = pr.default_drive(motor)
    points = [Point.of(motor, drive, speed=speed, contact=contact, audit=False) for speed in speeds]
    states = steady_states(points)
    columns: dict[str, Any] = {"speed_rad_s": speeds}
    random = np.random.default_rng(noise)
    for name, error in ERRORS.items():
        values = np.array([getattr(state, name) for state in states])
        columns[name] = values + (0.0 if noise is None else error * random.standard_normal(len(values)))
        columns[f"{name}_error"] = np.full(len(values), error)
    return columns


def spectrum_of(motor: pr.Motor, start: float, stop: float, state: Any = "free", points: int = 201) -> Spectrum:
    found = pr.admittance(motor, start=start, stop=stop, points=points, state=state)
    return Spectrum.from_admittance(found.frequency_hz, found.matrix_s, source=f"{state}.csv")


def test_one_point_gives_back_the_friction_of_a_motor_that_slips(tmp_path: Path) -> None:
    columns = truth_and_points({"contact.friction": 0.25}, [4.0, 12.0])
    result = pr.calibrate(pr.load_motor(SET), columns, free=["contact.friction"])
    (found,) = result.estimates
    # Without noise the search ends within 0.3 standard errors, and its last step gains more than it states; the steps
    # of truth and fit differ by a tenth, which changes the torque by a tenth of its error.
    assert abs(found.value - 0.25) < 0.3 * found.standard_error
    # dT/dμ = T/μ of a contact that slips: two torques of 0.011 N·m with errors of 1e-4 give 0.25 · 0.01 / √2, and the
    # currents little. Speed and stick change the slope by some ten percent.
    assert found.standard_error == pytest.approx(0.25 * (1e-4 / 0.011) / np.sqrt(2.0), rel=0.3)
    low, high = found.interval_95
    assert (high - low) == pytest.approx(2 * 1.96 * found.standard_error, rel=0.3)
    rivals = (Rival("brush", result.aicc + 12.0, result.freedom, ("the points",)), Rival("coulomb", 0.0, 1, ()))
    told = replace(result, rivals=rivals).summary()
    assert told["law brush"] == "spring-slider fits better by 12 in AICc; brush does not explain the points"
    assert told["law coulomb"].startswith("not comparable")
    saved = pr.load_motor(result.save(tmp_path / "calibrated.toml"))
    assert saved.contact.friction == pytest.approx(found.value)
    assert "calibrated with the points" in saved.provenance["contact.friction"].note


def test_a_spectrum_gives_back_a_quality_factor_and_leaves_the_friction_open(tmp_path: Path) -> None:
    truth = pr.load_motor(SET).updated({"modes.2.quality_factor": 52.0})
    spectra = [(spectrum_of(truth, 49e3, 55e3, points=41), "free")]
    result = pr.calibrate(pr.load_motor(SET), free=["modes.2.quality_factor", "contact.friction"], spectra=spectra)
    quality, friction = result.estimates
    # the data have no noise: what is left is the end of the search
    assert abs(quality.value - 52.0) < 0.3 * quality.standard_error
    assert quality.identifiable
    assert not friction.identifiable  # a free tip touches nothing
    assert friction.value == pytest.approx(0.3, rel=1e-3)
    (warning,) = [one for one in result.warnings if "do not identify contact.friction" in one]
    assert "measure the torque at speeds at which the contact slips" in warning
    (curve,) = Record.read(result.save(tmp_path / "result.json")).curves
    assert (curve.data, curve.along) == ("free.csv (free)", "frequency_hz")
    assert curve.at == pytest.approx(np.linspace(49e3, 55e3, 41))
    residuals = [one.residuals for one in curve.quantities.values()]
    assert np.ravel(residuals) == pytest.approx(result.columns()["residual"])


@pytest.mark.soak
def test_spectra_give_back_quality_factors_and_stiffness_and_leave_the_friction_open() -> None:
    motor = pr.load_motor(SET)
    truth = motor.updated({
        "modes.1.quality_factor": 75.0, "modes.2.quality_factor": 52.0,
        "contact.normal_stiffness_n_per_m15": 0.8 * motor.contact.normal_stiffness_n_per_m15,
    })  # fmt: skip
    free = ["modes.*.quality_factor", "contact.normal_stiffness_n_per_m15", "contact.friction"]
    spectra = [(spectrum_of(truth, 40e3, 56e3), "free"), (spectrum_of(truth, 40e3, 60e3, "preloaded"), "preloaded")]
    result = pr.calibrate(motor, free=free, spectra=spectra)
    found = {one.path: one for one in result.estimates}
    for path, value in (("modes.1.quality_factor", 75.0), ("modes.2.quality_factor", 52.0),
                        ("contact.normal_stiffness_n_per_m15", truth.contact.normal_stiffness_n_per_m15)):  # fmt: skip
        # the data have no noise: what is left is the end of the search
        assert abs(found[path].value - value) < 0.3 * found[path].standard_error, path
        assert found[path].identifiable
    # mode 0 has its resonance at 13.5 kHz, below the spectra; a contact at rest does not slip
    assert not found["modes.0.quality_factor"].identifiable
    assert not found["contact.friction"].identifiable
    assert found["contact.friction"].value == pytest.approx(0.3, rel=1e-3)
    told = " ".join(result.warnings)
    assert "do not identify modes.0.quality_factor" in told
    assert "do not identify contact.friction" in told


@pytest.mark.soak
def test_the_law_of_the_measured_motor_fits_best() -> None:
    columns = truth_and_points({"contact.friction": 0.25}, [0.5, 2.0, 4.0, 6.0, 9.0, 12.0], noise=5, contact="brush")
    free = ["contact.friction", "modes.*.quality_factor"]
    result = pr.calibrate(pr.load_motor(SET), columns, free=free, against=["brush"])
    (brush,) = result.rivals
    assert brush.freedom == result.freedom
    assert brush.aicc < result.aicc
    assert result.summary()["law brush"].startswith("brush fits better by ")
    assert brush.misfits == ()


@pytest.mark.soak
def test_noisy_points_are_explained_and_outliers_are_named() -> None:
    truth = {"contact.friction": 0.25, "modes.1.quality_factor": 70.0}
    columns = truth_and_points(truth, [1.0, 4.0, 8.0, 12.0], noise=3)
    columns["torque_n_m"][2] *= 1.5
    result = pr.calibrate(pr.load_motor(SET), columns, free=list(truth))
    for one in result.estimates:
        assert abs(one.value - truth[one.path]) < 4.0 * one.standard_error  # one in 16,000 of a normal error
    assert any("Point 3: torque_n_m" in warning for warning in result.warnings)


@pytest.mark.soak
def test_a_calibrated_motor_predicts_another_voltage_within_its_band() -> None:
    truth = {"contact.friction": 0.25, "modes.1.quality_factor": 70.0}
    result = pr.calibrate(pr.load_motor(SET), truth_and_points(truth, [1.0, 6.0, 12.0], noise=5), free=list(truth))
    motor = pr.load_motor(SET).updated(truth)
    drive, speeds = pr.default_drive(motor).updated({"voltage": 80.0}), [2.0, 8.0]
    states = steady_states([Point.of(motor, drive, speed=speed, audit=False) for speed in speeds])
    torques = [state.torque_n_m for state in states]
    curve = result.predict({"voltage": [80.0, 80.0], "speed_rad_s": speeds, "torque_n_m": torques})
    # 1e-3 of the friction torque of 0.0125 N·m: steps of truth and prediction differ
    assert np.all(np.abs(curve.values - torques) < 4.0 * curve.standard_errors + 1.25e-5)
    assert np.all(curve.standard_errors < 0.02 * np.abs(curve.values))


@pytest.mark.parametrize(
    ("columns", "free", "told"),
    [
        ({"speed_rad_s": [1.0], "torqe_n_m": [0.1]}, ["contact.friction"], "Did you mean 'torque_n_m'?"),
        ({"speed_rad_s": [1.0], "torque_n_m": ["x"]}, ["contact.friction"], "torque_n_m of point 1 is 'x'"),
        ({"speed_rad_s": [1.0]}, ["contact.friction"], "has no measured value"),
        ({"torque_n_m": [0.1], "torque_n_m_error": [0.0]}, ["contact.friction"], "must be a number > 0"),
        ({"speed_rad_s": [1.0, 2.0], "torque_n_m": [0.1]}, ["contact.friction"], "must have the same number"),
        ({"speed_rad_s": [1.0], "torque_n_m": [0.1]}, ["contact.frction"], "Did you mean"),
        ({"speed_rad_s": [1.0], "torque_n_m": [0.1]}, ["drive.voltage"], "is not a parameter of the motor"),
        ({"speed_rad_s": [1.0], "torque_n_m": [0.1]}, ["contact.friction", "contact.friction"], "given twice"),
        ({"speed_rad_s": [1.0], "torque_n_m": [0.1], "voltage": [-1e9]}, ["contact.friction"], "voltage"),
        ({"speed_rad_s": [1.0], "torque_n_m": [1e-3]}, ["contact.effective_radius_m"], "Change contact.materials.tip"),
        ({"speed_rad_s": [1.0], "torque_n_m": [1e-3]}, ["contact.poisson"], "Change contact.materials.tip_poisson"),
        (None, ["contact.friction"], "nothing to calibrate against"),
        ("not a table", ["contact.friction"], "Cannot read"),
    ],
)
def test_bad_points_and_paths_are_refused_with_a_reason(columns: Any, free: list[str], told: str) -> None:
    with pytest.raises(pr.ParameterError, match=told.replace("?", r"\?")):
        pr.calibrate(pr.load_motor(SET), columns, free=free)


def test_the_command_refuses_a_table_without_points(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "points.csv"
    table.write_text("speed_rad_s,torque_n_m\n", encoding="utf-8")
    assert run(["calibrate", SET, "--points", str(table), "--free", "contact.friction"]) == 2
    assert "has no points" in capfd.readouterr().err


@pytest.mark.soak
def test_the_command_calibrates_with_points_and_a_spectrum_and_writes_the_motor(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    columns = truth_and_points({"contact.friction": 0.27}, [4.0, 10.0])
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    table = tmp_path / "points.csv"
    table.write_text("\n".join(lines), encoding="utf-8")
    output, plot = tmp_path / "calibrated.toml", tmp_path / "calibrated.png"
    spectrum = spectrum_of(pr.load_motor(SET), 49e3, 55e3, points=21).save(tmp_path / "free.csv")
    arguments = ["calibrate", SET, "--points", str(table), "--spectrum", str(spectrum), "--free", "contact.friction"]
    arguments.append("--json")
    assert run([*arguments, "--output", str(output), "--plot", str(plot)]) == 0
    document = json.loads(capfd.readouterr().out)
    found = document["parameters"]["contact.friction"]
    assert found["interval_95"][0] < 0.27 < found["interval_95"][1]
    assert found["identifiable"]
    assert "points.csv" in output.read_text(encoding="utf-8")
    assert plot.stat().st_size > 10_000


def test_a_calibration_has_errors_and_slopes_of_time_averages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first point counts as one here: the prediction a step beside is that of ngspice, and its error is larger."""
    motor = pr.load_motor(SET)
    base = Point.of(motor, pr.default_drive(motor).updated({"frequency": 46e3}), audit=False)
    points = read_points({"speed_rad_s": [2.0, 8.0], "torque_n_m": [0.01, 0.008], "torque_n_m_error": [1e-4, 1e-4]})
    unknowns = unknowns_of(motor, base.drive, ["contact.friction", "contact.preload_n"])
    plain = prediction.Predictor(base, unknowns, points)
    monkeypatch.setattr(prediction, "_scatter", lambda state, _: 1e-2 * (getattr(state, "speed_rad_s", 0) == 2.0))
    monkeypatch.setattr(prediction, "SLOPED", float("inf"))
    found, here = plain.refined(np.zeros(2))
    beside = np.array([0.0, prediction.COARSE_DIFFERENCE])
    (fast,), (fine,) = found.at([beside], here), plain.at([beside], here, fine=True)
    untilted = replace(found, tilt=None).at([beside], here)[0].values[0]
    # what is left is the end of Newton's method from other starts
    assert abs(fast.values[0] - fine.values[0]) < 0.1 * abs(untilted - fine.values[0])
    assert found.errors[0] == pytest.approx(np.hypot(1e-4, 1e-2 * here.values[0]))
    assert found.errors[1] == 1e-4


# --- the file of a calibration, as the report reads it ---


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


@pytest.mark.soak  # the time averages of eight points take seven minutes
def test_the_remedy_for_a_wrong_minimum_finds_points_of_unstable_motions() -> None:
    """The fast model has the unstable motion itself, and leads to another motor, which does not explain the points."""
    data, free = CASES / "unintended_points.csv", ["contact.friction", "contact.normal_stiffness_n_per_m15"]
    motor = pr.load_motor(SET)
    (warning,) = pr.calibrate(motor, data, free=free).cautions
    assert "give starts = 16" in warning
    found = {one.path: one.interval_95 for one in pr.calibrate(motor, data, free=free, starts=8).estimates}
    for path, value in zip(free, (0.24, 1.2 * motor.contact.normal_stiffness_n_per_m15), strict=True):
        low, high = found[path]
        assert low < value < high
