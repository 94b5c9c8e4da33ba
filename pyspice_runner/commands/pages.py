# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor report`` and ``live``: the pages of a motor."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.measured import ColumnsOption, ThroughOption, reader
from pyspice_runner.commands.options import with_options
from pyspice_runner.impedance.spectrum import Connection

if TYPE_CHECKING:
    from pyspice_runner.trackers.track import Tracking


@with_options
def report(
    context: typer.Context,
    motor: common.MotorArgument,
    drive: DriveOptions,
    duration: Annotated[float, typer.Option(help="Simulated time of the run from rest, s.")] = 10e-3,
    speeds: Annotated[
        str | None,
        typer.Option(help="Speeds of the curves, rad/s (slider: m/s), as 0:10:6; default: up to no load."),
    ] = None,
    levels: Annotated[str, typer.Option(help="Fractions of the voltage, one curve each.")] = "0.5,1",
    measured: Annotated[
        str | None, typer.Option(metavar="FILE", help="A measured spectrum to plot with the computed ones.")
    ] = None,
    connection: Annotated[Connection, typer.Option(help="Connection of the groups in a one-port measurement.")] = "A",
    columns: ColumnsOption = None,
    through: ThroughOption = None,
    tracker: Annotated[
        Literal["pll"] | None,
        typer.Option(help="Add the loop gain of this tracker: the run of `track`, from rest and with its defaults."),
    ] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="JSON of `calibrate` for this motor: its values, fits and residuals.")
    ] = None,
    timeout: common.TimeoutOption = None,
    changes: common.SetOption = None,
    as_json: common.JsonOption = False,
    output: Annotated[Path | None, typer.Option("--output", help="The page, .html; or .json.")] = None,
    plot: common.PlotOption = None,
) -> None:
    """Write the data sheet of a motor: animated modes, tip path, impedance, speed and torque. Writes .html or .json.

    The page is self-contained. Without --output it is MOTOR.html.

    Example: piezomotor report bimodal40 --output report.html
    """
    if measured is None:
        common.refuse_idle(context, "without --measured", "connection", "columns", "through")
    loaded = common.load_changed(motor, changes)
    target = Path(f"{loaded.name}.html") if output is None and not as_json else output
    common.check_targets(target, (".html", ".json"), plot, [motor, calibration])
    if target is not None and target.suffix == ".html":
        _check_tools()
    excitation = drive.stated(loaded)
    spectrum = reader(columns, through)(measured) if measured else None
    tracking = None
    if tracker is not None:
        tracking = _tracked(loaded, excitation, centred=drive.frequency is None, timeout=timeout)
        common.caution(tracking)
    with common.points_progress() as progress:
        try:
            result = pr.report(
                loaded,
                excitation,
                duration=duration,
                speeds=common.grid("--speeds", speeds) if speeds else None,
                levels=common.grid("--levels", levels),
                measured=spectrum,
                connection=connection,
                tracking=tracking,
                calibration=calibration,
                progress=progress,
                timeout=timeout,
            )
        except pr.SimulationError as error:
            kept = common.keep([(Path(name), save) for name, save in (error.partial or {}).items()])
            if kept is None:
                raise
            raise pr.SimulationError(f"{error} What was finished is kept in {kept}.") from None

    def save(path: Path) -> None:
        with common.busy("writing the page"):
            result.save(path)

    table = common.summary_table(result.summary() | ({} if target is None else {"file": str(target)}), "Data sheet")
    common.deliver(result.to_dict(), table, as_json, (target, save), (plot, result.run.plot))


def _tracked(
    motor: pr.Motor, drive: pr.TwoPhaseDrive | pr.TwoToneDrive, *, centred: bool, timeout: float | None
) -> Tracking:
    """Return the run of ``piezomotor track`` from rest; ``centred``: about the resonance of the running motor."""
    from pyspice_runner.commands import track

    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError(
            f"--tracker needs two phases of one tone, and this drive of {motor.name} has two tones. Add --drive "
            "two-phase, or leave --tracker out."
        )
    tone = {name: getattr(drive, name) for name in ("voltage", "frequency", "phase_deg", "ratio_b")}
    tracker = pr.Tracker(kind="pll", offset=track.START_OFFSET, **tone)
    with common.busy("The motor runs with the tracker pll"):
        return pr.track(motor, track.centred(motor, tracker) if centred else tracker, timeout=timeout)


def _check_tools() -> None:
    """Check before any run that the tools for the page are installed."""
    for name in ("plotly", "jinja2"):
        if find_spec(name) is None:
            raise pr.ParameterError(f"A report needs {name}. Install it: `pip install 'pyspice-runner[report]'`.")


def live(
    motor: common.MotorArgument,
    changes: common.SetOption = None,
    as_json: common.JsonOption = False,
    output: Annotated[Path | None, typer.Option("--output", help="The page, .html; by default MOTOR.html.")] = None,
    plot: common.PlotOption = None,
) -> None:
    """Write a page in which ngspice runs the motor in the browser: one file, without installation or network.

    Example: piezomotor live bimodal40 --output live.html
    """
    from pyspice_runner.view.live import engine_facts, save_live_page

    if plot is not None:
        raise pr.ParameterError("The page draws its own charts: leave --plot out.")
    loaded = common.load_changed(motor, changes)
    target = Path(f"{loaded.name}.html") if output is None else output
    common.check_targets(target, (".html",), None)
    with common.busy("writing the page"):
        save_live_page(loaded, target)
    facts = engine_facts()
    document = {"page": str(target), "motor": loaded.name, "bytes": target.stat().st_size, "engine": facts}
    shown = {
        "page": str(target),
        "size": f"{target.stat().st_size / 1e6:.1f} MB",
        "engine": f"ngspice {facts['ngspice']}, {facts['package']}",
    }
    common.deliver(document, common.summary_table(shown, f"{loaded.name}: live page"), as_json)
