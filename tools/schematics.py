# SPDX-License-Identifier: GPL-3.0-or-later
"""The example schematics of ``examples/``: the motor between two sources, for KiCad and for LTspice.

``python -m tools.schematics FOLDER`` writes them. A test compares them with the ones in ``examples/``,
extracts the circuit from each drawing, and runs it. ``make kicad`` does the same with KiCad 9; LTspice is not tested.
"""

from __future__ import annotations

import json
import sys
import uuid
from math import degrees
from pathlib import Path

from pyspice_runner.circuit.motor import SUBCIRCUIT, editable_parameters, motor_library
from pyspice_runner.export.symbols import MOTOR_PINS, TESTED, UNTESTED, kicad_symbol, ltspice_symbol
from pyspice_runner.motor.drive import Tone, default_drive
from pyspice_runner.motor.load import load_motor
from pyspice_runner.motor.motor import Motor

MOTOR = "bimodal40"
NAME = "motor"  # name of all files, by which they refer to each other
SOURCES = ("V1", "V2")  # of groups A and B; the names in KiCad must end in a number
STEP, STOP = "100n", "5m"
SWEEP = ".ac lin 1001 30k 50k"  # the admittance around both modes, with the tip on the rotor
_ROOT = uuid.uuid5(uuid.NAMESPACE_URL, "pyspice-runner/examples/kicad")
_FONT = "(effects (font (size 1.27 1.27))"

Point = tuple[float, float]


def example_texts() -> dict[str, str]:
    """Return path below ``examples/`` → text of every file."""
    motor = load_motor(MOTOR)
    title = f"standing-wave piezomotor {motor.name}"
    library = motor_library(motor)
    described = (SUBCIRCUIT, MOTOR_PINS, f"{NAME}.lib", title, editable_parameters(motor))
    symbol = kicad_symbol(*described)
    symbols = f"{symbol.rstrip().removesuffix(')').rstrip()}\n{_SOURCE}\n)\n"  # the library of the project
    table = f'(lib (name "{NAME}")(type "KiCad")(uri "${{KIPRJMOD}}/{NAME}.kicad_sym")(options "")(descr ""))'
    project = {
        "meta": {"filename": f"{NAME}.kicad_pro", "version": 1},
        "schematic": {"ngspice": {"workbook_filename": f"{NAME}.wbk"}},
        "sheets": [[str(_ROOT), ""]],
    }
    return {
        f"kicad/{NAME}.kicad_pro": json.dumps(project, indent=2) + "\n",
        f"kicad/{NAME}.kicad_sch": kicad_schematic(motor, symbol),
        f"kicad/{NAME}.kicad_sym": symbols,
        f"kicad/{NAME}.wbk": json.dumps(_workbook(), indent=2) + "\n",
        "kicad/sym-lib-table": f"(sym_lib_table\n  (version 7)\n  {table}\n)\n",
        f"kicad/{NAME}.lib": library,
        f"ltspice/{NAME}_example.asc": ltspice_schematic(motor),
        f"ltspice/{NAME}.asy": ltspice_symbol(*described),
        f"ltspice/{NAME}.lib": library,
    }


def write_examples(folder: Path) -> list[Path]:
    """Write every file into a folder and return the files."""
    paths = []
    for name, text in example_texts().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="\n")
        paths.append(path)
    return paths


def _workbook() -> dict[str, object]:
    """Return KiCad's simulation workbook: a tab for the transient and one for the admittance."""
    tabs = [
        {
            "analysis": analysis, "commands": [command, ".kicad adjustpaths", ".save all", ".probe alli"], "traces": [],
            "measurements": [], "dottedSecondary": True, "showGrid": True,
        }
        for analysis, command in (("TRAN", _transient()), ("AC", SWEEP))
    ]  # fmt: skip
    return {"version": 6, "tabs": tabs, "user_defined_signals": [], "last_sch_text_sim_command": _transient()}


def _transient() -> str:
    return f".tran {STEP} {STOP} 0 {STEP} uic"


def _tones(motor: Motor) -> list[tuple[str, Tone]]:
    """Return name and sine of both sources, of the recommended drive."""
    drive = default_drive(motor)
    return list(zip(SOURCES, (*drive.tones_a, *drive.tones_b), strict=True))


def ltspice_schematic(motor: Motor) -> str:
    """Return the LTspice schematic, which refers to ``motor.asy`` in the same folder."""
    wires = [
        (160, 208, 160, 128), (160, 128, 384, 128),  # a
        (256, 208, 256, 160), (256, 160, 384, 160),  # b
        (160, 288, 160, 304), (256, 288, 256, 304), (160, 304, 256, 304), (256, 304, 336, 304),  # ground
        (336, 304, 336, 192), (336, 192, 384, 192),  # com
        (512, 128, 576, 128),  # shaft
    ]  # fmt: skip
    flags = {"0": (160, 304), "a": (224, 128), "b": (304, 160), "shaft": (576, 128)}
    lines = ["Version 4", "SHEET 1 880 680"]
    lines += [f"WIRE {' '.join(map(str, wire))}" for wire in wires]
    lines += [f"FLAG {x} {y} {name}" for name, (x, y) in flags.items()]
    for number, (name, tone) in enumerate(_tones(motor)):
        lines += [
            f"SYMBOL voltage {160 + 96 * number} 192 R0",
            f"SYMATTR InstName {name}",
            f"SYMATTR Value SINE(0 {tone.amplitude:g} {tone.frequency:.6g} 0 0 {degrees(tone.phase):.6g})",
        ]
    lines += [f"SYMBOL {NAME} 448 128 R0", "SYMATTR InstName X1"]
    lines += [f"TEXT 160 368 Left 2 !.tran 0 {STOP} 0 {STEP} uic", "TEXT 160 400 Left 2 !.options method=trap"]
    lines += [f"TEXT 160 432 Left 2 ;V(shaft): 1 V is 1 rad/s. {UNTESTED}."]
    return "\n".join(lines) + "\n"


def kicad_schematic(motor: Motor, symbol: str) -> str:
    """Return the KiCad schematic (format of KiCad 7, which later versions read).

    Args:
        motor: the motor.
        symbol: the text of its symbol library, of which the schematic contains a copy.
    """
    copy = "\n".join(symbol.splitlines()[1:-1]).replace(f'"{SUBCIRCUIT}"', f'"{NAME}:{SUBCIRCUIT}"', 1)
    parts = [f'(kicad_sch (version 20230121) (generator pyspice_runner)\n  (uuid {_ROOT})\n  (paper "A4")']
    source = _SOURCE.replace('"VSIN"', f'"{NAME}:VSIN"', 1)
    parts.append(f"  (lib_symbols\n{copy}\n{source}\n  )")
    parts += [_wire(number, *wire) for number, wire in enumerate(_KICAD_WIRES)]
    parts.append(f"  (junction (at 101.6 99.06) (diameter 0) (color 0 0 0 0) (uuid {_id('junction')}))")
    for name, (x, y) in {"a": (95.25, 76.2), "b": (106.68, 78.74), "shaft": (147.32, 76.2)}.items():
        parts.append(f'  (label "{name}" (at {x:g} {y:g} 0) {_FONT} (justify left bottom)) (uuid {_id(name)}))')
    parts.append(
        f'  (global_label "0" (shape input) (at 88.9 99.06 180) {_FONT} (justify right)) (uuid {_id("ground")}))'
    )
    parts.append(f"  (no_connect (at 147.32 76.2) (uuid {_id('open shaft')}))")
    notes = (
        _transient(), SWEEP, "V(/shaft): 1 V is 1 rad/s. -I(V1) in .ac: admittance of group A, B at 0 V.", f"{TESTED}.",
    )  # fmt: skip
    for number, note in enumerate(notes):
        parts.append(
            f'  (text "{note}" (at 88.9 {111.76 + 5.08 * number:g} 0) {_FONT} (justify left bottom)) '
            f"(uuid {_id(note)}))"
        )
    pins = " ".join(f"{number}={pin}" for number, pin in enumerate(MOTOR_PINS, start=1))
    fields = {
        "Sim.Device": "SUBCKT", "Sim.Library": f"{NAME}.lib", "Sim.Name": SUBCIRCUIT, "Sim.Pins": pins,
        "Sim.Params": editable_parameters(motor),
    }  # fmt: skip
    parts.append(_placed(f"{NAME}:{SUBCIRCUIT}", "X1", SUBCIRCUIT, (127.0, 76.2), fields, len(MOTOR_PINS)))
    for number, (name, tone) in enumerate(_tones(motor)):
        waveform = f"dc=0 ampl={tone.amplitude:g} f={tone.frequency:.6g} td=0 theta=0 phase={degrees(tone.phase):.6g}"
        waveform += " ac=1 ph=0" if number == 0 else ""
        fields = {"Sim.Device": "V", "Sim.Type": "SIN", "Sim.Params": waveform, "Sim.Pins": "1=+ 2=-"}
        parts.append(_placed(f"{NAME}:VSIN", name, "VSIN", (88.9 + 12.7 * number, 88.9), fields, 2))
    parts.append('  (sheet_instances (path "/" (page "1")))\n)')
    return "\n".join(parts) + "\n"


_KICAD_WIRES: tuple[tuple[Point, Point], ...] = (
    ((88.9, 83.82), (88.9, 76.2)), ((88.9, 76.2), (116.84, 76.2)),  # a
    ((101.6, 83.82), (101.6, 78.74)), ((101.6, 78.74), (116.84, 78.74)),  # b
    ((88.9, 93.98), (88.9, 99.06)), ((101.6, 93.98), (101.6, 99.06)),  # ground
    ((88.9, 99.06), (101.6, 99.06)), ((101.6, 99.06), (109.22, 99.06)),
    ((109.22, 99.06), (109.22, 81.28)), ((109.22, 81.28), (116.84, 81.28)),  # com
    ((137.16, 76.2), (147.32, 76.2)),  # shaft
)  # fmt: skip

_SOURCE = f"""\
  (symbol "VSIN" (pin_names (offset 0.254)) (in_bom yes) (on_board yes)
    (property "Reference" "V" (at 2.54 2.54 0) {_FONT}))
    (property "Value" "VSIN" (at 2.54 0 0) {_FONT}))
    (property "Footprint" "" (at 0 0 0) {_FONT} hide))
    (property "Datasheet" "" (at 0 0 0) {_FONT} hide))
    (symbol "VSIN_0_1"
      (circle (center 0 0) (radius 2.54) (stroke (width 0.254) (type default)) (fill (type background))))
    (symbol "VSIN_1_1"
      (pin passive line (at 0 5.08 270) (length 2.54)
        (name "+" {_FONT})) (number "1" {_FONT})))
      (pin passive line (at 0 -5.08 90) (length 2.54)
        (name "-" {_FONT})) (number "2" {_FONT})))
    )
  )"""


def _wire(number: int, start: Point, end: Point) -> str:
    points = " ".join(f"(xy {x:g} {y:g})" for x, y in (start, end))
    return f"  (wire (pts {points}) (stroke (width 0) (type default)) (uuid {_id(f'wire {number}')}))"


def _placed(library: str, reference: str, value: str, place: Point, fields: dict[str, str], pins: int) -> str:
    """Return a symbol on the sheet, with its simulation fields."""
    x, y = place
    shown = [("Reference", reference, y - 5.08, False), ("Value", value, y - 2.54 if pins == 2 else y + 11.43, False)]
    hidden = [(key, text, y, True) for key, text in {"Footprint": "", "Datasheet": "", **fields}.items()]
    lines = [f'  (symbol (lib_id "{library}") (at {x:g} {y:g} 0) (unit 1)']
    lines += ["    (in_bom no) (on_board no) (dnp no)", f"    (uuid {_id(reference)})"]
    lines += [
        f'    (property "{key}" "{text}" (at {x + 5.08:g} {height:g} 0) {_FONT}{" hide" if hide else ""}))'
        for key, text, height, hide in (*shown, *hidden)
    ]
    lines += [f'    (pin "{number}" (uuid {_id(f"{reference} {number}")}))' for number in range(1, pins + 1)]
    lines.append(f'    (instances (project "{NAME}" (path "/{_ROOT}" (reference "{reference}") (unit 1))))\n  )')
    return "\n".join(lines)


def _id(what: str) -> uuid.UUID:
    """Return an identifier that is the same whenever the file is written."""
    return uuid.uuid5(_ROOT, what)


if __name__ == "__main__":
    for written in write_examples(Path(sys.argv[1] if len(sys.argv) > 1 else "examples")):
        sys.stdout.write(f"{written}\n")
