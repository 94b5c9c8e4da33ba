# SPDX-License-Identifier: GPL-3.0-or-later
"""Loops designed from small signals, against modulation of the running loop, on the averaged and the full motor."""

import json
from dataclasses import replace
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.control.loop import PHASES_OF_PLANT, LoopController, over_amplitudes
from tests.motors import BEAM40, recommended
from tests.runs import unestimated

PLATE = str(Path(__file__).resolve().parents[2] / "examples" / "plate40.toml")

MEASURED = run_path(str(Path(__file__).resolve().parents[2] / "docs" / "averaged_loops.py"))
DESIGNS: dict[str, dict[str, Any]] = MEASURED["DESIGNS"]
injected, difference = MEASURED["injected"], MEASURED["difference"]
FINE: dict[str, Any] = {"start": "steady", "phases": PHASES_OF_PLANT}


@pytest.fixture(scope="module")
def motor() -> pr.Motor:
    return pr.load_motor("bimodal40")


@pytest.fixture(scope="module")
def drive(motor: pr.Motor) -> pr.TwoPhaseDrive:
    return pr.default_drive(motor).model_copy(update={"voltage": 60.0})


@pytest.mark.parametrize("name", DESIGNS)
def test_a_designed_loop_has_the_crossover_and_margin_that_modulation_measures(
    name: str, motor: pr.Motor, drive: pr.TwoPhaseDrive
) -> None:
    """1 % and 1° for a modulation that is not infinitely small; the step response by small signals within 2.5 %.

    By as many phases as those of the plant: the 64 of a run change it by 2 %, off the full motor.
    """
    wanted = DESIGNS[name]
    loop = pr.control_loop(motor, drive, **wanted)
    assert loop.crossover_hz == pytest.approx(wanted["crossover"], rel=1e-3)  # the grid of the loop gain
    assert loop.phase_margin_deg == pytest.approx(wanted["margin"], abs=0.1)
    crossover, margin = difference(loop, injected(loop, motor, drive, settles=0.1, **FINE))
    assert abs(crossover) <= 0.01
    assert abs(margin) <= 1.0
    assert np.abs(loop.step_predicted - loop.step_simulated).max() <= 0.025
    assert loop.overshoot == pytest.approx(loop.overshoot_simulated, abs=0.01)
    if name == "slow speed":  # the estimate takes a second; of the others the soak reads it
        assert loop.trusted


@pytest.mark.soak
@pytest.mark.parametrize("name", DESIGNS)
def test_the_full_motor_has_the_crossover_and_margin_of_the_design(
    name: str, motor: pr.Motor, drive: pr.TwoPhaseDrive
) -> None:
    """5 % and 3°: the averaged motor's own speed is 1 % from that of the full motor there."""
    wanted, found = DESIGNS[name], MEASURED["margins"](name)
    assert pr.control_loop(motor, drive, **wanted).trusted
    assert found["crossover_hz"] == pytest.approx(wanted["crossover"], rel=0.05)
    assert found["margin_deg"] == pytest.approx(wanted["margin"], abs=3.0)


def test_the_slow_gain_of_the_plant_is_that_of_two_steady_states(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> None:
    """Half a per cent: the curvature of the speed over 0.2 V."""
    loop = pr.control_loop(motor, drive, **DESIGNS["slow speed"])
    runs = [
        pr.simulate_averaged(motor, drive.model_copy(update={"voltage": volts}), 1.0, phases=PHASES_OF_PLANT)
        for volts in (59.9, 60.1)
    ]
    low, high = (run.rotor_speed_rad_s[-1] for run in runs)
    assert abs(loop.plant[0]) == pytest.approx((high - low) / 0.2, rel=5e-3)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"crossover": 5e3}, pr.ParameterError, r"crossover = 5000 Hz is not valid: it must be from 0.16 to 800 Hz"),
        ({"crossover": 1e-9}, pr.ParameterError, r"crossover = 1e-09 Hz is not valid: it must be from 0.16 to 800 Hz"),
        ({"mode": 1}, pr.ParameterError, "control_loop: mode and contact are those of a tracker"),
        ({"margin": 200.0}, pr.ParameterError, "margin = 200 ° is not valid: it must be from 5 to 120°"),
        ({"sample_time": 1e-6}, pr.ParameterError, "at least one period of the drive"),
        ({"crossover": 300.0, "margin": 90.0}, pr.ParameterError, r"is not possible: a PI controller gives .* to .*°"),
        (
            {"crossover": 700.0, "margin": None},
            pr.ParameterError,
            r"700 Hz is not possible: crossovers from .* are possible",
        ),
        ({"quantity": "torque"}, pr.ParameterError, "quantity"),
        ({"torque": 1.0}, pr.ParameterError, "control_loop: there is no argument 'torque'"),
    ],
)
def test_a_loop_that_cannot_be_is_an_error(
    changes: dict[str, Any], error: type[Exception], message: str, motor: pr.Motor, drive: pr.TwoPhaseDrive
) -> None:
    with pytest.raises(error, match=message):
        pr.control_loop(motor, drive, **(DESIGNS["slow speed"] | changes))


@pytest.mark.parametrize("name", ["bimodal40", PLATE])
@pytest.mark.parametrize("quantity", ["speed", "position", "phase"])
def test_a_loop_without_options_has_margins_that_modulation_measures(name: str, quantity: Any) -> None:
    """5 % and 3°, of the plate by sines of 2 %: the contact is open for 62 %, and its small signals jump."""
    motor, drive = recommended(name)
    loop = pr.control_loop(motor, drive, quantity=quantity)
    assert loop.phase_margin_deg == pytest.approx(60.0, abs=0.1)
    assert loop.gain_margin_db >= 6.0
    units = {"speed": "V·s/rad", "position": "V/rad", "phase": "Hz/deg"}
    assert loop.gain_units["proportional"] == units[quantity].replace("rad", "m" if motor.slider else "rad")
    size = 4.0 if motor.slider and quantity != "phase" else 1.0
    crossover, margin = difference(loop, injected(loop, motor, drive, settles=0.3, size=size, **FINE))
    assert abs(crossover) <= 0.05
    assert abs(margin) <= 3.0
    given = pr.control_loop(motor, drive, quantity=quantity, crossover=loop.crossover_hz, margin=60.0)
    assert given.gains == pytest.approx(loop.gains, rel=1e-3)


def test_a_position_loop_rests_within_a_step_of_the_encoder_and_a_hunting_one_has_a_caution(motor: pr.Motor) -> None:
    drive = pr.default_drive(motor)
    loop = pr.control_loop(motor, drive, quantity="position")
    still = drive.model_copy(update={"voltage": 0.0})
    # an ideal encoder has no step, hence no dead zone unless it is given
    for lines, target, zone in ((5000, 0.05, None), (5000, -0.05, None), (0, 0.05, None), (0, 0.05, 2e-3)):
        controller = LoopController(loop, lambda time, target=target: target * (time > 1e-3), zone)
        electronics = pr.Electronics(encoder_lines=lines)
        run = unestimated(
            pr.simulate_controlled(motor, still, controller, 0.3, sample_time=0.5e-3, electronics=electronics)
        )
        tail = run.position_rad[-100:]
        hunts = any("The rotor hunts: it turns back" in caution for caution in run.cautions)
        assert hunts == (not lines and not zone) == (np.ptp(tail) > 1e-3)
        if not hunts:
            assert abs(tail[-1] - target) <= 1.01 * (zone or run.provenance["run"]["resolution"]["position_rad"])
            assert run.voltage_a_v[-1] == 0.0


def test_the_loop_of_a_tracker_takes_no_settings_of_a_sampled_one(motor: pr.Motor) -> None:
    tracker = pr.Tracker(kind="pll", voltage=60.0, frequency=40.7e3)
    with pytest.raises(pr.ParameterError, match="control_loop: there is no argument 'foo'"):
        pr.control_loop(motor, tracker, foo=1)  # type: ignore[call-overload]
    with pytest.raises(pr.ParameterError, match=r"crossover, margin, .* are those of a sampled loop"):
        pr.control_loop(motor, tracker, crossover=40.0)  # type: ignore[call-overload]


def test_a_margin_alone_is_used_where_no_robust_loop_has_it(motor: pr.Motor) -> None:
    loop = pr.control_loop(motor, pr.default_drive(motor), quantity="phase", margin=20.0)
    assert loop.phase_margin_deg == pytest.approx(20.0, abs=0.5)


def test_a_motor_in_its_dead_band_has_no_loop(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> None:
    weak = drive.model_copy(update={"voltage": 20.0})
    with pytest.raises(pr.SimulationError, match="The motor stands still"):
        pr.control_loop(motor, weak, **DESIGNS["slow speed"])


def test_gains_against_the_drive_or_of_a_changing_sign_have_a_caution(motor: pr.Motor) -> None:
    """At 40 kHz the motor turns forwards up to 74 V, then backwards; at 40.7 kHz its speed rises.

    In the full motor 1.690 rad/s at 62.5 V, −0.0426 at 75 V, −1.836 at 87.5 V and −3.680 at 100 V.
    """
    design = {"quantity": "position", "crossover": 20.0, "margin": 90.0, "sample_time": 0.5e-3}
    told = {}
    for frequency in (40.0e3, 40.7e3):
        at = pr.TwoPhaseDrive(voltage=100.0, frequency=frequency, phase_deg=62.0)
        loop = pr.control_loop(motor, at, **design)  # type: ignore[arg-type]
        unestimated(loop.simulated)
        told[loop.gains["proportional"] > 0.0] = " ".join(loop.cautions)
    assert "-3.67 rad/s, against the sign of the phase of 62°: the gains are negative" in told[False]
    assert "changes its sign below the drive: 1.7 rad/s at 62.5 V, -0.0475 rad/s at 75 V, -1.83 rad/s" in told[False]
    assert not any(words in told[True] for words in ("against", "its sign"))
    spread = pr.control_loop(motor, at, **design, over={"drive.frequency": [40.0e3]}).spread  # type: ignore[arg-type]
    assert "The gain of the motor has the opposite sign there" in spread[0].reason


def beam() -> tuple[pr.Motor, pr.TwoPhaseDrive]:
    """Return the beam, whose contact does not creep, with its drive."""
    motor = pr.load_motor(BEAM40)
    return motor, pr.default_drive(motor).model_copy(update={"voltage": 69.0})


def test_a_motor_stands_below_its_dead_band_and_turns_above(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> None:
    """By runs of 0.2 s, 1 V below and above.

    Without slip the contact moves the rotor of the beam by microradians only. The start turns that of the flagship by
    milliradians; after it, its contact creeps by the area that the path of the tip encloses.
    """
    for (one, given), begin, still in ((beam(), 0.0, 20e-6), ((motor, drive), 0.1, 50e-6)):
        band = over_amplitudes(one, given, 0.0)[0]
        for volts, turns in ((band - 1.0, False), (band + 1.0, True)):
            run = pr.simulate_averaged(one, given.model_copy(update={"voltage": volts}), 0.2)
            late = run.rotor_position_rad[-1] - np.interp(begin, run.time_s, run.rotor_position_rad)
            assert (late > 1e-3) == turns
            assert abs(late) < still or turns
        assert over_amplitudes(one, given, 2e-3)[0] > band


@pytest.mark.soak
def test_the_full_motor_stands_in_the_dead_band_and_turns_above(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> None:
    """After the first oscillations; below, the flagship slips for less than one of the averaged motor's 64 phases."""
    for (one, given), begin, moves, still in ((beam(), 9, 0.2e-3, 2e-6), ((motor, drive), 29, 5e-3, 1e-3)):
        band = over_amplitudes(one, given, 0.0)[0]
        for volts, turns in ((band - 1.5, False), (band + 1.5, True)):
            weak = given.model_copy(update={"voltage": volts})
            end = (begin + 11) * 1e-3
            run = pr.simulate_controlled(one, weak, lambda _: {}, end, sample_time=1e-3, averaged=False)
            late = run.position_rad[-1] - run.position_rad[begin]  # in 10 ms
            assert (late > moves) == turns
            assert abs(late) < still or turns


@pytest.mark.soak
def test_a_spread_has_the_margins_at_other_operating_points(motor: pr.Motor, drive: pr.TwoPhaseDrive) -> None:
    """By a sine in the running loop with the gains of the design; 3 % and 1.5°, as it is not infinitely small."""
    wanted = DESIGNS["slow speed"]
    loop = pr.control_loop(motor, drive, **wanted, over={"drive.voltage": [20.0, 48.0, 54.0]})
    assert "The motor stands still" in loop.spread[0].reason
    assert any("At 1 of 3 operating points" in caution for caution in loop.cautions)
    for point in loop.spread[1:]:
        changed = drive.model_copy(update={"voltage": point.at["drive.voltage"]})
        there = pr.control_loop(motor, changed, **wanted)
        assert point.gains == pytest.approx(there.gains)  # the schedule is what a design there gives
        run_there = there.provenance["run"] | {"crossover_hz": point.crossover_hz}
        moved = replace(
            there, gains=loop.gains, provenance=there.provenance | {"run": run_there},
            loop_gain=there.plant * loop.loop_gain / loop.plant,
        )  # fmt: skip
        gain = injected(moved, motor, changed, settles=0.2, start="steady")
        cycle = round(1.0 / point.crossover_hz / wanted["sample_time"]) * wanted["sample_time"]
        place = np.log(moved.frequency_hz)
        level = np.exp(np.interp(-np.log(cycle), place, np.log(np.abs(moved.loop_gain))))
        phase = np.interp(-np.log(cycle), place, np.degrees(np.unwrap(np.angle(moved.loop_gain))))
        assert abs(gain) == pytest.approx(level, rel=0.03)
        assert (np.degrees(np.angle(gain)) - phase + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1.5)
        assert (180.0 + phase - point.phase_margin_deg + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=3.0)


def test_a_spread_over_speed_and_load_has_the_amplitude_that_gives_the_speed(
    motor: pr.Motor, drive: pr.TwoPhaseDrive
) -> None:
    """The free run at that amplitude comes to the speed; that of 1000 rad/s is above four times the drive's."""
    over = {"speed": [4.0, 12.0, 1e3], "load.torque": [0.0, 1e-3]}
    spread = pr.control_loop(motor, drive, **DESIGNS["slow speed"], over=over).spread
    assert [point.at["speed"] for point in spread] == [4.0, 4.0, 12.0, 12.0, 1e3, 1e3]
    for point in spread[:4]:
        assert point.voltage is not None
        there = drive.model_copy(update={"voltage": point.voltage})
        run = pr.simulate_averaged(motor, there, 0.5, load_torque=point.at["load.torque"])
        assert run.rotor_speed_rad_s[-1] == pytest.approx(point.at["speed"], rel=2e-3)
        assert point.speed == pytest.approx(point.at["speed"], rel=1e-3)
        assert point.phase_margin_deg is not None
    assert spread[1].voltage > spread[0].voltage  # type: ignore[operator]
    assert "No amplitude up to" in spread[4].reason
    with pytest.raises(pr.ParameterError, match="the amplitude sets the speed"):
        pr.control_loop(motor, drive, **DESIGNS["slow speed"], over={"speed": [4.0], "drive.voltage": [60.0]})


def test_a_vibration_that_averages_do_not_describe_makes_no_loop_unstable() -> None:
    """At 60 V the averaged equations have a pole of +599 1/s at 79 kHz, which their integration damps."""
    motor = pr.load_motor(BEAM40)
    weak = pr.default_drive(motor).model_copy(update={"voltage": 60.0})
    loop = pr.control_loop(motor, weak, **DESIGNS["slow speed"])
    # as of the other designs
    assert np.abs(loop.step_simulated - loop.step_predicted).max() < 0.025
    assert np.linalg.eigvals(pr.state_space(motor, weak).a).real.max() < 1e-3


def test_the_command_prints_the_gains_and_draws_the_loop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = "loop bimodal40 --voltage 60 --quantity speed --crossover 100 --margin 60 --sample 250e-6 --json"
    assert run([*words.split(), "--plot", str(tmp_path / "loop.png"), "--output", str(tmp_path / "loop.csv")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"gains", "crossover_hz", "phase_margin_deg", "gain_margin_db", "overshoot"} <= set(found)
    assert found["gain_units"] == {"proportional": "V·s/rad", "integral": "V/rad"}
    assert found["gain_margin_db"] > 6.0
    assert (tmp_path / "loop.png").stat().st_size > 0
