# SPDX-License-Identifier: GPL-3.0-or-later
"""Each correction to the paper on docs/physics.md by quadrature, against the package where it has the function.

The surface displacements are integrated from the point-force solutions of Boussinesq and Cerruti, so that none of the
closed forms in question is taken for granted. Tolerances are those of the quadratures, 1e-9 or better where the
integrand is smooth, unless a line says otherwise.
"""

from dataclasses import dataclass
from math import cbrt, cos, pi, radians, sin, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

import pyspice_runner as pr
from pyspice_runner.motor import contact as law
from pyspice_runner.motor.parameters import Contact
from pyspice_runner.spice.library import definitions, read_library
from pyspice_runner.spice.ngspice import run_deck

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """Two spheres in contact; indices 1 and 2 are tip and rotor."""

    e1: float
    nu1: float
    e2: float
    nu2: float
    r1: float
    r2: float
    mu: float
    force: float

    @property
    def modulus(self) -> float:
        return law.effective_modulus(self.e1, self.nu1, self.e2, self.nu2)

    @property
    def radius(self) -> float:
        return law.effective_radius(self.r1, self.r2)

    @property
    def penetration(self) -> float:
        return (self.force / law.normal_stiffness(self.modulus, self.radius)) ** (2 / 3)

    @property
    def patch(self) -> float:
        """Hertz's contact radius a."""
        return sqrt(self.radius * self.penetration)

    @property
    def pressure(self) -> float:
        """Hertz's greatest pressure p₀."""
        return 2 * self.modulus * self.patch / (pi * self.radius)

    @property
    def shear_moduli(self) -> tuple[float, float]:
        return self.e1 / (2 * (1 + self.nu1)), self.e2 / (2 * (1 + self.nu2))

    @property
    def limit(self) -> float:
        """u_lim from the package's K_t."""
        return self.mu * self.compliance * self.force ** (2 / 3)

    @property
    def compliances(self) -> list[float]:
        bodies = (self.e1, self.nu1), (self.e2, self.nu2)
        return [law.tangential_compliance(e, nu, self.modulus, self.radius) for e, nu in bodies]

    @property
    def compliance(self) -> float:
        return sum(self.compliances)


PAIRS = [
    Pair(e1=370e9, nu1=0.22, e2=206e9, nu2=0.30, r1=5e-3, r2=10e-3, mu=0.3, force=5.0),
    Pair(e1=3e9, nu1=0.38, e2=69e9, nu2=0.33, r1=2e-3, r2=40e-3, mu=0.15, force=31.0),
    Pair(e1=70e9, nu1=0.0, e2=70e9, nu2=0.49, r1=1e-3, r2=1e-3, mu=0.8, force=0.2),
]
pairs = pytest.mark.parametrize("pair", PAIRS)


def disc_integral(weight: float) -> float:
    """∫ √(1 − r²) weight r dr from 0 to 1: with the weight 2π over the disc's area, with 1 as the paper prints it."""
    value, _ = quad(lambda r: sqrt(1 - r * r) * weight * r, 0, 1, epsabs=1e-13, epsrel=1e-13)
    return float(value)


def half_ellipse(r: float, radius: float) -> float:
    return sqrt(max(1 - (r / radius) ** 2, 0.0))


def chords(x: float, y: float, radius: float) -> tuple[Array, Array]:
    """Angles over half a turn, and ∫ √(1 − r²/radius²) ds along the chord through (x, y) at each.

    With the distance along the chord written as (half chord) · sin t the integrand is smooth.
    """
    angles = np.arange(400) * pi / 400
    along = x * np.cos(angles) + y * np.sin(angles)
    half = np.sqrt(radius**2 - (x**2 + y**2 - along**2))
    t, weights = np.polynomial.legendre.leggauss(40)
    t, weights = t * pi / 2, weights * pi / 2
    integrand = np.sqrt(np.maximum(half[:, None] ** 2 * (1 - np.sin(t) ** 2), 0)) / radius * half[:, None] * np.cos(t)
    return angles, integrand @ weights


def normal_displacement(x: float, y: float, radius: float, modulus: float) -> float:
    """u_z under the pressure √(1 − r²/radius²), Boussinesq: u_z = (1 − ν²)/(πE) ∬ p/s dA, here 1/E* for (1 − ν²)/E."""
    _, integrals = chords(x, y, radius)
    return float(integrals.mean() * pi) / (pi * modulus)


def tangential_displacement(x: float, y: float, radius: float, g: float, nu: float) -> tuple[float, float]:
    """(u_x, u_y) under the traction √(1 − r²/radius²) along x, by Cerruti.

    u_x = 1/(2πG) ∬ q [(1 − ν)/s + ν (x − ξ)²/s³] dA,  u_y = 1/(2πG) ∬ q ν (x − ξ)(y − η)/s³ dA.
    """
    angles, integrals = chords(x, y, radius)
    along_x = (1 - nu + nu * np.cos(angles) ** 2) * integrals
    along_y = nu * np.sin(angles) * np.cos(angles) * integrals
    return float(along_x.mean() / (2 * g)), float(along_y.mean() / (2 * g))


# --- (4) and (5): normal contact ----------------------------------------------------------------------------


@pairs
def test_the_hertz_pressure_gives_the_stiffness_k_n_of_two_spheres(pair: Pair) -> None:
    a, p0 = pair.patch, pair.pressure
    for r in (0.0, 0.31 * a, 0.77 * a, 0.999 * a):
        depth = p0 * normal_displacement(r * cos(0.4), r * sin(0.4), a, pair.modulus)
        assert depth == pytest.approx(pair.penetration - r**2 / (2 * pair.radius), rel=1e-9)
    carried = p0 * a**2 * disc_integral(2 * pi)
    assert carried == pytest.approx(pair.force, rel=1e-9)
    assert carried == pytest.approx(2 / 3 * p0 * pi * a**2, rel=1e-9)


@pairs
def test_equations_4_and_5_as_printed_are_impossible(pair: Pair) -> None:
    """With the moduli in MPa instead of Pa, K_N must come out in MN/m^1.5: by the same factor."""

    def printed(scale: float) -> float:
        compliance = (1 - pair.nu1**2) / (pair.e1 * scale) + (1 - pair.nu2**2) / (pair.e2 * scale)
        return 4 / 3 * sqrt(pair.radius * compliance)

    def corrected(scale: float) -> float:
        modulus = law.effective_modulus(pair.e1 * scale, pair.nu1, pair.e2 * scale, pair.nu2)
        return law.normal_stiffness(modulus, pair.radius)

    assert corrected(1e-6) == pytest.approx(1e-6 * corrected(1.0))
    assert printed(1e-6) == pytest.approx(1e3 * printed(1.0))  # stiffer bodies would make a softer contact
    without_area = pair.pressure * pair.patch**2 * disc_integral(1.0)
    assert without_area * 2 * pi == pytest.approx(pair.force, rel=1e-9)


# --- the shear modulus after (7) ----------------------------------------------------------------------------


@pytest.mark.parametrize("nu", [0.0, 0.22, 0.3, 0.45])
def test_shear_modulus_follows_from_hookes_law(nu: float) -> None:
    """Tension and compression at right angles are pure shear on the planes at 45°: γ = ε₁ − ε₂ under τ = σ₁ = −σ₂."""
    e = 206e9
    strain = np.array([[1, -nu], [-nu, 1]]) @ np.array([1.0, -1.0]) / e
    turn = np.array([[1, 1], [-1, 1]]) / sqrt(2)
    turned_stress = turn @ np.diag([1.0, -1.0]) @ turn.T
    turned_strain = turn @ np.diag(strain) @ turn.T
    assert turned_stress[0, 0] == pytest.approx(0.0, abs=1e-12)
    g = turned_stress[0, 1] / (2 * turned_strain[0, 1])
    assert g == pytest.approx(e / (2 * (1 + nu)))
    assert e / (2 * (1 - nu)) == pytest.approx(g * (1 + nu) / (1 - nu))  # as printed: too stiff unless ν = 0
    ours = law.tangential_compliance(e, nu, 100e9, 4e-3)
    assert ours == pytest.approx(cbrt(4 * 100e9 / (3 * 4e-3)) * 3 * (2 - nu) / (16 * g))


# --- (7) and (10): displacement under a tangential traction --------------------------------------------------


@pytest.mark.parametrize("nu", [0.0, 0.22, 0.3, 0.49])
def test_displacement_depends_on_the_direction_and_its_angular_mean_does_not(nu: float) -> None:
    a, g = 50e-6, 80e9
    for r in (0.0, 0.4 * a, 0.9 * a):
        around = []
        for angle in np.arange(12) * pi / 6:
            x, y = r * cos(angle), r * sin(angle)
            u_x, u_y = tangential_displacement(x, y, a, g, nu)
            exact = pi / (32 * g * a) * (4 * (2 - nu) * a**2 - (4 - 3 * nu) * x**2 - (4 - nu) * y**2)
            assert u_x == pytest.approx(exact, rel=1e-9)
            assert u_y == pytest.approx(pi / (16 * g * a) * nu * x * y, rel=1e-8, abs=1e-12 * exact)
            around.append(u_x)
        mean = pi * (2 - nu) / (16 * g * a) * (2 * a**2 - r**2)
        assert np.mean(around) == pytest.approx(mean, rel=1e-9)
        spread = nu * r**2 * pi / (32 * g * a)  # on the axes, on either side of the mean
        assert max(around) - mean == pytest.approx(spread, rel=1e-6, abs=1e-9 * mean)
        assert mean - min(around) == pytest.approx(spread, rel=1e-6, abs=1e-9 * mean)


# --- (8) and (12): partial slip -----------------------------------------------------------------------------


@pairs
@pytest.mark.parametrize("share", [0.2, 0.6, 0.95])
def test_the_corrected_traction_moves_the_stick_circle_as_a_whole(pair: Pair, share: float) -> None:
    """One body. Inside r ≤ c everything moves by the same u_x and not at all along y, in spite of (7)'s angles."""
    a, c = pair.patch, share * pair.patch
    g, nu = pair.shear_moduli[0], pair.nu1

    def moved(x: float, y: float, inner: float) -> Array:
        outer = np.array(tangential_displacement(x, y, a, g, nu))
        cancelling = np.array(tangential_displacement(x, y, c, g, nu))
        return np.asarray(pair.pressure * (pair.mu * outer - inner * share * cancelling))

    rigid = (2 - nu) * pi * pair.mu * pair.pressure * (a**2 - c**2) / (8 * g * a)
    points = [(r * c * cos(t), r * c * sin(t)) for r in (0.0, 0.5, 0.98) for t in (0.0, 0.7, pi / 2)]
    for x, y in points:
        u_x, u_y = moved(x, y, pair.mu)
        assert u_x == pytest.approx(rigid, rel=1e-8)
        assert u_y == pytest.approx(0.0, abs=1e-9 * rigid)
    printed = [moved(x, y, 1.0)[0] for x, y in points]
    assert np.ptp(printed) > 1e-3 * rigid


@pairs
def test_corrected_traction_respects_coulomb_and_the_printed_one_does_not(pair: Pair) -> None:
    a = pair.patch

    def traction(r: float, share: float, factor: float) -> float:
        inner = factor * share * half_ellipse(r, share * a) if r < share * a else 0.0
        return pair.pressure * (pair.mu * half_ellipse(r, a) - inner)

    radii = np.linspace(0, 0.9999 * a, 50)
    share = 1 - 0.4 * (1 - pair.mu) / (1 + pair.mu)  # nearly all of the patch sticks: little force is transmitted
    bound = [pair.mu * pair.pressure * half_ellipse(r, a) for r in radii]
    corrected = np.array([traction(r, share, pair.mu) for r in radii])
    assert (np.abs(corrected) <= np.array(bound) * (1 + 1e-12)).all()
    assert (corrected >= -1e-12 * pair.pressure).all()
    printed = np.array([traction(r, share, 1.0) for r in radii])
    assert printed.min() < 0.0  # it would push the wrong way
    at_rest = [traction(r, 1.0, 1.0) for r in radii[:-1]]
    assert min(at_rest) == pytest.approx(-(1 - pair.mu) * pair.pressure)  # … though no force acts at all


@pairs
@pytest.mark.parametrize("share", [0.0, 0.35, 0.8, 1.0])
def test_traction_adds_up_to_the_friction_force(pair: Pair, share: float) -> None:
    a, c = pair.patch, share * pair.patch

    def summed(weight: float) -> float:
        return pair.mu * pair.pressure * (a**2 * disc_integral(weight) - share * c**2 * disc_integral(weight))

    total = pair.mu * pair.force * (1 - share**3)
    assert summed(2 * pi) == pytest.approx(total, rel=1e-9, abs=1e-12)
    assert summed(1.0) == pytest.approx(total / (2 * pi), rel=1e-9, abs=1e-12)  # as printed


# --- (13)–(15): the tangential law --------------------------------------------------------------------------


@pairs
@pytest.mark.parametrize("share", [0.05, 0.4, 0.9])
def test_the_law_of_stick_adds_the_compliances_of_both_bodies(pair: Pair, share: float) -> None:
    """Both bodies' stick circles by quadrature, as functions of c; eliminating c must give the law."""
    a, c = pair.patch, share * pair.patch
    moves = []
    for g, nu in zip(pair.shear_moduli, (pair.nu1, pair.nu2), strict=True):
        outer, _ = tangential_displacement(0.0, 0.0, a, g, nu)
        inner, _ = tangential_displacement(0.0, 0.0, c, g, nu)
        moves.append(pair.mu * pair.pressure * (outer - share * inner))
    u = sum(moves)
    force = pair.mu * pair.force * (1 - share**3)
    assert u / pair.limit == pytest.approx(1 - share**2, rel=1e-9)
    assert force == pytest.approx(pair.mu * pair.force * (1 - (1 - u / pair.limit) ** 1.5), rel=1e-9)
    own = pair.compliances
    assert moves[0] == pytest.approx(u / (1 + own[1] / own[0]), rel=1e-9)
    assert moves[1] == pytest.approx(u / (1 + own[0] / own[1]), rel=1e-9)


@pairs
def test_limit_is_linear_in_the_penetration_for_every_radius(pair: Pair) -> None:
    by_force = pair.limit / pair.penetration
    g1, g2 = pair.shear_moduli
    closed = pair.mu * pair.modulus / 4 * ((2 - pair.nu1) / g1 + (2 - pair.nu2) / g2)
    assert by_force == pytest.approx(closed)
    assert pair.mu * pair.compliance * law.normal_stiffness(pair.modulus, pair.radius) ** (2 / 3) == pytest.approx(
        closed
    )


@pairs
def test_stiffness_at_the_start_is_mindlins(pair: Pair) -> None:
    """A patch that does not slip at all carries q = F/(2πa √(a² − r²)); Cerruti's integral at its centre."""
    g1, g2 = pair.shear_moduli
    a = pair.patch
    area, _ = quad(lambda t: 2 * pi * a * sin(t) / (2 * pi * a), 0, pi / 2)  # ∬ q dA / F with r = a sin t
    assert area == pytest.approx(1.0)
    along, _ = quad(lambda r: 1 / (2 * pi * a * sqrt(a + r)), 0, a, weight="alg", wvar=(0, -0.5))  # ∫ q dr / F
    around = [quad(lambda t, nu=nu: 1 - nu + nu * cos(t) ** 2, 0, 2 * pi)[0] for nu in (pair.nu1, pair.nu2)]
    per_force = sum(turn * along / (2 * pi * g) for g, turn in zip((g1, g2), around, strict=True))
    own = pair.compliances
    contact = Contact(
        normal_stiffness_n_per_m15=law.normal_stiffness(pair.modulus, pair.radius),
        tangential_compliance_tip_m_per_n23=own[0],
        tangential_compliance_rotor_m_per_n23=own[1],
        friction=pair.mu,
        preload_n=pair.force,
    )
    assert law.tangential_stiffness_at_preload(contact) == pytest.approx(1 / per_force, rel=1e-7)
    assert 1 / per_force == pytest.approx(8 * pair.patch / ((2 - pair.nu1) / g1 + (2 - pair.nu2) / g2))


def test_parameter_set_uses_these_constants() -> None:
    motor = pr.load_motor("andersen2002")
    pair = PAIRS[0]  # the materials of the set
    assert motor.contact.normal_stiffness_n_per_m15 == pytest.approx(law.normal_stiffness(pair.modulus, pair.radius))
    assert law.total_compliance(motor.contact) == pytest.approx(pair.compliance)


# --- the signs of (13) and (15), the arguments of (1) and (2) ---


@pairs
def test_no_displacement_satisfies_the_printed_sign(pair: Pair) -> None:
    """(15) solves (13) for u: with |F_T| < μ F_N the positive factor is u_lim (1 − (1 − F_T/(μ F_N))^(2/3))."""
    for share in (0.1, 0.5, 0.99):
        size = 1.0 - (1.0 - share) ** (2 / 3)
        printed = [u for u in (-size, size) if u == -np.sign(u) * size]
        assert not printed
        assert pair.mu * (1.0 - (1.0 - size) ** 1.5) == pytest.approx(pair.mu * share)  # the corrected one does


def test_friction_with_the_printed_sign_would_drive_the_tip() -> None:
    """In gross slip at a constant normal force, friction takes power; with the printed sign it would give some."""
    turn = np.linspace(0.0, 8.0 * pi, 80_001)
    velocity, u = 5.0 * np.cos(turn), np.zeros_like(turn)  # in units of u_lim a radian
    for k in range(1, len(turn)):
        u[k] = min(max(u[k - 1] + velocity[k] * (turn[k] - turn[k - 1]), -1.0), 1.0)
    force = np.sign(u) * (1.0 - (1.0 - np.abs(u)) ** 1.5)
    last = turn >= 6.0 * pi
    taken = np.trapezoid((force * velocity)[last], turn[last])
    # a cycle of amplitude 5 slips by 4·5 − 4 and follows the spring, which gives back all that it stores, in between
    assert taken == pytest.approx(16.0, rel=2e-3)
    assert -taken < 0.0  # the printed sign


def test_the_voltages_depend_on_time() -> None:
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=20e3, phase_deg=90.0)
    ((tone_a,), (tone_b,)) = drive.tones_a, drive.tones_b
    run = pr.simulate(pr.load_motor("andersen2002"), drive, duration=1e-4, contact=None)
    for tone, voltage in ((tone_a, run.voltage_a_v), (tone_b, run.voltage_b_v)):
        exact = tone.amplitude * np.sin(2.0 * pi * tone.frequency * run.time_s + tone.phase)
        np.testing.assert_allclose(voltage[1:], exact[1:], atol=1e-6)
    assert np.ptp(run.voltage_a_v) == pytest.approx(100.0, rel=1e-3)  # as printed, 50 sin(2π·20000) = 0


# --- the stick test -----------------------------------------------------------------------------------------


@pairs
def test_the_printed_stick_test_never_ends_stick(pair: Pair) -> None:
    ratio = np.linspace(0, 1, 101)
    force = pair.mu * pair.force * (1 - (1 - ratio) ** 1.5)
    assert (force < pair.force).all()  # "F_mu < F_N" holds to the very end …
    assert (force[:-1] < pair.mu * pair.force).all()  # … "F_mu < mu F_N" holds until u = u_lim
    assert force[-1] == pytest.approx(pair.mu * pair.force)


# --- the event rule -----------------------------------------------------------------------------------------


def by_events(depth: Array, velocity: Array, step: float) -> tuple[Array, Array]:
    """Take the paper's rule through small steps: in slip u = s u_lim, until v₁ - v₂ = v_rel - u̇ changes sign.

    In units of δ₀ = 1, u_lim(δ₀) = 1 and μ F₀ = 1. Returns the slider's displacement, and the work done against
    friction by the slipping surfaces.
    """
    u, work = np.zeros_like(depth), np.zeros_like(depth)
    slipping, side = False, 0.0
    for i in range(1, len(depth)):
        limit, growth = max(depth[i], 0.0), (max(depth[i], 0.0) - max(depth[i - 1], 0.0)) / step
        v = 0.5 * (velocity[i] + velocity[i - 1])
        if slipping and limit > 0.0 and side * (v - side * growth) >= 0.0:
            u[i] = side * limit
        else:
            u[i] = u[i - 1] + v * step
            slipping = bool(abs(u[i]) > limit)
            if slipping:
                side = float(np.sign(u[i]))
                u[i], slipping = side * limit, limit > 0.0
        power = side * limit**1.5 * (v - (u[i] - u[i - 1]) / step) if slipping else 0.0
        work[i] = work[i - 1] + power * step
    return u, work


def projected(depth: Array, velocity: Array, step: float) -> Array:
    """Return the displacement of a slider that moves with the surfaces and is held inside its limit."""
    u = np.zeros_like(depth)
    for i in range(1, len(depth)):
        limit = max(depth[i], 0.0)
        u[i] = np.clip(u[i - 1] + 0.5 * (velocity[i] + velocity[i - 1]) * step, -limit, limit)
    return u


def ellipse(
    phase_deg: float, amplitude: float = 1.0, periods: int = 4, points: int = 4000
) -> tuple[Array, Array, float]:
    """δ = 1 + 0.8 sin ωt and v_rel = amplitude · 0.8 ω sin(ωt + phase), with a period of 1."""
    t = np.arange(periods * points + 1) / points
    depth = 1 + 0.8 * np.sin(2 * pi * t)
    return depth, amplitude * 0.8 * 2 * pi * np.sin(2 * pi * t + radians(phase_deg)), 1 / points


@pytest.mark.parametrize("amplitude", [0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0])
@pytest.mark.parametrize("phase_deg", range(0, 360, 30))
def test_the_event_rule_is_the_projection_and_never_creates_energy(phase_deg: int, amplitude: float) -> None:
    depth, velocity, step = ellipse(phase_deg, amplitude, periods=2, points=1000)
    u, work = by_events(depth, velocity, step)
    np.testing.assert_allclose(u, projected(depth, velocity, step), rtol=0.0, atol=1e-12)
    assert (np.diff(work) >= -1e-12).all()


def test_the_circuit_sticks_again_when_its_limit_exceeds_the_slider() -> None:
    """ngspice: dragged at a constant speed until it slips, then pressed in so fast that u_lim grows faster than that.

    The slider must then move with the surfaces, and slip again once the
    load no longer grows. The slider's displacement is that of the projection to slider_time · velocity = 0.5 nm.
    """
    contact = read_library("piezomotor_contact")
    speed = 0.01  # m/s
    deck = f"""contact, dragged and pressed
{definitions(contact)}
Vx x 0 0
Vy y 0 PWL(0 0 60u 0 80u 2 200u 2)
Vvx vx 0 {speed}
Vvy vy 0 0
Vshaft shaft 0 0
Xcontact x y vx vy fx fy shaft normal friction slider state piezomotor_contact
.options reltol=1e-6 trtol=1e9
.save v(slider) v(state) v(xcontact.delta)
.tran 100n 200u 0 100n uic
.end
"""
    vectors = run_deck(deck, vectors=["v(slider)", "v(state)"], stop_time=200e-6).raw.vectors
    time = vectors["time"].real
    state, slider, depth = (vectors[name].real for name in ("v(state)", "v(slider)", "v(xcontact.delta)"))
    defaults = {parameter.name: parameter.default for parameter in contact.parameters}
    ratio = defaults["mu"] * defaults["compliance"] * defaults["normal_stiffness"] ** (2 / 3)
    assert ratio * 2.0 / 20.0 > speed  # the limit's rate in µm/µs = m/s while it is pressed: the case in question
    assert state[np.searchsorted(time, 59e-6)] == 2.0
    pressing = (time > 60.5e-6) & (time < 79.5e-6)
    assert (state[pressing] == 1.0).all()
    assert (slider[pressing] < ratio * depth[pressing]).all()
    np.testing.assert_allclose(np.diff(slider[pressing]), 1e6 * speed * np.diff(time[pressing]), rtol=1e-4)
    caught = brentq(lambda t: np.interp(t, time, slider - ratio * depth), 80e-6, 199e-6)
    start = slider[np.searchsorted(time, 60e-6)] - 0.5e-3  # µm; slipping, the node stands above the limit by 0.5 nm
    final = ratio * depth[-1]
    assert caught == pytest.approx(60e-6 + 1e-6 * (final - start) / speed, abs=0.2e-6)  # two steps
    assert state[-1] == 2.0
    assert slider[-1] == pytest.approx(final + 0.5e-3, abs=1e-5)
