# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a run of the averaged motor, its own check, and where it differs from the full motor."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
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
TRUSTED_CHECK, TRUSTED_OPEN = 0.02, 0.0
MOST_FACTOR = 4.0  # of the normal force by its damping, in piezomotor_averaged_phase.lib
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


@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated errors of an averaged run against the full motor, RMS over the run, by the names of its curves.

    Attributes:
        errors: of torque (at the speed of the run), speed, amplitudes of both currents, and power; empty if unknown.
        shares: the same relative to the friction torque μ F₀ R, and to the maximum in the run.
        unknown: why the errors are not known.
    """

    errors: Mapping[str, float]
    shares: Mapping[str, float]
    unknown: str = ""


@dataclass(frozen=True, repr=False)
class RunOverTime(Result):
    """A run whose curves are attributes, with the model's own check and a netlist on demand.

    Attributes:
        provenance: motor, drive and run settings, JSON-ready.
        write_deck: returns the netlist of the run, for ngspice; ``None`` if ngspice cannot run it.
    """

    provenance: dict[str, Any] = field(repr=False)
    write_deck: Callable[[], str | None] = field(repr=False)

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

    @property
    def trusted(self) -> bool:
        """Whether the averaged model's own check passes throughout the run, and the rotor keeps its limit of speed.

        The check passes where the harmonics of the model are enough, the contact stays closed, damping multiplies
        the normal force by 4 at most, and the drive has no burst below 60 periods. Where it does not, speed and torque
        may be off by more than 2 % of the friction torque μ F₀ R. The full motor has no such check.
        """
        return not (self._model_cautions or self._too_fast)

    @property
    def _model_cautions(self) -> tuple[str, ...]:
        raise NotImplementedError

    @property
    def _too_fast(self) -> tuple[str, ...]:
        return too_fast(self.provenance["motor"], float(np.abs(self.columns()[self.speed_name]).max()))

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
        check_stability: returns cautions where the full motor is not stable at the end; called for ``cautions``.
    """

    curves: Mapping[str, Array] = field(repr=False)
    energy_residual: float
    solver_seconds: float
    ngspice_version: str | None
    audit: Audit = field(default_factory=Audit)
    check_stability: Callable[[], tuple[str, ...]] = field(default=tuple, repr=False)
    find_error: Callable[[], ErrorEstimate] = field(
        default=partial(ErrorEstimate, {}, {}, "It was not estimated."), repr=False
    )

    units = COLUMNS

    @cached_property
    def error_estimate(self) -> ErrorEstimate:
        """Estimated error against the full motor, by its steady states at operating points of the run.

        It is computed when first asked for: in about 1 s, or up to 20 s where the contact sticks throughout.
        """
        return self.find_error()

    @cached_property
    def _stability_cautions(self) -> tuple[str, ...]:
        return self.check_stability()

    @property
    def _model_cautions(self) -> tuple[str, ...]:
        amplitude = np.maximum(self.curves["amplitude_a_v"], self.curves["amplitude_b_v"])
        bursts = short_bursts(self.curves["time_s"], amplitude, float(self.curves["frequency_hz"].min()))
        return (*cautions_over_time(self.provenance["motor"], self.curves), *bursts)

    def _limits(self) -> Iterator[str]:
        """Yield the findings of the model's own check; whether friction holds a held shaft at the end."""
        end = {name: float(self.curves[name][-1]) for name in ("slip", "separated")}
        run = self.provenance["run"]
        yield from self._model_cautions
        if run["speed_rad_s"] is not None and stuck(end, max(GRAZING, 1.0 / run["phases"])):
            yield f"{STUCK} The interval of torques is in the result of steady_state."
        yield from self._stability_cautions
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
            "check": "passed" if self.trusted else "not passed",
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
            **self._entries("energy_residual", "trusted", "settled", "to_come"),
            "greatest_check": float(self.curves["check"].max()),
            "greatest_separated": float(self.curves["separated"].max()),
            "end": last,
            "points": len(self.curves["time_s"]),
            **self._entries("solver_seconds", "ngspice_version", "audit"),
            **self.provenance,
            **self._entries("cautions"),  # in place of those of the operating point alone
        })  # fmt: skip


def cautions_over_time(motor: Mapping[str, Any], curves: Mapping[str, Array]) -> tuple[str, ...]:
    """Return :func:`model_cautions` of a run with the curves of :data:`COLUMNS`, of a motor as of ``to_dict``."""
    check, opened = (float(curves[name].max()) for name in ("check", "separated"))
    damping = contact_law.normal_damping(Contact(**motor["contact"]))
    fastest = float(np.max(2.0 * np.pi * curves["frequency_hz"] * curves["tip_y_amplitude_m"]))
    return model_cautions(check, opened, 1.0 + damping * fastest)


def model_cautions(check: float, opened: float, factor: float = 1.0) -> tuple[str, ...]:
    """Return the cautions for the largest check value, open share, and factor of the normal force by its damping."""
    found = []
    if check > TRUSTED_CHECK:
        found.append(
            f"The motion that the averaged model leaves out moves the tip by {check:.2g} of its static penetration "
            f"or limit of stick; up to {TRUSTED_CHECK:g} is accurate. Give more harmonics, or use the full motor."
        )
    if opened > TRUSTED_OPEN:
        found.append(
            f"The contact is open for up to {100.0 * opened:.3g} % of the period, where the averaged model is less "
            "accurate. Compare with the full motor, or give more phases and harmonics."
        )
    if factor > MOST_FACTOR:
        found.append(
            f"Damping along the normal multiplies the normal force by up to {factor:.3g}; the averaged model limits "
            f"this factor to {MOST_FACTOR:g}, so that its forces are too small. Use the full motor."
        )
    return tuple(found)


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

    With a slider it is the distance in m.
    """
    contact = Contact(**motor["contact"])
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
