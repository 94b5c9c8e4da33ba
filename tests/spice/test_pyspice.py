# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine as a PySpice simulator, used as PySpice's own are."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit
from PySpice.Unit import u_H, u_Hz, u_kHz, u_kOhm, u_mH, u_ms, u_nF, u_Ohm, u_us, u_V

from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.spice.pyspice import BatchSimulator

RESISTANCE, INDUCTANCE, CAPACITANCE = 1e3, 0.22, 4.7e-9  # 4.95 kHz, Q = 6.8


@pytest.fixture(autouse=True)
def _scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def rlc() -> Circuit:
    """Series resonator behind a voltage source, its capacitor's voltage the output."""
    circuit = Circuit("series resonator")
    circuit.SinusoidalVoltageSource("drive", "source", circuit.gnd, amplitude=2 @ u_V, frequency=3 @ u_kHz)
    circuit.R(1, "source", "middle", 1 @ u_kOhm)
    circuit.L(1, "middle", "out", 220 @ u_mH)
    circuit.C(1, "out", circuit.gnd, 4.7 @ u_nF)
    return circuit


def gain(frequency: NDArray[np.float64] | float) -> NDArray[np.complex128]:
    s = 2j * np.pi * np.asarray(frequency)
    return 1.0 / (1.0 + s * RESISTANCE * CAPACITANCE + s**2 * INDUCTANCE * CAPACITANCE)


def test_the_transient_of_a_resonator_follows_its_closed_form() -> None:
    simulator = BatchSimulator(rlc())
    simulator.options(reltol=1e-6)
    analysis = simulator.transient(
        step_time=1 @ u_us, end_time=1.5 @ u_ms, max_time=1 @ u_us, use_initial_condition=True
    )
    time, out = np.asarray(analysis.time), np.asarray(analysis.out)
    assert time[-1] == pytest.approx(1.5e-3)
    # steady sine plus the free decay that makes v(0) = 0 and i(0) = 0
    w, steady = 2.0 * np.pi * 3e3, 2.0 * gain(3e3)
    decay = RESISTANCE / (2.0 * INDUCTANCE)
    ring = np.sqrt(1.0 / (INDUCTANCE * CAPACITANCE) - decay**2)
    start, slope = -steady.imag, -w * steady.real
    free = np.exp(-decay * time) * (start * np.cos(ring * time) + (slope + decay * start) / ring * np.sin(ring * time))
    exact = np.imag(steady * np.exp(1j * w * time)) + free
    # trapezoidal rule, h = 1 us: the ringing's phase is off by (ring h)²/12 · ring t = 8e-5 · 47 = 4e-3 of some 3 V
    np.testing.assert_allclose(out, exact, atol=0.015)
    assert np.abs(exact).max() > 2.0
    np.testing.assert_allclose(np.asarray(analysis["vdrive"]), -np.asarray(analysis.branches["l1"]), atol=1e-12)
    np.testing.assert_array_equal(np.asarray(analysis.out.abscissa), time)


def test_start_time_leaves_the_beginning_out() -> None:
    analysis = BatchSimulator(rlc()).transient(step_time=1 @ u_us, start_time=0.5 @ u_ms, end_time=1 @ u_ms)
    assert float(np.asarray(analysis.time)[0]) >= 0.5e-3


@pytest.mark.parametrize(("variation", "number"), [("lin", 31), ("dec", 20), ("oct", 7)])
def test_ac_sweeps_of_every_kind_follow_the_closed_form(variation: str, number: int) -> None:
    analysis = BatchSimulator(rlc()).ac(
        variation=variation, number_of_points=number, start_frequency=170 @ u_Hz, stop_frequency=19.3 @ u_kHz
    )
    frequency, out = np.asarray(analysis.frequency), np.asarray(analysis.out)
    assert np.iscomplexobj(out)
    assert not np.iscomplexobj(frequency)
    assert frequency[0] == pytest.approx(170.0)
    assert frequency[-1] <= 19.3e3 * (1.0 + 1e-9)
    if variation == "lin":
        assert len(frequency) == number
        assert frequency[-1] == pytest.approx(19.3e3)
    np.testing.assert_allclose(out, gain(frequency), rtol=1e-9)  # PySpice's source has an AC value of 1 V
    np.testing.assert_allclose(np.asarray(analysis.source), 1.0, rtol=1e-12)


def test_operating_point_and_dc_sweep_of_a_divider_follow_ohms_law() -> None:
    circuit = Circuit("divider")
    circuit.V("in", "top", circuit.gnd, 10 @ u_V)
    circuit.R(1, "top", "tap", 3 @ u_kOhm)
    circuit.R(2, "tap", circuit.gnd, 1 @ u_kOhm)
    simulator = BatchSimulator(circuit)
    point = simulator.operating_point()
    np.testing.assert_allclose(np.asarray(point.tap), [2.5], rtol=1e-9)
    np.testing.assert_allclose(np.asarray(point.vin), [-2.5e-3], rtol=1e-9)
    swept = simulator.dc(Vin=slice(-2, 2, 0.5))
    np.testing.assert_allclose(np.asarray(swept.sweep), np.arange(-2.0, 2.1, 0.5), atol=1e-12)
    np.testing.assert_allclose(np.asarray(swept.tap), np.asarray(swept.sweep) / 4.0, atol=1e-9)


def test_temperature_reaches_the_elements() -> None:
    circuit = Circuit("thermometer")
    circuit.V("in", "top", circuit.gnd, 1 @ u_V)
    circuit.R(1, "top", circuit.gnd, 100 @ u_Ohm, raw_spice="tc1=0.01")
    for arguments, ohms in (({}, 100.0), ({"temperature": 77, "nominal_temperature": 27}, 150.0)):
        point = BatchSimulator(circuit, **arguments).operating_point()
        np.testing.assert_allclose(np.asarray(point.vin), [-1.0 / ohms], rtol=1e-9)


def test_a_node_and_a_source_may_have_the_same_name() -> None:
    circuit = Circuit("namesakes")
    circuit.V("x", "vx", circuit.gnd, 3 @ u_V)
    circuit.R(1, "vx", circuit.gnd, 1 @ u_kOhm)
    point = BatchSimulator(circuit).operating_point()
    np.testing.assert_allclose(np.asarray(point.nodes["vx"]), [3.0])
    np.testing.assert_allclose(np.asarray(point.branches["vx"]), [-3e-3])


def test_saved_vectors_are_returned_in_the_order_of_the_request() -> None:
    simulator = BatchSimulator(rlc())
    simulator.save("v(out)", "i(L1)")
    simulator.save(["source", "v(out)"])
    assert ".save v(out) i(L1) source\n" in str(simulator)
    analysis = simulator.transient(step_time=1 @ u_us, end_time=0.1 @ u_ms)
    assert simulator.result is not None
    assert list(simulator.result.raw.vectors) == ["time", "v(out)", "i(l1)", "v(source)"]
    assert list(analysis.nodes) == ["out", "source"]
    assert list(analysis.branches) == ["l1"]


def test_probes_and_internal_parameters_are_returned() -> None:
    analysis = BatchSimulator(rlc()).transient(step_time=1 @ u_us, end_time=0.1 @ u_ms, probes=["out"])
    assert list(analysis.nodes) == ["out"]
    simulator = BatchSimulator(rlc())
    simulator.save_internal_parameters("@r1[i]")
    for _ in range(2):  # PySpice forgets the word "all" whenever it writes the deck
        assert ".save all @r1[i]\n" in str(simulator)
        analysis = simulator.transient(step_time=1 @ u_us, end_time=0.1 @ u_ms)
        assert set(analysis.nodes) == {"source", "middle", "out"}
        current = np.asarray(analysis.internal_parameters["@r1[i]"])
        np.testing.assert_allclose(current, -np.asarray(analysis.vdrive), atol=1e-9)


def test_prepare_writes_the_deck_and_runs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    simulator = BatchSimulator(rlc()).prepare("transient", step_time=1e-6, end_time=1e-3, use_initial_condition=True)
    assert str(simulator).splitlines()[-2:] == [".tran 1e-06s 0.001s 0s uic", ".end"]
    assert simulator.result is None


def test_a_failure_raises_and_removes_the_result_of_the_previous_run() -> None:
    circuit = rlc()
    simulator = BatchSimulator(circuit)
    simulator.transient(step_time=1 @ u_us, end_time=0.1 @ u_ms)
    assert simulator.result is not None
    circuit.L(2, "out", "nowhere", 1 @ u_H, raw_spice="foo=3")
    with pytest.raises(SimulationError, match=r"unknown parameter \(foo\)"):
        simulator.transient(step_time=1 @ u_us, end_time=0.1 @ u_ms)
    assert simulator.result is None


def test_vector_that_does_not_exist_raises() -> None:
    simulator = BatchSimulator(rlc())
    simulator.save("v(out)", "v(mistyped)")
    with pytest.raises(SimulationError, match=r"left out the vector v\(mistyped\)"):
        simulator.operating_point()


def test_a_measurement_raises_because_it_would_not_be_made() -> None:
    simulator = BatchSimulator(rlc())
    simulator.measure("TRAN", "top", "MAX v(out)")
    with pytest.raises(SimulationError, match=r"No \.measure possible"):
        simulator.transient(step_time=1 @ u_us, end_time=0.1 @ u_ms)


def test_the_timeout_of_the_simulator_applies_to_every_run() -> None:
    simulator = BatchSimulator(rlc(), timeout=0.2)
    with pytest.raises(SimulationError, match=r"did not finish within 0\.2 s"):
        simulator.transient(step_time=1 @ u_us, end_time=1e4, max_time=1 @ u_us)


def test_an_analysis_that_it_cannot_run_is_rejected() -> None:
    with pytest.raises(ParameterError) as caught:
        BatchSimulator(rlc()).noise("out", "0", "Vdrive", "lin", 10, 1, 100)
    assert str(caught.value) == "BatchSimulator does not run noise; it runs operating_point, dc, ac, transient."


def test_deck_is_the_same_in_every_process() -> None:
    script = """
import pyspice_runner as pr
from pyspice_runner.motor.drive import Load
from pyspice_runner.circuit.source import source_of
from pyspice_runner.run.kernel import simulator as ready
from pyspice_runner.run.point import Point
from pyspice_runner.run.recording import Recording
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.circuit.fixtures import admittance_bench
motor = pr.load_motor("andersen2002")
drive = pr.TwoToneDrive(voltage_1=1, frequency_1=2e4, voltage_2=2, frequency_2=4e4, phase_deg=30)
setup = Point(motor, source_of(drive, motor, None), Load(torque=1e-3))
simulator = ready(setup.bench(), Recording(setup, setup.discretisation).vectors(None))
print(simulator.prepare("transient", step_time=1e-7, end_time=1e-3), motor_library(motor))
print(admittance_bench(motor, preloaded=True))
"""
    decks = {
        subprocess.run(
            [sys.executable, "-c", script],
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(Path(__file__).parents[2])},
            capture_output=True, text=True, check=True,
        ).stdout
        for seed in ("0", "1")
    }  # fmt: skip
    assert len(decks) == 1
    assert ".tran 1e-07s 0.001s" in decks.pop()


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("nan")])
def test_an_invalid_timeout_is_rejected(timeout: float) -> None:
    with pytest.raises(ParameterError, match=r"timeout = .* s is not valid: it must be a number > 0 s"):
        BatchSimulator(Circuit("empty"), timeout=timeout)
