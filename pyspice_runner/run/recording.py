# SPDX-License-Identifier: GPL-3.0-or-later
"""What the vectors of a run mean: its columns in SI units, and its energy balance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.drive import Load
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.parameters import Mode, Mount
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.contact import Law
from pyspice_runner.netlist.motor import Discretisation, dielectric_branches
from pyspice_runner.netlist.source import Source
from pyspice_runner.run.audit import NEWTON, pressed_j
from pyspice_runner.run.waveforms import COLUMNS, HEATED, Array, EnergyBalance

VECTORS: dict[str, tuple[str, ...]] = {  # of the columns, but for the currents, which the source knows
    "time_s": (),
    "voltage_a_v": ("v(a)",),
    "voltage_b_v": ("v(b)",),
    "tip_x_m": ("v(xmotor.x)",),
    "tip_y_m": ("v(xmotor.y)",),
    "normal_force_n": ("v(xmotor.normal)",),
    "friction_force_n": ("v(xmotor.friction)",),
    "contact_displacement_m": ("v(xmotor.slider)", "v(xmotor.xcontact.delta)"),
    "contact_state": ("v(xmotor.state)",),
    "rotor_speed_rad_s": ("v(shaft)",),
    "temperature_k": ("v(temperature)",),
}
_OF_CONTACT = ("xmotor.normal", "xmotor.friction", "xmotor.slider", "xmotor.state", "xmotor.xcontact.delta")
_OF_MOUNT = ("v(xmotor.xmount.elastic)", "i(v.xmotor.xmount.vvelocity)")
_SHARE = "v(xmotor.xbearing.share)"
_CURRENTS = {"current_a_a": "a", "current_b_a": "b"}


@dataclass(frozen=True)
class Recording:
    """What a run's vectors mean.

    Attributes:
        motor: the motor.
        source: what drives the pins.
        law: law of the contact; ``None`` for a free tip.
        load: on the shaft.
        discretisation: of the modes.
        thermal: drift of a motor that its losses heat; ``None`` for one that does not drift.
        started: whether it begins with the start, of which ngspice writes no point; the known state is put in front.
    """

    motor: Motor
    source: Source
    law: Law | None
    load: Load
    discretisation: Discretisation
    started: bool
    thermal: Thermal | None = None

    def vectors(self, signals: Sequence[str] | None) -> list[str]:
        """Return the vectors to record: those of some columns, or of all, and then the states of the modes too."""
        names: list[str] = []
        for column in self.all_columns if signals is None else signals:
            names += self._current(column)[:1] if column in _CURRENTS else VECTORS[column]
        if signals is None:
            for index in range(1, len(self.motor.modes) + 1):
                names += [f"i(v.xmotor.xmode{index}.vvelocity)", f"v(xmotor.xmode{index}.elastic)"]
            if self._mount:
                names += _OF_MOUNT
            if self.motor.rotor.bearing_friction_n_m:
                names.append(_SHARE)
        return [name for name in names if self.law or name[2:-1] not in _OF_CONTACT]

    @property
    def all_columns(self) -> list[str]:
        """The columns that a run with these settings has."""
        return [*COLUMNS, *(HEATED if self.thermal else ())]

    def _current(self, column: str) -> tuple[str, float]:
        return self.source.current(_CURRENTS[column])

    def columns(self, samples: Mapping[str, Array], names: Iterable[str]) -> dict[str, Array]:
        """Return time and columns in SI units; each is the one copy that is made of the raw file's vector."""
        voltage_a, voltage_b = self.source.initial_voltages()
        deflection = sum(self._preload * mode.tip_y**2 / self._stiffness(mode) for mode in self.motor.modes)
        first = {
            "voltage_a_v": voltage_a,
            "voltage_b_v": voltage_b,
            "tip_x_m": self.sway,
            "tip_y_m": -deflection,
            "normal_force_n": self._preload,
            "contact_state": 1.0 if self.law else 0.0,
            "rotor_speed_rad_s": self.load.speed or 0.0,
            "temperature_k": self.thermal.ambient_k if self.thermal else 0.0,
        }
        scale = dict.fromkeys(("tip_x_m", "tip_y_m", "contact_displacement_m"), 1e-6)
        columns = {"time_s": self._after(0.0, samples["time"])}
        for name in names:
            if name == "time_s":
                continue
            vector_name = VECTORS[name][0] if name in VECTORS else ""
            if name in _CURRENTS:
                vector_name, scale[name] = self._current(name)
            vector = samples.get(vector_name)
            if vector is None:  # of a contact, and there is none
                columns[name] = np.zeros(len(columns["time_s"]))
                continue
            start = first.get(name, scale[name] * vector[0] if name in _CURRENTS else 0.0)
            columns[name] = self._after(start, vector, scale.get(name, 1.0))
            if name == "contact_displacement_m" and self.law and self.law.name == "spring-slider":
                # while it slips, the slider's node stands above its limit by the slip velocity times half a step
                limit = contact_law.limit_ratio(self.motor.contact) * self._penetration(samples)
                np.clip(columns[name], -limit, limit, out=columns[name])
        return columns

    def energy(self, waves: Mapping[str, Array], samples: Mapping[str, Array]) -> EnergyBalance:
        """Balance the run by the physical parameters, not by those that the step asked for in the netlist."""
        modal = self._modal(samples)
        carrier = self._carrier(samples) if self._mount else None
        drift = samples.get("v(temperature)") if self.thermal else None
        bearing = self.motor.rotor.bearing_damping_n_m_s * waves["rotor_speed_rad_s"]
        if self.motor.rotor.bearing_friction_n_m:
            bearing = bearing + self._after(0.0, samples[_SHARE], self.motor.rotor.bearing_friction_n_m)
        return _energy(self, waves, self._penetration(samples), modal, carrier, bearing, drift)

    @property
    def sway(self) -> float:
        """Sideways displacement in m of the tip under the preload, where the rotor's crown stands."""
        softened = [mode.model_copy(update={"stiffness_n_per_m": self._stiffness(mode)}) for mode in self.motor.modes]
        return contact_law.static_sway(self.motor.contact, tuple(softened)) if self.law else 0.0

    @property
    def _preload(self) -> float:
        return self.motor.contact.preload_n if self.law else 0.0

    @property
    def _mount(self) -> Mount | None:
        """The mount, which a free tip has none of."""
        return self.motor.mount if self.law else None

    def _stiffness(self, mode: Mode | Mount) -> float:
        return self.discretisation.mode(mode)[1]

    def _after(self, start: float, values: Array, scale: float = 1.0) -> Array:
        """Return a vector, scaled, behind its value at the start if that is recorded."""
        column = np.empty(len(values) + self.started)
        column[:1] = start
        np.multiply(values, scale, out=column[int(self.started) :])
        return column

    def _penetration(self, samples: Mapping[str, Array]) -> Array:
        """Return the penetration in m, 0 where the contact is open."""
        if not self.law:
            return np.zeros(len(samples["time"]) + self.started)
        start = contact_law.static_penetration(self.motor.contact)
        depth = self._after(start, samples["v(xmotor.xcontact.delta)"], 1e-6)
        return np.maximum(depth, 0.0, out=depth)

    def _modal(self, samples: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return displacement (m) and velocity (m/s) of every mode, shape (modes, points)."""
        displacement, velocity = [], []
        for index, mode in enumerate(self.motor.modes, start=1):
            stiffness = self._stiffness(mode)
            elastic = samples[f"v(xmotor.xmode{index}.elastic)"]
            displacement.append(self._after(-mode.tip_y * self._preload / stiffness, elastic, 1.0 / stiffness))
            velocity.append(self._after(0.0, samples[f"i(v.xmotor.xmode{index}.vvelocity)"]))
        return np.array(displacement), np.array(velocity)

    def _carrier(self, samples: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return displacement (m) and velocity (m/s) of the carrier, shape (points,)."""
        assert self._mount is not None
        elastic, velocity = (samples[name] for name in _OF_MOUNT)
        return self._after(0.0, elastic, 1.0 / self._stiffness(self._mount)), self._after(0.0, velocity)


def plate_voltage(time_s: Array, voltage_v: Array, lag_s: float) -> Array:
    """Return the voltage of a capacitance behind a resistance, which starts charged.

    Exact for a voltage that is linear within each step.

    Args:
        time_s: times, rising.
        voltage_v: voltage of both in series.
        lag_s: their time constant.
    """
    if not lag_s > 0.0:
        return voltage_v
    from scipy.linalg import solve_banded  # takes long to load

    h = np.diff(time_s)
    kept = np.exp(-h / lag_s)
    lag = (1.0 - kept) * lag_s / np.where(h > 0.0, h, 1.0)
    driven = (1.0 - kept) * voltage_v[:-1] + (1.0 - lag) * np.diff(voltage_v)
    bands = np.ones((2, len(time_s)))
    bands[1, :-1], bands[1, -1] = -kept, 0.0
    found: Array = solve_banded((1, 0), bands, np.concatenate((voltage_v[:1], driven)))
    return found


def _energy(
    recording: Recording,
    waves: Mapping[str, Array],
    penetration: Array,
    modal: tuple[Array, Array],
    carrier: tuple[Array, Array] | None,
    bearing: Array,
    temperature: Array | None,
) -> EnergyBalance:
    """Balance the run by the physical parameters, not by those that the step asked for in the netlist."""
    motor, load, thermal = recording.motor, recording.load, recording.thermal
    time = waves["time_s"]
    displacement, velocity = modal
    tip_vx = sum(mode.tip_x * v for mode, v in zip(motor.modes, velocity, strict=True))
    tip_vy = sum(mode.tip_y * v for mode, v in zip(motor.modes, velocity, strict=True))

    def work(power: Array) -> float:
        return float(np.trapezoid(power, time))

    def change(stored: Array) -> float:
        return float(stored[-1] - stored[0])

    mount = mount_damping = 0.0
    if carrier is not None:
        assert motor.mount is not None
        lift, rise = carrier
        tip_vy = tip_vy + rise
        pressed = 0.5 * (motor.mount.mass_kg * rise**2 + motor.mount.stiffness_n_per_m * lift**2)
        mount = change(pressed - motor.contact.preload_n * lift)
        mount_damping = work(motor.mount.damping_n_s_per_m * rise**2)

    # a heated motor: its couplings and capacitances are those of its temperature, and drift does work on its springs
    coupling, drift = np.ones_like(time), 0.0
    if thermal is not None and temperature is not None:
        warm = np.concatenate((np.full(len(time) - len(temperature), thermal.ambient_k), temperature))
        coupling = 1.0 + thermal.coupling_drift_per_k * warm
        softer = thermal.frequency_drift_per_k * warm
        force = np.array([mode.stiffness_n_per_m for mode in motor.modes])[:, np.newaxis] * displacement
        drift = work(softer * (2.0 + softer) * np.sum(force * velocity, axis=0))

    dielectric = 0.0
    for group in "ab":
        motional = coupling * sum(
            getattr(mode, f"coupling_{group}_n_per_v") * v for mode, v in zip(motor.modes, velocity, strict=True)
        )
        voltage = waves[f"voltage_{group}_v"]
        if not recording.started or thermal is not None:
            # of a run that continues another, or whose capacitances drift, only what the pins take is known
            dielectric += work(voltage * (waves[f"current_{group}_a"] - motional))
            continue
        for branch in dielectric_branches(motor, group):
            plate = plate_voltage(time, voltage, branch.resistance_ohm * branch.capacitance_f)
            dielectric += change(0.5 * branch.capacitance_f * plate**2)
            if branch.resistance_ohm > 0.0:
                dielectric += work((voltage - plate) ** 2) / branch.resistance_ohm

    masses = np.array([mode.mass_kg for mode in motor.modes])
    stiffnesses = np.array([mode.stiffness_n_per_m for mode in motor.modes])
    dampings = np.array([mode.damping_n_s_per_m for mode in motor.modes])
    squared = displacement**2
    softening = np.array([mode.softening_per_m2 for mode in motor.modes])[:, np.newaxis]
    growth = np.array([mode.damping_growth_per_m2 for mode in motor.modes])[:, np.newaxis]
    normal, friction, rotor_speed = (
        waves["normal_force_n"],
        waves["friction_force_n"],
        waves["rotor_speed_rad_s"],
    )
    hertz = motor.contact.normal_stiffness_n_per_m15 * penetration**1.5
    radius = motor.rotor.radius_m
    sine = (waves["tip_x_m"] - recording.sway) / (radius - penetration)
    cosine = np.sqrt(np.maximum(1.0 - sine**2, 0.0))  # a tip that ran away is for the audit
    tangential = tip_vx * cosine + tip_vy * sine
    torque = radius * friction
    electrical = waves["voltage_a_v"] * waves["current_a_a"] + waves["voltage_b_v"] * waves["current_b_a"]
    passed = np.cumsum(0.5 * (electrical[1:] + electrical[:-1]) * np.diff(time))
    to_load = work((torque - bearing) * rotor_speed) if load.speed is not None else work(load.torque * rotor_speed)
    return EnergyBalance(
        electrical=work(electrical),
        dielectric=dielectric,
        kinetic=change(0.5 * masses @ velocity**2),
        elastic=change(0.5 * stiffnesses @ (squared - 0.5 * softening * squared**2)),
        damping=work(dampings @ (velocity**2 * (1.0 + growth * squared))),
        contact_elastic=change(0.4 * hertz * penetration + 0.5 * motor.contact.series_compliance_m_per_n * normal**2),
        contact_damping=float(np.trapezoid(normal - hertz, penetration)),
        friction=work(friction * (tangential - radius * rotor_speed)),
        mount=mount,
        mount_damping=mount_damping,
        # a held speed does not change but for the rounding of its digits
        rotor=change(0.5 * motor.rotor.inertia_kg_m2 * rotor_speed**2) if load.speed is None else 0.0,
        bearing=work(bearing * rotor_speed),
        load=to_load,
        drift=drift,
        passed=float(np.abs(passed).max()) + max(-to_load, 0.0),
        rounding=NEWTON * pressed_j(motor, float(np.abs(normal).max())) if recording.law else 0.0,
    )
