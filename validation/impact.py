# SPDX-License-Identifier: GPL-3.0-or-later
r"""Oblique impact of an elastic sphere on an elastic half-space, in ngspice, with any contact law.

With :math:`v_n` the approach velocity and :math:`v_t` the tangential velocity of the contact patch, Maw, Barber and
Fawcett's dimensionless velocity is

.. math::
    \psi = \frac{v_t}{\kappa\,v_n}, \qquad \kappa = \mu\,\frac{E^*}{G^*} = \mu K_t K_N^{2/3};
    \qquad \frac{E^*}{G^*} = \frac{2-\nu}{2(1-\nu)}\text{ for two bodies of one material.}

κ is the ratio of the limit of stick to the penetration: a sphere that lands with ψ < 1 sticks at first. Sources: K. L.
Johnson, *Contact Mechanics*, Cambridge 1985, §11.4; N. Maw, J. R. Barber, J. N. Fawcett, "The oblique impact of elastic
spheres", Wear 38 (1976) 101–114.

``python -m validation.impact --contact brush --poisson 0.3 --psi 1.2 --json`` prints the result.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import gamma, pi, sqrt
from pathlib import Path
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes
from pydantic import model_validator

from pyspice_runner.circuit.bench import Bench
from pyspice_runner.circuit.law import PAPER_LAW, ContactLaw, Law, touching_law
from pyspice_runner.errors import ParameterError, SimulationError
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.parameters import Contact, quantity
from pyspice_runner.motor.refusal import Stated, checked
from pyspice_runner.result import Audit, Result
from pyspice_runner.run.audit import SLACK, audit_contact
from pyspice_runner.run.kernel import transient
from pyspice_runner.run.waveforms import Array
from pyspice_runner.units import engineering
from pyspice_runner.view import plots
from pyspice_runner.view.draw import Panel, Sheet, draw_lines, dress
from pyspice_runner.view.style import BLUE, LABELS, VERMILION, Label
from validation.contact_bench import contact_bench

STEPS = 1000  # of an impact without loss; the error of ψ₂ from the steps is then some 1e-5
FEWEST_STEPS = 50
MOST_STEPS = 1_000_000
_HALF_SPACE = 10.0  # m: radius of the rotor that represents a half-space; its curvature has no effect in this bench
# duration of a Hertz impact in units of δ_max/v: 2 ∫ dz/√(1 − z^(5/2)) from 0 to 1
DURATION = 0.8 * sqrt(pi) * gamma(0.4) / gamma(0.9)


class Throw(Stated):
    """Oblique impact of a solid elastic sphere on an elastic half-space, of the same material by default.

    Raises:
        ParameterError: for a value out of range.
    """

    psi: float = quantity("incidence ψ₁ of the contact patch", "1", gt=0.0, le=1e3, default=1.0)
    velocity_m_s: float = quantity("approach velocity v_n along the normal", "m/s", ge=1e-4, le=1e3, default=1.0)
    spin_rad_s: float = quantity("spin, positive where it moves the patch forward", "rad/s", ge=-1e7, le=1e7, default=0)
    friction: float = quantity("coefficient of friction μ", "1", ge=1e-4, le=5.0, default=0.2)
    restitution: float = quantity("coefficient of restitution along the normal", "1", ge=0.05, le=1.0, default=1.0)
    radius_m: float = quantity("radius of the sphere", "m", ge=1e-6, le=10.0, default=5e-3)
    density_kg_m3: float = quantity("density of the sphere", "kg/m³", ge=1.0, le=1e5, default=7850.0)
    youngs_modulus_pa: float = quantity("Young's modulus of the sphere", "Pa", ge=1e5, le=2e12, default=206e9)
    poisson: float = quantity("Poisson's ratio ν of the sphere", "1", ge=0.0, lt=0.5, default=0.3)
    half_space_youngs_modulus_pa: float | None = quantity(
        "Young's modulus of the half-space, if another", "Pa", ge=1e5, le=1e18, default=None
    )
    half_space_poisson: float | None = quantity(
        "Poisson's ratio of the half-space, if another", "1", ge=0.0, lt=0.5, default=None
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.greatest_penetration_m > 0.1 * self.radius_m:
            raise ValueError(
                f"velocity_m_s = {self.velocity_m_s:g} m/s gives a penetration of {self.greatest_penetration_m:.3g} m; "
                f"Hertz's theory holds up to a tenth of radius_m = {self.radius_m:g} m, so reduce the velocity"
            )
        return self

    @property
    def mass_kg(self) -> float:
        """Mass m of the sphere."""
        return 4.0 / 3.0 * pi * self.density_kg_m3 * self.radius_m**3

    @property
    def inertia_kg_m2(self) -> float:
        """Moment of inertia of the solid sphere, 2/5 m R²."""
        return 0.4 * self.mass_kg * self.radius_m**2

    @property
    def effective_modulus_pa(self) -> float:
        """Modulus E* of sphere and half-space."""
        modulus, poisson = self._half_space
        return contact_law.effective_modulus(self.youngs_modulus_pa, self.poisson, modulus, poisson)

    @property
    def contact(self) -> Contact:
        """Constants of the contact; the preload is the smallest force that the libraries accept."""
        modulus = self.effective_modulus_pa
        sides = [
            contact_law.tangential_compliance(youngs, poisson, modulus, self.radius_m)
            for youngs, poisson in ((self.youngs_modulus_pa, self.poisson), self._half_space)
        ]
        return Contact(
            normal_stiffness_n_per_m15=contact_law.normal_stiffness(modulus, self.radius_m),
            tangential_compliance_tip_m_per_n23=sides[0],
            tangential_compliance_rotor_m_per_n23=sides[1],
            friction=self.friction,
            preload_n=1e-6,
            restitution=self.restitution,
            restitution_velocity_m_s=self.velocity_m_s,
        )

    @property
    def limit_ratio(self) -> float:
        """Limit of stick relative to the penetration, κ = μ E*/G*."""
        return contact_law.limit_ratio(self.contact)

    @property
    def patch_velocity_m_s(self) -> float:
        """Tangential velocity v_t of the contact patch before the impact."""
        return self.psi * self.limit_ratio * self.velocity_m_s

    @property
    def centre_velocity_m_s(self) -> float:
        """Tangential velocity of the sphere's centre before the impact, v_t − R ω."""
        return self.patch_velocity_m_s - self.radius_m * self.spin_rad_s

    @property
    def greatest_penetration_m(self) -> float:
        """Hertz's δ_max = (5 m v²/(4 K_N))^(2/5), without loss."""
        stiffness = contact_law.normal_stiffness(self.effective_modulus_pa, self.radius_m)
        return float((1.25 * self.mass_kg * self.velocity_m_s**2 / stiffness) ** 0.4)

    @property
    def duration_s(self) -> float:
        """Hertz's duration 2.943 δ_max/v, without loss."""
        return DURATION * self.greatest_penetration_m / self.velocity_m_s

    @property
    def _half_space(self) -> tuple[float, float]:
        modulus, poisson = self.half_space_youngs_modulus_pa, self.half_space_poisson
        return (
            self.youngs_modulus_pa if modulus is None else modulus,
            self.poisson if poisson is None else poisson,
        )


@dataclass(frozen=True, repr=False)
class Impact(Result):
    """An impact, from touch to lift-off. The patch is the area of contact.

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
        solver_seconds: wall time of ngspice.
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
        return {**self._entries(*names), **self.provenance}

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
            "restitution, normal": f"{self.restitution_normal:.4f}",
            "restitution, tangential": f"{self.restitution_tangential:.4f}",
            "duration": f"{engineering(self.duration_s, 's')} = {self.duration_over_delta_v:.4f} δ/v",
            "greatest force": engineering(self.greatest_force_n, "N"),
            "greatest penetration": engineering(self.greatest_penetration_m, "m"),
            "spin after the impact": f"{self.spin_rad_s:.4g} rad/s",
        }


def impact_bench(throw: Throw, law: Law, step: float, title: str = "sphere thrown at a half-space") -> Bench:
    """Return the bench of a sphere that hits a half-space at t = 0. Run it with ``uic``.

    The sphere is the tip: its masses are capacitors (mobility analogy, 1 V = 1 m/s or 1 rad/s, 1 A = 1 N or 1 N.m) on
    the nodes ``vy`` (approach), ``centre`` and ``spin``; ``vx`` is the velocity of its contact patch. The contact is
    ``Xcontact``; ``step`` is the time step of the run in s.
    """
    constants = throw.contact
    seat = contact_law.static_penetration(constants)
    mass, radius = f"{throw.mass_kg:.10g}", f"{throw.radius_m:.10g}"
    lines = [
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
        f"Espin vx centre spin 0 {radius}",
    ]
    if "creep" in law.own:  # a thousandth of the velocity at ψ = 1
        law = law.updated({"creep": 1e-3 * throw.limit_ratio * throw.velocity_m_s})
    return contact_bench(
        lines, law, constants, radius=_HALF_SPACE, span=throw.greatest_penetration_m,
        step=step, title=title,
    )  # fmt: skip


@checked
def impact(
    throw: Throw,
    contact: ContactLaw | None = PAPER_LAW,
    *,
    steps: int = STEPS,
    timeout: float | None = None,
    audit: bool = True,
) -> Impact:
    """Simulate the impact of a sphere on a half-space, until it lifts off.

    Args:
        throw: sphere, half-space and velocities.
        contact: law of the contact, as in ``simulate``.
        steps: number of time steps of an impact without loss.
        timeout: wall time in s after which ngspice is ended.
        audit: whether findings of the physical audit are an error; if not, ``provenance["audit"]`` has them.

    Raises:
        ParameterError: for an invalid value.
        SimulationError: if ngspice fails or its result cannot be trusted.
    """
    law = touching_law(contact, "The sphere hits a half-space.")
    if not FEWEST_STEPS <= steps <= MOST_STEPS:
        raise ParameterError(f"steps = {steps} is not valid: it must be a whole number from {FEWEST_STEPS} to 1e6.")
    step = throw.duration_s / steps
    bench = impact_bench(throw, law, step)
    vectors = ("vy", "vx", "centre", "spin", "normal", "friction", "state", "xcontact.delta")
    # a lossy impact lasts longer; e^(-0.36) is above all of Hunt and Crossley's
    end = 1.1 * throw.duration_s / throw.restitution**0.36
    outcome = transient(bench, [f"v({name})" for name in vectors], step=step, duration=end, timeout=timeout)
    start = {"time": 0.0, "v(vy)": throw.velocity_m_s, "v(vx)": throw.patch_velocity_m_s,
             "v(centre)": throw.centre_velocity_m_s, "v(spin)": throw.spin_rad_s}  # fmt: skip
    samples = {name: np.concatenate(([start.get(name, 0.0)], values)) for name, values in outcome.vectors().items()}
    energy = 0.5 * throw.mass_kg * (samples["v(vy)"] ** 2 + samples["v(centre)"] ** 2)
    energy += 0.5 * throw.inertia_kg_m2 * samples["v(spin)"] ** 2
    forces = audit_contact(throw.friction, samples["v(normal)"], samples["v(friction)"])
    audited = Audit(forces + audit_impact(float(energy[0]), float(energy[-1])))
    if audit:
        audited.withhold("impact")
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
            **law.to_dict(),
            "audit": audited.to_dict(),
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


def audit_impact(before_j: float, after_j: float) -> tuple[str, ...]:
    """Return the physical violations in the energy of an impact, one sentence each."""
    if after_j <= (1.0 + SLACK) * before_j:
        return ()
    finding = (
        f"The energy of the sphere rises from {before_j:.4g} J to {after_j:.4g} J in the impact, which is not "
        "possible. The steps are likely too coarse: double their number."
    )
    return (finding,)


def sheet(result: Impact) -> Sheet:
    """Return the forces of an impact, the velocity of the contact patch, and the part of it that slips."""
    time = LABELS["time_us"], result.time_s

    forces = [
        (result.normal_force_n, {"color": BLUE, "label": "normal"}),
        (result.friction_force_n, {"color": VERMILION, "linestyle": "--", "label": "friction, on the sphere"}),
    ]
    velocity, velocities = Label("velocity", "m/s"), [(result.patch_velocity_m_s, {"color": BLUE})]

    def draw_slip(ax: Axes) -> None:
        slip = np.clip(result.contact_state - 1.0, 0.0, 1.0)
        ax.plot(time[0].scale * time[1], slip, color=VERMILION)
        dress(ax, time[0], "part of the contact", "Slip")
        ax.set_ylim(-0.05, 1.05)

    law, poisson = result.provenance["contact"], result.provenance["throw"]["poisson"]
    title = f"{law}, ν = {poisson:g}: ψ = {result.psi_1:.4g} rebounds as {result.psi_2:.4g}"
    panels: dict[str, Panel] = {
        "forces": lambda ax: draw_lines(ax, time, LABELS["force_n"], forces, "Forces"),
        "velocity": lambda ax: draw_lines(ax, time, velocity, velocities, "Tangential velocity of the contact patch"),
        "slip": draw_slip,
    }
    return Sheet(panels, 1, (8.0, 2.7), title)


plots.sheet.register(sheet)
_OPTIONS = {  # of the command → field of the throw
    "psi": "psi", "velocity": "velocity_m_s", "spin": "spin_rad_s", "friction": "friction",
    "restitution": "restitution", "radius": "radius_m", "density": "density_kg_m3",
    "youngs_modulus": "youngs_modulus_pa", "poisson": "poisson",
}  # fmt: skip


def main(arguments: Sequence[str]) -> int:
    """Simulate an impact by the options of a command line; return the exit status, 2 for input that is refused."""
    parser = argparse.ArgumentParser("python -m validation.impact", description=impact.__doc__)
    parser.add_argument("--contact", default="spring-slider", help="law, or the path of a .lib file")
    parser.add_argument("--sliders", type=int, help="number of sliders of the brush")
    for option, name in _OPTIONS.items():
        item = Throw.model_fields[name]
        meaning = str(item.description).replace("%", "%%")
        parser.add_argument(f"--{option.replace('_', '-')}", type=float, default=item.default, help=meaning)
    parser.add_argument("--timeout", type=float, help="wall time in s after which ngspice is ended")
    parser.add_argument("--no-audit", dest="audit", action="store_false", help="keep a result that fails the audit")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--output", type=Path, help="write .csv (over time), .json or .cir (the deck)")
    parser.add_argument("--plot", type=Path, help="write a .png, .svg or .pdf")
    given = vars(parser.parse_args(arguments))
    try:
        throw = Throw(**{name: given[option] for option, name in _OPTIONS.items()})
        law = Law(given["contact"], given["sliders"])
        result = impact(throw, law, timeout=given["timeout"], audit=given["audit"])
        for path, write in ((given["output"], result.save), (given["plot"], result.plot)):
            if path is not None:
                write(path)
    except (ParameterError, SimulationError) as error:
        print(error, file=sys.stderr)
        return 3 if isinstance(error, SimulationError) else 2
    rows = json.dumps(result.to_dict(), ensure_ascii=False) if given["json"] else "\n".join(
        f"{name}: {value}" for name, value in result.summary().items()
    )  # fmt: skip
    print(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
