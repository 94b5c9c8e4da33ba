# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor small-signals``: transfer functions and hot admittance of a running motor."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
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
    grid,
    load_changed,
)
from pyspice_runner.commands.contacting import DEFAULT_LAW, ContactOption, SlidersOption, law_named
from pyspice_runner.commands.driving import DriveOptions, with_drive_options


@with_drive_options
def small_signals(
    motor: MotorArgument,
    drive: DriveOptions,
    frequencies: Annotated[
        str, typer.Option(help="Frequencies of the modulation, Hz: 10,100,1000 or 100:5000:8.")
    ] = "10,30,100,300,1000,3000",
    speed: Annotated[float | None, typer.Option(help="Speed at which the shaft is held, rad/s; default: free.")] = None,
    load: Annotated[float, typer.Option(help="Torque that a load draws from the free shaft, N.m.")] = 0.0,
    contact: ContactOption = DEFAULT_LAW,
    sliders: SlidersOption = None,
    step: Annotated[float | None, typer.Option(help="Longest time step, s; default: from the fastest motion.")] = None,
    timeout: TimeoutOption = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> int:
    """Find transfer functions and hot admittance of a running motor. Writes .json, .csv or .nc.

    Example: piezomotor small-signals andersen2002-unintended-mode --frequency 46e3 --load 5e-3 --frequencies 100,1000
    """
    law = law_named(contact, sliders)
    check_targets(output, (".json", ".csv", ".nc"), plot)
    loaded = load_changed(motor, changes)
    with busy("ngspice runs periods of the drive"):
        result = pr.small_signals(
            loaded, drive.stated(loaded), frequencies=grid("--frequencies", frequencies), speed=speed,
            load_torque=load, contact=law, step=step, timeout=timeout,
        )  # fmt: skip
    table = Table("quantity", "value", title=f"{loaded.name}: {result.state.drive.label}")
    for name, value in result.summary().items():
        table.add_row(name, value)
    caution(result)
    deliver(result.to_dict(), table, as_json, (output, result.save), (plot, result.plot))
    return 0
