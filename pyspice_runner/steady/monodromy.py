# SPDX-License-Identifier: GPL-3.0-or-later
r"""The derivative of the map over a period, from the equations linearised along the trace that ngspice computed.

ngspice integrates ẋ = f(x, t) by the trapezoidal rule. A small change δ of the state at one point changes that at the
next one, a step h later, to

.. math::
    \delta_{n+1} = \left(1 - \tfrac h2 A_{n+1}\right)^{-1}\left(1 + \tfrac h2 A_n\right)\delta_n, \qquad
    A_n = \partial f/\partial x\,(x_n, t_n)

so the product over a period is the derivative of the discretised map itself, without perturbed copies. The contact's
share of A is the difference quotient of the library's own equations (:mod:`.evaluated`). Between events these are
smooth, and a small change moves no event to another step. T. J. Aprille, T. N. Trick, Proc. IEEE 60 (1972).

A small input u adds h/2 (B_n u_n + B_{n+1} u_{n+1}), in B the contact's share by what the voltages push.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.circuit.evaluated import DIFFERENCE, evaluable, library_function, parameter_columns
from pyspice_runner.circuit.law import libraries_of, unplotted
from pyspice_runner.circuit.motor import SLIDER_TIME, rounded
from pyspice_runner.circuit.state import MICRO, Discretisation, pushes, static_places, stems, written_stator
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.stator import square
from pyspice_runner.run.window import Array
from pyspice_runner.spice.library import read_library
from pyspice_runner.steady.copies import Plant, drive_voltage

Complex = NDArray[np.complex128]
FORCES = ("fx", "fy", "friction", "normal")  # of the contact, in N
PLACES = ("a", "b", "shaft", "time")  # of a small input: voltage of a group, torque on the rotor, the drive's frequency


@dataclass(frozen=True)
class Derivative:
    """Derivatives with respect to the state at the start of a run, in SI units."""

    at_start: Array  # of the state at the beginning of the period, shape (order, order)
    at_end: Array  # of the state at its end
    forces: Array  # of the mean normal and the mean friction force of all contacts, N, shape (2, order)
    monodromy: Array  # of the state at the end with respect to that at the beginning


@dataclass(frozen=True)
class Course:
    """The points of one run, from its first to the end of the period, as :class:`.Trace` has them."""

    plant: Plant
    time: Array  # s
    states: Array  # shape (order, points)
    normal: Array  # N, shape (k, points) as the following
    friction: Array  # N
    penetration_um: Array
    first: int  # the point at which the period begins
    begun: float = 0.0  # time since the drive's phase was that of t = 0 at the start of the run, s

    def pushed(self, name: str) -> Array:
        """Return the force in N by which the voltages move an instance of what is in series with the contact."""
        force = np.zeros(len(self.time))
        by_group = pushes(self.plant.motor, self.plant.law).get(name, ())
        for per_volt, tones in zip(by_group, self.plant.drive.tones, strict=False):
            force += rounded(per_volt) * drive_voltage(tones, self.begun + self.time)
        return force


def differentiable(plant: Plant) -> bool:
    """Return whether the equations of a plant are known; a user's own law has them if numpy can evaluate it.

    Contacts with different laws, or of which some alone have a compliance in series, are not alike, and their
    derivatives are those of copies.
    """
    libraries = libraries_of(plant.motor, plant.law)
    alike = len(stems(plant.motor, plant.law)) % len(plant.motor.touching) == 0
    return alike and len({library.name for library in libraries}) == 1 and evaluable(libraries[0])


def derivatives(courses: Sequence[Course], discretisation: Discretisation) -> list[Derivative]:
    """Return the derivatives of runs whose plants are differentiable."""
    found: dict[int, Any] = dict.fromkeys(range(len(courses)))
    groups: dict[tuple[Any, ...], dict[int, Course]] = {}
    for place, course in enumerate(courses):
        plant = course.plant
        library = libraries_of(plant.motor, plant.law)[0]
        kinds = tuple((state.kind, state.part) for state in plant.states)
        groups.setdefault((library, kinds, course.first, course.time.tobytes()), {})[place] = course
    for group in groups.values():
        found |= zip(group, Linearised(list(group.values()), discretisation).derivatives(), strict=True)
    return list(found.values())


class Linearised:
    """Linearised runs of similar plants with the same points in time. Axes of arrays are runs, points, and others.

    Where an array has rows, these are the contacts of the first run, then those of the next.
    """

    def __init__(self, courses: Sequence[Course], discretisation: Discretisation) -> None:
        self.courses, self.discretisation = courses, discretisation
        self.plant = courses[0].plant
        assert self.plant.law is not None
        self.law = self.plant.law
        self.library = unplotted(libraries_of(self.plant.motor, self.law)[0])
        self.function = library_function(self.library)
        self.row = slice(5, 5 + self.law.sliders) if self.law.row else None  # place of the sliders among the inputs
        self.count, places = len(self.plant.motor.touching), self.plant.places
        self.inner = np.r_[places["contact"], places["stem"]]  # states of contacts and stems
        lags = np.arange(self.plant.order)[places["stem"]].reshape(self.count, -1)
        self.own = np.concatenate([self.plant.sliders, lags], axis=1)  # those of each contact
        self.units = np.array([self.plant.states[place].unit for place in self.own[0]])
        self.states = np.array([course.states.T for course in courses])
        # runs of the same motor share what depends on it alone
        names = [course.plant.motor_name for course in courses]
        _, first, self.which = np.unique(names, return_index=True, return_inverse=True)  # ``which``: motor of each run
        self.plants = [courses[place].plant for place in first]
        self.rows = (self.which[:, np.newaxis] * self.count + np.arange(self.count)).ravel()  # of those of the motors

    @cached_property
    def stems(self) -> dict[str, dict[str, Any]]:
        """The parameters of the libraries of what is in series with the contact, by instance."""
        slider_time = rounded(self.discretisation.slider_time)  # a law may have no slider
        known = read_library("piezomotor_stem").defaults | {SLIDER_TIME: slider_time}
        # rounded as in the netlist: the rate is a small difference of two forces, over half a step
        found: dict[str, dict[str, Any]] = {}
        for name in ("stem", "stem_x"):
            if name not in stems(self.plant.motor, self.law):
                continue
            own = []
            for plant in self.plants:
                softness = stems(plant.motor, self.law)
                for one in plant.motor.touching:
                    preload = rounded(one.preload_n) if name == "stem" else 0.0
                    own.append((preload, rounded(softness[f"{name}{one.suffix}"])))
            values = np.array(own)[self.rows, np.newaxis]
            found[name] = known | {"preload": values[..., 0], "compliance": values[..., 1]}
        return found

    @cached_property
    def tip(self) -> Array:
        """What each state moves x, y (µm), vx, vy (m/s), shaft (rad/s) of each contact, shape (runs, k, 5, order)."""
        found = np.zeros((len(self.plants), self.count, 5, self.plant.order))
        places, speeds = self.plant.moving
        for one, plant in enumerate(self.plants):
            contact = plant.motor.stator.with_carrier(plant.mount).contact
            found[one][:, 0:2, places] = contact.reshape(self.count, 2, -1) / MICRO
            found[one][:, 2:4, speeds] = contact.reshape(self.count, 2, -1)
        if self.plant.turns:
            found[:, :, 4, -1] = 1.0
        return np.asarray(found[self.which])

    def _contact(self) -> tuple[Array, Array]:
        """Return the derivatives of the contacts' outputs: forces on the tips and rates of their states.

        The outputs are fx, fy, friction, normal force in N of each contact, and the rates of the inner states in SI
        units, shape (runs, points, outputs, order). The second array has those by the forces on what is in series along
        x and y, of each output those at its own contact.
        """
        plant, own, runs, count = self.plant, len(self.function.states), len(self.courses), self.count
        held = np.zeros((runs, count, 1, 5))
        places = np.array([static_places(one.motor, plant.law, self.discretisation) for one in self.plants])
        held[..., 0, 0] = -places[self.which, :, 0] / MICRO
        speeds = [0.0 if plant.turns else course.plant.load.speed or 0.0 for course in self.courses]
        held[..., 0, 4] = np.array(speeds)[:, np.newaxis]
        pins = self.states[:, np.newaxis] @ self.tip.swapaxes(2, 3) + held
        inner = np.moveaxis(self.states[..., self.own], 2, 1) / self.units
        each = [(one.friction - one.pushed("stem_x"), one.normal - one.pushed("stem")) for one in self.courses]
        forces = np.moveaxis(np.array(each), 1, 3)
        pins, inner, forces = (one.reshape(runs * count, *one.shape[2:]) for one in (pins, inner, forces))
        moved = self._through_stems(np.concatenate([pins, inner[..., own:], forces], axis=2))
        slopes = self._slopes(np.concatenate([moved[..., :5], inner[..., :own]], axis=2))
        # what is in series with the contact is linear, and its forces depend on how far they compress it
        lags = inner.shape[2] - own
        unit = np.eye(5 + lags + 2)
        linear = np.swapaxes(self._through_stems(unit) - self._through_stems(np.zeros_like(unit)), 1, 2)[:, np.newaxis]
        by_force = linear[..., 5 + lags :]
        at_pins = np.zeros((*linear.shape[:3], 5 + own + lags + 2))
        at_pins[..., :5], at_pins[..., 5 + own : -2], at_pins[..., -2:] = linear[..., :5], linear[..., 5:-2], -by_force
        direct = slopes[..., 2:4, :5] @ at_pins[..., :5, :]
        direct[..., 5 : 5 + own] += slopes[..., 2:4, 5:]
        back = slopes[..., 2:4, :5] @ by_force[..., :5, :]
        total = at_pins + by_force @ np.linalg.solve(np.eye(2) - back, direct)
        outputs = slopes[..., :5] @ total[..., :5, :]  # a sum of products with the slopes would amplify their errors
        outputs[..., 5 : 5 + own] += slopes[..., 5:]
        every = np.concatenate([outputs, self.units[own:, np.newaxis] * total[..., 5:, :]], axis=2)
        every = every.reshape(runs, count, *every.shape[1:])
        found = every[..., :5] @ self.tip[:, :, np.newaxis]
        for number, places in enumerate(self.own):
            found[:, number][..., places] += every[:, number, ..., 5:-2] / self.units
        return self._in_order(found), self._in_order(every[..., -2:])

    def _in_order(self, outputs: Array) -> Array:
        """Return outputs of shape (runs, k, points, outputs, …) in the order of :meth:`_contact`."""
        own, every = 4 + len(self.function.states), np.moveaxis(outputs, 1, 2)
        parts = every[:, :, :, :4], every[:, :, :, 4:own], every[:, :, :, own:]
        return np.concatenate([part.reshape(*part.shape[:2], -1, part.shape[-1]) for part in parts], axis=2)

    def _slopes(self, values: Array) -> Array:
        """Return the derivatives of the outputs of :meth:`_outputs`, shape (rows, points, outputs, inputs)."""
        scales = np.abs(values).max(axis=(0, 1))
        contacts = [one.contact for plant in self.plants for one in plant.motor.touching]
        damping = max(map(contact_law.normal_damping, contacts))
        scales[3] = min(scales[3], 1.0 / damping) if damping else scales[3]  # vy, which damping multiplies
        steps = DIFFERENCE * np.where(scales > 0.0, scales, 1.0)
        changes = np.diag(steps)
        if self.row:  # its sliders change together
            steps[self.row] = steps[self.row].max()
            changes[self.row.start, self.row] = steps[self.row]
            changes = np.delete(changes, range(self.row.start + 1, self.row.stop), axis=0)
        outputs = self._outputs(values[:, :, np.newaxis] + np.vstack([np.zeros_like(steps), changes]))
        found = outputs[:, :, 1:] - outputs[:, :, :1]
        if self.row:
            found = self._separated(found, self.row, steps[self.row.start])
        return np.asarray(np.moveaxis(found / steps[:, np.newaxis], 2, 3))

    def _separated(self, found: Array, row: slice, step: float) -> Array:
        """Divide the changes of the outputs between the sliders that change by a step in um together.

        The rate of each follows from itself alone, and each has the share of the force that its held displacement has.
        """
        together, count = found[:, :, row.start], row.stop - row.start
        rates = together[..., 4 : 4 + count]
        held = step + self.discretisation.slider_time * rates / self.units[:count]  # um, of what charges the slider
        total = held.sum(axis=-1, keepdims=True)
        share = np.divide(held, total, out=np.zeros_like(held), where=np.abs(total) > 0.5 * step)
        own = np.zeros((*rates.shape, together.shape[-1]))
        own[..., :4] = share[..., np.newaxis] * together[..., np.newaxis, :4]
        own[..., np.arange(count), 4 + np.arange(count)] = rates
        return np.concatenate([found[:, :, : row.start], own, found[:, :, row.start + 1 :]], axis=2)

    def _through_stems(self, inputs: Array) -> Array:
        """Return x, y, vx, vy, shaft as the contact has them, and the rates of the lags of what is in series with it.

        The inputs are x, y, vx, vy, shaft as the base of the tip has them, the lags, friction and normal force, both
        less that by which the voltages move what is in series.
        """
        if inputs.ndim == 2:  # the same in all rows
            inputs = np.broadcast_to(inputs, (len(self.rows), *inputs.shape))
        x, y, vx, vy, shaft, *lags, friction, normal = np.moveaxis(inputs, -1, 0)
        pins, rates = {"x": x, "y": y, "vx": vx, "vy": vy, "shaft": shaft}, list[Any]()
        function, at = library_function(read_library("piezomotor_stem")), 0
        for name, parameters in self.stems.items():
            axis, force = ("x", friction) if name == "stem_x" else ("y", normal)
            given = parameters | {"y": pins[axis], "vy": pins[f"v{axis}"], "normal": force}
            moved = function(given | dict(zip(function.states, lags[at : at + len(function.states)], strict=True)))
            pins |= {"vx": moved["stem_vy"]} if axis == "x" else {"y": moved["stem_y"], "vy": moved["stem_vy"]}
            rates += map(moved.__getitem__, function.rates)
            at += len(function.states)
        return np.stack(np.broadcast_arrays(*pins.values(), *rates), axis=-1)

    def _outputs(self, inputs: Array) -> Array:
        """Return forces on the tip, friction, normal force and rates of the contact's states, in SI units.

        The inputs are x, y, vx, vy, shaft and the contact's states.
        """
        columns = parameter_columns(self.law, [plant.motor for plant in self.plants], self.discretisation)
        values: dict[str, Any] = {name: one[self.rows, np.newaxis, np.newaxis] for name, one in columns.items()}
        x, y, vx, vy, shaft, *states = np.moveaxis(inputs, -1, 0)
        names = self.function.states
        values |= {"x": x, "y": y, "vx": vx, "vy": vy, "shaft": shaft} | dict(zip(names, states, strict=True))
        depth = np.concatenate([course.penetration_um for course in self.courses])[..., np.newaxis]
        found = self.function.of([*FORCES, *self.function.rates], values, {"delta": depth})
        outputs = np.stack(np.broadcast_arrays(*found.values()), axis=-1)
        outputs[..., len(FORCES) :] *= self.units[: len(names)]
        return outputs

    def _structure(self) -> tuple[Array, Array, Array]:
        """Return A without the contact, what its outputs add, and what both voltages and a torque on the rotor add.

        The shapes are (runs, order, order), (runs, order, outputs) and (runs, order, 3).
        """
        plant, (places, speeds), runs = self.plant, self.plant.moving, len(self.plants)
        rates = np.zeros((runs, plant.order, plant.order))
        inputs = np.zeros((runs, plant.order, 4 * self.count + len(self.inner)))
        on_tips = [4 * number + axis for number in range(self.count) for axis in (0, 1)]
        driven = np.zeros((runs, plant.order, 3))
        rates[:, places, speeds] = 1.0
        for run, one in enumerate(self.plants):
            stator = written_stator(one.motor, self.discretisation, one.mount)
            inverse = np.linalg.inv(square(stator.mass))
            rates[run][np.ix_(speeds, places)] = -inverse @ square(stator.stiffness)
            rates[run][np.ix_(speeds, speeds)] = -inverse @ square(stator.damping)
            inputs[run][np.ix_(speeds, on_tips)] = inverse @ stator.contact.T
            driven[run, speeds, :2] = inverse @ stator.coupling[:, :2]
            if electrode := stator.feedback:
                place = self.plant.places["feedback"].start
                rates[run, speeds, place] = inverse @ stator.sensed
                rates[run, place, speeds] = -stator.sensed / electrode.capacitance_f
                rates[run, place, place] = -1.0 / (electrode.resistance_ohm * electrode.capacitance_f)
            if plant.turns:
                rotor = one.motor.rotor
                rates[run, -1, -1] = -rotor.bearing_damping_n_m_s / rotor.inertia_kg_m2
                inputs[run, -1, 2 : 4 * self.count : 4] = one.motor.at_rest.radius_m / rotor.inertia_kg_m2
                driven[run, -1, 2] = 1.0 / rotor.inertia_kg_m2
        inputs[:, self.inner, 4 * self.count :] = np.eye(len(self.inner))
        return rates[self.which], inputs[self.which], driven[self.which]

    def _softening(self) -> Array:
        """Return what modes add to A that soften and lose more at large amplitudes, by run and point."""
        n, speeds = self.plant.modes, self.plant.moving[1]
        found = np.zeros((*self.states.shape, self.plant.order))
        for run, course in enumerate(self.courses):
            motor = course.plant.motor
            soft, growth = motor.stator.softening, motor.stator.growth
            stator = written_stator(motor, self.discretisation, course.plant.mount)
            moved, moving = self.states[run, :, :n], self.states[run, :, n : 2 * n]
            stiffness, damping = np.diag(square(stator.stiffness))[:n], np.diag(square(stator.damping))[:n]
            inverse = np.linalg.inv(square(stator.mass))[:, :n]
            by_place = (3.0 * soft * stiffness * moved - 2.0 * growth * damping * moving) * moved
            found[run][:, speeds, :n] = inverse * by_place[:, np.newaxis]
            found[run][:, speeds, n : 2 * n] = -inverse * (growth * damping * moved**2)[:, np.newaxis]
        return found

    def derivatives(self) -> list[Derivative]:
        """Return the derivatives of the runs."""
        contact, _ = self._contact()
        rates, inputs, _ = self._structure()
        slopes = rates[:, np.newaxis] + inputs[:, np.newaxis] @ contact + self._softening()
        time, first, unit = self.courses[0].time, self.courses[0].first, np.eye(self.plant.order)
        half = 0.5 * np.diff(time)[:, np.newaxis, np.newaxis]
        forward = np.linalg.solve(unit - half * slopes[:, 1:], unit + half * slopes[:, :-1])
        # the first point comes after a short step of first order
        at_start = np.linalg.inv(unit - time[0] * slopes[:, 0])
        for place in range(first):
            at_start = forward[:, place] @ at_start
        since = np.empty((forward.shape[1] - first, *at_start.shape))  # the beginning of the period
        now: Array = np.broadcast_to(unit, at_start.shape)
        for place in range(len(since)):
            now = np.matmul(forward[:, first + place], now, out=since[place])
        levers = np.array([course.plant.motor.stator.lever for course in self.courses])[:, np.newaxis, :, np.newaxis]
        of_contacts = contact[:, first + 1 :, : 4 * self.count]
        friction, normal = of_contacts[:, :, 2::4], of_contacts[:, :, 3::4]
        forces = np.stack([normal.sum(axis=2), (levers * friction).sum(axis=2)], axis=2)
        forces = np.moveaxis(forces, 1, 0) @ since
        return list(map(Derivative, at_start, now @ at_start, forces.mean(axis=0) @ at_start, now))

    def responses(self, probes: Sequence[tuple[str, float]], turns: Complex) -> Complex:
        """Return the responses of states, normal and friction forces of the first run to small inputs e^{jωt}.

        They are those of which a period later each is ``turns`` times itself, shape (probes, order + 2k, points of the
        period). A probe is one of :data:`PLACES` and its frequency in Hz, below 0 too. A frequency of the drive, in Hz,
        adds minus the rates of the states over the drive's: the response is that beside the motion with its phase.
        """
        (contact, *_), (pushed, *_) = self._contact()
        rates, inputs, driven = (one[0] for one in self._structure())
        course, order, unit = self.courses[0], self.plant.order, np.eye(self.plant.order)
        contact, pushed, time = contact[course.first :], pushed[course.first :], course.time[course.first :]
        pushing = np.zeros((2, 3))  # force on what is in series along x and y per input
        for name, per_volt in pushes(course.plant.motor, self.law).items():
            pushing[("stem_x", "stem").index(name), :2] = per_volt
        waves = np.zeros((len(time), len(PLACES), len(probes)), complex)
        for number, (place, frequency) in enumerate(probes):
            waves[:, PLACES.index(place), number] = np.exp(2j * np.pi * frequency * (course.begun + time))
        waves, shifts = waves[:, :3], waves[:, 3:]
        rising = np.diff(course.states[:, course.first :]).T[..., np.newaxis] / course.plant.drive.frequencies[0]
        slopes = rates + inputs @ contact + self._softening()[0, course.first :]
        half = 0.5 * np.diff(time)[:, np.newaxis, np.newaxis]
        added = (driven + inputs @ pushed @ pushing) @ waves
        implicit = np.linalg.inv(unit - half * slopes[1:])
        added = half * (added[1:] + added[:-1]) - 0.5 * rising * (shifts[1:] + shifts[:-1])
        forward, added = implicit @ (unit + half * slopes[:-1]), implicit @ added
        states = np.zeros((len(time), order, order + len(probes)), complex)  # by each state at the start, by each input
        states[0, :, :order] = unit
        for now, after, step, more in zip(states[:-1], states[1:], forward, added, strict=True):
            after[:] = step @ now
            after[:, order:] += more
        size = np.abs(course.states).max(axis=1)
        size[size == 0.0] = 1.0
        left = (turns[:, np.newaxis, np.newaxis] * unit - states[-1, :, :order]) * size / size[:, np.newaxis]
        right = (states[-1, :, order:] / size[:, np.newaxis]).T
        starts = [np.linalg.lstsq(*pair, rcond=1e-10)[0] * size for pair in zip(left, right, strict=True)]
        found = states[..., :order] @ np.array(starts).T + states[..., order:]
        of_forces = [4 * number + place for place in (3, 2) for number in range(self.count)]
        forces = contact[:, of_forces] @ found + pushed[:, of_forces] @ pushing @ waves
        return np.asarray(np.concatenate([found, forces], axis=1).T)
