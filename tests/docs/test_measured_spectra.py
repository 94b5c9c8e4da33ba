# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra and circuits of measured transducers: the tables of docs/measured.md are computed again."""

from __future__ import annotations

import json
import re
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from tests.impedance.readers.test_measured import MEASURED

PAGE = (Path(__file__).parents[2] / "docs" / "measured.md").read_text(encoding="utf-8")
DATA = Path(__file__).parents[1] / "data" / "measured"
TRANSDUCERS = MEASURED / "transducers" / "transducers.json"


def printed(name: str) -> list[float]:
    """Return the numbers of a row of the page, without its name."""
    (line,) = (line for line in PAGE.splitlines() if line.startswith(f"| {name} |"))
    return [float(item) for item in re.findall(r"[-+]?\d+\.?\d*", line.removeprefix(f"| {name} |"))]


def rms(deviation: Any) -> float:
    """Return the root mean square of a complex deviation in per cent."""
    return float(100.0 * np.sqrt(np.mean(np.abs(deviation) ** 2)))


@pytest.mark.soak
@pytest.mark.parametrize("name", ["clean", "messy"])
def test_a_sweep_about_the_resonance_predicts_the_wide_one_as_the_page_says(name: str) -> None:
    near, wide = (pr.read_spectrum(DATA / f"piezolab_{name}_{kind}.csv") for kind in ("resonant", "sweep"))
    fit = pr.fit_spectrum(near)
    predicted, measured = fit.admittance(wide.frequency_hz), wide.admittance_s
    low, high = near.frequency_hz[[0, -1]]
    inside = (low <= wide.frequency_hz) & (wide.frequency_hz <= high)
    again = np.interp(wide.frequency_hz[inside], near.frequency_hz, near.admittance_s)
    capacitances = [1e9 * one[0].imag / (2 * pi * wide.frequency_hz[0]) for one in (predicted, measured)]
    losses = [one[0].real / one[0].imag for one in (predicted, measured)]
    found = [
        1e-3 * low, 1e-3 * high, len(fit.arms), 100.0 * fit.rms_relative_error,
        rms(predicted[inside] / measured[inside] - 1), rms(again / measured[inside] - 1),
        *capacitances, 100.0 * (capacitances[0] / capacitances[1] - 1), *losses,
    ]  # fmt: skip
    # 1 % for the place where the search ends, and the last printed digit of a deviation
    assert printed(f"`{name}`")[:-2] == pytest.approx([float(item) for item in found[:-2]], rel=0.01, abs=0.051)
    assert printed(f"`{name}`")[-2:] == pytest.approx(losses, rel=0.02)


def test_two_specimens_of_a_type_differ_by_what_the_page_says() -> None:
    if not TRANSDUCERS.is_file():
        pytest.skip("the measured circuits are not here")
    circuits = json.loads(TRANSDUCERS.read_text(encoding="utf-8"))
    first, second = (circuits[f"SMBLTD45F40H_{number}"] for number in (1, 2))
    ratio = {key: second[key] / first[key] for key in ("rs", "ls", "cs", "c0")}
    found = [1 / sqrt(ratio["ls"] * ratio["cs"]), ratio["ls"], ratio["rs"], ratio["c0"]]
    said = re.search(r"the second differs by (\S+) % in f_s, (\S+) % in L₁, (\S+) % in R₁ and (\S+) % in C₀", PAGE)
    assert said
    assert [float(item.replace("−", "-")) for item in said.groups()] == pytest.approx(
        [100 * (item - 1) for item in found], abs=0.051
    )
