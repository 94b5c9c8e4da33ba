# SPDX-License-Identifier: GPL-3.0-or-later
"""The drives of the paper's eqs. (1) and (2): their tones, their period and what they refuse."""

from inspect import signature
from math import pi, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pyspice_runner.errors import ParameterError
from pyspice_runner.motor.drive import (
    Drive,
    Load,
    Tone,
    TwoPhaseDrive,
    TwoToneDrive,
    check_together,
    default_drive,
    free_tip,
)
from pyspice_runner.motor.load import available_motors, load_motor
from tests.motor.toml_text import reads_well
from tests.motors import mode, motor

Array = NDArray[np.float64]


def wave(tones: tuple[Tone, ...], time: Array) -> Array:
    return np.sum([t.amplitude * np.sin(2 * pi * t.frequency * time + t.phase) for t in tones], axis=0)


def test_two_phases_are_equation_1() -> None:
    drive = TwoPhaseDrive(voltage=37.0, frequency=48e3, phase_deg=-70.0)
    time = np.linspace(0.0, 1e-4, 501)
    np.testing.assert_allclose(wave(drive.tones_a, time), 37.0 * np.sin(2 * pi * 48e3 * time), atol=1e-9)
    np.testing.assert_allclose(
        wave(drive.tones_b, time), 37.0 * np.sin(2 * pi * 48e3 * time - radians(70.0)), atol=1e-9
    )
    assert TwoPhaseDrive(voltage=1.0, frequency=1e3).phase_deg == 90.0
    assert drive.frequencies == (48e3,)
    assert drive.period == 1.0 / 48e3


def test_the_default_drive_is_that_of_the_set_or_two_phases_at_the_last_mode() -> None:
    tones = TwoToneDrive(voltage_1=20.0, frequency_1=13e3, voltage_2=9.0, frequency_2=26e3)
    table = {"kind": "two-tone", "voltage_1": 20.0, "frequency_1": 13e3, "voltage_2": 9.0, "frequency_2": 26e3}
    assert default_drive(motor(drive=table)) == tones
    changed = motor(drive=table).updated({"contact.preload_n": 5.0, "modes.0.frequency_hz": 23e3})
    assert default_drive(changed) == tones
    assert default_drive(motor()) == TwoPhaseDrive(
        voltage=50.0, frequency=motor().modes[-1].frequency_hz, phase_deg=90.0
    )
    for name in available_motors():
        recommended = load_motor(name)
        assert recommended.drive is not None
        check_together(recommended, default_drive(recommended))
        assert all(any(path == f"drive.{key}" for path in recommended.provenance) for key in ("voltage", "frequency"))


def test_two_tones_are_equation_2() -> None:
    drive = TwoToneDrive(voltage_1=20.0, frequency_1=13e3, voltage_2=9.0, frequency_2=26e3, phase_deg=25.0)
    time = np.linspace(0.0, 2e-4, 501)
    common = 20.0 * np.sin(2 * pi * 13e3 * time)
    opposed = 9.0 * np.sin(2 * pi * 26e3 * time + radians(25.0))
    np.testing.assert_allclose(wave(drive.tones_a, time), common + opposed, atol=1e-9)
    np.testing.assert_allclose(wave(drive.tones_b, time), common - opposed, atol=1e-9)
    assert drive.frequencies == (13e3, 26e3)


@pytest.mark.parametrize(
    ("first", "second", "period"),
    [
        (13.5e3, 27e3, 1 / 13.5e3),
        (27e3, 13.5e3, 1 / 13.5e3),
        (20e3, 30e3, 1 / 10e3),
        (30e3, 20e3, 1 / 10e3),
        (21e3, 49e3, 1 / 7e3),
        (51.7e3, 51.7e3, 1 / 51.7e3),
        (1e4 / 3, 1e4 / 7, 1 / (1e4 / 21)),
    ],
)
def test_period_is_that_of_both_tones_together(first: float, second: float, period: float) -> None:
    drive = TwoToneDrive(voltage_1=3.0, frequency_1=first, voltage_2=2.0, frequency_2=second, phase_deg=10.0)
    assert drive.period == pytest.approx(period, rel=1e-12)
    time = np.linspace(0.0, 1e-4, 101)
    for tones in (drive.tones_a, drive.tones_b):
        np.testing.assert_allclose(wave(tones, time + drive.period), wave(tones, time), atol=1e-8)


def test_tones_without_a_short_common_period_give_that_of_the_lower() -> None:
    drive = TwoToneDrive(voltage_1=3.0, frequency_1=20e3, voltage_2=2.0, frequency_2=20e3 * 2**0.5)
    assert drive.period == 1.0 / 20e3


@settings(max_examples=50, deadline=None)
@given(
    voltage=st.floats(0.0, 1e4),
    frequency=st.floats(1.0, 1e8),
    phase=st.floats(-360.0, 360.0),
    start=st.floats(0.0, 1.0),
)
def test_the_first_voltages_are_those_at_time_zero(
    voltage: float, frequency: float, phase: float, start: float
) -> None:
    drive = TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase, soft_start=start)
    a, b = drive.initial_voltages()
    assert a == 0.0
    assert b == (0.0 if start else pytest.approx(voltage * sin(radians(phase)), abs=1e-9 * voltage))
    both = TwoToneDrive(
        voltage_1=voltage,
        frequency_1=frequency,
        voltage_2=2.0,
        frequency_2=frequency,
        phase_deg=phase,
        soft_start=start,
    )
    plus, minus = both.initial_voltages()
    assert plus == -minus
    assert plus == (0.0 if start else pytest.approx(2.0 * sin(radians(phase))))


def test_values_without_names_are_taken_in_the_order_of_the_declaration() -> None:
    assert TwoPhaseDrive(110, 40e3, 120) == TwoPhaseDrive(voltage=110.0, frequency=40e3, phase_deg=120.0)
    assert TwoToneDrive(50.0, 13.5e3, 50.0, 27e3).frequencies == (13.5e3, 27e3)
    assert list(signature(TwoPhaseDrive).parameters) == ["voltage", "frequency", "phase_deg", "ratio_b", "soft_start"]
    with pytest.raises(ParameterError, match=r"there are 6 values for 5 parameters\."):
        TwoPhaseDrive(1.0, 1e3, 0.0, 1.0, 0.0, 0.0)
    with pytest.raises(ParameterError, match=r"voltage is given twice\. The order of the values is voltage, "):
        TwoPhaseDrive(1.0, 1e3, voltage=1.0)


# --- a drive and its motor -----------------------------------------------------------------------------------


def test_free_tip_at_resonance_is_force_over_damping() -> None:
    """One mode that moves the tip along 3:4, driven by both groups in phase at its resonance."""
    alone = mode("m", 2e4, 0.003, 50.0, coupling_a_n_per_v=0.2, coupling_b_n_per_v=0.1, tip_x=3.0, tip_y=4.0)
    drive = TwoPhaseDrive(voltage=10.0, frequency=2e4, phase_deg=0.0)
    velocity, swing = free_tip(motor(modes=(alone,)), drive)
    assert velocity == pytest.approx(5.0 * 0.3 * 10.0 / alone.damping_n_s_per_m)
    assert swing == pytest.approx(velocity / (2.0 * pi * 2e4))
    opposed = TwoPhaseDrive(voltage=10.0, frequency=2e4, phase_deg=180.0)
    assert free_tip(motor(modes=(alone,)), opposed)[0] == pytest.approx(velocity / 3.0)


@pytest.mark.parametrize(
    ("drive", "sentence"),
    [
        (TwoPhaseDrive(voltage=1.0, frequency=21.9), "give a frequency ≥ 22 and ≤ 6.6e+06 Hz."),
        (TwoToneDrive(voltage_1=1.0, frequency_1=2e4, voltage_2=0.0, frequency_2=7e6), "A drive at 7e+06 Hz does not"),
        (TwoPhaseDrive(voltage=9e3, frequency=22e3), "is too strong for off the defaults: the free tip would move by"),
    ],
)
def test_a_drive_that_no_motor_of_this_kind_has_is_rejected(drive: Drive, sentence: str) -> None:
    check_together(motor(), TwoPhaseDrive(voltage=100.0, frequency=22e3))
    with pytest.raises(ParameterError) as caught:
        check_together(motor(), drive)
    assert sentence in str(caught.value)
    assert reads_well(str(caught.value))


def test_a_speed_at_which_the_rotor_bursts_is_rejected() -> None:
    Load(speed=7e4).check(motor())
    with pytest.raises(ParameterError, match=r"from -7\.69e\+04 to 7\.69e\+04 rad/s, above which its rim bursts\.$"):
        Load(speed=-8e4).check(motor())
    with pytest.raises(ParameterError, match=r"speed = nan rad/s is not valid"):
        Load(speed=float("nan")).check(motor())
