# SPDX-License-Identifier: GPL-3.0-or-later
"""Libraries and decks keep to the dialect of behavioral/CONVENTIONS.md, in ngspice's modes and in another parser."""

import json
import re
from pathlib import Path

import pytest

from pyspice_runner.spice.library import data_path
from validation.dialects import CAMPAIGN, FUNCTIONS, MODES, agrees, keys, outcome, passes, summary, write_deck

QUICK = ("netlists/free_admittance.cir", "netlists/impact.cir", "behavioral/piezomotor_contact.lib")
EXPORTS = [key for key in keys() if key.startswith("export/")]


def text_of(key: str, folder: Path) -> str:
    """Return the text of a deck, a library, or an exported motor."""
    kind, _, name = key.partition("/")
    if kind == "export":
        write_deck(key, folder)
        return (folder / "motor.lib").read_text(encoding="utf-8")
    return (data_path(kind) / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("key", [*keys(), "netlists/piezomotor_averaged.lib"])
def test_a_file_is_in_the_common_dialect(key: str, tmp_path: Path) -> None:
    text = text_of(key, tmp_path)
    assert text.isascii()
    lines = [line for line in text.splitlines() if line and not line.startswith(("*", ".title"))]
    assert max(map(len, lines)) <= 1000
    for line in lines:
        code, _, _ = line.partition(" ; ")
        assert not re.search(r"[;$^?`]|//|^\+|\bpow\b|\bm=", code), line
        assert set(re.findall(r"\b([a-z_]\w*)\(", code.lower())) <= FUNCTIONS, line
        suffixes = re.findall(r"(?<![\w.])\d+\.?\d*(?:e[+-]?\d+)?+([a-zA-Z]+)\b", code)
        assert {*suffixes} <= {"t", "g", "meg", "k", "m", "u", "n", "p", "f"}, line


@pytest.mark.parametrize("key", [*QUICK, "export/bimodal40.spring-slider"])
def test_a_deck_has_the_same_results_in_every_mode(key: str) -> None:
    found = outcome(key)["modes"]
    assert found.keys() == set(MODES)
    assert all(map(agrees, found.values())), found


def test_the_recorded_decks_have_no_difference() -> None:
    cases = CAMPAIGN.cases()
    assert {case["index"] for case in cases} <= set(keys())
    assert passes(json.loads(CAMPAIGN.record.with_suffix(".json").read_text(encoding="utf-8")))
    assert not passes(summary([*cases, {"index": "other", "modes": dict.fromkeys(MODES, 2e-9)}]))


@pytest.mark.parametrize("key", EXPORTS)
def test_another_parser_finds_every_pin_and_parameter(key: str, tmp_path: Path) -> None:
    """By spicelib, which reads files of LTspice, QSPICE, ngspice and Xyce by rules of its own."""
    spicelib = pytest.importorskip("spicelib")
    text = text_of(key, tmp_path)
    (tmp_path / "read.cir").write_text(f"{text}.end\n", encoding="utf-8")
    read = spicelib.SpiceEditor(tmp_path / "read.cir")
    circuits = {part.name(): part for part in read.netlist if isinstance(part, spicelib.SpiceCircuit)}
    heads = {name: words.split() for name, words in re.findall(r"^\.subckt (\w+) (.*)$", text, re.M)}
    bodies = re.findall(r"^\.subckt (\w+) .*\n((?:.*\n)*?)\.ends", text, re.M)
    assert circuits.keys() == heads.keys()
    for name, body in bodies:
        lines = [line.split() for line in body.splitlines() if line[0] not in ".*"]
        assert circuits[name].get_components() == [line[0].upper() for line in lines]
        for line in lines:
            nodes = circuits[name].get_component_nodes(line[0])
            if line[0][0] == "X":
                called = circuits[name].get_component_value(line[0])
                given = {one.lower() for one in circuits[name].get_component_parameters(line[0])} - {"value"}
                assert len(nodes) == sum("=" not in word for word in heads[called]), line
                assert given <= {word.partition("=")[0] for word in heads[called] if "=" in word}, line
            else:
                assert nodes == line[1:3], line
