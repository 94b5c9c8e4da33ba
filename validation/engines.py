# SPDX-License-Identifier: GPL-3.0-or-later
"""All decks of ``netlists/`` in the native ngspice and in ngspice as WebAssembly: wall times, and the difference.

``python -m validation.engines [NAME …]`` prints a table; without names it writes ``records/engines.json``. The
differences of a vector are the maximum over the run, relative to the vector's maximum, and the RMS, relative to its
RMS. Vectors below 1e-9 of the largest one of their kind are rounding, and those inside a device (``#``) have other
names. Where the steps differ, which follows from switching edges, the points are interpolated at the native times, and
only the RMS has a meaning: an edge or the contact's state is one step early or late. There native ngspice 47 differs
from native 39 by more, 0.09 to 0.15 in RMS of the worst vector. The record has the versions of both engines.
"""

from __future__ import annotations

import json
import os
import re
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from pyspice_runner.spice.library import data_path
from pyspice_runner.spice.ngspice import SpiceRun, run_deck
from pyspice_runner.spice.wasm import refused

RECORD = Path(__file__).parent / "records" / "engines.json"
ROUNDING = 1e-9  # of the largest vector of a kind: voltages here, currents there


def prepared(path: Path) -> str:
    """Return a deck for a raw file: its libraries in place, without measurements and control section."""
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^\.include (\S+)$", lambda found: (path.parent / found[1]).read_text(encoding="utf-8"), text)
    text = re.sub(r"(?m)^\.(?:meas|print).*\n(?:\+.*\n)*", "", text)
    text = re.sub(r"(?ms)^\.control$.*?^\.endc\n", "", text)
    return text if re.search(r"(?m)^\.(?:tran|ac|dc)\b", text) else text.replace("\n.end\n", "\n.op\n.end\n")


def run(deck: str, engine: str) -> tuple[SpiceRun, float]:
    """Run a deck in an engine and return its result with the wall time in s."""
    os.environ["PIEZOMOTOR_ENGINE"] = engine
    began = time.perf_counter()
    found = run_deck(deck, vectors=[])
    return found, time.perf_counter() - began


def difference(ours: SpiceRun, theirs: SpiceRun) -> tuple[float, float, str]:
    """Return the largest relative difference by the maximum and by the RMS, and the vector of the latter."""
    axis, most, worst = next(iter(theirs.raw.vectors)), 0.0, (0.0, "")
    largest = dict.fromkeys("vi", 0.0)
    for name, values in theirs.raw.vectors.items():
        if name != axis:
            largest[_kind(name)] = max(largest[_kind(name)], float(np.abs(values).max()))
    for name, values in theirs.raw.vectors.items():
        size = float(np.abs(values).max())
        if name == axis or "#" in name or size <= ROUNDING * largest[_kind(name)]:
            continue
        other = ours.raw.vectors[name]
        if len(other) != len(values):
            other = np.interp(theirs.raw.vectors[axis].real, ours.raw.vectors[axis].real, other.real)
        off = np.abs(other - values)
        most = max(most, float(off.max()) / size)
        worst = max(worst, (float(np.linalg.norm(off) / np.linalg.norm(values)), name))
    return most, *worst


def _kind(name: str) -> str:
    return "i" if name.startswith("i(") else "v"


def main(names: list[str]) -> None:
    """Compare the decks and print the table."""
    rows: list[dict[str, Any]] = []
    versions: set[tuple[str, str]] = set()
    print(f"{'deck':28} {'points':>8} {'native':>8} {'wasm':>8} {'maximum':>11} {'RMS':>11}")
    for path in sorted(data_path("netlists").glob("*.cir")):
        if names and path.stem not in names:
            continue
        deck = prepared(path)
        rows.append({"deck": path.stem})
        if sentence := refused(deck):
            rows[-1]["refused"] = sentence
            print(f"{path.stem:28} {sentence}", flush=True)
            continue
        theirs, native_s = run(deck, "native")
        ours, wasm_s = run(deck, "wasm")
        most, rms, vector = difference(ours, theirs)
        versions.add((theirs.ngspice_version, ours.ngspice_version))
        rows[-1] |= {
            "points": theirs.raw.points, "points_wasm": ours.raw.points, "native_s": round(native_s, 2),
            "wasm_s": round(wasm_s, 2), "maximum": float(f"{most:.2g}"), "rms": float(f"{rms:.2g}"), "vector": vector,
        }  # fmt: skip
        print(
            f"{path.stem:28} {theirs.raw.points:8} {native_s:8.2f} {wasm_s:8.2f} {most:11.1e} {rms:11.1e} {vector}",
            flush=True,
        )
    if not names:
        ((native, wasm),) = versions
        RECORD.write_text(
            json.dumps({"native": native, "wasm": wasm, "decks": rows}, indent=1) + "\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
