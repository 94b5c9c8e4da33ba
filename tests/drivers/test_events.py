# SPDX-License-Identifier: GPL-3.0-or-later
"""A load that steps, a control that stops and a frequency that sweeps: against closed forms."""

from __future__ import annotations

from math import exp, pi

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.loads import LOAD_STEP, STOP, SWEEP, EventfulDriver, driver_events, event_cautions
from pyspice_runner.run.point import Point

MOTOR = pr.load_motor("andersen2002")
DRIVER = pr.Driver(kind="ideal", voltage=50.0, frequency=50e3)


def run(source: EventfulDriver, duration: float) -> dict[str, np.ndarray]:
    """The rotor is free of the tip."""
    setup = Point.of(MOTOR, source, contact=None)
    return setup.run(duration, ["v(shaft)", "v(a)", "v(b)"]).vectors()


def test_a_load_that_steps_accelerates_a_free_rotor_from_then_on() -> None:
    """Ω = −τ/C (1 − exp(−C t/J)); 0.5 % for the edge of 1 µs in 100 µs."""
    found = run(EventfulDriver(DRIVER, load_at=1e-4, load_torque=1e-3), 2e-4)
    before = found["time"] < 1e-4
    assert np.abs(found["v(shaft)"][before]).max() < 1e-9
    damping, inertia = MOTOR.rotor.bearing_damping_n_m_s, MOTOR.rotor.inertia_kg_m2
    expected = -1e-3 / damping * (1.0 - exp(-damping * 1e-4 / inertia))
    assert found["v(shaft)"][-1] == pytest.approx(expected, rel=0.01)


def test_a_control_that_stops_leaves_no_voltage_of_an_ideal_source() -> None:
    found = run(EventfulDriver(DRIVER, stop_at=1e-4), 2e-4)
    on, off = found["time"] < 1e-4, found["time"] > 1.02e-4
    assert np.abs(found["v(b)"][on]).max() == pytest.approx(50.0, rel=1e-3)
    assert np.abs(found["v(b)"][off]).max() < 1e-9


def test_a_sweep_has_the_phase_of_its_frequency() -> None:
    """2π (f t + r t²/2) in the middle of 45 to 55 kHz, the amplitude throughout."""
    found = run(EventfulDriver(DRIVER, first=45e3, rate=10e3 / 5e-4), 5e-4)
    time = found["time"]
    expected = 50.0 * np.sin(2.0 * pi * (45e3 + 0.5 * 10e3 / 5e-4 * time) * time)
    assert found["v(a)"] == pytest.approx(expected, abs=1e-3)


def test_the_maxima_of_events_are_those_of_their_time_and_excess_is_told() -> None:
    """Without a network the pins have the amplitude of the source, but for samples beside a peak; 200 V on 0.8 mm."""
    strong = DRIVER.updated({"voltage": 200.0})
    setup = Point.of(MOTOR.updated({"limits.field_v_per_m": 2e5}), strong, audit=False)
    names = [f"{kind}_{group})" for kind in ("i(vpin", "i(vout") for group in "ab"]
    found = driver_events(setup, strong, ["v(a)", "v(b)", *names])
    assert list(found) == [LOAD_STEP, STOP, SWEEP]
    for event in (LOAD_STEP, SWEEP):
        assert found[event]["voltage_a_v"] == pytest.approx(200.0, rel=2e-3)
    assert found[STOP]["voltage_a_at_s"] < 1.51e-3
    told = event_cautions(setup, found)
    assert any(sentence.startswith("At a load step: Group A reaches 2") for sentence in told)
