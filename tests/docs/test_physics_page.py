# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors of beams that docs/physics.md prints are recomputed; where one moves, the page must be rewritten."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

from pyspice_runner.motor.beam import solve_resonator
from pyspice_runner.motor.beam_limits import estimated_errors, share_of_laminate
from pyspice_runner.motor.parameters import Beam, Tip
from tests.docs.numbers import missing
from tests.solid_beams import Headed, PatchedBeam

NO_TIP = Tip(position_m=0.005, length_m=0.0, mass_kg=0.0, rotary_inertia_kg_m2=0.0)


def says(*sentences: str) -> None:
    """The page prints the numbers of these sentences, with their units."""
    assert missing("physics.md", *sentences) == []


def rayleigh_lamb(ratio: float, poisson: float, near: float) -> float:
    """ωh/c_T of the lowest antisymmetric wave in plane stress; ``ratio`` is the height h over the half wave.

    (q² + β²)² tanh(αh/2)/α = 4q² β tanh(βh/2), α² = q² − (ω/c_L)², β² = q² − (ω/c_T)², c_L² = E/ρ(1 − ν²)
    (H. Lamb, Proc. R. Soc. A 93 (1917) 114).
    """
    q, squared = pi * ratio, 2 / (1 - poisson)  # (c_L/c_T)²

    def difference(w: float) -> float:
        alpha, beta = np.emath.sqrt(q**2 - w**2 / squared), np.emath.sqrt(q**2 - w**2)
        first = (2 * q**2 - w**2) ** 2 * np.tanh(alpha / 2) / alpha
        return float(np.real(first - 4 * q**2 * beta * np.tanh(beta / 2)))

    return float(brentq(difference, 0.95 * near, 1.05 * near, xtol=1e-14))


@pytest.mark.parametrize("ratio", [0.05, 0.1, 0.2, 0.3, 0.5, 1.0])
def test_uniform_beams_against_the_theory_of_elasticity(ratio: float) -> None:
    poisson, modulus, density, length = 0.3, 200e9, 7850.0, 0.01
    height = ratio * length
    found = [
        solve_resonator(
            Beam.model_validate(
                {"length_m": length, "width_m": 0.001, "thickness_m": height, "youngs_modulus_pa": modulus,
                 "density_kg_m3": density, "poissons_ratio": poisson, "theory": theory}
            ), (), NO_TIP, count=1, shapes=4,
        ).frequencies_hz[0]
        for theory in ("bernoulli-euler", "timoshenko")
    ]  # fmt: skip
    unit = sqrt(modulus / (2 * (1 + poisson)) / density) / height / (2 * pi)
    exact = unit * rayleigh_lamb(ratio, poisson, found[1] / unit)
    euler, timoshenko = (100 * (frequency / exact - 1) for frequency in found)
    digits = 2 if ratio == 0.05 else 1
    says(f"|{ratio:g}|{euler:+.{digits}f}|{timoshenko:+.2f}|".replace("-", "−"))
    assert abs(timoshenko) < 0.9


def per_cent(errors: np.ndarray, digits: int) -> str:
    return " and ".join(f"{100 * error:+.{digits}f}" for error in errors).replace("-", "−")


@pytest.mark.parametrize(
    ("beam", "element"),
    [
        (PatchedBeam(0.05, 2e-3, 0.25e-3, 0.002, 0.0235), 1e-3),
        pytest.param(PatchedBeam(0.03, 2e-3, 0.6e-3, 0.001, 0.014), 0.7e-3, marks=pytest.mark.soak),
        pytest.param(PatchedBeam(0.018, 1.8e-3, 0.8e-3, 0.001, 0.0085), 0.6e-3, marks=pytest.mark.soak),
        pytest.param(PatchedBeam(0.02, 3e-3, 1e-3, 0.003, 0.008), 0.7e-3, marks=pytest.mark.soak),
        (PatchedBeam(0.0122, 3.6e-3, 1.2e-3, 0.0005, 0.0039), 0.6e-3),
    ],
)
def test_patched_beams_against_finite_elements(beam: PatchedBeam, element: float) -> None:
    frequencies, forces = beam.solid(element)
    parts = beam.parts()
    estimates = estimated_errors(*parts, 2)
    timoshenko, ours = beam.beam()
    says(
        f"|{1e3 * beam.length:g} × {1e3 * beam.height:g}, {1e3 * beam.plate:g}"
        f"|{(beam.end - beam.start) / beam.plate:.1f}|{share_of_laminate(parts[0], parts[1][0]):.2f}"
        f"|{per_cent(timoshenko / frequencies - 1, 1)}|{per_cent(ours / forces - 1, 0)}|"
    )
    assert (np.abs(timoshenko / frequencies - 1 - estimates[0]) < 0.02).all()


@pytest.mark.parametrize(
    "shape",
    [
        Headed(0.03, 2e-3, 1e-3),
        Headed(0.03, 2e-3, 2e-3),
        Headed(0.0122, 3.6e-3, 2e-3, 5e-3, 5e-3),
        Headed(0.0122, 3.6e-3, 3e-3, 5e-3, 5e-3),
        Headed(0.0122, 3.6e-3, 4e-3, 5e-3, 5e-3),
    ],
)
def test_heads_on_stems_against_finite_elements(shape: Headed) -> None:
    exact = np.array(shape.solid(0.25e-3))
    errors = np.array(shape.beam()) / exact - 1
    assert (np.abs(errors) < 0.036).all()
