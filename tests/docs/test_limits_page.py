# SPDX-License-Identifier: GPL-3.0-or-later
"""Every number on docs/limits.md is recomputed; where one moves, the page must be rewritten."""

from __future__ import annotations

import re
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import pyspice_runner as pr
from pyspice_runner.circuit.law import REACH, Law
from pyspice_runner.cli import run
from pyspice_runner.motor import contact as law
from pyspice_runner.motor.dielectric import HIGH_HZ, LOW_HZ
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.steady.speed_torque import held_point
from tests.circuit.batch import batch, results
from tests.docs.numbers import DOCS, missing

MOTOR = pr.load_motor("bimodal40")
CONTACT = MOTOR.contact
DRIVE = pr.default_drive(MOTOR)
PAGE = (DOCS / "limits.md").read_text(encoding="utf-8")


def says(*sentences: str) -> None:
    """The page prints the numbers of these sentences, with their units."""
    assert missing("limits.md", *sentences) == []


def test_dielectric_loss() -> None:
    says(f"constant from {LOW_HZ / 1e3:g} kHz to {HIGH_HZ / 1e6:g} MHz")


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


def test_shape_of_the_contact() -> None:
    pair = MOTOR.materials
    assert pair is not None
    tip, rotor = (pair.tip_youngs_modulus_pa, pair.tip_poisson), (pair.rotor_youngs_modulus_pa, pair.rotor_poisson)
    modulus, radius = law.effective_modulus(*tip, *rotor), pair.tip_radius_m
    assert law.normal_stiffness(modulus, radius) == pytest.approx(CONTACT.normal_stiffness_n_per_m15)
    force, depth = CONTACT.preload_n, law.static_penetration(CONTACT)
    assert elliptical_penetration(radius, radius * (1 + 1e-6), modulus, force) == pytest.approx(depth, rel=1e-5)
    rim = law.effective_radius(radius, MOTOR.rotor.radius_m)
    stiffness = force / elliptical_penetration(rim, radius, modulus, force) ** 1.5
    says(f"on the rim $K_N$ would be {100 * (stiffness / law.normal_stiffness(modulus, rim) - 1):.0f} % higher")
    patch = sqrt(radius * depth)
    says(f"radius of {1e6 * patch:.0f} µm, a penetration of {1e6 * depth:.2f} µm")
    says(f"peak pressure of {1.5e-9 * force / (pi * patch**2):.2f} GPa")


def test_least_amplitude_that_costs_a_brush_something() -> None:
    """The elements of the outermost cell that touches at rest slip, on average, at 1 − x² of the limit."""
    sliders = Law("brush").sliders
    touching = sliders / sqrt(REACH)
    inner = 1 - 1 / touching
    slips = 1 - (1 - inner**3) * touching / 3
    assert (sliders, touching) == (8, 4)
    says(f"below {slips:.2f} of $u_{{\\lim}}$")


def test_loss_of_partial_slip() -> None:
    """Masing: a loop of ±u has the area 8 ∫F du − 4 F u of the virgin curve F."""
    force, limit = CONTACT.friction * CONTACT.preload_n, CONTACT.friction * law.total_compliance(CONTACT)
    limit *= CONTACT.preload_n ** (2 / 3)
    area, _ = quad(lambda v: 1 - (1 - v) ** 1.5, 0, 1)
    loop = force * limit * (8 * area - 4)
    says(f"loses {1e6 * loop:.2f} µJ", f"{1e3 * loop * DRIVE.frequencies[0]:.0f} mW at 40.7 kHz")


@pytest.mark.soak
def test_mean_normal_force_at_a_fixed_distance() -> None:
    """There the preload is no mean force; on the mount it is."""
    fixed, sprung = (
        held_point(motor, DRIVE, speed=0.0, audit=False) for motor in (MOTOR.updated({"mount": None}), MOTOR)
    )
    says(f"from {sprung['normal_force_n']:.1f} N to {fixed['normal_force_n']:.1f} N")
    says(f"{1e3 * fixed['torque_n_m']:.1f} mN·m".replace("-", "−"), f"{1e3 * sprung['torque_n_m']:.1f} mN·m")


ROWS = re.findall(r"^\|`(\.[^`]+)`\|([\d.]+)\|([\d.]+)\|$", PAGE, re.M)
(DECK,) = re.findall(r"^```spice\n(.*?)^```", PAGE, re.M | re.S)


@pytest.mark.soak
def test_steps_and_options_of_a_deck(tmp_path: Path) -> None:
    assert len(ROWS) == 10
    assert run(["export", "bimodal40", "--output", str(tmp_path / "motor.lib")]) == 0
    tolerance = 1e-3 if ngspice_version() == "39" else 1e-2  # other versions choose other steps
    for line, *printed in ROWS:
        deck = re.sub(r"^\.tran.*$", line, DECK, flags=re.M) if line.startswith(".tran") else DECK
        deck = deck.replace(".end", f"{line}\n.end") if line.startswith(".options") else deck
        found = results(batch(tmp_path / "deck.cir", deck))
        assert 1e3 * found["current"] == pytest.approx(float(printed[0]), rel=tolerance)
        assert found["speed"] == pytest.approx(float(printed[1]), rel=tolerance)
