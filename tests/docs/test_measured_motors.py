# SPDX-License-Identifier: GPL-3.0-or-later
"""Published motors beside members of the class of bimodal40: the tables of docs/measured.md are computed again.

By their mass alone: the plate of bimodal40, smaller or larger in all directions, at the same field. Stresses and
strains are then the same, so a size λ gives the force λ², the same speed, and the frequency 1/λ. By frequency, force
and speed: ``motor_from``, which leaves the other published values to be predicted.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.calibration.similar import Factors, as_stage, scaled
from pyspice_runner.motor.drive import TwoPhaseDrive
from pyspice_runner.motor.motor import Motor
from tests.docs.numbers import missing

PAGE = (Path(__file__).parents[2] / "docs" / "measured.md").read_text(encoding="utf-8")
MOTORS: dict[str, dict[str, Any]] = {
    motor["name"]: motor
    for motor in tomllib.loads(Path(__file__).with_name("measured_motors.toml").read_text(encoding="utf-8"))["motors"]
}
VOLTAGE = 100.0  # where none is published: force, speed, output and mass do not depend on it
CLASS = "bimodal40"
NEAR_MOST = np.linspace(0.4, 0.7, 13)  # of the speed without load; this grid has the maximum output to 0.1 %
DIGITS = 2e-3  # of the last printed digit, and of the estimated error of a steady state


def base() -> tuple[Motor, TwoPhaseDrive]:
    """Return the motor that represents the class, as a stage, with its drive."""
    motor = as_stage(pr.load_motor(CLASS))
    drive = pr.default_drive(motor)
    assert isinstance(drive, TwoPhaseDrive)
    return motor, drive


def mass(motor: Motor) -> float:
    """Return the mass of a free plate: it is the carrier of its mount."""
    assert motor.mount is not None
    return motor.mount.mass_kg


@cache
def by_mass(name: str) -> dict[str, float]:
    """Return force and speed of the plate with the mass of a stator."""
    motor, drive = base()
    size = (MOTORS[name]["stator_kg"] / mass(motor)) ** (1.0 / 3.0)
    smaller = scaled(motor, Factors(size**2, 1.0, 1.0 / size, size), name)
    assert mass(smaller) == pytest.approx(MOTORS[name]["stator_kg"])
    there = drive.updated({"frequency": drive.frequency / size, "voltage": drive.voltage * size})
    stall, free = pr.steady_state(smaller, there, speed=0.0), pr.steady_state(smaller, there)
    return {"force_n": stall.force_n, "speed_m_s": free.speed_m_s}


@cache
def by_sheet(name: str, *, friction: float | None = None) -> tuple[Motor, TwoPhaseDrive]:
    """Return the member of the class with the frequency, force and speed of a motor."""
    motor, _ = base()
    if friction is not None:
        motor = motor.updated({"contact.friction": friction})
    sheet = MOTORS[name]
    found = pr.motor_from(
        stall_force=sheet["force_n"], no_load_speed=sheet["speed_m_s"], frequency=sheet["frequency_hz"],
        voltage=sheet.get("voltage", VOLTAGE), base=motor,
    )  # fmt: skip
    assert not found.cautions
    drive = pr.default_drive(found.motor)
    assert isinstance(drive, TwoPhaseDrive)
    return found.motor, drive


def held_out(name: str) -> dict[str, float]:
    """Return output, mass, preload and power of the motor that has the published frequency, force and speed."""
    motor, drive = by_sheet(name)
    speeds = MOTORS[name]["speed_m_s"] * NEAR_MOST
    output = pr.speed_torque(motor, drive, speeds=speeds).shaft_power_w.values
    assert 0 < output.argmax() < len(speeds) - 1
    # all members of the class have one shape of the curve
    assert output.max() / (MOTORS[name]["force_n"] * MOTORS[name]["speed_m_s"]) == pytest.approx(0.325, abs=0.005)
    free = pr.steady_state(motor, drive)
    return {
        "output_w": float(output.max()), "stator_kg": mass(motor), "preload_n": motor.contact.preload_n,
        "free_power_w": free.power_a_w + free.power_b_w,
    }  # fmt: skip


def peak_to_peak_m(motor: Motor, drive: TwoPhaseDrive, voltage: float) -> float:
    """Return the greatest motion along the rotor of the free stator at a voltage, over frequencies near the drive."""
    omega = 2 * np.pi * drive.frequency * np.linspace(0.95, 1.05, 4001)
    b = drive.ratio_b * np.exp(1j * np.deg2rad(drive.phase_deg))
    along = sum(
        mode.tip_x * voltage * (mode.coupling_a_n_per_v + mode.coupling_b_n_per_v * b)
        / (mode.stiffness_n_per_m + 1j * omega * mode.damping_n_s_per_m - omega**2 * mode.mass_kg)
        for mode in motor.modes
    )  # fmt: skip
    return float(2.0 * np.abs(along).max())


OTHERS = {"output_w": 1e3, "stator_kg": 1e3, "preload_n": 1.0, "free_power_w": 1.0}


def cells(name: str, found: dict[str, float], units: dict[str, float]) -> str:
    """Return a row: predicted, published and the error in per cent; a cell is empty where nothing is published."""
    row = [name]
    for key, unit in units.items():
        published = MOTORS[name].get(key)
        if published is None:
            row.append("")
            continue
        value = f"{unit * found[key]:#.4g}".removesuffix(".")
        row.append(f"{value} / {unit * published:.4g} ({100 * (found[key] / published - 1):+.1f})")
    return "|" + "".join(f" {cell} |" if cell else " |" for cell in row)


def printed(name: str, section: str) -> list[float]:
    """Return the numbers of a motor's row in a section of the page."""
    text = PAGE.partition(f"### {section}\n")[2].partition("\n#")[0]
    (line,) = (line for line in text.splitlines() if line.startswith(f"| {name} |"))
    return numbers(line.removeprefix(f"| {name} |"))


def numbers(text: str) -> list[float]:
    """Return the numbers of a text."""
    return [float(item) for item in re.findall(r"[-+]?\d+\.?\d*", text)]


@pytest.mark.soak
def test_plates_with_the_masses_of_published_stators_miss_as_the_page_says() -> None:
    names = [name for name, motor in MOTORS.items() if "stator_kg" in motor]
    ratios = [by_mass(name)[key] / MOTORS[name][key] for key in ("force_n", "speed_m_s") for name in names]
    extremes = [f"{one:.2f}" for part in (ratios[: len(names)], ratios[len(names) :]) for one in (min(part), max(part))]
    assert not missing("measured.md", *extremes)


@pytest.mark.soak
@pytest.mark.parametrize("name", MOTORS)
def test_the_motor_of_a_published_frequency_force_and_speed_has_what_the_page_says(name: str) -> None:
    found = held_out(name)
    wanted = numbers(cells(name, found, OTHERS).removeprefix(f"| {name} |"))
    ratios = [found[key] / MOTORS[name][key] for key in OTHERS if key in MOTORS[name]]
    tolerances = [part for ratio in ratios for part in (DIGITS, 1e-9, 100 * DIGITS * ratio)]
    here = printed(name, "By frequency, force and speed")
    for index, (value, said) in enumerate(zip(wanted, here, strict=True)):
        off = {"rel": tolerances[index]} if index % 3 < 2 else {"abs": tolerances[index] + 0.051}
        assert said == pytest.approx(value, **off), cells(name, found, OTHERS)


@pytest.mark.soak
def test_the_free_tip_of_the_micro_motor_moves_as_far_as_the_page_says() -> None:
    name = "micro-motor of Morita et al."
    sheet, (motor, drive) = MOTORS[name], by_sheet(name)
    # force over preload is the friction where the contact slides throughout, as it does at stall
    friction = motor.contact.friction * motor.contact.preload_n / sheet["preload_n"]
    slipping, _ = by_sheet(name, friction=friction)
    assert slipping.contact.preload_n == pytest.approx(sheet["preload_n"], rel=0.01)
    found = [1e9 * peak_to_peak_m(one, drive, sheet["tip"]["voltage"]) for one in (motor, slipping)]
    said = re.search(r"moves (\S+) nm .*? of (\S+) that .*?\s(\S+) nm, published are (\S+) nm", PAGE, re.S)
    assert said
    assert [float(item) for item in said.groups()] == pytest.approx([found[0], friction, found[1], 58.0], rel=DIGITS)
