# SPDX-License-Identifier: GPL-3.0-or-later
"""A design of a driver: its parts, what they bear, and the steady states from stall to no load that check it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pyspice_runner.drivers.driver import Driver
from pyspice_runner.drivers.maxima import PartLoad, exceeded
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.strength import depolarised

STALL, OPERATING, IDLE = "stall", "operating point", "no load"  # states of the range
WARM = "operating point, warm"  # the motor at its temperature, the frequency following its drift
STANDS = 1e-3  # rad/s, speed below which a motor does not turn
ARRIVED = 0.9  # of the speed of the operating point, from which on a motor has reached it
BEGUN = 0.02  # of that speed, from which on a motor turns and is no longer in the first slips of its start


@dataclass(frozen=True)
class GroupPoint:
    """One group in a steady state: fundamentals at its pin."""

    voltage_v: float  # amplitude
    current_a: float  # amplitude of the current into the pin
    resistance_ohm: float  # real part of the impedance at the pin
    reactance_ohm: float  # imaginary part of that impedance
    power_factor: float  # of the fundamentals at the output of the stage; negative where power flows back


@dataclass(frozen=True)
class RangePoint:
    """A steady state of the range of operation."""

    state: str  # stall, operating point or no load
    speed_rad_s: float
    torque_n_m: float  # mean torque of the contact on the rotor
    power_w: float  # real power into both groups
    # real power of the fundamentals of both stages, their resistance included; without a driver that of the pins
    stage_power_w: float
    power_factor: float  # real over apparent power of both stages, of the fundamentals
    a: GroupPoint
    b: GroupPoint

    def group(self, name: str) -> GroupPoint:
        """Return group ``"a"`` or ``"b"``."""
        return self.a if name == "a" else self.b


@dataclass(frozen=True)
class Design:
    """A driver with network, transformer and rails for a motor.

    Attributes:
        driver: the driver with its parts; ``None`` if there is none.
        wanted_v: group → amplitude wanted at its pin.
        unmatched: the range with the wanted voltages at the pins; the power factor is that of the pins.
        points: the range with the network, behind the fundamental of the stage.
        share: part of the reactance at the operating point that the network cancels, by its design.
        parts: the parts and what each must bear in the range; with a run the larger of both.
        feasible: whether everything was simulated and within its limits.
        reason: why it is not feasible and what can be done, or the explanation of the network.
        starts: whether the motor started from rest behind the driver; ``None`` if that was not simulated.
    """

    driver: Driver | None
    wanted_v: dict[str, float]
    unmatched: tuple[RangePoint, ...] = ()
    points: tuple[RangePoint, ...] = ()
    share: float = 0.0
    parts: tuple[PartLoad, ...] = ()
    feasible: bool = False
    reason: str = ""
    starts: bool | None = None
    load_torque_n_m: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return the design without the driver, which its report has, JSON-ready."""
        names = ("parts", "feasible", "reason", "starts", "wanted_v", "share", "unmatched", "points")
        found = {name: getattr(self, name) for name in names}
        found["parts"] = [part.__dict__ for part in self.parts]
        for name in ("unmatched", "points"):
            found[name] = [{**point.__dict__, "a": point.a.__dict__, "b": point.b.__dict__} for point in found[name]]
        return found

    def ran(
        self, runs: Sequence[Sequence[PartLoad]], speed_rad_s: float | None, volts: Mapping[str, float], motor: Motor
    ) -> Design:
        """Return the design after runs from rest.

        Args:
            runs: the parts with their maxima over each run.
            speed_rad_s: mean speed at the end of the first one; ``None`` for a held shaft.
            volts: group → greatest voltage at its pin.
            motor: the motor.
        """
        assert self.driver is not None
        both = tuple(runs[0])
        for others in (self.parts, *runs[1:]):
            both = tuple(_larger(one, other) for one, other in zip(both, _matched(others, both), strict=True))
        starts = None if speed_rad_s is None else self._starts(speed_rad_s)
        told = [*exceeded(both, self.driver), *depolarised(motor, volts)]
        if starts is False:
            told.append(f"The motor does not start: it turns at {speed_rad_s:.3g} rad/s at the end of the run.")
        feasible = self.feasible and not told
        reason = self.reason if feasible else " ".join([*([] if self.feasible else [self.reason]), *told])
        return replace(self, parts=both, feasible=feasible, reason=reason, starts=starts)

    def _starts(self, speed_rad_s: float) -> bool:
        """Return whether a motor that has reached a speed comes to its operating point.

        It has, or it turns towards it and the torque of the steady states beyond its speed accelerates it on.
        """
        target = next(point for point in self.points or self.unmatched if point.state == OPERATING)
        if abs(target.speed_rad_s) < STANDS:
            return True
        reached = speed_rad_s / target.speed_rad_s
        sign = 1.0 if target.speed_rad_s > 0.0 else -1.0
        ahead = [point for point in self.points if point.speed_rad_s / target.speed_rad_s < 1.0]
        spare = [sign * (point.torque_n_m - self.load_torque_n_m) > 0.0 for point in ahead]
        return reached >= ARRIVED or (reached >= BEGUN and bool(spare) and all(spare))


def _matched(known: Sequence[PartLoad], parts: Sequence[PartLoad]) -> list[PartLoad | None]:
    """Return for each part the one of the same name among those that are known."""
    named = {part.name: part for part in known}
    return [named.get(part.name) for part in parts]


def _larger(one: PartLoad, other: PartLoad | None) -> PartLoad:
    """Return a part with the larger voltage and current of two."""
    if other is None:
        return one
    return replace(
        one,
        peak_voltage_v=_greater(one.peak_voltage_v, other.peak_voltage_v),
        peak_current_a=_greater(one.peak_current_a, other.peak_current_a),
    )


def _greater(one: float | None, other: float | None) -> float | None:
    """Return the greater of two values that are known."""
    return max((value for value in (one, other) if value is not None), default=None)
