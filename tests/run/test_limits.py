# SPDX-License-Identifier: GPL-3.0-or-later
"""Strain, stress and temperature of the ceramic, and the warnings about them in every kind of result."""

import json
from math import pi

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.datasets import Curves
from pyspice_runner.motor.strength import peak_of_amplitudes, peak_of_motion
from pyspice_runner.steady.speed_torque import held_point

MOTOR = pr.load_motor("andersen2002").updated({"modes.0.recoil_kg": 0.0})  # an unknown one would be a caution
HOT, STRONG = "half the Curie temperature", "rated dynamic strength"


def drive(voltage: float) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=51.7e3, phase_deg=90.0)


def test_the_strain_of_a_half_wave_is_its_curvature_times_the_distance_of_the_outer_fibre() -> None:
    """The first mode of a beam whose ceramic and tip hardly count is sin(pi x / L)."""
    structure = MOTOR.structure
    patches = tuple(patch.model_copy(update={"thickness_m": 1e-5}) for patch in structure.patches)
    bare = structure.model_copy(
        update={
            "patches": patches,
            "tip": structure.tip.model_copy(update={"mass_kg": 0.0, "rotary_inertia_kg_m2": 0.0}),
        }
    )
    motor = MOTOR.model_copy(update={"structure": bare})
    found = peak_of_amplitudes(motor, [1e-6, 0.0])
    # at the end of a patch next to the middle, x = 8.5 of 18 mm; the plates stiffen the beam by 1 %
    expected = (0.9e-3 + 1e-5) * (pi / 0.018) ** 2 * np.sin(pi * 8.5 / 18.0) * 1e-6
    assert found["ceramic_strain"] == pytest.approx(expected, rel=0.02)
    assert found["ceramic_stress_pa"] == pytest.approx(61e9 * expected, rel=0.02)


def test_a_motion_is_strained_less_than_its_amplitudes_together() -> None:
    angle = np.linspace(0.0, 2.0 * pi, 101)
    motion = 1e-6 * np.array([np.sin(angle), np.cos(angle)])
    assert peak_of_motion(MOTOR, motion)["ceramic_strain"] < peak_of_amplitudes(MOTOR, [1e-6, 1e-6])["ceramic_strain"]
    assert peak_of_motion(MOTOR, motion[:1] * [[1.0], [0.0]]) == peak_of_amplitudes(MOTOR, [1e-6, 0.0])


# heat and stress that issue 15 of the project found for this motor held still, by its damping and thermal resistance
@pytest.mark.parametrize(
    ("voltage", "rise_k", "stress_pa", "told"), [(20.0, None, None, ()), (50.0, 166.0, None, (HOT,)),
                                                 (300.0, None, 130e6, (STRONG, HOT))],
)  # fmt: skip
def test_a_steady_state_tells_what_its_ceramic_does_not_withstand(
    voltage: float, rise_k: float | None, stress_pa: float | None, told: tuple[str, ...]
) -> None:
    state = pr.steady_state(MOTOR, drive(voltage), speed=0.0)
    if rise_k is not None:
        assert state.temperature_rise_k == pytest.approx(rise_k, rel=0.01)
    if stress_pa is not None:
        assert state.ceramic_stress_pa == pytest.approx(stress_pa, rel=0.03)
    limits = state.cautions[len(MOTOR.cautions) :]
    assert state.cautions[: len(MOTOR.cautions)] == MOTOR.cautions  # of its beam
    assert all(words in sentence for words, sentence in zip(told, limits, strict=True))
    assert state.to_dict()["cautions"] == list(state.cautions)


def test_every_kind_of_result_has_the_caution() -> None:
    run = pr.simulate(MOTOR, drive(100.0), duration=1e-3, step=2e-7)
    assert any(STRONG in caution for caution in run.cautions)
    assert run.to_dict()["ceramic_stress_pa"] > 30e6
    assert run.to_dict()["peak_pressure_pa"] > 1.2e9  # that of the preload, docs/limits.md
    assert run.to_dict()["wear_volume_m3_per_s"] is None
    averaged = pr.simulate_averaged(MOTOR, drive(100.0), 5e-3)
    assert any(STRONG in caution for caution in averaged.cautions)
    point = held_point(MOTOR, drive(100.0), speed=0.0)
    assert any(STRONG in caution for caution in point["cautions"])
    curves = Curves(pr.speed_torque(MOTOR, drive(100.0), speeds=[0.0]))
    assert any(STRONG in caution for caution in curves.cautions)
    assert curves.to_dict()["cautions"] == json.loads(curves.dataset.attrs["cautions"])
    driver = pr.Driver(kind="ideal", voltage=100.0, frequency=51.7e3, phase_deg=90.0)
    driven = pr.drive_report(MOTOR, driver, duration=1e-3)
    assert any(STRONG in caution for caution in driven.cautions)
    tracked = pr.track(MOTOR, pr.Tracker(kind="none", voltage=100.0, frequency=51.7e3, phase_deg=90.0), duration=2e-3)
    assert any(STRONG in caution for caution in tracked.cautions)


def test_a_motor_without_beam_or_limits_says_nothing() -> None:
    motor = MOTOR.updated({"limits": None, "modes.0.frequency_hz": 13.4e3})
    state = pr.steady_state(motor, drive(50.0), speed=0.0)
    assert state.cautions == ()
    assert state.to_dict()["ceramic_strain"] is None
    assert state.to_dict()["temperature_rise_k"] is None
