# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor simulate``: one transient run."""

from __future__ import annotations

from pathlib import Path

import typer

import pyspice_runner as pr
from pyspice_runner.circuit.source import Waveform, read_waveform
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, DRIVE, DRIVER, LAW, TARGETS, Call, command, option

# options of a run cycle by cycle, which an averaged one does not have
_OF_CYCLES = "waveform sliders step accuracy signals record_from record_every audit"


@command(
    "motor", DRIVE, "duration", LAW, "speed load_torque step accuracy signals record_from record_every waveform",
    "averaged", DRIVER, "timeout audit engine", CHANGES, TARGETS,
    duration=option("Simulated time, s; default: 5e-3, of a transducer until it has settled."),
    step=option("Uniform time step, s; default: from the fastest motion."),
    accuracy=option("Largest relative error of the tip's trajectory, such as 0.005; sets the step."),
    signals=option("Columns to record, such as tip_x_m,tip_y_m.", str | None),
    record_from=option("Time at which recording starts, s.", float, 0.0),
    record_every=option("Record every n-th step.", int, 1),
    waveform=option(
        "CSV file of the voltages: time_s, voltage_a_v, voltage_b_v; --frequency is that of its cycles.",
        Path | None, rich_help_panel="Drive",
    ),
)  # fmt: skip
def simulate(call: Call) -> None:
    """Run a motor from rest under preload. Writes .csv or .nc (waveforms), .json (summary) or .cir (the deck).

    Example: piezomotor simulate bimodal40 --voltage 100 --duration 20e-3 --output run.csv --plot run.png
    """
    call.check(".csv", ".nc", ".json", ".cir")
    if not call.averaged:
        call.refuse_idle("without --averaged; piezomotor drive runs every cycle behind a driver", "driver engine")
    call.check_driver()
    motor, shaped = call.loaded, _shaped(call)
    duration = max(common.DURATION, motor.settled_s) if call.duration is None else call.duration
    if call.averaged:
        call.refuse_idle("with --averaged", _OF_CYCLES)
        with common.run_progress("The averaged motor runs") as progress:
            mean = pr.simulate_averaged(
                motor, call.in_front(), duration, contact=call.law, progress=progress,
                **call.pick("speed load_torque engine timeout"),
            )  # fmt: skip
        call.deliver(mean, f"{motor.name}, averaged, {call.stated.label}, {duration:.6g} s")
        return
    if call.plot is not None and call.signals is not None:
        raise pr.ParameterError("--plot draws all signals; leave --signals out.")
    signals = None if call.signals is None else [name.strip() for name in call.signals.split(",")]
    with common.run_progress("ngspice runs the motor") as progress:
        run, status = common.finished(lambda: pr.simulate(
            motor, shaped, duration, contact=call.law, signals=signals, progress=progress,
            **call.pick("speed load_torque step accuracy record_from record_every timeout audit"),
        ))  # fmt: skip
    partial = "" if run.complete else ", partial"
    call.deliver(run, f"{motor.name}, {shaped.label}, {run.time_s[-1]:.6g} s{partial}")
    raise typer.Exit(status)


def _shaped(call: Call) -> pr.TwoPhaseDrive | pr.TwoToneDrive | Waveform:
    """Return the drive, or the waveform of a file."""
    drive = call.stated
    if call.waveform is None:
        return drive
    if not isinstance(drive, pr.TwoPhaseDrive):
        raise pr.ParameterError("--waveform needs a two-phase drive. Add --drive two-phase.")
    call.refuse_idle("with --waveform", "voltage phase ratio_b soft_start")
    return read_waveform(call.waveform, drive.frequency)
