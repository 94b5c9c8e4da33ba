# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor with a slider runs as the same motor with a rotor, and its results are in N and m/s."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.datasets import Curves, WorkingPoints
from pyspice_runner.motor.motor import Motor
from pyspice_runner.units import linear_name, with_linear
from tests.motors import BEAM40, sliding, turning
from tests.runs import simulated

SHEET: Motor = pr.load_motor(BEAM40)
STAGE = sliding(SHEET)
DRIVE = pr.default_drive(SHEET)
COARSE: dict[str, Any] = {"step": 4e-7, "accuracy": 0.1}  # both motors have the same error by the step


def beside(document: Any) -> list[tuple[str, Any, Any]]:
    """Names and values of the quantities of a rotor, each with that of the slider beside it, in a whole document."""
    if isinstance(document, list):
        return [found for item in document for found in beside(item)]
    if not isinstance(document, dict):
        return []
    own = [(name, value, document[linear_name(name)]) for name, value in document.items() if linear_name(name)]
    return own + [found for value in document.values() for found in beside(value)]


@pytest.mark.parametrize(
    ("rotary", "linear"),
    [
        ("torque_n_m", "force_n"), ("mean_torque_n_m", "force_n"), ("torque_ripple_n_m", "force_ripple_n"),
        ("load_torque_n_m", "load_force_n"), ("speed_rad_s", "speed_m_s"), ("rotor_speed_rad_s", "speed_m_s"),
        ("mean_rotor_speed_rad_s", "speed_m_s"), ("rotor_position_rad", "position_m"),
        ("stall_torque_n_m", "stall_force_n"), ("normal_force_n", ""), ("tip_x_m", ""), ("time_s", ""),
    ],
)  # fmt: skip
def test_a_quantity_of_a_slider_is_named_after_that_of_the_rotor(rotary: str, linear: str) -> None:
    assert linear_name(rotary) == linear


def test_a_table_keeps_what_it_states_itself() -> None:
    table = {"speed_rad_s": 1.0, "speed_m_s": 2.0, "run": {"load_torque_n_m": 3.0}}
    assert with_linear(table) == table | {"run": {"load_torque_n_m": 3.0, "load_force_n": 3.0}}


def test_the_deck_is_that_of_a_rotor_of_radius_1_m() -> None:
    slides, turns = (simulated(motor, DRIVE, duration=1e-4) for motor in (STAGE, turning(STAGE, 1.0)))
    np.testing.assert_allclose(slides.speed_m_s, turns.rotor_speed_rad_s, rtol=1e-12)
    np.testing.assert_allclose(slides.friction_force_n, turns.friction_force_n, rtol=1e-12)
    assert slides.force_n == pytest.approx(turns.mean_torque_n_m, rel=1e-12)
    assert slides.energy_residual < 1e-3


@pytest.mark.parametrize("speed", [0.0, pytest.param(0.2, marks=pytest.mark.soak)])
def test_the_face_is_flat(speed: float) -> None:
    slides = pr.steady_state(STAGE, DRIVE, speed=speed, **COARSE)
    turns = pr.steady_state(turning(STAGE, 2.0), DRIVE, speed=speed / 2.0, **COARSE)
    assert slides.converged
    assert turns.torque_n_m / 2.0 == pytest.approx(slides.force_n, rel=1e-4)
    assert turns.speed_m_s == pytest.approx(slides.speed_m_s, abs=1e-12)
    assert turns.force_n == pytest.approx(turns.torque_n_m / 2.0, rel=1e-12)


def test_a_steady_state_has_force_and_speed_beside_the_rotary_keys() -> None:
    state = pr.steady_state(STAGE, DRIVE, speed=0.1, **COARSE)
    document = state.to_dict()
    assert document["force_n"] == document["torque_n_m"] == pytest.approx(state.force_n, rel=1e-12)
    assert document["speed_m_s"] == pytest.approx(0.1, rel=1e-9)
    found = beside(document)
    assert {linear_name(name) for name, *_ in found} >= {"force_ripple_n", "load_force_n", "force_error_n"}
    assert all(rotary == linear for _, rotary, linear in found)
    assert state.summary()["force"].endswith("N")
    assert state.summary()["speed"].endswith("m/s")
    assert state.plot(panel="speed").get_ylabel() == "slider speed in mm/s"
    assert state.plot(panel="path").get_xlabel() == "tip x, along the slider, in µm"


def test_a_run_has_force_and_speed_beside_the_rotary_keys(tmp_path: Path) -> None:
    waves = simulated(STAGE, DRIVE, duration=2e-4)
    assert waves.columns()["speed_m_s"] is waves.columns()["rotor_speed_rad_s"]
    assert waves.save(tmp_path / "run.csv").read_text(encoding="utf-8").partition("\n")[0].endswith("speed_m_s")
    assert waves.to_xarray()["speed_m_s"].attrs["units"] == "m/s"
    document = json.loads(waves.save(tmp_path / "run.json").read_text(encoding="utf-8"))
    assert document["speed_m_s"] == document["mean_rotor_speed_rad_s"] == waves.mean_rotor_speed_rad_s
    assert document["force_n"] == document["mean_torque_n_m"] == pytest.approx(waves.force_n, rel=1e-12)
    assert "mean slider speed" in waves.summary()
    assert "mN" in waves.summary()["mean force"]


def test_a_curve_has_force_and_speed_beside_the_rotary_ones() -> None:
    curve = pr.speed_torque(STAGE, DRIVE, speeds=[0.0, 0.2], step=4e-7)
    assert curve["speed_m_s"].values.tolist() == [0.0, 0.2]
    assert curve["force_n"].attrs == {"units": "N", "long_name": "mean force of the contact on the slider"}
    assert curve["force_n"].values.tolist() == curve["torque_n_m"].values.tolist()
    result: Curves = curve.piezomotor
    assert result.to_dict()["force_n"] == result.to_dict()["torque_n_m"]
    assert result.summary()["speed_m_s"] == "0 to 0.2 m/s, 2 values"
    axes = curve.plot(panel="torque")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed in mm/s", "force on the slider in N")
    assert axes.lines[0].get_xdata() == pytest.approx([0.0, 200.0])
    assert axes.lines[0].get_ydata() == pytest.approx(curve["force_n"].values)


def test_a_map_has_force_and_speed() -> None:
    points = pr.working_points(
        STAGE, DRIVE, over={"load.speed": [0.1, 0.2]}, limits={"force_n": 10.0, "tensile_stress_pa": 2e9}, **COARSE
    )
    result: WorkingPoints = points.piezomotor
    assert points["load.speed"].attrs["units"] == "m/s"
    best = result.best
    assert best["force_n"] == best["torque_n_m"]
    assert "force" in result.summary()
    assert result.plot(panel="torque").get_ylabel() == "force on the slider in N"
    assert "shaft" not in points.attrs["title"] or "m/s" in points.attrs["title"]


def test_the_averaged_motor_has_force_and_speed() -> None:
    slides = pr.simulate_averaged(STAGE, DRIVE, 5e-3)
    turns = pr.simulate_averaged(SHEET, DRIVE, 5e-3)
    document = slides.to_dict()
    assert document["speed_m_s"] == slides.to_dict()["end"]["speed_m_s"] == slides.speed_m_s[-1]
    assert document["force_n"] == document["mean_torque_n_m"]
    assert document["end"]["position_m"] == document["end"]["rotor_position_rad"]
    # the averaged model's own solver steps: 1e-3; the rotor of 15 mm is not flat: 1e-3 of the free speed
    assert slides.speed_m_s[-1] == pytest.approx(0.015 * turns.rotor_speed_rad_s[-1], rel=5e-3)
    assert slides.plot(panel="torque").get_ylabel() == "force in N"
    assert "m/s" in slides.summary()["speed"]


def test_behind_a_driver_the_slider_has_force_and_speed() -> None:
    report = pr.drive_report(STAGE, pr.Driver(kind="linear", voltage=50.0, frequency=40.1e3), duration=3e-4, speed=0.2)
    document = report.to_dict()
    assert document["force_n"] == document["mean_torque_n_m"]
    assert document["speed_m_s"] == pytest.approx(0.2, rel=1e-6)
    assert report.summary()["mean slider speed"].endswith("m/s")
    assert "mean force" in report.summary()
