# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured operating points: a table with a row for each point, checked.

Columns have the conditions of a point: ``voltage``, ``frequency``, ``phase_deg`` and further values of the drive, any
path with a dot (``contact.preload_n``), ``temperature`` in °C of the stator (:mod:`.spectra`), and the load:
``load_torque_n_m``, or ``speed_rad_s`` of a shaft that is held. The other columns are measured: quantities of
:func:`~pyspice_runner.speed_torque`, ``power_w`` of both groups, the phase ``current_a_phase_deg`` of a group's current
ahead of its voltage at the drive frequency, the ``resonance_hz`` (:class:`~.prediction.Peak`), and the ``speed_rad_s``
of a row with a ``load_torque_n_m``. ``…_error`` is the standard error of a measured column. A cell without a value is
not measured, or keeps the condition of the drive. A heading such as ``Speed (mm/s)`` or ``Torque [mN·m]`` has its unit.
"""

from __future__ import annotations

import csv
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees, pi, remainder, sqrt
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pyspice_runner.errors import ParameterError, did_you_mean
from pyspice_runner.motor import groups
from pyspice_runner.motor.document import read_document
from pyspice_runner.motor.drive import TwoPhaseDrive, TwoToneDrive
from pyspice_runner.motor.refusal import as_number, quoted
from pyspice_runner.run.dynamometer import UNITS
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array

MOST_POINTS = 2000
ERROR = "_error"
SPEED, LOAD, POWER, CURRENT = "speed_rad_s", "load_torque_n_m", "power_w", "current_rms_a"
LINEAR = {"speed_m_s": SPEED, "load_force_n": LOAD, "force_n": "torque_n_m"}  # of a slider → of its rotor of 1 m
TEMPERATURE = "temperature"  # °C of the stator: a condition that is no path of the motor
PHASES = ("current_a_phase_deg", "current_b_phase_deg")
_OF_PHASES = (
    "phase_deg is that of the drive, group B ahead of A. current_a_phase_deg and current_b_phase_deg are measured: the "
    "current ahead of the voltage of its group, the negative of the phase of an impedance."
)
RESONANCE = "resonance_hz"
MEASURED = (SPEED, POWER, *(name for name in UNITS if name != LOAD), *PHASES, RESONANCE)
_OF_DRIVE = (*dict.fromkeys([*TwoPhaseDrive.model_fields, *TwoToneDrive.model_fields]),)
# A class of instruments: a torque cell, a current probe. Measured points without errors get this one, of the maximum
# value of their column; then only ratios of the errors count, because the scatter about the fit sets their size.
DEFAULT_ERROR = 0.02
_RESONANCE_SPAN = 0.05
_FAR = 2.0  # of the motor's modes: farther, a resonance has another unit
_FAR_BEYOND = 20.0  # times the torque of friction at the preload; a factor of 1000 between units exceeds it

_HEADING = re.compile(r"\s*([A-Za-z][A-Za-z .]*?)\s*(?:\[([^\]]+)\]|\(([^)]+)\)|/\s*(\S.*?))\s*")
_G = 9.80665  # m/s², standard gravity: weights are given in grams
_LINEAR = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "um/s": 1e-6}
_PER_MINUTE, _DEGREES = pi / 30.0, pi / 180.0
_ROTARY = {
    "rad/s": 1.0, "rpm": _PER_MINUTE, "1/min": _PER_MINUTE, "r/min": _PER_MINUTE, "deg/s": _DEGREES, "°/s": _DEGREES,
}  # fmt: skip
_FORCE = {"n": 1.0, "mn": 1e-3, "kgf": _G, "kg": _G, "gf": 1e-3 * _G, "g": 1e-3 * _G}
_TORQUE = {"nm": 1.0, "mnm": 1e-3, "unm": 1e-6, "ncm": 1e-2, "nmm": 1e-3, "kgfcm": 1e-2 * _G, "gfcm": 1e-5 * _G}
_FREQUENCY = {"hz": 1.0, "khz": 1e3}
_ANGLE = {"deg": 1.0, "°": 1.0, "rad": 180.0 / pi}
_KINDS: dict[str, tuple[tuple[str, dict[str, float]], ...]] = {  # of headings: words → columns, each with its units
    "speed": (("speed_m_s", _LINEAR), ("speed_rad_s", _ROTARY)),
    "force": (("force_n", _FORCE),),
    "torque": (("torque_n_m", _TORQUE),),
    "load": (("force_n", _FORCE), ("torque_n_m", _TORQUE)),
    "frequency": (("frequency", _FREQUENCY),),
    "voltage": (("voltage", {"v": 1.0, "vp": 1.0, "vpp": 0.5, "vrms": sqrt(2.0)}),),
    "power": (("power_w", {"w": 1.0, "mw": 1e-3}),),
    "resonance": (("resonance_hz", _FREQUENCY),),
    "temperature": (("temperature", {"°c": 1.0, "c": 1.0, "degc": 1.0}),),
    "current phase": (("current_a_phase_deg", _ANGLE),),
    "current phase a": (("current_a_phase_deg", _ANGLE),),
    "current phase b": (("current_b_phase_deg", _ANGLE),),
}
_WORDS = {
    "velocity": "speed", "n": "speed", "v": "speed", "f": "force", "thrust": "force", "m": "torque", "t": "torque",
}  # fmt: skip
_PLAIN = str.maketrans("µμ", "uu", "·*⋅ .-")  # of units


@dataclass(frozen=True)
class Points:
    """Measured operating points."""

    source: str  # name of the file, or of the origin
    conditions: tuple[dict[str, float | None], ...]  # of each point: path → value
    rows: tuple[int, ...]  # place of each measured value: its point
    quantities: tuple[str, ...]  # and its quantity
    values: Array  # measured values, SI units
    errors: Array  # their standard errors
    errors_given: bool  # whether the errors are those of the measurement; if not, only their ratios count
    logarithmic: bool = False  # whether values and predictions are logarithms, and errors relative
    signs: Array | float = 1.0  # of the values whose logarithms these are

    def __len__(self) -> int:
        return len(self.conditions)

    def check(self, setups: Sequence[Point]) -> None:
        """Raise ParameterError for a phase without a voltage or a resonance far from the modes, of points as set up."""
        for row, quantity, value in zip(self.rows, self.quantities, self.values.tolist(), strict=True):
            where, drive = f"{self.source}: {quantity} of point {row + 1}", setups[row].drive
            if quantity in PHASES:
                group = quantity[len("current_")]
                tones = [tone for tone in groups.of(getattr(drive, "tones", ((), ())), group) if tone.amplitude]
                if len({tone.frequency for tone in tones}) != 1:
                    raise ParameterError(
                        f"{where} takes a voltage of group {group.upper()} at one frequency. Its drive is "
                        f"{getattr(drive, 'label', type(drive).__name__)}. Leave the phase out."
                    )
            motor = setups[row].motor
            most = motor.contact.friction * motor.contact.preload_n * motor.rotor.radius_m
            if quantity == "torque_n_m" and abs(value) > _FAR_BEYOND * most:
                named, unit = ("force_n", "N") if motor.slider else (quantity, "N·m")
                raise ParameterError(
                    f"{self.source}: {named} of point {row + 1} is {value:g} {unit}; friction at the preload holds "
                    f"{most:.3g} {unit}, and at most {_FAR_BEYOND:g} times this is allowed. Give it in {unit}, or "
                    f"name the unit in the heading: {'Force (mN)' if motor.slider else 'Torque (mN.m)'}."
                )
            if quantity == RESONANCE:
                if not isinstance(drive, TwoPhaseDrive):
                    raise ParameterError(f"{where} takes a drive with one frequency. Leave the resonance out.")
                every = [mode.frequency_hz for mode in setups[row].motor.modes]
                low, high = min(every) / _FAR, _FAR * max(every)
                if not low <= value <= high:
                    raise ParameterError(
                        f"{where} is {value:g} Hz; the modes of the motor allow {low:.4g} to {high:.4g} Hz. Give it in "
                        "Hz, or specify the unit in the heading: Resonance (kHz)."
                    )


@dataclass(frozen=True)
class Curve(ABC):
    """Measured data beside the points: a spectrum, a run-up."""

    along: ClassVar[str]  # name of the axis
    quantities: ClassVar[tuple[str, ...]]  # names of what was measured
    smooth: ClassVar[bool] = True  # whether the prediction varies smoothly with the parameters

    file: str  # name of the file
    conditions: dict[str, float | None]  # path → value
    at: Array  # values of the axis
    measured: Array  # those of each quantity, one after another
    errors: Array  # standard errors

    @property
    def source(self) -> str:
        """Name of the data."""
        return self.file

    def errors_at(self, predicted: Array) -> Array:  # noqa: ARG002 # spectra follow it
        """Return the standard errors of the measured values, by predicted ones as far as these are known."""
        return self.errors

    @abstractmethod
    def predicted(self, point: Point, *, fine: bool) -> Array:
        """Return the values of a motor at the conditions, by ngspice with ``fine``. NaN, or an error, if unknown."""


def read_points(
    data: str | Path | Mapping[str, Any] | Any, motor_is_linear: bool = False, *, measured: bool = True
) -> Points:
    """Read operating points from a CSV file, a dictionary of columns, or a pandas table.

    Without ``measured`` the values only name the quantities, and need no errors.

    Raises:
        ParameterError: for an unreadable file, an unknown column, a value that is not a number, or an error that is not
            above zero.
    """
    source, columns = read_columns(data, motor_is_linear)
    rows_of_table = zip(*columns.values(), strict=True)
    conditions = tuple(conditions_of_row(dict(zip(columns, row, strict=True))) for row in rows_of_table)
    found: list[tuple[int, str, float, float]] = []
    errors_given = True
    for name in filter(columns.__contains__, MEASURED):
        rows = [row for row, value in enumerate(columns[name]) if not np.isnan(value)]
        rows = [row for row in rows if name != SPEED or conditions[row]["load.speed"] is None]
        own = columns.get(f"{name}{ERROR}")
        errors_given = errors_given and (own is not None or not rows)
        size = span(name, [columns[name][row] for row in rows]) or float(not measured)
        for row in rows:
            error = own[row] if own is not None else DEFAULT_ERROR * size
            if not error > 0.0:
                raise ParameterError(
                    f"{source}: {name}{ERROR} of point {row + 1} is {quoted(error)}; it must be a number > 0."
                    if own is not None
                    else f"{source}: {name} is 0 at every point, so its error is not known. Give {name}{ERROR}."
                )
            found.append((row, name, columns[name][row], error))
    if not found:
        raise ParameterError(
            f"{source} has no measured value. Give a column of {', '.join(MEASURED[:6])}, or another quantity of "
            "speed_torque; speed_rad_s is measured where load_torque_n_m is given."
        )
    places, quantities, values, errors = zip(*found, strict=True)
    return Points(source, conditions, places, quantities, np.array(values), np.array(errors), errors_given)


def read_columns(
    data: str | Path | Mapping[str, Any] | Any, linear: bool, *, name: str = "the points",
    further: Sequence[str] = (), most: int = MOST_POINTS,
) -> tuple[str, dict[str, list[float]]]:  # fmt: skip
    """Return the name of a table and its columns in SI units under the names of a rotor, NaN for an empty cell.

    The columns may be those of a slider with ``linear``, and ``further`` ones beside those of points, with ``most``
    rows; ``name`` names a table that is not a file. Raise ParameterError as :func:`read_points`.
    """
    if isinstance(data, str | Path):
        source, columns = Path(data).name, _columns(Path(data))
    else:
        source = name
        table = data if isinstance(data, Mapping) else getattr(data, "to_dict", lambda _: None)("list")
        if not isinstance(table, Mapping):
            raise ParameterError(
                f"data = {quoted(data)} is not a table of points: give the path of a CSV file, a dictionary of columns "
                "or a pandas table."
            )
        columns = {str(key): list(np.atleast_1d(np.asarray(values, dtype=object))) for key, values in table.items()}
    lengths = {len(values) for values in columns.values()}
    if len(lengths) != 1 or not 1 <= max(lengths, default=0) <= most:
        raise ParameterError(
            f"{source} has columns of {' and '.join(map(str, sorted(lengths))) or 'no'} points: they must have the "
            f"same number, from 1 to {most}."
        )
    numbers = {key: [_number(value, key, row, source) for row, value in enumerate(values, start=1)]
               for key, values in columns.items()}  # fmt: skip
    return source, _named(numbers, source, further, linear=linear)


def _column_of(heading: str) -> tuple[str, float] | None:
    """Return the column that a heading with a unit means, and the factor to its unit; ``None`` for another heading.

    A voltage is an amplitude; one in ``Vrms`` is that of a sine.
    """
    found = _HEADING.fullmatch(heading)
    if found is None:
        return None
    words = found[1].lower().split()
    unit = (found[2] or found[3] or found[4]).lower().translate(_PLAIN)
    named = (" ".join(words), words[-1], words[0])
    for word in ("resonance",) if any(word.startswith("resonan") for word in words) else named:
        for column, units in _KINDS.get(_WORDS.get(word, word), ()):
            if unit in units:
                return column, units[unit]
    return None


def _columns(path: Path) -> dict[str, list[str]]:
    """Return the columns of a CSV file with commas, semicolons or tabs. A line that starts with # is left out."""
    text = read_document(path, "the path of a CSV file with one point in each line")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise ParameterError(f"{path.name} has no points: it needs a line of column names and a line for each point.")
    mark = max(",;\t", key=lines[0].count)
    header, *rows = list(csv.reader(lines, delimiter=mark))
    names = [name.strip() for name in header]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(f"{path.name} has the column {quoted(name)} twice. Give it once.")
    for number, row in enumerate(rows, start=1):
        if len(row) != len(names):
            raise ParameterError(
                f"{path.name}: point {number} has {len(row)} values for {len(names)} columns. Correct that line."
            )
    return {name: [row[place].strip() for row in rows] for place, name in enumerate(names)}


def _number(value: Any, name: str, row: int, source: str) -> float:
    """Return the value of a cell, NaN for one without a value."""
    if value is None or value == "":
        return float("nan")
    try:
        number = float(value) if isinstance(value, str) else as_number(value)
    except ValueError:
        number = None
    if number is None or np.isinf(number) or (isinstance(value, str) and np.isnan(number)):
        raise ParameterError(f"{source}: {name} of point {row} is {quoted(value)}; it must be a number, or empty.")
    return number


def _named(
    columns: Mapping[str, list[float]], source: str, further: Sequence[str], *, linear: bool
) -> dict[str, list[float]]:
    """Return the columns in SI units under the names of a rotor. Raise ParameterError for an unknown name."""
    known = [*further, *_OF_DRIVE, TEMPERATURE, LOAD, *MEASURED]
    found: dict[str, list[float]] = {}
    for heading, values in columns.items():
        name, factor = _column_of(heading) or (heading, 1.0)
        base = name.removesuffix(ERROR)
        own = LINEAR.get(base, base) if linear else base
        if own not in (MEASURED if base != name else known) and not ("." in own and base == name):
            hint = _OF_PHASES if "phase" in name.lower() else did_you_mean(name, [*known, *(LINEAR if linear else ())])
            raise ParameterError(f"{source}: there is no column {quoted(name)}. {hint}")
        own = own + name[len(base) :]
        if own in found:
            raise ParameterError(f"{source}: {quoted(heading)} is a second column of {name}. Leave one out.")
        found[own] = [factor * value for value in values]
    return found


def conditions_of_row(row: Mapping[str, float]) -> dict[str, float | None]:
    """Return the conditions of a point: path → value. A shaft without a load is held at its speed if there is one."""
    paths = {name: f"drive.{name}" if name in _OF_DRIVE else name
             for name in row if "." in name or name in (*_OF_DRIVE, TEMPERATURE)}  # fmt: skip
    there: dict[str, float | None] = {path: row[name] for name, path in paths.items() if not np.isnan(row[name])}
    speed, load = row.get(SPEED, float("nan")), row.get(LOAD, float("nan"))
    held = np.isnan(load) and not np.isnan(speed)
    return {**there, "load.torque": 0.0 if np.isnan(load) else load, "load.speed": speed if held else None}


def span(quantity: str, values: Sequence[float] | Array) -> float:
    """Return the size of which :data:`DEFAULT_ERROR` is the error of a class of instruments: the maximum.

    An error of a phasor turns it by as many radians. A resonance is read to a tenth of the bandwidth of Q = 100.
    """
    if quantity in PHASES:
        return degrees(1.0)
    greatest = float(np.abs(values).max(initial=0.0))
    return _RESONANCE_SPAN * greatest if quantity == RESONANCE else greatest


def measured_of(values: Mapping[str, float], quantity: str, measured: float = 0.0) -> float:
    """Return a measured quantity of a steady state; a phase within 180° of the measured one."""
    if quantity == POWER:
        return values["power_a_w"] + values["power_b_w"]
    if quantity == CURRENT:  # of a data sheet that does not name the group
        return sqrt(0.5 * (values["current_a_rms_a"] ** 2 + values["current_b_rms_a"] ** 2))
    if quantity in PHASES:
        return measured + remainder(values[quantity] - measured, 360.0)
    return values[quantity]
