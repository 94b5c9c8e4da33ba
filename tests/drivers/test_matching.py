# SPDX-License-Identifier: GPL-3.0-or-later
"""Matches to a source resistance: two published ones, their reflection, and designs for a motor."""

from math import pi

import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import Design
from pyspice_runner.drivers.parts import match_to_source

pytestmark = pytest.mark.xdist_group("drivers")

# resistance in ohm and clamped capacitance in F of a transducer at its nominal frequency in Hz; published coil in H and
# capacitor in F that match it to 50 ohm, and the relative rounding of what is published
PUBLISHED = {
    "1.8 kohm": (1800.0, 65e-12, 800e3, 58.8e-6, 588e-12, 2e-3),
    "1.5 kohm": (1500.0, 692e-12, 100e3, 430e-6, 5e-9, 5e-3),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_match_is_the_published_one(name: str) -> None:
    ohms, clamped, hertz, coil, capacitor, rounding = PUBLISHED[name]
    found = match_to_source(1.0 / (1.0 / ohms + 2j * pi * hertz * clamped), 50.0, hertz)
    assert found == pytest.approx({"series_inductance": coil, "parallel_capacitance": capacitor}, rel=rounding)


@pytest.mark.parametrize(("load", "source"), [(300.0 - 900.0j, 50.0), (20.0 - 1500.0j, 10.0), (80.0 + 40.0j, 75.0)])
def test_a_matched_load_is_the_source_resistance(load: complex, source: float) -> None:
    found, omega = match_to_source(load, source, 28e3), 2.0 * pi * 28e3
    across = 1.0 / load + 1j * omega * found.get("parallel_capacitance", 0.0)
    if "parallel_inductance" in found:
        across += 1.0 / (1j * omega * found["parallel_inductance"])
    assert 1j * omega * found["series_inductance"] + 1.0 / across == pytest.approx(source)


def test_a_source_above_the_load_and_one_without_effect_are_refused() -> None:
    with pytest.raises(pr.ParameterError, match="at most that resistance"):
        match_to_source(20.0 + 0j, 50.0, 28e3)
    with pytest.raises(pr.ParameterError, match="left out without the network l or llcc"):
        pr.DriverSpec(pr.TwoPhaseDrive(voltage=50.0, frequency=40e3), "linear", "inductor", source_ohm=50.0)


@pytest.mark.soak
@pytest.mark.parametrize("network", ["l", "llcc"])
def test_a_design_shows_the_stage_its_resistance_at_the_operating_point(network: str) -> None:
    motor = pr.load_motor("bimodal40")
    drive = pr.TwoPhaseDrive(voltage=80.0, frequency=40.7e3)
    found: Design = pr.design(motor, pr.DriverSpec(drive, "linear", network, source_ohm=50.0), speed=20.0)  # type: ignore[arg-type]
    assert found.driver is not None
    assert found.feasible, found.reason
    assert "At the operating point the stage sees" in found.reason
    for group in "ab":
        point, parts = found.points[1].group(group), found.driver.values(group, "llcc")
        *_, (_, before) = found.driver.passed(group, point.impedance_ohm, 1.0, 2.0 * pi * found.driver.frequency)
        # three digits of parts that cancel ten times the resistance, and the motor at a voltage a little off
        assert before.volts / before.amperes == pytest.approx(50.0, abs=5.0)
        assert (parts["series_capacitance"] == 1.0) is (network == "l")
        assert point.voltage_v == pytest.approx(found.wanted_v[group], rel=0.05)
