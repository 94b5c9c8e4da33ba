# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of steady states, and the best working point within limits."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.motor.load import changed_motor

pytestmark = pytest.mark.xdist_group("maps")  # they are shared

MOTOR = pr.load_motor("andersen2002-unintended-mode")
DRIVE = pr.TwoPhaseDrive(voltage=100.0, frequency=46e3, phase_deg=180.0)
FREQUENCIES, VOLTAGES = (45.2e3, 46e3, 46.8e3), (70.0, 100.0)


@cache
def mapped() -> xarray.Dataset:
    over = {"drive.frequency": FREQUENCIES, "drive.voltage": VOLTAGES}
    return pr.working_points(MOTOR, DRIVE, over=over, limits={"voltage_v": 80.0})


def test_a_point_of_a_map_is_the_steady_state_there() -> None:
    data = mapped()
    assert bool(data["converged"].all())
    assert data["torque_n_m"].dims == ("drive.frequency", "drive.voltage")
    state = pr.steady_state(MOTOR, DRIVE.model_copy(update={"frequency": 46.8e3}), speed=0.0)
    friction_torque = MOTOR.contact.friction * MOTOR.contact.preload_n * MOTOR.rotor.radius_m
    # 1 %: the accuracy of a map
    at = data.sel({"drive.frequency": 46.8e3, "drive.voltage": 100.0})
    assert float(at["torque_n_m"]) == pytest.approx(state.torque_n_m, abs=1e-2 * friction_torque)
    assert float(at["current_a"]) == pytest.approx(max(state.current_a_rms_a, state.current_b_rms_a), rel=1e-2)


def test_the_best_point_is_the_greatest_within_the_limits() -> None:
    data, best = mapped(), mapped().piezomotor.best
    allowed = data["torque_n_m"].where(data["allowed"])
    assert best["torque_n_m"] == float(allowed.max())
    assert best["drive.voltage"] == 70.0
    assert not bool(data["allowed"].sel({"drive.voltage": 100.0}).any())
    none = pr.working_points(MOTOR, DRIVE, over={"drive.voltage": [100.0]}, limits={"voltage_v": 80.0})
    assert none.piezomotor.best is None
    assert none.piezomotor.cautions[0].startswith("No point is stable and within the limits")


def test_an_interrupted_map_keeps_its_finished_points(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The signal comes when the first points are found, those of the coarse grid."""
    plain = pr.working_points

    def press(done: int, _: int) -> None:
        if done:
            raise KeyboardInterrupt

    def interrupted(*args: Any, **settings: Any) -> xarray.Dataset:
        return plain(*args, **settings | {"progress": press})

    monkeypatch.setattr(pr, "working_points", interrupted)
    file = tmp_path / "map.nc"
    words = ["map", "bimodal40", "--over", "drive.voltage=20,25,30,35,40", "--speed", "10", "--output", str(file)]
    assert run([*words, "--json"]) == 130
    output, said = capsys.readouterr()
    torques = json.loads(output)["torque_n_m"]
    finished = [torque for torque in torques if torque is not None]
    assert 0 < len(finished) < len(torques) == 5
    assert f"{len(finished)} of 5 points are finished." in said
    assert "no steady state" not in said
    voltage = 20.0 + 5.0 * torques.index(finished[0])
    motor = pr.load_motor("bimodal40")
    alone = pr.steady_state(motor, pr.default_drive(motor).updated({"voltage": voltage}), speed=10.0)
    friction_torque = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    assert finished[0] == pytest.approx(alone.torque_n_m, abs=1e-2 * friction_torque)
    with xarray.open_dataset(file) as data:
        assert int(data["torque_n_m"].notnull().sum()) == len(finished)


def test_a_point_beyond_a_limit_of_the_motor_is_not_the_best_and_its_caution_is_kept() -> None:
    motor = changed_motor("andersen2002", {"beam.theory": "bernoulli-euler", "beam.recoil": False})
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=54e3, phase_deg=90.0)
    over = {"drive.voltage": [100.0, 200.0, 300.0]}
    found = pr.working_points(motor, drive, over=over)
    # half of the Curie temperature, 350 °C, is the limit
    assert found["allowed"].values.tolist() == (found["temperature_c"].values <= 175.0).tolist() == [True, False, False]
    assert found.piezomotor.best["drive.voltage"] == 100.0
    alone = pr.steady_state(motor, drive.updated({"voltage": 300.0}), speed=0.0).cautions
    assert len(alone) == 4
    for sentence in alone[:3]:  # of the motor, at all points
        assert sentence in found.piezomotor.cautions
    assert found.piezomotor.cautions[3].startswith("2 of 3 points: In the steady state the losses heat the stator by 6")
    hot = pr.working_points(motor, drive, over=over, limits={"temperature_c": 1000.0})
    assert hot.piezomotor.best["drive.voltage"] == 300.0


def test_temperature_is_that_of_the_losses_and_a_limit() -> None:
    data = mapped()
    heat = (data["dielectric_loss_w"] + data["damping_loss_w"]).values
    expected = MOTOR.limits.ambient_c + MOTOR.limits.thermal_resistance_k_per_w * heat
    assert data["temperature_c"].values == pytest.approx(expected)
    below = 0.5 * (data["temperature_c"].values.min() + data["temperature_c"].values.max())
    over = {"drive.frequency": [46e3], "drive.voltage": [70.0, 100.0]}
    best = pr.working_points(MOTOR, DRIVE, over=over, limits={"temperature_c": below}).piezomotor.best
    assert best["temperature_c"] < below


def test_the_amplitude_of_group_b_is_an_axis() -> None:
    data = pr.working_points(MOTOR, DRIVE, over={"drive.ratio_b": [0.5]}, speed=6.0)
    assert float(data["voltage_v"][0]) == 100.0
    assert float(data["current_b_rms_a"][0]) < 0.7 * float(data["current_a_rms_a"][0])


def test_wrong_requests_say_what_is_allowed() -> None:
    with pytest.raises(pr.ParameterError, match="objective = 'force' is not valid"):
        pr.working_points(MOTOR, DRIVE, over={"drive.voltage": [1.0]}, objective="force")  # type: ignore[arg-type]
    with pytest.raises(pr.ParameterError, match="limits: 'volts' is not known: it must be one of"):
        pr.working_points(MOTOR, DRIVE, over={"drive.voltage": [1.0]}, limits={"volts": 1.0})
    with pytest.raises(pr.ParameterError, match=r"limits: current_a = -1 is not valid: it must be a number > 0"):
        pr.working_points(MOTOR, DRIVE, over={"drive.voltage": [1.0]}, limits={"current_a": -1.0})
    with pytest.raises(pr.ParameterError, match=r"ceramic_stress_pa is not known of .* described without its beam"):
        pr.working_points(MOTOR, DRIVE, over={"drive.voltage": [1.0]}, limits={"ceramic_stress_pa": 1e6})
    cold = MOTOR.updated({"limits": None})
    with pytest.raises(pr.ParameterError, match=r"temperature_c is not known of .* no table of limits"):
        pr.working_points(cold, DRIVE, over={"drive.voltage": [1.0]}, limits={"temperature_c": 100.0})
    with pytest.raises(pr.ParameterError, match="over has 0 points"):
        pr.working_points(MOTOR, DRIVE, over={})


def test_the_command_prints_the_best_point_and_draws_the_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["map", MOTOR.name, "--over", "drive.frequency=44500,46000", "--over", "contact.preload_n=5,6"]
    words += ["--objective", "power", "--speed", "5", "--limit", "current_a=1"]
    files = ["--output", str(tmp_path / "map.nc"), "--plot", str(tmp_path / "map.png")]
    assert run([*words, "--json", *files]) == 0
    document = json.loads(capsys.readouterr().out)
    powers, allowed = (np.ravel(document[name]) for name in ("shaft_power_w", "allowed"))
    assert document["best"]["shaft_power_w"] == powers[allowed].max()
    assert document["best"]["drive.frequency"] in (44500.0, 46000.0)
    assert (tmp_path / "map.png").stat().st_size > 10_000
    with xarray.open_dataset(tmp_path / "map.nc") as data:
        assert data["torque_n_m"].shape == (2, 2)
    assert run([*words[:2], "--over", "drive.voltage=50", "--limit", "current"]) == 2
    assert "--limit 'current' has no values" in capsys.readouterr().err
