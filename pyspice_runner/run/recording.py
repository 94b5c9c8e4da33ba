# SPDX-License-Identifier: GPL-3.0-or-later
"""Columns in SI units and energy balance from the vectors of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from pyspice_runner.circuit.law import laws_of
from pyspice_runner.circuit.motor import ALL, dielectric_branches
from pyspice_runner.circuit.state import (
    FEEDBACK,
    Discretisation,
    Kind,
    held_piezo,
    pushes,
    recorded_states,
    state_vectors,
    static_places,
    stems,
)
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.contacts import Touching
from pyspice_runner.motor.groups import GROUPS, column
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.stator import square
from pyspice_runner.run.audit import NEWTON, pressed_j
from pyspice_runner.run.point import Point
from pyspice_runner.run.waveforms import (
    COLUMNS,
    HEATED,
    OF_SEVERAL,
    OF_TRANSDUCER,
    SENSED,
    Array,
    EnergyBalance,
    column_of_contact,
    force_columns,
)
from pyspice_runner.run.window import plate_voltage

VECTORS: dict[str, tuple[str, ...]] = {  # of the columns, but for the currents, which the source knows
    "time_s": (),
    "voltage_a_v": ("v(a)",),
    "voltage_b_v": ("v(b)",),
    "tip_x_m": ("v(xmotor.x)",),
    "tip_y_m": ("v(xmotor.y)",),
    "normal_force_n": ("v(xmotor.normal)",),
    "friction_force_n": ("v(xmotor.friction)",),
    "contact_displacement_m": ("v(xmotor.slider)", "v(xmotor.xcontact.delta)", "v(xmotor.normal)"),
    "contact_state": ("v(xmotor.state)",),
    "rotor_speed_rad_s": ("v(shaft)",),
    "temperature_k": ("v(temperature)",),
    "feedback_v": (f"v(xmotor.{FEEDBACK})",),
}
_TOTALS = {"normal_force_n": f"v(xmotor.normal{ALL})", "friction_force_n": f"v(xmotor.friction{ALL})"}  # of several
_OF_CONTACT = ("xmotor.normal", "xmotor.friction", "xmotor.slider", "xmotor.state", "xmotor.xcontact.delta")
_CURRENTS = {column("current", group, "a"): group for group in GROUPS}


_VOLTAGES = tuple(column("voltage", group, "v") for group in GROUPS)


def columns_of_transducer(motor: Motor) -> list[str]:
    """Return the columns of a run of a transducer; the face is there if its motion is known."""
    kinds = (("voltage", "v"), ("current", "a"), ("motional_current", "a"))
    of_groups = [column(name, group, unit) for name, unit in kinds for group in motor.groups]
    return ["time_s", *of_groups, *(["tip_y_m"] if any(mode.tip_y for mode in motor.modes) else [])]


@dataclass(frozen=True)
class Recording:
    """Conversion of the vectors of a run into columns and energies."""

    point: Point  # motor, source, load and law
    discretisation: Discretisation  # of the modes
    started: bool = True  # whether it has the start, of which ngspice writes no point: the known state is put in front

    def vectors(self, signals: Sequence[str] | None) -> list[str]:
        """Return the vectors to record: those of some columns, or of all, and then the states of the modes too."""
        names: list[str] = []
        for name in self.all_columns if signals is None else signals:
            if name in OF_TRANSDUCER:
                names += self._velocities
            else:
                names += self.point.source.current(_CURRENTS[name])[:1] if name in _CURRENTS else self._known[name]
        if signals is None:
            names += [f"v(xmotor.{node}{one.suffix})" for one in self._several for node in ("x", "y")]
            names += [_depth(one) for one in self._several]
            names += state_vectors(self.point.motor, self.point.law, kinds=("mode", "mount", "feedback", "bearing"))
        return [name for name in dict.fromkeys(names) if self.point.law or name[2:-1] not in _OF_CONTACT]

    @property
    def all_columns(self) -> list[str]:
        """The columns that a run with these settings has."""
        if self.point.motor.is_transducer:
            return columns_of_transducer(self.point.motor)
        sensed = SENSED if self.point.motor.feedback else ()
        return [*COLUMNS, *sensed, *(HEATED if self.point.thermal else ()), *contact_columns(self._several)]

    @property
    def _several(self) -> tuple[Touching, ...]:
        """The contacts of a motor with several, unless its tips are free."""
        return self.point.motor.touching if self.point.motor.contacts and self.point.law else ()

    @cached_property
    def _known(self) -> dict[str, tuple[str, ...]]:
        """The vectors of the columns, of which the first has the values."""
        if not self._several:
            return VECTORS
        totals = {name: (vector,) for name, vector in _TOTALS.items()}
        return VECTORS | totals | {name: (vector,) for name, vector in contact_columns(self._several).items()}

    @property
    def _velocities(self) -> list[str]:
        """The vectors of the velocities of the modes."""
        return [f"i(v.xmotor.xmode{number}.vvelocity)" for number in range(1, len(self.point.motor.modes) + 1)]

    def columns(self, samples: Mapping[str, Array], names: Iterable[str]) -> dict[str, Array]:
        """Return time and columns in SI units; each is the one copy that is made of the raw file's vector."""
        begun = dict(zip(_VOLTAGES, self.point.source.initial_voltages(), strict=False))
        pressed = self._pressed
        first = {
            **begun,
            **dict(zip(("tip_x_m", "tip_y_m"), self.places[0].tolist(), strict=True)),
            "normal_force_n": sum(pressed) if self._several else self._preload,
            **dict(zip(contact_columns(self._several, ("normal",)), pressed, strict=True)),
            **{column_of_contact("state", one.name): float(one.share > 0.0) for one in self._several},
            "contact_state": 1.0 if self.point.law else 0.0,
            "rotor_speed_rad_s": self.point.load.speed or 0.0,
            "temperature_k": self.point.thermal.ambient_k if self.point.thermal else 0.0,
        }
        scale = dict.fromkeys(("tip_x_m", "tip_y_m", "contact_displacement_m"), 1e-6)
        columns = {"time_s": self._after(0.0, samples["time"])}
        for name in names:
            if name == "time_s":
                continue
            if name in OF_TRANSDUCER:
                place = list(OF_TRANSDUCER).index(name)
                flows = zip(self.point.motor.stator.coupling[:, place], self._velocities, strict=True)
                columns[name] = self._after(0.0, sum(force * samples[vector] for force, vector in flows))
                continue
            vector_name = self._known[name][0] if name in self._known else ""
            if name in _CURRENTS:
                vector_name, scale[name] = self.point.source.current(_CURRENTS[name])
            vector = samples.get(vector_name)
            if vector is None:  # of a contact, and there is none
                columns[name] = np.zeros(len(columns["time_s"]))
                continue
            start = first.get(name, scale[name] * vector[0] if name in _CURRENTS else 0.0)
            start = vector[0] if name == "normal_force_n" and self._jumps else start
            columns[name] = self._after(start, vector, scale.get(name, 1.0))
            first_law = laws_of(self.point.motor, self.point.law)[:1]
            if name == "contact_displacement_m" and any("averaged" in law.forms for law in first_law):
                # while it slips, the slider's node stands above its limit by the slip velocity times half a step
                normal = self._after(pressed[0] if self._several else self._preload, samples["v(xmotor.normal)"])
                one = self.point.motor.touching[0]
                limit = contact_law.stick_limit(one.contact, self._penetration(samples, one), normal)
                np.clip(columns[name], -limit, limit, out=columns[name])
        return columns

    def energy(self, waves: Mapping[str, Array], samples: Mapping[str, Array]) -> EnergyBalance:
        """Balance the run by the physical parameters, not by those that the step asked for in the netlist."""
        return _Terms(self, waves, samples).balance()

    @property
    def places(self) -> Array:
        """Displacements x and y in m of the tips under the preload, shape (contacts, 2); the crown stands at x."""
        return static_places(self.point.motor, self.point.law, self.discretisation)

    @property
    def _pressed(self) -> list[float]:
        """Normal force in N of each of several contacts at the start of a run from rest."""
        found = []
        for one in self._several:
            depth = np.array(contact_law.static_penetration(one.contact) + one.height_m)
            found.append(float(contact_law.elastic_force(one.contact, depth)))
        return found

    @property
    def _jumps(self) -> bool:
        """Whether voltages at the start move the contact, so that its force is at once not the preload."""
        return bool(pushes(self.point.motor, self.point.law)) and any(self.point.source.initial_voltages())

    @property
    def _preload(self) -> float:
        return self.point.motor.contact.preload_n if self.point.law else 0.0

    def _after(self, start: float, values: Array, scale: float = 1.0) -> Array:
        """Return a vector, scaled, behind its value at the start if that is recorded."""
        column = np.empty(len(values) + self.started)
        column[:1] = start
        np.multiply(values, scale, out=column[int(self.started) :])
        return column

    def _penetration(self, samples: Mapping[str, Array], one: Touching) -> Array:
        """Return the penetration of a contact in m, 0 where it is open."""
        if not self.point.law:
            return np.zeros(len(samples["time"]) + self.started)
        rest, deep = contact_law.static_penetration(one.contact) + one.height_m, samples[_depth(one)]
        depth = self._after(1e-6 * deep[0] if self._jumps else rest, deep, 1e-6)
        return np.maximum(depth, 0.0, out=depth)

    def _courses(self, samples: Mapping[str, Array], kind: Kind) -> Array:
        """Return the states of a part of the motor in SI units, shape (states, points)."""
        found = recorded_states(samples, self.point.motor, self.point.law, self.discretisation, kind)
        return np.array([self._after(rest, values, scale) for rest, scale, values in found])


class _Terms:
    """The terms of the energy balance of a run, in J."""

    def __init__(self, recording: Recording, waves: Mapping[str, Array], samples: Mapping[str, Array]) -> None:
        motor = recording.point.motor
        self.recording, self.motor, self.waves, self.samples = recording, motor, waves, samples
        self.time = waves["time_s"]
        self.displacement, self.velocity = np.split(recording._courses(samples, "mode"), 2)
        self.carrier = recording._courses(samples, "mount")  # displacement and velocity, or nothing
        self.share = recording._courses(samples, "bearing")
        self.charged = recording._courses(samples, "feedback")
        self.stator = motor.stator
        thermal = recording.point.thermal
        if not motor.is_transducer:
            self.bearing = motor.rotor.bearing_damping_n_m_s * waves["rotor_speed_rad_s"]  # its torque, N·m
        if len(self.share):
            self.bearing = self.bearing + motor.rotor.bearing_friction_n_m * self.share.sum(axis=0)
        # temperature above that at which the parameters hold, K; ``None`` for a motor that does not drift
        temperature = samples.get("v(temperature)") if thermal else None
        self.warm: Array | None = None
        if thermal is not None and temperature is not None:
            before = np.full(len(self.time) - len(temperature), thermal.ambient_k)
            self.warm = np.concatenate((before, temperature))

    def work(self, power: Array) -> float:
        """Return the energy that a power in W carries over the run."""
        return float(np.trapezoid(power, self.time))

    def balance(self) -> EnergyBalance:
        """Return all terms."""
        waves, motor, load = self.waves, self.motor, self.recording.point.load
        squared = self.displacement**2
        softening, growth = self.stator.softening[:, np.newaxis], self.stator.growth[:, np.newaxis]
        electrical = np.zeros(len(self.time))
        for group in motor.groups:
            electrical += waves[column("voltage", group, "v")] * waves[column("current", group, "a")]
        passed = np.cumsum(0.5 * (electrical[1:] + electrical[:-1]) * np.diff(self.time))
        of_modes = {
            "electrical": self.work(electrical),
            "dielectric": self.dielectric() + self.sensed(),
            "kinetic": _change(0.5 * self.stator.mass @ self.velocity**2),
            "elastic": _change(0.5 * self.stator.stiffness @ (squared - 0.5 * softening * squared**2)),
            "damping": self.work(self.stator.damping @ (self.velocity**2 * (1.0 + growth * squared))),
        }
        if motor.is_transducer:
            rest = dict.fromkeys((item.name for item in fields(EnergyBalance)), 0.0)
            largest = float(np.abs(passed).max())
            return EnergyBalance(**rest | of_modes | {"load": self.tool(), "passed": largest})
        normal, rotor_speed = waves["normal_force_n"], waves["rotor_speed_rad_s"]
        grip = motor.rotor.radius_m * waves["friction_force_n"] - self.bearing  # torque on what holds the shaft
        to_load = self.work((load.torque if load.speed is None else grip) * rotor_speed)
        mount, mount_damping = self.mount()
        return EnergyBalance(
            **of_modes,
            **self.contact(),
            mount=mount,
            mount_damping=mount_damping,
            # a held speed changes by the rounding of its digits only
            rotor=_change(0.5 * motor.rotor.inertia_kg_m2 * rotor_speed**2) if load.speed is None else 0.0,
            bearing=self.work(self.bearing * rotor_speed),
            load=to_load,
            drift=self.drift(),
            passed=float(np.abs(passed).max()) + max(-to_load, 0.0),
            rounding=NEWTON * pressed_j(motor, float(np.abs(normal).max())) if self.recording.point.law else 0.0,
        )

    def tool(self) -> float:
        """Return the work on the load of a transducer: loss in its resistance, and energy of mass and spring."""
        motor, tool, along = self.motor, self.motor.tool, np.array(self.motor.load_motion)
        speed, place = along @ self.velocity, along @ self.displacement
        stored = 0.5 * (tool.mass_kg * speed**2 + tool.stiffness_n_per_m * place**2)
        return self.work(motor.load_resistance_n_s_per_m * speed**2) + _change(stored)

    def in_series(self, name: str, force: Array) -> tuple[float, float]:
        """Return the change of the energy of what is in series with the contact, and the work of the voltages on it."""
        point = self.recording.point
        compliance = stems(self.motor, point.law).get(name, 0.0)
        given = np.zeros_like(force)
        for voltage, per_volt in zip(_VOLTAGES, pushes(self.motor, point.law).get(name, ()), strict=False):
            given = given + per_volt * self.waves[voltage]
        moved = force - given
        return _change(0.5 * compliance * moved**2), -compliance * float(np.trapezoid(given, moved))

    def dielectric(self) -> float:
        """Return the energy in the clamped capacitances and their loss."""
        thermal, warm = self.recording.point.thermal, self.warm
        energy = 0.0
        if not self.recording.started or thermal is not None:
            # of a run that continues another, or whose capacitances drift, only what the pins take is known
            drifting = 1.0 if thermal is None or warm is None else 1.0 + thermal.coupling_drift_per_k * warm
            for group, coupling in zip(self.motor.groups, self.stator.coupling.T, strict=True):
                own = self.waves[column("current", group, "a")] - drifting * (coupling @ self.velocity)
                energy += self.work(self.waves[column("voltage", group, "v")] * own)
            if self.motor.is_transducer:
                return energy
            normal, friction = self.waves["normal_force_n"], self.waves["friction_force_n"]
            return energy - self.in_series("stem", normal)[1] - self.in_series("stem_x", friction)[1]  # 0 of several
        law, u = self.recording.point.law, self.waves[_VOLTAGES[0]]
        v = self.waves.get(_VOLTAGES[1], np.zeros_like(u))  # of one group nothing
        piezo = held_piezo(self.motor, law)
        share = piezo.capacitance_ab_f / piezo.capacitance_a_f
        branches = [dielectric_branches(self.motor, group, law) for group in self.motor.groups]
        for a, b in zip(branches[0], branches[-1], strict=True):
            lag = a.resistance_ohm * a.capacitance_f
            at_a, at_b = plate_voltage(self.time, u, lag), plate_voltage(self.time, v, lag)
            energy += _change(0.5 * (a.capacitance_f * at_a * (at_a - 2.0 * share * at_b) + b.capacitance_f * at_b**2))
            if a.resistance_ohm > 0.0:
                energy += self.work((u - at_a) * (u - at_a - 2.0 * share * (v - at_b))) / a.resistance_ohm
                energy += self.work((v - at_b) ** 2) / b.resistance_ohm
        return energy

    def sensed(self) -> float:
        """Return the energy in the feedback electrode and its loss."""
        electrode = self.motor.feedback
        if electrode is None:
            return 0.0
        squared = self.charged[0] ** 2
        return _change(0.5 * electrode.capacitance_f * squared) + self.work(squared / electrode.resistance_ohm)

    def drift(self) -> float:
        """Return the work of the drift of a heated motor on the springs of its modes."""
        thermal, warm = self.recording.point.thermal, self.warm
        if thermal is None or warm is None:
            return 0.0
        softer = thermal.frequency_drift_per_k * warm
        force = self.stator.stiffness[:, np.newaxis] * self.displacement
        return self.work(softer * (2.0 + softer) * np.sum(force * self.velocity, axis=0))

    def mount(self) -> tuple[float, float]:
        """Return the change of the energy of carrier and springs, and the loss in the springs."""
        if not len(self.carrier):
            return 0.0, 0.0
        change, loss = -_change(self.recording._preload * self.carrier[0]), 0.0
        carried = self.motor.carried_stator
        mass, damping, stiffness = map(square, (carried.mass, carried.damping, carried.stiffness))
        for at, (lift, rise) in enumerate(zip(self.carrier[::2], self.carrier[1::2], strict=True), len(self.velocity)):
            momentum = mass[at, : len(self.velocity)] @ self.velocity
            change += _change(0.5 * (mass[at, at] * rise**2 + stiffness[at, at] * lift**2) + rise * momentum)
            loss += self.work(damping[at, at] * rise**2)
        return change, loss

    def contact(self) -> dict[str, float]:
        """Return the change of the elastic energy of all contacts and what is in series, and the losses there."""
        found = dict.fromkeys(("contact_elastic", "contact_damping", "friction"), 0.0)
        for place, one in enumerate(self.motor.touching if self.recording.point.law else ()):
            normal, friction = map(self.waves.__getitem__, force_columns(self.motor, one))
            depth = self.recording._penetration(self.samples, one)
            compressed, _ = self.in_series(f"stem{one.suffix}", normal)
            found["contact_elastic"] += _change(contact_law.elastic_energy(one.contact, depth)) + compressed
            elastic = contact_law.elastic_force(one.contact, depth)
            found["contact_damping"] += float(np.trapezoid(normal - elastic, depth))
            found["friction"] += self.friction(place, one, friction, depth)
        return found

    def friction(self, place: int, one: Touching, friction: Array, depth: Array) -> float:
        """Return the work of the friction force of a contact on the motion of the tip against the rotor."""
        vx, vy = self.stator.contact[2 * place : 2 * place + 2] @ self.velocity
        rest = self.recording.places[place, 0]
        x = self.waves["tip_x_m"]
        if one.suffix:
            x = self.recording._after(rest, self.samples[f"v(xmotor.x{one.suffix})"], 1e-6)
        x = x - rest
        if len(self.carrier):
            vy = vy + self.carrier[1]
        if len(self.carrier) > 2:
            forward = self.stator.forward[place]
            x, vx = x + forward * self.carrier[2], vx + forward * self.carrier[3]
        radius = one.radius_m
        sine = x / (radius - depth)
        cosine = np.sqrt(np.maximum(1.0 - sine**2, 0.0))  # a tip that ran away is for the audit
        tangential = vx * cosine + vy * sine
        work = self.work(friction * (tangential - radius * self.waves["rotor_speed_rad_s"]))
        return work + self.in_series(f"stem_x{one.suffix}", friction)[1]


def contact_columns(several: Sequence[Touching], nodes: Sequence[str] = tuple(OF_SEVERAL)) -> dict[str, str]:
    """Return the columns of each of several contacts, with their vectors: all, or those of some nodes."""
    return {column_of_contact(node, one.name): f"v(xmotor.{node}{one.suffix})" for node in nodes for one in several}


def _depth(one: Touching) -> str:
    """Return the vector of the penetration of a contact."""
    return f"v(xmotor.xcontact{one.suffix}.delta)"


def _change(stored: Array) -> float:
    """Return the change of a stored energy over the run."""
    return float(stored[-1] - stored[0])
