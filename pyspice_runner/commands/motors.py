# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor motors``, ``show`` and ``export``: what a motor is."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    CIRCUIT_ENDINGS,
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    busy,
    check_targets,
    complete_motor,
    leaves,
    load_changed,
    show_result,
    write_table,
)
from pyspice_runner.commands.contacting import LawKind, LawOption, SlidersOption


def motors(as_json: JsonOption = False, output: OutputOption = None, plot: PlotOption = None) -> None:
    """List the parameter sets that come with the package."""
    check_targets(output, (".json", ".csv"), plot)
    found = [pr.load_motor(name) for name in pr.available_motors()]
    document = {
        "motors": [
            {"name": motor.name, "frequencies_hz": [mode.frequency_hz for mode in motor.modes]} for motor in found
        ]
    }
    table = Table("set", "modes", title="Parameter sets")
    for motor in found:
        table.add_row(motor.name, ", ".join(f"{mode.frequency_hz / 1e3:.4g} kHz" for mode in motor.modes))
    if output is not None:
        rows = [["motor", "mode", "frequency_hz"]]
        rows += [[motor.name, mode.name, f"{mode.frequency_hz:.9g}"] for motor in found for mode in motor.modes]
        write_table(output, document, rows)
    if plot is not None:
        pr.plot_motors(found, plot)
    show_result(document, table, as_json)


def show(
    motor: MotorArgument,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Show a motor: its modes, groups, contact and rotor, in SI units.

    Example: piezomotor show andersen2002 --plot modes.png
    """
    check_targets(output, (".json", ".csv"), plot)
    loaded = load_changed(motor, changes)
    document = loaded.to_dict()
    rows = [["parameter", "value"], *([path, f"{value}"] for path, value in leaves(document))]
    if output is not None:
        write_table(output, document, rows)
    if plot is not None:
        pr.plot_mode_shapes(loaded, plot)
    table = Table("parameter", "value", "from", title=loaded.name)
    for path, value in leaves(document):
        origin = loaded.provenance.get(path)
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(path, shown, origin.kind if origin else "derived")
    show_result(document, table, as_json)


def export(
    source: Annotated[
        str,
        typer.Argument(
            metavar="MOTOR|FIT",
            help="A parameter set, a motor's TOML, or a fit's .json or .toml.",
            autocompletion=complete_motor,
        ),
    ],
    contact: LawOption = LawKind.spring_slider,
    sliders: SlidersOption = 8,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Write a motor, or the circuit of a fit, for other programs.

    A motor becomes .subckt piezomotor a b com shaft, a fit .subckt resonator p n. Writes .lib (ngspice and LTspice),
    .asy (LTspice symbol), .kicad_sym (KiCad symbol), .s2p or .s1p (Touchstone) or .toml; without --output, the .lib.

    Example: piezomotor export andersen2002 --output motor.lib
    """
    if pr.is_circuit_file(source):
        _export_circuit(source, changes, as_json, output, plot)
        return
    check_targets(output, (".lib", ".asy", ".kicad_sym", ".s2p", ".toml"), plot)
    loaded = load_changed(source, changes)
    text = pr.motor_library(loaded, contact=contact.value, sliders=sliders)
    if output is not None:
        with busy("writing"):
            pr.export_motor(loaded, output, contact=contact.value, sliders=sliders)
    if plot is not None:
        pr.plot_mode_shapes(loaded, plot)
    _show_library("motor", loaded.name, text, as_json, output)


def _export_circuit(
    source: str, changes: list[str] | None, as_json: bool, output: Path | None, plot: Path | None
) -> None:
    if changes or plot is not None:
        raise pr.ParameterError("--set and --plot are for motors; a fit is drawn by `piezomotor fit FILE --plot`.")
    check_targets(output, CIRCUIT_ENDINGS, None)
    circuit, name = pr.load_circuit(source), Path(source).name
    if output is not None:
        pr.export_circuit(circuit, output, title=f"from {name}")
    _show_library("circuit", name, pr.circuit_library(circuit, title=f"from {name}"), as_json, output)


def _show_library(kind: str, name: str, text: str, as_json: bool, output: Path | None) -> None:
    if as_json:
        sys.stdout.write(json.dumps({kind: name, "library": text}) + "\n")
    elif output is None:
        sys.stdout.write(text)
    elif output.suffix in (".asy", ".kicad_sym"):
        library = output.with_suffix(".lib")
        if not library.exists():
            Console(stderr=True, highlight=False, soft_wrap=True).print(
                f"note: {output.name} names {library.name}; export that too, beside it.", markup=False
            )
