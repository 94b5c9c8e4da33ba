# SPDX-License-Identifier: GPL-3.0-or-later
"""What the paper finds in its figure 5: how the contact changes the tip's path.

The closed forms are those of one mode: with D = k − mω² + iωc the free tip has the amplitude θU/|D|, and a tip on a
contact that neither opens nor slips θU/|D + s|, where s is the contact's stiffness at the preload times the square of
the tip's share in the mode. The rotor is held.
"""

from collections.abc import Callable
from functools import cache
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.run.waveforms import Waveforms
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("figure 5")  # the runs are shared

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
FIRST, SECOND = MOTOR.modes
F_1 = FIRST.frequency_hz
CONTACT = MOTOR.contact
PENETRATION = (CONTACT.preload_n / CONTACT.normal_stiffness_n_per_m15) ** (2 / 3)
COMPLIANCE = CONTACT.tangential_compliance_tip_m_per_n23 + CONTACT.tangential_compliance_rotor_m_per_n23
NORMAL = 1.5 * CONTACT.preload_n / PENETRATION * FIRST.tip_y**2  # dF_N/dδ at the preload, seen by mode 1
TANGENTIAL = 1.5 * CONTACT.preload_n ** (1 / 3) / COMPLIANCE * SECOND.tip_x**2  # dF_T/du at u = 0, seen by mode 2
F_CONTACT = F_1 * sqrt(1 + NORMAL / FIRST.stiffness_n_per_m)

# Spans are taken over the last 20 periods, from 6.5 ms on at f₁: what is left of the start there is
# e^(-6.5/1.34) = 0.8 % in mode 1, whose time constant is 2m/c = 1.34 ms.
DURATION = 8e-3
SETTLED = 0.015  # twice that: it is in both spans that are compared
STEP = 0.25e-6  # 50 points in a period of the fastest drive


@cache
def free_and_held(drive: pr.TwoPhaseDrive | pr.TwoToneDrive) -> tuple[Waveforms, Waveforms]:
    free = pr.simulate(MOTOR, drive, duration=DURATION, step=STEP, contact=None)
    return free, pr.simulate(MOTOR, drive, duration=DURATION, step=STEP, speed=0.0)


def ratio(drive: pr.TwoPhaseDrive | pr.TwoToneDrive, signal: str) -> float:
    """Span of a motion in contact over that of the free tip."""
    free, held = (np.ptp(getattr(run, signal)[run.window()]) for run in free_and_held(drive))
    return float(held / free)


def small_ratio(mode: Any, frequency: float, spring: float) -> float:
    """The same for a small motion: |D| / |D + s|."""
    omega = 2 * pi * frequency
    free = mode.stiffness_n_per_m - mode.mass_kg * omega**2 + 1j * omega * mode.damping_n_s_per_m
    return float(abs(free) / abs(free + spring))


def at_f1(voltage: float) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=F_1)


def at_contact_resonance(voltage: float) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=F_CONTACT)


def between(voltage: float) -> pr.TwoPhaseDrive:
    return pr.TwoPhaseDrive(voltage=voltage, frequency=21e3)


def off_resonance(voltage: float) -> pr.TwoToneDrive:
    return pr.TwoToneDrive(voltage_1=voltage, frequency_1=40e3, voltage_2=voltage, frequency_2=80e3)


@pytest.mark.parametrize("voltage", mostly(pytest.mark.soak, [2.0, 50.0, 200.0], [2.0]))
@pytest.mark.soak
def test_at_f1_the_tip_moves_less_towards_the_rotor_in_contact(voltage: float) -> None:
    """Finding (e): on resonance D = iωc is small, and s = 43 |D|."""
    found, expected = ratio(at_f1(voltage), "tip_y_m"), small_ratio(FIRST, F_1, NORMAL)
    assert found < 0.05
    if voltage == 2.0:
        # the penetration swings by 2 %, and the force is linear in it to the square of that
        assert found == pytest.approx(expected, rel=SETTLED)


@pytest.mark.parametrize("voltage", mostly(pytest.mark.soak, [0.2, 20.0, 50.0, 200.0], [0.2]))
def test_at_the_contact_resonance_it_moves_more(voltage: float) -> None:
    """Finding (f): D + s is what is small here; it grows less than the voltage where the contact opens."""
    found, expected = ratio(at_contact_resonance(voltage), "tip_y_m"), small_ratio(FIRST, F_CONTACT, NORMAL)
    assert found > 2.0
    if voltage == 0.2:
        assert found == pytest.approx(expected, rel=SETTLED)
        assert expected > 30.0
    else:
        assert found < expected


def test_the_contact_resonance_is_the_preloaded_resonance_of_a_plus_b() -> None:
    (resonance,) = pr.admittance(MOTOR, state="preloaded").resonances["A+B"]
    # fs is where the conductance peaks; the dielectric loss, G_d ~ f³, shifts a peak of height G and quality factor
    # Q by 3 G_d/(8 G Q²) of the frequency: 2e-7 here
    assert resonance.fs == pytest.approx(F_CONTACT, rel=1e-6)


@pytest.mark.parametrize("voltage", mostly(pytest.mark.soak, [20.0, 200.0], [200.0]))
@pytest.mark.soak
def test_off_resonance_eq_2_is_almost_unaffected(voltage: float) -> None:
    """Finding (c, d): far above both resonances |D| is some ten times the contact's s, which therefore counts a tenth.

    s takes from D, which is negative there, so the contact adds to the motion; slip, which lets go of the spring, makes
    it add less along the rotor. A tip that sticks everywhere is the bound.
    """
    drive = off_resonance(voltage)
    bound_y = small_ratio(FIRST, drive.frequency_1, NORMAL)
    bound_x = small_ratio(SECOND, drive.frequency_2, TANGENTIAL)
    assert 1.0 < bound_y < 1.13
    assert 1.0 < bound_x < 1.13
    assert 1.0 < ratio(drive, "tip_y_m") < bound_y * (1 + SETTLED)
    assert 1.0 < ratio(drive, "tip_x_m") < bound_x * (1 + SETTLED)


@pytest.mark.parametrize(
    "drive", mostly(pytest.mark.soak, [at_f1, at_contact_resonance, between, off_resonance], [off_resonance])
)
@pytest.mark.soak
def test_stick_dominates_at_small_amplitude(drive: Callable[[float], pr.TwoPhaseDrive | pr.TwoToneDrive]) -> None:
    _, small = free_and_held(drive(0.2 if drive is at_contact_resonance else 2.0))
    _, large = free_and_held(drive(200.0))
    assert small.state_fractions["stick"] == 1.0
    assert large.state_fractions["stick"] < 0.7
    assert large.state_fractions["slip"] > 0.02
