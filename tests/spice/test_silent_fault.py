# SPDX-License-Identifier: GPL-3.0-or-later
"""What is looked for in a netlist before ngspice runs; that ngspice does pass over it, test_ngspice.py shows."""

import time

import pytest

from pyspice_runner.spice.process import silent_fault


@pytest.mark.parametrize(
    ("line", "fault"),
    [
        ("Xa n part r={2*{k=3}} c='x=1'", None),  # what stands in braces or quotes is an expression
        ("Xa n part r={f(a b=1", None),  # ngspice itself refuses what is not closed
        ("Xa n part b=1", "Subcircuit part has no parameter b"),
        ("Xa n part\n* a comment\n + b=1", "Subcircuit part has no parameter b"),
        ("Xa n part\nR1 n 0 1\n+ b=1", None),  # continues the resistor
        ("x=1 y=2", None),  # names no subcircuit
        ("}", None),
    ],
)
def test_an_instance_is_held_to_the_parameters_of_its_subcircuit(line: str, fault: str | None) -> None:
    found = silent_fault(f"title\n.subckt part n r=1 c=1\nR1 n 0 {{r}}\n.ends\n{line}\n.end\n")
    assert (found or "").startswith(fault or "")
    assert (found is None) == (fault is None)


@pytest.mark.parametrize(
    "signs", ["{" * 100_000, "}" * 100_000, "{" * 50_000 + "}" * 50_000, "{'" * 50_000, "\n" * 100_000]
)
def test_nested_braces_cost_no_time(signs: str) -> None:
    start = time.process_time()
    silent_fault(f"title\nX1 a 0 {signs}\n.end\n")
    assert time.process_time() - start < 1.0
