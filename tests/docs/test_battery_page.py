# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/tutorial_battery.md: the whole flow, from a specification to a deck, parts and a margin, in under a minute."""

from __future__ import annotations

import csv
import json
import re
import resource
import shlex
from pathlib import Path

import pytest

from pyspice_runner.cli import run
from tests.docs.test_pages import commands

PAGE = Path(__file__).resolve().parents[2] / "docs" / "tutorial_battery.md"
CPU = 60.0  # s, of all processes together: then it takes less than a minute on an idle machine


def cpu_s() -> float:
    """The time in s of this process and of those that it has ended."""
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in uses)


@pytest.mark.soak
def test_the_tutorial_leads_from_a_battery_to_a_deck_parts_and_a_margin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    begun, text, answers = cpu_s(), PAGE.read_text(encoding="utf-8"), []
    for command in commands(PAGE):
        store = ["--store", str(tmp_path / "store")] if " sweep " in command else []
        assert run([*shlex.split(command)[1:], *store, "--json"]) == 0, command
        answers.append(json.loads(capsys.readouterr().out))
    seconds = cpu_s() - begun
    steady, driver, margin = answers
    assert steady["stable"]
    assert f"It gives {1e3 * steady['torque_n_m']:.0f} mN·m" in text
    design = driver["design"]
    assert design["feasible"]
    assert design["starts"]
    parts = {part["name"]: part for part in design["parts"]}
    for group, column in (("A", 1), ("B", 2)):
        for row, name, scale, digits in (
            ("transformer, turns", "transformer, group {}, turns secondary to primary", 1.0, 2),
            ("series coil", "series coil, group {}", 1e3, 1),
            ("series capacitor", "series capacitor, group {}", 1e9, 1),
            ("bleeder", "bleeder, group {}", 1e-3, 0),
        ):
            cells = re.search(rf"^\| {row} \|(.+)\|$", text, re.M)
            assert cells
            stated = cells.group(1).split("|")[column - 1].strip().removeprefix("1 : ").split()[0]
            assert stated == f"{scale * parts[name.format(group)]['value']:.{digits}f}"
    for part, words in (("MOSFET IRF530", "24 V, {:.2f} A"), ("supply vp", "and {:.2f} A of the supply")):
        peak = max(parts[f"{part}, group {group}"]["peak_current_a"] for group in "AB")
        assert words.format(peak) in text
    assert "Vvp_a" in (tmp_path / "driver.cir").read_text(encoding="utf-8")
    assert (tmp_path / "driver.png").stat().st_size > 20_000
    assert margin["yield"]["good"] == margin["yield"]["points"] == 8
    with (tmp_path / "margin.csv").open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == 8
    assert f"at least {1e3 * min(map(min, margin['quantities']['torque_n_m'])):.0f} mN·m" in text
    assert seconds < CPU
