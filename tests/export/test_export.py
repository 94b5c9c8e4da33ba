# SPDX-License-Identifier: GPL-3.0-or-later
"""Files for other programs.

ngspice runs the libraries and scikit-rf reads Touchstone. LTspice's and KiCad's files go through parsers of their
formats, since neither program runs here.
"""

import re
from math import atan, pi
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.cli import run
from pyspice_runner.export.circuit import CircuitExport, circuit_library, touchstone
from pyspice_runner.export.motor import FORMATS, endings
from pyspice_runner.motor.circuit_file import load_circuit
from pyspice_runner.motor.stator import CAPACITANCE_AT
from pyspice_runner.run.window import Window
from pyspice_runner.spice.ngspice import run_deck
from tests.circuit.batch import batch, measured
from tests.resonators import fitted, resonator, spectrum, values
from tests.said import output, printed

CIRCUIT = resonator([20e3, 33e3], [120.0, 300.0], [0.05, 0.02])
DECK = """an exported motor, both groups driven by unequal voltages
.include m.lib
VA a 0 DC 0 AC 0.5
VB b 0 DC 0 AC 1
XMOTOR a b 0 shaft piezomotor {values}
.options reltol=1e-6 vntol=1e-12 abstol=1e-12
.control
set numdgt=12
set wr_singlescale
ac lin 451 15k 60k
wrdata out.txt real(i(va)) imag(i(va)) real(i(vb)) imag(i(vb))
quit 0
.endc
.end
"""
# what stands behind a word in an .asy file, by the listing of the format: the number of integers
ASY = {
    "Version": 1, "RECTANGLE Normal": 4, "LINE Normal": 4, "WINDOW": 3, "PIN": 2, "PINATTR SpiceOrder": 1,
}  # fmt: skip


def asy(text: str) -> tuple[dict[str, str], list[tuple[str, int, int, str]]]:
    """Parse an LTspice symbol: its attributes, and its pins as name, order, x, side."""
    lines = text.splitlines()
    assert lines[0] == "Version 4"
    assert lines[1] in ("SymbolType CELL", "SymbolType BLOCK")
    attributes: dict[str, str] = {}
    pins: list[tuple[str, int, int, str]] = []
    for line in lines[2:]:
        word, _, rest = line.partition(" ")
        if word == "SYMATTR":
            key, _, attributes[key] = rest.partition(" ")
        elif word == "PIN":
            x, _, side, offset = rest.split()
            assert int(x) % 16 == int(rest.split()[1]) % 16 == 0, "pins stand on LTspice's grid"
            assert side in ("LEFT", "RIGHT", "TOP", "BOTTOM", "NONE")
            pins.append(("", int(offset), int(x), side))
        elif word == "PINATTR":
            key, _, value = rest.partition(" ")
            name, order, x, side = pins[-1]
            pins[-1] = (value, order, x, side) if key == "PinName" else (name, int(value), x, side)
        else:
            match = next(kind for kind in ASY if line.startswith(f"{kind} "))
            numbers = re.findall(r"(?<= )-?\d+(?= |$)", line)
            assert len(numbers) >= ASY[match], line
    return attributes, pins


@pytest.mark.parametrize(
    ("kind", "name", "pins"), [("motor", "piezomotor", ["a", "b", "com", "shaft"]), ("fit", "resonator", ["p", "n"])]
)
def test_symbols_name_the_library_and_its_pins_in_order(
    kind: str, name: str, pins: list[str], motor: pr.Motor, tmp_path: Path
) -> None:
    from kiutils.symbol import SymbolLib  # reads and checks KiCad's format

    files = [tmp_path / f"stator{ending}" for ending in (".lib", ".asy", ".kicad_sym")]
    for file in files:
        assert (pr.export_motor(motor, file) if kind == "motor" else CircuitExport(CIRCUIT).save(file)) == file
    library, ltspice, kicad = (file.read_text(encoding="ascii") for file in files)
    (declared,) = re.findall(rf"^\.subckt {name} (.+)$", library, re.M)
    assert [word for word in declared.split() if "=" not in word] == pins

    attributes, found = asy(ltspice)
    assert (attributes["Prefix"], attributes["Value"], attributes["ModelFile"]) == ("X", name, "stator.lib")
    assert [pin[:2] for pin in found] == [(pin, order) for order, pin in enumerate(pins, start=1)]
    settings, defaults = (
        {key: float(value) for key, value in re.findall(r"(\w+)=(\S+)", text)}
        for text in (attributes.get("SpiceLine", ""), declared)
    )
    assert settings.items() <= defaults.items()
    assert ({"preload", "friction", "inertia"} <= set(settings)) is (kind == "motor")
    assert "Untested" in attributes["Description"]
    assert "Use:" in attributes["Description"]

    (symbol,) = SymbolLib.from_file(str(files[2])).symbols
    fields = {item.key: item.value for item in symbol.properties}
    assert symbol.entryName == name
    assert (fields["Sim.Device"], fields["Sim.Library"], fields["Sim.Name"]) == ("SUBCKT", "stator.lib", name)
    assert fields.get("Sim.Params", "") == attributes.get("SpiceLine", "")
    assert fields["Sim.Pins"] == " ".join(f"{number}={pin}" for number, pin in enumerate(pins, start=1))
    drawn = [pin for unit in symbol.units for pin in unit.pins]
    assert [(pin.name, pin.number) for pin in drawn] == [(pin, str(order)) for order, pin in enumerate(pins, start=1)]
    assert "Tested with KiCad 9" in fields["ki_description"]
    assert "beside the schematic" in fields["Usage"]
    assert kicad.count("(") == kicad.count(")")


def test_a_circuit_is_read_back_without_loss(tmp_path: Path) -> None:
    assert load_circuit(CircuitExport(CIRCUIT).save(tmp_path / "c.toml")) == CIRCUIT
    fit = fitted(spectrum(CIRCUIT, np.linspace(15e3, 40e3, 401)), 2)
    for ending in (".json", ".toml"):
        assert load_circuit(fit.save(tmp_path / f"fit{ending}")) == fit.circuit


def test_touchstone_has_the_admittance(motor: pr.Motor, tmp_path: Path) -> None:
    import skrf

    one = skrf.Network(str(CircuitExport(CIRCUIT).save(tmp_path / "c.s1p")))
    assert one.y[:, 0, 0] == pytest.approx(CIRCUIT.admittance(one.f), rel=1e-9)
    assert one.f[0] < 20e3 < 33e3 < one.f[-1]
    again = fitted(pr.read_spectrum(tmp_path / "c.s1p"))
    assert values(again.circuit) == pytest.approx(values(CIRCUIT), rel=1e-6)

    two = pr.read_spectrum(pr.export_motor(motor, tmp_path / "m.s2p"))
    start, stop = two.frequency_hz[[0, -1]].tolist()
    result = pr.admittance(motor, start=start, stop=stop, points=len(two))
    assert two.matrix_s == pytest.approx(result.matrix_s, rel=1e-6, abs=1e-12)

    # S21 stands before S12, which a stator, being reciprocal, does not show
    matrix = np.array([[[1e-2, 2e-3], [5e-3, 3e-2]], [[1e-2, 2e-3j], [5e-3, 3e-2j]]], dtype=complex)
    path = tmp_path / "t.s2p"
    path.write_text(touchstone(np.array([1e3, 2e3]), matrix), encoding="utf-8")
    assert skrf.Network(str(path)).y == pytest.approx(matrix, rel=1e-12)


@pytest.mark.parametrize(  # a contact of about 0.001 N/m leaves the tip free
    ("state", "values"), [("preloaded", ""), ("free", "preload=1e-11 normal_stiffness=10 compliance=10")]
)
@pytest.mark.parametrize("name", ["bimodal40", "examples/plate40.toml", "tests/data/every_effect.toml"])
def test_the_admittance_is_that_of_the_exported_library_in_a_deck_by_hand(
    name: str, state: str, values: str, tmp_path: Path
) -> None:
    motor = pr.load_motor(name)
    pr.export_motor(motor, tmp_path / "m.lib")
    batch(tmp_path / "deck.cir", DECK.format(values=values))
    frequency, *parts = np.loadtxt(tmp_path / "out.txt").T
    found = pr.admittance(motor, start=15e3, stop=60e3, points=451, state=state)  # type: ignore[arg-type]
    assert frequency == pytest.approx(found.frequency_hz)
    currents = -np.array([parts[0] + 1j * parts[1], parts[2] + 1j * parts[3]]).T
    size = np.abs(found.matrix_s).max(axis=(1, 2))[:, None]  # 1e-11 S lies across group A for the node check
    expected, allowed = found.matrix_s @ [0.5, 1.0], 1e-6 * size
    if state == "free":  # what the voltages move without a force, S'S/c, is no capacitance with losses in the library
        stator, loss, omega = motor.stator, motor.piezo.loss_tangent, 2.0 * np.pi * frequency[:, None]
        moved = stator.residual_per_volt.T @ (stator.residual_per_volt / np.diag(stator.residual)[:, None])
        ideal = 1.0 - (1.0 - 1j * loss) * (omega / (2.0 * np.pi * CAPACITANCE_AT)) ** (-2.0 / np.pi * atan(loss))
        expected = expected + 1j * omega * ideal * (moved @ [0.5, 1.0])
        lagging = (omega * 50e-9) ** 2  # of a rate, by the lags of what is in series
        branches = 1e-4  # error of the branches that stand for a constant loss
        allowed = allowed + (1.5 * lagging + branches) * omega * np.abs(moved).sum()
    assert np.all(np.abs(currents - expected) < allowed)


def test_a_motor_is_read_back_and_runs_alike(motor: pr.Motor, tmp_path: Path) -> None:
    assert pr.load_motor(pr.export_motor(motor, tmp_path / "m.toml")).to_dict() == motor.to_dict()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "c.json is not valid JSON"),
        ("[]", "c.json has no arms; give what `piezomotor fit --output` wrote"),
        ('{"arms": [3]}', "has no arms"),
        ('{"arms": [{"resistance_ohm": 1}]}', "arms.0.inductance_h is missing"),
        (
            '{"arms": [{"resistance_ohm": -1, "inductance_h": 1, "capacitance_f": 1}]}',
            "= -1 is not valid",
        ),
        ('{"arms": [{"resistance_ohm": true, "inductance_h": 1, "capacitance_f": 1}]}', "= True is not valid"),
        (
            '{"arms": [{"resistance_ohm": 1, "inductance_h": 1, "capacitance_f": 1}]}',
            "clamped_capacitance_f is",
        ),
        (f'{{"arms": [{{"resistance_ohm": 1{"0" * 400}}}]}}', "resistance_ohm = 1000"),
        ('{"arms": [{"resistance_ohm": 1e-300}]}', "it must be a number ≥ 1e-30 and ≤ 1e+18"),
    ],
)
def test_a_file_without_a_circuit_is_an_error(text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=re.escape(says)):
        load_circuit(path)


# --- the command ---


def test_the_command_exports_a_fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measured = spectrum(CIRCUIT, np.linspace(15e3, 40e3, 401)).save(tmp_path / "measured.csv")
    fit = tmp_path / "fit.json"
    assert run(["fit", str(measured), "--output", str(fit), "--json"]) == 0
    capsys.readouterr()
    library = output(["export", str(fit)], capsys)
    assert ".subckt resonator p n" in library
    assert printed(["export", str(fit)], capsys) == {"circuit": "fit.json", "library": library}
    assert run(["export", str(fit), "--output", str(tmp_path / "stator.asy")]) == 0
    assert run(["export", str(fit), "--output", str(tmp_path / "stator.lib")]) == 0
    assert (tmp_path / "stator.lib").read_text(encoding="ascii") == library
    assert run(["export", str(fit), "--output", str(tmp_path / "stator.kicad_sym")]) == 0
    assert capsys.readouterr().err == ""
    assert run(["export", str(fit), "--set", "contact.preload_n=3"]) == 2
    assert "--set has no effect on the circuit of a fit" in capsys.readouterr().err


@pytest.mark.parametrize("averaged", [False, True])
def test_command_and_function_offer_the_formats_of_the_table(
    averaged: bool, motor: pr.Motor, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "motor.doc"
    with pytest.raises(pr.ParameterError) as caught:
        pr.export_motor(motor, file, averaged=averaged)
    assert run(["export", "andersen2002", "--output", str(file), *(["--averaged"] if averaged else [])]) == 2
    for message in (str(caught.value), capsys.readouterr().err):
        assert [ending for ending in FORMATS if re.search(rf"\{ending}\b", message)] == list(endings(averaged))


# --- STEP of a header: at that step the power at a resonance is within the stated error ---


HERTZ = 28e3


def settled(library: str, line: str, hertz: float, quality: float, volts: float) -> float:
    """Return the settled mean power in W at the step of the header, by Aitken's rule from two stretches of time.

    They are two decays, or 120 periods; the envelope after switching on is one complex exponential.
    """
    (step,) = (float(text) for text in re.findall(r"^\* STEP +at most (\S+) s; the power .* within 1 %", library, re.M))
    periods = max(int(2.0 * quality / pi), 120)
    stop = 2.0 * periods / hertz
    tran = f".tran {step!r} {stop!r} {stop / 2.0 - 21.0 / hertz!r} {step!r} uic"
    source = f"V1 p 0 SIN(0 {volts!r} {hertz!r})"
    deck = f"step\n{library}\n{source}\n{line}\n.save i(V1)\n{tran}\n.end\n"
    vectors = run_deck(deck, vectors=["i(v1)"], stop_time=stop).raw.vectors
    time, amperes, found = vectors["time"].real, -vectors["i(v1)"].real, []
    for end in (stop / 2.0, stop):
        until = time <= end + 0.5 * step
        found.append(Window(time[until], 1.0 / hertz).harmonics(amperes[until])[0])
    first, second = found
    return float(0.5 * volts * (first**2 / (2.0 * first - second)).real)


@pytest.mark.parametrize("quality", [50.0, 633.0, pytest.param(5000.0, marks=pytest.mark.soak)])
def test_a_resonator_keeps_its_power_at_the_step_of_its_header(quality: float) -> None:
    circuit = resonator([HERTZ], [quality], [0.15], loss_tangent=0.0)
    power = settled(circuit_library(circuit), "X1 p 0 resonator", HERTZ, quality, 1.0)
    assert power == pytest.approx(0.5 / circuit.arms[0].resistance_ohm, rel=0.01)


@pytest.mark.soak
@pytest.mark.parametrize("name", ["bimodal40", "plate40"])
def test_a_motor_keeps_its_power_at_the_step_of_its_header(name: str) -> None:
    """At the largest conductance under preload of group A, by a voltage that leaves the contact stuck."""
    motor = pr.load_motor(name if name == "bimodal40" else "examples/plate40.toml")
    hertz = np.linspace(35e3, 45e3, 20001)
    conductance = motor.pressed_stator.admittance(2.0 * pi * hertz)[:, 0, 0].real
    place, volts = int(conductance.argmax()), 1e-2
    line = "Vb b 0 0\nXmotor p b 0 shaft piezomotor"
    power = settled(motor_library(motor), line, float(hertz[place]), 2.0 * 410.0, volts)  # neighbours have decayed
    assert power == pytest.approx(0.5 * volts**2 * conductance[place], rel=0.01)


def test_a_resonator_has_the_node_check(tmp_path: Path) -> None:
    library = circuit_library(resonator([HERTZ, 60e3], [633.0, 100.0], [0.15, 0.05]))
    for line, step, expected in (("X1 p 0", 1e-7, 0.0), ("X1 p 0", 3e-7, 1.0), ("R1 p 0 1k\nX1 p open", 1e-7, 1.0)):
        text = f"check\n{library}\nV1 p 0 SIN(0 1 28k)\n{line} resonator\n.tran {step} 250u 0 {step} uic\n"
        assert measured(f"{text}.measure tran check MAX v(x1.check)\n.end\n", tmp_path)["check"] == expected
