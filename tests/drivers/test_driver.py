# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers: what they are made of and refuse, the transistor against its data sheet, and that every one powers up."""

import random
import re
from itertools import product
from math import e, pi, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.parts import MOSFETS, ratings, suited
from pyspice_runner.drivers.report import DriveReport
from pyspice_runner.run.point import Point
from pyspice_runner.spice.library import definitions, library_names, read_library
from tests.circuit.batch import measured
from tests.circuit.test_decks import measured as deck_measured
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("drivers")

KINDS = ("linear", "half-bridge", "full-bridge", "push-pull")
NETWORKS = ("none", "inductor", "llcc")


def driver(kind: str = "linear", **values: Any) -> pr.Driver:
    return pr.Driver(**{"kind": kind, "voltage": 50.0, "frequency": 51.7e3, **values})


# --- the transistor ------------------------------------------------------------------------------------------


class Sheet(NamedTuple):
    """What a data sheet states."""

    on_ohm: float  # at 10 V, greatest
    on_a: float  # at this current
    transconductance_s: float  # at that current, least
    diode_v: float  # greatest
    diode_a: float
    input_pf: float  # typical at 25 V
    output_pf: float
    reverse_pf: float
    gate_nc: float  # greatest, to 10 V
    gate_v: float
    gate_a: float


# Vishay 91023, 91019 and 91059
SHEETS = {
    "IRF610": Sheet(1.5, 2.0, 0.8, 2.0, 3.3, 140.0, 53.0, 15.0, 8.2, 160.0, 3.3),
    "IRF530": Sheet(0.16, 8.4, 5.1, 2.5, 14.0, 670.0, 250.0, 60.0, 26.0, 80.0, 14.0),
    "IRF820": Sheet(3.0, 1.5, 1.5, 1.6, 2.5, 360.0, 92.0, 37.0, 24.0, 400.0, 2.1),
}


def transistor(part: str) -> str:
    lines = ratings(part).library.subcircuit.splitlines()
    return next(line for line in lines if line.startswith(f".model {part.lower()}"))


def test_each_transistor_stands_once_and_its_ratings_are_those_of_its_data_sheet() -> None:
    assert set(SHEETS) == set(MOSFETS)
    for part, sheet in SHEETS.items():
        files = [name for name in library_names() if f".model {part.lower()}" in read_library(name).text]
        assert len(files) == 1
        assert ratings(part).on_resistance_ohm == sheet.on_ohm
        assert ratings(part).gate_charge_nc == sheet.gate_nc
    assert [ratings(part).breakdown_v for part in MOSFETS] == [100.0, 200.0, 500.0]


def test_the_mosfet_of_a_design_takes_the_voltage_and_has_the_least_loss() -> None:
    """24 V at 50 kHz: the IRF530 saves 0.67 Ω I² and loses 200 nJ more in its capacitance, which pays above 122 mA."""
    assert [suited(24.0, 24.0, amperes, 50e3) for amperes in (0.115, 0.13)] == ["IRF610", "IRF530"]
    assert [suited(volts, volts, 0.01, 50e3) for volts in (181.0, 450.0, 451.0)] == ["IRF820", "IRF820", None]


@pytest.mark.parametrize("part", SHEETS)
def test_transistor_has_the_static_values_of_its_data_sheet(part: str, tmp_path: Path) -> None:
    """On-resistance, transconductance and body diode of the sheet; 2 to 4 V at 250 µA.

    The transconductance is that between 98 and 102 % of the current of the sheet, which a source of the drain sets.
    """
    sheet, name = SHEETS[part], part.lower()
    found = measured(
        f"""static
{transistor(part)}
Vg1 g1 0 10
I1 0 d1 {sheet.on_a}
M1 d1 g1 0 {name}
I2 0 d2 250u
M2 d2 d2 0 {name}
I3 0 d3 PWL(0 {0.98 * sheet.on_a} 1 {1.02 * sheet.on_a})
Eg3 g3 0 d3 hold 1e3
Vhold hold 0 50
M3 d3 g3 0 {name}
I4 0 s4 {sheet.diode_a}
M4 0 s4 s4 {name}
.tran 10m 1
.measure tran on_v FIND v(d1) AT=0.5
.measure tran threshold_v FIND v(d2) AT=0.5
.measure tran less_v FIND v(g3) AT=0
.measure tran more_v FIND v(g3) AT=1
.measure tran diode_v FIND v(s4) AT=0.5
.end
""",
        tmp_path,
    )
    assert found["on_v"] / sheet.on_a == pytest.approx(sheet.on_ohm, rel=0.01)  # the sheet's digits
    assert 2.0 <= found["threshold_v"] <= 4.0
    slope = 0.04 * sheet.on_a / (found["more_v"] - found["less_v"])
    assert slope == pytest.approx(sheet.transconductance_s, rel=0.03)
    assert found["diode_v"] == pytest.approx(sheet.diode_v, rel=0.03)


@pytest.mark.parametrize("part", SHEETS)
def test_transistor_has_the_capacitances_of_its_data_sheet(part: str, tmp_path: Path) -> None:
    """Typical ones, at 25 V; all from what a change of 1 V/µs draws."""
    sheet, name = SHEETS[part], part.lower()
    found = measured(
        f"""capacitances
{transistor(part)}
Vd1 d1 0 25
Vg1 g1 0 PWL(0 -0.05 1n -0.05 101n 0.05)
M1 d1 g1 0 {name}
Vd2 d2 0 PWL(0 24.95 1n 24.95 101n 25.05)
Vg2 g2 0 0
M2 d2 g2 0 {name}
.tran 0.1n 100n
.measure tran gate_a FIND i(vg1) AT=51n
.measure tran reverse_a FIND i(vd1) AT=51n
.measure tran output_a FIND i(vd2) AT=51n
.end
""",
        tmp_path,
    )
    leakage = 25.0 / 100e6  # the model's, drain to source
    assert -found["gate_a"] == pytest.approx(1e-6 * sheet.input_pf, rel=0.01)  # the sheet's digits
    assert found["reverse_a"] + leakage == pytest.approx(1e-6 * sheet.reverse_pf, rel=0.01)
    assert -found["output_a"] - leakage == pytest.approx(1e-6 * sheet.output_pf, rel=0.01)


@pytest.mark.parametrize("part", SHEETS)
def test_transistor_takes_no_more_gate_charge_than_its_data_sheet_allows(part: str, tmp_path: Path) -> None:
    """To 10 V at the voltage and current of the sheet; 1 mA flows into the gate from 2 µs on."""
    sheet = SHEETS[part]
    found = measured(
        f"""gate charge
{transistor(part)}
Vdd dd 0 PWL(0 0 1u {sheet.gate_v})
Rd dd d {sheet.gate_v / sheet.gate_a}
Ig 0 g PWL(0 0 2u 0 2.001u 1m)
Shold g 0 control 0 hold
.model hold sw vt=0.5 ron=1 roff=1e12
Vcontrol control 0 PWL(0 1 2u 1 2.001u 0)
M1 d g 0 {part.lower()}
.tran 1n {2.0 + 1.2 * sheet.gate_nc}u uic
.measure tran charged_s WHEN v(g)=10 RISE=1
.end
""",
        tmp_path,
    )
    assert 0.35 * sheet.gate_nc < (found["charged_s"] - 2e-6) * 1e6 < sheet.gate_nc  # nC: typical values are a half


@pytest.mark.parametrize(
    ("dead_time", "edge"),
    mostly(
        pytest.mark.soak,
        [(40e-9, 5e-9), (200e-9, 5e-9), (200e-9, 25e-9), (2e-6, 5e-9), (2e-6, 1e-7)],
        [(2e-6, 1e-7)],
    ),
)
@pytest.mark.soak
def test_dead_time_and_edges_of_the_gates_are_those_of_the_settings(
    dead_time: float, edge: float, tmp_path: Path
) -> None:
    """From half voltage of the one gate driver to half voltage of the other; edges from 10 to 90 %, within 6 %.

    The ramp is an exponential, whose slope changes by up to a quarter over an edge of an eighth of the dead time, and
    steps of 0.2 ns are a part of an edge.
    """
    library = read_library("driver_half_bridge")
    found = measured(
        f"""dead time
{definitions(library)}
Vin in 0 PULSE(1 -1 20u 1n 1n 20u 40u)
Vp vp 0 PWL(0 0 1u 40)
Xbridge in 0 out vp 0 driver_half_bridge dead_time={dead_time!r} gate_edge={edge!r}
Bhigh rail 0 V=V(xbridge.drive_high,out)
Rload out 0 100
.tran 1n 25u 19u 0.2n uic
.measure tran between_s TRIG v(rail) VAL=6 FALL=1 TARG v(xbridge.drive_low) VAL=6 RISE=1
.measure tran fall_s TRIG v(rail) VAL=10.8 FALL=1 TARG v(rail) VAL=1.2 FALL=1
.measure tran rise_s TRIG v(xbridge.drive_low) VAL=1.2 RISE=1 TARG v(xbridge.drive_low) VAL=10.8 RISE=1
.end
""",
        tmp_path,
    )
    assert found["between_s"] == pytest.approx(dead_time, abs=0.1 * edge + 1e-9)  # the control falls in 1 ns
    assert (found["fall_s"], found["rise_s"]) == pytest.approx((edge, edge), rel=0.06)


@pytest.mark.parametrize("kind", mostly(pytest.mark.soak, KINDS[1:], ["full-bridge"]))
def test_a_run_has_points_where_the_comparators_of_a_bridge_switch(kind: str) -> None:
    """They are within 1 mV of zero, or of the level of a full bridge, whose legs have controls of opposite sign."""
    level = 0.5 if kind == "full-bridge" else 0.0
    settings = {"bridge.level": level} if level else {}
    bridge = driver(kind, phase_deg=62.0, settings=settings)
    run = Point.of(pr.load_motor("andersen2002"), bridge, contact=None).run(5.0 * bridge.period, ["v(a)"])
    time = run.vectors()["time"]
    for ahead, sign, side in product((0.0, 62.0), (1.0, -1.0) if level else (1.0,), (-1e-3, 1e-3)):
        angle = np.arcsin(sign * (level + side))
        for phase in (angle, pi - angle):
            edges = ((phase / (2.0 * pi) - ahead / 360.0) % 1.0 + np.arange(1.0, 4.0)) * bridge.period
            # 1 % of the 6 ns in which a comparator switches; the corners are where the sine would be straight
            assert np.abs(time[:, np.newaxis] - edges).min(axis=0) == pytest.approx(0.0, abs=0.06e-9)


def test_a_gate_resistance_that_differs_by_1e_9_does_not_change_the_steps_at_the_edges_of_a_bridge() -> None:
    """From one corner on they would differ by themselves, since each edge would multiply rounding errors by 10⁵."""
    runs = []
    for ohm in (22.0, 22.0 * (1.0 + 1e-9)):
        bridge = driver("half-bridge", frequency=40.7e3, settings={"bridge.gate_resistance": ohm})
        runs.append(Point.of(pr.load_motor("bimodal40"), bridge, contact=None).run(2.0 * bridge.period, ["v(a)"]))
    ours, theirs = (run.vectors()["time"] for run in runs)
    assert ours == pytest.approx(theirs, abs=1e-4 * np.diff(ours).max(), rel=0.0)


def test_a_bleeder_discharges_a_pin_that_a_series_capacitor_isolates(tmp_path: Path) -> None:
    """10 V on 2 nF of a group behind 2 nF in series: 10 kΩ takes it to 10 V/e in 40 µs; without it it stays.

    2000 steps of the trapezoidal rule in a time constant; 1 µH is 1e-4 of it.
    """
    head = "driver_inductor inductance=10u capacitance=2n start_voltage=-10"
    lines = []
    for pin, bleeder in (("bled", "10k"), ("kept", "1e12")):
        lines += [f"X{pin} 0 {pin} {head} bleeder={bleeder}", f"C{pin} {pin} 0 2n ic=10"]
        lines += [f".measure tran {pin}_v FIND v({pin}) AT=40u"]
    library = definitions(read_library("driver_inductor"))
    found = measured("\n".join(["bleeder", library, *lines, ".tran 20n 40u 0 20n uic", ".end", ""]), tmp_path)
    assert found["bled_v"] == pytest.approx(10.0 / e, rel=2e-3)
    assert found["kept_v"] == pytest.approx(10.0, rel=1e-6)


def test_supply_follows_from_the_voltage_asked_for() -> None:
    assert driver("half-bridge").rails("a") == pytest.approx((50 * pi / 4, -50 * pi / 4))
    full = driver("full-bridge", settings={"transformer.ratio": 4.0, "bridge.level": 0.5})
    assert full.rails("b") == pytest.approx((50 * pi / 4 / 4 / sqrt(0.75), 0.0))
    assert driver("linear", supply_v=80.0).rails("a") == (80.0, -80.0)
    assert driver("ideal").rails("a") == (0.0, 0.0)


@pytest.mark.parametrize(
    ("kind", "changes", "sentence"),
    [
        ("linear", {"frequency": 1.0}, "frequency = 1 Hz is not valid: it must be a number ≥ 1000"),
        ("quarter-bridge", {}, "kind = 'quarter-bridge' is not valid"),
        ("linear", {"volts": 5.0}, "there is no 'volts'. Did you mean 'voltage'?"),
        ("linear", {"settings": {"amplifier.slew": 1.0}}, "no parameter 'slew'. Did you mean 'slew_rate'?"),
        ("linear", {"settings": {"bridge.dead_time": 1e-6}}, "no part 'bridge' in this linear; its parts: amplifier."),
        ("linear", {"settings": {"amplifier.gain": 0.0}}, "gain = 0 is not valid: it must be 0.1 to 1000."),
        ("half-bridge", {"settings": {"bridge.dead_time": 1e-9}}, "dead_time = 1e-09 s is not valid"),
        ("half-bridge", {"voltage": 120.0}, "188.5 V between the rails of the half-bridge of group A are too high"),
        ("half-bridge", {"frequency": 4e5, "settings": {"bridge.dead_time": 6e-7}}, "at most a fifth of a period"),
        (
            "push-pull",
            {"frequency": 4e5, "settings": {"bridge_b.dead_time": 6e-7}},
            "bridge_b.dead_time = 6e-07 s",
        ),
        ("half-bridge", {"settings": {"bridge.gate_edge": 3e-8}}, "at most an eighth of that, 2.5e-08 s"),
    ],
)
def test_errors_name_the_value_and_what_is_allowed(kind: str, changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        driver(kind, **changes)


@pytest.mark.parametrize(("kind", "label"), [("full-bridge", "transformer"), ("push-pull", "bridge")])
def test_the_capacitance_of_a_winding_raises_the_voltage_behind_the_leakage(kind: str, label: str) -> None:
    """By 1/(1 − (f/f₀)²): test_library.py has that voltage in the circuit of the transformer."""
    settings = {f"{label}.ratio": 4.0, f"{label}.coupling": 0.99}
    plain = driver(kind, network="inductor", settings=settings)
    wound = plain.updated({f"{label}.winding_capacitance": 1e-9})
    leakage = 5e-3 * 16.0 * (1.0 - 0.99**2)
    resonance = 1.0 / (2.0 * pi * sqrt(leakage * 1e-9))
    assert wound.transformer_resonance("a") == pytest.approx(resonance)
    raised = 1.0 / (1.0 - (plain.frequency / resonance) ** 2)
    assert wound.fundamental("a") == pytest.approx(raised * plain.fundamental("a"))
    inductances = [one.equivalent.setting("inductor.inductance") for one in (wound, plain)]
    assert inductances[0] - inductances[1] == pytest.approx((raised - 1.0) * leakage)
    with pytest.raises(pr.ParameterError, match="below the drive"):
        _ = wound.updated({"frequency": 130e3}).equivalent


# --- decks ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "drive_linear",
        # test_drive.py has the balance of both bridges
        *(
            pytest.param(name, marks=pytest.mark.soak)
            for name in ("drive_full_bridge", "drive_half_bridge", "drive_llcc")
        ),
    ],
)
def test_powers_of_the_decks_balance_within_one_per_cent(name: str, tmp_path: Path) -> None:
    found = deck_measured(name, tmp_path)
    power_in = found["supply_power_w"] + found.get("gate_power_w", 0.0)
    assert found["driver_loss_w"] + found["motor_power_w"] == pytest.approx(power_in, rel=0.01)
    for group in ("a", "b"):  # each is made for 50 V at both groups; what parts and harmonics do to that
        assert found[f"voltage_{group}_rms_v"] == pytest.approx(50 / sqrt(2), rel=0.03)


# --- power-up over the whole range ---------------------------------------------------------------------------


def ranges(kind: str, network: str) -> dict[str, tuple[float, float]]:
    """Least and greatest value of everything that a driver may be set to."""
    plain = driver(kind, network=network)
    found = {
        f"{part.label}.{parameter.name}": (parameter.least, parameter.greatest)
        for part in plain.parts("a")
        for parameter in part.library.parameters
        if parameter.name in part.values
    }
    found["frequency"] = (1e3, 1e7)
    found["voltage"] = (0.1, 1000.0 if kind == "linear" else 100.0)
    found["phase_deg"] = (-360.0, 360.0)
    found["supply_rise_s"] = (1e-6, 1e-2)
    return found


def powered_up(kind: str, network: str, changes: dict[str, float]) -> DriveReport | None:
    """Run ten periods from power-up; ``None`` where the values exclude each other."""
    try:
        chosen = driver(kind, network=network).updated(changes)
    except pr.ParameterError as error:
        if not re.search("between the rails|dead_time|gate_edge", str(error)):
            raise
        return None
    motor = pr.load_motor("andersen2002")
    return pr.drive_report(motor, chosen, duration=10.0 / chosen.frequency, timeout=120.0)


PAIRS = list(product(KINDS, NETWORKS))


@pytest.mark.parametrize(
    ("kind", "network"),
    mostly(pytest.mark.soak, PAIRS, [("linear", "none"), ("half-bridge", "llcc"), ("full-bridge", "inductor")]),
)
def test_drivers_power_up_in_corners_of_their_ranges(kind: str, network: str) -> None:
    """A corner at which everything is at one end of its range at once, frequency aside; 1 kHz would take long."""
    generator = random.Random(f"{kind} {network}")
    ends = ranges(kind, network)
    report = None
    while report is None:
        corner = {name: generator.choice(end) for name, end in ends.items()} | {"frequency": 51.7e3}
        report = powered_up(kind, network, corner)
    assert abs(report.balance_residual) < 0.01, corner
