# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor in VACASK against ngspice, and VACASK's own traps. ``make verilog-a``."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from tests.motors import BEAM40
from tests.tools import second_simulator

MOTOR = pr.load_motor(BEAM40)
LINED, ROUGH = (
    MOTOR.updated({"contact.lining": {"exponent": power, "stiffness_n_per_m": stiffness, "stiffness_ratio": 1.2}})
    for power, stiffness in ((1.0, 1e7), (2.5, 2e15))
)
CASES: dict[str, tuple[pr.Motor, dict[str, Any], Law]] = {
    "free shaft": (MOTOR, {}, Law()),
    "held shaft": (MOTOR, {"speed": 5.0}, Law()),
    "load": (MOTOR, {"load_torque": 3e-3}, Law()),
    "three modes": (pr.load_motor("andersen2002-unintended-mode"), {}, Law()),
    "fixed distance": (pr.load_motor("andersen2002").updated({"mount": None}), {}, Law()),
    "lining": (LINED, {}, Law()),
    "rough surfaces": (ROUGH, {}, Law()),
    "Coulomb friction": (MOTOR, {}, Law("coulomb")),
    "brush": (MOTOR, {}, Law("brush", 3)),  # of four sliders the compiler makes wrong code
}


@pytest.mark.parametrize("case", CASES)
def test_a_transient_in_vacask_is_that_of_ngspice(case: str) -> None:
    """Both integrate by the trapezoidal rule, but begin with other steps, so that one is up to a step ahead."""
    motor, settings, law = CASES[case]
    drive = pr.default_drive(motor)
    ours = pr.simulate(motor, drive, duration=1e-3, contact=law, **settings)
    theirs = second_simulator.simulate(motor, drive, duration=1e-3, law=law, **settings)
    late = ours.time_s[(ours.time_s > 2 * drive.period) & (ours.time_s < 0.999e-3)]
    for name in ("tip_x_m", "tip_y_m", "current_a_a", "current_b_a", "normal_force_n", "rotor_speed_rad_s"):
        found, expected = (CubicSpline(run.time_s, getattr(run, name))(late) for run in (theirs, ours))
        assert np.sqrt(np.mean((found - expected) ** 2)) < 2e-3 * np.sqrt(np.mean(expected**2)), name
    assert theirs.energy_residual < 1e-3


@pytest.mark.parametrize("name", [BEAM40, "andersen2002-unintended-mode"])
def test_the_admittance_in_vacask_is_that_of_ngspice(name: str) -> None:
    motor = pr.load_motor(name)
    ours = pr.admittance(motor, start=30e3, stop=60e3, points=121, state="preloaded")
    theirs = second_simulator.admittance(motor, ours.frequency_hz)
    assert np.abs(theirs - ours.matrix_s).max() < 1e-6 * np.abs(ours.matrix_s).max()


def test_vacask_ignores_phase_in_a_transient() -> None:
    """It takes ``phase=120`` without a message; the transient is that of two voltages in phase."""
    drive = pr.TwoPhaseDrive(voltage=110.0, frequency=40.1e3, phase_deg=120.0)
    in_phase = pr.TwoPhaseDrive(voltage=110.0, frequency=40.1e3, phase_deg=0.0)
    wrong = second_simulator.simulate(MOTOR, drive, duration=2e-4, phase="phase")
    right = second_simulator.simulate(MOTOR, drive, duration=2e-4)
    expected = second_simulator.simulate(MOTOR, in_phase, duration=2e-4)
    assert np.abs(wrong.voltage_b_v - expected.voltage_b_v)[1:].max() < 1e-9
    assert np.abs(right.voltage_b_v - expected.voltage_b_v).max() > 100.0


@pytest.mark.parametrize("harmonics", [2, 3])
def test_harmonic_balance_with_few_harmonics_gives_a_wrong_speed_without_a_message(harmonics: int) -> None:
    """Friction and contact have many harmonics. Take the steady state by shooting, not by harmonic balance."""
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3, phase_deg=90.0)
    speed = pr.steady_state(motor, drive).speed_rad_s
    lines = [*second_simulator.sines("a", drive.tones_a), *second_simulator.sines("b", drive.tones_b)]
    commands = ("options reltol=1e-6", f"analysis run hb freq=[{drive.frequency!r}] nharm={harmonics}")
    raw, _ = second_simulator.vacask(motor, Law(), lines, commands, None)
    found = float(np.asarray(raw.vectors["shaft"])[0].real)
    assert abs(found - speed) > 5.0 * abs(speed)  # measured: -35 and 36 rad/s instead of 2.6
