# SPDX-License-Identifier: GPL-3.0-or-later
"""What the paper finds in its figure 5: how the contact changes the tip's path.

The closed forms are those of one mode, a mass on two springs: with D = k − mω² + iωc the free tip has the amplitude
θU/|D|, a tip on a contact that neither opens nor slips θU/|D + s|, where s is the contact's stiffness at the preload
times the square of the tip's share in the mode. The rotor is held.
"""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import pyspice_runner as pr

MOTOR = pr.load_motor("andersen2002")
FIRST, SECOND = MOTOR.modes
F_1 = FIRST.frequency_hz
DURATION = 8e-3  # the slowest transient has fallen to e^-6 = 0.25 %

CONTACT = MOTOR.contact
PENETRATION = (CONTACT.preload_n / CONTACT.normal_stiffness_n_per_m15) ** (2 / 3)
COMPLIANCE = CONTACT.tangential_compliance_tip_m_per_n23 + CONTACT.tangential_compliance_rotor_m_per_n23
NORMAL_STIFFNESS = 1.5 * CONTACT.preload_n / PENETRATION  # of F = K δ^1.5 at F₀
TANGENTIAL_STIFFNESS = 1.5 * CONTACT.preload_n ** (1 / 3) / COMPLIANCE  # of F_T(u) at u = 0
F_CONTACT = F_1 * np.sqrt(1 + NORMAL_STIFFNESS * FIRST.tip_y**2 / FIRST.stiffness_n_per_m)


def stiffening(mode: pr.Motor, frequency: float, spring: float) -> float:
    """|D| / |D + s|: how many times as large the contact makes a small motion."""
    omega = 2 * pi * frequency
    free = mode.stiffness_n_per_m - mode.mass_kg * omega**2 + 1j * omega * mode.damping_n_s_per_m
    return float(abs(free) / abs(free + spring))


def both(drive: pr.TwoPhaseDrive | pr.TwoToneDrive) -> tuple[pr.Waveforms, pr.Waveforms]:
    free = pr.simulate(MOTOR, drive, duration=DURATION, contact=None)
    return free, pr.simulate(MOTOR, drive, duration=DURATION, speed=0.0)


def span(run: pr.Waveforms, signal: str) -> float:
    return float(np.ptp(getattr(run, signal)[run.window()]))


@pytest.mark.parametrize("voltage", [2.0, 50.0, 200.0])
def test_at_f1_the_tip_in_contact_moves_less_towards_the_rotor(voltage: float) -> None:
    free, held = both(pr.TwoPhaseDrive(voltage=voltage, frequency=F_1))
    ratio = span(held, "tip_y_m") / span(free, "tip_y_m")
    small = stiffening(FIRST, F_1, NORMAL_STIFFNESS * FIRST.tip_y**2)  # 1/43
    if voltage == 2.0:
        # the penetration swings by 1 %: the force is linear to 1e-4; what is left of the transient, 0.25 % of a
        # start as large as the motion itself, counts twice in a span
        assert ratio == pytest.approx(small, rel=0.01)
    assert ratio < 2 * small < 0.05


@pytest.mark.parametrize("voltage", [0.2, 20.0, 50.0, 200.0])
def test_at_the_contact_resonance_the_tip_in_contact_moves_more(voltage: float) -> None:
    (resonance,) = pr.admittance(MOTOR, state="preloaded").resonances["A+B"]
    assert resonance.fs == pytest.approx(F_CONTACT, rel=1e-3)  # the figure drives at fs
    free, held = both(pr.TwoPhaseDrive(voltage=voltage, frequency=resonance.fs))
    ratio = span(held, "tip_y_m") / span(free, "tip_y_m")
    ...
