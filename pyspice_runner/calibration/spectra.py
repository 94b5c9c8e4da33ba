# SPDX-License-Identifier: GPL-3.0-or-later
r"""Measured spectra with their temperature and drive level, and their prediction.

At a level the elastic force of a mode of the free stator softens and its losses grow with the amplitude, in Duffing's
closed form (:func:`~pyspice_runner.impedance.joint_fit.amplitude_squared`): with :math:`r_0 = \theta U/k`, the share A
of :math:`r_0^2`, :math:`d = 1 - \omega^2/\omega_n^2`,

.. math::
    Y = \frac{j\omega\theta^2/k}
    {d - \tfrac34 \gamma r_0^2 A + j\frac{\omega}{\omega_n Q}(1 + \tfrac14 \kappa r_0^2 A)}

Its difference to the linear mode is added to the admittance at small amplitude. Modes that shake a common carrier are
taken to do so as at small amplitude.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from math import copysign, pi, sqrt
from typing import Any, ClassVar, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pyspice_runner.calibration.points import TEMPERATURE, Curve
from pyspice_runner.calibration.unknowns import Unknown
from pyspice_runner.errors import ParameterError, SpectrumError, did_you_mean
from pyspice_runner.impedance.spectrum import COUPLING, Connection, Spectrum, State, connect
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Mode
from pyspice_runner.motor.refusal import as_number, quoted
from pyspice_runner.run.point import Point
from pyspice_runner.run.two_port import sweep_two_port, two_port, two_port_bench
from pyspice_runner.run.waveforms import Array

SPECTRUM_ERROR = 0.01  # relative error of a measured admittance: that of an impedance analyser with its fixture
SPECTRUM_POINTS = 200  # of a measured spectrum that are compared; its resonances are narrow, so they are chosen there
COUPLINGS = "coupling_a_n_per_v", "coupling_b_n_per_v"
_CONDITIONS = {TEMPERATURE: (-273.15, 1e3, "°C"), "level": (1e-9, 1e6, "V")}
_LARGEST_RATIO = 2.0  # of predicted and measured magnitude, up to which the prediction sets the error
_FAR_ABOVE = 3.0  # times the noise of a spectrum (RMS), beyond which a motor does not describe it
_FINE = 4001  # points of a sweep from which a spectrum with uneven frequencies is interpolated
_OPPOSED = 1e3  # distance, as a logarithm of frequencies, of a mode that the groups drive in another way
_COUPLED = 0.01  # the same for a coupling that differs by a factor of e
_EXCHANGED = 4.0  # half-power widths between modes, below which one port may show them in another order
_LEAST = 1e-9  # N/(V·√kg), added to couplings that may be 0
_BANDWIDTHS = 8.0 / 3.0  # γ a² Q of a resonance that leans by its own bandwidth: ¾ γ a² is twice the relative shift


@dataclass(frozen=True)
class Band(Curve):
    """A measured spectrum: what is compared of it. Its conditions are the temperature of the stator in °C."""

    along: ClassVar[str] = "frequency_hz"
    quantities: ClassVar[tuple[str, ...]] = ("admittance_real_s", "admittance_imaginary_s")

    spectrum: Spectrum
    state: State
    connection: Connection
    level_v: float = 0.0  # amplitude at the terminals; 0 where it is small or not known

    @property
    def source(self) -> str:
        """Name of the data."""
        return f"{self.spectrum.source or 'the spectrum'} ({self.state})"

    def errors_at(self, predicted: Array) -> Array:
        """Return the standard errors of the measured parts: a share of the predicted magnitude, or of the measured one.

        Shares of measured magnitudes would make values that are low by chance count more. A prediction that is more
        than :data:`_LARGEST_RATIO` off is given the nearest magnitude within it.
        """
        if not np.isfinite(predicted).all():
            return self.errors
        magnitude, own = (np.hypot(*np.split(values, 2)) for values in (self.measured, predicted))
        ratio = np.clip(own / magnitude, 1.0 / _LARGEST_RATIO, _LARGEST_RATIO)
        return self.errors * np.tile(ratio, 2)

    def far(self, predicted: Array) -> bool:
        """Whether a prediction is farther from the spectrum than its noise, as its third differences show it."""
        from pyspice_runner.impedance.noise import estimate  # takes long to load

        measured = np.asarray(np.array([1.0, 1j]) @ self.measured.reshape(2, -1), dtype=complex)
        size = np.abs(measured)
        noise = np.median(estimate(measured).deviation(measured) / size)
        return bool(np.mean(((predicted - self.measured) / np.tile(size, 2)) ** 2) > 0.5 * (_FAR_ABOVE * noise) ** 2)

    def predicted(self, point: Point, *, fine: bool) -> Array:
        """Return the parts of a motor's admittance at the measured frequencies: in closed form, or by ngspice."""
        motor, frequency = point.motor, self.at
        if fine:
            own = self._by_ngspice(motor)
        else:
            pressed = self.state == "preloaded"
            stator = motor.pressed_stator if pressed else motor.stator.with_carrier(motor.mount)
            own = connect(stator.admittance(2.0 * pi * frequency), self.connection)
        if self.level_v:
            own = own + added(motor, frequency, self.connection, self.level_v)
        return np.concatenate([own.real, own.imag])

    def _by_ngspice(self, motor: Motor) -> NDArray[np.complex128]:
        """Return the admittance in S, complex."""
        frequency = self.at
        steps = np.diff(frequency)
        even = np.ptp(steps) < 1e-6 * steps.mean()
        points = len(frequency) if even else _FINE
        bench = two_port_bench(motor, preloaded=self.state == "preloaded")
        found, matrix = two_port(sweep_two_port(bench, None, float(frequency[0]), float(frequency[-1]), points))
        own = connect(matrix, self.connection)
        if not even:
            from scipy.interpolate import CubicSpline  # takes long to load

            own = CubicSpline(found, own)(frequency)
        return np.asarray(own, dtype=complex)


def bands_of(spectra: Sequence[Any], connection: Connection, error: float) -> tuple[Band, ...]:
    """Return what is compared of measured spectra, at most :data:`SPECTRUM_POINTS` points of each.

    ``spectra`` are as of :func:`~pyspice_runner.calibrate`; ``error`` is relative to the magnitude. Raise
    ParameterError for another shape, an unknown condition, a value out of range, or a level of a stator on its rotor.
    """
    found = []
    for number, entry in enumerate(spectra, start=1):
        where = f"spectrum {number}"
        if not isinstance(entry, tuple | list) or len(entry) not in (2, 3) or not isinstance(entry[0], Spectrum):
            raise ParameterError(
                f"{where} = {quoted(entry)} is not valid: give (spectrum, state), or with its conditions "
                '(spectrum, "free", {"temperature": 40.0, "level": 10.0}).'
            )
        spectrum, state, given = (*entry, {})[:3]
        if not isinstance(given, Mapping):
            raise ParameterError(
                f'{where}: the conditions {quoted(given)} are not valid: give {{"temperature": 40.0}}.'
            )
        if state not in get_args(State):
            raise ParameterError(f"{where}: the state {quoted(state)} is not valid: it must be free or preloaded.")
        values = {str(key): _checked(str(key), value, where) for key, value in dict(given).items()}
        if "level" in values and state != "free":
            raise ParameterError(
                f"{where}: level goes with a free stator: on the rotor the contact determines the amplitude. Leave it "
                "out, or measure the free stator."
            )
        places = np.unique(np.linspace(0, len(spectrum.frequency_hz) - 1, SPECTRUM_POINTS).round().astype(int))
        few = Spectrum(spectrum.frequency_hz[places], spectrum.matrix_s[places], spectrum.source, spectrum.format)
        own = (few.driven(connection) if few.ports == 2 else few).matrix_s[:, 0, 0]
        found.append(Band(
            few.source or f"a spectrum ({state})", {TEMPERATURE: values.get(TEMPERATURE)}, few.frequency_hz,
            np.concatenate([own.real, own.imag]), error * np.tile(np.abs(own), 2), few, state, connection,
            values.get("level", 0.0),
        ))  # fmt: skip
    return tuple(found)


def temperatures_of(named: Sequence[tuple[str, Mapping[str, float | None]]]) -> list[float]:
    """Return the temperatures of all data in °C, by their names and conditions; without any the list is empty.

    The parameters of the motor hold at the first. Raise ParameterError for a value out of range, or one that only some
    of the data have.
    """
    found = [_checked(TEMPERATURE, own[TEMPERATURE], name) for name, own in named if own.get(TEMPERATURE) is not None]
    if found and len(found) < len(named):
        without = next(name for name, own in named if own.get(TEMPERATURE) is None)
        raise ParameterError(
            f"{without} has no temperature, {len(found)} of {len(named)} points, spectra and run-ups have one. Give it "
            "for each: that of the first spectrum, or else of the first point, is that of the motor's parameters."
        )
    return found


def _checked(key: str, value: Any, where: str) -> float:
    if key not in _CONDITIONS:
        raise ParameterError(f"{where}: there is no condition {quoted(key)}. {did_you_mean(key, list(_CONDITIONS))}")
    low, high, unit = _CONDITIONS[key]
    number = as_number(value)
    if number is None or not low <= number <= high:
        raise ParameterError(
            f"{where}: {key} = {quoted(value)} is not valid: it must be a number >= {low:g} and <= {high:g} {unit}."
        )
    return float(number)


def added(motor: Motor, frequency: Array, connection: Connection, level_v: float) -> Array:
    """Return the change of a free stator's admittance by the amplitude at a level, complex, in S."""
    from pyspice_runner.impedance.joint_fit import amplitude_squared  # takes long to load

    found = np.zeros(len(frequency), dtype=complex)
    for mode in motor.modes:
        force = abs(_coupling(mode, connection)) * level_v
        if mode.linear or not force:
            continue
        ratio = frequency / mode.frequency_hz
        detuning, damping = 1.0 - ratio**2, ratio / mode.quality_factor
        square = (force / mode.stiffness_n_per_m) ** 2
        softer, growing = 0.75 * mode.softening_per_m2 * square, 0.25 * mode.damping_growth_per_m2 * square
        share = amplitude_squared(detuning, damping, softer, growing)
        soft = detuning - softer * share + 1j * damping * (1.0 + growing * share)
        size = 2j * pi * frequency * (force / level_v) ** 2 / mode.stiffness_n_per_m
        found += size * (1.0 / soft - 1.0 / (detuning + 1j * damping))
    return found


def _coupling(mode: Mode, connection: Connection) -> float:
    return float(COUPLING[connection] @ np.array(mode.couplings))


def fitted(
    motor: Motor, unknowns: Sequence[Unknown], spectra: Sequence[tuple[Any, ...]], connection: Connection
) -> Array:
    """Return the coordinates of modes and capacitances by the fit of the first free spectrum; NaN for other parameters.

    Without a spectrum that can be fitted there are none. One port gives the size of the coupling through it, and does
    not show which of two close modes is which: each further row has such a pair exchanged.
    """
    from pyspice_runner.impedance.one_port_fit import fit_one_port  # takes long to load
    from pyspice_runner.impedance.two_port_fit import TwoPortFit, fit_groups

    shown = any(one.path.startswith(("modes.", "piezo.")) for one in unknowns)
    free = [spectrum for spectrum, state, *_ in spectra if state == "free" and shown]
    fit, found, rows = None, dict[str, float](), list[tuple[float, ...]]()
    with suppress(SpectrumError):
        fit = (fit_groups if free[0].ports == 2 else fit_one_port)(free[0]) if free else None
    if isinstance(fit, TwoPortFit):
        found = {f"piezo.{name}": getattr(fit, name) for name in fit.standard_errors}
        rows = [(one.series_resonance_hz, one.coupling_a_n_per_v_kg05, one.coupling_b_n_per_v_kg05, one.quality_factor)
                for one in fit.modes]  # fmt: skip
    elif fit is not None:
        rows = [(one.series_resonance_hz, one.inductance_h**-0.5, 0.0, one.quality_factor) for one in fit.resonances]
    weights = np.array(COUPLING[connection])
    pairs = matched([row[:3] for row in rows], motor)
    own, places = [rows[row] for row, _ in pairs], [place for _, place in pairs]
    orders, starts = [places], list[list[float]]()
    for k, ((low, *_), (high, _, b, quality)) in enumerate(pairwise(own)):
        if not b and high - low < _EXCHANGED * high / quality:
            orders.append([*places[:k], places[k + 1], places[k], *places[k + 2 :]])
    for order in orders:
        for (frequency, a, b, quality), place in zip(own, order, strict=True):
            mode = motor.modes[place]
            couplings, root = np.array(mode.couplings), sqrt(mode.mass_kg)
            if b:
                couplings = copysign(root, couplings[0]) * np.array([a, b])
            elif through := abs(float(weights @ couplings)):
                couplings = np.where(weights, root * a / through, 1.0) * couplings
            values = {"frequency_hz": frequency, "stiffness_n_per_m": mode.mass_kg * (2.0 * pi * frequency) ** 2}
            values |= {"quality_factor": quality, **dict(zip(COUPLINGS, couplings.tolist(), strict=True))}
            found |= {f"modes.{place}.{key}": value for key, value in values.items()}
        starts.append([one.coordinate(found[one.path]) if one.path in found else np.nan for one in unknowns])
    return np.array(starts)


def matched(found: Sequence[tuple[float, ...]], motor: Motor) -> list[tuple[int, int]]:
    """Return the places of modes that were found, each with the place of the equivalent mode of a motor.

    A mode that was found has a frequency and θ/√m to both groups, to group B 0 where it is not known.
    Equivalent is the closest one in frequency and coupling that the groups drive in the same way, alike or opposed.
    """
    here = np.reshape(found, (-1, 1, 3))
    there = np.array([[mode.frequency_hz, *np.array(mode.couplings) / sqrt(mode.mass_kg)] for mode in motor.modes])
    known = [1.0, 1.0] if here[..., 2].any() else [1.0, 0.0]
    sizes = [np.linalg.norm(one[..., 1:] * known, axis=-1) + _LEAST for one in (here, there)]
    opposed = np.prod(here[..., 1:], axis=-1) * np.prod(there[:, 1:], axis=-1) < 0.0
    table = np.abs(np.log(here[..., 0] / there[:, 0])) + _COUPLED * np.abs(np.log(sizes[0] / sizes[1]))
    rows, places = linear_sum_assignment(table + _OPPOSED * opposed)
    return [pair for pair in zip(rows.tolist(), places.tolist(), strict=True) if not opposed[pair]]


def scales(motor: Motor, bands: Sequence[Band]) -> dict[str, float]:
    """Return the size of softening and growth that the spectra can show: path → value in 1/m².

    That softening lets a resonance lean by its bandwidth at the highest level, that growth doubles its losses.
    """
    level = max((band.level_v for band in bands), default=0.0)
    found = {}
    for number, mode in enumerate(motor.modes if level else ()):
        amplitude = abs(_coupling(mode, bands[0].connection)) * level * mode.quality_factor / mode.stiffness_n_per_m
        if amplitude:
            found[f"modes.{number}.softening_per_m2"] = _BANDWIDTHS / (mode.quality_factor * amplitude**2)
            found[f"modes.{number}.damping_growth_per_m2"] = 4.0 / amplitude**2
    return found
