# SPDX-License-Identifier: GPL-3.0-or-later
"""``STEP`` of exported resonators and motors: at that step the power at a resonance is within the stated error."""

import re
from math import pi
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.export.circuit import circuit_library
from pyspice_runner.run.window import Window
from pyspice_runner.spice.ngspice import run_deck
from tests.circuit.batch import measured
from tests.resonators import resonator

HERTZ = 28e3


def settled(library: str, line: str, hertz: float, quality: float, volts: float) -> float:
    """Return the settled mean power in W at the step of the header, by Aitken's rule from two stretches of time.

    They are two decays, or 120 periods; the envelope after switching on is one complex exponential.
    """
    (step,) = (float(text) for text in re.findall(r"^\* STEP +at most (\S+) s; the power .* within 1 %", library, re.M))
    periods = max(int(2.0 * quality / pi), 120)
    stop = 2.0 * periods / hertz
    tran = f".tran {step!r} {stop!r} {stop / 2.0 - 21.0 / hertz!r} {step!r} uic"
    source = f"V1 p 0 SIN(0 {volts!r} {hertz!r})"
    deck = f"step\n{library}\n{source}\n{line}\n.save i(V1)\n{tran}\n.end\n"
    vectors = run_deck(deck, vectors=["i(v1)"], stop_time=stop).raw.vectors
    time, amperes, found = vectors["time"].real, -vectors["i(v1)"].real, []
    for end in (stop / 2.0, stop):
        until = time <= end + 0.5 * step
        found.append(Window(time[until], 1.0 / hertz).harmonics(amperes[until])[0])
    first, second = found
    return float(0.5 * volts * (first**2 / (2.0 * first - second)).real)


@pytest.mark.parametrize("quality", [50.0, 633.0, pytest.param(5000.0, marks=pytest.mark.soak)])
def test_a_resonator_keeps_its_power_at_the_step_of_its_header(quality: float) -> None:
    circuit = resonator([HERTZ], [quality], [0.15], loss_tangent=0.0)
    power = settled(circuit_library(circuit), "X1 p 0 resonator", HERTZ, quality, 1.0)
    assert power == pytest.approx(0.5 / circuit.arms[0].resistance_ohm, rel=0.01)


@pytest.mark.soak
@pytest.mark.parametrize("name", ["bimodal40", "plate40"])
def test_a_motor_keeps_its_power_at_the_step_of_its_header(name: str) -> None:
    """At the largest conductance under preload of group A, by a voltage that leaves the contact stuck."""
    motor = pr.load_motor(name if name == "bimodal40" else "examples/plate40.toml")
    hertz = np.linspace(35e3, 45e3, 20001)
    conductance = motor.pressed_stator.admittance(2.0 * pi * hertz)[:, 0, 0].real
    place, volts = int(conductance.argmax()), 1e-2
    line = "Vb b 0 0\nXmotor p b 0 shaft piezomotor"
    power = settled(motor_library(motor), line, float(hertz[place]), 2.0 * 410.0, volts)  # neighbours have decayed
    assert power == pytest.approx(0.5 * volts**2 * conductance[place], rel=0.01)


def test_a_resonator_has_the_node_check(tmp_path: Path) -> None:
    library = circuit_library(resonator([HERTZ, 60e3], [633.0, 100.0], [0.15, 0.05]))
    for line, step, expected in (("X1 p 0", 1e-7, 0.0), ("X1 p 0", 3e-7, 1.0), ("R1 p 0 1k\nX1 p open", 1e-7, 1.0)):
        text = f"check\n{library}\nV1 p 0 SIN(0 1 28k)\n{line} resonator\n.tran {step} 250u 0 {step} uic\n"
        assert measured(f"{text}.measure tran check MAX v(x1.check)\n.end\n", tmp_path)["check"] == expected
