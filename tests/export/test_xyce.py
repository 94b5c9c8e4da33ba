# SPDX-License-Identifier: GPL-3.0-or-later
"""The dialect of Xyce: its grammar by the Reference Guide, its meaning by ngspice. Xyce itself does not run here."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.averaged.library import averaged_library
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.cli import run
from pyspice_runner.export.xyce import xyce_library
from tests.circuit.batch import batch, results
from tests.motors import BEAM40

# Reference Guide, table of arithmetic functions; those with one, two or any number of arguments
FUNCTIONS = {"ABS": 1, "ATAN": 1, "COS": 1, "EXP": 1, "LN": 1, "SIN": 1, "SQRT": 1, "STP": 1, "TANH": 1, "URAMP": 1,
             "MAX": 2, "MIN": 2}  # fmt: skip
RESERVED = {"time", "freq", "vt", "temp", "gmin"}  # section on .PARAM
SUFFIX = re.compile(r"(?<![A-Za-z_])(\d+\.?\d*|\.\d+)(meg|[tgkmunpf])\b", re.I)
VALUE = r"(?:-?\d[^\s)]*|\{[^{}]+\})"
WAVE = rf"(?:SIN|EXP)\((?:{VALUE} ){{5}}{VALUE}\)"  # section on V and I devices: six numbers each
NAME = r"[A-Za-z]\w*"
NODE = r"(?:0|[A-Za-z]\w*)"
DEVICES = {
    "B": rf"B\w+ {NODE} {NODE} [VIvi]=\{{[^{{}}]+\}}",
    "R": rf"R\w+ {NODE} {NODE} {VALUE}",
    "C": rf"C\w+ {NODE} {NODE} {VALUE}(?: ic={VALUE})?",
    "L": rf"L\w+ {NODE} {NODE} {VALUE}(?: ic={VALUE})?",
    "V": rf"V\w+ {NODE} {NODE} (?:(?:DC )?{VALUE}|{WAVE})",
    "I": rf"I\w+ {NODE} {NODE} {WAVE}",
    "E": rf"E\w+(?: {NODE}){{4}} {VALUE}",
    "G": rf"G\w+(?: {NODE}){{4}} {VALUE}",
    "F": rf"F\w+ {NODE} {NODE} V\w+ {VALUE}",
    "H": rf"H\w+ {NODE} {NODE} V\w+ {VALUE}",
    "X": rf"X\w+(?: {NODE})+ {NAME}(?: PARAMS:(?: {NAME}={VALUE})+)?",
}


def faults(text: str) -> list[str]:
    """Return every line that Xyce's grammar does not have, or that names something that is not there."""
    code = "".join(f"{line}\n" for line in text.splitlines() if not line.startswith("*"))
    blocks = re.findall(r"^\.subckt (.*)\n((?:(?!\.subckt|\.ends).*\n)*)\.ends \w+\n", code, re.M)
    heads = {head.split()[0]: head for head, _ in blocks}
    found = [] if code.count("\n") == sum(body.count("\n") + 2 for _, body in blocks) else ["a line outside of blocks"]
    for head, body in blocks:
        lines = body.splitlines()
        known = set(re.findall(r"(\w+)=", head)) | {line[7:].split("=")[0] for line in lines if line[:6] == ".param"}
        if not re.fullmatch(rf"{NAME}(?: {NAME})+(?: PARAMS:(?: {NAME}={VALUE})+)?", head) or known & RESERVED:
            found.append(head)
        nodes = {"0", *pins(head)}
        for line in lines:
            words = line.partition(" PARAMS:")[0].split()
            nodes |= set(words[1:-1] if line[0] == "X" else words[1:5] if line[0] in "EG" else words[1:3])
        sources = {line.split()[0] for line in lines if line[0] == "V"}
        for line in lines:
            found += [line] * misplaced(line, heads, sources)
            for expression in re.findall(r"\{([^{}]+)\}", line):
                found += [f"{line}: {what}" for what in wrong(expression, known, nodes, sources)]
    return found


def pins(head: str) -> list[str]:
    return head.partition(" PARAMS:")[0].split()[1:]


def misplaced(line: str, heads: dict[str, str], sources: set[str]) -> bool:
    """Tell whether a line has another form than its device, or does not fit the subcircuit or source that it names."""
    if not re.fullmatch(DEVICES.get(line[0], rf"\.param {NAME}=\{{[^{{}}]+\}}"), line):
        return True
    if line[0] == "X":
        *nodes, of = pins(line)
        settable = set(re.findall(r"(\w+)=", heads.get(of, "")))
        return len(nodes) != len(pins(heads.get(of, ""))) or not set(re.findall(r"(\w+)=", line)) <= settable
    return line[0] in "FH" and line.split()[3] not in sources


def wrong(expression: str, known: set[str], nodes: set[str], sources: set[str]) -> list[str]:
    """Return what an expression has that is not in Xyce's tables of operators and functions."""
    plain = SUFFIX.sub(r"\1", expression)
    try:
        tree = ast.parse(plain, mode="eval")
    except SyntaxError as error:
        return [str(error)]
    found: list[str] = []
    inside: set[int] = set()
    allowed = (ast.Expression, ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Constant, ast.Load, ast.Add, ast.Sub,
               ast.Mult, ast.Div, ast.Pow, ast.USub)  # fmt: skip
    for node in ast.walk(tree):
        if not isinstance(node, allowed):
            found.append(type(node).__name__)
        if isinstance(node, ast.Call):
            name = node.func.id.upper() if isinstance(node.func, ast.Name) else ""
            inside.add(id(node.func))
            if name in ("V", "I"):
                inside |= {id(argument) for argument in node.args}
                given = {ast.unparse(argument) for argument in node.args}
                if not given <= (nodes if name == "V" else sources):
                    found.append(f"{name}({', '.join(given)})")
            elif FUNCTIONS.get(name) != len(node.args):
                found.append(f"function {name}")
        elif isinstance(node, ast.Name) and id(node) not in inside and node.id not in known:
            found.append(f"name {node.id}")
    return found


LOSSES = {
    "contact.sliding_ratio": 0.8, "contact.series_compliance_m_per_n": 2e-9, "rotor.bearing_friction_n_m": 3e-4,
    "modes.0.softening_per_m2": 1e9, "modes.1.damping_growth_per_m2": 1e10,
}  # fmt: skip
BIMODAL = pr.load_motor(BEAM40)
CASES = {
    "spring-slider": lambda: motor_library(BIMODAL),
    "losses of a real motor": lambda: motor_library(BIMODAL.updated(LOSSES)),
    "brush": lambda: motor_library(BIMODAL, contact="brush"),
    "coulomb": lambda: motor_library(BIMODAL, contact="coulomb"),
    "drift": lambda: motor_library(BIMODAL, thermal=pr.Thermal.of(BIMODAL)),
    "three modes, no mount": lambda: motor_library(
        pr.load_motor("andersen2002-unintended-mode").updated({"mount": None})
    ),
    "averaged": lambda: averaged_library(BIMODAL, thermal=pr.Thermal.of(BIMODAL)),
}


@pytest.mark.parametrize("case", CASES)
def test_every_line_obeys_the_reference_guide(case: str) -> None:
    assert faults(xyce_library(CASES[case]())) == []


def test_the_checker_finds_what_xyce_does_not_have() -> None:
    assert len(faults(CASES["spring-slider"]())) > 20  # the dialect of ngspice
    good = xyce_library(CASES["spring-slider"]())
    for change in (
        ("STP(", "u("), ("LN(", "LOG("), ("PARAMS: ", ""), ("uramp(V(delta))", "uramp(V(delay))"), ("**", "^"),
        (".param seat=", ".param temp="), ("Fa a com Vvelocity", "Fa a com Vspeed"), ("Rforce", "Jforce"),
    ):  # fmt: skip
        assert faults(good.replace(*change)), change


@pytest.mark.parametrize("case", ["losses of a real motor", "drift"])
def test_the_translation_means_the_same(case: str, tmp_path: Path) -> None:
    """Both run in ngspice, the translation with what differs put back: the braces of a B-source, and STP."""
    text = CASES[case]()
    name = "piezomotor_thermal" if case == "drift" else "piezomotor"
    nodes = "a b 0 shaft 0 heat" if case == "drift" else "a b 0 shaft"
    back = re.sub(r"(?m)^(B.* [VI]=)\{(.*)\}$", r"\1\2", xyce_library(text)).replace("STP(", "u(")
    ends = []
    for library in (text, back):
        deck = [
            "title", library, f"Xmotor {nodes} {name}",
            "Va a 0 SIN(0 110 40100 0 0 0)", "Vb b 0 SIN(0 110 40100 0 0 120)",
            ".tran 200n 100u 0 200n uic", ".measure tran speed FIND v(shaft) AT=99u",
            ".measure tran current RMS i(Va) FROM=50u TO=99u", ".end",
        ]  # fmt: skip
        found = results(batch(tmp_path / "deck.cir", "\n".join(deck)))
        ends.append([found["speed"], found["current"]])
    assert np.all(np.array(ends[0]) != 0.0)
    assert ends[1] == pytest.approx(ends[0], rel=1e-6)


def test_the_command_writes_the_dialect(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "motor.lib"
    assert run(["export", BEAM40, "--dialect", "xyce", "--output", str(target)]) == 0
    assert target.read_text(encoding="utf-8") == xyce_library(motor_library(BIMODAL))
    assert "*   .options timeint method=gear\n" in xyce_library(averaged_library(BIMODAL))
    assert run(["export", BEAM40, "--dialect", "xyce", "--output", str(tmp_path / "motor.va")]) == 2
    assert run(["export", BEAM40, "--dialect", "hspice"]) == 2
    assert run(["export", BEAM40, "--rotational", "--output", str(target)]) == 2
    assert run(["export", BEAM40, "--rotational", "--output", str(target.with_suffix(".va"))]) == 0
    assert "    rotational_omega shaft;\n" in target.with_suffix(".va").read_text(encoding="utf-8")
    said = capsys.readouterr().err
    assert "dialect = 'xyce' has no effect on a .va: give a file name that ends in .lib." in said
    assert "'hspice' is not one of 'spice', 'ltspice', 'xyce'" in " ".join(said.replace("│", " ").split())


def test_a_law_of_ones_own_with_a_function_that_xyce_does_not_have_is_an_error() -> None:
    with pytest.raises(pr.ParameterError, match=r"floor\(\) in the line Bx has no translation to Xyce"):
        xyce_library(".subckt a x\nBx x 0 V=floor(V(x))\n.ends a\n")
    with pytest.raises(pr.ParameterError, match=r"The operator \^ in the line Bx has no translation to Xyce"):
        xyce_library(".subckt a x\nBx x 0 V=V(x)^2\n.ends a\n")
