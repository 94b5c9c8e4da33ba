# SPDX-License-Identifier: GPL-3.0-or-later
"""Every number on docs/limits.md is recomputed; where one moves, the page must be rewritten."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import pyspice_runner as pr
from pyspice_runner.circuit.law import REACH, Law
from pyspice_runner.motor import contact as law
from pyspice_runner.motor.beam import clamped_capacitances, resonator_modes, solve_resonator
from pyspice_runner.motor.beam_limits import estimated_errors
from pyspice_runner.motor.dielectric import HIGH_HZ, LOW_HZ
from pyspice_runner.motor.motor import Structure
from pyspice_runner.motor.parameters import Patch
from pyspice_runner.steady.speed_torque import held_point
from tests.docs.numbers import missing
from tests.runs import simulated

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
CONTACT = MOTOR.contact
TIP_RADIUS_M = 0.005  # contact.materials.tip_radius_m of the set; a motor keeps what follows from it
WORKING = pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3, phase_deg=90.0)


def says(*sentences: str) -> None:
    """The page prints the numbers of these sentences, with their units."""
    assert missing("limits.md", *sentences) == []


def structure() -> Structure:
    assert MOTOR.structure is not None
    return MOTOR.structure


# --- stator -------------------------------------------------------------------------------------------------


def timoshenko(shapes: int, *, stiff: bool = False) -> np.ndarray:
    """The two lowest frequencies of the structure, Ritz with w ~ sin and rotation ψ ~ cos; ``stiff``: Bernoulli–Euler.

    The shear stiffness D²/∫ S²/(G b) dz is that of the shear stress that equilibrium asks for; in a uniform section it
    is 5/6 G b h. G is 77 GPa (steel) and 21 GPa (PZT-5A, 1/s₄₄ᴱ).
    """
    beam, tip, patches = structure().beam, structure().tip, structure().patches
    j = np.arange(1, shapes + 1)
    k, k0 = j * pi / beam.length_m, np.concatenate(([0.0], j * pi / beam.length_m))
    stiffness, mass = np.zeros((2 * shapes + 1,) * 2), np.zeros((2 * shapes + 1,) * 2)

    def add(matrix: np.ndarray, weight: float, rows: np.ndarray, points: np.ndarray) -> None:
        matrix += weight * (rows * points[:, None]).T @ rows

    nodes, weights = np.polynomial.legendre.leggauss(4 * shapes)
    edges = sorted({0.0, beam.length_m, *(e for p in patches for e in (p.start_m, p.end_m))})
    for start, end in pairwise(edges):
        here = [p for p in patches if p.start_m < (start + end) / 2 < p.end_m]
        bending, shear, density, inertia = section(here[0] if here else None)
        if stiff:
            shear, inertia = 1e4 * shear, 1e-3 * inertia
        x, points = (start + end) / 2 + (end - start) / 2 * nodes, (end - start) / 2 * weights
        w, dw = np.sin(np.outer(x, k)), np.cos(np.outer(x, k)) * k
        psi, dpsi = np.cos(np.outer(x, k0)), -np.sin(np.outer(x, k0)) * k0
        add(stiffness, shear, np.hstack([dw, -psi]), points)
        add(stiffness, bending, np.hstack([0 * dw, dpsi]), points)
        add(mass, density, np.hstack([w, 0 * psi]), points)
        add(mass, inertia, np.hstack([0 * w, psi]), points)
    foot = np.sin(k * tip.position_m), np.cos(k0 * tip.position_m)
    add(mass, tip.mass_kg, np.concatenate([foot[0], 0 * k0])[None, :], np.ones(1))
    add(mass, tip.rotary_inertia_kg_m2, np.concatenate([0 * k, foot[1]])[None, :], np.ones(1))
    squares = eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, 1))
    return np.asarray(np.sqrt(squares) / (2 * pi))


def section(patch: Patch | None) -> tuple[float, float, float, float]:
    """Bending and shear stiffness, mass and rotary inertia per length; a patch lies on both faces."""
    beam = structure().beam
    half = beam.thickness_m / 2
    layers = [(beam.youngs_modulus_pa, 77e9, beam.width_m, 0.0, half, beam.density_kg_m3)]
    if patch:
        layers.append(
            (patch.youngs_modulus_pa, 21e9, patch.width_m, half, half + patch.thickness_m, patch.density_kg_m3)
        )
    bending = 2 * sum(e * b * (top**3 - low**3) / 3 for e, _, b, low, top, _ in layers)

    def flow(z: float) -> float:
        return sum(e * b * (max(top, z) ** 2 - max(low, z) ** 2) / 2 for e, _, b, low, top, _ in layers)

    compliance = sum(2 * quad(lambda z, gb=g * b: flow(z) ** 2 / gb, low, top)[0] for _, g, b, low, top, _ in layers)
    return (
        bending,
        bending**2 / compliance,
        2 * sum(rho * b * (top - low) for _, _, b, low, top, rho in layers),
        2 * sum(rho * b * (top**3 - low**3) / 3 for _, _, b, low, top, rho in layers),
    )


def test_shear_and_rotary_inertia() -> None:
    plain, full = timoshenko(80, stiff=True), timoshenko(80)
    beam = structure().beam
    slender, ours = (
        solve_resonator(
            beam.model_copy(update={"theory": theory}), structure().patches, structure().tip, shapes=80
        ).frequencies_hz
        for theory in ("bernoulli-euler", "timoshenko")
    )  # fmt: skip
    np.testing.assert_allclose(plain, slender, rtol=1e-4)  # the same structure but for what "stiff" leaves of the shear
    # ours has shear moduli from E and ν, 7 % higher in the ceramic, and κ = 0.85 instead of 5/6; three quarters
    # of the correction of 7 % are due to shear
    np.testing.assert_allclose(full, ours, rtol=3e-3)
    lower = 100 * (1 - ours / slender)
    says(f"resonate {lower[0]:.1f} % lower in mode 1 and {lower[1]:.1f} % lower in mode 2")
    exact = beam.model_copy(update={"theory": "timoshenko"})
    first, second = 100 * np.array(estimated_errors(exact, structure().patches, structure().tip, 2)[0])
    says(f"a Timoshenko beam without it is {first:.0f} % and {second:.0f} % too high")
    height = structure().beam.thickness_m + 2 * structure().patches[0].thickness_m
    length = structure().beam.length_m
    says(f"With the ceramic it is {1e3 * height:.1f} mm high", f"{1e3 * length:.0f} mm in mode 1")
    says(f"{0.5e3 * length:.0f} mm in mode 2")


def test_omitted_modes() -> None:
    s = structure()
    more = resonator_modes(s.beam, s.patches, s.tip, s.damping, count=20)
    says(f"lie at {more[2].frequency_hz / 1e3:.0f} kHz and {more[3].frequency_hz / 1e3:.0f} kHz")
    with_them = MOTOR.model_copy(update={"modes": more}).pressed_stator.resonances()[:3]
    swing, rises, tilts = 100 * (1 - with_them / MOTOR.pressed_stator.resonances())
    says(f"contact resonance would be {rises:.1f} % lower, the preloaded tilt mode {tilts:.1f} % lower")
    says(f"swing of the rotor on the contact {swing:.1f} % lower")
    compliance = [m.tip_x**2 / m.stiffness_n_per_m for m in more]
    says(f"{100 * sum(compliance[2:]) / compliance[1]:.0f} % of mode 2's compliance")
    charge = sum(m.coupling_a_n_per_v**2 / m.stiffness_n_per_m for m in more[2:])
    says(f"add some {100 * charge / clamped_capacitances(s.beam, s.patches)[0]:.0f} % to the capacitance")


@pytest.mark.soak
def test_convergence_of_the_series() -> None:
    """The error falls as 1/shapes, so the limit is twice the finer minus the coarser; 480 and 960 give the digits."""
    s = structure()
    coarse, fine = (solve_resonator(s.beam, s.patches, s.tip, shapes=n) for n in (480, 960))
    ours = solve_resonator(s.beam, s.patches, s.tip)

    def percent(name: str, index: int | tuple[int, int]) -> float:
        here, a, b = (getattr(r, name)[index] for r in (ours, coarse, fine))
        return float(100 * (here / (2 * b - a) - 1))

    for mode in (0, 1):
        says(f"frequencies are {percent('frequencies_hz', mode):.2f} % above the limit")
    says(f"the coupling of mode 1 is {percent('couplings_n_per_v', (0, 0)):.1f} % high")
    says(f"$X_2$ {-percent('tip_x', 1):.1f} % low", f"{len(ours.coefficients)} shapes")


def test_quality_field_and_dielectric_loss() -> None:
    first, second = MOTOR.modes
    says(f"$Q$ = {first.quality_factor:.0f} and {second.quality_factor:.0f}")
    says(f"100 V on these plates is {100 / (1e3 * structure().patches[0].thickness_m):.0f} V/mm")
    tangent = 100 * MOTOR.piezo.loss_tangent
    says(f"The loss tangent of {tangent:g} % holds from {LOW_HZ / 1e3:g} kHz to {HIGH_HZ / 1e6:g} MHz")


# --- contact ------------------------------------------------------------------------------------------------


def elliptical_penetration(radius_1: float, radius_2: float, modulus: float, force: float) -> float:
    """Hertz's general contact with the relative radii R′ < R″, by his elliptic integrals."""

    def integrals(ratio: float) -> tuple[float, float, float]:
        e2 = 1 - ratio**2
        return e2, float(ellipk(e2)), float(ellipe(e2))

    def mismatch(ratio: float) -> float:
        _, big_k, big_e = integrals(ratio)
        return (big_e / ratio**2 - big_k) / (big_k - big_e) - radius_2 / radius_1

    ratio = float(brentq(mismatch, 1e-3, 1 - 1e-9))
    e2, big_k, big_e = integrals(ratio)
    slope = e2 * modulus / (2 * radius_2 * ratio * (big_k - big_e))  # p₀ per half axis a
    half_axis = float(np.cbrt(force / (2 / 3 * pi * ratio * slope)))
    return slope * half_axis * ratio * half_axis * big_k / modulus


@cache
def modulus_and_radius() -> tuple[float, float]:
    """E* and R*; the materials of the set give K_N again."""
    modulus = law.effective_modulus(370e9, 0.22, 206e9, 0.3)
    radius = law.effective_radius(TIP_RADIUS_M, MOTOR.rotor.radius_m)
    assert law.normal_stiffness(modulus, radius) == pytest.approx(CONTACT.normal_stiffness_n_per_m15)
    return modulus, radius


def test_shape_of_the_contact() -> None:
    modulus, radius = modulus_and_radius()
    force, depth = CONTACT.preload_n, law.static_penetration(CONTACT)
    assert elliptical_penetration(radius, radius * (1 + 1e-6), modulus, force) == pytest.approx(depth, rel=1e-5)
    stiffness = force / elliptical_penetration(radius, TIP_RADIUS_M, modulus, force) ** 1.5
    rim = CONTACT.model_copy(update={"normal_stiffness_n_per_m15": stiffness})
    first = MOTOR.modes[0]
    rise = law.resonance_under_preload(rim, first) / law.resonance_under_preload(CONTACT, first)
    says(f"$K_N$ would be {100 * (stiffness / CONTACT.normal_stiffness_n_per_m15 - 1):.0f} % higher")
    says(f"contact resonance {100 * (rise - 1):.1f} % higher")
    patch = sqrt(radius * depth)
    says(f"radius of {1e6 * patch:.0f} µm, a penetration of {1e6 * depth:.2f} µm")
    says(f"peak pressure of {1.5e-9 * force / (pi * patch**2):.1f} GPa")
    g1, g2 = 370e9 / 2.44, 206e9 / 2.6
    dundurs = 0.5 * ((1 - 0.44) / g1 - (1 - 0.6) / g2) / ((1 - 0.22) / g1 + (1 - 0.3) / g2)
    says(f"(Dundurs' β is {dundurs:.2f} here)".replace("-", "−"))


def test_least_amplitude_that_costs_a_brush_something() -> None:
    """The elements of the outermost cell that touches at rest slip, on average, at 1 − x² of the limit."""
    sliders = Law("brush").sliders
    touching = sliders / sqrt(REACH)
    inner = 1 - 1 / touching
    slips = 1 - (1 - inner**3) * touching / 3
    words = {4: "four"}
    says(f"with {Law('brush').sliders}, {words[round(touching)]} of which touch at rest, {slips:.2f} of $u_{{\\lim}}$")


def test_loss_of_partial_slip() -> None:
    """Masing: a loop of ±u has the area 8 ∫F du − 4 F u of the virgin curve F."""
    force, limit = CONTACT.friction * CONTACT.preload_n, CONTACT.friction * law.total_compliance(CONTACT)
    limit *= CONTACT.preload_n ** (2 / 3)
    area, _ = quad(lambda v: 1 - (1 - v) ** 1.5, 0, 1)
    loop = force * limit * (8 * area - 4)
    says(f"would cost {1e6 * loop:.2f} µJ", f"{1e3 * loop * 51.7e3:.0f} mW at 51.7 kHz")


@pytest.mark.soak
def test_spring_gives_energy_back() -> None:
    drive = pr.TwoToneDrive(voltage_1=50.0, frequency_1=13.5e3, voltage_2=50.0, frequency_2=27e3)
    run = simulated(MOTOR, drive, duration=5e-3)
    force, u = run.friction_force_n, run.contact_displacement_m
    spring = float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(u)))
    says(f"spring gives back {-1e6 * spring:.2f} µJ, slip takes {1e6 * (run.energy.friction - spring):.2f} µJ")
    says(f"deliver {1e6 * run.energy.electrical:.0f} µJ")


def test_tilt() -> None:
    run = simulated(MOTOR, WORKING, duration=5e-3)
    stroke = float(np.abs(run.tip_x_m[run.window()]).max())
    says(f"At the {1e6 * stroke:.1f} µm that it moves at 50 V")
    says(f"sink by {1e9 * stroke**2 / (2 * structure().tip.length_m):.1f} nm")
    says(f"{1e9 * law.static_penetration(CONTACT):.0f} nm of penetration")
    says(f"$x^2/(2R)$ = {1e9 * stroke**2 / (2 * MOTOR.rotor.radius_m):.1f} nm")


# --- rotor and numbers --------------------------------------------------------------------------------------


@pytest.mark.soak
def test_mean_normal_force() -> None:
    resonance = law.resonance_under_preload(CONTACT, MOTOR.modes[0])
    says(f"in phase at {resonance / 1e3:.1f} kHz and 20 V")
    run = simulated(MOTOR, pr.TwoPhaseDrive(voltage=20.0, frequency=17.9e3, phase_deg=0.0), duration=5e-3)
    says(f"rises from {CONTACT.preload_n:g} N to {run.mean(run.normal_force_n):.1f} N")


@pytest.mark.soak
def test_mean_normal_force_of_a_held_rotor() -> None:
    """At a fixed distance the preload is no mean force; on a mount it is."""
    motor = pr.load_motor("andersen2002-unintended-mode").updated({"mount": None})
    sprung = motor.updated({"mount": {"stiffness_n_per_m": 1e4, "mass_kg": 0.02, "damping_n_s_per_m": 2.0}})

    def stall(motor: pr.Motor, frequency: float) -> dict[str, Any]:
        drive = pr.TwoPhaseDrive(voltage=100.0, frequency=frequency, phase_deg=180.0)
        return held_point(motor, drive, speed=0.0)

    low, high, soft = stall(motor, 44.5e3), stall(motor, 46e3), stall(sprung, 44.5e3)
    says(f"it is {low['normal_force_n']:.1f} N at 44.5 kHz", f"off for {100 * low['separated']:.0f} % of the time")
    says(f"and {high['normal_force_n']:.1f} N at 46 kHz")
    assert high["separated"] < 1e-6  # the share is a sum of steps, rounded
    says(f"the stall torque is {1e3 * low['torque_n_m']:.1f} mN·m at the fixed distance")
    says(f"{1e3 * soft['torque_n_m']:.1f} mN·m with a mount", f"the mean force is {soft['normal_force_n']:.1f} N")
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=17e3, phase_deg=90.0)
    run = simulated(MOTOR.updated({"mount": None}), drive, duration=5e-3, speed=0.0, audit=False)
    says(f"it is {run.mean(run.normal_force_n):.1f} N at the end of 5 ms")


@pytest.mark.soak
def test_error_of_a_deck() -> None:
    """100 ns, true modes; against 20 ns exact at resonance, whose own error is (20/141)² of 0.03 %."""
    fine = pr.simulate(MOTOR, WORKING, duration=3e-3, step=20e-9)
    deck = pr.simulate(MOTOR, WORKING, duration=3e-3, step=100e-9, exact_resonance=False)
    error = np.interp(fine.time_s, deck.time_s, deck.tip_x_m) - fine.tip_x_m
    relative = 100 * np.sqrt(np.mean(error**2) / np.mean(fine.tip_x_m**2))
    says(f"100 ns: about {relative:.1f} % in the tip's motion")
