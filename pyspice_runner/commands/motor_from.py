# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor motor-from``: a motor from spectra and the numbers of a data sheet, or from a data sheet alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import pyspice_runner as pr
from pyspice_runner.commands import common, measured
from pyspice_runner.impedance.spectrum import Connection

_SHEET = "Data sheet"


def motor_from(
    context: typer.Context,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="Spectrum of the free stator: a two-port, or group A. Without it the motor is of the class of --base.",
        ),
    ] = None,
    other: measured.OtherOption = None,
    both: measured.SumOption = None,
    difference: measured.DifferenceOption = None,
    preloaded: Annotated[Path | None, typer.Option(help="Spectrum of the stator pressed on its rotor.")] = None,
    connection: Annotated[Connection, typer.Option(help="Connection of the groups in a preloaded two-port.")] = "A",
    no_load_speed: Annotated[
        float | None, typer.Option(help="rad/s, or m/s of a linear stage.", rich_help_panel=_SHEET)
    ] = None,
    stall_torque: Annotated[float | None, typer.Option(help="N·m.", rich_help_panel=_SHEET)] = None,
    stall_force: Annotated[float | None, typer.Option(help="Of a linear stage, N.", rich_help_panel=_SHEET)] = None,
    voltage: Annotated[float | None, typer.Option(help="Amplitude on each group, V.", rich_help_panel=_SHEET)] = None,
    frequency: Annotated[float | None, typer.Option(help="Of the drive, Hz.", rich_help_panel=_SHEET)] = None,
    phase: Annotated[
        float | None,
        typer.Option(help="Of group B, degrees: 90, or without spectra that of --base.", rich_help_panel=_SHEET),
    ] = None,
    rated_speed: Annotated[
        float | None, typer.Option(help="Of a point at the same drive, rad/s or m/s.", rich_help_panel=_SHEET)
    ] = None,
    rated_load: Annotated[
        float | None, typer.Option(help="Of the rated point, N·m or N.", rich_help_panel=_SHEET)
    ] = None,
    rated_current: Annotated[
        float | None, typer.Option(help="RMS of a group at the rated point, A.", rich_help_panel=_SHEET)
    ] = None,
    rated_power: Annotated[
        float | None, typer.Option(help="Electrical, at the rated point, W.", rich_help_panel=_SHEET)
    ] = None,
    speed_error: Annotated[float, typer.Option(help="Relative, of the speed.", rich_help_panel=_SHEET)] = 0.02,
    torque_error: Annotated[
        float, typer.Option(help="Relative, of torques and forces.", rich_help_panel=_SHEET)
    ] = 0.02,
    current_error: Annotated[
        float, typer.Option(help="Relative, of current and power.", rich_help_panel=_SHEET)
    ] = 0.05,
    mass: measured.MassOption = None,
    tips: measured.TipOption = None,
    modes: measured.ModesOption = None,
    base: Annotated[
        str | None,
        typer.Option(
            help="Motor to take contact and rotor from: andersen2002, or without FILE bimodal40, whose class it is.",
            rich_help_panel="Both groups, towards a motor",
        ),
    ] = None,
    columns: measured.ColumnsOption = None,
    page: Annotated[Path | None, typer.Option(help="A page, .html, with the data and the motor together.")] = None,
    as_json: common.JsonOption = False,
    output: common.OutputOption = None,
) -> None:
    """Make a motor from spectra and numbers of its data sheet, or from a data sheet alone. Writes .toml or .json.

    The spectra are those of `fit --two-port` or `fit --b`. The no-load speed determines the modal mass, the stall load
    the friction, a preloaded spectrum the contact's stiffness. Without spectra the motor has the force and the speed of
    the sheet and is otherwise similar to --base. The table states the origin of each value: spectrum, data sheet,
    derived, or class average with its spread. A motor with --stall-force is a linear stage, in m/s and N.

    Example: piezomotor motor-from free.csv --no-load-speed 18.4 --stall-torque 0.9e-3 --voltage 300 --frequency 54e3
    """
    common.check_targets(output, (".toml", ".json"), None, [file, other, both, difference, preloaded, base])
    common.check_targets(page, (".html",), None, [file, other, both, difference, preloaded, base])
    stall = stall_torque if stall_force is None else stall_force
    rated = (rated_speed, rated_load, rated_current, rated_power)
    if (no_load_speed, stall, *rated) == (None,) * 6:
        common.refuse_idle(context, "without --no-load-speed or --stall-torque", "voltage", "frequency", "phase")
    if no_load_speed is None or mass is not None:  # with the mass, the speed is computed to compare it
        common.refuse_idle(context, "without --no-load-speed, or with --mass-kg", "speed_error")
    if stall is None and rated_load is None:
        common.refuse_idle(context, "without --stall-torque, --stall-force or --rated-load", "torque_error")
    if rated_current is None and rated_power is None:
        common.refuse_idle(context, "without --rated-current or --rated-power", "current_error")
    if file is None and (other or both or difference):
        raise pr.ParameterError("--b, --sum and --difference go with FILE, the spectrum of group A. Give it too.")
    masses = common.grid("--mass-kg", mass) if mass is not None else None
    mass_kg = masses[0] if masses and len(masses) == 1 else masses
    pairs = measured.tips_of(tips)
    read = measured.reader(columns, None)
    with common.busy("reading"):
        files = {"A": file, "B": other, "A+B": both, "A-B": difference}
        spectra = {name: read(path) for name, path in files.items() if path is not None}
        pressed = read(preloaded) if preloaded is not None else None
    if pressed is None or pressed.ports == 1:
        common.refuse_idle(context, "without a --preloaded two-port", "connection")
    given: Any = spectra if len(spectra) > 1 else spectra.get("A")
    with common.busy("fitting", "step {} of at most {}") as progress:
        result = pr.motor_from(
            given, preloaded=pressed, no_load_speed=no_load_speed, stall_torque=stall_torque, stall_force=stall_force,
            rated_speed=rated_speed, rated_load=rated_load, rated_current=rated_current, rated_power=rated_power,
            voltage=voltage, frequency=frequency, phase_deg=phase,
            mass_kg=mass_kg, speed_error=speed_error, torque_error=torque_error, current_error=current_error,
            modes=modes, connection=connection, tips=pairs, base=base, progress=progress,
        )  # fmt: skip
    writings = [(output, result.save)]
    if page is not None:
        with common.busy("page"):
            drive = pr.default_drive(result.motor)
            shown = pr.report(result.motor, drive, levels=(1.0,), measured=spectra.get("A"))
        writings.append((page, shown.save))
    table = common.summary_table(result.summary(), result.motor.name)
    common.deliver(result.to_dict(), table, as_json, *writings)
    if not as_json:
        for text in result.cautions:
            common.complain(f"note: {text}", style=None)
