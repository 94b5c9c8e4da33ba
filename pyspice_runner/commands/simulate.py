# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor simulate``: one transient run."""

from __future__ import annotations

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
    load_changed,
    show_result,
    warn_of,
)
from pyspice_runner.commands.contacting import ContactKind, ContactOption, SlidersOption
from pyspice_runner.commands.driving import (
    DriveKind,
    DriveOption,
    Frequency1Option,
    Frequency2Option,
    FrequencyOption,
    PhaseOption,
    SoftStartOption,
    Voltage1Option,
    Voltage2Option,
    VoltageOption,
    stated_drive,
)


def simulate(
    motor: MotorArgument,
    drive: DriveOption = DriveKind.two_phase,
    voltage: VoltageOption = 50.0,
    frequency: FrequencyOption = None,
    phase: PhaseOption = None,
    voltage_1: Voltage1Option = 50.0,
    frequency_1: Frequency1Option = None,
    voltage_2: Voltage2Option = 50.0,
    frequency_2: Frequency2Option = None,
    soft_start: SoftStartOption = 0.0,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 5e-3,
    contact: ContactOption = ContactKind.spring_slider,
    sliders: SlidersOption = 8,
    speed: Annotated[float | None, typer.Option(help="Hold the shaft at this speed, rad/s.")] = None,
    load_torque: Annotated[float, typer.Option(help="Torque that a load draws from the shaft, N.m.")] = 0.0,
    step: Annotated[float | None, typer.Option(help="Uniform time step, s; default: from the fastest motion.")] = None,
    timeout: TimeoutOption = None,
    audit: AuditOption = True,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Run a motor from rest under preload. Writes .csv or .nc (waveforms), .json (summary) or .cir (the deck).

    Example: piezomotor simulate andersen2002 --voltage 100 --duration 20e-3 --output run.csv --plot run.png
    """
    check_targets(output, (".csv", ".nc", ".json", ".cir"), plot)
    loaded = load_changed(motor, changes)
    tones = (voltage_1, frequency_1, voltage_2, frequency_2)
    excitation = stated_drive(loaded, drive, voltage, frequency, phase, tones, soft_start)
    with busy("ngspice runs the motor"):
        run = pr.simulate(
            loaded,
            excitation,
            duration=duration,
            contact=contact.law,
            sliders=sliders,
            speed=speed,
            load_torque=load_torque,
            step=step,
            timeout=timeout,
            audit=audit,
        )
    warn_of(run.provenance["audit"]["findings"])
    if output is not None:
        run.save(output)
    if plot is not None:
        run.plot(plot)
    states = run.state_fractions
    table = Table("quantity", "value", title=f"{loaded.name}, {duration:g} s")
    table.add_row("mean rotor speed", f"{run.mean_rotor_speed_rad_s:.4g} rad/s")
    table.add_row("mean torque", f"{run.mean_torque_n_m:.4g} N·m")
    table.add_row("separated / stick / slip", " / ".join(f"{100 * share:.1f} %" for share in states.values()))
    table.add_row("energy residual", f"{run.energy_residual:.1e}")
    table.add_row("points", f"{run.points} in {run.solver_seconds:.2f} s, ngspice {run.ngspice_version}")
    show_result(run.to_dict(), table, as_json)
