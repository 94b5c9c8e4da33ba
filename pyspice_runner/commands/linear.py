# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor admittance`` and ``state-space``: the stator's two-port, and the averaged motor as a linear system."""

from __future__ import annotations

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, DRIVE, NO_START, TARGETS, Call, command, option
from pyspice_runner.impedance.spectrum import State


@command(
    "motor", TARGETS, "state start stop points timeout audit", CHANGES,
    state=option(State, "free", "Free tip, or pressed on the rotor."),
    start=option(float | None, None, "First frequency, Hz; default: that of the solid, else 5 kHz."),
    stop=option(float | None, None, "Last frequency, Hz; default: that of the solid, else 100 kHz."),
    points=option(int, 2000, "Number of frequencies."),
)  # fmt: skip
def admittance(call: Call) -> None:
    """Compute the stator's two-port admittance and the equivalent circuit of each mode. Writes .csv, .nc or .json.

    Example: piezomotor admittance bimodal40 --state preloaded --plot admittance.png
    """
    call.check(".csv", ".nc", ".json")
    with common.busy("ngspice sweeps the frequency"):
        result = pr.admittance(call.loaded, **call.pick("start stop points state timeout audit"))
    call.deliver(result, f"{result.motor['name']}, {call.state}")


@command("motor", DRIVE, "load_torque", CHANGES, TARGETS)
def state_space(call: Call) -> None:
    """Write the averaged motor about a steady state as A, B, C, D: .mat or .json.

    Example: piezomotor state-space bimodal40 --voltage 80 --output plant.mat
    """
    call.refuse_idle(NO_START, "soft_start")
    call.check(".json", ".mat")
    drive = call.one_tone("Small signals are those about")
    with common.busy("The averaged motor settles"):
        system = pr.state_space(call.loaded, drive, load_torque=call.load_torque)
    call.deliver(system, f"{call.loaded.name}: state space, {drive.label}")
