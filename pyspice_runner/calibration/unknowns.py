# SPDX-License-Identifier: GPL-3.0-or-later
"""The free parameters of a calibration: their paths, their ranges, and what was known of them before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, hypot, inf, log

from pyspice_runner.circuit.law import PAPER_LAW, Law
from pyspice_runner.errors import ParameterError, did_you_mean, require
from pyspice_runner.motor.motor import Motor, Ringing
from pyspice_runner.motor.parameters import Mode, Parameters, stiffest
from pyspice_runner.motor.refusal import Stated, quoted, schema_of
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.paths import law_parameter, parameter

MOST = 40  # free parameters
WIDE = log(10.0)  # a factor of 10 in the value: longest step of a profile, and what is always known of a value
DRIFTS = ("frequency_drift_per_k", "coupling_drift_per_k", "capacitance_drift_per_k")
THERMAL = "thermal."  # drift of the motor, of spectra at several temperatures
_TUNING = ("frequency_hz", "stiffness_n_per_m", "mass_kg")  # of a mode: its response is straight within its half width
_STRAIGHT = 20.0  # quality factor up to which a difference of 0.2 % in frequency is a small part of that
_SECTIONS = ("modes", "piezo", "contact", "law", "rotor", "slider", "mount")


@dataclass(frozen=True)
class Unknown:
    """A free parameter, and its coordinate x: the logarithm of value over start, or their difference over a scale.

    The logarithm makes a step of all parameters alike, and an interval of a poorly known one as wide as it is: a factor
    each way. A parameter that may be zero has a linear coordinate.
    """

    path: str
    start: float
    low: float  # minimum
    high: float  # maximum
    unit: str
    prior: float | None = None  # standard deviation of x about 0 that was known before; ``None``: nothing
    size: float = 1.0  # scale of a linear coordinate whose start is 0
    sharp: float = 1.0  # share of a difference of x over which the response is straight
    wide: float = WIDE  # further standard deviation: what the data leave open stays at the order of its start

    @property
    def weight(self) -> float:
        """Reciprocal of the standard deviation of x about 0 that is known beforehand."""
        return hypot(1.0 / self.prior if self.prior else 0.0, 1.0 / self.wide)

    @property
    def logarithmic(self) -> bool:
        """Whether x is a logarithm: the value keeps its sign."""
        return self.start != 0.0 and (self.low > 0.0 or self.high < 0.0)

    def value(self, x: float) -> float:
        """Return the value at a coordinate, within its range."""
        value = self.start * exp(x) if self.logarithmic else self.start + x * self._scale
        return min(max(value, self.low), self.high)

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value; 0 for one whose logarithm from the start does not exist."""
        if not self.logarithmic:
            return (value - self.start) / self._scale
        return log(value / self.start) if value / self.start > 0.0 else 0.0

    @property
    def bounds(self) -> tuple[float, float]:
        """Minimum and maximum coordinate."""
        low, high = sorted(map(self.coordinate, (self.low, self.high)))
        return low, high

    def spread(self, x: float, deviation: float) -> float:
        """Return the standard error of the value for that of its coordinate."""
        return abs(self.value(x)) * deviation if self.logarithmic else self._scale * deviation

    @property
    def _scale(self) -> float:
        return abs(self.start) or self.size


def unknowns_of(
    motor: Motor,
    drive: Stated,
    free: Sequence[str],
    priors: Mapping[str, float] | None = None,
    sizes: Mapping[str, float] | None = None,
    law: Law = PAPER_LAW,
) -> tuple[Unknown, ...]:
    """Return the free parameters; ``modes.*.NAME`` stands for that of all modes, each of its own.

    ``law`` has those of the section ``law``. ``sizes`` are scales of parameters that start from 0: path → value.

    Raises:
        ParameterError: for an unknown path, one that is given twice or is not a number of the motor, too many, or a
            prior that is not of a free parameter.
    """
    paths = [own for path in free for own in _expanded(motor, path)]
    if not 1 <= len(paths) <= MOST:
        raise ParameterError(f"free has {len(paths)} parameters: it must have 1 to {MOST}.")
    for path in paths:
        if paths.count(path) > 1:
            raise ParameterError(f"free: {path} is given twice. Give it once.")
        if path.partition(".")[0] not in (*_SECTIONS, THERMAL[:-1]):
            raise ParameterError(
                f"free: {quoted(path)} is not a parameter of the motor. Give paths of {', '.join(_SECTIONS)}."
            )
    widths = {own: width for path, width in (priors or {}).items() for own in _expanded(motor, path)}
    for path, width in widths.items():
        if path not in paths:
            raise ParameterError(f"priors: {path} is not free. Name it in free, or leave its prior out.")
        require(0.0 < width < inf, f"priors: {path}", width, "a relative width > 0")
    return tuple(_unknown(motor, drive, path, widths.get(path), (sizes or {}).get(path, 1.0), law) for path in paths)


def _expanded(motor: Motor, path: str) -> list[str]:
    if not path.startswith("modes.*."):
        return [path]
    return [path.replace("*", str(number), 1) for number in range(len(motor.modes))]


def _unknown(motor: Motor, drive: Stated, path: str, width: float | None, size: float, law: Law) -> Unknown:
    if path.startswith(THERMAL):  # a linear coordinate, since the sign of a drift is not known
        thermal, key = Thermal.of(motor), path.removeprefix(THERMAL)
        if key not in DRIFTS:
            raise ParameterError(
                f"free: {quoted(path)} is not a drift. {did_you_mean(path, [THERMAL + one for one in DRIFTS])}"
            )
        return Unknown(path, getattr(thermal, key), *_limits(Thermal, key), "1/K", width)
    found = parameter(path, motor, drive, {"contact": law})
    if found.nominal is None:
        raise ParameterError(f"free: {path} has no value in {motor.name}. Set it to one to start from.")
    low, high = law_parameter(path, law)[1:] if path.startswith("law.") else _range(motor, path)
    start = found.nominal
    if low < 0.0 < high and start:  # a coupling, or a motion of the tip: its sign is that of the start
        smallest = 1e-6 * abs(start)
        low, high = (smallest, high) if start > 0.0 else (low, -smallest)
    elif low == 0.0 and start > 0.0:
        low = 1e-6 * start
    mode, _, key = path.rpartition(".")
    tuned = mode.startswith("modes.") and key in _TUNING
    quality = parameter(f"{mode}.quality_factor", motor, drive, {}).nominal if tuned else None
    return Unknown(path, start, low, high, found.unit, width, size, min(1.0, _STRAIGHT / (quality or 1.0)))


def _range(motor: Motor, path: str) -> tuple[float, float]:
    section, _, key = path.partition(".")
    if section != "modes":
        low, high = _limits(type(getattr(motor, section)), key)
        return low, min(high, stiffest(motor.contact.exponent)) if key == "normal_stiffness_n_per_m15" else high
    key = key.partition(".")[2]
    return _limits(Ringing if key in Ringing.model_fields else Mode, key)


def _limits(kind: type[Parameters], key: str) -> tuple[float, float]:
    """Return the minimum and the maximum of a field."""
    ends = {name.removeprefix("exclusive").lower(): end for name, end in schema_of(kind, key).items()}
    return float(ends["minimum"]), float(ends["maximum"])
