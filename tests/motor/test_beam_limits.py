# SPDX-License-Identifier: GPL-3.0-or-later
"""Cautions of beams: their criteria, their estimates against finite elements, and that every result has them."""

import json
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.motor.beam_limits import (
    beam_cautions,
    estimated_errors,
    heights_over_half_wave,
    share_of_laminate,
)
from pyspice_runner.motor.load import changed_motor
from tests.runs import simulated
from tests.solid_beams import PatchedBeam

SLENDER = PatchedBeam(0.1, 2e-3, 0.25e-3, 0.002, 0.0485)
MEDIUM = PatchedBeam(0.03, 2e-3, 0.6e-3, 0.001, 0.014)
SHORT = PatchedBeam(0.0122, 3.6e-3, 1.2e-3, 0.0005, 0.0039)


@pytest.mark.parametrize("case", [MEDIUM, SHORT], ids=["medium", "short"])
@pytest.mark.soak
def test_the_estimates_are_those_of_finite_elements(case: PatchedBeam) -> None:
    frequencies, forces = case.solid(0.7e-3)
    for theory in ("timoshenko", "bernoulli-euler"):
        ours = case.beam(theory)
        said = estimated_errors(*case.parts(theory), 2)
        # the two points on docs/physics.md; a second mode of Bernoulli and Euler has errors far above them
        close = 0.02 * ours[0] / case.beam()[0]
        assert (np.abs(ours[0] / frequencies - 1 - said[0]) < close).all()
        if case is MEDIUM:
            assert ours[1][0] / forces[0] - 1 == pytest.approx(said[1][0], rel=0.1)
    if case is SHORT:  # a half to a third of the laminate's force; the estimate does not see all of the loss
        beam, patches, _ = case.parts()
        assert 0.3 < forces[0] / case.beam()[1][0] < share_of_laminate(beam, patches[0]) < 0.55


def test_force_rises_from_the_ends_of_a_patch() -> None:
    # the mean of N over the patch, from N″ = (N − 1)/λ² with N = 0 at both ends, by finite differences
    beam, (patch, _), _ = MEDIUM.parts()
    points, length = 4001, patch.end_m - patch.start_m
    shear = patch.youngs_modulus_pa / (2 * (1 + patch.poissons_ratio))
    soft = 1 / (patch.youngs_modulus_pa * patch.thickness_m) + 6 / (beam.youngs_modulus_pa * beam.thickness_m)
    squared = 3 * shear / patch.thickness_m * soft  # 1/λ²
    step = length / (points + 1)
    from scipy.linalg import solve_banded

    band = np.array([np.ones(points), np.full(points, -2 - squared * step**2), np.ones(points)])
    force = solve_banded((1, 1), band, np.full(points, -squared * step**2))
    assert share_of_laminate(beam, patch) == pytest.approx(force.sum() * step / length, rel=1e-6)


def test_the_share_of_a_wide_and_of_a_single_patch() -> None:
    beam, (patch, _), _ = MEDIUM.parts()
    share = share_of_laminate(beam, patch)
    assert share_of_laminate(beam, patch.model_copy(update={"faces": "top"})) < share
    assert share_of_laminate(beam, patch.model_copy(update={"width_m": 0.5e-3})) < share
    long = patch.model_copy(update={"end_m": 1e3})
    assert share_of_laminate(beam, long) == pytest.approx(1.0, abs=1e-5)


def test_the_height_counts_the_ceramic_where_it_is_thickest() -> None:
    beam, patches, _ = MEDIUM.parts()
    assert heights_over_half_wave(beam, patches, 2) == pytest.approx([3.2 / 30, 6.4 / 30])
    top = patches[0].model_copy(update={"faces": "top"}), patches[1].model_copy(update={"thickness_m": 1e-4})
    assert heights_over_half_wave(beam, top, 1) == pytest.approx([2.6 / 30])
    assert heights_over_half_wave(beam, (), 1) == pytest.approx([2.0 / 30])


@pytest.mark.parametrize("theory", ["timoshenko", "bernoulli-euler"])
def test_a_slender_beam_with_long_patches_has_no_caution(theory: str) -> None:
    assert beam_cautions(*SLENDER.parts(theory), 2) == ()
    frequencies, forces = estimated_errors(*SLENDER.parts(theory), 2)
    assert (np.abs(frequencies) < 0.02).all()
    assert (np.abs(forces) < 0.02).all()


def test_cautions_state_ratios_and_errors() -> None:
    height, lag = beam_cautions(*SHORT.parts("bernoulli-euler"), 2)
    frequencies, forces = estimated_errors(*SHORT.parts("bernoulli-euler"), 2)
    assert height == (
        "The height of the beam is 0.49 and 0.98 of the half waves of its modes, more than 0.1: by its dimensions its "
        f"frequencies have an estimated error of {100 * frequencies[0]:+.0f} % and {100 * frequencies[1]:+.0f} %. "
        'Specify theory = "timoshenko".'
    )
    assert lag == (
        "Shear lag leaves 52 % of the laminate's force in a patch 2.8 times as long as thick: by its dimensions the "
        f"force factors have an estimated error of {100 * forces[0]:+.0f} % and {100 * forces[1]:+.0f} %."
    )
    assert not any("theory" in caution for caution in beam_cautions(*SHORT.parts(), 2))


def test_an_estimate_that_cannot_be_computed_is_of_unknown_size(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any, **__: Any) -> None:
        raise pr.ParameterError("too stiff")

    monkeypatch.setattr("pyspice_runner.motor.beam_limits.solve_resonator", refused)
    said = beam_cautions.__wrapped__(*SHORT.parts(), 2)
    assert all(caution.endswith("an estimated error of an unknown size.") for caution in said)


def test_every_result_of_a_high_beam_has_its_cautions(capsys: pytest.CaptureFixture[str]) -> None:
    motor = changed_motor("andersen2002", {"beam.recoil": True, "beam.theory": "bernoulli-euler"})
    assert len(motor.cautions) == 2  # the user specifies the theory, not the paper
    drive = pr.default_drive(motor)
    brief = simulated(motor, drive, duration=2e-4)
    for result in (
        pr.steady_state(motor, drive, speed=0.0),
        pr.admittance(motor, start=5e3, stop=6e3, points=5),
        brief,
    ):
        assert set(motor.cautions) <= set(result.cautions)
        assert set(motor.cautions) <= set(result.to_dict()["cautions"])
    capsys.readouterr()
    assert run(["show", "andersen2002", "--set", "beam.recoil=true"]) == 0
    shown = capsys.readouterr().err.splitlines()
    assert shown == [f"piezomotor: {caution}" for caution in motor.cautions]
    assert run(["show", "andersen2002", "--set", "beam.recoil=true", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["cautions"] == list(motor.cautions)


def test_a_motor_by_its_modes_has_no_caution_of_a_beam() -> None:
    motor = pr.load_motor("andersen2002-unintended-mode")
    assert not any("height" in caution or "lag" in caution for caution in motor.cautions)
    by_modes = pr.load_motor("andersen2002").updated({"modes.0.quality_factor": 100.0})
    assert not any("height" in caution or "lag" in caution for caution in by_modes.cautions)
