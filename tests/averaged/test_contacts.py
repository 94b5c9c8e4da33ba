# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor with several contacts, against one that stands for them and against the full motor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

import pyspice_runner as pr
from pyspice_runner.averaged.run import AveragedRun
from pyspice_runner.averaged.simulate import simulate_averaged
from pyspice_runner.errors import ParameterError
from tests.rings import ring, with_contacts

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


def difference(averaged: AveragedRun, full: pr.Result) -> np.ndarray:
    """Return the speed of the averaged motor minus the mean of the full motor in each period, over its maximum."""
    period = 1.0 / averaged.frequency_hz.max()
    edges = np.arange(0.0, full.time_s[-1], period)
    angle = np.concatenate(([0.0], np.cumsum(np.diff(full.time_s) * full.rotor_speed_rad_s[1:])))
    mean = np.diff(np.interp(edges, full.time_s, angle)) / period
    ours = np.interp(0.5 * (edges[1:] + edges[:-1]), averaged.time_s, averaged.rotor_speed_rad_s)
    return np.asarray(ours - mean) / np.abs(mean).max()


@pytest.mark.soak
def test_unequal_contacts_turn_the_rotor_as_in_the_full_motor() -> None:
    """0.2 % of the maximum speed, RMS: shares, heights, levers, friction, a tip that faces backward, the carrier."""
    flagship = pr.load_motor("bimodal40").updated(ALONG)
    back = {"tip_x": {one.name: -0.8 * one.tip_x for one in flagship.modes}}
    motor = with_contacts(flagship, UNEQUAL[0], UNEQUAL[1] | back)
    drive = pr.default_drive(motor)
    runs = simulate_averaged(motor, drive, 10e-3), pr.simulate(motor, drive, 10e-3)
    assert np.sqrt(np.mean(difference(*runs) ** 2)) <= 2e-3


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


def test_ngspice_has_one_contact_only(tmp_path: Path) -> None:
    motor = ring(tmp_path)
    assert simulate_averaged(motor, pr.default_drive(motor), 10e-3).deck is None
    with pytest.raises(ParameterError, match=r"averaged motor in ngspice, and its \.lib, are for a motor with one"):
        simulate_averaged(motor, pr.default_drive(motor), 10e-3, engine="spice")
