# SPDX-License-Identifier: GPL-3.0-or-later
"""Steady states of random motors, compared with settling: ``python -m tests.random_steady --count 200``.

Motors and drives are those of the soak (:mod:`tests.soak`), whose parameters are drawn from the whole ranges that they
declare. The outcome of a case is written at once, so that an interrupted study can be resumed.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pyspice_runner as pr
from pyspice_runner.analysis.speed_torque import operating_point
from pyspice_runner.analysis.steady import SteadyState
from tests.soak import case

RECORD = Path(__file__).with_suffix(".json")
SEED = 16
LONGEST = 10.0  # s, of a run of ngspice
AGREES = 5e-3  # of the friction torque, besides the error that the steady state states
FOUND = ("newton", "damped", "neighbour", "settled")


def outcome(index: int) -> dict[str, Any] | None:
    """Return what came of a case; ``None`` for one without a plain drive or a contact."""
    subject = case(SEED, index)
    if not isinstance(subject.drive, pr.TwoPhaseDrive | pr.TwoToneDrive) or subject.settings.get("contact") is None:
        return None
    point: dict[str, Any] = {"speed": subject.settings.get("speed") or 0.0, "contact": subject.settings["contact"]}
    point |= {"timeout": LONGEST, "audit": False}
    try:
        state = pr.steady_state(subject.motor, subject.drive, **point)
    except (pr.ParameterError, pr.SimulationError) as error:
        slow = "did not finish within" in str(error)
        how = "refused" if isinstance(error, pr.ParameterError) else "too slow" if slow else "failed"
        return {"index": index, "method": how, "verdict": str(error)[:120]}
    method = state.method or "not found"
    return {"index": index, "method": method, "verdict": _verdict(subject, state, point) if state.converged else ""}


def _verdict(subject: Any, state: SteadyState, point: dict[str, Any]) -> str:
    """Return the deviation of a steady state from the result of settling."""
    if not state.stable:
        return "unstable"
    if state.audit.findings:
        return "fails the audit"
    try:
        settled = operating_point(subject.motor, subject.drive, mode="settle", **point)
    except (pr.ParameterError, pr.SimulationError):
        return "settling failed or took too long"
    if not settled["settled"]:
        return "not settled in time"
    contact = subject.motor.contact
    force = max(contact.preload_n, settled["normal_force_n"])
    allowed = AGREES * contact.friction * force * subject.motor.rotor.radius_m + state.torque_error_n_m
    return "agrees" if abs(state.torque_n_m - settled["torque_n_m"]) <= allowed else "differs"


def read() -> list[dict[str, Any]]:
    """Return the record."""
    found: list[dict[str, Any]] = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else []
    return found


def main() -> None:
    """Run cases until there are so many, or the time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=1e9)
    chosen = parser.parse_args()
    record, begun = read(), time.monotonic()
    index = record[-1]["index"] if record else -1
    while len(record) < chosen.count and time.monotonic() - begun < chosen.seconds:
        index += 1
        found = outcome(index)
        if found is not None:
            record.append(found)
            RECORD.write_text(
                "[\n" + ",\n".join(json.dumps(one, ensure_ascii=False) for one in record) + "\n]\n", encoding="utf-8"
            )
    print(len(record), Counter(one["method"] for one in record))
    print(Counter(one["verdict"] for one in record if one["method"] in FOUND))


if __name__ == "__main__":
    main()
