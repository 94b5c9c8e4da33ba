# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor steady``: one periodic steady state, by shooting."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    AuditOption,
    EngineKind,
    EngineOption,
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    TimeoutOption,
    busy,
    check_targets,
    complain,
    deliver,
    load_changed,
    warn_of,
)
from pyspice_runner.commands.contacting import DEFAULT_LAW, ContactOption, SlidersOption, law_named
from pyspice_runner.commands.driving import DriveOptions, with_drive_options


@with_drive_options
def steady(
    motor: MotorArgument,
    drive: DriveOptions,
    speed: Annotated[float | None, typer.Option(help="Speed at which the shaft is held, rad/s; default: free.")] = None,
    load: Annotated[float, typer.Option(help="Torque that a load draws from the free shaft, N.m.")] = 0.0,
    contact: ContactOption = DEFAULT_LAW,
    sliders: SlidersOption = None,
    step: Annotated[float | None, typer.Option(help="Longest time step, s; default: from the fastest motion.")] = None,
    accuracy: Annotated[float, typer.Option(help="Error allowed of the torque, relative to mu F0 R.")] = 2e-3,
    timeout: TimeoutOption = None,
    audit: AuditOption = True,
    engine: EngineOption = EngineKind.spice,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> int:
    """Find the periodic steady state and its stability. Writes .json, .csv or .nc (one period), .cir (its deck).

    Example: piezomotor steady bimodal40 --voltage 90 --speed 30 --json
    """
    law = law_named(contact, sliders)
    check_targets(output, (".json", ".csv", ".nc", ".cir"), plot)
    loaded = load_changed(motor, changes)
    with busy("ngspice runs periods of the drive"):
        result = pr.steady_state(
            loaded, drive.stated(loaded), speed=speed, load_torque=load, contact=law,
            step=step, accuracy=accuracy, timeout=timeout, audit=audit, engine=engine.value,
        )  # fmt: skip
    warn_of(result.audit.findings)
    table = Table("quantity", "value", title=f"{loaded.name}: {result.drive.label}")
    for name, value in result.summary().items():
        table.add_row(name, value)
    deliver(result.to_dict(), table, as_json, (output, result.save), (plot, result.plot))
    if not result.converged:
        complain("piezomotor: no steady state was found. Run simulate to see how the motor moves.")
        return 3
    if not result.stable:
        complain(f"piezomotor: the steady state is not stable ({result.instability}).", style="yellow")
    return 0
