# SPDX-License-Identifier: GPL-3.0-or-later
"""Waveforms of one run, with their means, state fractions, energy balance and files."""

from __future__ import annotations

from cmath import phase
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from math import degrees, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.state import Motion
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.contacts import Touching
from pyspice_runner.motor.motor import Motor
from pyspice_runner.result import Audit, Result, contact_row
from pyspice_runner.run.window import Window, change_to_come
from pyspice_runner.units import engineering, unit_in

Array = NDArray[np.float64]
# The balance of a smooth motion closes to 0.3 % at 16 points per period, to 0.01 % at the default step; a greater
# residual is not an error of the step.
ENERGY_BOUND = 0.01
USUAL_ACCURACY = 0.01  # limit of the error of tip and mean speed for a run without a given accuracy
SETTLED = 0.02  # expected further relative change below which a mean is settled
SMALL_TORQUE = 0.02  # of the friction limit; below, a change of the mean torque is noise
ROUNDING_RAD_S = 1e-6  # speed error of a rotor at rest by the tolerance of Newton's iteration
NODES = 6  # of the interpolating polynomial: the error is of the order of a cubic spline's at 12 points a period

COLUMNS: dict[str, tuple[str, str]] = {
    "time_s": ("s", "time"),
    "voltage_a_v": ("V", "voltage of group A"),
    "voltage_b_v": ("V", "voltage of group B"),
    "current_a_a": ("A", "current into group A"),
    "current_b_a": ("A", "current into group B"),
    "tip_x_m": ("m", "tip displacement, tangential"),
    "tip_y_m": ("m", "tip displacement towards the rotor"),
    "normal_force_n": ("N", "normal contact force, positive when pressed"),
    "friction_force_n": ("N", "friction force, positive where it drives the rotor forward"),
    "contact_displacement_m": ("m", "displacement of the tangential spring"),
    "contact_state": ("1", "0 separated, 1 stick, 2 slip; between them the part of a brush that slips"),
    "rotor_speed_rad_s": ("rad/s", "rotor speed"),
}
OF_TRANSDUCER = {  # beside time, voltages, currents, and of a known face tip_y_m
    "motional_current_a_a": ("A", "motional current of group A, that of its modes"),
    "motional_current_b_a": ("A", "motional current of group B"),
}
OF_SEVERAL = {  # of each of several contacts, by its nodes: name of the column, unit and meaning
    "normal": ("normal_force", "N", "normal force of the contact"),
    "friction": ("friction_force", "N", "friction force of the contact"),
    "state": ("contact_state", "", "0 separated, 1 stick, 2 slip of the contact"),
}
SENSED = {"feedback_v": ("V", "voltage of the feedback electrode")}
HEATED = {"temperature_k": ("K", "temperature of a heated motor, above that at which its parameters hold")}


def column_of_contact(node: str, name: str) -> str:
    """Return the name of the column of one of several contacts, such as ``normal_force_left_n``."""
    quantity, unit, _ = OF_SEVERAL[node]
    return "_".join(filter(None, (quantity, name, unit.lower())))


def force_columns(motor: Motor, one: Touching) -> tuple[str, str]:
    """Return the columns of the normal and the friction force of a contact, the only one or one of several."""
    if motor.contacts:
        return column_of_contact("normal", one.name), column_of_contact("friction", one.name)
    return "normal_force_n", "friction_force_n"


@dataclass(frozen=True)
class EnergyBalance:
    """Energy balance of a run in J: electrical = sum of dielectric to drift + missing."""

    electrical: float  # delivered through the pins
    dielectric: float  # stored in the clamped capacitances (change) and lost in their loss resistance
    kinetic: float  # change of the modes' kinetic energy
    elastic: float  # change of the modes' elastic energy
    damping: float  # lost in the modes' damping
    contact_elastic: float  # change of the elastic energy of the Hertz contact and of the compliance in series with it
    contact_damping: float  # lost along the normal, where the coefficient of restitution is below 1
    friction: float  # absorbed by the tangential contact: slip loss and energy of its spring
    mount: float  # change of the carrier's kinetic and elastic energy, less the work of the preload
    mount_damping: float  # lost in the damping of the mount
    rotor: float  # change of the rotor's kinetic energy
    bearing: float  # lost in the bearing
    load: float  # work done on the load, or on the grip that holds the shaft
    drift: float  # work against the drift of a heated motor's stiffness
    passed: float  # largest energy that passed through the pins in either direction, and input of a driven shaft
    rounding: float  # error of the energy of the preload by the tolerance of Newton's iteration

    @property
    def missing(self) -> float:
        """Energy supplied less energy found, J."""
        beside = ("electrical", "passed", "rounding")
        found: float = sum(getattr(self, item.name) for item in fields(self) if item.name not in beside)
        return self.electrical - found

    @property
    def residual(self) -> float:
        """Missing energy over passed energy; finite, since the rounding error counts as passed.

        At the end of a run the sources may have taken more energy than they delivered. The largest energy passed is a
        valid scale in that case, too.
        """
        scale = self.passed + self.rounding / ENERGY_BOUND
        return abs(self.missing) / scale if scale > 0.0 else 0.0


class NotRecordedError(AttributeError, ParameterError):
    """A column that was not recorded."""


def _absent() -> Any:
    return None


@dataclass(frozen=True, repr=False)
class Waveforms(Result):
    """One verified run. The arrays share one time axis, uniform but for the first few steps and the last, shorter ones.

    Access to a signal that was not recorded raises :class:`NotRecordedError`.

    Attributes:
        energy: the energy balance from the first recorded point; it requires all signals at every step.
        of_contacts: of a motor with several contacts the forces and the state of each, by column. The normal force is
            then that of all, the friction force at the radius of the rotor, and ``tip_x_m``, ``tip_y_m``,
            ``contact_displacement_m`` and ``contact_state`` are those of the first.
        drive_period_s: period of the drive, over which means are taken.
        rotor_radius_m: radius at the contact, which turns friction force into torque.
        decay_s: time in which the slowest free mode, or the carrier on its mount, decays by e.
        solver_seconds: wall time that ngspice took.
        ngspice_version: version of ngspice.
        provenance: motor, drive, run settings and hash of the deck, JSON-ready.
        deck: the netlist that was run.
        temperature_k: only for a motor heated by its losses.
        feedback_v: only for a motor with a feedback electrode.
        motional_current_a_a, motional_current_b_a: only for a transducer; ``tip_y_m`` is then the motion of its face.
        final_state: the motion at the end, from which a run can continue, if all signals were recorded.
        error_estimate: estimated error of the tip's trajectory, RMS relative to its motion; ``None`` for a run with a
            given step.
        speed_error_rad_s: estimated error of the mean rotor speed.
        torque_error_n_m: estimated error of the mean torque.
        complete: whether the run reached its end; false for an interrupted run.
        periodic: whether it is one period of a steady state, which repeats.
    """

    time_s: Array
    voltage_a_v: Array
    voltage_b_v: Array
    current_a_a: Array
    current_b_a: Array
    tip_x_m: Array
    tip_y_m: Array
    normal_force_n: Array
    friction_force_n: Array
    contact_displacement_m: Array
    contact_state: Array
    rotor_speed_rad_s: Array
    temperature_k: Array
    energy: EnergyBalance
    drive_period_s: float
    rotor_radius_m: float
    decay_s: float
    solver_seconds: float
    ngspice_version: str
    provenance: dict[str, Any] = field(repr=False)
    deck: str = field(repr=False)
    final_state: Motion | None = field(default=None, repr=False)
    error_estimate: float | None = None
    speed_error_rad_s: float | None = None
    torque_error_n_m: float | None = None
    complete: bool = True
    periodic: bool = False
    motional_current_a_a: Array = field(default_factory=_absent)
    motional_current_b_a: Array = field(default_factory=_absent)

    feedback_v: Array = field(default_factory=_absent)
    of_contacts: Mapping[str, Array] = field(default_factory=dict, repr=False)

    units = COLUMNS | SENSED | HEATED | OF_TRANSDUCER

    def __post_init__(self) -> None:
        for name in (*self.units, "energy"):
            if getattr(self, name) is None:
                object.__delattr__(self, name)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name in self.units:
                raise NotRecordedError(f"{name} was not recorded in this run; name it among the signals of simulate.")
            if name == "energy":
                raise NotRecordedError("An energy balance takes all signals at every step, as simulate records them.")
            return super().__getattr__(name)

    @property
    def recorded(self) -> list[str]:
        """Names of the columns that are there."""
        return [name for name in self.units if hasattr(self, name)]

    @property
    def points(self) -> int:
        """Number of time points."""
        return len(self.time_s)

    @property
    def energy_residual(self) -> float:
        """Relative residual of the energy balance, see :attr:`EnergyBalance.residual`."""
        return self.energy.residual

    @property
    def mean_rotor_speed_rad_s(self) -> float:
        """Rotor speed averaged over the last whole drive periods, rad/s."""
        return self.mean(self.rotor_speed_rad_s)

    @property
    def mean_torque_n_m(self) -> float:
        """Torque of the contact on the rotor, R·F_T, averaged over the last whole drive periods, N·m."""
        return self.rotor_radius_m * self.mean(self.friction_force_n)

    @property
    def state_fractions(self) -> dict[str, float]:
        """Fractions of time separated, stick and slip over the last whole drive periods; they add up to 1.

        Of several contacts they are the mean. A brush counts as slip where more than half of its width slips.
        """
        several = [states for name, states in self.of_contacts.items() if name.startswith("contact_state")]
        each = [self._fractions(states) for states in several or [self.contact_state]]
        return {name: sum(one[name] for one in each) / len(each) for name in each[0]}

    def _fractions(self, contact_state: Array) -> dict[str, float]:
        """Return the fractions of one contact."""
        points = self.window()
        steps = np.diff(self.time_s[points])
        states = np.rint(contact_state[points])
        before, after = states[:-1], states[1:]
        # A change happens in mid-step on average. The end of a slip, though, shows half a step late: the slider's
        # excess over its limit, by which slip is detected, follows the relative velocity in the middle of the step.
        late = (before == 2) & (after == 1)
        held_before = steps * np.where(late, 0.0, 0.5)
        held_after = steps - held_before
        return {
            name: float((held_before[before == code].sum() + held_after[after == code].sum()) / steps.sum())
            for code, name in enumerate(("separated", "stick", "slip"))
        }

    @property
    def speed_m_s(self) -> Array:
        """Speed of the slider, or of the rotor's rim, m/s."""
        return self.rotor_radius_m * self.rotor_speed_rad_s

    @property
    def force_n(self) -> float:
        """Force of the contact on the slider, or on the rotor's rim, averaged over the last whole drive periods, N."""
        return self.mean(self.friction_force_n)

    def window(self) -> slice:
        """Return the points of the last whole drive periods (:class:`.Window`)."""
        return self._window.points

    def mean(self, signal: Array) -> float:
        """Return the time average of a signal over the last whole drive periods."""
        return self._window.mean(signal)

    @cached_property
    def _window(self) -> Window:
        return Window(self.time_s, self.drive_period_s)

    def to_dict(self) -> dict[str, Any]:
        """Return the summary of the run, JSON-ready; ``None`` stands for what was not recorded."""

        def known(column: str, quantity: str) -> Any:
            return getattr(self, quantity) if hasattr(self, column) else None

        beside = {
            **self._entries("accurate", "settled", "to_come", "complete"),
            **self._entries("points", "solver_seconds", "ngspice_version"),
            **self.provenance,
            "cautions": list(self.cautions),
        }
        if self.of_transducer:
            energy = asdict(self.energy) if hasattr(self, "energy") else None
            balance = {"energy_residual": known("energy", "energy_residual"), "energy_j": energy}
            return {**self.electrical(), **balance, "error_estimate": self.error_estimate, **beside}
        return self._localised({
            "mean_rotor_speed_rad_s": known("rotor_speed_rad_s", "mean_rotor_speed_rad_s"),
            "mean_torque_n_m": known("friction_force_n", "mean_torque_n_m"),
            **self.sensed(),
            "state_fractions": known("contact_state", "state_fractions"),
            "energy_residual": known("energy", "energy_residual"),
            "energy_j": asdict(self.energy) if hasattr(self, "energy") else None,
            "error_estimate": self.error_estimate,
            "mean_rotor_speed_error_rad_s": self.speed_error_rad_s,
            "mean_torque_error_n_m": self.torque_error_n_m,
            **beside,
        })  # fmt: skip

    @property
    def of_transducer(self) -> bool:
        """Whether it is a run of a transducer, which has no contact."""
        return "contact" not in self.provenance["motor"]

    def electrical(self) -> dict[str, float | None]:
        """Return power, power factor, RMS voltages and currents, and amplitudes over the last whole drive periods.

        The amplitudes are those of the motional currents in A and, where its motion is known, of the face in m, at the
        drive's frequency. What was not recorded is left out.
        """
        found: dict[str, float | None] = {}
        real = apparent = 0.0
        for group in ("a", "b"):
            volts, amperes = (
                getattr(self, f"{name}_{group}_{unit}", None) for name, unit in (("voltage", "v"), ("current", "a"))
            )
            if volts is None or amperes is None:
                continue
            power, rms_v, rms_a = self.mean(volts * amperes), self._window.rms(volts), self._window.rms(amperes)
            real, apparent = real + power, apparent + rms_v * rms_a
            found |= {f"voltage_{group}_rms_v": rms_v, f"current_{group}_rms_a": rms_a, f"power_{group}_w": power}
        if found:
            found |= {"power_w": real, "power_factor": real / apparent if apparent else None}
        for column, name in {**dict.fromkeys(OF_TRANSDUCER), "tip_y_m": "amplitude_m"}.items():
            if hasattr(self, column):
                name = name or column.replace("current_", "current_amplitude_", 1)
                found[name] = float(abs(self._window.harmonics(getattr(self, column))[0]))
        return found

    def sensed(self) -> dict[str, float]:
        """Return amplitude in V, and phase in degrees ahead of the voltage of group A, of a feedback electrode.

        They are at the drive's frequency over the last whole drive periods. What was not recorded is left out.
        """
        if not hasattr(self, "feedback_v"):
            return {}
        volts = complex(self._window.harmonics(self.feedback_v)[0])
        found = {"feedback_amplitude_v": abs(volts)}
        if hasattr(self, "voltage_a_v"):
            ahead = volts * complex(self._window.harmonics(self.voltage_a_v)[0]).conjugate()
            found["feedback_phase_deg"] = degrees(phase(ahead))
        return found

    def columns(self) -> dict[str, Array]:
        """Return the recorded signals by name, the time first."""
        return self._localised({**{name: getattr(self, name) for name in self.recorded}, **self.of_contacts})

    @property
    def audit(self) -> Audit:  # type: ignore[override]
        """The outcome of the physical audit; it takes all signals at every step."""
        found = self.provenance["audit"]
        return Audit(tuple(found["findings"]), done=found["passed"] is not None)

    def _limits(self) -> Iterator[str]:
        """Yield whether the run is inaccurate or interrupted, and the cautions of the motor."""
        if self.accurate is False:
            step = 0.5 * self.provenance["run"]["step_s"]
            yield f"{self._inaccuracy} Compare with a run with step = {step:.3g}."
        if not self.complete:
            yield "The run did not reach its end."
        yield from self.provenance.get("cautions", ())

    @property
    def accuracy(self) -> float:
        """Limit of the error: the requested accuracy, or 1 %."""
        return float(self.provenance["run"]["accuracy"] or USUAL_ACCURACY)

    @property
    def accurate(self) -> bool | None:
        """Whether the estimated errors of tip and mean rotor speed are allowed; ``None`` without an estimate."""
        return None if self.error_estimate is None else not self._inaccuracy

    @property
    def _inaccuracy(self) -> str:
        """What is not accurate, in a sentence; an empty text if all is."""
        found = []
        if self.error_estimate is not None and self.error_estimate > self.accuracy:
            found.append(f"the tip's motion, {100.0 * self.error_estimate:.2g} %")
        if self.speed_error_rad_s is not None and self._free:
            mean = abs(self.mean_rotor_speed_rad_s)
            if self.speed_error_rad_s > max(self.accuracy, USUAL_ACCURACY) * mean + self._still:
                found.append(f"the mean rotor speed, {self.speed_error_rad_s:.2g} rad/s")
        return f"The estimated error exceeds {100.0 * self.accuracy:.3g} %: {' and '.join(found)}." if found else ""

    @property
    def _free(self) -> bool:
        """Whether the shaft is not held at a speed."""
        return self.provenance["run"]["speed_rad_s"] is None

    @property
    def _still(self) -> float:
        """Speed in rad/s below which a change counts for nothing: a thousandth of the largest, or rounding."""
        return 1e-3 * USUAL_ACCURACY * float(np.abs(self.rotor_speed_rad_s).max()) + ROUNDING_RAD_S

    @cached_property
    def to_come(self) -> dict[str, float | None]:
        """By how much each mean would still change if the run went on, relative (:func:`.window.change_to_come`).

        The torque is taken relative to itself and a fiftieth of what friction can transmit: of a small torque the rest
        is noise. A value is ``None`` where the run is too short to judge. Nothing changes in a steady state.
        """
        found: dict[str, float] = {}
        if self.of_transducer and hasattr(self, "voltage_a_v") and hasattr(self, "current_a_a"):
            power = self.voltage_a_v * self.current_a_a
            apparent = self._window.rms(self.voltage_a_v) * self._window.rms(self.current_a_a)
            found["power"] = self._change_to_come(power) / max(abs(self.mean(power)), SMALL_TORQUE * apparent, 1e-300)
        if hasattr(self, "rotor_speed_rad_s") and self._free:
            change = self._change_to_come(self.rotor_speed_rad_s)
            scale = abs(self.mean_rotor_speed_rad_s) + self._still / USUAL_ACCURACY
            found["mean_rotor_speed_rad_s"] = change / scale
        if hasattr(self, "friction_force_n"):
            change = self.rotor_radius_m * self._change_to_come(self.friction_force_n)
            contact = self.provenance["motor"]["contact"]
            friction = self.rotor_radius_m * contact["friction"] * contact["preload_n"]
            found["mean_torque_n_m"] = change / (abs(self.mean_torque_n_m) + SMALL_TORQUE * friction)
        if self.periodic:
            return dict.fromkeys(found, 0.0)
        return {name: share if isfinite(share) else None for name, share in found.items()}

    def _change_to_come(self, values: Array) -> float:
        return change_to_come(self.time_s, values, self.drive_period_s, self.decay_s)

    @property
    def settled(self) -> bool | None:
        """Whether the means stay within 2 % if the run goes on; ``None`` if neither speed nor torque was recorded."""
        return all(map(has_settled, self.to_come.values())) if self.to_come else None

    def remark(self, name: str) -> str:
        """Return the remark on a mean by its name, as :func:`remark`."""
        return remark(self.to_come.get(name, 0.0))

    def summary(self) -> dict[str, str]:
        """Return motor, drive, means, shares of the contact's states and the energy residual."""
        found = {
            "transducer" if self.of_transducer else "motor": str(self.provenance["motor"]["name"]),
            "duration": engineering(float(self.time_s[-1]), "s"),
        }
        for name, column, value, unit in (
            ("mean_rotor_speed_rad_s", "rotor_speed_rad_s", "mean rotor speed", "rad/s"),
            ("mean_torque_n_m", "friction_force_n", "mean torque", "N·m"),
        ):
            if hasattr(self, column):
                found[value] = engineering(getattr(self, name), unit) + self.remark(name)
        found["drive"] = str(self.provenance["drive"]["label"])
        if self.of_transducer:
            found |= {words: text + self.remark(words) for words, text in described(self.electrical()).items()}
        found |= described(self.sensed())
        found |= contact_row(self.provenance["run"])
        if hasattr(self, "contact_state"):
            found["contact"] = ", ".join(
                f"{name} {100.0 * share:.1f} %" for name, share in self.state_fractions.items()
            )
        if hasattr(self, "energy"):
            found["energy residual"] = f"{self.energy_residual:.2g}"
        if self.error_estimate is not None:
            found["error estimate"] = f"{self.error_estimate:.2g}"
        found["points"] = str(self.points)
        return self._localised(found)


def described(quantities: Mapping[str, float | None]) -> dict[str, str]:
    """Return quantities ready to print, their names as words without the unit."""
    units = {name: unit_in(name) for name in quantities}
    return {
        name.removesuffix(f"_{units[name].lower()}").removesuffix("_deg").replace("_", " "): engineering(
            value, units[name].strip("1")
        )
        for name, value in quantities.items()
    }


def has_settled(share: float | None) -> bool:
    """Whether a mean with this expected relative change is settled; ``None``: the run is too short to judge."""
    return share is not None and share <= SETTLED


def remark(share: float | None) -> str:
    """Return the words after a mean with this expected relative change: ", not settled", or none."""
    return "" if has_settled(share) else ", not settled"


def interpolated(time: Array, values: Array, at: Array | float) -> Array:
    """Return values, along their last axis, at other times, by Lagrange's polynomial through the points around each.

    ``time`` rises; before and after it the polynomial through its first or last points counts.
    """
    nodes, places = min(NODES, len(time)), np.asarray(at, dtype=float)
    first = np.clip(np.searchsorted(time, places) - nodes // 2, 0, len(time) - nodes)
    found = np.zeros((*values.shape[:-1], *places.shape))
    for one in range(nodes):
        weight = np.ones_like(places)
        for other in range(nodes):
            if other != one:
                weight *= (places - time[first + other]) / (time[first + one] - time[first + other])
        found += weight * values[..., first + one]
    return found
