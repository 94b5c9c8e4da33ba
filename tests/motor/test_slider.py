# SPDX-License-Identifier: GPL-3.0-or-later
"""A motor with a slider: its document, its rotor of radius 1 m, and its limits."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

import pyspice_runner as pr
from pyspice_runner.motor import contact as law
from pyspice_runner.motor.drive import Load, check_together, too_fast
from pyspice_runner.motor.load import SETS
from pyspice_runner.motor.motor import Motor
from pyspice_runner.motor.parameters import Rotor, Slider
from tests.motors import motor as rotary

STAGE = {"mass_kg": 0.2, "guide_damping_n_s_per_m": 0.4, "guide_friction_n": 0.3, "guide_presliding_m": 2e-5}


def stage(**changes: float) -> Motor:
    """A motor off the defaults with a slider."""
    parts = {name: getattr(rotary(), name) for name in ("name", "modes", "piezo", "contact")}
    return Motor(**parts, slider=Slider(**(STAGE | changes)))


def test_a_slider_moves_as_a_rotor_of_radius_1_m() -> None:
    assert stage().rotor == Rotor(
        radius_m=1.0,
        inertia_kg_m2=0.2,
        bearing_damping_n_m_s=0.4,
        bearing_friction_n_m=0.3,
        bearing_presliding_rad=2e-5,
    )


def test_the_document_states_the_slider_in_place_of_the_rotor() -> None:
    document = stage().to_dict()
    assert document["slider"] == STAGE
    assert "rotor" not in document
    assert "slider" not in rotary().to_dict()


def test_a_motor_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    motor = stage()
    file = tmp_path / "stage.toml"
    file.write_text(motor.to_toml(), encoding="utf-8")
    assert pr.load_motor(file).to_dict() == motor.to_dict()
    assert "rotor" not in tomllib.loads(file.read_text(encoding="utf-8"))


def test_paths_of_the_slider_change_the_rotor_too() -> None:
    changed = stage().updated({"slider.mass_kg": 0.5, "slider.guide_friction_n": 0.0})
    assert changed.slider.mass_kg == changed.rotor.inertia_kg_m2 == 0.5
    assert changed.dry_friction == ("slider.guide_friction_n", 0.0, "N")


@pytest.mark.parametrize(
    ("motor", "changes", "reason"),
    [
        (stage(), {"rotor.radius_m": 0.1}, "There is no parameter 'rotor.radius_m'."),
        (rotary(), {"slider.mass_kg": 0.1}, "There is no parameter 'slider.mass_kg'."),
        (stage(), {"slider.mas_kg": 0.1}, "Did you mean 'slider.mass_kg'?"),
        (stage(), {"slider.mass_kg": 2e3}, "slider.mass_kg = 2000 kg is not valid: it must be a number > 1e-12 and"),
        (stage(), {"contact.preload_n": 9e4}, "presses the tip 0.00183 m into the slider; at most 0.001 m is allowed"),
        (stage(), {"slider.mass_kg": 1e-9}, "the tip, the slider or the carrier has too little mass"),
    ],
)
def test_a_mistake_is_named(motor: Motor, changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(pr.ParameterError) as refused:
        motor.updated(changes)
    assert reason in str(refused.value)


def test_a_motor_has_a_rotor_or_a_slider() -> None:
    parts = {name: getattr(rotary(), name) for name in ("name", "modes", "piezo", "contact", "rotor")}
    with pytest.raises(ValueError, match="a motor has a rotor or a slider, not both: specify one of them"):
        Motor(**parts, slider=Slider(**STAGE))


def test_a_slider_is_held_at_no_speed_that_no_tip_reaches() -> None:
    Load(100.0).check(stage())
    with pytest.raises(pr.ParameterError, match=r"speed = 101 m/s is not valid for the slider of .* -100 to 100 m/s"):
        Load(101.0).check(stage())
    assert too_fast(stage().to_dict(), 99.0) == ()
    assert too_fast(stage().to_dict(), -101.0) == (
        "The slider moves at -101 m/s; the limit is 100 m/s, at which a stator breaks. Lower the load.",
    )
    with pytest.raises(pr.ParameterError, match=r"load_torque = 2e\+06 N is not valid: it must be from -1e6 to 1e6 N"):
        Load(torque=2e6).check(stage())


def test_a_drive_may_not_move_the_tip_to_where_the_rotor_of_the_model_is_not_flat() -> None:
    drive = pr.TwoPhaseDrive(voltage=2e3, frequency=22e3)
    with pytest.raises(pr.ParameterError, match="within which the model's slider is flat") as refused:
        check_together(stage(), drive)
    # x²/2R at the limit is a twentieth of the penetration
    limit = float(str(refused.value).partition("the limits are ")[2].partition(" m,")[0])
    assert 0.5 * limit**2 == pytest.approx(0.05 * law.static_penetration(stage().contact), rel=5e-3)  # three digits


def test_a_flat_slider_has_the_radius_of_the_tip_as_effective_radius(tmp_path: Path) -> None:
    text = (SETS / "andersen2002.toml").read_text(encoding="utf-8")
    head, _, tail = text.partition("[rotor]")
    rest = tail.partition("\n[")[2]
    file = tmp_path / "stage.toml"
    file.write_text(f"{head}[slider]\nmass_kg = 0.1\nguide_damping_n_s_per_m = 0.1\n\n[{rest}", encoding="utf-8")
    materials = tomllib.loads(text)["contact"]["materials"]
    values = {key: item["value"] if isinstance(item, dict) else item for key, item in materials.items()}
    modulus = law.effective_modulus(
        values["tip_youngs_modulus_pa"], values["tip_poisson"],
        values["rotor_youngs_modulus_pa"], values["rotor_poisson"],
    )  # fmt: skip
    stiffness = law.normal_stiffness(modulus, values["tip_radius_m"])
    assert pr.load_motor(file).contact.normal_stiffness_n_per_m15 == pytest.approx(stiffness, rel=1e-14)
