# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor motors``, ``show`` and ``export``: parameters and libraries of motors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer
from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import LawOptions, Targets, with_options


@with_options
def motors(targets: Targets) -> None:
    """List the parameter sets of the package."""
    targets.check(".json", ".csv")
    found = [pr.load_motor(name) for name in pr.available_motors()]
    modes = {motor.name: [mode.frequency_hz for mode in motor.modes] for motor in found}
    document = {"motors": [{"name": name, "frequencies_hz": frequencies} for name, frequencies in modes.items()]}
    table = common.summary_table({motor.name: motor.summary()["modes"] for motor in found}, "Parameter sets")
    rows = [["motor", "mode", "frequency_hz"]]
    rows += [[motor.name, mode.name, f"{mode.frequency_hz:.9g}"] for motor in found for mode in motor.modes]
    targets.write(
        document, table, lambda path: common.write_table(path, document, rows),
        lambda path: common.view().draw(found, path),
    )  # fmt: skip


@with_options
def show(motor: common.MotorArgument, changes: common.SetOption = None, *, targets: Targets) -> None:
    """Show a motor: its modes, groups, contact and rotor, in SI units.

    Example: piezomotor show bimodal40 --plot modes.png
    """
    targets.check(".json", ".csv")
    loaded = common.load_changed(motor, changes)
    document = loaded.to_dict()
    rows = [["parameter", "value"], *([path, f"{value}"] for path, value in common.leaves(document))]
    table = Table("parameter", "value", "from", title=loaded.name)
    for path, value in common.leaves(document):
        origin = loaded.provenance.get(path)
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(path, shown, origin.kind if origin else "derived")
    if loaded.cautions:
        document["cautions"] = list(loaded.cautions)
    targets.write(document, table, lambda path: common.write_table(path, document, rows), loaded.plot)
    for sentence in loaded.cautions:
        common.complain(f"piezomotor: {sentence}", style="yellow")


_OF_MOTORS = ("contact", "sliders", "thermal", "averaged", "dialect", "rotational")  # options of export for motors


@with_options
def export(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Argument(
            metavar="MOTOR|FIT",
            help="A parameter set, a motor's TOML, or a fit's .json or .toml.",
            autocompletion=common.complete_motor,
        ),
    ],
    law: LawOptions,
    name: Annotated[
        str, typer.Option(help="Name of the subcircuit; different names may be used in one deck.", show_default=False)
    ] = "",
    thermal: Annotated[bool, typer.Option("--thermal", help="Add drift with temperature, and its two pins.")] = False,
    averaged: Annotated[
        bool, typer.Option("--averaged", help="Write the motor averaged over the drive's period (.lib, .fmu).")
    ] = False,
    dialect: Annotated[str, typer.Option(help="Dialect of the .lib: spice (ngspice, LTspice) or xyce.")] = "spice",
    rotational: Annotated[
        bool, typer.Option("--rotational", help="Give the .va a shaft pin of the discipline rotational_omega.")
    ] = False,
    fmi: Annotated[int, typer.Option(help="Version of FMI of the .fmu: 2 or 3.")] = 2,
    changes: common.SetOption = None,
    *,
    targets: Targets,
) -> None:
    """Write a motor, or the circuit of a fit, for other programs.

    A motor becomes .subckt piezomotor a b com shaft, a fit .subckt resonator p n. Writes .lib (ngspice and LTspice),
    .va (Verilog-A), .fmu (averaged motor for control tools, FMI), .asy (LTspice symbol), .kicad_sym (KiCad symbol),
    .s2p or .s1p (Touchstone) or .toml; without --output, the .lib.

    Example: piezomotor export bimodal40 --output motor.lib
    """
    from pyspice_runner.export.fmu_description import Version
    from pyspice_runner.export.motor import FORMATS, MotorExport, check_rotational, endings
    from pyspice_runner.export.xyce import Dialect, check_dialect
    from pyspice_runner.motor.circuit_file import is_circuit_file
    from pyspice_runner.motor.thermal import Thermal

    output = targets.output
    if is_circuit_file(source):
        common.refuse_idle(context, "on the circuit of a fit", *_OF_MOTORS)
        if output is not None and output.suffix in (".s1p", ".toml"):
            common.refuse_idle(context, f"on a {output.suffix}, which names no subcircuit", "name")
        _export_circuit(source, changes, targets, name or "resonator")
        return
    contact = law.law
    targets.check(*endings(averaged), inputs=[source])
    check_dialect(dialect, output)
    check_rotational(rotational, output)
    if fmi != 2 and (output is None or output.suffix != ".fmu"):
        raise pr.ParameterError(f"--fmi {fmi} is for a Functional Mock-up Unit: give a file name that ends in .fmu.")
    ending = output.suffix if output is not None else ".lib"
    common.refuse_idle(context, f"on a {ending}", *FORMATS[ending].idle)
    loaded = common.load_changed(source, changes)
    drift = Thermal.of(loaded) if thermal else None
    exported = MotorExport(
        loaded, contact, name, drift, averaged, cast(Dialect, dialect), rotational, cast(Version, fmi)
    )

    def save(path: Path) -> None:
        with common.busy("writing"):
            exported.save(path)

    text = exported.text(ending)
    targets.write({"motor": loaded.name, "library": text}, "" if output else text, save, loaded.plot)
    _name_library(targets)


def _export_circuit(source: str, changes: list[str] | None, targets: Targets, name: str) -> None:
    if changes or targets.plot is not None:
        raise pr.ParameterError("--set and --plot are for motors; a fit is drawn by `piezomotor fit FILE --plot`.")
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS, CircuitExport
    from pyspice_runner.motor.circuit_file import load_circuit

    targets.check(*CIRCUIT_FORMATS, inputs=[source])
    file = Path(source).name
    exported = CircuitExport(load_circuit(source), f"from {file}", name)
    text = exported.text()
    targets.write({"circuit": file, "library": text}, "" if targets.output else text, exported.save)
    _name_library(targets)


def _name_library(targets: Targets) -> None:
    """Say that a symbol needs the library that it names, where that is missing."""
    output = targets.output
    if not targets.as_json and output is not None and output.suffix in (".asy", ".kicad_sym"):
        library = output.with_suffix(".lib")
        if not library.exists():
            common.complain(f"note: {output.name} names {library.name}; export that too, beside it.", style=None)
