# SPDX-License-Identifier: GPL-3.0-or-later
"""The bench of a contact alone, for its closed forms of impact and hysteresis."""

from __future__ import annotations

from collections.abc import Sequence

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.law import PINS, Law, contact_library, contact_values
from pyspice_runner.circuit.motor import instantiate
from pyspice_runner.circuit.source import TRANSIENT_OPTIONS
from pyspice_runner.motor.parameters import Contact
from pyspice_runner.spice.library import definitions


def contact_bench(
    lines: Sequence[str],
    law: Law,
    contact: Contact,
    *,
    radius: float,
    span: float,
    step: float,
    title: str,
) -> Bench:
    """Return a bench of the contact alone, the instance ``Xcontact``.

    Its pins ``x`` and ``shaft`` are grounded; each other pin is a node of the same name. ``lines`` are elements that
    move the tip, at the nodes ``y``, ``vx`` and ``vy``. The radius of the rotor and the largest penetration ``span``
    are in m. The time constant of a slider is half of the step in s.
    """
    circuit = Circuit(title)
    library = contact_library(law, contact)
    values = contact_values(law, contact, radius=radius, preload=contact.preload_n, slider_time=step / 2.0, span=span)
    circuit.raw_spice += "\n".join([definitions(library), *lines, ""])
    instantiate(circuit, "contact", library, ["0" if pin in ("x", "shaft") else pin for pin in PINS], **values)
    return Bench(circuit, TRANSIENT_OPTIONS)
