# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine as a PySpice simulator, used as PySpice's own are."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PySpice.Spice.Netlist import Circuit
from PySpice.Unit import u_H, u_Hz, u_kHz, u_kOhm, u_mH, u_ms, u_nF, u_us, u_V

from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.spice.ngspice import BatchSimulator

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
    found = simulator.transient(
        step_time=1 @ u_us, end_time=1.5 @ u_ms, max_time=1 @ u_us, use_initial_condition=True
    ).raw.vectors
    time, out = found["time"], found["v(out)"]
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
    np.testing.assert_allclose(found["i(vdrive)"], -found["i(l1)"], atol=1e-12)


def test_start_time_leaves_the_beginning_out() -> None:
    run = BatchSimulator(rlc()).transient(step_time=1 @ u_us, start_time=0.5 @ u_ms, end_time=1 @ u_ms)
    assert run.raw.vectors["time"][0] >= 0.5e-3


@pytest.mark.parametrize(("variation", "number"), [("lin", 31), ("dec", 20), ("oct", 7)])
def test_ac_sweeps_of_every_kind_follow_the_closed_form(variation: str, number: int) -> None:
    found = (
        BatchSimulator(rlc())
        .ac(variation=variation, number_of_points=number, start_frequency=170 @ u_Hz, stop_frequency=19.3 @ u_kHz)
        .raw.vectors
    )
    frequency, out = found["frequency"].real, found["v(out)"]
    assert frequency[0] == pytest.approx(170.0)
    assert frequency[-1] <= 19.3e3 * (1.0 + 1e-9)
    if variation == "lin":
        assert len(frequency) == number
        assert frequency[-1] == pytest.approx(19.3e3)
    np.testing.assert_allclose(out, gain(frequency), rtol=1e-9)  # PySpice's source has an AC value of 1 V
    np.testing.assert_allclose(found["v(source)"], 1.0, rtol=1e-12)


def test_saved_vectors_are_returned_in_the_order_of_the_request() -> None:
    simulator = BatchSimulator(rlc())
    simulator.save("v(out)", "i(L1)")
    simulator.save("source", "v(out)")
    assert ".save v(out) i(L1) source\n" in str(simulator)
    simulator.transient(step_time=1 @ u_us, end_time=0.1 @ u_ms)
    assert list(simulator.result.raw.vectors) == ["time", "v(out)", "i(l1)", "v(source)"]


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
        simulator.transient(step_time=1 @ u_us, end_time=0.1 @ u_ms)


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
    assert str(caught.value) == "BatchSimulator does not run noise; it runs ac, transient, operating_point."


def test_deck_is_the_same_in_every_process() -> None:
    script = """
import pyspice_runner as pr
from pyspice_runner.motor.drive import Load
from pyspice_runner.circuit.source import source_of
from pyspice_runner.run.kernel import simulator as ready
from pyspice_runner.run.point import Point
from pyspice_runner.run.recording import Recording
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.circuit.bench import admittance_bench
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
