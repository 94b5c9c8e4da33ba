# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor admittance``: the stator's two-port."""

from __future__ import annotations

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import TARGETS, Call, command, option
from pyspice_runner.impedance.spectrum import State


@command(
    "motor", TARGETS, "state start stop points timeout audit changes",
    state=option(State, "free", "Free tip, or pressed on the rotor."),
    start=option(float, 5e3, "First frequency, Hz."),
    stop=option(float, 100e3, "Last frequency, Hz."),
    points=option(int, 2000, "Number of frequencies."),
)  # fmt: skip
def admittance(call: Call) -> None:
    """Compute the stator's two-port admittance and the equivalent circuit of each mode. Writes .csv, .nc or .json.

    Example: piezomotor admittance bimodal40 --state preloaded --plot admittance.png
    """
    call.check(".csv", ".nc", ".json")
    with common.busy("ngspice sweeps the frequency"):
        result = pr.admittance(call.loaded, **call.pick("start stop points state timeout audit"))
    common.caution(result)
    call.deliver(result, f"{result.motor['name']}, {call.state}")
