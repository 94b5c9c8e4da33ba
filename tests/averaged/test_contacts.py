# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor with several contacts, against one that stands for them and against the full motor."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

import pyspice_runner as pr
from pyspice_runner.averaged.simulate import simulate_averaged
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.contacts import gathered
from pyspice_runner.motor.parameters import Contact, ContactPlace, Mount, Piezo, Rotor
from tests.motors import mode

WAVE = {"cosine": (1.0, 0.0), "sine": (0.0, 1.0)}  # of a ring with a travelling wave, along the circumference
DRIVE = pr.TwoPhaseDrive(voltage=175.0, frequency=39.9e3, phase_deg=90.0)


def ring(points: int = 8) -> pr.Motor:
    """A ring of 60 mm with nine waves, each of which touches the rotor at some points."""
    places = []
    for number in range(points):
        angle = 2.0 * pi * number / points
        tip_x = {"cosine": 1.2 * sin(angle), "sine": -1.2 * cos(angle)}
        tip_y = {"cosine": cos(angle), "sine": sin(angle)}
        places.append(ContactPlace(name=f"point{number}", multiplicity=9, tip_x=tip_x, tip_y=tip_y))
    moved = [{"tip_x": places[0].tip_x[name], "tip_y": places[0].tip_y[name]} for name in WAVE]
    modes = [
        mode(name, 39.43e3, 0.0176, 97.0, coupling_a_n_per_v=0.3 * a, coupling_b_n_per_v=0.3 * b, **tip)
        for (name, (a, b)), tip in zip(WAVE.items(), moved, strict=True)
    ]
    return pr.Motor(
        name="ring", modes=tuple(modes), contacts=tuple(places),
        piezo=Piezo(capacitance_a_f=10e-9, capacitance_b_f=10e-9, loss_tangent=0.0),
        contact=Contact(
            normal_stiffness_n_per_m15=2.7e8, tangential_compliance_tip_m_per_n23=1.44e-6,
            tangential_compliance_rotor_m_per_n23=1.44e-6, friction=0.2, preload_n=170.0,
        ),
        rotor=Rotor(radius_m=0.03, inertia_kg_m2=7e-5, bearing_damping_n_m_s=1e-5),
        mount=Mount(stiffness_n_per_m=100.0, mass_kg=0.1, damping_n_s_per_m=400.0),
    )  # fmt: skip


def halves(points: int) -> pr.Motor:
    """The flagship with two tips that do the same, or the one tip that stands for them."""
    still = {f"piezo.motion_{axis}_{group}_m_per_v": 0.0 for axis in "xy" for group in "ab"}
    one = pr.load_motor("bimodal40").updated(still)
    if points == 1:
        return one.model_copy(update={"contact": gathered(one.contact, 2, one.contact.preload_n)})
    tips = {f"tip_{axis}": {of.name: getattr(of, f"tip_{axis}") for of in one.modes} for axis in "xy"}
    return one.model_copy(update={"contacts": tuple(ContactPlace(name=name, **tips) for name in ("left", "right"))})


def test_two_equal_contacts_are_the_one_that_stands_for_both() -> None:
    courses = {"voltage": [(0.0, 80.0), (10e-3, 120.0)], "load_torque": [(5e-3, 0.0), (5.1e-3, 5e-4)]}
    drive = pr.default_drive(halves(1))
    one, two = (simulate_averaged(halves(points), drive, 20e-3, courses=courses) for points in (1, 2))
    assert one.slip.max() > 0.3
    for name in one.units:
        values = getattr(one, name)
        at = np.interp(one.time_s, two.time_s, getattr(two, name))
        assert at == pytest.approx(values, rel=1e-9, abs=1e-9 * np.abs(values).max()), name


def test_an_exported_unit_has_the_contacts_of_the_motor(tmp_path: Path) -> None:
    file = pr.export_motor(halves(2), tmp_path / "motor.fmu")
    run = simulate_averaged(halves(2), pr.default_drive(halves(2)), 10e-3)
    start = {"contact[2].share": 0.5, "contact[2].friction_ratio": 1.0, "contact[2].mode[1].tip_x": 0.9856614997}
    unit = simulate_fmu(str(file), stop_time=10e-3, output_interval=1e-3, start_values=start, output=["speed"])
    assert unit["speed"][-1] == pytest.approx(run.rotor_speed_rad_s[-1], rel=1e-3)


def test_ngspice_has_one_contact_only() -> None:
    run = simulate_averaged(ring(), DRIVE, 10e-3)
    assert run.deck is None
    with pytest.raises(ParameterError, match=r"averaged motor in ngspice, and its \.lib, are for a motor with one"):
        simulate_averaged(ring(), DRIVE, 10e-3, engine="spice")
