# SPDX-License-Identifier: GPL-3.0-or-later
"""A branch of steady states over a parameter, through its folds, by pseudo-arclength continuation.

State and parameter are unknowns together; the additional equation is the distance from the point before, along the
tangent. The branch can therefore turn back, where a steady state over the parameter would jump: between two folds its
states are unstable, and a sweep up and a sweep down jump at different folds. H. B. Keller, "Numerical solution of
bifurcation and nonlinear eigenvalue problems", in: Applications of Bifurcation Theory, Academic Press 1977.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import ceil, sqrt
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError, SimulationError, require
from pyspice_runner.motor.drive import Drive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.run.dynamometer import UNITS
from pyspice_runner.run.paths import canonical
from pyspice_runner.run.point import Point, Settings
from pyspice_runner.run.window import Array
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.period_map import PeriodMap, Trace, means, quantities
from pyspice_runner.steady.shooting import NEWTON, Orbit, Shooting, start_point
from pyspice_runner.steady.speed_torque import dataset_of

if TYPE_CHECKING:
    import xarray


MOST_POINTS = 400
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.05, 0.2, 1e-4  # of the arc; 1 is the size of the motion, or SPAN
SPAN = 0.25  # of the range of the parameter that counts as much as the size of the motion
NUDGE = 2e-5  # of the parameter's span, by which it is changed for the derivative
MOST_CORRECTIONS = 8
MOST_RENEWALS = 3  # of the derivative within one step
SLOW = 0.5  # contraction of corrections beyond which the derivative is measured anew
GROWTH = 1.5

OUTCOME = {
    "speed_rad_s": ("rad/s", "mean speed of the rotor"),
    **UNITS,
    "stable": ("1", "whether the steady state is stable"),
    "largest_multiplier": ("1", "largest Floquet multiplier; a disturbance decays where it is below 1"),
}


@checked
def steady_branch(
    motor: Motor,
    drive: Drive,
    *,
    follow: str,
    start: float,
    stop: float,
    points: int = MOST_POINTS,
    **settings: Unpack[Settings],
) -> xarray.Dataset:
    """Follow a branch of steady states over a parameter, with its stable and unstable parts.

    Args:
        motor: the motor.
        drive: the voltages of both groups.
        follow: dotted path of the parameter: ``drive.frequency``, ``drive.voltage``, ``contact.preload_n``,
            ``load.speed``, ``load.torque``, ….
        start: value of the parameter at which the branch begins.
        stop: value at which it ends. It also ends where it comes back to ``start``.
        points: maximum number of points.
        settings: load, contact and solver, as in :class:`.Settings`.

    Returns:
        The quantities of :func:`speed_torque` over ``point``, with the parameter, ``stable`` and ``start_state`` at
        each. Attribute ``folds`` has the values of the parameter at which the branch turns back, as JSON, and ``ended``
        says why it ends. The quantities are those of one time step, without extrapolation.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if there is no steady state at ``start``, or ngspice fails.
    """
    return followed_branch(Point.of(motor, drive, audit=False, **settings), follow, start, stop, points)


def followed_branch(point: Point, follow: str, start: float, stop: float, points: int = MOST_POINTS) -> xarray.Dataset:
    """Follow a branch from an operating point; the arguments are those of :func:`steady_branch`."""
    given = {"load.speed": point.load.speed is not None, "load.torque": point.load.torque != 0.0}
    if given.get(canonical(follow)):
        raise ParameterError(f"{canonical(follow)} is given twice. Give it once.")
    if not np.isfinite([start, stop]).all() or start == stop:
        raise ParameterError(f"start = {start:g} and stop = {stop:g} are not valid: they must be different numbers.")
    require(2 <= points <= MOST_POINTS, "points", points, f"a whole number from 2 to {MOST_POINTS}")
    family = _Family(point, follow, start, stop)
    for value in (start, stop):  # both ends are checked before any run
        family.setup(value)
    nodes, ended = _followed(family, points)
    return _dataset(family, nodes, ended)


@dataclass
class _Family:
    """Plants that differ in one parameter."""

    base: Point  # the operating point at the nominal value of the parameter
    follow: str  # path of the parameter
    start: float  # first value of the parameter
    stop: float  # last value
    hashes: set[str] = field(default_factory=set)  # of the circuits that were run

    @property
    def scale(self) -> float:
        """Change of the parameter that counts as much as the size of the motion."""
        return SPAN * abs(self.stop - self.start)

    def setup(self, value: float) -> Point:
        """Return the operating point at a value of the parameter."""
        return self.base.updated({self.follow: value})

    def at(self, value: float) -> tuple[Plant, PeriodMap]:
        """Return plant and map at a value of the parameter."""
        setup = self.setup(value)
        plant, period = Plant.of(setup), setup.source.period
        return plant, PeriodMap(period, ceil(period / setup.step - 1e-9), self.base.solver.timeout)


@dataclass
class _Node:
    """A point of a branch: a solved point, its parameter, and the derivatives there."""

    point: Orbit
    value: float
    period_map: PeriodMap
    slope: Array  # of the scaled gap with respect to the scaled parameter
    tangent: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Whether each component of the scaled state, and the parameter, is an unknown."""
        return np.append(self.point.free, True)

    def solved(self, tangent: Array, right: Array) -> Array:
        """Return the change of the scaled state and parameter for a change of the gap and of the arc along a tangent.

        A state whose start has no influence on the period, as that of a slider that slips there, does not change.
        """
        assert self.point.at_end is not None
        assert self.point.at_start is not None
        matrix = np.column_stack([self.point.at_end - self.point.at_start, self.slope])
        free = self.free
        left, sizes, across = np.linalg.svd(np.vstack([matrix, tangent])[np.ix_(free, free)])
        # the solution of minimum norm: sliders that stick keep their distances
        kept = (sizes > 1e-10 * sizes[0]) & (np.arange(len(sizes)) < len(sizes) - self.point.sticks)
        change = np.zeros(len(free))
        change[free] = across.T @ np.where(kept, (left.T @ right[free]) / np.where(kept, sizes, 1.0), 0.0)
        return change


def _first(family: _Family) -> Orbit:
    """Return the solved point where the branch begins, from the free stator if that succeeds.

    Where two motions are possible, it is the one that stays in contact.
    """
    plant, period_map = family.at(family.start)
    first = start_point(plant)
    shooting = Shooting([first], period_map)
    shooting.solve()
    if not first.done:
        shooting.search()
    if not first.done:
        raise SimulationError(f"There is no steady state at {family.follow} = {family.start:g}. Choose another start.")
    return first


def _followed(family: _Family, points: int) -> tuple[list[_Node], str]:
    first = _first(family)
    scale, order = first.scale, first.plant.order
    weights = np.append(np.full(order, 1.0 / sqrt(order)), 1.0)  # of the scaled unknowns in the arc

    def measured(state: Array, value: float) -> _Node | None:
        """Return the node at a state and parameter, with its derivatives; ``None`` where ngspice finds no period."""
        nudge = NUDGE * family.scale / SPAN
        here, there = family.at(value), family.at(value + nudge)
        point = Orbit(here[0], state, scale)
        beside = there[1].traces([Copy(there[0], state)])[0]
        Shooting([point], here[1]).evaluate([point])
        if beside is None or point.failed:
            return None
        family.hashes |= {here[1].effort.hashes()}
        gap = (beside.states[:, -1] - beside.states[:, 0]) / scale
        return _Node(point, value, here[1], (gap - point.gap) * family.scale / nudge)

    node = measured(first.state, family.start)
    if node is None:
        raise SimulationError("ngspice does not find the period near the start. Choose another start.")
    toward = np.append(np.zeros(order), np.sign(family.stop - family.start))
    node.tangent = _tangent(node, toward, weights)
    nodes, length = [node], FIRST_STEP
    low, high = sorted((family.start, family.stop))
    while len(nodes) < points:
        found = _next(nodes[-1], length, family, weights, measured)
        if found is None:
            length *= 0.5
            if length < SHORTEST_STEP:
                return nodes, "No further point is found."
            continue
        found.tangent = _tangent(found, nodes[-1].tangent, weights)
        nodes.append(found)
        turn = float((weights * found.tangent) @ (weights * nodes[-2].tangent))
        length = min(length * GROWTH, LONGEST_STEP) if turn > 0.95 else length * (1.0 if turn > 0.8 else 0.5)
        if not low <= found.value <= high:
            return nodes, "It reaches stop." if (found.value > high) == (family.stop > family.start) else (
                "It comes back to start."
            )  # fmt: skip
    return nodes, f"It has {points} points."


def _tangent(node: _Node, before: Array, weights: Array) -> Array:
    """Return the direction of the branch, of length 1, with the sense of the one before."""
    found = node.solved(weights**2 * before, np.append(np.zeros(len(before) - 1), 1.0))
    return np.asarray(found / np.linalg.norm(weights * found))


def _next(
    node: _Node, length: float, family: _Family, weights: Array, measured: Callable[[Array, float], _Node | None]
) -> _Node | None:
    """Return the node at a distance along the branch; ``None`` if the correction fails."""
    scales = np.append(node.point.scale, family.scale)
    here = np.append(node.point.state, node.value)
    unknown = here + length * node.tangent * scales
    near, renewed = node, 0
    before = np.inf
    for _ in range(MOST_CORRECTIONS):
        try:
            plant, period_map = family.at(float(unknown[-1]))
        except ParameterError:  # the parameter leaves its range
            return None
        trace: Trace | None = period_map.traces([Copy(plant, unknown[:-1])])[0]
        if trace is None:
            return None
        gap = (trace.states[:, -1] - trace.states[:, 0]) / node.point.scale
        while True:
            change = near.solved(weights**2 * node.tangent, np.append(-gap, 0.0))
            size = float(np.linalg.norm(weights * change))
            if size < SLOW * min(before, length) or renewed == MOST_RENEWALS:
                break
            renewed += 1  # another kind of contact has begun: the derivative of the node before does not serve
            here_now = measured(unknown[:-1], float(unknown[-1]))
            if here_now is None:
                return None
            near = here_now
        if size > max(before, length):
            return None
        later = np.append(trace.later(0.0), unknown[-1])
        unknown = np.where(near.free, unknown + change * scales, later)
        before = size
        if size < NEWTON.residual:
            return measured(unknown[:-1], float(unknown[-1]))
    return None


def _dataset(family: _Family, nodes: list[_Node], ended: str) -> xarray.Dataset:
    rows: list[Mapping[str, Any]] = []
    for node in nodes:
        trace, plant = node.point.trace, node.point.plant
        assert trace is not None
        found = means(plant, trace, node.period_map.discretisation)
        largest = float(np.abs(node.point.multipliers).max(initial=0.0))
        rows.append({
            "speed_rad_s": found["speed"], **quantities(plant, found), "stable": largest < 1.0,
            "largest_multiplier": largest,
        })  # fmt: skip
    values = np.array([node.value for node in nodes])
    coordinates = {
        "point": ("point", np.arange(len(nodes)), {}),
        family.follow: ("point", values, {"units": family.base.parameter(family.follow).unit}),
    }
    dataset = dataset_of(
        family.base, f"steady states over {family.follow}", OUTCOME, rows, coordinates, sorted(family.hashes),
        follow=family.follow, folds=folds(values), ended=ended, run=family.setup(family.start).to_dict(),
    )  # fmt: skip
    meaning = "modal displacements, velocities and the other states at t = 0, SI"
    states = np.array([node.point.state for node in nodes])
    dataset["start_state"] = (("point", "state"), states, {"long_name": meaning})
    return dataset


def folds(values: Array) -> list[float]:
    """Return the values at which a branch turns back, from parabolas through three points each."""
    found = []
    for at in range(1, len(values) - 1):
        before, here, after = values[at - 1 : at + 2].tolist()
        if (here - before) * (after - here) < 0.0:
            bend = before - 2.0 * here + after
            found.append(here - (after - before) ** 2 / (8.0 * bend))
    return found
