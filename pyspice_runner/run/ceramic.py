# SPDX-License-Identifier: GPL-3.0-or-later
"""Strain, stress and steady temperature of the ceramic from the vectors of a run, and exceeded limits of the motor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pyspice_runner.model.drive import too_fast
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.strength import exceeded, peak_of_motion, temperature_rise
from pyspice_runner.netlist.source import GROUPS, Source
from pyspice_runner.netlist.state import Discretisation, motor_states
from pyspice_runner.run.window import Array, Window


def modal_vectors(motor: Motor) -> list[str]:
    """Return the vectors of velocity and elastic force of every mode."""
    return [state.within("xmotor") for state in motor_states(motor, None, ("mode",))]


def ceramic(
    motor: Motor, discretisation: Discretisation, samples: Mapping[str, Array], source: Source, window: Window
) -> dict[str, Any]:
    """Return strain, stress and temperature rise over the last periods of a run, and ``cautions``; None if not known.

    The vectors of the run include those of :func:`modal_vectors`, and the voltages and currents of the pins.
    """
    states = motor_states(motor, None, ("mode",))
    courses = [samples[state.within("xmotor")] * state.scale(discretisation) for state in states]
    moved, velocities = courses[: len(motor.modes)], courses[len(motor.modes) :]
    displacement = np.array([course[window.points] for course in moved])
    heat = 0.0
    for group in GROUPS:
        name, sign = source.current(group)
        heat += window.mean(sign * samples[name] * samples[f"v({group})"])
    for mode, velocity in zip(motor.modes, velocities, strict=True):
        force = mode.coupling_a_n_per_v * samples["v(a)"] + mode.coupling_b_n_per_v * samples["v(b)"]
        heat += window.mean((mode.damping_n_s_per_m * velocity - force) * velocity)
    found = {**peak_of_motion(motor, displacement), "temperature_rise_k": temperature_rise(motor, heat)}
    return stated(motor, found, samples["v(shaft)"])


def stated(motor: Motor, found: Mapping[str, float], speed_rad_s: Array) -> dict[str, Any]:
    """Return strain, stress and temperature rise, JSON-ready, with ``cautions``, also of the course of the speed."""
    known = {name: value if np.isfinite(value) else None for name, value in found.items()}
    limits = exceeded(motor, found["ceramic_stress_pa"], found["temperature_rise_k"])
    fastest = float(speed_rad_s[np.abs(speed_rad_s).argmax()])
    return {**known, "cautions": [*limits, *too_fast(motor.to_dict(), fastest)]}
