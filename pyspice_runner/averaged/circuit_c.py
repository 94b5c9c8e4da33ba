# SPDX-License-Identifier: GPL-3.0-or-later
"""Circuits of sources, resistors and capacitors in C: what flows into each capacitor.

The averaged motor in C takes the circuits in front of it from the libraries that ngspice runs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from textwrap import wrap

from pyspice_runner.spice.expressions import HELPERS, Equations, translated
from pyspice_runner.spice.library import LibraryParameter, read_library

Parts = Sequence[tuple[str, Mapping[str, str]]]  # names of libraries, each with the nodes to which its pins go
NETWORK: Parts = (("driver_averaged", {}),)
TRACKER: Parts = (("tracker_averaged", {}), ("tracker_filter", {"in": "out"}))


def circuit_parameters(parts: Parts) -> tuple[LibraryParameter, ...]:
    """Return the parameters of a circuit: the first fields of its structure, in this order."""
    return tuple(item for name, _ in parts for item in read_library(name).parameters)


def circuit_source(name: str, parts: Parts) -> str:
    """Return a circuit in C: the structure ``NAME``, and the function ``NAME_flows``.

    The function takes parameters, voltages of pins and capacitors, and the currents of sources that sense one. It finds
    the other voltages and, for each capacitor to ground, the current into its node and its capacitance, ``flow_NODE``
    and ``store_NODE``.
    """
    found = Equations()
    for part, pins in parts:
        found.add(read_library(part), pins)
    found.resolve()
    parameters = [item.name for item in circuit_parameters(parts)]
    texts = {node: _c(text) for node, text in found.ordered()}
    for node, capacitance in found.capacitances.items():
        texts[f"flow_{node}"] = _c("+".join(found.currents.get(node, ["0"])))
        texts[f"store_{node}"] = _c(capacitance)
    used = dict.fromkeys(re.findall(r"p->(\w+)", " ".join(texts.values())))
    fields = [*parameters, *(word for word in used if word not in parameters and word not in texts), *texts]
    return "\n".join(
        (
            "/* SPDX-License-Identifier: GPL-3.0-or-later",
            " *",
            f" * Written from {' and '.join(f'{part}.lib' for part, _ in parts)}.",
            " */",
            "#include <math.h>",
            "",
            HELPERS["c"],
            "",
            f"struct {name} {{",
            *wrap(f"double {', '.join(fields)};", 110, initial_indent="    ", subsequent_indent="        "),
            "};",
            "",
            f"static inline void {name}_flows(struct {name} *p)",
            "{",
            *(f"    p->{node} = {text};" for node, text in texts.items()),
            "}",
            "",
        )
    )


def _c(text: str) -> str:
    return translated(text, "c", lambda used: f"p->{used.lower()}")
