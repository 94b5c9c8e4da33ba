# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of a motor's data sheet: checked, and as measured operating points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import copysign, inf, sqrt

import numpy as np

from pyspice_runner.calibration.points import CURRENT, LOAD, POWER, SPEED, Points
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.drive import TwoPhaseDrive

GROUPS = 2
_SIGNED = "no_load_speed", "stall", "rated_speed", "rated_load", "low_speed"


@dataclass(frozen=True)
class DataSheet:
    """Numbers of a rotary motor in rad/s and N·m, of a linear stage in m/s and N; all at one drive.

    Speeds and loads are negative where the motor turns in the negative direction.
    """

    linear: bool  # whether the motor pushes a slider
    no_load_speed: float | None = None
    stall: float | None = None
    rated_speed: float | None = None  # of the rated point
    rated_load: float | None = None
    rated_current: float | None = None  # RMS, of a group there, A; where the groups differ, the root mean square
    rated_power: float | None = None  # electrical, of both groups there, W
    speed_error: float = 0.02  # relative standard deviation of speeds
    load_error: float = 0.02  # likewise of torques and forces
    current_error: float = 0.05  # likewise of current and power
    low_speed: float | None = None  # without load, at a lower voltage
    low_voltage: float | None = None  # V

    def __post_init__(self) -> None:
        stall = f"stall_{'force' if self.linear else 'torque'}"
        for key, value in vars(self).items():
            name, sign = stall if key == "stall" else key, self.sign if key in _SIGNED else 1.0
            allowed = "a number > 0" if sign > 0.0 else "a number < 0"
            allowed += (
                ", like the other speeds and loads" if key in _SIGNED and self.sign * (value or 0.0) < 0.0 else ""
            )
            require(key == "linear" or value is None or 0.0 < sign * value < 1e9, name, value, allowed)
        if (self.low_speed is None) != (self.low_voltage is None):
            raise ParameterError("low_speed is the no-load speed at low_voltage: give both, or leave both out.")
        at_point = [name for name in ("rated_current", "rated_power") if getattr(self, name) is not None]
        if at_point and self.rated_speed is None and self.rated_load is None:
            raise ParameterError(f"{at_point[0]} holds at a rated point; give its rated_load or rated_speed too.")
        if not at_point and (self.rated_speed is None) != (self.rated_load is None):
            raise ParameterError(
                "One value does not make a rated point: give rated_speed and rated_load, or one of them with "
                "rated_current or rated_power."
            )
        for name, value, most, limit in (
            ("rated_speed", self.rated_speed, "no_load_speed", self.no_load_speed),
            ("rated_load", self.rated_load, stall, self.stall),
            ("low_speed", self.low_speed, "no_load_speed", self.no_load_speed),
        ):
            if value is not None and limit is not None and abs(value) >= abs(limit):
                raise ParameterError(
                    f"{name} = {value:g} {self.unit(name)} contradicts {most} = {limit:g} {self.unit(name)}: a motor "
                    "turns slower under load and at a low voltage, and stands at stall. Check both, and their units."
                )

    def drive(self, at: Mapping[str, float | None], phase_deg: float) -> TwoPhaseDrive | None:
        """Return the drive ``at`` which the numbers hold, by default with ``phase_deg``; ``None`` without numbers.

        Raise ParameterError without voltage or frequency, or if the powers at the rated point contradict each other.
        """
        if not self.measured:
            return None
        voltage, frequency, phase = at["voltage"], at["frequency"], at["phase_deg"]
        if voltage is None or frequency is None:
            raise ParameterError(
                "A speed or a torque is measured at one drive; give its voltage and its frequency too."
            )
        if self.low_voltage is not None:
            require(0.0 < self.low_voltage < voltage, "low_voltage", self.low_voltage, f"> 0 and < {voltage:g} V")
        drive = TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase_deg if phase is None else phase)
        most, source = inf, ""
        if self.rated_current is not None:
            most = GROUPS * voltage / sqrt(2.0) * self.rated_current
            source = (
                f"the apparent power of {most:.4g} VA, that of {GROUPS} groups at {voltage:g} V amplitude and "
                f"{self.rated_current:g} A rms"
            )
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
        return drive

    def unit(self, key: str) -> str:
        """Return the unit of a number."""
        if "speed" in key:
            return "m/s" if self.linear else "rad/s"
        return "N" if self.linear else "N·m"

    @property
    def sign(self) -> float:
        """Direction of the motor at the drive: the sign of the first number that has one."""
        return copysign(1.0, next((one for name in _SIGNED if (one := getattr(self, name)) is not None), 1.0))

    @property
    def measured(self) -> dict[str, float]:
        """The numbers that a motor has to show: name with its unit → value."""
        return {name: value for name, value, *_ in self._numbers if value is not None}

    @property
    def _numbers(self) -> list[tuple[str, float | None, str, str, float]]:
        """Name, value, load, quantity and error of each number that a motor may have to show."""
        speed, load = ("m_s", "force_n") if self.linear else ("rad_s", "torque_n_m")
        rated_load = self.rated_load if self.rated_speed is not None else None
        return [
            (f"no_load_speed_{speed}", self.no_load_speed, "no load", SPEED, self.speed_error),
            (f"low_speed_{speed}", self.low_speed, "low", SPEED, self.speed_error),
            (f"stall_{load}", self.stall, "stall", "torque_n_m", self.load_error),
            (f"rated_{load}", rated_load, "rated", LOAD, self.load_error),
            ("rated_current_rms_a", self.rated_current, "rated", CURRENT, self.current_error),
            ("rated_power_w", self.rated_power, "rated", POWER, self.current_error),
        ]

    def points(self, *, logarithmic: bool = True) -> Points | None:
        """Return the numbers as measured points: without a load, held at stall, and rated; ``None`` without numbers.

        A motor that is to be found may be a factor off: therefore ``logarithmic``.
        """
        if not self.measured:
            return None
        _, values, loads, quantities, errors = zip(*(one for one in self._numbers if one[1] is not None), strict=True)
        conditions: dict[str, dict[str, float | None]] = {
            "no load": {"load.torque": 0.0, "load.speed": None},
            "low": {"load.torque": 0.0, "load.speed": None, "drive.voltage": self.low_voltage},
            "stall": {"load.torque": 0.0, "load.speed": 0.0},
            "rated": {"load.torque": self.rated_load, "load.speed": None},
        }
        if self.rated_speed is not None:
            conditions["rated"] = {"load.torque": 0.0, "load.speed": self.rated_speed}
        used = list(dict.fromkeys(loads))
        return Points(
            "the data sheet", tuple(conditions[load] for load in used), tuple(map(used.index, loads)), quantities,
            np.log(np.abs(values)) if logarithmic else np.array(values), np.array(errors), errors_given=True,
            logarithmic=logarithmic, signs=np.sign(values),
        )  # fmt: skip
