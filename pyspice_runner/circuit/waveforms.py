# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives of any shape for the full motor: voltages from arrays or a file.

The voltages are functions of time in behavioural sources, which set no breakpoints: the steps stay uniform.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.source import UniformSource
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import groups
from pyspice_runner.motor.document import read_document
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor

MOST_POINTS = 20_000  # ngspice searches them at every step
_MOST_BYTES = 2**25  # of a file: that many points with all signals of a run
COLUMNS = ("time_s", "voltage_a_v", "voltage_b_v")
_EVER = 1e9  # s
_ON_A_LINE = 6


@dataclass(frozen=True)
class Waveform(UniformSource):
    """Voltages at given times, with linear interpolation; the last values hold afterwards.

    Attributes:
        time_s: times in s, rising from 0.
        voltage_a_v: voltage of group A in V at them.
        voltage_b_v: that of group B.
        frequency: of the drive in Hz; means are over its periods, and it determines the time step.

    Raises:
        ParameterError: by the constructor, for arrays of different lengths, or a value out of range.
    """

    time_s: ArrayLike
    voltage_a_v: ArrayLike
    voltage_b_v: ArrayLike
    frequency: float

    def __post_init__(self) -> None:
        arrays = [_numbers(name, getattr(self, name)) for name in COLUMNS]
        for name, values in zip(COLUMNS, arrays, strict=True):
            object.__setattr__(self, name, values)
        time = arrays[0]
        if len({len(values) for values in arrays}) > 1:
            lengths = ", ".join(f"{name} {len(values)}" for name, values in zip(COLUMNS, arrays, strict=True))
            raise ParameterError(f"A waveform's columns must have one length, and have {lengths}.")
        if not 2 <= len(time) <= MOST_POINTS:
            raise ParameterError(f"A waveform has {len(time)} points: it must have 2 to {MOST_POINTS}. Thin it out.")
        if time[0] != 0.0 or (np.diff(time) <= 0.0).any():
            at = 0 if time[0] else int(np.argmax(np.diff(time) <= 0.0)) + 1
            raise ParameterError(f"time_s[{at}] = {time[at]:g} s: the times of a waveform must rise from 0 s.")
        _ = self.drive  # it checks frequency and largest voltage

    @property
    def drive(self) -> TwoPhaseDrive:  # type: ignore[override]
        """A drive of the same frequency and largest voltage, for the checks."""
        greatest = float(max(np.abs(self.voltage_a_v).max(), np.abs(self.voltage_b_v).max()))
        return TwoPhaseDrive(voltage=greatest, frequency=self.frequency)

    @property
    def label(self) -> str:
        """Number of points and end time."""
        return f"waveform of {len(np.asarray(self.time_s))} points to {1e3 * np.asarray(self.time_s)[-1]:g} ms"

    def add(self, circuit: Circuit, motor: Motor, pins: tuple[str, str], *, begun: float) -> None:  # noqa: ARG002
        """Add the two sources ``Va`` and ``Vb`` as ``pwl`` of the time, over many lines."""
        for group, pin, values in zip("ab", pins, (self.voltage_a_v, self.voltage_b_v), strict=True):
            times, volts = np.append(np.asarray(self.time_s), _EVER), np.append(values, np.asarray(values)[-1])
            pairs = [f"{at!r},{volt!r}" for at, volt in zip(times.tolist(), volts.tolist(), strict=True)]
            lines = [",".join(pairs[place : place + _ON_A_LINE]) for place in range(0, len(pairs), _ON_A_LINE)]
            voltage = "pwl(time,\n+ " + ",\n+ ".join(lines) + ")"
            source = groups.named("drive", group)
            circuit.raw_spice += f"B{source} {source} 0 V={voltage}\n"
            circuit.V(group, pin, source, "DC 0")

    def initial_voltages(self) -> tuple[float, float]:
        """Return U_A and U_B at t = 0."""
        return float(np.asarray(self.voltage_a_v)[0]), float(np.asarray(self.voltage_b_v)[0])

    def to_dict(self) -> dict[str, Any]:
        """Return kind, number of points and frequency, JSON-ready."""
        points = len(np.asarray(self.time_s))
        return {"kind": type(self).__name__, "label": self.label, "points": points, "frequency": self.frequency}


def read_waveform(path: str | Path, frequency: float) -> Waveform:
    """Return a waveform from a CSV file with the columns time_s, voltage_a_v and voltage_b_v; others are ignored.

    The file of ``simulate --output`` is one. ``frequency`` is that of :class:`Waveform`.

    Raises:
        ParameterError: for a file that cannot be read, lacks a column, or has a cell that is not a number.
    """
    text = read_document(Path(path), "a .csv file", _MOST_BYTES).removeprefix("\ufeff")
    try:
        rows = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise ParameterError(f"{path} cannot be read as a waveform: {error}.") from None
    header = [name.strip() for name in rows[0]] if rows else []
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise ParameterError(f"{path} has no column {missing[0]}: its first line must name {', '.join(COLUMNS)}.")
    places = [header.index(name) for name in COLUMNS]
    found = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            found += [[float(row[place]) for place in places]] if any(row) else []
        except (ValueError, IndexError):
            raise ParameterError(
                f"{path}, line {number}: {','.join(row)[:60]!r} must have a number for each column."
            ) from None
    try:
        time, voltage_a, voltage_b = np.array(found, dtype=float).reshape(-1, len(COLUMNS)).T
        return Waveform(time, voltage_a, voltage_b, frequency)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None


def _numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        found = np.empty((0, 0))
    if found.ndim != 1:
        raise ParameterError(f"{name} of a waveform must be a list of numbers.")
    if not np.isfinite(found).all():
        raise ParameterError(f"{name}[{int(np.argmin(np.isfinite(found)))}] of a waveform is not a finite number.")
    return found
