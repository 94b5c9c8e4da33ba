# SPDX-License-Identifier: GPL-3.0-or-later
"""Schematic symbols for a library: LTspice ``.asy`` and KiCad ``.kicad_sym``.

``make kicad`` opens, checks and exports the example with KiCad 9. LTspice itself is not tested: a test reads its
files with a parser of the format, and the files state this.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from pyspice_runner.errors import ParameterError

UNTESTED = "Untested: written by piezomotor and checked by a parser, never opened in LTspice"
TESTED = "Tested with KiCad 9"


Pins = Mapping[str, Literal["left", "right"]]  # name of a pin in the subcircuit → its side of the box

MOTOR_PINS: Pins = {"a": "left", "b": "left", "com": "left", "shaft": "right"}
THERMAL_PINS: Pins = {"temperature": "right", "heat": "right"}
RESONATOR_PINS: Pins = {"p": "left", "n": "right"}


def ltspice_symbol(name: str, pins: Pins, library: str, title: str, parameters: str = "") -> str:
    """Return an LTspice symbol of ``.subckt NAME``, whose library is beside the schematic, its pins in their order.

    ``parameters`` of the X line, such as ``preload=5 friction=0.3``, can be edited on the schematic.
    """
    title = ascii_line(title, '"\\').rstrip(". ")
    rows = _rows(pins)
    bottom = 32 * max(rows) + 32
    usage = f"Use: put {library} beside the schematic, place X, and plot I(X1:{next(iter(pins))})"
    lines = [
        "Version 4",
        "SymbolType CELL",
        f"RECTANGLE Normal -64 -32 64 {bottom}",
        "WINDOW 0 0 -40 Bottom 2",
        f"WINDOW 3 0 {bottom + 8} Top 2",
        f"SYMATTR Value {name}",
        "SYMATTR Prefix X",
        f"SYMATTR ModelFile {library}",
        *([f"SYMATTR SpiceLine {parameters}"] if parameters else []),
        f"SYMATTR Description {title}. {usage}. {UNTESTED}.",
    ]
    for order, ((pin, side), row) in enumerate(zip(pins.items(), rows, strict=True), start=1):
        x = -64 if side == "left" else 64
        lines += [f"PIN {x} {32 * row} {side.upper()} 8", f"PINATTR PinName {pin}", f"PINATTR SpiceOrder {order}"]
    return "\n".join(lines) + "\n"


def kicad_symbol(name: str, pins: Pins, library: str, title: str, parameters: str = "") -> str:
    """Return a KiCad symbol library (format of KiCad 7, which later versions read) with its simulation fields.

    ``parameters`` are those of :func:`ltspice_symbol`.
    """
    title = ascii_line(title, '"\\').rstrip(". ")
    rows = _rows(pins)
    bottom = -2.54 * (max(rows) + 1)
    fields = [
        ("Reference", "X", 3.81, False),
        ("Value", name, bottom - 1.27, False),
        ("Footprint", "", 0.0, True),
        ("Datasheet", "", 0.0, True),
        ("Sim.Device", "SUBCKT", 0.0, True),
        ("Sim.Library", library, 0.0, True),
        ("Sim.Name", name, 0.0, True),
        ("Sim.Pins", " ".join(f"{number}={pin}" for number, pin in enumerate(pins, start=1)), 0.0, True),
        *([("Sim.Params", parameters, 0.0, True)] if parameters else []),
        ("ki_description", f"{title}. {TESTED}.", 0.0, True),
        ("Usage", f"Put {library} beside the schematic; Inspect, Simulator runs it.", 0.0, True),
    ]
    font = "(effects (font (size 1.27 1.27))"
    lines = [
        "(kicad_symbol_lib (version 20220914) (generator pyspice_runner)",
        f'  (symbol "{name}" (pin_names (offset 1.016)) (in_bom no) (on_board no)',
        *(
            f'    (property "{key}" "{value}" (at 0 {y:g} 0) {font}{" hide" if hidden else ""}))'
            for key, value, y, hidden in fields
        ),
        f'    (symbol "{name}_0_1"',
        f"      (rectangle (start -7.62 2.54) (end 7.62 {bottom:g})",
        "        (stroke (width 0.254) (type default)) (fill (type background))))",
        f'    (symbol "{name}_1_1"',
    ]
    for number, ((pin, side), row) in enumerate(zip(pins.items(), rows, strict=True), start=1):
        x, angle = (-10.16, 0) if side == "left" else (10.16, 180)
        lines += [
            f"      (pin passive line (at {x:g} {0.0 - 2.54 * row:g} {angle}) (length 2.54)",
            f'        (name "{pin}" {font})) (number "{number}" {font})))',
        ]
    return "\n".join([*lines, "    )", "  )", ")"]) + "\n"


def _rows(pins: Pins) -> list[int]:
    """Return the row of every pin, counted on each side from the top."""
    sides = list(pins.values())
    return [sides[:place].count(side) for place, side in enumerate(sides)]


def library_name(file: Path) -> str:
    """Return the name of the library in the folder of a symbol's file.

    Raise ParameterError for a name with characters that end a text of the format.
    """
    if not file.stem.isprintable() or set(file.stem) & set('"\\'):
        raise ParameterError(
            f"A symbol names the .lib beside it, and cannot name {file.stem!r}; "
            "choose a name without quotes, backslashes and control characters."
        )
    return f"{file.stem}.lib"


def ascii_line(text: str, without: str = "") -> str:
    """Return a text as one line of ASCII, at most 150 characters, for a comment; some characters become ``_``."""
    return "".join(sign if " " <= sign <= "~" and sign not in without else "_" for sign in text)[:150]
