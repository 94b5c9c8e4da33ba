# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor from a ``[ring]``: its modes, electrodes, contacts, cautions, and what a wrong table is told."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pyspice_runner as pr
from pyspice_runner.motor import ring as theory
from pyspice_runner.motor import strength
from pyspice_runner.motor.load import changed_motor
from pyspice_runner.motor.ring import Layer, Ring, ring_cautions, ring_contacts, ring_modes, wave_of_plate
from pyspice_runner.motor.solid.materials import material_of, materials
from tests.motor.toml_text import reads_well


def ring(**changes: Any) -> Ring:
    """Return the ring of the set with some entries changed."""
    motor = pr.load_motor("ring60").ring
    assert motor is not None
    return Ring(**{**motor.model_dump(), **changes})


@pytest.mark.parametrize("waves", [2, 3, 5])
def test_a_thin_narrow_ring_has_the_frequencies_of_love(waves: int) -> None:
    radius, width, height, steel = 0.1, 2e-3, 0.2e-3, materials()["steel"]
    found = theory.solve_plate((Layer.of(steel, 0.0, height),), radius - width / 2, radius + width / 2, waves)
    young, poisson = 211.9e9, 0.291
    bending = young * width * height**3 / 12
    torsion = young / (2 * (1 + poisson)) * width * height**3 / 3 * (1 - 0.630 * height / width)  # Saint-Venant
    line = steel.density_kg_m3 * width * height
    square = bending / line / radius**4 * waves**2 * (waves**2 - 1) ** 2 / (waves**2 + bending / torsion)
    # neglected there: the width over the wave length, and the shear, both below 1e-3 in frequency
    assert found.frequencies_hz[0] == pytest.approx(sqrt(square) / 2 / pi, rel=2e-3)


@pytest.mark.parametrize(("waves", "hertz"), [(2, 205.89), (3, 588.88)])
def test_a_thick_ring_has_the_frequencies_of_a_published_benchmark(waves: int, hertz: float) -> None:
    # Code_Aster V2.03.109 (SDLS109): mean radius 369 mm, 48 mm wide and 50 mm high; its reference is a mesh of
    # linear bricks, whose frequencies converge from above: quadratic ones by Tanatloc have 205.22 Hz
    card = {"youngs_modulus_pa": 185e9, "poisson": 0.3, "density_kg_m3": 7800.0, "specific_heat_j_per_kg_k": 1.0}
    layer = Layer.of(material_of("steel", {**card, "source": ""}), 0.0, 0.05)
    frequencies = theory.solve_plate((layer,), 0.345, 0.393, waves).frequencies_hz
    assert np.abs(frequencies[:2] / hertz - 1.0).min() < 0.006


@settings(max_examples=20, deadline=None)
@given(st.floats(0.3, 3.0))
def test_a_ring_of_another_size_follows_the_laws_of_similarity(scale: float) -> None:
    sizes = ("outer_radius_m", "inner_radius_m", "contact_radius_m", "thickness_m", "ceramic_thickness_m")
    one = ring()
    other = ring(**{name: scale * getattr(one, name) for name in (*sizes, "tooth_height_m")})
    ours, theirs = wave_of_plate(one), wave_of_plate(other)
    ratios = [
        getattr(theirs, name) / getattr(ours, name) for name in ("frequency_hz", "mass_kg", "force_n_per_v", "lever")
    ]
    assert ratios == pytest.approx([1 / scale, scale**3, scale, 1.0], rel=1e-6)
    assert theory.capacitance_f(other, 4.0) == pytest.approx(theory.capacitance_f(one, 4.0) * scale, rel=1e-12)
    assert other.heat_capacity_j_per_k == pytest.approx(one.heat_capacity_j_per_k * scale**3, rel=1e-12)


@pytest.mark.parametrize(("waves_a", "waves_b", "axis"), [(4.0, 4.0, 0.0), (2.5, 3.0, 40.0)])
def test_force_factors_follow_from_the_electrodes_around_the_ring(waves_a: float, waves_b: float, axis: float) -> None:
    one = ring(waves_a=waves_a, waves_b=waves_b, waves_feedback=0.3, splitting_axis_deg=axis)
    modes, feedback = ring_modes(one, wave_of_plate(one))
    phase = (np.arange(1_800_000) + 0.5) * 2e-5 * pi  # of nine waves twice: each place once
    phase = phase[phase < 2 * pi * one.waves] - 0.5 * pi
    start_b = 2 * pi * waves_a  # a quarter of a wave after the end of A
    end_b = start_b + 2 * pi * waves_b
    in_a, in_b = phase < start_b - 0.5 * pi, (phase >= start_b) & (phase < end_b)
    sensed = np.abs(phase - (end_b + 2 * pi * one.waves - 0.5 * pi) / 2) < pi * one.waves_feedback
    assert not (in_a & in_b | (in_a | in_b) & sensed).any()
    per_wave, step = wave_of_plate(one).force_n_per_v / 4, 2e-5 * pi
    turned = np.radians(axis)
    for mode, shape, sense in zip(modes, (np.cos, np.sin), feedback, strict=True):
        moved = shape(phase - turned)
        a = per_wave * step * (moved * np.sign(np.cos(phase)))[in_a].sum()
        b = per_wave * step * (moved * np.sign(np.sin(phase)))[in_b].sum()
        assert (mode["coupling_a_n_per_v"], mode["coupling_b_n_per_v"]) == pytest.approx((a, b), abs=1e-5)
        assert sense == pytest.approx(per_wave * step * moved[sensed].sum(), abs=1e-5)


@settings(max_examples=10, deadline=None)
@given(st.floats(-180.0, 180.0))
def test_equal_modes_may_be_turned(axis: float) -> None:
    found = []
    for turned in (0.0, axis):
        one = ring(splitting=0.0, splitting_axis_deg=turned)
        modes, feedback = ring_modes(one, wave_of_plate(one))
        places = ring_contacts(one, wave_of_plate(one))
        moved = [[place[axis][mode["name"]] for mode in modes] for place in places for axis in ("tip_x", "tip_y")]
        forces = [[mode["coupling_a_n_per_v"], mode["coupling_b_n_per_v"]] for mode in modes]
        found.append(np.array(moved) @ np.column_stack([forces, feedback]))
    assert found[0] == pytest.approx(found[1], abs=1e-9)


def test_the_set_has_two_modes_that_split_and_a_wave_that_runs_past_its_contacts() -> None:
    motor = pr.load_motor("ring60")
    one = motor.ring
    assert one is not None
    low, high = motor.modes
    assert high.frequency_hz / low.frequency_hz - 1 == pytest.approx(one.splitting, rel=1e-3)
    assert [place.multiplicity for place in motor.contacts] == 8 * [9]
    assert not motor.cautions
    assert "compresses the lining by 39 %" in motor.updated({"contact.lining.youngs_modulus_pa": 2e6}).cautions[0]
    for points in (3, 4, 16):  # [contact] is of the whole circle, which is as stiff with any number of points
        pressed = changed_motor("ring60", {"ring.points": points, "contact.preload_n": 170.0}).pressed_stator
        assert pressed.stiffness == pytest.approx(motor.pressed_stator.stiffness, rel=1e-9, abs=1e-3)
    # of a wave all points move by 1 towards the rotor and by X along it, a quarter of a period apart
    x, y = motor.stator.contact[::2], motor.stator.contact[1::2]
    assert np.hypot(*y.T) == pytest.approx(np.ones(8))
    assert np.hypot(*x.T) == pytest.approx(np.full(8, wave_of_plate(one).lever))
    assert np.sum(x * y, axis=1) == pytest.approx(np.zeros(8), abs=1e-12)
    assert motor.deflections_m == pytest.approx(np.zeros(8), abs=1e-15)  # equal points along a wave do not bend it
    assert pr.Thermal.of(motor).heat_capacity_j_per_k == pytest.approx(one.heat_capacity_j_per_k)
    assert strength.electrode_distance(motor, "a") == one.ceramic_thickness_m


def test_stress_is_that_of_a_bent_strip() -> None:
    one = ring(inner_radius_m=0.0299, outer_radius_m=0.0301, contact_radius_m=0.03, ceramic_thickness_m=2e-6,
               thickness_m=1e-4, teeth=0, tooth_height_m=0.0, splitting_axis_deg=0.0)  # fmt: skip
    strain, stress = (np.abs(each).max() for each in theory.ring_stress(one))
    expected = 0.5 * one.face_m * (one.waves**2 - 1) / 0.03**2  # (n² − 1)/R²: curvature of a ring out of its plane
    assert strain == pytest.approx(expected, rel=0.02)  # the layer of ceramic shifts the neutral plane by 1 %
    assert stress / strain == pytest.approx(1 / 12.3e-12, rel=0.1)  # 1/s11, across it the strain of brass


BEYOND = {"thickness_m": (0.01, "half a wave is 1.1"), "inner_radius_m": (0.018, "width"),
          "teeth": (28, "a multiple of ring.waves = 9"), "tooth_height_m": (0.004, "of a tooth alone")}  # fmt: skip
WRONG = {
    "waves_a": (5.0, "take 9.5 waves"), "waves_b": (3.3, "whole number of half waves"),
    "ceramic": ("steel", "there are PZT-4"), "material": ("wood", "is not known"),
    "inner_radius_m": (0.031, "must be less than outer_radius_m"), "points": (6, "odd, or a multiple of 4"),
    "contact_radius_m": (0.028, "radius_m is ring.contact_radius_m"), "waves_feedback": (0.0, "[feedback] belongs to"),
    "teeth": (0, "belong together"), "rotor.radius_m": (0.02, "radius_m is ring.contact_radius_m = 0.029 m"),
    "contact.lining.youngs_modulus_pa": (1e5, "compresses the lining by 7.87 times contact.lining.thickness_m"),
}  # fmt: skip


@pytest.mark.parametrize("name", BEYOND)
def test_a_ring_beyond_the_theory_says_so(name: str) -> None:
    (caution,) = ring_cautions(ring(**{name: BEYOND[name][0]}))
    assert BEYOND[name][1] in caution
    assert not ring_cautions(ring(**{name: BEYOND[name][0]}, theory="solid"))


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_ring_is_told_what_is_wrong(name: str) -> None:
    with pytest.raises(pr.ParameterError) as error:
        changed_motor("ring60", {name if "." in name else f"ring.{name}": WRONG[name][0]})
    assert WRONG[name][1] in str(error.value)
    assert reads_well(str(error.value))
