# SPDX-License-Identifier: GPL-3.0-or-later
"""The equations of harmonic balance: the linear stator, and the contact at the phases of a period with its derivative.

The forces of the contact are those of the spring-slider's library (:mod:`.evaluated`). Arrays have the operating point
as their first axis. :mod:`.harmonic_balance` solves the equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import pi
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.evaluated import DIFFERENCE, library_function, parameter_columns
from pyspice_runner.circuit.law import PAPER_LAW, Law
from pyspice_runner.circuit.state import MICRO, static_sway
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.drive import Tone
from pyspice_runner.motor.stator import carriers, square
from pyspice_runner.spice.library import Library
from pyspice_runner.steady.copies import Plant

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Places = NDArray[np.int_]

HARMONICS = 7  # of the highest tone
PHASES = 64  # in a period of the highest tone
PINS = ("x", "y", "vx", "vy", "shaft", "slider")  # inputs of the library


class Grid:
    """The harmonics and the phases of a period, and the law of the contact."""

    def __init__(self, period: float, highest: int, library: Library) -> None:
        self.contact = library_function(library)
        self.parameters = [parameter.name for parameter in library.parameters]
        self.omega = 2.0 * pi / period
        self.orders = np.arange(HARMONICS * highest + 1.0)
        self.angles = 2.0 * pi * np.arange(PHASES * highest) / (PHASES * highest)
        turning = np.outer(self.angles, self.orders)
        # displacement and, over ω, velocity at the phases by the coefficients of the cosines, then of the sines
        self.shape = np.hstack([np.cos(turning), np.sin(turning[:, 1:])])
        self.rate = np.hstack([-self.orders * np.sin(turning), self.orders[1:] * np.cos(turning[:, 1:])])

    def phasors(self, values: Array, orders: Array) -> Complex:
        """Return the complex amplitudes of functions of the phase, the last axis but one; the first is the mean."""
        waves = np.exp(-1j * np.outer(orders, self.angles)) * 2.0 / len(self.angles)
        waves[orders == 0] *= 0.5
        return np.asarray(waves @ values, dtype=complex)


@dataclass
class Stators:
    """Contacts and linear equations of some operating points; the first axis of each array is the point.

    Coordinates are those of modes and carriers; a point with fewer than others has some that do not move.
    """

    tip: Array  # what each coordinate moves the tip along x and y, shape (points, 2, n)
    impedance: Complex  # force over displacement, shape (points, harmonics, n, n), N/m
    memory: Complex  # force over the rate of an amplitude that changes slowly, N s/m
    forces: Complex  # by voltages and preload, shape (points, harmonics, n), N
    contact: Array  # parameters of the library, shape (points, parameters)
    series: Array  # compliances in series along x and y, shape (points, 2), m/N
    preload: Array  # N; this and the following have the shape (points, 1)
    grip: Array  # static limit of the friction force, N
    depth: Array  # static penetration, m
    sway: Array  # crown of the rotor, m
    radius: Array  # m
    surface: Array  # surface speed of a held shaft over ω, m
    turns: Array  # 1 for a free shaft, 0 for a held one
    drag: Array  # of the bearing at the surface of the rotor, N s/m
    load: Array  # force that the load takes there, N
    decay: Array  # time constant of the slowest mode or carrier, s

    def of(self, some: Places) -> Self:
        """Return some of the points."""
        return type(self)(*(getattr(self, one.name)[some] for one in fields(self)))


@dataclass
class Response:
    """How the tip answers forces of the contact: D = free + compliance F."""

    gains: Complex  # of all coordinates, shape (points, harmonics, n, n), m/N
    coordinates: Complex  # without the contact, shape (points, harmonics, n), m
    compliance: Complex  # shape (points, harmonics, 2, 2), m/N
    free: Complex  # shape (points, harmonics, 2), m

    def of(self, some: Places) -> Self:
        """Return some of the points."""
        return type(self)(*(getattr(self, one.name)[some] for one in fields(self)))


def response_of(stators: Stators, rate: Array, before: Complex) -> Response:
    """Return the response of amplitudes that change from those before at a rate in 1/s; 0 is the steady state."""
    memory = rate[:, np.newaxis, np.newaxis, np.newaxis] * stators.memory
    gains = np.linalg.inv(stators.impedance + memory)
    forces = stators.forces + np.einsum("phnm,phm->phn", memory, before)
    coordinates = np.einsum("phnm,phm->phn", gains, forces)
    tip = stators.tip[:, np.newaxis]
    compliance = np.asarray(tip @ gains @ np.swapaxes(tip, -1, -2), dtype=complex)
    compliance[..., [0, 1], [0, 1]] += stators.series[:, np.newaxis]  # which the contact force compresses
    return Response(
        np.asarray(gains, dtype=complex), coordinates, compliance, np.einsum("pxn,phn->phx", stators.tip, coordinates)
    )


def stators_of(plants: Sequence[Plant], grid: Grid) -> Stators:
    """Return contacts and linear equations of operating points whose contacts have the library of the grid."""
    rows = []
    most = max(len(plant.motor.modes) + len(carriers(plant.mount)) for plant in plants)
    for plant in plants:
        motor, contact = plant.motor, plant.motor.contact
        preload, radius = contact.preload_n, motor.rotor.radius_m
        rows.append((
            *linear(plant, grid.omega, grid.orders, most), preload, contact.friction * preload,
            contact_law.static_penetration(contact), static_sway(motor, plant.law, None), radius,
            (plant.load.speed or 0.0) * radius / grid.omega, float(plant.turns),
            motor.rotor.bearing_damping_n_m_s / radius**2, (plant.load.torque or 0.0) / radius,
            motor.stator.with_carrier(plant.mount).decay_s,
        ))  # fmt: skip
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    contacts = [plant.motor.contact for plant in plants]
    series = [[one.tangential_series_compliance_m_per_n, one.series_compliance_m_per_n] for one in contacts]
    parameters = np.array(list(contact_parameters(plants, PAPER_LAW).values())).T
    scalars = [column[:, np.newaxis] for column in columns[4:]]
    return Stators(*[*columns[:4], parameters, np.array(series), *scalars])


def contact_parameters(plants: Sequence[Plant], law: Law) -> dict[str, Array]:
    """Return the parameters of the library of a law, each of shape (points,)."""
    motors = [plant.motor for plant in plants]
    bent = [motor.deflection_m + motor.contact.preload_n * motor.contact.series_compliance_m_per_n for motor in motors]
    return parameter_columns(law, motors, bent)


def linear(plant: Plant, omega: float, orders: Array, most: int) -> tuple[Array, Complex, Complex, Complex]:
    """Return the first four fields of :class:`Stators` of one point, with so many coordinates."""
    stator, modes = plant.motor.stator.with_carrier(plant.mount), plant.modes
    count = len(stator.mass)
    stiffness, damping, mass = np.eye(most), np.zeros((most, most)), np.zeros((most, most))
    for padded, own in ((stiffness, stator.stiffness), (damping, stator.damping), (mass, stator.mass)):
        padded[:count, :count] = square(own)
    rates = 1j * omega * orders[:, np.newaxis, np.newaxis]
    tip = np.pad(stator.contact, ((0, 0), (0, most - count)))
    forces = np.zeros((len(orders), most), dtype=complex)
    for tones, coupling in zip(plant.drive.tones, stator.coupling.T, strict=True):
        for tone in tones:
            order, phasor = tone_phasor(tone, omega)
            forces[order, :count] += coupling * phasor
    if stator.carriers:
        forces[0, modes] = plant.motor.contact.preload_n
    return tip, stiffness + rates * damping + rates**2 * mass, damping + 2.0 * rates * mass, forces


def tone_phasor(tone: Tone, omega: float) -> tuple[int, complex]:
    """Return the order and the phasor of a tone, which is a sine."""
    return round(2.0 * pi * tone.frequency / omega), tone.amplitude * complex(np.exp(1j * tone.phase)) / 1j


def real_parts(phasors: Complex) -> Array:
    """Return the coefficients of cosines and sines of x, then of y, from phasors of shape (points, harmonics, 2, …)."""
    parts = np.concatenate([phasors.real, -phasors.imag[:, 1:]], axis=1)
    return np.concatenate([parts[:, :, 0], parts[:, :, 1]], axis=1)


@dataclass
class Forces:
    """The forces of the contact at the phases of a period, N, shape (points, phases)."""

    force_x: Array  # on the tip
    force_y: Array
    friction: Array
    normal: Array

    @property
    def on_tip(self) -> Array:
        """The forces on the tip along x and y, shape (points, phases, 2)."""
        return np.stack([self.force_x, self.force_y], axis=2)


@dataclass
class TouchingContact(Forces):
    """The contact at the phases of a period, and the derivatives of forces with respect to the unknowns."""

    slider: Array  # µm
    slope_x: Array  # derivative of force_x, shape (points, phases, unknowns)
    slope_y: Array
    slope_friction: Array


def moving_tip(stators: Stators, grid: Grid, unknowns: Array) -> tuple[Array, Array]:
    """Return the :data:`PINS` of a library at the phases, and the relative motion from the phase before in µm.

    The shapes are (6, points, phases) and (points, phases). The last of the pins, the slider, is 0.
    """
    width, omega = grid.shape.shape[1], grid.omega
    along, towards, surface = unknowns[:, :width], unknowns[:, width:-1], unknowns[:, -1:]
    x, y = along @ grid.shape.T - stators.sway, towards @ grid.shape.T
    pins = np.zeros((len(PINS), *x.shape))
    pins[:2] = x / MICRO, y / MICRO
    pins[2:4] = omega * along @ grid.rate.T, omega * towards @ grid.rate.T
    pins[4] = omega * surface / stators.radius
    return pins, (x - np.roll(x, 1, axis=1) - surface * grid.angles[1]) / MICRO


def touching_contact(stators: Stators, grid: Grid, unknowns: Array) -> TouchingContact:
    """Evaluate the contact: the unknowns are coefficients of x, of y, and the surface speed of the rotor over ω."""
    s, width, omega = stators, grid.shape.shape[1], grid.omega
    pins, slid = moving_tip(stators, grid, unknowns)
    constants = dict(zip(grid.parameters, s.contact.T[..., np.newaxis], strict=True))
    touching = grid.contact(constants | dict(zip(PINS, pins, strict=True)))
    depth = touching["delta"]
    before = np.roll(depth, 1, axis=1)
    landing = (depth > 0.0) & (before <= 0.0)  # the tip touches within the step that ends at the phase
    rise = np.where(landing, depth - before, 1.0)
    apart = np.where(landing, -before / rise, 0.0)  # share of the step before that
    pins[5], since = clipped(slid * (1.0 - apart), touching["limit"])
    # difference quotients; the speed of the shaft has no effect on the forces
    moved = [place for place, name in enumerate(PINS) if name != "shaft"]
    scales = np.abs(pins[moved]).max(axis=2, keepdims=True)
    steps = DIFFERENCE * np.where(scales > 0.0, scales, 1.0)
    many = np.repeat(pins[:, np.newaxis], 1 + len(moved), axis=1)
    for copy, place in enumerate(moved):
        many[place, 1 + copy] += steps[copy]
    found = grid.contact(constants | dict(zip(PINS, many, strict=True)))

    def by_pins(name: str) -> Array:
        values = np.broadcast_to(found[name], many.shape[1:])
        return np.asarray((values[1:] - values[0]) / steps)[..., np.newaxis]

    shape, rate = grid.shape / MICRO, omega * grid.rate
    none = np.zeros((*slid.shape, 1))

    def by(slope: Array) -> Array:
        return np.concatenate([slope[0] * shape + slope[2] * rate, slope[1] * shape + slope[3] * rate, none], axis=2)

    # a slider that sticks has moved with the tip since it was at its limit, perhaps in the period before, or since the
    # tip touched
    points, phases = slid.shape
    row, last = np.arange(points)[:, np.newaxis], since % phases
    d_slider = by(by_pins("limit"))[row, last]
    d_slider *= np.where(since >= -phases, np.sign(pins[5])[row, last], 0.0)[..., np.newaxis]
    d_slider[..., :width] += shape - shape[last]
    d_slider[..., -1] += grid.angles[1] / MICRO * (since - np.arange(phases))
    first = (last + 1) % phases
    share = np.where(landing[row, first] & (since != np.arange(phases)), apart[row, first], 0.0)[..., np.newaxis]
    d_depth = by(by_pins("delta"))
    d_rise = rise[row, first][..., np.newaxis]
    d_share = -(share * d_depth[row, first] + (1.0 - share) * d_depth[row, last]) / d_rise
    d_slider -= np.where(share > 0.0, d_share, 0.0) * slid[row, first][..., np.newaxis]
    d_slider[..., :width] -= share * (shape[first] - shape[last])
    d_slider[..., -1:] += share * grid.angles[1] / MICRO
    slopes = [by(slope) + slope[4] * d_slider for slope in map(by_pins, ("fx", "fy", "friction"))]
    forces = [np.broadcast_to(found[name], many.shape[1:])[0] for name in ("fx", "fy", "friction", "normal")]
    return TouchingContact(*[*forces, pins[5], *slopes])


def missed(stators: Stators, grid: Grid, response: Response, unknowns: Array, found: Forces) -> Array:
    """Return the residual of the equations in m with the forces of a contact that moves as the unknowns tell."""
    s, phasors = stators, grid.phasors(found.on_tip, grid.orders)
    driven = response.free + np.einsum("phxf,phf->phx", response.compliance, phasors)
    residual = np.empty_like(unknowns)
    residual[:, :-1] = unknowns[:, :-1] - real_parts(driven)
    # the rotor: held, or in balance with bearing and load
    unit, surface = (s.depth / s.grip)[:, 0], unknowns[:, -1]
    balance = grid.omega * s.drag[:, 0] * surface + s.load[:, 0] - found.friction.mean(axis=1)
    residual[:, -1] = np.where(s.turns[:, 0], unit * balance, surface - s.surface[:, 0])
    return residual


def clipped(slid: Array, limit: Array) -> tuple[Array, Array]:
    """Return the slider at each phase of the second of two periods, and the phase at which it last was at its limit.

    It begins at 0. The phase is negative in the period before; less than minus the number of phases means never.
    """
    steps, upper = np.ascontiguousarray(np.hstack([slid, slid]).T), np.ascontiguousarray(np.hstack([limit, limit]).T)
    free, sliders, at = np.empty_like(steps), np.empty_like(steps), np.zeros(len(slid))
    lower = -upper
    for place in range(len(steps)):
        np.add(at, steps[place], out=free[place])
        at = np.maximum(np.minimum(free[place], upper[place]), lower[place], out=sliders[place])
    phases = slid.shape[1]
    hit = np.where(np.abs(free) > upper, np.arange(-phases, phases)[:, np.newaxis], -phases - 1)
    return sliders[phases:].T, np.maximum.accumulate(hit, axis=0)[phases:].T
