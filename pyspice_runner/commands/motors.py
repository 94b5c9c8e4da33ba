# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor motors``, ``show`` and ``export``: parameters and libraries of motors."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from rich.table import Table

import pyspice_runner as pr
from pyspice_runner.commands import common
from pyspice_runner.commands.options import CHANGES, LAW, TARGETS, Call, argument, command, option
from pyspice_runner.motor.parameters import HERTZ
from pyspice_runner.result import leaves

SKELETON = Path(__file__).parents[1] / "motor" / "skeleton.toml"


@command("as_json output")
def motors(call: Call) -> None:
    """List the parameter sets of the package."""
    call.check(".json", ".csv")
    found = [pr.load_motor(name) for name in pr.available_motors()]
    modes = {motor.name: [mode.frequency_hz for mode in motor.modes] for motor in found}
    document = {"motors": [{"name": name, "frequencies_hz": frequencies} for name, frequencies in modes.items()]}
    table = common.summary_table({motor.name: motor.summary()["modes"] for motor in found}, "Parameter sets")
    rows = [["motor", "mode", "frequency_hz"]]
    rows += [[motor.name, mode.name, f"{mode.frequency_hz:.9g}"] for motor in found for mode in motor.modes]
    call.write(document, table, lambda path: common.write_table(path, document, rows))


@command("as_json", target=argument("The file to write, .toml.", Path, ..., "FILE"))
def new(call: Call) -> None:
    """Write a parameter set to start from: a motor that runs, in SI units, with comments.

    Example: piezomotor new mymotor.toml
    """
    common.check_targets(call.target, (".toml",), None)
    if call.target.exists():
        raise pr.ParameterError(f"{call.target} exists. Choose another name, or remove it.")
    document = {"file": str(call.target)}
    shown = common.summary_table({"file": str(call.target), "next": f"piezomotor show {call.target}"}, "A new motor")
    common.deliver(document, shown, call.as_json, (call.target, lambda path: path.write_bytes(SKELETON.read_bytes())))


@command("motor", CHANGES, TARGETS)
def show(call: Call) -> None:
    """Show a motor: its modes, groups, contact and rotor, in SI units.

    Example: piezomotor show bimodal40 --plot modes.png
    """
    call.check(".json", ".csv")
    loaded = call.loaded
    document = loaded.to_dict()
    if loaded.is_transducer:
        document["arms"] = {mode.name: mode.arm for mode in loaded.modes if mode.coupling_a_n_per_v}
    if loaded.contacts:
        document["normal_forces_at_rest_n"] = {one.name: one.preload_n for one in loaded.touching}
    source, ring = loaded.materials, loaded.ring  # from which values above follow
    origins = {f"contact.{source.TABLE}": source.model_dump(exclude_none=True)} if source else {}
    values = [*leaves(document), *leaves(origins | ({"ring": ring.model_dump()} if ring else {}))]
    power = HERTZ if loaded.is_transducer else loaded.contact.exponent
    units = {} if power == HERTZ else {"n_per_m15": f" N/m^{power:g}", "m_per_n23": f" m/N^(1/{power:g})"}
    rows = [["parameter", "value"], *([path, f"{value}"] for path, value in values)]
    table = Table("parameter", "value", "from", title=loaded.name)
    for path, value in values:
        origin = loaded.provenance.get(path)
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        for unit in (unit for ending, unit in units.items() if path.endswith(ending)):
            shown += unit.removesuffix("^(1/1)").removesuffix("^1")
        without = "default" if path.startswith(("ring.", "contact.lining.")) else "derived"
        table.add_row(path, shown, origin.kind if origin else without)
    if cautions := list(dict.fromkeys([*loaded.cautions, *loaded.limits_of_theory])):
        document["cautions"] = cautions
    call.write(document, table, lambda path: common.write_table(path, document, rows), loaded.plot)
    for sentence in cautions:
        common.complain(f"piezomotor: {sentence}", style="yellow")


_OF_MOTORS = "contact sliders thermal averaged dialect rotational"  # options of export for motors


@command(
    "source target", LAW, "name thermal averaged dialect rotational fmi", CHANGES, TARGETS,
    source=argument(
        "A parameter set, a motor's TOML, or a fit's .json or .toml.", str, ..., "MOTOR|FIT",
        autocompletion=common.complete_motor,
    ),
    target=argument("The file to write; the same as --output.", Path | None, None, "FILE"),
    name=option("Name of the subcircuit; different names may be used in one deck.", str, "", show_default=False),
    thermal=option("Add drift with temperature, and its two pins.", bool, False),
    averaged=option("Write the motor averaged over the drive's period (.lib, .fmu).", bool, False),
    dialect=option("Dialect of the .lib; spice is the same as ltspice.", Literal["spice", "ltspice", "xyce"], "spice"),
    rotational=option("Give the .va a shaft pin of the discipline rotational_omega.", bool, False),
    fmi=option("Version of FMI of the .fmu: 2 or 3.", int, 2),
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

    if call.target is not None:
        if call.output is not None:
            raise pr.ParameterError(f"Two files are given, {call.target} and --output {call.output}. Give one.")
        call = Call(call.context, {**call.values, "output": call.target})
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
    loaded = call.load(call.source)
    drift = Thermal.of(loaded) if call.thermal else None
    exported = MotorExport(
        loaded, contact, thermal=drift, dialect="xyce" if call.dialect == "xyce" else "spice",
        **call.pick("name averaged rotational fmi"),
    )  # fmt: skip
    exported.check(output)

    def save(path: Path) -> None:
        with common.busy("writing"):
            exported.save(path)

    text = FORMATS[ending].text(exported)
    call.write({"motor": loaded.name, "library": text}, "" if output else text, save, loaded.plot)


def _export_circuit(call: Call, name: str) -> None:
    call.refuse_idle("on the circuit of a fit", CHANGES)
    if call.plot is not None:
        raise pr.ParameterError("--plot is for motors; a fit is drawn by `piezomotor fit FILE --plot`.")
    from pyspice_runner.export.circuit import CIRCUIT_FORMATS, CircuitExport
    from pyspice_runner.motor.circuit_file import load_circuit

    call.check(*CIRCUIT_FORMATS, inputs=[call.source])
    file = Path(call.source).name
    exported = CircuitExport(load_circuit(call.source), f"from {file}", name)
    text = exported.text()
    call.write({"circuit": file, "library": text}, "" if call.output else text, exported.save)
