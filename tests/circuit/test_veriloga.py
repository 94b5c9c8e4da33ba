# SPDX-License-Identifier: GPL-3.0-or-later
"""The Verilog-A motor against the subcircuits and the motor; ``make verilog-a`` compiles and runs it."""

import re
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.veriloga import WRITTEN, motor_module
from pyspice_runner.spice.library import data_path, read_library
from tests.motors import BEAM40

PARAMETER = re.compile(
    r'^ *\(\* desc="(?P<meaning>[^"]+)"(?:, units="(?P<unit>[^"]+)")? \*\) parameter (?:real|integer) '
    r"(?P<name>\w+) = (?P<value>\S+) from \[(?P<least>[^:]+):(?P<greatest>[^\]]+)\];$",
    re.M,
)
# parameter of the module: library and its parameter
SAME = {
    "preload": ("contact", "preload"), "friction": ("contact", "mu"), "radius": ("contact", "radius"),
    "normal_stiffness": ("contact", "normal_stiffness"), "compliance": ("contact", "compliance"),
    "normal_damping": ("contact", "damping"), "slider_time": ("contact", "slider_time"),
    "sliding": ("contact", "sliding"), "stribeck": ("contact", "stribeck"), "creep": ("coulomb", "creep"),
    "inertia": ("rotor", "inertia"), "bearing": ("rotor", "bearing"),
    "bearing_torque": ("bearing", "torque"), "bearing_angle": ("bearing", "angle"),
    "mount_stiffness": ("mount", "stiffness"), "mount_mass": ("mount", "mass"), "mount_damping": ("mount", "damping"),
    "mount_x_stiffness": ("mount", "stiffness"), "mount_x_mass": ("mount", "mass"),
    "mount_x_damping": ("mount", "damping"),
    "capacitance_a": ("group", "capacitance"), "capacitance_b": ("group", "capacitance"), "loss": ("group", "loss"),
    "drift_f": ("mode_thermal", "frequency_drift"), "drift_k": ("mode_thermal", "coupling_drift"),
    "drift_c": ("group_thermal", "capacitance_drift"),
    "mass_1": ("mode", "mass"), "damping_1": ("mode", "damping"), "stiffness_1": ("mode", "stiffness"),
    "coupling_a_1": ("mode", "coupling_a"), "coupling_b_1": ("mode", "coupling_b"),
    "tip_x_1": ("tip", "tip_x"), "tip_y_1": ("tip", "tip_y"),
    "softening_1": ("mode_soft", "softening"), "growth_1": ("mode_soft", "growth"),
}  # fmt: skip


def parameters(text: str) -> dict[str, re.Match[str]]:
    return {found["name"]: found for found in PARAMETER.finditer(text)}


def test_the_file_has_the_values_of_bimodal40() -> None:
    text = (data_path("behavioral") / "piezomotor.va").read_text(encoding="utf-8")
    assert set(text.splitlines()) <= set(motor_module(pr.load_motor("bimodal40")).splitlines())


def test_constants_stand_inside_the_time_derivative() -> None:
    """A constant before ddt has been seen to compile to wrong dynamics in OpenVAF, without a message."""
    for law in WRITTEN:
        text = motor_module(pr.load_motor(BEAM40), contact=law)
        assert "ddt(" in text
        assert not re.search(r"\* *ddt\(", text)


@pytest.mark.parametrize("name", SAME)
def test_a_parameter_has_the_unit_and_range_of_the_subcircuit(name: str) -> None:
    law = "coulomb" if name == "creep" else "spring-slider"
    found = parameters(motor_module(pr.load_motor(BEAM40), contact=law))[name]
    library, inner = SAME[name]
    (declared,) = (item for item in read_library(f"piezomotor_{library}").parameters if item.name == inner)
    assert (float(found["least"]), float(found["greatest"])) == (declared.least, declared.greatest)
    assert (found["unit"] or "1") == declared.unit


def test_every_mode_has_its_states_equations_and_values() -> None:
    motor = pr.load_motor("andersen2002-unintended-mode")
    text = motor_module(motor)
    found = parameters(text)
    for number, mode in enumerate(motor.modes, start=1):
        assert float(found[f"stiffness_{number}"]["value"]) == pytest.approx(mode.stiffness_n_per_m, rel=1e-9)
        assert float(found[f"tip_x_{number}"]["value"]) == pytest.approx(mode.tip_x, rel=1e-9)
        assert text.count(f"I(velocity_{number}) <+") == 1
        assert text.count(f"electrical displacement_{number}, velocity_{number};") == 1
    assert "mass_4" not in text
    assert "andersen2002-unintended-mode" in text.splitlines()[1]


def test_a_module_takes_a_name_and_no_law_that_it_does_not_have(tmp_path: Path) -> None:
    file = pr.export_motor(pr.load_motor("andersen2002"), tmp_path / "m.va", name="left")
    assert "\nmodule left(a, b, com, shaft, temperature);\n" in file.read_text(encoding="utf-8")
    law = tmp_path / "law.lib"
    law.write_text(read_library("piezomotor_coulomb").text, encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=r"contact = .* is not valid for a \.va file"):
        pr.export_motor(pr.load_motor("andersen2002"), tmp_path / "m.va", contact=str(law))
