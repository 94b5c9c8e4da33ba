# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor track``: a motor with a resonance tracker, under a disturbance."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    AuditOption,
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    TimeoutOption,
    busy,
    caution,
    check_targets,
    deliver,
    engineering,
    load_changed,
    refuse_idle,
)
from pyspice_runner.commands.contacting import DEFAULT_LAW, NONE, ContactOption, law_named
from pyspice_runner.commands.drive import (
    DRIVERS,
    MATCH_STATES,
    MatchKind,
    MatchOption,
    MosfetOption,
    PartOption,
    changes_of,
    driver_of,
)
from pyspice_runner.commands.driving import recommended_phases

if TYPE_CHECKING:
    from pyspice_runner.analysis.matching import State
    from pyspice_runner.analysis.tracking import Tracking


class TrackerName(StrEnum):
    """Kind of tracker."""

    none = "none"
    pll = "pll"
    observe_current = "observe-current"
    observe_power = "observe-power"


class DisturbName(StrEnum):
    """Kind of disturbance."""

    start = "start"
    target = "target"
    load = "load"
    preload = "preload"
    temperature = "temperature"
    warm_up = "warm-up"


def track(
    context: typer.Context,
    motor: MotorArgument,
    tracker: Annotated[TrackerName, typer.Option(help="Tracker that sets the frequency.")] = TrackerName.pll,
    disturb: Annotated[DisturbName, typer.Option(help="Disturbance of the motor.")] = DisturbName.start,
    voltage: Annotated[
        float | None, typer.Option(help="Amplitude of group A, V; default: the motor's recommended drive.")
    ] = None,
    ratio_b: Annotated[float, typer.Option(help="Amplitude of group B over that of group A.")] = 1.0,
    phase: Annotated[
        float | None, typer.Option(help="Phase of group B ahead of group A, degrees; default: the recommended drive.")
    ] = None,
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
    load_torque: Annotated[float | None, typer.Option(help="Load, N.m; default: half the stall torque.")] = None,
    preload_change: Annotated[float, typer.Option(help="Relative change of the preload.")] = 0.3,
    target_step: Annotated[float, typer.Option(help="Step of the target, degrees.")] = 10.0,
    drift: Annotated[float, typer.Option(help="Relative drift of the frequencies.")] = -0.02,
    drift_time: Annotated[float, typer.Option(help="Duration of the drift, s.")] = 50e-3,
    all_drift: Annotated[
        bool, typer.Option("--all-drift", help="Couplings and capacitances drift too, by their default coefficients.")
    ] = False,
    driver: Annotated[
        str | None, typer.Option(help=f"Driver between tracker and motor: {DRIVERS}; default: none.")
    ] = None,
    match: MatchOption = MatchKind.running,
    part: PartOption = None,
    mosfet: MosfetOption = None,
    contact: ContactOption = DEFAULT_LAW,
    begin: Annotated[float | None, typer.Option(help="Start of the disturbance, s.")] = None,
    duration: Annotated[float | None, typer.Option(help="Simulated time, s.")] = None,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="Track the averaged motor: minutes of motor time in seconds.")
    ] = False,
    timeout: TimeoutOption = None,
    audit: AuditOption = True,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Track the last mode of a motor under a disturbance. The exit status is 0 whether or not the tracker locked.

    Writes .json (result), .csv (frequency, phase and speed of each period) or .cir (the deck).

    Example: piezomotor track bimodal40 --tracker pll --disturb load --plot track.png
    """
    _refuse_idle(context, tracker, disturb, driver)
    check_targets(output, (".json", ".csv", ".cir"), plot)
    of_motor, of_parts = changes_of(changes, part) if driver else (changes, part)
    loaded = load_changed(motor, of_motor)
    tone = recommended_phases(loaded, voltage, frequency, phase) | {"ratio_b": ratio_b}
    values = {
        "kind": tracker.value, **tone, "span": span,
        "offset": (0.03 if disturb is DisturbName.start else 0.0) if offset is None else offset, "target_deg": target,
        "bandwidth_hz": bandwidth, "period_s": period, "step_hz": step_size, "polarity": -1 if reverse else 1,
    }  # fmt: skip
    chosen = pr.Tracker(**values)
    if frequency is None:
        from pyspice_runner.analysis.track import running_resonance

        resonance = running_resonance(loaded, chosen, contact=contact != NONE)
        chosen = pr.Tracker(**(values | {"frequency": resonance.resonance_hz}))
    through = driver and driver_of(driver, tone | {"frequency": chosen.frequency}, of_parts, mosfet)
    with busy(f"ngspice runs the tracker {tracker.value}"):
        if through and through.network != "none" and (state := MATCH_STATES[match]):
            through = _matched(loaded, through, state, contact, timeout)
        found = pr.track(
            loaded,
            chosen,
            driver=through or None,
            disturb=disturb.value,
            contact=law_named(contact),
            begin=begin,
            duration=duration,
            load_torque=load_torque,
            preload_change=preload_change,
            drift=drift,
            drift_time=drift_time,
            target_step=target_step,
            thermal=pr.Thermal.of(loaded) if all_drift else None,
            averaged=averaged,
            timeout=timeout,
            audit=audit,
        )
    caution(found)
    deliver(found.to_dict(), _table(loaded, found), as_json, (output, found.save), (plot, found.plot))


_OF_TRACKERS = {
    ("bandwidth", "target"): {TrackerName.pll},
    ("period", "step_size"): {TrackerName.observe_current, TrackerName.observe_power},
    ("reverse",): set(TrackerName) - {TrackerName.none},
}
_OF_DISTURBANCES = {
    ("load_torque",): {DisturbName.load},
    ("preload_change",): {DisturbName.preload},
    ("target_step",): {DisturbName.target},
    ("drift", "drift_time", "all_drift"): {DisturbName.temperature},
    ("begin",): set(DisturbName) - {DisturbName.start, DisturbName.warm_up},
}


def _refuse_idle(context: typer.Context, tracker: TrackerName, disturb: DisturbName, driver: str | None) -> None:
    """Refuse options of another tracker, of another disturbance and of a driver that is not there."""
    if driver is None:
        refuse_idle(context, "without --driver", "match", "part", "mosfet")
    elif "+" not in driver:
        refuse_idle(context, "without a matching network, such as --driver half-bridge+llcc", "match")
    for names, trackers in _OF_TRACKERS.items():
        if tracker not in trackers:
            refuse_idle(context, f"on --tracker {tracker.value}", *names)
    for names, disturbances in _OF_DISTURBANCES.items():
        if disturb not in disturbances:
            refuse_idle(context, f"on --disturb {disturb.value}", *names)


def _matched(
    motor: pr.Motor,
    driver: pr.Driver,
    state: State,
    contact: str,
    timeout: float | None,
) -> pr.Driver:
    """Return a driver whose network is matched to the motor at its frequency."""
    from pyspice_runner.analysis.matching import propose_matching

    matching = propose_matching(motor, driver, state=state, contact=law_named(contact), timeout=timeout)
    return matching.applied(driver)


def _table(motor: pr.Motor, found: Tracking) -> Table:
    remark = ", not settled" if found.settled is False else ""
    table = Table("quantity", "value", title=f"{motor.name}: {found.settings['tracker']['kind']}")
    tracker = found.settings["tracker"]
    volts = f"A {tracker['voltage']:g} V, B {tracker['voltage'] * tracker['ratio_b']:g} V at {tracker['phase_deg']:g}°"
    table.add_row("drive", f"{volts}, about {engineering(tracker['frequency'], 'Hz')}")
    if found.settings["driver"]:
        table.add_row("driver", found.settings["driver"]["label"])
    table.add_row("locked", "yes" if found.locked else "no")
    table.add_row("lock time", "–" if found.lock_time_s is None else engineering(found.lock_time_s, "s"))
    table.add_row("phase error, RMS", f"{found.rms_phase_error_deg:.3g}°")
    table.add_row("phase error, worst", f"{found.worst_phase_error_deg:.3g}°")
    table.add_row("residual detuning", engineering(found.residual_detuning_hz, "Hz"))
    table.add_row("frequency at the end", f"{found.end_frequency_hz / 1e3:.6g} kHz")
    table.add_row("speed before, after", f"{found.speed_before_rad_s:.3g}, {found.speed_after_rad_s:.3g} rad/s{remark}")
    if found.temperature_k is not None:
        table.add_row("temperature rise at the end", f"{found.temperature_k[-1]:.3g} K")
    table.add_row("speed lost", f"{found.speed_lost_rad_s:.3g} rad/s")
    if found.stall_torque_n_m is not None:
        table.add_row("stall torque", engineering(found.stall_torque_n_m, "N·m"))
    table.add_row(
        "running resonance, by design", f"{found.lag.resonance_hz / 1e3:.6g} kHz, Q = {found.lag.quality:.3g}"
    )
    if found.loop is not None:
        values = found.loop.loop_filter
        table.add_row(
            "loop filter",
            f"{engineering(values.resistance_ohm, 'Ω')}, {engineering(values.capacitance_f, 'F')}, "
            f"{engineering(values.ripple_f, 'F')}",
        )
        margin = f"{found.loop.phase_margin_deg:.1f}° at {found.loop.crossover_hz:.4g} Hz"
        table.add_row("phase margin", margin)
    return table
