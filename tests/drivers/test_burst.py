# SPDX-License-Identifier: GPL-3.0-or-later
"""Fast start and stop against closed forms: a transducer, and the free stator that is one."""

from __future__ import annotations

from math import exp, log

import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.drivers.burst import Transducer, boost_time, transducer_of

# 40 kHz, Q = 1000, Cs/C₀ = 1e-4: the weak coupling of the closed form
WEAK = Transducer(158.4, 0.63, 25.13e-12, 251.3e-9)


def test_the_best_resistor_of_a_weak_transducer_is_the_reactance_of_its_clamped_capacitance() -> None:
    """And it adds K²/4 to the damping ratio, K² = Cs/C₀ (Hagood and von Flotow). 0.1 %: the next order is K²."""
    best = WEAK.best_resistor()
    assert best == pytest.approx(1.0 / (WEAK.omega * WEAK.clamped_capacitance_f), rel=1e-3)
    ratio = WEAK.capacitance_f / WEAK.clamped_capacitance_f
    added = 1.0 / (WEAK.omega * WEAK.decay_with(best)) - 1.0 / (WEAK.omega * WEAK.decay_s)
    assert added == pytest.approx(ratio / 4.0, rel=1e-3)


def test_open_and_shorted_pins_leave_the_decay_of_the_arm() -> None:
    assert WEAK.decay_with(1e-3) == pytest.approx(WEAK.decay_s, rel=1e-3)
    assert WEAK.decay_with(1e12) == pytest.approx(WEAK.decay_s, rel=1e-3)
    assert boost_time(1.0, 2.0) == pytest.approx(log(2.0))


def test_a_burst_of_the_free_stator_has_the_times_of_its_transducer() -> None:
    """The first mode, by both groups in phase; 2 %: means over periods, of which 18 are in the decay time.

    The amplitude at the end of the burst, after six decay times, is 1 − exp(−6) of the last one.
    """
    motor = pr.load_motor("andersen2002")
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=motor.modes[0].frequency_hz, phase_deg=0.0)
    found, free = pr.fast_burst(motor, drive, contact=None, speed=None), transducer_of(motor, drive)
    last = 1.0 - exp(-6.0)
    risen = -log(1.0 - 0.9 * last)
    assert found.plain["rise_s"] == pytest.approx(free.decay_s * risen, rel=0.02)
    assert found.plain["fall_s"] == pytest.approx(free.decay_s * log(10.0), rel=0.02)
    assert found.boost_s == pytest.approx(boost_time(free.decay_s * risen / log(10.0), 2.0), rel=0.02)
    # twice the voltage: 2 (1 − exp(−t/τ)) = 0.9; a mean over a period tells the time within half of one
    half = 0.5 * drive.period
    assert found.fast["rise_s"] == pytest.approx(-free.decay_s * log(1.0 - 0.45 * last), abs=half)
    assert found.fast["greatest"] == pytest.approx(1.0, abs=0.02)
    with_resistor = found.transducer["decay_with_resistor_s"]
    assert found.fast["fall_s"] == pytest.approx(with_resistor * log(10.0), rel=0.02)
    assert with_resistor < 0.5 * free.decay_s


def test_a_boost_out_of_range_and_a_burst_that_lasts_too_long_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["burst", "bimodal40", "--boost", "1"]) == 2
    assert "boost = 1 is not valid: it must be from 1.05 to 10." in capsys.readouterr().err
    bimodal = pr.load_motor("bimodal40")
    ringing = bimodal.updated({f"modes.{n}.quality_factor": 2e4 for n in range(len(bimodal.modes))})
    with pytest.raises(pr.ParameterError, match="would take"):
        pr.fast_burst(ringing, pr.TwoPhaseDrive(voltage=50.0, frequency=40.7e3))
