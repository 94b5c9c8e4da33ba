# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor track``: a motor with a resonance tracker, under a disturbance."""

from __future__ import annotations

from math import atan, cos, pi, radians
from typing import Any, Literal, get_args

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import (
    CHANGES,
    DRIVER,
    DRIVERS,
    LOAD,
    PHASE,
    TARGETS,
    Call,
    command,
    option,
)
from pyspice_runner.errors import require
from pyspice_runner.trackers.tracker import CHANGED, DisturbanceKind, TrackerKind

START_OFFSET = 0.03  # relative to the centre
FARTHEST_DEG = 60.0  # of a target


@command(
    "motor tracker mode disturb event voltage ratio_b phase frequency span offset target bandwidth period step_size",
    "reverse no_restart restart_after load_torque load_factor preload_change supply_change target_step drift",
    "drift_time all_drift compensate no_copies sense sense_ohm magnetizing", DRIVER,
    "contact begin duration averaged engine timeout audit", CHANGES, TARGETS,
    tracker=option(TrackerKind, "pll", "Tracker that sets the frequency."),
    mode=option(str | None, None, "Name of the mode to track; default: the last.", "--mode", metavar="NAME"),
    disturb=option(DisturbanceKind, "start", "Disturbance of the motor."),
    event=option(
        list[str] | None, None, "In place of --disturb, one of several: load=50m@20m is 50 mN.m from 20 ms on. "
        f"Kinds: {', '.join(CHANGED)}. Repeatable.", "--event", metavar="KIND=VALUE@BEGIN",
    ),
    voltage=option(
        float | None, None, "Amplitude of group A, V; default: the mode has the amplitude of the recommended drive."
    ),
    ratio_b=option(float, 1.0, "Amplitude of group B relative to group A."),
    phase=PHASE,
    frequency=option(
        float | None, None, "Centre of the oscillator's range, Hz; default: the resonance of the running motor."
    ),
    span=option(float, 0.07, "Half the oscillator's range, relative."),
    offset=option(
        float | None, None, "Initial offset, relative to the centre; default: 0.03 for start, otherwise 0."
    ),
    target=option(float, 0.0, "Target phase of the loop, degrees; 0 is resonance."),
    bandwidth=option(float, 500.0, "Bandwidth of the phase-locked loop, Hz."),
    period=option(float, 0.8e-3, "Time between two steps of an observer, s."),
    step_size=option(float, 80.0, "Size of an observer's steps, Hz."),
    reverse=option(bool, False, "Reverse the polarity of the tracker.", "--reverse"),
    no_restart=option(bool, False, "A loop that has lost lock does not return to its start.", "--no-restart"),
    restart_after=option(float, 0.0, "Time without lock after which it returns, s; 0: by the loop."),
    load_torque=option(float | None, None, "Load, N.m (slider: N); default: half the stall torque.", *LOAD),
    load_factor=option(float, 2.0, "Transducer: damping of the mode after the step of its load over that before."),
    preload_change=option(float, 0.3, "Relative change of the preload."),
    supply_change=option(float, -0.3, "Relative change of the supply."),
    target_step=option(float, 10.0, "Step of the target, degrees."),
    drift=option(float, -0.02, "Relative drift of the frequencies."),
    drift_time=option(float, 50e-3, "Duration of the drift, s."),
    all_drift=option(
        bool, False, "Couplings and capacitances drift too, by their default coefficients.", "--all-drift"
    ),
    compensate=option(
        bool, False, "The copies of the clamped capacitances follow the stator's temperature.", "--compensate"
    ),
    no_copies=option(
        bool, False, "The sensed current includes the current of the clamped capacitances.", "--no-copies"
    ),
    sense=option(
        Literal["current", "feedback"], "current", "Senses the currents of the groups, or the feedback electrode."
    ),
    sense_ohm=option(float, 0.0, "Sense resistor, or burden of a current transformer referred to the line, ohm."),
    magnetizing=option(float, 0.0, "Magnetising inductance of this transformer, referred to the line, H."),
    driver=option(str | None, None, f"Driver between tracker and motor: {DRIVERS}; default: none."),
    begin=option(float | None, None, "Start of the disturbance, s."),
    averaged=option(bool, False, "Track the averaged motor: minutes of motor time in seconds.", "--averaged"),
)  # fmt: skip
def track(call: Call) -> None:
    """Track a mode of a motor under a disturbance. The exit status is 0 whether or not the tracker locked.

    Writes .json (result), .csv (frequency, phase and speed of each period) or .cir (the deck).

    Example: piezomotor track bimodal40 --tracker pll --disturb load --plot track.png
    """
    _refuse_idle(call)
    call.check(".json", ".csv", ".cir")
    motor = call.loaded
    names = [mode.name for mode in motor.modes]
    require(call.mode is None or call.mode in names, "--mode", call.mode, f"one of {', '.join(names)}")
    mode = None if call.mode is None else names.index(call.mode)
    phases = call.phases(motor, ratio_b=call.ratio_b)
    tone = {name: getattr(phases, name) for name in ("voltage", "frequency", "phase_deg", "ratio_b")}
    call.refuse_idle(f"on {motor.name}", "load_torque" if motor.is_transducer else "load_factor")
    offset = START_OFFSET if call.disturb == "start" and not call.event else 0.0
    tracker = pr.Tracker(
        **tone, offset=offset if call.offset is None else call.offset, polarity=-1 if call.reverse else 1,
        restart=not call.no_restart, copies=not call.no_copies,
        copies_drift_per_k=pr.Thermal.of(motor).capacitance_drift_per_k if call.compensate else 0.0,
        **call.pick("span", kind="tracker", target_deg="target", bandwidth_hz="bandwidth", period_s="period",
                    step_hz="step_size", restart_after_s="restart_after", sense_ohm="sense_ohm", sense="sense",
                    magnetizing_h="magnetizing"),
    )  # fmt: skip
    if call.voltage is None and motor.drive is not None:
        usual = _usual_voltage(motor, tracker, mode, motor.drive["frequency"], contact=call.law is not None)
        tracker = tracker.updated({"voltage": usual})
    if call.frequency is None:
        tracker = centred(motor, tracker, mode=mode, contact=call.law is not None)
    with common.busy(f"The motor runs with the tracker {call.tracker}"):
        driver = None
        if call.driver:
            pins = phases.updated({"frequency": tracker.frequency, "voltage": tracker.voltage})
            driver = call.spec_of(call.driver, pins).built(motor, contact=call.law)
        result = pr.track(
            motor, tracker, driver=driver, contact=call.law, thermal=pr.Thermal.of(motor) if call.all_drift else None,
            **call.pick("disturb begin duration load_torque load_factor preload_change supply_change drift drift_time"),
            disturbances=[_event(text, call) for text in call.event or ()], mode=mode,
            **call.pick("target_step averaged engine timeout audit"),
        )  # fmt: skip
    call.deliver(result, motor.name)


def _event(text: str, call: Call) -> pr.Disturbance:
    """Return the disturbance that KIND=VALUE@BEGIN names; a drift takes ``--drift-time``."""
    kind, _, rest = text.partition("=")
    value, _, begin = rest.partition("@")
    require(kind in CHANGED and begin, "--event", text, f"KIND=VALUE@BEGIN with one of {', '.join(CHANGED)}")
    units = {"load": "Load, N.m", "target": "Target, degrees"}.get(kind, "")
    name = "load_change_n_s_per_m" if kind == "load" and call.loaded.is_transducer else CHANGED[kind]
    values: dict[str, Any] = {name: common.number(value, units), "begin_s": common.number(begin, "Begin, s")}
    if kind == "temperature":
        values |= {"drift_time_s": call.drift_time, "thermal": pr.Thermal.of(call.loaded) if call.all_drift else None}
    return pr.Disturbance(**{"kind": kind, **values})


def _usual_voltage(
    motor: pr.Motor, tracker: pr.Tracker, mode: int | None, frequency: float, *, contact: bool
) -> float:  # fmt: skip
    """Return the voltage at which a mode has at the target the amplitude of a recommended drive.

    That drive holds beside the resonance, where the same voltage gives less. Where a mode has a phase beyond all
    targets there, the drive is meant for another one, and its voltage is returned.
    """
    from pyspice_runner.trackers.tracker import running_resonance

    lag = running_resonance(motor, tracker, mode=mode, contact=contact)
    phase = atan(2.0 * pi * lag.time_constant_s * (frequency - lag.resonance_hz))
    factor = 1.0 if abs(phase) > radians(FARTHEST_DEG) else cos(phase) / cos(radians(tracker.wanted_deg))
    return round(factor * tracker.voltage, 1)


def centred(motor: pr.Motor, tracker: pr.Tracker, *, mode: int | None = None, contact: bool = True) -> pr.Tracker:
    """Return a tracker with the resonance of the running motor in the middle of its range."""
    from pyspice_runner.trackers.tracker import running_resonance

    return tracker.updated({"frequency": running_resonance(motor, tracker, mode=mode, contact=contact).resonance_hz})


_NEEDS: tuple[tuple[str, str, set[str]], ...] = (
    ("tracker", "bandwidth target", {"pll"}),
    ("tracker", "period step_size", {*get_args(TrackerKind)} - {"none", "pll"}),
    ("tracker", "reverse", {*get_args(TrackerKind)} - {"none"}),
    ("tracker", "no_restart restart_after", {"pll"}),
    ("tracker", "compensate", {"pll", "observe-current"}),
    ("disturb", "load_torque load_factor", {"load"}),
    ("disturb", "preload_change", {"preload"}),
    ("disturb", "supply_change", {"supply"}),
    ("disturb", "target_step", {"target"}),
    ("disturb", "drift", {"temperature"}),
    ("event", "drift_time all_drift", {"temperature"}),
    ("event", "compensate", {"temperature", "warm-up"}),
    ("disturb", "begin", {*get_args(DisturbanceKind)} - {"start", "warm-up"}),
)


def _refuse_idle(call: Call) -> None:
    """Refuse options of another tracker, of another disturbance, or of a driver without ``--driver``."""
    call.check_driver()
    events = {text.partition("=")[0] for text in call.event or ()}
    if events:
        call.refuse_idle("beside --event", "disturb")
    for name, options, kinds in _NEEDS:
        needed = "disturb" if name == "event" else name
        if not kinds & {call.values[needed], *(events if name == "event" else ())}:
            call.refuse_idle(f"on --{needed} {call.values[needed]}", options)
