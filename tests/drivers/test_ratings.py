# SPDX-License-Identifier: GPL-3.0-or-later
"""What the parts of a driver bear beside their peaks, against equations that are solved by hand."""

from __future__ import annotations

from functools import cache
from math import pi, sqrt
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.loads import PartLoad
from pyspice_runner.drivers.report import DriveReport

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
        "+ id_max=20m Rthjc=3.5 rth_ext=2k te_max=30)\n"
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
    assert caution.endswith("or lower the voltage, or lower case_ambient_k_per_w by a heat sink.")
    assert "EXCEEDED: peak " in found.summary()["MOSFET small, group A"]
    with pytest.raises(pr.ParameterError, match="drain_a has no effect on a linear"):
        pr.Driver(kind="linear", voltage=50.0, frequency=FREQUENCY, drain_a=1.0)
