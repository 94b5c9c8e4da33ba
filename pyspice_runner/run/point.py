# SPDX-License-Identifier: GPL-3.0-or-later
"""The operating point of a running motor: motor, source, load, contact and solver. Every analysis works on it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Annotated, Any, TypedDict

from pydantic import Field

from pyspice_runner.circuit.bench import FREE, Bench, motor_bench
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw, Law, law_of, law_settings, touching_law
from pyspice_runner.circuit.source import Excitation, Source, source_of
from pyspice_runner.circuit.state import Discretisation, Motion, recorded_motion, state_vectors
from pyspice_runner.errors import ParameterError, require
from pyspice_runner.motor.drive import Drive, Load
from pyspice_runner.motor.motor import Motor, derived
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.kernel import Outcome, transient
from pyspice_runner.run.paths import Parameter, canonical, changed, parameter, unknown

MOST_POINTS = 20_000_000  # recorded points: 4 GB of vectors, 160 MB per signal
_ROUNDED_DOWN = 0.995  # a limit that is printed with three digits is not above itself
MOST_STEPS = 1e6  # in the period of the fastest motion, 128 by default; a run with more would not end
LEAST_ACCURACY, MOST_ACCURACY = 1e-4, 0.05  # finer, Newton's iteration counts; coarser, the order is lost


@dataclass(frozen=True)
class Solver:
    """How a run is solved. An accuracy out of range is a ParameterError."""

    # time step in s; the largest where steps are not uniform. By default from the fastest motion.
    step: float | None = None
    # error allowed of the tip's trajectory, RMS relative to its motion; it chooses the step.
    accuracy: float | None = None
    # whether modes are written so that the trapezoidal rule resonates where they do
    # (:class:`~pyspice_runner.circuit.motor.Discretisation`); only with uniform steps.
    exact_resonance: bool = True
    timeout: float | None = None  # wall time in s after which ngspice is ended
    audit: bool = True  # whether a result that fails the physical audit (:mod:`.audit`) is an error

    def __post_init__(self) -> None:
        valid = self.accuracy is None or LEAST_ACCURACY <= self.accuracy <= MOST_ACCURACY
        words = f"a relative error from {LEAST_ACCURACY:g} to {MOST_ACCURACY:g} of the tip's motion"
        require(valid, "accuracy", self.accuracy, words)


DEFAULT = Solver()


class RunSettings(TypedDict, total=False):
    """Keywords of the analyses of a motor: the law of its contact, and how it is solved."""

    contact: Annotated[
        ContactLaw | None,
        Field(
            default=PAPER_LAW,
            description="law of the contact: a built-in law, by default the paper's; the path of a law of the "
            "user's own; None for a free tip",
        ),
    ]
    step: Annotated[
        float | None,
        Field(
            default=None, description="longest time step in s; by default from the fastest motion of drive and motor"
        ),
    ]
    timeout: Annotated[
        float | None, Field(default=None, description="wall time in s after which a run of ngspice is ended")
    ]


class Settings(RunSettings, total=False):
    """Keywords of the analyses of a motor with a load on its shaft."""

    speed: Annotated[
        float | None,
        Field(default=None, description="speed in rad/s at which the shaft is held; None leaves it free"),
    ]
    load_torque: Annotated[
        float,
        Field(
            default=0.0,
            description="torque in N·m that a load draws from the free shaft, positive against the positive direction",
        ),
    ]


@dataclass(frozen=True)
class Point:
    """A motor, its source, its load and its solver. A load or a time step that is out of range is a ParameterError."""

    motor: Motor  # the motor
    source: Source  # what drives the pins
    load: Load = FREE  # on the shaft
    law: Law | None = PAPER_LAW  # law of the contact; ``None`` for a free tip
    solver: Solver = DEFAULT  # how it is solved
    thermal: Thermal | None = None  # drift of the motor, which its own losses heat; ``None`` for a motor that does not

    def __post_init__(self) -> None:
        assert self.step > 0.0  # the rule has seen it
        self.load.check(self.motor)

    @classmethod
    def of(
        cls,
        motor: Motor,
        drive: Drive | Excitation,
        *,
        speed: float | None = None,
        load_torque: float = 0.0,
        contact: ContactLaw | None = PAPER_LAW,
        thermal: Thermal | None = None,
        **solver: Any,
    ) -> Point:
        """Return the operating point for the arguments of an analysis. Raise ParameterError for an invalid value.

        ``solver`` are settings of :class:`Solver`.
        """
        law = None if motor.is_transducer else law_of(contact, motor.law)
        return cls(
            motor, source_of(drive, motor, law), Load(speed, load_torque), law, replace(DEFAULT, **solver), thermal
        )

    def touching(self, reason: str) -> Law:
        """Return the law. Raise ParameterError with the reason for a free tip, and for a transducer."""
        _ = self.motor.rotor  # of a transducer an error
        return touching_law(self.law, reason)

    @property
    def drive(self) -> Any:
        """The drive or the driver. Raise ParameterError for another source, whose values cannot be changed here."""
        return self.source.given

    @property
    def settings(self) -> dict[str, Any]:
        """The settings that paths change: the load and those of the run."""
        of_run = {name: getattr(self.solver, name) for name in ("step", "accuracy", "timeout")}
        return {"speed": self.load.speed, "load_torque": self.load.torque, **of_run}

    def parameter(self, path: str) -> Parameter:
        """Return the parameter that a path names. Raise ParameterError for an unknown path, with the nearest one."""
        settings = self.settings
        section, _, name = canonical(path).partition(".")
        if section == "run" and name not in settings:
            raise unknown(path, [f"run.{name}" for name in settings])
        return parameter(path, self.motor, self.drive, settings | {"contact": self.law})

    def updated(self, changes: Mapping[str, Any]) -> Point:
        """Return the point with changed values: path → value, such as ``{"drive.voltage": 60.0, "load.speed": 2.0}``.

        Paths are those of :mod:`.paths`. Raise ParameterError for an unknown path, with the nearest one, or an invalid
        value.
        """
        if not changes:
            return self
        of_drive = any(path.startswith("drive.") for path in changes)
        for path in changes:
            if path.startswith("run."):
                self.parameter(path)
        drive: Any = self.drive if of_drive else None
        try:
            motor, drive, settings = changed(self.motor, drive, self.settings, changes)
        except ParameterError:
            for path in changes:
                self.parameter(path)  # has the nearest path
            raise
        return replace(
            self,
            motor=motor,
            law=law_of(self.law, motor.law),
            source=source_of(drive, motor, self.law) if of_drive else self.source,
            load=Load(settings.pop("speed"), settings.pop("load_torque")),
            solver=replace(self.solver, **settings),
        )

    @cached_property
    def shortest_period(self) -> float:
        """Period in s of the fastest motion: drive tones and modes, free and under preload."""
        return 1.0 / max(*self.source.frequencies, _fastest_hz(self.motor, pressed=self.law is not None))

    @cached_property
    def step(self) -> float:
        """Time step in s, the largest where steps are not uniform: the given one, or the default."""
        step, coarsest = self.solver.step, self.coarsest_step
        if step is None:
            of_motion = self.shortest_period / self.source.points_per_period
            return min(of_motion, self.source.ringing_step(self.motor))
        require(isfinite(step) and step > 0.0, "step", step, "a number > 0 s", unit="s")
        finest = self.shortest_period / MOST_STEPS
        if step < finest:
            raise ParameterError(
                f"step = {step:g} s is not valid for a motion of {1.0 / self.shortest_period:.4g} Hz: it must be "
                f">= {finest:.3g} s."
            )
        if step > coarsest:
            raise ParameterError(
                f"step = {step:g} s is too coarse for a motion of {1.0 / self.shortest_period:.4g} Hz; it must be <= "
                f"{_ROUNDED_DOWN * coarsest:.3g} s."
            )
        return step

    @property
    def coarsest_step(self) -> float:
        """Longest time step in s that the rule allows."""
        return self.shortest_period / self.source.fewest_points

    @property
    def discretisation(self) -> Discretisation:
        """How the motor is adapted to the step."""
        return Discretisation(self.step, self.solver.exact_resonance and self.source.uniform)

    def state_vectors(self) -> list[str]:
        """Return the vectors that hold the state of the motor."""
        return state_vectors(self.motor, self.law)

    def motion(self, values: Mapping[str, float]) -> Motion:
        """Return the motion that the values of :meth:`state_vectors` at one time stand for, to go on from."""
        return recorded_motion(values, self.motor, self.law, self.discretisation)

    def with_step(self, step: float) -> Point:
        """Return the same with a time step in s."""
        return replace(self, solver=replace(self.solver, step=step))

    def bench(self, start: Motion | None = None) -> Bench:
        """Return the bench, from a motion or from rest."""
        return motor_bench(
            self.motor, self.source, load=self.load, law=self.law, discretisation=self.discretisation,
            thermal=self.thermal, start=start,
        )  # fmt: skip

    def run(
        self,
        duration: float,
        vectors: Sequence[str],
        *,
        record_from: float = 0.0,
        progress: Callable[[float], object] | None = None,
        keep_partial: bool = False,
        start: Motion | None = None,
    ) -> Outcome:
        """Run it from rest or a motion; for the arguments see :func:`~pyspice_runner.run.kernel.transient`."""
        return transient(
            self.bench(start), vectors, step=self.step, duration=duration, record_from=record_from,
            timeout=self.solver.timeout, progress=progress, keep_partial=keep_partial, uniform=self.source.uniform,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as results state them, JSON-ready."""
        return {
            "contact": None,
            **law_settings(self.motor, self.law),
            "speed_rad_s": self.load.speed,
            "load_torque_n_m": self.load.torque,
            "step_s": self.step,
            "exact_resonance": self.discretisation.exact_resonance,
            "engine": "spice",
        }


@derived
def _fastest_hz(motor: Motor, *, pressed: bool) -> float:
    """Return the frequency in Hz of a motor's fastest motion, free or also under preload."""
    loaded = motor.pressed_stator.resonances().tolist() if pressed else []
    return float(max([*(mode.frequency_hz for mode in motor.modes), *loaded]))
