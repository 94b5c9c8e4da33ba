# SPDX-License-Identifier: GPL-3.0-or-later
"""Trackers find the resonance, keep it, and are told apart from those that do not; the loop is as it was designed.

Where the mode alone matters, the tip is free: then resonance and quality factor are the parameters' own.
"""

import re
from functools import cache
from math import atan, atan2, degrees, pi
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest
from PySpice.Spice.Netlist import Circuit

import pyspice_runner as pr
from pyspice_runner.circuit.bench import AC_OPTIONS, Bench
from pyspice_runner.circuit.law import law_of
from pyspice_runner.cli import run
from pyspice_runner.run.kernel import run_bench
from pyspice_runner.run.point import Point, Solver
from pyspice_runner.trackers import tracker as events
from pyspice_runner.trackers.loop import LoopDesign, running_loop
from pyspice_runner.trackers.tracker import Disturbances, LoopFilter, TrackedSource, propose_filter, running_resonance
from tests.said import output, printed
from tools.decks import average_bench

pytestmark = pytest.mark.xdist_group("trackers")

MARGINS = run_path(str(Path(__file__).resolve().parents[2] / "docs" / "tracker_margins.py"))

COARSE = 1.0 / (100.0 * 55.4e3)  # s, a hundredth of the shortest period: edges are seen 3.6° late at worst
FAST = {"period_s": 0.8e-3, "step_hz": 100.0}


@cache
def motor() -> pr.Motor:
    """A light rotor, so that speeds settle within milliseconds."""
    return pr.load_motor("andersen2002").updated({"rotor.inertia_kg_m2": 1e-7})


@cache
def resonance(contact: bool = True) -> float:
    return running_resonance(motor(), drive("pll", frequency=50e3), contact=contact).resonance_hz


def drive(kind: str, **values: Any) -> pr.Tracker:
    return pr.Tracker(**{"kind": kind, "voltage": 50.0, "ratio_b": 2.0, **values})


def tracker(kind: str = "pll", *, contact: bool = True, **values: Any) -> pr.Tracker:
    return drive(kind, **{"frequency": resonance(contact), **values})


# --- locking -------------------------------------------------------------------------------------------------


@pytest.mark.soak
@pytest.mark.parametrize(
    ("kind", "offset", "period", "duration"),
    [("observe-current", -0.03, FAST["period_s"], 17e-3), ("observe-power", 0.03, 0.5e-3, 11e-3)],  # equal steps
)
def test_observers_lock_from_three_per_cent(kind: str, offset: float, period: float, duration: float) -> None:
    chosen = tracker(kind, contact=False, offset=offset, **{**FAST, "period_s": period})
    found = pr.track(motor(), chosen, contact=None, duration=duration, step=COARSE)
    assert found.locked
    # never at rest: two steps to either side at most; coarse steps lower the resonance by (2π/100)²/12
    assert found.end_frequency_hz == pytest.approx((1.0 - 3.3e-4) * resonance(contact=False), abs=2.0 * FAST["step_hz"])


def test_an_untracked_drive_that_is_off_stays_off() -> None:
    found = pr.track(motor(), tracker("none", contact=False, offset=0.03), contact=None, duration=3e-3, step=COARSE)
    assert not found.locked
    assert found.lock_time_s is None
    # the closed form, the coarse steps lowering the resonance by (2π/100)²/12
    mode = motor().modes[1]
    detuned = 1.03 - 1.0 / 1.03 + 2.0 * 3.3e-4
    assert found.phase_deg[-1] == pytest.approx(-degrees(atan(mode.quality_factor * detuned)), abs=0.5)


@pytest.mark.parametrize(
    ("kind", "values", "what"),
    [
        ("pll", {"frequency": 1.1 * 51.7e3}, "a range that excludes the resonance"),
        pytest.param("pll", {"polarity": -1, "offset": 0.01}, "a sign error", marks=pytest.mark.soak),
        pytest.param("pll", {"polarity": -1}, "a sign error, from resonance", marks=pytest.mark.soak),
        pytest.param("observe-current", {"polarity": -1}, "a sign error, from resonance", marks=pytest.mark.soak),
        pytest.param("observe-power", {"polarity": -1, "offset": -0.01}, "a sign error", marks=pytest.mark.soak),
    ],
)
@pytest.mark.soak
def test_a_tracker_that_cannot_lock_is_reported_as_not_locked(kind: str, values: dict[str, Any], what: str) -> None:
    chosen = tracker(kind, **{"contact": False, **({} if kind == "pll" else FAST), **values})
    duration = 4e-3 if kind == "pll" else 10e-3  # a loop that can lock does so within 3 ms
    found = pr.track(motor(), chosen, contact=None, duration=duration, step=COARSE)
    assert not found.locked, what


# --- keeping lock --------------------------------------------------------------------------------------------


@pytest.mark.soak
@pytest.mark.parametrize(
    ("disturb", "values"),
    [
        # half of the stall torque that the next test measures
        ("load", {"load_torque": 0.18e-3, "duration": 5.5e-3}),
        ("preload", {"preload_change": 0.3, "duration": 6e-3}),
        ("preload", {"preload_change": -0.3, "duration": 6e-3}),
        ("temperature", {"drift": -0.02, "drift_time": 10e-3, "contact": None}),
    ],
)
def test_the_phase_locked_loop_keeps_lock(disturb: Any, values: dict[str, Any]) -> None:
    """The drift five times as fast as it must be borne."""
    chosen = tracker(contact="contact" not in values)
    found = pr.track(motor(), chosen, disturb=disturb, begin=3e-3, step=COARSE, **values)
    assert found.locked
    # a ramp of 2 kHz in 10 ms is followed with an error of τ/(loop gain) of it, 7°; coarse edges are 3.6° late at worst
    assert found.rms_phase_error_deg < 8.0
    assert abs(found.residual_detuning_hz) < 30.0
    if disturb == "temperature":
        assert found.end_frequency_hz == pytest.approx(0.98 * found.lag.resonance_hz, abs=40.0)
    elif disturb == "load":
        assert 0.3 * found.speed_before_rad_s < found.speed_lost_rad_s < 0.7 * found.speed_before_rad_s


@pytest.mark.soak
def test_a_drive_that_is_not_tracked_loses_the_resonance_as_it_drifts() -> None:
    chosen = tracker("none", contact=False)
    found = pr.track(
        motor(), chosen, disturb="temperature", contact=None, drift_time=3e-3, begin=2e-3, duration=7e-3, step=COARSE
    )
    assert abs(found.phase_deg[found.time_s < 2e-3][-1]) < 5.0
    assert not found.kept_lock
    assert not found.locked
    detuned = 1.0 / 0.98 - 0.98 + 2.0 * 3.3e-4
    assert found.phase_deg[-1] == pytest.approx(-degrees(atan(motor().modes[1].quality_factor * detuned)), abs=1.0)


# --- the loop as it was designed -----------------------------------------------------------------------------


def free(bandwidth: float, ratio: float, **values: Any) -> pr.Tracker:
    return tracker(contact=False, bandwidth_hz=bandwidth, ripple_ratio=ratio, ratio_b=1.0, **values)


@cache
def design(chosen: pr.Tracker) -> LoopDesign:
    return pr.control_loop(motor(), chosen, contact=False)


def proposed(chosen: pr.Tracker) -> LoopFilter:
    return pr.design(motor(), chosen, contact=False)


@pytest.mark.soak
@pytest.mark.parametrize(("bandwidth", "ratio"), [(250.0, 4.0), (500.0, 2.0), (1000.0, 1.0)])
def test_the_phase_margin_moves_with_the_bandwidth_as_predicted(bandwidth: float, ratio: float) -> None:
    """The pole against ripple stays at 1 kHz. At resonance the margin is 90° less what that pole takes."""
    chosen = free(bandwidth, ratio)
    found = design(chosen)
    assert found.crossover_hz == pytest.approx(bandwidth, rel=1e-3)
    assert found.phase_margin_deg == pytest.approx(90.0 - degrees(atan(1.0 / ratio)), abs=0.1)
    settled = 4e-3 + 12.0 / (2.0 * pi * bandwidth)
    gain = MARGINS["measured_loop_gain"](motor(), chosen, bandwidth, begin=settled, contact=None, cycles=2)
    assert abs(gain) == pytest.approx(1.0, rel=0.05)
    # the phase swings by 8 to 17°, of which a step is 1.8°, and the stator is linear to 3 %
    assert 180.0 + np.degrees(np.angle(gain)) == pytest.approx(found.phase_margin_deg, abs=2.0)


def test_the_loop_gain_off_resonance_is_that_of_the_averaged_circuit() -> None:
    chosen = free(500.0, 6.0, target_deg=-40.0)
    found, lag = design(chosen), running_resonance(motor(), chosen, contact=False)
    bench = Bench(average_bench(chosen, lag, found.loop_filter), AC_OPTIONS)
    sweep = {"variation": "dec", "number_of_points": 100, "start_frequency": 5.0, "stop_frequency": 50e3}
    vectors = run_bench(bench, ["v(control)"], None, "ac", sweep).phasors()
    assert vectors["frequency"].real == pytest.approx(found.frequency_hz, rel=1e-6)
    assert found.gain == pytest.approx(-vectors["v(control)"], rel=1e-4)


# --- the loop gain of the running motor -----------------------------------------------------------------------


def locked(chosen: pr.Tracker, driver: pr.Driver | None = None) -> LoopDesign:
    """The loop gain of a free stator in front of which a tracker is locked."""
    lag = running_resonance(motor(), chosen, contact=False)
    source = TrackedSource(chosen, 1, proposed(chosen), driver)
    volts = pr.TwoPhaseDrive(voltage=chosen.voltage, frequency=lag.resonance_hz, phase_deg=90.0)
    return running_loop(motor(), source, Point.of(motor(), volts, contact=None))


def test_without_a_network_a_free_stator_has_the_loop_of_its_resonance() -> None:
    chosen = free(1000.0, 2.0)
    found, designed = locked(chosen), design(chosen)
    # the other mode, 38 kHz away, moves the sensed phase a little; its current is weighted out but for its loss
    assert found.crossover_hz == pytest.approx(designed.crossover_hz, rel=1e-3)
    assert found.phase_margin_deg == pytest.approx(designed.phase_margin_deg, abs=0.1)
    assert found.sensed_phase_deg == pytest.approx(0.0, abs=1.0)


@pytest.mark.soak
def test_a_loop_gain_that_crosses_1_several_times_has_the_worst_margin() -> None:
    """Of plate40 while it accelerates, by the command without options: 151, 195 and 512 Hz."""
    plate = pr.load_motor(str(Path(__file__).parents[2] / "examples" / "plate40.toml"))
    tracker = pr.Tracker(kind="pll", voltage=100.0, frequency=40093.845, phase_deg=70.0, offset=0.03)
    found = pr.track(plate, tracker, duration=20e-3, averaged=True).loop
    ones = np.flatnonzero((np.abs(found.gain[:-1]) > 1.0) != (np.abs(found.gain[1:]) > 1.0))
    assert len(ones) == 3
    margins = (np.degrees(np.angle(found.gain[ones])) + 360.0) % 360.0 - 180.0
    assert found.phase_margin_deg == pytest.approx(margins.min(), abs=3.0)
    assert found.crossover_hz == pytest.approx(found.frequency_hz[ones[margins.argmin()]], rel=0.03)


def test_a_network_changes_the_loop_of_a_tracker() -> None:
    """1.5 mH at 1.4 kHz: 0.856 and 44.3° by a sine in front of the oscillator, in a transient with edges 0.5° late."""
    coil = {"inductor.inductance": 1.5e-3, "inductor.resistance": 15.0}
    chosen = free(500.0, 6.0).model_copy(update={"ratio_b": 2.0})
    driver = pr.Driver(kind="ideal", network="inductor", voltage=50.0, frequency=51.7e3, settings=coil)
    lag = running_resonance(motor(), chosen, contact=False)
    source = TrackedSource(chosen, 1, proposed(chosen), driver)
    # the pins in lock, by the transient
    volts = pr.TwoPhaseDrive(voltage=53.494, ratio_b=2.25022, phase_deg=-9.1287, frequency=lag.resonance_hz)
    found = running_loop(motor(), source, Point.of(motor(), volts, contact=None))
    gain = np.exp(np.interp(np.log(1438.0), np.log(found.frequency_hz), np.log(np.abs(found.gain))))
    margin = 180.0 + np.interp(1438.0, found.frequency_hz, np.degrees(np.unwrap(np.angle(found.gain))))
    assert gain == pytest.approx(0.856, rel=0.02)
    assert (margin + 180.0) % 360.0 - 180.0 == pytest.approx(44.3, abs=1.0)


@pytest.mark.soak
@pytest.mark.parametrize("name", MARGINS["CASES"])
def test_the_margin_that_is_printed_is_the_one_that_is_measured(name: str) -> None:
    """±3° and 5 % of the crossover; a finite sine and the detector's edges take some of both."""
    found = MARGINS["measured"](MARGINS["CASES"][name])
    (printed_hz, printed_deg), (measured_hz, measured_deg) = found.printed, found.measured
    assert printed_hz == pytest.approx(measured_hz, rel=0.05)
    assert printed_deg == pytest.approx(measured_deg, abs=3.0)


@pytest.mark.soak
def test_copies_that_follow_the_temperature_keep_the_phase() -> None:
    """125 K; the difference of both runs is the drift per kelvin that the result states, for small angles."""
    chosen, warm = tracker(contact=False), pr.Thermal()
    settings: dict[str, Any] = {"disturb": "temperature", "drift": -0.02, "drift_time": 10e-3, "begin": 2e-3}
    errors = []
    for drift in (0.0, warm.capacitance_drift_per_k):
        following = chosen.model_copy(update={"copies_drift_per_k": drift})
        found = pr.track(motor(), following, contact=None, thermal=warm, step=0.5 * COARSE, **settings)
        errors.append(found.static_phase_error_deg)
        if not drift:
            expected = 125.0 * found.sensing.phase_drift_deg_per_k
    # a step is 1.8° of a period, of which the mean over a run of periods sees a tenth, in both runs; measured 0.24°
    assert errors[0] - errors[1] == pytest.approx(expected, abs=0.5)


# --- behind a bridge -------------------------------------------------------------------------------------------

LLCC = {
    "series_inductance": 6.8e-3, "series_capacitance": 2.2e-9, "series_resistance": 17.4,
    "parallel_inductance": 68e-3, "parallel_resistance": 174.0,
}  # fmt: skip


def bridged(duration: float, *supply: tuple[float, float]) -> dict[str, Any]:
    """Rails, force and velocity of the flagship behind half bridges, under changes of the supply."""
    flagship = pr.load_motor("bimodal40")
    settings = {f"llcc_{group}.{name}": value for group in "ab" for name, value in LLCC.items()}
    driver = pr.Driver(
        kind="half-bridge", network="llcc", voltage=62.0, frequency=40.684e3, phase_deg=92.0, settings=settings
    )
    chosen = pr.Tracker(kind="pll", voltage=60.0, frequency=40.684e3, offset=0.03)
    lag = running_resonance(flagship, chosen)
    dips = tuple(events.Disturbance(kind="supply", begin_s=at, supply_change=change) for at, change in supply)
    source = TrackedSource(
        chosen, 3, propose_filter(chosen, lag), driver, Disturbances(dips or (events.Disturbance(kind="start"),))
    )
    vectors = ["v(vp_a)", "v(vn_a)", "v(tuned)", "v(force)", "v(ahead)", "i(v.xmotor.xmode4.vvelocity)"]
    setup = Point(flagship, source, pr.Load(None), law_of("spring-slider", flagship.law), Solver())
    return setup.run(duration, vectors).vectors()


def lead(found: dict[str, Any], begin: float, end: float) -> float:
    """Phase in degrees of the velocity ahead of the force, mean from begin to end in s."""
    time, force, ahead, velocity = (
        found[name] for name in ("time", "v(force)", "v(ahead)", "i(v.xmotor.xmode4.vvelocity)")
    )
    late = (time > begin) & (time < end)
    parts = (float(np.trapezoid(part[late] * velocity[late], time[late])) for part in (ahead, force))
    return degrees(atan2(*parts))


def test_the_flagship_starts_behind_a_bridge() -> None:
    """A body diode breaks off where the other transistor turns on; a control for 3e-15 C ended the run at 30 µs."""
    found = bridged(0.4e-3)
    assert found["time"][-1] == pytest.approx(0.4e-3)


@pytest.mark.soak
def test_a_loop_behind_a_bridge_keeps_lock_through_a_dip_of_the_supply() -> None:
    found = bridged(12e-3, (5e-3, -0.4), (8e-3, 0.0))
    span = np.interp([4.9e-3, 7.9e-3, 11.9e-3], found["time"], found["v(vp_a)"] - found["v(vn_a)"])
    assert span[1:] / span[0] == pytest.approx([0.6, 1.0], rel=1e-3)
    assert [lead(found, at - 0.5e-3, at) for at in (5e-3, 8e-3, 12e-3)] == pytest.approx([0.0] * 3, abs=20.0)


def test_the_filters_behind_a_bridge_are_those_of_the_loop_gain() -> None:
    driver = pr.Driver(kind="half-bridge", voltage=62.0, frequency=40e3)
    source = TrackedSource(drive("pll", frequency=40e3), 1, LoopFilter(1e5, 1e-9, 1e-10), driver)
    circuit = Circuit("low-pass filters")
    circuit.raw_spice += "Vmotional motional 0 AC 1\nVforce force 0 AC 1\n"
    names = [f"v({name})" for name in source._add_low_passes(circuit)]
    sweep = {"variation": "lin", "number_of_points": 4, "start_frequency": 40e3, "stop_frequency": 160e3}
    found = run_bench(Bench(circuit, AC_OPTIONS), names, None, "ac", sweep).phasors()
    for name, rate in zip(names, (0.0, 0.0, 1.0), strict=True):  # the last is the rate, over 2π 40 kHz
        passed = found[name] / (1j * found["frequency"].real / 40e3) ** rate
        assert passed == pytest.approx(source.low_pass(found["frequency"].real), rel=1e-6)


# --- refusals, files, the command ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"disturb": "earthquake"}, "disturb = 'earthquake' is not valid: it must be 'start', 'target', 'load'"),
        ({"mode": 2}, "mode = 2 is not valid; andersen2002 has the modes 0 to 1."),
        ({"disturb": "load", "contact": None}, "disturb = 'load' needs a rotor"),
        ({"disturb": "load", "speed": 1.0}, "speed and disturb = 'load' exclude each other"),
        ({"disturb": "load", "disturbances": [events.Disturbance(kind="load")]}, "disturbances exclude each other"),
        ({"speed": 2e5}, "above which its rim bursts"),
        ({"disturb": "preload", "preload_change": -1.0}, "preload_change = -1 is not valid: it must be a"),
        ({"disturb": "temperature", "drift": 0.5}, "drift = 0.5 is not valid"),
        ({"step": 1e-6}, "step = 1e-06 s is too coarse"),
        ({"duration": 1e-6}, "duration = 1e-06 s is not valid"),
        ({"disturb": "load", "load_torque": 1e-4, "duration": 5e-3}, "Give at least 0.008"),
    ],
)
def test_errors_name_the_value(settings: dict[str, Any], sentence: str) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        pr.track(motor(), tracker(), **settings)


def test_the_command_tracks_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["track", "andersen2002", "--contact", "none"]
    files = ["--output", str(tmp_path / "track.csv"), "--plot", str(tmp_path / "track.png")]
    found = printed([*words, "--duration", "3e-3", *files], capsys)
    assert found["locked"] is True
    assert {"lock_time_s", "rms_phase_error_deg", "residual_detuning_hz", "speed_lost_rad_s", "loop"} <= set(found)
    header, *rows = (tmp_path / "track.csv").read_text(encoding="utf-8").splitlines()
    assert header == "time_s,frequency_hz,phase_deg,rotor_speed_rad_s"
    assert len(rows) == found["periods"]
    assert (tmp_path / "track.png").stat().st_size > 20_000
    shown = output([*words, "--duration", "2e-3", "--reverse"], capsys)
    assert "no" in shown.split("lock time")[0]
    assert run(["track", "andersen2002", "--tracker", "none", "--disturb", "target"]) == 2
    assert "only a pll has a target" in " ".join(capsys.readouterr().err.split())


def test_a_run_of_fewer_periods_than_are_averaged_is_rejected_before_it_begins() -> None:
    tracker = pr.Tracker(kind="observe-current", voltage=20.0, frequency=13.5e3)
    with pytest.raises(pr.ParameterError, match=r"duration = 0\.0022 s is not valid: it must be from 0\.00335 s, 40"):
        pr.track(pr.load_motor("andersen2002"), tracker, mode=0, duration=2.2e-3)


def test_a_run_shorter_than_the_mode_takes_to_build_up_says_so() -> None:
    ringing = motor().updated({"modes.1.quality_factor": 2e4})
    chosen = pr.Tracker(kind="pll", voltage=5.0, frequency=ringing.modes[1].frequency_hz, bandwidth_hz=800.0)
    found = pr.track(ringing, chosen, 2e-3, contact=None, step=COARSE)
    assert "shorter than 3 time constants of the mode" in found.cautions[0]


def test_a_run_that_is_too_short_is_refused_before_the_stall_torque_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pyspice_runner.trackers.track._stall_torque", lambda *_: pytest.fail("it has run"))
    base = pr.load_motor("bimodal40")
    chosen = pr.Tracker(kind="pll", voltage=100.0, frequency=40.7e3)
    for averaged, duration, message in (
        (False, 1e-3, "duration = 0.001 s is not valid"),
        (False, 3e-3, "does not show the disturbance"),
        (True, 1e-3, "does not show the disturbance"),
    ):
        with pytest.raises(pr.ParameterError, match=message):
            pr.track(base, chosen, disturb="load", duration=duration, averaged=averaged)
