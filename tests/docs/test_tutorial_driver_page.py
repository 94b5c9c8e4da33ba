# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/tutorial_driver.md: the whole flow, from a specification to a deck, parts and a margin."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.motor.equivalent import EquivalentCircuit, MotionalArm
from tests.docs.test_pages import commands, run_decks

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorial_driver.md"
TEXT = PAGE.read_text(encoding="utf-8")
GUIDE = PAGE.with_name("drive.md").read_text(encoding="utf-8")
PART = {
    "transformer, turns": ("transformer, group {}, turns secondary to primary", 1.0),
    "series coil": ("series coil, group {}", 1e3),
    "series capacitor": ("series capacitor, group {}", 1e9),
    "bleeder": ("bleeder, group {}", 1e-3),
}


def row(name: str) -> list[float]:
    """Return the numbers in the cells of a row."""
    (line,) = re.findall(rf"^\|{name}\|(.+)\|$", TEXT, re.M)
    return [float(number) for number in re.findall(r"(?<![\w:])\d+\.?\d*(?=[ |]|$)", line.replace("1 :", ""))]


@pytest.mark.parametrize(("name", "speed"), [("stall", 0.0), ("20 rad/s", 20.0), ("no load", None)])
def test_the_page_has_the_currents_and_powers_of_both_groups(name: str, speed: float | None) -> None:
    motor = pr.load_motor("bimodal40")
    state = pr.steady_state(motor, pr.default_drive(motor), speed=speed)
    found = [
        scale * state.quantities[f"{quantity.format(group)}"]
        for group in "ab"
        for quantity, scale in (("current_{}_rms_a", 1e3), ("power_{}_w", 1.0), ("apparent_power_{}_va", 1.0))
    ]
    assert row(name) == pytest.approx(found, abs=0.051, rel=2e-3)


@pytest.mark.soak
def test_the_tutorial_leads_to_a_deck_parts_and_a_margin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    circuit = EquivalentCircuit((MotionalArm(20.07, 72.47e-3, 448.4e-12),), 3.012e-9, 0.0, 28e3)
    frequency = np.linspace(26.5e3, 31e3, 1501)
    pr.Spectrum(frequency, circuit.admittance(frequency)[:, None, None]).save("bl28.csv")
    answers: dict[str, Any] = {}
    for command in commands(PAGE):
        name, *words = shlex.split(command)[1:]
        store = ["--store", str(tmp_path / "store")] if name == "sweep" else []
        assert run([name, *words, *store, "--json"]) == 0, command
        answers[name if words[0] != "bl28.toml" else f"{name} transducer"] = json.loads(capsys.readouterr().out)
    run_decks(PAGE, tmp_path)
    (arm,), state = answers["fit"]["arms"], answers["steady transducer"]
    assert f"({arm['resistance_ohm']:.4g} Ω, {1e3 * arm['inductance_h']:.4g} mH, " in TEXT
    assert f"{state['power_w']:.4g} W and {1e3 * state['motional_current_amplitude_a_a']:.4g} mA" in TEXT
    assert answers["track transducer"]["locked"]
    generator = answers["drive transducer"]
    loaded, idle = (1e3 * point["motional_current_a"] for point in generator["design"]["points"][:2])
    assert f"{generator['load_power_w']:.3g} W of load power" in TEXT.replace("50.0", "50")
    assert f"{loaded:.0f} mA under load and {idle:.0f} mA idle" in TEXT
    for name, volts in re.findall(r"(load step|load off|stop|frequency sweep) ([\d.]+) V", TEXT):
        assert float(volts) == pytest.approx(generator["events"][name]["voltage_a_v"], rel=0.02)
    design, margin = answers["drive"]["design"], answers["sweep"]
    assert design["feasible"]
    assert design["starts"]
    parts = {part["name"]: part for part in design["parts"]}
    for title, (name, scale) in PART.items():
        groups = [parts[name.format(group)] for group in "AB"]
        values = [scale * part["value"] for part in groups]
        volts, amps = (max(part[f"peak_{key}"] for part in groups) for key in ("voltage_v", "current_a"))
        unit = 1.0 if title.startswith("transformer") else 1e3
        assert row(title) == pytest.approx([*values, volts, unit * amps], rel=0.04), title
    for name, point in zip(("stall", "20 rad/s", "no load"), design["unmatched"], strict=False):
        found = [1e-3 * point[group][f"{part}_ohm"] for group in "ab" for part in ("resistance", "reactance")]
        assert "|{}|{:.2f} + {:.2f}j|{:.2f} + {:.2f}j|".format(name, *found) in GUIDE
    assert margin["yield"]["good"] == margin["yield"]["points"] == 8
    assert f"at least {1e3 * min(map(min, margin['quantities']['torque_n_m'])):.0f} mN·m" in TEXT
