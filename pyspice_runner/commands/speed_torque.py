# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor speed-torque``: speed–torque curves on a dynamometer."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import EngineOptions, PeriodOptions, Targets, with_options
from pyspice_runner.errors import Interrupted

_SHOWN = ["torque_n_m", "normal_force_n", "shaft_power_w", "efficiency", "separated", "stick", "slip", "settled"]


@with_options
def speed_torque(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    speeds: Annotated[
        str, typer.Option(help="Speeds in rad/s: 0,2.5,5 or -5:10:7 for seven from -5 to 10; write --speeds=-5:10:7.")
    ] = "-5:10:7",
    over: Annotated[
        str | None, typer.Option(metavar="PATH=VALUES", help="A further axis, as drive.voltage=40,60,80.")
    ] = None,
    mode: Annotated[
        Literal["steady", "settle", "ramp"], typer.Option(help="steady: solve; settle: run until settled; ramp.")
    ] = "steady",
    follow: Annotated[
        str | None,
        typer.Option(metavar="AXIS", help="Go on from point to point along this axis; with steady, through folds."),
    ] = None,
    tolerance: Annotated[float, typer.Option(help="Largest change from block to block of a settled point.")] = 1e-3,
    patience: Annotated[int, typer.Option(help="Number of blocks after which a point counts as not settled.")] = 40,
    period: PeriodOptions,
    engine: EngineOptions,
    changes: common.SetOption = None,
    targets: Targets,
) -> int:
    """Measure torque, power and losses over speed. Writes .nc, .csv or .json.

    Example: piezomotor speed-torque andersen2002-unintended-mode --voltage 100 --frequency 46e3 --phase 180
    --speeds=-5:25:13 --plot curve.png
    """
    targets.check(".nc", ".csv", ".json")
    loaded = common.load_changed(motor, changes)
    excitation = drive.stated(loaded)
    status = 0
    with common.points_progress() as progress:
        try:
            curve = pr.speed_torque(
                loaded,
                excitation,
                speeds=common.grid("--speeds", speeds),
                over=common.axes_of([over] if over else None),
                mode=mode,
                follow=follow,
                tolerance=tolerance,
                patience=patience,
                progress=progress,
                **period.settings,
                **engine.settings,
            )
        except (Interrupted, pr.SimulationError) as fault:
            if fault.partial is None:
                raise
            curve = fault.partial
            status = common.INTERRUPTED if isinstance(fault, Interrupted) else 3
            common.complain(f"piezomotor: {fault}")
    result = curve.piezomotor
    common.caution(result)
    if "folds" in curve.attrs:
        targets.deliver(result, curve.attrs["title"])
        return 0
    points = curve[_SHOWN].to_dataframe().dropna(subset="torque_n_m").to_string(float_format="{:.4g}".format)
    targets.write(result.to_dict(), f"{curve.attrs['title']}\n{points}\n", result.save, result.plot)
    return status
