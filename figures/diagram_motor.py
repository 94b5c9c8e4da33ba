# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor and its equivalent circuit: stator, tip, rotor and mount, and the subcircuits that stand for them."""

from __future__ import annotations

from pathlib import Path

import schemdraw.elements as elm
from diagram import CONTACT, GROUP_A, GROUP_B, MODE, MOUNT, ROTOR, Sheet, carrier, rotor
from style import main

CAPTION = (
    "In the loops 1 V is 1 N and 1 A is 1 m/s, at the shaft 1 V is 1 rad/s and 1 A is 1 N·m; x and y are in µm. "
    "The couplings are the θ of docs/physics.md, tip_x and tip_y its X and Y. Forces are drawn as they act on the "
    "rotor, which positive friction turns forward; fx and fy act on the tip: a contact that pushes has fy < 0. "
    "Each clamped capacitance is a ladder of six branches."
)


def machine(sheet: Sheet) -> None:
    """Draw the motor from the side."""
    sheet.note("bold", (0.3, 13.3), ha="left", family="monospace", weight="bold")
    sheet.note("node of a subcircuit", (2.0, 13.3), ha="left")
    sheet.note("plain", (0.3, 12.75), ha="left", family="monospace", fontsize=7)
    sheet.note("its parameter", (2.0, 12.75), ha="left")
    middle, top = 3.75, carrier(sheet, 0.6, 0.7, 6.3)
    sheet.arrow((2.6, 0.85), (2.6, 2.7), MOUNT)
    sheet.note("$F_0$", (2.8, 2.0), ha="left")
    sheet.value("piezomotor_mount", "preload", (2.8, 1.4), ha="left")
    sheet.arrow((7.15, 2.9), (7.15, 4.0), MOUNT)
    sheet.note("$z$", (7.35, 3.5), ha="left")
    beam = top + 1.1
    for x in (1.0, 6.5):
        sheet.triangle((x, beam), 0.4)
        sheet.solid((x - 0.2, top), (0.4, beam - top - 0.4), MODE)
    sheet.solid((0.75, beam), (6.0, 0.65), MODE)
    for x, colour, group in ((1.3, GROUP_A, "a"), (4.6, GROUP_B, "b")):
        for y in (beam - 0.3, beam + 0.65):
            sheet.solid((x, y), (1.6, 0.3), colour, "90")
        sheet.note(f"group {group.upper()}", (x + 0.8, beam + 1.35))
        side = 0.25 if group == "a" else 7.25
        edge = x if group == "a" else x + 1.6
        for y in (beam - 0.15, beam + 0.8):
            sheet.wire((edge, y), (side, y))
        sheet.wire((side, beam - 0.15), (side, beam + 0.8))
        sheet.pin((side, beam + 1.5))
        sheet.wire((side, beam + 0.8), (side, beam + 1.4))
        sheet.joint((side, beam + 0.8))
        sheet.node("piezomotor_mode", group, (side, beam + 1.95))
    sheet.node("piezomotor_mode", "com", (middle, beam + 0.3))
    tip = beam + 0.65
    sheet.solid((middle - 0.25, tip), (0.5, 0.7), MODE)
    sheet.solid((middle - 0.55, tip + 0.7), (1.1, 0.8), MODE)
    sheet.note("tip", (middle, tip + 1.1))
    radius, contact = 1.75, tip + 1.5
    axis = (middle, contact + radius)
    sheet.disc(axis, radius, ROTOR)
    sheet.joint((middle, contact))
    sheet.arrow((middle + 0.1, contact), (middle + 1.5, contact), CONTACT)
    sheet.note("$x, F_T$", (middle + 1.6, contact), ha="left")
    sheet.arrow((middle, contact + 0.1), (middle, contact + 1.1), CONTACT)
    sheet.note("$y, F_N$", (middle + 0.15, contact + 0.75), ha="left")
    sheet.turn(axis, 2.1, (25.0, 95.0), ROTOR)
    sheet.note("$\\Omega$", (axis[0] + 1.9, axis[1] + 1.5))
    sheet.node("piezomotor_rotor", "shaft", (axis[0], axis[1] + 0.45))
    sheet.turn(axis, 2.1, (165.0, 105.0), ROTOR)
    sheet.note("$\\tau_\\mathrm{load}$", (axis[0] - 2.1, axis[1] + 1.5))
    sheet.wire((axis[0] - 0.2, axis[1]), (axis[0] + 0.2, axis[1]))
    sheet.wire((axis[0], axis[1] - 0.2), (axis[0], axis[1] + 0.2))


def circuit(sheet: Sheet) -> None:
    """Draw the equivalent circuit."""
    group, mode = "piezomotor_group", "piezomotor_mode"
    top, middle, bottom = 13.0, 10.0, 7.0  # of the electrical lines a, com, b, and of fx, node 0, fy
    left, first, second, third, fourth = 8.1, 10.7, 11.8, 17.5, 18.6  # pins and columns of windings
    for y, name in ((top, "a"), (middle, "com"), (bottom, "b")):
        sheet.pin((left, y))
        sheet.wire((left + 0.1, y), (first, y))
        sheet.node(mode, name, (left, y + 0.45))
    for y, colour in ((top, GROUP_A), (bottom, GROUP_B)):
        plate = middle + 0.45 * (y - middle)
        sheet.block((8.5, min(y, middle) + 0.15), (1.55, 2.7), colour)
        sheet.part(elm.Resistor().scale(0.8), (8.95, y), (8.95, plate))
        sheet.part(elm.Capacitor(), (8.95, plate), (8.95, middle))
        sheet.joint((8.95, y), (8.95, plate), (8.95, middle))
        sheet.node(group, "plate", (9.08, plate), ha="left", fontsize=7)
        sheet.note("6 ×", (9.3, 0.5 * (y + plate)), ha="left", fontsize=7)
    sheet.joint((first, middle))

    sheet.block((10.2, bottom - 0.55), (8.9, 7.3), MODE)
    for columns, ends, dots, ratio, x, side in (
        ((first, second), (top, middle), "tt", "1:coupling_a", second + 0.4, "left"),
        ((first, second), (middle, bottom), "bt", "1:coupling_b", second + 0.4, "left"),
        ((third, fourth), (top, middle), "bt", "tip_x:1", third - 0.4, "right"),
        ((third, fourth), (middle, bottom), "bb", "tip_y:1", third - 0.4, "right"),
    ):
        sheet.windings(*columns, *ends, dots)
        sheet.value("piezomotor_tip" if ratio.startswith("tip") else mode, ratio, (x, 0.5 * sum(ends)), ha=side)
    arm(sheet, mode, (second, third), top, (12.0, 13.75, 15.5, 17.3))
    sheet.node(mode, "elastic", (15.5, top + 0.4), fontsize=7)
    sheet.flow((third, bottom), (14.3, bottom))
    sheet.wire((14.3, bottom), (second, bottom))
    sheet.note("1 A = 1 m/s", (14.65, bottom + 0.4), fontsize=7)
    sheet.note("1 V = 1 N", (14.65, middle - 0.3), fontsize=7)
    sheet.note("mode 1", (14.65, middle + 0.3), fontweight="bold")
    sheet.block((10.2, 4.5), (8.9, 1.4), MODE)
    sheet.note("mode 2 and further modes:\nthe same circuit, in parallel", (14.1, 5.2), linespacing=1.3)
    sheet.node(mode, "a\ncom\nb", (10.4, 5.2), ha="left", linespacing=1.1)
    sheet.node("piezomotor_tip", "fx vx x\nfy vy y", (18.9, 5.35), ha="right", linespacing=1.4)
    sheet.node(mode, "base", (18.9, 4.75), ha="right")

    contact(sheet, (fourth, top), middle, bottom)
    mount(sheet, bottom)
    sheet.wire((21.05, bottom - 0.55), (21.05, 5.6))
    rotor(sheet, 0.7, 5.0, 5.6)


def arm(sheet: Sheet, library: str, ends: tuple[float, float], y: float, places: tuple[float, ...]) -> None:
    """Draw mass, damping and spring of a loop from one end to the other, between the given places."""
    parts = ((elm.Inductor2(), "mass"), (elm.Resistor(), "damping"), (elm.Capacitor(), "1/stiffness"))
    for (element, name), start, end in zip(parts, places, places[1:], strict=False):
        sheet.part(element, (start, y), (end, y))
        sheet.value(library, name, (0.5 * (start + end), y - 0.6))
    sheet.wire((ends[0], y), (places[0], y))
    sheet.wire((places[-1], y), (ends[1], y))
    sheet.joint((places[2], y))


def contact(sheet: Sheet, corner: tuple[float, float], middle: float, bottom: float) -> None:
    """Draw the contact between the lines fx, fy and the shaft."""
    library, edge, (x, top) = "piezomotor_contact", 20.0, corner
    sheet.block((edge, bottom - 0.55), (2.1, 7.3), CONTACT)
    for y in (top, bottom):
        sheet.flow((edge, y), (edge - 0.85, y))
    sheet.wire((edge - 0.85, top), (x, top))
    sheet.wire((edge - 0.85, bottom), (x, bottom))
    for names, y, edge_of in (("fx\nvx\nx", top + 0.2, "top"), ("vy\ny\nfy", bottom - 0.2, "bottom")):
        sheet.node(library, names, (edge + 0.2, y), ha="left", va=edge_of, linespacing=1.4)
    sheet.wire((x, middle), (19.45, middle), (19.45, middle - 0.2))
    sheet.joint((x, middle))
    sheet.ground((19.45, middle - 0.2))
    sheet.node(library, "shaft", (21.95, bottom - 0.25), ha="right", fontsize=7)
    sheet.note("contact", (21.05, 11.1), fontweight="bold")
    sheet.note("$F_N(\\delta)$, $F_T(u)$", (21.05, 10.5))
    sheet.node(library, "normal\nfriction\nslider\nstate", (21.95, 9.1), ha="right", linespacing=1.4, fontsize=7)


def mount(sheet: Sheet, bottom: float) -> None:
    """Draw the mount between the line fy and node 0."""
    library, y = "piezomotor_mount", 1.9
    sheet.block((8.5, 0.7), (10.6, 3.1), MOUNT)
    sheet.joint((19.5, bottom))
    sheet.flow((19.5, bottom), (19.5, 2.7))
    sheet.wire((19.5, 2.7), (19.5, y), (18.8, y))
    sheet.part(elm.SourceV().scale(0.8), (18.8, y), (16.4, y))
    sheet.value(library, "preload", (17.6, y - 0.85))
    arm(sheet, library, (16.4, 9.4), y, (16.0, 14.2, 12.2, 10.2))
    sheet.wire((9.4, y), (9.2, y), (9.2, y - 0.2))
    sheet.ground((9.2, y - 0.2))
    sheet.note("mount", (17.6, 3.3), fontweight="bold")
    sheet.node(library, "contact_y", (8.8, 3.3), ha="left")
    sheet.note("$= y + z$,", (10.75, 3.3), ha="left")
    sheet.node(library, "contact_vy", (12.1, 3.3), ha="left")
    sheet.note("$= v_y + \\dot{z}$", (14.15, 3.3), ha="left")


def sheet() -> Sheet:
    """Return the diagram."""
    drawn = Sheet(14.0)
    machine(drawn)
    circuit(drawn)
    return drawn


def draw(folder: Path) -> list[str]:
    return sheet().write(folder / "diagram_motor.png", "The motor and its equivalent circuit", CAPTION)


if __name__ == "__main__":
    main(draw, __doc__)
