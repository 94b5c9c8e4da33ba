# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of docs/measured.md that are not those of finite elements alone are computed again."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pyspice_runner as pr
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


@pytest.mark.soak
def test_the_plate_beside_the_published_motor_pushes_as_the_page_says() -> None:
    motor = pr.load_motor(ROOT / "examples" / "plate40.toml")
    drive = pr.default_drive(motor)
    stall, free = pr.steady_state(motor, drive, speed=0.0), pr.steady_state(motor, drive)
    for start, value in (
        ("stall force", stall.force_n),
        ("speed without load", free.speed_m_s),
        ("electrical power at stall", stall.power_a_w + stall.power_b_w),
    ):
        assert numbers(start)[1] == pytest.approx(value, rel=DIGITS)


@pytest.mark.soak
def test_the_calibrated_plate_meets_force_and_speed_but_not_the_power() -> None:
    motor = pr.load_motor(ROOT / "examples" / "plate40.toml")
    points = {
        "load_force_n": ["", 0.0], "speed_m_s": [0.0, 0.3], "speed_m_s_error": ["", 0.03], "force_n": [4.0, ""],
        "force_n_error": [0.4, ""], "power_w": [5.0, ""], "power_w_error": [0.5, ""],
    }  # fmt: skip
    free = ["contact.friction", "modes.1.quality_factor", "modes.2.quality_factor"]
    result = pr.calibrate(motor, points, free=free, priors=dict.fromkeys(free, 0.3))
    found = dict(zip(result.points.quantities if result.points else (), result.predicted, strict=True))
    # the end of the search is within 0.3 standard errors, and its last step halves the distance at least
    for start, quantity in (
        ("stall force", "torque_n_m"),
        ("speed without load", "speed_rad_s"),
        ("electrical power at stall", "power_w"),
    ):
        assert numbers(start)[2] == pytest.approx(found[quantity], rel=0.02)
    assert any("does not explain the points" in warning for warning in result.warnings)


@pytest.mark.soak
def test_the_plate_calibrated_to_force_and_speed_alone_takes_the_power_that_the_page_says() -> None:
    motor = pr.load_motor(ROOT / "examples" / "plate40.toml")
    points = {
        "load_force_n": ["", 0.0], "speed_m_s": [0.0, 0.3], "speed_m_s_error": ["", 0.03], "force_n": [4.0, ""],
        "force_n_error": [0.4, ""],
    }  # fmt: skip
    free = ["contact.friction", "modes.1.quality_factor", "modes.2.quality_factor"]
    calibrated = pr.calibrate(motor, points, free=free, priors=dict.fromkeys(free, 0.3)).motor
    drive = pr.default_drive(calibrated)
    stall, run = pr.steady_state(calibrated, drive, speed=0.0), pr.steady_state(calibrated, drive)
    power = stall.power_a_w + stall.power_b_w
    for start, value in (
        ("stall force", stall.force_n),
        ("speed without load", run.speed_m_s),
        ("electrical power at stall", power),
    ):
        assert numbers(start)[3] == pytest.approx(value, rel=0.02)  # the end of the search, as above
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
