# SPDX-License-Identifier: GPL-3.0-or-later
"""What changes during a run of the averaged motor or of a controlled one: courses over time, checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from pyspice_runner.averaged.library import SETTINGS, SPECIAL, Schedule
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.run.point import Point

MOST_POINTS_OF_A_SCHEDULE = 10_000
VALUES_OF_A_FUNCTION = 1000  # over the duration of a run
ScheduleLike = ArrayLike | Callable[[float], float]


def settings_of(
    point: Point, stage: TwoPhaseDrive, courses: Mapping[str, ScheduleLike], duration: float
) -> dict[str, Schedule]:
    """Return the courses of all settings, constant unless the user gives one, over a duration in s.

    ``stage`` is the drive at the start. Preload and temperature are in it only if the user gives them. Raise
    ParameterError for an invalid course.
    """
    given = dict(courses)
    if "voltage" in given:
        if {"voltage_a", "voltage_b"} & given.keys():
            raise ParameterError("courses: voltage and voltage_a or voltage_b exclude each other. Give one or the two.")
        given["voltage_a"] = given["voltage_b"] = given.pop("voltage")
    constant = (stage.frequency, stage.voltage, stage.voltage_b, stage.phase_deg, point.load.torque)
    settings: dict[str, Schedule] = {name: [(0.0, value)] for name, value in zip(SETTINGS, constant, strict=True)}
    if stage.soft_start > 0.0:
        settings["voltage_a"] = [(0.0, 0.0), (stage.soft_start, stage.voltage)]
        settings["voltage_b"] = [(0.0, 0.0), (stage.soft_start, stage.voltage_b)]
    for name, rows in given.items():
        if name == "reference":
            raise ParameterError("courses: reference has an effect on a controller only. Leave it out.")
        settings[name] = schedule_of(name, rows, duration)
    ambient = point.thermal.ambient_k if point.thermal else 0.0
    for name, value in (("preload", point.motor.contact.preload_n), ("temperature", ambient)):
        if name in given and settings[name][0][1] != value:
            raise ParameterError(
                f"courses: {name} begins at {settings[name][0][1]:g} {SPECIAL[name]}: it must begin at that of the "
                f"motor, {value:g} {SPECIAL[name]}."
            )
    if "temperature" in given and point.thermal is None:
        raise ParameterError("courses: temperature takes thermal, which has the coefficients of the drift. Give it.")
    if point.load.speed is not None and "load_torque" in given:
        raise ParameterError("courses: load_torque has no effect on a shaft that is held at a speed. Leave one out.")
    return settings


def schedule_of(name: str, rows: ScheduleLike, duration: float) -> Schedule:
    """Return the course of a quantity over a duration in s, of which a function gives a thousand values.

    Raise ParameterError for an unknown name, or rows that are not valid.
    """
    known = SETTINGS | SPECIAL | {"reference": "the controller's unit"}
    if name not in known:
        raise ParameterError(f"courses: {name!r} is not known: it must be voltage or one of {', '.join(known)}.")
    try:
        if callable(rows):
            times = np.linspace(0.0, duration, VALUES_OF_A_FUNCTION + 1)
            table = np.array([[time, float(rows(float(time)))] for time in times])
        else:
            table = np.asarray(rows, dtype=float)
            table = np.array([[0.0, float(table)]]) if table.ndim == 0 else table
    except (TypeError, ValueError):
        table = np.empty(0)
    if table.ndim != 2 or table.shape[1] != 2 or not 1 <= len(table) <= MOST_POINTS_OF_A_SCHEDULE:
        raise ParameterError(
            f"courses: {name} must be 1 to {MOST_POINTS_OF_A_SCHEDULE} rows of time (s) and value ({known[name]}), a "
            "number, or a function of the time."
        )
    if not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0.0).any() or table[0, 0] < 0.0:
        raise ParameterError(f"courses: {name} must have finite values and rising times from 0 s on.")
    if name in ("frequency", "preload") and (table[:, 1] <= 0.0).any():
        unit = known[name]
        raise ParameterError(f"courses: {name} = {table[:, 1].min():g} {unit} is out of range: it must be > 0 {unit}.")
    return [(float(time), float(value)) for time, value in table]
