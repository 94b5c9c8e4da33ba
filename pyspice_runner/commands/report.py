# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor report``: the data sheet of a motor."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    JsonOption,
    MotorArgument,
    PlotOption,
    SetOption,
    TimeoutOption,
    busy,
    check_targets,
    deliver,
    engineering,
    grid,
    keep,
    load_changed,
    points_progress,
    refuse_idle,
)
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.measured import ColumnsOption, ThroughOption, reader
from pyspice_runner.commands.options import with_options
from pyspice_runner.spectra.spectrum import Connection

if TYPE_CHECKING:
    from pyspice_runner.view.report import Report


@with_options
def report(
    context: typer.Context,
    motor: MotorArgument,
    drive: DriveOptions,
    duration: Annotated[float, typer.Option(help="Simulated time of the run from rest, s.")] = 10e-3,
    speeds: Annotated[
        str | None, typer.Option(help="Speeds of the curves, rad/s, as 0:10:6; default: from standstill to no load.")
    ] = None,
    levels: Annotated[str, typer.Option(help="Fractions of the voltage, one curve each.")] = "0.5,1",
    measured: Annotated[
        str | None, typer.Option(metavar="FILE", help="A measured spectrum to plot with the computed ones.")
    ] = None,
    connection: Annotated[Connection, typer.Option(help="Connection of the groups in a one-port measurement.")] = "A",
    columns: ColumnsOption = None,
    through: ThroughOption = None,
    timeout: TimeoutOption = None,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: Annotated[Path | None, typer.Option("--output", help="The page, .html; or .json.")] = None,
    plot: PlotOption = None,
) -> None:
    """Write the data sheet of a motor: animated modes, tip path, impedance, speed and torque. Writes .html or .json.

    The page is self-contained. Without --output it is MOTOR.html.

    Example: piezomotor report bimodal40 --output report.html
    """
    if measured is None:
        refuse_idle(context, "without --measured", "connection", "columns", "through")
    loaded = load_changed(motor, changes)
    target = Path(f"{loaded.name}.html") if output is None and not as_json else output
    check_targets(target, (".html", ".json"), plot)
    if target is not None and target.suffix == ".html":
        _check_tools()
    excitation = drive.stated(loaded)
    spectrum = reader(columns, through)(measured) if measured else None
    with points_progress() as progress:
        try:
            result = pr.report(
                loaded,
                excitation,
                duration=duration,
                speeds=grid("--speeds", speeds) if speeds else None,
                levels=grid("--levels", levels),
                measured=spectrum,
                connection=connection,
                progress=progress,
                timeout=timeout,
            )
        except pr.SimulationError as error:
            kept = keep([(Path(name), save) for name, save in (error.partial or {}).items()])
            if kept is None:
                raise
            raise pr.SimulationError(f"{error} What was finished is kept in {kept}.") from None

    def save(path: Path) -> None:
        with busy("writing the page"):
            result.save(path)

    deliver(result.to_dict(), _table(result, target), as_json, (target, save), (plot, result.run.plot))


def _check_tools() -> None:
    """Check before any run that the tools for the page are installed."""
    for name in ("plotly", "jinja2"):
        if find_spec(name) is None:
            raise pr.ParameterError(f"A report needs {name}. Install it: `pip install 'pyspice-runner[report]'`.")


def _table(result: Report, target: Path | None) -> Table:
    table = Table("quantity", "value", title=f"{result.motor.name}, {result.drive.label}")
    for mode in result.motor.modes:
        table.add_row(mode.name, f"{engineering(mode.frequency_hz, 'Hz')}, Q {mode.quality_factor:.3g}")
    for name, value in list(result.summary().items())[2:]:  # motor and drive are in the title
        table.add_row(name, value)
    table.add_row("error by the step", f"{result.discretisation_error['tip_path']:.1e} of the tip's path")
    table.add_row("energy residual", f"{result.run.energy_residual:.1e}")
    if target is not None:
        table.add_row("page" if target.suffix == ".html" else "file", str(target))
    return table
