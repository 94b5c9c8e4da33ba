# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor track``: a motor with a resonance tracker, under a disturbance."""

from __future__ import annotations

from math import atan, cos, pi, radians
from typing import Any, Literal, get_args

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, DRIVER, DRIVERS, LOAD, PHASE, TARGETS, Call, command, option
from pyspice_runner.errors import require
from pyspice_runner.trackers.tracker import CHANGED, Disturbance, DisturbanceKind, TrackerKind, running_resonance

START_OFFSET = 0.03  # relative to the centre
FARTHEST_DEG = 60.0  # of a target


@command(
    "motor tracker mode disturb event voltage ratio_b phase frequency span offset target bandwidth period step_size",
    "reverse no_restart restart_after load_torque load_factor preload_change supply_change target_step drift",
    "drift_time all_drift compensate no_copies sense sense_ohm magnetizing", DRIVER,
    "contact begin duration averaged engine timeout audit", CHANGES, TARGETS,
    tracker=option("Tracker that sets the frequency.", TrackerKind, "pll"),
    mode=option("Name of the mode to track; default: the last.", str | None, metavar="NAME"),
    disturb=option("Disturbance of the motor.", DisturbanceKind, "start"),
    event=option(
        "In place of --disturb, one of several: load=50m@20m is 50 mN.m from 20 ms on. "
        f"Kinds: {', '.join(CHANGED)}. Repeatable.", list[str] | None, metavar="KIND=VALUE@BEGIN"
    ),
    voltage=option("Amplitude of group A, V; default: the mode has the amplitude of the recommended drive."),
    ratio_b=option("Amplitude of group B relative to group A.", float, 1.0),
    phase=PHASE,
    frequency=option("Centre of the oscillator's range, Hz; default: the resonance of the running motor."),
    span=option("Half the oscillator's range, relative.", float, 0.07),
    offset=option("Initial offset, relative to the centre; default: 0.03 for start, otherwise 0."),
    target=option("Target phase of the loop, degrees; 0 is resonance.", float, 0.0),
    bandwidth=option("Bandwidth of the phase-locked loop, Hz.", float, 500.0),
    period=option("Time between two steps of an observer, s.", float, 0.8e-3),
    step_size=option("Size of an observer's steps, Hz.", float, 80.0),
    reverse=option("Reverse the polarity of the tracker.", bool, False),
    no_restart=option("A loop that has lost lock does not return to its start.", bool, False),
    restart_after=option("Time without lock after which it returns, s; 0: by the loop.", float, 0.0),
    load_torque=option("Load, N.m (slider: N); default: half the stall torque.", float | None, None, *LOAD),
    load_factor=option("Transducer: damping of the mode after the step of its load over that before.", float, 2.0),
    preload_change=option("Relative change of the preload.", float, 0.3),
    supply_change=option("Relative change of the supply.", float, -0.3),
    target_step=option("Step of the target, degrees.", float, 10.0),
    drift=option("Relative drift of the frequencies.", float, -0.02),
    drift_time=option("Duration of the drift, s.", float, 50e-3),
    all_drift=option("Couplings and capacitances drift too, by their default coefficients.", bool, False),
    compensate=option("The copies of the clamped capacitances follow the stator's temperature.", bool, False),
    no_copies=option("The sensed current includes the current of the clamped capacitances.", bool, False),
    sense=option(
        "What is sensed: the currents of the groups, or the feedback electrode.", Literal["current", "feedback"],
        "current",
    ),
    sense_ohm=option("Sense resistor, or burden of a current transformer referred to the line, ohm.", float, 0.0),
    magnetizing=option("Magnetising inductance of this transformer, referred to the line, H.", float, 0.0),
    driver=option(f"Driver between tracker and motor: {DRIVERS}; default: none.", str | None),
    begin=option("Start of the disturbance, s."),
    averaged=option("Track the averaged motor: minutes of motor time in seconds.", bool, False),
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
    phases = call.phases(ratio_b=call.ratio_b)
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
    shown: Any = common.busy if call.averaged else common.run_progress
    hint = "" if call.tracker != "pll" or call.averaged or motor.is_transducer else " (--averaged takes seconds)"
    with shown(f"The motor runs with the tracker {call.tracker}{hint}") as progress:
        driver = None
        if call.driver:
            pins = phases.updated({"frequency": tracker.frequency, "voltage": tracker.voltage})
            driver = call.spec_of(call.driver, pins).built(motor, contact=call.law)
        result = pr.track(
            motor, tracker, driver=driver, contact=call.law, thermal=pr.Thermal.of(motor) if call.all_drift else None,
            **call.pick("disturb begin duration load_torque load_factor preload_change supply_change drift drift_time"),
            disturbances=[_event(text, call) for text in call.event or ()], mode=mode, progress=progress,
            **call.pick("target_step averaged engine timeout audit"),
        )  # fmt: skip
    call.deliver(result, motor.name)


def _event(text: str, call: Call) -> Disturbance:
    """Return the disturbance that KIND=VALUE@BEGIN names; a drift takes ``--drift-time``."""
    kind, _, rest = text.partition("=")
    value, _, begin = rest.partition("@")
    require(kind in CHANGED and begin, "--event", text, f"KIND=VALUE@BEGIN with one of {', '.join(CHANGED)}")
    units = {"load": "Load, N.m", "target": "Target, degrees"}.get(kind, "")
    name = "load_change_n_s_per_m" if kind == "load" and call.loaded.is_transducer else CHANGED[kind]
    values: dict[str, Any] = {name: common.number(value, units), "begin_s": common.number(begin, "Begin, s")}
    if kind == "temperature":
        values |= {"drift_time_s": call.drift_time, "thermal": pr.Thermal.of(call.loaded) if call.all_drift else None}
    return Disturbance(**{"kind": kind, **values})


def _usual_voltage(
    motor: pr.Motor, tracker: pr.Tracker, mode: int | None, frequency: float, *, contact: bool
) -> float:  # fmt: skip
    """Return the voltage at which a mode has at the target the amplitude of a recommended drive.

    That drive holds beside the resonance, where the same voltage gives less. Where a mode has a phase beyond all
    targets there, the drive is meant for another one, and its voltage is returned.
    """
    lag = running_resonance(motor, tracker, mode=mode, contact=contact)
    phase = atan(2.0 * pi * lag.time_constant_s * (frequency - lag.resonance_hz))
    factor = 1.0 if abs(phase) > radians(FARTHEST_DEG) else cos(phase) / cos(radians(tracker.wanted_deg))
    return round(factor * tracker.voltage, 1)


def centred(motor: pr.Motor, tracker: pr.Tracker, *, mode: int | None = None, contact: bool = True) -> pr.Tracker:
    """Return a tracker with the resonance of the running motor in the middle of its range."""
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
