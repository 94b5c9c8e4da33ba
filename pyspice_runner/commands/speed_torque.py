# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor speed-torque``: speed–torque curves on a dynamometer."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    INTERRUPTED,
    MotorArgument,
    SetOption,
    axes_of,
    caution,
    complain,
    grid,
    load_changed,
    points_progress,
    warn_of,
)
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import EngineOptions, PeriodOptions, Targets, with_options
from pyspice_runner.errors import Interrupted

if TYPE_CHECKING:
    import xarray


@with_options
def speed_torque(
    motor: MotorArgument,
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
    changes: SetOption = None,
    targets: Targets,
) -> int:
    """Measure torque, power and losses over speed. Writes .nc, .csv or .json.

    Example: piezomotor speed-torque andersen2002-unintended-mode --voltage 100 --frequency 46e3 --phase 180
    --speeds=-5:25:13 --plot curve.png
    """
    targets.check(".nc", ".csv", ".json")
    loaded = load_changed(motor, changes)
    excitation = drive.stated(loaded)
    status = 0
    with points_progress() as progress:
        try:
            curve = pr.speed_torque(
                loaded,
                excitation,
                speeds=grid("--speeds", speeds),
                over=axes_of([over] if over else None),
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
            status = INTERRUPTED if isinstance(fault, Interrupted) else 3
            complain(f"piezomotor: {fault} {curve.attrs['incomplete']}")
    result = curve.piezomotor
    if "folds" in curve.attrs:
        caution(result)
        targets.deliver(result, curve.attrs["title"])
        return 0
    warn_of(result.audit.findings)
    if result.unsettled:
        message = f"piezomotor: {result.unsettled} of {curve['settled'].size} points did not settle; see 'settled'."
        complain(message, style="yellow")
    targets.deliver(result, _table(curve))
    return status


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %" if isfinite(share) else "–"


def _table(curve: xarray.Dataset) -> Table:
    further = [str(name) for name in curve["torque_n_m"].dims[:-1]]
    titles = ("rad/s", "mN·m", "F_N / N", "electrical / W", "shaft / W", "efficiency", "stick", "slip", "settled")
    table = Table(*further, *titles, title=curve.attrs["title"], box=None, padding=(0, 2, 0, 0))
    for _, point in curve.to_dataframe().reset_index().dropna(subset="torque_n_m").iterrows():
        electrical = point["power_a_w"] + point["power_b_w"]
        values = (point["speed_rad_s"], 1e3 * point["torque_n_m"], point["normal_force_n"], electrical)
        table.add_row(
            *(f"{point[name]:g}" for name in further),
            *(f"{value:.4g}" for value in (*values, point["shaft_power_w"])),
            *(_percent(point[name]) for name in ("efficiency", "stick", "slip")),
            "yes" if point["settled"] else "no",
        )
    return table
