# SPDX-License-Identifier: GPL-3.0-or-later
"""Which further measurement would decide a parameter that the data leave open.

The information of a measurement about the parameters is the product of its Jacobian, over its standard errors, with
itself; that of several adds up. So the standard error after a measurement is known before it is made (design of
experiments: A. C. Atkinson, A. N. Donev, R. D. Tobias, "Optimum Experimental Designs, with SAS", Oxford 2007).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pyspice_runner.calibration.points import DEFAULT_ERROR, RESONANCE, span
from pyspice_runner.calibration.prediction import SPECTRUM_ERROR, Band, Predictor
from pyspice_runner.calibration.run_up import settled_run_up
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.impedance.spectrum import Spectrum
from pyspice_runner.run.waveforms import Array

QUANTITIES = {  # quantity → what to measure
    "torque_n_m": "the torque", "current_a_rms_a": "the current of group A",
    "current_b_rms_a": "the current of group B", "power_w": "the electrical power",
    "normal_force_n": "the normal force", "current_a_phase_deg": "the phase of the current of group A",
    "resonance_hz": "the resonance",
}  # fmt: skip
_SPECTRA = {"free": "a spectrum of the free stator", "preloaded": "a spectrum of the stator pressed on the rotor"}
_BANDWIDTHS, _EACH = 8.0, 33  # on each side of a mode, and frequencies about each mode
_RAISED = 1.2  # of a mode, where the contact may move its resonance to


def informations(predictor: Predictor, x: Array) -> dict[str, Array]:
    """Return the information of each measurement that was not made: what to measure → matrix over the coordinates."""
    candidates = {**_quantities(predictor), **_spectra(predictor), **_run_up(predictor, x)}
    return {words: _information(candidate, x) for words, candidate in candidates.items()}


def _quantities(predictor: Predictor) -> dict[str, Predictor]:
    """Return the quantities that were not measured at the points."""
    points, found = predictor.points, dict[str, Predictor]()
    if points is None:
        return found
    setups = [predictor.point(predictor.base, conditions) for conditions in points.conditions]
    rows, one = tuple(range(len(points))), np.ones(len(points))
    for name, words in QUANTITIES.items():
        if name == RESONANCE and not predictor.balanced:  # a sweep of each point by ngspice takes minutes
            continue
        near = np.array([min(setup.source.frequencies) for setup in setups]) if name == RESONANCE else one
        own = replace(points, rows=rows, quantities=(name,) * len(rows), values=near, errors=one)
        try:
            own.check(setups)
        except ParameterError:  # two tones have neither a phase nor a resonance
            continue
        if name not in points.quantities:
            found[f"{words} at the same points"] = replace(predictor, points=own, bands=(), run_ups=(), shift=None)
    return found


def _spectra(predictor: Predictor) -> dict[str, Predictor]:
    """Return the spectra of the states that were not measured."""
    found = dict[str, Predictor]()
    for state, words in _SPECTRA.items():
        if state not in [band.state for band in predictor.bands]:
            frequency = _frequencies(predictor)
            flat = Spectrum.from_admittance(frequency, np.ones(len(frequency), complex))
            band = Band.of(flat, state, "A", SPECTRUM_ERROR)  # type: ignore[arg-type]
            found[words] = replace(predictor, points=None, bands=(band,), run_ups=(), shift=None)
    return found


def _run_up(predictor: Predictor, x: Array) -> dict[str, Predictor]:
    """Return a run-up from rest without a load at the drive, unless one was measured or the motor has none."""
    if predictor.run_ups:
        return {}
    try:
        own = settled_run_up(predictor.base.updated(predictor.changes(x)))
    except (ParameterError, SimulationError):
        return {}
    return {"a run-up from rest": replace(predictor, points=None, bands=(), run_ups=(own,), shift=None)}


def _information(candidate: Predictor, x: Array) -> Array:
    (here,) = candidate.at([x])
    values = np.nan_to_num(here.values)
    if candidate.points:
        errors = np.full(len(values), DEFAULT_ERROR * span(candidate.points.quantities[0], values))
    elif candidate.run_ups:
        errors = candidate.run_ups[0].errors
    else:
        half = len(values) // 2
        errors = SPECTRUM_ERROR * np.tile(np.hypot(values[:half], values[half:]), 2)
    slope = candidate.jacobian(x, here, central=True) / np.where(errors > 0.0, errors, np.inf)[:, None]
    return np.asarray(slope.T @ slope)


def _frequencies(predictor: Predictor) -> Array:
    """Return frequencies in Hz about each mode of the motor, free and pressed on the rotor."""
    motor = predictor.base.motor
    spread = np.linspace(-_BANDWIDTHS, _BANDWIDTHS, _EACH)
    every = [mode.frequency_hz * (1.0 + spread / mode.quality_factor) for mode in motor.modes]
    found = np.unique(
        np.concatenate([*every, *(np.linspace(1.0, 1.2, _EACH) * mode.frequency_hz for mode in motor.modes)])
    )
    return np.asarray(found[found > 0.0])


def advice(place: int, known: Array, further: Mapping[str, Array], enough: float) -> str:
    """Return the measurement that lowers the standard error of a coordinate most, as a sentence.

    Args:
        place: number of the coordinate.
        known: information of the data so far.
        further: that of each measurement that can be added.
        enough: standard error with which the value counts as decided.
    """
    errors = {words: float(np.sqrt(np.linalg.inv(known + more)[place, place])) for words, more in further.items()}
    best = min(errors, key=errors.__getitem__, default="")
    if not best or errors[best] > enough:
        return (
            "No further quantity at the measured points, no spectrum and no run-up decides it: measure torque and "
            "current over speed at other voltages, frequencies or preloads, or leave it out of free."
        )
    return f"To decide it, measure {best}: its standard error would be {100.0 * errors[best]:.2g} %."
