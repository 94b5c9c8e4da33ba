# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of ``python -m tests.random_losses``, a part of it run again, and its integrator against the other one."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pyspice_runner as pr
from tests import random_losses, random_runs
from tests.reference.damped import integrate_damped
from tests.reference.integrator import integrate

pytestmark = pytest.mark.xdist_group("reference")


def test_no_result_of_the_record_is_silent_about_a_difference_or_a_gain() -> None:
    record = json.loads(random_losses.RESULT.read_text(encoding="utf-8"))
    assert record["cases"] == random_losses.COUNT
    assert random_losses.passes(record)
    assert sum(record["run"]["kinds"].values()) >= random_losses.COMPARED - 3  # a run may be refused


@pytest.mark.parametrize(
    ("error", "change", "stated", "said", "kind"),
    [
        (0.009, 1.0, 0.0, False, "within 1 %"),
        (0.02, 1e-6, 0.03, False, "said"),
        (0.02, 1e-6, 0.01, True, "said"),
        (0.02, 1e-6, 0.01, False, "silent"),
        (0.02, 1e-2, 0.01, False, "chaotic"),
    ],
)
def test_a_result_is_judged_by_its_difference_and_by_what_it_states(
    error: float, change: float, stated: float, said: bool, kind: str
) -> None:
    assert random_losses.judged({"torque": (error, change, stated), "tip": (0.0, 0.0, 0.0)}, said=said) == kind


def test_a_loss_below_minus_a_thousandth_of_the_input_is_a_gain() -> None:
    assert random_losses.gains({"friction": -0.0009, "bearing": 0.5}, 1.0) == {}
    assert random_losses.gains({"friction": -0.0022, "bearing": 0.5}, 2.0) == {"friction": -0.0011}


@pytest.mark.soak
@pytest.mark.parametrize("index", range(4))
def test_both_integrators_agree_without_loss_along_the_normal(index: int) -> None:
    one = random_losses.case(random_losses.SEED, index)
    contact = {"contact.restitution": 1.0, "contact.series_compliance_m_per_n": 0.0}
    motor = one.motor.updated(contact)
    modes = random_runs._upright(list(motor.modes))  # the other integrator has the crown above x = 0
    motor = pr.Motor.model_validate(motor.model_copy(update={"modes": tuple(modes)}).model_dump())
    tones = random_runs.tones(one.drive)
    plain = [[(tone.amplitude_v, tone.frequency_hz, tone.phase_rad) for tone in of] for of in tones]
    step = one.setup.shortest_period / 1600
    duration = 64000 * step
    exact = integrate(motor.to_dict(), *tones, duration=duration, output_step=100 * step, step=step, **one.shaft)
    ours = integrate_damped(motor.to_dict(), *plain, duration=duration, output_step=100 * step, step=step, **one.shaft)
    for name in ("tip_x_m", "tip_y_m", "rotor_speed_rad_s"):
        values = getattr(exact, name)
        # of first order in the step, 1/1600 of a period
        assert np.std(getattr(ours, name) - values) <= 2e-3 * np.std(values), name
    energies = exact.energies_j
    for name in ("input", "damping", "mount_damping", "bearing"):
        assert ours.integrals[name][-1] == pytest.approx(energies[name], abs=2e-3 * abs(energies["input"])), name


@pytest.mark.soak
@pytest.mark.parametrize("index", [1, 4])
def test_random_motors_with_all_losses_run_as_the_reference_does(index: int) -> None:
    assert random_losses.outcome(index)["run"]["kind"] in ("within 1 %", "said")
