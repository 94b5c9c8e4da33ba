# SPDX-License-Identifier: GPL-3.0-or-later
"""Lag of a running stator and the filter that goes with it: against closed forms."""

from __future__ import annotations

from math import atan, degrees, pi, sqrt

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.motor import contact as contact_law
from pyspice_runner.trackers.track import running_resonance
from pyspice_runner.trackers.tracker import (
    StatorLag,
    loop_gain,
    propose_filter,
    slider_cycle,
    stator_lag,
)

MOTOR = pr.load_motor("andersen2002")
CONTACT = MOTOR.contact
LIMIT = contact_law.limit_ratio(CONTACT) * contact_law.static_penetration(CONTACT)
LOOP = {"gain_hz_per_v": 1500.0, "current_a": 20e-6}


def test_a_small_cycle_sticks_and_a_large_one_slips() -> None:
    stiffness, loss = slider_cycle(CONTACT, 1e-4 * LIMIT)
    # the spring softens by |u|/4 u_lim
    assert stiffness == pytest.approx(contact_law.tangential_stiffness_at_preload(CONTACT), rel=1e-4)
    assert abs(loss) < 1e-9 * stiffness
    amplitude = 1e3 * LIMIT
    stiffness, loss = slider_cycle(CONTACT, amplitude)
    # a square wave of ±μF₀, but for 2 u_lim at each corner
    assert loss == pytest.approx(4.0 / pi * CONTACT.friction * CONTACT.preload_n / amplitude, rel=2e-3)
    assert stiffness < 0.1 * loss


def test_a_free_mode_has_its_own_lag() -> None:
    mode = MOTOR.modes[1]
    lag = stator_lag(MOTOR, 1, 3.0, contact=False)
    assert (lag.resonance_hz, lag.quality) == (mode.frequency_hz, mode.quality_factor)
    assert lag.time_constant_s == pytest.approx(2.0 * mode.mass_kg / mode.damping_n_s_per_m)
    assert lag.amplitude_m == pytest.approx(3.0 / (mode.damping_n_s_per_m * 2.0 * pi * mode.frequency_hz))
    # at half the bandwidth, f/2Q, the phase is 45°
    assert lag.detuning_hz(-45.0) == pytest.approx(mode.frequency_hz / (2.0 * mode.quality_factor))


def test_a_mode_that_sticks_resonates_with_the_springs_of_the_contact() -> None:
    mode = MOTOR.modes[1]
    stiffness = mode.stiffness_n_per_m + contact_law.tangential_stiffness_at_preload(CONTACT) * mode.tip_x**2
    lag = stator_lag(MOTOR, 1, 1e-4)
    assert lag.resonance_hz == pytest.approx(sqrt(stiffness / mode.mass_kg) / (2.0 * pi), rel=1e-4)
    assert lag.quality == pytest.approx(sqrt(stiffness * mode.mass_kg) / mode.damping_n_s_per_m, rel=1e-4)


@pytest.mark.parametrize("target", [0.0, -40.0])
@pytest.mark.parametrize("ratio", [2.0, 6.0])
def test_the_proposed_filter_gives_the_bandwidth_and_the_margin(target: float, ratio: float) -> None:
    lag = StatorLag(50e3, 40.0)
    proposed = propose_filter(lag, 700.0, target_deg=target, ripple_ratio=ratio, **LOOP)
    gain = loop_gain(lag, proposed, 700.0, target_deg=target, **LOOP)
    assert abs(gain) == pytest.approx(1.0, rel=1e-12)
    if target == 0.0:  # elsewhere the zero does not lie on the lag
        assert 180.0 + degrees(np.angle(gain)) == pytest.approx(90.0 - degrees(atan(1.0 / ratio)), abs=1e-9)
    assert proposed.resistance_ohm * proposed.capacitance_f == pytest.approx(lag.time_constant_s)


def test_a_mode_that_does_not_rub_keeps_its_own_damping() -> None:
    motor = MOTOR.updated({"modes.0.tip_x": 0.0})
    mode = motor.modes[0]
    lag = stator_lag(motor, 0, 3.0)
    stiffness = mode.stiffness_n_per_m + contact_law.normal_stiffness_at_preload(CONTACT) * mode.tip_y**2
    omega = sqrt(stiffness / mode.mass_kg)
    assert lag.resonance_hz == pytest.approx(omega / (2.0 * pi))
    assert lag.quality == pytest.approx(mode.mass_kg * omega / mode.damping_n_s_per_m)
    assert lag.amplitude_m == pytest.approx(3.0 / (mode.damping_n_s_per_m * omega))


@pytest.mark.parametrize("contact", [True, False])
def test_a_mode_that_nothing_drives_is_rejected(contact: bool) -> None:
    tracker = pr.Tracker(kind="none", voltage=50.0, frequency=5e4)
    motor = MOTOR.updated({"modes.1.coupling_a_n_per_v": 0.0, "modes.1.coupling_b_n_per_v": 0.0})
    with pytest.raises(pr.ParameterError, match=r"Nothing drives mode .*; choose another mode"):
        running_resonance(motor, tracker, contact=contact)
