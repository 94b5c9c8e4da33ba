# SPDX-License-Identifier: GPL-3.0-or-later
"""What every analysis of a running motor works on: motor, source, load, contact and solver, ready to be run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from pyspice_runner.model.drive import Load
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.thermal import Thermal
from pyspice_runner.netlist.contact import PAPER_LAW, Law
from pyspice_runner.netlist.motor import Discretisation, Motion
from pyspice_runner.netlist.source import Source
from pyspice_runner.netlist.sources import FREE, Bench, motor_bench
from pyspice_runner.netlist.trackers import Disturbance
from pyspice_runner.run.kernel import Outcome, transient
from pyspice_runner.run.recording import Recording
from pyspice_runner.run.settings import DEFAULT, Solver
from pyspice_runner.run.state import motion, state_vectors
from pyspice_runner.run.steps import shortest_period, time_step


@dataclass(frozen=True)
class Setup:
    """A motor between what drives it and what it works against, and how that is solved.

    Attributes:
        motor: the motor.
        source: what drives the pins.
        load: on the shaft.
        law: law of the contact; ``None`` for a free tip.
        solver: how it is solved.
        thermal: drift of the motor, which its own losses heat; ``None`` for a motor that does not.
        disturbance: what happens to the motor during the run.

    Raises:
        ParameterError: by the constructor, for a load or a time step that is out of range.
    """

    motor: Motor
    source: Source
    load: Load = FREE
    law: Law | None = PAPER_LAW
    solver: Solver = DEFAULT
    thermal: Thermal | None = None
    disturbance: Disturbance | None = None

    def __post_init__(self) -> None:
        assert self.step > 0.0  # the rule has seen it
        self.load.check(self.motor)

    @cached_property
    def shortest_period(self) -> float:
        """Period in s of the fastest motion."""
        return shortest_period(self.motor, self.source, self.law)

    @cached_property
    def step(self) -> float:
        """Time step in s, the largest where steps are not uniform."""
        return time_step(self.motor, self.source, self.law, self.solver.step)

    @property
    def coarsest_step(self) -> float:
        """Greatest time step in s that the rule allows."""
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
        return motion(values, self.motor, self.law, self.discretisation)

    def with_step(self, step: float) -> Setup:
        """Return the same with a time step in s."""
        return replace(self, solver=replace(self.solver, step=step))

    def recording(self, *, started: bool = True) -> Recording:
        """Return what the vectors of a run mean, from its start on or from later on."""
        return Recording(
            self.motor, self.source, self.law, self.load, self.discretisation, started, self.thermal
        )  # fmt: skip

    def bench(self, *, start: Motion | None = None, begun: float = 0.0, title: str = "") -> Bench:
        """Return the bench, from rest or from a motion that the source has driven for ``begun`` seconds."""
        return motor_bench(
            self.motor, self.source, load=self.load, law=self.law, discretisation=self.discretisation,
            thermal=self.thermal, disturbance=self.disturbance, start=start, begun=begun, title=title,
            compiled=self.solver.compiled,
        )  # fmt: skip

    def run(
        self,
        duration: float,
        vectors: Sequence[str],
        *,
        record_from: float = 0.0,
        progress: Callable[[float], object] | None = None,
        keep_partial: bool = False,
    ) -> Outcome:
        """Run it from rest; the arguments are those of :func:`~pyspice_runner.run.kernel.transient`."""
        return transient(
            self.bench(), vectors, step=self.step, duration=duration, record_from=record_from,
            timeout=self.solver.timeout, progress=progress, keep_partial=keep_partial,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as results state them, JSON-ready."""
        return {
            "contact": None,
            **(self.law.to_dict() if self.law else {}),
            "speed_rad_s": self.load.speed,
            "load_torque_n_m": self.load.torque,
            "step_s": self.step,
            "exact_resonance": self.discretisation.exact_resonance,
            "engine": "compiled" if self.solver.compiled else "spice",
        }
