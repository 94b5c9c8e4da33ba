# SPDX-License-Identifier: GPL-3.0-or-later
"""Strain, stress and temperature of the ceramic of a running motor, and whether they exceed its limits.

A Bernoulli–Euler beam strains its outer fibre by the curvature times the distance from the neutral axis. The stress is
Young's modulus times that strain, without the contribution of the field, E d₃₁ E₃ (0.7 MPa at 50 V on the plates of
andersen2002). The sine series of the curvature is summed with Lanczos' factors, which remove its ringing at the ends of
the plates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from math import nan, sqrt

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.model.beam import solve_resonator
from pyspice_runner.model.motor import Motor, Structure

Array = NDArray[np.float64]
STRESSED = (
    "The ceramic is stressed to {stress:.3g} MPa; its rated dynamic strength is {strength:.3g} MPa. Lower the voltage."
)
HEATED = (
    "In the steady state the losses heat the stator by {rise:.3g} K to {temperature:.3g} °C; the limit is {most:.3g} "
    "°C, half the Curie temperature. Lower the voltage, or drive it for a short time."
)
_POINTS = 41  # along each patch


@cache
def _outer_strain(structure: Structure) -> tuple[Array, Array]:
    """Return the strain of the outer fibres per modal displacement in 1/m, (points, modes), and their moduli in Pa."""
    resonator = solve_resonator(structure.beam, structure.patches, structure.tip)
    shapes, k = len(resonator.coefficients), resonator.wavenumbers
    smooth = np.sinc(np.arange(1, shapes + 1) / (shapes + 1))
    strains, moduli = [], []
    for patch in structure.patches:
        x = np.linspace(patch.start_m, patch.end_m, _POINTS)
        curvature = np.sin(np.outer(x, k)) @ ((smooth * k**2)[:, None] * resonator.coefficients)
        strains.append((0.5 * structure.beam.thickness_m + patch.thickness_m) * curvature)
        moduli.append(np.full(_POINTS, patch.youngs_modulus_pa))
    return np.concatenate(strains), np.concatenate(moduli)


def stress_of_modes(structure: Structure, modes: int) -> Array:
    """Return the stress of the outer fibres per displacement of the first modes in Pa/m, (points, modes)."""
    strain, modulus = _outer_strain(structure)
    return modulus[:, None] * strain[:, :modes]


def peak_of_motion(motor: Motor, displacement_m: Array) -> dict[str, float]:
    """Return the greatest strain and stress over modal displacements in m, shape (modes, points).

    They are NaN without a known beam.
    """
    return _peak(motor, lambda shape: np.abs(shape @ displacement_m).max(axis=1))


def peak_of_amplitudes(motor: Motor, amplitudes_m: Sequence[float]) -> dict[str, float]:
    """Return an upper bound of strain and stress: all modes at their amplitudes at once."""
    return _peak(motor, lambda shape: np.abs(shape) @ np.asarray(amplitudes_m))


def _peak(motor: Motor, strain_of: Callable[[Array], Array]) -> dict[str, float]:
    """Return the greatest strain and stress, for a strain as a function of the strain per modal displacement."""
    if motor.structure is None:
        return {"ceramic_strain": nan, "ceramic_stress_pa": nan}
    shape, modulus = _outer_strain(motor.structure)
    strain = strain_of(shape[:, : len(motor.modes)])
    return {"ceramic_strain": float(strain.max()), "ceramic_stress_pa": float((modulus * strain).max())}


def amplitude(mean_square_velocity: float, omega: float) -> float:
    """Return the amplitude in m of a sinusoidal displacement."""
    return sqrt(2.0 * max(mean_square_velocity, 0.0)) / omega


def temperature_rise(motor: Motor, heat_w: float) -> float:
    """Return the steady temperature in K above the surroundings; NaN without a thermal resistance."""
    return nan if motor.limits is None else motor.limits.thermal_resistance_k_per_w * heat_w


def exceeded(motor: Motor, stress_pa: float, rise_k: float) -> tuple[str, ...]:
    """Return one sentence for each limit that a stress and a temperature rise exceed."""
    limits = motor.limits
    if limits is None:
        return ()
    found = []
    if stress_pa > limits.dynamic_strength_pa:
        found.append(STRESSED.format(stress=1e-6 * stress_pa, strength=1e-6 * limits.dynamic_strength_pa))
    temperature, most = limits.ambient_c + rise_k, 0.5 * limits.curie_temperature_c
    if temperature > most:
        found.append(HEATED.format(rise=rise_k, temperature=temperature, most=most))
    return tuple(found)
