# SPDX-License-Identifier: GPL-3.0-or-later
"""A contact law of the user's own: the tutorial's steps, and what is not accepted in such a file."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.circuit.law import Law, contact_library
from pyspice_runner.cli import run
from pyspice_runner.spice.library import data_path, read_library
from tests.selection import mostly

PAGE = Path(__file__).parents[2] / "docs" / "tutorial_contact_law.md"
EVERY_EFFECT = Path(__file__).parents[1] / "data" / "every_effect.toml"
DRIVE = pr.TwoPhaseDrive(voltage=100.0, frequency=51.7e3, phase_deg=90.0)


def tutorial_law() -> str:
    (law,) = re.findall(r"^```spice\n(\* my_law:.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    return str(law)


@pytest.fixture
def law(tmp_path: Path) -> Path:
    path = tmp_path / "my_law.lib"
    path.write_text(tutorial_law(), encoding="ascii")
    return path


@pytest.mark.soak
def test_the_commands_of_the_tutorial_run(
    law: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(law.parent)
    commands = re.findall(r"^    piezomotor (.+)$", PAGE.read_text(encoding="utf-8"), re.M)
    assert {command.split()[0] for command in commands} == {"simulate", "speed-torque", "export"}
    for command in commands:
        assert run([*command.split(), "--json"]) == 0, command
        assert json.loads(capsys.readouterr().out)


def test_with_no_fall_the_law_of_the_tutorial_is_coulombs(law: Path) -> None:
    motor = pr.load_motor("andersen2002")
    constant = law.with_name("constant.lib")
    constant.write_text(tutorial_law().replace("fall=0.4", "fall=0").replace("1        0.4 ", "1        0 "))
    runs = [pr.simulate(motor, DRIVE, duration=3e-4, contact=name) for name in (str(constant), "coulomb", str(law))]
    own, coulomb, falling = (wave.rotor_speed_rad_s for wave in runs)
    np.testing.assert_allclose(own, coulomb, atol=1e-6 * np.abs(coulomb).max())
    assert np.abs(falling - coulomb).max() > 0.01 * np.abs(coulomb).max()
    for wave in runs:  # of a law that the package does not know, too
        assert abs(wave.energy_residual) < 1e-3


@pytest.mark.parametrize(
    "name",
    mostly(pytest.mark.soak, ["piezomotor_contact", "piezomotor_brush", "piezomotor_coulomb"], ["piezomotor_contact"]),
)
def test_a_copy_of_a_built_in_law_gives_the_same(name: str, tmp_path: Path) -> None:
    """Also at the end of a run in blocks, which hands the state of the contact from block to block."""
    path = tmp_path / "copy.lib"
    text = (data_path("behavioral") / f"{name}.lib").read_text(encoding="ascii")
    path.write_text(text.replace(name, "copied"))
    built_in = {"piezomotor_contact": "spring-slider", "piezomotor_brush": "brush", "piezomotor_coulomb": "coulomb"}
    damping = {f"modes.{mode}.damping_n_s_per_m": 200.0 for mode in range(2)}  # short blocks
    motor = pr.load_motor("andersen2002").updated({"mount": None, **damping})
    own, known = (
        pr.speed_torque(motor, DRIVE, speeds=[1.0], mode="settle", contact=law, tolerance=0.1, patience=4)
        for law in (str(path), built_in[name])
    )
    for quantity in ("torque_n_m", "normal_force_n", "power_a_w", "slip"):
        np.testing.assert_allclose(own[quantity], known[quantity], rtol=1e-6, err_msg=quantity)


@pytest.mark.parametrize("name", mostly(pytest.mark.soak, ["bimodal40", str(EVERY_EFFECT)], ["bimodal40"]))
def test_a_copy_of_the_law_without_a_spring_gives_the_same_results(name: str, tmp_path: Path) -> None:
    """Free, held and in the steady state, on a worn tip and with compliances in series; the file has a BOM."""
    path = tmp_path / "copy.lib"
    text = (data_path("behavioral") / "piezomotor_coulomb.lib").read_text(encoding="ascii")
    path.write_text(text.replace("piezomotor_coulomb", "copied"), encoding="utf-8-sig")
    motor = pr.load_motor(name)
    drive, laws = pr.default_drive(motor), (str(path), "coulomb")
    for load in ({}, {"speed": 2.0}):
        own, known = (pr.simulate(motor, drive, duration=1e-4, contact=law, **load) for law in laws)
        for column in ("rotor_speed_rad_s", "friction_force_n", "current_a_a"):
            found, expected = getattr(own, column), getattr(known, column)
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    held = [pr.steady_state(motor, drive, speed=2.0, contact=law) for law in laws]
    assert all(state.converged for state in held)
    assert held[0].torque_n_m == pytest.approx(held[1].torque_n_m, rel=1e-9)


def test_a_law_states_where_it_stores_what(law: Path, tmp_path: Path) -> None:
    assert Law("brush", 3).states == ("xcontact.q1", "xcontact.q2", "xcontact.q3")
    assert Law("coulomb").states == ()
    slider = tmp_path / "slider.lib"
    slider.write_text(
        tutorial_law().replace("Rslider slider 0 1\n", "Cslider slider 0 1u\nCage age 0 1u\nRage age 0 1\n")
    )
    assert Law(str(slider)).states == ("slider", "xcontact.age")
    assert contact_library(Law(str(law))).needs == ("piezomotor_normal",)
    assert read_library("piezomotor_normal").name == "piezomotor_normal"


def put(line: str) -> Callable[[str], str]:
    return lambda text: text.replace("Rslip slip 0 1\n", f"Rslip slip 0 1\n{line}\n")


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (lambda _: "", "must hold one subcircuit, from .subckt NAME x y vx vy fx fy shaft normal friction"),
        (lambda text: text + text, "it has 2 .subckt and 2 .ends."),
        (lambda text: text + ".control\nshell touch hacked\n.endc\n", "'.control' is outside of the subcircuit"),
        (put(".control"), "'.control' is not allowed: only .param, and .model of type D, SW or CSW"),
        (put(".include /etc/passwd"), "'.include /etc/passwd' is not allowed"),
        (put(".global a"), "'.global a' is not allowed"),
        (put("A1 %v([a]) %d([b]) process"), "elements begin with one of"),
        (put(".model m d_process (process_file=a)"), "a law reads no files and needs no quotes"),
        (put("V1 a 0 PWL file=a.txt"), "a law reads no files and needs no quotes"),
        (put("X1 a b other"), "other is not in the file; name it in a line '* NEEDS piezomotor_normal'"),
        (put("R1 a 0 {depth}"), "the expression reads depth, which is not a parameter of the law"),
        (put("C1 a 0 1u ic=1"), "remove ic=; a run starts with no voltage there"),
        (put("R1 a 0 1 ; µ"), "only ASCII characters are allowed"),
        (put("R1 a 0 1\x07"), "it has a control character"),
        (lambda text: text.replace("x y vx vy", "y x vx vy", 1), "they must be x y vx vy fx fy shaft normal friction"),
        (lambda text: text.replace(" preload=5", "", 1).replace("* PAR  preload", "* WAS  preload"), "preload"),
        (lambda text: text.replace("mu=0.3", "mu={3}", 1), "parameter mu: '{3}' is not a SPICE number."),
        (lambda text: text.replace("fall=0.4", "fall=0.5", 1), "fall is 0.5 here and 0.4 in its PAR line"),
        (lambda text: text.replace(".ends my_law", ".ends your_law"), "'.ends your_law' does not end .subckt my_law"),
        (lambda text: text.replace("NEEDS  piezomotor_normal", "NEEDS  nothing"), "NEEDS names 'nothing', which is"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_law_is_an_error_that_names_the_line(
    damage: Callable[[str], str], sentence: str, law: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    damaged = damage(tutorial_law())
    assert damaged != tutorial_law()
    law.write_text(damaged, encoding="utf-8")
    with pytest.raises(pr.ParameterError) as caught:
        pr.simulate(pr.load_motor("andersen2002"), DRIVE, duration=1e-4, contact=str(law))
    assert sentence in str(caught.value)
    assert str(law) in str(caught.value)
    assert not (tmp_path / "hacked").exists()


@pytest.mark.parametrize(
    ("contact", "sentence"),
    [
        ("absent.lib", "No such file or directory. Give the path of a .lib file."),
        ("/dev/zero.lib", "Cannot read the contact law '/dev/zero.lib'"),
    ],
)
def test_a_law_that_does_not_exist_is_an_error(contact: str, sentence: str) -> None:
    with pytest.raises(pr.ParameterError, match=re.escape(sentence)):
        pr.simulate(pr.load_motor("andersen2002"), DRIVE, duration=1e-4, contact=contact)


def test_a_law_without_damping_cannot_take_a_coefficient_of_restitution(law: Path) -> None:
    text = re.sub(r"^\* PAR  damping.*\n", "", tutorial_law().replace(" damping={damping}", ""), flags=re.M)
    law.write_text(text.replace(" damping=0", ""), encoding="utf-8")
    motor = pr.load_motor("andersen2002").updated({"contact.restitution": 0.8})
    with pytest.raises(pr.ParameterError, match=r"has no parameter damping\. Set contact.restitution to 1"):
        pr.simulate(motor, DRIVE, duration=1e-4, contact=str(law))
