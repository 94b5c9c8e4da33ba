# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor map``: steady states over parameters, and the best working point within limits."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.analysis.working_points import ACCURACY
from pyspice_runner.commands.common import (
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    TimeoutOption,
    caution,
    check_targets,
    deliver,
    grid,
    load_changed,
    points_progress,
)
from pyspice_runner.commands.contacting import DEFAULT_LAW, ContactOption, SlidersOption, law_named
from pyspice_runner.commands.driving import DriveOptions, with_drive_options


class ObjectiveKind(StrEnum):
    """What is to be greatest."""

    torque = "torque"
    speed = "speed"
    efficiency = "efficiency"
    power = "power"


@with_drive_options
def map_points(
    motor: MotorArgument,
    drive: DriveOptions,
    over: Annotated[
        list[str],
        typer.Option(metavar="PATH=VALUES", help="An axis: drive.frequency=44e3:46e3:10. Twice for a plane."),
    ],
    objective: Annotated[ObjectiveKind, typer.Option(help="What the best point has most of.")] = ObjectiveKind.torque,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Greatest value allowed: current_a=0.1, temperature_c=100. Repeatable."
        ),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Speed at which the shaft is held, rad/s; default: by the objective.")
    ] = None,
    load: Annotated[float, typer.Option(help="Torque that a load draws from the free shaft, N.m.")] = 0.0,
    contact: ContactOption = DEFAULT_LAW,
    sliders: SlidersOption = None,
    step: Annotated[float | None, typer.Option(help="Longest time step, s; default: from the fastest motion.")] = None,
    accuracy: Annotated[float, typer.Option(help="Error allowed of the torque, relative to mu F0 R.")] = ACCURACY,
    timeout: TimeoutOption = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> int:
    """Map steady states over parameters and find the best point. Writes .nc, .csv or .json.

    Example: piezomotor map andersen2002-unintended-mode --over drive.frequency=44e3:46e3:5
    --over drive.voltage=60,100 --limit current_a=0.06 --plot map.png
    """
    law = law_named(contact, sliders)
    check_targets(output, (".nc", ".csv", ".json"), plot)
    loaded = load_changed(motor, changes)
    axes = {}
    for text in over:
        path, _, values = text.partition("=")
        axes[path.strip()] = grid(f"--over {path}", values)
    limits = dict(_limit(text) for text in limit or ())
    with points_progress() as progress:
        dataset = pr.working_points(
            loaded, drive.stated(loaded), over=axes, objective=objective.value, limits=limits, speed=speed,
            load_torque=load, contact=law, step=step, accuracy=accuracy, timeout=timeout,
            progress=progress,
        )  # fmt: skip
    result = dataset.piezomotor
    caution(result)
    table = Table("quantity", "value", title=dataset.attrs["title"])
    for name, value in result.summary().items():
        table.add_row(name, value)
    deliver(result.to_dict(), table, as_json, (output, result.save), (plot, result.plot))
    return 0


def _limit(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise pr.ParameterError(f"--limit {text!r} is not NAME=VALUE; write it as current_a=0.1.") from None
