# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench of a motor as a compiled module: its ports, its values and its vectors. ``make verilog-a`` runs it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import DriveSource, motor_bench
from pyspice_runner.circuit.compiled import loading, missing_form, module_of, module_signals, module_subcircuit
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.state import Discretisation, state_vectors
from pyspice_runner.spice.library import read_library

MOTOR = pr.load_motor("andersen2002-unintended-mode")


def test_every_state_of_the_module_is_a_port() -> None:
    """A simulator sets initial voltages of ports only."""
    source = module_of(MOTOR, Law()).source
    ports = re.search(r"module piezomotor_3_modes_mount\(([^)]*)\);\n    inout ([^;]*);\n", source)
    assert ports is not None
    assert ports[1] == ports[2]
    declared = ", ".join(re.findall(r"(?m)^    electrical ([^;]+);$", source))
    assert ports[1] == declared
    assert "displacement_3, velocity_3" in ports[1]
    assert "displacement_4" not in ports[1]


def test_the_instance_has_a_node_for_every_port() -> None:
    text = module_subcircuit(MOTOR, Law(), None, "piezomotor")
    instance = next(line for line in text.splitlines() if line.startswith("N1 ")).split()
    ports = re.search(r"module \w+\(([^)]*)\)", module_of(MOTOR, Law()).source)
    assert ports is not None
    assert len(instance) - 2 == len(ports[1].split(", "))
    assert len(set(instance)) == len(instance)


@pytest.mark.parametrize(
    ("changes", "has", "lacks"),
    [
        ({}, {"carrier", "carrier_velocity"}, {"share", "temperature"}),
        ({"mount": None}, {"slider"}, {"carrier", "carrier_velocity", "share", "temperature"}),
        ({"rotor.bearing_friction_n_m": 1e-4}, {"carrier", "share"}, {"temperature"}),
    ],
)
def test_a_module_has_no_states_that_its_motor_does_not_need(
    changes: dict[str, object], has: set[str], lacks: set[str]
) -> None:
    module = module_of(MOTOR.updated(changes), Law())
    assert has <= set(module.ports)
    for node in lacks:
        assert node not in module.ports
        assert f"V({node})" not in module.source
        assert f"I({node})" not in module.source


def test_modes_are_written_to_be_exact_at_resonance_and_the_slider_follows_in_half_a_step() -> None:
    step = 1e-7
    text = module_subcircuit(MOTOR, Law(), Discretisation(step), "piezomotor")
    values = dict(re.findall(r"(\w+)=(\S+)", text))
    mode = MOTOR.modes[1]
    half = np.pi * mode.frequency_hz * step
    assert float(values["mass_2"]) == pytest.approx(mode.mass_kg * np.cos(half) ** 2, rel=1e-9)
    assert float(values["stiffness_2"]) == pytest.approx(4 * mode.mass_kg / step**2 * np.sin(half) ** 2, rel=1e-9)
    assert float(values["slider_time"]) == step / 2


def test_a_deck_asks_for_one_thread() -> None:
    """The start file of ngspice 46 asks for eight, which make a single device many times slower."""
    bench = motor_bench(MOTOR, DriveSource(pr.default_drive(MOTOR)), compiled=True)
    assert "\nset num_threads=1\n" in loading(bench.modules[0])
    assert loading(bench.modules[0]) in str(bench.circuit)
    assert bench.modules == (module_of(MOTOR, Law()),)


def test_the_vectors_of_rest_are_those_of_the_subcircuits() -> None:
    """All displacements of the module are relative to rest under the preload, those of the subcircuits to no load."""
    motor = MOTOR.updated({"modes.0.tip_x": 0.3})
    rest = {name: np.zeros(1) for name in state_vectors(motor, Law())}
    signals = module_signals(motor, None, "xmotor")
    for signal in signals.values():
        rest |= {name: np.zeros(1) for name in signal.terms if not name.startswith("@")}
    preload = motor.contact.preload_n
    for number, mode in enumerate(motor.modes, start=1):
        elastic = signals[f"v(xmotor.xmode{number}.elastic)"].of(rest)
        assert elastic[0] == pytest.approx(-mode.tip_y * preload)
    for axis in "xy":
        shapes = [getattr(mode, f"tip_{axis}") * mode.tip_y / mode.stiffness_n_per_m for mode in motor.modes]
        assert signals[f"v(xmotor.{axis})"].of(rest)[0] == pytest.approx(-1e6 * preload * sum(shapes))


def test_a_contact_without_a_compiled_form_is_named(tmp_path: Path) -> None:
    assert missing_form(None).startswith("contact = None (a free tip) has no compiled form")
    (tmp_path / "law.lib").write_text(read_library("piezomotor_coulomb").text, encoding="utf-8")
    own = Law(str(tmp_path / "law.lib"))
    assert "has no compiled form; there is one of spring-slider, coulomb, brush." in missing_form(own)
    with pytest.raises(pr.ParameterError, match="has no compiled form"):
        module_subcircuit(MOTOR, own, None, "piezomotor")
