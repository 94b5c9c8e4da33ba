# SPDX-License-Identifier: GPL-3.0-or-later
"""Driver, design and tracker of a transducer with one group: one channel."""

import json
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import design_driver, driver_state
from pyspice_runner.motor.circuit_file import circuit_toml
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from pyspice_runner.steady.transducer import transducer_state
from tests.circuit.batch import measured
from tests.said import output, refusal

AIR = EquivalentCircuit((MotionalArm(643.2, 68.87e-3, 230.5e-12),), 2.402e-9, 0.0, 40e3)  # MA40S4S, settles in 1 ms


@pytest.fixture(scope="module")
def air(tmp_path_factory: pytest.TempPathFactory) -> pr.Motor:
    (path := tmp_path_factory.mktemp("air") / "air.toml").write_text(circuit_toml(AIR))
    return pr.load_motor(path)


def drive_of(motor: pr.Motor) -> pr.TwoPhaseDrive:
    return pr.default_drive(motor).updated({"voltage": 20.0})


def test_power_behind_a_coil_is_that_of_a_hand_written_deck(air: pr.Motor, tmp_path: Path) -> None:
    drive, (arm,) = drive_of(air), AIR.arms
    parts = {"inductor.inductance": 2e-3, "inductor.resistance": 50.0}
    spec = pr.DriverSpec(drive, "ideal", "inductor", parts=parts)
    report = pr.drive_report(air, spec.driver(), 4e-3)
    deck = [
        "by hand", "V1 s 0 DC 0 AC -20", "R0 s k 50", "L0 k p 2m", f"C0 p 0 {AIR.clamped_capacitance_f!r}",
        f"L1 p m {arm.inductance_h!r}", f"C1 m r {arm.capacitance_f!r}", f"R1 r 0 {arm.resistance_ohm!r}",
        f".ac lin 3 {drive.frequency - 1.0!r} {drive.frequency + 1.0!r}",
        f".measure ac current FIND i(V1) AT={drive.frequency!r}", ".end",
    ]  # fmt: skip
    put_in = 10.0 * measured("\n".join(deck), tmp_path)["current"]
    assert report.outputs["a"].real_power_w == pytest.approx(put_in, rel=0.01)
    assert driver_state(air, spec.driver())["stage_power_w"] == pytest.approx(put_in, rel=1e-6)
    lost = 0.5 * 50.0 * (2.0**0.5 * report.outputs["a"].current_rms_a) ** 2
    assert report.motor_power_w == pytest.approx(put_in - lost, rel=0.01)
    own = 0.5 * arm.resistance_ohm * report.ceramic["motional_current_amplitude_a_a"] ** 2
    assert report.motor_power_w == pytest.approx(own, rel=0.01)


def test_one_group_has_one_channel(air: pr.Motor) -> None:
    report = pr.drive_report(air, pr.DriverSpec(drive_of(air), "half-bridge", "none"), 0.5e-3)
    assert [*report.groups] == [*report.outputs] == [*report.driver["parts"]] == ["a"]
    assert all("group A" in part["name"] for part in report.maxima["parts"])
    assert not {"xstage_b", "vpin_b", "vvp_b"} & {line.split(" ")[0].lower() for line in report.deck.splitlines()}
    assert "mean_torque_n_m" not in report.to_dict()
    assert "mean torque" not in report.summary()
    with pytest.raises(pr.ParameterError, match="has channels = 2, and air has 1 group"):
        pr.drive_report(air, pr.Driver(kind="linear", voltage=20.0, frequency=40e3), 0.5e-3)


def test_design_gives_the_wanted_voltage_under_load(air: pr.Motor) -> None:
    tool = air.updated({"load.resistance_ohm": 643.2})
    design = design_driver(tool, pr.DriverSpec(drive_of(air), "linear", "inductor"))
    under, idle = design.points
    assert (under.state, idle.state) == ("operating point", "no load")
    assert under.a.voltage_v == pytest.approx(20.0, rel=0.02)
    assert under.b is None
    assert idle.power_w > 1.5 * under.power_w  # half the resistance
    steady = transducer_state(tool, drive_of(air)).quantities
    assert design.unmatched[0].power_w == pytest.approx(steady["power_w"], rel=1e-9)
    assert all("group A" in part.name for part in design.parts)


def test_loop_of_the_phase_is_designed_in_front_of_the_mode(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (path := tmp_path / "air.toml").write_text(circuit_toml(AIR))
    for crossover in (200.0, 500.0):
        asked = ["loop", str(path), "--quantity", "phase", "--crossover", f"{crossover:g}", "--json"]
        found = json.loads(output([*asked, "--plot", str(tmp_path / "loop.png")], capsys))
        assert found["crossover_hz"] == pytest.approx(crossover, rel=1e-6)  # is a point of the sweep
        assert found["phase_margin_deg"] > 60.0
    assert "air is a transducer, without a shaft: add --quantity phase" in refusal(["loop", str(path)], capsys)


def test_tracker_keeps_lock_under_a_load_step(air: pr.Motor) -> None:
    tracker = pr.Tracker(kind="pll", voltage=20.0, frequency=air.modes[0].frequency_hz, offset=0.005, span=0.03)
    found = pr.track(air, tracker, disturb="load", load_factor=2.0, begin=10e-3, duration=16e-3)
    assert found.locked
    assert found.end_frequency_hz == pytest.approx(air.modes[0].frequency_hz, rel=5e-4)
    document = found.to_dict()
    current = 20.0 / AIR.arms[0].resistance_ohm
    assert document["motional_current_before_a"] == pytest.approx(current, rel=0.03)
    assert document["motional_current_after_a"] == pytest.approx(0.5 * current, rel=0.03)
    assert not [name for name in document if "rad_s" in name]
    assert found.loop.phase_margin_deg > 45.0


@pytest.mark.soak
def test_a_transducer_locks_behind_a_network_that_passes_the_third_harmonic(tmp_path: Path) -> None:
    """With the parts that are chosen the pin has a third of its voltage at 84 kHz, and three edges in a period."""
    horn = EquivalentCircuit((MotionalArm(20.07, 72.47e-3, 448.4e-12),), 3.012e-9, 0.0, 28e3)
    (tmp_path / "horn.toml").write_text(circuit_toml(horn))
    device = pr.load_motor(tmp_path / "horn.toml")
    driver = pr.DriverSpec(drive_of(device), "half-bridge", "llcc").built(device, contact=None)
    found = pr.track(device, pr.Tracker(kind="pll", voltage=20.0, frequency=27919.54), 8e-3, driver=driver)
    assert found.locked
    # by which a third, 1/|1 - 9 + 3j| of it behind the filter, moves the edge; an edge is seen 1.4° late at most
    assert abs(found.static_phase_error_deg) == pytest.approx(2.2, abs=1.4)
    assert found.end_frequency_hz == pytest.approx(27919.54, rel=1e-4)
