# SPDX-License-Identifier: GPL-3.0-or-later
"""Bending modes, piezo couplings and clamped capacitances of the resonator, from its dimensions.

Rayleigh–Ritz for a simply supported beam that carries piezoceramic patches and a rigid tip: a Timoshenko beam, with
shear and rotary inertia of its sections, or the Bernoulli–Euler beam of B. Andersen, J. Helbo, M. Blanke, "Modelling
and Experiments of a Standing Wave Piezomotor", Proc. 8th Int. Conf. New Actuators, 2002, eqs. (3) and (19). All
quantities are in SI units.

**Coordinates.** x runs along the beam from the left support, 0 ≤ x ≤ L. The deflection w and the height z
point towards the rotor; z = 0 is the middle of the bare beam, and the *top* face is the one at z > 0.

**Cross-section.** A section turns by ψ = w′ − γ; γ is the angle of shear, 0 in a Bernoulli–Euler beam. The axial
strain is S = ε − z ψ′. A patch obeys the one-dimensional piezoelectric equations
(IEEE Std 176) S = T/E + d₃₁ E₃, D₃ = d₃₁ T + ε₃₃ᵀ E₃; with e = E d₃₁ and ε₃₃ˢ = ε₃₃ᵀ − d₃₁² E they read

    T = E S − e E₃        D₃ = e S + ε₃₃ˢ E₃

n layers of thickness t/n, electrically in parallel, see the field |E₃| = n U/t, taken as uniform in each.
*Sign*: the patches are poled so that U > 0 stretches the top and shortens the bottom where d₃₁ < 0, that is,
E₃ = −s n U/t with s = +1 on the top face and −1 on the bottom face. So a positive voltage bends the beam
towards the rotor, and in the fundamental mode θ > 0 for both groups. Between two neighbouring patch edges the
section is uniform. With A = ∫E b dz, B = ∫E b z dz, D = ∫E b z² dz, with N_p = Σ s e n b and
M_p = Σ s e n b z_p for each group (z_p is the middle of the ceramic), its axial force, moment and charge per
length are

    N = A ε − B ψ′ + N_p U
    M = B ε − D ψ′ + M_p U
    q = −N_p ε + M_p ψ′ + Σ (ε₃₃ˢ n² b/t) U

The supports leave the beam axially free. N = 0 eliminates ε:

    M = −(D − B²/A) ψ′ + m U        m = M_p − N_p B/A
    q = m ψ′ + c U                  c = Σ ε₃₃ˢ n² b/t + N_p²/A

D − B²/A is the bending stiffness and m the moment per volt, both about the composite's neutral axis. c is the
capacitance per length with the deflection held at zero, "clamped" for short. A pair on both faces has
B = N_p = 0.

**Shear.** With z from the neutral axis and S_E(z) the integral of E b z above the height z, the shear stress that
equilibrium asks for is V S_E/((D − B²/A) b). Its strain energy gives the stiffness κGA of V = κGA γ:

    1/κGA = ∫ S_E²/(κ_G G b) dz / (D − B²/A)²,   κ_G = (6/5) 10(1+ν)/(12+11ν),   G = E/(2(1+ν))

Without κ_G a uniform rectangle has κ = 5/6. κ_G makes it the κ = 10(1+ν)/(12+11ν) of three-dimensional elasticity,
0.85 at ν = 0.3 (G. R. Cowper, "The Shear Coefficient in Timoshenko's Beam Theory", J. Appl. Mech. 33 (1966) 335). A
laminate with soft outer layers has more: 0.93 of ΣGA for the sets here. The rotary inertia ρI is about the neutral
axis.

**Ritz.** The shape functions are w_j = sin(jπx/L)/j² and γ_j = a_j cos(jπx/L) from j = 0; the scales make K well
conditioned, also where the beam is so slender that γ vanishes. With the mass μ per length and the tip's mass m_t and
rotary inertia J_t at x_t, the energies are

    K: ∫(D − B²/A) ψ′² dx + ∫κGA γ² dx
    M: ∫μ w² dx + ∫ρI ψ² dx + m_t w(x_t)² + J_t ψ(x_t)²
    Θ: ∫m ψ′ dx, the sum of m [ψ(end) − ψ(start)] over the sections
    K φ  = ω² M φ,   C = αM + βK

A Bernoulli–Euler beam has no γ_j and no ρI. Each mode is scaled so that its largest |w| on the beam is 1 and
w′(0) > 0: the modal mass φᵀMφ is the effective mass at the antinode. The contact point of a tip of length l_t moves
by Y = w(x_t) towards the rotor and by X = −l_t ψ(x_t) along its surface. An elastic foot and stem add unknowns to the
tip's motion (:mod:`.stem`).

**Convergence.** Frequencies converge from above. Where ψ′ jumps, at patch edges and at a tip with rotary
inertia, the series leaves an error of the order of 1/shapes: with 160 shapes less than 0.2 per cent in
frequency, about 1 per cent in the slope at the tip.

**Omits** the bond layer; the field's non-uniformity in thick layers; axial motion and inertia; shear lag in the
ceramic: the outer fibres of a patch are not strained near its ends. Patches of groups A and B on opposite faces of
one stretch would have a mutual capacitance, which this theory does not give; they are an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.numerics import one_thread, root
from pyspice_runner.motor.parameters import Beam, Damping, Mode, Patch, Tip
from pyspice_runner.motor.refusal import build
from pyspice_runner.motor.stem import STRAINED, Stem, footprint, require_room

Array = NDArray[np.float64]

GROUPS = ("A", "B")
SHAPES = 160  # within 0.2 % of the limit for the motors here, in about 5 ms
SIDES = {"both": (1, -1), "top": (1,), "bottom": (-1,)}  # s of each face that carries ceramic

_LENGTH_TOLERANCE = 1e-9  # of the beam's length: edges that are meant to coincide
_ZERO = 1e-9  # of its natural scale: a coupling that symmetry forbids


@dataclass(frozen=True)
class Resonator:
    """The lowest bending modes of the structure, undamped; the arrays' last index counts the modes."""

    coefficients: Array  # (shapes, modes): w(x) = Σ_j coefficients[j−1] sin(jπx/L), the largest |w| is 1
    masses_kg: Array
    stiffnesses_n_per_m: Array
    couplings_n_per_v: Array  # (2, modes): groups A and B
    wavenumbers: Array  # jπ/L in 1/m, of the shape functions
    recoils_kg: Array  # Γ = ∫ μ w dx + m_t w(x_t) of the modes: momentum along y per modal velocity
    recoils_x_kg: Array | None  # the same along x, of the tip; not known without its centre of mass
    shears: Array  # (shapes + 1, modes): γ(x) = Σ_j shears[j] cos(jπx/L); none without shear
    tip_x: Array  # tangential displacement of the contact point per modal coordinate
    tip_y: Array  # displacement of the contact point towards the rotor per modal coordinate
    residual_m_per_n: Array
    """Static compliance of the modes that are left out at the contact point, towards the rotor and along it."""

    @property
    def frequencies_hz(self) -> Array:
        """Undamped natural frequencies with the electrodes short-circuited."""
        return np.sqrt(self.stiffnesses_n_per_m / self.masses_kg) / (2 * np.pi)

    def deflection(self, x_m: ArrayLike) -> Array:
        """Mode shapes w at the positions ``x_m``: (len(x), modes)."""
        return np.asarray(np.sin(np.multiply.outer(x_m, self.wavenumbers)) @ self.coefficients)

    def slope(self, x_m: ArrayLike) -> Array:
        """Their slopes w′ (1/m) at the positions ``x_m``: (len(x), modes)."""
        k = self.wavenumbers
        return np.asarray(np.cos(np.multiply.outer(x_m, k)) @ (k[:, None] * self.coefficients))

    def curvature(self, x_m: ArrayLike) -> Array:
        """Curvature ψ′ (1/m²) at the positions ``x_m``: (len(x), modes).

        Lanczos' factors remove the ringing of the series at the ends of the patches.
        """
        k, shapes = self.wavenumbers, len(self.wavenumbers)
        smooth = np.sinc(np.arange(1, shapes + 1) / (shapes + 1))
        bent = k[:, None] ** 2 * self.coefficients
        bent[: len(self.shears)] -= k[: len(self.shears), None] * self.shears[1:]
        return np.asarray(-np.sin(np.multiply.outer(x_m, k)) @ (smooth[:, None] * bent))


@one_thread()  # the modes enter decks and the addresses of stored points
def solve_resonator(
    beam: Beam, patches: Sequence[Patch], tip: Tip, *, count: int = 2, shapes: int = SHAPES
) -> Resonator:
    """Return the ``count`` lowest bending modes, from ``shapes`` sines, with or without patches.

    Raise ParameterError if the parts do not fit together.
    """
    if tip.position_m > beam.length_m * (1 + _LENGTH_TOLERANCE):
        raise ParameterError(
            f"tip.position_m = {tip.position_m:g} m lies beyond beam.length_m = {beam.length_m:g} m; "
            "place the tip on the beam."
        )
    sections = _sections(beam, patches, tip)
    unit = np.pi / beam.length_m
    j = np.arange(1, shapes + 1, dtype=np.float64)
    k = j * unit
    # unknowns: w_j, scaled, and with shear γ_j of the angle γ = w′ − ψ, whose first is uniform
    sheared = beam.theory == "timoshenko"
    waves = np.concatenate((k, [0.0], k)) if sheared else k
    turns = np.concatenate((k, -np.ones(shapes + 1))) if sheared else k  # ψ = Σ turns cos(waves x) per unknown
    # of the tip, means over its foot: deflection and rotation of the beam, then what the foot and the stem add
    stem = Stem.of(beam, tip)
    require_room(beam, patches, tip)
    mean = np.sinc(waves * tip.foot_width_m / (2 * np.pi))
    here, angle, beyond = slice(0, shapes), slice(shapes, len(waves)), slice(len(waves), None)
    rise = np.concatenate((mean[here] * np.sin(k * tip.position_m), np.zeros(len(waves) - shapes), stem.rise))
    turn = mean * turns * np.cos(waves * tip.position_m)
    centre = tip.centre_m or 0.0
    sideways = np.concatenate((centre * turn, stem.sideways(centre)))
    turn = np.concatenate((turn, stem.turn))
    unknowns = len(turn)

    bending = np.zeros((shapes, shapes))
    mass = np.zeros((unknowns, unknowns))
    shear, rotary = np.zeros((2, shapes + 1, shapes + 1))
    coupling = np.zeros((2, unknowns))
    coupling_scale = np.zeros((2, unknowns))
    recoil = tip.mass_kg * rise
    for section in sections:
        sines, cosines = _products(shapes, section.start, section.end, beam.length_m)
        bending += section.bending_stiffness * sines
        mass[:shapes, :shapes] += section.mass_per_length * sines
        if sheared:
            shear += section.shear_stiffness * cosines
            rotary += section.rotary_inertia * cosines
        bend = turns * (np.cos(waves * section.end) - np.cos(waves * section.start))
        coupling[:, : len(waves)] += np.outer(section.moment_per_volt, bend)
        coupling_scale[:, : len(waves)] += np.outer(np.abs(section.moment_per_volt), 2 * np.abs(turns))
        recoil[:shapes] += section.mass_per_length * (np.cos(k * section.start) - np.cos(k * section.end)) / k
    scale = 1.0 / j**2
    stiffness = np.zeros((unknowns, unknowns))
    stiffness[:shapes, :shapes] = bending * unit**4  # w″ of the scaled shapes is −(π/L)² sin(jπx/L)
    if sheared:
        stretches = np.array([[section.end - section.start] for section in sections])
        of_sections = [(section.bending_stiffness, section.shear_stiffness) for section in sections]
        mean_bending, mean_shear = np.sum(stretches * of_sections, axis=0) / beam.length_m
        angles = unit**2 / np.sqrt(unit**2 * np.arange(shapes + 1) ** 2 + mean_shear / mean_bending)
        scale = np.concatenate((scale, angles))  # gives the strain energy of γ_j the order of that of w_j
        bent = np.concatenate(([0.0], k * angles[1:]))
        curved = np.pad(bending, ((1, 0), (1, 0)))  # ∫D sin sin, with the uniform γ, which has no curvature
        stiffness[here, angle] = -(unit**2) * curved[1:] * bent
        stiffness[angle, here] = stiffness[here, angle].T
        stiffness[angle, angle] = shear * np.outer(angles, angles) + curved * np.outer(bent, bent)
        mass[here, here] += rotary[1:, 1:] * np.outer(k, k)
        mass[here, angle] = -k[:, None] * rotary[1:]
        mass[angle, here] = mass[here, angle].T
        mass[angle, angle] = rotary
    if len(stem.stiffness):
        units = np.sqrt(stiffness[0, 0] / np.diag(stem.stiffness))
        scale = np.concatenate((scale, units))
        stiffness[beyond, beyond] = stem.stiffness * np.outer(units, units)
    mass += tip.mass_kg * (np.outer(rise, rise) + np.outer(sideways, sideways))
    mass += (tip.rotary_inertia_kg_m2 - tip.mass_kg * centre**2) * np.outer(turn, turn)
    mass *= np.outer(scale, scale)

    # M φ = (1/ω²) K φ with the largest 1/ω²: accurate for the low modes, however many shapes there are.
    try:
        factor = np.linalg.inv(np.linalg.cholesky(stiffness))
        inverse_squares, vectors = np.linalg.eigh(factor @ mass @ factor.T)
    except np.linalg.LinAlgError as error:
        stiff, soft = (pick(section.bending_stiffness for section in sections) for pick in (max, min))
        raise ParameterError(
            f"The bending stiffness along the beam varies from {soft:.3g} to {stiff:.3g} N·m², too much for its modes "
            "to be computed; check the thickness of the beam and of the patches."
        ) from error
    inverse_squares = inverse_squares[: -count - 1 : -1]
    coefficients = scale[:, None] * (factor.T @ vectors[:, : -count - 1 : -1])
    amplitudes = np.array([_amplitude(column, k, beam.length_m) for column in coefficients[:shapes].T])
    coefficients = coefficients / amplitudes
    stiffnesses = 1.0 / amplitudes**2  # φᵀKφ = 1 of the vectors
    along = -np.concatenate((tip.length_m * turn[: len(waves)], stem.sideways(tip.length_m)))
    tip_x, tip_y = along @ coefficients, rise @ coefficients
    pushed = np.stack((rise, along), axis=1) * scale[:, None]
    compliance = np.sum(pushed * np.linalg.solve(stiffness, pushed), axis=0)
    return Resonator(
        coefficients=coefficients[:shapes],
        masses_kg=stiffnesses * inverse_squares,
        stiffnesses_n_per_m=stiffnesses,
        couplings_n_per_v=_without_round_off(coupling @ coefficients, coupling_scale @ np.abs(coefficients)),
        wavenumbers=k,
        recoils_kg=_without_round_off(recoil @ coefficients, np.abs(recoil).max() * np.abs(coefficients).sum(axis=0)),
        recoils_x_kg=None
        if tip.centre_m is None
        else _without_round_off(
            -tip.mass_kg * (sideways @ coefficients), tip.mass_kg * centre * k @ np.abs(coefficients[:shapes])
        ),
        shears=coefficients[angle],
        tip_x=_without_round_off(tip_x, tip.length_m * k @ np.abs(coefficients[:shapes])),
        tip_y=_without_round_off(tip_y, 1.0),
        residual_m_per_n=compliance - np.sum(np.stack((tip_y, tip_x)) ** 2 / stiffnesses, axis=1),
    )


def resonator_modes(
    beam: Beam, patches: Sequence[Patch], tip: Tip, damping: Damping, *, count: int = 2, shapes: int = SHAPES
) -> tuple[Mode, ...]:
    """Return the ``count`` lowest modes, "bending-1" first, with Rayleigh damping c = α m + β k and recoil.

    Raises:
        ParameterError: The parts do not fit together, a group has no patch, or nothing damps the modes.
    """
    _require_both_groups(patches)
    if damping.alpha_per_s == 0.0 and damping.beta_s == 0.0:
        raise ParameterError(
            "damping.alpha_per_s = 0 1/s and damping.beta_s = 0 s leave the modes undamped; "
            "at least one of them must be positive."
        )
    resonator = solve_resonator(beam, patches, tip, count=count, shapes=shapes)
    coupling_a, coupling_b = resonator.couplings_n_per_v
    columns = {
        "mass_kg": resonator.masses_kg, "stiffness_n_per_m": resonator.stiffnesses_n_per_m,
        "coupling_a_n_per_v": coupling_a, "coupling_b_n_per_v": coupling_b,
        "tip_x": resonator.tip_x, "tip_y": resonator.tip_y,
    }  # fmt: skip
    if beam.recoil:
        columns["recoil_kg"] = resonator.recoils_kg
        if resonator.recoils_x_kg is not None:
            columns["recoil_x_kg"] = resonator.recoils_x_kg
    columns["damping_n_s_per_m"] = np.array([*map(damping.modal, columns["mass_kg"], columns["stiffness_n_per_m"])])
    return tuple(
        build(Mode, {"name": f"bending-{index + 1}"} | {name: float(column[index]) for name, column in columns.items()},
              f"modes.{index}", "the beam with patches and tip")
        for index in range(count)
    )  # fmt: skip


def clamped_capacitances(beam: Beam, patches: Sequence[Patch]) -> tuple[float, float]:
    """Return the capacitances (F) of groups A and B with the deflection held at zero, free to stretch.

    Raise ParameterError if the patches do not fit the beam or each other, or a group has none.
    """
    _require_both_groups(patches)
    each = [section.capacitance_per_length * (section.end - section.start) for section in _sections(beam, patches)]
    of_a, of_b = np.sum(each, axis=0).tolist()
    return of_a, of_b


@dataclass(frozen=True)
class _Section:
    """A stretch of the beam with a uniform cross-section; pairs of values belong to groups A and B."""

    start: float
    end: float
    mass_per_length: float
    bending_stiffness: float
    moment_per_volt: Array
    capacitance_per_length: Array
    shear_stiffness: float
    rotary_inertia: float  # per length, about the neutral axis


def _sections(beam: Beam, patches: Sequence[Patch], tip: Tip | None = None) -> list[_Section]:
    """Cut the beam at every patch edge, and at those of an elastic foot."""
    _require_fit(beam, patches)
    edges = {0.0, beam.length_m}.union(*((patch.start_m, patch.end_m) for patch in patches))
    foot = None if tip is None or not tip.foot_width_m else _foot(beam, tip)
    low, high = (0.0, 0.0) if tip is None or foot is None else footprint(beam, tip)
    edges |= {low, high} if foot else set()
    return [
        _section(
            beam, [p for p in patches if p.start_m < 0.5 * (start + end) < p.end_m], start, end,
            foot if low < 0.5 * (start + end) < high else None,
        )
        for start, end in pairwise(sorted(edges))
    ]  # fmt: skip


def _section(beam: Beam, patches: Sequence[Patch], start: float, end: float, foot: _Layer | None = None) -> _Section:
    """Laminate the beam with the patches, and the foot, that lie between ``start`` and ``end``."""
    force = np.zeros(2)
    moment = np.zeros(2)
    capacitance = np.zeros(2)
    layers = [_Layer.of(beam, 0.0)]
    for patch in patches:
        group = GROUPS.index(patch.group)
        per_volt = patch.youngs_modulus_pa * patch.piezoelectric_constant_m_per_v * patch.layers * patch.width_m
        clamped_permittivity = (
            patch.permittivity_f_m - patch.piezoelectric_constant_m_per_v**2 * patch.youngs_modulus_pa
        )
        for side in SIDES[patch.faces]:
            middle = side * 0.5 * (beam.thickness_m + patch.thickness_m)
            layers.append(_Layer.of(patch, middle))
            force[group] += side * per_volt
            moment[group] += side * per_volt * middle
            capacitance[group] += clamped_permittivity * patch.layers**2 * patch.width_m / patch.thickness_m
    layers += [foot] if foot is not None else []
    mass = sum(layer.mass for layer in layers)
    axial = sum(layer.stretch for layer in layers)
    mixed = sum(layer.stretch * layer.middle for layer in layers)
    bending = sum(layer.stretch * (layer.middle**2 + layer.thickness**2 / 12) for layer in layers)
    bending -= mixed**2 / axial
    neutral = mixed / axial
    moment -= force * neutral
    capacitance += force**2 / axial
    shear = _shear_stiffness(layers, neutral, bending)
    rotary = sum(layer.mass * ((layer.middle - neutral) ** 2 + layer.thickness**2 / 12) for layer in layers)
    return _Section(start, end, mass, bending, moment, capacitance, shear, rotary)


@dataclass(frozen=True)
class _Layer:
    """One layer of a section: steel or ceramic."""

    middle: float
    thickness: float
    mass: float  # per length
    stiffness: float  # E b, per height
    shear_compliance: float  # (12 + 11 ν)/(6 E b): Cowper's, 1/(G b) times 5/6 of his 1/κ

    @property
    def stretch(self) -> float:
        """E b t: axial stiffness."""
        return self.stiffness * self.thickness

    @classmethod
    def of(cls, part: Beam | Patch, middle: float) -> _Layer:
        thickness, stiffness = part.thickness_m, part.youngs_modulus_pa * part.width_m
        mass = part.density_kg_m3 * part.width_m * thickness
        return cls(middle, thickness, mass, stiffness, (12 + 11 * part.poissons_ratio) / (6 * stiffness))


def _foot(beam: Beam, tip: Tip) -> _Layer:
    """Return the layer by which a foot stiffens the beam; its mass is that of the tip."""
    thickness = STRAINED * tip.foot_width_m
    stiffness = (tip.stem_youngs_modulus_pa or beam.youngs_modulus_pa) * beam.width_m
    middle = 0.5 * (beam.thickness_m + thickness)
    return _Layer(middle, thickness, 0.0, stiffness, (12 + 11 * beam.poissons_ratio) / (6 * stiffness))


def _shear_stiffness(layers: Sequence[_Layer], neutral: float, bending: float) -> float:
    """Return D²/∫ S² ds, with S the moment of E b above a height, from the shear stress that equilibrium asks for."""
    nodes, weights = np.polynomial.legendre.leggauss(3)  # exact for S², of fourth degree
    compliance = above = 0.0
    for layer in sorted(layers, key=lambda layer: -layer.middle):
        top = layer.middle + 0.5 * layer.thickness - neutral
        down = 0.5 * layer.thickness * (1.0 + nodes)  # from the top of the layer
        flow = above + layer.stiffness * down * (top - 0.5 * down)
        compliance += 0.5 * layer.thickness * layer.shear_compliance * float(weights @ flow**2)
        above += layer.stretch * (layer.middle - neutral)
    return bending**2 / compliance


def _products(shapes: int, start: float, end: float, length: float) -> tuple[Array, Array]:
    """∫ sin(iπx/L) sin(jπx/L) dx from ``start`` to ``end``, i and j from 1 to ``shapes``; of cosines from 0."""
    j = np.arange(shapes + 1)
    difference, total = np.abs(np.subtract.outer(j, j)), np.add.outer(j, j)
    whole = np.arange(2 * shapes + 1)  # all that differences and sums can be

    def antiderivatives(x: float) -> tuple[Array, Array]:
        values = np.sinc(whole * x / length)
        first, second = values[difference], values[total]
        return 0.5 * x * (first - second)[1:, 1:], 0.5 * x * (first + second)

    (sines, cosines), (sines_before, cosines_before) = antiderivatives(end), antiderivatives(start)
    return sines - sines_before, cosines - cosines_before


def _amplitude(coefficients: Array, k: Array, length: float) -> float:
    """Return the largest |w| of a sine series, with the sign of w′(0); every extremum is exact to rounding."""

    def slope(x: float) -> float:
        return float(np.cos(k * x) @ (k * coefficients))

    intervals = 16 * len(k)
    grid = np.linspace(0.0, length, intervals + 1)
    # Σ_j k_j c_j cos(jπi/intervals) for all i: a Fourier sum
    slopes = np.fft.fft(np.concatenate(([0.0], k * coefficients)), 2 * intervals).real[: intervals + 1]
    for i in np.flatnonzero(np.abs(slopes) <= _ZERO * np.max(np.abs(slopes))):
        slopes[i] = slope(grid[i])  # where rounding decides on the sign: as the search below computes it
    turns = np.flatnonzero(slopes[:-1] * slopes[1:] <= 0.0)
    extrema = np.array([root(slope, grid[i], grid[i + 1], 1e-12 * length) for i in turns])
    largest = np.max(np.abs(np.sin(np.outer(extrema, k)) @ coefficients))
    return float(np.copysign(largest, slopes[0]))


def _without_round_off(values: Array, scale: Array | float) -> Array:
    """Set values that are zero by symmetry to exactly zero, so that rounding does not couple a mode."""
    return np.where(np.abs(values) <= _ZERO * scale, 0.0, values)


def _require_both_groups(patches: Sequence[Patch]) -> None:
    for group in GROUPS:
        if not any(patch.group == group for patch in patches):
            raise ParameterError(
                f"patches: none of the {len(patches)} belongs to group {group}, but a motor has the two "
                f'electrical groups A and B; add a patch with group = "{group}".'
            )


def _require_fit(beam: Beam, patches: Sequence[Patch]) -> None:
    """Check that patches are on the beam, do not overlap and have no mutual capacitance."""
    slack = _LENGTH_TOLERANCE * beam.length_m
    for index, patch in enumerate(patches):
        if patch.end_m > beam.length_m + slack:
            raise ParameterError(
                f"patches.{index}.end_m = {patch.end_m:g} m lies beyond beam.length_m = {beam.length_m:g} m; "
                "shorten or shift the patch."
            )
    for (i, first), (j, second) in combinations(enumerate(patches), 2):
        start, end = max(first.start_m, second.start_m), min(first.end_m, second.end_m)
        if end - start <= slack:
            continue
        where = f"patches.{i} and patches.{j} overlap between {start:g} m and {end:g} m"
        if set(SIDES[first.faces]) & set(SIDES[second.faces]):
            raise ParameterError(f"{where} on the same face; shift one of them or put it on the other face.")
        if first.group != second.group:
            raise ParameterError(
                f"{where} on opposite faces but belong to different groups, whose mutual capacitance the "
                "theory of the beam does not give; wire them to one group or shift one of them."
            )
