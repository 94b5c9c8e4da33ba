# SPDX-License-Identifier: GPL-3.0-or-later
"""The quantities of a speed–torque curve from a period of the steady state.

The instruments of the dynamometer integrate inside the circuit; here the same means are taken of recorded points.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Mapping
from math import atan2, degrees, nan

import numpy as np

from pyspice_runner.circuit.state import Discretisation, static_sway
from pyspice_runner.motor import groups, strength
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.stator import carriers
from pyspice_runner.run.dynamometer import quantities_of, stored_energy
from pyspice_runner.run.window import Array
from pyspice_runner.steady.copies import Plant, drive_voltage, phasor_at
from pyspice_runner.steady.period_map import Trace


def modal(plant: Plant, trace: Trace) -> tuple[Array, Array]:
    """Return the modal displacements (m) and velocities (m/s) of a period, shape (modes, points)."""
    return trace.states[: plant.modes], trace.states[plant.modes : 2 * plant.modes]


def speed(plant: Plant, trace: Trace) -> Array:
    """Return the speed of the rotor in rad/s."""
    if plant.load.speed is not None:
        return np.full(len(trace.time), plant.load.speed)
    return np.asarray(trace.states[plant.where("rotor")][0])


def tip(plant: Plant, trace: Trace) -> tuple[Array, Array, Array, Array]:
    """Return the displacements x, y (m) of the tip and its velocities (m/s)."""
    contact = plant.motor.stator.contact
    (x, y), (vx, vy) = (contact @ motion for motion in modal(plant, trace))
    return x, y, vx, vy


def current(plant: Plant, group: str, trace: Trace) -> Array:
    """Return the current in A into a group."""
    place = GROUPS.index(group)
    amperes = plant.motor.stator.coupling[:, place] @ modal(plant, trace)[1]
    for at, tones in enumerate(plant.drive.tones):  # of the clamped capacitances
        for tone in tones:
            gain = complex(plant.dielectrics[tone.frequency][place, at])
            amperes += phasor_at(tone, gain, trace.time)[0]
    return np.asarray(amperes)


def _dielectric_loss(plant: Plant) -> float:
    """Return the mean loss in W of the clamped capacitances: their admittance is linear, at each frequency alone."""
    loss, drive = 0.0, plant.drive
    for frequency in set(drive.frequencies):
        volts = np.array(
            [
                sum(rect(tone.amplitude, tone.phase) for tone in tones if tone.frequency == frequency)
                for tones in drive.tones
            ]
        )
        loss += 0.5 * float(np.vdot(volts, plant.dielectrics[frequency] @ volts).real)
    return loss


def means(plant: Plant, trace: Trace, discretisation: Discretisation) -> dict[str, float]:
    """Return the means over a period from which the quantities follow; all are linear in time averages."""
    motor, radius = plant.motor, plant.motor.rotor.radius_m
    x, _, vx, vy = (values[1:] for values in tip(plant, trace))
    carried = trace.states[plant.carrier]  # displacement and velocity of the carrier along y, then along x
    x = x - static_sway(motor, plant.law, discretisation)
    if len(carried):
        vy = vy + carried[1, 1:]
    if len(carried) > 2:
        x, vx = x + carried[2, 1:], vx + carried[3, 1:]
    normal, friction, state = trace.normal[1:], trace.friction[1:], trace.contact_state[1:]
    turning = speed(plant, trace)[1:]
    points = len(state)
    touching, slipping = state > 0.5, state > 1.5
    # slip that ended within a step: on average half of it
    ended = np.count_nonzero(touching[1:] & ~slipping[1:] & slipping[:-1])
    ended += int(touching[0] and not slipping[0] and slipping[-1])
    displacement, velocity = modal(plant, trace)
    mount_loss = sum(
        spring.damping_n_s_per_m * float(rise[1:] @ rise[1:]) / points
        for spring, rise in zip(carriers(plant.mount), carried[1::2], strict=True)
    )
    dampings = np.array([mode.damping_n_s_per_m for mode in motor.modes])
    heating = velocity[:, 1:] ** 2
    growth = [mode.damping_growth_per_m2 for mode in motor.modes]
    if any(growth):
        heating *= 1.0 + np.array(growth)[:, np.newaxis] * displacement[:, 1:] ** 2
    found = {
        **strength.peak_of_motion(motor, displacement),
        "friction": float(friction.sum()) / points,
        "friction_square": float(friction @ friction) / points,
        "normal": float(normal.sum()) / points,
        "touching": np.count_nonzero(touching) / points,
        "slip": (np.count_nonzero(slipping) - 0.5 * ended) / points,
        "work": float(friction @ (vx + x * vy / radius)) / points,
        "press": float(normal @ (vy - x * vx / radius)) / points,
        "given": radius * float(friction @ turning) / points,
        "speed": float(turning.sum()) / points,
        "damping_loss": float(dampings @ heating.sum(axis=1)) / points + mount_loss,
        "dielectric_loss": _dielectric_loss(plant),
        "greatest": float(normal.max()),
        "stored": (_stored(plant, trace, -1) - _stored(plant, trace, 0)) / (trace.time[-1] - trace.time[0]),
    }
    found["rubbing"] = _rubbing(plant, trace, discretisation, found["work"] - found["given"])
    for group, tones in zip(GROUPS, plant.drive.tones, strict=True):
        voltage = drive_voltage(tones, trace.time)[1:]
        amperes = current(plant, group, trace)[1:]
        found |= {
            groups.named("power", group): float(voltage @ amperes) / points,
            groups.named("voltage_square", group): float(voltage @ voltage) / points,
            groups.named("current_square", group): float(amperes @ amperes) / points,
            groups.named("peak", group): float(np.abs(amperes).max()),
            **_fundamental(plant, group, trace, amperes),
        }
    return found


def _fundamental(plant: Plant, group: str, trace: Trace, amperes: Array) -> dict[str, float]:
    """Return the parts in V·A of a group's current at its drive frequency, in phase with its voltage and 90° ahead.

    Empty for a group without a voltage, or with tones at two frequencies.
    """
    tones = [tone for tone in groups.of(plant.drive.tones, group) if tone.amplitude]
    if len({tone.frequency for tone in tones}) != 1:
        return {}
    turning = np.exp(-2j * np.pi * tones[0].frequency * trace.time[1:])
    product = np.vdot(drive_voltage(tones, trace.time)[1:] @ turning, amperes @ turning) / len(amperes) ** 2
    return {groups.named("in_phase", group): float(product.real), groups.named("ahead", group): float(product.imag)}


def phases(found: Mapping[str, float]) -> dict[str, float]:
    """Return the phase in degrees of each group's current ahead of its voltage at its drive frequency, from means."""
    return {
        groups.column("current", group, "phase_deg"): degrees(
            atan2(found[groups.named("ahead", group)], found[groups.named("in_phase", group)])
        )
        for group in "ab"
        if groups.named("ahead", group) in found
    }


def loads(plant: Plant, trace: Trace, discretisation: Discretisation, loss_w: float) -> dict[str, float]:
    """Return strain and stress of the ceramic, pressure and wear of the contact; ``loss_w`` is the loss by friction."""
    greatest, rubbing = float(trace.normal.max()), _rubbing(plant, trace, discretisation, loss_w)
    return {
        **strength.peak_of_motion(plant.motor, modal(plant, trace)[0]),
        **strength.of_contact(plant.motor.contact, greatest, rubbing),
    }


def _rubbing(plant: Plant, trace: Trace, discretisation: Discretisation, loss_w: float) -> float:
    """Return the mean of normal force times slip velocity in W; of other laws than the paper's by their loss.

    The spring of the paper's law is not quite conservative: its loss also has what the spring gives or takes.
    """
    if plant.law is None:
        return nan
    if "averaged" not in plant.law.forms:
        return loss_w / plant.motor.contact.friction
    velocity = strength.slip_velocity(
        plant.motor.contact, 1e-6 * trace.slider_um, 1e-6 * trace.penetration_um, trace.normal,
        discretisation.slider_time,
    )  # fmt: skip
    return float(trace.normal[1:] @ velocity[1:]) / len(velocity[1:])


def _stored(plant: Plant, trace: Trace, at: int) -> float:
    """Return the energy in J in the modes and the mount."""
    displacement, velocity = (values[:, at].tolist() for values in modal(plant, trace))
    carried = trace.states[plant.carrier][:, at].tolist()
    return stored_energy(plant.motor, displacement, velocity, carried[::2], carried[1::2])


def extrapolated(fine: Mapping[str, float], coarse: Mapping[str, float], ratio: float) -> dict[str, float]:
    """Extrapolate the means at two time steps to a vanishing step; their error is of second order.

    Shares of time and squares stay in their range.
    """
    weight = 1.0 / (ratio**2 - 1.0)
    limit = {name: value + weight * (value - coarse[name]) for name, value in fine.items()}
    for name in ("touching", "slip"):
        limit[name] = min(max(limit[name], 0.0), 1.0)
    limit["slip"] = min(limit["slip"], limit["touching"])
    for name in ("peak_a", "peak_b", "greatest", "rubbing"):
        limit[name] = max(limit[name], 0.0)
    return limit


def quantities(plant: Plant, found: Mapping[str, float]) -> dict[str, float]:
    """Return the quantities of :data:`.dynamometer.UNITS` from means."""
    motor = plant.motor
    # of a held shaft that has turned, dry friction in the bearing takes all its torque
    dry = float(np.sign(plant.load.speed or 0.0)) * motor.rotor.bearing_friction_n_m
    bearing = motor.rotor.bearing_damping_n_m_s * found["speed"] + dry
    load_torque = motor.rotor.radius_m * found["friction"] - bearing
    return quantities_of(motor, {**found, "load_torque": load_torque})
