# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor motors``, ``show`` and ``export``: parameters and libraries of motors."""

from __future__ import annotations

from pathlib import Path

from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import LAW, TARGETS, Call, argument, command, option
from pyspice_runner.export.xyce import Dialect


@command(TARGETS)
def motors(call: Call) -> None:
    """List the parameter sets of the package."""
    call.check(".json", ".csv")
    found = [pr.load_motor(name) for name in pr.available_motors()]
    modes = {motor.name: [mode.frequency_hz for mode in motor.modes] for motor in found}
    document = {"motors": [{"name": name, "frequencies_hz": frequencies} for name, frequencies in modes.items()]}
    table = common.summary_table({motor.name: motor.summary()["modes"] for motor in found}, "Parameter sets")
    rows = [["motor", "mode", "frequency_hz"]]
    rows += [[motor.name, mode.name, f"{mode.frequency_hz:.9g}"] for motor in found for mode in motor.modes]
    call.write(
        document, table, lambda path: common.write_table(path, document, rows),
        lambda path: common.view().draw(found, path),
    )  # fmt: skip


@command("motor changes", TARGETS)
def show(call: Call) -> None:
    """Show a motor: its modes, groups, contact and rotor, in SI units.

    Example: piezomotor show bimodal40 --plot modes.png
    """
    call.check(".json", ".csv")
    loaded = call.loaded
    document = loaded.to_dict()
    rows = [["parameter", "value"], *([path, f"{value}"] for path, value in common.leaves(document))]
    table = Table("parameter", "value", "from", title=loaded.name)
    for path, value in common.leaves(document):
        origin = loaded.provenance.get(path)
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        table.add_row(path, shown, origin.kind if origin else "derived")
    if loaded.cautions:
        document["cautions"] = list(loaded.cautions)
    call.write(document, table, lambda path: common.write_table(path, document, rows), loaded.plot)
    for sentence in loaded.cautions:
        common.complain(f"piezomotor: {sentence}", style="yellow")


_OF_MOTORS = "contact sliders thermal averaged dialect rotational"  # options of export for motors


@command(
    "source", LAW, "name thermal averaged dialect rotational fmi changes", TARGETS,
    source=argument(
        str, ..., "A parameter set, a motor's TOML, or a fit's .json or .toml.", "MOTOR|FIT",
        autocompletion=common.complete_motor,
    ),
    name=option(
        str, "", "Name of the subcircuit; different names may be used in one deck.", show_default=False
    ),
    thermal=option(bool, False, "Add drift with temperature, and its two pins.", "--thermal"),
    averaged=option(
        bool, False, "Write the motor averaged over the drive's period (.lib, .fmu).", "--averaged"
    ),
    dialect=option(Dialect, "spice", "Dialect of the .lib: spice (ngspice, LTspice) or xyce."),
    rotational=option(
        bool, False, "Give the .va a shaft pin of the discipline rotational_omega.", "--rotational"
    ),
    fmi=option(int, 2, "Version of FMI of the .fmu: 2 or 3."),
)  # fmt: skip
def export(call: Call) -> None:
    """Write a motor, or the circuit of a fit, for other programs.

    A motor becomes .subckt piezomotor a b com shaft, a fit .subckt resonator p n. Writes .lib (ngspice and LTspice),
    .va (Verilog-A), .fmu (averaged motor for control tools, FMI), .asy (LTspice symbol), .kicad_sym (KiCad symbol),
    .s2p or .s1p (Touchstone) or .toml; without --output, the .lib.

    Example: piezomotor export bimodal40 --output motor.lib
    """
    from pyspice_runner.export.motor import FORMATS, MotorExport, endings
    from pyspice_runner.motor.circuit_file import is_circuit_file
    from pyspice_runner.motor.thermal import Thermal

    output = call.output
    if is_circuit_file(call.source):
        call.refuse_idle("on the circuit of a fit", _OF_MOTORS)
        if output is not None and output.suffix in (".s1p", ".toml"):
            call.refuse_idle(f"on a {output.suffix}, which names no subcircuit", "name")
        _export_circuit(call, call.name or "resonator")
        return
    contact = call.law
    call.check(*endings(call.averaged), inputs=[call.source])
    ending = output.suffix if output is not None else ".lib"
    call.refuse_idle(f"on a {ending}", " ".join(FORMATS[ending].idle))
    loaded = common.load_changed(call.source, call.changes)
    drift = Thermal.of(loaded) if call.thermal else None
    exported = MotorExport(
        loaded, contact, thermal=drift, **call.pick("name averaged dialect rotational fmi")
    )  # fmt: skip
    exported.check(output)

    def save(path: Path) -> None:
        with common.busy("writing"):
            exported.save(path)

    text = exported.text(ending)
    call.write({"motor": loaded.name, "library": text}, "" if output else text, save, loaded.plot)


def _export_circuit(call: Call, name: str) -> None:
    if call.changes or call.plot is not None:
        raise pr.ParameterError("--set and --plot are for motors; a fit is drawn by `piezomotor fit FILE --plot`.")
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS, CircuitExport
    from pyspice_runner.motor.circuit_file import load_circuit

    call.check(*CIRCUIT_FORMATS, inputs=[call.source])
    file = Path(call.source).name
    exported = CircuitExport(load_circuit(call.source), f"from {file}", name)
    text = exported.text()
    call.write({"circuit": file, "library": text}, "" if call.output else text, exported.save)
