# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of a motor's data sheet: checked, and as measured operating points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from pyspice_runner.calibration.points import CURRENT, LOAD, POWER, SPEED, Points
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.drive import TwoPhaseDrive

GROUPS = 2


@dataclass(frozen=True)
class DataSheet:
    """Numbers of a rotary motor in rad/s and N·m, of a linear stage in m/s and N.

    Attributes:
        linear: whether the motor pushes a slider.
        no_load_speed, stall: at the drive.
        rated_speed, rated_load: of the rated point at the same drive.
        rated_current: RMS current of a group there, A; where the groups differ, the root mean square of both.
        rated_power: electrical power of both groups there, W.
        speed_error, load_error, current_error: relative standard deviations of speeds, of torques and forces, and of
            current and power.
    """

    linear: bool
    no_load_speed: float | None = None
    stall: float | None = None
    rated_speed: float | None = None
    rated_load: float | None = None
    rated_current: float | None = None
    rated_power: float | None = None
    speed_error: float = 0.02
    load_error: float = 0.02
    current_error: float = 0.05

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            require(key == "linear" or value is None or 0.0 < value < 1e9, key, value, "a number > 0")
        at_point = [name for name in ("rated_current", "rated_power") if getattr(self, name) is not None]
        if at_point and self.rated_speed is None and self.rated_load is None:
            raise ParameterError(f"{at_point[0]} holds at a rated point; give its rated_load or rated_speed too.")
        if not at_point and (self.rated_speed is None) != (self.rated_load is None):
            raise ParameterError(
                "One value does not make a rated point: give rated_speed and rated_load, or one of them with "
                "rated_current or rated_power."
            )
        for own, name, most, limit in (
            ("rated_speed", "rated_speed", "no_load_speed", self.no_load_speed),
            ("rated_load", "rated_load", self.words("stall"), self.stall),
        ):
            value = getattr(self, own)
            if value is not None and limit is not None and value >= limit:
                raise ParameterError(
                    f"{name} = {value:g} {self.unit(own)} contradicts {most} = {limit:g} {self.unit(own)}: a motor "
                    "turns slower under load, and stands at stall. Check both, and their units."
                )

    def check_power(self, drive: TwoPhaseDrive) -> None:
        """Raise ParameterError where the powers at the rated point contradict each other at this voltage."""
        voltage = drive.voltage * sqrt(0.5 * (1.0 + drive.ratio_b**2))  # amplitude, root mean square of the groups
        most, source = float("inf"), ""
        if self.rated_current is not None:
            most = GROUPS * voltage / sqrt(2.0) * self.rated_current
            source = (
                f"the apparent power of {most:.4g} VA, that of {GROUPS} groups at {drive.voltage:g} V amplitude and "
            )
            source += f"{self.rated_current:g} A rms"
        if self.rated_power is not None:
            if self.rated_power > most:
                raise ParameterError(
                    f"rated_power = {self.rated_power:g} W contradicts {source}: it cannot be greater. Check power, "
                    "current (rms of one group) and voltage (amplitude)."
                )
            most, source = self.rated_power, f"the electrical power of {self.rated_power:g} W"
        output = (self.rated_speed or 0.0) * (self.rated_load or 0.0)
        if output >= most:
            raise ParameterError(
                f"The rated point gives {output:.4g} W at the shaft ({self.rated_load:g} {self.unit('rated_load')} at "
                f"{self.rated_speed:g} {self.unit('rated_speed')}), but takes at most {source}. Check the numbers and "
                "their units."
            )

    def unit(self, key: str) -> str:
        """Return the unit of a number."""
        if "speed" in key:
            return "m/s" if self.linear else "rad/s"
        return "N" if self.linear else "N·m"

    def words(self, key: str) -> str:
        """Return the name of a load as an argument of the entry."""
        return f"{key}_{'force' if self.linear else 'torque'}"

    @property
    def measured(self) -> dict[str, float]:
        """The numbers that a motor has to show: name with its unit → value."""
        speed, load = ("m_s", "force_n") if self.linear else ("rad_s", "torque_n_m")
        found = {
            f"no_load_speed_{speed}": self.no_load_speed, f"stall_{load}": self.stall,
            f"rated_{load}": self.rated_load if self.rated_speed is not None else None,
            "rated_current_rms_a": self.rated_current, "rated_power_w": self.rated_power,
        }  # fmt: skip
        return {key: value for key, value in found.items() if value is not None}

    @property
    def errors(self) -> dict[str, float]:
        """The relative standard deviation of each of :attr:`measured`."""
        own = {"speed": self.speed_error, "current": self.current_error, "power": self.current_error}
        return {
            key: next((error for word, error in own.items() if word in key), self.load_error) for key in self.measured
        }

    def points(self, keys: Sequence[str]) -> Points:
        """Return numbers of :attr:`measured` as measured points: without a load, held at stall, and rated.

        They are logarithmic, since a motor that is to be found may be a factor off.
        """
        held = self.rated_speed is not None
        loads: dict[str, dict[str, float | None]] = {
            "no_load": {"load.torque": 0.0, "load.speed": None}, "stall": {"load.torque": 0.0, "load.speed": 0.0},
            "rated": {"load.torque": 0.0 if held else self.rated_load, "load.speed": self.rated_speed},
        }  # fmt: skip
        used = [name for name in loads if any(key.startswith(name) for key in keys)]
        quantities = {"speed": SPEED, "stall": "torque_n_m", "current": CURRENT, "power": POWER}
        every = self.measured
        return Points(
            source="the data sheet",
            conditions=tuple(loads[name] for name in used),
            rows=tuple(next(row for row, name in enumerate(used) if key.startswith(name)) for key in keys),
            quantities=tuple(next((own for word, own in quantities.items() if word in key), LOAD) for key in keys),
            values=np.log([every[key] for key in keys]), errors=np.array([self.errors[key] for key in keys]),
            errors_given=True, logarithmic=True,
        )  # fmt: skip
