# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole chain: oscillator, power stages, matching networks, motor and load, and the loop of the tracker."""

from __future__ import annotations

from pathlib import Path

import schemdraw.elements as elm
from diagram import CONTACT, GROUP_A, GROUP_B, MODE, MOUNT, ROTOR, Sheet
from style import main

LINE_A, LINE_B, LOOP = 7.1, 4.3, 1.9  # heights of the two channels and of the loop filter
UPPER, BETWEEN, LOWER = 8.8, 5.2, 3.4  # edges of the blocks
CAPTION = (
    "The names are pins and parameters of the subcircuits in behavioral/. An amplifier or a full bridge with a "
    "transformer can take the place of the half bridge, an inductor or nothing that of the LLCC network, and "
    "tracker_observer that of detector and filter."
)


def oscillator(sheet: Sheet) -> None:
    """Draw oscillator and phases."""
    sheet.box(
        "tracker_oscillator", 0.2, 2.9, LOWER, UPPER, MODE,
        east={"sine": LINE_A, "cosine": LINE_B}, south={"control": 1.55}, north={"tuned": 1.55},
    )  # fmt: skip
    sheet.part(elm.SourceSin(), (1.15, 4.8), (1.15, 6.6))
    sheet.box(
        "tracker_phases", 3.8, 6.3, LOWER, UPPER, MODE,
        west={"sine": LINE_A, "cosine": LINE_B}, east={"a": LINE_A, "b": LINE_B}, south={"com": 5.05},
    )  # fmt: skip
    sheet.value("tracker_phases", "phase_deg", (5.05, 0.5 * (LINE_A + LINE_B)))
    for x, words in ((1.55, "oscillator"), (5.05, "phases"), (8.7, "power stage"), (12.95, "matching network")):
        sheet.note(words, (x, UPPER + 0.35), fontweight="bold")


def channels(sheet: Sheet) -> None:
    """Draw power stage and network of both groups."""
    stage, network = "driver_half_bridge", "driver_llcc"
    for line, low, high, colour in ((LINE_A, BETWEEN, UPPER, GROUP_A), (LINE_B, LOWER, BETWEEN - 0.3, GROUP_B)):
        for start, end in ((2.9, 3.8), (6.3, 7.2), (10.2, 11.1), (14.8, 15.7), (17.8, 18.7)):
            sheet.flow((start, line), (end, line))
        aside = 0.5 if line == LINE_A else 0.0
        own = {"north": {"vp": 9.45}, "south": {"com": 7.75, "vn": 9.45}} if line == LINE_A else {}
        sheet.box(stage, 7.2, 10.2, low, high, colour, west={"in": line + aside}, east={"out": line + aside}, **own)
        sheet.box(network, 11.1, 14.8, low, high, colour, west={"in": line + aside}, east={"out": line + aside})
    for x in (8.7, 12.95):
        sheet.note("as for group A", (x, LOWER + 0.35))
    # the half bridge
    for drain in (LINE_A + 1.0, LINE_A):
        sheet.drawing += elm.NMos().scale(0.6).at((9.0, drain)).anchor("drain")
        sheet.wire((8.3, drain - 0.7), (8.5, drain - 0.7))
    sheet.solid((7.85, LINE_A - 1.0), (0.45, 1.7), GROUP_A, "00")
    sheet.note("gate drive", (8.08, LINE_A - 0.15), rotation=90, fontsize=7)
    sheet.wire((7.2, LINE_A), (7.85, LINE_A))
    sheet.wire((9.0, LINE_A), (10.2, LINE_A))
    sheet.wire((9.0, LINE_A + 1.0), (9.0, UPPER))
    sheet.wire((9.0, LINE_A - 1.0), (9.0, BETWEEN))
    sheet.joint((9.0, LINE_A))
    # the network
    sheet.part(elm.Inductor2(), (11.1, LINE_A), (12.9, LINE_A))
    sheet.part(elm.Capacitor(), (12.7, LINE_A), (13.3, LINE_A))
    sheet.wire((13.3, LINE_A), (14.8, LINE_A))
    sheet.part(elm.Inductor2(), (13.4, LINE_A), (13.4, BETWEEN + 0.5))
    sheet.part(elm.Capacitor(), (14.2, LINE_A), (14.2, BETWEEN + 0.5))
    sheet.wire((11.9, BETWEEN + 0.5), (14.2, BETWEEN + 0.5))
    sheet.joint((13.4, LINE_A), (14.2, LINE_A), (13.4, BETWEEN + 0.5))
    sheet.node(network, "com", (11.8, BETWEEN + 0.5), ha="right", fontsize=7)


def motor(sheet: Sheet) -> None:
    """Draw sensing, motor and load."""
    sheet.box(
        "tracker_sense", 15.7, 17.8, 0.5, UPPER, MOUNT,
        west={"line_a": LINE_A, "line_b": LINE_B, "motional": LOOP + 0.6, "force": LOOP, "ahead": LOOP - 0.6,
              "power": 0.8},
        east={"a": LINE_A, "b": LINE_B, "com": 5.7, "temperature": 3.2},
    )  # fmt: skip
    sheet.wire((17.8, 3.2), (18.25, 3.2))
    sheet.ground((18.25, 3.2))
    sheet.note("sensing", (16.75, UPPER + 0.35), fontweight="bold")
    sheet.box("piezomotor_mode", 18.7, 20.6, LOWER, UPPER, CONTACT, west={"a": LINE_A, "com": 5.7, "b": LINE_B})
    sheet.note("motor", (19.65, UPPER + 0.35), fontweight="bold")
    sheet.wire((17.8, 5.7), (18.7, 5.7))
    sheet.joint((18.25, 5.7))
    sheet.ground((18.25, 5.7))
    sheet.node("piezomotor_rotor", "shaft", (20.5, 5.7), ha="right", fontsize=7)
    sheet.wire((20.6, 5.7), (21.5, 5.7))
    sheet.part(elm.SourceI().scale(0.8), (21.5, 5.7), (21.5, 3.7))
    sheet.ground((21.5, 3.7))
    sheet.block((20.95, 2.2), (1.1, 4.0), ROTOR)
    sheet.note("load", (21.5, 2.6), fontweight="bold")


def loop(sheet: Sheet) -> None:
    """Draw detector and filter of the phase-locked loop."""
    sheet.box(
        "tracker_detector", 10.2, 14.0, 0.5, 2.9, MOUNT,
        east={"motional": LOOP + 0.6, "force": LOOP, "ahead": LOOP - 0.6}, west={"out": LOOP}, south={"target": 12.1},
    )  # fmt: skip
    sheet.note("detector", (10.35, 2.55), fontweight="bold", ha="left")
    for y in (LOOP + 0.6, LOOP, LOOP - 0.6):
        sheet.flow((15.7, y), (14.0, y))
    sheet.box("tracker_filter", 3.6, 9.0, 0.1, 2.9, MOUNT, east={"in": LOOP + 0.35})
    sheet.note("filter", (3.75, 2.5), fontweight="bold", ha="left")
    sheet.value("tracker_filter", "ripple", (4.7, 1.2), ha="left")
    sheet.value("tracker_filter", "resistance", (6.7, 1.45), ha="left")
    sheet.value("tracker_filter", "capacitance", (6.7, 0.9), ha="left")
    sheet.part(elm.Capacitor(), (4.3, LOOP), (4.3, 0.6))
    sheet.part(elm.Resistor().scale(0.6), (6.3, LOOP), (6.3, 1.15))
    sheet.part(elm.Capacitor(), (6.3, 1.15), (6.3, 0.6))
    sheet.ground((4.3, 0.6), (6.3, 0.6))
    sheet.joint((4.3, LOOP), (6.3, LOOP))
    sheet.flow((10.2, LOOP), (9.0, LOOP))
    sheet.flow((9.0, LOOP), (1.55, LOOP), (1.55, LOWER))


def sheet() -> Sheet:
    """Return the diagram."""
    drawn = Sheet(9.5)
    oscillator(drawn)
    channels(drawn)
    motor(drawn)
    loop(drawn)
    return drawn


def draw(folder: Path) -> list[str]:
    return sheet().write(folder / "diagram_drive.png", "From the tracker to the load", CAPTION)


if __name__ == "__main__":
    main(draw, __doc__)
