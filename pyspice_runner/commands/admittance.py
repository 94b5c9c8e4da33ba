# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor admittance``: the stator's two-port."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    AuditOption,
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    TimeoutOption,
    busy,
    check_targets,
    deliver,
    engineering,
    load_changed,
    warn_of,
)


class StateKind(StrEnum):
    """State of the tip in an admittance."""

    free = "free"
    preloaded = "preloaded"


def admittance(
    motor: MotorArgument,
    state: Annotated[StateKind, typer.Option(help="Free tip, or pressed on the rotor.")] = StateKind.free,
    start: Annotated[float, typer.Option(help="First frequency, Hz.")] = 5e3,
    stop: Annotated[float, typer.Option(help="Last frequency, Hz.")] = 100e3,
    points: Annotated[int, typer.Option(help="Number of frequencies.")] = 2000,
    timeout: TimeoutOption = None,
    audit: AuditOption = True,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Compute the stator's two-port admittance and the equivalent circuit of each mode. Writes .csv, .nc or .json.

    Example: piezomotor admittance bimodal40 --state preloaded --plot admittance.png
    """
    check_targets(output, (".csv", ".nc", ".json"), plot)
    with busy("ngspice sweeps the frequency"):
        result = pr.admittance(
            load_changed(motor, changes),
            start=start,
            stop=stop,
            points=points,
            state=state.value,
            timeout=timeout,
            audit=audit,
        )
    warn_of(result.audit.findings)
    table = Table("driven", "mode", "fs", "fp", "k_eff", "Qm", "R", "L", "C", box=None, padding=(0, 1, 0, 0))
    table.title = f"{result.motor['name']}, {state.value}"
    for connection, resonances in result.resonances.items():
        for item in resonances:
            table.add_row(
                connection,
                item.mode,
                *(engineering(value, "Hz") for value in (item.fs, item.fp)),
                f"{item.coupling_factor:.3f}",
                f"{item.quality_factor:.1f}",
                engineering(item.resistance_ohm, "Ω"),
                engineering(item.inductance_h, "H"),
                engineering(item.capacitance_f, "F"),
            )
    deliver(result.to_dict(), table, as_json, (output, result.save), (plot, result.plot))
