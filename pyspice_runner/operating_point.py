# SPDX-License-Identifier: GPL-3.0-or-later
"""The operating point with the analyses of a motor as its verbs.

    point = pr.OperatingPoint(motor, drive, load=pr.Load(speed=20.0))
    print(point.steady().torque_n_m, point.updated({"drive.voltage": 90.0}).steady().torque_n_m)

The layers below hold the plain :class:`~pyspice_runner.run.point.Point`, and name none of the features.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from pyspice_runner.averaged.run import AveragedRun
from pyspice_runner.averaged.simulate import simulate_averaged
from pyspice_runner.circuit.bench import FREE
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw, law_of
from pyspice_runner.circuit.source import Excitation, source_of
from pyspice_runner.drivers.design import Design, DriverSpec, design_driver
from pyspice_runner.motor.drive import Drive, Load
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.motor.thermal import Thermal
from pyspice_runner.run.point import Point, Solver
from pyspice_runner.run.simulate import simulated
from pyspice_runner.run.waveforms import Array, Waveforms
from pyspice_runner.steady.branch import followed_branch
from pyspice_runner.steady.settling import Settling
from pyspice_runner.steady.small_signals import SmallSignals, linearised
from pyspice_runner.steady.speed_torque import Method, curve
from pyspice_runner.steady.steady import ACCURACY, SteadyState, settled
from pyspice_runner.steady.working_points import mapped

if TYPE_CHECKING:
    import xarray


class OperatingPoint(Point):
    """A motor, what drives it, its load, the law of its contact and how it is solved.

    Args:
        motor: the motor.
        drive: the voltages of both groups, a waveform, a driver circuit or a tracker.
        load: on the shaft: free, a torque, or a held speed.
        contact: law of the contact, as in :class:`~pyspice_runner.run.point.RunSettings`; ``None`` for a free tip.
        thermal: drift of a motor that its losses heat.
        step, accuracy, exact_resonance, timeout, audit: as in :class:`~pyspice_runner.run.point.Solver`.

    Raises:
        ParameterError: for an invalid value.
    """

    @checked
    def __init__(
        self,
        motor: Motor,
        drive: Drive | Excitation,
        *,
        load: Load = FREE,
        contact: ContactLaw | None = PAPER_LAW,
        thermal: Thermal | None = None,
        step: float | None = None,
        accuracy: float | None = None,
        exact_resonance: bool = True,
        timeout: float | None = None,
        audit: bool = True,
    ) -> None:
        law, solver = (
            None if motor.is_transducer else law_of(contact),
            Solver(step, accuracy, exact_resonance, timeout, audit),
        )
        super().__init__(motor, source_of(drive, motor, law), load, law, solver, thermal)

    @property
    def plain(self) -> Point:
        """The point without the verbs, as the layers below take it."""
        return Point(self.motor, self.source, self.load, self.law, self.solver, self.thermal)

    def updated(self, changes: Mapping[str, Any]) -> OperatingPoint:
        """Return the point with changed values: path → value, such as ``{"drive.voltage": 60.0, "load.speed": 2.0}``.

        Raises:
            ParameterError: for an unknown path, with the nearest one, or an invalid value.
        """
        new = self.plain.updated(changes)
        return OperatingPoint(
            new.motor, new.source, load=new.load, contact=new.law, thermal=new.thermal, **vars(new.solver)
        )

    def simulate(self, duration: float, **recording: Any) -> Waveforms:
        """Run the point from rest for a time in s; keywords and errors are those of :func:`.simulate`."""
        return simulated(self.plain, duration, **recording)

    def steady(self, accuracy: float = ACCURACY) -> SteadyState:
        """Return the periodic steady state; accuracy and errors are those of :func:`.steady_state`."""
        return settled(self.plain, accuracy)

    def curve(
        self, speeds: ArrayLike | None = None, *, mode: Method = "steady", settling: Settling | None = None, **axes: Any
    ) -> xarray.Dataset:
        """Return torque, power and losses over held speeds.

        ``over``, ``progress`` and errors are those of :func:`.speed_torque`.
        """
        return curve(self.plain, speeds=speeds, mode=mode, settling=settling or Settling(), **axes)

    def map(self, over: Mapping[str, Sequence[float] | Array], **choice: Any) -> xarray.Dataset:
        """Return steady states over parameters and the best one; keywords and errors as in :func:`.working_points`."""
        return mapped(self.plain, over, **choice)

    def branch(self, follow: str, start: float, stop: float) -> xarray.Dataset:
        """Follow a branch of steady states over a parameter, through its folds, as :func:`.steady_branch` does."""
        return followed_branch(self.plain, follow, start, stop)

    def small_signals(self, frequencies: Sequence[float] | Array) -> SmallSignals:
        """Return the transfer functions at frequencies of modulation in Hz; errors as in :func:`.small_signals`."""
        return linearised(self.plain, frequencies)

    def averaged(self, duration: float, **settings: Any) -> AveragedRun:
        """Run the averaged motor for a time in s; keywords and errors are those of :func:`.simulate_averaged`."""
        return simulate_averaged(
            self.motor, self.drive, duration, contact=self.law, speed=self.load.speed, load_torque=self.load.torque,
            thermal=self.thermal, timeout=self.solver.timeout, **settings,
        )  # fmt: skip

    def design(self, stage: str = "full-bridge", **spec: Any) -> Design:
        """Design a driver whose pins get the drive; ``network``, ``rail`` and ``parts`` as in :class:`.DriverSpec`.

        The speed or the torque of the load is the operating point of the design; errors as in :func:`.design_driver`.
        """
        return design_driver(
            self.motor, DriverSpec(self.drive, stage, **spec), speed=self.load.speed, load_torque=self.load.torque,
            contact=self.law, timeout=self.solver.timeout,
        )  # fmt: skip
