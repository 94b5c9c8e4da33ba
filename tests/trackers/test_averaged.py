# SPDX-License-Identifier: GPL-3.0-or-later
"""A tracker in front of the averaged motor: the loop of the full motor, over minutes."""

from __future__ import annotations

import json
import re
from itertools import product
from time import process_time
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.averaged.library import OPTIONS
from pyspice_runner.cli import run
from pyspice_runner.spice import Engine
from pyspice_runner.trackers.tracker import CHANGED, Disturbance, running_resonance
from tests.motors import BEAM40, recommended
from tests.runs import unestimated
from tests.said import printed
from tests.selection import mostly

ENGINES: tuple[Engine, ...] = ("compiled", "spice")
pytestmark = pytest.mark.xdist_group("trackers")


def tracker(motor: pr.Motor, **values: Any) -> pr.Tracker:
    drive = pr.Tracker(**{"kind": "pll", "voltage": 50.0, "ratio_b": 2.0, "frequency": 50e3, **values})
    return drive.model_copy(update={"frequency": running_resonance(motor, drive).resonance_hz})


@pytest.fixture(scope="module")
def motor() -> pr.Motor:
    """A light rotor, as in the tests of the full motor; at a fixed distance."""
    return pr.load_motor("andersen2002").updated({"mount": None, "rotor.inertia_kg_m2": 1e-7})


@pytest.mark.soak
def test_the_first_milliseconds_are_those_of_the_full_motor(motor: pr.Motor) -> None:
    """3 % RMS of the speed reached; the frequency within 0.1 %, a few of the steps by which an edge is seen late."""
    chosen = tracker(motor, offset=0.03)
    full, averaged = (
        pr.track(motor, chosen, duration=3.2e-3, averaged=averaged, margin=False) for averaged in (False, True)
    )
    assert averaged.locked
    assert full.locked
    assert full.lock_time_s < 3e-3
    # harmonic balance leaves out the other mode and the turning rotor; 1/200 of a period is 1.8°, or 18 Hz
    assert full.end_frequency_hz == pytest.approx(chosen.frequency, abs=30.0)
    assert abs(full.residual_detuning_hz) < 20.0
    at = np.linspace(0.3e-3, 3.1e-3, 100)
    speeds = [np.interp(at, found.time_s, found.rotor_speed_rad_s) for found in (full, averaged)]
    assert np.sqrt(np.mean((speeds[0] - speeds[1]) ** 2)) <= 0.03 * speeds[0].max()
    frequencies = [np.interp(at, found.time_s, found.frequency_hz) for found in (full, averaged)]
    assert np.sqrt(np.mean((frequencies[0] / frequencies[1] - 1.0) ** 2)) <= 1e-3


def test_the_loop_has_the_phase_margin_that_was_measured_on_the_full_motor(motor: pr.Motor) -> None:
    """63.8°, by a sine in front of the oscillator (docs/tracking.md), whose detector sees edges up to 1.8° late."""
    found = pr.track(motor, tracker(motor, bandwidth_hz=1e3, ripple_ratio=2.0), averaged=True)
    assert found.loop.phase_margin_deg == pytest.approx(63.8, abs=1.8)
    assert found.loop.crossover_hz == pytest.approx(1e3, rel=0.02)


WARM_UP: dict[str, Any] = {"disturb": "warm-up", "duration": 600.0}
# what both engines give at the end: settled in the warm-up and at a held shaft; the load still slows the rotor
DISTURBED = {"warm-up": WARM_UP, "held": {"duration": 0.05, "speed": 20.0}}
CHANGING = {
    "load": {"disturb": "load", "load_torque": 0.01}, "target": {"disturb": "target"},
    "temperature": {"disturb": "temperature"},
}  # fmt: skip


def beam40_tracked(engine: Engine, **settings: Any) -> pr.Tracking:
    motor, drive = recommended(BEAM40)
    chosen = pr.Tracker(
        kind="pll", voltage=drive.voltage, phase_deg=drive.phase_deg, frequency=40.5e3, target_deg=-20.0
    )
    return pr.track(motor, chosen, averaged=True, engine=engine, **settings)


@pytest.mark.parametrize("name", [pytest.param("warm-up"), pytest.param("held", marks=pytest.mark.soak)])
@pytest.mark.soak
def test_the_compiled_motor_ends_where_ngspice_does(name: str) -> None:
    """Speed, temperature and frequency within 0.1 %, which the 50 long steps of ngspice leave; the loop likewise."""
    ours, theirs = (beam40_tracked(engine, **DISTURBED[name]) for engine in ENGINES)
    assert ours.ngspice_version is None
    assert ours.locked
    assert theirs.locked
    for column in ("rotor_speed_rad_s", "frequency_hz", "temperature_k"):
        end, reference = (float(found.columns()[column][-1]) for found in (ours, theirs))
        assert end == pytest.approx(reference, rel=1e-3), column
    assert ours.static_phase_error_deg == pytest.approx(theirs.static_phase_error_deg, abs=0.05)
    assert ours.loop.crossover_hz == pytest.approx(theirs.loop.crossover_hz, rel=1e-3)
    assert ours.loop.phase_margin_deg == pytest.approx(theirs.loop.phase_margin_deg, abs=0.05)
    assert ours.sensing.phase_drift_deg_per_k == pytest.approx(theirs.sensing.phase_drift_deg_per_k, rel=1e-3)
    assert ours.ceramic["ceramic_stress_pa"] == pytest.approx(theirs.ceramic["ceramic_stress_pa"], rel=1e-3)


@pytest.mark.soak
@pytest.mark.parametrize("name", CHANGING)
def test_the_compiled_motor_follows_a_disturbance_as_ngspice_with_short_steps_does(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.2 % RMS of the range of the speed: a tenth of it is the error of the compiled motor's own steps."""
    ours = beam40_tracked("compiled", margin=False, **CHANGING[name])
    monkeypatch.setitem(OPTIONS, "trtol", "1")
    monkeypatch.setitem(OPTIONS, "reltol", "1e-4")
    theirs = beam40_tracked("spice", margin=False, **CHANGING[name])
    at = np.linspace(0.0, theirs.time_s[-1], 4000)
    speed, reference = (np.interp(at, found.time_s, found.rotor_speed_rad_s) for found in (ours, theirs))
    assert np.sqrt(np.mean((speed - reference) ** 2)) < 2e-3 * np.ptp(reference)


def test_ten_minutes_of_warm_up_take_less_than_a_second(motor: pr.Motor) -> None:
    """The frequency follows the temperature by the coefficient of the thermal model; copies that drift along."""
    thermal = pr.Thermal(capacitance_drift_per_k=0.0, coupling_drift_per_k=0.0)
    begun = process_time()
    chosen = tracker(motor, voltage=25.0)
    found = pr.track(motor, chosen, thermal=thermal, averaged=True, **WARM_UP)
    if found.ngspice_version is None:
        assert process_time() - begun < 1.0
    assert found.locked
    rise = float(found.temperature_k[-1])
    assert rise > 20.0
    early = float(np.interp(0.1, found.time_s, found.frequency_hz))
    drift = thermal.frequency_drift_per_k * rise
    # the static stiffness of the contact does not drift: 1 % of that of the mode
    assert found.frequency_hz[-1] / early - 1.0 == pytest.approx(drift, rel=0.02)


def started(settings: dict[str, Any], *, estimated: bool = False, **tracker: Any) -> pr.Tracking:
    chosen = pr.Tracker(**{"kind": "pll", "voltage": 70.0, "frequency": 40.73e3, "target_deg": -30.0, **tracker})
    found = pr.track(pr.load_motor("bimodal40"), chosen, **{"averaged": True, "margin": False, **settings})
    return found if estimated else unestimated(found)


@pytest.mark.parametrize("target", mostly(pytest.mark.soak, [-60.0, -30.0, 0.0], [0.0]))
def test_a_loop_locks_from_either_side_whatever_its_target(target: float) -> None:
    """From 39 kHz, where the motor sticks and its current leads by nearly 90°, and from 42.5 kHz."""
    for voltage, offset in product((25.0, 150.0), (-0.0425, 0.0435)):
        found = started({"duration": 20e-3}, voltage=voltage, target_deg=target, offset=offset)
        assert found.locked, (voltage, offset)
        assert "The tracker" not in " ".join(found.cautions)


@pytest.mark.soak
def test_full_motor_and_both_averaged_ones_lock_from_below_alike() -> None:
    found = [started({"averaged": False}, offset=-0.0376), *(started({"engine": e}, offset=-0.0376) for e in ENGINES)]
    assert all(one.locked for one in found)
    assert np.ptp([one.end_frequency_hz for one in found]) < 10.0


@pytest.mark.parametrize(
    ("tracker", "settings", "caution"),
    [
        ({"polarity": -1, "offset": -0.03}, {}, r"has not locked: it ended at 37\.87\d* kHz, the limit .*offset.*span"),
        (
            {"offset": -0.03},
            {"duration": 1.2e-3},
            r"has not locked: it ended at 4\S+ kHz, -?\d\S*° from .* Run it longer",
        ),
        ({"span": 0.01}, {"disturb": "temperature"}, r"has lost lock: it ended at 40\.32\d* kHz, the limit .*span"),
    ],
)
def test_a_run_that_ends_at_a_rail_or_without_lock_says_so(tracker: Any, settings: Any, caution: str) -> None:
    found = started(settings, **tracker)
    assert not found.locked
    assert re.search(caution, " ".join(found.cautions))


def test_a_loop_that_an_overload_has_pulled_out_returns_by_a_restart() -> None:
    """0.1 N·m from 30 to 60 ms, with copies of the clamped capacitances that are 60 % too small."""
    load = [Disturbance(kind="load", begin_s=at, load_torque_n_m=torque) for at, torque in ((30e-3, 0.1), (60e-3, 0))]
    chosen = {"voltage": 110.0, "target_deg": -35.0, "capacitance_error": -0.6}
    settings = {"duration": 120e-3, "disturbances": load}
    without, found = (started(settings, restart=restart, **chosen) for restart in (False, True))
    assert [one.regained_s for one in without.losses] == [None]
    assert "lost lock: at 4" in " ".join(without.cautions)
    assert (without.locked, found.locked, found.kept_lock) == (False, True, False)
    (lost,) = found.losses
    assert 30e-3 < lost.lost_s < found.restarts_s[0] < (lost.regained_s or 0.0) < 80e-3
    assert found.to_dict()["losses"][0]["lost_hz"] == lost.lost_hz
    assert lost.pull_out == {"load": 0.1}
    assert "kHz, load 0.1, regained at" in found.summary()["lock lost"]
    assert found.speed_after_rad_s > found.speed_before_rad_s > 50.0


@pytest.mark.parametrize(
    "how",
    [
        {"engine": "compiled"},
        {"engine": "spice"},
        pytest.param({"averaged": False, "duration": 2.5e-3}, marks=pytest.mark.soak),
    ],
)
def test_a_restart_returns_to_the_starting_frequency(how: dict[str, Any]) -> None:
    """A slow loop 4 % above resonance: after 1 ms without lock it is held at its start, which it has left by 70 Hz."""
    chosen = {"bandwidth_hz": 50.0, "offset": 0.04, "lost_share": 0.5, "restart_after_s": 1e-3}
    found = started({"duration": 2.1e-3, **how}, **chosen)
    assert found.restarts_s == pytest.approx((1e-3,), abs=0.1e-3)
    early, late = np.interp([0.75e-3, 2e-3], found.time_s, found.frequency_hz) - 1.04 * 40.73e3
    assert early < -50.0
    assert abs(late) < 10.0


def test_an_overload_of_a_loop_with_right_copies_loses_lock_and_regains_it() -> None:
    """1.26 of the friction times the preload, at −58.5°; lock is regained under the load, 30 Hz lower."""
    load = [Disturbance(kind="load", begin_s=at, load_torque_n_m=to) for at, to in ((30e-3, 0.104), (60e-3, 0.0))]
    found = started({"duration": 120e-3, "disturbances": load}, voltage=78.6, target_deg=-58.5)
    (lost,) = found.losses
    assert (found.locked, lost.pull_out["load"]) == (True, 0.104)
    assert lost.regained_s < 60e-3


def test_the_load_of_a_loop_has_no_hysteresis() -> None:
    """From both sides of 40.0 to 40.6 kHz, where a drive of constant frequency has two states at 70 V."""
    load = [Disturbance(kind="load", begin_s=2e-3, load_torque_n_m=0.0825)]
    ends = [
        started({"duration": 40e-3, "disturbances": load}, target_deg=0.0, offset=offset).end_frequency_hz
        for offset in (-0.0375, -0.01, 0.0385)
    ]
    assert np.ptp(ends) < 5.0


def test_without_a_compiler_a_loop_starts_at_the_middle_of_its_range() -> None:
    found, compiled = (started({"duration": 2e-3, "engine": engine}, offset=0.0) for engine in ("spice", "compiled"))
    assert found.end_frequency_hz == pytest.approx(compiled.end_frequency_hz, rel=1e-3)
    assert found.speed_after_rad_s == pytest.approx(compiled.speed_after_rad_s, rel=5e-3)


def test_a_run_that_stays_locked_is_the_same_with_and_without_a_restart() -> None:
    settings = {"disturb": "load", "load_torque": 50e-3, "begin": 20e-3, "duration": 60e-3}
    found, without = (started(settings, restart=restart) for restart in (True, False))
    assert (found.kept_lock, found.restarts_s) == (True, ())
    assert found.speed_after_rad_s == pytest.approx(without.speed_after_rad_s, rel=1e-3)


def test_a_run_has_a_sequence_of_disturbances() -> None:
    """The frequency moves with each, and returns."""
    moves = (("load", 50e-3, 30), ("supply", -0.5, 70), ("preload", 0.5, 110), ("temperature", -5e-3, 150))
    events = [
        Disturbance(**{"kind": kind, "begin_s": 1e-3 * begin, CHANGED[kind]: to, "drift_time_s": 5e-3})
        for kind, changed, at in moves for to, begin in ((changed, at), (0.0, at + 20))
    ]  # fmt: skip
    found = started({"disturbances": events, "duration": 190e-3})
    for *_, at in moves:
        before, during, after = np.interp([at, at + 19, at + 39], 1e3 * found.time_s, found.frequency_hz)
        assert abs(during - before) > 5.0
        assert after == pytest.approx(before, abs=0.4 * abs(during - before) + 2.0)


def test_a_disturbance_begins_where_the_last_one_of_its_kind_ends() -> None:
    """The sum of 10 and 50 ms is above 60 ms by rounding. The run has an estimate of its errors."""
    rise = Disturbance(kind="temperature", begin_s=10e-3, drift=-5e-3)
    drifts = [rise, rise.updated({"begin_s": 60e-3, "drift": 0.0})]
    found = started({"disturbances": drifts, "duration": 0.12}, estimated=True)
    assert found.temperature_k is not None
    at = np.interp([10e-3, 60e-3, 110e-3], found.time_s, found.temperature_k)
    assert at == pytest.approx([0.0, rise.value, 0.0], abs=0.1)
    assert found.trusted


def test_modes_that_two_groups_cannot_separate_have_a_caution() -> None:
    said = [" ".join(started({"mode": mode, "duration": 2e-3}).cautions) for mode in range(4)]
    assert ["cannot separate" in one for one in said] == [True, True, False, False]


def test_a_loop_that_oscillates_says_so_and_what_it_advises_helps() -> None:
    """The plate at 46 V and -48° from 40.35 kHz: its frequency goes up and down by a kilohertz."""
    plate = pr.load_motor("examples/plate40.toml")
    values = {"voltage": 46.14, "frequency": 40903.0, "offset": -0.0136, "target_deg": -47.6, "phase_deg": 70.0}
    chosen = pr.Tracker(kind="pll", **values)
    trackers = [chosen.model_copy(update=one) for one in ({}, {"voltage": 70.0}, {"target_deg": 0.0})]
    runs = [unestimated(pr.track(plate, one, 40e-3, averaged=True, margin=False)) for one in trackers]
    assert [one.locked for one in runs] == [False, True, True]
    assert "It oscillates from 4" in " ".join(runs[0].cautions)
    # at 50 V and -30° under a load its phase swings by 8°: it stays locked
    hunting = chosen.model_copy(update={"voltage": 50.0, "frequency": 40740.7, "offset": 0.0, "target_deg": -30.0})
    load = {"disturb": "load", "load_torque": -1.416, "averaged": True, "margin": False}
    swings = [unestimated(pr.track(plate, hunting.updated({"voltage": volts}), 0.1, **load)) for volts in (50.0, 100.0)]
    assert ["The loop hunts to the end, from 40." in " ".join(one.cautions) for one in swings] == [True, False]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"disturb": "preload", "engine": "spice"}, "disturb = 'preload' has no averaged model in ngspice"),
        ({"contact": None}, "contact = None has no averaged model"),
        ({"step": 1e-7}, "step has no effect"),
        ({"duration": 1e-6}, "duration = 1e-06 s is not valid"),
        ({"disturb": "warm-up", "averaged": False}, "give averaged=True"),
        ({"averaged": False, "engine": "compiled"}, "engine = 'compiled' has no tracker for the full motor"),
    ],
)
def test_what_has_no_averaged_model_is_an_error(motor: pr.Motor, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(pr.ParameterError, match=message):
        pr.track(motor, tracker(motor), **{"averaged": True, **changes})


@pytest.mark.soak
def test_fixed_copies_of_the_capacitances_move_the_phase_as_stated_and_warm_ones_do_not() -> None:
    motor, drive = recommended(BEAM40)
    cold = pr.Tracker(kind="pll", voltage=drive.voltage, phase_deg=drive.phase_deg, frequency=40.5e3, target_deg=-20.0)
    warm = cold.model_copy(update={"copies_drift_per_k": pr.Thermal.of(motor).capacitance_drift_per_k})
    settings: dict[str, Any] = {"disturb": "warm-up", "duration": 600.0, "averaged": True, "margin": False}
    fixed, following = (pr.track(motor, one, **settings) for one in (cold, warm))
    # the drift per kelvin is that at the end; the ratio of both currents changes by some per cent on the way
    stated = fixed.sensing.phase_drift_deg_per_k * float(fixed.temperature_k[-1])
    assert fixed.static_phase_error_deg == pytest.approx(stated, rel=0.05)
    assert abs(stated) > 3.0
    # what the copy of a loss that is constant over frequency leaves: a hundredth of the drift
    assert abs(following.static_phase_error_deg) < 0.1


def test_the_flagship_is_tracked_within_its_limits_by_default(capsys: pytest.CaptureFixture[str]) -> None:
    """100 V beside the resonance; at resonance, where 100 V stress the ceramic to 52 MPa of 41, the same amplitude."""
    found = printed(["track", "bimodal40", "--averaged", "--duration", "0.2"], capsys)
    assert found["tracker"]["voltage"] == pytest.approx(62.3, abs=0.1)
    assert (found["locked"], found["cautions"]) == (True, [])


@pytest.mark.soak
def test_the_command_states_temperature_and_check(capsys: pytest.CaptureFixture[str]) -> None:
    command = f"track {BEAM40} --averaged --voltage 110 --disturb warm-up --target -20 --duration 60 --json"
    assert run(command.split()) == 0
    told = capsys.readouterr()
    found = json.loads(told.out)
    assert found["locked"]
    assert found["temperature_k"] > 10.0
    assert found["run"]["averaged"]
    assert "against the full motor" not in told.err  # the contact opens, the error is small
    assert printed(["track", "andersen2002", "--averaged", "--mode", "bending-1"], capsys)["run"]["mode"] == 0
    margins = []
    for engine in ENGINES:
        assert run(["track", "andersen2002", "--averaged", "--engine", engine, "--json"]) == 0
        margins.append(json.loads(capsys.readouterr().out)["loop"]["phase_margin_deg"])
    assert margins[0] == pytest.approx(margins[1], abs=0.1)
