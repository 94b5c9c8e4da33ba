# SPDX-License-Identifier: GPL-3.0-or-later
"""Branches of steady states through folds: near the contact resonance the motor remembers where it came from."""

from functools import cache
from math import ceil

import numpy as np
import pytest
import xarray

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.source import DriveSource
from pyspice_runner.cli import run
from pyspice_runner.motor.drive import Load
from pyspice_runner.run.dynamometer import Dynamometer, off_beat
from pyspice_runner.run.point import Point
from pyspice_runner.steady.branch import folds
from pyspice_runner.steady.copies import Copy, Plant
from pyspice_runner.steady.period_map import PeriodMap
from pyspice_runner.steady.settling import Settling, settle
from tools.benches import duffing
from tools.decks import SOFT as NUMBER
from tools.decks import SOFTENING

pytestmark = pytest.mark.xdist_group("branches")  # they are shared

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
DRIVE = pr.TwoPhaseDrive(voltage=30.0, frequency=17e3, phase_deg=90.0)


@cache
def branch() -> xarray.Dataset:
    """Up from a tip that stays in contact, around the upper fold, and back with the unstable motion."""
    return pr.steady_branch(MOTOR, DRIVE, follow="drive.frequency", start=16.89e3, stop=17.2e3, speed=0.0, points=32)


def test_a_branch_without_folds_is_that_of_the_steady_states(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    short = pr.steady_branch(MOTOR, DRIVE, follow="drive.voltage", start=30.0, stop=29.0, speed=0.0, points=3)
    at = short.isel(point=-1)
    drive = DRIVE.model_copy(update={"voltage": float(at["drive.voltage"])})
    state = pr.steady_state(MOTOR, drive, speed=0.0)
    friction_torque = MOTOR.contact.friction * MOTOR.contact.preload_n * MOTOR.rotor.radius_m
    # 2 %: one time step without extrapolation, of a tip that hammers
    assert float(at["torque_n_m"]) == pytest.approx(state.torque_n_m, abs=0.02 * friction_torque)
    assert float(at["normal_force_n"]) == pytest.approx(state.normal_force_n, rel=0.01)
    assert short.piezomotor.folds == []
    (caution,) = short.piezomotor.cautions
    assert caution == "The branch does not reach its end: It has 3 points."
    monkeypatch.setattr(pr, "steady_branch", lambda *_, **__: short)
    words = "speed-torque andersen2002 --over drive.voltage=30,29 --follow drive.voltage --speeds 0"
    assert run(words.split()) == 0
    assert caution in " ".join(capsys.readouterr().err.split())


@pytest.mark.soak
def test_behind_a_fold_the_branch_is_unstable() -> None:
    data = branch()
    (fold,) = data.piezomotor.folds
    turned = int(data["drive.frequency"].values.argmax())
    assert fold == pytest.approx(float(data["drive.frequency"].max()), abs=1.0)
    assert data["stable"].values[: turned - 1].all()
    assert not data["stable"].values[turned + 2 :].any()
    assert data.piezomotor.cautions == ("The branch does not reach its end: It comes back to start.",)


@pytest.mark.soak
def test_an_unstable_motion_that_is_disturbed_leaves_to_either_side() -> None:
    at = branch().isel(point=-1)
    drive = DRIVE.model_copy(update={"frequency": float(at["drive.frequency"])})
    plant = Plant(MOTOR, drive, Load(0.0), Law())
    step = Point(MOTOR, DriveSource(drive), Load(0.0), Law()).step
    period_map = PeriodMap(drive.period, ceil(drive.period / step - 1e-9))
    state, motion = at["start_state"].values, np.zeros(plant.order)
    motion[: 2 * plant.modes] = 1e-2
    # in 80 periods 1.15, the largest multiplier, makes 7e4 of 1
    traces = period_map.traces([Copy(plant, state * (1.0 + sign * motion)) for sign in (1.0, -1.0)], 80)
    low, high = sorted(float(trace.forces(plant)[0]) for trace in traces if trace is not None)
    between = float(at["normal_force_n"])
    assert low < 0.95 * between  # in contact
    assert high > 1.5 * between  # hammering


@pytest.mark.soak
def test_the_folds_are_where_sweeps_up_and_down_jump() -> None:
    step = 50.0
    whole = pr.steady_branch(MOTOR, DRIVE, follow="drive.frequency", start=17e3, stop=16.5e3, speed=0.0)
    lower, upper = whole.piezomotor.folds
    down, up = np.arange(17.2e3, 16.39e3, -step), np.arange(16.3e3, 17.11e3, step)
    for fold, frequencies in ((lower, down), (upper, up)):
        motion, separated = None, []
        for frequency in frequencies.tolist():  # each transient continues the one before
            point = Point.of(MOTOR, DRIVE.updated({"frequency": frequency}), speed=0.0)
            outcome, last = settle(Dynamometer(off_beat(point)), motion, Settling(patience=12))
            motion = last.end
            separated.append(outcome["separated"])
        jump = int(np.abs(np.diff(separated)).argmax())
        ends = frequencies[jump : jump + 2]
        assert min(ends) - step <= fold <= max(ends) + step, (fold, ends)  # required: one step


@pytest.mark.slow
@pytest.mark.soak
def test_the_branch_of_a_free_stator_that_softens_is_duffings_curve_through_both_folds() -> None:
    motor = pr.load_motor("bimodal40").updated(SOFTENING)
    mode, voltage = motor.modes[NUMBER], 3.0
    force = voltage * abs(mode.coupling_a_n_per_v - mode.coupling_b_n_per_v)
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=mode.frequency_hz, phase_deg=180.0)
    low, high = 0.9955 * mode.frequency_hz, 0.9975 * mode.frequency_hz
    data = pr.steady_branch(motor, drive, follow="drive.frequency", start=low, stop=high, speed=0.0, contact=None)
    assert data.attrs["ended"] == "It reaches stop."
    exact = duffing.folds(mode, force, low, high)
    assert exact is not None
    # harmonics of γ a²/32 = 3e-4 of the shift by softening, 140 Hz, and the parabola through three points
    assert sorted(data.piezomotor.folds) == pytest.approx(exact, abs=0.5)
    for at in range(data.sizes["point"]):
        frequency, state = float(data["drive.frequency"][at]), data["start_state"].values[at]
        if min(abs(frequency - fold) for fold in exact) < 2.0:
            continue  # two amplitudes meet
        roots = duffing.amplitudes(mode, force, frequency)
        amplitude = np.hypot(state[NUMBER], state[len(motor.modes) + NUMBER] / (2.0 * np.pi * frequency))
        place = int(np.abs(roots - amplitude).argmin())
        assert amplitude == pytest.approx(roots[place], rel=2e-3)  # harmonics, as above
        assert bool(data["stable"][at]) == (place != 1)  # the middle one is unstable


def test_folds_are_the_extrema_of_the_parameter() -> None:
    along = np.linspace(-2.0, 2.0, 30)
    cubic = along**3 - along  # extrema ±2/(3√3) at ∓1/√3
    assert folds(cubic) == pytest.approx([0.3849, -0.3849], abs=1e-3)


def test_wrong_requests_say_what_is_allowed() -> None:
    with pytest.raises(pr.ParameterError, match="start = 30 and stop = 30 are not valid"):
        pr.steady_branch(MOTOR, DRIVE, follow="drive.voltage", start=30.0, stop=30.0)
    with pytest.raises(pr.ParameterError, match="points = 1 is not valid: it must be a whole number from 2 to 400"):
        pr.steady_branch(MOTOR, DRIVE, follow="drive.voltage", start=30.0, stop=20.0, points=1)
    with pytest.raises(pr.ParameterError, match=r"load.speed is given twice. Give it once."):
        pr.steady_branch(MOTOR, DRIVE, follow="load.speed", start=0.0, stop=2.0, speed=1.0)
    words = ["speed-torque", "andersen2002", "--over", "drive.voltage=30,20", "--follow", "drive.voltage"]
    assert run([*words, "--speeds=0,1"]) == 2
