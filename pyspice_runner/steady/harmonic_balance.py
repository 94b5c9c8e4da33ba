# SPDX-License-Identifier: GPL-3.0-or-later
r"""A start for shooting that is nearly the steady state: harmonic balance of the tip, for many points together.

The stator is linear, so the motion of the tip follows from the two forces of the contact. With :math:`D_h` the harmonic
h of the displacement of tip and carrier along x and y, :math:`C_h` its dynamic compliance (2 × 2) and :math:`D^0_h` the
response to the voltages and, for h = 0, to the preload,

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
between motors that are close to each other may be taken of it (:mod:`.balanced`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import pi

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.law import PAPER_LAW, Law, contact_library
from pyspice_runner.circuit.state import MICRO
from pyspice_runner.motor.groups import GROUPS
from pyspice_runner.motor.stator import carriers
from pyspice_runner.spice.library import Library
from pyspice_runner.steady.balance_equations import (
    Array,
    Complex,
    Forces,
    Grid,
    Places,
    Response,
    Stators,
    linear,
    missed,
    real_parts,
    response_of,
    stators_of,
    tone_phasor,
    touching_contact,
)
from pyspice_runner.steady.copies import Plant

MOST_TONES = 4  # periods of the highest tone in that of the drive; beyond, the equations are too many
CLOSE = 1e-3  # last Newton step over the static penetration
QUICK, MOST_STEPS = 5, 12  # Newton steps below which the voltage may rise faster, and beyond which it must rise slower
FIRST_STEP, SHORTEST_STEP = 4.0, 0.1  # of the slow equations, in periods of the drive
LONGEST_STEP = 10.0  # of them, in decay times; beyond, the steady state is sought
GROWTH, MOST_TIMES = 2.0, 60  # by which a step may grow, and number of steps
LEAST_DAMPING = 1.0 / 64.0


def harmonic_starts(plants: Sequence[Plant]) -> list[Array | None]:
    """Return the states at t = 0 from which shooting begins; ``None`` where there is none.

    The drives have the same period. A free tip and laws without sliders have no such start.
    """
    return [None if found is None else found.state for found in balanced(plants)]


def balanced(plants: Sequence[Plant], near: Sequence[Balance | None] = ()) -> list[Balance | None]:
    """Return the balanced motions of operating points whose drives have the same period; ``None`` where there is none.

    A point starts from that of ``near``. Without one, the point with the middle speed of each curve runs up from rest,
    and the others start from it. A brush of sliders is balanced as a single one.
    """
    found: list[Balance | None] = [None] * len(plants)
    groups: dict[tuple[Library, Law], list[int]] = {}
    for place, plant in enumerate(plants):
        if plant.law and plant.law.sliding and tones(plant):
            groups.setdefault((contact_library(PAPER_LAW, plant.motor.contact), plant.law), []).append(place)
    for (library, _), places in groups.items():
        some = [plants[place] for place in places]
        points = _Points(some, Grid(some[0].drive.period, max(map(tones, some)), library))
        points.solve([near[place] if near else None for place in places])
        for place, balance in zip(places, points.balances(), strict=True):
            found[place] = balance
    return found


def tones(plant: Plant) -> int:
    """Return the number of periods of the highest tone in that of the drive; 0 for too many."""
    count = round(max(plant.drive.frequencies) * plant.drive.period)
    return count if count <= MOST_TONES else 0


def _residual(stators: Stators, grid: Grid, response: Response, unknowns: Array) -> tuple[Array, Array]:
    """Return the residual of the equations in m, and its derivative."""
    s, found = stators, touching_contact(stators, grid, unknowns)
    slopes = np.stack([grid.phasors(each, grid.orders) for each in (found.slope_x, found.slope_y)], axis=2)
    count = unknowns.shape[1]
    derivative = np.empty((len(unknowns), count, count))
    derivative[:, :-1] = np.eye(count)[:-1] - real_parts(response.compliance @ slopes)
    unit, turns = (s.depth / s.grip)[:, 0], s.turns[:, 0]
    derivative[:, -1] = -(turns * unit)[:, np.newaxis] * found.slope_friction.mean(axis=1)
    derivative[:, -1, -1] += np.where(turns, unit * grid.omega * s.drag[:, 0], 1.0)
    return missed(stators, grid, response, unknowns, found), derivative


def _newton(
    stators: Stators, grid: Grid, response: Response, unknowns: Array
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
        unknowns[active[near]] += after[near]  # the step that is left, by the derivative of the last one
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


def _coordinates(stators: Stators, grid: Grid, response: Response, forces: Forces) -> Complex:
    """Return the phasors of the coordinates."""
    pushed = np.einsum("pxn,phx->phn", stators.tip, grid.phasors(forces.on_tip, grid.orders))
    return np.asarray(response.coordinates + np.einsum("phnm,phm->phn", response.gains, pushed))


def _run_up(stators: Stators, grid: Grid) -> tuple[Array, NDArray[np.bool_]]:
    """Return the unknowns of points that run to their steady state, and whether they reached it.

    They begin at rest. The amplitudes follow their slow equations by the
    implicit Euler rule, with steps that grow.
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
        response = response_of(some, np.where(final, 0.0, 1.0 / step[active]), coordinates[active])
        found, good, taken = _newton(some, grid, response, unknowns[active])
        moved = active[good]
        unknowns[moved] = found[good]
        coordinates[moved] = _coordinates(some, grid, response, touching_contact(some, grid, found))[good]
        reached[active] = good & final
        step[active] *= np.where(good, np.where(taken <= QUICK, GROWTH, 1.0), 0.25)
        lost[active] = step[active] < SHORTEST_STEP * 2.0 * pi / grid.omega
    return unknowns, reached


class _Points:
    """Operating points on the way to their balanced motions."""

    def __init__(self, plants: Sequence[Plant], grid: Grid) -> None:
        self.plants, self.grid = plants, grid
        self.stators = stators_of(plants, grid)
        self.steady = response_of(self.stators, np.zeros(len(plants)), np.zeros_like(self.stators.forces))
        self.unknowns = np.zeros((len(plants), 2 * grid.shape.shape[1] + 1))
        self.found = np.zeros(len(plants), dtype=bool)
        self.speeds = self.stators.surface[:, 0]
        curves: dict[str, list[int]] = {}
        for place, plant in enumerate(plants):
            curves.setdefault(plant.curve, []).append(place)
        self.curves = [sorted(curve, key=lambda place: self.speeds[place]) for curve in curves.values()]

    def solve(self, near: Sequence[Balance | None]) -> None:
        """Solve the points: from given motions, from rest, and from the nearest solved point of the same curve."""
        begun = {
            place: one.unknowns
            for place, one in enumerate(near)
            if one and one.unknowns.shape == self.unknowns[0].shape
        }
        self._start(np.array([*begun], dtype=int), np.array([*begun.values()]))
        self._run_up([curve[len(curve) // 2] for curve in self.curves if not self.found[curve].any()])
        tried: set[tuple[int, int]] = set()
        while pairs := [pair for pair in self._neighbours() if pair not in tried]:  # until no new one is found
            tried |= set(pairs)
            some, others = np.array(pairs).T
            self._start(some, self.unknowns[others].copy())
        self._run_up(np.flatnonzero(~self.found))

    def _neighbours(self) -> list[tuple[int, int]]:
        """Return each point that is not solved, with the nearest solved one of its curve."""
        pairs = []
        for curve in self.curves:
            solved, lost = ([place for place in curve if self.found[place] == one] for one in (True, False))
            distance = np.abs(self.speeds[lost][:, np.newaxis] - self.speeds[solved])
            if solved:
                pairs += [(place, solved[int(row.argmin())]) for place, row in zip(lost, distance, strict=True)]
        return pairs

    def _run_up(self, places: Sequence[int] | Places) -> None:
        some = np.array(places, dtype=int)
        if len(some):
            self.unknowns[some], self.found[some] = _run_up(self.stators.of(some), self.grid)

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
        forces, sliders = Forces(*(getattr(touching, one.name) for one in fields(Forces))), touching.slider[:, :1]
        coordinates = _coordinates(own, self.grid, steady, forces)
        for number, place in enumerate(places.tolist()):
            found[place] = Balance(
                self.plants[place], self.grid, unknowns[number], coordinates[number],
                Forces(*(getattr(forces, one.name)[number : number + 1] for one in fields(Forces))), sliders[number],
            )  # fmt: skip
        return found


@dataclass(frozen=True)
class Balance:
    """The balanced motion of an operating point."""

    plant: Plant
    grid: Grid
    unknowns: Array  # coefficients of x, of y, and the surface speed of the rotor over ω
    coordinates: Complex  # phasors of modes and carriers, shape (harmonics, n), m
    forces: Forces  # of this point
    sliders: Array  # at t = 0, µm

    @property
    def normal(self) -> float:
        """Mean normal force in N."""
        return float(self.forces.normal.mean())

    @property
    def friction(self) -> float:
        """Mean friction force on the rotor in N."""
        return float(self.forces.friction.mean())

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
        tip, impedance, _, forces = linear(plant, grid.omega, orders, count)
        forces += grid.phasors(self.forces.on_tip[0], orders) @ tip
        coordinates = np.linalg.solve(impedance, forces[..., np.newaxis])[..., 0]
        displacements = coordinates.sum(axis=0).real
        velocities = (1j * grid.omega * orders @ coordinates).real
        modes, state = plant.modes, np.zeros(plant.order)
        state[:modes], state[modes : 2 * modes] = displacements[:modes], velocities[:modes]
        state[plant.where("contact")] = MICRO * self.sliders
        contact, stem = plant.motor.contact, []
        for series, force, rest in (
            (contact.series_compliance_m_per_n, self.forces.normal[0], contact.preload_n),
            (contact.tangential_series_compliance_m_per_n, self.forces.friction[0], 0.0),
        ):
            if series:
                rate = (force[1] - force[-1]) * grid.omega / (2.0 * grid.angles[1])
                stem += [series * (force[0] - rest), series * rate]
        state[plant.where("stem")] = stem
        state[plant.carrier] = np.column_stack([displacements[modes:], velocities[modes:]]).ravel()
        if plant.turns:
            state[-1] = self.speed
        return state
