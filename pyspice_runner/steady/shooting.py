# SPDX-License-Identifier: GPL-3.0-or-later
"""Newton's method on the map of a motor's state over a drive period, for many operating points together.

Let x be the state and Φ its map over one period. The steady state is the fixed point Φ(x) = x; its stability follows
from the eigenvalues of dΦ/dx, the Floquet multipliers. ngspice evaluates Φ for many states in one run, so that the
derivative is a matter of perturbed copies. T. J. Aprille and T. N. Trick, "Steady-state analysis of nonlinear circuits
with periodic inputs", Proc. IEEE 60 (1972); P. Deuflhard, "Newton Methods for Nonlinear Problems", Springer 2004, for
the damping. ``docs/steady_state.md`` has the derivation and what was measured.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from math import ceil, degrees, log, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.state import stems
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor import groups
from pyspice_runner.motor.parameters import HERTZ
from pyspice_runner.motor.stator import carriers, square
from pyspice_runner.run.waveforms import Array, interpolated
from pyspice_runner.steady.copies import Copy, Plant, phasor_at
from pyspice_runner.steady.harmonic_balance import balanced
from pyspice_runner.steady.monodromy import Course, Derivative, derivatives, differentiable
from pyspice_runner.steady.period_map import (
    GROSS_SLIP,
    PeriodMap,
    Trace,
    held_by_friction,
    held_forces,
    in_threads,
    of_contacts,
    parts_of_force,
    phasors,
    quantities,
)

LONG_CURVE = 9  # points of a curve from which on most of them start from solved neighbours
SPACING = 3  # of the points that are solved first


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of Newton's method on a period."""

    # of the scale of a state: between the noise of Newton's iteration in ngspice and the curvature
    perturbation: float = 3e-4
    # remaining Newton step, and what it would change of the mean forces, relative to their scales
    residual: float = 1e-4
    iterations: int = 12  # the maximum; quadratic convergence takes 3 to 5
    damping: float = 1.0 / 64.0  # the minimum; a shorter step seldom leads to the solution
    growth: float = 3.0  # by which the first steps may grow: they pass from one kind of contact to another
    free_steps: int = 3  # number of steps that may grow
    reuse: float = 0.7  # contraction of steps by which an old derivative may still be good enough
    expected: float = 0.2  # of the residual, which a step by an old derivative must be likely to reach, to keep it
    neighbour_contraction: float = 0.1  # by the derivative of the same orbit at other steps; 0.02 to 0.1 was measured
    distance: float = 0.1  # of the size of the motion, how far from the solution its derivative may have been measured
    # the same of a derivative along the trace, which costs less: it differs there by about 1e-3
    exact_distance: float = 1e-3
    # of a slider's displacement at the start of a run, what must be left of it at the beginning of the period, by
    # copies and by the equations. About 1e-3 is left where the tip touches in the uneven steps between.
    memory: float = 0.1
    exact_memory: float = 2e-4
    # of the contact's state, from stick to where all sliders slip, or to separation
    gross_slip: float = GROSS_SLIP - 1.0
    held: float = 0.9  # of the range of forces that friction holds, to which a point is moved in one step
    balance: float = 2e-4  # of the preload, mean friction force below which the contact counts as unloaded
    unloadings: int = 4  # maximum of these steps; the contact's tangential spring is not linear
    slipped: float = 3.0  # limits of stick under the preload, to which a slider is moved that its shaft drags
    slowest_s: float = 50.0  # time constant beyond which a disturbance stays; a slider that sticks leaks in 1000 s
    # decay times of the slowest mode that a point runs if Newton's method fails
    settling: tuple[float, float] = (1.0, 4.0)
    # of a step, by which a point moves in turn if Newton's method fails with a contact whose force has a kink
    shifts: tuple[float, float, float] = (0.3, 0.15, 0.37)


NEWTON = Tolerances()


@dataclass(frozen=True, eq=False)
class Slip:
    """What the slip of the contact in a period does to the states."""

    trace: Trace | None  # of the period; ``None`` before the first run
    # whether the period depends on each state at the start of the run: a uniform step takes a slider that slips, or
    # touches nothing, to its limit, wherever it was before. So the period does not depend on where the slider starts if
    # it slips there a period later. Of a brush all sliders slip then; one that slips beside others that stick shows in
    # its derivative. The lags of the stem forget their start in two steps.
    influential: NDArray[np.bool_]
    # whether each state at the beginning of the period acts on it: no slider that slips or touches nothing does, since
    # the first step of the period takes it to its limit, and no lag of the stem.
    persistent: NDArray[np.bool_]
    stuck: NDArray[np.bool_]  # whether each contact with sliders sticks for the whole period


@dataclass(eq=False)
class Orbit:
    """One operating point on its way to the steady state."""

    plant: Plant  # motor, drive, load and law
    state: Array  # at the start of a run
    scale: Array  # size of each state
    begun: float = 0.0  # time in s at which a run begins, since the drive's phase was that of t = 0
    tolerance: float = NEWTON.residual  # of what remains to the solution
    trace: Trace | None = None  # the last period
    # derivative of the state at the beginning of the period with respect to that at the start of the run.
    at_start: Array | None = None
    at_end: Array | None = None  # the same of the state at the end of the period; both in scaled states
    measured_end: Array | None = None  # ``at_end`` as it was last measured, without later corrections
    measured_at: Array | None = None  # the state at which it was measured
    monodromy: Array | None = None  # scaled derivative of the state at the end to that at the beginning, if it is known
    force_slope: Array | None = None  # derivative of the mean forces with respect to the scaled state
    step: Array | None = None
    damping: float = 1.0
    damped: bool = False
    stale: bool = False
    done: bool = False
    failed: bool = False
    informed: bool = False  # whether it starts from harmonic balance and has its derivative without the help of others
    by_copies: bool = False  # whether its derivative is taken of perturbed copies, though its equations are known
    guessed: bool = False  # whether it starts from a guess by solved neighbours; if that fails, from a start of its own
    method: str = ""  # ``newton``, ``damped``, ``neighbour`` or ``settled``; empty while there is no solution
    iterations: int = 0  # Newton steps taken
    residual: float = float("inf")
    reach: int | None = None  # number of sliders of a brush that touched something in the last run, if it is known
    _slip: Slip | None = field(default=None, repr=False)  # in the last trace

    @property
    def gap(self) -> Array:
        """State at the end of the period less that at its beginning, scaled."""
        assert self.trace is not None
        return np.asarray((self.trace.states[:, -1] - self.trace.states[:, 0]) / self.scale)

    def newton_step(self) -> Array:
        """Return the step of the scaled state that closes the gap.

        Where the contact sticks, the step is the shortest one: sliders that stick keep their distances. A slider that
        is not free goes to where it is a period later.
        """
        assert self.at_start is not None
        assert self.at_end is not None
        free = self.free
        left, sizes, right = np.linalg.svd((self.at_end - self.at_start)[np.ix_(free, free)])
        # A heavy rotor is slow, and has its steady speed. A shaft that is held at a speed drags the sliders until they
        # slip, however little it does in a period.
        slow = self.plant.turns & (right[:, -1] ** 2 > 0.5) | bool(self.plant.load.speed)
        kept = sizes > np.where(slow, 1e-10 * sizes[0], self.plant.drive.period / NEWTON.slowest_s)
        drifting = self.drift > self.tolerance
        kept &= np.arange(len(sizes)) < len(sizes) - self.sticks - drifting
        assert self.trace is not None
        step = np.asarray((self.trace.later(self.begun) - self.state) / self.scale)
        step[free] = right.T @ np.where(kept, -(left.T @ self.gap[free]) / np.where(kept, sizes, 1.0), 0.0)
        if drifting:  # in the end the sliders slip; the first step takes them back to their limit
            ahead = -1.0 if (self.plant.load.speed or 0.0) > 0.0 else 1.0  # of the tip, relative to the shaft
            slipping = self.state / self.scale
            places: list[int] = []
            for one, stuck, sliders in zip(self.plant.motor.touching, self.slip.stuck, self.plant.sliders, strict=True):
                part = f"stem_x{one.suffix}"
                along = [place for place, state in enumerate(self.plant.states) if state.part == part]
                slipping[sliders] = NEWTON.slipped * ahead
                if along:  # the friction compresses what is in series along the rotor, and its rate is 0
                    contact = one.contact
                    compressed = contact.tangential_series_compliance_m_per_n * contact.friction * contact.preload_n
                    slipping[along] = ahead * compressed / self.scale[along[0]], 0.0
                places += [*sliders, *along] if stuck else []
            step[places] = (slipping - self.state / self.scale)[places]
        return step

    @property
    def slip(self) -> Slip:
        """What the slip of the contact does in the period, once for each trace.

        Behind a driver the states that fade before the period begins show in their derivatives.
        """
        plant, trace = self.plant, self.trace
        if self._slip is not None and self._slip.trace is trace:
            return self._slip
        influential, persistent = np.ones(plant.order, dtype=bool), np.ones(plant.order, dtype=bool)
        stuck = np.zeros(len(plant.motor.touching), dtype=bool)
        if trace is not None and plant.law is not None:
            time = trace.time
            end = self.begun + time[-1] - time[0]
            later = int(np.searchsorted(time, end - 1.01 * (time[1] - time[0]), "right"))
            slips = np.abs(trace.contact_state - 1.0)
            for number, (sliders, law) in enumerate(zip(plant.sliders, plant.laws, strict=True)):
                if law.sliding:
                    influential[sliders] = np.any(slips[number, later:] < NEWTON.gross_slip)
                    persistent[sliders] = np.any(slips[number, [0, -1]] < NEWTON.gross_slip)
                    stuck[number] = not np.any(slips[number] > NEWTON.gross_slip)
        influential[plant.places["stem"]] = persistent[plant.places["stem"]] = False
        if plant.driver is not None:
            influential[:] = True
        self._slip = Slip(trace, influential, persistent, stuck)
        return self._slip

    @property
    def free(self) -> NDArray[np.bool_]:
        """Whether each state is one of Newton's unknowns: all but sliders whose start has no influence."""
        if self.at_start is None:
            return self.slip.influential
        free, sliders = self.slip.influential.copy(), self.plant.places["contact"]
        left = self.at_start.diagonal()[sliders]
        known, memory = (self.slip.persistent, NEWTON.exact_memory) if self.exact else (free, NEWTON.memory)
        free[sliders] = known[sliders] & (left > memory)
        return free

    @property
    def sticks(self) -> int:
        """Number of directions in which contacts that stick for the whole period keep their state.

        Sliders that stick keep their distances from the innermost one of the contact. On a shaft that is held still,
        all together also keep any torque.
        """
        if self.trace is None or not self.slip.stuck.any():
            return 0
        found = -int(self.plant.load.speed != 0.0)
        for sliders in compress(self.plant.sliders, self.slip.stuck):
            apart = (self.trace.states[sliders] - self.trace.states[sliders[0]]) / self.scale[sliders, np.newaxis]
            found += int(np.count_nonzero((np.ptp(apart, axis=1) < NEWTON.residual) & self.free[sliders]))
        return max(found, 0)

    @property
    def drift(self) -> float:
        """Distance by which a shaft that is held at a speed drags a slider in a period, scaled; 0 unless it is stuck.

        Such a motion repeats itself only if the tip comes back to its place, and then the slider does not.
        """
        if not (self.plant.load.speed and self.slip.stuck.any()):
            return 0.0
        distance = self.plant.load.speed * self.plant.motor.rotor.radius_m * self.plant.drive.period
        return abs(distance) / float(self.scale[self.plant.places["contact"]].max())

    def remaining(self, step: Array) -> float:
        """Return the size of a Newton step: of the state, the gap that it leaves, and its change of the mean forces."""
        assert self.at_start is not None
        assert self.at_end is not None
        assert self.force_slope is not None
        motor = self.plant.motor
        step = np.where(self.free, step, 0.0)
        left = np.where(self.slip.persistent, self.gap + (self.at_end - self.at_start) @ step, 0.0)
        size = max(float(np.sqrt(np.mean(np.maximum(np.abs(step), np.abs(left)) ** 2))), self.drift)
        if self.plant.law is None:
            return size
        force = max(motor.contact.preload_n, abs(float(self.trace.forces(self.plant)[0])) if self.trace else 0.0)
        changes = np.abs(self.force_slope @ step) / np.array([force, motor.contact.friction * force])
        return max(size, float(changes.max()))

    def moved(self, begun: float, step: float | None = None) -> Orbit:
        """Return the point with its period begun at another time in s, at the state that its orbit has there.

        ``step`` is the time step in s of the map to which the point moves, if it is another one: where the contact
        slips, the slider is beyond its limit by a distance that is proportional to the step.
        """
        assert self.trace is not None
        time, period = self.trace.time, self.trace.time[-1] - self.trace.time[0]
        at = time[0] + (begun - time[0]) % period
        state = interpolated(time, self.trace.states, at)
        if step is not None and self.plant.law:
            for one, law, sliders, normal, penetration in zip(
                self.plant.motor.touching, self.plant.laws, self.plant.sliders, self.trace.normal,
                self.trace.penetration_um, strict=True,
            ):  # fmt: skip
                if law.row or not law.sliding:
                    continue
                place = sliders[0]
                depth = max(1e-6 * float(np.interp(at, time, penetration)), 0.0)
                limit = contact_law.stick_limit(one.contact, depth, float(np.interp(at, time, normal)))
                held = np.clip(state[place], -limit, limit)
                state[place] = held + (state[place] - held) * step / (time[1] - time[0])
        return replace(self, state=state, begun=begun, trace=None, step=None)

    @property
    def held(self) -> bool:
        """Whether it is solved, and friction holds its shaft at rest, at any torque within a range."""
        ideal = self.plant.driver is None
        return self.done and ideal and self.trace is not None and held_by_friction(self.plant, self.trace)

    def with_force(self, force_n: float) -> Orbit:
        """Return the point with a constant friction force in addition, at the static deflections that it causes."""
        plant, motor, state = self.plant, self.plant.motor, self.state.copy()
        stator, forces = motor.stator.with_carrier(plant.mount), force_n * parts_of_force(plant)
        state[plant.moving[0]] -= np.linalg.solve(square(stator.stiffness), forces @ stator.contact[::2])
        for one, sliders, force in zip(motor.touching, plant.sliders, forces.tolist(), strict=True):
            state[sliders] += force / contact_law.tangential_stiffness_at_preload(one.contact)
            along = [place for place, part in enumerate(plant.states) if part.part == f"stem_x{one.suffix}"]
            state[along[:1]] += one.contact.tangential_series_compliance_m_per_n * force
        return replace(self, state=state, at_start=None, at_end=None, measured_end=None, trace=None, step=None)

    def copy(self, state: Array) -> Copy:
        """Return a copy for the map that starts at a state."""
        return Copy(self.plant, state, self.begun, reach=self.reach)

    def guess(self, other: Orbit) -> None:
        """Start from the state and the derivative of another point."""
        self.restart(other.state)
        self.at_start, self.at_end, self.force_slope = other.at_start, other.at_end, other.force_slope
        self.guessed, self.reach = True, other.reach

    def restart(self, state: Array) -> None:
        """Restart from a state, without a derivative."""
        self.state, self.trace, self.at_start, self.at_end, self.measured_end = state.copy(), None, None, None, None
        self.reach = None

    def judge(self) -> None:
        """Take the next step, and mark the point as solved if it is small enough."""
        self.step = self.newton_step()
        self.residual = self.remaining(self.step)
        self.done = self.residual <= self.tolerance

    def accepts(self, trial: Array, trace: Trace | None) -> bool:
        """Accept the trial state if the next step by the old derivative is shorter than the last one."""
        assert self.step is not None
        if trace is None:
            return False
        before, old, gap = float(np.linalg.norm(self.step[self.free])), self.trace, self.gap
        self.trace = trace
        step, free = self.newton_step(), self.free
        after = float(np.linalg.norm(step[free]))
        moved = bool(np.any(np.abs(self.step[~free]) > NEWTON.distance))  # the slider, unknown to Newton
        allowed = NEWTON.growth if self.iterations <= NEWTON.free_steps else 1.0
        remaining = self.remaining(step)
        if remaining > self.tolerance and after > allowed * before and not moved:
            self.trace = old
            return False
        self.stale = self.damping < 1.0 or after > NEWTON.reuse * before
        if not (self.stale or self.exact):
            self._update(np.where(self.free, self.damping * self.step, 0.0), gap)
            step = self.newton_step()
            remaining = self.remaining(step)
        self.state, self.step = trial, step
        self.damping = min(1.0, 2.0 * self.damping)
        self.residual, self.done = remaining, remaining <= self.tolerance
        if self.exact:  # a step is as dear as some derivatives, so that another one by the old derivative must do
            self.stale |= remaining * after > NEWTON.expected * self.tolerance * before
        elif not (self.stale or self.done):  # as many more steps would cost more than a new derivative
            self.stale = log(self.residual / self.tolerance) > self.plant.order * log(before / after)
        return True

    @property
    def exact(self) -> bool:
        """Whether the derivative follows from the trace."""
        return self.trace is not None and self.trace.course is not None and not self.by_copies

    @property
    def lined(self) -> bool:
        """Whether the force of a contact has a kink at the limit of stick: its exponent is below that of Hertz."""
        return any(one.contact.exponent < HERTZ for one in self.plant.motor.touching)

    @property
    def far(self) -> bool:
        """Whether the derivative was measured too far from the state to tell the multipliers."""
        if self.measured_at is None:
            return True
        free = self.free
        away = float(np.abs(((self.state - self.measured_at) / self.scale)[free]).max(initial=0.0))
        return away > (NEWTON.exact_distance if self.exact else NEWTON.distance)

    def _update(self, step: Array, gap: Array) -> None:
        """Update the derivative from the last step and the gap before it (Broyden 1965)."""
        assert self.at_start is not None
        assert self.at_end is not None
        missed = self.gap - gap - (self.at_end - self.at_start) @ step
        self.at_end = self.at_end + np.outer(missed, step) / float(step @ step)

    def differentiate(self, pairs: Sequence[tuple[Trace | None, Trace | None]]) -> None:
        """Take the derivatives from the traces of the undisturbed and of each perturbed state; then the next step.

        For a state that is not influential both are the same.
        """
        both = [(base, trace) for base, trace in pairs if base is not None and trace is not None]
        self.failed = len(both) < self.plant.order
        if self.failed:
            return
        starts = np.array([(trace.states[:, 0] - base.states[:, 0]) / self.scale for base, trace in both]).T
        ends = np.array([(trace.states[:, -1] - base.states[:, -1]) / self.scale for base, trace in both]).T
        self.at_start, self.at_end = starts / NEWTON.perturbation, ends / NEWTON.perturbation
        self.measured_end, self.measured_at = self.at_end, self.state
        self.force_slope = np.array([trace.forces(self.plant) - base.forces(self.plant) for base, trace in both]).T
        self.force_slope /= NEWTON.perturbation
        self.stale = False
        self.step = self.newton_step()

    def linearise(self, derivative: Derivative) -> None:
        """Take the derivatives of the equations along the trace; then the next step."""
        assert self.trace is not None
        assert self.trace.course is not None
        inner, across = self.trace.course.plant, self.scale / self.scale[:, np.newaxis]
        self.at_start = self.plant.widened(derivative.at_start, inner, 0, 1) * across
        self.at_end = self.plant.widened(derivative.at_end, inner, 0, 1) * across
        self.monodromy = self.plant.widened(derivative.monodromy, inner, 0, 1) * across
        self.measured_end, self.measured_at = self.at_end, self.state
        self.force_slope = self.plant.widened(derivative.forces, inner, 1) * self.scale
        self.stale = False
        self.judge()

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, the largest first, without the 1 of sliders that stick and stay where they are.

        They are those of the derivative as it was last measured. The corrections of :meth:`_update` serve Newton's step
        along one direction and would mix the modes.
        """
        assert self.at_start is not None
        assert self.measured_end is not None
        free = np.ix_(self.free, self.free)
        # a slider that slips at the beginning of the period depends on nothing of the start: its multiplier is 0
        monodromy = np.zeros_like(self.at_start)
        if self.monodromy is None:
            monodromy[free] = self.measured_end[free] @ np.linalg.pinv(self.at_start[free], rcond=1e-8)
        else:
            monodromy = self.monodromy
        values = np.linalg.eigvals(monodromy).astype(complex)
        values = np.delete(values, np.argsort(np.abs(values - 1.0))[: self.sticks])
        values = values[np.abs(values - 1.0) > self.plant.drive.period / NEWTON.slowest_s]
        return np.asarray(values[np.argsort(-np.abs(values))])


@dataclass(frozen=True)
class Answer:
    """The answer to one operating point."""

    point: Orbit  # the point at the finest step
    map: PeriodMap | None = None  # the map at that step; ``None`` if only the coarse step has been tried
    # the quantities of :data:`.dynamometer.UNITS`; empty without a solution.
    found: Mapping[str, float] = field(default_factory=dict)
    error: float = float("nan")  # estimated error of the torque, N·m
    speed: float | None = None  # mean speed of the rotor, rad/s; ``None`` for a held shaft
    method: str = ""  # by which the quantities were found; empty for the method of the point
    running: Orbit | None = None  # of a time average behind a driver, a period of the running motor
    pins: Mapping[str, tuple[complex, complex]] = field(default_factory=dict)  # as in :class:`.SteadyState`
    contacts: tuple[dict[str, Any], ...] = ()  # of each of several contacts, as in :class:`.SteadyState`

    @property
    def unstable(self) -> bool:
        """Whether it has the quantities of an unstable motion of a contact."""
        multipliers = self.point.multipliers if self.found and self.point.plant.law else np.zeros(1)
        return float(np.abs(multipliers).max(initial=0.0)) >= 1.0


def answer_of(point: Orbit, period_map: PeriodMap, found: Mapping[str, float], error: float) -> Answer:
    """Return the answer for means and the error of the friction force in N."""
    torque_error = point.plant.motor.rotor.radius_m * error
    pins, contacts = phasors(found), of_contacts(point.plant, found)
    values = quantities(point.plant, found)
    for group, (volts, amperes) in pins.items():
        values[groups.column("current", group, "phase_deg")] = degrees(phase(amperes / volts))
    return Answer(point, period_map, values, torque_error, found["speed"], pins=pins, contacts=contacts)


def between(points: Sequence[Orbit]) -> Orbit:
    """Return a point in the middle of solved ones, with the mean of their derivatives, as a guess for another."""
    names = ("state", "at_start", "at_end", "force_slope")
    means: dict[str, Any] = {name: np.mean([getattr(point, name) for point in points], axis=0) for name in names}
    return replace(points[0], **means, measured_end=None, measured_at=None, guessed=True)


def start_balanced(points: Sequence[Orbit]) -> None:
    """Let points start from harmonic balance, where that finds a start."""
    for point, balance in zip(points, balanced([point.plant for point in points]), strict=True):
        if balance is not None:
            point.restart(balance.state)
            point.informed = differentiable(point.plant)


def start_point(plant: Plant) -> Orbit:
    """Return a point that starts from the response of the free stator, bent by the preload."""
    motor, n = plant.motor, plant.modes
    preload = motor.contact.preload_n if plant.law else 0.0
    state = np.zeros(plant.order)
    amplitudes = np.zeros(n)
    displacements, velocities = plant.moving
    stator = motor.stator.with_carrier(plant.mount)
    for tones in zip(*plant.drive.tones, strict=True):
        gains = np.linalg.solve(stator.dynamic_stiffness(2.0 * pi * tones[0].frequency), stator.coupling)
        for tone, gain in zip(tones, gains.T, strict=True):
            displacement, velocity = phasor_at(tone, gain, 0.0)
            state[displacements] += displacement
            state[velocities] += velocity
        amplitudes += abs(gains[:n] @ [tone.amplitude * np.exp(1j * tone.phase) for tone in tones])
    along, towards = motor.stator.contact[::2], motor.stator.contact[1::2]  # of the modes
    followed = along @ state[:n]  # by the tips since rest
    state[:n] -= motor.stator.preload_motion * preload / motor.stator.stiffness
    energy = 0.5 * float(motor.stator.stiffness @ amplitudes**2)
    depths, slides = motor.at_rest.depth_m, motor.at_rest.limit_m
    if plant.law:
        energy += 0.4 * preload * float(motor.stator.share @ depths)
    energy = max(energy, np.finfo(float).tiny * 1e100)
    fastest = np.sqrt(2.0 * energy / motor.stator.mass)
    for law, sliders, slid in zip(plant.laws, plant.sliders, np.clip(followed, -slides, slides), strict=False):
        if law.sliding:  # where they do not slip they have followed the tip
            state[sliders] = slid * law.touching
    swift = float(np.abs(motor.stator.contact * fastest).max())
    carrier = []
    for _, tip in zip(carriers(plant.mount), (towards, along), strict=False):
        lift = float(depths.max() + np.abs(tip * amplitudes).max())
        carrier += [lift, lift / plant.drive.period]
    sensed = []
    if motor.feedback:
        charge = float(np.abs(motor.stator.sensed) @ np.sqrt(2.0 * energy / motor.stator.stiffness))
        sensed = [max(charge / motor.feedback.capacitance_f, 1e-6)]
    turning = [swift / motor.rotor.radius_m] if plant.turns else []
    stem = []
    for compliance in stems(motor, plant.law).values():
        stem += [compliance * preload / len(depths), swift]
    scale = np.array([
        *np.sqrt(2.0 * energy / motor.stator.stiffness), *fastest, *np.repeat(slides, list(map(len, plant.sliders))),
        *stem, *carrier, *sensed, *turning,
    ])  # fmt: skip
    return Orbit(plant, state, scale)


@dataclass
class Shooting:
    """Newton's method for many operating points together, on one map. The points are changed in place."""

    points: Sequence[Orbit]
    map: PeriodMap
    near: bool = False  # whether the derivatives that points have are those of the same orbits at the same step

    def solve(self, points: Sequence[Orbit] | None = None) -> None:
        """Iterate until every point is solved or has failed. A point keeps its derivative while that is good.

        Each worker has its own points, so that none waits for the others after a step.
        """
        every = list(self.points if points is None else points)
        if not every:
            return
        for point in every:
            point.done = point.failed = point.damped = False
            point.damping, point.iterations = 1.0, 0
        threads = min(self.map.workers, len(every))
        workers = max(1, self.map.workers // threads)
        part = replace(self, map=replace(self.map, workers=workers))  # with a common effort
        in_threads(part._iterate, [every[first::threads] for first in range(threads)], threads)

    def _iterate(self, active: list[Orbit]) -> None:
        self.evaluate(active)
        for _ in range(2 * NEWTON.iterations):
            active = [point for point in active if not (point.done or point.failed)]
            if not active:
                break
            self._advance(active)
        for point in active:
            point.failed = not point.done

    def evaluate(self, points: Sequence[Orbit]) -> None:
        """Evaluate the points where they start, with the derivative of those that have none."""
        old = []
        for point, trace in zip(points, self.map.traces([one.copy(one.state) for one in points]), strict=True):
            point.trace, point.failed = trace, trace is None
            point.reach = trace.reach if trace else None
            near = False
            if trace and point.at_end is not None:
                point.judge()
                near = self.near and point.residual * NEWTON.neighbour_contraction < NEWTON.expected * point.tolerance
            if trace and (point.at_end is None or (point.exact and not (point.done or near))):
                old.append(point)
        self._renew(old)

    def _advance(self, points: list[Orbit]) -> None:
        """Try the next step of every point; evaluate the derivative anew where it is too old."""
        trials = []
        for point in points:
            assert point.step is not None
            trials.append(point.copy(point.state + point.damping * point.step * point.scale))
        old = []
        for point, trial, trace in zip(points, trials, self.map.traces(trials), strict=True):
            point.iterations += 1
            point.reach = trace.reach if trace else None
            accepted = point.accepts(trial.state, trace)
            if not accepted:
                point.damping *= 0.5
                point.damped = True
                point.failed = point.damping < NEWTON.damping
            point.failed = point.failed or (point.iterations >= NEWTON.iterations and not point.done)
            if accepted and point.stale and not (point.done or point.failed):
                old.append(point)
        self._renew(old)

    def _renew(self, points: Sequence[Orbit]) -> None:
        """Take new derivatives of points that have a trace: along it where the equations are known, else by copies."""
        exact, courses, others, copies = list[Orbit](), list[Course](), list[Orbit](), list[Copy]()
        for point in points:
            if point.exact and point.trace and point.trace.course:
                exact.append(point)
                courses.append(point.trace.course)
            else:
                others.append(point)
                copies += _perturbed(point)
        with np.errstate(over="ignore", invalid="ignore"):
            found = derivatives(courses, self.map.discretisation)
        for point, derivative in zip(exact, found, strict=True):
            point.failed = not np.isfinite(derivative.at_end).all()  # a step far from the contact
            if not point.failed:
                point.linearise(derivative)
        traces = iter(self.map.traces(copies))
        for point in others:
            point.differentiate([(point.trace, next(traces) if one else point.trace) for one in point.slip.influential])

    def search(self) -> None:
        """Solve all points: from a given guess or harmonic balance, then from others, then after a transient.

        Where there is no harmonic balance, a point starts from the free stator, or from solved neighbours. The
        derivatives of the solved points are then measured again where they were measured too far away.
        """
        start_balanced([point for point in self.points if not point.guessed])
        seeds = _seeds(self.points)
        self.solve(seeds)
        others = [point for point in self.points if point not in seeds]
        for point in others:
            beside = _nearest(point, seeds)[:2]
            if beside:
                point.guess(between(beside))
        self.solve(others)
        for point in self.points:
            way = "damped" if point.damped else "newton"
            point.method = ("neighbour" if point.guessed else way) if point.done else ""
        lost = [point for point in self.points if point.failed]
        if lost:
            self._solve_lost(lost)
        self._unload()
        self._measure_anew()

    def _solve_lost(self, lost: list[Orbit]) -> None:
        """Solve points without a solution: from a start of their own, from solved points, and after transients."""
        guessed = [point for point in lost if point.guessed]
        for point in guessed:
            point.restart(start_point(point.plant).state)
        start_balanced(guessed)
        self.solve_by(guessed, "newton")
        lost = [point for point in lost if point.failed]
        near = [(point, others[0]) for point in lost if (others := _nearest(point, self.points))]
        for point, other in near:
            point.restart(other.state)
        self.solve_by([point for point, _ in near], "neighbour")
        self.shift(lost, "newton")
        for decays in NEWTON.settling:
            lost = [point for point in lost if point.failed]
            self._settle(lost, decays)
            self.solve_by(lost, "settled")

    def shift(self, lost: Sequence[Orbit], method: str) -> None:
        """Solve points of lined contacts that failed anew, with their steps elsewhere in the period.

        The force of a lining changes its slope where slip begins. Where that passes from one step to another, the map
        jumps by about 1e-4 of the motion, and for some places of the steps it has no fixed point. After the first place
        the derivative is that of perturbed copies, which sees the jumps.
        """
        for share in NEWTON.shifts:
            moving = [point for point in lost if point.failed and point.trace and point.lined]
            for point in moving:
                point.by_copies = share != NEWTON.shifts[0]
                moved = point.moved(point.begun + share * self.map.step, self.map.step)
                point.begun = moved.begun
                point.restart(moved.state)
            self.solve_by(moving, method)

    def _unload(self) -> None:
        """Move points whose shafts friction holds to the torque nearest to 0, from which a motor starts."""
        points = [point for point in self.points if point.held]
        for _ in range(NEWTON.unloadings):
            moved = []
            for point in points:
                assert point.trace is not None
                least, most = held_forces(point.plant, point.trace)
                change = float(np.clip(-point.trace.forces(point.plant)[1], NEWTON.held * least, NEWTON.held * most))
                if abs(change) > NEWTON.balance * point.plant.motor.contact.preload_n:
                    moved.append((point, point.with_force(change)))
            if not moved:
                break
            self.solve([there for _, there in moved])
            lost = [there for _, there in moved if there.failed]
            self._settle(lost, NEWTON.settling[0])
            self.solve(lost)
            points = [point for point, there in moved if there.done and there.held]
            for point, there in moved:
                if point in points:
                    vars(point).update(vars(there) | {"method": point.method, "iterations": point.iterations})

    def _measure_anew(self) -> None:
        """Measure the derivatives of solved points anew if they were measured too far away to tell the multipliers."""
        far = [point for point in self.points if point.done and point.far]
        self._renew(far)
        if doubtful := [point for point in far if not point.done]:  # by the new derivative
            self.solve(doubtful)
            self._renew([point for point in doubtful if point.done and point.far])

    def solve_by(self, points: Sequence[Orbit], method: str) -> None:
        """Solve points from where they are; ``method`` is then that of those that are solved."""
        self.solve(points)
        for point in points:
            point.method = method if point.done else ""

    def _settle(self, points: Sequence[Orbit], decays: float) -> None:
        """Run points from preloaded rest for a number of decay times of their slowest mode."""
        longest = 0.0
        for point in points:
            plant = point.plant
            longest = max(longest, decays * plant.motor.stator.with_carrier(plant.mount).decay_s)
            point.restart(rest(plant))
        periods = max(10, ceil(longest / self.map.period))
        ends = self.map.settled([Copy(point.plant, point.state, point.begun) for point in points], periods)
        for point, end in zip(points, ends, strict=True):
            if end is not None:
                point.state = end


def rest(plant: Plant) -> Array:
    """Return the state of a motor at preloaded rest."""
    state, stator = np.zeros(plant.order), plant.motor.stator
    if plant.law:
        state[: plant.modes] = -plant.motor.contact.preload_n * stator.preload_motion / stator.stiffness
    return state


def _seeds(points: Sequence[Orbit]) -> list[Orbit]:
    """Return the points to solve first: of a long curve at held speeds every third, otherwise all."""
    curves: dict[str, list[Orbit]] = {}
    for point in points:
        curves.setdefault(point.plant.curve, []).append(point)
    seeds = []
    for curve in curves.values():
        if len(curve) < LONG_CURVE or any(
            point.plant.load.speed is None or point.guessed or point.informed for point in curve
        ):
            seeds += curve
        else:
            seeds += sorted(curve, key=lambda point: point.plant.load.speed or 0.0)[::SPACING]
    return seeds


def _nearest(point: Orbit, points: Sequence[Orbit]) -> list[Orbit]:
    """Return the solved points of the same curve at held speeds, that with the nearest speed first."""
    speed, curve = point.plant.load.speed, point.plant.curve
    if speed is None:
        return []
    others = [other for other in points if other.done and not other.plant.turns and other.plant.curve == curve]
    return sorted(others, key=lambda other: abs((other.plant.load.speed or 0.0) - speed))


def _perturbed(point: Orbit) -> list[Copy]:
    """Return copies of a point, each with one of the influential states changed by :class:`Tolerances` of its scale."""
    states = point.state + NEWTON.perturbation * np.diag(point.scale)[point.slip.influential]
    return [Copy(point.plant, state, point.begun) for state in states]
