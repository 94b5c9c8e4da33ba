# SPDX-License-Identifier: GPL-3.0-or-later
"""Small signals of the averaged motor: closed forms. docs/averaged_accuracy.md compares them with the full motor."""

from __future__ import annotations

from cmath import phase
from math import degrees, pi

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.analysis.averaged_signals import AveragedSignals, averaged_signals

DRIVE = pr.TwoPhaseDrive(voltage=200.0, frequency=55e3, phase_deg=90.0)


@pytest.fixture(scope="module")
def signals() -> AveragedSignals:
    motor = pr.load_motor("andersen2002").updated({"mount": None})
    return averaged_signals(motor, DRIVE, start=100.0, stop=5e3, points=3)


def test_a_fast_torque_works_against_the_inertia_alone(signals: AveragedSignals) -> None:
    """-1/(jωJ); the slope of the torque over the speed adds 1 % at 2 kHz and less above."""
    fast = signals.modulation_hz > 2e3
    expected = -1.0 / (2j * pi * signals.modulation_hz[fast] * 1e-6)
    np.testing.assert_allclose(signals.transfer("speed", "load_torque")[fast], expected, rtol=0.01)


def test_torque_and_speed_are_those_of_one_rotor(signals: AveragedSignals) -> None:
    """Torque = (jωJ + C_R) speed, where no load changes."""
    motor = pr.load_motor("andersen2002")
    admittance = 2j * pi * signals.modulation_hz * motor.rotor.inertia_kg_m2 + motor.rotor.bearing_damping_n_m_s
    for of in ("amplitude", "phase", "frequency"):
        speed, torque = (signals.transfer(output, of) for output in ("speed", "torque"))
        np.testing.assert_allclose(torque, admittance * speed, rtol=1e-6)


def test_all_signals_at_a_tenth_of_the_frequency_are_those_of_the_full_motor() -> None:
    """3 % and 3 degrees. The page on accuracy has lower frequencies and another motor, with a finer step."""
    motor = pr.load_motor("bimodal40").updated({"mount": None})
    drive = pr.TwoPhaseDrive(voltage=60.0, frequency=40.4e3, phase_deg=120.0)
    highest = 0.0999 * drive.frequency
    ours = averaged_signals(motor, drive, start=0.9 * highest, stop=highest, points=1)
    full = pr.small_signals(motor, drive, frequencies=[highest])
    assert len(full.transfers) == 32
    for (output, of), (expected,) in full.transfers.items():
        ratio = ours.transfer(output, of)[-1] / expected
        assert abs(ratio) == pytest.approx(1.0, abs=0.03), (output, of)
        assert abs(degrees(phase(ratio))) < 3.0, (output, of)


def test_an_operating_point_that_is_not_found_is_an_error_that_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = []

    def fails(bench: object, *_: object, **__: object) -> None:
        tried.append(bench)
        raise pr.SimulationError("Warning: Last gmin step failed")

    monkeypatch.setattr("pyspice_runner.analysis.averaged_signals.ac", fails)
    motor = pr.load_motor("andersen2002").updated({"mount": None})
    with pytest.raises(pr.SimulationError, match="no operating point of the averaged motor at 40 phases"):
        averaged_signals(motor, DRIVE, start=100.0, stop=1e3, phases=20)
    assert len(tried) == 3


def test_a_range_of_less_than_a_step_has_its_two_ends() -> None:
    motor = pr.load_motor("bimodal40").updated({"mount": None})
    drive = pr.TwoPhaseDrive(voltage=60.0, frequency=40.4e3, phase_deg=120.0)
    found = averaged_signals(motor, drive, start=1e3, stop=3e3, points=1)
    np.testing.assert_allclose(found.modulation_hz, [1e3, 3e3])


def test_signals_are_tables_and_files(signals: AveragedSignals) -> None:
    assert "speed_per_amplitude_re" in signals.to_dict()
    assert signals.summary()["speed"] == "6.422 rad/s"
    with pytest.raises(pr.ParameterError, match="There is no transfer from colour"):
        signals.transfer("speed", "colour")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start": 0.0}, "start = 0 Hz, stop = 1000 Hz are not valid"),
        ({"stop": 9e3}, "stop = 9000 Hz are not valid"),
        ({"points": 0}, "points = 0 is out of range"),
        ({"phases": 8}, "phases = 8 is out of range"),
    ],
)
def test_a_range_that_is_not_valid_is_an_error(changes: dict[str, float], message: str) -> None:
    motor = pr.load_motor("andersen2002")
    with pytest.raises(pr.ParameterError, match=message):
        averaged_signals(motor, DRIVE, **{"start": 10.0, "stop": 1e3, "points": 3} | changes)  # type: ignore[arg-type]
