# SPDX-License-Identifier: GPL-3.0-or-later
"""Circuits whose arms share losses: passivity by closed form, and the exported library in ngspice, AC and transient."""

from dataclasses import replace

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.export.circuit import circuit_library
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.spice.ngspice import run_deck
from tests.resonators import fitted

ARMS = (
    MotionalArm(120.0, 0.0513, 1.0 / (0.0513 * (2 * np.pi * 111.4e3) ** 2)),
    MotionalArm(112.0, 0.0511, 1.0 / (0.0511 * (2 * np.pi * 112.7e3) ** 2)),
    MotionalArm(300.0, 0.12, 1.0 / (0.12 * (2 * np.pi * 114.1e3) ** 2)),
)
SHARED = EquivalentCircuit(
    ARMS, 1.5e-9, 0.012, 112.5e3, loss_tangent_falling=0.002, loss_tangent_rising=0.003,
    shared_losses=((0.5, 9.0, -6.0, 12.0), (0.0, -3.0, 5.0, 4.0)),
)  # fmt: skip
BAND = np.linspace(108e3, 118e3, 801)


def matrix_admittance(circuit: EquivalentCircuit, frequency: np.ndarray) -> np.ndarray:
    """Y by the full impedance matrix of the arms and the clamped capacitance."""
    found = []
    for s in 2j * np.pi * frequency:
        clamped = circuit.loss_conductance_s + sum(s * c / (1 + s * r * c) for r, c in circuit.dielectric())
        own = [circuit.loss_resistance_ohm + 1.0 / clamped]
        for arm, ohm in zip(circuit.arms, circuit.own_resistance_ohm, strict=True):
            own.append(ohm + s * arm.inductance_h + 1.0 / (s * arm.capacitance_f))
        weights = np.array(circuit.shared_losses)
        found.append(np.linalg.inv(np.diag(own) + weights.T @ weights).sum())
    return np.array(found)


def test_the_admittance_is_that_of_the_impedance_matrix() -> None:
    assert SHARED.device_admittance(BAND) == pytest.approx(matrix_admittance(SHARED, BAND), rel=1e-12)


def test_the_conductance_is_positive_from_direct_current_to_1_ghz() -> None:
    """By closed form Re Y is a sum of squares; here on a grid that is finer than the resonances."""
    assert min(SHARED.own_resistance_ohm) > 0.0
    assert np.linalg.eigvalsh(np.array(SHARED.damping_matrix)).min() > 0.0
    wide = np.concatenate([np.geomspace(1e-3, 1e9, 40_001), np.linspace(100e3, 125e3, 20_001)])
    assert SHARED.admittance(wide).real.min() >= 0.0


def test_the_library_has_the_admittance_of_the_fit() -> None:
    """:func:`tests.resonators.fitted` runs the library in ngspice and compares it to a millionth."""
    fit = fitted(pr.Spectrum.from_admittance(BAND, SHARED.admittance(BAND)), 3)
    assert fit.circuit.shared_losses
    assert fit.rms_relative_error < 2e-3
    document = fit.to_dict()
    assert np.shape(document["damping_matrix"]) == (3, 3)
    assert document["leads"] is None


@pytest.mark.soak
def test_an_arm_of_a_stated_number_may_lie_far_from_the_band() -> None:
    """The fourth arm is at 190 kHz, the band ends at 118 kHz; the error was 0.07 % with arms of up to 120.5 kHz."""
    beyond = MotionalArm(9e3, 0.1, 1.0 / (0.1 * (2 * np.pi * 190e3) ** 2))
    device = replace(SHARED, arms=(*ARMS, beyond), shared_losses=((0.5, 9.0, -6.0, 12.0, 20.0),))
    fit = fitted(pr.Spectrum.from_admittance(BAND, device.admittance(BAND)), 4)
    assert sum(not arm.in_band for arm in fit.arms) == 1
    assert fit.rms_relative_error < 5e-5
    assert fit.main_arm.quality_factor == pytest.approx(
        max(ARMS, key=lambda arm: arm.capacitance_f).quality_factor, rel=0.01
    )


def oscillation(circuit: EquivalentCircuit, periods: int) -> np.ndarray:
    """The current after a step of 1 V, over so many periods of the slowest arm, 20 points each."""
    period = 1.0 / circuit.arms[0].series_resonance_hz
    deck = "\n".join(
        [
            "a step",
            circuit_library(circuit),
            f"Vdrive a 0 PWL(0 0 {period!r} 1)",
            "Xdevice a 0 resonator",
            f".tran {period / 20!r} {periods * period!r} 0 {period / 20!r} uic",
            ".save i(vdrive)",
            ".end",
        ]
    )
    return run_deck(deck, vectors=["i(vdrive)"], stop_time=periods * period).raw.vectors["i(vdrive)"].real


def decays(periods: int) -> None:
    """Check that the current is largest in the beginning and ends at nothing."""
    # what flows through the conductance in parallel for ever is not part of it
    current = np.abs(oscillation(SHARED, periods) + SHARED.loss_conductance_s)
    begin, end = current[: len(current) // 20].max(), current[-len(current) // 20 :].max()
    assert np.isfinite(current).all()
    assert end < 0.01 * begin


def test_the_current_after_a_step_dies_away() -> None:
    decays(2000)


@pytest.mark.soak
def test_the_current_after_a_step_dies_away_over_100000_periods() -> None:
    decays(100_000)
