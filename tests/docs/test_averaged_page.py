# SPDX-License-Identifier: GPL-3.0-or-later
"""The accuracy of the averaged motor on its page: a part of it, measured again."""

from __future__ import annotations

from pathlib import Path
from runpy import run_path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
SCRIPT = run_path(str(DOCS / "averaged_accuracy.py"))
ALLOWED = SCRIPT["ALLOWED"]
LINES = (DOCS / "accuracy.md").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("case", [0, pytest.param(1, marks=pytest.mark.soak)])
def test_a_row_of_the_page_is_what_is_measured(case: int) -> None:
    for row in SCRIPT["rows"]((case,)):
        start = f"|{row.name}|{row.drive.label}|{row.speed:g}|"
        (line,) = (line for line in LINES if line.startswith(start))
        full, averaged, error, _, verdict = (cell.strip() for cell in line.removeprefix(start).split("|")[:5])
        assert verdict == row.verdict
        if row.sticks:
            assert error == "–"
            continue
        # four digits are printed
        assert float(full) == pytest.approx(1e3 * row.full, rel=2e-3)
        assert float(averaged) == pytest.approx(1e3 * row.averaged, rel=2e-3)
        assert float(error) == pytest.approx(100.0 * row.error, abs=0.1)
        if row.verdict == "yes":
            assert abs(row.error) <= ALLOWED


EVENTS = [(name, event) for name, *_ in SCRIPT["MOVING"] for event in SCRIPT["TRANSIENTS"]]


@pytest.mark.soak  # test_track_averaged.py compares a transient with the full motor too
@pytest.mark.parametrize("case", EVENTS)
def test_a_transient_of_the_page_is_what_is_measured(case: tuple[str, str]) -> None:
    (row,) = SCRIPT["transients"]((case,))
    (line,) = (line for line in LINES if line.startswith(f"|{row.name}|{row.event}|"))
    assert float(line.split("|")[4]) == pytest.approx(100.0 * row.error, abs=0.1)
    assert row.error <= SCRIPT["ALLOWED_TRANSIENT"]


LOOPS = run_path(str(DOCS / "averaged_loops.py"))


def test_a_loop_of_the_page_is_trusted_as_there_and_not_in_a_limit_cycle() -> None:
    """One that is trusted, one that is not, and a limit cycle; the soak has all."""
    for name, row in LOOPS["read"]()["samples"].items():
        if name.startswith(("reversal", "position")):
            continue
        run = LOOPS["LOOPS"][name](True)
        assert run.trusted == row["trusted"]
        assert any("limit cycle" in caution for caution in run.cautions) == name.startswith("limit cycle")


@pytest.mark.soak
@pytest.mark.parametrize("name", LOOPS["LOOPS"])
def test_a_loop_of_the_page_is_what_is_measured(name: str) -> None:
    then, again = LOOPS["read"]()["samples"][name], LOOPS["compared"](name)
    assert again == pytest.approx(then, rel=0.05, abs=1e-3)  # two digits are printed
