# SPDX-License-Identifier: GPL-3.0-or-later
r"""A start for shooting that is nearly the steady state: harmonic balance of the tip, for many points together.

The stator is linear, so the motion of the tip follows from the two forces of the contact. With :math:`D_h` the harmonic
h of the displacement of tip and carrier along x and y, :math:`C_h` its dynamic compliance (2 × 2) and :math:`D^0_h` the
response to the voltages and, for h = 0, to the preload,

.. math::
    D_h = D^0_h + C_h F_h(D), \qquad C_h = P\,(K - (h\omega)^2 M + jh\omega B)^{-1} P^T .

A compliance in series with the contact is a part of :math:`C_h`. The forces are those of the spring-slider's library
(:mod:`.evaluated`) at some phases of the period; the relative motion moves its slider, and its limit clips it. Newton's
method, with the derivative of these equations, finds the harmonics. It begins at rest, and amplitudes follow
their slow equations

.. math::
    (B + 2jh\omega M)\,\dot R_h = F - (K - (h\omega)^2 M + jh\omega B)\,R_h

by the implicit Euler rule, with steps that grow until they skip the transient: the motion that is found is as a rule
the one to which a motor runs up. T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56, 149 (1989), for the alternation
between time and frequency; C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35, 508 (1998), for the steps that grow;
P. Deuflhard, "Newton Methods for Nonlinear Problems", Springer 2004, for the damping.

The result is a start only: what ngspice finds from it does not depend on these equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import pi
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.parameters import Mode, Mount
from pyspice_runner.model.recoil import carriers, mass_matrix
from pyspice_runner.netlist.contact import PAPER_LAW, Law, contact_library
from pyspice_runner.netlist.copies import Plant
from pyspice_runner.netlist.evaluated import DIFFERENCE, library_function, parameter_columns
from pyspice_runner.netlist.library import Library
from pyspice_runner.netlist.state import MICRO, static_sway

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Places = NDArray[np.int_]

HARMONICS = 7  # of the highest tone
PHASES = 64  # in a period of the highest tone
MOST_TONES = 4  # periods of the highest tone in that of the drive; beyond, the equations are too many
CLOSE = 1e-3  # last Newton step over the static penetration
QUICK, MOST_STEPS = 5, 12  # Newton steps below which the voltage may rise faster, and beyond which it must rise slower
FIRST_STEP, SHORTEST_STEP = 4.0, 0.1  # of the slow equations, in periods of the drive
LONGEST_STEP = 10.0  # of them, in decay times; beyond, the steady state is sought
GROWTH, MOST_TIMES = 2.0, 60  # by which a step may grow, and number of steps
LEAST_DAMPING = 1.0 / 64.0
PINS = ("x", "y", "vx", "vy", "shaft", "slider")  # inputs of the library


def harmonic_starts(plants: Sequence[Plant]) -> list[Array | None]:
    """Return the states at t = 0 from which shooting begins; ``None`` where there is none.

    The drives have the same period. Of each curve the point with the middle speed runs up from rest, the others start
    from it. A free tip and laws without sliders have no such start.
    """
    starts: list[Array | None] = [None] * len(plants)
    groups: dict[Library, list[int]] = {}
    for place, plant in enumerate(plants):
        if plant.law and plant.law.sliding and tones(plant):
            groups.setdefault(contact_library(PAPER_LAW, plant.motor.contact), []).append(place)
    for library, places in groups.items():
        some = [plants[place] for place in places]
        grid = _Grid(some[0].drive.period, max(map(tones, some)), library)
        for place, state in zip(places, _solved(some, grid), strict=True):
            starts[place] = state
    return starts


def tones(plant: Plant) -> int:
    """Return the number of periods of the highest tone in that of the drive; 0 for too many."""
    count = round(max(plant.drive.frequencies) * plant.drive.period)
    return count if count <= MOST_TONES else 0


class _Grid:
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
class _Stators:
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
class _Response:
    """How the tip answers forces of the contact: D = free + compliance F."""

    gains: Complex  # of all coordinates, shape (points, harmonics, n, n), m/N
    coordinates: Complex  # without the contact, shape (points, harmonics, n), m
    compliance: Complex  # shape (points, harmonics, 2, 2), m/N
    free: Complex  # shape (points, harmonics, 2), m

    def of(self, some: Places) -> Self:
        """Return some of the points."""
        return type(self)(*(getattr(self, one.name)[some] for one in fields(self)))


def _response(stators: _Stators, rate: Array, before: Complex) -> _Response:
    """Return the response of amplitudes that change from those before at a rate in 1/s; 0 is the steady state."""
    memory = rate[:, np.newaxis, np.newaxis, np.newaxis] * stators.memory
    gains = np.linalg.inv(stators.impedance + memory)
    forces = stators.forces + np.einsum("phnm,phm->phn", memory, before)
    coordinates = np.einsum("phnm,phm->phn", gains, forces)
    tip = stators.tip[:, np.newaxis]
    compliance = np.asarray(tip @ gains @ np.swapaxes(tip, -1, -2), dtype=complex)
    compliance[..., [0, 1], [0, 1]] += stators.series[:, np.newaxis]  # which the contact force compresses
    return _Response(
        np.asarray(gains, dtype=complex), coordinates, compliance, np.einsum("pxn,phn->phx", stators.tip, coordinates)
    )


def _stators(plants: Sequence[Plant], grid: _Grid) -> _Stators:
    rows = []
    most = max(len(plant.motor.modes) + len(carriers(plant.mount)) for plant in plants)
    for plant in plants:
        motor, contact = plant.motor, plant.motor.contact
        preload, radius = contact.preload_n, motor.rotor.radius_m
        springs: list[Mode | Mount] = [*motor.modes, *carriers(plant.mount)]
        rows.append((
            *_linear(plant, grid.omega, grid.orders, most), preload, contact.friction * preload,
            contact_law.static_penetration(contact), static_sway(motor, plant.law, None), radius,
            (plant.load.speed or 0.0) * radius / grid.omega, float(plant.turns),
            motor.rotor.bearing_damping_n_m_s / radius**2, (plant.load.torque or 0.0) / radius,
            max(2.0 * spring.mass_kg / spring.damping_n_s_per_m for spring in springs),
        ))  # fmt: skip
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    contacts = [plant.motor.contact for plant in plants]
    series = [[one.tangential_series_compliance_m_per_n, one.series_compliance_m_per_n] for one in contacts]
    parameters = np.array(list(_parameters(plants, PAPER_LAW).values())).T
    scalars = [column[:, np.newaxis] for column in columns[4:]]
    return _Stators(*[*columns[:4], parameters, np.array(series), *scalars])


def _parameters(plants: Sequence[Plant], law: Law) -> dict[str, Array]:
    """Return the parameters of the library of a law, each of shape (points,)."""
    motors = [plant.motor for plant in plants]
    bent = [
        contact_law.static_deflection(motor.contact, motor.modes)
        + motor.contact.preload_n * motor.contact.series_compliance_m_per_n
        for motor in motors
    ]
    return parameter_columns(law, motors, bent)


def _linear(plant: Plant, omega: float, orders: Array, most: int) -> tuple[Array, Complex, Complex, Complex]:
    """Return the first four fields of :class:`_Stators` of one point, with so many coordinates."""
    motor, moving = plant.motor, carriers(plant.mount)
    springs: list[Mode | Mount] = [*motor.modes, *moving]
    count, modes = len(springs), plant.modes
    stiffness, damping, mass = np.eye(most), np.zeros((most, most)), np.zeros((most, most))
    place = np.arange(count)
    stiffness[place, place] = [spring.stiffness_n_per_m for spring in springs]
    damping[place, place] = [spring.damping_n_s_per_m for spring in springs]
    mass[:count, :count] = mass_matrix(motor.modes, plant.mount)
    rates = 1j * omega * orders[:, np.newaxis, np.newaxis]
    tip = np.zeros((2, most))
    tip[:, :modes] = [[mode.tip_x for mode in motor.modes], [mode.tip_y for mode in motor.modes]]
    for number in range(len(moving)):
        tip[1 - number, modes + number] = 1.0  # the carrier along y, then along x
    forces = np.zeros((len(orders), most), dtype=complex)
    for group in "ab":
        coupling = np.array([getattr(mode, f"coupling_{group}_n_per_v") for mode in motor.modes])
        for tone in getattr(plant.drive, f"tones_{group}"):
            order = round(2.0 * pi * tone.frequency / omega)
            forces[order, :modes] += coupling * tone.amplitude * np.exp(1j * tone.phase) / 1j  # a sine
    if moving:
        forces[0, modes] = motor.contact.preload_n
    return tip, stiffness + rates * damping + rates**2 * mass, damping + 2.0 * rates * mass, forces


def _real(phasors: Complex) -> Array:
    """Return the coefficients of cosines and sines of x, then of y, from phasors of shape (points, harmonics, 2, …)."""
    parts = np.concatenate([phasors.real, -phasors.imag[:, 1:]], axis=1)
    return np.concatenate([parts[:, :, 0], parts[:, :, 1]], axis=1)


@dataclass
class _Contact:
    """The contact at the phases of a period, and the derivatives of forces with respect to the unknowns."""

    force_x: Array  # on the tip, N, shape (points, phases)
    force_y: Array
    friction: Array
    normal: Array
    pins: Array  # of the library: x, y, vx, vy, shaft, slider, shape (6, points, phases)
    slid: Array  # relative motion from the phase before, µm
    slope_x: Array  # derivative of force_x, shape (points, phases, unknowns)
    slope_y: Array
    slope_friction: Array


def _touching(stators: _Stators, grid: _Grid, unknowns: Array) -> _Contact:
    """Evaluate the contact: the unknowns are coefficients of x, of y, and the surface speed of the rotor over ω."""
    s, width, omega = stators, grid.shape.shape[1], grid.omega
    along, towards, surface = unknowns[:, :width], unknowns[:, width:-1], unknowns[:, -1:]
    x, y = along @ grid.shape.T - s.sway, towards @ grid.shape.T
    slid = (x - np.roll(x, 1, axis=1) - surface * grid.angles[1]) / MICRO
    pins = np.zeros((len(PINS), *x.shape))
    pins[:2] = x / MICRO, y / MICRO
    pins[2:4] = omega * along @ grid.rate.T, omega * towards @ grid.rate.T
    pins[4] = omega * surface / s.radius
    constants = dict(zip(grid.parameters, s.contact.T[..., np.newaxis], strict=True))
    limit = grid.contact(constants | dict(zip(PINS, pins, strict=True)))["limit"]
    pins[5], since = _clipped(slid, limit)
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
    none = np.zeros((*x.shape, 1))

    def by(slope: Array) -> Array:
        return np.concatenate([slope[0] * shape + slope[2] * rate, slope[1] * shape + slope[3] * rate, none], axis=2)

    # a slider that sticks has moved with the tip since it was at its limit, perhaps in the period before
    points, phases = x.shape
    row, last = np.arange(points)[:, np.newaxis], since % phases
    d_slider = by(by_pins("limit"))[row, last]
    d_slider *= np.where(since >= -phases, np.sign(pins[5])[row, last], 0.0)[..., np.newaxis]
    d_slider[..., :width] += shape - shape[last]
    d_slider[..., -1] += grid.angles[1] / MICRO * (since - np.arange(phases))
    slopes = [by(slope) + slope[4] * d_slider for slope in map(by_pins, ("fx", "fy", "friction"))]
    forces = [np.broadcast_to(found[name], many.shape[1:])[0] for name in ("fx", "fy", "friction", "normal")]
    return _Contact(*[*forces, pins, slid, *slopes])


def _clipped(slid: Array, limit: Array) -> tuple[Array, Array]:
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


def _residual(stators: _Stators, grid: _Grid, response: _Response, unknowns: Array) -> tuple[Array, Array]:
    """Return the residual of the equations in m, and its derivative."""
    s, found = stators, _touching(stators, grid, unknowns)
    forces = grid.phasors(np.stack([found.force_x, found.force_y], axis=2), grid.orders)
    slopes = np.stack([grid.phasors(each, grid.orders) for each in (found.slope_x, found.slope_y)], axis=2)
    driven = response.free + np.einsum("phxf,phf->phx", response.compliance, forces)
    count = unknowns.shape[1]
    missed, derivative = np.empty((len(unknowns), count)), np.empty((len(unknowns), count, count))
    missed[:, :-1] = unknowns[:, :-1] - _real(driven)
    derivative[:, :-1] = np.eye(count)[:-1] - _real(response.compliance @ slopes)
    # the rotor: held, or in balance with bearing and load
    unit = (s.depth / s.grip)[:, 0]
    turns, surface = s.turns[:, 0], unknowns[:, -1]
    balance = grid.omega * s.drag[:, 0] * surface + s.load[:, 0] - found.friction.mean(axis=1)
    missed[:, -1] = np.where(turns, unit * balance, surface - s.surface[:, 0])
    derivative[:, -1] = -(turns * unit)[:, np.newaxis] * found.slope_friction.mean(axis=1)
    derivative[:, -1, -1] += np.where(turns, unit * grid.omega * s.drag[:, 0], 1.0)
    return missed, derivative


def _newton(
    stators: _Stators, grid: _Grid, response: _Response, unknowns: Array
) -> tuple[Array, NDArray[np.bool_], Places]:
    """Return the unknowns, whether they are a solution, and the number of steps; steps are damped.

    A step is good if the next one with the same derivative is shorter.
    """
    unknowns, size, count = unknowns.copy(), stators.depth[:, 0], len(unknowns)
    done, taken, damping = np.zeros(count, dtype=bool), np.zeros(count, dtype=int), np.ones(count)
    active = np.arange(count)
    missed, derivative = _residual(stators, grid, response, unknowns)
    inverse = np.linalg.inv(derivative)
    step = -np.einsum("pij,pj->pi", inverse, missed)
    for _ in range(MOST_STEPS):
        trial = unknowns[active] + damping[active, np.newaxis] * step
        missed, derivative = _residual(stators.of(active), grid, response.of(active), trial)
        after = -np.einsum("pij,pj->pi", inverse, missed)
        length, later = np.linalg.norm(step, axis=1), np.linalg.norm(after, axis=1)
        near = later < CLOSE * size[active]
        better = near | (later < (1.0 - 0.25 * damping[active]) * length)
        taken[active] += 1
        unknowns[active[better]] = trial[better]
        done[active[near]] = True
        damping[active] *= np.where(better, 2.0, 0.5)
        damping[active] = np.minimum(damping[active], 1.0)
        fresh = np.linalg.inv(derivative[better])
        inverse[better] = fresh
        step[better] = -np.einsum("pij,pj->pi", fresh, missed[better])
        kept = ~near & (damping[active] >= LEAST_DAMPING)
        active, step, inverse = active[kept], step[kept], inverse[kept]
        if not len(active):
            break
    return unknowns, done, taken


def _coordinates(stators: _Stators, grid: _Grid, response: _Response, unknowns: Array) -> Complex:
    """Return the phasors of the coordinates."""
    found = _touching(stators, grid, unknowns)
    forces = grid.phasors(np.stack([found.force_x, found.force_y], axis=2), grid.orders)
    pushed = np.einsum("pxn,phx->phn", stators.tip, forces)
    return np.asarray(response.coordinates + np.einsum("phnm,phm->phn", response.gains, pushed))


def _run_up(stators: _Stators, grid: _Grid) -> tuple[Array, NDArray[np.bool_]]:
    """Return the unknowns of points that run from rest to their steady state, and whether they reached it.

    The amplitudes follow their slow equations by the implicit Euler rule, with steps that grow.
    """
    count = len(stators.depth)
    unknowns = np.zeros((count, 2 * grid.shape.shape[1] + 1))
    unknowns[:, -1] = stators.surface[:, 0]
    coordinates = np.zeros(stators.forces.shape, dtype=complex)
    # the preload bends the modes; of a carrier it is balanced
    pressed = stators.forces[:, 0] - stators.preload * stators.tip[:, 1]
    coordinates[:, 0] = np.linalg.solve(stators.impedance[:, 0], pressed[..., np.newaxis])[..., 0]
    unknowns[:, grid.shape.shape[1]] = np.einsum("pn,pn->p", stators.tip[:, 1], coordinates[:, 0].real)
    step = np.full(count, FIRST_STEP * 2.0 * pi / grid.omega)
    reached, lost = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
    for _ in range(MOST_TIMES):
        active = np.flatnonzero(~(reached | lost))
        if not len(active):
            break
        some = stators.of(active)
        final = step[active] > LONGEST_STEP * some.decay[:, 0]
        response = _response(some, np.where(final, 0.0, 1.0 / step[active]), coordinates[active])
        found, good, taken = _newton(some, grid, response, unknowns[active])
        moved = active[good]
        unknowns[moved] = found[good]
        coordinates[moved] = _coordinates(some, grid, response, found)[good]
        reached[active] = good & final
        step[active] *= np.where(good, np.where(taken <= QUICK, GROWTH, 1.0), 0.25)
        lost[active] = step[active] < SHORTEST_STEP * 2.0 * pi / grid.omega
    return unknowns, reached


def _solved(plants: Sequence[Plant], grid: _Grid) -> list[Array | None]:
    """Return the states of operating points at t = 0; ``None`` where no solution was found."""
    stators = _stators(plants, grid)
    steady = _response(stators, np.zeros(len(plants)), np.zeros_like(stators.forces))
    curves: dict[str, list[int]] = {}
    for place, plant in enumerate(plants):
        curves.setdefault(plant.curve, []).append(place)
    unknowns = np.zeros((len(plants), 2 * grid.shape.shape[1] + 1))
    found = np.zeros(len(plants), dtype=bool)

    def run_up(some: Places) -> None:
        unknowns[some], found[some] = _run_up(stators.of(some), grid)

    speeds = stators.surface[:, 0]
    ordered = [sorted(curve, key=lambda place: speeds[place]) for curve in curves.values()]
    run_up(np.array([curve[len(curve) // 2] for curve in ordered]))
    tried: set[tuple[int, int]] = set()
    while True:  # from the nearest solved point of the curve, until no new one is found
        pairs = []
        for curve in ordered:
            solved = [place for place in curve if found[place]]
            for place in curve if solved else ():
                other = min(solved, key=lambda one: abs(speeds[one] - speeds[place]))
                if not found[place] and (place, other) not in tried:
                    pairs.append((place, other))
        if not pairs:
            break
        tried |= set(pairs)
        some, others = np.array(pairs).T
        guess = unknowns[others].copy()
        guess[:, -1] = np.where(stators.turns[some, 0], guess[:, -1], speeds[some])
        unknowns[some], found[some], _ = _newton(stators.of(some), grid, steady.of(some), guess)
    lost = np.flatnonzero(~found)
    if len(lost):
        run_up(lost)
    return [
        _state(plant, grid, stators.of(np.array([place])), unknowns[place : place + 1]) if found[place] else None
        for place, plant in enumerate(plants)
    ]


def _state(plant: Plant, grid: _Grid, stators: _Stators, unknowns: Array) -> Array:
    """Return the state at t = 0, with twice as many harmonics of the forces as were balanced."""
    touching = _touching(stators, grid, unknowns)
    orders = np.arange(2.0 * len(grid.orders) - 1.0)
    count = plant.modes + len(carriers(plant.mount))
    tip, impedance, _, forces = _linear(plant, grid.omega, orders, count)
    forces += grid.phasors(np.stack([touching.force_x[0], touching.force_y[0]], axis=1), orders) @ tip
    coordinates = np.linalg.solve(impedance, forces[..., np.newaxis])[..., 0]
    displacements = coordinates.sum(axis=0).real
    velocities = (1j * grid.omega * orders @ coordinates).real
    modes, state = plant.modes, np.zeros(plant.order)
    state[:modes], state[modes : 2 * modes] = displacements[:modes], velocities[:modes]
    state[plant.where("contact")] = _sliders(plant, touching)
    contact, stem = plant.motor.contact, []
    for series, force, rest in (
        (contact.series_compliance_m_per_n, touching.normal[0], contact.preload_n),
        (contact.tangential_series_compliance_m_per_n, touching.friction[0], 0.0),
    ):
        if series:
            rate = (force[1] - force[-1]) * grid.omega / (2.0 * grid.angles[1])
            stem += [series * (force[0] - rest), series * rate]
    state[plant.where("stem")] = stem
    state[plant.carrier] = np.column_stack([displacements[modes:], velocities[modes:]]).ravel()
    if plant.turns:
        state[-1] = unknowns[0, -1] * grid.omega / plant.motor.rotor.radius_m
    return state


def _sliders(plant: Plant, touching: _Contact) -> Array:
    """Return the slider, or those of a brush on the same motion, at t = 0, in m."""
    law = plant.law
    if law is None or law.sliders is None:
        return MICRO * touching.pins[-1, :, 0]
    constants = {name: values[0] for name, values in _parameters([plant], law).items()}
    pins = dict(zip(PINS, touching.pins[:, 0], strict=True))
    brush = library_function(contact_library(law))
    found = brush(constants | pins | dict.fromkeys(brush.states, 0.0))
    wide, limit = (np.stack([found[f"{node}{1 + cell}"] for cell in range(law.sliders)]) for node in "wl")
    sliders, _ = _clipped(wide * touching.slid, limit)
    return MICRO * sliders[:, 0]
