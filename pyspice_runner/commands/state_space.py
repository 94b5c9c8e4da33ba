# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor state-space``: the averaged motor about a steady state as a linear system."""

from __future__ import annotations

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import one_tone
from pyspice_runner.commands.options import DRIVE, TARGETS, Call, command


@command("motor", DRIVE, "load changes", TARGETS)
def state_space(call: Call) -> None:
    """Write the averaged motor about a steady state as A, B, C, D: .mat or .json.

    Example: piezomotor state-space bimodal40 --voltage 80 --output plant.mat
    """
    call.check(".json", ".mat")
    drive = one_tone(call.stated, "Small signals are those about")
    with common.busy("The averaged motor settles"):
        system = pr.state_space(call.loaded, drive, load_torque=call.load)
    common.caution(system)
    call.deliver(system, f"{call.loaded.name}: state space, {drive.label}")
