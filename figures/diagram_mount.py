# SPDX-License-Identifier: GPL-3.0-or-later
"""The mount: a carrier on plate springs that press the stator on the rotor, and its circuit."""

from __future__ import annotations

from pathlib import Path

import schemdraw.elements as elm
from diagram import CONTACT, MODE, MOUNT, ROTOR, Sheet, carrier
from style import main

LIBRARY = "piezomotor_mount"
CAPTION = (
    "In the loop 1 V is 1 N and 1 A is 1 m/s; y and contact_y are in µm. At rest the contact pushes the tip back "
    "with the preload: fy = −preload, no current flows, and z = 0."
)


def mechanics(sheet: Sheet) -> None:
    """Draw the carrier with the stator, and the rotor."""
    top = carrier(sheet, 0.6, 0.6, 5.6)
    sheet.value(LIBRARY, "stiffness", (0.75, 0.05), ha="left")
    sheet.value(LIBRARY, "damping", (6.2, 0.05), ha="right")
    sheet.value(LIBRARY, "mass", (3.4, top - 0.25))
    sheet.arrow((2.02, 0.75), (2.02, 2.6), MOUNT)
    sheet.value(LIBRARY, "preload", (2.17, 1.7), ha="left")
    sheet.arrow((6.5, top - 0.6), (6.5, top + 0.5), MOUNT)
    sheet.note("$z$", (6.7, top), ha="left")
    for x in (1.0, 5.4):
        sheet.solid((x, top), (0.4, 0.9), MODE)
    sheet.solid((0.8, top + 0.9), (5.2, 0.5), MODE)
    sheet.note("stator", (3.4, top + 0.45))
    sheet.solid((3.1, top + 1.4), (0.6, 0.9), MODE)
    sheet.arrow((2.7, top + 1.4), (2.7, top + 2.3), MODE)
    sheet.note("$y$", (2.4, top + 1.9))
    sheet.solid((0.8, top + 2.3), (5.2, 0.5), ROTOR)
    sheet.note("rotor", (5.2, top + 2.55))
    sheet.arrow((4.1, top + 2.3), (4.1, top + 1.4), CONTACT)
    sheet.node(LIBRARY, "-fy", (4.25, top + 1.85), ha="left")


def circuit(sheet: Sheet) -> None:
    """Draw the loop of the carrier and the two sums."""
    loop = 4.9
    sheet.block((9.2, -1.1), (11.3, 7.3), MOUNT)
    sheet.note(LIBRARY, (14.85, 6.6), fontweight="bold")
    sheet.pin((8.6, loop))
    sheet.node(LIBRARY, "fy", (8.6, loop + 0.45))
    sheet.wire((8.7, loop), (9.4, loop))
    parts = (
        (elm.SourceV().scale(0.8), 9.4, 11.8, "preload"), (elm.Inductor2(), 12.6, 14.6, "mass"),
        (elm.Resistor(), 14.6, 16.6, "damping"), (elm.Capacitor(), 17.0, 19.4, "1/stiffness"),
    )  # fmt: skip
    for element, start, end, name in parts:
        sheet.part(element, (start, loop), (end, loop))
        sheet.value(LIBRARY, name, (0.5 * (start + end), loop - 0.75))
    sheet.flow((11.8, loop), (12.6, loop))
    sheet.note("$\\dot{z}$", (12.25, loop + 0.45))
    sheet.wire((16.6, loop), (17.0, loop))
    sheet.wire((19.4, loop), (19.8, loop), (19.8, loop - 0.2))
    sheet.ground((19.8, loop - 0.2))
    sheet.joint((11.6, loop), (16.8, loop))
    sheet.node(LIBRARY, "arm", (11.6, loop + 0.45), fontsize=7)
    sheet.node(LIBRARY, "elastic", (16.8, loop + 0.45), fontsize=7)
    for y, first, last, formula in (
        (2.6, "y", "contact_y", "$z = v(\\mathrm{elastic})$ / stiffness"), (1.2, "vy", "contact_vy", "$\\dot{z}$"),
    ):  # fmt: skip
        sheet.pin((8.6, y), (21.0, y))
        sheet.wire((8.7, y), (12.0, y))
        sheet.part(elm.SourceControlledV().scale(0.8), (12.0, y), (14.4, y))
        sheet.wire((14.4, y), (20.9, y))
        sheet.node(LIBRARY, first, (9.5, y + 0.35), ha="left")
        sheet.node(LIBRARY, last, (20.3, y + 0.35), ha="right")
        sheet.note(formula, (13.9, y + 0.4), ha="left")
    sheet.pin((21.0, -0.4))
    sheet.wire((19.4, -0.4), (20.9, -0.4))
    sheet.node(LIBRARY, "base", (20.3, -0.05), ha="right")
    sheet.note(
        "$\\ddot{z}$; draws the recoil of the modes, which acts on the loop", (19.2, -0.4), ha="right", fontsize=7.0
    )


def sheet() -> Sheet:
    """Return the diagram."""
    drawn = Sheet(8.2)
    drawn.axes.set_ylim(-1.3, 6.9)  # the pin of the recoil is below the ground of the mechanical drawing
    mechanics(drawn)
    circuit(drawn)
    return drawn


def draw(folder: Path) -> list[str]:
    return sheet().write(folder / "diagram_mount.png", "The mount and its circuit", CAPTION)


if __name__ == "__main__":
    main(draw, __doc__)
