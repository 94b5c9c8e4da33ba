# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor steady``: one periodic steady state, by shooting."""

from __future__ import annotations

from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import EngineOptions, LoadOption, PeriodOptions, SpeedOption, Targets, with_options


@with_options
def steady(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    speed: SpeedOption = None,
    load: LoadOption = 0.0,
    period: PeriodOptions,
    accuracy: Annotated[float, typer.Option(help="Error allowed of the torque, relative to mu F0 R.")] = 2e-3,
    engine: EngineOptions,
    changes: common.SetOption = None,
    targets: Targets,
) -> int:
    """Find the periodic steady state and its stability. Writes .json, .csv or .nc (one period), .cir (its deck).

    Example: piezomotor steady bimodal40 --voltage 90 --speed 30 --json
    """
    targets.check(".json", ".csv", ".nc", ".cir")
    loaded = common.load_changed(motor, changes)
    with common.busy("ngspice runs periods of the drive"):
        result = pr.steady_state(
            loaded, drive.stated(loaded), speed=speed, load_torque=load, accuracy=accuracy, **period.settings,
            **engine.settings,
        )  # fmt: skip
    common.warn_of(result.audit.findings)
    targets.deliver(result, f"{loaded.name}: {result.drive.label}")
    if not result.converged:
        common.complain("piezomotor: no steady state was found. Run simulate to see how the motor moves.")
        return 3
    if not result.stable:
        common.complain(f"piezomotor: the steady state is not stable ({result.instability}).", style="yellow")
    return 0
