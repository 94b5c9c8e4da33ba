# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor loop``: a control loop of speed, position or phase."""

from __future__ import annotations

from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import LoadOption, Targets, with_options
from pyspice_runner.control.loop import Quantity


@with_options
def loop(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    quantity: Annotated[Quantity, typer.Option(help="Controlled quantity.")] = "speed",
    crossover: Annotated[float, typer.Option(help="Frequency at which the loop gain is 1, Hz.")] = 40.0,
    margin: Annotated[float, typer.Option(help="Phase margin, degrees.")] = 60.0,
    sample: Annotated[float, typer.Option(help="Time between two samples, s.")] = 0.5e-3,
    load: LoadOption = 0.0,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH=VALUES",
            help="Other operating points: speed=5,10 (the amplitude follows), load.torque=0,1e-3, "
            "drive.voltage=60,80, temperature=0,40, contact.preload_n=5,6. Repeatable.",
        ),
    ] = None,
    changes: common.SetOption = None,
    targets: Targets,
) -> None:
    """Design a sampled controller at a steady state of the averaged motor. Writes .json, .csv or .nc (loop gain).

    Example: piezomotor loop bimodal40 --voltage 80 --crossover 100 --margin 60 --sample 250e-6 --plot loop.png
    """
    targets.check(".json", ".csv", ".nc")
    loaded = common.load_changed(motor, changes)
    stated = drive.stated(loaded)
    if not isinstance(stated, pr.TwoPhaseDrive):
        raise pr.ParameterError("A loop is designed about a drive with one frequency. Add --drive two-phase.")
    with common.busy("The averaged motor settles and steps"):
        found = pr.control_loop(
            loaded,
            stated,
            quantity=quantity,
            crossover=crossover,
            margin=margin,
            sample_time=sample,
            load_torque=load,
            over=common.axes_of(over) if over else None,
        )
    common.caution(found)
    targets.deliver(found, f"{loaded.name}: loop of the {quantity}, {stated.label}")
