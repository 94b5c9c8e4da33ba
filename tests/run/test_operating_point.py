# SPDX-License-Identifier: GPL-3.0-or-later
"""Operating points: their parameters by path."""

from collections.abc import Callable

import pytest

import pyspice_runner as pr
from pyspice_runner.run.point import Point
from tests.motors import BEAM40

MOTOR = pr.load_motor(BEAM40)
DRIVE = pr.TwoPhaseDrive(voltage=50.0, frequency=40e3)
POINT = Point.of(MOTOR, DRIVE)


def test_one_call_changes_motor_drive_load_and_step() -> None:
    changes = {
        "contact.friction": 0.2,
        "modes.1.frequency_hz": 40.5e3,
        "drive.voltage": 60.0,
        "load.speed": 2.0,
        "run.step": 1e-7,
    }
    found = POINT.updated(changes)
    assert found.motor == MOTOR.updated({"contact.friction": 0.2, "modes.1.frequency_hz": 40.5e3})
    assert found.drive == pr.TwoPhaseDrive(voltage=60.0, frequency=40e3)
    assert (found.load.speed, found.load.torque, found.step) == (2.0, 0.0, 1e-7)
    assert found.law == POINT.law
    assert POINT.updated({}) is POINT


@pytest.mark.parametrize("path", ["speed", "run.speed", "speed_rad_s", "load.speed"])
def test_earlier_names_of_the_speed_stay_valid(path: str) -> None:
    assert POINT.updated({path: 3.0}).load.speed == 3.0
    assert POINT.parameter(path).unit == "rad/s"


@pytest.mark.parametrize("path", ["load_torque", "run.load_torque", "load.torque"])
def test_earlier_names_of_the_load_torque_stay_valid(path: str) -> None:
    assert POINT.updated({path: 1e-3}).load.torque == 1e-3
    assert POINT.parameter(path).unit == "N·m"


def test_a_parameter_has_nominal_value_unit_and_description() -> None:
    found = POINT.parameter("contact.friction")
    assert (found.nominal, found.unit) == (MOTOR.contact.friction, "1")
    assert "friction" in found.description
    assert POINT.parameter("modes.bending-1.frequency_hz").unit == "Hz"
    assert POINT.parameter("contact.restitution").nominal == MOTOR.contact.restitution
    driver = pr.Driver(kind="half-bridge", voltage=50.0, frequency=40e3)
    part = Point.of(MOTOR, driver).parameter("drive.bridge.dead_time")
    assert (part.unit, part.nominal) == ("s", driver.setting("bridge.dead_time"))


@pytest.mark.parametrize(
    ("path", "nearest"),
    [
        ("contact.frction", "contact.friction"),
        ("contct.friction", "contact.friction"),
        ("modes.0.tipx", "modes.0.tip_x"),
        ("drive.voltag", "drive.voltage"),
        ("load.sped", "load.speed"),
        ("lod.speed", "load.speed"),
        ("run.stp", "run.step"),
    ],
)
def test_an_unknown_path_is_answered_with_the_nearest_one(path: str, nearest: str) -> None:
    said = f"There is no parameter '{path}'. Did you mean '{nearest}'?"
    with pytest.raises(pr.ParameterError) as caught:
        POINT.parameter(path)
    assert str(caught.value) == said
    with pytest.raises(pr.ParameterError) as caught:
        POINT.updated({path: 1.0})
    assert str(caught.value) == said


def test_speed_and_load_torque_exclude_each_other() -> None:
    with pytest.raises(pr.ParameterError, match="speed and load_torque exclude each other"):
        POINT.updated({"load.speed": 1.0, "load.torque": 1e-3})


def test_a_curve_takes_its_speeds_as_a_path() -> None:
    motor = MOTOR.updated({"mount": None})
    by_path = pr.speed_torque(motor, DRIVE, over={"load.speed": [0.0, 10.0]})
    assert by_path["speed_rad_s"].values.tolist() == [0.0, 10.0]
    by_name = pr.speed_torque(motor, DRIVE, speeds=[0.0, 10.0])
    assert by_path["torque_n_m"].values == pytest.approx(by_name["torque_n_m"].values, rel=1e-9)
    for arguments in ({}, {"speeds": [0.0], "over": {"load.speed": [0.0]}}):
        with pytest.raises(pr.ParameterError, match="The speeds of the curve must be given once"):
            pr.speed_torque(motor, DRIVE, **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("analysis", [pr.speed_torque, pr.working_points, pr.small_signals])
def test_an_analysis_that_needs_a_contact_says_why(analysis: object) -> None:
    arguments = {
        pr.speed_torque: {"speeds": [0.0]},
        pr.working_points: {"over": {"drive.voltage": [50.0]}},
        pr.small_signals: {"frequencies": [100.0]},
    }[analysis]  # type: ignore[index]
    with pytest.raises(pr.ParameterError, match=r"contact = None \(free tip\) is not valid here: "):
        analysis(MOTOR, DRIVE, contact=None, **arguments)  # type: ignore[operator]
    with pytest.raises(pr.ParameterError, match=r"no argument 'sliders'\."):
        analysis(MOTOR, DRIVE, sliders=8, **arguments)  # type: ignore[operator]


@pytest.mark.parametrize("step", [5e-324, 1e-300, 1e-18])
@pytest.mark.parametrize(
    "analysis",
    [
        lambda point: point.simulate(1e-3),
        lambda point: point.steady(),
        lambda point: point.curve([0.0]),
        lambda point: point.small_signals([100.0]),
    ],
    ids=["simulate", "steady", "curve", "small signals"],
)
def test_a_step_of_a_run_that_would_not_end_is_refused(
    analysis: Callable[[pr.OperatingPoint], object], step: float
) -> None:
    flagship = pr.load_motor("bimodal40")
    with pytest.raises(
        pr.ParameterError, match=r"^step = \S+ s is not valid for a motion of .* it must be >= \S+ s\.$"
    ):
        analysis(pr.OperatingPoint(flagship, pr.default_drive(flagship), step=step))
