# SPDX-License-Identifier: GPL-3.0-or-later
"""Benches of the contact alone: the oblique impact of a sphere, and a tip that moves back and forth."""

from __future__ import annotations

from math import pi, radians

from PySpice.Spice.Netlist import Circuit

from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.impact import Throw
from pyspice_runner.model.parameters import Contact, Rotor
from pyspice_runner.netlist.contact import Law, contact_library, contact_values
from pyspice_runner.netlist.library import definitions
from pyspice_runner.netlist.motor import instantiate
from pyspice_runner.netlist.own_law import PINS

_HALF_SPACE = 10.0  # m: radius of the rotor that represents a half-space; its curvature has no effect in this bench


def impact_bench(throw: Throw, *, law: Law, step: float, title: str = "") -> Circuit:
    """Return the bench of a sphere that hits a half-space at t = 0.

    The sphere is the tip: its masses are capacitors (mobility analogy, 1 V = 1 m/s or 1 rad/s, 1 A = 1 N or 1 N.m) on
    the nodes ``vy`` (approach), ``centre`` and ``spin``; ``vx`` is the velocity of its contact patch. Run it with
    ``uic``.

    Args:
        throw: sphere, half-space and velocities.
        law: law of the contact; instance ``Xcontact``.
        step: time step of the run in s; the time constant of a slider is half of it.
        title: title line of the deck.
    """
    circuit = Circuit(title or "sphere thrown at a half-space")
    constants = throw.contact
    library = contact_library(law, constants)
    values = contact_values(
        law, constants, radius=_HALF_SPACE, preload=constants.preload_n,
        slider_time=step / 2.0, span=throw.greatest_penetration_m,
    )  # fmt: skip
    if law.name == "coulomb":  # creep velocity: a thousandth of the velocity at ψ = 1
        values["creep"] = 1e-3 * throw.limit_ratio * throw.velocity_m_s
    seat = contact_law.static_penetration(constants)
    mass, radius = f"{throw.mass_kg:.10g}", f"{throw.radius_m:.10g}"
    lines = [
        definitions(library),
        "* approach: mass, and the path in um",
        f"Capproach vy 0 {mass} ic={throw.velocity_m_s:.10g}",
        "Gapproach 0 vy fy 0 1",
        f"Cpath y 0 1u ic={-1e6 * seat:.10g}",
        "Gpath 0 y vy 0 1",
        "* along the half-space: mass and moment of inertia, and the velocity of the patch",
        f"Ccentre centre 0 {mass} ic={throw.centre_velocity_m_s:.10g}",
        "Gcentre 0 centre fx 0 1",
        f"Cspin spin 0 {throw.inertia_kg_m2:.10g} ic={throw.spin_rad_s:.10g}",
        f"Gspin 0 spin fx 0 {radius}",
        f"Espin vx centre spin 0 {radius}\n",
    ]
    circuit.raw_spice += "\n".join(lines)
    nodes = [{"x": "0", "shaft": "0"}.get(pin, pin) for pin in PINS]
    instantiate(circuit, "contact", library, nodes, **values)
    return circuit


def cyclic_bench(
    contact: Contact,
    rotor: Rotor,
    *,
    amplitude: float,
    swing: float = 0.0,
    phase_deg: float = 0.0,
    harmonic: int = 1,
    frequency: float = 1e3,
    law: Law,
    step: float,
    title: str = "",
) -> Circuit:
    """Return the bench of a tip that moves back and forth along a rotor at rest, at a constant or varying normal force.

    The displacement is amplitude · sin(2πft), the node ``moved`` in µm; the normal force F₀ (1 + swing ·
    sin(2πnft + φ)). The node ``power`` is the power that friction dissipates or stores.

    Args:
        contact: constants of the contact, among them F₀.
        rotor: only its radius matters.
        amplitude: of the displacement, m.
        swing: amplitude of the normal force, relative to F₀.
        phase_deg: phase of the force ahead of the displacement, degrees.
        harmonic: number n of cycles of the force in a cycle of the displacement.
        frequency: of the displacement, Hz.
        law: law of the contact; instance ``Xcontact``.
        step: time step of the run in s; the time constant of a slider is half of it.
        title: title line of the deck.
    """
    circuit = Circuit(title or "tip moved back and forth")
    library = contact_library(law, contact)
    span = contact_law.static_penetration(contact) * (1.0 + abs(swing)) ** (2.0 / 3.0)
    values = contact_values(
        law, contact, radius=rotor.radius_m, preload=contact.preload_n, slider_time=step / 2.0, span=span
    )
    omega = 2.0 * pi * frequency
    if law.name == "coulomb":  # creep velocity: a hundredth of the greatest velocity
        values["creep"] = min(max(0.01 * amplitude * omega, 1e-9), 1e3)
    depth = 1e6 * contact_law.static_penetration(contact)
    turn = f"{omega:.12g}*time"
    swings = f"{harmonic * omega:.12g}*time+({radians(phase_deg):.12g})"
    force = f"(1+({swing:.10g})*sin({swings}))"
    rate = f"{2e-6 / 3.0 * depth * swing * harmonic * omega:.10g}*cos({swings})"
    lines = [
        definitions(library),
        "* displacement, um, and velocity along the rotor",
        f"Bmoved moved 0 V={1e6 * amplitude:.10g}*sin({turn})",
        f"Bvx vx 0 V={amplitude * omega:.10g}*cos({turn})",
        "* displacement, um, and velocity towards it that give the normal force",
        f"By y 0 V={depth:.10g}*({force}**(2/3)-1)",
        f"Bvy vy 0 V={rate}/{force}**(1/3)",
        "Bpower power 0 V=V(friction)*V(vx)\n",
    ]
    circuit.raw_spice += "\n".join(lines)
    nodes = [{"x": "0", "shaft": "0"}.get(pin, pin) for pin in PINS]
    instantiate(circuit, "contact", library, nodes, **values)
    return circuit
