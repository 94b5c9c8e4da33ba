# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin of the temperature: open, it changes nothing; held, values drift as stated; free, losses heat the stator."""

import re
from functools import cache
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySpice.Spice.Netlist import Circuit

import pyspice_runner as pr
from pyspice_runner.circuit.bench import AC_OPTIONS, motor_bench
from pyspice_runner.circuit.motor import add_motor
from pyspice_runner.circuit.source import TRANSIENT_OPTIONS, DriveSource
from pyspice_runner.motor.dielectric import lossy_capacitance
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal, heat_capacity
from pyspice_runner.spice.library import read_library
from pyspice_runner.spice.ngspice import BatchSimulator
from tests.circuit.test_decks import measured
from tests.motors import motor as odd_motor

DRIFT = pr.Thermal(frequency_drift_per_k=-3e-4, coupling_drift_per_k=2e-3, capacitance_drift_per_k=5e-3)


@cache
def andersen() -> Motor:
    return pr.load_motor("andersen2002")


def admittance(motor: Motor, thermal: Thermal | None, frequency: float, temperature: float | None = None) -> complex:
    """Current into group A per volt on A, with B shorted and a free tip."""
    circuit = Circuit("admittance")
    circuit.V("a", "a", circuit.gnd, "DC 0 AC 1")
    circuit.V("b", "b", circuit.gnd, "DC 0")
    warm = ("temperature", "heat") if thermal else ()
    if temperature is not None:
        circuit.V("temperature", "temperature", circuit.gnd, f"DC {temperature!r}")
    add_motor(circuit, motor, ("a", "b", circuit.gnd, "shaft", *warm), law=None, thermal=thermal)
    simulator = BatchSimulator(circuit)
    simulator.options(**AC_OPTIONS)
    simulator.ac(
        variation="lin", number_of_points=3, start_frequency=frequency, stop_frequency=frequency * (1.0 + 1e-9)
    )
    return complex(-simulator.result.raw.vectors["i(va)"][0])


def closed_form(motor: Motor, thermal: Thermal, frequency: float, temperature: float) -> complex:
    omega = 2.0 * pi * frequency
    coupling = 1.0 + thermal.coupling_drift_per_k * temperature
    stiffness = (1.0 + thermal.frequency_drift_per_k * temperature) ** 2
    clamped = sum(
        1j * omega * c / (1.0 + 1j * omega * r * c)
        for r, c in lossy_capacitance(motor.piezo.capacitance_a_f, motor.piezo.loss_tangent)
    )
    total = clamped * (1.0 + thermal.capacitance_drift_per_k * temperature)
    for mode in motor.modes:
        impedance = mode.stiffness_n_per_m * stiffness - mode.mass_kg * omega**2 + 1j * omega * mode.damping_n_s_per_m
        total += 1j * omega * (coupling * mode.coupling_a_n_per_v) ** 2 / impedance
    return total


@pytest.mark.parametrize("motor", [andersen(), odd_motor()], ids=["andersen2002", "odd"])
def test_pins_left_open_change_nothing_in_the_admittance(motor: Motor) -> None:
    for mode in motor.modes:
        plain = admittance(motor, None, mode.frequency_hz)
        assert admittance(motor, DRIFT, mode.frequency_hz) == pytest.approx(plain, rel=1e-9)


def test_pins_left_open_change_nothing_in_a_run() -> None:
    def run(thermal: Thermal | None) -> dict[str, Any]:
        circuit = Circuit("open")
        circuit.V("a", "a", circuit.gnd, "SIN(0 50 51.7k)")
        circuit.V("b", "b", circuit.gnd, "SIN(0 50 51.7k 0 0 180)")
        warm = ("temperature", "heat") if thermal else ()
        add_motor(circuit, andersen(), ("a", "b", circuit.gnd, "shaft", *warm), thermal=thermal)
        simulator = BatchSimulator(circuit)
        simulator.options(**TRANSIENT_OPTIONS)
        simulator.save("i(va)", "v(xmotor.x)", "v(xmotor.normal)")
        simulator.transient(step_time=100e-9, end_time=2e-4, max_time=100e-9, use_initial_condition=True)
        return dict(simulator.result.raw.vectors)

    plain, warm = run(None), run(DRIFT)
    for name, values in plain.items():
        # Newton's iteration is closed to 1e-6, and the two netlists iterate differently
        assert np.abs(warm[name] - values).max() < 1e-5 * np.abs(values).max(), name


@pytest.mark.parametrize("motor", [andersen(), odd_motor()], ids=["andersen2002", "odd"])
@pytest.mark.parametrize("temperature", [-40.0, 60.0])
def test_held_temperature_drifts_frequency_coupling_and_capacitance(motor: Motor, temperature: float) -> None:
    shifted = [mode.frequency_hz * (1.0 + DRIFT.frequency_drift_per_k * temperature) for mode in motor.modes]
    for frequency in (200.0, *shifted, 1.01 * shifted[0]):
        expected = closed_form(motor, DRIFT, frequency, temperature)
        assert admittance(motor, DRIFT, frequency, temperature) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("between", "frequency"),
    # far above resonance nearly all heat is that of the dielectric, half of it in the capacitance between the groups
    [(0.0, 51.7e3), pytest.param(1e-9, 80e3, marks=pytest.mark.soak)],
)
def test_heat_is_what_a_free_stator_takes_up(between: float, frequency: float) -> None:
    """Settled, all the electrical power becomes heat in damping and dielectric."""
    motor = andersen().updated({"piezo.capacitance_ab_f": between})
    drive = pr.TwoPhaseDrive(voltage=20.0, frequency=frequency, phase_deg=180.0)
    circuit = motor_bench(motor, DriveSource(drive), law=None, thermal=pr.Thermal(heat_capacity_j_per_k=1e6)).circuit
    simulator = BatchSimulator(circuit)
    simulator.options(**TRANSIENT_OPTIONS)
    simulator.save("v(a)", "v(b)", "i(va)", "i(vb)", "v(heat)", "v(temperature)")
    periods, points = 200, 200
    step = drive.period / points
    simulator.transient(step_time=step, end_time=periods * drive.period, max_time=step, use_initial_condition=True)
    v = {name: np.asarray(values, float) for name, values in simulator.result.raw.vectors.items()}
    last = slice(-20 * points - 1, None)
    time = v["time"][last]

    def mean(values: Any) -> float:
        return float(np.trapezoid(values[last], time) / (time[-1] - time[0]))

    power = -mean(v["v(a)"] * v["i(va)"] + v["v(b)"] * v["i(vb)"])
    # after ten decay times e^-20 of the energy is missing; the window is whole periods but for a step
    assert mean(v["v(heat)"]) == pytest.approx(power, rel=1e-3)
    assert v["v(temperature)"][-1] < 1e-6  # a very great heat capacity


@pytest.mark.soak
def test_losses_heat_the_stator_until_it_has_drifted_away_from_its_drive(tmp_path: Path) -> None:
    """The deck: T = P R once warm, and the current that the closed form has at that temperature."""
    found = measured("thermal_drift", tmp_path)
    thermal = pr.Thermal()
    # 10 ms are five time constants, and the heat falls while it warms
    expected = thermal.thermal_resistance_k_per_w * found["heat_late_w"]
    assert found["temperature_late_k"] == pytest.approx(expected, rel=0.01)
    motor, omega = andersen(), 2.0 * pi * 51.7e3
    late = found["temperature_late_k"]
    one = closed_form(motor, thermal, 51.7e3, late)
    mode = motor.modes[1]
    # both groups driven against each other: twice what mode 2 takes of one
    stiffness = mode.stiffness_n_per_m * (1.0 + thermal.frequency_drift_per_k * late) ** 2
    mechanical = stiffness - mode.mass_kg * omega**2 + 1j * omega * mode.damping_n_s_per_m
    coupling = mode.coupling_a_n_per_v * (1.0 + thermal.coupling_drift_per_k * late)
    both = one + 1j * omega * coupling**2 / mechanical
    # mode 1 drops out when the groups are opposed; 193 points a period shift the resonance by 0.03 % of 0.8 % drift
    first = motor.modes[0]
    low = first.stiffness_n_per_m * (1.0 + thermal.frequency_drift_per_k * late) ** 2 - first.mass_kg * omega**2
    both -= (
        1j
        * omega
        * (first.coupling_a_n_per_v * (1.0 + thermal.coupling_drift_per_k * late)) ** 2
        / (low + 1j * omega * first.damping_n_s_per_m)
    )
    assert found["current_a_rms_late_a"] == pytest.approx(20.0 / sqrt(2.0) * abs(both), rel=0.03)
    assert found["current_a_rms_late_a"] < 0.7 * found["current_a_rms_early_a"]


def test_ranges_are_those_of_the_libraries() -> None:
    schema = Thermal.model_json_schema()["properties"]
    for library, parameter, field in (
        ("piezomotor_mode_thermal", "frequency_drift", "frequency_drift_per_k"),
        ("piezomotor_mode_thermal", "coupling_drift", "coupling_drift_per_k"),
        ("piezomotor_group_thermal", "capacitance_drift", "capacitance_drift_per_k"),
        ("piezomotor_cooling", "capacity", "heat_capacity_j_per_k"),
        ("piezomotor_cooling", "resistance", "thermal_resistance_k_per_w"),
        ("piezomotor_cooling", "ambient", "ambient_k"),
    ):
        declared = next(item for item in read_library(library).parameters if item.name == parameter)
        assert (declared.least, declared.greatest) == (schema[field]["minimum"], schema[field]["maximum"])


def test_derived_values_follow_from_what_they_are_derived_from() -> None:
    structure = andersen().structure
    assert structure is not None
    assert heat_capacity(structure) == pytest.approx(Thermal().heat_capacity_j_per_k, rel=0.02)
    modulus = (198.6 / 203.4 - 1.0) / (93.0 - 21.0)
    assert Thermal().frequency_drift_per_k == pytest.approx(0.5 * modulus + 0.5 * 12e-6, rel=0.02)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"heat_capacity_j_per_k": 0.0}, "heat_capacity_j_per_k = 0 J/K is not valid: it must be a number ≥ 1e-09"),
        ({"frequency_drift": 1.0}, "there is no 'frequency_drift'. Did you mean 'frequency_drift_per_k'?"),
    ],
)
def test_errors_name_the_value(values: dict[str, float], sentence: str) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        pr.Thermal(**values)
