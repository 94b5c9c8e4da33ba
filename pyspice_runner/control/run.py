# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a run with a sampled controller: samples, their check, settling, and the static error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from pyspice_runner.averaged.run import RunOverTime, limit_cycle, presliding, short_bursts
from pyspice_runner.result import contact_row
from pyspice_runner.run.window import Array, change_to_come

SAMPLES: dict[str, tuple[str, str]] = {
    "time_s": ("s", "time of the sample"),
    "speed_rad_s": ("rad/s", "mean speed of the rotor since the last sample"),
    "position_rad": ("rad", "angle of the rotor"),
    "current_amplitude_a": ("A", "amplitude of the current into group A, mean since the last sample"),
    "current_phase_deg": ("deg", "phase of that current ahead of the commanded voltage of group A"),
    "temperature_k": ("K", "temperature of the stator above that at which its parameters hold"),
    "reference": ("1", "set point of the controller, or value of the course reference, in the controller's unit"),
    "current_b_amplitude_a": ("A", "amplitude of the current into group B, mean since the last sample"),
    "current_b_phase_deg": ("deg", "phase of that current ahead of the commanded voltage of group A"),
    "voltage_amplitude_v": ("V", "amplitude of the voltage of group A, mean since the last sample"),
    "voltage_b_amplitude_v": ("V", "amplitude of the voltage of group B, mean since the last sample"),
    "frequency_hz": ("Hz", "drive frequency from this sample on"),
    "voltage_a_v": ("V", "amplitude of group A from this sample on"),
    "voltage_b_v": ("V", "amplitude of group B from this sample on"),
    "phase_deg": ("deg", "phase of group B ahead of group A from this sample on"),
    "electrical_power_w": ("W", "real power into both groups, mean since the last sample"),
    "heat_w": ("W", "losses of the stator in the averaged motor: dielectric and modal damping"),
    "load_torque_n_m": ("N·m", "torque that the load draws"),
    "load_position_rad": ("rad", "angle of what is coupled to the shaft"),
    "check": ("1", "motion that the averaged motor leaves out, relative to static penetration and limit of stick"),
    "separated": ("1", "share of the period in which the contact of the averaged motor is open"),
    "tip_y_amplitude_m": ("m", "amplitude of the tip's fundamental in the averaged motor, towards the rotor"),
}
CHECKS = ("check", "separated", "tip_y_amplitude_m")
OF_AVERAGED = ("heat_w", *CHECKS)
# sample of each quantity that a controller may control, by the attribute ``quantity`` of the controller
CONTROLLED = {"speed": "speed_rad_s", "position": "position_rad", "phase": "current_phase_deg"}
MOST_TURNS = 2  # of a rotor that comes to rest: an overshoot and its correction
NOISE = 10.0  # standard deviations: the range of 100,000 normal values is 9
SMALL = 0.02  # share of the largest value, added to the mean that a change is relative to

RECORDS = (
    "time_s", "speed_rad_s", "position_rad", "current_amplitude_a", "current_b_amplitude_a", "temperature_k",
    "load_position_rad",
)  # fmt: skip


def turning_points(position: Array, angle: float) -> int:
    """Return how often a position turns back by more than an angle, both in rad."""
    low = high = float(position[0])
    direction = count = 0
    for value in position.tolist():
        low, high = min(low, value), max(high, value)
        rises, falls = direction <= 0 and value > low + angle, direction >= 0 and value < high - angle
        if rises or falls:
            count += direction != 0
            direction, low, high = 1 if rises else -1, value, value
    return count


@dataclass(frozen=True, repr=False)
class ControlledRun(RunOverTime):
    """Samples and commands of a controller.

    Attributes:
        samples: arrays by the names of :data:`SAMPLES`, one value a sample; of the full motor without
            :data:`OF_AVERAGED`. They are what the sensors measure and the actuators set.
        records: arrays by the names of :data:`RECORDS`, between the samples, by ideal sensors.
        logs: what firmware logs at each sample, by its own names.
    """

    samples: Mapping[str, Array] = field(repr=False)
    records: Mapping[str, Array] = field(repr=False)
    logs: Mapping[str, Array] = field(repr=False)

    units = SAMPLES
    curves_name = "samples"
    speed_name = "speed_rad_s"

    def _doubts(self) -> Iterator[str]:
        seen, running = self.samples, self.provenance["run"]["start"] == "steady"
        if self.provenance["run"]["averaged"]:
            amplitude = np.maximum(np.abs(seen["voltage_a_v"]), np.abs(seen["voltage_b_v"]))
            yield from short_bursts(seen["time_s"], amplitude, float(seen["frequency_hz"].min()), running=running)
            yield from limit_cycle(seen["time_s"], seen["position_rad"], amplitude, self._still)
        yield from super()._doubts()

    @property
    def _still(self) -> float:
        """Angle in rad, of a slider in m, below which a change of the position is no motion."""
        run = self.provenance["run"]
        noise = NOISE * (run["electronics"] or {}).get("encoder_jitter_rad", 0.0)
        return float(max(2.0 * presliding(self.provenance["motor"]), 1.5 * run["resolution"]["position_rad"] + noise))

    def _hunts(self) -> Iterator[str]:
        """Yield whether the rotor turns back again and again in the second half of the time at the last set point."""
        time, position, reference = (self.samples[name] for name in ("time_s", "position_rad", "reference"))
        quantity = self.provenance["run"]["quantity"]
        if quantity in ("speed", "phase") or (quantity is None and not reference.any()):  # it need not rest
            return
        changes = np.flatnonzero(np.diff(reference))
        begin = ((int(changes[-1]) + 1 if changes.size else 0) + len(time)) // 2
        late = position[begin:]
        if (turns := turning_points(late, self._still)) > MOST_TURNS:
            yield (
                f"The rotor hunts: it turns back {turns} times after {time[begin]:.4g} s, between {late.min():.5g} rad "
                f"and {late.max():.5g} rad, at a constant set point. Give the controller a dead zone (of an encoder's "
                "step or more), or lower its gains."
            )

    def _limits(self) -> Iterator[str]:
        """Yield why the run is not trusted, and whether the rotor hunts."""
        yield from (*self._doubts(), *self._hunts())

    @property
    def _watched(self) -> dict[str, str]:
        quantity = self.provenance["run"]["quantity"] or "speed"
        heats = {"temperature": "temperature_k"} if self.samples["temperature_k"].any() else {}
        return {quantity: CONTROLLED[quantity], "electrical power": "electrical_power_w"} | heats

    @cached_property
    def to_come(self) -> dict[str, float | None]:
        """Relative further change of means of up to 20 samples if the run went on; by extrapolation.

        Given for the controlled quantity, or the speed; the electrical power; and the temperature of a stator that
        heats up. Each is relative to its mean plus a fiftieth of its largest value. ``None``: the run is too short.
        """
        found = {}
        for name in self._watched.values():
            values = self.samples[name]
            size = abs(self._mean(values)) + SMALL * float(np.abs(values).max()) + np.finfo(float).tiny
            share = change_to_come(self.samples["time_s"], values, self.provenance["run"]["sample_time_s"]) / size
            found[name] = float(share) if isfinite(share) else None
        return found

    @staticmethod
    def _mean(values: Array) -> float:
        """Return the mean of the last quarter of the samples."""
        return float(np.mean(values[-max(1, len(values) // 4) :]))

    @property
    def static_error(self) -> float | None:
        """Set point less controlled quantity, mean of the last quarter of the samples, in the unit of the quantity.

        ``None`` for a controller without the attribute ``quantity``.
        """
        quantity = self.provenance["run"]["quantity"]
        if quantity is None:
            return None
        error = self.samples["reference"] - self.samples[CONTROLLED[quantity]]
        return self._mean((error + 180.0) % 360.0 - 180.0 if quantity == "phase" else error)

    def summary(self) -> dict[str, str]:
        """Return the last sample, what has settled, the static error, and the error against the full motor."""
        found = {}
        for name, (unit, _) in SAMPLES.items():
            if name in self.samples and unit != "1":
                quantity = name.removesuffix("_" + unit.lower().replace("/", "_").replace("·", "_"))
                found[quantity.replace("_", " ")] = f"{self.samples[name][-1]:.4g} {unit}"
        found["settled"] = f"no: {self._moving}" if self._moving else "yes"
        if self.static_error is not None:
            name = CONTROLLED[self.provenance["run"]["quantity"]]
            found["static error"] = f"{self.static_error:.3g} {SAMPLES[name][0]}, mean of the last quarter"
        return self._localised(found | self._trust() | contact_row(self.provenance["run"]))

    def to_dict(self) -> dict[str, Any]:
        """Return the last sample and the settings, JSON-ready."""
        end = {name: float(values[-1]) for name, values in self.samples.items()}
        checked = [name for name in CHECKS if name in self.samples]
        greatest = {f"greatest_{name}": float(self.samples[name].max()) for name in checked}
        checks = self._entries("trusted", "error_estimate", "settled", "to_come", "static_error")
        return self._localised({"end": end, **checks, **greatest, **self.provenance, **self._entries("cautions")})
