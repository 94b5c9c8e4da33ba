# SPDX-License-Identifier: GPL-3.0-or-later
"""The cyclic bench: a tip moved back and forth along a rotor that stands, in ngspice, with any of the contact laws."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi, radians
from typing import Any

import numpy as np

from pyspice_runner.errors import ParameterError
from pyspice_runner.model import contact as contact_law
from pyspice_runner.model.motor import Motor
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.benches import TRANSIENT_OPTIONS
from pyspice_runner.netlist.contact import ContactLaw, touching_law
from pyspice_runner.netlist.contact_benches import cyclic_bench
from pyspice_runner.netlist.sources import Bench
from pyspice_runner.result import Audit, Result
from pyspice_runner.run.audit import audit_contact
from pyspice_runner.run.kernel import transient
from pyspice_runner.run.waveforms import Array
from pyspice_runner.units import engineering

PERIODS = 2  # the second is already closed: what came before the first reversal is forgotten
STEPS = 1000  # a period
FREQUENCY = 1e3  # Hz; without inertia only the law of Coulomb, which follows the velocity, knows of it


@dataclass(frozen=True, repr=False)
class Hysteresis(Result):
    """A tip moved back and forth: a virgin curve, then loops.

    Attributes:
        time_s: time.
        displacement_m: of the tip along the rotor.
        normal_force_n: normal force.
        friction_force_n: friction force, which resists the displacement where both have one sign.
        contact_state: 0 separated, 1 stick, 2 slip; between them 1 + the part of the brush that slips.
        loss_j: energy lost in the last cycle.
        limit_m: displacement u_lim at which all of the contact slips under the mean normal force.
        provenance: contact, motion, law and ngspice's version, JSON-ready.
        deck: the netlist that was run.
    """

    time_s: Array
    displacement_m: Array
    normal_force_n: Array
    friction_force_n: Array
    contact_state: Array
    loss_j: float
    limit_m: float
    provenance: dict[str, Any] = field(repr=False)
    deck: str = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return loss and limit, JSON-ready."""
        return {"loss_j": self.loss_j, "limit_m": self.limit_m, **self.provenance}

    def columns(self) -> dict[str, Array]:
        """Return displacement, forces and state over the time."""
        names = ("time_s", "displacement_m", "normal_force_n", "friction_force_n", "contact_state")
        return {name: getattr(self, name) for name in names}

    @property
    def audit(self) -> Audit:  # type: ignore[override]
        """The outcome of the physical audit."""
        return Audit(tuple(self.provenance["audit"]["findings"]))

    def summary(self) -> dict[str, str]:
        """Return law, loss in the last cycle and the displacement at which all slips."""
        return {
            "contact": str(self.provenance["law"]),
            "loss in the last cycle": engineering(self.loss_j, "J"),
            "displacement at full slip": engineering(self.limit_m, "m"),
        }


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
    """Move a motor's tip back and forth along a rotor that stands, at a constant or a swinging normal force.

    The displacement is amplitude · u_lim · sin ωt, the normal force F₀ (1 + swing · sin(nωt + φ)), with F₀ the preload
    and u_lim the limit of stick under it.

    Args:
        motor: of which only contact and rotor count.
        amplitude: of the displacement, in units of u_lim.
        contact: law of the contact, as in ``simulate``.
        swing: of the normal force, relative to F₀.
        phase_deg: by which the force is ahead, degrees.
        harmonic: number n of swings of the force a cycle.
        timeout: wall time in s after which ngspice is ended.
        audit: whether forces that fail the physical audit are an error. If not, ``provenance["audit"]`` has what was
            found.

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
    circuit = cyclic_bench(
        motor.contact, motor.rotor, amplitude=amplitude * limit, swing=swing, phase_deg=phase_deg, harmonic=harmonic,
        frequency=FREQUENCY, law=law, step=step,
    )  # fmt: skip
    outcome = transient(
        Bench(circuit, TRANSIENT_OPTIONS), ["v(normal)", "v(friction)", "v(state)"], step=step,
        duration=PERIODS / FREQUENCY, timeout=timeout,
    )  # fmt: skip
    raw = outcome.vectors()
    time = np.concatenate(([0.0], raw["time"]))
    displacement = amplitude * limit * np.sin(2.0 * pi * FREQUENCY * time)
    first = motor.contact.preload_n * (1.0 + swing * np.sin(radians(phase_deg)))
    friction = np.concatenate(([0.0], raw["v(friction)"]))
    findings = audit_contact(motor.contact.friction, raw["v(normal)"], raw["v(friction)"])
    if audit:
        Audit(findings).withhold("loop")
    cycle = slice(int(np.searchsorted(time, (PERIODS - 1) / FREQUENCY - 0.5 * step)), None)
    return Hysteresis(
        time_s=time,
        displacement_m=displacement,
        normal_force_n=np.concatenate(([first], raw["v(normal)"])),
        friction_force_n=friction,
        contact_state=np.concatenate((raw["v(state)"][:1], raw["v(state)"])),
        loss_j=float(np.trapezoid(friction[cycle], displacement[cycle])),
        limit_m=limit,
        provenance={
            "contact": motor.contact.model_dump(),
            "law": law.name,
            "amplitude": amplitude,
            "swing": swing,
            "phase_deg": phase_deg,
            "harmonic": harmonic,
            **({"sliders": law.sliders} if law.sliders else {}),
            "ngspice_version": outcome.ngspice_version,
            "audit": Audit(findings).to_dict(),
        },
        deck=outcome.deck,
    )
