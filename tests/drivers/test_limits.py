# SPDX-License-Identifier: GPL-3.0-or-later
"""What a stage cannot do: clipping, current limit, slew rate, and rails that are too low for the wanted voltage."""

import json
from math import asin, pi, sqrt
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.drivers.loads import exceeded, load_vectors, part_loads
from pyspice_runner.drivers.report import DriveReport
from pyspice_runner.motor.drive import two_phases

pytestmark = pytest.mark.xdist_group("drivers")

# a bolt-clamped transducer of 28 kHz
TRANSDUCER = pr.load_motor(Path(__file__).parents[1] / "data" / "blt28.toml")


def linear(voltage: float, duration: float = 5e-4, **values: float) -> DriveReport:
    """A linear stage at the flagship's recommended drive with another voltage."""
    motor = pr.load_motor("bimodal40")
    own = {"supply_v": values.pop("supply_v", 0.0)}
    settings = {f"amplifier.{name}": value for name, value in values.items()}
    drive = two_phases(pr.default_drive(motor)) | {"voltage": voltage}  # type: ignore[arg-type]
    driver = pr.Driver(kind="linear", settings=settings, **drive, **own)
    return pr.drive_report(motor, driver, duration)


def test_a_current_limit_below_that_of_the_resonance_is_told() -> None:
    """10 V into 20 ohm are 0.5 A. Limited to 0.25 A the current is between a sine and a square wave of that."""
    settings = {"current_limit": 0.25, "bandwidth": 2e7, "gain": 1.0, "output_resistance": 5.0}
    driver = pr.Driver(
        kind="linear", voltage=10.0, frequency=27920.0, phase_deg=0.0, supply_v=15.0,
        settings={f"amplifier.{name}": value for name, value in settings.items()},
    )  # fmt: skip
    found = pr.drive_report(TRANSDUCER, driver, 12e-3, contact=None)
    told = found.delivered["a"]
    assert 0.1 < told["limited"]["current"] < 0.5
    assert told["limited"]["clipping"] == told["limited"]["slew"] == 0.0
    first = found.outputs["a"].harmonics[0]
    assert 0.25 < first.current_a < 4.0 / pi * 0.25
    assert told["got_v"] == first.voltage_v < 0.6 * told["wanted_v"]
    assert found.groups["a"].voltage_thd > 0.7
    assert found.maxima["exceeded"] == list(found.cautions)
    assert "of group A is at a limit" in found.cautions[0]
    assert "of the 10 V wanted. The stage is at a limit" in found.cautions[1]
    assert len(found.cautions) == 2  # of group B, which draws nothing, there is none


def test_a_current_limit_of_50_ma_at_150_v_is_told_at_the_flagship() -> None:
    found = linear(150.0, 1e-3, current_limit=0.05)
    assert found.groups["a"].voltage_rms_v < 0.4 * 106.0  # V, of a sine of 150 V
    assert found.delivered["a"]["got_v"] == found.groups["a"].harmonics[0].voltage_v < 0.4 * 150.0
    assert found.delivered["a"]["limited"]["current"] > 0.9
    assert sum("current_limit" in caution for caution in found.cautions) == 2
    assert sum("of the 150 V wanted. The stage is at a limit" in caution for caution in found.cautions) == 2
    assert "current limit" in found.summary()["group a, wanted"]


def test_a_supply_below_the_voltage_clips_for_the_time_of_the_sine_beyond_it() -> None:
    """117 V of 150 V behind 3 V of headroom; between points a 200th of a period apart."""
    found, level = linear(150.0, supply_v=120.0), 117.0 / 150.0
    for group in "ab":
        told = found.delivered[group]
        assert told["limited"]["clipping"] == pytest.approx(1.0 - 2.0 / pi * asin(level), abs=0.01)
        # the fundamental of a clipped sine; 1 ohm and the pole of the stage take 0.5 %
        expected = 150.0 * 2.0 / pi * (asin(level) + level * sqrt(1.0 - level**2))
        assert told["got_v"] == pytest.approx(expected, rel=0.01)
    assert sum("240 V between the rails are enough for 117 V" in caution for caution in found.cautions) == 2
    assert len(found.maxima["exceeded"]) == 4


def test_rails_that_make_half_of_the_voltage_are_told() -> None:
    """4/pi of 23.5 V is 29.9 V."""
    driver = pr.Driver(
        kind="half-bridge", voltage=60.0, frequency=27920.0, phase_deg=0.0, supply_v=47.0, mosfet="IRF530"
    )
    assert driver.reachable("a") == pytest.approx(2.0 / pi * 47.0)
    found = pr.drive_report(TRANSDUCER, driver, 1e-3, contact=None)
    for group in "AB":
        told = [caution for caution in found.maxima["exceeded"] if f"The pin of group {group} has 29.9" in caution]
        assert "of the 60 V wanted. 47 V between the rails are enough for 29.92 V" in told[0]


def test_a_stage_within_its_limits_has_no_caution_and_a_network_counts_from_the_stage() -> None:
    assert not linear(150.0).cautions  # the flagship's drive, although the supply clips while it rises
    motor = pr.load_motor("andersen2002")
    driver = pr.Driver(
        kind="linear", voltage=50.0, frequency=51.7e3, network="inductor", settings={"inductor.inductance": 8.2e-3}
    )
    told = pr.drive_report(motor, driver, 3e-4).delivered["a"]
    assert told["place"] == "stage"
    assert told["got_v"] == pytest.approx(50.0, rel=0.01)


@pytest.mark.parametrize(("rail", "told"), [(19.0, False), (80.0, True)])
def test_a_mosfet_above_the_breakdown_voltage_of_its_model_is_told(rail: float, told: bool, tmp_path: Path) -> None:
    models = tmp_path / "my.lib"
    models.write_text(".model weak20 VDMOS(Rg=3 Vto=2 Kp=30 Cgdmax=.5n Cgdmin=.1n Cgs=1n Cjo=.5n Is=5p BV=20)\n")
    driver = pr.Driver(kind="half-bridge", voltage=10.0, frequency=51.7e3, supply_v=rail, mosfet=f"{models}:weak20")
    zeros = dict.fromkeys([*load_vectors(driver), *(f"i(vout_{group})" for group in "ab")], np.zeros(1))
    notes = exceeded(part_loads(driver, zeros), driver)
    assert (
        any("weak20 exceeds its ratings (group A: peak 80 V, breakdown 20 V; group B" in note for note in notes) is told
    )


def test_a_limit_that_an_own_driver_declares_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = tmp_path / "own.lib"
    own.write_text("""* LIMIT thermal  the case is hot
.subckt hot in out com gain=1
Eout out com in com 1
Blimit_thermal limit_thermal 0 V=V(in,com)>0
.ends hot
""")
    words = ["drive", "andersen2002", "--driver", f"{own}:hot", "--voltage", "50", "--duration", "3e-4", "--json"]
    assert run(words) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["delivered"]["a"]["limited"]["thermal"] == pytest.approx(0.5, abs=0.02)
    assert any("of the time: the case is hot" in caution for caution in found["cautions"])
    assert any("the case is hot" in sentence for sentence in found["maxima"]["exceeded"])
