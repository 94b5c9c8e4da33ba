# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a run of the averaged motor, and the estimate of its errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.drive import too_fast
from pyspice_runner.motor.parameters import Contact
from pyspice_runner.result import Audit, Result, contact_row
from pyspice_runner.run.dynamometer import GRAZING, STUCK, stuck
from pyspice_runner.run.waveforms import ROUNDING_RAD_S, SMALL_TORQUE, has_settled
from pyspice_runner.run.window import averaged_to_come

Array = NDArray[np.float64]
ROUNDING_W = 1e-9  # power of a motor without drive
SMALL_RISE_K = 1.0  # added to a temperature rise to which its change is taken
# estimated error up to which a run is trusted: parameters of a motor, and speeds of one, are hardly known better
TRUSTED = 0.02
# a burst of 20 periods turns a beam by 10 % less than the averaged motor at 70 V and by 4 % less at 110 V, one of 40 by
# 9 % more and 1 % less, one of 80 by 1 % more and 0.3 % less (docs/tracking.md)
FEWEST_PERIODS = 60
# an approach and a correction end with a stop each; a loop that stops more often with its drive on is in a limit cycle
MOST_STOPS = 2

COLUMNS: dict[str, tuple[str, str]] = {
    "time_s": ("s", "time"),
    "frequency_hz": ("Hz", "drive frequency"),
    "amplitude_a_v": ("V", "amplitude of the voltage of group A"),
    "amplitude_b_v": ("V", "amplitude of the voltage of group B"),
    "phase_deg": ("deg", "phase of group B ahead of group A"),
    "current_amplitude_a_a": ("A", "amplitude of the current into group A"),
    "current_amplitude_b_a": ("A", "amplitude of the current into group B"),
    "electrical_power_w": ("W", "real power into both groups"),
    "heat_w": ("W", "losses of the stator: dielectric and modal damping"),
    "contact_power_w": ("W", "power of the stator into the contact: friction loss and power on the rotor"),
    "tip_x_amplitude_m": ("m", "amplitude of the tip's fundamental, tangential"),
    "tip_y_amplitude_m": ("m", "amplitude of the tip's fundamental, towards the rotor"),
    "normal_force_n": ("N", "mean normal force"),
    "torque_n_m": ("N·m", "mean torque of the contact on the rotor"),
    "load_torque_n_m": ("N·m", "torque that the load draws"),
    "rotor_speed_rad_s": ("rad/s", "rotor speed"),
    "rotor_position_rad": ("rad", "angle of the rotor"),
    "separated": ("1", "share of the period in which the contact is open"),
    "slip": ("1", "share of the period in which the contact slips"),
    "temperature_k": ("K", "temperature of the stator above that at which its parameters hold"),
    "check": ("1", "motion at the harmonics that are left out, relative to static penetration and limit of stick"),
}


WORDS = {
    "torque_n_m": "torque", "force_n": "force", "rotor_speed_rad_s": "speed", "speed_m_s": "speed",
    "current_amplitude_a_a": "current of group A", "current_amplitude_b_a": "current of group B",
    "electrical_power_w": "power",
}  # fmt: skip


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated errors of an averaged run against the full motor, RMS over the run, by the names of its curves.

    Without arguments it describes a run of the full motor itself, which has no error.

    Attributes:
        errors: of torque, speed of a free shaft, amplitudes of both currents, and power; empty if unknown. Of a held
            shaft, and of one whose speed or position is controlled, they are those at its speed.
        shares: the same relative to the friction torque μ F₀ R, and to the maximum in the run.
        unknown: why the errors are not known.
    """

    errors: Mapping[str, float] = field(default_factory=dict)
    shares: Mapping[str, float] = field(default_factory=dict)
    unknown: str = ""

    @property
    def caution(self) -> str:
        """Why a run with this estimate is not trusted, empty if it is."""
        if self.unknown:
            return f"The error against the full motor is not known: {self.unknown}"
        if not (above := {name: share for name, share in self.shares.items() if share > TRUSTED}):
            return ""
        said = f"The estimated error against the full motor is above {100.0 * TRUSTED:g} %: {ErrorEstimate({}, above)}."
        return f"{said} Use the full motor, or more phases and harmonics where the analysis takes them."

    def __str__(self) -> str:
        """Return the shares, or that they are not known."""
        shares = [f"{WORDS[name]} {100.0 * share:.2g} %" for name, share in self.shares.items()]
        return "not known" if self.unknown else ", ".join(shares) or "none"


class Estimated:
    """A result with an estimate of its errors against the full motor, which its first use computes.

    It takes about 1 s, with eight contacts half a minute, and eight times the CPU time of the run, for
    ``error_estimate``, ``trusted``, ``cautions``, ``summary`` and ``to_dict``; curves and all else do not take it.
    """

    find_error: Callable[[], ErrorEstimate]

    @cached_property
    def error_estimate(self) -> ErrorEstimate:
        """Estimated error at the commands of the run, without any of the full motor itself."""
        return self.find_error()

    @property
    def trusted(self) -> bool:
        """Whether the estimated errors of torque, speed, currents and power are known and within 2 %.

        Short bursts of the drive, limit cycles through standstill, and a speed beyond the limit are not trusted either.
        """
        return not any(self._doubts())

    def _trust(self) -> dict[str, str]:
        """Return the rows of a summary about the errors."""
        return {"error against the full motor": str(self.error_estimate), "trusted": "yes" if self.trusted else "no"}

    def _doubts(self) -> Iterator[str]:
        """Yield why the result is not trusted."""
        if caution := self.error_estimate.caution:
            yield caution


@dataclass(frozen=True, repr=False)
class RunOverTime(Estimated, Result):
    """A run whose curves are attributes, with an estimate of its errors and a netlist on demand.

    Attributes:
        provenance: motor, drive and run settings, JSON-ready.
        write_deck: returns the netlist of the run, for ngspice; ``None`` if ngspice cannot run it.
        find_error: returns the estimate of the errors.
    """

    provenance: dict[str, Any] = field(repr=False)
    write_deck: Callable[[], str | None] = field(repr=False)
    find_error: Callable[[], ErrorEstimate] = field(repr=False)

    curves_name: ClassVar[str] = "curves"  # of the attribute with the arrays by their names
    speed_name: ClassVar[str] = "rotor_speed_rad_s"

    if TYPE_CHECKING:  # the curves are attributes

        def __getattr__(self, name: str) -> Array: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, self.curves_name, self._localised(self.columns()))
        self.__dict__.update(self.columns())

    def columns(self) -> Mapping[str, Array]:
        """Return the curves over time."""
        return cast("Mapping[str, Array]", getattr(self, self.curves_name))

    @cached_property
    def deck(self) -> str | None:  # type: ignore[override]
        """Netlist of the run, for ngspice, without a controller; ``None`` if ngspice cannot run it."""
        return self.write_deck()

    def _doubts(self) -> Iterator[str]:
        yield from too_fast(self.provenance["motor"], float(np.abs(self.columns()[self.speed_name]).max()))
        yield from super()._doubts()

    @property
    def _watched(self) -> dict[str, str]:
        """Curves that must settle, by their words in the table."""
        raise NotImplementedError

    @cached_property
    def to_come(self) -> dict[str, float | None]:
        """Relative further change of each of them if the run went on; by extrapolation. ``None``: too short."""
        raise NotImplementedError

    @property
    def settled(self) -> bool:
        """Whether these values stay within 2 % if the run goes on."""
        return not self._moving

    @property
    def _moving(self) -> str:
        """What has not settled, in words."""
        shares = {word: self.to_come[name] for word, name in self._watched.items()}
        return ", ".join(word for word, share in shares.items() if not has_settled(share))


@dataclass(frozen=True, repr=False)
class AveragedRun(RunOverTime):
    """A run of the averaged motor: means and amplitudes over time.

    The arrays share one time axis, which is not uniform.

    Attributes:
        curves: the arrays by the names of :data:`COLUMNS`; each is an attribute as well.
        energy_residual: energy into the stator that is not found as heat, in the modes, in the plates or in the
            contact, relative to the energy put in.
        solver_seconds: wall time that the engine took.
        ngspice_version: version of ngspice; ``None`` of a run with the compiled motor.
        audit: the power balance.
    """

    curves: Mapping[str, Array] = field(repr=False)
    energy_residual: float
    solver_seconds: float
    ngspice_version: str | None
    audit: Audit = field(default_factory=Audit)

    units = COLUMNS

    def _doubts(self) -> Iterator[str]:
        amplitude = np.maximum(self.curves["amplitude_a_v"], self.curves["amplitude_b_v"])
        yield from short_bursts(self.curves["time_s"], amplitude, float(self.curves["frequency_hz"].min()))
        yield from super()._doubts()

    def _limits(self) -> Iterator[str]:
        """Yield why the run is not trusted; whether friction holds a held shaft at the end."""
        end = {name: float(self.curves[name][-1]) for name in ("slip", "separated")}
        run = self.provenance["run"]
        yield from self._doubts()
        if run["speed_rad_s"] is not None and stuck(end, max(GRAZING, 1.0 / run["phases"])):
            yield f"{STUCK} The interval of torques is in the result of steady_state."
        yield from self.provenance["cautions"]

    @property
    def _watched(self) -> dict[str, str]:
        free = self.provenance["run"]["speed_rad_s"] is None
        found = {"speed": "rotor_speed_rad_s"} if free else {"torque": "torque_n_m"}
        found |= {"electrical power": "electrical_power_w"}
        return found | ({"temperature": "temperature_k"} if self.curves["temperature_k"].any() else {})

    @cached_property
    def to_come(self) -> dict[str, float | None]:
        """By how much values at the end would still change if the run went on, relative; by extrapolation.

        Speed, of a held shaft torque, electrical power, and the temperature of a stator that heats up; torque plus a
        fiftieth of what friction can transmit, temperature rise plus 1 K. ``None``: too short to judge.
        """
        motor = self.provenance["motor"]
        contact, radius = motor["contact"], 1.0 if self.linear else motor["rotor"]["radius_m"]
        least = {
            "rotor_speed_rad_s": ROUNDING_RAD_S, "electrical_power_w": ROUNDING_W, "temperature_k": SMALL_RISE_K,
            "torque_n_m": SMALL_TORQUE * radius * contact["friction"] * contact["preload_n"],
        }  # fmt: skip
        found = {}
        for name in self._watched.values():
            values = self.curves[name]
            share = averaged_to_come(self.curves["time_s"], values) / (abs(float(values[-1])) + least[name])
            found[name] = share if isfinite(share) else None
        return found

    def summary(self) -> dict[str, str]:
        """Return the most important values at the end of the run."""
        last = {name: float(values[-1]) for name, values in self.curves.items()}
        return self._localised({
            "speed": f"{last['rotor_speed_rad_s']:.4g} rad/s",
            "torque": f"{last['torque_n_m']:.4g} N·m",
            "duration": f"{last['time_s']:.4g} s",
            "settled": f"no: {self._moving}" if self._moving else "yes",
            **self._trust(),
            **contact_row(self.provenance["run"]),
            "electrical power": f"{last['electrical_power_w']:.4g} W",
            "temperature rise": f"{last['temperature_k']:.4g} K",
        })  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the values at the end, JSON-ready, with the keys of ``simulate`` and those of the averaged model."""
        last = {name: float(values[-1]) for name, values in self.curves.items()}
        return self._localised({
            "mean_rotor_speed_rad_s": last["rotor_speed_rad_s"],
            "mean_torque_n_m": last["torque_n_m"],
            "state_fractions": {
                "separated": last["separated"],
                "stick": max(0.0, 1.0 - last["separated"] - last["slip"]),
                "slip": last["slip"],
            },
            **self._entries("energy_residual", "trusted", "error_estimate", "settled", "to_come"),
            "greatest_check": float(self.curves["check"].max()),
            "greatest_separated": float(self.curves["separated"].max()),
            "end": last,
            "points": len(self.curves["time_s"]),
            **self._entries("solver_seconds", "ngspice_version", "audit"),
            **self.provenance,
            **self._entries("cautions"),  # in place of those of the operating point alone
        })  # fmt: skip


# --- where a run is not what the full motor does sample by sample: short bursts, and cycles of stopping ---


def short_bursts(
    time: NDArray[np.float64], amplitude: NDArray[np.float64], frequency: float, *, running: bool = False
) -> tuple[str, ...]:
    """Return a caution for the shortest burst of a drive, if it is too short for the averaged motor.

    ``amplitude`` in V is the greater one of both groups at the times in s, ``frequency`` in Hz that of the drive. A
    burst begins and ends without voltage; of a motor that is ``running``, the start of the run begins none.
    """
    on = np.concatenate([[running], amplitude != 0.0])
    begins = np.flatnonzero(~on[:-1] & on[1:])
    ends = np.flatnonzero(on[:-1] & ~on[1:])
    # the last burst of a run may have no end
    lengths = [(time[ends[ends > begin][0]] - time[begin], time[begin]) for begin in begins if (ends > begin).any()]
    if not lengths or min(lengths)[0] * frequency >= FEWEST_PERIODS:
        return ()
    length, begin = min(lengths)
    caution = (
        f"The drive is on for {length * frequency:.3g} periods only, from {begin:.4g} s on. The averaged motor leaves "
        f"out free oscillations of the first periods: below {FEWEST_PERIODS} periods the angle of a burst may be off "
        "by a tenth. Use the full motor."
    )
    return (caution,)


def presliding(motor: Mapping[str, Any]) -> float:
    """Return the angle in rad by which the contact gives way before it slips, of a motor as of ``to_dict``.

    With a slider it is the distance in m. Of several contacts it is that of one point with an equal share.
    """
    parts = [place.get("multiplicity", 1) * place.get("part", 1.0) for place in motor.get("contacts", ())]
    points = sum(parts) or 1
    contact = Contact(**motor["contact"] | {"preload_n": motor["contact"]["preload_n"] / points})
    limit = contact_law.limit_ratio(contact) * contact_law.static_penetration(contact)
    limit += contact.tangential_series_compliance_m_per_n * contact.friction * contact.preload_n
    return float(limit if "slider" in motor else limit / motor["rotor"]["radius_m"])


def limit_cycle(
    time: NDArray[np.float64], position: NDArray[np.float64], amplitude: NDArray[np.float64], angle: float
) -> tuple[str, ...]:
    """Return a caution for a rotor that stops and starts again and again with its drive on.

    ``position`` in rad at the times in s, ``amplitude`` in V from each of them on. A rotor that moves by less than
    ``angle``, rad, from one sample to the next stands: without slip the contact gives way by twice its pre-sliding.
    """
    moves = np.abs(np.diff(position)) > angle
    stops = np.flatnonzero(moves[:-1] & ~moves[1:] & (amplitude[1:-1] > 0.0)) + 2
    if stops.size <= MOST_STOPS:
        return ()
    caution = (
        f"The rotor stops {stops.size} times with its drive on, from {time[stops[0]]:.4g} s on: a limit cycle through "
        "standstill, in which a small error shifts all later samples. Compensate the dead band, or lower the gains."
    )
    return (caution,)
