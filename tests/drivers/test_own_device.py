# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers and MOSFETs of the user's own: copies of the built-in ones, the example, and what is not accepted."""

import json
import re
import shutil
import time
from cmath import rect
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from math import radians
from pathlib import Path
from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.bench import motor_bench
from pyspice_runner.cli import run
from pyspice_runner.drivers.own_device import read_driver, read_mosfet
from pyspice_runner.drivers.report import DriveReport
from pyspice_runner.spice.library import data_path
from tests.circuit.batch import writes_a_raw_file
from tests.said import refusal
from validation.fuzz.entry_points import clear, harmless
from validation.fuzz.nasty import ATTEMPTS, MARKER
from validation.fuzz.watch import watched

pytestmark = pytest.mark.xdist_group("drivers")

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "drive.md"
EXAMPLE = ROOT / "examples" / "drivers" / "my_drivers.lib"
MOTOR = pr.load_motor("andersen2002")
SHORT = 2e-4  # s: ten periods, the shortest run of a report


def driver(kind: str, **values: Any) -> pr.Driver:
    return pr.Driver(**{"kind": kind, "voltage": 50.0, "frequency": 51.7e3, **values})


def report(chosen: pr.Driver, motor: pr.Motor = MOTOR, *, plotted: bool = False) -> DriveReport:
    """Return a report; if ``plotted``, all nodes of powers are in the circuit, as those of a copy are."""
    with pytest.MonkeyPatch.context() as patch:
        if plotted:
            patch.setattr(pr.Driver, "powers", {})
        return pr.drive_report(motor, chosen, duration=SHORT)


def built_in(name: str) -> str:
    return f"{data_path('behavioral') / name}.lib:{name}"


@cache
def half_bridge(*, plotted: bool = False) -> DriveReport:
    return report(driver("half-bridge", network="inductor"), plotted=plotted)


# --- copies of what is built in ------------------------------------------------------------------------------


def test_a_copy_of_the_amplifier_gives_the_same_report() -> None:
    own, known = report(driver(built_in("driver_amplifier"))), report(driver("linear"))
    assert own.driver["rails_v"] == known.driver["rails_v"]
    # steps of ngspice's own choice against uniform ones with modes exact at resonance; both are right to some 0.1 %
    for quantity in ("supply_power_w", "motor_power_w", "driver_efficiency", "power_factor"):
        assert getattr(own, quantity) == pytest.approx(getattr(known, quantity), rel=5e-3), quantity
    assert list(own.losses_w.values()) == pytest.approx(list(known.losses_w.values()), rel=5e-3)


@pytest.mark.soak
def test_a_loss_that_is_not_stated_follows_from_the_powers(tmp_path: Path) -> None:
    name = "driver_half_bridge"
    text = (data_path("behavioral") / f"{name}.lib").read_text(encoding="ascii")
    copy = tmp_path / "copy.lib"
    copy.write_text(re.sub(r"^\* (LOSS|FEED) .*\n", "", text, flags=re.M))
    own, known = report(driver(f"{copy}:{name}", network="inductor"), plotted=True), half_bridge(plotted=True)
    # the gate drivers, of which the copy says nothing, put in a part of the loss; what the balance of the built-in
    # bridge misses is in the difference too
    stated = sum(loss for path, loss in known.losses_w.items() if path.startswith("bridge_"))
    missed = known.balance_residual * known.power_in_w - own.balance_residual * own.power_in_w
    found = own.losses_w["driver_a.total"] + own.losses_w["driver_b.total"]
    assert found == pytest.approx(stated - known.gate_power_w + missed, rel=1e-6)
    assert abs(missed) < 0.05 * stated
    assert own.gate_power_w == 0.0


@pytest.mark.parametrize("kind", ["half-bridge", "full-bridge", built_in("driver_half_bridge")])
def test_a_bridge_has_the_mosfet_of_the_user_and_no_other(kind: str) -> None:
    text = str(motor_bench(MOTOR, driver(kind, mosfet=f"{EXAMPLE}:fast200")).circuit)
    harmless(text)
    assert text.count(".subckt driver_mosfet d g s\nMswitch d g s fast200\n.model fast200 VDMOS(") == 1
    assert "irf610" not in text


# --- the example ---------------------------------------------------------------------------------------------


@pytest.mark.soak
def test_the_commands_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLE, tmp_path)
    commands = re.findall(r"^piezomotor (.+)$", PAGE.read_text(encoding="utf-8"), re.M)
    assert len(commands) == 3
    for command in commands:
        assert run([*command.split(), "--json"]) == 0, command
        assert json.loads(capsys.readouterr().out)


def test_the_output_of_a_generator_drops_by_its_resistance() -> None:
    found = report(driver(f"{EXAMPLE}:generator", settings={"driver.resistance": 20.0}))
    for group, angle in (("a", 0.0), ("b", 90.0)):
        first = found.groups[group].harmonics[0]
        voltage, current = (
            rect(size, radians(turn))
            for size, turn in (
                (first.voltage_v, first.voltage_phase_deg),
                (first.current_a, first.current_phase_deg),
            )
        )
        # Ohm's law; the phasors are those of ten periods of the start, taken from steps that are not uniform
        assert abs(voltage + 20.0 * current) == pytest.approx(50.0, rel=2e-3), group
        assert found.driver["parts"][group]["driver"]["phase_deg"] == angle
    assert found.supply_power_w == pytest.approx(sum(port.real_power_w for port in found.outputs.values()))
    assert "The driver has no supply pins: powers and efficiencies count from its output." in found.cautions


@pytest.mark.soak
def test_the_deck_of_a_report_needs_no_other_file(tmp_path: Path) -> None:
    deck = report(driver("half-bridge", network="inductor", mosfet=f"{EXAMPLE}:sturdy200")).deck
    harmless(deck.replace(".tran", ".title").replace(".save", ".title"))
    (tmp_path / "deck.cir").write_text(deck, encoding="utf-8")
    writes_a_raw_file(tmp_path / "deck.cir")


def test_a_sweep_over_a_parameter_of_the_driver_notices_a_changed_file(tmp_path: Path) -> None:
    path = tmp_path / "my.lib"
    text = EXAMPLE.read_text(encoding="ascii")
    found = []
    for resistance in (50, 51):
        path.write_text(text.replace("Rout sine out {resistance}", f"Rout sine out {{resistance+{resistance}}}"))
        chosen = driver(f"{path}:generator")
        data = pr.sweep(
            MOTOR, chosen, over={"drive.driver.resistance": [0.0, 50.0]}, analysis=pr.drive_report,
            quantities=["motor_power_w"], duration=SHORT, store=tmp_path / "points",
            executor=ThreadPoolExecutor(1),
        )  # fmt: skip
        assert not data.piezomotor.failures
        found.append(data["motor_power_w"].values)
    assert found[0][0] > 1.05 * found[0][1]  # at a larger resistance less reaches the motor
    assert found[0][0] > found[1][0]


def test_a_tracker_drives_a_motor_through_a_driver(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["track", "andersen2002", "--tracker", "none", "--duration", "1.9e-3", "--frequency", "51.7e3"]
    words += ["--contact", "none", "--json"]
    saved = tmp_path / "deck.cir"
    assert run([*words, "--driver", f"{EXAMPLE}:push_pull", "--part", "driver.rout=5", "--output", str(saved)]) == 0
    found = json.loads(capsys.readouterr().out)["driver"]
    assert found["label"].startswith("push_pull, 50 V at 51.7 kHz")
    assert found["ratio_b"] == 1.0
    assert found["parts"]["b"]["driver"]["rout"] == 5.0
    assert "\n.subckt driver_own in out com vp vn" in saved.read_text(encoding="utf-8")
    assert "The driver generator has no pin in" in refusal([*words, "--driver", f"{EXAMPLE}:generator"], capsys)
    assert "--mosfet has no effect without --driver" in refusal([*words, "--mosfet", f"{EXAMPLE}:fast200"], capsys)


def test_parameters_of_the_driver_are_set_like_those_of_the_built_in_ones(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["drive", "andersen2002", "--duration", str(SHORT), "--driver", f"{EXAMPLE}:push_pull", "--json"]
    assert run([*words, "--part", "driver_b.rout=3", "--set", "driver.gain=10", "--part", "supply_v=70"]) == 0
    found = json.loads(capsys.readouterr().out)
    values = [found["driver"]["parts"][group]["driver"] for group in ("a", "b")]
    assert [value["rout"] for value in values] == [2.0, 3.0]
    assert [value["gain"] for value in values] == [10.0, 10.0]
    assert found["driver"]["rails_v"] == {"a": [70.0, -70.0], "b": [70.0, -70.0]}
    assert found["outputs"]["a"]["voltage_rms_v"] == pytest.approx(50 / 2**0.5, rel=0.03)  # less the base's drop
    assert found["losses_w"]["driver_b.stage"] > found["losses_w"]["driver_a.stage"] > 0.0


def test_a_shorted_output_has_no_power_and_no_efficiency(tmp_path: Path) -> None:
    text = ".subckt short out com amplitude=1 frequency=1 phase_deg=0\nV1 out com 0\n.ends\n"
    (tmp_path / "own.lib").write_text(text)
    found = report(driver(f"{tmp_path}/own.lib:short"), pr.load_motor("bimodal40"))
    assert found.summary()
    assert (found.power_in_w, found.driver_efficiency, found.efficiency) == (0.0, 0.0, 0.0)


# --- what is not accepted ------------------------------------------------------------------------------------

DRIVER = ".subckt one in out com gain=20\nE1 out com in com {gain}\nR1 out com 1k\n.ends one\n"


def put(line: str) -> str:
    return DRIVER.replace("R1 out com 1k\n", f"R1 out com 1k\n{line}\n")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "there is no .subckt one. It has none."),
        (DRIVER.replace("one", "two"), "there is no .subckt one. It has two."),
        (DRIVER.replace(".ends one\n", ""), ".subckt one has no .ends"),
        (DRIVER.replace(" com gain", " gain"), "the pins of one are in out; they must be out and com"),
        (DRIVER.replace("in out com", "in out com tab"), "and may include in, vp and vn, in any order"),
        (DRIVER.replace("in out com", "out com"), "the parameters amplitude, frequency, phase_deg are missing"),
        (DRIVER.replace("gain=20", "gain={2}"), "parameter gain: '{2}' is not a SPICE number"),
        (DRIVER.replace("one in", 'on"e in').replace("s one", 's on"e'), "'on\"e' is not valid"),
        (DRIVER + ".control\nshell touch marker\n.endc\n", "'.control' is outside of a subcircuit"),
        (".include /etc/passwd\n" + DRIVER, "'.include /etc/passwd' is outside of a subcircuit"),
        (put(".control"), "'.control' is not allowed: only .param, and .model of type D, SW"),
        (put(".include other.lib"), "'.include other.lib' is not allowed"),
        (put("A1 %v([a]) %d([b]) process"), "elements begin with one of"),
        (put(".model m d_process (process_file=a)"), "a device reads no files and needs no quotes"),
        (put("R1 a 0 `shell`"), "a device reads no files and needs no quotes"),
        (put("X1 a b other"), "other is not in the file; name it in a line '* NEEDS driver_mosfet'"),
        (put("X1 in out com one"), "one contains itself, or is nested too deeply"),
        (put("M1 a b c c absent"), "the model of M1 is not in the file; add its .model"),
        (put("R2 a 0 {depth}"), "the expression reads depth, which is not a parameter"),
        (put("R2 a 0 1\x07"), "it has a control character"),
        (put("R2 µ 0 1"), "one that is not ASCII"),
        (put(".subckt inner a b"), "'.subckt inner a b' is inside of .subckt one; move it out"),
        ("* PAR gain $\\frac{$ 20 1 100 gain\n" + DRIVER, "in the PAR line of gain is not a unit"),
        ("* PAR gain 1 20 x 100 gain\n" + DRIVER, "my.lib, parameter gain: 'x' is not a SPICE number."),
        ("* LOSS heat loss\n" + DRIVER, "LOSS 'heat' has no node 'loss_heat'"),
        ("* PAR gain 1 20 0 100 gain\n" + DRIVER.replace("=20", "=21"), "gain is 21 here and 20 in its PAR line"),
        ("* NEEDS nothing\n" + DRIVER, "NEEDS names 'nothing', which is not in behavioral/. Usually it is driver_mosf"),
    ],
)  # fmt: skip
def test_a_library_that_holds_no_driver_is_an_error(text: str, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / "my.lib"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(pr.ParameterError) as caught:
        driver(f"{path}:one")
    assert sentence in str(caught.value)
    assert str(path) in str(caught.value)
    assert clear(str(caught.value))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (".model one PMOS(Vto=-3)", "is not valid: the type must be NMOS or VDMOS, of n-channel"),
        (".model one VDMOS(pchan Vto=-3)", "is not valid: the type must be NMOS or VDMOS, of n-channel"),
        (".model one NPN(Bf=3)", "is not valid: the type must be NMOS or VDMOS, of n-channel"),
        (".model one d_process(process_file=a)", "a device reads no files"),
        (".model one filesource(x=1)", "a device reads no files"),
        (".subckt one d g s t\nR1 d s 1\n.ends", "the pins of one are d g s t; they must be three: drain gate source"),
        ("* NEEDS driver_mosfet\n.subckt one d g s\nX1 d g s driver_mosfet\n.ends", "is not a part of a MOSFET"),
        ("", "there is no .subckt one. It has none."),
    ],
)
def test_a_library_that_holds_no_mosfet_is_an_error(text: str, sentence: str, tmp_path: Path) -> None:
    (tmp_path / "my.lib").write_text(f"{text}\n", encoding="utf-8")
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        driver("half-bridge", mosfet=f"{tmp_path / 'my.lib'}:one")


@pytest.mark.parametrize(
    ("kind", "values", "sentence"),
    [
        ("absent.lib:one", {}, "No such file or directory. Give the path of a .lib file."),
        ("/dev/zero:one", {}, "Cannot read the driver library '/dev/zero': it is not a regular file."),
        (f"{'x' * 300}:one", {}, "Cannot read the driver library 'xxx"),
        ("my.lib:a b", {}, "it must be FILE:NAME, with a NAME of letters, digits and _ . + -."),
        ("my.lib:", {}, "it must be FILE:NAME"),
        ("linear", {"mosfet": f"{EXAMPLE}:fast200"}, "mosfet has no effect on a linear"),
        ("half-bridge", {"mosfet": "BUZ11"}, "it must be IRF530, IRF610, IRF820 or FILE:NAME of a .subckt or .model."),
        ("half-bridge", {"mosfet": "absent.lib:one"}, "Cannot read the MOSFET library 'absent.lib'"),
        (f"{EXAMPLE}:push_pull", {"settings": {"driver.gian": 1.0}}, "no parameter 'gian'. Did you mean 'gain'?"),
        (f"{EXAMPLE}:push_pull", {"settings": {"driver.gain": 500.0}}, "gain = 500 is not valid: it must be 1 to 200."),
        (f"{EXAMPLE}:generator", {"settings": {"driver.frequency": 1.0}}, "driver.frequency follows from the driver's"),
    ],
)
def test_an_invalid_driver_is_an_error_that_names_the_value(kind: str, values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(pr.ParameterError) as caught:
        driver(kind, **values)
    assert sentence in str(caught.value)
    assert clear(str(caught.value))


@pytest.mark.parametrize(
    "text",
    [
        DRIVER.replace(".ends", f"R2 a 0 {{1{' ' * 4000}}}\n" * 900 + ".ends"),
        DRIVER.replace(".ends", "+ 1\n" * 900_000 + ".ends"),
        "".join(f".subckt s{i} a b\nX1 a b s{i + 1}\nX2 a b s{i + 1}\n.ends\n" for i in range(30_000)) + DRIVER,
    ],
    ids=["blanks", "continued lines", "subcircuits"],
)
@pytest.mark.fuzz
def test_a_large_library_is_read_in_seconds(text: str, tmp_path: Path) -> None:
    path = tmp_path / "my.lib"
    path.write_text(text, encoding="ascii")
    with watched(tmp_path):  # at most five seconds of processor time
        read_driver(f"{path}:one")


@pytest.mark.parametrize("what", ["a line of its own", "a control section", "a continued line", "an include"])
def test_a_hostile_line_in_a_library_reaches_no_netlist(what: str, tmp_path: Path) -> None:
    path = tmp_path / "my.lib"
    places: list[Callable[[str], str]] = [put, lambda text: DRIVER + text, lambda text: DRIVER.replace("one", text, 1)]
    for place in places:
        for text in (ATTEMPTS[what], ATTEMPTS[what].replace("\n", "\r"), ATTEMPTS[what].replace("\n", "\x0b")):
            path.write_text(place(text), encoding="utf-8", newline="")
            for read in (read_driver, read_mosfet):
                with pytest.raises(pr.ParameterError) as caught:
                    read(f"{path}:one")
                assert clear(str(caught.value)), text
    assert not list(tmp_path.rglob(MARKER))


def nested(depth: int, instances: int) -> str:
    """A driver of nested subcircuits, each with instances of the next."""
    texts = [".subckt one out com", *(f"X{n} out com part1" for n in range(instances)), ".ends"]
    for level in range(1, depth):
        texts += [f".subckt part{level} p n", *(f"X{n} p n part{level + 1}" for n in range(instances)), ".ends"]
    return "\n".join([*texts, f".subckt part{depth} p n", "R1 p n 1k", ".ends"])


def test_the_elements_of_nested_subcircuits_are_counted_before_the_run(tmp_path: Path) -> None:
    library = tmp_path / "my.lib"
    parameters = " amplitude=1 frequency=1 phase_deg=0\n"
    library.write_text(nested(8, 8).replace("\n", parameters, 1), encoding="utf-8")
    began = time.process_time()
    with pytest.raises(pr.ParameterError, match=r"line 1: one has 1.68e\+07 elements .* at most 10000 are allowed"):
        driver(f"{library}:one")  # 8^8
    assert time.process_time() - began < 1.0
    library.write_text(nested(4, 10).replace("\n", parameters, 1), encoding="utf-8")
    assert driver(f"{library}:one").own  # 10^4
    library.write_text(nested(4, 10).replace("R1 p n 1k", "R1 p n 1k\nR2 p n 1k").replace("\n", parameters, 1))
    with pytest.raises(pr.ParameterError, match=r"one has 2e\+04 elements"):
        driver(f"{library}:one")
