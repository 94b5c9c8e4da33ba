# SPDX-License-Identifier: GPL-3.0-or-later
r"""Temperature of the data and drive level of a measured spectrum, and what they change of the predicted values.

At a temperature the motor drifts (:class:`~pyspice_runner.motor.thermal.Thermal`); that of the first spectrum, or
without spectra of the first point, is that of the motor's parameters. At a level the elastic force of a mode of the
free stator softens and its losses grow with the amplitude, in Duffing's closed form
(:func:`~.spectra.together.amplitude_squared`): with :math:`r_0 = \theta U/k`, the share A of :math:`r_0^2`,
:math:`d = 1 - \omega^2/\omega_n^2`,

.. math::
    Y = \frac{j\omega\theta^2/k}
    {d - \tfrac34 \gamma r_0^2 A + j\frac{\omega}{\omega_n Q}(1 + \tfrac14 \kappa r_0^2 A)}

Its difference to the linear mode is added to the admittance at small amplitude. Modes that shake a common carrier are
taken to do so as at small amplitude.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any, get_args

import numpy as np

from pyspice_runner.calibration.points import TEMPERATURE
from pyspice_runner.errors import ParameterError, did_you_mean
from pyspice_runner.impedance.joint_fit import amplitude_squared
from pyspice_runner.impedance.spectrum import COUPLING, Connection, Spectrum, State
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Mode
from pyspice_runner.motor.refusal import as_number, quoted
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import Array

_RANGES = {TEMPERATURE: (-273.15, 1e3, "°C"), "level": (1e-9, 1e6, "V")}
BANDWIDTHS = 8.0 / 3.0  # γ a² Q of a resonance that leans by its own bandwidth: ¾ γ a² is twice the relative shift


@dataclass(frozen=True)
class Condition:
    """What a spectrum was measured at.

    Attributes:
        temperature: of the stator, °C; ``None``: that of the motor's parameters.
        level_v: amplitude at the terminals, V; 0 where it is small or not stated.
    """

    temperature: float | None = None
    level_v: float = 0.0


def conditions_of(
    spectra: Sequence[Any],
) -> list[tuple[Spectrum, State, Condition]]:
    """Return the spectra with their states and conditions.

    Args:
        spectra: each with its state, and with ``{"temperature": °C, "level": V}`` or one of these if stated.

    Raises:
        ParameterError: for another shape, an unknown condition, a value out of range, or a level of a stator on its
            rotor.
    """
    stated = []
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
                f"{where}: level goes with a free stator: on the rotor the contact decides on the amplitude. Leave it "
                "out, or measure the free stator."
            )
        stated.append((spectrum, state, values))
    return [
        (spectrum, state, Condition(values.get(TEMPERATURE), values.get("level", 0.0)))
        for spectrum, state, values in stated
    ]


def temperatures_of(
    spectra: Sequence[Condition], others: Sequence[tuple[str, Mapping[str, float | None]]]
) -> list[float]:
    """Return the temperatures of all data in °C; the first is that of the motor's parameters. Empty without any.

    Args:
        spectra: conditions of the spectra.
        others: name and conditions of each point and run-up.

    Raises:
        ParameterError: for a value out of range, or one that only some of the data have.
    """
    named = [(f"spectrum {number}", one.temperature) for number, one in enumerate(spectra, start=1)]
    named += [(name, conditions.get(TEMPERATURE)) for name, conditions in others]
    found = [_checked(TEMPERATURE, value, name) for name, value in named if value is not None]
    if found and len(found) < len(named):
        without = next(name for name, value in named if value is None)
        raise ParameterError(
            f"{without} has no temperature, {len(found)} of {len(named)} points, spectra and run-ups have one. Give it "
            "for each: that of the first spectrum, or else of the first point, is that of the motor's parameters."
        )
    return found


def at_conditions(
    motor: Point, conditions: Mapping[str, float | None], thermal: Thermal, reference: float | None
) -> Point:
    """Return a motor at the conditions of a point: at its temperature, then with its values.

    Args:
        motor: with values at the reference temperature.
        conditions: path → value, and ``temperature``.
        thermal: drift of the motor.
        reference: temperature in °C of the motor's values.
    """
    paths = {path: value for path, value in conditions.items() if path != TEMPERATURE}
    return warmed(motor, conditions.get(TEMPERATURE), thermal, reference).updated(paths)


def warmed(motor: Point, temperature: float | None, thermal: Thermal, reference: float | None) -> Point:
    """Return a motor at a temperature in °C, of values at the reference temperature."""
    if temperature is None or reference is None or temperature == reference:
        return motor
    return replace(motor, motor=thermal.warmed(motor.motor, temperature - reference))


def _checked(key: str, value: Any, where: str) -> float:
    if key not in _RANGES:
        raise ParameterError(f"{where}: there is no condition {quoted(key)}. {did_you_mean(key, list(_RANGES))}")
    low, high, unit = _RANGES[key]
    number = as_number(value)
    if number is None or not low <= number <= high:
        raise ParameterError(
            f"{where}: {key} = {quoted(value)} is not valid: it must be a number >= {low:g} and <= {high:g} {unit}."
        )
    return float(number)


def added(motor: Motor, frequency: Array, connection: Connection, level_v: float) -> Array:
    """Return the change of a free stator's admittance by the amplitude at a level, complex, in S."""
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


def scales(motor: Motor, connection: Connection, conditions: Sequence[Condition]) -> dict[str, float]:
    """Return the size of softening and growth that the spectra can tell: path → value in 1/m².

    That softening lets a resonance lean by its bandwidth at the greatest level, that growth doubles its losses.
    """
    level = max((one.level_v for one in conditions), default=0.0)
    found = {}
    for number, mode in enumerate(motor.modes):
        amplitude = abs(_coupling(mode, connection)) * level * mode.quality_factor / mode.stiffness_n_per_m
        if amplitude:
            found[f"modes.{number}.softening_per_m2"] = BANDWIDTHS / (mode.quality_factor * amplitude**2)
            found[f"modes.{number}.damping_growth_per_m2"] = 4.0 / amplitude**2
    return found
