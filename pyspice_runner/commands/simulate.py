# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor simulate``: one transient run."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
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
)


class DriveKind(StrEnum):
    """The drives of the paper's equations (1) and (2)."""

    two_phase = "two-phase"
    two_tone = "two-tone"


class ContactKind(StrEnum):
    """What the tip touches."""

    spring_slider = "spring-slider"
    none = "none"


def simulate(
    motor: MotorArgument,
    drive: Annotated[DriveKind, typer.Option(help="two-phase: eq. (1); two-tone: eq. (2).")] = DriveKind.two_phase,
    voltage: Annotated[float, typer.Option(help="Two-phase: amplitude of both groups, V.")] = 50.0,
    frequency: Annotated[float | None, typer.Option(help="Two-phase: frequency, Hz; default: the last mode.")] = None,
    phase: Annotated[float | None, typer.Option(help="Phase, degrees: 90 for two phases, 0 for two tones.")] = None,
    voltage_1: Annotated[float, typer.Option("--voltage-1", help="Two-tone: amplitude of the common tone, V.")] = 50.0,
    frequency_1: Annotated[float | None, typer.Option("--frequency-1", help="Two-tone: the common tone, Hz.")] = None,
    voltage_2: Annotated[float, typer.Option("--voltage-2", help="Two-tone: amplitude of the opposed tone, V.")] = 50.0,
    frequency_2: Annotated[float | None, typer.Option("--frequency-2", help="Two-tone: the opposed tone, Hz.")] = None,
    soft_start: Annotated[float, typer.Option(help="Rise time of the amplitude, s.")] = 0.0,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 5e-3,
    contact: Annotated[ContactKind, typer.Option(help="Contact law; none is a free tip.")] = ContactKind.spring_slider,
    speed: Annotated[float | None, typer.Option(help="Hold the shaft at this speed, rad/s.")] = None,
    load_torque: Annotated[float, typer.Option(help="Torque that a load draws from the shaft, N.m.")] = 0.0,
    step: Annotated[float | None, typer.Option(help="Uniform time step, s; default: from the fastest motion.")] = None,
    timeout: TimeoutOption = None,
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
    if drive is DriveKind.two_phase:
        last = loaded.modes[-1].frequency_hz
        excitation: pr.TwoPhaseDrive | pr.TwoToneDrive = pr.TwoPhaseDrive(
            voltage=voltage,
            frequency=last if frequency is None else frequency,
            phase_deg=90.0 if phase is None else phase,
            soft_start=soft_start,
        )
    else:
        if frequency_1 is None or frequency_2 is None:
            raise pr.ParameterError("A two-tone drive needs --frequency-1 and --frequency-2, in Hz. Give both.")
        excitation = pr.TwoToneDrive(
            voltage_1=voltage_1,
            frequency_1=frequency_1,
            voltage_2=voltage_2,
            frequency_2=frequency_2,
            phase_deg=0.0 if phase is None else phase,
            soft_start=soft_start,
        )
    with busy("ngspice runs the motor"):
        run = pr.simulate(
            loaded,
            excitation,
            duration=duration,
            contact=None if contact is ContactKind.none else "spring-slider",
            speed=speed,
            load_torque=load_torque,
            step=step,
            timeout=timeout,
        )
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
