# SPDX-License-Identifier: GPL-3.0-or-later
"""Every deck and library in the modes by which ngspice reads other programs' files: ``python -m validation.dialects``.

The decks are in ``netlists/``, in the headers of ``behavioral/``, and in the headers of
exported motors. Each runs in ngspice's own mode and with ``ngbehavior`` set to each of :data:`MODES`, and must have the
same time or frequency points, the same measured values and, at every point, the same values of the vectors that are
measured. ``records/dialects.json`` has the table.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import pyspice_runner as pr
from pyspice_runner.spice.library import data_path, library_names, read_library
from pyspice_runner.spice.ngspice import ngspice_version
from pyspice_runner.spice.rawfile import RawFileError, read_rawfile
from validation.campaign import Campaign

ROOT = Path(__file__).parents[1]
MODES = ("lt", "ps", "kicad", "ltpsa", "kiltpsa")  # of LTspice, PSpice and KiCad, and their combinations
ROUNDING = 1e-9  # of the largest magnitude of a vector: the modes may sum and fold constants in another order
# of ngspice and LTspice, with the same meaning; behind them the words of sources, devices and prints that look alike
FUNCTIONS = {"abs", "atan", "cos", "exp", "log", "max", "min", "sin", "sqrt", "tanh", "u", "uramp"} | {
    "adc_bridge", "d_dff", "d", "dac_bridge", "i", "par", "pulse", "pwl", "v", "vm", "vp",
}  # fmt: skip
_TIMEOUT = 600.0  # s; a deck takes up to 10
_VALUE = re.compile(r"^([a-z]\w*) *= +(-?[\d.]+e[+-]\d+)", re.M)
_TROUBLE = re.compile(r"^.*\b(?:error|warning|unknown|unrecognized|can't|cannot)\b.*$", re.M | re.I)
_WRITE = ".control\nrun\nwrite out.raw\n.endc\n"

FLAGSHIPS = {"bimodal40": "bimodal40", "plate40": str(ROOT / "examples" / "plate40.toml")}
VARIANTS: dict[str, dict[str, Any]] = {
    "spring-slider": {},
    "coulomb": {"contact": "coulomb"},
    "brush": {"contact": "brush"},
    "averaged": {"averaged": True},
}


def keys() -> Iterator[str]:
    """Yield the names of the decks."""
    yield from (f"netlists/{file.name}" for file in sorted(data_path("netlists").glob("*.cir")))
    yield from (f"behavioral/{name}.lib" for name in library_names())
    yield from (f"export/{motor}.{variant}" for motor in FLAGSHIPS for variant in VARIANTS)


def write_deck(key: str, folder: Path) -> Path:
    """Write a deck and what it includes, and return its path."""
    kind, _, name = key.partition("/")
    deck = folder / "deck.cir"
    if kind == "netlists":
        shutil.copy(data_path("netlists") / "piezomotor_averaged.lib", folder)
        text = (data_path("netlists") / name).read_text(encoding="utf-8")
    else:
        if kind == "behavioral":
            library = read_library(Path(name).stem)
            files = [data_path("behavioral") / f"{part}.lib" for part in (library.name, *library.needs)]
            usage = library.usage
        else:
            motor, _, variant = name.partition(".")
            files = [pr.export_motor(pr.load_motor(FLAGSHIPS[motor]), folder / "motor.lib", **VARIANTS[variant])]
            usage = in_header(files[0].read_text(encoding="utf-8"))
        text = f"{key}\n{''.join(f'.include {file}{chr(10)}' for file in files)}{usage}\n.end\n"
    if ".control" not in text:
        measured = " ".join(re.findall(r"^ *\.meas.*$", text, re.M | re.I))
        nodes = {f"v({node})" for pair in re.findall(r"\bv\(([^)]*)\)", measured, re.I) for node in pair.split(",")}
        saved = sorted({name.lower() for name in (*nodes, *re.findall(r"\bi\([^)]*\)", measured, re.I))})
        added = f".save {' '.join(saved)}\n{_WRITE}.end" if saved and "par(" not in measured else f"{_WRITE}.end"
        text = re.sub(r"^\.end\s*$", lambda _: added, text, flags=re.M)
    deck.write_text(text, encoding="utf-8")
    return deck


def in_header(text: str) -> str:
    """Return the example in the header of a library."""
    example = re.search(r"^\* USE\b[^\n]*\n(.*?)^\* END USE$", text, re.M | re.S)
    assert example, "a header without an example"
    return re.sub(r"^\* ?", "", example[1], flags=re.M)


def run(deck: Path, mode: str = "") -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """Run a deck in a mode; return what it measures, and its vectors where it has one analysis."""
    raw = deck.with_name("out.raw")
    raw.unlink(missing_ok=True)
    words = ["ngspice", "-b", *(["-D", f"ngbehavior={mode}"] if mode else []), deck.name]
    done = subprocess.run(
        words, cwd=deck.parent, env=os.environ | {"HOME": str(deck.parent), "LC_ALL": "C"}, capture_output=True,
        text=True, timeout=_TIMEOUT, check=False,
    )  # fmt: skip
    said = done.stdout + done.stderr
    trouble = _TROUBLE.search(said)
    if done.returncode or trouble:
        raise ValueError(trouble[0] if trouble else f"status {done.returncode}")
    if bool(mode) != ("Compatibility modes selected" in said):
        raise ValueError("the mode was not selected")
    try:
        vectors = dict(read_rawfile(raw).vectors)
    except RawFileError:
        vectors = {}
    return {name: float(value) for name, value in _VALUE.findall(said)}, vectors


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return the largest difference of two vectors, relative to the largest magnitude of the first."""
    if one.shape != other.shape:
        return float("inf")
    largest = np.abs(one).max()
    return float(np.abs(other - one).max() / largest) if largest else float(np.abs(other).max())


def outcome(key: str) -> dict[str, Any]:
    """Run a deck in each mode, and compare it with ngspice's own mode."""
    with tempfile.TemporaryDirectory() as place:
        deck = write_deck(key, Path(place))
        measured, vectors = run(deck)
        points = len(next(iter(vectors.values()))) if vectors else 0
        modes: dict[str, Any] = {}
        for mode in MODES:
            try:
                found, others = run(deck, mode)
            except ValueError as error:
                modes[mode] = str(error)
                continue
            if found.keys() != measured.keys() or others.keys() != vectors.keys():
                modes[mode] = "other results"
                continue
            pairs = [(vectors[name], others[name]) for name in vectors]
            pairs += [(np.array([measured[name]]), np.array([found[name]])) for name in measured]
            modes[mode] = max(difference(*pair) for pair in pairs)
        return {"points": points, "vectors": len(vectors), "measured": len(measured), "modes": modes}


def agrees(difference: Any) -> bool:
    """Return whether a mode has the results of ngspice's own."""
    return isinstance(difference, float) and difference <= ROUNDING


def summary(cases: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return for each mode how many decks agree, the largest difference of these, and the others."""
    table: dict[str, Any] = {"ngspice": ngspice_version(), "decks": len(cases)}
    for mode in MODES:
        found = {case["index"]: case["modes"][mode] for case in cases}
        agreeing = [value for value in found.values() if agrees(value)]
        table[mode] = {
            "agree": len(agreeing),
            "largest_difference": max(agreeing, default=0.0),
            "others": {key: value for key, value in found.items() if not agrees(value)},
        }
    return table


def passes(table: Mapping[str, Any]) -> bool:
    """Return whether all decks agree in all modes."""
    return not any(table[mode]["others"] for mode in MODES)


CAMPAIGN = Campaign("dialects", outcome, summary, passes, count=10**6, keys=partial(keys))

if __name__ == "__main__":
    sys.exit(CAMPAIGN.main())
