# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor burst``: fast start and stop."""

from __future__ import annotations

from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import RunOptions, Targets, with_options


@with_options
def burst(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    boost: Annotated[float, typer.Option(help="Factor of the voltages at the start.")] = 2.0,
    speed: Annotated[float, typer.Option(help="Speed at which the shaft is held, rad/s (slider: m/s).")] = 0.0,
    run: RunOptions,
    targets: Targets,
) -> None:
    """Compare a plain burst with one that starts at a higher voltage and stops by resistors. Writes .json, .csv, .cir.

    Example: piezomotor burst bimodal40 --boost 2 --speed 20 --plot burst.png
    """
    targets.check(".json", ".csv", ".cir")
    loaded = common.load_changed(motor, run.changes)
    stated = drive.stated(loaded)
    if not isinstance(stated, pr.TwoPhaseDrive):
        raise pr.ParameterError("A burst has two phases of one tone. Add --drive two-phase.")
    with common.busy("ngspice runs both bursts"):
        found = pr.fast_burst(loaded, stated, boost=boost, speed=speed, **run.settings)
    common.caution(found)
    targets.deliver(found, f"{loaded.name}: burst, {stated.label}")
