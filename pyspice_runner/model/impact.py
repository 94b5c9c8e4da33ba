# SPDX-License-Identifier: GPL-3.0-or-later
r"""Oblique impact of an elastic sphere, with or without spin, on an elastic half-space.

With :math:`v_n` the approach velocity and :math:`v_t` the tangential velocity of the contact patch, Maw, Barber and
Fawcett's dimensionless velocity is

.. math::
    \psi = \frac{v_t}{\kappa\,v_n}, \qquad \kappa = \mu\,\frac{E^*}{G^*} = \mu K_t K_N^{2/3};
    \qquad \frac{E^*}{G^*} = \frac{2-\nu}{2(1-\nu)}\text{ for two bodies of one material.}

κ is the ratio of the limit of stick to the penetration: a sphere that lands with ψ < 1 sticks at first. Sources: K. L.
Johnson, *Contact Mechanics*, Cambridge 1985, §11.4; N. Maw, J. R. Barber, J. N. Fawcett, "The oblique impact of elastic
spheres", Wear 38 (1976) 101–114.
"""

from __future__ import annotations

from math import gamma, pi, sqrt
from typing import Self

from pydantic import model_validator

from pyspice_runner.model import contact as law
from pyspice_runner.model.parameters import Contact, quantity
from pyspice_runner.model.refusal import Stated

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
                f"velocity_m_s = {self.velocity_m_s:g} m/s presses the sphere in by {self.greatest_penetration_m:.3g} "
                f"m; Hertz's theory holds to a tenth of radius_m = {self.radius_m:g} m at most, so throw it slower"
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
        return law.effective_modulus(self.youngs_modulus_pa, self.poisson, modulus, poisson)

    @property
    def contact(self) -> Contact:
        """Constants of the contact; the preload is the smallest force that the libraries accept."""
        modulus = self.effective_modulus_pa
        sides = [
            law.tangential_compliance(youngs, poisson, modulus, self.radius_m)
            for youngs, poisson in ((self.youngs_modulus_pa, self.poisson), self._half_space)
        ]
        return Contact(
            normal_stiffness_n_per_m15=law.normal_stiffness(modulus, self.radius_m),
            tangential_compliance_tip_m_per_n23=sides[0],
            tangential_compliance_rotor_m_per_n23=sides[1],
            friction=self.friction,
            preload_n=1e-6,
            restitution=self.restitution,
            restitution_velocity_m_s=self.velocity_m_s,
        )

    @property
    def limit_ratio(self) -> float:
        """Limit of stick over penetration, κ = μ E*/G*."""
        return law.limit_ratio(self.contact)

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
        stiffness = law.normal_stiffness(self.effective_modulus_pa, self.radius_m)
        return float((1.25 * self.mass_kg * self.velocity_m_s**2 / stiffness) ** 0.4)

    @property
    def greatest_force_n(self) -> float:
        """Hertz's F_max = K_N δ_max^(3/2), without loss."""
        return float(law.normal_stiffness(self.effective_modulus_pa, self.radius_m) * self.greatest_penetration_m**1.5)

    @property
    def duration_s(self) -> float:
        """Hertz's duration 2.943 δ_max/v, without loss."""
        return DURATION * self.greatest_penetration_m / self.velocity_m_s

    @property
    def gross_slip_psi(self) -> float:
        """Rebound ψ₂ of an impact that slips to its end: ψ₁ − 7/2 (1 + e) G*/E*."""
        return self.psi - 3.5 * (1.0 + self.restitution) * self.friction / self.limit_ratio

    @property
    def _half_space(self) -> tuple[float, float]:
        modulus, poisson = self.half_space_youngs_modulus_pa, self.half_space_poisson
        return (
            self.youngs_modulus_pa if modulus is None else modulus,
            self.poisson if poisson is None else poisson,
        )
