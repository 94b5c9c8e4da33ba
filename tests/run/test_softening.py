# SPDX-License-Identifier: GPL-3.0-or-later
"""A ceramic that softens and loses more with amplitude, against Duffing's oscillator in closed form."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from tests.circuit.test_decks import measured
from tools.benches.duffing import amplitudes, folds
from tools.decks import SOFT as NUMBER
from tools.decks import SOFTENING

MOTOR = pr.load_motor("bimodal40")
SOFT = MOTOR.updated(SOFTENING)
MODE = SOFT.modes[NUMBER]
VOLTAGE = 5.0
FORCE = VOLTAGE * abs(MODE.coupling_a_n_per_v - MODE.coupling_b_n_per_v)


def free(motor: pr.Motor, frequency: float) -> float:
    """Amplitude of the modal coordinate of a free stator in antiphase, m."""
    drive = pr.TwoPhaseDrive(voltage=VOLTAGE, frequency=frequency, phase_deg=180.0)
    state = pr.steady_state(motor, drive, speed=0.0, contact=None)
    assert state.converged
    return float(np.abs(state.waveforms.tip_x_m).max() / abs(MODE.tip_x))


def test_the_closed_form_without_softening_is_the_linear_resonance() -> None:
    mode = MOTOR.modes[NUMBER]
    for frequency in (0.99 * mode.frequency_hz, mode.frequency_hz):
        omega = 2.0 * pi * frequency
        impedance = mode.stiffness_n_per_m - mode.mass_kg * omega**2 + 1j * omega * mode.damping_n_s_per_m
        assert amplitudes(mode, FORCE, frequency) == pytest.approx([FORCE / abs(impedance)], rel=1e-6)
    assert folds(mode, FORCE, 0.975 * mode.frequency_hz, 1.025 * mode.frequency_hz) is None


def test_at_a_fold_two_amplitudes_meet() -> None:
    found = folds(MODE, FORCE, 0.975 * MODE.frequency_hz, 1.01 * MODE.frequency_hz)
    down, up = found
    assert down < up < MODE.frequency_hz
    low, middle, _ = amplitudes(MODE, FORCE, up)
    assert low == pytest.approx(middle, rel=1e-3)
    _, middle, high = amplitudes(MODE, FORCE, down)
    assert middle == pytest.approx(high, rel=1e-3)


@pytest.mark.parametrize("ratio", [0.97, 0.998, 1.005])
def test_the_steady_state_is_on_duffings_curve(ratio: float) -> None:
    frequency = ratio * MODE.frequency_hz
    (expected,) = amplitudes(MODE, FORCE, frequency)
    # harmonics of γ a²/32 = 1e-3; the peak of 128 points a period and the small motion of the other modes
    assert free(SOFT, frequency) == pytest.approx(expected, rel=3e-3)


def test_loss_that_grows_with_amplitude_lowers_the_peak() -> None:
    motor = MOTOR.updated({f"modes.{NUMBER}.damping_growth_per_m2": 5e11})
    mode = motor.modes[NUMBER]
    (expected,) = amplitudes(mode, FORCE, mode.frequency_hz)
    assert expected < 0.9 * amplitudes(MOTOR.modes[NUMBER], FORCE, mode.frequency_hz)[0]
    assert free(motor, mode.frequency_hz) == pytest.approx(expected, rel=3e-3)
    run = pr.simulate(
        motor, pr.TwoPhaseDrive(voltage=VOLTAGE, frequency=40.5e3, phase_deg=180.0), duration=1e-3, contact=None
    )
    assert run.energy_residual < 1e-3


@pytest.mark.soak
def test_the_deck_jumps_at_the_folds(tmp_path: Path) -> None:
    found = measured("softening", tmp_path)
    low, high, sweep = 0.975 * MODE.frequency_hz, 1.01 * MODE.frequency_hz, 0.05
    folded = folds(MODE, FORCE, low, high)
    span = high - low
    up = low + span * found["time_up_s"] / sweep
    down = high - span * (found["time_down_s"] / sweep - 1.0)
    # 28 kHz/s for the time constant 2 m/c of 2.8 ms: the motion follows 80 Hz late, and overshoots after the jump
    lag = span / sweep * 2.0 * MODE.mass_kg / MODE.damping_n_s_per_m
    assert 0.0 < up - folded[1] < 4.0 * lag
    assert -3.0 * lag < down - folded[0] < lag
    assert found["greatest_down_um"] > 1.2 * found["greatest_up_um"]


def test_what_takes_linear_modes_only_says_so() -> None:
    drive = pr.default_drive(MOTOR)
    for refused in (
        lambda: pr.simulate_averaged(SOFT, drive, 1e-3),
        lambda: pr.simulate(SOFT, drive, duration=1e-4, thermal=pr.Thermal()),
        lambda: pr.speed_torque(SOFT, drive, speeds=[0.0], mode="settle"),
    ):
        with pytest.raises(pr.ParameterError, match="takes linear modes only: set both to 0"):
            refused()
