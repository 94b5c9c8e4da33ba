# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor with several contacts, against one that stands for them and against the full motor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

import pyspice_runner as pr
from pyspice_runner.averaged.simulate import simulate_averaged
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.parameters import Contact
from tests.motors import motor as motor_of
from tests.rings import ring, with_contacts
from tests.runs import simulated
from tests.selection import mostly

UNEQUAL = (  # on a carrier that moves along the rotor, too
    {"share": 0.6, "height_m": 5e-8, "contact": {"friction": 0.2}},
    {"share": 0.4, "height_m": -3e-8, "radius_m": 0.012, "direction": -1, "multiplicity": 2},
)
ALONG = {"mount.tangential_stiffness_n_per_m": 3e5, "mount.tangential_damping_n_s_per_m": 5.0}


@pytest.mark.parametrize("name", ["bimodal40", "examples/plate40.toml"])
def test_two_equal_contacts_are_the_one_that_stands_for_both(name: str) -> None:
    """With courses of the voltage and of the load; the C code has the values rounded to ten digits."""
    motor = pr.load_motor(name)
    drive = pr.default_drive(motor).model_copy(update={"voltage": 80.0})
    courses = {"voltage": [(0.0, 80.0), (10e-3, 120.0)], "load_torque": [(5e-3, 0.0), (5.1e-3, 5e-4)]}
    one, two = (
        simulate_averaged(with_contacts(motor, *places), drive, 20e-3, courses=courses)
        for places in ([{"multiplicity": 2}], [{}, {}])
    )
    assert one.slip.max() > 0.3
    for column in one.units:
        values = getattr(one, column)
        assert getattr(two, column) == pytest.approx(values, rel=1e-8, abs=1e-8 * np.abs(values).max()), column


@pytest.mark.soak
def test_unequal_contacts_turn_the_rotor_as_in_the_full_motor() -> None:
    """Angle of a spin-up: shares, heights, levers, friction, a tip that faces backward, a carrier that moves along.

    0.5 % for the first periods, in which free oscillations decay; in the last millisecond 0.1 %.
    """
    flagship = pr.load_motor("bimodal40").updated(ALONG)
    back = {"tip_x": {one.name: -0.8 * one.tip_x for one in flagship.modes}}
    motor = with_contacts(flagship, UNEQUAL[0], UNEQUAL[1] | back)
    drive = pr.default_drive(motor)
    averaged, full = simulate_averaged(motor, drive, 12e-3), simulated(motor, drive, duration=12e-3)
    for begin, bound in ((0.0, 5e-3), (11e-3, 1e-3)):
        late = full.time_s >= begin
        angle = np.trapezoid(full.rotor_speed_rad_s[late], full.time_s[late])
        turned = averaged.rotor_position_rad[-1] - np.interp(begin, averaged.time_s, averaged.rotor_position_rad)
        assert turned == pytest.approx(angle, rel=bound)


@pytest.mark.soak
def test_a_ring_is_trusted_in_a_step_of_the_load_and_of_the_frequency(tmp_path: Path) -> None:
    """Against steady states of the full motor."""
    motor = ring(tmp_path)
    drive = pr.default_drive(motor)
    courses = {
        "load_torque": [(20e-3, 0.0), (20.1e-3, 0.05)],
        "frequency": [(40e-3, drive.frequency), (40.1e-3, drive.frequency + 300.0)],
    }
    run = simulate_averaged(motor, drive, 60e-3, courses=courses)
    assert max(run.error_estimate.shares.values()) < 0.01
    assert run.trusted


def test_an_exported_unit_has_the_contacts_of_the_motor(tmp_path: Path) -> None:
    motor = with_contacts(pr.load_motor("bimodal40"), {"share": 0.7}, {"share": 0.3, "tip_y": {"mode-3": 0.9}})
    run = simulate_averaged(motor, pr.default_drive(motor), 10e-3)
    file = pr.export_motor(motor, tmp_path / "motor.fmu")
    start = {"contact[2].share": 0.3, "contact[2].mode[3].tip_y": 0.9}
    unit = simulate_fmu(str(file), stop_time=10e-3, output_interval=1e-3, start_values=start, output=["speed"])
    assert unit["speed"][-1] == pytest.approx(run.rotor_speed_rad_s[-1], rel=1e-3)


@pytest.mark.parametrize("power", mostly(pytest.mark.soak, [1.0, 2.0], [1.0]))
def test_a_lining_and_rough_surfaces_turn_the_rotor_as_in_ngspice_and_in_the_full_motor(power: float) -> None:
    """The penetration and the limit of stick of the flagship; its contact opens with the exponent of 2."""
    motor = pr.load_motor("bimodal40")
    own, sides = motor.contact, [f"tangential_compliance_{side}_m_per_n23" for side in ("tip", "rotor")]
    stiffness = own.preload_n / contact_law.static_penetration(own) ** power
    compliance = contact_law.limit_ratio(own) / own.friction / stiffness ** (1.0 / power)
    changed = {"normal_stiffness_n_per_m15": stiffness, "exponent": power, **dict.fromkeys(sides, 0.5 * compliance)}
    document = own.model_dump() | dict.fromkeys(("effective_radius_m", "poisson")) | changed
    motor = motor.model_copy(update={"contact": Contact(**document), "materials": None})
    drive = pr.default_drive(motor)
    compiled, spice = (simulate_averaged(motor, drive, 0.03, speed=5.0, engine=one) for one in ("compiled", "spice"))
    assert compiled.torque_n_m[-1] == pytest.approx(spice.torque_n_m[-1], rel=1e-4)
    friction = own.friction * own.preload_n * motor.rotor.radius_m
    full = pr.steady_state(motor, drive, speed=5.0)
    assert compiled.torque_n_m[-1] == pytest.approx(full.torque_n_m, abs=0.01 * friction)
    assert (compiled.separated[-1] > 0.0) == (power == 2.0)


def test_what_has_no_averaged_model_is_an_error(tmp_path: Path) -> None:
    motor, other = ring(tmp_path), {"exponent": 1.0, "normal_stiffness_n_per_m15": 1e7}
    drive = pr.default_drive(motor)
    assert simulate_averaged(motor, drive, 10e-3).deck is None
    with pytest.raises(ParameterError, match=r"averaged motor in ngspice, and its \.lib, are for a motor with one"):
        simulate_averaged(motor, drive, 10e-3, engine="spice")
    mixed = with_contacts(motor_of(), {}, {"contact": other})
    with pytest.raises(ParameterError, match=r"exponent = 1 and 1\.5 has no averaged model: it must be the same"):
        simulate_averaged(mixed, drive, 10e-3)
