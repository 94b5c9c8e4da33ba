# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact between tip and rotor: spring, slider and normal force, and the circuit of the paper's law."""

from __future__ import annotations

from pathlib import Path

import schemdraw.elements as elm
from diagram import CONTACT, MODE, ROTOR, Sheet
from style import main

CAPTION = (
    "1 V of slider, held, limit and delta is 1 µm, of normal, friction, fx and fy 1 N. At slip a current of 1 A "
    "is 1 m/s of relative velocity. The forces are drawn as they act on the rotor."
)


def mechanics(sheet: Sheet) -> None:
    """Draw the springs and the slider between tip and rotor."""
    sheet.solid((0.4, 6.0), (6.5, 0.9), ROTOR)
    sheet.note("rotor", (1.2, 6.45))
    sheet.arrow((4.6, 6.45), (6.2, 6.45), ROTOR)
    sheet.note("$R\\Omega$", (4.4, 6.45), ha="right")
    sheet.solid((0.8, 0.7), (5.2, 0.9), MODE)
    sheet.note("tip", (1.5, 1.15))
    sheet.arrow((6.1, 1.15), (7.1, 1.15))
    sheet.note("$x$", (6.7, 0.75))
    sheet.arrow((6.1, 1.15), (6.1, 2.15))
    sheet.note("$y$", (6.4, 1.95))
    sheet.spring((1.5, 1.6), (1.5, 6.0), CONTACT)
    sheet.note("$K_N\\,\\delta^{3/2}$", (1.85, 3.2), ha="left")
    sheet.solid((3.4, 1.6), (0.3, 4.0), MODE)
    sheet.spring((3.7, 5.2), (5.3, 5.2), CONTACT)
    sheet.note("$u$", (4.5, 4.6))
    sheet.solid((5.3, 4.8), (1.4, 1.2), CONTACT)
    sheet.note("slider", (6.0, 5.4))
    sheet.note("$|F_T| \\leq \\mu F_N$", (6.0, 4.25))
    sheet.arrow((0.7, 7.3), (0.7, 8.0), CONTACT)
    sheet.note("$F_N$", (0.95, 7.6), ha="left")
    sheet.arrow((2.6, 7.6), (3.9, 7.6), CONTACT)
    sheet.note("$F_T$", (4.05, 7.6), ha="left")


def circuit(sheet: Sheet) -> None:
    """Draw the subcircuits."""
    normal, law, line = "piezomotor_normal", "piezomotor_contact", 2.6
    west = dict(zip(("x", "y", "vx", "vy", "fx", "fy", "shaft"), (6.9, 6.2, 5.5, 4.8, 3.7, 3.0, 1.9), strict=True))
    east = {"normal": 7.2, "friction": 6.4, "factor": 5.2, "delta": 4.4, "slip": line}
    sheet.block((8.1, 0.2), (12.7, 7.7), CONTACT)
    sheet.note(law, (16.6, 8.3), fontweight="bold")
    sheet.box(normal, 8.8, 12.4, 1.2, 7.6, CONTACT, west=west, east=east)
    sheet.note(normal, (10.6, 0.7), fontweight="bold")
    for name, y in west.items():
        sheet.pin((7.7, y))
        ends = [(7.8, y), (8.8, y)]
        sheet.flow(*(reversed(ends) if name in ("fx", "fy", "shaft") else ends))
    sheet.note("geometry,\nHertz", (10.3, 4.0), linespacing=1.3)
    for name, y in (("normal", 7.2), ("friction", 6.4)):
        sheet.wire((12.4, y), (21.2, y))
        sheet.pin((21.3, y))
        sheet.node(law, name, (20.65, y - 0.3), ha="right", fontsize=7)
    # the slider
    sheet.wire((13.4, line), (15.0, line))
    sheet.note("$v_\\mathrm{rel}$", (13.0, line + 0.4))
    sheet.part(elm.Capacitor(), (15.0, line), (15.0, 0.8))
    sheet.note("1 µF", (14.7, 1.2), ha="right", fontsize=7)
    sheet.part(elm.Resistor(), (15.0, line), (17.6, line))
    sheet.part(elm.SourceControlledV().scale(0.8), (17.6, 0.8), (17.6, line))
    sheet.ground((15.0, 0.8), (17.6, 0.8))
    sheet.joint((15.0, line), (17.6, line))
    sheet.node(law, "slider", (14.9, line + 0.4), ha="center", fontsize=7)
    sheet.value(law, "slider_time", (16.3, line - 0.55))
    sheet.node(law, "held", (17.75, line - 0.3), ha="left", fontsize=7)
    sheet.note("± limit", (18.1, 1.2), ha="left", fontsize=7)
    # limit, friction, state
    for place, size in (((14.0, 4.0), (1.9, 0.8)), ((17.6, 4.4), (2.2, 1.2)), ((19.4, 0.8), (1.1, 0.8))):
        sheet.solid(place, size, CONTACT, "00")
    sheet.node(law, "limit", (14.95, 4.4), fontsize=7)
    sheet.note("$F_T(u)$", (18.7, 5.0))
    sheet.node(law, "state", (19.95, 1.2), fontsize=7)
    sheet.wire((20.5, 1.2), (21.2, 1.2))
    sheet.pin((21.3, 1.2))
    for points in (
        [(12.4, 4.4), (14.0, 4.4)],
        [(12.4, 5.2), (17.6, 5.2)],
        [(15.9, 4.6), (17.6, 4.6)],
        [(17.6, line), (18.7, line), (18.7, 4.4)],
        [(18.7, 5.6), (18.7, 6.4)],
        [(18.7, 6.4), (12.4, 6.4)],
        [(12.4, line), (13.4, line)],
    ):
        sheet.flow(*points)


def sheet() -> Sheet:
    """Return the diagram."""
    drawn = Sheet(8.6)
    mechanics(drawn)
    circuit(drawn)
    return drawn


def draw(folder: Path) -> list[str]:
    return sheet().write(folder / "diagram_contact.png", "The contact as spring and slider, and its circuit", CAPTION)


if __name__ == "__main__":
    main(draw, __doc__)
