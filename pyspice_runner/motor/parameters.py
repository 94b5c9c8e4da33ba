# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of a motor: name, unit, range and meaning, each declared once.

Every class is a frozen pydantic model; :func:`quantity` gives a field its unit, so that error messages, the
parameter table of the documentation and the command line all read the same declaration. Names end in their
unit (SI throughout). The origin of a value is stated in the parameter set.
"""

from __future__ import annotations

from collections.abc import Generator
from functools import cached_property
from math import pi, sqrt
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.groups import GROUPS

# Ranges are those of piezo motors that can be built, from MEMS to some kilograms: wide enough for any device that the
# theory fits, narrow enough to catch a value given in mm, kHz or GPa. Relations between values are checked here,
# in Motor and in model/drive.py; `make soak` runs motors drawn from the whole range.

MIN_CAPACITANCE = 1e-15  # F, of a group: the minimum of its library


def quantity(description: str, unit: str, **limits: Any) -> Any:
    """Declare a physical quantity: its meaning, its unit and (``gt``, ``ge``, ``lt``, ``le``) its range."""
    return Field(description=description, json_schema_extra={"unit": unit}, allow_inf_nan=False, **limits)


def label(description: str) -> Any:
    """Declare a name that can stand in a dotted path."""
    made_of: dict[str, Any] = {"made_of": "letters, digits, - and _, the first a letter"}
    pattern = r"^[A-Za-z][A-Za-z0-9_-]*$"
    return Field(description=description, min_length=1, max_length=40, pattern=pattern, json_schema_extra=made_of)


class Parameters(BaseModel):
    """Base of all parameter classes: immutable, strict about unknown names."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, use_attribute_docstrings=False)

    def __setattr__(self, name: str, value: object) -> None:
        """Raise a :class:`ParameterError` that names ``updated``, which returns a changed copy."""
        if name.startswith("_"):
            super().__setattr__(name, value)
            return
        raise ParameterError(
            f"{type(self).__name__}: {name} cannot be assigned. The method updated of the motor or the drive returns a "
            "changed copy."
        )

    # what cached properties hold follows from the fields, so that only these are listed, copied and pickled

    def __iter__(self) -> Generator[tuple[str, Any], None, None]:
        """Yield the names and values of the fields."""
        yield from [item for item in super().__iter__() if item[0] in type(self).model_fields]

    def __copy__(self) -> Self:
        """Return a copy of the fields, also for ``model_copy``."""
        copied = super().__copy__()
        object.__setattr__(copied, "__dict__", dict(self))
        return copied

    def __getstate__(self) -> dict[Any, Any]:
        """Return the fields for pickle."""
        return super().__getstate__() | {"__dict__": dict(self)}


class Beam(Parameters):
    """The bare elastic beam, simply supported at both ends, uniform and rectangular."""

    length_m: float = quantity("distance between the two supports", "m", gt=1e-4, le=1.0)
    width_m: float = quantity("width, across the bending plane", "m", gt=1e-5, le=0.5)
    thickness_m: float = quantity("height in the bending plane", "m", gt=1e-5, le=0.5)
    youngs_modulus_pa: float = quantity("Young's modulus", "Pa", ge=1e8, le=2e12)
    density_kg_m3: float = quantity("density", "kg/m³", ge=100.0, le=3e4)
    theory: Literal["timoshenko", "bernoulli-euler"] = Field(
        default="timoshenko", description="with or without shear and rotary inertia of the sections"
    )
    poissons_ratio: float = quantity("Poisson's ratio, for the shear stiffness", "1", ge=0.0, le=0.49, default=0.3)
    recoil: bool = Field(default=True, description="whether the modes have recoil Γ")


class Patch(Parameters):
    """One piezoceramic patch, or a pair of them on opposite faces, wired to one electrical group.

    A pair is poled such that the same voltage stretches the upper patch and shortens the lower one.
    """

    group: Literal["A", "B"] = Field(description="group of the electrodes")
    faces: Literal["both", "top", "bottom"] = Field(description="faces of the beam that carry the ceramic")
    start_m: float = quantity("left end, from the left support", "m", ge=0.0, le=1.0)
    end_m: float = quantity("right end, from the left support", "m", gt=0.0, le=1.0)
    width_m: float = quantity("width", "m", gt=1e-5, le=0.5)
    thickness_m: float = quantity("total thickness on each face, all layers together", "m", gt=1e-6, le=0.1)
    layers: Annotated[int, Field(description="active layers on each face, electrically in parallel", ge=1, le=500)]
    youngs_modulus_pa: float = quantity("Young's modulus at constant field, 1/s₁₁ᴱ", "Pa", ge=1e8, le=1e12)
    density_kg_m3: float = quantity("density", "kg/m³", ge=100.0, le=3e4)
    piezoelectric_constant_m_per_v: float = quantity(
        "transverse charge constant d₃₁, usually negative", "m/V", ge=-5e-9, le=5e-9
    )
    permittivity_f_m: float = quantity("permittivity at constant stress, ε₃₃ᵀ", "F/m", ge=8.8e-12, le=1e-6)
    poissons_ratio: float = quantity("Poisson's ratio, for the shear stiffness", "1", ge=0.0, le=0.49, default=0.3)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.end_m <= self.start_m:
            raise ValueError(f"end_m = {self.end_m:g} m must lie to the right of start_m = {self.start_m:g} m")
        coupling_squared = self.piezoelectric_constant_m_per_v**2 * self.youngs_modulus_pa / self.permittivity_f_m
        if coupling_squared >= 1.0:
            raise ValueError(
                f"piezoelectric_constant_m_per_v = {self.piezoelectric_constant_m_per_v:g} m/V gives a coupling "
                f"k₃₁² = {coupling_squared:.3g}; a ceramic stays below 1"
            )
        return self


class Tip(Parameters):
    """The tip that touches the rotor: rigid and joined to the beam in a point, or on an elastic foot and stem."""

    position_m: float = quantity("foot of the tip, from the left support", "m", ge=0.0, le=1.0)
    length_m: float = quantity("from the beam's neutral axis to the contact point", "m", ge=0.0, le=0.5)
    mass_kg: float = quantity("mass, including the stem", "kg", ge=0.0, le=1.0)
    rotary_inertia_kg_m2: float = quantity("moment of inertia about the beam's neutral axis", "kg·m²", ge=0.0, le=1e-2)
    foot_width_m: float = quantity(
        "width of foot and stem along the beam; 0: joined to it in a point, rigidly", "m", ge=0.0, le=0.5, default=0.0
    )
    centre_m: float | None = quantity(
        "from the beam's neutral axis to the centre of mass; needed with a foot", "m", ge=0.0, le=0.5, default=None
    )
    stem_length_m: float = quantity(
        "length of the elastic stem between the beam's face and the rigid head", "m", ge=0.0, le=0.5, default=0.0
    )
    stem_youngs_modulus_pa: float | None = quantity(
        "Young's modulus of the stem; needed with a stem", "Pa", ge=1e8, le=2e12, default=None
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        foot, stem = self.foot_width_m > 0.0, self.stem_length_m > 0.0
        if stem != (self.stem_youngs_modulus_pa is not None) or (stem and not foot):
            raise ValueError(
                "an elastic stem needs foot_width_m, stem_length_m and stem_youngs_modulus_pa together; state all "
                "three, or none for a rigid tip"
            )
        if foot != (self.centre_m is not None):
            raise ValueError(
                "an elastic foot needs foot_width_m and centre_m, the height of the centre of mass; state both, or "
                "neither for a rigid tip"
            )
        least = self.mass_kg * (self.centre_m or 0.0) ** 2
        if self.rotary_inertia_kg_m2 < least:
            raise ValueError(
                f"rotary_inertia_kg_m2 = {self.rotary_inertia_kg_m2:g} kg·m² is less than mass_kg · centre_m² = "
                f"{least:.3g} kg·m²; it is about the beam's neutral axis, so correct one of the three"
            )
        return self


class Damping(Parameters):
    """Rayleigh damping, C = α M + β K (paper eq. 19)."""

    alpha_per_s: float = quantity("mass-proportional coefficient α", "1/s", ge=0.0, le=1e7)
    beta_s: float = quantity("stiffness-proportional coefficient β", "s", ge=0.0, le=1e-2)

    def modal(self, mass_kg: float, stiffness_n_per_m: float) -> float:
        """Return the modal damping c = α m + β k in N·s/m."""
        return self.alpha_per_s * mass_kg + self.beta_s * stiffness_n_per_m


class Mode(Parameters):
    """One bending mode: the motional arm of the Butterworth–Van Dyke circuit and its couplings.

    m r̈ + c ṙ + k r = θ_A U_A + θ_B U_B + X F_x + Y F_y − Γ z̈ − Γₓ z̈ₓ, with r the modal coordinate (m), and z̈ and z̈ₓ
    the accelerations of the carrier, which are 0 without a mount.
    """

    # A mass from a MEMS plate 10 µm across to the 1 kg of modes normalised by their mass, and beyond. Couplings and tip
    # motions depend on the normalisation; Motor limits them by quantities that do not: coupling factor and stiffness.
    name: str = label("name of the mode")
    mass_kg: float = quantity("modal mass m, the arm's inductance", "kg", gt=1e-12, le=1e3)
    damping_n_s_per_m: float = quantity("modal damping c, the arm's resistance", "N·s/m", ge=1e-12, le=1e9)
    stiffness_n_per_m: float = quantity("modal stiffness k, one over the arm's capacitance", "N/m", gt=1e-3, le=1e15)
    coupling_a_n_per_v: float = quantity("force per volt of group A, θ_A", "N/V", ge=-1e4, le=1e4)
    coupling_b_n_per_v: float = quantity("force per volt of group B, θ_B", "N/V", ge=-1e4, le=1e4)
    tip_x: float = quantity("tangential tip displacement per modal coordinate, X", "1", ge=-1e4, le=1e4)
    tip_y: float = quantity("tip displacement towards the rotor per modal coordinate, Y", "1", ge=-1e4, le=1e4)
    softening_per_m2: float = quantity(
        "softening γ of the elastic force k r (1 − γ r²) at large amplitude", "1/m²", ge=0.0, le=1e18, default=0.0
    )
    damping_growth_per_m2: float = quantity(
        "growth κ of the damping force c ṙ (1 + κ r²) with amplitude", "1/m²", ge=0.0, le=1e18, default=0.0
    )

    recoil_kg: float | None = quantity(
        "recoil Γ on the carrier of a mount: momentum along y per modal velocity", "kg", ge=-1e3, le=1e3, default=None
    )
    recoil_x_kg: float | None = quantity(
        "recoil Γₓ along x, on a carrier that moves along the rotor, too", "kg", ge=-1e3,
        le=1e3, default=None,
    )  # fmt: skip

    @cached_property
    def couplings(self) -> tuple[float, ...]:
        """Force per volt of each group in N/V."""
        return self.coupling_a_n_per_v, self.coupling_b_n_per_v

    @cached_property
    def linear(self) -> bool:
        """Whether stiffness and damping do not depend on the amplitude."""
        return self.softening_per_m2 == self.damping_growth_per_m2 == 0.0

    @cached_property
    def frequency_hz(self) -> float:
        """Undamped natural frequency √(k/m)/2π in Hz."""
        return sqrt(self.stiffness_n_per_m / self.mass_kg) / (2.0 * pi)

    @property
    def arm(self) -> dict[str, float]:
        """Resistance, inductance and capacitance of the motional arm that group A sees, without a load."""
        square = self.coupling_a_n_per_v**2
        values = self.damping_n_s_per_m / square, self.mass_kg / square, square / self.stiffness_n_per_m
        return dict(zip(("resistance_ohm", "inductance_h", "capacitance_f"), values, strict=True))

    @property
    def quality_factor(self) -> float:
        """Mechanical quality factor √(k m)/c."""
        return sqrt(self.stiffness_n_per_m * self.mass_kg) / self.damping_n_s_per_m


def _motion(along: str, group: str) -> Any:
    """Return the field of the motion of the contact per volt on a group."""
    meaning = f"tip motion {along} per volt on {group}, by modes left out"
    return quantity(meaning, "m/V", ge=-1e-6, le=1e-6, default=0.0)


class Piezo(Parameters):
    """Electrical values of both groups with the beam clamped.

    The charges are Q_A = C_A U_A − C_AB U_B and Q_B = C_B U_B − C_AB U_A: each capacitance is that with the other group
    shorted. A force F on the tip adds S F to each, with S the motion per volt: the spring that S moves is that in
    series with the contact, and the capacitances are those without a force on it.
    """

    capacitance_a_f: float = quantity("clamped capacitance of group A at 100 kHz", "F", gt=MIN_CAPACITANCE, le=1e-3)
    capacitance_b_f: float | None = quantity(  # of a transducer with one group not given
        "clamped capacitance of group B at 100 kHz", "F", gt=MIN_CAPACITANCE, le=1e-3, default=None
    )
    capacitance_ab_f: float = quantity(
        "capacitance C_AB between the groups at 100 kHz, a part of both others", "F", ge=-1e-3, le=1e-3, default=0.0
    )
    loss_tangent: float = quantity("dielectric loss tangent, the same from 1 kHz to 10 MHz", "1", ge=0.0, le=0.5)
    motion_x_a_m_per_v: float = _motion("along the rotor", "A")
    motion_x_b_m_per_v: float = _motion("along the rotor", "B")
    motion_y_a_m_per_v: float = _motion("towards the rotor", "A")
    motion_y_b_m_per_v: float = _motion("towards the rotor", "B")
    # of the capacitances of a transducer; not given: 100 kHz
    reference_hz: float | None = quantity("frequency at which they hold", "Hz", ge=1.0, le=1e9, default=None)

    @model_validator(mode="after")
    def _check(self) -> Self:
        smaller = min(self.capacitances)
        if self.capacitance_ab_f and self.capacitance_b_f is None:
            raise ValueError("capacitance_ab_f lies between two groups: specify capacitance_b_f, or leave it out")
        if abs(self.capacitance_ab_f) >= smaller:
            raise ValueError(
                f"capacitance_ab_f = {self.capacitance_ab_f:g} F is a part of the capacitances of both groups, and the "
                f"smaller is {smaller:g} F; correct one of them"
            )
        return self

    @model_serializer(mode="wrap")
    def _stated(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Return the values without those of a transducer that are not given."""
        found: dict[str, Any] = write(self)
        for name in ("capacitance_b_f", "reference_hz"):
            if found.get(name) is None:
                found.pop(name, None)
        return found

    @cached_property
    def capacitances(self) -> tuple[float, ...]:
        """Clamped capacitance of each group in F, the others shorted."""
        return tuple(own for own in (self.capacitance_a_f, self.capacitance_b_f) if own is not None)

    def capacitance_f(self, group: str) -> float:
        """Return the clamped capacitance of group ``a`` or ``b`` in F, the other shorted."""
        return self.capacitances[GROUPS.index(group)]

    @property
    def matrix(self) -> tuple[tuple[float, ...], ...]:
        """Charges of the groups per volt on each, in F."""
        between, own = -self.capacitance_ab_f, self.capacitances
        return tuple(tuple(value if at == by else between for by in range(len(own))) for at, value in enumerate(own))

    @property
    def motion(self) -> tuple[tuple[float, ...], ...]:
        """Static motion of the tip along x and y per volt on each group, by modes that are left out, in m/V."""
        count = len(self.capacitances)
        along = self.motion_x_a_m_per_v, self.motion_x_b_m_per_v
        return along[:count], (self.motion_y_a_m_per_v, self.motion_y_b_m_per_v)[:count]


class Feedback(Parameters):
    """A feedback electrode: a third group, which no source drives, as a sensor of the vibration.

    Its voltage is U_F = w + s_A U_A + s_B U_B, with C_F ẇ + w/R = −Σ θ_Fn ṙ_n, and the forces θ_Fn w act on the modes.
    Their stiffness is that with the electrode shorted; on a large R it adds θ_F²/C_F. Capacitances and force factors of
    groups A and B are those with the electrode open.
    """

    capacitance_f: float = quantity(
        "clamped capacitance C_F, including cable and amplifier", "F", gt=MIN_CAPACITANCE, le=1e-3
    )
    # with a larger one a charge would stay for more than minutes
    resistance_ohm: float = quantity(
        "resistance R of its amplifier and dielectric loss", "Ω", ge=1.0, le=1e10, default=1e7
    )
    couplings_n_per_v: dict[str, Annotated[float, Field(allow_inf_nan=False)]] = Field(
        description="force per volt θ_F on modes, by their names", json_schema_extra={"unit": "N/V"}
    )
    share_a: float = quantity("its voltage s_A per volt on A, the modes held", "1", ge=-1.0, le=1.0, default=0.0)
    share_b: float = quantity("the same s_B of B", "1", ge=-1.0, le=1.0, default=0.0)

    @property
    def corner_hz(self) -> float:
        """Frequency 1/(2π R C_F) in Hz below which the resistance discharges the electrode."""
        return 1.0 / (2.0 * pi * self.resistance_ohm * self.capacitance_f)

    @property
    def shares(self) -> tuple[float, float]:
        """Voltage of the electrode per volt on groups A and B while the modes are held."""
        return self.share_a, self.share_b


SOFTEST_SIDES = 0.01  # m/N^(2/3), the maximum of the contact's library
# K_t K_N^(1/p) = E*/G*, of elastic bodies with Poisson's ratios from 0 to 0.5: 1 to 1.5. A layer that only shears makes
# it larger, a value identified from a run may be smaller; a factor of ten each way, and ten more for soft layers.
SOFTNESS = (0.1, 100.0)


FLATTEST_TIP = 0.3  # worn flat over effective radius: the cap is taken for a paraboloid
HERTZ = 1.5  # exponent of Hertz's contact
SOFTEST = 1e3  # N/m^p
STIFFEST_HERTZ = 1e13  # N/m^1.5; with another exponent, what gives the same force at a micrometre


def stiffest(exponent: float) -> float:
    """Return the maximum of K_N in N/m^p for an exponent p."""
    return float(STIFFEST_HERTZ * 1e6 ** (exponent - HERTZ))


class Contact(Parameters):
    """Normal contact by a power law, Hertz's by default, with a spring–slider along the tangent (paper eqs. 13–18)."""

    # 4/3 E* √R* of rubber (1e6 Pa) round to a micrometre: 1e3; of diamond (1e12 Pa) on a flat slide (R* = 10 m): 4e12
    normal_stiffness_n_per_m15: float = quantity("K_N of F_N = K_N δ^p, N/m^p", "N/m^1.5", ge=SOFTEST, le=1e25)
    tangential_compliance_tip_m_per_n23: float = quantity(
        "K_t1 of u₁ = μ K_t1 F_N^(1/p) at the limit of stick, tip side", "m/N^(2/3)", ge=0.0, le=1e-2
    )
    tangential_compliance_rotor_m_per_n23: float = quantity(
        "K_t2, the same on the rotor's side", "m/N^(2/3)", ge=0.0, le=1e-2
    )
    # graphite at its most slippery has 1e-4 and more, clean rubber up to 4
    friction: float = quantity("coefficient of friction μ", "1", ge=1e-4, le=5.0)
    # a lining has 1, machined surfaces about 2, fine rough ones up to 3.5
    exponent: float = quantity("exponent p: Hertz 1.5, lining 1", "1", ge=1.0, le=3.5, default=HERTZ)
    # micronewtons press a MEMS rotor, kilonewtons the largest ring motors
    preload_n: float = quantity("static normal force F₀", "N", ge=1e-6, le=1e5)
    restitution: float = quantity(
        "coefficient of restitution along the normal; 1 is no loss", "1", ge=0.05, le=1.0, default=1.0
    )
    restitution_velocity_m_s: float = quantity(
        "approach velocity at which the coefficient of restitution holds", "m/s", ge=1e-4, le=1e3, default=0.1
    )
    # handbooks give 0.6 to 0.9 for dry metals and ceramics
    sliding_ratio: float = quantity(
        "friction of fast sliding over that at the limit of stick (Stribeck); 1 is none",
        "1",
        ge=0.01,
        le=1.0,
        default=1.0,
    )
    stribeck_velocity_m_s: float = quantity(
        "velocity v_s of exp(−(v/v_s)²), by which friction falls with the slip velocity", "m/s", ge=1e-6, le=1e3,
        default=0.05,
    )  # fmt: skip
    series_compliance_m_per_n: float = quantity(
        "compliance of stem and rough surfaces, in series with the contact", "m/N", ge=0.0, le=1e-3,
        default=0.0,
    )  # fmt: skip
    tangential_series_compliance_m_per_n: float = quantity(
        "compliance of tip and stem along the rotor", "m/N", ge=0.0, le=1e-3,
        default=0.0,
    )  # fmt: skip
    worn_flat_radius_m: float = quantity(
        "radius of the flat worn on the tip; K_N and K_t describe the new tip", "m",
        ge=0.0, le=0.01, default=0.0,
    )  # fmt: skip
    # for a worn tip, and for pressure, tension and wear, which need more than its stiffness
    effective_radius_m: float | None = quantity(
        "relative radius R* of tip and rotor, 1/R* = 1/R₁ + 1/R₂; not known: no pressure", "m", ge=1e-7, le=10.0,
        default=None,
    )  # fmt: skip
    poisson: float | None = quantity(
        "Poisson's ratio ν of the tip; not known: no tension", "1", ge=0.0, lt=0.5, default=None
    )
    # from the best lubricated ceramics to soft polymers
    specific_wear_rate_m3_per_n_m: float | None = quantity(
        "worn volume per normal force and path of slip, k; not known: no wear", "m³/(N·m)", ge=1e-21,
        le=1e-9, default=None,
    )  # fmt: skip

    @model_validator(mode="after")
    def _check(self) -> Self:
        total = self.tangential_compliance_tip_m_per_n23 + self.tangential_compliance_rotor_m_per_n23
        if self.tangential_series_compliance_m_per_n and self.sliding_ratio < 1.0:
            raise ValueError(
                f"sliding_ratio = {self.sliding_ratio:g} lets friction fall with the slip velocity, and the spring of "
                f"tangential_series_compliance_m_per_n = {self.tangential_series_compliance_m_per_n:g} m/N, which has "
                "no mass, then jumps: there is no motion to compute. Set sliding_ratio to 1, or the compliance to 0"
            )
        if self.worn_flat_radius_m and self.effective_radius_m is None:
            raise ValueError(
                f"worn_flat_radius_m = {self.worn_flat_radius_m:g} m needs effective_radius_m, the effective radius of "
                "the new tip; specify it, or [contact.materials]"
            )
        if self.effective_radius_m is not None and self.worn_flat_radius_m > FLATTEST_TIP * self.effective_radius_m:
            raise ValueError(
                f"worn_flat_radius_m = {self.worn_flat_radius_m:g} m must be at most {FLATTEST_TIP:g} of "
                f"effective_radius_m = {self.effective_radius_m:g} m; lower it"
            )
        power = "2/3" if self.exponent == HERTZ else f"1/{self.exponent:g}"
        if self.normal_stiffness_n_per_m15 > stiffest(self.exponent):
            raise ValueError(
                f"normal_stiffness_n_per_m15 = {self.normal_stiffness_n_per_m15:g} must be at most "
                f"{stiffest(self.exponent):.3g} "
                f"N/m^{self.exponent:g} with exponent = {self.exponent:g}; lower it"
            )
        if self.exponent != HERTZ and self.effective_radius_m is not None:
            raise ValueError(
                f"exponent = {self.exponent:g} is not that of effective_radius_m or [contact.materials], which is "
                "1.5: specify [contact.lining] in their place"
            )
        if total > SOFTEST_SIDES:
            raise ValueError(
                f"tangential_compliance_tip_m_per_n23 and tangential_compliance_rotor_m_per_n23 sum to {total:g} "
                f"m/N^({power}); the sum must be ≤ {SOFTEST_SIDES:g} m/N^({power})"
            )
        softness = total * self.normal_stiffness_n_per_m15 ** (1.0 / self.exponent)
        if not SOFTNESS[0] <= softness <= SOFTNESS[1]:
            raise ValueError(
                f"normal_stiffness_n_per_m15 and the tangential compliances do not go together: K_t K_N^({power}) = "
                f"{softness:.3g}; of two elastic bodies it is 1 to 1.5, and it must be {SOFTNESS[0]:g} to "
                f"{SOFTNESS[1]:g}, so specify [contact.materials] or correct the one that is off"
            )
        return self


MOST_CONTACTS = 64  # eight points suffice on each wave of a ring (docs/ring.md); waves that do the same are one


class ContactPlace(Parameters):
    """One of several contacts of a stator, or some that do the same: how the modes move it, and what is its own.

    Its own x points the way in which friction drives the rotor forward.
    """

    name: str = label("name of the contact")
    tip_x: dict[str, Annotated[float, Field(ge=-1e4, le=1e4)]] = Field(
        default_factory=dict, description="tangential displacement per modal coordinate, by the names of the modes"
    )
    tip_y: dict[str, Annotated[float, Field(ge=-1e4, le=1e4)]] = Field(
        default_factory=dict, description="displacement towards the rotor per modal coordinate, by the modes' names"
    )
    radius_m: float | None = quantity(
        "radius of the rotor at the contact; not given: rotor.radius_m", "m", ge=1e-4, le=10.0, default=None
    )
    direction: Literal[1, -1] = Field(
        default=1, description="1, or -1 for a tip whose motion along the stator's x drives the rotor backward"
    )
    multiplicity: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=1, description="number of equal points of contact that do the same"
    )
    part: float = quantity("part of the values of [contact] that one point has", "1", gt=0.0, le=1.0, default=1.0)
    share: float | None = quantity(
        "share of the preload if all heights are 0; not given: by the multiplicities", "1", gt=0.0, lt=1.0, default=None
    )
    height_m: float = quantity(
        "height above the place at which it would have its share, negative where it is worn; others bear the rest", "m",
        ge=-1e-3, le=1e-3, default=0.0,
    )  # fmt: skip
    contact: dict[str, float] = Field(
        default_factory=dict, description="numbers of [contact] that differ here, but for preload_n"
    )
    law: dict[str, str | float] = Field(
        default_factory=dict,
        description="law of its own: a name or file as of --contact, or a table of name and own parameters",
    )


class Mount(Parameters):
    """The carrier of the stator: plate springs press it towards the rotor, so that the preload is a force.

    m_c z̈ + d_c ż + k_c z = F₀ + F_y − Σ Γ r̈, with z its displacement towards the rotor, F_y the force of the contact
    and Γ the recoil of a mode. Along the rotor it is held, or it moves on springs of its own:
    m_c z̈ₓ + d_x żₓ + k_x zₓ = F_x − Σ Γₓ r̈.
    """

    stiffness_n_per_m: float = quantity("stiffness k_c of the springs along y", "N/m", ge=1.0, le=1e13)
    mass_kg: float = quantity("mass m_c of the carrier, including the stator", "kg", ge=1e-9, le=1e3)
    damping_n_s_per_m: float = quantity("damping d_c of the springs", "N·s/m", ge=1e-9, le=1e9)
    tangential_stiffness_n_per_m: float | None = quantity(
        "stiffness k_x of the springs along the rotor; not given: held along it", "N/m", ge=1.0, le=1e13, default=None
    )
    tangential_damping_n_s_per_m: float | None = quantity(
        "damping d_x of the springs along the rotor", "N·s/m", ge=1e-9, le=1e9, default=None
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.tangential_stiffness_n_per_m is None) != (self.tangential_damping_n_s_per_m is None):
            raise ValueError(
                "a carrier that moves along the rotor needs tangential_stiffness_n_per_m and "
                "tangential_damping_n_s_per_m; state both, or neither for one that is held along it"
            )
        return self

    @cached_property
    def frequency_hz(self) -> float:
        """Undamped natural frequency √(k_c/m_c)/2π in Hz of a carrier with a free stator."""
        return sqrt(self.stiffness_n_per_m / self.mass_kg) / (2.0 * pi)

    @cached_property
    def tangential(self) -> Mount | None:
        """The carrier along the rotor, with the springs of that direction; ``None`` if it is held along it."""
        if self.tangential_stiffness_n_per_m is None or self.tangential_damping_n_s_per_m is None:
            return None
        return Mount(
            stiffness_n_per_m=self.tangential_stiffness_n_per_m,
            mass_kg=self.mass_kg,
            damping_n_s_per_m=self.tangential_damping_n_s_per_m,
        )


class Limits(Parameters):
    """Limits of the ceramic and the contact, and cooling of the stator; a result warns where it exceeds them."""

    dynamic_strength_pa: float = quantity("rated dynamic strength of the ceramic in tension", "Pa", ge=1e5, le=1e10)
    curie_temperature_c: float = quantity(
        "Curie temperature of the ceramic; half of it is the limit", "°C", ge=50, le=2e3
    )
    thermal_resistance_k_per_w: float = quantity(
        "thermal resistance of the stator to the surroundings", "K/W", ge=1e-3, le=1e6
    )
    ambient_c: float = quantity("temperature of the surroundings", "°C", ge=-273.0, le=1e3)
    field_v_per_m: float | None = quantity(
        "maximum amplitude of the field in the ceramic", "V/m", ge=1e3, le=1e8,
        default=None,
    )  # fmt: skip
    contact_pressure_pa: float | None = quantity(
        "maximum peak pressure that tip and rotor withstand",
        "Pa",
        ge=1e5,
        le=1e11,
        default=None,
    )
    contact_tension_pa: float | None = quantity(
        "strength in tension of the surfaces of tip and rotor", "Pa", ge=1e4, le=1e11,
        default=None,
    )  # fmt: skip


class Rotor(Parameters):
    """The rotor: a rigid disc on a bearing, its centre fixed."""

    radius_m: float = quantity("radius R at the contact", "m", ge=1e-4, le=10.0)
    inertia_kg_m2: float = quantity("moment of inertia J", "kg·m²", gt=1e-13, le=1e3)
    bearing_damping_n_m_s: float = quantity("viscous bearing coefficient C_R", "N·m·s", ge=0.0, le=1e3)
    bearing_friction_n_m: float = quantity(
        "torque T_c of dry friction in the bearing", "N·m", ge=0.0, le=1e3, default=0.0
    )
    # small ball bearings reach their torque after some micrometres of rolling
    bearing_presliding_rad: float = quantity(
        "angle after a reversal to 63 % of the dry friction (Dahl)", "rad", ge=1e-5, le=1.0,
        default=1e-3,
    )  # fmt: skip


class Slider(Parameters):
    """The slider of a linear stage, in place of a rotor: a rigid body with a flat face, on a straight guide."""

    # numerically those of a rotor of radius 1 m, so their ranges lie within its ranges
    mass_kg: float = quantity("mass", "kg", gt=1e-12, le=1e3)
    guide_damping_n_s_per_m: float = quantity("viscous coefficient of the guide", "N·s/m", ge=0.0, le=1e3)
    guide_friction_n: float = quantity("dry friction of the guide", "N", ge=0.0, le=1e3, default=0.0)
    # guides with balls or rollers reach their friction after some micrometres to a tenth of a millimetre
    guide_presliding_m: float = quantity(
        "travel after a reversal to 63 % of the dry friction (Dahl)", "m", ge=1e-5, le=1e-2,
        default=1e-5,
    )  # fmt: skip

    @property
    def as_rotor(self) -> Rotor:
        """The rotor of radius 1 m that moves in the same way: 1 rad/s is 1 m/s, and 1 N·m is 1 N."""
        return Rotor.model_construct(
            radius_m=1.0,
            inertia_kg_m2=self.mass_kg,
            bearing_damping_n_m_s=self.guide_damping_n_s_per_m,
            bearing_friction_n_m=self.guide_friction_n,
            bearing_presliding_rad=self.guide_presliding_m,
        )


class ToolLoad(Parameters):
    """The load of a transducer: a mechanical impedance R + jωM + K/(jω), or a resistance in the arm of a mode.

    It opposes the velocity of a mode, or of the face: Σ Y ṙ over the modes. If the motion of the face is not known, it
    acts on the only mode.
    """

    mode: str | None = Field(default=None, description="loaded mode; default the face")
    resistance_n_s_per_m: float = quantity("mechanical resistance R", "N·s/m", ge=0.0, le=1e9, default=0.0)
    mass_kg: float = quantity("mass M", "kg", ge=0.0, le=1e3, default=0.0)
    stiffness_n_per_m: float = quantity("stiffness K", "N/m", ge=0.0, le=1e15, default=0.0)
    # as that of a spectrum under load less that without
    resistance_ohm: float = quantity("resistance in the mode's arm", "Ω", ge=0.0, le=1e12, default=0.0)
