# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor motors``, ``show`` and ``export``: what a motor is."""

from __future__ import annotations

import json
import sys

from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands.common import (
    JsonOption,
    MotorArgument,
    OutputOption,
    PlotOption,
    SetOption,
    check_targets,
    guarded,
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
    motor: MotorArgument,
    contact: LawOption = LawKind.spring_slider,
    sliders: SlidersOption = 8,
    changes: SetOption = None,
    as_json: JsonOption = False,
    output: OutputOption = None,
    plot: PlotOption = None,
) -> None:
    """Write a motor as one self-contained SPICE library, .subckt piezomotor a b com shaft. Writes .lib.

    Example: piezomotor export andersen2002 --output motor.lib
    """
    check_targets(output, (".lib",), plot)
    loaded = load_changed(motor, changes)
    text = pr.motor_library(loaded, contact=contact.value, sliders=sliders)
    if output is not None:
        guarded(output, lambda: output.write_text(text, encoding="utf-8"))
    if plot is not None:
        pr.plot_mode_shapes(loaded, plot)
    if as_json:
        sys.stdout.write(json.dumps({"motor": loaded.name, "library": text}) + "\n")
    elif output is None:
        sys.stdout.write(text)
