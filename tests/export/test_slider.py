# SPDX-License-Identifier: GPL-3.0-or-later
"""Exported motors with a slider: the circuit of a rotor of radius 1 m, with pins and parameters in N and m/s."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

import pyspice_runner as pr
from pyspice_runner.averaged.library import averaged_library
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.circuit.veriloga import motor_module
from pyspice_runner.export.fmu import fmu_texts
from tests.motors import BEAM40, sliding, turning

STAGE = sliding(pr.load_motor(BEAM40), guide_friction_n=0.1)
ROTARY = turning(STAGE, 1.0)
ROTOR = re.compile(r"rad/s|N\.m\b|kg\.m2|torque|rotor|rad\b|inertia of|speed_rad_s")


@pytest.mark.parametrize("library", [motor_library, averaged_library], ids=["full", "averaged"])
def test_a_library_has_a_header_in_newton_and_metres_per_second(library: object) -> None:
    assert callable(library)
    smooth = (motor.updated({motor.dry_friction[0]: 0.0}) for motor in (STAGE, ROTARY))
    (head, slides), (_, turns) = (library(motor).split("\n.subckt", 1) for motor in smooth)
    assert slides == turns
    assert not ROTOR.search(head.replace("rotor of this radius", ""))
    assert re.search(
        r"^\* PIN  shaft +inout  m/s +slider speed; a current fed into the pin is a driving force$", head, re.M
    )
    assert re.search(r"^\* PAR  inertia +kg +\S+ +1e-13 +1000 +mass$", head, re.M)
    assert re.search(r"^\* PAR  bearing +N\.s/m +\S+ +0 +1000 +viscous guide coefficient$", head, re.M)
    assert "1 V = 1 m/s" in head
    assert "1 A = 1 N" in head
    assert ".measure tran speed_m_s FIND v(shaft)" in head


def test_the_module_has_parameters_in_newton_and_metres_per_second() -> None:
    slides, turns = motor_module(STAGE), motor_module(ROTARY)
    comments = re.compile(r"//.*|\(\*.*?\*\)")
    assert comments.sub("", slides) == comments.sub("", turns)
    head = "\n".join(line for line in slides.splitlines() if line.startswith("//"))
    assert not ROTOR.search(head.replace("_rotor and", ""))
    assert '(* desc="mass", units="kg" *) parameter real inertia' in slides
    assert '(* desc="dry friction of the guide", units="N" *) parameter real bearing_torque' in slides
    with pytest.raises(pr.ParameterError, match="beam40 has a slider, and a rotational shaft is for a rotor: leave"):
        motor_module(STAGE, rotational=True)


def test_the_unit_of_a_control_tool_is_in_newton_and_metres_per_second() -> None:
    root = ElementTree.fromstring(fmu_texts(STAGE.updated({"slider.guide_friction_n": 0.0}))["modelDescription.xml"])
    found = {
        item.attrib["name"]: (item.attrib["description"], item[0].attrib.get("unit"))
        for item in root.iter("ScalarVariable")
    }
    assert found["speed"] == ("slider speed", "m/s")
    assert found["position"] == ("position of the slider", "m")
    assert found["load_torque"] == ("force that the load draws from the shaft", "N")
    assert found["torque"] == ("mean force of the contact on the slider", "N")
    assert found["inertia"] == ("mass", "kg")
    assert {unit.attrib["name"] for unit in root.iter("Unit")} >= {unit for _, unit in found.values() if unit}


def test_a_parameter_file_is_read_back(tmp_path: Path) -> None:
    file = pr.export_motor(STAGE, tmp_path / "stage.toml")
    assert pr.load_motor(file).to_dict() == STAGE.to_dict()
