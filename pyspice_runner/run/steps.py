# SPDX-License-Identifier: GPL-3.0-or-later
"""The rule for time steps: a number of points per period of the fastest motion."""

from __future__ import annotations

from math import isfinite

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.motor import Motor
from pyspice_runner.netlist.contact import Law
from pyspice_runner.netlist.source import Source

MOST_POINTS = 20_000_000  # recorded points: 4 GB of vectors, 160 MB per signal


def shortest_period(motor: Motor, source: Source, law: Law | None) -> float:
    """Return the period in s of the fastest motion: drive tones and modes, free and under preload."""
    frequencies = [*source.frequencies, *(mode.frequency_hz for mode in motor.modes)]
    if law:
        frequencies += contact_law.linearised_resonances(motor.contact, motor.modes, motor.rotor, motor.mount).tolist()
    return 1.0 / max(frequencies)


def time_step(motor: Motor, source: Source, law: Law | None, step: float | None = None) -> float:
    """Return the time step in s of a run: the given step, or the default.

    Raises:
        ParameterError: for a step that is not positive or too coarse.
    """
    shortest = shortest_period(motor, source, law)
    if step is None:
        return shortest / source.points_per_period
    coarsest = shortest / source.fewest_points
    if not (isfinite(step) and step > 0.0):
        raise ParameterError(f"step = {step:g} s is not valid: it must be a number > 0 s.")
    if step > coarsest:
        raise ParameterError(
            f"step = {step:g} s is too coarse for a motion of {1.0 / shortest:.4g} Hz; it must be <= {coarsest:.3g} s."
        )
    return step
