# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor as compiled C code in this process.

The code of ``behavioral/piezomotor_averaged.c`` is compiled once for each number of modes, carriers and contacts
into the user's cache; motors of one size share it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyspice_runner.averaged.c_code import (
    NETWORK,
    TRACKER,
    Front,
    Size,
    part_values,
    session_texts,
    state_names,
    variables,
)
from pyspice_runner.averaged.library import HARMONICS, PHASES, Schedule, Terms, first, require_averaged
from pyspice_runner.errors import SimulationError
from pyspice_runner.files import cache_folder
from pyspice_runner.motor.drive import UNCOUPLED, ShaftLoad
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.spice.compiler import cached_library

Array = NDArray[np.float64]
INPUTS = (
    "amplitude_a", "amplitude_b", "phase", "frequency", "load_torque", "ambient_temperature", "preload", "friction"
)  # fmt: skip
_ROWS = 512  # between two looks at the clock
SETTLING, SETTLED = ("speed", "torque", "tip_x_amplitude", "temperature"), 1e-6  # what settles; relative change
LONG, PATIENCE = 1.0, 20.0  # s of motor time between two looks at the clock; s of wall time
SHORT, DOUBLINGS = 5e-3, 25  # s, first interval between two looks; each is twice as long as the one before it
_POINTER = ctypes.POINTER(ctypes.c_double)
# functions of piezomotor_session.c: type of the result, types of the arguments behind the motor
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "default": (None, ()),
    "begin": (None, (ctypes.c_double, ctypes.c_double)),
    "zero": (None, ()),
    "advance": (ctypes.c_int, (ctypes.c_double,)),
    "record": (ctypes.c_int, (_POINTER, ctypes.c_double, _POINTER, ctypes.c_int)),
    "sums": (None, (_POINTER,)),
    "amplitude": (ctypes.c_double, (ctypes.c_int,)),
    "linearise": (None, (_POINTER, _POINTER)),
}
_TRACK = {"track": (None, (_POINTER, ctypes.c_int, ctypes.c_int))}  # of a library with a loop
_DRIVE = {"drive": (None, (_POINTER, ctypes.c_int))}  # of a library with networks


@dataclass(frozen=True)
class LinearMotor:
    """The averaged motor about a state: rates of the states = ``by_state`` · states + ``by_input`` · inputs."""

    by_state: Array  # shape (states, states)
    by_input: Array  # shape (states, inputs), inputs in the order of INPUTS; with a loop its target is behind them
    place: Mapping[str, int]  # name of a state, as of :func:`.state_names` → its place


@dataclass(frozen=True)
class Loop:
    """A phase-locked loop that sets the frequency of the motor."""

    values: Mapping[str, float]  # of the parameters of ``tracker_averaged`` and ``tracker_filter``
    mode: int  # number of the mode, from 0, whose phase is an output


@cache
def _library(size: Size, terms: Terms, front: Front, phases: int, harmonics: int, folder: Path) -> ctypes.CDLL:
    texts = session_texts(size, terms, front, phases=phases, harmonics=harmonics)
    loaded = ctypes.CDLL(str(cached_library("piezomotor_averaged", texts, folder)))
    functions = _FUNCTIONS | (_TRACK if front.tracked else {}) | (_DRIVE if front.driven else {})
    for name, (result, arguments) in functions.items():
        function = getattr(loaded, f"session_{name}")
        function.restype, function.argtypes = result, (ctypes.c_void_p, *arguments)
    return loaded


class AveragedMotor:
    """One averaged motor, from preloaded rest.

    Args:
        motor: the motor.
        thermal: drift with temperature; the losses then heat the stator. Without it the stator keeps its temperature.
        shaft: load that is coupled to the shaft.
        speed: if given, the shaft is held at this speed, rad/s.
        phases: number of phases of the period at which the contact is evaluated.
        harmonics: number of harmonics of the tip's motion.
        longest: longest internal step, s.
        loop: phase-locked loop that sets the frequency; the motor then has the input ``target`` (degrees), and the
            outputs ``control`` (V) and ``mode_phase`` (degrees).
        networks: parameters of ``driver_averaged`` of groups A and B, if there are networks between the inputs'
            amplitudes and the groups; the motor then has the outputs ``pin_amplitude_a`` and ``pin_amplitude_b`` (V).

    Raises:
        ParameterError: for a motor without an averaged model.
        SimulationError: if there is no C compiler, or it fails.
    """

    def __init__(
        self,
        motor: Motor,
        *,
        thermal: Thermal | None = None,
        shaft: ShaftLoad = UNCOUPLED,
        speed: float | None = None,
        phases: int = PHASES,
        harmonics: int = HARMONICS,
        longest: float = inf,
        loop: Loop | None = None,
        networks: Sequence[Mapping[str, float]] = (),
    ) -> None:
        motor = require_averaged(motor)
        size, front = Size.of(motor), Front(loop is not None, bool(networks))
        hint = "This user has no home folder for compiled modules. Set HOME or XDG_CACHE_HOME."
        folder = cache_folder("modules", SimulationError(hint))
        self._c = _library(size, Terms.of(motor), front, phases, harmonics, folder)
        known = variables(motor, thermal, shaft, front)
        inputs = (*INPUTS, "target") if loop else INPUTS
        self._modes, self._states = size.modes, state_names(size, harmonics, tracked=front.tracked)
        self._places = {item.name: item.reference for item in known}
        self.shown = tuple(item.name for item in known if item.name in inputs or item.causality == "output")
        self._memory = ctypes.create_string_buffer(self._c.session_bytes())
        self._values = (ctypes.c_double * len(known)).from_buffer(self._memory)
        self._slopes = (ctypes.c_double * len(inputs)).from_buffer(self._memory, self._c.session_slopes())
        self._c.session_default(self._memory)
        if loop is not None:
            given = part_values(TRACKER, loop.values)
            self._c.session_track(self._memory, given.ctypes.data_as(_POINTER), given.size, loop.mode)
        if networks:
            given = part_values(NETWORK, *networks)
            self._c.session_drive(self._memory, given.ctypes.data_as(_POINTER), given.size // len(networks))
        for item in known:
            self._values[item.reference] = item.start or 0.0
        if thermal is None:  # the stator has the temperature of the surroundings
            self._values[self._places["heat_capacity"]] = 0.0
            self._values[self._places["ambient_temperature"]] = 0.0
        if speed is not None:
            self._values[self._places["inertia"]] = inf
        self._longest, self._speed = longest, speed or 0.0

    def begin(self, **inputs: float) -> None:
        """Set inputs, and start at preloaded rest."""
        self.set(**inputs)
        self._c.session_begin(self._memory, self._longest, self._speed)

    def set(self, **inputs: float) -> None:
        """Set inputs from now on."""
        for name, value in inputs.items():
            self._values[self._places[name]] = value

    def get(self, name: str) -> float:
        """Return a value: an input, a parameter, or an output as of the last step."""
        return float(self._values[self._places[name]])

    def advance(self, begin: float, end: float, courses: Mapping[str, Schedule] | None = None) -> None:
        """Advance from one time in s to another; inputs are constant but for courses, which are linear in between.

        Raise SimulationError if the equations have no solution.
        """
        for start, stop in self._follow(courses or {}, begin, end):
            if self._c.session_advance(self._memory, stop - start):
                raise self._unsolved()

    def settle(self) -> None:
        """Advance with constant inputs to the steady state; set the angle of the rotor to 0 there.

        Raise SimulationError if there is none, or the motor has not settled after :data:`PATIENCE` of wall time.
        """
        never = SimulationError("The averaged motor does not settle at these inputs: start at rest.")
        duration, before, deadline = SHORT, np.full(len(SETTLING), inf), monotonic() + PATIENCE
        for _ in range(DOUBLINGS):
            for begin in np.arange(0.0, duration, LONG).tolist():
                self.advance(0.0, min(LONG, duration - begin))
                if monotonic() > deadline:
                    raise never
            now = np.array([self.get(name) for name in SETTLING])
            if np.all(np.abs(now - before) <= SETTLED * np.abs(now)):
                self._c.session_zero(self._memory)
                return
            duration, before = 2.0 * duration, now
        raise never

    def record(
        self,
        courses: Mapping[str, Schedule],
        duration: float,
        *,
        timeout: float | None = None,
        progress: Callable[[float], object] | None = None,
        begin: bool = True,
    ) -> dict[str, Array]:
        """Run with inputs that follow courses; return ``time`` and :attr:`shown` after each internal step.

        It begins at rest, or without ``begin`` where the motor is.

        Raise SimulationError if the equations have no solution, or after ``timeout`` in s of wall time.
        """
        if begin:
            self.begin(**{name: first(course) for name, course in courses.items()})
        found = [np.array([[0.0, *self._values[: len(self.shown)]]])]
        deadline = monotonic() + (inf if timeout is None else timeout)
        for start, end in self._follow(courses, 0.0, duration):
            time = ctypes.c_double(start)
            while time.value < end:
                rows = np.empty((_ROWS, 1 + len(self.shown)))
                into = rows.ctypes.data_as(_POINTER)
                count = self._c.session_record(self._memory, ctypes.byref(time), end, into, _ROWS)
                if count < 0:
                    raise self._unsolved()
                found.append(rows[:count])
                if progress:
                    progress(time.value)
                if monotonic() > deadline:
                    raise SimulationError(f"The averaged motor took longer than {timeout:g} s. Give a greater timeout.")
        table = np.concatenate(found)
        return {name: table[:, place] for place, name in enumerate(("time", *self.shown))}

    def _follow(self, courses: Mapping[str, Schedule], begin: float, end: float) -> Iterator[tuple[float, float]]:
        """Yield the intervals between corners of courses, with the inputs and their slopes set to those there."""
        corners = {time for course in courses.values() for time, _ in course if begin < time < end}
        ends = [begin, *sorted(corners), end]
        at = {name: np.interp(ends, *np.transpose(course)).tolist() for name, course in courses.items()}
        for number, (start, stop) in enumerate(pairwise(ends)):
            for name, values in at.items():
                self._values[self._places[name]] = values[number]
                self._slopes[self._places[name]] = (values[number + 1] - values[number]) / (stop - start)
            yield start, stop

    @property
    def sums(self) -> tuple[list[complex], list[complex], float]:
        """Integrals since the start: amplitudes of the groups' currents, A·s, and voltages, V·s; power, J."""
        found = (ctypes.c_double * 9)()
        self._c.session_sums(self._memory, found)
        integrals = [complex(*found[place : place + 2]) for place in range(0, 8, 2)]
        return integrals[:2], integrals[2:], found[8]

    def linearised(self) -> LinearMotor:
        """Return the small signals about the present state."""
        count = self._c.session_states()
        by_state, by_input = np.empty((count, count)), np.empty((count, len(self._slopes)))
        self._c.session_linearise(self._memory, *(one.ctypes.data_as(_POINTER) for one in (by_state, by_input)))
        return LinearMotor(by_state, by_input, {name: place for place, name in enumerate(self._states)})

    def mode_amplitudes(self) -> list[float]:
        """Return for each mode the largest displacement of its coordinate by all harmonics in phase, m."""
        return [float(self._c.session_amplitude(self._memory, index)) for index in range(self._modes)]

    def _unsolved(self) -> SimulationError:
        return SimulationError("The equations of the averaged motor have no solution. Check its parameters.")
