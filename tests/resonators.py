# SPDX-License-Identifier: GPL-3.0-or-later
"""Resonators whose circuit is known, their spectra, and fits that are compared with ngspice as they are made."""

from collections.abc import Sequence
from itertools import pairwise
from math import pi, sqrt

import numpy as np

import pyspice_runner as pr
from pyspice_runner.export.circuit import circuit_library
from pyspice_runner.impedance.one_port_fit import SpectrumFit
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.spice.ngspice import run_deck


def resonator(
    frequencies: Sequence[float],
    qualities: Sequence[float],
    ratios: Sequence[float],
    *,
    capacitance: float = 1e-9,
    loss_tangent: float = 0.01,
    reference: float = 1e5,
    lead_resistance: float = 0.0,
    lead_inductance: float = 0.0,
    rising: bool = True,
) -> EquivalentCircuit:
    """A circuit by its arms' series resonances in Hz, quality factors and capacitance ratios C/C₀.

    Its loss is a resistance in series with C₀, or with ``rising=False`` the ladder around the reference frequency.
    """
    arms = []
    for frequency, quality, ratio in zip(frequencies, qualities, ratios, strict=True):
        omega, motional = 2.0 * pi * frequency, ratio * capacitance
        arms.append(MotionalArm(1.0 / (omega * motional * quality), 1.0 / (omega**2 * motional), motional))
    leads = lead_resistance, lead_inductance
    parts = {"loss_tangent_rising": loss_tangent if rising else 0.0}
    return EquivalentCircuit(tuple(arms), capacitance, loss_tangent, reference, *leads, **parts)


def random_resonator(seed: int, arms: int, *, nearest: float = 3.0) -> tuple[EquivalentCircuit, np.ndarray]:
    """A circuit of arms with Q 20 to 5000, neighbours at least so many of the wider bandwidths apart, and a grid."""
    rng = np.random.default_rng(seed)
    qualities = np.exp(rng.uniform(np.log(20.0), np.log(5000.0), arms)).tolist()
    frequencies = [float(np.exp(rng.uniform(np.log(1e4), np.log(1e6))))]
    for before, after in pairwise(qualities):
        bandwidth = frequencies[-1] / min(before, after)
        frequencies.append(frequencies[-1] + nearest * bandwidth * float(np.exp(rng.uniform(0.0, np.log(10.0)))))
    low, high = frequencies[0], frequencies[-1]
    start = max(min(0.8 * low, low * (1.0 - 5.0 / qualities[0])), 0.3 * low)
    stop = max(1.2 * high, high * (1.0 + 5.0 / qualities[-1]))
    points = int(rng.integers(400, 4000))
    grid = np.linspace(start, stop, points) if seed % 2 else np.geomspace(start, stop, points)
    with_leads = bool(seed % 3)
    capacitance = float(np.exp(rng.uniform(np.log(1e-10), np.log(1e-8))))
    ratios = np.maximum(np.exp(rng.uniform(np.log(1e-3), np.log(0.1), arms)), 0.5 / np.array(qualities)).tolist()
    least = min(
        1.0 / (2.0 * pi * f * r * capacitance * q) for f, r, q in zip(frequencies, ratios, qualities, strict=True)
    )
    circuit = resonator(
        frequencies,
        qualities,
        ratios,
        capacitance=capacitance,
        loss_tangent=float(rng.uniform(0.0, 0.05)),
        reference=sqrt(start * stop),
        rising=bool(seed % 4),
        lead_resistance=min(float(rng.uniform(0.0, 0.2)) * least, 4.0) * with_leads,
        lead_inductance=min(float(rng.uniform(0.0, 0.1)) / ((2.0 * pi * stop) ** 2 * capacitance), 8e-6) * with_leads,
    )
    return circuit, grid


def spectrum(circuit: EquivalentCircuit, frequency: np.ndarray, *, noise: float = 0.0, seed: int = 0) -> pr.Spectrum:
    """The circuit's spectrum with noise of a given share of |Y|, the same in all phases."""
    rng = np.random.default_rng(seed)
    error = rng.standard_normal((2, len(frequency)))
    y = circuit.admittance(frequency) * (1.0 + noise / sqrt(2.0) * (error[0] + 1j * error[1]))
    return pr.Spectrum.from_admittance(frequency, y, source="synthetic")


def fitted(measured: pr.Spectrum, modes: int | None = None, *, leads: bool = True) -> SpectrumFit:
    """A fit whose exported library, run by ngspice, has the fitted admittance to a millionth."""
    fit = pr.fit_spectrum(measured, modes, leads=leads)
    start, stop = fit.frequency_hz[[0, -1]].tolist()
    centres = [arm.series_resonance_hz for arm in fit.arms]
    deck = "\n".join(
        [
            "library of a fit",
            circuit_library(fit.circuit),
            "Vdrive a 0 DC 0 AC -1",
            "Xdevice a 0 resonator",
            ".options reltol=1e-9",
            ".save i(vdrive)",
            f".ac lin 301 {start!r} {stop!r}",
            ".end",
        ]
    )
    vectors = run_deck(deck, vectors=["i(vdrive)"], stop_frequency=None).raw.vectors
    frequency = vectors["frequency"].real
    assert frequency[-1] > 0.99 * stop
    assert np.abs(vectors["i(vdrive)"] / fit.admittance(frequency) - 1.0).max() < 1e-6, centres
    return fit


def values(circuit: EquivalentCircuit) -> np.ndarray:
    """C₀ and R, L, C of every arm."""
    arms = [value for arm in circuit.arms for value in (arm.resistance_ohm, arm.inductance_h, arm.capacitance_f)]
    return np.array([circuit.clamped_capacitance_f, *arms])


def extras(circuit: EquivalentCircuit) -> np.ndarray:
    """tan δ, R and L of the leads."""
    return np.array([circuit.loss_tangent, circuit.lead_resistance_ohm, circuit.lead_inductance_h])
