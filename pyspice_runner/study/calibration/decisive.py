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

from pyspice_runner.run.waveforms import Array
from pyspice_runner.spectra.spectrum import Spectrum
from pyspice_runner.study.calibration.points import DEFAULT_ERROR, Points
from pyspice_runner.study.calibration.prediction import SPECTRUM_ERROR, Band, Predictor

QUANTITIES = {  # quantity → what to measure
    "torque_n_m": "the torque", "current_a_rms_a": "the current of group A",
    "current_b_rms_a": "the current of group B", "power_w": "the electrical power",
    "normal_force_n": "the normal force",
}  # fmt: skip
_SPECTRA = {"free": "a spectrum of the free stator", "preloaded": "a spectrum of the stator pressed on the rotor"}
_BANDWIDTHS, _EACH = 8.0, 33  # on each side of a mode, and frequencies about each mode
_RAISED = 1.2  # of a mode, where the contact may move its resonance to


def informations(predictor: Predictor, x: Array) -> dict[str, Array]:
    """Return the information of each measurement that was not made: what to measure → matrix over the coordinates."""
    candidates: dict[str, Predictor] = {}
    points = predictor.points
    if points is not None:
        for name, words in QUANTITIES.items():
            if name not in points.quantities:
                rows = tuple(range(len(points)))
                one = np.ones(len(rows))
                own = replace(points, rows=rows, quantities=(name,) * len(rows), values=one, errors=one)
                candidates[f"{words} at the same points"] = replace(
                    predictor, points=own, bands=(), run_ups=(), shift=None
                )
    for state, words in _SPECTRA.items():
        if state not in [band.state for band in predictor.bands]:
            frequency = _frequencies(predictor)
            flat = Spectrum.from_admittance(frequency, np.ones(len(frequency), complex))
            band = Band.of(flat, state, "A", SPECTRUM_ERROR)  # type: ignore[arg-type]
            candidates[words] = replace(predictor, points=None, bands=(band,), run_ups=(), shift=None)
    return {words: _information(candidate, x) for words, candidate in candidates.items()}


def _information(candidate: Predictor, x: Array) -> Array:
    (here,) = candidate.at([x])
    values = np.nan_to_num(here.values)
    if isinstance(candidate.points, Points):
        errors = np.full(len(values), DEFAULT_ERROR * np.abs(values).max(initial=0.0))
    else:
        half = len(values) // 2
        errors = SPECTRUM_ERROR * np.tile(np.hypot(values[:half], values[half:]), 2)
    slope = candidate.jacobian(x, here) / np.where(errors > 0.0, errors, np.inf)[:, None]
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
            "No further quantity at the measured points and no spectrum decides it: measure torque and current over "
            "speed at other voltages, frequencies or preloads, a run-up from rest, or leave it out of free."
        )
    return f"To decide it, measure {best}: its standard error would be {100.0 * errors[best]:.2g} %."
