# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns of measured points: temperature, phase and resonance decide parameters; headings have units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.points import read_points
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.point import Point
from pyspice_runner.steady.steady import SteadyState, steady_states
from validation import calibration as study

START = study.base()
DRIVE = pr.default_drive(START)
FAR = 4.0  # standard errors: one in 16,000 of a normal error


def states(motor: pr.Motor, speed: float, frequencies: list[float], **drive: float) -> list[SteadyState]:
    setups = [DRIVE.updated({"frequency": frequency, **drive}) for frequency in frequencies]
    return steady_states([Point.of(motor, one, speed=speed, audit=False) for one in setups])


def waveform_phase(state: pr.SteadyState, group: str) -> float:
    """Phase in degrees of the fundamental of a group's current ahead of its voltage, by a fit to the waveforms."""
    time = state.waveforms.time_s
    omega = 2.0 * np.pi * DRIVE.frequency  # type: ignore[union-attr]
    basis = np.column_stack([np.ones_like(time), np.cos(omega * time), np.sin(omega * time)])
    volts, amperes = (
        np.linalg.lstsq(basis, getattr(state.waveforms, name), rcond=None)[0]
        for name in (f"voltage_{group}_v", f"current_{group}_a")
    )
    return float(np.angle((amperes[1] - 1j * amperes[2]) / (volts[1] - 1j * volts[2]), deg=True))


def test_the_phase_of_a_current_is_that_of_its_waveform_and_90_degrees_of_a_capacitance() -> None:
    found = pr.steady_state(START, DRIVE, speed=4.0)
    # the phase is extrapolated to a vanishing step, the waveform has the finest one: 2e-3 of a radian and less
    assert found.current_a_phase_deg == pytest.approx(waveform_phase(found, "a"), abs=0.1)
    assert found.current_b_phase_deg == pytest.approx(waveform_phase(found, "b"), abs=0.1)
    idle = START.updated({f"modes.{mode}.coupling_a_n_per_v": 1e-6 for mode in (0, 1)})
    loss = np.degrees(idle.piezo.loss_tangent)
    (found,) = states(idle, 4.0, [45e3])
    # the library states a loss tangent within 5 %
    assert found.current_a_phase_deg == pytest.approx(90.0 - loss, abs=0.05 * loss)


def warm_points() -> tuple[pr.Motor, Thermal, dict[str, Any]]:
    """A motor, its drift, and points of it at two temperatures."""
    truth = START.updated({"piezo.capacitance_a_f": 1.05 * START.piezo.capacitance_a_f})
    drift = Thermal.of(truth).model_copy(update={"frequency_drift_per_k": -3e-4})
    own = [states(drift.warmed(truth, rise), 4.0, [45e3])[0] for rise in (0.0, 60.0)]
    columns = {
        "temperature": [25.0, 85.0], "speed_rad_s": [4.0, 4.0],
        "torque_n_m": [state.torque_n_m for state in own], "torque_n_m_error": [1e-4] * 2,
        "current_a_phase_deg": [state.current_a_phase_deg + 360.0 for state in own],  # a turn does not count
        "current_a_phase_deg_error": [0.2] * 2,
    }  # fmt: skip
    return truth, drift, columns


def test_points_at_two_temperatures_decide_the_drift_and_a_phase_decides_the_capacitance() -> None:
    truth, _, columns = warm_points()
    free = ["thermal.frequency_drift_per_k", "piezo.capacitance_a_f"]
    result = pr.calibrate(START, columns, free=free)
    for one, value in zip(result.estimates, (-3e-4, truth.piezo.capacitance_a_f), strict=True):
        # without noise the search ends within 0.3 standard errors
        assert abs(one.value - value) < 0.3 * one.standard_error, one.path
        assert one.identifiable, one.path


@pytest.mark.soak
def test_a_calibration_with_temperatures_predicts_one_between_them() -> None:
    truth, drift, columns = warm_points()
    result = pr.calibrate(truth, columns, free=["thermal.frequency_drift_per_k"])
    curve = result.predict({"temperature": [55.0], "speed_rad_s": [4.0], "torque_n_m": [0.0]})
    (between,) = states(drift.warmed(truth, 30.0), 4.0, [45e3])
    assert abs(curve.values[0] - between.torque_n_m) < FAR * curve.standard_errors[0]
    without = pr.calibrate(START, POINT, free=["contact.friction"])
    with pytest.raises(pr.ParameterError, match="the calibration has none"):
        without.predict({"temperature": [55.0], "speed_rad_s": [4.0], "torque_n_m": [0.0]})


@pytest.mark.soak
def test_a_resonance_decides_the_frequency_of_a_mode() -> None:
    truth = START.updated({"modes.0.frequency_hz": 44.4e3})
    columns: dict[str, Any] = {"voltage": [60.0, 100.0], "speed_rad_s": [4.0, 4.0], "resonance_hz": []}
    for voltage in columns["voltage"]:
        # an independent search: the greatest of many steady states, then a parabola through five about it
        grid = np.arange(44.3e3, 45.3e3, 50.0)
        own = states(truth, 4.0, grid.tolist(), voltage=voltage)
        power = np.array([state.power_a_w + state.power_b_w for state in own])
        near = slice(int(power.argmax()) - 2, int(power.argmax()) + 3)
        curve = np.polynomial.Polynomial.fit(grid[near], power[near], 2)
        columns["resonance_hz"].append(float(curve.deriv().roots()[0].real))
    columns["resonance_hz_error"] = [10.0, 10.0]
    result = pr.calibrate(START, columns, free=["modes.0.frequency_hz"])
    (frequency,) = result.estimates
    # five powers over 200 Hz, a third of the bandwidth, leave their parabola some hertz off
    assert abs(frequency.value - 44.4e3) < 10.0
    assert frequency.standard_error == pytest.approx(10.0 / np.sqrt(2.0), rel=0.2)  # a mode moves its resonance along
    assert frequency.identifiable


POINT = {"speed_rad_s": [4.0, 4.0], "torque_n_m": [0.01, 0.01]}


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ({"temperature": [20.0, float("nan")]}, "point 2 has no temperature, 1 of 2 points"),
        ({"temperature": [20.0, -300.0]}, "point 2: temperature = -300 is not valid"),
        ({"temperatur": [20.0, 30.0]}, "Did you mean 'temperature'?"),
        ({"Phase (deg)": [60.0, 60.0]}, "current_a_phase_deg and current_b_phase_deg are measured"),
        ({"resonance_hz": [44.6, 45.0]}, "resonance_hz of point 1 is 44.6 Hz; the modes of the motor allow"),
        ({"resonance_hz": [-45e3, 45e3]}, "the modes of the motor allow"),
        ({"torque_n_m": [12.0, 9.0]}, "torque_n_m of point 1 is 12 N·m; friction at the preload holds 0.0"),
        ({"resonance_hz": [45e3, 45e3], "Resonance (kHz)": [45, 45]}, "second column"),
        ({"current_a_phase_deg": [10.0, 10.0], "current_a_phase_deg_error": [0.0, 1.0]}, "must be a number > 0"),
    ],
)  # fmt: skip
def test_a_bad_temperature_phase_or_resonance_is_refused_with_a_reason(columns: dict[str, Any], told: str) -> None:
    with pytest.raises(pr.ParameterError, match=told.replace("?", r"\?")):
        pr.calibrate(START, {**POINT, **columns}, free=["contact.friction"])


@pytest.mark.parametrize("column", ["current_b_phase_deg", "resonance_hz"])
def test_a_drive_of_two_tones_has_neither_a_phase_nor_a_resonance(column: str) -> None:
    drive = pr.TwoToneDrive(voltage_1=60.0, frequency_1=45e3, voltage_2=60.0, frequency_2=90e3)
    with pytest.raises(pr.ParameterError, match=f"{column} of point 1 takes a .* one frequency"):
        pr.calibrate(START, {**POINT, column: [45e3, 45e3]}, drive=drive, free=["contact.friction"])


def test_a_drift_takes_temperatures_that_differ() -> None:
    with pytest.raises(pr.ParameterError, match="at temperatures that differ"):
        pr.calibrate(START, {**POINT, "temperature": [20.0, 20.0]}, free=["thermal.frequency_drift_per_k"])


def test_columns_without_errors_have_those_of_instruments() -> None:
    found = read_points({
        "speed_rad_s": [4.0], "Current phase (rad)": [np.pi / 3.0], "Resonance frequency (kHz)": [45.0],
        "Temperature (°C)": [30.0],
    })  # fmt: skip
    errors = dict(zip(found.quantities, found.errors.tolist(), strict=True))
    values = dict(zip(found.quantities, found.values.tolist(), strict=True))
    assert values == pytest.approx({"current_a_phase_deg": 60.0, "resonance_hz": 45e3})
    assert errors == pytest.approx({"current_a_phase_deg": np.degrees(0.02), "resonance_hz": 45.0})
    assert found.conditions[0]["temperature"] == 30.0
    assert not found.errors_given


# --- headings of published tables ---


def test_a_speed_force_table_of_a_stage_is_read_in_its_units(tmp_path: Path) -> None:
    table = tmp_path / "stage.csv"
    table.write_text("Voltage (Vrms);Force [mN];Speed / mm/s\n80;0;300\n80;2000;150\n80;4000;0\n", encoding="utf-8")
    points = read_points(table, motor_is_linear=True)
    assert [there["load.speed"] for there in points.conditions] == pytest.approx([0.3, 0.15, 0.0])
    assert points.conditions[0]["drive.voltage"] == pytest.approx(80.0 * np.sqrt(2.0))
    assert set(points.quantities) == {"torque_n_m"}  # of the rotor of 1 m that stands for a slider: N
    assert points.values == pytest.approx([0.0, 2.0, 4.0])
    assert not points.errors_given


def test_a_speed_torque_table_of_a_motor_is_read_in_its_units(tmp_path: Path) -> None:
    table = tmp_path / "motor.csv"
    table.write_text("Output speed (rpm),Load torque (mN·m),Input power [mW]\n60,1.5,900\n30,3,\n", encoding="utf-8")
    points = read_points(table)
    assert [there["load.speed"] for there in points.conditions] == pytest.approx([2.0 * np.pi, np.pi])
    measured = dict(zip(zip(points.rows, points.quantities, strict=True), points.values, strict=True))
    assert measured == pytest.approx({(0, "torque_n_m"): 1.5e-3, (1, "torque_n_m"): 3e-3, (0, "power_w"): 0.9})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Speed (furlongs),Force (N)\n1,2\n", "there is no column"),
        ("Speed (rpm),Velocity (rad/s),Torque (Nm)\n1,2,3\n", "second column of speed_rad_s"),
        ("Speed (mm/s),Force (N)\n1,2\n", "there is no column"),  # of a rotor
    ],
)
def test_a_heading_that_means_nothing_here_is_refused(text: str, says: str, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=says):
        read_points(table)
