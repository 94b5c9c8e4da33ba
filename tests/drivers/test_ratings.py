# SPDX-License-Identifier: GPL-3.0-or-later
"""What the parts of a driver withstand beside their peaks, against equations that are solved by hand."""

import csv
import json
import re
import tomllib
from functools import cache
from math import pi, sqrt
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.drivers import magnetics
from pyspice_runner.drivers.magnetics import wound, wound_transformer
from pyspice_runner.drivers.ratings import PartLoad, judged, transistor_ratings
from pyspice_runner.drivers.report import DriveReport
from tests.said import output, refusal

pytestmark = pytest.mark.xdist_group("drivers")

FREQUENCY = 51.7e3
NETWORK = {"inductance": 8.2e-3, "resistance": 27.0, "capacitance": 1.5e-9, "bleeder": 180e3}


@cache
def driven(kind: str, duration: float = 1e-3) -> DriveReport:
    settings = {f"inductor.{name}": value for name, value in NETWORK.items()}
    driver = pr.Driver(kind=kind, voltage=50.0, frequency=FREQUENCY, network="inductor", settings=settings)
    return pr.drive_report(pr.load_motor("andersen2002"), driver, duration)


def part(found: DriveReport, name: str) -> PartLoad:
    return next(one for one in found.parts if one.name.startswith(name))


def test_rms_values_losses_and_ripple_of_a_network_are_those_of_its_elements() -> None:
    """U = ωL I without R, Q = U I, R I², U²/R of the bleeder, and 2√2 I/(ωC) from peak to peak."""
    found, omega = driven("ideal", 4e-3), 2.0 * pi * FREQUENCY
    current = found.groups["a"].current_rms_a
    coil, capacitor, bleeder = (
        part(found, f"{name}, group A") for name in ("series coil", "series capacitor", "bleeder")
    )
    impedance = sqrt(NETWORK["resistance"] ** 2 + (omega * NETWORK["inductance"]) ** 2)
    # harmonics of the motor's current, which count by ω and 1/ω, are 1 % of it
    assert coil.rms_current_a == pytest.approx(current)
    assert coil.rms_voltage_v == pytest.approx(impedance * current, rel=0.01)
    assert coil.apparent_power_va == pytest.approx(impedance * current**2, rel=0.01)
    assert coil.loss_w == pytest.approx(NETWORK["resistance"] * current**2, rel=1e-3)
    assert capacitor.ripple_v == pytest.approx(2.0 * sqrt(2.0) * current / (omega * NETWORK["capacitance"]), rel=0.02)
    assert bleeder.loss_w == pytest.approx(bleeder.rms_voltage_v**2 / NETWORK["bleeder"], rel=1e-3)
    assert capacitor.loss_w is None
    assert "; RMS " in found.summary()["series coil, group A"]


@pytest.mark.parametrize("kind", ["full-bridge", "push-pull"])
def test_the_row_of_a_transformer_has_both_windings(kind: str) -> None:
    """U₂ = n U₁ but for the leakage; n I₂ = I₁ but for the magnetising current; VA of the secondary."""
    found = driven(kind, 3e-4)
    one, coil = part(found, "transformer, group A"), part(found, "series coil, group A")
    assert one.rms_current_a == pytest.approx(coil.rms_current_a, rel=1e-6)
    assert one.apparent_power_va == pytest.approx(one.rms_voltage_v * one.rms_current_a)
    assert one.rms_voltage_v == pytest.approx(one.value * one.primary_rms_voltage_v, rel=0.05)
    if kind == "full-bridge":
        assert one.primary_rms_current_a == pytest.approx(found.outputs["a"].current_rms_a, rel=1e-6)
    assert "; primary RMS " in found.summary()[one.name]


def test_a_transistor_of_a_half_bridge_carries_the_current_for_a_half_of_the_time() -> None:
    found = driven("half-bridge")
    mosfet, supply = part(found, "MOSFET IRF610, group A"), part(found, "supply vp, group A")
    assert mosfet.rms_current_a == pytest.approx(supply.rms_current_a, rel=0.01)  # of the upper one; both are alike
    # the charging of the leg beside the current of the output
    assert 1.0 < mosfet.rms_current_a * sqrt(2.0) / found.outputs["a"].current_rms_a < 1.1
    assert mosfet.loss_w == max(found.losses_w["bridge_a.high"], found.losses_w["bridge_a.low"])
    assert found.to_dict()["maxima"]["parts"][2]["loss_w"] == mosfet.loss_w


def test_a_junction_is_hotter_by_its_loss_times_the_thermal_resistances() -> None:
    """Vishay 91023: 3.5 K/W to the case, 62 K/W in all, without a heat sink; at an ambient of 25 °C."""
    mosfet = part(driven("half-bridge"), "MOSFET IRF610, group A")
    assert mosfet.junction_c == pytest.approx(25.0 + 62.0 * mosfet.loss_w)
    assert mosfet.exceeds == ()


def test_currents_and_junction_above_the_ratings_of_a_model_are_one_caution_and_mark_their_rows(tmp_path: Path) -> None:
    models = tmp_path / "my.lib"
    models.write_text(
        ".model small VDMOS(Rg=3 Vto=3 Kp=.17 Cgs=125p Cgdmax=171p Cgdmin=10p Cjo=216p Is=1p BV=200 TT=180n\n"
        "+ id_max=20m Rthjc=3.5 rthca=2k te_max=30)\n"
    )
    driver = pr.Driver(
        kind="half-bridge", voltage=50.0, frequency=FREQUENCY, mosfet=f"{models}:small", drain_a=5e-3, ambient_c=20.0
    )
    found = pr.drive_report(pr.load_motor("andersen2002"), driver, 2e-4)
    mosfet = part(found, "MOSFET small, group A")
    assert mosfet.junction_c == pytest.approx(20.0 + 2003.5 * mosfet.loss_w)
    (caution,) = (sentence for sentence in found.cautions if "exceeds its ratings" in sentence)
    for words in ("group A: peak ", "; group B: peak ", "pulsed 0.02 A", "continuous 0.005 A", "maximum 30 °C"):
        assert words in caution
    assert caution.endswith("or a lower case_ambient_k_per_w.")
    assert "EXCEEDED: peak " in found.summary()["MOSFET small, group A"]
    with pytest.raises(pr.ParameterError, match="drain_a has no effect on a linear"):
        pr.Driver(kind="linear", voltage=50.0, frequency=FREQUENCY, drain_a=1.0)


def test_a_coil_on_its_core_has_inductance_flux_density_and_losses_of_the_equations() -> None:
    """6.8 mH, 126 mA peak, 69 mA RMS: A_p = L Î I/(k_u J B) = 6.8e-3 · 0.126 · 0.069/(0.4 · 4e6 · 0.3) = 123 mm⁴.

    RM 4 has 13 · 7.7 = 100 mm⁴, RM 5 23.8 · 9.5 = 226 mm⁴.
    """
    peak, rms, henries = 0.126, 0.069, 6.8e-3
    coil = wound(henries * peak, henries * sqrt(2.0) * rms, rms, 40.7e3, henries)
    assert coil.name == "RM 5"
    area, path, permeability = 23.8e-6, 22.1e-3, 2200.0
    reluctance = (coil.gap_m + path / permeability) / (4e-7 * pi * area)
    assert coil.turns**2 / reluctance == pytest.approx(henries)
    assert coil.peak_t == pytest.approx(henries * peak / (coil.turns * area))
    assert coil.peak_t <= 0.3
    ohms = 2.0e-8 * coil.turns * 25e-3 / (0.4 * 9.5e-6 / coil.turns)  # ρ N l/(k_u A_w/N)
    assert coil.winding_w == pytest.approx(ohms * rms**2)
    density = 375e3 * (40.7e3 / 100e3) ** 1.36 * (henries * sqrt(2.0) * rms / (coil.turns * area) / 0.2) ** 2.58
    assert coil.ferrite_w == pytest.approx(density * path * area)
    # of all turns, the loss is smallest: 2 P_w = β P_c, but for the rounding to whole turns
    assert 2.0 * coil.winding_w == pytest.approx(2.58 * coil.ferrite_w, rel=4.6 / coil.turns)
    assert coil.rise_k == pytest.approx(53.0 * 0.526**-0.54 * (coil.winding_w + coil.ferrite_w), rel=1e-3)
    assert wound(henries * peak, henries * peak, rms, 1e6, henries) is None  # above the range of the ferrite


def test_a_transformer_has_the_turns_of_its_volt_seconds_and_the_permeance_of_its_core() -> None:
    """A square wave of 24 V at 40.7 kHz has 24/(4 · 40.7e3) = 147 µV·s, twice that at power-up; 0.5 A on both sides."""
    driver = pr.Driver(kind="full-bridge", voltage=100.0, frequency=40.7e3, supply_v=24.0, settings={
        "transformer.ratio": 3.42
    })  # fmt: skip
    found = wound_transformer(driver, "a", 0.25)
    assert found.name == "RM 6"
    assert found.peak_t == pytest.approx(2.0 * 24.0 / (4.0 * 40.7e3) / (found.turns * 36.6e-6))
    assert found.peak_t <= 0.3
    assert found.secondary_turns == round(3.42 * found.turns)
    assert found.inductance_h == pytest.approx(found.turns**2 * 4e-7 * pi * 36.6e-6 / (28.6e-3 / 2200.0 + 1e-5))


def test_a_core_stays_with_its_turns_until_the_rms_current_of_a_run_is_too_large() -> None:
    """RM 6 has 36.6 · 15 = 549 mm⁴; 0.25 A in both windings and 295 µV·s need 2 · 0.25 · 295e-6/480e3 = 307 mm⁴."""
    settings = {"transformer.ratio": 3.42}
    driver = pr.Driver(kind="full-bridge", voltage=100.0, frequency=40.7e3, supply_v=24.0, settings=settings)
    design = wound_transformer(driver, "a", 0.25)
    assert wound_transformer(driver, "a", 0.1, design) is design
    more, other = wound_transformer(driver, "a", 0.3, design), wound_transformer(driver, "a", 1.0, design)
    assert (more.name, more.turns, more.instead_of) == (design.name, design.turns, "")
    assert more.winding_w == pytest.approx(design.winding_w * (0.3 / 0.25) ** 2)
    assert other.name == "RM 8"  # 2 · 1 A · 295 µV·s/480e3 = 1228 mm⁴; it has 64 · 30 = 1920 mm⁴
    assert "; RM 6 of the design does not take the RMS current" in other.words()
    transformer = PartLoad(
        "transformer, group A", 3.42, "1", 100.0, 1.5, rms_current_a=0.3, primary_rms_current_a=1.0, group="a"
    )
    assert judged(driver, transformer, {"a": design}).core == other
    assert wound_transformer(driver, "a", 100.0, design) is None


@pytest.mark.parametrize("ratio", [0.789, 0.334, 2.61, 3.33, 15.4])
def test_whole_turns_give_the_ratio_that_is_simulated(ratio: float) -> None:
    """26 and 21 turns are 0.808, 2.4 % more than 0.789."""
    driver = pr.Driver(kind="full-bridge", voltage=100.0, frequency=28e3, supply_v=48.0, settings={
        "transformer.ratio": ratio
    })  # fmt: skip
    found = wound_transformer(driver, "a", 2.0)
    assert found.secondary_turns / found.turns == pytest.approx(ratio, rel=5e-3)
    assert f"(1 : {found.secondary_turns / found.turns:.4g})" in found.words()


@pytest.mark.parametrize(("core", "nanohenries"), [("RM 8", 3300), ("RM 10", 4200), ("ETD 44/22/15", 3500)])
def test_the_permeance_of_a_core_is_that_of_its_data_sheet(core: str, nanohenries: float) -> None:
    """A_L of N87 in TDK's data sheets, whose tolerance is −20 to +30 %."""
    listed = tomllib.loads((Path(magnetics.__file__).parent / "cores.toml").read_text(encoding="utf-8"))["cores"][core]
    path, area = 1e-3 * listed["path_mm"], 1e-6 * listed["area_mm2"]
    assert 4e-7 * pi * area / (path / 2200.0 + 1e-5) == pytest.approx(1e-9 * nanohenries, rel=0.15)


def test_a_design_takes_its_transformers_from_their_cores_unless_they_are_given() -> None:
    """The magnetising inductance of the other group still follows from its core: N² A_L, not the default of 5 mH."""
    drive, parts = pr.TwoPhaseDrive(voltage=50.0, frequency=FREQUENCY), {"transformer_a.magnetizing": 4e-3}
    design = pr.design(pr.load_motor("andersen2002"), pr.DriverSpec(drive, "full-bridge", rail=24.0, parts=parts))
    assert design.driver.setting("transformer_a.magnetizing") == 4e-3
    core = design.cores["b"]
    for name, value in (("magnetizing", core.inductance_h), ("primary_resistance", core.winding_ohm)):
        assert design.driver.setting(f"transformer_b.{name}") == pytest.approx(value, rel=5e-3)  # three digits


def test_the_bill_of_materials_has_a_row_for_each_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bom.csv"
    words = ["drive", "andersen2002", "--driver", "half-bridge+inductor", "--no-match", "--duration", "2e-4", "--json"]
    parts = {load["name"]: load for load in json.loads(output([*words, "--bom", str(path)], capsys))["maxima"]["parts"]}
    with path.open(encoding="utf-8", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert rows.keys() == {name for name, load in parts.items() if load["unit"] not in ("V", "s")}
    assert float(rows["MOSFET IRF610, group B"]["quantity"]) == 2.0
    coil = rows["series coil, group A"]
    assert float(coil["rms_current_a"]) == pytest.approx(parts["series coil, group A"]["rms_current_a"], rel=1e-5)
    assert coil["core_name"] == parts["series coil, group A"]["core"]["name"]


def test_peaks_at_power_up_are_stated_with_the_recovery_of_body_diodes() -> None:
    """Without a transit time there is no recovery; with 2.3 times the typical charge the peak is larger."""
    design = pr.design(
        pr.load_motor("andersen2002"),
        pr.DriverSpec(pr.TwoPhaseDrive(voltage=50.0, frequency=FREQUENCY), "half-bridge", rail=79.0),
    )
    found = pr.drive_report(pr.load_motor("andersen2002"), design, 5e-4)
    mosfet = next(one for one in found.bill if one.name.startswith("MOSFET"))
    least, most = mosfet.peak_range_a
    assert least < 0.8 * mosfet.peak_current_a < most
    assert "by the recovery of the body diodes" in found.summary()[mosfet.name]
    text = design.driver.recovering(2.0)._transistor.subcircuit
    assert "TT=3.6e-07" in text  # of 180 ns


@pytest.mark.parametrize("written", ["TT=180n", "tt = 1.8e-7", "Tt=0.18u"])
def test_the_transit_time_of_a_body_diode_is_read_as_it_is_written(written: str, tmp_path: Path) -> None:
    models = tmp_path / "my.lib"
    models.write_text(f".model small VDMOS(Rg=3 Vto=3 Kp=.17 Cjo=216p Is=1p BV=200 {written} M=0.5)\n")
    driver = pr.Driver(kind="half-bridge", voltage=10.0, frequency=FREQUENCY, mosfet=f"{models}:small")
    transistor = driver.recovering(2.0)._transistor
    found = re.search(r"TT=(\S+) M=0.5", transistor.subcircuit)
    assert found
    assert float(found[1]) == pytest.approx(3.6e-7)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ("id_max={3+4}", "id_max = {3+4} is not a number"),
        ("id_max=nan", "is not a number"),
        ("BV=-200", "breakdown_v = -200"),
    ],
)
def test_a_rating_that_is_no_number_above_0_is_refused_before_the_run(values: str, words: str, tmp_path: Path) -> None:
    models = tmp_path / "my.lib"
    models.write_text(f".model small VDMOS(Rg=3 Vto=3 Kp=.17\n+ {values})\n")
    driver = pr.Driver(kind="half-bridge", voltage=10.0, frequency=FREQUENCY, mosfet=f"{models}:small")
    with pytest.raises(pr.ParameterError, match=re.escape(words)):
        pr.drive_report(pr.load_motor("andersen2002"), driver, 1e-4)


def test_ratings_are_those_of_the_transistor_alone(tmp_path: Path) -> None:
    """A zener diode at the gate has another breakdown voltage."""
    models = tmp_path / "my.lib"
    models.write_text(
        ".subckt fet d g s\nM1 d g s s channel\nDz s g zen\n.model channel VDMOS(Vto=3 Kp=.17 BV=210 id_max=.5)\n"
        ".model zen D(BV=18)\n.ends fet\n"
    )
    driver = pr.Driver(kind="half-bridge", voltage=10.0, frequency=FREQUENCY, mosfet=f"{models}:fet")
    found = transistor_ratings(driver)
    assert (found["breakdown_v"], found["drain_pulsed_a"]) == (210.0, 0.5)


def test_a_specification_refuses_values_of_another_kind() -> None:
    drive = pr.TwoPhaseDrive(voltage=50.0, frequency=FREQUENCY)
    for name, value in (
        ("rail", 0), ("rail", "48"), ("power", [1]), ("current", 1j), ("at", "middle"), ("load_range", 5),
        ("load_range", (20, 1)), ("source_ohm", True), ("parts", 3),
    ):  # fmt: skip
        with pytest.raises(pr.ParameterError, match=name):
            pr.DriverSpec(drive, "full-bridge", **{name: value})


def test_a_bill_of_materials_is_of_one_driver_in_a_file_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["drive", "andersen2002", "--bom", str(tmp_path / "a.csv"), "--driver", "half-bridge"]
    for more, told in (
        (["--output", str(tmp_path / "a.csv")], "one file"), (["--against", "linear"], "--bom is of one driver"),
    ):  # fmt: skip
        assert told in " ".join(refusal([*words, *more], capsys).split())
