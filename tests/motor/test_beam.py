# SPDX-License-Identifier: GPL-3.0-or-later
"""The resonator against closed forms, transcendental equations, quadrature and statics."""

import os
import subprocess
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid
from scipy.optimize import brentq

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.beam import Resonator, clamped_capacitances, resonator_modes, solve_resonator
from pyspice_runner.motor.parameters import Beam, Damping, Patch, Tip

EPSILON_0 = 8.8541878128e-12
BEAM = Beam(
    length_m=0.03, width_m=0.008, thickness_m=0.002, youngs_modulus_pa=190e9, density_kg_m3=7900.0,
    theory="bernoulli-euler",
)  # fmt: skip
THICK = BEAM.model_copy(update={"theory": "timoshenko", "thickness_m": 0.005, "poissons_ratio": 0.27})
DAMPING = Damping(alpha_per_s=900.0, beta_s=3e-8)
NO_TIP = Tip(position_m=0.011, length_m=0.0, mass_kg=0.0, rotary_inertia_kg_m2=0.0)
CENTRAL_TIP = Tip(position_m=0.015, length_m=0.005, mass_kg=2e-4, rotary_inertia_kg_m2=3e-9)


def patch(group: str = "A", start: float = 0.002, end: float = 0.012, **changes: object) -> Patch:
    values: dict[str, object] = {
        "group": group,
        "faces": "both",
        "start_m": start,
        "end_m": end,
        "width_m": 0.006,
        "thickness_m": 0.0006,
        "layers": 1,
        "youngs_modulus_pa": 70e9,
        "density_kg_m3": 7700.0,
        "piezoelectric_constant_m_per_v": -150e-12,
        "permittivity_f_m": 1300 * EPSILON_0,
    }
    return Patch.model_validate(values | changes)


SYMMETRIC = (patch("A", 0.002, 0.0135), patch("B", 0.0165, 0.028))
SKEW = (
    patch("A", 0.0013, 0.0094),
    patch("B", 0.0107, 0.0202, faces="top", thickness_m=0.0009, width_m=0.007),
    patch("B", 0.0155, 0.0291, faces="bottom", thickness_m=0.0004, layers=2),
)
SKEW_TIP = Tip(position_m=0.0123, length_m=0.004, mass_kg=1.5e-4, rotary_inertia_kg_m2=1.2e-9)

beams = st.builds(
    Beam,
    length_m=st.floats(0.005, 0.5),
    width_m=st.floats(0.001, 0.1),
    thickness_m=st.floats(2e-4, 0.02),
    youngs_modulus_pa=st.floats(1e9, 5e11),
    density_kg_m3=st.floats(1000.0, 2e4),
    theory=st.just("bernoulli-euler"),
)


def bending_stiffness(beam: Beam) -> float:
    return beam.youngs_modulus_pa * beam.width_m * beam.thickness_m**3 / 12


def mass_per_length(beam: Beam) -> float:
    return beam.density_kg_m3 * beam.width_m * beam.thickness_m


def frequency(stiffness: float, mass: float, beta: float, length: float) -> float:
    """f of a uniform beam whose wavenumber is β/L."""
    return float((beta / length) ** 2 * np.sqrt(stiffness / mass) / (2 * np.pi))


def transformed_section(beam: Beam, patches: tuple[Patch, ...]) -> tuple[float, float, float, list[float]]:
    """Textbook laminate: axial stiffness, neutral axis, bending stiffness about it, ceramic heights."""
    parts = [(beam.youngs_modulus_pa, beam.width_m, beam.thickness_m, 0.0)]
    heights = []
    for p in patches:
        for side in sides(p):
            heights.append(side * (beam.thickness_m + p.thickness_m) / 2)
            parts.append((p.youngs_modulus_pa, p.width_m, p.thickness_m, heights[-1]))
    axial = sum(e * b * t for e, b, t, _ in parts)
    neutral = sum(e * b * t * z for e, b, t, z in parts) / axial
    bending = sum(e * b * (t**3 / 12 + t * (z - neutral) ** 2) for e, b, t, z in parts)
    return axial, neutral, bending, heights


def moment_per_volt(p: Patch, distance: float) -> float:
    """Moment of one face at a distance from the neutral axis, so poled that U > 0 bends the beam upwards."""
    stress_per_volt = p.youngs_modulus_pa * p.piezoelectric_constant_m_per_v * p.layers / p.thickness_m
    return stress_per_volt * p.width_m * p.thickness_m * distance


def second_derivative(resonator: Resonator, x: np.ndarray) -> np.ndarray:
    k = resonator.wavenumbers
    return -np.sin(np.outer(x, k)) @ (k[:, None] ** 2 * resonator.coefficients)


def sides(p: Patch) -> tuple[int, ...]:
    return {"both": (1, -1), "top": (1,), "bottom": (-1,)}[p.faces]


def section(beam: Beam, patches: tuple[Patch, ...]) -> tuple[float, float, np.ndarray]:
    """Mass per length, bending stiffness, and moment per volt of each group."""
    _, neutral, bending, _ = transformed_section(beam, patches)
    line, moments = mass_per_length(beam), np.zeros(2)
    for p in patches:
        for side in sides(p):
            line += p.density_kg_m3 * p.width_m * p.thickness_m
            distance = side * (side * (beam.thickness_m + p.thickness_m) / 2 - neutral)
            moments["AB".index(p.group)] += moment_per_volt(p, distance)
    return line, bending, moments


def stretches(beam: Beam, patches: tuple[Patch, ...]) -> list[tuple[float, float, tuple[Patch, ...]]]:
    edges = sorted({0.0, beam.length_m, *(e for p in patches for e in (p.start_m, p.end_m))})
    return [(a, b, tuple(p for p in patches if p.start_m < (a + b) / 2 < p.end_m)) for a, b in pairwise(edges)]


# --- uniform beams ------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(beam=beams, shapes=st.integers(4, 30))
def test_bare_beam_has_its_closed_form(beam: Beam, shapes: int) -> None:
    tip = Tip(position_m=0.3 * beam.length_m, length_m=0.001, mass_kg=0.0, rotary_inertia_kg_m2=0.0)
    resonator = solve_resonator(beam, (), tip, count=4, shapes=shapes)
    n = np.arange(1, 5)
    stiffness, mass = bending_stiffness(beam), mass_per_length(beam)
    expected = n**2 * np.pi / (2 * beam.length_m**2) * np.sqrt(stiffness / mass)
    np.testing.assert_allclose(resonator.frequencies_hz, expected, rtol=1e-12)
    np.testing.assert_allclose(resonator.masses_kg, mass * beam.length_m / 2, rtol=1e-10)
    np.testing.assert_allclose(resonator.tip_y, np.sin(0.3 * np.pi * n), rtol=1e-9)
    slope = n * np.pi / beam.length_m * np.cos(0.3 * np.pi * n)
    np.testing.assert_allclose(resonator.tip_x, -0.001 * slope, rtol=1e-9)
    assert not resonator.couplings_n_per_v.any()


@pytest.mark.parametrize("faces", ["both", "top", "bottom"])
@pytest.mark.parametrize("layers", [1, 5])
def test_full_length_patch_makes_a_uniform_laminate(faces: str, layers: int) -> None:
    p = patch("A", 0.0, BEAM.length_m, faces=faces, layers=layers)
    _, neutral, bending, heights = transformed_section(BEAM, (p,))
    mass = mass_per_length(BEAM) + len(heights) * p.density_kg_m3 * p.width_m * p.thickness_m
    resonator = solve_resonator(BEAM, (p,), NO_TIP, count=3)
    expected = [frequency(bending, mass, n * np.pi, BEAM.length_m) for n in (1, 2, 3)]
    np.testing.assert_allclose(resonator.frequencies_hz, expected, rtol=1e-12)
    # θ = m [φ'(L) − φ'(0)], m = Σ (stress per volt)(area)(distance from the composite's neutral axis)
    moment = sum(moment_per_volt(p, abs(z - neutral)) for z in heights)
    turn = -2 * np.pi / BEAM.length_m
    np.testing.assert_allclose(resonator.couplings_n_per_v[0], [moment * turn, 0.0, 3 * moment * turn], rtol=1e-9)
    assert resonator.couplings_n_per_v[0, 0] > 0.0
    assert resonator.couplings_n_per_v[0, 1] == 0.0


def test_vanishing_patch_leaves_the_bare_beam_and_couples_by_its_end_slopes() -> None:
    speck = patch("A", 0.0041, 0.0102, width_m=1.1e-5, thickness_m=1.1e-6)
    resonator = solve_resonator(BEAM, (speck,), NO_TIP, count=3)
    n = np.arange(1, 4)
    bare = [frequency(bending_stiffness(BEAM), mass_per_length(BEAM), j * np.pi, BEAM.length_m) for j in n]
    np.testing.assert_allclose(resonator.frequencies_hz, bare, rtol=3e-6)
    k = n * np.pi / BEAM.length_m
    turn = k * (np.cos(k * speck.end_m) - np.cos(k * speck.start_m))
    moment = 2 * moment_per_volt(speck, (BEAM.thickness_m + speck.thickness_m) / 2)
    np.testing.assert_allclose(resonator.couplings_n_per_v[0], moment * turn, rtol=1e-4)


# --- shear and rotary inertia -------------------------------------------------------------------------------


def timoshenko(beam: Beam, half_waves: int) -> np.ndarray:
    """Both frequencies in Hz of a uniform, simply supported beam with w = sin qx and ψ ~ cos qx.

    S. Timoshenko, Phil. Mag. 41 (1921) 744: ρI/κG ω⁴ − (ρA + q²ρI(1 + E/κG)) ω² + EI q⁴ = 0, over A.
    """
    poisson, modulus, density = beam.poissons_ratio, beam.youngs_modulus_pa, beam.density_kg_m3
    shear = 10 * (1 + poisson) / (12 + 11 * poisson) * modulus / (2 * (1 + poisson))
    q, radius = half_waves * np.pi / beam.length_m, beam.thickness_m**2 / 12
    first, second = density**2 * radius / shear, density * (1 + q**2 * radius * (1 + modulus / shear))
    root = np.sqrt(second**2 - 4 * first * modulus * radius * q**4)
    low = 2 * modulus * radius * q**4 / (second + root)  # without cancellation
    return np.sqrt([low, (second + root) / (2 * first)]) / (2 * np.pi)


@settings(max_examples=30, deadline=None)
@given(beam=beams, slenderness=st.sampled_from([60.0, 10.0, 5.0]), poisson=st.floats(0.0, 0.49))
def test_uniform_beam_has_timoshenkos_closed_form(beam: Beam, slenderness: float, poisson: float) -> None:
    changes = {"theory": "timoshenko", "thickness_m": beam.length_m / slenderness, "poissons_ratio": poisson}
    beam = beam.model_copy(update=changes)
    tip = Tip(position_m=0.3 * beam.length_m, length_m=0.001, mass_kg=0.0, rotary_inertia_kg_m2=0.0)
    resonator = solve_resonator(beam, (), tip, count=3, shapes=6)
    expected = np.sort(np.ravel([timoshenko(beam, n) for n in range(1, 7)]))[:3]
    np.testing.assert_allclose(resonator.frequencies_hz, expected, rtol=1e-10)
    # first mode: w = sin qx, ψ = q (1 − ρω²/κG q²) cos qx, from the equation of the shear force
    q, omega = np.pi / beam.length_m, 2 * np.pi * expected[0]
    shear = beam.youngs_modulus_pa * 5 / (12 + 11 * poisson)
    turn = q * (1 - beam.density_kg_m3 * omega**2 / (shear * q**2))
    assert resonator.tip_x[0] == pytest.approx(-0.001 * turn * np.cos(0.3 * np.pi), rel=1e-9)
    inertia = mass_per_length(beam) * (1 + turn**2 * beam.thickness_m**2 / 12) * beam.length_m / 2
    assert resonator.masses_kg[0] == pytest.approx(inertia, rel=1e-9)
    assert resonator.recoils_kg[0] == pytest.approx(mass_per_length(beam) * beam.length_m * 2 / np.pi, rel=1e-9)


def test_a_slender_beam_is_that_of_bernoulli_and_euler() -> None:
    # with tip and patches; the corrections are of the order of (h/L)²: 1e-8 at h = L/10⁴
    changes = {"thickness_m": 3e-6}
    patches = tuple(p.model_copy(update=changes) for p in SKEW)
    tip = SKEW_TIP.model_copy(update={"mass_kg": 1e-7, "rotary_inertia_kg_m2": 1e-12})
    found = [
        solve_resonator(BEAM.model_copy(update={**changes, "theory": theory}), patches, tip)
        for theory in ("timoshenko", "bernoulli-euler")
    ]
    for name in ("frequencies_hz", "masses_kg", "couplings_n_per_v", "tip_x", "tip_y", "recoils_kg"):
        slender, euler = (getattr(item, name) for item in found)
        np.testing.assert_allclose(slender, euler, rtol=1e-6, err_msg=name)


def shear_stiffness(beam: Beam, patches: tuple[Patch, ...]) -> tuple[float, float]:
    """κGA and ρI of a section by quadrature of the shear flow on a fine grid."""
    _, neutral, bending, heights = transformed_section(beam, patches)
    half = beam.thickness_m / 2
    layers = [(-half, half, beam)]
    for p, height in zip([q for q in patches for _ in range(2 if q.faces == "both" else 1)], heights, strict=True):
        layers.append((height - p.thickness_m / 2, height + p.thickness_m / 2, p))
    above = compliance = inertia = 0.0
    for low, high, part in sorted(layers, key=lambda layer: -layer[0]):
        z = np.linspace(high, low, 20001)
        flow = above + part.youngs_modulus_pa * part.width_m * (
            (high - neutral) ** 2 - (z - neutral) ** 2
        ) / 2  # fmt: skip
        poisson = part.poissons_ratio
        shear = part.youngs_modulus_pa / (2 * (1 + poisson)) * 1.2 * 10 * (1 + poisson) / (12 + 11 * poisson)
        compliance += trapezoid(flow**2 / (shear * part.width_m), -z)
        inertia += part.density_kg_m3 * part.width_m * trapezoid((z - neutral) ** 2, -z)
        above = flow[-1]
    assert above == pytest.approx(0.0, abs=1e-9 * beam.youngs_modulus_pa * beam.width_m * half**2)
    return bending**2 / compliance, inertia


@pytest.mark.parametrize("faces", ["both", "top"])
def test_full_length_patch_shears_as_a_uniform_laminate(faces: str) -> None:
    p = patch("A", 0.0, BEAM.length_m, faces=faces, thickness_m=0.002, poissons_ratio=0.37)
    _, _, bending, heights = transformed_section(THICK, (p,))
    shear, inertia = shear_stiffness(THICK, (p,))
    mass = mass_per_length(THICK) + len(heights) * p.density_kg_m3 * p.width_m * p.thickness_m
    resonator = solve_resonator(THICK, (p,), NO_TIP)
    for mode, q in enumerate((np.pi / THICK.length_m, 2 * np.pi / THICK.length_m)):
        # two by two: w = sin qx, ψ = r cos qx
        stiffness = np.array([[shear * q**2, -shear * q], [-shear * q, shear + bending * q**2]])
        squares = np.linalg.eigvals(np.diag([1 / mass, 1 / inertia]) @ stiffness)
        assert resonator.frequencies_hz[mode] == pytest.approx(np.sqrt(min(squares)) / (2 * np.pi), rel=1e-6)


def rotation(resonator: Resonator, x: np.ndarray | float) -> np.ndarray:
    """Rotation ψ = w′ − γ of the sections."""
    k = np.concatenate(([0.0], resonator.wavenumbers))
    return resonator.slope(x) - np.cos(np.multiply.outer(x, k)) @ resonator.shears


# --- the tip ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.01, 0.1, 1.0])
def test_central_mass_against_the_transcendental_equation(ratio: float) -> None:
    line = mass_per_length(BEAM)
    tip = NO_TIP.model_copy(update={"position_m": BEAM.length_m / 2, "mass_kg": ratio * line * BEAM.length_m})
    beta = brentq(lambda b: 4 / (ratio * b) - np.tan(b / 2) + np.tanh(b / 2), 0.5, np.pi - 1e-9, xtol=1e-14)
    resonator = solve_resonator(BEAM, (), tip, shapes=100)
    exact = frequency(bending_stiffness(BEAM), line, beta, BEAM.length_m)
    assert resonator.frequencies_hz[0] == pytest.approx(exact, rel=1e-5)
    assert resonator.frequencies_hz[0] >= exact
    # The antisymmetric mode has its node there.
    bare = frequency(bending_stiffness(BEAM), line, 2 * np.pi, BEAM.length_m)
    assert resonator.frequencies_hz[1] == pytest.approx(bare, rel=1e-12)


@pytest.mark.parametrize("ratio", [1e-4, 1e-3, 1e-2])
def test_central_rotary_inertia_against_the_transcendental_equation(ratio: float) -> None:
    line = mass_per_length(BEAM)
    inertia = ratio * line * BEAM.length_m**3
    tip = NO_TIP.model_copy(update={"position_m": BEAM.length_m / 2, "rotary_inertia_kg_m2": inertia})
    beta = brentq(
        lambda b: 4 / (ratio * b**3) - 1 / np.tanh(b / 2) + 1 / np.tan(b / 2),
        1.0,
        2 * np.pi - 1e-9,
        xtol=1e-14,
    )
    exact = frequency(bending_stiffness(BEAM), line, beta, BEAM.length_m)

    def second(shapes: int) -> float:
        # Whether the rotary inertia's mode lies below or above the symmetric one depends on the ratio.
        resonator = solve_resonator(BEAM, (), tip, count=2, shapes=shapes)
        antisymmetric = np.abs(resonator.deflection(BEAM.length_m / 2)) < 1e-6
        return float(resonator.frequencies_hz[antisymmetric][0])

    coarse, fine = second(64), second(128)
    assert exact < fine < coarse
    assert (coarse - exact) / (fine - exact) == pytest.approx(2.0, rel=0.05)  # first order: w″ jumps
    assert 2 * fine - coarse == pytest.approx(exact, rel=2e-4)


def test_tip_moves_with_deflection_and_slope() -> None:
    resonator = solve_resonator(BEAM, SKEW, SKEW_TIP, count=3)
    step = 1e-7
    above, below = resonator.deflection([SKEW_TIP.position_m + step, SKEW_TIP.position_m - step])
    np.testing.assert_allclose(resonator.tip_y, (above + below) / 2, rtol=1e-6)
    np.testing.assert_allclose(resonator.tip_x, -SKEW_TIP.length_m * (above - below) / (2 * step), rtol=1e-6)


# --- composite beams ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("beam", "within"), [(BEAM, 1e-10), (THICK, 1e-6)])
def test_modal_matrices_by_quadrature(beam: Beam, within: float) -> None:
    """φᵀMφ and φᵀKφ are diagonal and equal the modal masses and stiffnesses; Θ is ∫ m ψ′ dx.

    A slender beam has ψ = w′ alone. A thick one adds ∫κGA (w′ − ψ)² and ∫ρI ψ², and its rigid tip turns with ψ.
    """
    thick = beam is THICK
    resonator = solve_resonator(beam, SKEW, SKEW_TIP, count=4, shapes=24)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    mass, stiffness = np.zeros((2, 4, 4))
    coupling = np.zeros((2, 4))
    turned = (lambda x: rotation(resonator, x)) if thick else resonator.slope
    recoil = SKEW_TIP.mass_kg * resonator.deflection(SKEW_TIP.position_m)
    step = 1e-8
    for start, end, here in stretches(beam, SKEW):
        x, dx = (start + end) / 2 + nodes * (end - start) / 2, weights * (end - start) / 2
        line, bending, moments = section(beam, here)
        w, turn, bend = resonator.deflection(x), turned(x), second_derivative(resonator, x)
        if thick:
            bend = (turned(x + step) - turned(x - step)) / (2 * step)
            shear, inertia = shear_stiffness(beam, here)
            angle = resonator.slope(x) - turn
            mass += inertia * (turn.T * dx) @ turn
            stiffness += shear * (angle.T * dx) @ angle
        coupling += np.outer(moments, dx @ bend)
        recoil = recoil + line * (dx @ w)
        mass += line * (w.T * dx) @ w
        stiffness += bending * (bend.T * dx) @ bend
    value, turn = resonator.deflection(SKEW_TIP.position_m), turned(SKEW_TIP.position_m)
    mass += SKEW_TIP.mass_kg * np.outer(value, value) + SKEW_TIP.rotary_inertia_kg_m2 * np.outer(turn, turn)
    np.testing.assert_allclose(np.diag(mass), resonator.masses_kg, rtol=within)
    np.testing.assert_allclose(np.diag(stiffness), resonator.stiffnesses_n_per_m, rtol=within)
    for matrix in (mass, stiffness):
        scaled = matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
        np.testing.assert_allclose(scaled, np.eye(4), atol=within)
    np.testing.assert_allclose(coupling, resonator.couplings_n_per_v, rtol=max(within, 1e-9))
    np.testing.assert_allclose(recoil, resonator.recoils_kg, rtol=1e-6)
    np.testing.assert_allclose(-SKEW_TIP.length_m * turn, resonator.tip_x, rtol=1e-12)


@pytest.mark.parametrize("beam", [BEAM, THICK])
def test_frequencies_fall_towards_their_limit_at_first_order(beam: Beam) -> None:
    frequencies = np.array(
        [solve_resonator(beam, SKEW, SKEW_TIP, shapes=n).frequencies_hz for n in (10, 20, 40, 80, 160)]
    )
    steps = np.diff(frequencies, axis=0)
    assert (steps <= 0.0).all()
    order = np.log2(np.abs(frequencies[0] - frequencies[2]) / np.abs(frequencies[2] - frequencies[4])) / 2
    assert (order > 0.7).all()
    assert (order < 1.6).all()
    assert (np.abs(frequencies[2] / frequencies[4] - 1) < 0.01).all()


@settings(max_examples=20, deadline=None)
@given(
    edges=st.lists(st.integers(0, 100), min_size=4, max_size=4, unique=True).map(sorted),
    position=st.integers(0, 100),
    faces=st.sampled_from(["both", "top", "bottom"]),
)
def test_shapes_are_scaled_to_a_largest_deflection_of_one(edges: list[int], position: int, faces: str) -> None:
    a, b, c, d = (0.01 * edge * BEAM.length_m for edge in edges)
    patches = (patch("A", a, b, faces=faces), patch("B", c, d))
    tip = CENTRAL_TIP.model_copy(update={"position_m": 0.01 * position * BEAM.length_m})
    resonator = solve_resonator(BEAM, patches, tip, count=3, shapes=16)
    w = np.abs(resonator.deflection(np.linspace(0.0, BEAM.length_m, 4001)))
    assert (w.max(axis=0) <= 1.0 + 1e-12).all()
    assert (w.max(axis=0) >= 1.0 - 1e-4).all()
    assert (resonator.slope(0.0) > 0.0).all()


@pytest.mark.parametrize("beam", [BEAM, THICK])
def test_symmetric_motor_has_exact_symmetries(beam: Beam) -> None:
    first, second = resonator_modes(beam, SYMMETRIC, CENTRAL_TIP, DAMPING)
    assert (first.name, second.name) == ("bending-1", "bending-2")
    assert first.coupling_a_n_per_v == pytest.approx(first.coupling_b_n_per_v, rel=1e-10)
    assert second.coupling_a_n_per_v == pytest.approx(-second.coupling_b_n_per_v, rel=1e-10)
    assert first.coupling_a_n_per_v > 0.0
    assert second.coupling_a_n_per_v > 0.0
    assert first.tip_x == 0.0
    assert second.tip_y == 0.0
    assert first.tip_y == pytest.approx(1.0)
    assert second.tip_x > 0.0


@pytest.mark.parametrize("beam", [BEAM, THICK])
def test_a_mirrored_motor_has_mirrored_modes(beam: Beam) -> None:
    length = BEAM.length_m
    mirrored = tuple(p.model_copy(update={"start_m": length - p.end_m, "end_m": length - p.start_m}) for p in SKEW)
    tip = SKEW_TIP.model_copy(update={"position_m": length - SKEW_TIP.position_m})
    here, there = solve_resonator(beam, SKEW, SKEW_TIP), solve_resonator(beam, mirrored, tip)
    parity = np.array([1.0, -1.0])
    np.testing.assert_allclose(there.frequencies_hz, here.frequencies_hz, rtol=1e-10)
    np.testing.assert_allclose(there.couplings_n_per_v, here.couplings_n_per_v * parity, rtol=1e-8)
    np.testing.assert_allclose(there.tip_y, here.tip_y * parity, rtol=1e-8)
    np.testing.assert_allclose(there.tip_x, -here.tip_x * parity, rtol=1e-8)


@pytest.mark.parametrize("beam", [BEAM, THICK])
def test_a_patch_cut_in_two_is_the_same_patch(beam: Beam) -> None:
    cut = (patch("A", 0.002, 0.007), patch("A", 0.007, 0.0135), SYMMETRIC[1])
    whole, halves = solve_resonator(beam, SYMMETRIC, SKEW_TIP), solve_resonator(beam, cut, SKEW_TIP)
    np.testing.assert_allclose(halves.frequencies_hz, whole.frequencies_hz, rtol=1e-12)
    np.testing.assert_allclose(halves.couplings_n_per_v, whole.couplings_n_per_v, rtol=1e-10)
    assert clamped_capacitances(BEAM, cut) == pytest.approx(clamped_capacitances(BEAM, SYMMETRIC))


def test_modes_carry_rayleigh_damping() -> None:
    resonator = solve_resonator(BEAM, SKEW, SKEW_TIP, count=3)
    modes = resonator_modes(BEAM, SKEW, SKEW_TIP, DAMPING, count=3)
    for mode, frequency_hz in zip(modes, resonator.frequencies_hz, strict=True):
        omega = 2 * np.pi * frequency_hz
        assert omega**2 == pytest.approx(mode.stiffness_n_per_m / mode.mass_kg)
        quality = omega * mode.mass_kg / mode.damping_n_s_per_m
        assert 1 / quality == pytest.approx(DAMPING.alpha_per_s / omega + DAMPING.beta_s * omega)


# --- statics and electricity --------------------------------------------------------------------------------


@cache
def skew_resonator(shapes: int) -> Resonator:
    """The skew beam with many modes, which take a second."""
    return solve_resonator(BEAM, SKEW, SKEW_TIP, count=shapes, shapes=shapes)


@pytest.mark.parametrize("group", [0, 1])
def test_static_deflection_per_volt_is_that_of_the_statically_determinate_beam(group: int) -> None:
    """Unloaded, the beam carries no moment, so w″ = m U/(D − B²/A); integrate twice with w(0) = w(L) = 0."""
    xt, length = SKEW_TIP.position_m, BEAM.length_m
    exact = 0.0
    for start, end, here in stretches(BEAM, SKEW):
        _, bending, moments = section(BEAM, here)
        x = np.linspace(start, end, 2001)
        influence = -np.where(x < xt, x * (length - xt), xt * (length - x)) / length
        exact += moments[group] / bending * trapezoid(influence, x)

    def modal_sum(shapes: int) -> float:
        resonator = skew_resonator(shapes)
        compliance = resonator.tip_y / resonator.stiffnesses_n_per_m
        return float(resonator.couplings_n_per_v[group] @ compliance)

    coarse, fine = modal_sum(60), modal_sum(120)
    assert exact > 0.0
    assert fine == pytest.approx(exact, rel=1e-2)
    assert abs(fine - exact) < abs(coarse - exact)


def test_capacitance_of_plates_without_piezoelectricity() -> None:
    patches = tuple(p.model_copy(update={"piezoelectric_constant_m_per_v": 0.0, "layers": 4}) for p in SYMMETRIC)
    p = patches[0]
    layer = p.thickness_m / 4
    plates = p.permittivity_f_m * p.width_m * (p.end_m - p.start_m) / layer
    assert clamped_capacitances(BEAM, patches) == pytest.approx((8 * plates, 8 * plates))


def test_capacitance_of_a_pair_is_fully_clamped() -> None:
    p = SYMMETRIC[0]
    permittivity = p.permittivity_f_m - p.piezoelectric_constant_m_per_v**2 * p.youngs_modulus_pa
    expected = 2 * permittivity * p.width_m * (p.end_m - p.start_m) / p.thickness_m
    assert clamped_capacitances(BEAM, SYMMETRIC) == pytest.approx((expected, expected))


@pytest.mark.parametrize("faces", ["top", "bottom"])
def test_capacitance_of_one_face_is_free_to_stretch(faces: str) -> None:
    p = patch("A", faces=faces)
    axial, *_ = transformed_section(BEAM, (p,))
    share = p.youngs_modulus_pa * p.width_m * p.thickness_m / axial  # 1: free to stretch, 0: held by the beam
    clamping = p.piezoelectric_constant_m_per_v**2 * p.youngs_modulus_pa * (1 - share)
    expected = (p.permittivity_f_m - clamping) * p.width_m * (p.end_m - p.start_m) / p.thickness_m
    assert clamped_capacitances(BEAM, (p, SYMMETRIC[1]))[0] == pytest.approx(expected)


# --- invalid input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("patches", "message"),
    [
        ((SYMMETRIC[0], patch("B", 0.02, 0.031)), r"patches\.1\.end_m = 0\.031 m lies beyond beam\.length_m"),
        ((SYMMETRIC[0], patch("B", 0.0134, 0.02)), r"patches\.0 and patches\.1 overlap .* same face"),
        ((patch("A", faces="top"), patch("B", faces="both")), "same face"),
        ((patch("A"), SYMMETRIC[1], patch("A", 0.005, 0.006, faces="top")), r"patches\.0 and patches\.2"),
        ((patch("A", faces="top"), patch("B", faces="bottom")), "mutual capacitance"),
        ((SYMMETRIC[0],), "group B"),
        ((SYMMETRIC[1],), "group A"),
        ((), "group A"),
    ],
)
def test_patches_that_do_not_fit_are_rejected(patches: tuple[Patch, ...], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        resonator_modes(BEAM, patches, CENTRAL_TIP, DAMPING)
    with pytest.raises(ParameterError, match=message):
        clamped_capacitances(BEAM, patches)


def test_patches_may_touch_despite_round_off() -> None:
    touching = (patch("A", 0.0, 0.1 * 3 * 0.05), patch("B", 0.015, 0.03 + 1e-15))
    assert touching[0].end_m != touching[1].start_m
    assert len(resonator_modes(BEAM, touching, CENTRAL_TIP, DAMPING)) == 2
    capacitance_a, capacitance_b = clamped_capacitances(BEAM, touching)
    assert capacitance_a == pytest.approx(capacitance_b)


def test_a_tip_beyond_the_beam_is_rejected() -> None:
    tip = CENTRAL_TIP.model_copy(update={"position_m": 0.0301})
    with pytest.raises(ParameterError, match=r"tip\.position_m = 0\.0301 m lies beyond beam\.length_m = 0\.03 m"):
        resonator_modes(BEAM, SYMMETRIC, tip, DAMPING)


def test_a_mode_out_of_range_is_reported_as_a_parameter() -> None:
    speck = Beam(length_m=1.1e-4, width_m=1.1e-5, thickness_m=1.1e-5, youngs_modulus_pa=1e9, density_kg_m3=100.0)
    changes = {"width_m": 1.1e-5, "thickness_m": 1.1e-6, "density_kg_m3": 100.0}
    patches = (patch("A", 0.0, 5e-5, **changes), patch("B", 5e-5, 1e-4, **changes))
    tip = Tip(position_m=5e-5, length_m=0.0, mass_kg=0.0, rotary_inertia_kg_m2=0.0)
    with pytest.raises(ParameterError, match=r"beam with patches and tip: modes\.0\.mass_kg = .* is not valid"):
        resonator_modes(speck, patches, tip, DAMPING)


def test_a_stiffness_that_varies_too_much_is_reported_by_its_range() -> None:
    foil = Beam(length_m=1.0, width_m=0.125, thickness_m=1.1e-5, youngs_modulus_pa=1e8, density_kg_m3=100.0)
    soft = {"density_kg_m3": 100.0, "width_m": 0.5}
    patches = (
        patch("A", 0.0, 0.45, thickness_m=1.1e-6, youngs_modulus_pa=1e8, **soft),
        patch("B", 0.5, 1.0, thickness_m=0.1, youngs_modulus_pa=1e11, **soft),
    )
    with pytest.raises(ParameterError, match=r"varies from 1\.39e-09 to .* N·m², too much .* thickness of the beam"):
        resonator_modes(foil, patches, NO_TIP, DAMPING)


ADDRESSES = """
import pyspice_runner as pr
from pyspice_runner.sweeps.store import fingerprint
print(*(fingerprint(pr.load_motor(name).to_dict()) for name in pr.available_motors()))
"""


@pytest.mark.soak
def test_the_number_of_threads_does_not_change_a_motor() -> None:
    """Two threads of BLAS add in another order; a stored point would have another address."""
    said = [
        subprocess.run(
            [sys.executable, "-c", ADDRESSES], env={**os.environ, "OPENBLAS_NUM_THREADS": number},
            stdout=subprocess.PIPE, check=True, timeout=60, cwd=Path(__file__).parents[2],
        ).stdout
        for number in ("1", "2", "4")
    ]  # fmt: skip
    assert len(said[0].split()) >= 3
    assert said[1:] == [said[0]] * 2
