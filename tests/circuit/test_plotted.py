# SPDX-License-Identifier: GPL-3.0-or-later
"""What only serves a plot of a brush: computed after a run, and in the circuit."""

from dataclasses import replace

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import MotorSubCircuit
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.circuit.state import Discretisation
from pyspice_runner.run.kernel import transient


@pytest.mark.parametrize(("sliders", "flat"), [(1, 0.0), (5, 40e-6)])
def test_slider_and_state_of_a_brush_are_those_of_its_circuit(sliders: int, flat: float) -> None:
    motor, law = pr.load_motor("bimodal40").updated({"contact.worn_flat_radius_m": flat}), Law("brush", sliders)
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    step = Discretisation(2e-7)
    bench = motor_bench(motor, DriveSource(drive), law=law, discretisation=step)
    whole = MotorSubCircuit(motor, law=law, discretisation=step)
    text = str(bench.circuit)
    assert "Bslips" not in text
    assert "Bslips" in whole.parts
    full = motor_bench(motor, DriveSource(drive), law=law, discretisation=step)
    lean = MotorSubCircuit(motor, law=law, discretisation=step, plotted=False)
    full.circuit.raw_spice = full.circuit.raw_spice.replace(lean.parts, whole.parts)
    names = ["v(xmotor.slider)", "v(xmotor.state)"]
    runs = [transient(each, names, step=2e-7, duration=3e-4) for each in (bench, replace(full, signals={}))]
    computed, in_circuit = (run.vectors() for run in runs)
    for name in names:
        assert np.ptp(in_circuit[name]) > 0.02
        # the iteration of the circuit ends at 1e-6 of a value
        np.testing.assert_allclose(computed[name], in_circuit[name], atol=1e-5 * np.abs(in_circuit[name]).max())
