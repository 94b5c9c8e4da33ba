# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor live``: the live page of a motor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common


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
