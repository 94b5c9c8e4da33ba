# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor state-space``: the averaged motor about a steady state as a linear system."""

from __future__ import annotations

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.driving import DriveOptions
from pyspice_runner.commands.options import LoadOption, Targets, with_options


@with_options
def state_space(
    motor: common.MotorArgument,
    drive: DriveOptions,
    *,
    load: LoadOption = 0.0,
    changes: common.SetOption = None,
    targets: Targets,
) -> None:
    """Write the averaged motor about a steady state as A, B, C, D: .mat or .json.

    Example: piezomotor state-space bimodal40 --voltage 80 --output plant.mat
    """
    targets.check(".json", ".mat")
    loaded = common.load_changed(motor, changes)
    stated = drive.stated(loaded)
    if not isinstance(stated, pr.TwoPhaseDrive):
        raise pr.ParameterError("Small signals are those about a drive with one frequency. Add --drive two-phase.")
    with common.busy("The averaged motor settles"):
        found = pr.state_space(loaded, stated, load_torque=load)
    common.caution(found)
    targets.deliver(found, f"{loaded.name}: state space, {stated.label}")
