# SPDX-License-Identifier: GPL-3.0-or-later
r"""A start for shooting that is nearly the steady state: harmonic balance of the tip, for many points together.

The stator is linear, so the motion of the tip follows from the two forces of the contact. With :math:`D_h` the harmonic
h of the displacement of tip and carrier along x and y, at k contacts, :math:`C_h` its dynamic compliance (2k × 2k) and
:math:`D^0_h` the response to the voltages and, for h = 0, to the preload,

.. math::
    D_h = D^0_h + C_h F_h(D), \qquad C_h = P\,(K - (h\omega)^2 M + jh\omega B)^{-1} P^T .

A compliance in series with the contact is a part of :math:`C_h`. The forces are those of the spring-slider's library at
some phases of the period; the relative motion moves its slider, and its limit clips it. A brush starts from the motion
of a single slider. Newton's method, with the derivative of these equations, finds the harmonics. It begins at rest, and
amplitudes follow their slow equations

.. math::
    (B + 2jh\omega M)\,\dot R_h = F - (K - (h\omega)^2 M + jh\omega B)\,R_h

by the implicit Euler rule, with steps that grow until they skip the transient: the motion that is found is as a rule
the one to which a motor runs up. T. M. Cameron, J. H. Griffin, J. Appl. Mech. 56, 149 (1989), for the alternation
between time and frequency; C. T. Kelley, D. E. Keyes, SIAM J. Numer. Anal. 35, 508 (1998), for the steps that grow;
P. Deuflhard, "Newton Methods for Nonlinear Problems", Springer 2004, for the damping.

For shooting the result is a start only: what ngspice finds from it does not depend on these equations. Differences
between motors that are close to each other may be taken of it (:func:`balanced_states`).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from math import ceil, nan, pi, sqrt
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.evaluated import DIFFERENCE, library_function, parameter_columns
from pyspice_runner.circuit.law import PAPER_LAW, Law, laws_of, libraries_of
from pyspice_runner.circuit.state import MICRO, static_places
from pyspice_runner.motor import groups
from pyspice_runner.motor.drive import Tone
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.stator import carriers, square
from pyspice_runner.run.point import Point
from pyspice_runner.spice.library import Library
from pyspice_runner.steady.copies import Plant

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Places = NDArray[np.int_]

HARMONICS = 7  # of the highest tone
PHASES = 64  # in a period of the highest tone
PINS = ("x", "y", "vx", "vy", "shaft", "slider")  # inputs of the library
MOVED = [0, 1, 2, 3, 5]  # places of those that change the forces: all but the speed of the shaft


class Grid:
    """The harmonics and the phases of a period, and the law of the contact."""

    def __init__(self, period: float, highest: int, library: Library) -> None:
        self.contact = library_function(library)
        self.parameters = list(library.defaults)
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


class _OfPoints:
    """Arrays of which the first axis is the operating point, as fields of a dataclass."""

    def of(self, some: Places) -> Self:
        """Return some of the points."""
        found = copy(self)
        for name, values in vars(self).items():
            setattr(found, name, values[some])
        return found


@dataclass
class Stators(_OfPoints):
    """Contacts and linear equations of some operating points; the first axis of each array is the point.

    Coordinates are those of modes and carriers; a point with fewer than others has some that do not move.
    """

    tip: Array  # what each coordinate moves the k contacts along x₁, y₁, x₂ and so on, shape (points, 2k, n)
    impedance: Complex  # force over displacement, shape (points, harmonics, n, n), N/m
    memory: Complex  # force over the rate of an amplitude that changes slowly, N s/m
    forces: Complex  # by voltages and preload, shape (points, harmonics, n), N
    direct: Complex  # motion of the contacts by the voltages through modes left out, shape (points, harmonics, 2k), m
    series: Array  # compliances in series, shape (points, 2k, 2k), m/N
    contact: Array  # parameters of the library, shape (points, k, parameters)
    preload: Array  # N; this and the following have the shape (points, k)
    sway: Array  # crown of the rotor, m
    radius: Array  # m
    lever: Array  # radius over that of the rotor
    grip: Array  # static limit of all friction forces, N; this and the following have the shape (points, 1)
    depth: Array  # largest static penetration, m
    surface: Array  # surface speed of a held shaft over ω, m
    turns: Array  # 1 for a free shaft, 0 for a held one
    drag: Array  # of the bearing at the surface of the rotor, N s/m
    load: Array  # force that the load takes there, N
    decay: Array  # time constant of the slowest mode or carrier, s


@dataclass
class Response(_OfPoints):
    """How the contacts answer their forces: D = free + compliance F."""

    gains: Complex  # of all coordinates, shape (points, harmonics, n, n), m/N
    coordinates: Complex  # without the contact, shape (points, harmonics, n), m
    compliance: Complex  # shape (points, harmonics, 2k, 2k), m/N
    free: Complex  # shape (points, harmonics, 2k), m


def response_of(stators: Stators, rate: Array, before: Complex) -> Response:
    """Return the response of amplitudes that change from those before at a rate in 1/s; 0 is the steady state."""
    memory = rate[:, np.newaxis, np.newaxis, np.newaxis] * stators.memory
    gains = np.linalg.inv(stators.impedance + memory)
    forces = stators.forces + np.einsum("phnm,phm->phn", memory, before)
    coordinates = np.einsum("phnm,phm->phn", gains, forces)
    tip = stators.tip[:, np.newaxis]
    compliance = np.asarray(tip @ gains @ np.swapaxes(tip, -1, -2), dtype=complex)
    compliance += stators.series[:, np.newaxis]  # which the contact forces compress
    return Response(
        np.asarray(gains, dtype=complex),
        coordinates,
        compliance,
        np.einsum("pxn,phn->phx", stators.tip, coordinates) + stators.direct,
    )


def stators_of(plants: Sequence[Plant], grid: Grid) -> Stators:
    """Return contacts and linear equations of operating points whose contacts have the library of the grid."""
    rows = []
    most = max(len(plant.moving[0]) for plant in plants)
    for plant in plants:
        motor, rest, radius = plant.motor, plant.motor.at_rest, plant.motor.rotor.radius_m
        rows.append((
            *linear(plant, grid.omega, grid.orders, most), motor.stator.residual, rest.preload_n,
            static_places(motor, plant.law, None)[:, 0], rest.radius_m, motor.stator.lever,
            [rest.friction @ rest.preload_n], [rest.depth_m.max()], [(plant.load.speed or 0.0) * radius / grid.omega],
            [float(plant.turns)], [motor.rotor.bearing_damping_n_m_s / radius**2],
            [(plant.load.torque or 0.0) / radius], [motor.stator.with_carrier(plant.mount).decay_s],
        ))  # fmt: skip
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    motors = [plant.motor.with_one_law() for plant in plants]
    parameters = np.array(list(parameter_columns(PAPER_LAW, motors).values())).T
    return Stators(*[*columns[:6], parameters.reshape(*columns[6].shape, -1), *columns[6:]])


def linear(plant: Plant, omega: float, orders: Array, most: int) -> tuple[Array, Complex, Complex, Complex, Complex]:
    """Return the first five fields of :class:`Stators` of one point, with so many coordinates."""
    stator, modes = plant.motor.stator.with_carrier(plant.mount), plant.modes
    count = len(stator.mass)
    impedance = np.tile(np.eye(most, dtype=complex), (len(orders), 1, 1))
    impedance[:, :count, :count] = stator.dynamic_stiffness(omega * orders)
    damping, mass = np.zeros((most, most)), np.zeros((most, most))
    for padded, own in ((damping, stator.damping), (mass, stator.mass)):
        padded[:count, :count] = square(own)
    rates = 1j * omega * orders[:, np.newaxis, np.newaxis]
    tip = np.pad(stator.contact, ((0, 0), (0, most - count)))
    forces, direct = np.zeros((len(orders), most), dtype=complex), np.zeros((len(orders), len(tip)), dtype=complex)
    moved = plant.motor.stator.residual_per_volt.T
    for tones, coupling, per_volt in zip(plant.drive.tones, stator.coupling.T, moved, strict=True):
        for tone in tones:
            order, phasor = tone_phasor(tone, omega)
            forces[order, :count] += coupling * phasor
            direct[order] += per_volt * phasor
    if stator.carriers:
        forces[0, modes] = plant.motor.contact.preload_n
    return tip, impedance, damping + 2.0 * rates * mass, forces, direct


def tone_phasor(tone: Tone, omega: float) -> tuple[int, complex]:
    """Return the order and the phasor of a tone, which is a sine."""
    return round(2.0 * pi * tone.frequency / omega), tone.amplitude * complex(np.exp(1j * tone.phase)) / 1j


def real_parts(phasors: Complex) -> Array:
    """Return coefficients of cosines and sines of x₁, of y₁ … from phasors, shape (points, harmonics, 2k, …)."""
    parts = np.concatenate([phasors.real, -phasors.imag[:, 1:]], axis=1).swapaxes(1, 2)
    return parts.reshape(len(parts), -1, *parts.shape[3:])


@dataclass
class Forces(_OfPoints):
    """The forces of the contacts at the phases of a period, N, shape (points, k, phases)."""

    force_x: Array  # on the tip
    force_y: Array
    friction: Array
    normal: Array

    @property
    def on_tip(self) -> Array:
        """The forces on the contacts along x₁, y₁, x₂ and so on, shape (points, phases, 2k)."""
        both = np.stack([self.force_x, self.force_y], axis=2)
        return both.reshape(len(both), -1, both.shape[-1]).swapaxes(1, 2)


@dataclass
class TouchingContact(Forces):
    """The contacts at the phases of a period, and the derivatives of forces with respect to their own unknowns."""

    slider: Array  # µm
    slope_x: Array  # derivative of force_x, shape (points, k, phases, unknowns)
    slope_y: Array
    slope_friction: Array


def moving_tip(stators: Stators, grid: Grid, unknowns: Array) -> tuple[Array, Array]:
    """Return the :data:`PINS` of a library at the phases, and the relative motion from the phase before in µm.

    The shapes are (6, points times k, phases) and (points times k, phases): contacts are as points. The last of the
    pins, the slider, is 0.
    """
    width, omega = grid.shape.shape[1], grid.omega
    moved, sway = unknowns[:, :-1].reshape(-1, 2 * width), stators.sway.reshape(-1, 1)
    along, towards, surface = moved[:, :width], moved[:, width:], (unknowns[:, -1:] * stators.lever).reshape(-1, 1)
    x, y = along @ grid.shape.T - sway, towards @ grid.shape.T
    pins = np.zeros((len(PINS), *x.shape))
    pins[:2] = x / MICRO, y / MICRO
    pins[2:4] = omega * along @ grid.rate.T, omega * towards @ grid.rate.T
    pins[4] = omega * surface / stators.radius.reshape(-1, 1)
    return pins, (x - np.roll(x, 1, axis=1) - surface * grid.angles[1]) / MICRO


def touching_contact(stators: Stators, grid: Grid, unknowns: Array) -> TouchingContact:
    """Evaluate the contacts: the unknowns are coefficients of x₁, of y₁ and so on, and the surface speed over ω.

    Those of the slopes are coefficients of the own x and y, and the surface speed at the contact over ω.
    """
    width, omega = grid.shape.shape[1], grid.omega
    pins, slid = moving_tip(stators, grid, unknowns)
    columns = stators.contact.reshape(len(slid), -1).T[..., np.newaxis]
    constants = dict(zip(grid.parameters, columns, strict=True))
    touching = grid.contact(constants | dict(zip(PINS, pins, strict=True)))
    depth = touching["delta"]
    before = np.roll(depth, 1, axis=1)
    landing = (depth > 0.0) & (before <= 0.0)  # the tip touches within the step that ends at the phase
    rise = np.where(landing, depth - before, 1.0)
    apart = np.where(landing, -before / rise, 0.0)  # share of the step before that
    pins[5], since = clipped(slid * (1.0 - apart), touching["limit"])
    # difference quotients
    scales = np.abs(pins[MOVED]).max(axis=2, keepdims=True)
    steps = DIFFERENCE * np.where(scales > 0.0, scales, 1.0)
    many = np.repeat(pins[:, np.newaxis], 1 + len(MOVED), axis=1)
    for number, place in enumerate(MOVED):
        many[place, 1 + number] += steps[number]
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
    every = (one.reshape(*stators.sway.shape, *one.shape[1:]) for one in (*forces, pins[5], *slopes))
    return TouchingContact(*every)


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


# --- solution ---

MOST_CONTACTS = 32  # beyond, the equations are too many
LARGEST = 4_000_000  # elements of the derivatives of points that are solved together: 32 MB
MOST_TONES = 4  # periods of the highest tone in that of the drive; beyond, the equations are too many
CLOSE = 1e-3  # last Newton step over the static penetration
QUICK, MOST_STEPS = 5, 12  # Newton steps below which the voltage may rise faster, and beyond which it must rise slower
FIRST_STEP, SHORTEST_STEP = 4.0, 0.1  # of the slow equations, in periods of the drive
LONGEST_STEP = 10.0  # of them, in decay times; beyond, the steady state is sought
GROWTH, MOST_TIMES = 2.0, 60  # by which a step may grow, and number of steps
LEAST_DAMPING = 1.0 / 64.0


def balanced(plants: Sequence[Plant], near: Sequence[Balance | None] = ()) -> list[Balance | None]:
    """Return the balanced motions of operating points; ``None`` where there is none.

    A free tip, laws without sliders and more than :data:`MOST_CONTACTS` contacts have none. A point starts from that of
    ``near``. Without one, the point with the middle speed of each curve runs up from rest, and the others start from
    it. A brush is balanced as a single slider.
    """
    found: list[Balance | None] = [None] * len(plants)
    groups: dict[tuple[float, Library, Law, int], dict[int, Plant]] = {}
    for place, plant in enumerate(plants):
        sliding = all(law.sliding for law in plant.laws)
        if plant.law and sliding and tones(plant) and len(plant.motor.touching) <= MOST_CONTACTS:
            library, count = libraries_of(plant.motor.with_one_law(), PAPER_LAW)[0], len(plant.motor.touching)
            groups.setdefault((plant.drive.period, library, plant.law, count), {})[place] = plant
    for (period, library, *_), some in groups.items():
        points = _Points(list(some.values()), Grid(period, max(map(tones, some.values())), library))
        points.solve([near[place] if near else None for place in some])
        for place, balance in zip(some, points.balances(), strict=True):
            found[place] = balance
    return found


def tones(plant: Plant) -> int:
    """Return the number of periods of the highest tone in that of the drive; 0 for too many."""
    count = round(max(plant.drive.frequencies) * plant.drive.period)
    return count if count <= MOST_TONES else 0


def _residual(stators: Stators, grid: Grid, response: Response, unknowns: Array) -> tuple[Array, Array]:
    """Return the residual of the equations in m, and its derivative."""
    s, found = stators, touching_contact(stators, grid, unknowns)
    phasors = grid.phasors(found.on_tip, grid.orders)
    driven = response.free + np.einsum("phxf,phf->phx", response.compliance, phasors)
    count = unknowns.shape[1]
    residual, derivative = np.empty_like(unknowns), np.empty((len(unknowns), count, count))
    residual[:, :-1] = unknowns[:, :-1] - real_parts(driven)
    # the motion by the forces of each contact, which depend on its own motion, then by the surface
    both = np.stack([grid.phasors(slope, grid.orders) for slope in (found.slope_x, found.slope_y)], axis=3)
    by_contact = response.compliance.reshape(*response.compliance.shape[:3], -1, 2).transpose(0, 3, 1, 2, 4) @ both
    moved = np.moveaxis(by_contact[..., :-1], 1, 3)
    derivative[:, :-1, :-1] = np.eye(count - 1) - real_parts(moved.reshape(*moved.shape[:3], -1))
    derivative[:, :-1, -1] = -real_parts(np.einsum("pkhx,pk->phx", by_contact[..., -1], s.lever))
    # the rotor: held, or in balance with bearing and load
    unit, turns, surface = (s.depth / s.grip)[:, 0], s.turns[:, 0], unknowns[:, -1]
    balance = grid.omega * s.drag[:, 0] * surface + s.load[:, 0] - (s.lever * found.friction.mean(axis=2)).sum(axis=1)
    residual[:, -1] = np.where(turns, unit * balance, surface - s.surface[:, 0])
    slopes = (turns * unit)[:, np.newaxis, np.newaxis] * s.lever[..., np.newaxis] * found.slope_friction.mean(axis=2)
    derivative[:, -1, :-1] = -slopes[..., :-1].reshape(len(slopes), -1)
    derivative[:, -1, -1] = -(s.lever * slopes[..., -1]).sum(axis=1)
    derivative[:, -1, -1] += np.where(turns, unit * grid.omega * s.drag[:, 0], 1.0)
    return residual, derivative


def _newton(
    stators: Stators, grid: Grid, response: Response, unknowns: Array
) -> tuple[Array, NDArray[np.bool_], Places]:
    """Return the unknowns, whether they are a solution, and the number of steps; steps are damped.

    A step is good if the next one with the same derivative is shorter.
    """
    if len(unknowns) > (most := max(1, LARGEST // unknowns.shape[1] ** 2)):
        some = np.array_split(np.arange(len(unknowns)), ceil(len(unknowns) / most))
        parts = [_newton(stators.of(part), grid, response.of(part), unknowns[part]) for part in some]
        values, solved, steps = (np.concatenate(several) for several in zip(*parts, strict=True))
        return values, solved, steps
    unknowns, size, count = unknowns.copy(), stators.depth[:, 0], len(unknowns)
    done, taken, damping = np.zeros(count, dtype=bool), np.zeros(count, dtype=int), np.ones(count)
    active = np.arange(count)
    left, derivative = _residual(stators, grid, response, unknowns)
    inverse = np.linalg.inv(derivative)
    step = -np.einsum("pij,pj->pi", inverse, left)
    for _ in range(MOST_STEPS):
        trial = unknowns[active] + damping[active, np.newaxis] * step
        left, derivative = _residual(stators.of(active), grid, response.of(active), trial)
        after = -np.einsum("pij,pj->pi", inverse, left)
        length, later = np.linalg.norm(step, axis=1), np.linalg.norm(after, axis=1)
        near = later < CLOSE * size[active]
        better = near | (later < (1.0 - 0.25 * damping[active]) * length)
        taken[active] += 1
        unknowns[active[better]] = trial[better]
        unknowns[active[near]] += after[near]  # the step that is left, by the derivative of the last one
        done[active[near]] = True
        damping[active] *= np.where(better, 2.0, 0.5)
        damping[active] = np.minimum(damping[active], 1.0)
        fresh = np.linalg.inv(derivative[better])
        inverse[better] = fresh
        step[better] = -np.einsum("pij,pj->pi", fresh, left[better])
        kept = ~near & (damping[active] >= LEAST_DAMPING)
        active, step, inverse = active[kept], step[kept], inverse[kept]
        if not len(active):
            break
    return unknowns, done, taken


def _coordinates(stators: Stators, grid: Grid, response: Response, forces: Forces) -> Complex:
    """Return the phasors of the coordinates."""
    pushed = np.einsum("pxn,phx->phn", stators.tip, grid.phasors(forces.on_tip, grid.orders))
    return np.asarray(response.coordinates + np.einsum("phnm,phm->phn", response.gains, pushed))


class _Points:
    """Operating points on the way to their balanced motions."""

    def __init__(self, plants: Sequence[Plant], grid: Grid) -> None:
        self.plants, self.grid = plants, grid
        self.stators = stators_of(plants, grid)
        self.steady = response_of(self.stators, np.zeros(len(plants)), np.zeros_like(self.stators.forces))
        self.unknowns = np.zeros((len(plants), self.stators.tip.shape[1] * grid.shape.shape[1] + 1))
        self.found = np.zeros(len(plants), dtype=bool)
        self.speeds = self.stators.surface[:, 0]
        curves: dict[str, list[int]] = {}
        for place in np.argsort(self.speeds, kind="stable").tolist():
            curves.setdefault(plants[place].curve, []).append(place)
        self.curves = list(curves.values())

    def solve(self, near: Sequence[Balance | None]) -> None:
        """Solve the points: from given motions, from rest, and from the nearest solved point of the same curve."""
        starts = {
            place: one.unknowns
            for place, one in enumerate(near)
            if one and one.unknowns.shape == self.unknowns[0].shape
        }
        self._start(np.array([*starts], dtype=int), np.array([*starts.values()]))
        self._run_up([curve[len(curve) // 2] for curve in self.curves if not self.found[curve].any()])
        tried: set[tuple[int, int]] = set()
        while pairs := [pair for pair in self._neighbours() if pair not in tried]:  # until no new one is found
            tried |= set(pairs)
            some, others = np.array(pairs).T
            self._start(some, self.unknowns[others].copy())
        self._run_up(np.flatnonzero(~self.found))

    def _neighbours(self) -> list[tuple[int, int]]:
        """Return each point that is not solved, with the nearest solved one of its curve."""
        pairs = list[tuple[int, int]]()
        for curve in map(np.array, self.curves):
            solved, lost = curve[self.found[curve]], curve[~self.found[curve]]
            distance = np.abs(self.speeds[lost][:, np.newaxis] - self.speeds[solved])
            if len(solved):
                pairs += zip(lost.tolist(), solved[distance.argmin(axis=1)].tolist(), strict=True)
        return pairs

    def _run_up(self, places: Sequence[int] | Places) -> None:
        """Let points run to their steady state from rest, by the slow equations with steps that grow."""
        places, grid = np.array(places, dtype=int), self.grid
        stators, count = self.stators.of(places), len(places)
        unknowns = np.zeros((count, self.unknowns.shape[1]))
        unknowns[:, -1] = stators.surface[:, 0]
        coordinates = np.zeros(stators.forces.shape, dtype=complex)
        # the preload bends the modes and compresses what is in series; of a carrier it is balanced
        pressed = stators.forces[:, 0] - np.einsum("pk,pkn->pn", stators.preload, stators.tip[:, 1::2])
        coordinates[:, 0] = np.linalg.solve(stators.impedance[:, 0], pressed[..., np.newaxis])[..., 0]
        width = grid.shape.shape[1]
        unknowns[:, width : -1 : 2 * width] = np.einsum("pkn,pn->pk", stators.tip[:, 1::2], coordinates[:, 0].real)
        unknowns[:, width : -1 : 2 * width] -= np.einsum("pkl,pl->pk", stators.series[:, 1::2, 1::2], stators.preload)
        step = np.full(count, FIRST_STEP * 2.0 * pi / grid.omega)
        reached, lost = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        for _ in range(MOST_TIMES):
            active = np.flatnonzero(~(reached | lost))
            if not len(active):
                break
            some = stators.of(active)
            final = step[active] > LONGEST_STEP * some.decay[:, 0]
            response = response_of(some, np.where(final, 0.0, 1.0 / step[active]), coordinates[active])
            found, good, taken = _newton(some, grid, response, unknowns[active])
            moved = active[good]
            unknowns[moved] = found[good]
            coordinates[moved] = _coordinates(some, grid, response, touching_contact(some, grid, found))[good]
            reached[active] = good & final
            step[active] *= np.where(good, np.where(taken <= QUICK, GROWTH, 1.0), 0.25)
            lost[active] = step[active] < SHORTEST_STEP * 2.0 * pi / grid.omega
        self.unknowns[places], self.found[places] = unknowns, reached

    def _start(self, some: Places, guess: Array) -> None:
        if len(some):
            guess[:, -1] = np.where(self.stators.turns[some, 0], guess[:, -1], self.speeds[some])
            own = self.stators.of(some), self.grid, self.steady.of(some)
            self.unknowns[some], self.found[some], _ = _newton(*own, guess)

    def balances(self) -> list[Balance | None]:
        """Return the motions that were found."""
        found: list[Balance | None] = [None] * len(self.plants)
        places = np.flatnonzero(self.found)
        if not len(places):
            return found
        own, unknowns, steady = self.stators.of(places), self.unknowns[places], self.steady.of(places)
        touching = touching_contact(own, self.grid, unknowns)
        forces = Forces(touching.force_x, touching.force_y, touching.friction, touching.normal)
        coordinates = _coordinates(own, self.grid, steady, forces)
        for number, place in enumerate(places.tolist()):
            found[place] = Balance(
                self.plants[place], self.grid, unknowns[number], coordinates[number],
                forces.of(np.array([number])), touching.slider[number, :, 0],
            )  # fmt: skip
        return found


@dataclass(frozen=True)
class Balance:
    """The balanced motion of an operating point."""

    plant: Plant
    grid: Grid
    unknowns: Array  # coefficients of x₁, of y₁ and so on, and the surface speed of the rotor over ω
    coordinates: Complex  # phasors of modes and carriers, shape (harmonics, n), m
    forces: Forces  # of this point
    sliders: Array  # of the contacts at t = 0, µm

    @property
    def speed(self) -> float:
        """Speed of the rotor in rad/s."""
        return float(self.unknowns[-1]) * self.grid.omega / self.plant.motor.rotor.radius_m

    def phasors(self, group: str) -> tuple[Complex, Complex]:
        """Return the phasors of voltage (V) and current (A) of a group at the harmonics."""
        plant, orders = self.plant, self.grid.orders
        place = GROUPS.index(group)
        couplings = plant.motor.stator.coupling[:, place]
        volts, amperes = np.zeros((2, len(orders)), dtype=complex)
        amperes += 1j * self.grid.omega * orders * (self.coordinates[:, : plant.modes] @ couplings)
        if (moved := plant.motor.stator.residual_per_volt[:, place]).any():
            on_tip = self.grid.phasors(self.forces.on_tip[0], orders)
            amperes += 1j * self.grid.omega * orders * (on_tip @ moved)
        for at, tones in enumerate(plant.drive.tones):
            for tone in tones:
                order, phasor = tone_phasor(tone, self.grid.omega)
                amperes[order] += plant.dielectrics[tone.frequency][place, at] * phasor
                volts[order] += phasor if at == place else 0.0
        return volts, amperes

    @property
    def state(self) -> Array:
        """The state at t = 0, with twice as many harmonics of the forces as were balanced."""
        plant, grid = self.plant, self.grid
        orders = np.arange(2.0 * len(grid.orders) - 1.0)
        count = plant.modes + len(carriers(plant.mount))
        tip, impedance, _, forces, direct = linear(plant, grid.omega, orders, count)
        forces += grid.phasors(self.forces.on_tip[0], orders) @ tip
        coordinates = np.linalg.solve(impedance, forces[..., np.newaxis])[..., 0]
        state, (displacements, velocities) = np.zeros(plant.order), plant.moving
        state[displacements] = coordinates.sum(axis=0).real
        state[velocities] = (1j * grid.omega * orders @ coordinates).real
        for sliders, slid in zip(plant.sliders, self.sliders, strict=True):
            state[sliders] = MICRO * slid
        if plant.motor.feedback:
            stator, charge = plant.motor.stator, -coordinates[:, : plant.modes] @ plant.motor.stator.sensed
            state[plant.places["feedback"]] = (stator.feedback_gain(grid.omega * orders) @ charge).real
        stem = []
        moved, moving = direct.sum(axis=0).real, (1j * grid.omega * orders @ direct).real
        for number, one in enumerate(plant.motor.touching):
            contact = one.contact
            for axis, series, force, rest in (
                (1, contact.series_compliance_m_per_n, self.forces.normal[0, number], one.preload_n),
                (0, contact.tangential_series_compliance_m_per_n, self.forces.friction[0, number], 0.0),
            ):
                if series:
                    rate, at = (force[1] - force[-1]) * grid.omega / (2.0 * grid.angles[1]), 2 * number + axis
                    stem += [series * (force[0] - rest) - moved[at], series * rate - moving[at]]
        state[plant.places["stem"]] = stem
        if plant.turns:
            state[-1] = self.speed
        return state


# --- quantities ---

QUANTITIES = (
    "speed_rad_s", "torque_n_m", "load_torque_n_m", "normal_force_n", "power_a_w", "power_b_w", "current_a_rms_a",
    "current_b_rms_a", "current_a_phase_deg", "current_b_phase_deg",
)  # fmt: skip


@dataclass(frozen=True)
class BalancedState:
    """An operating point by harmonic balance."""

    values: dict[str, float]  # of :data:`QUANTITIES`
    solution: Balance  # a start for others


def balances(setup: Point) -> bool:
    """Return whether harmonic balance describes a point: paper's contact, linear modes, few harmonics of the drive."""
    laws = laws_of(setup.motor, setup.law)
    if setup.source.ideal is None or not laws or not all("averaged" in law.forms for law in laws):
        return False
    stator = setup.motor.stator
    return not (stator.softening.any() or stator.growth.any()) and tones(Plant.of(setup)) > 0


def balanced_states(setups: Sequence[Point], starts: Sequence[Balance | None]) -> list[BalancedState | None]:
    """Return the points by harmonic balance; ``None`` where it has no solution. ``starts`` are solutions nearby."""
    solved = balanced([Plant.of(setup) for setup in setups], starts)
    return [None if one is None else _state(one) for one in solved]


def _state(balance: Balance) -> BalancedState:
    motor, plant = balance.plant.motor, balance.plant
    torque = motor.rotor.radius_m * float(motor.stator.lever @ balance.forces.friction[0].mean(axis=1))
    bearing = motor.rotor.bearing_damping_n_m_s * balance.speed
    dry = float(np.sign(plant.load.speed or 0.0)) * motor.rotor.bearing_friction_n_m
    values = {
        "speed_rad_s": balance.speed, "torque_n_m": torque, "load_torque_n_m": torque - bearing - dry,
        "normal_force_n": float(balance.forces.normal[0].mean(axis=1).sum()),
    }  # fmt: skip
    for group in "ab":
        volts, amperes = balance.phasors(group)
        values[groups.column("power", group, "w")] = 0.5 * float(np.vdot(volts, amperes).real)
        values[groups.column("current", group, "rms_a")] = float(np.linalg.norm(amperes)) / sqrt(2.0)
        (orders,) = np.nonzero(volts)
        ahead = np.angle(amperes[orders[0]] / volts[orders[0]], deg=True) if len(orders) == 1 else nan
        values[groups.column("current", group, "phase_deg")] = float(ahead)
    return BalancedState(values, balance)
