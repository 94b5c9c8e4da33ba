# SPDX-License-Identifier: GPL-3.0-or-later
"""The example schematics hold the circuit that they show: taken out of the drawing, wire by wire, it runs.

The drawings are tested by parsers and by geometry; ``make kicad`` runs the last test here with KiCad itself.
"""

import re
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from tests.circuit.batch import batch, results
from tools.schematics import example_texts

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    from kiutils.schematic import Schematic

EXAMPLES = Path(__file__).parents[2] / "examples"
Point = tuple[float, float]

# the symbols' own pins: of LTspice's voltage, and of the motor as motor.asy states them
LTSPICE_VOLTAGE = {"+": (0.0, 16.0), "-": (0.0, 96.0)}


def nodes(wires: Iterable[tuple[Point, Point]], names: Mapping[Point, str], pins: Iterable[Point]) -> dict[Point, str]:
    """Which node each pin is on: what touches belongs together, and takes the name of its label."""
    groups: list[tuple[list[tuple[Point, Point]], set[Point]]] = []
    for wire in wires:
        touched = [group for group in groups if any(meet(wire, other) for other in group[0])]
        merged = ([wire, *(w for group in touched for w in group[0])], {*wire, *(p for g in touched for p in g[1])})
        groups = [group for group in groups if group not in touched] + [merged]
    found = {}
    for pin in pins:
        (group,) = [lines for lines, _ in groups if any(on(pin, wire) for wire in lines)]
        (found[pin],) = {name for place, name in names.items() if any(on(place, wire) for wire in group)}
    return found


def on(point: Point, wire: tuple[Point, Point]) -> bool:
    (x, y), ((x1, y1), (x2, y2)) = point, wire
    return min(x1, x2) <= x <= max(x1, x2) and min(y1, y2) <= y <= max(y1, y2)


def meet(first: tuple[Point, Point], second: tuple[Point, Point]) -> bool:
    """Wires are connected where one ends on the other; where they only cross, they are not."""
    return any(on(end, second) for end in first) or any(on(end, first) for end in second)


def from_ltspice(folder: Path) -> tuple[dict[str, list[str]], list[str]]:
    text = (folder / "motor_example.asc").read_text(encoding="utf-8")
    symbol = (folder / "motor.asy").read_text(encoding="utf-8")
    motor = [(float(x), float(y)) for x, y in re.findall(r"^PIN (\S+) (\S+)", symbol, re.M)]
    assert re.findall(r"SpiceOrder (\d+)", symbol) == ["1", "2", "3", "4"]
    wires = [
        ((float(a), float(b)), (float(c), float(d)))
        for a, b, c, d in re.findall(r"^WIRE (\S+) (\S+) (\S+) (\S+)", text, re.M)
    ]
    names = {(float(x), float(y)): name for x, y, name in re.findall(r"^FLAG (\S+) (\S+) (\S+)", text, re.M)}
    parts = {}
    placed = re.findall(r"^SYMBOL (\w+) (\S+) (\S+) R0\nSYMATTR InstName (\w+)(?:\nSYMATTR Value (.+))?", text, re.M)
    for kind, x, y, name, value in placed:
        own = motor if kind == "motor" else LTSPICE_VOLTAGE.values()
        pins = [(float(x) + dx, float(y) + dy) for dx, dy in own]
        at = nodes(wires, names, pins)
        model = value or re.search(r"^SYMATTR Value (\w+)", symbol, re.M)[1]  # type: ignore[index]
        line = re.search(r"^SYMATTR SpiceLine (.+)$", symbol, re.M)[1] if kind == "motor" else ""  # type: ignore[index]
        parts[name] = [*(at[pin] for pin in pins), model, *line.split()]
    return parts, re.findall(r"^TEXT .*!(.+)$", text, re.M)


def from_kicad(folder: Path) -> tuple[dict[str, list[str]], list[str]]:
    sheet = Schematic.from_file(str(folder / "motor.kicad_sch"))
    wires = [tuple((p.X, p.Y) for p in item.points) for item in sheet.graphicalItems if item.type == "wire"]
    labels = [*sheet.labels, *sheet.globalLabels]
    names = {(item.position.X, item.position.Y): item.text for item in labels}
    drawn = {symbol.libId: symbol for symbol in sheet.libSymbols}
    parts = {}
    for symbol in sheet.schematicSymbols:
        fields = {item.key: item.value for item in symbol.properties}
        own = {pin.number: pin.position for unit in drawn[symbol.libId].units for pin in unit.pins}
        place = symbol.position  # y points down on the sheet and up in a symbol
        order = [pair.split("=")[0] for pair in fields["Sim.Pins"].split()]
        pins = [(round(place.X + own[n].X, 6), round(place.Y - own[n].Y, 6)) for n in order]
        at = nodes(wires, names, pins)
        given = dict(re.findall(r"(\w+)=(\S+)", fields["Sim.Params"]))
        if fields["Sim.Device"] == "SUBCKT":
            model = [fields["Sim.Name"], *fields["Sim.Params"].split()]
        else:
            model = [f"SINE({' '.join(given[key] for key in ('dc', 'ampl', 'f', 'td', 'theta', 'phase'))})"]
        parts[fields["Reference"]] = [*(at[pin] for pin in pins), *model]
    return parts, [item.text for item in sheet.texts if item.text.startswith(".")]


@pytest.mark.parametrize("name", sorted(example_texts()))
def test_what_is_checked_in_is_fresh(name: str) -> None:
    assert (EXAMPLES / name).read_text(encoding="utf-8") == example_texts()[name], (
        "run: python -m tools.schematics examples"
    )


def test_both_drawings_show_the_same_circuit() -> None:
    ltspice, _ = from_ltspice(EXAMPLES / "ltspice")
    kicad, _ = from_kicad(EXAMPLES / "kicad")
    assert ltspice == kicad
    assert ltspice["X1"][:5] == ["a", "b", "0", "shaft", "piezomotor"]
    names = [word.partition("=")[0] for word in ltspice["X1"][5:]]
    assert names == ["preload", "friction", "normal_stiffness", "compliance", "radius", "inertia", "bearing"]
    assert [ltspice[name][:2] for name in ("V1", "V2")] == [["a", "0"], ["b", "0"]]


@pytest.mark.parametrize(("tool", "read"), [("ltspice", from_ltspice), ("kicad", from_kicad)])
def test_the_circuit_of_a_drawing_runs_as_simulate_does(tool: str, read: object, tmp_path: Path) -> None:
    parts, directives = read(EXAMPLES / tool)  # type: ignore[operator]
    lines = [f"* out of the drawing for {tool}", f".include {EXAMPLES / tool / 'motor.lib'}"]
    lines += [f"{name} {' '.join(words)}".replace("SINE(", "SIN(") for name, words in parts.items()]
    # LTspice's .tran 0 STOP has no print step; shortened, which does not change what is drawn
    lines += [re.sub(r"^\.tran \S+ 5m", ".tran 100n 500u", line) for line in directives]
    lines += [".save v(shaft)", ".measure tran speed_end FIND v(shaft) AT=499u", ".end"]
    speed = results(batch(tmp_path / "deck.cir", "\n".join(lines) + "\n"))["speed_end"]
    motor = pr.load_motor("bimodal40")
    drive = pr.default_drive(motor)
    run = pr.simulate(motor, drive, duration=0.5e-3)
    expected = float(np.interp(499e-6, run.time_s, run.rotor_speed_rad_s))
    # The exported motor keeps its own parameters, so that the trapezoidal rule at h = 100 ns lets it ring low by
    # (omega h)^2/12 = 5e-5; after 20 periods that changes the phase of the motion by 0.01. Twice that is allowed.
    assert speed == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("tool", "read"), [("ltspice", from_ltspice), ("kicad", from_kicad)])
def test_a_parameter_that_is_edited_on_the_drawing_changes_the_motor(tool: str, read: object, tmp_path: Path) -> None:
    parts, _ = read(EXAMPLES / tool)  # type: ignore[operator]
    motor = pr.load_motor("bimodal40")
    forces = []
    for preload in (motor.contact.preload_n, 4.0):
        x1 = " ".join(parts["X1"]).replace(f"preload={motor.contact.preload_n:g} ", f"preload={preload:g} ")
        lines = ["edited", f".include {EXAMPLES / tool / 'motor.lib'}", f"X1 {x1}"]
        lines += ["V1 a 0 SIN(0 1 40.7k)", "V2 b 0 SIN(0 1 40.7k)", ".tran 100n 20u 0 100n uic"]
        lines += [".measure tran normal FIND v(x1.normal) AT=50n", ".end"]
        forces.append(results(batch(tmp_path / "deck.cir", "\n".join(lines) + "\n"))["normal"])
    # the first step after rest: the normal force is the preload, with voltages that hardly move the tip
    assert forces == pytest.approx([motor.contact.preload_n, 4.0], rel=1e-3)
