# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor track``: a motor with a resonance tracker, under a disturbance."""

from __future__ import annotations

from typing import Annotated, get_args

import typer

import pyspice_runner as pr
from pyspice_runner.circuit.law import PAPER_LAW
from pyspice_runner.commands import common, drive, options
from pyspice_runner.commands.driving import recommended_phases
from pyspice_runner.trackers.tracker import DisturbanceKind, TrackerKind

START_OFFSET = 0.03  # relative to the centre


@options.with_options
def track(
    context: typer.Context,
    motor: common.MotorArgument,
    *,
    tracker: Annotated[TrackerKind, typer.Option(help="Tracker that sets the frequency.")] = "pll",
    disturb: Annotated[DisturbanceKind, typer.Option(help="Disturbance of the motor.")] = "start",
    voltage: drive.VoltageOption = None,
    ratio_b: Annotated[float, typer.Option(help="Amplitude of group B over that of group A.")] = 1.0,
    phase: drive.PhaseOption = None,
    frequency: Annotated[
        float | None,
        typer.Option(help="Centre of the oscillator's range, Hz; default: the resonance of the running motor."),
    ] = None,
    span: Annotated[float, typer.Option(help="Half the oscillator's range, relative.")] = 0.07,
    offset: Annotated[
        float | None, typer.Option(help="Initial offset, relative to the centre; default: 0.03 for start, otherwise 0.")
    ] = None,
    target: Annotated[float, typer.Option(help="Target phase of the loop, degrees; 0 is resonance.")] = 0.0,
    bandwidth: Annotated[float, typer.Option(help="Bandwidth of the phase-locked loop, Hz.")] = 500.0,
    period: Annotated[float, typer.Option(help="Time between two steps of an observer, s.")] = 0.8e-3,
    step_size: Annotated[float, typer.Option(help="Size of an observer's steps, Hz.")] = 80.0,
    reverse: Annotated[bool, typer.Option("--reverse", help="Reverse the polarity of the tracker.")] = False,
    load_torque: Annotated[
        float | None, typer.Option(help="Load, N.m (slider: N); default: half the stall torque.")
    ] = None,
    preload_change: Annotated[float, typer.Option(help="Relative change of the preload.")] = 0.3,
    target_step: Annotated[float, typer.Option(help="Step of the target, degrees.")] = 10.0,
    drift: Annotated[float, typer.Option(help="Relative drift of the frequencies.")] = -0.02,
    drift_time: Annotated[float, typer.Option(help="Duration of the drift, s.")] = 50e-3,
    all_drift: Annotated[
        bool, typer.Option("--all-drift", help="Couplings and capacitances drift too, by their default coefficients.")
    ] = False,
    compensate: Annotated[
        bool,
        typer.Option("--compensate", help="The copies of the clamped capacitances follow the stator's temperature."),
    ] = False,
    driver: Annotated[
        str | None, typer.Option(help=f"Driver between tracker and motor: {drive.DRIVERS}; default: none.")
    ] = None,
    match: drive.MatchOption = True,
    part: drive.PartOption = None,
    mosfet: drive.MosfetOption = None,
    contact: options.ContactOption = PAPER_LAW.name,
    begin: Annotated[float | None, typer.Option(help="Start of the disturbance, s.")] = None,
    duration: Annotated[float | None, typer.Option(help="Simulated time, s.")] = None,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="Track the averaged motor: minutes of motor time in seconds.")
    ] = False,
    engine: common.EngineOption = "auto",
    timeout: common.TimeoutOption = None,
    audit: common.AuditOption = True,
    changes: common.SetOption = None,
    targets: options.Targets,
) -> None:
    """Track the last mode of a motor under a disturbance. The exit status is 0 whether or not the tracker locked.

    Writes .json (result), .csv (frequency, phase and speed of each period) or .cir (the deck).

    Example: piezomotor track bimodal40 --tracker pll --disturb load --plot track.png
    """
    _refuse_idle(context, tracker, disturb, driver)
    targets.check(".json", ".csv", ".cir")
    of_motor, of_parts = drive.changes_of(changes, part) if driver else (changes, part)
    loaded = common.load_changed(motor, of_motor)
    tone = recommended_phases(loaded, voltage, frequency, phase) | {"ratio_b": ratio_b}
    values = {
        "kind": tracker, **tone, "span": span,
        "offset": (START_OFFSET if disturb == "start" else 0.0) if offset is None else offset, "target_deg": target,
        "bandwidth_hz": bandwidth, "period_s": period, "step_hz": step_size, "polarity": -1 if reverse else 1,
        "copies_drift_per_k": pr.Thermal.of(loaded).capacitance_drift_per_k if compensate else 0.0,
    }  # fmt: skip
    chosen = pr.Tracker(**values)
    if frequency is None:
        chosen = centred(loaded, chosen, contact=contact != options.NONE)
    law = options.law_named(contact)
    with common.busy(f"The motor runs with the tracker {tracker}"):
        through = None
        if driver:
            pins = pr.TwoPhaseDrive(**tone | {"frequency": chosen.frequency})
            through = drive.spec_of(driver, pins, of_parts, mosfet, match=match).built(loaded, contact=law)
        found = pr.track(
            loaded, chosen, driver=through, disturb=disturb, contact=law, begin=begin,
            duration=duration, load_torque=load_torque, preload_change=preload_change, drift=drift,
            drift_time=drift_time, target_step=target_step, thermal=pr.Thermal.of(loaded) if all_drift else None,
            averaged=averaged, engine=engine, timeout=timeout, audit=audit,
        )  # fmt: skip
    common.caution(found)
    targets.deliver(found, loaded.name)


def centred(motor: pr.Motor, tracker: pr.Tracker, *, contact: bool = True) -> pr.Tracker:
    """Return a tracker with the resonance of the running motor in the middle of its range."""
    from pyspice_runner.trackers.track import running_resonance

    return tracker.updated({"frequency": running_resonance(motor, tracker, contact=contact).resonance_hz})


_OF_TRACKERS: dict[tuple[str, ...], set[str]] = {
    ("bandwidth", "target"): {"pll"},
    ("period", "step_size"): {"observe-current", "observe-power"},
    ("reverse",): {*get_args(TrackerKind)} - {"none"},
    ("compensate",): {"pll", "observe-current"},
}
_OF_DISTURBANCES: dict[tuple[str, ...], set[str]] = {
    ("load_torque",): {"load"},
    ("preload_change",): {"preload"},
    ("target_step",): {"target"},
    ("drift", "drift_time", "all_drift"): {"temperature"},
    ("compensate",): {"temperature", "warm-up"},
    ("begin",): {*get_args(DisturbanceKind)} - {"start", "warm-up"},
}


def _refuse_idle(context: typer.Context, tracker: TrackerKind, disturb: DisturbanceKind, driver: str | None) -> None:
    """Refuse options of another tracker, of another disturbance, or of a driver without ``--driver``."""
    if driver is None:
        common.refuse_idle(context, "without --driver", "match", "part", "mosfet")
    else:
        drive.refuse_idle_match(context, driver)
    for option, kind, table in (("tracker", tracker, _OF_TRACKERS), ("disturb", disturb, _OF_DISTURBANCES)):
        for names, kinds in table.items():
            if kind not in kinds:
                common.refuse_idle(context, f"on --{option} {kind}", *names)
