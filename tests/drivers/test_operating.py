# SPDX-License-Identifier: GPL-3.0-or-later
"""What a designed driver does at no load, at its operating point and at a start, on both flagships."""

from functools import cache
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import Design
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("operating points")  # the designs are shared

PLATE40 = str(Path(__file__).parents[2] / "examples" / "plate40.toml")
SPEEDS = {"bimodal40": 20.0, PLATE40: None}  # of the operating points; by default half the speed at no load
MOTORS = mostly(pytest.mark.soak, list(SPEEDS), ["bimodal40"])


@cache
def designed(name: str) -> Design:
    motor = pr.load_motor(name)
    drive = pr.default_drive(motor)
    if name == "bimodal40":
        drive = drive.model_copy(update={"voltage": 150.0})
    design = pr.design(motor, pr.DriverSpec(drive, "full-bridge", rail=24.0), speed=SPEEDS[name])
    assert design.feasible, design.reason
    return design


@pytest.mark.parametrize("name", MOTORS)
def test_no_load_is_a_free_shaft_behind_the_network_and_the_verdict_covers_it(name: str) -> None:
    """Its torque is the bearing's, within 1 % of the friction torque; the real bridge leaves the same speed."""
    motor, design = pr.load_motor(name), designed(name)
    idle = next(point for point in design.points if point.state == "no load")
    friction = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
    bearing = motor.rotor.bearing_damping_n_m_s * idle.speed_rad_s
    assert idle.torque_n_m == pytest.approx(bearing, abs=0.01 * friction)
    worst = max(abs(idle.group(group).voltage_v / design.wanted_v[group] - 1.0) for group in "ab")
    told = float(design.reason.partition("within ")[2].partition(" %")[0])
    assert told >= 99.0 * worst
    if name == "bimodal40":  # steady_state behind the same bridge with all of its edges: 73.402 rad/s
        assert idle.speed_rad_s == pytest.approx(73.402, rel=5e-3)


@pytest.mark.parametrize("name", MOTORS)
def test_the_head_of_the_table_is_the_operating_point_and_a_short_run_is_no_verdict(name: str) -> None:
    """Powers within 2 % of the steady state behind the fundamental; the core's own current loses 0.5 % more."""
    design = designed(name)
    report = pr.drive_report(pr.load_motor(name), design, 3e-4)
    point = next(point for point in design.points if point.state == "operating point")
    held = report.operating
    assert held
    assert report.design
    assert held.mean_rotor_speed_rad_s == pytest.approx(point.speed_rad_s, rel=1e-6)
    assert held.motor_power_w == pytest.approx(point.power_w, rel=0.02)
    assert held.supply_power_w == pytest.approx(point.stage_power_w, rel=0.02)
    assert abs(held.balance_residual) < 0.01
    for group, given in report.delivered.items():
        assert given["got_v"] == pytest.approx(held.groups[group].harmonics[0].voltage_v)
    assert all(held.losses_w[f"bridge_{group}.{leg}"] > 0.0 for group in "ab" for leg in ("ph", "pl", "nh", "nl"))
    highest = max(bar.get_height() for bar in report.plot(panel="spectrum").patches)
    assert highest == held.groups["a"].harmonics[0].current_a  # at the operating point, not at the start
    rows = report.summary()
    assert list(rows.values())[3].startswith("operating point")
    assert float(rows["power put in"].split()[0]) == pytest.approx(held.power_in_w, rel=1e-3)
    assert "at the end of the run of 300" in rows["start-up"]
    assert (report.design.feasible, report.design.starts) == (True, None)
    assert "The run is too short by 700" in report.design.reason
