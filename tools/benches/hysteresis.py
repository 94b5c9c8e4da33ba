# SPDX-License-Identifier: GPL-3.0-or-later
"""The cyclic bench: a tip moves back and forth along a rotor at rest, in ngspice, with any contact law."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

import numpy as np

from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.law import ContactLaw, Law, touching_law
from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Contact, Rotor
from pyspice_runner.motor.refusal import checked
from pyspice_runner.result import Audit
from pyspice_runner.run.audit import audit_contact
from pyspice_runner.run.kernel import transient
from pyspice_runner.run.waveforms import Array
from validation.contact_bench import contact_bench

PERIODS = 2  # the second loop is closed: a brush forgets the motion before its last reversal
STEPS = 1000  # a period
FREQUENCY = 1e3  # Hz; without inertia only Coulomb's law, which follows the velocity, depends on it


@dataclass(frozen=True)
class Hysteresis:
    """Virgin curve and loops of a tip that moves back and forth.

    Attributes:
        time_s: time.
        displacement_m: displacement of the tip along the rotor.
        normal_force_n: normal force.
        friction_force_n: friction force, which resists the displacement where both have the same sign.
        contact_state: 0 separated, 1 stick, 2 slip; between 1 and 2, 1 + the part of the brush that slips.
        loss_j: energy lost in the last cycle.
        limit_m: displacement u_lim at which all of the contact slips under the mean normal force.
        audit: outcome of the physical audit.
    """

    time_s: Array
    displacement_m: Array
    normal_force_n: Array
    friction_force_n: Array
    contact_state: Array
    loss_j: float
    limit_m: float
    audit: Audit


def cyclic_bench(
    contact: Contact,
    rotor: Rotor,
    law: Law,
    *,
    amplitude: float,
    swing: float = 0.0,
    phase_deg: float = 0.0,
    harmonic: int = 1,
    frequency: float = FREQUENCY,
    step: float,
    title: str = "tip moved back and forth",
) -> Bench:
    """Return the bench of a tip that moves along a rotor at rest under a constant or varying normal force.

    The displacement is amplitude · sin(2πft), the node ``moved`` in µm; the normal force F₀ (1 + swing ·
    sin(2πnft + φ)). The node ``power`` is the power that friction dissipates or stores.

    Args:
        contact: constants of the contact, including F₀.
        rotor: the rotor, of which only the radius counts.
        law: law of the contact; instance ``Xcontact``.
        amplitude: amplitude of the displacement, m.
        swing: amplitude of the normal force, relative to F₀.
        phase_deg: phase of the force ahead of the displacement, degrees.
        harmonic: number n of cycles of the force in a cycle of the displacement.
        frequency: frequency of the displacement, Hz.
        step: time step of the run in s; the time constant of a slider is half of it.
        title: title line of the deck.
    """
    omega = 2.0 * pi * frequency
    depth = contact_law.static_penetration(contact)
    turn = f"{omega:.12g}*time"
    swings = f"{harmonic * omega:.12g}*time+({radians(phase_deg):.12g})"
    force = f"(1+({swing:.10g})*sin({swings}))"
    rate = f"{2e-6 / 3.0 * (1e6 * depth) * swing * harmonic * omega:.10g}*cos({swings})"
    lines = [
        "* displacement, um, and velocity along the rotor",
        f"Bmoved moved 0 V={1e6 * amplitude:.10g}*sin({turn})",
        f"Bvx vx 0 V={amplitude * omega:.10g}*cos({turn})",
        "* displacement, um, and velocity towards it that give the normal force",
        f"By y 0 V={1e6 * depth:.10g}*({force}**(2/3)-1)",
        f"Bvy vy 0 V={rate}/{force}**(1/3)",
        "Bpower power 0 V=V(friction)*V(vx)",
    ]
    if "creep" in law.own:  # a hundredth of the maximum velocity
        law = law.updated({"creep": min(max(0.01 * amplitude * omega, 1e-9), 1e3)})
    return contact_bench(
        lines, law, contact, radius=rotor.radius_m, span=depth * (1.0 + abs(swing)) ** (2.0 / 3.0),
        step=step, title=title,
    )  # fmt: skip


@checked
def hysteresis(
    motor: Motor,
    amplitude: float,
    contact: ContactLaw | None = "spring-slider",
    *,
    swing: float = 0.0,
    phase_deg: float = 0.0,
    harmonic: int = 1,
    timeout: float | None = None,
    audit: bool = True,
) -> Hysteresis:
    """Move a motor's tip back and forth along a rotor at rest, under a constant or varying normal force.

    The displacement is amplitude · u_lim · sin ωt, the normal force F₀ (1 + swing · sin(nωt + φ)), with F₀ the preload
    and u_lim the limit of stick under it.

    Args:
        motor: the motor, of which only contact and rotor count.
        amplitude: amplitude of the displacement, in units of u_lim.
        contact: law of the contact, as in ``simulate``.
        swing: amplitude of the normal force, relative to F₀.
        phase_deg: phase of the force ahead of the displacement, degrees.
        harmonic: number n of cycles of the force in a cycle of the displacement.
        timeout: wall time in s after which ngspice is ended.
        audit: whether forces that fail the physical audit raise an error; if not, the result has the findings.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    law = touching_law(contact, "The loop is that of the friction force.")
    for name, value, low, high in (("amplitude", amplitude, 0.0, 1e3), ("swing", swing, -0.99, 0.99)):
        if not low <= value <= high:
            raise ParameterError(f"{name} = {value:g} is not valid: it must be a number from {low:g} to {high:g}.")
    if not 1 <= harmonic <= 100:
        raise ParameterError(f"harmonic = {harmonic} is not valid: it must be a whole number from 1 to 100.")
    limit = contact_law.limit_ratio(motor.contact) * contact_law.static_penetration(motor.contact)
    step = 1.0 / (STEPS * FREQUENCY)
    bench = cyclic_bench(
        motor.contact, motor.rotor, law, amplitude=amplitude * limit, swing=swing, phase_deg=phase_deg,
        harmonic=harmonic, step=step,
    )  # fmt: skip
    outcome = transient(
        bench, ["v(normal)", "v(friction)", "v(state)"], step=step,
        duration=PERIODS / FREQUENCY, timeout=timeout,
    )  # fmt: skip
    raw = outcome.vectors()
    time = np.concatenate(([0.0], raw["time"]))
    displacement = amplitude * limit * np.sin(2.0 * pi * FREQUENCY * time)
    first = motor.contact.preload_n * (1.0 + swing * np.sin(radians(phase_deg)))
    friction = np.concatenate(([0.0], raw["v(friction)"]))
    audited = Audit(audit_contact(motor.contact.friction, raw["v(normal)"], raw["v(friction)"]))
    if audit:
        audited.withhold("loop")
    cycle = slice(int(np.searchsorted(time, (PERIODS - 1) / FREQUENCY - 0.5 * step)), None)
    return Hysteresis(
        time_s=time,
        displacement_m=displacement,
        normal_force_n=np.concatenate(([first], raw["v(normal)"])),
        friction_force_n=friction,
        contact_state=np.concatenate((raw["v(state)"][:1], raw["v(state)"])),
        loss_j=float(np.trapezoid(friction[cycle], displacement[cycle])),
        limit_m=limit,
        audit=audited,
    )
