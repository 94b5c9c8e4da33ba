# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of the tutorial on impedance."""

from __future__ import annotations

import pytest

import pyspice_runner as pr
from pyspice_runner.impedance.one_port_fit import SpectrumFit
from tests.docs.numbers import missing


@pytest.fixture(scope="module")
def fits() -> list[SpectrumFit]:
    """The two circuits of the tutorial: of a plate that was ground too short, and of the pressed stator."""
    motor, band = pr.load_motor("bimodal40"), {"start": 36e3, "stop": 45e3, "points": 450}
    short = pr.admittance(motor.updated({"modes.2.frequency_hz": 40.03e3}), **band)
    pressed = pr.admittance(motor, state="preloaded", **band)
    return [
        pr.fit_spectrum(pr.Spectrum.from_admittance(one.frequency_hz, one.driven("A+B"))) for one in (short, pressed)
    ]


@pytest.mark.soak
def test_the_tutorial_has_the_values_of_its_circuits(fits: list[SpectrumFit]) -> None:
    free, pressed = (fit.main_arm for fit in fits)
    assert [len(fit.arms) for fit in fits] == [1, 1]
    assert not missing(
        "tutorial_impedance.md",
        f"{1e-3 * free.series_resonance_hz:.2f} kHz {free.quality_factor:.0f} {free.resistance_ohm:.1f} Ω",
        f"{1e3 * free.inductance_h:.1f} mH {1e12 * free.capacitance_f:.1f} pF",
        f"{free.characteristics.coupling_factor:.3f} {1e9 * fits[0].circuit.clamped_capacitance_f:.3f} nF",
        f"{1e-3 * pressed.series_resonance_hz:.2f} kHz {pressed.quality_factor:.0f} {pressed.resistance_ohm:.0f} Ω",
        f"{1e-3 * pr.load_motor('bimodal40').modes[2].frequency_hz:.2f} kHz",
    )
