# SPDX-License-Identifier: GPL-3.0-or-later
"""Events of a run and the switching of bridges: against closed forms, and the charge of a leg against ngspice."""

from functools import cache
from math import exp, pi
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.loads import LOAD_STEP, STOP, SWEEP, EventfulDriver, Events, driver_events, event_cautions
from pyspice_runner.drivers.parts import ratings
from pyspice_runner.drivers.report import DriveReport
from pyspice_runner.run.point import Point
from pyspice_runner.spice.library import definitions, read_library
from tests.circuit.batch import measured

MOTOR = pr.load_motor("andersen2002")
DRIVER = pr.Driver(kind="ideal", voltage=50.0, frequency=50e3)


def run(source: EventfulDriver, duration: float) -> dict[str, np.ndarray]:
    """The rotor is free of the tip."""
    setup = Point.of(MOTOR, source, contact=None)
    return setup.run(duration, ["v(shaft)", "v(a)", "v(b)"]).vectors()


def test_a_load_that_steps_accelerates_a_free_rotor_from_then_on() -> None:
    """Ω = −τ/C (1 − exp(−C t/J)); 0.5 % for the edge of 1 µs in 100 µs."""
    found = run(EventfulDriver(DRIVER, Events(load_at=1e-4, load_torque=1e-3)), 2e-4)
    before = found["time"] < 1e-4
    assert np.abs(found["v(shaft)"][before]).max() < 1e-9
    damping, inertia = MOTOR.rotor.bearing_damping_n_m_s, MOTOR.rotor.inertia_kg_m2
    expected = -1e-3 / damping * (1.0 - exp(-damping * 1e-4 / inertia))
    assert found["v(shaft)"][-1] == pytest.approx(expected, rel=0.01)


def test_a_control_that_stops_leaves_no_voltage_of_an_ideal_source() -> None:
    found = run(EventfulDriver(DRIVER, Events(stop_at=1e-4)), 2e-4)
    on, off = found["time"] < 1e-4, found["time"] > 1.02e-4
    assert np.abs(found["v(b)"][on]).max() == pytest.approx(50.0, rel=1e-3)
    assert np.abs(found["v(b)"][off]).max() < 1e-9


def test_a_sweep_has_the_phase_of_its_frequency() -> None:
    """2π (f t + r t²/2) in the middle of 45 to 55 kHz, the amplitude throughout."""
    found = run(EventfulDriver(DRIVER, Events(first=45e3, rate=10e3 / 5e-4)), 5e-4)
    time = found["time"]
    expected = 50.0 * np.sin(2.0 * pi * (45e3 + 0.5 * 10e3 / 5e-4 * time) * time)
    assert found["v(a)"] == pytest.approx(expected, abs=1e-3)


def test_the_maxima_of_events_are_those_of_their_time_and_excess_is_a_caution() -> None:
    """Without a network the pins have the amplitude of the source, but for samples beside a peak; 200 V on 0.8 mm."""
    strong = DRIVER.updated({"voltage": 200.0})
    setup = Point.of(MOTOR.updated({"limits.field_v_per_m": 2e5}), strong, audit=False)
    names = [f"{kind}_{group})" for kind in ("i(vpin", "i(vout") for group in "ab"]
    found = driver_events(setup, strong, ["v(a)", "v(b)", *names])
    assert list(found) == [LOAD_STEP, STOP, SWEEP]
    for event in (LOAD_STEP, SWEEP):
        assert found[event]["voltage_a_v"] == pytest.approx(200.0, rel=2e-3)
    assert found[STOP]["voltage_a_at_s"] < 1.51e-3
    assert sum("Group A reaches 2" in one for one in event_cautions(setup, found)) == 1  # one caution for all events


CAPACITANCE = ratings("IRF610").output_capacitance
pytestmark = pytest.mark.xdist_group("drivers")


@cache
def bridge(dead_time: float) -> DriveReport:
    """Two half bridges between 79 V, each behind 8.2 mH: the current lags, and commutates the leg."""
    settings = {"inductor.inductance": 8.2e-3, "bridge.dead_time": dead_time}
    driver = pr.Driver(kind="half-bridge", voltage=50.0, frequency=51.7e3, network="inductor", settings=settings)
    return pr.drive_report(pr.load_motor("andersen2002"), driver, 2e-4)


def test_the_output_capacitance_is_that_of_the_data_sheet() -> None:
    """Vishay 91023: 53 pF, typical, at 25 V."""
    assert CAPACITANCE(np.array([25.0]))[0] == pytest.approx(53e-12, rel=0.01)  # the digits of the sheet


def test_a_constant_current_moves_a_leg_in_the_time_that_its_charge_needs(tmp_path: Path) -> None:
    """Two transistors that are off, 80 V, and 40 mA that lifts their middle from 1 to 79 V, after it was held down."""
    found = measured(
        f"""commutation of a leg
{definitions(read_library("driver_mosfet"))}
Vp vp 0 PWL(0 0 10u 80)
Xhigh vp out out driver_mosfet
Xlow out 0 0 driver_mosfet
Ilift 0 out PWL(0 -1m 11u -1m 11.001u -20u 13u -20u 13.001u 40m)
.tran 1n 13.4u 0 1n uic
.measure tran lifted_s TRIG v(out) VAL=1 RISE=1 TARG v(out) VAL=79 RISE=1
.end
""",
        tmp_path,
    )
    volts = np.linspace(1.0, 79.0, 1000)
    charge = np.trapezoid(CAPACITANCE(volts) + CAPACITANCE(80.0 - volts), volts)
    # steps of 1 ns in 210, and 1e8 Ω of leakage, which takes 1 µA
    assert found["lifted_s"] == pytest.approx(charge / 40e-3, rel=0.01)


@pytest.mark.soak
def test_a_dead_time_that_moves_the_charge_leaves_no_voltage_and_a_shorter_one_does() -> None:
    short, long = bridge(60e-9), bridge(400e-9)
    for before, after in zip(short.switching, long.switching, strict=True):
        assert before.transistor == after.transistor
        assert 60e-9 < before.dead_time_s < 400e-9  # the dead time that would do lies between
        assert not before.zero_voltage
        assert abs(after.voltage_left_v) < 0.2 * before.voltage_left_v
        assert before.hard_switching_w > 10.0 * after.hard_switching_w
    # the loss by the voltage left is part of the measured loss of the transistors
    assert sum(edge.hard_switching_w or 0.0 for edge in short.switching) < sum(short.losses_w.values())


def test_a_linear_stage_has_no_switching() -> None:
    driver = pr.Driver(kind="linear", voltage=50.0, frequency=51.7e3)
    assert pr.drive_report(pr.load_motor("andersen2002"), driver, 2e-4).to_dict()["switching"] == []
