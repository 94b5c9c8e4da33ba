# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor motors``, ``show`` and ``export``: parameters and libraries of motors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    busy,
    check_targets,
    complain,
    complete_motor,
    deliver,
    leaves,
    load_changed,
    refuse_idle,
    view,
    write_table,
)
from pyspice_runner.commands.contacting import DEFAULT_LAW, ContactOption, SlidersOption, law_named


def motors(as_json: JsonOption = False, output: OutputOption = None, plot: PlotOption = None) -> None:
    """List the parameter sets of the package."""
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
    rows = [["motor", "mode", "frequency_hz"]]
    rows += [[motor.name, mode.name, f"{mode.frequency_hz:.9g}"] for motor in found for mode in motor.modes]
    deliver(
        document, table, as_json,
        (output, lambda path: write_table(path, document, rows)), (plot, lambda path: view().draw_motors(found, path)),
    )  # fmt: skip


def show(
    motor: MotorArgument,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Show a motor: its modes, groups, contact and rotor, in SI units.

    Example: piezomotor show bimodal40 --plot modes.png
    """
    check_targets(output, (".json", ".csv"), plot)
    loaded = load_changed(motor, changes)
    document = loaded.to_dict()
    rows = [["parameter", "value"], *([path, f"{value}"] for path, value in leaves(document))]
    table = Table("parameter", "value", "from", title=loaded.name)
    for path, value in leaves(document):
        origin = loaded.provenance.get(path)
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(path, shown, origin.kind if origin else "derived")
    deliver(
        document, table, as_json,
        (output, lambda path: write_table(path, document, rows)),
        (plot, lambda path: view().draw(loaded, path)),
    )  # fmt: skip


def export(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Argument(
            metavar="MOTOR|FIT",
            help="A parameter set, a motor's TOML, or a fit's .json or .toml.",
            autocompletion=complete_motor,
        ),
    ],
    contact: ContactOption = DEFAULT_LAW,
    sliders: SlidersOption = None,
    name: Annotated[
        str, typer.Option(help="Name of the subcircuit; different names may be used in one deck.", show_default=False)
    ] = "",
    thermal: Annotated[bool, typer.Option("--thermal", help="Add drift with temperature, and its two pins.")] = False,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="Write the motor averaged over the drive's period (.lib, .fmu).")
    ] = False,
    dialect: Annotated[str, typer.Option(help="Dialect of the .lib: spice (ngspice, LTspice) or xyce.")] = "spice",
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Write a motor, or the circuit of a fit, for other programs.

    A motor becomes .subckt piezomotor a b com shaft, a fit .subckt resonator p n. Writes .lib (ngspice and LTspice),
    .va (Verilog-A), .fmu (averaged motor for control tools, FMI 2.0), .asy (LTspice symbol), .kicad_sym (KiCad symbol),
    .s2p or .s1p (Touchstone) or .toml; without --output, the .lib.

    Example: piezomotor export bimodal40 --output motor.lib
    """
    from pyspice_runner.export.motor import FORMATS, MotorExport, endings
    from pyspice_runner.export.xyce import Dialect, check_dialect
    from pyspice_runner.model.circuit_file import is_circuit_file
    from pyspice_runner.model.thermal import Thermal

    if is_circuit_file(source):
        refuse_idle(context, "on the circuit of a fit", "contact", "sliders", "thermal", "averaged", "dialect")
        if output is not None and output.suffix in (".s1p", ".toml"):
            refuse_idle(context, f"on a {output.suffix}, which names no subcircuit", "name")
        _export_circuit(source, changes, as_json, output, plot, name or "resonator")
        return
    law = law_named(contact, sliders)
    check_targets(output, endings(averaged), plot, [source])
    check_dialect(dialect, output)
    ending = output.suffix if output is not None else ".lib"
    refuse_idle(context, f"on a {ending}", *FORMATS[ending].idle)
    loaded = load_changed(source, changes)
    drift = Thermal.of(loaded) if thermal else None
    exported = MotorExport(loaded, law, name, drift, averaged, cast(Dialect, dialect))

    def save(path: Path) -> None:
        with busy("writing"):
            exported.save(path)

    text = exported.text(ending)
    deliver(
        {"motor": loaded.name, "library": text}, "" if output else text, as_json,
        (output, save), (plot, lambda path: view().draw(loaded, path)),
    )  # fmt: skip
    _name_library(as_json, output)


def _export_circuit(
    source: str, changes: list[str] | None, as_json: bool, output: Path | None, plot: Path | None, name: str
) -> None:
    if changes or plot is not None:
        raise pr.ParameterError("--set and --plot are for motors; a fit is drawn by `piezomotor fit FILE --plot`.")
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS, CircuitExport
    from pyspice_runner.model.circuit_file import load_circuit

    check_targets(output, tuple(CIRCUIT_FORMATS), None, [source])
    file = Path(source).name
    exported = CircuitExport(load_circuit(source), f"from {file}", name)
    text = exported.text()
    deliver({"circuit": file, "library": text}, "" if output else text, as_json, (output, exported.save))
    _name_library(as_json, output)


def _name_library(as_json: bool, output: Path | None) -> None:
    """Say that a symbol needs the library that it names, where that is missing."""
    if not as_json and output is not None and output.suffix in (".asy", ".kicad_sym"):
        library = output.with_suffix(".lib")
        if not library.exists():
            complain(f"note: {output.name} names {library.name}; export that too, beside it.", style=None)
