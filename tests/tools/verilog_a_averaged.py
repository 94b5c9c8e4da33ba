# SPDX-License-Identifier: GPL-3.0-or-later
"""The averaged motor in Verilog-A, compiled by OpenVAF, against the SPICE library in ngspice 46. ``make verilog-a``."""

from __future__ import annotations

from cmath import rect
from math import radians
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.netlist.averaged import averaged_library, default_two_phase
from pyspice_runner.netlist.veriloga_averaged import averaged_module
from tests.tools.verilog_a import compiled, run

PINS = "a_re 0 b_re b_im frequency shaft temperature heat"
COMPILED = [f"N1 {PINS} device", ".model device piezomotor_averaged"]
LIBRARY = [".include motor.lib", f"Xmotor {PINS} piezomotor_averaged"]
OUTPUTS = "v(shaft) i(va) i(vb_re) i(vb_im) v(heat)"
OPTIONS = ".options method=gear trtol=20"


def motors(name: str, tmp_path: Path, *, mount: bool = True) -> pr.Motor:
    """Write a motor that drifts in both forms."""
    motor = pr.load_motor(name).updated({} if mount else {"mount": None})
    thermal = pr.Thermal.of(motor)
    compiled(averaged_module(motor, thermal=thermal), tmp_path)
    (tmp_path / "motor.lib").write_text(averaged_library(motor, thermal=thermal), encoding="utf-8")
    return motor


def sources(motor: pr.Motor, modulated: str = "") -> list[str]:
    drive = default_two_phase(motor)
    b = rect(drive.voltage_b, radians(drive.phase_deg))
    return [
        f"Va a_re 0 {drive.voltage:g} {modulated}", f"Vb_re b_re 0 {b.real!r}", f"Vb_im b_im 0 {b.imag!r}",
        f"Vf frequency 0 {drive.frequency!r}", "Vt temperature 0 15", "Iload shaft 0 1e-4", OPTIONS,
    ]  # fmt: skip


def both(folder: Path, analysis: list[str], given: list[str]) -> tuple[np.ndarray, np.ndarray]:
    found = []
    for lines, one in ((COMPILED, True), (LIBRARY, False)):
        run(folder, lines, analysis, given, one)
        found.append(np.loadtxt(folder / "found.txt"))
    return found[0], found[1]


@pytest.mark.parametrize(
    ("name", "mount"), [("bimodal40", True), ("andersen2002", False), ("andersen2002-unintended-mode", True)]
)
def test_the_spin_up_is_that_of_the_library(name: str, mount: bool, tmp_path: Path) -> None:
    """Speed, currents and heat over 5 ms; 0.5 % of the greatest for the steps that ngspice chooses.

    A time derivative that the compiler loses would be seen: that of the slider changed the speed at 1 ms by 0.6 %, and
    the first 50 us altogether.
    """
    motor = motors(name, tmp_path, mount=mount)
    analysis = ["tran 10u 5m 0 10u uic", f"linearize {OUTPUTS}", f"wrdata found.txt {OUTPUTS}"]
    ours, library = both(tmp_path, analysis, sources(motor))
    later = library[:, 0] > 1e-4  # a step of the voltage onto the capacitances is one at t = 0
    for column in range(1, ours.shape[1], 2):
        at = np.interp(library[later, 0], ours[:, 0], ours[:, column])
        assert np.abs(at - library[later, column]).max() < 5e-3 * np.abs(library[later, column]).max(), column


@pytest.mark.parametrize("name", ["bimodal40", "andersen2002"])
def test_the_operating_point_and_the_transfer_function_are_those_of_the_library(name: str, tmp_path: Path) -> None:
    """The same equations: 1e-5 for the tolerance of the operating point, 1e-4 from 1 Hz to 2 kHz of modulation."""
    motor = motors(name, tmp_path)
    given = [*sources(motor, "AC 1"), ".options reltol=1e-6", ".nodeset v(shaft)=0"]
    ours, library = both(tmp_path, ["op", f"wrdata found.txt {OUTPUTS}"], given)
    assert ours[1::2] == pytest.approx(library[1::2], rel=1e-5)
    parts = " ".join(f"{part}({vector})" for vector in OUTPUTS.split() for part in ("real", "imag"))
    ours, library = both(tmp_path, ["ac dec 10 1 2k", f"wrdata found.txt {parts}"], given)
    for column in range(1, ours.shape[1], 4):
        gain, expected = (table[:, column] + 1j * table[:, column + 2] for table in (ours, library))
        assert np.abs(gain - expected).max() < 1e-4 * np.abs(expected).max(), column
