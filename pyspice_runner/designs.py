# SPDX-License-Identifier: GPL-3.0-or-later
"""The verbs ``design`` (parts of a driver, filter of a phase-locked loop) and ``control_loop`` of a motor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Unpack, overload

from pyspice_runner.control.loop import SAMPLE_TIME, ControlLoop, Quantity, sampled_loop
from pyspice_runner.drivers.design import Design, DriverSpec, Settings, design_driver
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.trackers.loop import LoopDesign, loop_design
from pyspice_runner.trackers.tracker import LoopFilter, Tracker, propose_filter, running_resonance


@overload
def design(motor: Motor, what: DriverSpec, **settings: Unpack[Settings]) -> Design: ...
@overload
def design(motor: Motor, what: Tracker, *, mode: int | None = None, contact: bool = True) -> LoopFilter: ...
def design(motor: Motor, what: DriverSpec | Tracker, **settings: Any) -> Design | LoopFilter:
    """Design a driver from its specification, or the loop filter of a tracker for its bandwidth.

    Args:
        motor: the motor.
        what: the specification of a driver, or the tracker.
        **settings: of a driver ``speed`` (rad/s), ``load_torque`` (N·m), ``contact``, ``step`` (s) and ``timeout`` (s),
            as of :func:`.design_driver`; of a tracker the index ``mode`` of the mode to track, by default the last one,
            and whether it is in ``contact``.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    if isinstance(what, DriverSpec):
        return design_driver(motor, what, **settings)
    return propose_filter(what, running_resonance(motor, what, **settings))


@overload
def control_loop(
    motor: Motor, drive: TwoPhaseDrive, *, quantity: Quantity | None = None, crossover: float | None = None,
    margin: float | None = None, sample_time: float = SAMPLE_TIME, load_torque: float = 0.0,
    over: Mapping[str, Sequence[float]] | None = None,
) -> ControlLoop: ...  # fmt: skip
@overload
def control_loop(
    motor: Motor, drive: Tracker, *, quantity: Quantity | None = None, mode: int | None = None, contact: bool = True
) -> LoopDesign: ...
@checked
def control_loop(
    motor: Motor, drive: TwoPhaseDrive | Tracker, *, quantity: Quantity | None = None, crossover: float | None = None,
    margin: float | None = None, sample_time: float = SAMPLE_TIME, load_torque: float = 0.0,
    over: Mapping[str, Sequence[float]] | None = None, mode: int | None = None, contact: bool = True,
) -> ControlLoop | LoopDesign:  # fmt: skip
    """Design a control loop of a motor: sampled, of speed, position or phase, or the phase-locked loop of a tracker.

    Args:
        motor: the motor.
        drive: the drive of the steady state about which a sampled controller is designed; or a tracker, whose loop of
            the phase has the filter of :func:`design` in front of a resonator alone.
        quantity: the controlled quantity, by default the ``speed``, of a tracker the ``phase``.
        crossover: wanted frequency at which the loop gain is 1, Hz; by default the highest with this margin, 6 dB of
            gain margin, and at the crossover a lag of the PI controller of 30° or more, or a lead of the PD up to 60°.
        margin: wanted phase margin, degrees; by default 60°, or the next that the motor allows.
        sample_time: time in s between two samples; at least one period of the drive.
        load_torque: torque in N·m that a load draws from the shaft.
        over: axes of a grid of other operating points: ``drive.voltage``, ``speed`` (rad/s, to which the amplitude of
            both groups brings the motor under its load), ``load.torque``, ``temperature`` (K, of the stator above that
            at which its parameters hold) or the path of a parameter of the motor → values.
        mode: of a tracker, the index of the tracked mode; by default the last one.
        contact: of a tracker, whether the tip is on the rotor.

    Raises:
        ParameterError: for a value out of range, or a crossover and margin that no controller of this kind gives.
        SimulationError: if there is no C compiler, no steady state, a motor that stands still, or no stable loop.
    """
    if isinstance(drive, TwoPhaseDrive):
        if mode is not None or not contact:
            raise ParameterError("control_loop: mode and contact are those of a tracker. Leave them out.")
        return sampled_loop(motor, drive, quantity or "speed", crossover, margin, sample_time, load_torque, over)
    given = quantity or "phase", crossover, margin, sample_time, load_torque, over
    if given != ("phase", None, None, SAMPLE_TIME, 0.0, None):
        words = "A tracker controls the phase: another quantity, crossover, margin, sample_time, load_torque and over"
        raise ParameterError(f"control_loop: {words} are those of a sampled loop. Leave them out.")
    return loop_design(motor, drive, mode=mode, contact=contact)
