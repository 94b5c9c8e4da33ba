# SPDX-License-Identifier: GPL-3.0-or-later
"""The closed forms of the contact's inside, by quadrature of Boussinesq's and Cerruti's solutions.

The quadratures are those of ``test_corrections``. Tolerances are theirs: 1e-9 where the integrand is smooth. Outside of
the circle the lines that meet it fill a sector, at whose ends the chords shrink to nothing as a square root does.
"""

from itertools import pairwise
from math import cos, hypot, pi, sin

import numpy as np
import pytest
from scipy.integrate import quad

from pyspice_runner.motor import contact as law
from tests.motor.test_corrections import PAIRS, Pair, normal_displacement, tangential_displacement
from tests.reference.row import drag
from tools.benches.traction import HertzPatch, microslip_loss, virgin_force

pairs = pytest.mark.parametrize("pair", PAIRS)


def patch_of(pair: Pair) -> HertzPatch:
    return HertzPatch(
        force_n=pair.force, friction=pair.mu, effective_modulus_pa=pair.modulus, effective_radius_m=pair.radius
    )


def over_the_circle(patch: HertzPatch, stress: object, *kinks: float) -> float:
    """∫ stress(r) 2πr dr; r = a sin t makes the half-ellipse smooth at the edge."""
    a = patch.radius_m
    breaks = [0.0, *(float(np.arcsin(kink / a)) for kink in kinks if 0.0 < kink < a), pi / 2]
    parts = [
        quad(lambda t: float(stress(a * sin(t))) * 2 * pi * a * sin(t) * a * cos(t), low, high, epsabs=0, epsrel=1e-10)[
            0
        ]  # type: ignore[operator]
        for low, high in pairwise(breaks)
    ]
    return float(sum(parts))


@pairs
def test_pressure_adds_up_to_the_normal_force_and_fits_the_spheres(pair: Pair) -> None:
    patch = patch_of(pair)
    assert over_the_circle(patch, patch.pressure) == pytest.approx(pair.force, rel=1e-9)
    assert patch.penetration_m == pytest.approx(pair.penetration, rel=1e-12)
    assert patch.radius_m == pytest.approx(pair.patch, rel=1e-12)
    for r in (0.0, 0.5, 0.99):
        depth = float(patch.normal_displacement(r * patch.radius_m))
        assert depth == pytest.approx(patch.penetration_m - (r * patch.radius_m) ** 2 / (2 * pair.radius), rel=1e-12)
    assert patch.pressure(1.01 * patch.radius_m) == 0.0


@pairs
@pytest.mark.parametrize("share", [0.0, 0.3, 0.8, 1.0])
def test_traction_adds_up_to_the_friction_force_and_respects_coulomb(pair: Pair, share: float) -> None:
    patch = patch_of(pair)
    force = share * pair.mu * pair.force
    stick = patch.stick_radius(force)
    # the traction has a kink of the kind of a square root at c, where the quadrature is split
    total = over_the_circle(patch, lambda r: patch.traction(r, force), stick)
    assert total == pytest.approx(force, rel=1e-7, abs=1e-9 * pair.mu * pair.force)
    radii = np.linspace(0.0, patch.radius_m, 400)
    traction = patch.traction(radii, force)
    assert np.all(traction <= pair.mu * patch.pressure(radii) * (1 + 1e-12))
    assert np.all(traction >= -1e-9 * patch.peak_pressure_pa)
    slips = radii > stick
    np.testing.assert_allclose(traction[slips], pair.mu * patch.pressure(radii[slips]), rtol=1e-12)
    np.testing.assert_allclose(patch.traction(radii, -force), -traction, rtol=1e-12)


@pairs
@pytest.mark.parametrize("share", [0.1, 0.6, 1.0])
def test_the_law_of_the_spring_slider_follows_from_the_displacements(pair: Pair, share: float) -> None:
    """(13) and (15): both stick circles move as one, and the sum of their displacements gives the friction force."""
    patch = patch_of(pair)
    force = share * pair.mu * pair.force
    stick = patch.stick_radius(force)
    moves = []
    for youngs, poisson in ((pair.e1, pair.nu1), (pair.e2, pair.nu2)):
        r = np.array([0.0, 0.4, 0.95]) * stick
        for angle in (0.0, 0.8, pi / 2):
            along, across = patch.tangential_displacement(
                r * cos(angle), r * sin(angle), force, youngs_modulus_pa=youngs, poisson=poisson
            )
            np.testing.assert_allclose(along, along[0], rtol=1e-10)
            np.testing.assert_allclose(across, 0.0, atol=1e-10 * along[0])
        moves.append(float(along[0]))
        compliance = law.tangential_compliance(youngs, poisson, pair.modulus, pair.radius)
        limit = pair.mu * compliance * pair.force ** (2 / 3)
        assert moves[-1] == pytest.approx(limit * (1 - (stick / patch.radius_m) ** 2), rel=1e-10)
    assert force == pytest.approx(pair.mu * pair.force * float(virgin_force(sum(moves) / pair.limit)), rel=1e-10)


def outside(x: float, y: float, radius: float, g: float, nu: float) -> tuple[float, float, float]:
    """(u_x, u_y, E* u_z) of a point beyond the circle: lines through it that meet the circle, by quadrature."""
    r, direction = hypot(x, y), np.arctan2(y, x)
    widest = np.arcsin(radius / r)

    def line(turn: float) -> float:  # ∫ √(1 − r²/radius²) along the chord
        return 0.5 * pi * max(radius**2 - (r * sin(turn)) ** 2, 0.0) / radius

    def total(weight: object) -> float:
        return float(quad(lambda t: weight(direction + t) * line(t), -widest, widest, epsabs=0, epsrel=1e-10)[0])  # type: ignore[operator]

    along = total(lambda phi: 1 - nu + nu * cos(phi) ** 2) / (2 * pi * g)
    across = total(lambda phi: nu * sin(phi) * cos(phi) + 1.0) - total(lambda _: 1.0)
    return along, across / (2 * pi * g), total(lambda _: 1.0) / pi


@pairs
def test_displacements_inside_are_cerrutis_and_boussinesqs(pair: Pair) -> None:
    patch = patch_of(pair)
    a = patch.radius_m
    force = pair.mu * pair.force  # full slip: one half-ellipsoid
    for r, angle in ((0.0, 0.0), (0.3, 0.5), (0.8, 2.0), (0.97, pi / 2)):
        x, y = r * a * cos(angle), r * a * sin(angle)
        depth = normal_displacement(x, y, a, pair.modulus) * patch.peak_pressure_pa
        assert float(patch.normal_displacement(hypot(x, y))) == pytest.approx(depth, rel=1e-9)
        g = pair.shear_moduli[0]
        exact = np.array(tangential_displacement(x, y, a, g, pair.nu1)) * pair.mu * patch.peak_pressure_pa
        ours = patch.tangential_displacement(x, y, force, youngs_modulus_pa=pair.e1, poisson=pair.nu1)
        np.testing.assert_allclose(np.array(ours), exact, rtol=1e-8, atol=1e-10 * exact[0])


@pairs
def test_displacements_outside_are_cerrutis_and_boussinesqs(pair: Pair) -> None:
    patch = patch_of(pair)
    a = patch.radius_m
    force = pair.mu * pair.force
    for r, angle in ((1.0001, 0.3), (1.2, 0.0), (1.7, 1.1), (6.0, 2.5)):
        x, y = r * a * cos(angle), r * a * sin(angle)
        along, across, deep = outside(x, y, a, pair.shear_moduli[1], pair.nu2)
        assert float(patch.normal_displacement(r * a)) == pytest.approx(
            patch.peak_pressure_pa * deep / pair.modulus, rel=1e-8
        )
        ours = patch.tangential_displacement(x, y, force, youngs_modulus_pa=pair.e2, poisson=pair.nu2)
        load = pair.mu * patch.peak_pressure_pa
        np.testing.assert_allclose(np.array(ours), [load * along, load * across], rtol=1e-7, atol=1e-9 * load * along)
    far = 400.0 * a  # a point force: u_x = F/(2πG r) along the force, (1 − ν) of that across it
    for x, y, weight in ((far, 0.0, 1.0), (0.0, far, 1.0 - pair.nu2)):
        along, _ = patch.tangential_displacement(x, y, force, youngs_modulus_pa=pair.e2, poisson=pair.nu2)
        assert float(along) == pytest.approx(weight * force / (2 * pi * pair.shear_moduli[1] * far), rel=1e-4)


def test_loss_is_the_area_of_masings_loop() -> None:
    """A reversal repeats the virgin curve at twice its size: 8 ∫ f du − 4 A f(A)."""
    for amplitude in (0.05, 0.3, 0.7, 1.0):
        area, _ = quad(lambda u: float(virgin_force(u)), 0.0, amplitude, epsabs=1e-14)
        masing = 8 * area - 4 * amplitude * float(virgin_force(amplitude))
        assert float(microslip_loss(amplitude)) == pytest.approx(masing, rel=1e-8)
    assert float(microslip_loss(1.0)) == pytest.approx(0.8, rel=1e-12)
    assert float(microslip_loss(1.5)) == pytest.approx(0.8 + 4 * 0.5, rel=1e-12)
    assert float(microslip_loss(1e-3)) == pytest.approx(0.5e-9, rel=1e-2)  # A³/2 for small amplitudes


@pytest.mark.parametrize("amplitude", [0.4, 0.9, 1.3])
def test_a_row_of_many_elements_runs_through_the_same_loop(amplitude: float) -> None:
    turn = np.linspace(0.0, 2.0, 4001)
    moved = amplitude * np.sin(2 * pi * turn)
    force, slipping = drag(np.ones_like(turn), moved)
    first = turn <= 0.25
    np.testing.assert_allclose(force[first], virgin_force(moved[first]), atol=2e-5)  # 1000 elements, second order
    cycle = turn >= 1.0
    loss = np.trapezoid(force[cycle], moved[cycle])
    assert loss == pytest.approx(float(microslip_loss(amplitude)), rel=1e-3)
    if amplitude < 1.0:  # at its greatest displacement c/a = √(1 − A) sticks
        assert slipping[500] == pytest.approx(1.0 - np.sqrt(1.0 - amplitude), abs=2e-3)
