# SPDX-License-Identifier: GPL-3.0-or-later
"""Finite elements against closed forms: frequencies within 0.5 per cent, force factors and capacitances within 2.

A bar in the plane has two groups side by side; a block in three dimensions has two layers with ground between them,
group A on top, group B below, poled so that equal voltages stretch both.
"""

from math import cosh, pi, sin, sinh, sqrt, tan
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import j0, j1

from pyspice_runner.motor.solid.elements import VOLTS, Part, assemble, plate_matrix
from pyspice_runner.motor.solid.materials import VACUUM, materials
from pyspice_runner.motor.solid.parameters import Box, Electrode, Face, Solid, Support
from pyspice_runner.motor.solid.stator import Stator, solve_stator

# PZT-4, from its card
S11, S12, D31, EPSILON, DENSITY = 12.3e-12, -4.05e-12, -123e-12, 1300 * VACUUM, 7500.0
K31_SQUARED = D31**2 / (S11 * EPSILON)


def bar(length: float, height: float, material: str, element: float, highest: float, **changes: Any) -> Stator:
    """Return the modes of a bar in the plane, 1 mm thick: groups A and B on its left and right half."""
    half, thickness = 0.5 * length, 1e-3
    sides = [("A", 0.0, half), ("B", half, length)]
    parts: dict[str, Any] = {
        "boxes": (Box(material=material, from_m=(0.0, 0.0, 0.0), to_m=(length, height, thickness)),),
        "electrodes": (
            *(Electrode(group=group, from_m=(a, 0.0, thickness), to_m=(b, height, thickness)) for group, a, b in sides),
            Electrode(group="ground", from_m=(0.0, 0.0, 0.0), to_m=(length, height, 0.0)),
        ),
        "contact": Face(from_m=(length, 0.0, 0.0), to_m=(length, height, 0.0), normal="+x", tangent="+y"),
    }
    range_hz = {"lowest_hz": 10.0, "highest_hz": highest}
    return solve_stator(Solid(theory="plate", element_m=element, quality_factor=1e3, **range_hz, **parts | changes))


def layers(length: float, width: float, thickness: float, highest: float, element: float, **changes: Any) -> Stator:
    """Return the modes of two layers of PZT-4 in three dimensions."""
    corner, top = (0.0, 0.0, 0.0), (length, width, thickness)
    bottom = (0.0, 0.0, -thickness), (length, width, -thickness)
    solid = Solid(
        element_m=element, lowest_hz=10.0, highest_hz=highest, quality_factor=1e3,
        boxes=(
            Box(material="PZT-4", from_m=corner, to_m=top, polarisation="+z"),
            Box(material="PZT-4", from_m=bottom[0], to_m=(length, width, 0.0), polarisation="-z"),
        ),
        electrodes=(
            Electrode(group="A", from_m=(0.0, 0.0, thickness), to_m=top),
            Electrode(group="B", from_m=bottom[0], to_m=bottom[1]),
            Electrode(group="ground", from_m=corner, to_m=(length, width, 0.0)),
        ),
        **{"contact": Face(from_m=(length, 0.0, 0.0), to_m=(length, width, 0.0), normal="+z", tangent="+x")} | changes,
    )  # fmt: skip
    return solve_stator(solid)


def antiresonance(stator: Stator, groups: np.ndarray, above: float, below: float) -> float:
    """Return the frequency at which the admittance of both groups in parallel vanishes."""
    theta = groups @ stator.couplings_n_per_v
    static = groups @ (stator.clamped_f + stator.residual_f) @ groups

    def capacitance(frequency: float) -> float:
        stiffness = stator.stiffnesses_n_per_m - (2 * pi * frequency) ** 2 * stator.masses_kg
        return float(static + np.sum(theta**2 / stiffness))

    return float(brentq(capacitance, above, below))


def test_a_slender_bar_resonates_along_its_length_with_k31() -> None:
    # R. Holland, E. P. EerNisse, Design of Resonant Piezoelectric Devices: f_r = 1/(2L√(ρ s₁₁)); at f_a
    # (tan X)/X = −(1 − k²)/k², X = π f_a/(2 f_r). The width of L/40 lowers f_r by (ν π w/2L)²/6 < 1e-4.
    length, width = 0.04, 0.001
    found = bar(length, width, "PZT-4", 0.001, 60e3)
    resonance = 1.0 / (2.0 * length * sqrt(DENSITY * S11))
    root = brentq(lambda x: K31_SQUARED * tan(x) + (1.0 - K31_SQUARED) * x, pi / 2 + 1e-9, pi)
    along = int(np.argmax(found.tip_y))
    assert found.frequencies_hz[along] == pytest.approx(resonance, rel=5e-3)
    both = np.ones(2)
    expected = 2.0 * resonance * root / pi
    assert antiresonance(found, both, resonance * 1.001, resonance * 1.3) == pytest.approx(expected, rel=5e-3)
    # u = sin(π(x − L/2)/L): θ = ∫e₃₁ u′ w dx, each group half of it
    assert np.abs(found.couplings_n_per_v[:, along]) == pytest.approx(np.full(2, width * abs(D31) / S11), rel=0.02)
    assert found.masses_kg[along] == pytest.approx(0.5 * DENSITY * length * width * 1e-3, rel=0.02)
    moved = (both @ found.couplings_n_per_v) ** 2
    motional = both @ found.residual_f @ both + np.sum(moved / found.stiffnesses_n_per_m)
    assert both @ found.clamped_f @ both + motional == pytest.approx(EPSILON * length * width / 1e-3, rel=1e-3)


def test_a_clamped_bimorph_bends_as_a_slender_beam() -> None:
    # Euler–Bernoulli at slenderness 60, a wide beam: no strain along y, so the constants are c = s₁₁/(s₁₁² − s₁₂²),
    # e = d₃₁/(s₁₁ + s₁₂), ε = εᵀ − 2d₃₁²/(s₁₁ + s₁₂). The field within a layer follows the strain, which stiffens it:
    # with D uniform, EI = 2w (c h³/3 + (e²/ε) h³/12). A group has the moment w e h/2 per volt.
    thickness, width = 0.25e-3, 1e-3
    length = 60 * 2 * thickness
    low, high = (0.0, 0.0, -thickness), (length, width, thickness)
    held = (
        Support(from_m=low, to_m=(0.0, width, thickness), directions="x"),
        Support(from_m=(0.0, 0.0, 0.0), to_m=(0.0, width, 0.0), directions="z"),
        Support(from_m=low, to_m=(length, 0.0, thickness), directions="y"),
        Support(from_m=(0.0, width, -thickness), to_m=high, directions="y"),
    )
    found = layers(length, width, thickness, 500.0, 1e-3, supports=held)
    elastic, piezo = S11 / (S11**2 - S12**2), abs(D31) / (S11 + S12)
    permittivity = EPSILON - 2 * D31**2 / (S11 + S12)
    stiffness = 2 * width * thickness**3 * (elastic / 3 + piezo**2 / permittivity / 12)
    beta = brentq(lambda x: np.cos(x) * cosh(x) + 1.0, 1.8, 1.9)
    frequency = beta**2 / (2 * pi * length**2) * sqrt(stiffness / (DENSITY * 2 * thickness * width))
    assert found.frequencies_hz[0] == pytest.approx(frequency, rel=5e-3)
    sigma = (np.cos(beta) + cosh(beta)) / (sin(beta) + sinh(beta))
    end = cosh(beta) - np.cos(beta) - sigma * (sinh(beta) - sin(beta))
    slope = beta / length * (sinh(beta) + sin(beta) - sigma * (cosh(beta) - np.cos(beta))) / end
    moment = width * thickness * piezo / 2
    assert np.abs(found.couplings_n_per_v[:, 0]) == pytest.approx(np.full(2, moment * slope), rel=0.02)
    assert found.couplings_n_per_v[0, 0] == pytest.approx(-found.couplings_n_per_v[1, 0], rel=1e-6)
    assert found.tip_y[0] == pytest.approx(1.0, rel=1e-3)
    assert found.masses_kg[0] == pytest.approx(0.25 * DENSITY * 2 * thickness * width * length, rel=0.01)


def test_the_thickness_mode_of_a_plate_held_at_its_edges_has_kt() -> None:
    # IEEE Std 176: f_p = v/(2t), k_t² = (π/2)(f_s/f_p) tan((π/2)(f_p − f_s)/f_p), of a plate as thick as both layers
    card, thickness, width = materials()["PZT-4"], 0.5e-3, 0.2e-3
    e33, clamped = card.stress_constants_c_m2[2, 2], card.permittivity_f_m[2, 2]
    stiffened = card.stiffness_pa[2, 2] + e33**2 / clamped
    kt_squared = e33**2 / (stiffened * clamped)
    low, high = (0.0, 0.0, -thickness), (width, width, thickness)
    held = [
        Support(from_m=low, to_m=(0.0, width, thickness), directions="x"),
        Support(from_m=(width, 0.0, -thickness), to_m=high, directions="x"),
        Support(from_m=low, to_m=(width, 0.0, thickness), directions="y"),
        Support(from_m=(0.0, width, -thickness), to_m=high, directions="y"),
    ]
    top = Face(from_m=(0.0, 0.0, thickness), to_m=high, normal="+z", tangent="+x")
    found = layers(width, width, thickness, 3e6, 0.2e-3, supports=tuple(held), contact=top)
    parallel = sqrt(stiffened / DENSITY) / (4 * thickness)
    series = brentq(
        lambda f: kt_squared - pi / 2 * (f / parallel) * tan(pi / 2 * (1 - f / parallel)), 0.5 * parallel, parallel
    )
    both = np.ones(2)
    thick = int(np.argmax(np.abs(both @ found.couplings_n_per_v)))
    assert found.frequencies_hz[thick] == pytest.approx(series, rel=5e-3)
    assert antiresonance(found, both, series * 1.001, 1.1 * parallel) == pytest.approx(parallel, rel=5e-3)
    # clamped: ε₃₃ˢ over the area, no fringing field outside
    assert np.diag(found.clamped_f) == pytest.approx(np.full(2, clamped * width**2 / thickness), rel=1e-6)
    assert found.clamped_f[0, 1] == pytest.approx(0.0, abs=1e-9 * found.clamped_f[0, 0])


@pytest.mark.parametrize(("slenderness", "half_waves"), [(60, 1), (10, 1), (5, 1), (10, 2)])
def test_a_simply_supported_steel_beam_follows_timoshenko(slenderness: int, half_waves: int) -> None:
    # S. Timoshenko, Phil. Mag. 41 (1921) 744: ρI/κG ω⁴ − (ρA + q²ρI(1 + E/κG)) ω² + EI q⁴ = 0, in plane stress
    # with κ = (5 + 5ν)/(6 + 5ν); at slenderness 60 Euler–Bernoulli is within 0.2 %
    modulus, poisson, density, height = 211.9e9, 0.291, 7860.0, 2e-3
    length = slenderness * height
    ends = [Support(from_m=(x, 0.0, 0.0), to_m=(x, height, 0.0), directions="y") for x in (0.0, length)]
    held = (*ends, Support(from_m=(0.0, 0.5 * height, 0.0), to_m=(0.0, 0.5 * height, 0.0), directions="x"))
    at = length / (2 * half_waves)
    contact = Face(from_m=(at, height, 0.0), to_m=(at, height, 0.0), normal="+y", tangent="+x")
    shear = (5 + 5 * poisson) / (6 + 5 * poisson) * modulus / (2 * (1 + poisson))
    q, radius = half_waves * pi / length, height**2 / 12
    linear = -(1 + q**2 * radius * (1 + modulus / shear))
    omega = sqrt(min(np.roots([density * radius / shear, linear, modulus * radius / density * q**4])))
    found = bar(length, height, "steel", 1e-3, 1.5 * omega / (2 * pi), supports=held, contact=contact)
    nearest = found.frequencies_hz[np.argmin(np.abs(found.frequencies_hz - omega / (2 * pi)))]
    assert nearest == pytest.approx(omega / (2 * pi), rel=5e-3)
    slender = q**2 * sqrt(modulus * radius / density)
    if slenderness == 60:
        assert nearest == pytest.approx(slender / (2 * pi), rel=5e-3)
    assert not found.couplings_n_per_v.any()


def test_frequencies_converge_with_the_fourth_power_of_the_element() -> None:
    # quadratic elements of a smooth mode; the finest mesh stands for the limit, which leaves 1/16 of the error before
    length, height = 0.02, 0.004

    def first(element: float) -> float:
        contact = Face(from_m=(0.0, height, 0.0), to_m=(0.0, height, 0.0), normal="+y", tangent="+x")
        return float(bar(length, height, "steel", element, 60e3, contact=contact).frequencies_hz[0])

    coarse, middle, fine, finest = (first(element) for element in (4e-3, 2e-3, 1e-3, 0.5e-3))
    assert coarse > middle > fine > finest
    assert 10.0 < (coarse - finest) / (middle - finest) < 24.0
    assert 10.0 < (middle - finest) / (fine - finest) < 24.0
    assert middle == pytest.approx(finest, rel=2e-3)


def test_a_disc_has_the_radial_modes_of_the_standard() -> None:
    # IEEE Std 176-1987, 6.4: η J₀(η) = (1 − σ) J₁(η), f = η/(2πa) √(c/ρ), c = s₁₁/(s₁₁² − s₁₂²), σ = −s₁₂/s₁₁
    from skfem import Basis, ElementTriP2, MeshTri2

    sigma, wanted, roots = -S12 / S11, [], []
    for low, high in ((1.5, 2.5), (5.0, 6.0)):
        eta = brentq(lambda x: x * j0(x) - (1 - sigma) * j1(x), low, high)
        roots.append(eta)
        wanted.append(eta / (2 * pi * 0.01) * sqrt(S11 / (S11**2 - S12**2) / DENSITY))
    mesh = MeshTri2.init_circle(2).scaled(0.01)
    basis = Basis(mesh, ElementTriP2(), intorder=4)
    card, unknowns = materials()["PZT-4"], 2 * basis.N
    part = Part(
        np.arange(mesh.t.shape[1]), plate_matrix(card.matrix(), shorted=True), DENSITY, 1e-3, (unknowns, unknowns + 2)
    )
    place = np.append(np.arange(unknowns), [unknowns, unknowns + 1, -1])
    stiffness, mass = (item.toarray() for item in assemble(basis, [part], place, unknowns + 2))
    squares, vectors = eigh(stiffness[:unknowns, :unknowns], mass[:unknowns, :unknowns], subset_by_index=(3, 60))
    charges = np.abs(stiffness[unknowns, :unknowns] @ vectors)  # only radial modes have one
    radial = np.sqrt(squares[np.sort(np.argsort(charges)[-2:])]) / (2 * pi)
    assert radial == pytest.approx(wanted, rel=5e-3)
    # u = J₁(ηr/a): θ = 2πa e J₁(η), e = d₃₁/(s₁₁ + s₁₂), m = πρta² (J₁² − J₀ J₂); the vectors have a mass of 1
    for index, eta in enumerate(roots):
        mass = pi * DENSITY * 1e-3 * 0.01**2 * (j1(eta) ** 2 - j0(eta) * (2 * j1(eta) / eta - j0(eta)))
        theta = 2 * pi * 0.01 * abs(D31) / (S11 + S12) * abs(j1(eta)) / sqrt(mass)
        assert np.sort(charges)[-1 - index] / VOLTS == pytest.approx(theta, rel=0.02)
