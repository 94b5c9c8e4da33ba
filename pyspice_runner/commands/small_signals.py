# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor small-signals``: transfer functions and hot admittance of a running motor."""

from __future__ import annotations

from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import LoadOption, PeriodOptions, SpeedOption, Targets, with_options


@with_options
def small_signals(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    frequencies: Annotated[
        str, typer.Option(help="Frequencies of the modulation, Hz: 10,100,1000 or 100:5000:8.")
    ] = "10,30,100,300,1000,3000",
    speed: SpeedOption = None,
    load: LoadOption = 0.0,
    period: PeriodOptions,
    changes: common.SetOption = None,
    targets: Targets,
) -> int:
    """Find transfer functions and hot admittance of a running motor. Writes .json, .csv or .nc.

    Example: piezomotor small-signals andersen2002-unintended-mode --frequency 46e3 --load 5e-3 --frequencies 100,1000
    """
    targets.check(".json", ".csv", ".nc")
    loaded = common.load_changed(motor, changes)
    with common.busy("ngspice runs periods of the drive"):
        result = pr.small_signals(
            loaded, drive.stated(loaded), frequencies=common.grid("--frequencies", frequencies), speed=speed,
            load_torque=load, **period.settings,
        )  # fmt: skip
    common.caution(result)
    targets.deliver(result, f"{loaded.name}: {result.state.drive.label}")
    return 0
