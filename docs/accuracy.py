# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of ``docs/accuracy.md``: campaigns from their records, and the model against the independent integrator.

``python -m docs.accuracy`` measures the latter again, ``python -m docs.accuracy records`` reads the records only.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from runpy import run_path
from typing import Any

put = run_path(str(Path(__file__).with_name("tables.py")))["put"]
RECORDS = Path(__file__).resolve().parents[1] / "validation" / "records"
CAMPAIGNS = "|what is drawn at random|checked against|cases|result|record|"
POINTS_HEAD = "|operating point|trajectory, %|states|speed, %|energy|"
SHOWN = (
    "stick only", "mostly slip", "opens, contact resonance", "hammers, hardly pressed", "60 kHz", "two tones, octave",
    "another motor", "sprung, opens far",
)  # fmt: skip


def _lines(name: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (RECORDS / f"{name}.jsonl").read_text(encoding="utf-8").splitlines()]


def _summary(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((RECORDS / f"{name}.json").read_text(encoding="utf-8"))
    return found


def campaigns() -> list[str]:
    """Return the rows of the campaigns, from their records."""
    soak, pairs, held = _summary("soak"), _summary("contradictions"), _summary("held_points")
    runs = [run for line in _lines("runs") for run in line["runs"]]
    kept = sum(run["kind"] in ("kept", "within 1 %") for run in runs)
    states = [line["verdict"] for line in _lines("steady_states") if "verdict" in line]
    agreeing, unstable = states.count("agrees") + states.count("stays"), states.count("unstable")
    lifting = [line["verdict"] for line in _lines("lift_off") if line["counts"]]
    trusted, others = (
        [abs(row["steady_error"]) for row in _lines("averaged") if row["steady_error"] and row["trusted"] == trust]
        for trust in (True, False)
    )
    fits, hidden = _summary("fits").values(), _summary("hidden")
    stay = lifting.count("stays")
    trials = sum(row["trials"] for row in fits)
    by_motor = held["by_motor"].values()
    agree, by_friction, differ = (sum(row[kind] for row in by_motor) for kind in ("agrees", "held", "differs"))
    missed, extra = (sum(row[kind] for row in fits) for kind in ("missed", "extra"))
    rows = (
        ("all analyses, all parameters over their ranges", "physical audit", soak["cases"],
         f"{soak['results']} results, {soak['kinds']['simulation error']} errors with their cause", "soak"),
        ("one motor through two analyses", "each other", pairs["comparisons"],
         f"{pairs['kinds']['contradiction']} contradictions", "contradictions"),
        ("transients, all contact laws", "independent integrators", len(runs), f"{kept} accurate", "runs"),
        ("steady states", "settling", len(states),
         f"{agreeing} agree, {unstable} unstable, {len(states) - agreeing - unstable} refused", "steady_states"),
        ("steady states with lift-off", "long runs", len(lifting),
         f"{stay} stay, {lifting.count('said to be unstable')} unstable, {lifting.count('')} not found", "lift_off"),
        ("held shafts", "settling", held["cases"],
         f"{agree} agree, {by_friction} held by friction, {differ} differ", "held_points"),
        ("calibrations", "hidden values", hidden["cases"],
         f"{round(hidden['hold'] * hidden['intervals'])} of {hidden['intervals']} intervals hold", "hidden"),
        ("fits of noisy spectra", "known circuit", trials, f"{missed} arms missed, {extra} extra", "fits"),
        *((f"averaged torque, {name}", "full motor", len(errors), f"within {max(errors):.2g} μF₀R", "averaged")
          for name, errors in (("trusted", trusted), ("not trusted", others)) if errors),
    )  # fmt: skip
    return [f"|{'|'.join(map(str, row[:4]))}|`{row[4]}`|" for row in rows]


def row(name: str, errors: tuple[float, ...]) -> str:
    """Return a line of the table of points."""
    return f"|{name}|{errors[0]:.3f}|{errors[1]:.2f}|{errors[2]:.3f}|{errors[3]:.0e}|"


def measure() -> None:
    """Run all points against the integrator and write their tables."""
    from tests.run.test_reference import POINTS, ours, speed_error, state_error, trajectory_error

    rows, every = [], []
    for name in POINTS:
        run = ours(name)
        errors = (trajectory_error(name, run), state_error(name, run), speed_error(name, run))
        trajectory, states, speed = (100.0 * error for error in errors)
        every.append((trajectory, states, speed, run.energy_residual))
        if name in SHOWN:
            rows.append(row(name, every[-1]))
    rows.append(row(f"maximum of {len(every)}", tuple(map(max, zip(*every, strict=True)))))
    put(POINTS_HEAD, rows)


if __name__ == "__main__":
    put(CAMPAIGNS, campaigns())
    if "records" not in sys.argv:
        measure()
