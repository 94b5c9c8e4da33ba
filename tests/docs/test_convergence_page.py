# SPDX-License-Identifier: GPL-3.0-or-later
"""Every row of the tables of docs/convergence.md is run again: the deck before the table, with the lines in the row."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from math import exp, log, pi
from pathlib import Path

import pytest

import pyspice_runner as pr
from pyspice_runner.cli import run
from pyspice_runner.spice.library import data_path
from pyspice_runner.spice.ngspice import ngspice_version

PAGE = (Path(__file__).parents[2] / "docs" / "convergence.md").read_text(encoding="utf-8")
UNITS = {"A": 1.0, "mA": 1e-3, "V": 1.0, "mW": 1e-3, "mrad/s": 1e-3, "mm/s": 1e-3}
MEASURED = "39"  # version of ngspice
NAMED = (".model", ".options", ".param")  # a line that replaces only the one with the same name behind its first word


def rows() -> Iterator[tuple[str, list[tuple[str, str]], dict[str, str]]]:
    """Yield for each row of a table the deck before it, what changes, and the results by name and unit.

    A change is a line and the name of the one that it replaces, empty for the line with its own name.
    """
    deck, header = "", [""]
    for part in re.findall(r"^```spice\n([^`]*)^```|^(\|.*\|)$|\((\.\./netlists/\w+\.cir)\)", PAGE, re.M):
        block, row, path = part
        if path:
            deck = (data_path("netlists") / Path(path).name).read_text(encoding="ascii")
        elif block:
            deck = block
        else:
            cells = [cell.strip() for cell in row.strip("|").split("|")]
            if cells[0] == "change":
                header = cells
            elif not cells[0].startswith("---"):
                yield (
                    deck,
                    re.findall(r"`([^`]+)`(?: instead of `(\w+)`)?", cells[0]),
                    dict(zip(header[1:], cells[1:], strict=True)),
                )


def first_words(line: str) -> tuple[str, ...]:
    return tuple(re.split(r"[ =(]+", line)[: 2 if line.startswith(NAMED) else 1])


def changed(deck: str, changes: list[tuple[str, str]]) -> str:
    lines = deck.splitlines()
    for change, old in changes:
        index = next((i for i, line in enumerate(lines) if first_words(line) == first_words(old or change)), None)
        if index is None:
            lines.insert(lines.index(".end"), change)
        else:
            lines[index] = change
    return "\n".join([*lines, ""])


VERSION = ngspice_version()
# which capacitance helps at the bridge leg depends on the version; tests/tools/ngspice46.py has that of ngspice 46
ROWS = [
    pytest.param(*row, id=str(number), marks=[pytest.mark.soak] if number % 4 else [])
    for number, row in enumerate(rows())
    if VERSION == MEASURED or not ("Shigh" in row[0] and "cshunt" in str(row[1]))
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("convergence")
    assert run(["export", "andersen2002", "--set", "mount=none", "--output", str(path / "motor.lib")]) == 0
    return path


@pytest.mark.parametrize(("deck", "changes", "results"), ROWS)
def test_a_row_of_the_page_is_what_ngspice_gives(
    deck: str, changes: list[tuple[str, str]], results: dict[str, str], folder: Path
) -> None:
    (folder / "deck.cir").write_text(changed(deck, changes), encoding="ascii")
    done = subprocess.run(
        ["ngspice", "-b", "deck.cir"], cwd=folder, capture_output=True, text=True, timeout=30, check=False
    )
    if "Timestep too small" in results.values():
        if done.returncode == 0 and VERSION != MEASURED:
            pytest.skip(f"ngspice {VERSION} finishes this deck, at which ngspice {MEASURED} stops")
        assert done.returncode != 0
        assert "Timestep too small" in done.stdout + done.stderr
        return
    assert done.returncode == 0, done.stdout + done.stderr
    found = dict(re.findall(r"^(\w+) *= +(\S+)", done.stdout, re.M))
    for name, value in results.items():
        quantity, unit = re.fullmatch(r"`(\w+)`, (\S+)", name).groups()  # type: ignore[union-attr]
        # three digits are printed; the steps at edges depend on round-off, and the currents of the supply on the steps
        tolerance = 5e-3 if quantity in ("driver_loss_w", "supply") else 1e-3
        if VERSION != MEASURED:  # other steps: 1 %, and the losses that a row shows to be wrong
            tolerance = 0.15 if quantity == "driver_loss_w" else 0.01
        expected = UNITS[unit] * float(value.replace("−", "-"))
        assert float(found[quantity]) == pytest.approx(expected, rel=tolerance, abs=1e-7), quantity


def test_the_page_has_failures_and_what_removes_them() -> None:
    failing = [changes for _, changes, results in rows() if "Timestep too small" in results.values()]
    assert len(failing) >= 5
    assert len(list(rows())) > 4 * len(failing)


def test_numbers_in_the_text_follow_from_the_motor_and_the_tables() -> None:
    text = re.sub(r"\s+", " ", PAGE)
    second = pr.load_motor("andersen2002").modes[1]
    shift = second.frequency_hz * (pi * second.frequency_hz * 1e-6) ** 2 / 3.0
    bandwidth = second.damping_n_s_per_m / (2.0 * pi * second.mass_kg)
    assert f"by {shift:.0f} Hz, half of its bandwidth of {10 * round(bandwidth / 10)} Hz" in text
    assert bandwidth == pytest.approx(2.0 * shift, rel=0.05)
    assert f"1/k = {1e9 / second.stiffness_n_per_m:.2f} nF" in text
    by_change = {str(row[1]): row[2] for row in rows()}
    exact = exp(-99.0 * pi / 1000.0)
    assert f"exp(−99 π/1000) = {exact:.4f}" in text
    gear = float(by_change["[('.options method=gear', '')]"]["`after_99_periods`, A"])
    assert f"Q falls from 1000 to {10 * round(-99.0 * pi / log(gear) / 10)}" in text
    told = [row["`driver_loss_w`, mW"] for row in by_change.values() if "`driver_loss_w`, mW" in row]
    own, base, tight, coarse, default, uniform = (float(loss) for loss in told if loss != "Timestep too small")
    assert f"are {100 * (own / base - 1):.2f} % above those with half of the step" in text
    assert f"{100 * (own / coarse - 1):.2f} % above those with ten times `abstol`" in text
    assert f"and {100 * (own / tight - 1):.1f} % above those with a tenth of `reltol`" in text
    worst, uneven = (f"{100 * (loss / base - 1):.0f} %" for loss in (default, uniform))
    assert f"`reltol` they are {worst} and with uniform steps {uneven} too high" in text
