# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor simulate``: one transient run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.circuit.waveforms import Waveform, read_waveform
from pyspice_runner.commands import common
from pyspice_runner.commands.drive import DriverOptions
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import LawOptions, Targets, with_options
from pyspice_runner.errors import Interrupted

# options of a run cycle by cycle, which an averaged one does not have
_OF_CYCLES = (
    "waveform",
    "sliders",
    "step",
    "accuracy",
    "signals",
    "record_from",
    "record_every",
    "audit",
)


@with_options
def simulate(
    context: typer.Context,
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 5e-3,
    law: LawOptions,
    speed: Annotated[float | None, typer.Option(help="Hold the shaft at this speed, rad/s (slider: m/s).")] = None,
    load_torque: Annotated[float, typer.Option(help="Torque of a load, N.m (slider: force, N).")] = 0.0,
    step: Annotated[float | None, typer.Option(help="Uniform time step, s; default: from the fastest motion.")] = None,
    accuracy: Annotated[
        float | None, typer.Option(help="Largest relative error of the tip's trajectory, such as 0.005; sets the step.")
    ] = None,
    signals: Annotated[str | None, typer.Option(help="Columns to record, such as tip_x_m,tip_y_m.")] = None,
    record_from: Annotated[float, typer.Option(help="Time at which recording starts, s.")] = 0.0,
    record_every: Annotated[int, typer.Option(help="Record every n-th step.")] = 1,
    waveform: Annotated[
        Path | None,
        typer.Option(
            help="CSV file of the voltages: time_s, voltage_a_v, voltage_b_v; --frequency is that of its cycles.",
            rich_help_panel="Drive",
        ),
    ] = None,
    averaged: Annotated[
        bool,
        typer.Option("--averaged", help="Average over the drive's period, for runs over seconds."),
    ] = False,
    driver: DriverOptions,
    timeout: common.TimeoutOption = None,
    audit: common.AuditOption = True,
    engine: common.EngineOption = "auto",
    changes: common.SetOption = None,
    targets: Targets,
) -> None:
    """Run a motor from rest under preload. Writes .csv or .nc (waveforms), .json (summary) or .cir (the deck).

    Example: piezomotor simulate bimodal40 --voltage 100 --duration 20e-3 --output run.csv --plot run.png
    """
    contact = law.law
    targets.check(".csv", ".nc", ".json", ".cir")
    if not averaged:
        common.refuse_idle(
            context, "without --averaged; piezomotor drive runs every cycle behind a driver", "driver", "engine"
        )
    driver.check(context)
    loaded, in_front = driver.applied(motor, changes)
    excitation = drive.stated(loaded)
    shaped = _shaped(context, excitation, waveform)
    if averaged:
        common.refuse_idle(context, "with --averaged", *_OF_CYCLES)
        with common.run_progress("The averaged motor runs") as progress:
            mean = pr.simulate_averaged(
                loaded, in_front(excitation, contact), duration, contact=contact, speed=speed, load_torque=load_torque,
                engine=engine, progress=progress, timeout=timeout,
            )  # fmt: skip
        common.caution(mean)
        targets.deliver(mean, f"{loaded.name}, averaged, {excitation.label}, {duration:.6g} s")
        return
    if targets.plot is not None and signals is not None:
        raise pr.ParameterError("--plot draws all signals; leave --signals out.")
    status = 0
    with common.run_progress("ngspice runs the motor") as progress:
        try:
            run = pr.simulate(
                loaded,
                shaped,
                duration=duration,
                contact=contact,
                speed=speed,
                load_torque=load_torque,
                step=step,
                accuracy=accuracy,
                signals=None if signals is None else [name.strip() for name in signals.split(",")],
                record_from=record_from,
                record_every=record_every,
                progress=progress,
                timeout=timeout,
                audit=audit,
            )
        except Interrupted as interrupt:
            run, status = interrupt.partial, common.INTERRUPTED
            common.warn_of([str(interrupt)])
    common.caution(run)
    partial = "" if run.complete else ", partial"
    targets.deliver(run, f"{loaded.name}, {shaped.label}, {run.time_s[-1]:.6g} s{partial}")
    raise typer.Exit(status)


def _shaped(
    context: typer.Context, drive: pr.TwoPhaseDrive | pr.TwoToneDrive, waveform: Path | None
) -> pr.TwoPhaseDrive | pr.TwoToneDrive | Waveform:
    """Return the drive, or the waveform of a file."""
    if waveform is None:
        return drive
    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError("--waveform needs a two-phase drive. Add --drive two-phase.")
    common.refuse_idle(context, "with --waveform", "voltage", "phase", "ratio_b", "soft_start")
    return read_waveform(waveform, drive.frequency)
