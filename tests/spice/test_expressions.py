# SPDX-License-Identifier: GPL-3.0-or-later
"""The equations of a subcircuit, and expressions in C and Verilog-A, against closed forms of the contact."""

from dataclasses import replace
from math import exp, sqrt, tanh

import pytest

from pyspice_runner.circuit.evaluated import library_function
from pyspice_runner.circuit.law import PAPER_LAW, Law, contact_library
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.load import load_motor
from pyspice_runner.spice.expressions import Equations, equations, translated
from pyspice_runner.spice.library import data_path, read_library

FUNCTIONS = {
    "fabs": abs, "larger": max, "smaller": min, "pow": pow, "exp": exp, "sqrt": sqrt, "tanh": tanh,
    "ramp_up": lambda x: max(x, 0.0), "ramp_down": lambda x: max(-x, 0.0), "unit_step": lambda x: float(x > 0.0),
    "power32": lambda x: max(x, 0.0) ** 1.5,
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "c", "verilog_a"),
    [
        ("max(-V(limit),min(V(limit),V(u)))", "larger(-limit, smaller(limit, u))", "max(-limit, min(limit, u))"),
        ("{2*a}*abs(V(x))**1.5", "(2.0 * a) * power32(fabs(x))", "(2.0 * a) * power32(abs(x))"),
        ("(V(x)-V(y))**2/50n", "pow(x - y, 2.0) / 5e-08", "pow(x - y, 2.0) / 5e-08"),
        ("uramp(-V(x))+u(1n-V(x))", "ramp_down(x) + unit_step(1e-09 - x)", "ramp_down(x) + unit_step(1e-09 - x)"),
    ],
)
def test_an_expression_has_the_functions_of_the_language(text: str, c: str, verilog_a: str) -> None:
    assert translated(text, "c", str) == c
    assert translated(text, "verilog-a", str) == verilog_a


def solved(library_name: str, given: dict[str, float]) -> dict[str, float]:
    """Evaluate the equations of a subcircuit; a node that depends on itself is iterated from 0."""
    values = {item.name: item.default for item in read_library(library_name).parameters} | given
    for name, text in equations(read_library(library_name)).ordered():
        values.setdefault(name, 0.0)
        for _ in range(5):
            values[name] = eval(translated(text, "c", str), FUNCTIONS | values)
    return values


def test_the_equations_of_the_contact_are_the_closed_forms_of_the_law() -> None:
    """At rest and at half of the limit of stick: the preload, and μ F₀ (1 − 0.5^1.5)."""
    contact = load_motor("andersen2002").contact
    depth = contact_law.static_penetration(contact)
    half = 0.5e6 * contact_law.limit_ratio(contact) * depth
    given = {
        "x": 0.0, "y": 0.0, "vx": 0.0, "vy": 0.0, "shaft": 0.0, "slider": half, "preload": contact.preload_n,
        "mu": contact.friction, "normal_stiffness": contact.normal_stiffness_n_per_m15,
        "compliance": contact_law.total_compliance(contact),
    }  # fmt: skip
    found = solved("piezomotor_contact", given)
    assert found["delta"] == pytest.approx(1e6 * depth, rel=1e-12)
    assert found["normal"] == pytest.approx(contact.preload_n, rel=1e-12)
    assert found["friction"] == pytest.approx(contact.friction * contact.preload_n * (1.0 - 0.5**1.5), rel=1e-12)
    assert (found["fx"], found["state"]) == (pytest.approx(-found["friction"]), 1.0)


def test_a_node_with_a_resistor_has_the_voltage_of_its_currents() -> None:
    """The relative velocity of Coulomb's law: vx − R Ω."""
    given = {"x": 0.0, "y": 0.0, "vx": 0.05, "vy": 0.0, "shaft": 2.0, "radius": 0.01, "mu": 0.25, "preload": 4.0}
    found = solved("piezomotor_coulomb", given)
    assert found["slip"] == pytest.approx(0.05 - 0.01 * 2.0)
    assert found["friction"] == pytest.approx(0.25 * 4.0 * tanh(found["slip"] / found["creep"]))


def test_each_cell_of_a_brush_is_a_state() -> None:
    found = equations(contact_library(Law("brush", 3)))
    assert list(found.capacitances) == ["q1", "q2", "q3"]
    assert [len(found.currents[node]) for node in found.capacitances] == [3, 3, 2]  # neighbours, and what holds it


def test_a_source_of_its_own_voltage_is_a_conductance() -> None:
    """What a brush plots: the displacement of the innermost cell, and 1 + the part of the contact that slips."""
    law = Law("brush", 3)
    given = {"x": 0.0, "y": 0.0, "vx": 0.1, "vy": 0.0, "shaft": 0.0, "q1": 1.0, "q2": 0.01, "q3": 0.0}
    parameters = {item.name: item.default for item in contact_library(law).parameters}
    found = library_function(contact_library(law))(parameters | given)
    assert found["state"] == pytest.approx(1.0 + 1.0 / found["x0"], rel=1e-9)
    assert found["slider"] == pytest.approx(found["y1"] * 2.0 - given["q1"], rel=1e-9)  # its limit


def test_a_sum_before_the_voltage_of_a_source_takes_parentheses() -> None:
    contact, found = contact_library(PAPER_LAW), Equations()
    found.add(replace(contact, subcircuit=".subckt one a b\nBa a 0 I=(1+2e-3)*{3-4}*V(a)\n.ends"), {})
    assert found.conductances == {"a": "(1+2e-3)*{3-4}"}
    with pytest.raises(ValueError, match="parentheses"):
        found.add(replace(contact, subcircuit=".subckt one a b\nBa a 0 I=1+V(b)*V(a)\n.ends"), {})


@pytest.mark.parametrize("name", ["piezomotor.va", "piezomotor_averaged.c"])
def test_the_contact_is_written_by_hand_in_spice_only(name: str) -> None:
    text = (data_path("behavioral") / name).read_text(encoding="utf-8")
    for word in ("power32", "grip", "held", "tanh"):
        assert word not in text, word


def test_some_nodes_of_a_brush_follow_as_they_do_with_all_others() -> None:
    library = contact_library(Law("brush", 8))
    function = library_function(library)
    values = {item.name: item.default for item in library.parameters}
    values |= {"x": 0.1, "y": 0.3, "vx": 0.2, "vy": 0.1, "shaft": 5.0}
    values |= {state: 0.1 * number for number, state in enumerate(function.states)}
    every = function(values)
    nodes = ("fx", "friction", "state", "rate_q3")
    assert function.of(nodes, values) == {node: every[node] for node in nodes}
    given = {"delta": every["delta"], "factor": every["factor"], **{one: values[one] for one in function.states}}
    constants = {item.name: item.default for item in library.parameters}
    assert function.of(("state",), constants | given) == {"state": every["state"]}
