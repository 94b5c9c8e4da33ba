# SPDX-License-Identifier: GPL-3.0-or-later
"""``.op`` and ``.ac`` of the averaged decks at random operating points: ``python -m tests.random_starts --count 200``.

At each point both run by themselves, and with the start by a transient that docs/averaged.md gives.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tempfile
from math import inf, nan
from pathlib import Path

import numpy as np

from tests.averaged.test_averaged_start import deck, expected, recipe, result

SEED, COUNT = 32, 200
VOLTAGES, FREQUENCIES, PHASES, TORQUES = (40.0, 150.0), (39.6e3, 41.2e3), (60.0, 140.0), (-6e-3, 6e-3)  # V, Hz, °, N·m
LIMIT = 2.0  # s of CPU time
AGREES = 0.01  # of the speed of the settled C code
LEAST = 0.05  # rad/s: differences of a rotor that stands are not relative


def point(index: int) -> tuple[float, float, float, float]:
    """Draw frequency, voltage, phase and load torque."""
    rng = np.random.default_rng((SEED, index))
    voltage, frequency, phase, torque = (float(rng.uniform(*span)) for span in (VOLTAGES, FREQUENCIES, PHASES, TORQUES))
    return frequency, voltage, phase * float(rng.choice((-1.0, 1.0))), torque


def ended(analysis: str, text: str, folder: Path) -> tuple[float, float]:
    """Return the result of a deck and its CPU time in s; NaN and infinity where it fails or does not end."""
    try:
        return result(analysis, text, folder)
    except (subprocess.TimeoutExpired, subprocess.CalledProcessError):
        return nan, inf


def main() -> None:
    """Run the points and print how many end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=COUNT)
    count = parser.parse_args().count
    met = dict.fromkeys(("op", "ac", "op from the transient", "ac from the transient"), 0)
    speeds, other, slowest = 0, 0, 0.0
    for index in range(count):
        at = point(index)
        settled = expected(at)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            start = re.sub(r"\.control.*?\.endc\n", lambda _: recipe(), deck("op", at), flags=re.S)
            _, spent = result("start", start, folder)
            slowest = max(slowest, spent)
            for analysis, mark in (("op", ".control"), ("ac", ".ac dec")):
                text = deck(analysis, at)
                for kind, own in (
                    ("", text),
                    (" from the transient", text.replace(mark, f".include start.nodeset\n{mark}")),
                ):
                    value, seconds = ended(analysis, own, folder)
                    met[f"{analysis}{kind}"] += seconds < LIMIT
                    if analysis == "op" and seconds < inf:
                        away = abs(value - settled) > max(AGREES * abs(settled), LEAST)
                        speeds, other = (speeds + (not away), other) if kind else (speeds, other + away)
                        if away:
                            print(
                                f"point {index}, {at}: .op{kind} {value:.4g} rad/s, settled {settled:.4g}", flush=True
                            )
    for kind, number in met.items():
        print(f".{kind}: {number} of {count} within {LIMIT:g} s")
    print(f"from the transient {speeds} have the settled speed; .op alone finds another at {other}")
    print(f"the slowest transient takes {slowest:.2f} s")


if __name__ == "__main__":
    main()
