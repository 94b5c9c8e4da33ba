# SPDX-License-Identifier: GPL-3.0-or-later
"""C code that is written from the libraries that ngspice runs: the contact at one phase, and the circuits in front.

A circuit of sources, resistors and capacitors gives what flows into each capacitor.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from textwrap import wrap

from pyspice_runner.averaged.library import ALL_TERMS, Terms, averaged_phase
from pyspice_runner.spice.expressions import HELPERS, Equations, equations, translated
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
    about = f"Written from {' and '.join(f'{part}.lib' for part, _ in parts)}."
    return _source([about], name, fields, *_function(f"static inline void {name}_flows", name, texts))


# the node of a phase that its own equation contains, and what that equation gives
_IMPLICIT = """\
static double phase_{0}_by(struct phase *p, double value)
{{
    p->{0} = value;
    return {1};
}}

/* The root of an equation whose right side falls as the value rises: false position, with the weights of Anderson and
   Bjoerck (BIT 13 (1973) 253) for an end that stays. */
static double phase_{0}(struct phase *p)
{{
    double low = 0.0, high = phase_{0}_by(p, 0.0), sign = high < 0.0 ? -1.0 : 1.0, most = sign * high;
    double under = most, over = sign * (phase_{0}_by(p, high) - high), same = 0.0;

    for (int i = 0; i < 100 && over < -1e-13 * most; i++) {{
        double middle = (low * over - high * under) / (over - under);
        double excess = sign * (phase_{0}_by(p, middle) - middle);
        double weight = same * excess > 0.0 ? 1.0 - excess / (excess < 0.0 ? over : under) : 1.0;
        if (fabs(excess) <= 1e-13 * most)
            return middle;
        weight = weight > 0.0 ? weight : 0.5;
        if (excess < 0.0) {{
            high = middle, over = excess, under *= weight;
        }} else {{
            low = middle, under = excess, over *= weight;
        }}
        same = excess;
    }}
    return high;
}}
"""


def phase_source(terms: Terms = ALL_TERMS) -> str:
    """Return the contact at one phase in C, with the equations of ``piezomotor_averaged_phase`` that a motor has."""
    library = averaged_phase(terms)
    found = equations(library)
    inputs = [pin.name for pin in library.pins if pin.name not in found.values]
    fields = [*(item.name for item in averaged_phase(ALL_TERMS).parameters), *inputs, *found.parameters, *found.values]
    texts = {name: translated(text, "c", lambda used: f"p->{used}") for name, text in found.ordered()}
    implicit = [name for name, text in found.values.items() if f"V({name})" in text]
    lines = texts | {name: f"phase_{name}(p)" for name in implicit}
    return _source(
        [f"{library.title}; displacements in um.", f"Written from {library.name}.lib."],
        "phase",
        fields,
        *_function("static void phase_parameters", "phase", {n: lines[n] for n in lines if n in found.parameters}),
        *(_IMPLICIT.format(name, texts[name]) for name in implicit),
        *_function("static void phase_forces", "phase", {n: lines[n] for n in lines if n in found.values}),
    )


def _source(about: Sequence[str], name: str, fields: Sequence[str], *lines: str) -> str:
    """Return a C header with a structure of numbers and functions."""
    comment = ["/* SPDX-License-Identifier: MIT", " *", *(f" * {line}" for line in about), " */"]
    members = wrap(f"double {', '.join(fields)};", 110, initial_indent="    ", subsequent_indent="        ")
    head = [*comment, "#include <math.h>", "", HELPERS["c"], "", f"struct {name} {{", *members, "};", ""]
    return "\n".join((*head, *lines))


def _function(declared: str, name: str, values: Mapping[str, str]) -> tuple[str, ...]:
    """Return the lines of a function that sets fields of a structure ``p``."""
    return f"{declared}(struct {name} *p)", "{", *(f"    p->{key} = {text};" for key, text in values.items()), "}", ""


def _c(text: str) -> str:
    return translated(text, "c", lambda used: f"p->{used.lower()}")
