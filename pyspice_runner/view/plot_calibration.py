# SPDX-License-Identifier: GPL-3.0-or-later
"""The panels of a calibration: values with intervals, residuals of each set of data, curves, spectra, run-ups."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from pyspice_runner.calibration.result import Calibration
from pyspice_runner.calibration.run_up import RunUp
from pyspice_runner.calibration.spectra import Band
from pyspice_runner.view.draw import AXIS, Panel, Sheet, dress
from pyspice_runner.view.style import BLUE, CYCLE, LABELS, VERMILION, Label, label_of, time_label

_MARKS = "osv^Dx+*"


def calibration(result: Calibration) -> Sheet:
    """Return the values over those at the start, residuals and curves of the points, each spectrum and run-up."""
    panels: dict[str, Panel] = {"values": partial(_values, result)}
    residuals = (result.predicted - result.measured) / result.errors
    if result.points is not None:
        numbers = result.columns()["point"]
        of_points = {}
        for quantity in dict.fromkeys(result.points.quantities):
            places = [place for place, name in enumerate(result.points.quantities) if name == quantity]
            of_points[quantity] = numbers[places], residuals[places]
        panels["residuals"] = partial(residuals_over, "number of the point", of_points, "points")
        if _curves(result):
            panels["curves"] = partial(_torques, result)
    bands = [(one, own) for one, own in result.curves if isinstance(one, Band)]
    for number, (band, own) in enumerate(bands, start=1):
        panels[f"spectrum {number}"] = partial(_spectrum, band, result.predicted[own])
        frequency = LABELS["frequency_hz"]
        halves = zip(("real part", "imaginary part"), np.split(residuals[own], 2), strict=True)
        parts = {name: (frequency.scale * band.at, half) for name, half in halves}
        panels[f"residuals {number}"] = partial(residuals_over, frequency, parts, band.state)
    run_ups = [(one, own) for one, own in result.curves if isinstance(one, RunUp)]
    for number, (run_up, own) in enumerate(run_ups, start=1):
        panels[f"run-up {number}"] = partial(_run_up, run_up, result.predicted[own], result.start.slider is not None)
        time = time_label(float(run_up.at[-1]))
        parts = {"speed": (time.scale * run_up.at, residuals[own])}
        panels[f"residuals of run-up {number}"] = partial(residuals_over, time, parts, run_up.source)
    return Sheet(panels, 2, (5.6, 3.8), f"{result.start.name}, calibrated with {result.sources}")


def _values(result: Calibration, ax: Axes) -> None:
    """Draw each value with its 95 % interval over the value at the start; hollow: not identified by the data."""
    for place, one in enumerate(reversed(result.estimates)):
        low, high, value = (number / one.start if one.start else number for number in (*one.interval_95, one.value))
        colour = BLUE if one.identifiable else VERMILION
        ax.plot([low, high], [place, place], "-", color=colour, linewidth=2.0)
        ax.plot(value, place, "o", color=colour, mfc=colour if one.identifiable else "white")
    ax.axvline(1.0, **AXIS)
    ax.set_yticks(range(len(result.estimates)), [one.path for one in reversed(result.estimates)], fontsize=7)
    if all(one.start and min(one.interval_95) / one.start > 0.0 for one in result.estimates):
        ax.set_xscale("log")
        for set_formatter in (ax.xaxis.set_major_formatter, ax.xaxis.set_minor_formatter):
            set_formatter("{x:g}")
    dress(ax, "value / value at the start", "", "Values with 95 % intervals (ring: not identified by the data)")


def _curves(result: Calibration) -> dict[tuple[tuple[str, float | None], ...], list[int]]:
    """Return the measured torques at held speeds, by rising speed: conditions of a curve → places of its values."""
    points, found = result.points, dict[tuple[tuple[str, float | None], ...], list[int]]()
    assert points is not None
    for place, (row, quantity) in enumerate(zip(points.rows, points.quantities, strict=True)):
        there = points.conditions[row]
        if quantity == "torque_n_m" and there["load.speed"] is not None and np.isfinite(result.predicted[place]):
            others = tuple((path, value) for path, value in there.items() if not path.startswith("load."))
            found.setdefault(others, []).append(place)
    kept = {others: places for others, places in found.items() if len(places) > 2}
    return {
        others: sorted(places, key=lambda place: points.conditions[points.rows[place]]["load.speed"] or 0.0)
        for others, places in kept.items()
    }


def _torques(result: Calibration, ax: Axes) -> None:
    """Draw measured and fitted torque over speed, with the 95 % band by the errors of the parameters."""
    points = result.points
    assert points is not None
    torque, along = (label_of(name, result.start.slider is not None) for name in ("torque_n_m", "speed_rad_s"))
    for number, (others, places) in enumerate(_curves(result).items()):
        colour = CYCLE[number % len(CYCLE)]
        speed = along.scale * np.array([points.conditions[points.rows[place]]["load.speed"] for place in places], float)
        fitted, half = torque.scale * result.predicted[places], torque.scale * 1.96 * result.predicted_errors[places]
        name = ", ".join(f"{path.removeprefix('drive.')} {value:g}" for path, value in others if value is not None)
        ax.fill_between(speed, fitted - half, fitted + half, color=colour, alpha=0.3, lw=0.0)
        ax.plot(speed, fitted, "-", color=colour, label=name or "calibrated")
        measured, errors = torque.scale * points.values[places], torque.scale * points.errors[places]
        ax.errorbar(speed, measured, errors, fmt=".", color=colour, ms=4, lw=0.8)
    dress(ax, along, torque, "Curves: measured, calibrated with 95 % band")


def _run_up(run_up: RunUp, predicted: np.ndarray, linear: bool, ax: Axes) -> None:
    """Draw the speed over time as measured, with its errors, and as predicted."""
    time, speed = time_label(float(run_up.at[-1])), label_of("rotor_speed_rad_s", linear)
    at = time.scale * run_up.at
    ax.errorbar(at, speed.scale * run_up.measured, speed.scale * run_up.errors, fmt=".", color=BLUE, ms=3, lw=0.6,
                label="measured")  # fmt: skip
    ax.plot(at, speed.scale * predicted, "-", color=VERMILION, label="calibrated", zorder=3)
    dress(ax, time, speed, run_up.source)


def _spectrum(band: Band, predicted: np.ndarray, ax: Axes) -> None:
    """Draw |Y| as measured and as predicted."""
    half = len(band.measured) // 2
    frequency, magnitude = LABELS["frequency_hz"], LABELS["magnitude_s"]
    at = frequency.scale * band.at
    ax.semilogy(at, magnitude.scale * np.hypot(band.measured[:half], band.measured[half:]), ".", color=BLUE, ms=3,
                label="measured")  # fmt: skip
    ax.semilogy(at, magnitude.scale * np.hypot(predicted[:half], predicted[half:]), "-", color=VERMILION,
                label="calibrated")  # fmt: skip
    dress(ax, frequency, magnitude, f"{band.spectrum.source or 'spectrum'}, {band.state}, {band.connection}")


def residuals_over(along: Label | str, parts: Mapping[str, tuple[np.ndarray, np.ndarray]], data: str, ax: Axes) -> None:
    """Draw (predicted - measured)/error of each part over its places: noise, unless the model is wrong."""
    for number, (name, (at, residuals)) in enumerate(parts.items()):
        mark, colour = _MARKS[number % len(_MARKS)], CYCLE[number % len(CYCLE)]
        ax.plot(at, residuals, mark, color=colour, label=name, ms=3)
    ax.axhline(0.0, **AXIS)
    ax.axhspan(-2.0, 2.0, color="0.92", zorder=0)
    if isinstance(along, str):
        ax.locator_params(axis="x", integer=True)
    dress(ax, along, "(predicted - measured) / error", f"Residuals, {data}; grey: two errors")
