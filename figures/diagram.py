# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of the circuit diagrams: elements of schemdraw, blocks, mechanical parts, and names of the subcircuits.

Coordinates are absolute, one unit is a third of an inch. A name in bold is a node of the subcircuit that is given with
it, one in regular type a parameter; ``tests/figures/test_diagrams.py`` looks each of them up in ``behavioral/``.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import schemdraw
import schemdraw.elements as elm
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Polygon, Rectangle
from style import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, WIDTH, canvas, write

UNIT = 1.0 / 3.0  # inches
COLUMNS = WIDTH / UNIT - 0.3  # units between the margins of a page
GROUP_A, GROUP_B, CONTACT, ROTOR, MOUNT = BLUE, ORANGE, VERMILION, GREEN, PURPLE
MODE = "#606060"
Point = tuple[float, float]


class Name(NamedTuple):
    """A label that stands for nodes or parameters of a subcircuit."""

    library: str
    words: str
    node: bool


class Sheet:
    """A diagram of page width and a height in units; (0, 0) is its lower left corner."""

    def __init__(self, height: float) -> None:
        self.figure, self.axes = canvas(1, 1, height * UNIT + 0.48)
        self.axes.set(xlim=(0.0, COLUMNS), ylim=(0.0, height), aspect="equal")
        self.axes.set_axis_off()
        self.drawing = schemdraw.Drawing(canvas=self.axes, show=False)
        self.drawing.config(lw=1.1)
        self.names: list[Name] = []

    def write(self, path: Path, title: str, caption: str) -> list[str]:
        """Write the picture and return the text to print."""
        self.drawing.draw(show=False)
        with mpl.rc_context({"savefig.dpi": 220}):
            write(self.figure, path, title, caption)
        return [f"{path.name}: {', '.join(sorted({name.library for name in self.names}))}"]

    # --- text ---

    def note(self, words: str, place: Point, **style: Any) -> None:
        """Write words that are no names."""
        self.axes.text(*place, words, **{"fontsize": 7.5, "ha": "center", "va": "center", "zorder": 6} | style)

    def node(self, library: str, words: str, place: Point, **style: Any) -> None:
        """Write names of nodes of a subcircuit."""
        self.names.append(Name(library, words, node=True))
        self.note(words, place, **{"family": "monospace", "weight": "bold"} | style)

    def value(self, library: str, words: str, place: Point, **style: Any) -> None:
        """Write names of parameters of a subcircuit."""
        self.names.append(Name(library, words, node=False))
        self.note(words, place, **{"family": "monospace", "fontsize": 7.0} | style)

    # --- circuit ---

    def part(self, element: elm.Element2Term, start: Point, end: Point) -> None:
        """Draw an element with two ends."""
        self.drawing += element.endpoints(start, end)

    def wire(self, *points: Point) -> None:
        """Draw a line through points."""
        for start, end in pairwise(points):
            self.part(elm.Line(), start, end)

    def flow(self, *points: Point) -> None:
        """Draw a line through points, with an arrowhead at its end."""
        self.wire(*points)
        before, end = np.array(points[-2:])
        self.arrow(tuple(end - 0.4 * (end - before) / np.hypot(*(end - before))), points[-1], width=1.1)

    def joint(self, *places: Point) -> None:
        """Draw connections of wires."""
        for place in places:
            self.drawing += elm.Dot(radius=0.075).at(place)

    def pin(self, *places: Point) -> None:
        """Draw terminals."""
        for place in places:
            self.drawing += elm.Dot(open=True, radius=0.1).at(place)

    def ground(self, *places: Point) -> None:
        """Draw node 0."""
        for place in places:
            self.drawing += elm.Ground().at(place).scale(0.6)

    def windings(self, left: float, right: float, top: float, bottom: float, dots: str) -> None:
        """Draw an ideal transformer in two columns; ``dots`` has t or b, the dotted end of the left and the right."""
        self.part(elm.Inductor2(loops=3), (left, top), (left, bottom))
        self.part(elm.Inductor2(loops=3), (right, bottom), (right, top))
        for x, end in ((left - 0.25, dots[0]), (right + 0.25, dots[1])):
            y = 0.5 * (top + bottom) + (0.7 if end == "t" else -0.7)
            self.axes.add_patch(Circle((x, y), 0.08, color=BLACK, zorder=5))

    def block(self, place: Point, size: Point, colour: str, **style: Any) -> None:
        """Draw a tinted box; ``place`` is its lower left corner."""
        look = {"fc": f"{colour}18", "ec": colour, "lw": 1.1, "zorder": 1} | style
        self.axes.add_patch(FancyBboxPatch(place, *size, boxstyle="round,pad=0,rounding_size=0.2", **look))

    def box(self, library: str, left: float, right: float, low: float, high: float, colour: str, **pins: Any) -> None:
        """Draw a subcircuit as a box; ``west``, ``east``, ``south``, ``north`` give pins and their places there."""
        self.block((left, low), (right - left, high - low), colour)
        for name, y in pins.get("west", {}).items():
            self.node(library, name, (left + 0.12, y), ha="left", fontsize=7)
        for name, y in pins.get("east", {}).items():
            self.node(library, name, (right - 0.12, y), ha="right", fontsize=7)
        for side, y in (("south", low + 0.28), ("north", high - 0.28)):
            for name, x in pins.get(side, {}).items():
                self.node(library, name, (x, y), fontsize=7)

    # --- mechanics ---

    def arrow(self, start: Point, end: Point, colour: str = BLACK, width: float = 1.3) -> None:
        """Draw an arrow."""
        shape = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0, "zorder": 5}
        self.axes.add_patch(FancyArrowPatch(start, end, color=colour, lw=width, **shape))

    def turn(self, centre: Point, radius: float, degrees: tuple[float, float], colour: str = BLACK) -> None:
        """Draw an arrow along a circle between two angles, counter-clockwise if the second is greater."""
        angles = np.radians(np.linspace(*degrees, 40))
        x, y = centre[0] + radius * np.cos(angles), centre[1] + radius * np.sin(angles)
        self.axes.plot(x[:-3], y[:-3], color=colour, lw=1.3, zorder=5)
        self.arrow((x[-6], y[-6]), (x[-1], y[-1]), colour)

    def solid(self, place: Point, size: Point, colour: str, tint: str = "40") -> None:
        """Draw a solid body; ``place`` is its lower left corner."""
        self.axes.add_patch(Rectangle(place, *size, fc=f"{colour}{tint}", ec=colour, lw=1.1, zorder=3))

    def disc(self, centre: Point, radius: float, colour: str) -> None:
        """Draw a wheel."""
        self.axes.add_patch(Circle(centre, radius, fc=f"{colour}30", ec=colour, lw=1.3, zorder=2))

    def triangle(self, top: Point, size: float = 0.35) -> None:
        """Draw a support under a point."""
        x, y = top
        corners = [(x, y), (x - 0.6 * size, y - size), (x + 0.6 * size, y - size)]
        self.axes.add_patch(Polygon(corners, fc="white", ec=MODE, lw=1.1, zorder=3))

    def base(self, left: float, right: float, y: float) -> None:
        """Draw the fixed frame of the machine under a line."""
        self.axes.plot([left, right], [y, y], color=BLACK, lw=1.3, zorder=4)
        for x in np.arange(left, right - 0.1, 0.3):
            self.axes.plot([x, x + 0.25], [y - 0.25, y], color=BLACK, lw=0.7, zorder=4)

    def spring(self, start: Point, end: Point, colour: str = BLACK) -> None:
        """Draw a spring between two points."""
        ends = np.array([start, end])
        along = ends[1] - ends[0]
        aside = 0.25 * np.array([-along[1], along[0]]) / np.hypot(*along)
        sides = np.array([0.0, 0.0, *[1.0, -1.0] * 5, 0.0, 0.0])
        line = ends[0] + np.linspace(0.0, 1.0, 14)[:, None] * along + sides[:, None] * aside
        self.axes.plot(*line.T, color=colour, lw=1.2, zorder=3)

    def dashpot(self, x: float, bottom: float, top: float, colour: str = BLACK) -> None:
        """Draw an upright damper."""
        middle = 0.5 * (bottom + top)
        for line in (
            [(x, bottom), (x, middle - 0.3)],
            [(x - 0.3, middle + 0.25), (x - 0.3, middle - 0.3), (x + 0.3, middle - 0.3), (x + 0.3, middle + 0.25)],
            [(x - 0.22, middle), (x + 0.22, middle)],
            [(x, middle), (x, top)],
        ):
            self.axes.plot(*zip(*line, strict=True), color=colour, lw=1.2, zorder=3)


def carrier(sheet: Sheet, left: float, bottom: float, width: float) -> float:
    """Draw the mount: carrier, plate springs, damper, preload and its displacement; return the height of its top."""
    top = bottom + 2.6
    sheet.base(left, left + width, bottom)
    for x in (left + 0.9, left + width - 2.3):
        sheet.spring((x, bottom), (x, top - 0.5), MOUNT)
    sheet.dashpot(left + width - 0.9, bottom, top - 0.5, MOUNT)
    sheet.solid((left, top - 0.5), (width, 0.5), MOUNT)
    return top


def rotor(sheet: Sheet, low: float, high: float, shaft: float) -> None:
    """Draw the rotor at the right edge, between two heights, under a line to the pin of the shaft."""
    library, middle, bus = "piezomotor_rotor", 21.05, high - 0.6
    sheet.block((19.9, low), (2.25, high - low), ROTOR)
    sheet.note("rotor", (middle, low + 0.4), fontweight="bold")
    sheet.wire((middle, shaft), (22.0, shaft))
    sheet.pin((22.05, shaft))
    sheet.node(library, "shaft", (middle + 0.1, shaft + 0.4), ha="left")
    sheet.wire((middle, shaft), (middle, bus))
    sheet.wire((20.4, bus), (21.65, bus))
    sheet.joint((middle, shaft), (middle, bus))
    for element, x, name, place in (
        (elm.Capacitor(), 20.4, "inertia", (20.65, bus - 2.35)), (elm.Resistor(), 21.65, "bearing", (21.4, bus - 2.75)),
    ):  # fmt: skip
        sheet.part(element, (x, bus), (x, bus - 1.7))
        sheet.ground((x, bus - 1.7))
        sheet.value(library, name, place)
