# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers for a power, an amplitude or a kept motional current of a transducer, against hand-written decks."""

import re
from dataclasses import replace
from math import hypot, pi, sqrt
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import PIN_BAND, Design, design_driver
from pyspice_runner.steady.transducer import resonance
from pyspice_runner.sweeps import task
from tests.circuit.batch import measured
from tests.run.test_transducer import REAL, fitted
from tests.said import printed, refusal

POWERS = {"SMBLTD45F28H": 50.0, "Skymen-60W": 50.0, "MA40S4S": 0.5}
AIR = "MA40S4S"  # settles in 1 ms
SLOW = [pytest.param(name, marks=[pytest.mark.soak] if name != AIR else []) for name in POWERS]


def spec_of(device: pr.Motor, network: str = "inductor", **target: object) -> pr.DriverSpec:
    drive = pr.default_drive(device).updated({"voltage": 1.0})
    return pr.DriverSpec(drive, "full-bridge", network, rail=48.0, **target)  # type: ignore[arg-type]


def by_hand(design: Design, name: str, folder: Path, more_ohm: float = 0.0) -> float:
    """Return the amplitude of the motional current behind the fundamental of a bridge on 48 V."""
    ohm, henry, farad, clamped = REAL[name]
    driver = design.driver
    network, turns = driver.values("a", driver.network), driver.values("a", "transformer")
    prefix = "series_" if driver.network == "llcc" else ""
    primary, on = turns["magnetizing"], {"IRF530": 0.32, "IRF610": 3.0}[driver.mosfet]
    deck = [
        f"{name} by hand", f"V1 s 0 DC 0 AC {4.0 / pi * 48.0!r}", f"R1 s p {on + turns['primary_resistance']!r}",
        f"Lp p 0 {primary!r}", f"Ls q 0 {primary * turns['ratio'] ** 2!r}", f"K1 Lp Ls {turns['coupling']!r}",
        f"R2 q k {turns['secondary_resistance'] + network[f'{prefix}resistance']!r}",
        f"L0 k j {network[f'{prefix}inductance']!r}", f"Cs j pin {network[f'{prefix}capacitance']!r}",
        f"Rs j pin {network['bleeder']!r}", f"Cp pin 0 {network.get('parallel_capacitance', 1e-15)!r}",
        f"Lx pin 0 {network.get('parallel_inductance', 1e9)!r}",  # 1 H where there is none
        f"C0 pin 0 {clamped!r}", f"L1 pin m {henry!r}", f"C1 m r {farad!r}", f"R3 r i {ohm + more_ohm!r}", "Vi i 0 0",
        f".ac lin 3 {driver.frequency - 1.0!r} {driver.frequency + 1.0!r}",
        f".measure ac current FIND i(Vi) AT={driver.frequency!r}", ".end",
    ]  # fmt: skip
    (own := folder / f"deck{more_ohm:g}").mkdir()
    real = measured("\n".join(deck), own)["current"]  # .measure gives real parts
    deck[1] += " 90"
    return hypot(real, measured("\n".join(deck), own)["current"])


@pytest.mark.parametrize("full", [1.0, 20.0])
@pytest.mark.parametrize("name", SLOW)
def test_power_is_that_of_a_hand_written_deck(tmp_path: Path, name: str, full: float) -> None:
    device, wanted, tool = fitted(tmp_path, name), POWERS[name], (full - 1.0) * REAL[name][0]
    spec = spec_of(device, "llcc" if tool else "inductor", power=wanted, load_range=(1.0, full) if tool else None)
    design = design_driver(device, spec)
    report = pr.drive_report(device, design, events=tool > 0.0)
    assert report.design.feasible, report.design.reason
    found, current = (
        report.to_dict()["load_power_w" if tool else "damping_loss_w"],
        by_hand(design, name, tmp_path, tool),
    )
    assert found == pytest.approx(0.5 * (tool or REAL[name][0]) * current**2, rel=0.01)
    assert found == pytest.approx(wanted, rel=0.05)
    assert {point.state for point in design.points} >= {"-0.5 % frequency", "+0.5 % frequency"}
    if tool:
        assert by_hand(design, name, tmp_path) == pytest.approx(current, rel=PIN_BAND)  # idle
        assert {*report.events} == {"load step", "load off", "stop", "frequency sweep"}


def test_what_is_possible_is_said_and_is_possible(tmp_path: Path) -> None:
    device = fitted(tmp_path, "SMBLTD45F28H")
    found = design_driver(device, spec_of(device, current=1.0, load_range=(1.0, 20.0)))
    assert not found.feasible
    assert found.reason.endswith("470\N{NO-BREAK SPACE}mA are possible, before the run.")
    assert design_driver(device, spec_of(device, current=0.47, load_range=(1.0, 20.0))).feasible


def test_at_the_antiresonance_a_voltage_keeps_the_current(tmp_path: Path) -> None:
    name = "Skymen-60W"
    device, (ohm, henry, farad, clamped) = fitted(tmp_path, name), REAL[name]
    both = farad * clamped / (farad + clamped)
    assert resonance(device, "parallel") == pytest.approx(1.0 / (2.0 * pi * sqrt(henry * both)), rel=1e-9)
    design = design_driver(device, spec_of(device, current=0.1, at="parallel", load_range=(1.0, 20.0)))
    assert design.feasible
    assert by_hand(design, name, tmp_path) == pytest.approx(0.1, rel=0.02)
    assert by_hand(design, name, tmp_path, 19.0 * ohm) == pytest.approx(0.1, rel=0.02)


def test_what_is_possible_keeps_the_junction_of_the_mosfet_below_its_limit(tmp_path: Path) -> None:
    """R I² of an IRF530 in free air: 62 K/W · 0.16 Ω · I² is 150 K at 3.89 A, in a sine 7.8 A from peak to zero."""
    device = fitted(tmp_path, "SMBLTD45F28H")
    spec = spec_of(device, "llcc", power=660.0, load_range=(1.0, 20.0))
    found = design_driver(device, spec)
    assert "RMS 18.3 A, continuous 14 A, junction" in found.reason
    possible = float(re.findall(r"(\d+)\N{NO-BREAK SPACE}W are possible", found.reason)[0])
    best = design_driver(device, replace(spec, power=possible))
    assert best.feasible
    mosfet = next(part for part in best.parts if part.name.startswith("MOSFET"))
    assert 3.5 < mosfet.rms_current_a < sqrt(150.0 / (62.0 * 0.16))


def test_an_idle_device_at_its_antiresonance_asks_for_a_load(tmp_path: Path) -> None:
    device = fitted(tmp_path, "SMBLTD45F28H")
    found = design_driver(device, spec_of(device, power=50.0, at="parallel"))
    assert found.reason.startswith("The device runs idle at its antiresonance, and its pins need 3.9")
    assert "by [load] in its file or --load-range, or take --at series." in found.reason


def test_the_supply_of_a_device_with_a_load_in_its_file_rises_slowly(tmp_path: Path) -> None:
    """With a rise of 20 µs the coil has 2.1 kV at power-up."""
    fitted(tmp_path, "SMBLTD45F28H")
    path = tmp_path / "SMBLTD45F28H.toml"
    path.write_text(f"{path.read_text(encoding='utf-8')}\n[load]\nresistance_ohm = 381\n", encoding="utf-8")
    device = pr.load_motor(path)
    design = design_driver(device, spec_of(device, power=50.0, at="parallel"))
    assert design.driver.supply_rise_s == pytest.approx(3.0 * device.loaded_stator.decay_s)
    report = pr.drive_report(device, design)
    assert report.design.feasible, report.design.reason
    coil = next(part for part in report.bill if part.name.startswith("series coil"))
    assert coil.peak_voltage_v < 1e3


def test_an_llcc_filter_is_tuned_to_twice_the_frequency_and_its_bleeder_takes_a_thousandth(tmp_path: Path) -> None:
    device = fitted(tmp_path, "SMBLTD45F28H")
    design = design_driver(device, spec_of(device, "llcc", power=50.0))
    assert design.feasible, design.reason
    values, frequency = design.driver.values("a", "llcc"), device.modes[0].frequency_hz
    clamped = values["parallel_capacitance"] + REAL["SMBLTD45F28H"][3]
    resonance_hz = 1.0 / (2.0 * pi * sqrt(values["series_inductance"] * clamped))
    assert resonance_hz == pytest.approx(2.0 * frequency, rel=0.05)  # parts of E12 and E24
    assert values["bleeder"] * 2.0 * pi * frequency * values["series_capacitance"] == pytest.approx(1000.0, rel=0.2)


@pytest.mark.soak
@pytest.mark.parametrize("network", ["inductor", "llcc"])
def test_an_llcc_filter_of_a_low_impedance_weakens_harmonics_that_a_coil_amplifies(
    tmp_path: Path, network: str
) -> None:
    device = fitted(tmp_path, "SMBLTD45F28H")
    report = pr.drive_report(device, spec_of(device, network, power=50.0))
    assert report.design.feasible, report.design.reason
    # charged at the start, the capacitor in series leaves no offset; its bleeder takes a thousandth of its current
    pin = report.operating.groups["a"]
    harmonics = sqrt(0.5 * sum(harmonic.voltage_v**2 for harmonic in pin.harmonics))
    assert pin.voltage_rms_v == pytest.approx(harmonics, rel=5e-3)
    assert report.operating.losses_w[f"{network}_a.bleeder"] < 0.005 * report.operating.motor_power_w
    if network == "inductor":
        assert pin.voltage_thd > 0.6
        assert any("THD of" in caution and "harmonic 7 at 195" in caution for caution in report.cautions)
        return
    assert pin.voltage_thd < 0.45
    assert not any("THD" in caution for caution in report.cautions)


def test_a_core_is_that_of_the_current_behind_the_network_or_the_reason(tmp_path: Path) -> None:
    """Of a kept current the idle arm has 10 V there, not the 205 V under load, with which its current would be 24 A."""
    device = fitted(tmp_path, "SMBLTD45F28H")
    design = design_driver(device, spec_of(device, "llcc", power=50.0, load_range=(1.0, 20.0)))
    assert design.cores["a"].name == "RM 12"
    drive = spec_of(device).drive
    found = design_driver(device, pr.DriverSpec(drive, "half-bridge", rail=400.0, power=2000.0), seeks=False)
    assert found.driver is None
    assert found.reason.startswith("No core of the list takes the 10.87\N{NO-BREAK SPACE}A RMS of the primary")


def test_show_and_map_of_a_transducer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    fitted(tmp_path, AIR)
    path = str(tmp_path / f"{AIR}.toml")
    assert printed(["show", path], capsys)["arms"]["arm1"]["inductance_h"] == pytest.approx(REAL[AIR][1])
    axes = ("--over=drive.voltage=10,20", "--over=load.resistance_ohm=0,643.186339335", "--set=load.mode=arm1")
    best = printed(["map", path, *axes, "--limit=motional_current_amplitude_a_a=0.02"], capsys)["best"]
    assert best["drive.voltage"] == 20.0
    assert best["load_power_w"] == pytest.approx(0.125 * 20.0**2 / (2.0 * 643.186339335) * 2.0, rel=1e-3)
    monkeypatch.setattr(task, "_code_sha256", lambda: "of an edited file")  # workers have the hash of the real file
    assert "other versions" in refusal(["map", path, "--over=drive.voltage=10,20"], capsys, status=3)
