# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact laws against Johnson's book, against their own derivatives and against small systems solved by hand."""

from math import cos, pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor import contact as law
from pyspice_runner.motor.materials import Materials
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.numerics import root
from pyspice_runner.motor.parameters import Contact, Mode, Mount, Rotor
from tests.motors import mode, motor

# two different bodies: a glass lens on a bronze cylinder
E1, NU1, R1 = 72e9, 0.17, 0.031
E2, NU2, R2 = 105e9, 0.35, 0.044
BODIES = Materials(
    tip_radius_m=R1, tip_youngs_modulus_pa=E1, tip_poisson=NU1, rotor_youngs_modulus_pa=E2, rotor_poisson=NU2
)
SIDES = ("tangential_compliance_tip_m_per_n23", "tangential_compliance_rotor_m_per_n23")


def test_a_steel_ball_on_a_steel_plate_has_the_published_indentation() -> None:
    """A ball of 20 mm under 100 N; E = 210 GPa, ν = 0.3 (Johnson §4.2: a and δ of a sphere on a plane)."""
    modulus = law.effective_modulus(210e9, 0.3, 210e9, 0.3)
    assert modulus == pytest.approx(115.38e9, rel=1e-4)
    radius = law.effective_radius(0.010, 1e12)
    assert radius == pytest.approx(0.010)
    contact_radius = (3.0 * 100.0 * 0.010 / (4.0 * 115.38e9)) ** (1.0 / 3.0)
    assert contact_radius == pytest.approx(0.1866e-3, rel=1e-3)
    contact = Contact(
        normal_stiffness_n_per_m15=law.normal_stiffness(modulus, radius), friction=0.2, preload_n=100.0,
        **dict.fromkeys(SIDES, law.tangential_compliance(210e9, 0.3, modulus, radius)),
    )  # fmt: skip
    assert law.static_penetration(contact) == pytest.approx(contact_radius**2 / 0.010, rel=1e-4)
    assert law.static_penetration(contact) == pytest.approx(3.48e-6, rel=2e-3)
    assert law.normal_stiffness_at_preload(contact) == pytest.approx(2.0 * modulus * contact_radius, rel=1e-4)
    # Mindlin: initial tangential stiffness 8 a / Σ(2 − ν)/G, and its ratio 2(1 − ν)/(2 − ν) to the normal one
    shear = 210e9 / 2.6
    tangential = 8.0 * contact_radius / (2.0 * 1.7 / shear)
    assert law.tangential_stiffness_at_preload(contact) == pytest.approx(tangential, rel=1e-4)
    ratio = law.tangential_stiffness_at_preload(contact) / law.normal_stiffness_at_preload(contact)
    assert ratio == pytest.approx(2.0 * (1.0 - 0.3) / (2.0 - 0.3), rel=1e-12)


@settings(max_examples=50, deadline=None)
@given(force=st.floats(1e-3, 1e4), friction=st.floats(0.01, 1.0))
def test_limit_of_stick_is_mindlins(force: float, friction: float) -> None:
    """u_lim = 3 μ F/(16 a) Σ(2 − ν_i)/G_i (Johnson eq. 7.42 at Q = μP), with a of Hertz."""
    modulus, radius = law.effective_modulus(E1, NU1, E2, NU2), law.effective_radius(R1, R2)
    contact_radius = (3.0 * force * radius / (4.0 * modulus)) ** (1.0 / 3.0)
    g1, g2 = E1 / (2.0 * (1.0 + NU1)), E2 / (2.0 * (1.0 + NU2))
    johnson = 3.0 * friction * force / (16.0 * contact_radius) * ((2.0 - NU1) / g1 + (2.0 - NU2) / g2)
    compliance = sum(law.tangential_compliance(e, nu, modulus, radius) for e, nu in ((E1, NU1), (E2, NU2)))
    assert friction * compliance * force ** (2.0 / 3.0) == pytest.approx(johnson, rel=1e-12)


def test_the_softer_body_determines_the_modulus() -> None:
    assert law.effective_modulus(1e9, 0.4, 1e15, 0.2) == pytest.approx(1e9 / (1.0 - 0.16), rel=1e-5)
    assert law.effective_modulus(E1, NU1, E2, NU2) == law.effective_modulus(E2, NU2, E1, NU1)
    assert law.effective_radius(0.02, 0.02) == pytest.approx(0.01)


def test_materials_give_the_constants_of_both_bodies() -> None:
    modulus, radius = law.effective_modulus(E1, NU1, E2, NU2), law.effective_radius(R1, R2)
    assert BODIES.constants(R2) == {
        "normal_stiffness_n_per_m15": pytest.approx(4.0 / 3.0 * modulus * sqrt(radius)),
        "tangential_compliance_tip_m_per_n23": law.tangential_compliance(E1, NU1, modulus, radius),
        "tangential_compliance_rotor_m_per_n23": law.tangential_compliance(E2, NU2, modulus, radius),
        "effective_radius_m": radius,
        "poisson": NU1,
    }


@settings(max_examples=30, deadline=None)
@given(preload=st.floats(0.01, 1e3), hertz=st.floats(1e7, 1e12), softness=st.floats(0.11, 99.0))
def test_stiffnesses_are_the_derivatives_of_the_laws(preload: float, hertz: float, softness: float) -> None:
    compliance = softness / hertz ** (2.0 / 3.0)
    sides = dict(zip(SIDES, (0.3 * compliance, 0.7 * compliance), strict=True))
    contact = Contact(normal_stiffness_n_per_m15=hertz, friction=0.25, preload_n=preload, **sides)
    assert law.total_compliance(contact) == pytest.approx(compliance)
    delta = law.static_penetration(contact)
    assert hertz * delta**1.5 == pytest.approx(preload, rel=1e-12)
    step = 1e-5 * delta
    slope = hertz * ((delta + step) ** 1.5 - (delta - step) ** 1.5) / (2.0 * step)
    assert law.normal_stiffness_at_preload(contact) == pytest.approx(slope, rel=1e-8)
    limit = 0.25 * compliance * preload ** (2.0 / 3.0)
    little = 1e-4 * limit
    friction_force = 0.25 * preload * (1.0 - (1.0 - little / limit) ** 1.5)
    # secant of F_T = μF (1 − (1 − u/u_lim)^(3/2)): below the tangent by u/(4 u_lim)
    assert law.tangential_stiffness_at_preload(contact) == pytest.approx(friction_force / little, rel=1e-4)


def pressed(*modes: Mode, **parts: object) -> Motor:
    """Return the motor with other modes or parts."""
    return motor().model_copy(update={"modes": modes, **parts})


def test_static_deflection_is_that_of_all_springs() -> None:
    subject = motor()
    expected = 8.0 * sum(m.tip_y**2 / m.stiffness_n_per_m for m in subject.modes)
    assert subject.deflection_m == pytest.approx(expected, rel=1e-14)
    assert pressed(mode("m", 2e4, 0.003, 50.0, tip_x=1.0)).deflection_m == 0.0


def test_a_pressed_mode_on_a_rigid_rotor_has_its_closed_form() -> None:
    """A mode that alone moves towards the rotor is stiffened by k_c Y²."""
    contact = motor().contact
    vertical = mode("m", 31e3, 0.0042, 70.0, tip_y=0.7)
    spring = 1.5 * contact.preload_n / law.static_penetration(contact)
    expected = sqrt((vertical.stiffness_n_per_m + 0.49 * spring) / 0.0042) / (2.0 * pi)
    assert law.resonance_under_preload(contact, vertical) == pytest.approx(expected, rel=1e-12)
    found = pressed(vertical).pressed_stator.resonances()
    # the rotor is not driven by a vertical motion: it turns freely, but for its own contact spring
    rotor_alone = sqrt(law.tangential_stiffness_at_preload(contact) * 0.013**2 / 3e-6) / (2.0 * pi)
    np.testing.assert_allclose(found, sorted([rotor_alone, expected]), rtol=1e-9)


def test_a_carrier_bounces_on_the_contact() -> None:
    """On a stator that does not bend its frequency is √((k_c + k)/m)/2π, and it does not move along the rotor."""
    contact = motor().contact
    stiff = mode("m", 1e5, 1e3, 70.0, tip_y=1.0)
    mount = Mount(stiffness_n_per_m=3e6, mass_kg=0.05, damping_n_s_per_m=50.0)
    found = pressed(stiff, mount=mount).pressed_stator.resonances()
    expected = sqrt((law.normal_stiffness_at_preload(contact) + 3e6) / 0.05) / (2.0 * pi)
    assert found[0] == pytest.approx(expected, rel=1e-6)  # the stator is 2e4 times as heavy
    without = pressed(stiff).pressed_stator.resonances()
    np.testing.assert_allclose(found[1:], without, rtol=1e-6)


def test_tangential_mode_and_rotor_are_a_two_mass_system() -> None:
    """m ẍ + k x + κ(x − z) = 0, M z̈ + κ(z − x) = 0: the roots of the biquadratic."""
    contact, rotor = motor().contact, Rotor(radius_m=0.02, inertia_kg_m2=4e-7, bearing_damping_n_m_s=0.0)
    sideways = mode("m", 45e3, 0.0027, 90.0, tip_x=1.0)
    m, k, kappa = 0.0027, sideways.stiffness_n_per_m, law.tangential_stiffness_at_preload(contact)
    heavy = 4e-7 / 0.02**2
    b, c = (k + kappa) / m + kappa / heavy, k * kappa / (m * heavy)
    squares = [(b - sqrt(b * b - 4.0 * c)) / 2.0, (b + sqrt(b * b - 4.0 * c)) / 2.0]
    found = pressed(sideways, rotor=rotor).pressed_stator.resonances()
    np.testing.assert_allclose(found, np.sqrt(squares) / (2.0 * pi), rtol=1e-9)


def test_contact_adds_one_resonance_and_they_are_in_rising_order() -> None:
    subject = motor()
    found = subject.pressed_stator.resonances()
    assert len(found) == 4
    assert np.all(np.diff(found) > 0.0)
    # springs are added, no mass is: the free stator's resonances lie below the upper three (Rayleigh)
    assert all(f >= m.frequency_hz for f, m in zip(found[1:], subject.modes, strict=True))


# --- a worn tip ----------------------------------------------------------------------------------------------

WORN = Contact(**BODIES.constants(R2), friction=0.3, preload_n=20.0, worn_flat_radius_m=150e-6)


def springs(contact: Contact, radius: float) -> tuple[float, float]:
    """Penetration and force for a contact radius, by the method of dimensionality reduction, integrated numerically.

    The profile f(r) = (r² − b²)/(2R*) of the gap beyond the flat has g(x) = x ∫ f'(r)/√(x² − r²) dr, b < r < x, and
    springs of the stiffness E* dx carry δ − g(x), with δ = g(a).
    """
    curved, flat = float(contact.effective_radius_m or 0.0), contact.worn_flat_radius_m
    modulus = law.effective_modulus(E1, NU1, E2, NU2)

    def g(x: float) -> float:
        angle = np.arcsin(min(flat / x, 1.0)) if x > 0.0 else 0.5 * pi  # r = x sin φ
        found = quad(lambda phi: np.sin(phi), angle, 0.5 * pi, epsabs=0.0, epsrel=1e-12)[0]
        return float(x * x / curved * found) if x > flat else 0.0

    depth = g(radius)
    outer, _ = quad(lambda x: (depth - g(x)) / depth, flat, radius, epsabs=0.0, epsrel=1e-10, limit=500)
    return depth, 2.0 * modulus * depth * (flat + outer)


@pytest.mark.parametrize("wider", [1.0001, 1.01, 1.3, 4.0, 30.0])
def test_the_force_of_a_worn_tip_is_that_of_its_springs(wider: float) -> None:
    radius = wider * WORN.worn_flat_radius_m
    depth, force = springs(WORN, radius)
    assert law.elastic_force(WORN, np.array([depth]))[0] == pytest.approx(force, rel=1e-7)
    assert law.penetration(WORN, force) == pytest.approx(depth, rel=1e-7)
    assert law.contact_radius(WORN, force) == pytest.approx(radius, rel=1e-7)


def test_a_worn_tip_is_a_punch_under_a_small_load_and_a_new_tip_under_a_large_one() -> None:
    modulus = law.effective_modulus(E1, NU1, E2, NU2)
    assert law.elastic_force(WORN, np.array([1e-10]))[0] == pytest.approx(2.0 * modulus * 150e-6 * 1e-10, rel=1e-5)
    new = WORN.model_copy(update={"worn_flat_radius_m": 0.0})
    # the flat of area πb² changes the contact by b²/a²
    deep = np.array([2e-4])
    assert law.elastic_force(WORN, deep)[0] == pytest.approx(law.elastic_force(new, deep)[0], rel=0.01)
    assert law.elastic_force(new, deep)[0] == pytest.approx(new.normal_stiffness_n_per_m15 * 2e-4**1.5, rel=1e-12)


@pytest.mark.parametrize("flat", [0.0, 1e-6, 150e-6])
def test_energy_force_and_stiffnesses_of_a_worn_tip_go_together(flat: float) -> None:
    contact = WORN.model_copy(update={"worn_flat_radius_m": flat})
    depth = law.static_penetration(contact)
    assert law.elastic_force(contact, np.array([depth]))[0] == pytest.approx(20.0, rel=1e-12)
    energy, _ = quad(lambda delta: law.elastic_force(contact, np.array([delta]))[0], 0.0, depth)
    assert law.elastic_energy(contact, np.array([depth]))[0] == pytest.approx(energy, rel=1e-6)
    step = 1e-5 * depth
    before, after = law.elastic_force(contact, np.array([depth - step, depth + step]))
    slope = (after - before) / (2.0 * step)
    assert law.normal_stiffness_at_preload(contact) == pytest.approx(slope, rel=1e-6)
    along = slope * contact.friction / law.limit_ratio(contact)  # Mindlin's ratio G*/E* for any profile
    assert law.tangential_stiffness_at_preload(contact) == pytest.approx(along, rel=1e-6)


def test_a_worn_tip_needs_its_effective_radius() -> None:
    subject = motor()
    with pytest.raises(ParameterError, match=r"worn_flat_radius_m = 5e-05 m needs effective_radius_m"):
        subject.updated({"contact.worn_flat_radius_m": 5e-5})
    with pytest.raises(ParameterError, match=r"must be at most 0.3 of effective_radius_m = 0.0001 m; lower it"):
        subject.updated({"contact.worn_flat_radius_m": 5e-5, "contact.effective_radius_m": 1e-4})


@pytest.mark.parametrize("power", [1.0, 1.7, 3.3])
def test_a_power_law_has_its_energy_stiffnesses_and_limit_of_stick(power: float) -> None:
    stiffness, softness = 20.0 / 2e-6**power, 1.3
    pressed = Contact(
        normal_stiffness_n_per_m15=stiffness, tangential_compliance_tip_m_per_n23=softness / stiffness ** (1.0 / power),
        tangential_compliance_rotor_m_per_n23=0.0, friction=0.2, preload_n=30.0, exponent=power,
    )  # fmt: skip
    depth = law.static_penetration(pressed)
    assert depth == pytest.approx(2e-6 * 1.5 ** (1.0 / power))
    before, at, after = law.elastic_force(pressed, depth * np.array([0.9999, 1.0, 1.0001]))
    slope = (after - before) / (2e-4 * depth)
    assert at == pytest.approx(30.0)
    energy, _ = quad(lambda delta: law.elastic_force(pressed, np.array([delta]))[0], 0.0, depth)
    assert law.elastic_energy(pressed, np.array([-1e-6, depth])) == pytest.approx([0.0, energy], rel=1e-7, abs=1e-30)
    assert law.stiffnesses_at_preload(pressed) == pytest.approx((slope / softness, slope), rel=1e-6)
    assert law.limit_ratio(pressed) == pytest.approx(0.2 * softness)


# --- the search of a root ---


@pytest.mark.parametrize("places", [(1.0, 2.0), (2.0, 1.0)])
def test_a_root_is_found_to_the_last_bit(places: tuple[float, float]) -> None:
    assert root(cos, *places) == pytest.approx(pi / 2, rel=3e-16)


def test_a_root_at_an_end_is_that_end() -> None:
    assert root(lambda x: x, 0.0, 1.0) == 0.0
    assert root(lambda x: x - 1.0, 0.0, 1.0) == 1.0


def test_a_tolerance_ends_the_search() -> None:
    tried: list[float] = []
    assert root(lambda x: tried.append(x) or x - 0.3, 0.0, 1.0, 1e-3) == pytest.approx(0.3, abs=1e-3)  # type: ignore[func-returns-value]
    assert len(tried) < 15
