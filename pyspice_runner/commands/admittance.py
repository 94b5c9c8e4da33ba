# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor admittance``: the stator's two-port."""

from __future__ import annotations

from typing import Annotated

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import Targets, with_options
from pyspice_runner.impedance.spectrum import State


@with_options
def admittance(
    motor: common.MotorArgument,
    targets: Targets,
    state: Annotated[State, typer.Option(help="Free tip, or pressed on the rotor.")] = "free",
    start: Annotated[float, typer.Option(help="First frequency, Hz.")] = 5e3,
    stop: Annotated[float, typer.Option(help="Last frequency, Hz.")] = 100e3,
    points: Annotated[int, typer.Option(help="Number of frequencies.")] = 2000,
    timeout: common.TimeoutOption = None,
    audit: common.AuditOption = True,
    changes: common.SetOption = None,
) -> None:
    """Compute the stator's two-port admittance and the equivalent circuit of each mode. Writes .csv, .nc or .json.

    Example: piezomotor admittance bimodal40 --state preloaded --plot admittance.png
    """
    targets.check(".csv", ".nc", ".json")
    with common.busy("ngspice sweeps the frequency"):
        result = pr.admittance(
            common.load_changed(motor, changes), start=start, stop=stop, points=points, state=state, timeout=timeout,
            audit=audit,
        )  # fmt: skip
    common.caution(result)
    targets.deliver(result, f"{result.motor['name']}, {state}")
