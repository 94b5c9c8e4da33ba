# SPDX-License-Identifier: GPL-3.0-or-later
"""Foot and stem of a tip against closed forms of a cantilever and momentum.

tests/docs/test_physics_page.py compares with finite elements of the same shape.
"""

from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import eigh

import pyspice_runner as pr
from pyspice_runner.motor.beam import Resonator, solve_resonator
from pyspice_runner.motor.parameters import Beam, Tip
from tests.motor.test_beam import BEAM, SYMMETRIC, THICK
from tests.motor.test_load import BEAM as MOTOR
from tests.motor.toml_text import toml

BASE = Beam(length_m=0.02, width_m=0.01, thickness_m=0.01, youngs_modulus_pa=2e12, density_kg_m3=3e4)
LENGTH, FOOT, MODULUS, MASS = 5e-3, 1e-3, 1e9, 1e-4
STRETCH = MODULUS * BASE.width_m * FOOT  # EA
BEND = STRETCH * FOOT**2 / 12  # EI
TURNING = 16.67 / (pi * BASE.youngs_modulus_pa * BASE.width_m * FOOT**2)  # of the foot per moment


def head(centre: float, inertia: float, **changes: Any) -> Tip:
    """A head on a soft stem; ``centre`` counts from the end of the stem, ``inertia`` is about the centre."""
    height = 0.5 * BASE.thickness_m + LENGTH + centre
    values = {
        "position_m": 0.01, "length_m": 0.012, "mass_kg": MASS, "rotary_inertia_kg_m2": inertia + MASS * height**2,
        "centre_m": height, "foot_width_m": FOOT, "stem_length_m": LENGTH, "stem_youngs_modulus_pa": MODULUS,
    }  # fmt: skip
    return Tip.model_validate(values | changes)


def test_a_mass_on_a_cantilever_has_its_closed_form() -> None:
    # on a base that is stiff: 1/ω² = m (l³/3EI + 3l/EA + l² c) with the turning c of the foot, and m l/EA along y.
    # The base gives way by some 2e-4 of the stem.
    found = solve_resonator(BASE, (), head(0.0, 0.0))
    sideways = MASS * (LENGTH**3 / (3 * BEND) + 3 * LENGTH / STRETCH + LENGTH**2 * TURNING)
    lengthways = MASS * LENGTH / STRETCH
    expected = [1 / (2 * pi * sqrt(square)) for square in (sideways, lengthways)]
    assert found.frequencies_hz == pytest.approx(expected, rel=5e-4)
    # at the height of the contact, 2 mm above the mass, x is larger by 2 mm of the rotation at the end of a cantilever
    turn = LENGTH**2 / (2 * BEND) + LENGTH * TURNING
    assert (found.tip_x[0] * sqrt(MASS / found.masses_kg[0])) ** 2 == pytest.approx(
        (1 + 2e-3 * turn / (sideways / MASS)) ** 2, rel=1e-3
    )


def test_a_head_with_rotary_inertia_has_the_modes_of_two_freedoms() -> None:
    centre, inertia = 1.5e-3, 4e-10
    moment = LENGTH**2 / (2 * BEND) + LENGTH * TURNING
    flexibility = np.array(
        [[LENGTH**3 / (3 * BEND) + 3 * LENGTH / STRETCH + LENGTH**2 * TURNING, moment],
         [moment, LENGTH / BEND + TURNING]]
    )  # fmt: skip
    mass = MASS * np.outer([1.0, centre], [1.0, centre]) + np.diag([0.0, inertia])
    squares = eigh(np.linalg.inv(flexibility), mass, eigvals_only=True)
    found = solve_resonator(BASE, (), head(centre, inertia), count=3).frequencies_hz
    swing = np.sqrt(squares) / (2 * pi)
    lengthways = sqrt(STRETCH / LENGTH / MASS) / (2 * pi)
    assert found == pytest.approx(sorted([*swing, lengthways]), rel=5e-4)


def test_a_foot_without_a_stem_turns_in_the_face() -> None:
    height = 0.5 * BASE.thickness_m
    tip = head(0.0, 1e-7, stem_length_m=0.0, stem_youngs_modulus_pa=None, foot_width_m=1e-4)
    inertia = 1e-7 + MASS * (tip.centre_m - height) ** 2 if tip.centre_m else 0.0
    turning = 16.67 / (pi * BASE.youngs_modulus_pa * BASE.width_m * 1e-8)
    found = solve_resonator(BASE, (), tip, count=1).frequencies_hz[0]
    assert found == pytest.approx(1 / (2 * pi * sqrt(turning * inertia)), rel=1e-3)


@pytest.mark.parametrize("beam", [BEAM, THICK])
def test_the_recoil_is_that_of_the_beam_and_of_the_head(beam: Beam) -> None:
    # momentum along y per modal velocity: ∫μ w dx + m times the motion of the head, which is rigid
    tip = Tip(
        position_m=0.0127, length_m=0.009, mass_kg=8e-4, rotary_inertia_kg_m2=5e-8, centre_m=0.007,
        foot_width_m=1.5e-3, stem_length_m=2.5e-3, stem_youngs_modulus_pa=5e9,
    )  # fmt: skip
    found = solve_resonator(beam, (), tip, count=3)
    line = beam.density_kg_m3 * beam.width_m * beam.thickness_m
    for mode in range(3):
        moving = quad(lambda x, n=mode: float(found.deflection(x)[n]), 0.0, beam.length_m, limit=500, epsabs=1e-9)[0]
        momentum = line * moving + tip.mass_kg * found.tip_y[mode]
        assert found.recoils_kg[mode] == pytest.approx(momentum, rel=1e-6, abs=1e-9)
    assert not np.allclose(found.tip_y, found.deflection(tip.position_m), rtol=1e-2)  # the stem is stretched
    # along x the beam's axis does not move; a contact at the centre of mass of the head moves with it
    at_centre = solve_resonator(beam, (), tip.model_copy(update={"length_m": 0.007}), count=3)
    assert found.recoils_x_kg == pytest.approx(tip.mass_kg * at_centre.tip_x, rel=1e-9)


def test_a_stem_between_the_patches_keeps_the_symmetries() -> None:
    tip = Tip(
        position_m=0.015, length_m=0.009, mass_kg=8e-4, rotary_inertia_kg_m2=5e-8, centre_m=0.007,
        foot_width_m=2e-3, stem_length_m=2.5e-3, stem_youngs_modulus_pa=200e9,
    )  # fmt: skip
    found = solve_resonator(THICK, SYMMETRIC, tip)
    up = int(np.argmax(np.abs(found.tip_y)))
    assert found.tip_x[up] == found.tip_y[1 - up] == found.recoils_kg[1 - up] == 0.0
    assert found.couplings_n_per_v[0] == pytest.approx(found.couplings_n_per_v[1] * [[1, -1], [-1, 1]][up], rel=1e-8)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stem_length_m": 2e-3}, "an elastic stem needs foot_width_m, stem_length_m and stem_youngs_modulus_pa"),
        ({"stem_youngs_modulus_pa": 2e11}, "an elastic stem needs"),
        ({"foot_width_m": 1e-3}, "an elastic foot needs foot_width_m and centre_m"),
        ({"centre_m": 2e-3}, "an elastic foot needs"),
        ({"foot_width_m": 1e-3, "centre_m": 0.1}, "is less than mass_kg · centre_m² = 2e-06 kg·m²"),
        (
            {"foot_width_m": 3e-3, "centre_m": 2e-3},
            "reaches from 0.0105 m to 0.0135 m, onto patches.0; the foot stands",
        ),
        ({"foot_width_m": 0.025, "centre_m": 2e-3}, "beyond the beam from 0 to beam.length_m = 0.025 m; move the tip"),
        (
            {"foot_width_m": 1e-3, "centre_m": 2e-3, "stem_length_m": 4e-3, "stem_youngs_modulus_pa": 2e11},
            "ends 0.00505 m above the neutral axis, beyond tip.length_m = 0.004 m",
        ),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(toml(MOTOR | {"tip": MOTOR["tip"] | changes}), encoding="utf-8")
    with pytest.raises(pr.ParameterError) as refused:
        pr.load_motor(file)
    assert message in str(refused.value)


def test_what_a_stem_adds_to_the_contact_is_a_cantilever_on_a_stiff_beam() -> None:
    """At its end, with the foot that turns in the face: k_x and k_y of the stem, to the part that is in the modes."""
    turning = 16.67 / (pi * BASE.youngs_modulus_pa * BASE.width_m * FOOT**2)
    bend, stretch = LENGTH**3 / (3 * BEND) + 3 * LENGTH / STRETCH + LENGTH**2 * turning, LENGTH / STRETCH
    tip = head(0.5 * BASE.thickness_m + LENGTH, 0.0)
    tip = tip.model_copy(update={"length_m": 0.5 * BASE.thickness_m + LENGTH})
    found = solve_resonator(BASE, (), tip, count=3)
    # omitted: mode 3 and above of the stiff beam, and the rotation of the massless head
    kept = np.array([found.tip_y, found.tip_x]) ** 2 / found.stiffnesses_n_per_m
    assert found.residual_m_per_n + kept.sum(axis=1) == pytest.approx([stretch, bend], rel=1e-3)


def test_a_motor_with_a_stem_is_read(tmp_path: Path) -> None:
    stem = {"foot_width_m": 1e-3, "centre_m": 2.5e-3, "stem_length_m": 2e-3, "stem_youngs_modulus_pa": 2e11}
    file = tmp_path / "mine.toml"
    file.write_text(toml(MOTOR | {"tip": MOTOR["tip"] | stem}), encoding="utf-8")
    motor = pr.load_motor(file)
    found: Resonator = solve_resonator(motor.structure.beam, motor.structure.patches, motor.structure.tip)
    assert [mode.frequency_hz for mode in motor.modes] == pytest.approx(list(found.frequencies_hz))
    assert [mode.tip_x for mode in motor.modes] == list(found.tip_x)
    contact, (normal, tangent) = motor.contact, found.residual_m_per_n
    assert (contact.series_compliance_m_per_n, contact.tangential_series_compliance_m_per_n) == (normal, tangent)
    assert tangent > normal > 0.0
