# SPDX-License-Identifier: GPL-3.0-or-later
"""Loops designed without options against injection in the full motor: ``python -m validation.loops``.

Crossover and margin of six loops, of speed, position and phase of two motors, by a sine near the crossover that is
added to the controller's output. The predicted plant is that of the averaged motor.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from runpy import run_path
from typing import Any

import pyspice_runner as pr
from validation.campaign import Campaign

ROOT = Path(__file__).parents[1]
MOTORS = {"bimodal40": "bimodal40", "plate40": str(ROOT / "examples" / "plate40.toml")}
QUANTITIES = ("speed", "position", "phase")
# motor → s from rest to the sine; sine over the usual one, so that it is about 1 % (bimodal40) and 2 % of the amplitude
SETTLES, SIZES = {"bimodal40": 0.06, "plate40": 0.1}, {"bimodal40": 1.0, "plate40": 4.0}
SLOW = (1, 1)  # cycles of the sine of 3 and 6 Hz of a phase, before the measurement and in it
CROSSOVER, MARGIN_DEG, WITHIN = 0.05, 3.0, 5  # largest errors; number of loops within both


def outcome(name: str) -> dict[str, Any]:
    """Return the designed loop of a case ``MOTOR QUANTITY``, and the errors of its crossover and margin."""
    of_motor, quantity = name.split()
    motor = pr.load_motor(MOTORS[of_motor])
    drive = pr.default_drive(motor)
    assert isinstance(drive, pr.TwoPhaseDrive)
    loop = pr.control_loop(motor, drive, quantity=quantity)
    docs = run_path(str(ROOT / "docs" / "averaged_loops.py"))
    phase = quantity == "phase"
    gain = docs["injected"](
        loop, motor, drive, settles=SETTLES[of_motor], size=1.0 if phase else SIZES[of_motor],
        cycles=SLOW if phase else docs["CYCLES"], averaged=False,
    )  # fmt: skip
    crossover, margin = docs["difference"](loop, gain)
    return {
        "crossover_hz": loop.crossover_hz, "margin_deg": loop.phase_margin_deg, "gains": dict(loop.gains),
        "crossover_error": crossover, "margin_error_deg": margin,
    }  # fmt: skip


def summary(record: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the errors of the loops, and the number of those within the bounds."""
    found = {str(one["index"]): [one["crossover_error"], one["margin_error_deg"]] for one in record}
    inside = [name for name, (one, other) in found.items() if abs(one) <= CROSSOVER and abs(other) <= MARGIN_DEG]
    return {"within": len(inside), "errors": found}


def passes(table: Mapping[str, Any]) -> bool:
    """Whether enough loops have the crossover and the margin of the design."""
    return int(table["within"]) >= WITHIN


CASES = tuple(f"{motor} {quantity}" for motor in MOTORS for quantity in QUANTITIES)
CAMPAIGN = Campaign("loops", outcome, summary, passes, len(CASES), keys=lambda: CASES)

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
