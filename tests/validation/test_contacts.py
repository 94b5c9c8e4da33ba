# SPDX-License-Identifier: GPL-3.0-or-later
"""Motors with several contacts against an integrator that shares no code; the campaign has sixty such points."""

import ast
from pathlib import Path

import pytest

import pyspice_runner as pr
from tests.rings import ring
from validation import contact_points, contacts
from validation.contact_points import Drive, integrate, read

PERIODS, COULOMB = 100, {"contacts.left.law": "coulomb", "contacts.left.law.creep": 0.02}


def compared(motor, drive, **load):
    """Return means over the last periods by the integrator and by ngspice, and μ F₀ R."""
    points = read(motor.model_dump())
    theirs = integrate(
        points, Drive(drive.voltage, drive.frequency, drive.phase_deg), blocks=PERIODS, steps=400,
        speed=load.get("speed"), load=load.get("load_torque", 0.0),
    )  # fmt: skip
    ours = contacts._simulated(motor, drive, PERIODS / drive.frequency, 1.0 / drive.frequency, **load)
    return contacts._means(theirs), ours, points.scale, 1.0 - theirs.touching[-contacts.MEANS :].mean()


@pytest.mark.parametrize(("voltage", "opens", "law"), [(60.0, False, {}), (220.0, True, {}), (60.0, False, COULOMB)])
def test_two_tips_are_those_of_the_integrator(voltage, opens, law):
    motor = contacts.motor_of("tips").updated(law)
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=40.7e3, phase_deg=90.0)
    theirs, ours, scale, open_time = compared(motor, drive, speed=2.0)
    assert (open_time > 0.05) == opens
    assert ours["torque"] == pytest.approx(theirs["torque"], abs=contacts.ALLOWED * scale)
    assert ours["power"] == pytest.approx(theirs["power"], abs=contacts.ALLOWED * scale * 20.0)  # rad/s at no load


def test_a_free_ring_is_that_of_the_integrator_where_its_points_lift_off(tmp_path):
    motor = ring(tmp_path).updated({"rotor.inertia_kg_m2": 1e-5, "piezo.loss_tangent": 0.0})
    drive = pr.TwoPhaseDrive(voltage=350.0, frequency=39.9e3, phase_deg=90.0)
    theirs, ours, _, open_time = compared(motor, drive, load_torque=0.1)
    assert open_time > 0.2
    assert ours["speed"] == pytest.approx(theirs["speed"], rel=contacts.ALLOWED)


def test_the_integrator_imports_nothing_of_the_package_and_no_other_integrator():
    tree = ast.parse(Path(contact_points.__file__).read_text(encoding="utf-8"))
    names = [getattr(node, "module", "") or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    names += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    assert not {name.partition(".")[0] for name in names} & {"pyspice_runner", "tests", "validation"}
