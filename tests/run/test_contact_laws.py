# SPDX-License-Identifier: GPL-3.0-or-later
"""The motor by each contact law, against one whose contact is a row of 200 elements (``tests/reference/row.py``)."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law
from pyspice_runner.circuit.motor import motor_library
from pyspice_runner.cli import run as command
from pyspice_runner.run.waveforms import Waveforms
from pyspice_runner.steady.speed_torque import held_point
from tests.circuit.batch import measured
from tests.reference.row import Array, run_motor
from tests.runs import simulated
from tests.selection import mostly

pytestmark = pytest.mark.xdist_group("impact")

MOTOR = pr.load_motor("andersen2002").updated({"mount": None})
DURATION = 1e-3
DRIVES = {
    "stick": pr.TwoPhaseDrive(voltage=10.0, frequency=51.7e3),
    "slip": pr.TwoPhaseDrive(voltage=50.0, frequency=51.7e3),
    "hammers": pr.TwoToneDrive(voltage_1=100.0, frequency_1=18e3, voltage_2=50.0, frequency_2=54e3, phase_deg=165.0),
}


@cache
def exact(name: str) -> dict[str, Array]:
    drive = DRIVES[name]
    return run_motor(MOTOR.to_dict(), drive.tones_a, drive.tones_b, duration=DURATION, step=2e-8)


@cache
def ours(name: str, law: str, sliders: int | None = None) -> Waveforms:
    return simulated(MOTOR, DRIVES[name], duration=DURATION, contact=Law(law, sliders))


def path_error(name: str, law: str, sliders: int | None = None) -> float:
    """RMS distance of the tip from the reference's, relative to the RMS of its own motion."""
    reference, run = exact(name), ours(name, law, sliders)
    away, motion = 0.0, 0.0
    for column in ("tip_x_m", "tip_y_m"):
        values = reference[column]
        away += np.mean((CubicSpline(run.time_s, getattr(run, column))(reference["time_s"]) - values) ** 2)
        motion += np.mean((values - values.mean()) ** 2)
    return float(np.sqrt(away / motion))


def speed_error(name: str, law: str, sliders: int | None = None) -> float:
    """Error of the rotor's speed at the end, relative to the greatest speed."""
    speed = exact(name)["rotor_speed_rad_s"]
    return float(abs(ours(name, law, sliders).rotor_speed_rad_s[-1] - speed[-1]) / np.abs(speed).max())


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, DRIVES, ["hammers"]))
def test_brush_follows_the_row_of_elements(name: str) -> None:
    # eight sliders over four times the static penetration; where all sticks and only the edge slips they are coarse
    assert path_error(name, "brush") < (0.02 if name == "stick" else 0.002)  # measured 0.015; 0.0008 to 0.0013
    assert speed_error(name, "brush") < (0.1 if name == "stick" else 0.01)
    if name == "stick":
        assert path_error(name, "brush", 16) < 0.005


def test_the_papers_law_is_off_by_what_partial_slip_takes() -> None:
    for name, least, greatest in (("stick", 0.10, 0.20), ("slip", 0.01, 0.03), ("hammers", 0.02, 0.06)):
        assert least < path_error(name, "spring-slider") < greatest, name  # measured 0.15, 0.02, 0.04


def test_without_a_tangential_spring_the_rotor_turns_otherwise() -> None:
    assert exact("hammers")["rotor_speed_rad_s"][-1] > 0.5
    assert ours("hammers", "coulomb").rotor_speed_rad_s[-1] < 0.0


@pytest.mark.parametrize("law", ["spring-slider", "brush", "coulomb"])
def test_energy_balances_by_every_law_also_with_loss_in_impacts(law: str) -> None:
    run = ours("hammers", law)
    assert run.energy_residual < 1e-4
    assert run.energy.contact_damping == pytest.approx(0.0, abs=1e-6 * run.energy.electrical)
    lossy = MOTOR.updated({"contact.restitution": 0.7})
    damped = simulated(lossy, DRIVES["hammers"], duration=DURATION, contact=law)
    assert damped.energy_residual < 1e-4
    assert damped.energy.contact_damping > 0.05 * damped.energy.electrical


def test_friction_takes_more_from_a_brush_that_sticks_than_from_the_spring() -> None:
    brush, spring = (ours("stick", law).energy.friction for law in ("brush", "spring-slider"))
    assert brush > 3 * max(spring, 0.0)
    assert brush > 0.0


def test_state_of_a_brush_lies_between_stick_and_slip() -> None:
    state = ours("stick", "brush").contact_state
    assert set(np.unique(np.rint(state))) <= {1.0, 2.0}
    partial = (state > 1.001) & (state < 1.999)
    assert partial.mean() > 0.2
    fractions = ours("stick", "brush").state_fractions
    assert sum(fractions.values()) == pytest.approx(1.0)
    assert fractions["stick"] > 0.9  # where less than half of the contact slips, it sticks
    assert ours("stick", "coulomb").contact_displacement_m.any() == np.False_


# --- stall torque and no-load speed, as docs/contact.md has them ---

PAGE = Path(__file__).parents[2] / "docs" / "contact.md"


@cache
def torque(law: str, speed: float = 0.0) -> float:
    point = held_point(MOTOR, DRIVES["hammers"], speed=speed, contact=law)
    assert point["settled"]
    return float(point["torque_n_m"])


def test_stall_torque_of_the_brush_is_that_of_the_row_of_elements() -> None:
    drive, motor = DRIVES["hammers"], MOTOR.to_dict()
    motor["rotor"] = motor["rotor"] | {"inertia_kg_m2": 1e6}  # it stands
    found = run_motor(motor, drive.tones_a, drive.tones_b, duration=8e-3, step=2e-8)
    last = found["time_s"] > 8e-3 - 36 * drive.period
    stall = motor["rotor"]["radius_m"] * float(found["friction_force_n"][last].mean())
    assert torque("brush") == pytest.approx(stall, rel=2e-3)  # eight sliders; measured 1e-4
    assert torque("spring-slider") == pytest.approx(1.09 * stall, rel=0.01)
    assert torque("coulomb") < 0.0


@pytest.mark.parametrize("law", ["spring-slider", "brush", "coulomb"])
def test_page_has_the_torque_and_the_efficiency_of_the_flagship(law: str) -> None:
    (row,) = re.findall(
        rf"^\| {law}(?:, 8)? \| (\S+) \| (\S+) \| (\S+) \| \S+ \| (\S+) \|$", PAGE.read_text("utf-8"), re.M
    )
    motor = pr.load_motor("bimodal40")
    found = pr.speed_torque(motor, pr.default_drive(motor), speeds=[0.0, 20.0, 30.0], contact=law, audit=False)
    values = [*(1e3 * found["torque_n_m"].values), 100 * float(found["efficiency"][-1])]
    cells = [float(cell.replace("−", "-").replace("–", "nan")) for cell in row]  # no efficiency where it brakes
    assert cells == pytest.approx(values, abs=0.06, nan_ok=True)


def test_driver_runs_by_the_law_it_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["drive", "andersen2002", "--driver", "ideal", "--duration", "3e-4", "--json", "--contact"]
    found = {}
    for law in ("spring-slider", "coulomb", "none"):
        assert command([*words, law]) == 0
        found[law] = json.loads(capsys.readouterr().out)["mean_torque_n_m"]
    assert found["none"] == 0.0 != found["coulomb"] != pytest.approx(found["spring-slider"], rel=0.01)


@pytest.mark.parametrize("law", ["brush", "coulomb"])
def test_exported_library_runs_by_the_law_it_was_asked_for(
    law: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sliders = ["--sliders", "4"] if law == "brush" else []
    assert command(["export", "andersen2002", "--contact", law, *sliders]) == 0
    library = capsys.readouterr().out
    assert f"friction ({law})" in library
    assert ("partial slip" in library.partition("* OMITS")[2].partition("\n")[0]) == (law == "coulomb")
    (example,) = re.findall(r"^\* USE[^\n]*\n(.*?)^\* END USE$", library, re.M | re.S)
    usage = re.sub(r"^\*   ", "", example, flags=re.M)
    found = measured(f"a motor from one file\n{library}\n{usage}.end\n", tmp_path)
    run = pr.simulate(
        MOTOR,
        pr.default_drive(MOTOR),
        duration=5e-4,
        step=1e-7,
        exact_resonance=False,
        contact=Law(law, 4 if law == "brush" else None),
    )
    # the same circuit and step, but ngspice's default tolerances
    assert found["speed_rad_s"] == pytest.approx(np.interp(499e-6, run.time_s, run.rotor_speed_rad_s), rel=0.01)
    with pytest.raises(pr.ParameterError, match=r"contact = None \(free tip\) is not valid here"):
        motor_library(MOTOR, contact=None)
