# SPDX-License-Identifier: GPL-3.0-or-later
"""What a driver does to a motor and the motor to it: against closed forms, and against runs without a driver."""

import csv
import json
import re
from functools import cache
from math import atan, degrees, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.drivers.design import Design, driver_state
from pyspice_runner.drivers.parts import E12, E24, largest_inductance, nearest
from pyspice_runner.drivers.ratings import PartLoad
from pyspice_runner.drivers.report import DriveReport
from pyspice_runner.run.window import Window
from tests.runs import simulated
from tests.said import output, printed, refusal
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("drivers")

FREQUENCY = 51.7e3
SETTLED = 1e-3  # s, after which the powers of a bridge balance


@cache
def motor(friction: float = 0.3) -> pr.Motor:
    return pr.load_motor("andersen2002").updated({"contact.friction": friction})


def driver(kind: str = "linear", **values: Any) -> pr.Driver:
    return pr.Driver(**{"kind": kind, "voltage": 50.0, "frequency": FREQUENCY, **values})


def report(chosen: pr.Driver, *, friction: float = 0.3, **settings: Any) -> DriveReport:
    return pr.drive_report(motor(friction), chosen, **{"duration": 1e-3, **settings})


@cache
def design(stage: str, network: str, level: float = 0.0) -> Design:
    """The driver of a stage whose pins get 50 V, 90° apart."""
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=FREQUENCY)
    parts = {"bridge.level": level} if level else {}
    return pr.design(motor(), pr.DriverSpec(drive, stage, network, parts=parts))


@cache
def half_bridge() -> DriveReport:
    return pr.drive_report(motor(), design("half-bridge", "inductor"), 1.4e-3)


@cache
def full_bridge(duration: float) -> DriveReport:
    """Three steps with no third harmonic, a transformer, an LLCC filter."""
    return pr.drive_report(motor(), design("full-bridge", "llcc", 0.5), duration)


# --- reading a run -------------------------------------------------------------------------------------------


def test_harmonics_of_a_square_wave_that_has_but_its_corners() -> None:
    edge = 1e-9
    corners = [(0.0, -1.0), (edge, 1.0), (0.5, 1.0), (0.5 + edge, -1.0)]
    points = [(period + time, value) for period in range(10) for time, value in corners] + [(10.0, -1.0)]
    time, values = np.array(points).T
    phasors = Window(time, 1.0, uniform=False).harmonics(values)
    orders = np.arange(1, 21)
    assert np.abs(phasors) == pytest.approx(np.where(orders % 2, 4.0 / (pi * orders), 0.0), abs=1e-6)
    assert np.angle(phasors[::2]) == pytest.approx(0.0, abs=1e-6)


def test_means_of_sines_with_uniform_steps_are_exact() -> None:
    time = np.linspace(0.0, 12.0, 12 * 128 + 1)
    window = Window(time, 1.0, uniform=True)
    values = 3.0 * np.sin(2.0 * pi * time + 0.7) + 0.5 * np.sin(6.0 * pi * time - 0.2)
    phasors = window.harmonics(values)
    assert window.rms(values) == pytest.approx(sqrt(4.5 + 0.125), rel=1e-12)
    assert (abs(phasors[0]), abs(phasors[2])) == pytest.approx((3.0, 0.5), rel=1e-12)
    assert (np.angle(phasors[0]), np.angle(phasors[2])) == pytest.approx((0.7, -0.2), rel=1e-12)
    assert window.mean(values) == pytest.approx(0.0, abs=1e-12)


# --- drivers against closed forms ----------------------------------------------------------------------------


def test_ideal_sources_are_those_of_simulate() -> None:
    """The same circuit but for an ammeter; whole periods end elsewhere between the points."""
    found = report(driver("ideal"))
    plain = simulated(motor(), pr.TwoPhaseDrive(voltage=50.0, frequency=FREQUENCY), duration=1e-3)
    for group in ("a", "b"):
        voltage, current = getattr(plain, f"voltage_{group}_v"), getattr(plain, f"current_{group}_a")
        assert found.groups[group].real_power_w == pytest.approx(plain.mean(voltage * current), rel=5e-3)
        assert found.groups[group].current_rms_a == pytest.approx(sqrt(plain.mean(current**2)), rel=5e-3)
        assert found.groups[group].voltage_rms_v == pytest.approx(50.0 / sqrt(2.0), rel=1e-4)
    assert found.losses_w == {}
    assert found.efficiency == pytest.approx(found.shaft_power_w / found.motor_power_w)


@pytest.mark.parametrize("kind", mostly(pytest.mark.soak, ["ideal", "linear"], ["ideal"]))
def test_the_error_of_the_torque_by_the_step_is_stated_and_holds(kind: str) -> None:
    settings: dict[str, Any] = {"speed": 3.0, "duration": 5e-4}
    found = report(driver(kind), **settings)
    fine = report(driver(kind), **settings, step=found.run["step_s"] / 8.0)
    assert abs(found.mean_torque_n_m - fine.mean_torque_n_m) < found.mean_torque_error_n_m
    assert found.to_dict()["mean_torque_error_n_m"] == found.mean_torque_error_n_m
    assert "by the step" in found.summary()["mean torque"]
    assert fine.mean_torque_error_n_m is None  # of a given step


def test_linear_amplifier_in_class_b_draws_two_over_pi_of_its_peak_current() -> None:
    found = report(driver(supply_v=60.0, settings={"amplifier.quiescent": 1e-6}))
    peaks = sum(found.outputs[group].harmonics[0].current_a for group in ("a", "b"))
    # the current's harmonics are some 1e-3 of it
    assert found.supply_power_w == pytest.approx(2.0 / pi * 60.0 * peaks, rel=2e-3)
    assert found.supply_current_mean_a["positive"] == pytest.approx(peaks / pi, rel=2e-3)
    assert found.supply_current_mean_a["negative"] == pytest.approx(-peaks / pi, rel=2e-3)
    assert sum(found.losses_w.values()) == pytest.approx(found.supply_power_w - found.motor_power_w, rel=1e-6)


def test_linear_amplifier_has_its_bandwidth() -> None:
    found = report(driver(settings={"amplifier.bandwidth": 200e3, "amplifier.output_resistance": 0.1}))
    for group, phase in (("a", 0.0), ("b", 90.0)):
        first = found.outputs[group].harmonics[0]
        # 0.1 A across 0.1 Ω is 2e-4 of 50 V, and the trapezoidal rule sees the pole (ωh)²/12 lower
        assert first.voltage_v == pytest.approx(50.0 / sqrt(1.0 + (FREQUENCY / 200e3) ** 2), rel=5e-4)
        lag = degrees(atan(FREQUENCY / 200e3))
        assert first.voltage_phase_deg == pytest.approx(phase - lag, abs=0.1)


def test_linear_amplifier_too_slow_makes_triangles() -> None:
    """A slew rate far below 2π f U: the voltage runs up and down for half a period each."""
    slow = 1e6
    found = report(driver(settings={"amplifier.slew_rate": slow}), contact=None)
    for group in ("a", "b"):
        assert found.outputs[group].slew_rate_v_per_s == pytest.approx(slow, rel=0.02)
        peak = slow / (4.0 * FREQUENCY)
        # corners between points a 146th of a period apart, and 1 Ω that carries the current
        for order in (1, 3):
            expected = 8.0 / pi**2 * peak / order**2
            assert found.outputs[group].harmonics[order - 1].voltage_v == pytest.approx(expected, rel=5e-3)


def test_the_slew_rate_asked_for_is_that_of_the_sine() -> None:
    found = report(driver("ideal"), contact=None)
    # read over a two-thousandth of a period, between points a 146th apart: (2π/146)²/24 below it
    assert found.outputs["b"].slew_rate_v_per_s == pytest.approx(2.0 * pi * FREQUENCY * 50.0, rel=1e-3)


@pytest.mark.soak
def test_half_bridge_gives_a_square_wave() -> None:
    found = half_bridge()
    for group in ("a", "b"):
        port = found.outputs[group]
        rail = found.driver["rails_v"][group][0]
        assert port.harmonics[0].voltage_v == pytest.approx(4.0 / pi * rail, rel=0.02)  # less the transistors' drop
        for order in (3, 5):
            assert port.harmonics[order - 1].voltage_v == pytest.approx(4.0 / (pi * order) * rail, rel=0.03)
        assert port.harmonics[1].voltage_v < 0.01 * rail
        # of a square wave and a sine the power factor cannot exceed 2√2/π = 0.900
        assert port.power_factor < 0.91
    assert found.gate_power_w > 0.0


@pytest.mark.soak
def test_a_push_pull_stage_gives_the_fundamental_of_its_supply_and_its_transistors_bear_twice_that() -> None:
    """4/π of the supply times the ratio behind the leakage, which is in series with the load that is measured.

    1 %: 1.8 Ω at 90 mA, 200 ns of dead time, and the body diodes. The balance is that of the other bridges.
    """
    stage = {"bridge.ratio": 2.0, "inductor.inductance": 8.2e-3}
    found = report(driver("push-pull", supply_v=24.0, network="inductor", settings=stage), duration=2.5e-4, speed=0.0)
    leakage = 2j * pi * FREQUENCY * 5e-3 * 2.0**2 * (1.0 - 0.998**2)
    for group in "ab":
        port = found.outputs[group]
        load = complex(port.resistance_ohm, port.reactance_ohm)
        expected = 4.0 / pi * 24.0 * 2.0 * abs(load / (load + leakage))
        assert port.harmonics[0].voltage_v == pytest.approx(expected, rel=0.01)
    assert abs(found.balance_residual) < 0.01
    transistors = [part for part in found.maxima["parts"] if part["name"].startswith("MOSFET")]
    assert [part["value"] for part in transistors] == [2, 2]
    assert all(part["peak_voltage_v"] > 48.0 for part in transistors)
    assert len(found.switching) == 4


@pytest.mark.soak  # its deck is run by tests/circuit/test_decks.py; its balance settles for 4 ms
def test_full_bridge_of_three_steps_has_no_third_harmonic() -> None:
    found = full_bridge(SETTLED)
    for group in ("a", "b"):
        port = found.outputs[group]
        rail = found.driver["rails_v"][group][0]
        assert port.harmonics[0].voltage_v == pytest.approx(4.0 / pi * rail * sqrt(0.75), rel=0.03)
        assert port.harmonics[2].voltage_v < 0.05 * port.harmonics[0].voltage_v  # dead time leaves some; a square: 1/3


# --- power balance -------------------------------------------------------------------------------------------


def settled(kind: str) -> DriveReport:
    if kind == "linear":
        return pr.drive_report(motor(), design("linear", "llcc"), 1.5e-3)
    return half_bridge() if kind == "half-bridge" else full_bridge(SETTLED)


@pytest.mark.parametrize("kind", mostly(pytest.mark.soak, ["linear", "half-bridge", "full-bridge"], ["half-bridge"]))
def test_supply_is_losses_and_motor_within_one_per_cent(kind: str) -> None:
    found = settled(kind)
    assert abs(found.balance_residual) < 0.01
    # and without what the report says of stored energy, which has hardly changed
    spent = sum(found.losses_w.values()) + found.motor_power_w
    assert spent == pytest.approx(found.power_in_w, rel=0.01)
    assert found.settling < 0.05  # the filter's two frequencies beat


# --- the design of a network ---------------------------------------------------------------------------------


def test_parts_have_values_of_the_e_series() -> None:
    """IEC 60063; the middle between two values is their geometric mean."""
    assert [nearest(value, E12) for value in (1.0e-3, 1.09e-3, 1.1e-3, 9.0e-3, 9.06e-3)] == [
        1e-3,
        1e-3,
        1.2e-3,
        8.2e-3,
        1e-2,
    ]
    assert nearest(3.14e-9, E24) == pytest.approx(3.0e-9)
    for exponent in (-11, -6, -3, 0):
        assert nearest(10.0**exponent, E24) == pytest.approx(10.0**exponent)


def test_coils_that_resonate_with_their_own_capacitance_are_refused() -> None:
    """275 mH at 40 kHz and 20 pF resonate at 68 kHz; at three times the frequency, 120 kHz, 88 mH do."""
    largest = largest_inductance(40e3)
    assert largest == pytest.approx(1.0 / ((2.0 * pi * 120e3) ** 2 * 20e-12))
    (told,) = PartLoad("coil", 0.275, "H", 100.0, 1e-3).beyond(largest)
    assert "inductance of 275" in told
    assert not PartLoad("coil", 22e-3, "H", 100.0, 20e-3).beyond(largest)
    assert "voltage of 1.5" in PartLoad("capacitor", 1e-9, "F", 1500.0, 1e-3).beyond(largest)[0]


def test_the_pins_keep_their_voltages_from_stall_to_no_load_behind_the_designed_network() -> None:
    found = design("half-bridge", "inductor")
    assert found.feasible, found.reason
    assert [point.state for point in found.points][:3] == ["stall", "operating point", "no load"]
    for point in found.points:
        for group in ("a", "b"):
            assert point.group(group).voltage_v == pytest.approx(50.0, rel=0.2)  # the band that the design promises
    for part in found.parts:
        if part.unit in ("H", "F"):
            series = E12 if part.unit == "H" else E24
            assert nearest(part.value, series) == pytest.approx(part.value)


def test_the_state_behind_a_driver_is_that_of_its_design_and_follows_the_values_of_its_parts() -> None:
    """0.2 %: the design starts from other states and both end at a residual of 1e-4; the torque's error is 1 %.

    A coil of 5 % more, in series with the capacitor to which it was tuned, lowers the voltage of the pin.
    """
    found = design("half-bridge", "inductor")
    point = found.points[1]
    plain = driver_state(motor(), found.driver, speed=point.speed_rad_s)
    for group in "ab":
        assert plain[f"voltage_{group}_v"] == pytest.approx(point.group(group).voltage_v, rel=2e-3)
    assert plain["stage_power_w"] == pytest.approx(point.stage_power_w, rel=2e-3)
    coil = found.driver.setting("inductor_a.inductance")
    more = found.driver.updated({"inductor_a.inductance": 1.05 * coil})
    load = complex(point.a.resistance_ohm, point.a.reactance_ohm)
    series = more.equivalent.setting("inductor_a.resistance")  # the tuned pair leaves its resistance alone
    detuned = 0.05j * 2.0 * pi * FREQUENCY * coil
    changed = driver_state(motor(), more, speed=point.speed_rad_s)["voltage_a_v"] / plain["voltage_a_v"]
    # 2 %: the impedance of the motor changes with its voltage, and the pair is tuned to the E series only
    assert changed == pytest.approx(abs((load + series) / (load + series + detuned)), rel=0.02)


def test_the_transient_behind_the_designed_bridge_has_the_voltages_and_currents_of_its_steady_states() -> None:
    """The steady states know the fundamental of the stage alone; the run has the switches.

    Dead time, 1 % of the period at each edge, and what has not settled after 72 periods leave some 2 %.
    """
    found = half_bridge()
    point = found.design.points[1]
    for group in ("a", "b"):
        port = found.groups[group].harmonics[0]
        assert port.voltage_v == pytest.approx(point.group(group).voltage_v, rel=0.03)
        assert port.current_a == pytest.approx(point.group(group).current_a, rel=0.03)
        assert found.outputs[group].displacement_factor == pytest.approx(point.group(group).power_factor, abs=0.02)


def test_maxima_are_those_of_the_whole_run() -> None:
    found = half_bridge()
    for group in ("a", "b"):
        # power-up overshoots, and the window is the last 20 periods
        assert found.maxima[f"voltage_{group}_v"] >= found.groups[group].voltage_peak_v
        # plates of 0.8 mm
        assert found.maxima[f"field_{group}_v_per_m"] == pytest.approx(found.maxima[f"voltage_{group}_v"] / 0.8e-3)
    loads = {load["name"]: PartLoad(**load) for load in found.maxima["parts"]}
    for group in ("a", "b"):
        coil = loads[f"series coil, group {group.upper()}"]
        assert coil.value == found.driver["parts"][group]["inductor"]["inductance"]
        assert coil.peak_current_a == pytest.approx(found.maxima[f"current_{group}_a"])


def test_the_transistors_of_a_bridge_bear_the_current_of_their_supply() -> None:
    found = half_bridge()
    parts = {part["name"]: part["peak_current_a"] for part in found.maxima["parts"]}
    for group in "AB":
        # the upper one carries all of it: that of the output, and what charges the leg and blocks the diode
        assert parts[f"MOSFET IRF610, group {group}"] >= parts[f"supply vp, group {group}"] * (1.0 - 1e-6)
        assert parts[f"MOSFET IRF610, group {group}"] > 1.5 * found.maxima[f"stage_current_{group.lower()}_a"]


def test_a_field_above_the_limit_of_the_set_is_told() -> None:
    """350 V/mm on plates of 0.8 mm are 280 V."""
    strong = pr.drive_report(motor(), driver("ideal", voltage=300.0), 3e-4)
    assert sum("V/mm; the limit is 350 V/mm" in caution for caution in strong.cautions) == 2
    assert not any("V/mm" in caution for caution in report(driver("ideal"), duration=3e-4).cautions)


def test_a_rail_beyond_the_transistors_is_a_reason_and_no_driver() -> None:
    drive = pr.TwoPhaseDrive(voltage=150.0, frequency=FREQUENCY)
    spec = pr.DriverSpec(drive, "full-bridge", rail=500.0)
    found = pr.OperatingPoint(motor(), drive).design("full-bridge", rail=500.0)
    assert not found.feasible
    assert found.driver is None
    assert "its transistors IRF820 take 450 V" in found.reason
    with pytest.raises(pr.ParameterError, match="There is no driver to be run"):
        pr.drive_report(motor(), spec)


def test_a_transformer_that_raises_the_output_resistance_beyond_a_part_is_a_reason_and_no_driver() -> None:
    """Seen from the pins, the resistance of a stage on 16 V is multiplied by the square of the ratio, 100."""
    motor = pr.load_motor("bimodal40")
    stage = {"amplifier.output_resistance": 1.3}
    spec = pr.DriverSpec(pr.default_drive(motor), "linear", "inductor", 16.0, stage)  # type: ignore[arg-type]
    found = pr.design(motor, spec, speed=26.0)
    assert found.driver is None
    assert "resistance = 1" in found.reason
    assert "Take another stage" in found.reason


@pytest.mark.soak  # as the full bridge above
def test_an_llcc_filter_takes_harmonics_and_reactive_current() -> None:
    found = full_bridge(SETTLED)
    # a wave of three steps without its third harmonic and a sine: 3/π = 0.955 at most, of a square wave 0.900;
    # dead time and the transformer's own current cost the rest
    assert 0.92 < found.power_factor < 3.0 / pi
    for group in ("a", "b"):
        assert found.groups[group].voltage_thd < 0.05
        assert found.groups[group].harmonics[0].voltage_v == pytest.approx(50.0, rel=0.06)  # less what drops
        assert found.outputs[group].reactive_power_var == pytest.approx(0.0, abs=0.15 * found.motor_power_w)


# --- refusals, files, the command ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"duration": 1e-5}, "duration = 1e-05 s is not valid: it must be from 0.000"),
        ({"speed": 1.0, "load_torque": 1e-3}, "speed and load_torque exclude each other"),
        ({"contact": "glue"}, "contact = 'glue' is not valid"),
        ({"step": 1e-5}, "step = 1e-05 s is too coarse"),
    ],
)
def test_errors_name_the_value(settings: dict[str, Any], sentence: str) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        report(driver(), **settings)


@pytest.mark.soak
def test_a_report_is_written_by_the_ending_of_its_file(tmp_path: Path) -> None:
    found = half_bridge()
    for ending in ("json", "csv", "cir"):
        found.save(tmp_path / f"report.{ending}")
    written = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert written["losses_w"] == found.losses_w
    header = (tmp_path / "report.csv").read_text(encoding="utf-8").partition("\n")[0]
    assert header.split(",")[:3] == ["time_s", "output_a_v", "output_a_a"]
    assert (tmp_path / "report.cir").read_text(encoding="utf-8") == found.deck
    found.plot(tmp_path / "report.png")
    assert (tmp_path / "report.png").stat().st_size > 20_000


@pytest.mark.soak
def test_the_command_reports_on_one_driver_and_compares_two(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["drive", "andersen2002", "--duration", "5e-4", "--speed", "0.3"]
    one = printed([*words, "--output", str(tmp_path / "one.csv")], capsys)
    assert {"groups", "outputs", "losses_w", "efficiency", "maxima", "design", "power_factor"} <= set(one)
    assert one["mean_rotor_speed_rad_s"] == pytest.approx(0.3)
    files = ["--output", str(tmp_path / "two.csv"), "--plot", str(tmp_path / "two.png")]
    stated = ["--part", "inductor.inductance=1e-3"]
    assert run([*words, "--driver", "linear+inductor", *stated, "--against", "ideal", *files]) == 0
    assert "series coil, group A" in capsys.readouterr().out
    with (tmp_path / "two.csv").open(encoding="utf-8", newline="") as file:
        assert {len(row) for row in csv.reader(file)} == {3}
    assert (tmp_path / "two.png").stat().st_size > 20_000


def test_the_command_says_why_there_is_no_driver_for_a_rail(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    table = tmp_path / "why.csv"
    words = ["--rail", "500", "--stage", "full-bridge", "--voltage", "180", "--output", str(table), "--json"]
    found = json.loads(output(["drive", "andersen2002", *words], capsys))
    assert found["maxima"] == {}
    assert not found["design"]["feasible"]
    assert "its transistors IRF820 take 450 V" in found["design"]["reason"]
    with table.open(encoding="utf-8", newline="") as file:
        assert list(csv.reader(file)) == [["reason"], [found["design"]["reason"]]]
    words[-2] = str(tmp_path / "deck.cir")
    assert f"There is no deck for {words[-2]}." in refusal(["drive", "andersen2002", *words], capsys)


@pytest.mark.soak
def test_the_command_designs_a_driver_for_a_rail_and_a_load(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = ["drive", "bimodal40", "--rail", "24", "--stage", "full-bridge", "--load-torque", "20e-3"]
    found = printed([*words, "--output", str(tmp_path / "driver.cir")], capsys)
    design = found["design"]
    assert design["feasible"], design["reason"]
    assert design["starts"]
    assert found["run"]["duration_s"] == 1e-3  # by the torque at stall: at the operating point none is to spare
    assert set(design["parts"][0]) == set(PartLoad.__dataclass_fields__)
    assert "transformer" in (tmp_path / "driver.cir").read_text(encoding="utf-8")
    assert "never drives 0.5 N·m" in printed([*words[:-1], "0.5"], capsys)["design"]["reason"]
    assert "less than the load of 0.5" in printed([*words[:-1], "0.5", "--speed", "20"], capsys)["design"]["reason"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--driver", "magic"], "kind = 'magic' is not valid"),
        (["--driver", "linear+magic"], "network = 'magic' is not valid"),
        (["--part", "amplifier.gain"], "is not PART.PARAMETER=VALUE"),
        (["--part", "amplifier.gain=high"], "'high' is not a number"),
        (["--part", "bridge.dead_time=1e-6"], "no part 'bridge' in this linear"),
        (["--against", "ideal", "--output", "deck.cir"], "let it end in .json"),
    ],
)
def test_the_command_refuses(words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert sentence in " ".join(refusal(["drive", "andersen2002", *words], capsys).split())
