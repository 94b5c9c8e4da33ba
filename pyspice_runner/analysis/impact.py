# SPDX-License-Identifier: GPL-3.0-or-later
"""The impact bench: a sphere thrown at a half-space, in ngspice, with any of the contact laws."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.model.impact import Throw
from pyspice_runner.model.refusal import checked
from pyspice_runner.netlist.benches import TRANSIENT_OPTIONS
from pyspice_runner.netlist.contact import ContactLaw, touching_law
from pyspice_runner.netlist.contact_benches import impact_bench
from pyspice_runner.netlist.sources import Bench
from pyspice_runner.result import Audit, Result
from pyspice_runner.run.audit import audit_contact, audit_impact
from pyspice_runner.run.kernel import Outcome, transient
from pyspice_runner.run.waveforms import Array
from pyspice_runner.units import engineering

STEPS = 1000  # of an impact without loss; the error of ψ₂ from the steps is then some 1e-5
FEWEST_STEPS = 50
MOST_STEPS = 1_000_000


@dataclass(frozen=True, repr=False)
class Impact(Result):
    """One impact, from touch to lift-off. The patch is where the sphere touches.

    Attributes:
        psi_1: incidence ψ₁ = v_t/(κ v_n) of the patch, κ = μ E*/G*.
        psi_2: rebound ψ₂ of the patch, over the same κ v_n; positive if it continues in the same direction.
        restitution_normal: departure velocity over approach velocity.
        restitution_tangential: −ψ₂/ψ₁, positive if the patch reverses its direction.
        duration_over_delta_v: duration in units of δ_max/v_n, with the greatest penetration that was reached.
        duration_s: duration.
        greatest_penetration_m: greatest penetration δ_max.
        greatest_force_n: greatest normal force.
        centre_velocity_m_s: tangential velocity of the sphere's centre after the impact.
        spin_rad_s: spin after the impact.
        time_s: time from touch to lift-off, in steps.
        penetration_m: penetration δ.
        normal_force_n: normal force.
        friction_force_n: friction force on the sphere, negative where it slows the patch down.
        contact_state: 1 stick, 2 slip; between them 1 + the part of the brush that slips.
        patch_velocity_m_s: tangential velocity of the patch.
        solver_seconds: wall time that ngspice took.
        provenance: throw, law and ngspice's version, JSON-ready.
        deck: the netlist that was run.
    """

    psi_1: float
    psi_2: float
    restitution_normal: float
    restitution_tangential: float
    duration_over_delta_v: float
    duration_s: float
    greatest_penetration_m: float
    greatest_force_n: float
    centre_velocity_m_s: float
    spin_rad_s: float
    time_s: Array
    penetration_m: Array
    normal_force_n: Array
    friction_force_n: Array
    contact_state: Array
    patch_velocity_m_s: Array
    solver_seconds: float
    provenance: dict[str, Any] = field(repr=False)
    deck: str = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return the dimensionless result with audit and provenance, JSON-ready."""
        names = ("psi_1", "psi_2", "restitution_normal", "restitution_tangential", "duration_over_delta_v")
        return {**{name: getattr(self, name) for name in names}, **self.provenance}

    def columns(self) -> dict[str, Array]:
        """Return penetration, forces, state and velocity of the patch, over the time."""
        names = ("time_s", "penetration_m", "normal_force_n", "friction_force_n", "contact_state", "patch_velocity_m_s")
        return {name: getattr(self, name) for name in names}

    @property
    def audit(self) -> Audit:  # type: ignore[override]
        """The outcome of the physical audit."""
        return Audit(tuple(self.provenance["audit"]["findings"]))

    def summary(self) -> dict[str, str]:
        """Return law, incidence and rebound, restitutions, duration and greatest force."""
        return {
            "contact": str(self.provenance["contact"]),
            "ψ₁ → ψ₂": f"{self.psi_1:.4g} → {self.psi_2:.4g}",
            "restitution": f"{self.restitution_normal:.4f} normal, {self.restitution_tangential:.4f} tangential",
            "duration": f"{engineering(self.duration_s, 's')} = {self.duration_over_delta_v:.4f} δ/v",
            "greatest force": engineering(self.greatest_force_n, "N"),
            "greatest penetration": engineering(self.greatest_penetration_m, "m"),
            "spin after the impact": f"{self.spin_rad_s:.4g} rad/s",
        }


@checked
def impact(
    throw: Throw,
    contact: ContactLaw | None = "spring-slider",
    *,
    steps: int = STEPS,
    timeout: float | None = None,
    audit: bool = True,
) -> Impact:
    """Throw a sphere at a half-space and follow it until it lifts off.

    Args:
        throw: sphere, half-space and velocities.
        contact: law of the contact, as in ``simulate``.
        steps: number of time steps of an impact without loss.
        timeout: wall time in s after which ngspice is ended.
        audit: whether an impact that fails the physical audit is an error. If not, ``provenance["audit"]`` has what
            was found.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    law = touching_law(contact, "The sphere hits a half-space.")
    if not FEWEST_STEPS <= steps <= MOST_STEPS:
        raise ParameterError(f"steps = {steps} is not valid: it must be a whole number from {FEWEST_STEPS} to 1e6.")
    step = throw.duration_s / steps
    bench = Bench(impact_bench(throw, law=law, step=step), TRANSIENT_OPTIONS)
    vectors = ("vy", "vx", "centre", "spin", "normal", "friction", "state", "xcontact.delta")
    # a lossy impact lasts longer; e^(-0.36) is above all of Hunt and Crossley's
    end = 1.1 * throw.duration_s / throw.restitution**0.36
    outcome = transient(bench, [f"v({name})" for name in vectors], step=step, duration=end, timeout=timeout)
    start = {"time": 0.0, "v(vy)": throw.velocity_m_s, "v(vx)": throw.patch_velocity_m_s,
             "v(centre)": throw.centre_velocity_m_s, "v(spin)": throw.spin_rad_s}  # fmt: skip
    samples = {name: np.concatenate(([start.get(name, 0.0)], values)) for name, values in outcome.vectors().items()}
    findings = _audited(throw, samples)
    if audit:
        Audit(findings).withhold("impact")
    return _read(throw, samples, outcome, {**law.to_dict(), "audit": Audit(findings).to_dict()})


def _audited(throw: Throw, samples: dict[str, Array]) -> tuple[str, ...]:
    """Return what cannot be true about the forces and the energy of an impact."""
    before, after = (
        0.5 * throw.mass_kg * (samples["v(vy)"][at] ** 2 + samples["v(centre)"][at] ** 2)
        + 0.5 * throw.inertia_kg_m2 * samples["v(spin)"][at] ** 2
        for at in (0, -1)
    )
    forces = audit_contact(throw.friction, samples["v(normal)"], samples["v(friction)"])
    return forces + audit_impact(float(before), float(after))


def _read(throw: Throw, samples: dict[str, Array], outcome: Outcome, settings: dict[str, Any]) -> Impact:
    delta = 1e-6 * samples["v(xcontact.delta)"]
    open_again = np.flatnonzero(delta[1:] <= 0.0) + 1
    if not open_again.size:
        raise SimulationError("The sphere has not lifted off within the simulated time.")
    last = int(open_again[0])
    time = samples["time"]
    share = delta[last - 1] / (delta[last - 1] - delta[last])
    duration = float(time[last - 1] + share * (time[last] - time[last - 1]))
    depth, force = delta[:last], samples["v(normal)"][:last]
    greatest = _crest(depth)
    after = {name: float(samples[f"v({name})"][-1]) for name in ("vy", "vx", "centre", "spin")}
    scale = throw.limit_ratio * throw.velocity_m_s
    psi_2 = after["vx"] / scale
    within = slice(0, last + 1)
    return Impact(
        psi_1=throw.psi,
        psi_2=psi_2,
        restitution_normal=-after["vy"] / throw.velocity_m_s,
        restitution_tangential=-psi_2 / throw.psi,
        duration_over_delta_v=duration * throw.velocity_m_s / greatest,
        duration_s=duration,
        greatest_penetration_m=greatest,
        greatest_force_n=_crest(force),
        centre_velocity_m_s=after["centre"],
        spin_rad_s=after["spin"],
        time_s=time[within],
        penetration_m=np.maximum(delta[within], 0.0),
        normal_force_n=samples["v(normal)"][within],
        friction_force_n=-samples["v(friction)"][within],
        contact_state=np.concatenate((samples["v(state)"][1:2], samples["v(state)"][1 : last + 1])),
        patch_velocity_m_s=samples["v(vx)"][within],
        solver_seconds=outcome.seconds,
        provenance={
            "throw": throw.model_dump(),
            **settings,
            "deck_sha256": outcome.deck_sha256,
            "ngspice_version": outcome.ngspice_version,
        },
        deck=outcome.deck,
    )


def _crest(values: Array) -> float:
    """Return the greatest value, refined by a parabola through its neighbours; they are evenly spaced there."""
    index = int(np.argmax(values))
    if not 0 < index < len(values) - 1:
        return float(values[index])
    left, middle, right = values[index - 1 : index + 2]
    return float(middle + (left - right) ** 2 / (8.0 * (2.0 * middle - left - right)))
