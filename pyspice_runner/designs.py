# SPDX-License-Identifier: GPL-3.0-or-later
"""The verbs ``design`` (parts of a driver, filter of a phase-locked loop) and ``control_loop`` of a motor."""

from __future__ import annotations

import re
from typing import Any, overload

from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw
from pyspice_runner.control.loop import ControlLoop, sampled_loop
from pyspice_runner.drivers.design import Design, DriverSpec, design_driver
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.trackers.loop import LoopDesign, loop_design
from pyspice_runner.trackers.tracker import LoopFilter, Tracker, propose_filter, running_resonance


@overload
def design(
    motor: Motor,
    what: DriverSpec,
    *,
    speed: float | None = None,
    load_torque: float = 0.0,
    contact: ContactLaw = PAPER_LAW,
    timeout: float | None = None,
) -> Design: ...
@overload
def design(motor: Motor, what: Tracker, *, mode: int | None = None, contact: bool = True) -> LoopFilter: ...
def design(motor: Motor, what: DriverSpec | Tracker, **settings: Any) -> Design | LoopFilter:
    """Design a driver from its specification, or the loop filter of a tracker for its bandwidth.

    Args:
        motor: the motor.
        what: the specification of a driver, or the tracker.
        **settings: of a driver ``speed`` (rad/s), ``load_torque`` (N·m), ``contact`` and ``timeout`` (s), as of
            :func:`.design_driver`; of a tracker the index ``mode`` of the mode to track, by default the last one, and
            whether it is in ``contact``.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    if isinstance(what, DriverSpec):
        return design_driver(motor, what, **settings)
    return propose_filter(what, running_resonance(motor, what, **settings))


@overload
def control_loop(motor: Motor, drive: TwoPhaseDrive, **settings: Any) -> ControlLoop: ...
@overload
def control_loop(motor: Motor, drive: Tracker, **settings: Any) -> LoopDesign: ...
def control_loop(motor: Motor, drive: TwoPhaseDrive | Tracker, **settings: Any) -> ControlLoop | LoopDesign:
    """Design a control loop of a motor: sampled, of speed, position or phase, or the phase-locked loop of a tracker.

    Args:
        motor: the motor.
        drive: the drive of the steady state about which a sampled controller is designed; or a tracker, whose loop of
            the phase has the filter of :func:`design` in front of a resonator alone.
        **settings: of a sampled controller ``quantity``, ``crossover``, ``margin``, ``sample_time``, ``load_torque``
            and ``over``, as of :func:`.sampled_loop`, each with a default; of a tracker the index ``mode`` of the
            tracked mode, by default the last one, and whether it is in ``contact``.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if there is no such loop.
    """
    try:
        if isinstance(drive, TwoPhaseDrive):
            return sampled_loop(motor, drive, **settings)
        if settings.pop("quantity", "phase") != "phase":
            raise ParameterError("A tracker controls the phase. Leave quantity out, or give a TwoPhaseDrive.")
        return loop_design(motor, drive, **settings)
    except ParameterError as error:
        raise ParameterError(re.sub("^(sampled_loop|loop_design):", "control_loop:", str(error))) from None
