# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of docs/measured.md that are not those of finite elements alone, and its spectra, are computed again."""

from __future__ import annotations

import json
import re
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.result import Calibration
from tests.impedance.readers.test_measured import MEASURED
from tests.validation.test_impact import deviation

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "measured.md").read_text(encoding="utf-8")
DIGITS = 2e-3  # of the last printed digit, and of the estimated error of a steady state

# name: free length, width, thickness in m, voltage in V, of http://rphotronics.com/b/product05/1536; then the edge of
# an element in m and the highest mode in Hz: half the edge changes deflection and stiffness by less than 1 %
BENDERS = {
    "MTP60": (0.053, 0.020, 0.7e-3, 150.0, 2.2e-3, 20e3),
    "MTP49": (0.038, 0.0023, 0.8e-3, 200.0, 1.2e-3, 40e3),
    "MTP35": (0.028, 0.0021, 0.7e-3, 200.0, 1.0e-3, 60e3),
}
# of the card of PZT-5H: d₃₁ in m/V, s₁₁ in m²/N, k₃₁²
CHARGE, COMPLIANCE = 274e-12, 16.5e-12
COUPLING = CHARGE**2 / (COMPLIANCE * 3400.0 * 8.854e-12)
BENDER = """
name = "bender"

[solid]
theory = "solid"
element_m = {element}
lowest_hz = 10.0
highest_hz = {highest}
quality_factor = 50.0

[solid.contact]
from_m = [{length}, 0.0, 0.0]
to_m = [{length}, {width}, {thickness}]
normal = "+z"
tangent = "+x"

[[solid.boxes]]
material = "PZT-5H"
from_m = [0.0, 0.0, 0.0]
to_m = [{length}, {width}, {half}]
polarisation = "+z"

[[solid.boxes]]
material = "PZT-5H"
from_m = [0.0, 0.0, {half}]
to_m = [{length}, {width}, {thickness}]
polarisation = "+z"

[[solid.electrodes]]
group = "A"
from_m = [0.0, 0.0, {thickness}]
to_m = [{length}, {width}, {thickness}]

[[solid.electrodes]]
group = "B"
from_m = [0.0, 0.0, 0.0]
to_m = [{length}, {width}, 0.0]

[[solid.electrodes]]
group = "ground"
from_m = [0.0, 0.0, {half}]
to_m = [{length}, {width}, {half}]

[[solid.supports]]
from_m = [0.0, 0.0, 0.0]
to_m = [0.0, {width}, {thickness}]

[piezo]
loss_tangent = 0.02

[contact]
preload_n = 0.01
friction = 0.3
normal_stiffness_n_per_m15 = 1e6
tangential_compliance_tip_m_per_n23 = 1e-4
tangential_compliance_rotor_m_per_n23 = 0.0

[slider]
mass_kg = 0.01
guide_damping_n_s_per_m = 0.01
"""


def numbers(start: str) -> list[float]:
    """The numbers that are printed in the cells of a row, the first of each cell."""
    (line,) = (line for line in PAGE.splitlines() if line.startswith(f"| {start}"))
    found = (re.search(r"\d+\.?\d*", cell) for cell in line.split("|")[2:-1])
    return [float(one[0]) for one in found if one]


@pytest.mark.soak
@pytest.mark.parametrize("name", BENDERS)
def test_the_deflection_and_stiffness_of_a_bender_are_those_of_the_elements(name: str, tmp_path: Path) -> None:
    length, width, thickness, voltage, element, highest = BENDERS[name]
    text = BENDER.format(
        length=length, width=width, thickness=thickness, half=thickness / 2, element=element, highest=highest
    )
    (tmp_path / "bender.toml").write_text(text, encoding="utf-8")
    motor = pr.load_motor(tmp_path / "bender.toml")
    both = [mode.coupling_a_n_per_v + mode.coupling_b_n_per_v for mode in motor.modes]
    rows = list(zip(motor.modes, both, strict=True))
    deflection = abs(voltage * sum(force * mode.tip_y / mode.stiffness_n_per_m for mode, force in rows))
    stiffness = 1.0 / sum(mode.tip_y**2 / mode.stiffness_n_per_m for mode in motor.modes)
    capacitance = motor.piezo.capacitance_a_f
    capacitance += sum(mode.coupling_a_n_per_v**2 / mode.stiffness_n_per_m for mode in motor.modes)
    found = [1e3 * deflection, stiffness, 1e9 * capacitance]
    assert numbers(name) == pytest.approx(found, rel=DIGITS)
    # a clamped beam of two layers: δ = 3 d₃₁ V L²/(t² s), k = s E w t³/(4 L³), E = 1/s₁₁; each layer is stiffer by
    # s = 1 + k₃₁²/(4 (1 − k₃₁²)), because its field follows the strain. Sides that are free take up to 6 % of the force
    # and the clamp, which holds the ceramic across, some more; a plate is stiffer.
    stiffer = 1.0 + COUPLING / (4.0 * (1.0 - COUPLING))
    assert deflection == pytest.approx(3 * CHARGE * voltage * (length / thickness) ** 2 / stiffer, rel=0.15)
    assert stiffness == pytest.approx(stiffer * width * thickness**3 / (4 * COMPLIANCE * length**3), rel=0.1)
    # ε₃₃ᵀ L w/(t/2), less what bending with the other layer holds back: at most k₃₁², and what the clamp does
    assert capacitance == pytest.approx(3400.0 * 8.854e-12 * length * width / (thickness / 2.0), rel=0.2)


ROWS = ("stall force", "speed without load", "electrical power at stall")


def calibrated(**more: list[Any]) -> Calibration:
    """Calibrate the plate to the published force and speed, and more."""
    points = {
        "load_force_n": ["", 0.0], "speed_m_s": [0.0, 0.3], "speed_m_s_error": ["", 0.03], "force_n": [4.0, ""],
        "force_n_error": [0.4, ""], **more,
    }  # fmt: skip
    free = ["contact.friction", "modes.1.quality_factor", "modes.2.quality_factor"]
    motor = pr.load_motor(ROOT / "examples" / "plate40.toml")
    return pr.calibrate(motor, points, free=free, priors=dict.fromkeys(free, 0.3))


@pytest.mark.soak
def test_the_plate_beside_the_published_motor_pushes_as_the_page_says() -> None:
    motor = pr.load_motor(ROOT / "examples" / "plate40.toml")
    drive = pr.default_drive(motor)
    stall, free = pr.steady_state(motor, drive, speed=0.0), pr.steady_state(motor, drive)
    found = [stall.force_n, free.speed_m_s, stall.power_a_w + stall.power_b_w]
    assert [numbers(start)[1] for start in ROWS] == pytest.approx(found, rel=DIGITS)


@pytest.mark.soak
def test_the_calibrated_plate_meets_force_and_speed_but_not_the_power() -> None:
    result = calibrated(power_w=[5.0, ""], power_w_error=[0.5, ""])
    found = dict(zip(result.points.quantities if result.points else (), result.predicted, strict=True))
    # the end of the search is within 0.3 standard errors, and its last step halves the distance at least
    wanted = [found[quantity] for quantity in ("torque_n_m", "speed_rad_s", "power_w")]
    assert [numbers(start)[2] for start in ROWS] == pytest.approx(wanted, rel=0.02)
    assert any("does not explain the points" in warning for warning in result.warnings)


@pytest.mark.soak
def test_the_plate_calibrated_to_force_and_speed_alone_takes_the_power_that_the_page_says() -> None:
    motor = calibrated().motor
    drive = pr.default_drive(motor)
    stall, run = pr.steady_state(motor, drive, speed=0.0), pr.steady_state(motor, drive)
    power = stall.power_a_w + stall.power_b_w
    found = [stall.force_n, run.speed_m_s, power]
    assert [numbers(start)[3] for start in ROWS] == pytest.approx(found, rel=0.02)  # the end of the search, as above
    said = re.search(r"from the calibration to force and speed, (\S+) % too high", PAGE)
    assert said
    assert float(said[1]) == pytest.approx(100.0 * (power / 5.0 - 1.0), abs=4.0)


@pytest.mark.soak
def test_the_motor_of_the_published_force_and_speed_takes_the_power_that_the_page_says() -> None:
    found = pr.motor_from(stall_force=4.0, no_load_speed=0.3, voltage=100.0, frequency=39.6e3)
    stall = pr.steady_state(found.motor, pr.default_drive(found.motor), speed=0.0)
    printed = re.search(r"It takes (\S+) W at stall", PAGE)
    assert printed
    assert float(printed[1]) == pytest.approx(stall.power_a_w + stall.power_b_w, rel=DIGITS)


@pytest.mark.soak
@pytest.mark.parametrize("law", ["brush", "spring-slider", "coulomb"])
def test_the_rebound_of_spheres_deviates_as_the_page_says(law: str) -> None:
    found = [deviation(law, quantity) for quantity in ("restitution", "spin", "patch")]
    assert numbers(law) == pytest.approx(found, rel=DIGITS)


# --- spectra and circuits of measured transducers ---

DATA = ROOT / "tests" / "data" / "measured"
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
