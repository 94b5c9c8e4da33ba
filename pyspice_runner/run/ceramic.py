# SPDX-License-Identifier: GPL-3.0-or-later
"""Load on ceramic and contact from the vectors of a run, and exceeded limits of the motor."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any

import numpy as np

from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.source import GROUPS, Source
from pyspice_runner.circuit.state import Discretisation, motor_states
from pyspice_runner.motor.drive import too_fast
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.strength import exceeded, peak_of_motion, temperature_rise
from pyspice_runner.motor.wear import of_contact, slip_velocity
from pyspice_runner.run.window import Array, Window


def modal_vectors(motor: Motor) -> list[str]:
    """Return the vectors of velocity and elastic force of every mode."""
    return [state.within("xmotor") for state in motor_states(motor, None, ("mode",))]


def ceramic(
    motor: Motor,
    law: Law | None,
    discretisation: Discretisation,
    samples: Mapping[str, Array],
    source: Source,
    window: Window,
) -> dict[str, Any]:
    """Return the load on ceramic and contact over the last periods of a run, and ``cautions``; None if not known.

    They are strain, stress and temperature rise of the ceramic, pressure, tension and wear of the contact. The vectors
    of the run include those of :func:`modal_vectors`, and the voltages and currents of the pins; for the contact its
    forces, for the wear also the slider of the law ``spring-slider``.
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
        force = sum(theta * samples[f"v({group})"] for theta, group in zip(mode.couplings, GROUPS, strict=True))
        heat += window.mean((mode.damping_n_s_per_m * velocity - force) * velocity)
    found = {
        **peak_of_motion(motor, displacement),
        "temperature_rise_k": temperature_rise(motor, heat),
        **_of_contact(motor, law, discretisation, samples, window),
    }
    return stated(motor, found, samples["v(shaft)"])


def _of_contact(
    motor: Motor, law: Law | None, discretisation: Discretisation, samples: Mapping[str, Array], window: Window
) -> dict[str, float]:
    normal, slider, depth = (samples.get(f"v(xmotor.{node})") for node in ("normal", "slider", "xcontact.delta"))
    greatest = nan if normal is None else float(normal[window.points].max())
    rubbing = nan
    if law and "averaged" in law.forms and normal is not None and slider is not None and depth is not None:
        velocity = slip_velocity(motor.contact, 1e-6 * slider, 1e-6 * depth, normal, discretisation.slider_time)
        rubbing = window.mean(normal * velocity)
    return of_contact(motor.contact, greatest, rubbing)


def stated(motor: Motor, found: Mapping[str, float], speed_rad_s: Array) -> dict[str, Any]:
    """Return quantities JSON-ready, with ``cautions``, also of the course of the speed."""
    known = {name: value if np.isfinite(value) else None for name, value in found.items()}
    limits = exceeded(motor, found)
    fastest = float(speed_rad_s[np.abs(speed_rad_s).argmax()])
    return {**known, "cautions": [*limits, *too_fast(motor.to_dict(), fastest)]}
