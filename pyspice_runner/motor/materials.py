# SPDX-License-Identifier: GPL-3.0-or-later
"""From what the constants of a contact follow: the materials of tip and rotor, or a lining."""

from __future__ import annotations

from math import inf
from typing import ClassVar, Self

from pydantic import Field, model_validator

from pyspice_runner.motor import contact as contact_law
from pyspice_runner.motor.parameters import SOFTEST, Parameters, quantity, stiffest


class Materials(Parameters):
    """Materials of tip and rotor, or slider, from which K_N and K_t follow (paper eqs. 4 and 13–15)."""

    TABLE: ClassVar[str] = "materials"
    # constants of the contact that cannot be changed alone, and what to change
    ONLY: ClassVar[dict[str, str]] = {"effective_radius_m": "tip_radius_m", "poisson": "tip_poisson"}
    tip_radius_m: float = quantity("radius of the tip's cap", "m", gt=1e-6, le=10.0)
    tip_youngs_modulus_pa: float = quantity("Young's modulus of the tip", "Pa", ge=1e8, le=2e12)
    tip_poisson: float = quantity("Poisson's ratio of the tip", "1", ge=0.0, lt=0.5)
    rotor_youngs_modulus_pa: float = quantity("Young's modulus of the rotor, or of the slider", "Pa", ge=1e8, le=2e12)
    rotor_poisson: float = quantity("Poisson's ratio of the rotor, or of the slider", "1", ge=0.0, lt=0.5)
    on_face: bool = Field(default=False, description="whether the tip runs on the flat face of a rotor, not on its rim")

    def constants(self, rotor_radius_m: float) -> dict[str, float]:
        """Return K_N, K_t1, K_t2, R* and the tip's ν under the names of :class:`Contact`.

        A flat slider and the face of a rotor have an infinite radius.
        """
        tip = self.tip_youngs_modulus_pa, self.tip_poisson
        rotor = self.rotor_youngs_modulus_pa, self.rotor_poisson
        modulus = contact_law.effective_modulus(*tip, *rotor)
        radius = contact_law.effective_radius(self.tip_radius_m, inf if self.on_face else rotor_radius_m)
        return {
            "normal_stiffness_n_per_m15": contact_law.normal_stiffness(modulus, radius),
            "tangential_compliance_tip_m_per_n23": contact_law.tangential_compliance(*tip, modulus, radius),
            "tangential_compliance_rotor_m_per_n23": contact_law.tangential_compliance(*rotor, modulus, radius),
            "effective_radius_m": radius,
            "poisson": self.tip_poisson,
        }


class Lining(Parameters):
    """A lining, or rough surfaces: F_N = K δ^p, from which the contact's constants follow.

    K is given for the whole contact, per area, or by a layer of thickness h. A layer that bulges freely has E A/h. With
    Poisson's ratio the layer is wide and bonded: E (1 − ν)/((1 + ν)(1 − 2ν)) A/h, and E/(2 + 2ν) A/h along the tangent.
    The loss factor η holds for small vibrations under the preload at the frequency f where 2π f δ₀ is
    ``contact.restitution_velocity_m_s``, with the static penetration δ₀; it grows in proportion to f.
    """

    TABLE: ClassVar[str] = "lining"
    ONLY: ClassVar[dict[str, str]] = {"exponent": "exponent"}
    exponent: float = quantity("exponent p", "1", ge=1.0, le=3.5, default=1.0)
    stiffness_n_per_m: float | None = quantity("K, N/m^p", "N/m", ge=1e3, le=1e25, default=None)
    stiffness_n_per_m3: float | None = quantity("K/A, N/m^(p+2)", "N/m³", ge=1e6, le=1e36, default=None)
    youngs_modulus_pa: float | None = quantity("E of the layer", "Pa", ge=1e4, le=2e12, default=None)
    thickness_m: float | None = quantity("thickness h of the layer", "m", ge=1e-8, le=0.1, default=None)
    poisson: float | None = quantity("ν of the layer, if bonded", "1", ge=0.0, le=0.49, default=None)
    area_m2: float | None = quantity("area A", "m²", ge=1e-14, le=1.0, default=None)
    tangential_stiffness_n_per_m: float | None = quantity("along the tangent", "N/m", ge=1.0, le=1e13, default=None)
    stiffness_ratio: float | None = quantity("normal over tangential stiffness", "1", ge=0.1, le=100.0, default=None)
    loss_factor: float | None = quantity("loss factor η", "1", ge=1e-3, le=1.0, default=None)

    @model_validator(mode="after")
    def _check(self) -> Self:
        ways = (
            ("stiffness_n_per_m", "stiffness_n_per_m3", "youngs_modulus_pa"),
            ("stiffness_ratio", "tangential_stiffness_n_per_m", "poisson"),
        )
        given = {name for names in ways for name in names if getattr(self, name) is not None}
        for names in ways:
            if len(found := sorted(given.intersection(names))) != 1:
                raise ValueError(
                    f"specify one of {', '.join(names)}; there are {' and '.join(found) or 'none of them'}"
                )
        layer, per_area = {"youngs_modulus_pa"}, {"stiffness_n_per_m3", "youngs_modulus_pa"}
        for name, users in (("area_m2", per_area), ("thickness_m", layer), ("poisson", layer)):
            stated = getattr(self, name) is not None
            if stated != bool(given & users) and (stated or name != "poisson"):
                raise ValueError(f"{name} belongs to {' or '.join(sorted(users))}: specify both, or leave out both")
        if self.exponent != 1.0 and given & {"youngs_modulus_pa", "tangential_stiffness_n_per_m"}:
            raise ValueError(f"exponent = {self.exponent:g} must be 1 with {' and '.join(sorted(given))}")
        normal, most = self.constants(inf)["normal_stiffness_n_per_m15"], stiffest(self.exponent)
        if not SOFTEST <= normal <= most:
            written = ", ".join(f"{name} = {value:g}" for name, value in self if value is not None)
            allowed = f"it must be {SOFTEST:g} to {most:.3g}, so correct one of them"
            raise ValueError(f"{written}: K is {normal:.4g} N/m^{self.exponent:g}; {allowed}")
        return self

    def constants(self, _: float) -> dict[str, float]:
        """Return exponent, K_N, K_t and, of one with a loss factor, the restitution, as :class:`Contact` names them."""
        area, ratio = self.area_m2 or 0.0, self.stiffness_ratio or 0.0
        normal = self.stiffness_n_per_m or (self.stiffness_n_per_m3 or 0.0) * area
        if self.youngs_modulus_pa is not None and self.thickness_m is not None:
            normal = self.youngs_modulus_pa * area / self.thickness_m
            if (poisson := self.poisson) is not None:
                normal *= (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
                ratio = 2.0 * (1.0 - poisson) / (1.0 - 2.0 * poisson)
        if self.tangential_stiffness_n_per_m:
            ratio = normal / self.tangential_stiffness_n_per_m
        found = {
            "exponent": self.exponent, "normal_stiffness_n_per_m15": normal,
            "tangential_compliance_tip_m_per_n23": ratio / normal ** (1.0 / self.exponent),
            "tangential_compliance_rotor_m_per_n23": 0.0,
        }  # fmt: skip
        # a small vibration has the loss factor a ω δ₀/p, so that a v = p η
        loss = {"restitution": contact_law.restitution(self.exponent * self.loss_factor)} if self.loss_factor else {}
        return found | loss


Source = Materials | Lining  # of the contact's constants
SOURCES: tuple[type[Source], ...] = (Materials, Lining)
