# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of an oscilloscope: phasors of voltage and current by a harmonic fit, and the decay of a ring-down.

The CSV files of Tektronix, Keysight, Rigol, Siglent and LeCroy are tables below lines of settings, one or two of which
name the channels; Rigol writes the number of a point and, in the header, start and distance of the points in time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError, SpectrumError, did_you_mean, require
from pyspice_runner.impedance.readers.text import clean, load, number, read_table, separator, split
from pyspice_runner.motor import groups

Array = NDArray[np.float64]

HARMONICS = 7  # that are fitted, below half of the rate of points; a bridge has odd ones
_FEWEST_PERIODS, _FEWEST_POINTS = 2.0, 8.0  # of the recording, and in a period of the fundamental
_RINGS = 3.0  # periods that a ring-down must have
_SIGNIFICANT = 5.0  # standard errors of a decay


@dataclass(frozen=True)
class Recording:
    """Channels over time."""

    source: str
    time_s: Array
    channels: Mapping[str, Array]  # as recorded, V

    def channel(self, name: str) -> Array:
        """Return a channel. Raise ParameterError for an unknown name."""
        if name not in self.channels:
            raise ParameterError(f"{self.source} has no channel {name!r}. {did_you_mean(name, self.channels)}")
        return self.channels[name]

    def phasors(
        self, voltage: str, current: str, *, ampere_per_volt: float = 1.0, volt_per_volt: float = 1.0,
        frequency_hz: float | None = None,
    ) -> Phasors:  # fmt: skip
        """Fit fundamental and harmonics to a voltage and a current.

        Args:
            voltage: channel of the voltage.
            current: channel of the current.
            ampere_per_volt: sensitivity of the current probe; negative if it is reversed.
            volt_per_volt: ratio of the voltage probe, if the oscilloscope did not apply it.
            frequency_hz: of the fundamental; by default that which fits best.

        Raises:
            ParameterError: for an unknown channel or an invalid sensitivity.
            SpectrumError: if the recording has too few periods or points for a fit.
        """
        from scipy.optimize import minimize_scalar  # takes long to load

        for name, value in (("ampere_per_volt", ampere_per_volt), ("volt_per_volt", volt_per_volt)):
            require(np.isfinite(value) and value != 0.0, name, value, "a number other than 0")
        volts, amperes = volt_per_volt * self.channel(voltage), ampere_per_volt * self.channel(current)
        rough = _peak_frequency(self.time_s, volts) if frequency_hz is None else float(frequency_hz)
        length, step = self.time_s[-1] - self.time_s[0], float(np.median(np.diff(self.time_s)))
        if not rough * length >= _FEWEST_PERIODS:
            raise SpectrumError(f"{self.source} has {rough * length:.3g} periods of {rough:.6g} Hz; record at least 2.")
        if not rough * step * _FEWEST_POINTS <= 1.0:
            raise SpectrumError(
                f"{self.source} has {1.0 / (rough * step):.3g} points in a period of {rough:.6g} Hz; record at least 8."
            )
        orders = np.arange(1, min(HARMONICS, int(0.5 / (rough * step))) + 1)
        fundamental, reach = rough, 0.6 / length
        if frequency_hz is None:
            found = minimize_scalar(
                lambda f: _harmonics(self.time_s, volts, f, orders)[1], method="bounded",
                bounds=(max(rough - reach, 0.1 * rough), rough + reach), options={"xatol": 1e-8 * rough},
            )  # fmt: skip
            fundamental = float(found.x)
        fits = [_harmonics(self.time_s, values, fundamental, orders) for values in (volts, amperes)]
        return Phasors(fundamental, fits[0][0], fits[1][0], fits[0][1], fits[1][1])

    def ring_down(self, channel: str, *, after_s: float | None = None) -> RingDown:
        """Fit a decaying oscillation: the drive is off after a time in s, by default from the first point on.

        Raises:
            ParameterError: for an unknown channel.
            SpectrumError: if the recording is too short, or does not decay.
        """
        from scipy.optimize import least_squares  # takes long to load

        kept = self.time_s >= (self.time_s[0] if after_s is None else after_s)
        time, values = self.time_s[kept], self.channel(channel)[kept]
        if len(time) < 3 * _FEWEST_POINTS:
            raise SpectrumError(f"{self.source} has {len(time)} points of a ring-down; record at least 24.")
        time = time - time[0]
        rough = _peak_frequency(time, values)
        if rough * time[-1] < _RINGS:
            raise SpectrumError(f"{self.source} has less than {_RINGS:g} periods of a ring-down; record more.")

        def parts(x: Array) -> tuple[Array, Array]:
            wave = np.exp((2j * pi * x[0] * rough - x[1] / time[-1]) * time)
            columns = np.column_stack([wave.real, wave.imag, np.ones_like(time)])
            return columns, np.linalg.lstsq(columns, values, rcond=None)[0]

        def residual(x: Array) -> Array:
            columns, found = parts(x)
            return np.asarray(values - columns @ found)

        starts = [np.array([1.0, decay]) for decay in (0.3, 1.0, 3.0, 10.0)]
        every = [least_squares(residual, one, bounds=([0.5, -1.0], [2.0, 1e4]), x_scale=[1e-2, 1.0]) for one in starts]
        best = min(every, key=lambda one: float(one.cost))
        frequency, decay = best.x[0] * rough, best.x[1] / time[-1]
        scatter = 2.0 * best.cost / (len(time) - 5)
        spread = np.sqrt(np.diag(np.linalg.pinv(best.jac.T @ best.jac)) * scatter)
        if decay <= _SIGNIFICANT * spread[1] / time[-1]:
            raise SpectrumError(f"{self.source}: channel {channel} does not decay. Check after_s, or record longer.")
        quality = pi * frequency / decay
        error = quality * float(np.hypot(spread[1] / best.x[1], spread[0] / best.x[0]))
        return RingDown(frequency, quality, float(rough * spread[0]), error)


@dataclass(frozen=True)
class Phasors:
    """Complex amplitudes of voltage and current: cosines, at the fundamental and its multiples."""

    frequency_hz: float
    voltage_v: NDArray[np.complex128]  # by order, the fundamental first
    current_a: NDArray[np.complex128]
    voltage_noise_v: float  # RMS of what the fit leaves
    current_noise_a: float

    @property
    def power_w(self) -> float:
        """Real power of all harmonics."""
        return 0.5 * float(np.vdot(self.voltage_v, self.current_a).real)

    @property
    def admittance_s(self) -> complex:
        """Admittance at the fundamental."""
        return complex(self.current_a[0] / self.voltage_v[0])

    def point(self, group: str = "a") -> dict[str, float]:
        """Return a row of measured points for :func:`~pyspice_runner.calibrate`, without load and errors."""
        return {
            "voltage": abs(complex(self.voltage_v[0])), "frequency": self.frequency_hz,
            groups.column("current", group, "rms_a"): float(np.linalg.norm(self.current_a)) / sqrt(2.0),
            groups.column("current", group, "phase_deg"): float(np.angle(self.current_a / self.voltage_v, deg=True)[0]),
            groups.column("power", group, "w"): self.power_w,
        }  # fmt: skip


@dataclass(frozen=True)
class RingDown:
    """A decaying oscillation; both values have a standard error by the noise."""

    frequency_hz: float  # of the free, damped oscillation
    quality_factor: float
    frequency_error_hz: float
    quality_error: float


def read_recording(path: str | Path) -> Recording:
    """Read the CSV file of an oscilloscope.

    Raises:
        SpectrumError: for a file that is not a table of channels over time.
    """
    text = load(path)
    first = text.find(_is_row)
    if first is None:
        raise SpectrumError(f"{text.name} has no rows of numbers; expected the CSV file of an oscilloscope.")
    mark = separator(text.lines[first])
    width = len(_cells(text.lines[first], mark))
    header = [line for line in text.lines[:first] if len(split(line, separator(line))) >= 2][-2:]
    rows = [split(line, separator(line)) for line in header]
    of_time = ("time", "x", "source", "t_", "t (")  # starts of the name of the first column
    named = next((row for row in rows if row[0].strip().lower().startswith(of_time)), rows[-1] if rows else [])
    names = [clean(name, 40) for name in named[:width]]
    if len(names) < width or not all(names):
        names = ["time", *(f"CH{number}" for number in range(1, width))]
    table = read_table(text, None, first, None, mark, names)
    time, *channels = table.numbers(list(range(width)))
    step = _rigol_step(rows)
    if step is not None:
        time = step[0] + step[1] * time
    if len(channels) < 1:
        raise SpectrumError(f"{text.name} has one column; expected time and at least one channel.")
    whole = np.all(np.isfinite([time, *channels]), axis=0)
    time = time[whole]
    if len(time) < 3 * _FEWEST_POINTS or np.any(np.diff(time) <= 0.0):
        raise SpectrumError(
            f"{text.name}: the first column does not rise over at least 24 points; expected time in s, a point in each "
            "row."
        )
    found = {name: values[whole] for name, values in zip(names[1:], channels, strict=True)}
    if len(found) < len(channels):
        raise SpectrumError(f"{text.name} has two channels of one name: {', '.join(names[1:])}. Rename one.")
    return Recording(text.name, time, found)


def _cells(line: str, mark: str | None) -> list[str]:
    cells = split(line, mark)
    while cells and not cells[-1]:  # a separator at the end
        cells.pop()
    return cells


def _is_row(line: str) -> bool:
    cells = _cells(line, separator(line))
    return len(cells) >= 2 and all(number(cell) is not None and cell for cell in cells)


def _rigol_step(rows: list[list[str]]) -> tuple[float, float] | None:
    """Return start and distance in s of a header that states them under ``Start`` and ``Increment``."""
    for names, values in pairwise(rows):
        lower = [name.strip().lower() for name in names]
        if "start" in lower and "increment" in lower:
            found = [number(values[lower.index(name)]) for name in ("start", "increment")]
            if found[0] is not None and found[1] is not None:
                return found[0], found[1]
    return None


def _peak_frequency(time: Array, values: Array) -> float:
    """Return the frequency in Hz of the highest peak of the spectrum."""
    even = np.linspace(time[0], time[-1], len(time))
    ac = np.interp(even, time, values)
    ac = (ac - ac.mean()) * np.hanning(len(ac))
    size = np.abs(np.fft.rfft(ac))
    return float(np.fft.rfftfreq(len(ac), even[1] - even[0])[1 + int(np.argmax(size[1:]))])


def _harmonics(
    time: Array, values: Array, frequency: float, orders: NDArray[np.int_]
) -> tuple[NDArray[np.complex128], float]:
    """Return the complex amplitudes of cosines at multiples of a frequency in Hz, and the RMS of the rest."""
    waves = np.exp(2j * pi * frequency * np.outer(time, orders))
    columns = np.column_stack([waves.real, waves.imag, np.ones_like(time)])
    found = np.linalg.lstsq(columns, values, rcond=None)[0]
    count = len(orders)
    rest = values - columns @ found
    return found[:count] - 1j * found[count : 2 * count], float(np.sqrt(np.mean(rest**2)))
