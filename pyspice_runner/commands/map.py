# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor map``: steady states over parameters, and the best working point within limits."""

from __future__ import annotations

from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.analysis.working_points import ACCURACY, Objective
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import LoadOption, PeriodOptions, Targets, with_options


@with_options
def map_points(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    over: Annotated[
        list[str],
        typer.Option(metavar="PATH=VALUES", help="An axis: drive.frequency=44e3:46e3:10. Twice for a plane."),
    ],
    objective: Annotated[Objective, typer.Option(help="Quantity that the best point maximises.")] = "torque",
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Greatest value allowed: current_a=0.1, temperature_c=100. Repeatable."
        ),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Speed at which the shaft is held, rad/s; default: by the objective.")
    ] = None,
    load: LoadOption = 0.0,
    period: PeriodOptions,
    accuracy: Annotated[float, typer.Option(help="Error allowed of the torque, relative to mu F0 R.")] = ACCURACY,
    changes: common.SetOption = None,
    targets: Targets,
) -> int:
    """Map steady states over parameters and find the best point. Writes .nc, .csv or .json.

    Example: piezomotor map andersen2002-unintended-mode --over drive.frequency=44e3:46e3:5
    --over drive.voltage=60,100 --limit current_a=0.06 --plot map.png
    """
    targets.check(".nc", ".csv", ".json")
    loaded = common.load_changed(motor, changes)
    limits = dict(_limit(text) for text in limit or ())
    with common.points_progress() as progress:
        dataset = pr.working_points(
            loaded, drive.stated(loaded), over=common.axes_of(over), objective=objective, limits=limits,
            speed=speed, load_torque=load, accuracy=accuracy, progress=progress, **period.settings,
        )  # fmt: skip
    result = dataset.piezomotor
    common.caution(result)
    targets.deliver(result, dataset.attrs["title"])
    return 0


def _limit(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise pr.ParameterError(f"--limit {text!r} is not NAME=VALUE; write it as current_a=0.1.") from None
