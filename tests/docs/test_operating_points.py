# SPDX-License-Identifier: GPL-3.0-or-later
"""The operating points of the tutorials on ``bimodal40`` are within the limits of its set, once settled."""

from __future__ import annotations

import re
from pathlib import Path

import pyspice_runner as pr
from pyspice_runner.motor.strength import limits_of

DOCS, MOTOR = Path(__file__).parents[2] / "docs", pr.load_motor("bimodal40")
RUNS = "steady|track|drive|loop|simulate|speed-torque|state-space|small-signals"


def points(text: str) -> set[tuple[float, float, float | None, float | None]]:
    """Return voltage, load, speed of a held shaft and target of a loop of each command and snippet of a page."""
    found = {(float(volts), 0.0, None, None) for volts in re.findall(r'"voltage": ([\d.]+)', text)}
    for name, options in re.findall(rf"piezomotor ({RUNS}) bimodal40((?:\\\n|[^\n`])*)", text):
        given = dict(re.findall(r"--([\w-]+)[ =](?!--)(\S+)", options))
        target = float(given.get("target", 0.0)) if name == "track" and given.get("tracker") != "none" else None
        for speed in given.get("speeds", given.get("speed", "")).split(","):
            load = 0.0 if speed else float(given.get("load", "0").replace("m", "e-3"))
            found.add((float(given.get("voltage", "100")), load, float(speed) if speed else None, target))
    return found


def beyond(voltage: float, load: float, speed: float | None, target: float | None) -> list[str]:
    """Return the limits of the set that the settled motor exceeds."""
    drive = pr.default_drive(MOTOR).model_copy(update={"voltage": voltage})
    if target is not None:
        tracker = pr.Tracker(kind="pll", voltage=voltage, frequency=40.6e3, target_deg=target)
        run = pr.track(MOTOR, tracker, duration=0.3, averaged=True, margin=False)
        assert run.locked
        drive = drive.model_copy(update={"frequency": run.end_frequency_hz})
    values = pr.steady_state(MOTOR, drive, load_torque=load, speed=speed).to_dict()
    values["temperature_c"] = MOTOR.limits.ambient_c + values["temperature_rise_k"]
    return [name for name, most in limits_of(MOTOR).items() if not values[name] <= most]


def test_the_operating_points_of_the_pages_are_within_the_limits() -> None:
    for page in ("tutorial_contact_law", "tutorial_driver", "tutorial_tracking", "tracking"):
        found = points((DOCS / f"{page}.md").read_text(encoding="utf-8"))
        assert found, page
        assert not any(beyond(*point) for point in found), page


def test_a_loop_behind_resonance_at_70_v_is_beyond_the_limits() -> None:
    found = points("piezomotor track bimodal40 --averaged --voltage 70 \\\n  --target -30 --duration 1")
    assert [beyond(*point) for point in found] == [["ceramic_stress_pa"]]
