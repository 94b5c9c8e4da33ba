# SPDX-License-Identifier: GPL-3.0-or-later
"""The page that compares simulators: every point is there, and no error is larger than allowed.

``make verilog-a`` measures a part of the page again.
"""

from __future__ import annotations

from pathlib import Path

from tests.run.test_reference import POINTS

PAGE = (Path(__file__).parents[2] / "docs" / "simulators.md").read_text(encoding="utf-8")
ROWS = {cells[1].strip(): [cell.strip() for cell in cells[2:-1]] for cells in (
    line.split("|") for line in PAGE.splitlines() if line.startswith("| ")
)}  # fmt: skip
PAIRS = {name: [tuple(float(value) for value in cell.split("/")) for cell in ROWS[name]] for name in POINTS}


def test_every_operating_point_ran_in_four_simulators() -> None:
    assert all(len(cells) == 4 for cells in PAIRS.values())
    assert [heading.split(",")[0].split(" ")[0] for heading in ROWS["operating point"]] == ["ngspice"] * 3 + ["VACASK"]


def test_no_error_is_larger_than_required() -> None:
    assert max(path for cells in PAIRS.values() for path, _ in cells) < 0.5  # per cent
    assert max(speed for cells in PAIRS.values() for _, speed in cells) < 1.0


def test_the_simulators_agree_as_the_page_says() -> None:
    for cells in PAIRS.values():
        paths, speeds = ([cell[column] for cell in cells] for column in (0, 1))
        assert max(paths) - min(paths) < 0.0021 + 0.0005  # the digits printed
        assert max(speeds) - min(speeds) < 0.25
        assert abs(speeds[0] - speeds[2]) < 0.01  # B-sources and compiled module take the same steps


def test_admittances_are_the_closed_form() -> None:
    admittances = [float(cell) for cells in ROWS.values() for cell in cells if "e-" in cell]
    assert len(admittances) == 12
    assert max(admittances) < 1e-6
