# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor speed-torque``: speed–torque curves on a dynamometer."""

from __future__ import annotations

from enum import StrEnum
from math import isfinite
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    INTERRUPTED,
    AuditOption,
    EngineKind,
    EngineOption,
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    TimeoutOption,
    caution,
    check_targets,
    complain,
    deliver,
    grid,
    load_changed,
    points_progress,
    warn_of,
)
from pyspice_runner.commands.contacting import DEFAULT_LAW, ContactOption, SlidersOption, law_named
from pyspice_runner.commands.driving import DriveOptions, with_drive_options
from pyspice_runner.errors import Interrupted

if TYPE_CHECKING:
    from pathlib import Path

    import xarray

    from pyspice_runner.datasets import DatasetResult


class ModeKind(StrEnum):
    """How the dynamometer sets the speeds."""

    steady = "steady"
    settle = "settle"
    ramp = "ramp"


@with_drive_options
def speed_torque(
    motor: MotorArgument,
    drive: DriveOptions,
    speeds: Annotated[
        str, typer.Option(help="Speeds in rad/s: 0,2.5,5 or -5:10:7 for seven from -5 to 10; write --speeds=-5:10:7.")
    ] = "-5:10:7",
    over: Annotated[
        str | None, typer.Option(metavar="PATH=VALUES", help="A further axis, as drive.voltage=40,60,80.")
    ] = None,
    mode: Annotated[ModeKind, typer.Option(help="steady: solve; settle: run until settled; ramp.")] = ModeKind.steady,
    follow: Annotated[
        str | None,
        typer.Option(metavar="AXIS", help="Go on from point to point along this axis; with steady, through folds."),
    ] = None,
    contact: ContactOption = DEFAULT_LAW,
    sliders: SlidersOption = None,
    tolerance: Annotated[float, typer.Option(help="Largest change from block to block of a settled point.")] = 1e-3,
    patience: Annotated[int, typer.Option(help="Number of blocks after which a point counts as not settled.")] = 40,
    step: Annotated[float | None, typer.Option(help="Longest time step, s; default: from the fastest motion.")] = None,
    timeout: TimeoutOption = None,
    audit: AuditOption = True,
    engine: EngineOption = EngineKind.spice,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> int:
    """Measure torque, power and losses over speed. Writes .nc, .csv or .json.

    Example: piezomotor speed-torque andersen2002-unintended-mode --voltage 100 --frequency 46e3 --phase 180
    --speeds=-5:25:13 --plot curve.png
    """
    law = law_named(contact, sliders)
    check_targets(output, (".nc", ".csv", ".json"), plot)
    loaded = load_changed(motor, changes)
    excitation = drive.stated(loaded)
    path, _, values = (over or "").partition("=")
    status = 0
    with points_progress() as progress:
        try:
            curve = pr.speed_torque(
                loaded,
                excitation,
                speeds=grid("--speeds", speeds),
                over={path.strip(): grid(f"--over {path}", values)} if over else None,
                mode=mode.value,
                follow=follow,
                contact=law,
                tolerance=tolerance,
                patience=patience,
                step=step,
                timeout=timeout,
                audit=audit,
                engine=engine.value,
                progress=progress,
            )
        except (Interrupted, pr.SimulationError) as fault:
            if fault.partial is None:
                raise
            curve = fault.partial
            status = INTERRUPTED if isinstance(fault, Interrupted) else 3
            complain(f"piezomotor: {fault} {curve.attrs['incomplete']}")
    result = curve.piezomotor
    if "folds" in curve.attrs:
        return _deliver_branch(result, as_json, output, plot)
    warn_of(result.audit.findings)
    if result.unsettled:
        message = f"piezomotor: {result.unsettled} of {curve['settled'].size} points did not settle; see 'settled'."
        complain(message, style="yellow")
    deliver(
        result.to_dict(), _table(curve), as_json, (output, result.save), (plot, result.plot),
    )  # fmt: skip
    return status


def _deliver_branch(result: DatasetResult, as_json: bool, output: Path | None, plot: Path | None) -> int:
    """Write and print a branch of steady states."""
    caution(result)
    table = Table("quantity", "value", title=result.dataset.attrs["title"])
    for name, value in result.summary().items():
        table.add_row(name, value)
    deliver(result.to_dict(), table, as_json, (output, result.save), (plot, result.plot))
    return 0


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
