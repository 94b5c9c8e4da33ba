# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor loop`` and ``state-space``: a control loop, and the averaged motor as a linear system."""

from __future__ import annotations

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, DRIVE, TARGETS, Call, command, option
from pyspice_runner.control.loop import SAMPLE_TIME, Quantity

LONGEST_SAMPLE = 1.0  # s; a motor of this kind runs up in milliseconds


@command(
    "motor", DRIVE, "quantity crossover margin sample load_torque over", CHANGES, TARGETS,
    quantity=option("Controlled quantity.", Quantity, "speed"),
    crossover=option("Frequency at which the loop gain is 1, Hz; default: the motor's highest."),
    margin=option("Phase margin, degrees; default: 60 or the next possible."),
    sample=option("Time between two samples, s.", float, SAMPLE_TIME),
    over=option(
        "Other operating points: speed=5,10 (the amplitude follows), load.torque=0,1e-3, drive.voltage=60,80, "
        "temperature=0,40, contact.preload_n=5,6. Repeatable.", list[str] | None, metavar="PATH=VALUES"
    ),
)  # fmt: skip
def loop(call: Call) -> None:
    """Design a sampled controller at a steady state of the averaged motor. Writes .json, .csv or .nc (loop gain).

    Example: piezomotor loop bimodal40 --voltage 80 --crossover 100 --margin 60 --sample 250e-6 --plot loop.png
    """
    call.check(".json", ".csv", ".nc", starts=False)
    if call.sample > LONGEST_SAMPLE:
        raise pr.ParameterError(
            f"--sample {call.sample:g} is out of range: it is the time between two samples, at most {LONGEST_SAMPLE:g} "
            f"s. For {call.sample:g} samples per second write --sample {1.0 / call.sample:.3g}."
        )
    drive = call.one_tone("A loop is designed about")
    if call.loaded.is_transducer:
        _phase_locked(call, drive)
        return
    with common.busy("The averaged motor settles and steps"):
        design = pr.control_loop(
            call.loaded, drive, over=common.axes_of(call.over) if call.over else None,
            **call.pick("quantity crossover margin load_torque", sample_time="sample"),
        )  # fmt: skip
    call.deliver(design, f"{call.loaded.name}: loop of the {call.quantity}, {drive.label}")


def _phase_locked(call: Call, drive: pr.TwoPhaseDrive) -> None:
    """Design the phase-locked loop of a transducer."""
    if call.quantity != "phase":
        raise pr.ParameterError(f"{call.loaded.name} is a transducer, without a shaft: add --quantity phase.")
    call.refuse_idle("for the phase-locked loop of a transducer", "margin sample load_torque over")
    tracker = pr.Tracker(kind="pll", voltage=drive.voltage, frequency=drive.frequency)
    tracker = tracker.updated({"bandwidth_hz": call.crossover or tracker.bandwidth_hz})
    call.deliver(pr.control_loop(call.loaded, tracker), f"{call.loaded.name}: loop of the phase, {drive.label}")


@command("motor", DRIVE, "load_torque", CHANGES, TARGETS)
def state_space(call: Call) -> None:
    """Write the averaged motor about a steady state as A, B, C, D: .mat or .json.

    Example: piezomotor state-space bimodal40 --voltage 80 --output plant.mat
    """
    call.check(".json", ".mat", starts=False)
    drive = call.one_tone("Small signals are those about")
    with common.busy("The averaged motor settles"):
        system = pr.state_space(call.loaded, drive, load_torque=call.load_torque)
    call.deliver(system, f"{call.loaded.name}: state space, {drive.label}")
