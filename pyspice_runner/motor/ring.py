# SPDX-License-Identifier: GPL-3.0-or-later
r"""A travelling-wave ring: two modes of n waves, their force factors and contacts, by the theory of a laminated plate.

A metal ring with teeth on its upper face has a ceramic ring bonded to its lower face. θ is the angle along the ring,
φ = nθ the phase of its waves, z the height above the lower face. The displacements of the lower modes of n waves are

    u_r = (u + z p) cos φ,    u_θ = (v + z q) sin φ,    u_z = w cos φ,

with u, v, p, q and w functions of the radius r; the other mode has sin φ and −cos φ in place of cos φ and sin φ. The
strains, of first-order shear deformation (R. D. Mindlin, J. Appl. Mech. 18 (1951) 31), are

    ε_r = u′ + z p′              γ_rθ = (v′ − (v + n u)/r) + z (q′ − (q + n p)/r)
    ε_θ = (u + n v)/r + z (p + n q)/r         γ_rz = p + w′         γ_θz = q − n w/r

Metal and ceramic are under plane stress, the ceramic between short-circuited electrodes. u and v put the neutral plane
where it is in the laminate. The stiffness against shear follows from the flow of shear stress through the layers, as in
:mod:`.beam`; a uniform plate has 5/6 of G t. Rayleigh–Ritz with Legendre polynomials of r gives the frequencies; a ring
that is narrow and thin has those of A. E. H. Love, *Mathematical Theory of Elasticity*, art. 293:

    ω² = (E I/ρ A R⁴) n² (n² − 1)²/(n² + E I/G J)

**Teeth** are cut by slots across the ring. Their roots stiffen it like a thin layer (:data:`ROOT`); above, they have
mass, turn by the slope of w, and resist bending across the ring and twist as bars. In the finite elements of one wave,
theory = "solid" (:mod:`.solid.wave`), they are bodies.

**Electrodes** have the length of half a wave and are poled alternately. Group A starts at φ = −π/2 and drives the
mode cos φ, group B follows a quarter of a wave behind A and drives sin φ. The feedback electrode is in the middle of
the gap between the end of B and the start of A. With the constant e* of plane stress, a group of N waves has the force
factor Θ = N (4/n) e* ∫(ε_r + ε_θ) r dr at the middle of the ceramic; the poling makes both positive. Its capacitance is
that of a plate that is clamped and free to become thicker. The field in a ceramic that bends is not uniform, which
stiffens it by e* e*ᵀ/ε* times t³/12.

**Contacts** are points on a circle, each for one point on each wave. The modal coordinate is u_z there, at the face. A
point at phase φ moves by y = q₁ cos φ + q₂ sin φ and x = X (q₁ sin φ − q₂ cos φ), with X of u_θ at the top of the
teeth, nearly n h/r with h the height above the neutral plane. A real ring is not quite the same all round: its modes
are turned by an angle, and differ in frequency by the ``splitting``.

**Omits** the bond, the web that supports the ring, the gaps between electrodes, modes of other numbers of waves, and
their response to the electrodes and to the contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import cos, pi, radians, sin, sqrt, tanh
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from pyspice_runner.motor.numerics import one_thread
from pyspice_runner.motor.parameters import Parameters, quantity
from pyspice_runner.motor.refusal import quoted
from pyspice_runner.motor.solid.elements import plate_matrix
from pyspice_runner.motor.solid.materials import Material, materials

Array = NDArray[np.float64]

MODES = ("cosine", "sine")
GAP_WAVES = 0.25  # between groups A and B: a quarter of a wave
# limits within which the frequency of the plate is within 2 % of finite elements (docs/ring.md)
THICKEST = 0.9  # metal and ceramic, in half waves
WIDEST = 1.0  # with teeth, in half waves
LONGEST_TOOTH = 0.75  # over metal and ceramic
FULLEST = 0.85  # part of the circumference that teeth fill
SLOWEST_TOOTH = 3.0  # resonance of a tooth alone over the frequency
# Height of a layer that stiffens the ring as the roots of the teeth do, per length l of a tooth: 0.0755 + 0.0118 l/t on
# a strip of the thickness t. By finite elements of a bent strip in plane stress, within 8 % for teeth that are half as
# high as long or higher and fill 60 to 90 % of it, for t from 0.8 l to 6 l.
ROOT, ROOT_BY_LENGTH = 0.0755, 0.0118
_DEGREE = 8  # of the polynomials: the frequency is exact to 1e-8
_NONE = 1e-12  # of a motion: one that symmetry forbids
_PHASES = 16  # of a wave, at which the stress is known


def _material(description: str) -> Any:
    made_of: dict[str, Any] = {"made_of": "letters, digits and -"}
    return Field(description=description, max_length=20, json_schema_extra=made_of)


def _poled(material: Material) -> bool:
    return bool(material.stress_constants_c_m2.any())


class Ring(Parameters):
    """A ring of metal and ceramic with teeth, which carries a travelling wave."""

    theory: Literal["plate", "solid"] = Field(
        default="plate", description="laminated plate, or finite elements of one wave"
    )
    waves: int = Field(description="number of waves", ge=2, le=50)
    outer_radius_m: float = quantity("outer radius", "m", gt=1e-4, le=1.0)
    inner_radius_m: float = quantity("inner radius", "m", gt=1e-5, le=1.0)
    thickness_m: float = quantity("metal below the teeth", "m", gt=1e-5, le=0.1)
    material: str = _material("material of the library")
    ceramic: str = _material("ceramic of the library")
    ceramic_thickness_m: float = quantity("thickness of the ceramic", "m", gt=1e-6, le=0.05)
    teeth: int = Field(default=0, description="number of teeth", ge=0, le=2000)
    tooth_height_m: float = quantity("height of the teeth", "m", ge=0.0, le=0.1, default=0.0)
    tooth_share: float = quantity("circumference that teeth fill", "1", gt=0.0, le=1.0, default=0.8)
    contact_radius_m: float = quantity("circle of contact", "m", gt=1e-5, le=1.0)
    waves_a: float = quantity("waves under group A", "1", ge=0.5, le=50.0)
    waves_b: float = quantity("waves under group B", "1", ge=0.5, le=50.0)
    waves_feedback: float = quantity("waves under the feedback electrode", "1", ge=0.0, le=0.5, default=0.0)
    points: int = Field(default=8, description="contacts on a wave", ge=3, le=64)
    splitting: float = quantity("relative difference of both frequencies", "1", ge=0.0, le=0.05, default=0.0)
    splitting_axis_deg: float = quantity("phase of the lower mode", "°", ge=-180.0, le=180.0, default=0.0)
    quality_factor: float = quantity("quality factor", "1", gt=0.5, le=1e6)

    @model_validator(mode="after")
    def _check(self) -> Self:
        inner, outer = self.inner_radius_m, self.outer_radius_m
        if inner >= outer:
            raise ValueError(f"inner_radius_m = {inner:g} m must be less than outer_radius_m = {outer:g} m")
        if not inner <= self.contact_radius_m <= outer:
            raise ValueError(
                f"contact_radius_m = {self.contact_radius_m:g} m must be from inner_radius_m = {inner:g} m to "
                f"outer_radius_m = {outer:g} m"
            )
        for name in ("material", "ceramic"):
            given = getattr(self, name)
            known = [key for key, card in materials().items() if _poled(card) == (name == "ceramic")]
            if given not in known:
                raise ValueError(f"{name} = {quoted(given)} is not known; there are {', '.join(known)}")
        for name in ("waves_a", "waves_b"):
            if (2.0 * getattr(self, name)) % 1.0:
                raise ValueError(f"{name} = {getattr(self, name):g} must be a whole number of half waves")
        used = self.waves_a + GAP_WAVES + self.waves_b + self.waves_feedback
        if used > self.waves:
            raise ValueError(
                f"waves_a, waves_b, waves_feedback and the gap of {GAP_WAVES:g} between A and B take {used:g} waves, "
                f"and the ring has {self.waves}"
            )
        if self.points % 4 == 2:
            raise ValueError(f"points = {self.points:g} must be odd, or a multiple of 4")
        if bool(self.teeth) != bool(self.tooth_height_m):
            raise ValueError("teeth and tooth_height_m belong together: specify both, or neither")
        return self

    @property
    def top_m(self) -> float:
        """Height of the top of the teeth."""
        return self.ceramic_thickness_m + self.thickness_m + self.tooth_height_m

    @property
    def face_m(self) -> float:
        """Height of the face of the metal between the teeth."""
        return self.ceramic_thickness_m + self.thickness_m

    @property
    def tooth_m(self) -> float:
        """Length of a tooth along the ring, at the middle of its width."""
        return pi * (self.outer_radius_m + self.inner_radius_m) * self.tooth_share / self.teeth

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Ceramic, metal, and teeth: their roots, which take part in bending along the ring, and ribs across it."""
        ceramic, metal = materials()[self.ceramic], materials()[self.material]
        body = [
            Layer.of(ceramic, 0.0, self.ceramic_thickness_m), Layer.of(metal, self.ceramic_thickness_m, self.face_m),
        ]  # fmt: skip
        if self.teeth:
            root = (ROOT + ROOT_BY_LENGTH * self.tooth_m / self.face_m) * self.tooth_m
            hinge = self.face_m + min(root, 0.5 * self.tooth_height_m)
            young, shear = 1.0 / float(np.linalg.inv(metal.stiffness_pa)[0, 0]), float(metal.stiffness_pa[3, 3])
            # force of a rib that the face strains: 1 − tanh X/X of a long one's, as in beam_limits
            reach = 0.5 * sqrt(3.0 * shear / young) * (self.outer_radius_m - self.inner_radius_m) / self.tooth_height_m
            across = self.tooth_share * young * (1.0 - tanh(reach) / reach)
            # Saint-Venant's torsion of a rectangle; the twist γ_rθ/z of a plate is twice that of a bar
            low, high = sorted((self.tooth_m, self.tooth_height_m))
            torsion = high * low**3 * (1.0 / 3.0 - 0.21 * low / high * (1.0 - (low / high) ** 4 / 12.0))
            twist = 0.25 * shear * torsion * self.tooth_share / self.tooth_m * 12.0 / (self.top_m - hinge) ** 3
            body.append(Layer.of(metal, self.face_m, hinge, self.tooth_share))
            body.append(
                Layer(
                    hinge, self.top_m, np.diag([across, 0.0, 0.0]), 0.0, self.tooth_share * metal.density_kg_m3,
                    tooth=True, curved_pa=np.diag([0.0, 0.0, twist]),
                )
            )  # fmt: skip
        return tuple(body)

    @property
    def heat_capacity_j_per_k(self) -> float:
        """Heat capacity of ceramic, metal and teeth."""
        area = pi * (self.outer_radius_m**2 - self.inner_radius_m**2)
        metal_m = self.thickness_m + self.tooth_share * self.tooth_height_m
        parts = (self.ceramic, self.ceramic_thickness_m), (self.material, metal_m)
        cards = ((materials()[name], height) for name, height in parts)
        return area * sum(card.density_kg_m3 * card.specific_heat_j_per_kg_k * height for card, height in cards)


@dataclass(frozen=True)
class Layer:
    """A layer of the laminate between two heights."""

    bottom_m: float
    top_m: float
    plane_pa: Array  # of plane stress, (3, 3): ε_r, ε_θ, γ_rθ
    shear_pa: float  # modulus of γ_rz and γ_θz
    density_kg_m3: float
    tooth: bool = False  # turns by the slope of its root
    curved_pa: Array | None = None  # added for strain that varies over its thickness

    @classmethod
    def of(cls, material: Material, bottom_m: float, top_m: float, share: float = 1.0) -> Self:
        """Return a layer of a material that fills a share of the circumference."""
        whole = material.matrix()
        plane, curved = plate_matrix(whole, shorted=True), None
        if plane[3, 3]:
            curved = np.outer(plane[:3, 3], plane[:3, 3]) / -plane[3, 3]
        density = share * material.density_kg_m3
        return cls(bottom_m, top_m, share * plane[:3, :3], share * float(whole[3, 3]), density, curved_pa=curved)

    def moments(self, base_m: float = 0.0) -> Array:
        """Return ∫1, ∫z and ∫z² dz of heights z above a base."""
        power = np.arange(1, 4)
        return np.asarray(((self.top_m - base_m) ** power - (self.bottom_m - base_m) ** power) / power)


@dataclass(frozen=True)
class Wave:
    """The mode cos φ of a ring by one of its theories; the modal coordinate is u_z on the circle of contact."""

    frequency_hz: float
    mass_kg: float  # of the whole ring
    force_n_per_v: float  # of electrodes on one wave
    lever: float  # X: amplitude of u_θ at the contact


@dataclass(frozen=True)
class Plate:
    """A laminated ring with its modes of n waves, by rising frequency."""

    frequencies_hz: Array
    vectors: Array  # (unknowns, modes) of unit modal mass: polynomials of u, v, p, q and w
    radii_m: tuple[float, float]
    waves: int

    def fields(self, radius_m: Any) -> tuple[Array, Array]:
        """Return u, v, p, q and w at radii, (5, radii, modes), and their derivatives by r in 1/m."""
        inner, outer = self.radii_m
        scaled: Array = (2.0 * np.asarray(radius_m, dtype=np.float64) - inner - outer) / (outer - inner)
        values, slopes = _polynomials(np.atleast_1d(scaled))
        shape = (5, _DEGREE + 1, -1)
        return (
            np.einsum("qk,fkm->fqm", values, self.vectors.reshape(shape)),
            np.einsum("qk,fkm->fqm", slopes / (0.5 * (outer - inner)), self.vectors.reshape(shape)),
        )

    def strains(self, radius_m: Any, height_m: float) -> Array:
        """Return the amplitudes of ε_r and ε_θ, (2, radii, modes)."""
        radius = np.atleast_1d(radius_m)[:, None]
        (u, v, p, q, _), (du, _, dp, _, _) = self.fields(radius_m)
        hoop = (u + self.waves * v + height_m * (p + self.waves * q)) / radius
        return np.stack([du + height_m * dp, hoop])


def _polynomials(scaled: Array) -> tuple[Array, Array]:
    """Return Legendre polynomials and their derivatives at places from −1 to 1, (places, degree + 1)."""
    legendre = np.polynomial.legendre
    slopes = [legendre.legval(scaled, legendre.legder(row)) for row in np.eye(_DEGREE + 1)]
    return np.asarray(legendre.legvander(scaled, _DEGREE), dtype=np.float64), np.stack(slopes, axis=1)


@one_thread()  # the modes enter decks and the addresses of stored points
def solve_plate(layers: tuple[Layer, ...], inner_m: float, outer_m: float, waves: int) -> Plate:
    """Return the modes of ``waves`` ≥ 2 waves of a free laminated ring, by the theory of this module."""
    membrane, mixed, bending = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    for layer in layers:
        moments = layer.moments()
        membrane, mixed, bending = (
            whole + layer.plane_pa * moment for whole, moment in zip((membrane, mixed, bending), moments, strict=True)
        )
        if layer.curved_pa is not None:
            bending = bending + layer.curved_pa * (layer.top_m - layer.bottom_m) ** 3 / 12.0
    scaled, weights = np.polynomial.legendre.leggauss(2 * _DEGREE + 4)
    radius = 0.5 * (outer_m + inner_m + (outer_m - inner_m) * scaled)
    weights = 0.5 * pi * (outer_m - inner_m) * weights * radius  # of cos² or sin² around the ring
    value, slope = _polynomials(scaled)
    slope = slope * 2.0 / (outer_m - inner_m)
    turned = waves * value / radius[:, None]
    over, zero = value / radius[:, None], np.zeros_like(value)
    plane_rows = [(slope, zero), (over, turned), (-turned, slope - over)]  # of two in-plane fields
    stretch = np.stack([np.hstack([*row, zero, zero, zero]) for row in plane_rows], axis=1)
    bend = np.stack([np.hstack([zero, zero, *row, zero]) for row in plane_rows], axis=1)
    shear = np.stack(
        [np.hstack([zero, zero, value, zero, slope]), np.hstack([zero, zero, zero, value, -turned])], axis=1
    )
    unit = np.eye(5)
    none = np.zeros((len(radius), unit.shape[0] * value.shape[1]))
    move = np.stack([np.kron(row, value) for row in unit[[0, 1, 4]]], axis=1)
    turn = np.stack([*(np.kron(row, value) for row in unit[[2, 3]]), none], axis=1)
    tilt = np.stack([np.kron(unit[4], -slope), np.kron(unit[4], turned), none], axis=1)  # by the slope of w

    def energy(left: Array, matrix: Array, right: Array) -> Array:
        return np.asarray(np.einsum("q,qia,ij,qjb->ab", weights, left, matrix, right, optimize=True))

    coupled = energy(stretch, mixed, bend)
    stiffness = energy(stretch, membrane, stretch) + coupled + coupled.T + energy(bend, bending, bend)
    stiffness += energy(shear, _shear_stiffness(layers, membrane, mixed, bending) * np.eye(2), shear)
    mass = np.zeros_like(stiffness)
    for layer in layers:
        base = layer.bottom_m if layer.tooth else 0.0
        moved, turned_by = (move + base * turn, tilt) if layer.tooth else (move, turn)
        first, second, third = (layer.density_kg_m3 * moment * np.eye(3) for moment in layer.moments(base))
        coupled = energy(moved, second, turned_by)
        mass += energy(moved, first, moved) + coupled + coupled.T + energy(turned_by, third, turned_by)
    # M x = (1/ω²) K x: accurate for the low modes
    factor = np.linalg.inv(np.linalg.cholesky(stiffness))
    inverse_squares, vectors = np.linalg.eigh(factor @ mass @ factor.T)
    squares = 1.0 / inverse_squares[::-1]
    vectors = (factor.T @ vectors[:, ::-1]) * np.sqrt(squares)
    return Plate(np.sqrt(squares) / (2.0 * pi), vectors, (inner_m, outer_m), waves)


def _shear_stiffness(layers: tuple[Layer, ...], membrane: Array, mixed: Array, bending: Array) -> float:
    """Return D²/∫S²/G dz in N/m, with S the moment of E above a height, from the stress that equilibrium asks for."""
    neutral = mixed[1, 1] / membrane[1, 1]
    nodes, weights = np.polynomial.legendre.leggauss(3)  # exact for S², of fourth degree
    compliance = above = 0.0
    for layer in sorted((layer for layer in layers if layer.shear_pa), key=lambda layer: -layer.bottom_m):
        modulus, thickness = layer.plane_pa[1, 1], layer.top_m - layer.bottom_m
        down = 0.5 * thickness * (1.0 + nodes)  # from the top of the layer
        flow = above + modulus * down * (layer.top_m - neutral - 0.5 * down)
        compliance += 0.5 * thickness / layer.shear_pa * float(weights @ flow**2)
        above += modulus * thickness * (0.5 * (layer.top_m + layer.bottom_m) - neutral)
    return float((bending[1, 1] - mixed[1, 1] * neutral) ** 2 / compliance)


@cache
def wave_of_plate(ring: Ring) -> Wave:
    """Return the lowest mode of a ring that bends out of its plane, by the theory of plates."""
    plate, bends, rise = _bending(ring)
    (_, v, _, q, w), _ = (part[:, 0, bends] / rise for part in plate.fields(ring.contact_radius_m))
    hinge, slope = ring.layers[-1].bottom_m if ring.teeth else ring.top_m, ring.waves * w / ring.contact_radius_m
    sheared = (hinge + v / q) * (slope - q) / 6.0
    # a tooth turns by the mean slope of its root, which is n π share/teeth long to either side
    swing = slope * np.sinc(ring.waves * ring.tooth_share / ring.teeth) if ring.teeth else 0.0
    half = 0.5 * (ring.outer_radius_m - ring.inner_radius_m)
    scaled, weights = np.polynomial.legendre.leggauss(_DEGREE + 2)
    radius = ring.inner_radius_m + half * (1.0 + scaled)
    area = plate.strains(radius, 0.5 * ring.ceramic_thickness_m).sum(axis=0)[:, bends] / rise
    constant = plate_matrix(materials()[ring.ceramic].matrix(), shorted=True)[0, 3]
    return Wave(
        frequency_hz=float(plate.frequencies_hz[bends]),
        mass_kg=float(1.0 / rise**2),
        force_n_per_v=float(4.0 / ring.waves * abs(constant * (half * weights * radius) @ area)),
        lever=float(v + hinge * q + sheared + (ring.top_m - hinge) * swing),
    )


def _bending(ring: Ring) -> tuple[Plate, int, float]:
    """Return the modes of a ring, the number of the lowest that bends out of its plane, and its u_z at the contact.

    Where the upper face is stretched it sinks: ε_z = −(c₁₃/c₃₃)(ε_r + ε_θ), from the mean height of a parabola.
    """
    plate = solve_plate(ring.layers, ring.inner_radius_m, ring.outer_radius_m, ring.waves)
    (_, _, _, _, w), _ = plate.fields(ring.contact_radius_m)
    bends = int(np.argmax(np.abs(w[0, :2])))  # the other one of these two bends in the plane
    hinge, elastic = ring.layers[-1].bottom_m if ring.teeth else ring.top_m, materials()[ring.material].stiffness_pa
    curved = plate.strains(ring.contact_radius_m, hinge) - plate.strains(ring.contact_radius_m, 0.0)
    sunk = elastic[0, 2] / elastic[2, 2] * float(curved[:, 0, bends].sum()) * hinge / 12.0
    return plate, bends, float(w[0, bends]) - sunk


def capacitance_f(ring: Ring, waves: float) -> float:
    """Return the capacitance of electrodes on a number of waves, the plate clamped and its thickness free."""
    permittivity = -plate_matrix(materials()[ring.ceramic].matrix(), shorted=True)[3, 3]
    area = pi * (ring.outer_radius_m**2 - ring.inner_radius_m**2) * waves / ring.waves
    return float(permittivity * area / ring.ceramic_thickness_m)


def ring_modes(ring: Ring, wave: Wave) -> tuple[list[dict[str, Any]], list[float]]:
    """Return the two modes as tables ``[[modes]]``, without their tip, and force per volt of the feedback electrode."""
    axis = radians(ring.splitting_axis_deg)
    middle = pi * (ring.waves + ring.waves_a + ring.waves_b - GAP_WAVES)  # phase of the feedback electrode
    half = pi * ring.waves_feedback
    modes, feedback = [], []
    for name, turned, side in zip(MODES, (axis, axis + 0.5 * pi), (-1.0, 1.0), strict=True):
        omega = 2.0 * pi * wave.frequency_hz * (1.0 + 0.5 * side * ring.splitting)
        couplings = ring.waves_a * cos(turned), ring.waves_b * sin(turned)
        a, b = (wave.force_n_per_v * _clean(value) for value in couplings)
        modes.append({
            "name": name, "mass_kg": wave.mass_kg, "damping_n_s_per_m": omega * wave.mass_kg / ring.quality_factor,
            "stiffness_n_per_m": wave.mass_kg * omega**2, "coupling_a_n_per_v": a, "coupling_b_n_per_v": b,
            "recoil_kg": 0.0, "recoil_x_kg": 0.0,
        })  # fmt: skip
        # force_n_per_v is that of ∫|cos φ| dφ = 4 of a wave
        feedback.append(wave.force_n_per_v * _clean(0.5 * sin(half) * cos(middle - turned)))
    return modes, feedback


def ring_contacts(ring: Ring, wave: Wave) -> list[dict[str, Any]]:
    """Return the points of contact as tables ``[[contacts]]``, each for as many equal points as there are waves."""
    axis = radians(ring.splitting_axis_deg)
    found = []
    for point in range(ring.points):
        phase = 2.0 * pi * point / ring.points - axis
        along, across = _clean(cos(phase)), _clean(sin(phase))
        found.append({
            "name": f"point{point + 1}", "multiplicity": ring.waves, "part": 1.0 / (ring.points * ring.waves),
            "tip_x": {MODES[0]: wave.lever * across, MODES[1]: -wave.lever * along},
            "tip_y": {MODES[0]: along, MODES[1]: across},
        })  # fmt: skip
    return found


def _clean(value: float) -> float:
    """Return a number, and 0 for one that differs from it by rounding."""
    return value if abs(value) > _NONE else 0.0


@cache
def ring_stress(ring: Ring) -> tuple[Array, Array]:
    """Return strain in 1/m and stress in Pa/m of the ceramic's lower face per modal displacement, (points, modes)."""
    axis = radians(ring.splitting_axis_deg)
    plate, bends, rise = _bending(ring)
    radius = np.linspace(ring.inner_radius_m, ring.outer_radius_m, 2 * _DEGREE + 1)
    strain = plate.strains(radius, 0.0)[..., bends] / rise
    stress = plate_matrix(materials()[ring.ceramic].matrix(), shorted=True)[:2, :2] @ strain
    phases = np.arange(_PHASES) * 2.0 * pi / _PHASES - axis
    around = np.stack([np.cos(phases), np.sin(phases)], axis=1)
    strains, stresses = (np.einsum("kr,pm->krpm", each, around).reshape(-1, 2) for each in (strain, stress))
    return strains, stresses


def ring_cautions(ring: Ring) -> tuple[str, ...]:
    """Return one sentence if the theory of plates may miss the frequency of a ring by more than 2 %."""
    if ring.theory != "plate":
        return ()
    width = ring.outer_radius_m - ring.inner_radius_m
    half_wave = 0.5 * pi * (ring.outer_radius_m + ring.inner_radius_m) / ring.waves
    limits = [("metal and ceramic over half a wave", ring.face_m / half_wave, THICKEST)]
    if ring.teeth:
        metal = materials()[ring.material]
        # cantilever: ω = 1.875² √(E I/ρ A)/h²
        sound = 1.0 / sqrt(float(np.linalg.inv(metal.stiffness_pa)[0, 0]) * metal.density_kg_m3)
        alone = 1.875**2 * sound * ring.tooth_m / sqrt(12.0) / ring.tooth_height_m**2 / (2.0 * pi)
        limits += [
            ("width over half a wave, with teeth,", width / half_wave, WIDEST),
            ("length of a tooth over metal and ceramic", ring.tooth_m / ring.face_m, LONGEST_TOOTH),
            ("tooth_share", ring.tooth_share, FULLEST),
            ("frequency over that of a tooth alone", wave_of_plate(ring).frequency_hz / alone, 1.0 / SLOWEST_TOOTH),
        ]
    found = [f"{what} is {value:.2g}, at most {most:.2g}" for what, value, most in limits if value > most]
    if not found:
        return ()
    whole = "" if ring.teeth % ring.waves == 0 else f" and ring.teeth to a multiple of ring.waves = {ring.waves}"
    beyond = f"The theory of plates has the frequency of a ring within 2 % only up to limits: {'; '.join(found)}."
    return (f'{beyond} Set ring.theory = "solid"{whole}.',)
