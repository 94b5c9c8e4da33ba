# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor admittance``: the stator's two-port."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    AuditOption,
    MotorArgument,
    SetOption,
    TimeoutOption,
    busy,
    engineering,
    load_changed,
    warn_of,
)
from pyspice_runner.commands.options import Targets, with_options
from pyspice_runner.spectra.spectrum import State


@with_options
def admittance(
    motor: MotorArgument,
    targets: Targets,
    state: Annotated[State, typer.Option(help="Free tip, or pressed on the rotor.")] = "free",
    start: Annotated[float, typer.Option(help="First frequency, Hz.")] = 5e3,
    stop: Annotated[float, typer.Option(help="Last frequency, Hz.")] = 100e3,
    points: Annotated[int, typer.Option(help="Number of frequencies.")] = 2000,
    timeout: TimeoutOption = None,
    audit: AuditOption = True,
    changes: SetOption = None,
) -> None:
    """Compute the stator's two-port admittance and the equivalent circuit of each mode. Writes .csv, .nc or .json.

    Example: piezomotor admittance bimodal40 --state preloaded --plot admittance.png
    """
    targets.check(".csv", ".nc", ".json")
    with busy("ngspice sweeps the frequency"):
        result = pr.admittance(
            load_changed(motor, changes), start=start, stop=stop, points=points, state=state, timeout=timeout,
            audit=audit,
        )  # fmt: skip
    warn_of(result.audit.findings)
    table = Table("driven", "mode", "fs", "fp", "k_eff", "Qm", "R", "L", "C", box=None, padding=(0, 1, 0, 0))
    table.title = f"{result.motor['name']}, {state}"
    for connection, resonances in result.resonances.items():
        for item in resonances:
            frequencies = (engineering(value, "Hz") for value in (item.fs, item.fp))
            arm = ((item.resistance_ohm, "Ω"), (item.inductance_h, "H"), (item.capacitance_f, "F"))
            values = (engineering(value, unit) for value, unit in arm)
            factors = f"{item.coupling_factor:.3f}", f"{item.quality_factor:.1f}"
            table.add_row(connection, item.mode, *frequencies, *factors, *values)
    targets.deliver(result, table)
